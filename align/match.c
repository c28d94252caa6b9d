// Product-space matching (docs/method.md "Maps"; after ZoomOut, Melzi et al. 2019, and
// product manifold filters, Vestner et al. 2017): nearest neighbours of [Phi_o | a y | w S_o] to
// [Phi_e C^T | a x_e | w S_e] while the number of functions kk rises.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

enum { FIRST_FUNCTIONS = 3, POLISH_ROUNDS = 4 };
// Weight of the landmarks' splines: 1 was better than 2 or 4 on every pair but one.
static const double SPLINE_WEIGHT = 1;
// Landmarks pull what is near: width over the rms radius; softness of meeting them.
static const double PULL_WIDTH = 0.5, PULL_SOFT = 0.02;

typedef struct matcher {
  const ep_side *from, *to;
  const ep_match_rule *rule;
  int regions, columns; // regions that take part; these, the skin and the landmarks
  double region_rms;    // of those columns of `from`, over its volume
  double *turned;       // (to->n x 3) to's positions in from's frame
  double *base;         // (from->n x 3) from's positions, warped by landmarks
  double *smooth;       // (from->n x 3) those positions moved by the kk-mode displacement
  double *image;        // (from->n x max(k, 3)) values of `to` at p
  double *query, *target, *lead, *c, *d;
  double *pull, *gram, *marks; // landmarks: coefficients, their matrix, turned points of `to`
  ep_point_map points;         // while polishing: the map, to points in tets; NULL before
} matcher;

static void free_matcher(matcher *w) {
  free(w->turned);
  free(w->base);
  free(w->smooth);
  free(w->image);
  free(w->query);
  free(w->target);
  free(w->lead);
  free(w->c);
  free(w->d);
  free(w->pull);
  free(w->gram);
  free(w->marks);
}

static double root_mean_square(const ep_side *side, const unsigned char *use) {
  double sum = 0;
  for (int g = 0; g < side->regions; g++) {
    if (use && !use[g]) continue;
    double mean = 0, square = 0;
    for (int i = 0; i < side->n; i++) {
      const double v = side->region[(size_t)i * side->regions + g];
      mean += side->share[i] * v;
      square += side->share[i] * v * v;
    }
    sum += square - mean * mean;
  }
  return sqrt(fmax(sum, 1e-12));
}

static ep_status make_matcher(const ep_side *from, const ep_side *to, const double r[9],
                              const ep_match_rule *rule, matcher *w, ep_error *err) {
  memset(w, 0, sizeof *w);
  w->from = from;
  w->to = to;
  w->rule = rule;
  if (rule->region_weight > 0 && from->regions == to->regions)
    for (int g = 0; g < from->regions; g++) w->regions += !rule->use || rule->use[g];
  if (w->regions) w->region_rms = root_mean_square(from, rule->use);
  const size_t nf = (size_t)from->n, nt = (size_t)to->n, k = (size_t)from->k;
  w->columns = w->regions + 1 + (rule->mark_weight > 0 ? from->marks : 0);
  const size_t wide = k > 3 ? k : 3, d = (size_t)rule->k + 3 + (size_t)w->columns;
  const size_t marks = (size_t)from->marks;
  w->turned = malloc(3 * nt * sizeof(double));
  w->base = malloc(3 * nf * sizeof(double));
  w->smooth = malloc(3 * nf * sizeof(double));
  w->image = malloc(wide * nf * sizeof(double));
  w->query = malloc(d * nf * sizeof(double));
  w->target = malloc(d * nt * sizeof(double));
  w->lead = malloc((size_t)rule->k * nt * 2 * sizeof(double));
  w->c = malloc(2 * k * k * sizeof(double));
  w->d = malloc(3 * k * sizeof(double));
  w->pull = malloc((3 * marks + 1) * sizeof(double));
  w->gram = malloc((marks * marks + 1) * sizeof(double));
  w->marks = malloc((3 * marks + 1) * sizeof(double));
  if (!w->pull || !w->gram || !w->marks || !w->turned || !w->base || !w->smooth || !w->image ||
      !w->query || !w->target || !w->lead || !w->c || !w->d) {
    free_matcher(w);
    return ep_fail(err, EP_ERR_MEMORY, "no memory to match %d with %d vertices", from->n, to->n);
  }
  ep_frame_apply(to->n, r, to->x, w->turned);
  if (marks) ep_frame_apply(to->marks, r, to->mark_x, w->marks);
  const ep_status status = ep_side_warp(from, w->marks, w->base, err);
  memcpy(w->smooth, w->base, 3 * nf * sizeof(double));
  if (status != EP_OK) free_matcher(w);
  return status;
}

