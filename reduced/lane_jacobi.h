// The projection of material.c over 8 elements at once: the rotations of jacobi.c in the same
// order, lanes that are done turn by nothing. Private to the kernels.
#ifndef EP_REDUCED_LANE_JACOBI_H
#define EP_REDUCED_LANE_JACOBI_H

#include "reduced/lanes.h"

enum { LANE_JACOBI_SWEEPS = 30 };

LANE_INLINE lane lane_sqrt(lane x) {
  lane y;
  for (int i = 0; i < 8; i++) y[i] = sqrt(x[i]);
  return y;
}

// Cosine and sine of the rotation that clears entry (p, q).
LANE_INLINE void lane_turn(const lane *a, int p, int q, lane *c, lane *s) {
  const lane zero = lane_all(0), one = lane_all(1), apq = a[9 * p + q];
  const lane_mask done = apq == zero;
  const lane theta = (a[10 * q] - a[10 * p]) / lane_select(done, one, apq + apq);
  const lane size = lane_select(theta < zero, -theta, theta);
  const lane t = one / (size + lane_sqrt(theta * theta + one));
  const lane turn = lane_select(done, zero, lane_select(theta < zero, -t, t));
  *c = one / lane_sqrt(turn * turn + one);
  *s = turn * *c;
}

static void lane_rotate(lane *a, lane *v, int p, int q) {
  lane c, s;
  lane_turn(a, p, q, &c, &s);
  for (int k = 0; k < 9; k++) {
    const lane x = a[9 * k + p], y = a[9 * k + q];
    a[9 * k + p] = c * x - s * y;
    a[9 * k + q] = s * x + c * y;
  }
  for (int k = 0; k < 9; k++) {
    const lane x = a[9 * p + k], y = a[9 * q + k], vx = v[9 * p + k], vy = v[9 * q + k];
    a[9 * p + k] = c * x - s * y;
    a[9 * q + k] = s * x + c * y;
    v[9 * p + k] = c * vx - s * vy; // rows of v are the eigenvectors
    v[9 * q + k] = s * vx + c * vy;
  }
  a[9 * p + q] = a[9 * q + p] = lane_all(0);
}

LANE_INLINE lane lane_off_diagonal(const lane *a) {
  lane sum = lane_all(0);
  for (int i = 0; i < 9; i++)
    for (int j = 0; j < i; j++) sum += a[9 * i + j] * a[9 * i + j];
  return sum;
}

// Nearest positive semidefinite matrix to each symmetric 9 x 9.
static void lane_project(lane h[81]) {
  const lane zero = lane_all(0);
  lane a[81], v[81], norm = zero;
  for (int i = 0; i < 81; i++) {
    a[i] = h[i];
    norm += h[i] * h[i];
    v[i] = lane_all(i % 10 == 0);
  }
  for (int sweep = 0; sweep < LANE_JACOBI_SWEEPS; sweep++) {
    if (!lane_any(lane_off_diagonal(a) > lane_all(1e-34) * norm)) break;
    for (int p = 0; p < 9; p++)
      for (int q = p + 1; q < 9; q++) lane_rotate(a, v, p, q);
  }
  for (int m = 0; m < 9; m++) { // what is negative is taken off: others stay as they are
    const lane value = lane_select(a[10 * m] < zero, a[10 * m], zero);
    if (!lane_any(value < zero)) continue;
    for (int i = 0; i < 9; i++)
      for (int j = 0; j < 9; j++) h[9 * i + j] -= value * (v[9 * m + i] * v[9 * m + j]);
  }
}

#endif
