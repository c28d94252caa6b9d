#include "app/bake/pose_local.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/forest.h"
#include "linalg/dense.h"

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the limits of a local pose");
}

// ---- parts outside -----------------------------------------------------------------------------

// Vertices of weight 0 that share a tet are of one part, numbered by their first vertex.
static void find_parts(ep_pose_limits *l, int *parent) {
  const ep_mesh *mesh = l->mesh;
  for (int v = 0; v < mesh->nv; v++) l->part[v] = -1;
  ep_forest_start(parent, mesh->nv);
  for (int e = 0; e < mesh->nt; e++) {
    int first = -1;
    for (int i = 0; i < 4; i++) {
      const int v = mesh->tet[4 * e + i];
      if (l->weight[v] > 0) continue;
      if (first < 0)
        first = v;
      else
        ep_forest_join(parent, v, first);
    }
  }
  for (int v = 0; v < mesh->nv; v++) {
    if (l->weight[v] > 0) continue;
    const int root = ep_forest_root(parent, v);
    if (l->part[root] < 0) l->part[root] = l->parts++;
    l->part[v] = l->part[root];
  }
}

static double square_distance(const ep_mesh *mesh, int a, int b) {
  const double *x = mesh->x + 3 * (size_t)a, *y = mesh->x + 3 * (size_t)b;
  return pow(x[0] - y[0], 2) + pow(x[1] - y[1], 2) + pow(x[2] - y[2], 2);
}

// A vertex of the soft edge that shares a tet with one of a part: it may belong to that part, too.
static int reach_vertex(const ep_pose_limits *l, int from, int to, int *next, double *edge) {
  if (l->part[from] < 0 || l->part[to] >= 0 || !(l->weight[to] < 1)) return 0;
  const double length = square_distance(l->mesh, from, to);
  if (!(length < edge[to])) return 0;
  next[to] = l->part[from];
  edge[to] = length;
  return 1;
}

// Vertices of the soft edge belong to the part nearest to them, counted in tets, and of several as
// near to the one at the shortest edge: numbers of vertices do not decide. edge (nv): scratch.
static void spread_parts(ep_pose_limits *l, int *next, double *edge) {
  const ep_mesh *mesh = l->mesh;
  for (int v = 0; v < mesh->nv; v++) edge[v] = HUGE_VAL;
  for (int changed = 1; changed;) {
    changed = 0;
    memcpy(next, l->part, (size_t)mesh->nv * sizeof *next);
    for (int e = 0; e < mesh->nt; e++)
      for (int i = 0; i < 16; i++)
        changed |= reach_vertex(l, mesh->tet[4 * (size_t)e + (size_t)(i / 4)],
                                mesh->tet[4 * (size_t)e + (size_t)(i % 4)], next, edge);
    memcpy(l->part, next, (size_t)mesh->nv * sizeof *next);
  }
}

static void find_edge(ep_pose_limits *l) {
  const ep_mesh *mesh = l->mesh;
  for (int e = 0; e < mesh->nt; e++) {
    const int *tet = mesh->tet + 4 * (size_t)e;
    double most = 0;
    for (int i = 0; i < 4; i++) most = fmax(most, l->weight[tet[i]]);
    for (int i = 0; most > 0 && i < 4; i++)
      if (l->weight[tet[i]] < 0.5) l->edge[tet[i]] = 1;
  }
}

// ---- what stays --------------------------------------------------------------------------------

// By volume. work (2 nv)
static int largest_part(const ep_pose_limits *l, double *work) {
  int best = 0;
  double *own = work, *sum = work + l->mesh->nv;
  ep_mesh_vertex_volumes(l->mesh, own);
  memset(sum, 0, (size_t)l->parts * sizeof *sum);
  for (int v = 0; v < l->mesh->nv; v++)
    if (l->part[v] >= 0) sum[l->part[v]] += own[v];
  for (int p = 1; p < l->parts; p++)
    if (sum[p] > sum[best]) best = p;
  return best;
}

static void choose_what_stays(const ep_shapes *shapes, ep_pose_limits *l, double *work) {
  for (int i = 0; i < shapes->nfixed; i++) {
    const int v = shapes->fixed[i];
    l->held[v] = 1;
    if (l->weight[v] > 0)
      l->anchor[v] = 1;
    else
      l->stays[l->part[v]] = 1;
  }
  if (shapes->nfixed == 0 && l->parts > 0) l->stays[largest_part(l, work)] = 1;
  for (int v = 0; v < l->mesh->nv; v++) {
    if (l->part[v] < 0 || !l->stays[l->part[v]]) continue;
    if (l->weight[v] == 0) l->held[v] = 1;
    if (l->edge[v]) l->anchor[v] = 1;
  }
}

