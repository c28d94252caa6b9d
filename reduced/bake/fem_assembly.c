#include "reduced/bake/fem_assembly.h"

#include <string.h>

void ep_fem_displacement_gradient(const ep_fem *fem, int e, const double *u, double d[9]) {
  const int *tet = fem->mesh->tet + 4 * (size_t)e;
  const double *g = fem->gradient + 12 * (size_t)e;
  memset(d, 0, 9 * sizeof *d);
  for (int v = 0; v < 4; v++) {
    const double *uv = u + 3 * (size_t)tet[v];
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++) d[3 * a + b] += uv[a] * g[3 * v + b];
  }
}

void ep_fem_deformation(const ep_fem *fem, int e, const double *u, double f[9]) {
  ep_fem_displacement_gradient(fem, e, u, f);
  f[0] += 1;
  f[4] += 1;
  f[8] += 1;
}

void ep_fem_scatter_stress(const ep_fem *fem, int e, double scale, const double p[9],
                           double *force) {
  const int *tet = fem->mesh->tet + 4 * (size_t)e;
  const double *g = fem->gradient + 12 * (size_t)e;
  for (int v = 0; v < 4; v++) {
    double *fv = force + 3 * (size_t)tet[v];
    for (int a = 0; a < 3; a++)
      fv[a] +=
          scale * (p[3 * a] * g[3 * v] + p[3 * a + 1] * g[3 * v + 1] + p[3 * a + 2] * g[3 * v + 2]);
  }
}

// t[(a, b)][w, c] = scale sum_d H[(a, b)][(c, d)] g_w[d]
static void contract_right(double scale, const double h[81], const double g[12], double t[9][12]) {
  for (int ab = 0; ab < 9; ab++)
    for (int w = 0; w < 4; w++)
      for (int c = 0; c < 3; c++) {
        const double *row = h + 9 * ab + 3 * c;
        t[ab][3 * w + c] =
            scale * (row[0] * g[3 * w] + row[1] * g[3 * w + 1] + row[2] * g[3 * w + 2]);
      }
}

void ep_fem_scatter_tangent(const ep_fem *fem, int e, double scale, const double h[81], ep_csr *k) {
  const int *tet = fem->mesh->tet + 4 * (size_t)e;
  const int *slot = fem->slot + 16 * (size_t)e;
  const double *g = fem->gradient + 12 * (size_t)e;
  double t[9][12];
  contract_right(scale, h, g, t);
  for (int v = 0; v < 4; v++)
    for (int a = 0; a < 3; a++) {
      double *row = k->value + k->start[3 * tet[v] + a];
      for (int w = 0; w < 4; w++)
        for (int c = 0; c < 3; c++)
          row[3 * slot[4 * v + w] + c] += g[3 * v] * t[3 * a][3 * w + c] +
                                          g[3 * v + 1] * t[3 * a + 1][3 * w + c] +
                                          g[3 * v + 2] * t[3 * a + 2][3 * w + c];
    }
}