static double bump(const ep_side *side, const double *a, const double *b) {
  const double s2 = PULL_WIDTH * PULL_WIDTH * side->radius * side->radius;
  double d2 = 0;
  for (int c = 0; c < 3; c++) d2 += (a[c] - b[c]) * (a[c] - b[c]);
  return exp(-0.5 * d2 / s2);
}

// Move the displaced positions by a sum of Gaussians, so that landmarks come to their partners.
static ep_status pull_to_marks(matcher *w, ep_error *err) {
  const ep_side *from = w->from;
  const int count = from->marks;
  if (w->rule->mark_weight <= 0 || !count) return EP_OK;
  for (int i = 0; i < count; i++) {
    const double *x = from->mark_x + 3 * i;
    const size_t near = 3 * (size_t)from->mark_near[i];
    for (int j = 0; j < count; j++)
      w->gram[i * count + j] = bump(from, x, from->mark_x + 3 * j) + (i == j ? PULL_SOFT : 0);
    for (int c = 0; c < 3; c++)
      w->pull[3 * i + c] = w->marks[3 * i + c] - x[c] - (w->smooth[near + c] - from->x[near + c]);
  }
  EP_TRY(ep_solve_spd(count, w->gram, 3, w->pull, err));
  for (int v = 0; v < from->n; v++)
    for (int i = 0; i < count; i++) {
      const double g = bump(from, from->x + 3 * (size_t)v, from->mark_x + 3 * i);
      for (int c = 0; c < 3; c++) w->smooth[3 * (size_t)v + c] += g * w->pull[3 * i + c];
    }
  return EP_OK;
}

ep_status ep_match_functional(const ep_side *from, const ep_side *to, const int *p, double *c,
                              ep_error *err) {
  const int k = from->k;
  double *image = malloc((size_t)from->n * k * sizeof *image);
  if (!image) return ep_fail(err, EP_ERR_MEMORY, "no memory for a functional map");
  for (int i = 0; i < from->n; i++)
    memcpy(image + (size_t)i * k, to->phi + (size_t)p[i] * k, (size_t)k * sizeof(double));
  ep_gemm_tn(k, k, from->n, from->mphi, image, c);
  free(image);
  return EP_OK;
}

// image (from->n x width) = values (to->n x width) where the map sends from's vertices.
static void pull(const matcher *w, const int *p, int width, const double *values, double *image) {
  const size_t row = (size_t)width;
  if (w->points.tet) {
    ep_point_map_pull(&w->points, w->from->n, w->to->shape->mesh, width, values, image);
    return;
  }
  for (size_t i = 0; i < (size_t)w->from->n; i++)
    memcpy(image + i * row, values + (size_t)p[i] * row, row * sizeof *image);
}

// y = b + Pi (x_e[p] - b), b the (warped) positions, Pi the projection on the constant and the
// first kk functions.
static void smooth_positions(matcher *w, int kk, const int *p) {
  const ep_side *from = w->from;
  const int k = from->k;
  double mean[3] = {0};
  pull(w, p, 3, w->turned, w->image);
  for (int i = 0; i < from->n; i++)
    for (int c = 0; c < 3; c++) {
      const double d = w->image[3 * (size_t)i + c] - w->base[3 * (size_t)i + c];
      w->image[3 * (size_t)i + c] = d;
      mean[c] += from->share[i] * d;
    }
  ep_gemm_tn(k, 3, from->n, from->mphi, w->image, w->d);
  memset(w->d + 3 * kk, 0, 3 * (size_t)(k - kk) * sizeof(double));
  ep_gemm(from->n, 3, k, from->phi, w->d, w->smooth);
  for (int i = 0; i < from->n; i++)
    for (int c = 0; c < 3; c++)
      w->smooth[3 * (size_t)i + c] += w->base[3 * (size_t)i + c] + mean[c];
}

