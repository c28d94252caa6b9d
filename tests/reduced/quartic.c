#include "tests/reduced/quartic.h"

#include <stdlib.h>
#include <string.h>

#include "reduced/cubic_kernel.h"

// gram += scale u u^T over the pairs, lower triangle.
static void add_square(int pairs, double scale, const double *u, double *gram) {
  for (int i = 0; i < pairs; i++)
    for (int j = 0; j <= i; j++) gram[(size_t)i * (size_t)pairs + (size_t)j] += scale * u[i] * u[j];
}

// E_xy as coefficients over pairs (a, b) of z = (1, q): E = (A + A^T + A^T A) / 2, A = G q.
static void strain_form(int r, const double *g, int x, int y, double *u) {
  for (int a = 0, at = 0; a <= r; a++) {
    for (int b = 0; b <= a; b++, at++) {
      u[at] = 0;
      if (a == 0) continue;
      if (b == 0) {
        u[at] = 0.5 * (g[(3 * x + y) * r + a - 1] + g[(3 * y + x) * r + a - 1]);
        continue;
      }
      for (int k = 0; k < 3; k++) {
        const double *gx = g + (3 * k + x) * r, *gy = g + (3 * k + y) * r;
        u[at] += 0.5 * gx[a - 1] * gy[b - 1];
        if (a != b) u[at] += 0.5 * gx[b - 1] * gy[a - 1];
      }
    }
  }
}

static void sort_four(int x[4]) {
  for (int i = 1; i < 4; i++)
    for (int j = i; j > 0 && x[j] > x[j - 1]; j--) {
      const int swap = x[j];
      x[j] = x[j - 1], x[j - 1] = swap;
    }
}

double *quartic_coefficients(const bar *b) {
  const int r = b->model.size.r, pairs = ep_triangle(r + 1);
  double *gram = calloc((size_t)pairs * (size_t)pairs, sizeof *gram);
  double *u = calloc(2 * (size_t)pairs, sizeof *u), *trace = u + pairs;
  double *packed = calloc(ep_cubic_count(r), sizeof *packed);
  if (!gram || !u || !packed) abort();
  for (int e = 0; e < b->model.size.s; e++) {
    const double *g = b->g + 9 * (size_t)b->model.cubature_tet[e] * (size_t)r;
    const double w = b->model.cubature_w[e], mu = b->model.cubature_mu[e];
    memset(trace, 0, (size_t)pairs * sizeof *trace);
    for (int x = 0; x < 3; x++)
      for (int y = x; y < 3; y++) {
        strain_form(r, g, x, y, u);
        add_square(pairs, (x == y ? 1 : 2) * w * mu, u, gram);
        for (int i = 0; x == y && i < pairs; i++) trace[i] += u[i];
      }
    add_square(pairs, 0.5 * w * b->model.cubature_lambda[e], trace, gram);
  }
  for (int a = 0, row = 0; a <= r; a++)
    for (int c = 0; c <= a; c++, row++)
      for (int x = 0, column = 0; x <= r; x++)
        for (int y = 0; y <= x && column <= row; y++, column++) {
          int index[4] = {a, c, x, y};
          sort_four(index);
          packed[ep_cubic_index(index[0], index[1], index[2], index[3])] +=
              (row == column ? 1 : 2) * gram[(size_t)row * (size_t)pairs + (size_t)column];
        }
  free(gram), free(u);
  return packed;
}
