#include <math.h>
#include <string.h>

#include "mesh/mesh.h"

static void edges(const int *v, const double *x, double d[9]) {
  const double *o = x + 3 * v[0];
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 3; k++) d[3 * i + k] = x[3 * v[i + 1] + k] - o[k];
}

static void cross(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double ep_tet_volume(const ep_mesh *mesh, int e, const double *x) {
  double d[9], n[3];
  edges(mesh->tet + 4 * (size_t)e, x, d);
  cross(d + 3, d + 6, n);
  return dot(d, n) / 6;
}

void ep_tet_volumes(const ep_mesh *mesh, const double *x, double *volume) {
  for (int e = 0; e < mesh->nt; e++) volume[e] = ep_tet_volume(mesh, e, x);
}

double ep_mesh_volume(const ep_mesh *mesh) {
  double sum = 0;
  for (int e = 0; e < mesh->nt; e++) sum += ep_tet_volume(mesh, e, mesh->x);
  return sum;
}

int ep_mesh_inverted(const ep_mesh *mesh, const double *x, double *worst) {
  int count = 0;
  double lowest = INFINITY;
  for (int e = 0; e < mesh->nt; e++) {
    const double volume = ep_tet_volume(mesh, e, x), rest = ep_tet_volume(mesh, e, mesh->x);
    if (!(volume > 0)) count++;
    if (rest > 0 && !(volume / rest >= lowest)) lowest = volume / rest;
  }
  if (worst) *worst = lowest;
  return count;
}

void ep_mesh_bounds(const ep_mesh *mesh, double low[3], double high[3]) {
  memcpy(low, mesh->x, 3 * sizeof(double));
  memcpy(high, mesh->x, 3 * sizeof(double));
  for (int i = 3; i < 3 * mesh->nv; i++) {
    low[i % 3] = fmin(low[i % 3], mesh->x[i]);
    high[i % 3] = fmax(high[i % 3], mesh->x[i]);
  }
}

double ep_mesh_diagonal(const ep_mesh *mesh) {
  double low[3], high[3];
  ep_mesh_bounds(mesh, low, high);
  return hypot(hypot(high[0] - low[0], high[1] - low[1]), high[2] - low[2]);
}

void ep_mesh_centroid(const ep_mesh *mesh, const double *x, double centroid[3]) {
  double sum[3] = {0, 0, 0}, total = 0;
  for (int e = 0; e < mesh->nt; e++) {
    const int *v = mesh->tet + 4 * e;
    const double volume = ep_tet_volume(mesh, e, x);
    total += volume;
    for (int i = 0; i < 4; i++)
      for (int k = 0; k < 3; k++) sum[k] += volume / 4 * x[3 * v[i] + k];
  }
  for (int k = 0; k < 3; k++) centroid[k] = sum[k] / total;
}

double ep_mesh_extent(const ep_mesh *mesh) {
  double centroid[3], largest = 0;
  ep_mesh_centroid(mesh, mesh->x, centroid);
  for (int v = 0; v < mesh->nv; v++) {
    const double *x = mesh->x + 3 * (size_t)v;
    const double d[3] = {x[0] - centroid[0], x[1] - centroid[1], x[2] - centroid[2]};
    largest = fmax(largest, dot(d, d));
  }
  return 2 * sqrt(largest);
}

void ep_mesh_vertex_volumes(const ep_mesh *mesh, double *v) {
  memset(v, 0, (size_t)mesh->nv * sizeof *v);
  for (int e = 0; e < mesh->nt; e++) {
    const int *tet = mesh->tet + 4 * e;
    const double quarter = ep_tet_volume(mesh, e, mesh->x) / 4;
    for (int i = 0; i < 4; i++) v[tet[i]] += quarter;
  }
}

double ep_tet_gradients(const ep_mesh *mesh, int e, double g[12]) {
  double d[9];
  edges(mesh->tet + 4 * e, mesh->x, d);
  cross(d + 3, d + 6, g + 3);
  cross(d + 6, d, g + 6);
  cross(d, d + 3, g + 9);
  const double six = dot(d, g + 3);
  for (int i = 3; i < 12; i++) g[i] = six != 0 ? g[i] / six : 0;
  for (int k = 0; k < 3; k++) g[k] = -(g[3 + k] + g[6 + k] + g[9 + k]);
  return six / 6;
}