// w->lead (to->n x kk) = Phi_to C^T with the leading kk x kk block of C.
static void functions_of_target(matcher *w, int kk, const int *p) {
  const int k = w->from->k, n = w->to->n;
  pull(w, p, k, w->to->phi, w->image);
  ep_gemm_tn(k, k, w->from->n, w->from->mphi, w->image, w->c);
  double *block = w->c + (size_t)k * k, *first = w->lead + (size_t)n * kk;
  for (int a = 0; a < kk; a++) memcpy(block + a * kk, w->c + a * k, (size_t)kk * sizeof(double));
  for (int i = 0; i < n; i++)
    memcpy(first + (size_t)i * kk, w->to->phi + (size_t)i * k, (size_t)kk * sizeof(double));
  ep_gemm_nt(n, kk, kk, first, block, w->lead);
}

static void fill(const matcher *w, const ep_side *side, const double *phi, int stride, int kk,
                 const double *x, double *out) {
  const double level = sqrt(kk > 0 ? (double)kk : 1);
  const double a = w->rule->gamma * level / w->from->radius;
  const double b = w->regions ? w->rule->region_weight * level / w->region_rms : 0;
  const double ball = side->marks ? w->rule->mark_weight / sqrt(side->marks) : 0;
  const double e = level * (side->splines ? SPLINE_WEIGHT : ball);
  for (int i = 0; i < side->n; i++) {
    for (int f = 0; f < kk; f++) *out++ = phi[(size_t)i * stride + f];
    for (int c = 0; c < 3; c++) *out++ = a * x[3 * (size_t)i + c];
    for (int g = 0; g < side->regions && w->regions; g++)
      if (!w->rule->use || w->rule->use[g])
        *out++ = b * side->region[(size_t)i * side->regions + g];
    for (int m = 0; m < w->columns - w->regions - 1; m++)
      *out++ = e * side->mark[(size_t)i * side->marks + m];
    *out++ = w->rule->skin_weight * level * side->skin[i];
  }
}

static ep_status match_level(matcher *w, int kk, int *p, ep_error *err) {
  if (kk > 0) {
    functions_of_target(w, kk, p);
    smooth_positions(w, kk, p);
  }
  EP_TRY(pull_to_marks(w, err));
  fill(w, w->from, w->from->phi, w->from->k, kk, w->smooth, w->query);
  fill(w, w->to, w->lead, kk, kk, w->turned, w->target);
  ep_tree *tree;
  EP_TRY(ep_tree_make(w->to->n, kk + 3 + w->columns, w->target, &tree, err));
  ep_tree_nearest(tree, w->from->n, w->query, p);
  ep_tree_free(tree);
  return EP_OK;
}

// Rounds at the last level with points in tets: without the noise of vertices.
static ep_status polish(matcher *w, int *p, int *tet, double *weight, ep_error *err) {
  const int d = w->rule->k + 3 + w->columns;
  const ep_mesh *mesh = w->to->shape->mesh;
  EP_TRY(ep_points_project(mesh, d, w->target, w->from->n, w->query, p, tet, weight, err));
  w->points = (ep_point_map){p, tet, weight};
  for (int round = 0; round < POLISH_ROUNDS; round++) {
    EP_TRY(match_level(w, w->rule->k, p, err));
    EP_TRY(ep_points_project(mesh, d, w->target, w->from->n, w->query, p, tet, weight, err));
  }
  return EP_OK;
}

ep_status ep_match_levels(const ep_side *from, const ep_side *to, const double r[9],
                          const ep_match_rule *rule, int *p, int *tet, double *weight,
                          ep_error *err) {
  if (from->k != to->k || rule->k > from->k || rule->step < 1)
    return ep_fail(err, EP_ERR_ARGUMENT, "matching with %d of %d and %d functions", rule->k,
                   from->k, to->k);
  matcher w;
  EP_TRY(make_matcher(from, to, r, rule, &w, err));
  ep_status status = EP_OK;
  if (!rule->refine) {
    for (int i = 0; i < from->n; i++) p[i] = -1;
    status = match_level(&w, 0, p, err);
  }
  int first = rule->k < FIRST_FUNCTIONS ? rule->k : FIRST_FUNCTIONS;
  if (rule->refine) first = rule->first ? rule->first : rule->k;
  for (int kk = first; kk <= rule->k && status == EP_OK;
       kk = kk < rule->k && kk + rule->step > rule->k ? rule->k : kk + rule->step)
    status = match_level(&w, kk, p, err);
  if (status == EP_OK && tet) status = polish(&w, p, tet, weight, err);
  free_matcher(&w);
  return status;
}

