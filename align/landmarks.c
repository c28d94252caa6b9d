// Landmarks: where they lie on a side, and a smooth function of each, a further coordinate of the
// product space: bumps of one to three, splines (spline.c) of four and more.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"

// Fewer landmarks leave most of a shape to extrapolation: measured, splines of two took a fish's
// map from 6 to 11 per cent, of four from 6.7 to 4.3.
enum { SPLINES_FROM = 4 };
// A landmark's ball, over V^(1/3); blurred like a region, but wider.
static const double BALL = 0.12, MARK_BLUR = 0.25;
// A point farther from the mesh than this share of its diagonal is a mistake.
static const double MARK_OUTSIDE = 0.1;

static ep_status mark_vertex(const ep_side *side, int number, int vertex, int *near, double x[3],
                             ep_error *err) {
  if (vertex >= side->n)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "landmark %d: vertex %d of %s, which has %d vertices (counted from 0)",
                   number + 1, vertex, side->shape->mesh->name, side->n);
  *near = vertex;
  memcpy(x, side->x + 3 * (size_t)vertex, 3 * sizeof *x);
  return EP_OK;
}

static ep_status mark_point(const ep_side *side, const ep_tree *tree, int number,
                            const double point[3], int *near, double x[3], ep_error *err) {
  const ep_mesh *mesh = side->shape->mesh;
  double q[3], weight[4], d2 = 0;
  int tet;
  for (int c = 0; c < 3; c++) {
    if (!isfinite(point[c]))
      return ep_fail(err, EP_ERR_ARGUMENT, "landmark %d on %s is not a finite point", number + 1,
                     mesh->name);
    q[c] = (point[c] - side->centre[c]) / side->length;
  }
  *near = -1;
  ep_tree_nearest(tree, 1, q, near);
  EP_TRY(ep_points_project(mesh, 3, side->x, 1, q, near, &tet, weight, err));
  memset(x, 0, 3 * sizeof *x);
  for (int j = 0; j < 4; j++)
    for (int c = 0; c < 3; c++)
      x[c] += weight[j] * side->x[3 * (size_t)mesh->tet[4 * (size_t)tet + j] + c];
  for (int c = 0; c < 3; c++) d2 += (x[c] - q[c]) * (x[c] - q[c]);
  const double away = sqrt(d2) * side->length, most = MARK_OUTSIDE * ep_mesh_diagonal(mesh);
  if (away > most)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "landmark %d lies outside %s: (%g, %g, %g) is %g from the mesh, at most %g "
                   "(a tenth of the diagonal) wanted; check its units and frame",
                   number + 1, mesh->name, point[0], point[1], point[2], away, most);
  return EP_OK;
}

static ep_status place_marks(ep_side *side, int count, const ep_landmark *marks, bool is_from,
                             ep_error *err) {
  ep_tree *tree;
  EP_TRY(ep_tree_make(side->n, 3, side->x, &tree, err));
  ep_status status = EP_OK;
  for (int m = 0; m < count && status == EP_OK; m++) {
    const int vertex = is_from ? marks[m].from_vertex : marks[m].to_vertex;
    const double *point = is_from ? marks[m].from : marks[m].to;
    double *x = side->mark_x + 3 * m;
    status = vertex >= 0 ? mark_vertex(side, m, vertex, side->mark_near + m, x, err)
                         : mark_point(side, tree, m, point, side->mark_near + m, x, err);
  }
  ep_tree_free(tree);
  return status;
}

// Vertices within the ball reached from the landmark along edges inside it: a limb that merely
// lies close is left out. in_ball (n), queue (n): scratch, in_ball zero.
static void fill_ball(const ep_side *side, const double x[3], int start, int column,
                      unsigned char *in_ball, int *queue) {
  const ep_csr *mass = side->shape->mass;
  int head = 0, tail = 0;
  queue[tail++] = start;
  in_ball[start] = 1;
  while (head < tail) {
    const int v = queue[head++];
    side->mark[(size_t)v * side->marks + column] = 1;
    for (int e = mass->start[v]; e < mass->start[v + 1]; e++) {
      const int next = mass->column[e];
      double d2 = 0;
      for (int c = 0; c < 3; c++) d2 += pow(side->x[3 * (size_t)next + c] - x[c], 2);
      if (in_ball[next] || d2 > BALL * BALL) continue;
      in_ball[next] = 1;
      queue[tail++] = next;
    }
  }
  for (int i = 0; i < tail; i++) in_ball[queue[i]] = 0;
}

// Columns of mean square 1, so that a landmark in a thin limb counts as much as one in the trunk.
static void normalise(ep_side *side) {
  for (int m = 0; m < side->marks; m++) {
    double sum = 0;
    for (int i = 0; i < side->n; i++)
      sum += side->share[i] * pow(side->mark[(size_t)i * side->marks + m], 2);
    const double scale = sum > 0 ? 1 / sqrt(sum) : 0;
    for (int i = 0; i < side->n; i++) side->mark[(size_t)i * side->marks + m] *= scale;
  }
}

ep_status ep_side_landmarks(ep_side *side, int count, const ep_landmark *marks, bool is_from,
                            ep_error *err) {
  const size_t all = (size_t)side->n * count;
  side->mark = calloc(all, sizeof *side->mark);
  side->mark_x = malloc(3 * (size_t)count * sizeof *side->mark_x);
  side->mark_near = malloc((size_t)count * sizeof *side->mark_near);
  unsigned char *in_ball = calloc((size_t)side->n, 1);
  int *queue = malloc((size_t)side->n * sizeof *queue);
  ep_status status = side->mark && side->mark_x && side->mark_near && in_ball && queue
                         ? EP_OK
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for %d landmarks", count);
  if (status == EP_OK) {
    side->marks = count;
    status = place_marks(side, count, marks, is_from, err);
  }
  side->splines = count >= SPLINES_FROM;
  if (status == EP_OK && side->splines) status = ep_side_splines(side, err);
  if (status == EP_OK && !side->splines) {
    for (int m = 0; m < count; m++)
      fill_ball(side, side->mark_x + 3 * m, side->mark_near[m], m, in_ball, queue);
    status = ep_side_blur(side, MARK_BLUR, count, side->mark, err);
    if (status == EP_OK) normalise(side);
  }
  free(in_ball);
  free(queue);
  return status;
}
