// The nearest point of a tet mesh whose vertices have d coordinates each: in space (d = 3), or in a
// product space, where it makes a map finer than its vertices (after Ezuz & Ben-Chen 2017,
// "Deblurring and denoising of maps between shapes").
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"

typedef struct fans {
  int *start, *tet; // tets around each vertex: tet[start[v] .. start[v + 1])
} fans;

static void free_fans(fans *f) {
  free(f->start);
  free(f->tet);
}

static ep_status make_fans(const ep_mesh *mesh, fans *f, ep_error *err) {
  f->start = calloc((size_t)mesh->nv + 2, sizeof *f->start);
  f->tet = malloc(4 * (size_t)mesh->nt * sizeof *f->tet);
  if (!f->start || !f->tet) {
    free_fans(f);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the tets around the vertices of %s",
                   mesh->name);
  }
  for (int i = 0; i < 4 * mesh->nt; i++) f->start[mesh->tet[i] + 2]++;
  for (int v = 0; v < mesh->nv; v++) f->start[v + 2] += f->start[v + 1];
  for (int i = 0; i < 4 * mesh->nt; i++) f->tet[f->start[mesh->tet[i] + 1]++] = i / 4;
  return EP_OK;
}

// Solve the n x n (n <= 3) symmetric system by elimination without pivoting; false: singular.
static bool solve(int n, double g[3][3], double b[3], double w[3]) {
  for (int c = 0; c < n; c++) {
    if (!(g[c][c] > 0)) return false;
    for (int r = c + 1; r < n; r++) {
      const double f = g[r][c] / g[c][c];
      for (int i = c; i < n; i++) g[r][i] -= f * g[c][i];
      b[r] -= f * b[c];
    }
  }
  for (int c = n - 1; c >= 0; c--) {
    double sum = b[c];
    for (int i = c + 1; i < n; i++) sum -= g[c][i] * w[i];
    w[c] = sum / g[c][c];
  }
  return true;
}

// Minimise w^T A w over the simplex spanned by the `n` corners in `of`, A_ij = (c_i - q).(c_j - q).
// The nearest point of a simplex that its plane's nearest point misses lies on a facet opposite a
// negative coordinate. *best, weight (4): replaced where lower.
static void nearest_on(const double a[4][4], int n, const int *of, double *best, double weight[4]) {
  double g[3][3], b[3], w[4];
  const int o = of[0];
  for (int i = 1; i < n; i++) {
    b[i - 1] = a[o][o] - a[of[i]][o];
    for (int j = 1; j < n; j++)
      g[i - 1][j - 1] = a[of[i]][of[j]] - a[of[i]][o] - a[o][of[j]] + a[o][o];
  }
  const bool regular = solve(n - 1, g, b, w + 1);
  bool inside = regular;
  w[0] = 1;
  for (int i = 1; i < n && regular; i++) w[0] -= w[i];
  for (int i = 0; i < n && regular; i++) inside = inside && w[i] >= 0;
  if (!inside) {
    for (int out = 0; out < n; out++) {
      if (regular && w[out] >= 0) continue;
      int facet[3] = {0}, count = 0;
      for (int i = 0; i < n; i++)
        if (i != out) facet[count++] = of[i];
      nearest_on(a, n - 1, facet, best, weight);
    }
    return;
  }
  double value = 0;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) value += w[i] * w[j] * a[of[i]][of[j]];
  if (value >= *best) return;
  *best = value;
  memset(weight, 0, 4 * sizeof *weight);
  for (int i = 0; i < n; i++) weight[of[i]] = w[i];
}

static double nearest_in_tet(int d, const double *coords, const int *tet, const double *q,
                             double weight[4]) {
  static const int all[4] = {0, 1, 2, 3};
  const double *c[4];
  double a[4][4], best = DBL_MAX;
  for (int i = 0; i < 4; i++) c[i] = coords + (size_t)tet[i] * d;
  for (int i = 0; i < 4; i++)
    for (int j = i; j < 4; j++) {
      double sum = 0;
      for (int f = 0; f < d; f++) sum += (c[i][f] - q[f]) * (c[j][f] - q[f]);
      a[i][j] = a[j][i] = sum;
    }
  nearest_on(a, 4, all, &best, weight);
  return best;
}

