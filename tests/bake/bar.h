// Shared by the bake tests: a box cut into tets (Kuhn), a material, random smooth displacements.
#ifndef EP_TESTS_BAKE_BAR_H
#define EP_TESTS_BAKE_BAR_H

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
// after the four above, which it needs
#include <cmocka.h>

#include "base/random.h"
#include "mesh/mesh.h"
#include "reduced/bake/fem.h"
#include "tests/near.h"
#include "tests/norms.h"

#define ASSERT_OK(call)                                                                            \
  do {                                                                                             \
    ep_error err_ = {0};                                                                           \
    ep_error *err = &err_;                                                                         \
    if ((call) != EP_OK) fail_msg("%s", err_.text);                                                \
  } while (0)

#define ASSERT_LESS(a, b)                                                                          \
  do {                                                                                             \
    double a_ = (a), b_ = (b);                                                                     \
    if (!(a_ < b_)) fail_msg("%s = %.6g is not below %s = %.6g", #a, a_, #b, b_);                  \
  } while (0)

typedef struct bar {
  ep_mesh mesh;
  ep_fem fem;
  size_t n3;
} bar;

// [0, size] cut into cells of 6 tets each.
static inline void box_mesh(const int cells[3], const double size[3], ep_mesh *out) {
  static const int corner[6][4] = {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7},
                                   {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}};
  const int nx = cells[0] + 1, ny = cells[1] + 1, nz = cells[2] + 1, nv = nx * ny * nz;
  double *x = malloc(3 * (size_t)nv * sizeof *x);
  int *tet = malloc(24 * (size_t)cells[0] * (size_t)cells[1] * (size_t)cells[2] * sizeof *tet);
  int nt = 0;
  for (int i = 0; i < nv; i++) {
    x[3 * i] = size[0] * (i % nx) / cells[0];
    x[3 * i + 1] = size[1] * (i / nx % ny) / cells[1];
    x[3 * i + 2] = size[2] * (i / nx / ny) / cells[2];
  }
  for (int c = 0; c < cells[0] * cells[1] * cells[2]; c++) {
    const int i = c % cells[0], j = c / cells[0] % cells[1], k = c / cells[0] / cells[1];
    for (int t = 0; t < 6; t++, nt++)
      for (int v = 0; v < 4; v++) {
        const int b = corner[t][v];
        tet[4 * nt + v] = (i + (b & 1)) + nx * ((j + (b >> 1 & 1)) + ny * (k + (b >> 2)));
      }
  }
  ASSERT_OK(ep_mesh_make(nv, x, nt, tet, "box", out, NULL, err));
  free(x);
  free(tet);
}

// A box whose face x = 0 is held when `fixed`.
static inline void make_bar(bar *b, const int cells[3], const double size[3], ep_material law,
                            ep_elastic elastic, int fixed) {
  box_mesh(cells, size, &b->mesh);
  int *list = malloc((size_t)b->mesh.nv * sizeof *list), count = 0;
  for (int v = 0; fixed && v < b->mesh.nv; v++)
    if (b->mesh.x[3 * v] < 1e-9) list[count++] = v;
  ASSERT_OK(ep_fem_create(&b->mesh, law, 1, &elastic, count, list, &b->fem, err));
  b->n3 = 3 * (size_t)b->mesh.nv;
  free(list);
}

static inline void free_bar(bar *b) {
  ep_fem_free(&b->fem);
  ep_mesh_free(&b->mesh);
}

static inline double *vector_of(size_t n) {
  double *v = calloc(n, sizeof *v);
  assert_non_null(v);
  return v;
}

// A smooth random displacement (quadratic in x) with largest entry `size`, zero where held.
static inline void smooth_random(const bar *b, uint64_t seed, double size, double *u) {
  ep_random rng = ep_random_seed(seed, 7);
  double c[3][10], largest = 0;
  for (int a = 0; a < 3; a++)
    for (int i = 0; i < 10; i++) c[a][i] = ep_random_normal(&rng);
  for (int v = 0; v < b->mesh.nv; v++) {
    const double *x = b->mesh.x + 3 * (size_t)v;
    const double p[10] = {1,           x[0],        x[1],        x[2],        x[0] * x[0],
                          x[1] * x[1], x[2] * x[2], x[0] * x[1], x[1] * x[2], x[0] * x[2]};
    for (int a = 0; a < 3; a++) {
      double *entry = u + 3 * v + a;
      *entry = 0;
      for (int i = 0; i < 10 && !b->fem.held[3 * v]; i++) *entry += c[a][i] * p[i];
      largest = fmax(largest, fabs(*entry));
    }
  }
  for (size_t i = 0; i < b->n3; i++) u[i] *= size / largest;
}

// The order p of an error ~ h^p from its values at h and h / 2.
static inline double order_of(double coarse, double fine) {
  return log2(coarse / fine);
}

#endif
