#include "reduced/bake/fem_assembly.h"

#include <math.h>
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

// One Jacobi rotation that zeroes a[p][q] (Golub and Van Loan, algorithm 8.4.1); rows of v follow.
static void rotate(double a[81], double v[81], int p, int q) {
  double tau = (a[10 * q] - a[10 * p]) / (2 * a[9 * p + q]);
  double t = (tau >= 0 ? 1.0 : -1.0) / (fabs(tau) + sqrt(1 + tau * tau));
  double c = 1 / sqrt(1 + t * t), s = t * c;
  for (int i = 0; i < 9; i++) {
    double x = a[9 * i + p], y = a[9 * i + q];
    a[9 * i + p] = c * x - s * y;
    a[9 * i + q] = s * x + c * y;
  }
  for (int i = 0; i < 9; i++) {
    double x = a[9 * p + i], y = a[9 * q + i];
    a[9 * p + i] = c * x - s * y;
    a[9 * q + i] = s * x + c * y;
    x = v[9 * p + i], y = v[9 * q + i];
    v[9 * p + i] = c * x - s * y;
    v[9 * q + i] = s * x + c * y;
  }
}

static void jacobi9(double a[81], double v[81]) {
  enum { SWEEPS = 30 }; // convergence is quadratic: 6 to 8 are needed
  double norm = 0;
  memset(v, 0, 81 * sizeof *v);
  for (int i = 0; i < 9; i++) v[10 * i] = 1;
  for (int i = 0; i < 81; i++) norm += a[i] * a[i];
  for (int sweep = 0; sweep < SWEEPS; sweep++) {
    double off = 0;
    for (int p = 0; p < 9; p++)
      for (int q = p + 1; q < 9; q++) off += a[9 * p + q] * a[9 * p + q];
    if (off <= 1e-30 * norm) return;
    for (int p = 0; p < 9; p++)
      for (int q = p + 1; q < 9; q++)
        if (a[9 * p + q] != 0) rotate(a, v, p, q);
  }
}

void ep_project_psd9(double h[81]) {
  double a[81], v[81];
  memcpy(a, h, sizeof a);
  jacobi9(a, v);
  for (int m = 0; m < 9; m++) {
    double lambda = a[10 * m];
    if (lambda >= 0) continue;
    for (int i = 0; i < 9; i++)
      for (int j = 0; j < 9; j++) h[9 * i + j] -= lambda * v[9 * m + i] * v[9 * m + j];
  }
}