// Best tet around vertex v; *tet, weight, *best replaced where lower. Returns whether it was.
static bool try_fan(const ep_mesh *mesh, const fans *f, int d, const double *coords,
                    const double *q, int v, int *tet, double weight[4], double *best) {
  bool better = false;
  for (int i = f->start[v]; i < f->start[v + 1]; i++) {
    double w[4];
    const double value = nearest_in_tet(d, coords, mesh->tet + 4 * (size_t)f->tet[i], q, w);
    if (value >= *best) continue;
    *best = value;
    *tet = f->tet[i];
    memcpy(weight, w, 4 * sizeof *w);
    better = true;
  }
  return better;
}

ep_status ep_points_project(const ep_mesh *mesh, int d, const double *coords, int count,
                            const double *query, const int *start, int *tet, double *weight,
                            ep_error *err) {
  enum { STEPS = 32 };
  fans f;
  EP_TRY(make_fans(mesh, &f, err));
  for (int i = 0; i < count; i++) {
    const double *q = query + (size_t)i * d;
    double best = DBL_MAX, *w = weight + 4 * (size_t)i;
    tet[i] = -1;
    bool moved = try_fan(mesh, &f, d, coords, q, start[i], tet + i, w, &best);
    for (int step = 0; step < STEPS && moved; step++) {
      const int *corner = mesh->tet + 4 * (size_t)tet[i];
      moved = false;
      const int corners[4] = {corner[0], corner[1], corner[2], corner[3]};
      for (int c = 0; c < 4; c++)
        if (corners[c] != start[i])
          moved = try_fan(mesh, &f, d, coords, q, corners[c], tet + i, w, &best) || moved;
    }
  }
  free_fans(&f);
  return EP_OK;
}

ep_status ep_point_map_make(int n, ep_point_map *out, ep_error *err) {
  out->p = malloc((size_t)n * sizeof *out->p);
  out->tet = malloc((size_t)n * sizeof *out->tet);
  out->weight = malloc(4 * (size_t)n * sizeof *out->weight);
  return out->p && out->tet && out->weight
             ? EP_OK
             : ep_fail(err, EP_ERR_MEMORY, "no memory for a map of %d vertices", n);
}

void ep_point_map_free(ep_point_map *map) {
  free(map->p);
  free(map->tet);
  free(map->weight);
  *map = (ep_point_map){0};
}

ep_status ep_point_map_from_vertices(int n, const ep_mesh *to, ep_point_map *map, ep_error *err) {
  int *corner = malloc((size_t)to->nv * sizeof *corner); // 4 tet + which of its corners
  if (!corner) return ep_fail(err, EP_ERR_MEMORY, "no memory for the tets of %s", to->name);
  for (int i = 0; i < 4 * to->nt; i++) corner[to->tet[i]] = i;
  for (int i = 0; i < n; i++) {
    map->tet[i] = corner[map->p[i]] / 4;
    for (int k = 0; k < 4; k++) map->weight[4 * (size_t)i + k] = k == corner[map->p[i]] % 4;
  }
  free(corner);
  return EP_OK;
}

double ep_points_distance(const double a[3], const double b[3]) {
  double d2 = 0;
  for (int c = 0; c < 3; c++) d2 += (a[c] - b[c]) * (a[c] - b[c]);
  return sqrt(d2);
}

void ep_point_map_pull(const ep_point_map *map, int n, const ep_mesh *to, int width,
                       const double *values, double *out) {
  for (int i = 0; i < n; i++) {
    const int *corner = to->tet + 4 * (size_t)map->tet[i];
    const double *w = map->weight + 4 * (size_t)i;
    for (int c = 0; c < width; c++) {
      double sum = 0;
      for (int j = 0; j < 4; j++) sum += w[j] * values[(size_t)corner[j] * width + c];
      out[(size_t)i * width + c] = sum;
    }
  }
}
