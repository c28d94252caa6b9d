#include "shapes.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/files.h"
#include "mesh/io.h"

void shape_from_mesh(test_shape *s, ep_mesh *mesh, int count) {
  ep_error err = {0};
  s->mesh = *mesh;
  memset(mesh, 0, sizeof *mesh);
  ep_status status = ep_lb_eigen(&s->mesh, count, NULL, &s->lb, &err);
  if (status == EP_OK) status = ep_lb_mass(&s->mesh, &s->mass, &err);
  if (status != EP_OK) fail_msg("%s", err.text);
  s->shape = (ep_shape){&s->mesh, &s->lb, &s->mass};
}

void shape_from_file(test_shape *s, const char *folder, const char *file, int count) {
  char path[EP_PATH_MAX];
  ep_error err = {0};
  ep_mesh mesh;
  ep_status status = ep_path_join(folder, file, path, &err);
  if (status == EP_OK) status = ep_mesh_read(path, &mesh, NULL, NULL, &err);
  if (status != EP_OK) fail_msg("%s", err.text);
  shape_from_mesh(s, &mesh, count);
}

void shape_free(test_shape *s) {
  ep_mesh_free(&s->mesh);
  ep_lb_free(&s->lb);
  ep_csr_free(&s->mass);
}

const char *data_folder(const char *name, char *path, size_t size) {
  snprintf(path, size, "%s/../shared/data/%s", EP_SOURCE_DIR, name);
  return ep_path_exists(path) ? path : NULL;
}

void lattice(const int cells[3], placement place, ep_mesh *mesh, double **u) {
  static const int corner[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                   {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  const int nx = cells[0] + 1, ny = cells[1] + 1, nz = cells[2] + 1;
  const int nv = nx * ny * nz, nt = 6 * cells[0] * cells[1] * cells[2];
  double *x = malloc(3 * (size_t)nv * sizeof *x);
  *u = malloc(3 * (size_t)nv * sizeof **u);
  int *tet = malloc(4 * (size_t)nt * sizeof *tet), at = 0;
  assert_true(x && *u && tet);
  for (int i = 0; i < nv; i++) {
    double *p = *u + 3 * i;
    p[0] = (double)(i % nx) / cells[0];
    p[1] = (double)(i / nx % ny) / cells[1];
    p[2] = (double)(i / nx / ny) / cells[2];
    place(p, x + 3 * i);
  }
  for (int k = 0; k < cells[2]; k++)
    for (int j = 0; j < cells[1]; j++)
      for (int i = 0; i < cells[0]; i++)
        for (int t = 0; t < 6; t++)
          for (int c = 0; c < 4; c++) {
            const int b = corner[t][c];
            tet[at++] = (i + (b & 1)) + nx * ((j + (b >> 1 & 1)) + ny * (k + (b >> 2)));
          }
  ep_error err = {0};
  if (ep_mesh_make(nv, x, nt, tet, "lattice", mesh, NULL, &err) != EP_OK) fail_msg("%s", err.text);
  free(x);
  free(tet);
}

void place_club(const double u[3], double x[3]) {
  const double thick = 0.7 + 0.8 * u[0] * u[0];
  x[0] = 5 * u[0];
  x[1] = thick * (u[1] - 0.5) + 0.35 * sin(3 * u[0]);
  x[2] = 0.7 * thick * (u[2] - 0.5) + 0.25 * u[0] * u[0];
}

void place_bent_club(const double u[3], double x[3]) {
  place_club(u, x);
  const double t = fmin(fmax((u[0] - 0.3) / 0.4, 0), 1), angle = acos(-1) / 2 * t * t * (3 - 2 * t);
  const double dx = x[0] - 2, dy = x[1];
  x[0] = 2 + cos(angle) * dx - sin(angle) * dy;
  x[1] = sin(angle) * dx + cos(angle) * dy;
}

void move_mesh(ep_mesh *mesh, const double axis[3], double degrees, double scale, double shift) {
  const double a = degrees * acos(-1) / 180, c = cos(a), s = sin(a);
  const double l = sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
  const double n[3] = {axis[0] / l, axis[1] / l, axis[2] / l};
  for (int i = 0; i < mesh->nv; i++) {
    double *p = mesh->x + 3 * i;
    const double dot = n[0] * p[0] + n[1] * p[1] + n[2] * p[2];
    const double cross[3] = {n[1] * p[2] - n[2] * p[1], n[2] * p[0] - n[0] * p[2],
                             n[0] * p[1] - n[1] * p[0]};
    for (int d = 0; d < 3; d++)
      p[d] = scale * (c * p[d] + s * cross[d] + (1 - c) * dot * n[d]) + shift;
  }
}

void permute_mesh(const ep_mesh *mesh, const int *order, ep_mesh *out) {
  double *x = malloc(3 * (size_t)mesh->nv * sizeof *x);
  int *tet = malloc(4 * (size_t)mesh->nt * sizeof *tet);
  int *place = malloc((size_t)mesh->nv * sizeof *place);
  assert_true(x && tet && place);
  for (int i = 0; i < mesh->nv; i++) {
    memcpy(x + 3 * i, mesh->x + 3 * order[i], 3 * sizeof *x);
    place[order[i]] = i;
  }
  for (int i = 0; i < 4 * mesh->nt; i++) tet[i] = place[mesh->tet[i]];
  ep_error err = {0};
  if (ep_mesh_make(mesh->nv, x, mesh->nt, tet, "permuted", out, NULL, &err) != EP_OK)
    fail_msg("%s", err.text);
  free(x);
  free(tet);
  free(place);
}
