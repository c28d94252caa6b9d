// Included once per instruction-set level with EP_GUARD defined as the name of its function. Loops
// over arrays of 8 numbers: the compilers turn each into vectors of the level's width.
#include <math.h>
#include <stddef.h>

#include "reduced/guard_kernel.h"
#include "reduced/kernel.h"
#include "reduced/lanes.h"

// Round-off of F and of the bound: a guard within this of its limit is there.
static const double slack = 1e-9;

// In the order of halves, whatever the width of the vectors.
static inline double sum_of(const double x[EP_LANES]) {
  double y[4], z[2];
  for (int i = 0; i < 4; i++) y[i] = x[i] + x[i + 4];
  for (int i = 0; i < 2; i++) z[i] = y[i] + y[i + 2];
  return z[0] + z[1];
}

// F of one guard.
static inline void gradient(int blocks, const double *g, const double *q, double f[9]) {
  _Alignas(64) double sum[9][EP_LANES];
  for (int p = 0; p < EP_LANES; p += PART) {
    part x[9] = {{0}};
    for (int b = 0; b < blocks; b++) {
      const double *row = g + 72 * b + p;
      const part y = *(const part *)(q + EP_LANES * b + p);
      for (int c = 0; c < 9; c++) x[c] += *(const part *)(row + EP_LANES * c) * y;
    }
    for (int c = 0; c < 9; c++) *(part *)(sum[c] + p) = x[c];
  }
  for (int c = 0; c < 9; c++) f[c] = (c % 4 == 0) + sum_of(sum[c]);
}

// F of up to 8 guards, entry by entry; those beyond count at rest.
static void gradients(int count, int blocks, const double *g, const double *q,
                      double f[9][EP_LANES]) {
  for (int e = 0; e < EP_LANES; e++) {
    double one[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    if (e < count) gradient(blocks, g + (size_t)e * (size_t)blocks * 72, q, one);
    for (int c = 0; c < 9; c++) f[c][e] = one[c];
  }
}

// det(F + D) >= J - |cof F| d - |F| d^2 / sqrt 3 - d^3 / (3 sqrt 3), d = |D|: how large d may be
// before that can be the limit, from below, by d -> room / (c1 + c2 d + c3 d^2), which swaps the
// sides of the root.
static double reach(int count, int blocks, const double *g, const double *limit, const double *q,
                    double *jacobian) {
  double f[9][EP_LANES], cof[9][EP_LANES], way[EP_LANES], room[EP_LANES];
  gradients(count, blocks, g, q, f);
  for (int i = 0; i < EP_LANES; i++) room[i] = i < count ? limit[i] + slack : 0;
  for (int c = 0; c < 9; c++) {
    const double *a = f[(c / 3 + 1) % 3 * 3 + (c + 1) % 3],
                 *b = f[(c / 3 + 2) % 3 * 3 + (c + 2) % 3];
    const double *u = f[(c / 3 + 1) % 3 * 3 + (c + 2) % 3],
                 *v = f[(c / 3 + 2) % 3 * 3 + (c + 1) % 3];
    for (int i = 0; i < EP_LANES; i++) cof[c][i] = a[i] * b[i] - u[i] * v[i];
  }
  for (int i = 0; i < EP_LANES; i++) {
    double squares = 0, cofactors = 0;
    for (int c = 0; c < 9; c++) squares += f[c][i] * f[c][i], cofactors += cof[c][i] * cof[c][i];
    jacobian[i] = f[0][i] * cof[0][i] + f[1][i] * cof[1][i] + f[2][i] * cof[2][i];
    room[i] = jacobian[i] - room[i];
    const double c1 = sqrt(cofactors), c2 = sqrt(squares / 3), c3 = 1 / (3 * sqrt(3));
    double d = room[i] / c1;
    d = room[i] / (c1 + c2 * d + c3 * d * d);
    d = room[i] / (c1 + c2 * d + c3 * d * d);
    way[i] = room[i] / (c1 + c2 * d + c3 * d * d);
  }
  double least = HUGE_VAL;
  for (int i = 0; i < count; i++) {
    const double known = room[i] > 0 && isfinite(way[i]) ? way[i] : 0;
    least = known < least ? known : least;
  }
  return least;
}

static void gone(int count, int blocks, const double *growth, const double *at, const double *q,
                 double *out) {
  const int width = EP_LANES * blocks;
  for (int row = 0; row < count; row++, growth += width, at += width) {
    double sum[EP_LANES] = {0};
    for (int b = 0; b < width; b += EP_LANES)
      for (int i = 0; i < EP_LANES; i++) sum[i] += fabs(q[b + i] - at[b + i]) * growth[b + i];
    out[row] = sum_of(sum);
  }
}

ep_guard_kernel EP_GUARD(void) {
  return (ep_guard_kernel){reach, gone};
}