// The nearest points to those of from's vertices that are on the boundary (or those inside). A
// vertex of the boundary goes to the boundary; one inside may go anywhere, also close to it.
static ep_status match_layer(matcher *w, bool boundary, ep_point_map *map, ep_error *err) {
  const ep_side *from = w->from, *to = w->to;
  const int d = 3 + w->columns;
  int *vertex = malloc((size_t)from->n * sizeof *vertex), count = 0;
  ep_point_map part = {0};
  ep_tree *tree = NULL;
  ep_status status = vertex ? ep_point_map_make(from->n, &part, err)
                            : ep_fail(err, EP_ERR_MEMORY, "no memory for %d points", from->n);
  if (status == EP_OK) {
    fill(w, from, from->phi, from->k, 0, w->smooth, w->query);
    fill(w, to, NULL, 0, 0, w->turned, w->target);
    for (int i = 0; i < from->n; i++) {
      if ((from->skin[i] > 0) != boundary) continue;
      memmove(w->query + (size_t)count * d, w->query + (size_t)i * d, (size_t)d * sizeof(double));
      part.p[count] = map->p[i];
      vertex[count++] = i;
    }
    status = ep_tree_make(to->n, d, w->target, &tree, err);
  }
  if (status == EP_OK) {
    ep_tree_nearest(tree, count, w->query, part.p);
    status = ep_points_project(to->shape->mesh, d, w->target, count, w->query, part.p, part.tet,
                               part.weight, err);
  }
  for (int i = 0; i < count && status == EP_OK; i++) {
    map->p[vertex[i]] = part.p[i];
    map->tet[vertex[i]] = part.tet[i];
    memcpy(map->weight + 4 * (size_t)vertex[i], part.weight + 4 * (size_t)i, 4 * sizeof(double));
  }
  ep_tree_free(tree);
  ep_point_map_free(&part);
  free(vertex);
  return status;
}

ep_status ep_match_positions(const ep_side *from, const ep_side *to, const double r[9],
                             const ep_match_rule *rule, const double *y, ep_point_map *map,
                             ep_error *err) {
  ep_side bare_from = *from, bare_to = *to;
  ep_match_rule bare = *rule;
  matcher w;
  bare_from.marks = bare_to.marks = 0;
  bare_from.splines = bare_to.splines = false;
  bare.mark_weight = 0;
  EP_TRY(make_matcher(&bare_from, &bare_to, r, &bare, &w, err));
  memcpy(w.smooth, y, 3 * (size_t)from->n * sizeof *y);
  ep_status status = match_layer(&w, true, map, err);
  bare.skin_weight = 0;
  if (status == EP_OK) status = match_layer(&w, false, map, err);
  free_matcher(&w);
  return status;
}

ep_status ep_match_plain(const ep_side *from, const ep_side *to, const double r[9], int *p,
                         int *tet, double *weight, ep_error *err) {
  double *turned = malloc(3 * (size_t)to->n * sizeof *turned);
  if (!turned) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d points", to->n);
  ep_frame_apply(to->n, r, to->x, turned);
  ep_tree *tree = NULL;
  ep_status status = ep_tree_make(to->n, 3, turned, &tree, err);
  if (status == EP_OK) {
    for (int i = 0; i < from->n; i++) p[i] = -1;
    ep_tree_nearest(tree, from->n, from->x, p);
    if (tet)
      status = ep_points_project(to->shape->mesh, 3, turned, from->n, from->x, p, tet, weight, err);
  }
  free(turned);
  ep_tree_free(tree);
  return status;
}

double ep_match_cycle(const ep_side *from, const int *p, const int *back) {
  double sum = 0;
  for (int i = 0; i < from->n; i++) {
    const double *a = from->x + 3 * (size_t)i, *b = from->x + 3 * (size_t)back[p[i]];
    double d2 = 0;
    for (int c = 0; c < 3; c++) d2 += (a[c] - b[c]) * (a[c] - b[c]);
    sum += from->share[i] * d2;
  }
  return sqrt(sum) / from->radius;
}