ep_status ep_pose_limits_make(const ep_shapes *shapes, const double *weight, ep_pose_limits *out,
                              ep_error *err) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  const size_t nv = (size_t)mesh->nv;
  *out = (ep_pose_limits){.mesh = mesh, .weight = weight};
  out->part = malloc(nv * sizeof *out->part);
  out->stays = calloc(nv, 1);
  out->edge = calloc(nv, 1);
  out->held = calloc(nv, 1);
  out->anchor = calloc(nv, sizeof *out->anchor);
  int *work = malloc(nv * sizeof *work);
  double *sizes = malloc(2 * nv * sizeof *sizes);
  if (!out->part || !out->stays || !out->edge || !out->held || !out->anchor || !work || !sizes) {
    free(work);
    free(sizes);
    ep_pose_limits_free(out);
    return no_memory(err);
  }
  find_parts(out, work);
  spread_parts(out, work, sizes);
  find_edge(out);
  choose_what_stays(shapes, out, sizes);
  free(work);
  free(sizes);
  return EP_OK;
}

void ep_pose_limits_free(ep_pose_limits *limits) {
  free(limits->part);
  free(limits->stays);
  free(limits->edge);
  free(limits->held);
  free(limits->anchor);
  *limits = (ep_pose_limits){0};
}

// ---- limiting a pose ---------------------------------------------------------------------------

typedef struct motion {
  double r[9], from[3], to[3];
} motion;

// The rigid motion that takes points x nearest to y by weights; only a shift, where they do not
// determine a rotation, and nothing where all weights are zero.
static ep_status fit(int n, const double *x, const double *y, const double *weight, motion *out,
                     ep_error *err) {
  double total = 0;
  for (int v = 0; v < n; v++) total += weight[v];
  *out = (motion){.r = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  if (total == 0) return EP_OK;
  ep_error spread = {0};
  const ep_status status = ep_kabsch(n, x, y, weight, out->r, out->from, out->to, &spread);
  return status == EP_OK || status == EP_ERR_NUMERIC ? EP_OK
                                                     : ep_fail(err, status, "%s", spread.text);
}

static void move(const motion *m, const double *x, double *y) {
  const double d[3] = {x[0] - m->from[0], x[1] - m->from[1], x[2] - m->from[2]};
  for (int i = 0; i < 3; i++)
    y[i] = m->to[i] + m->r[3 * i] * d[0] + m->r[3 * i + 1] * d[1] + m->r[3 * i + 2] * d[2];
}

// y (nv x 3) in place, so that the anchors come nearest to rest.
static ep_status seat(const ep_pose_limits *l, double *y, double *shift, ep_error *err) {
  const int nv = l->mesh->nv;
  motion m;
  double sum = 0, count = 0;
  EP_TRY(fit(nv, y, l->mesh->x, l->anchor, &m, err));
  for (int v = 0; v < nv; v++) {
    move(&m, y + 3 * (size_t)v, y + 3 * (size_t)v);
    if (l->anchor[v] == 0) continue;
    count++;
    for (int i = 0; i < 3; i++) {
      const double d = y[3 * (size_t)v + (size_t)i] - l->mesh->x[3 * (size_t)v + (size_t)i];
      sum += d * d;
    }
  }
  *shift = count > 0 ? sqrt(sum / count) / ep_mesh_diagonal(l->mesh) : 0;
  return EP_OK;
}

// One part outside: at rest, or carried along by its edge; the soft edge blends.
static ep_status limit_part(const ep_pose_limits *l, int part, const double *y, double *weight,
                            double *u, ep_error *err) {
  const int nv = l->mesh->nv;
  motion m = {.r = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  for (int v = 0; v < nv; v++) weight[v] = l->part[v] == part && l->edge[v];
  if (!l->stays[part]) EP_TRY(fit(nv, l->mesh->x, y, weight, &m, err));
  for (int v = 0; v < nv; v++) {
    if (l->part[v] != part) continue;
    const size_t at = 3 * (size_t)v;
    double carried[3];
    move(&m, l->mesh->x + at, carried);
    for (size_t i = 0; i < 3; i++)
      u[at + i] = l->weight[v] * u[at + i] + (1 - l->weight[v]) * (carried[i] - l->mesh->x[at + i]);
  }
  return EP_OK;
}

ep_status ep_pose_limit(const ep_pose_limits *limits, double *u, double *shift, ep_error *err) {
  const ep_mesh *mesh = limits->mesh;
  const size_t nv = (size_t)mesh->nv;
  double *y = calloc(4 * nv, sizeof *y), *weight = y + 3 * nv;
  if (!y) return no_memory(err);
  for (size_t i = 0; i < 3 * nv; i++) y[i] = mesh->x[i] + u[i];
  ep_status status = seat(limits, y, shift, err);
  for (size_t i = 0; i < 3 * nv; i++) u[i] = y[i] - mesh->x[i];
  for (int p = 0; p < limits->parts && status == EP_OK; p++)
    status = limit_part(limits, p, y, weight, u, err);
  free(y);
  return status;
}
