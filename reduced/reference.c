#include "reduced/reference.h"

#include <math.h>

// Stretches above the first carry full weight; elements below the second are left out.
static const double full_weight_stretch = 0.7, smallest_stretch = 0.05;

// Smallest singular value of F: root of the smallest eigenvalue of C = F^T F, by the trigonometric
// solution of its characteristic polynomial (Smith 1961).
static double smallest_singular_value(const double f[9]) {
  double c[6]; // 00 11 22 01 02 12
  for (int i = 0, at = 3; i < 3; i++) {
    c[i] = f[i] * f[i] + f[3 + i] * f[3 + i] + f[6 + i] * f[6 + i];
    for (int j = i + 1; j < 3; j++)
      c[at++] = f[i] * f[j] + f[3 + i] * f[3 + j] + f[6 + i] * f[6 + j];
  }
  const double mean = (c[0] + c[1] + c[2]) / 3;
  const double d0 = c[0] - mean, d1 = c[1] - mean, d2 = c[2] - mean;
  const double off = c[3] * c[3] + c[4] * c[4] + c[5] * c[5];
  const double p = sqrt((d0 * d0 + d1 * d1 + d2 * d2 + 2 * off) / 6);
  if (!(p > 1e-12 * mean)) return sqrt(mean);
  const double det = d0 * (d1 * d2 - c[5] * c[5]) - c[3] * (c[3] * d2 - c[5] * c[4]) +
                     c[4] * (c[3] * c[5] - d1 * c[4]);
  const double half = fmax(-1, fmin(1, det / (2 * p * p * p)));
  const double third_turn = 2.0943951023931953;
  return sqrt(fmax(0, mean + 2 * p * cos(acos(half) / 3 + third_turn)));
}

double ep_reference_element(const double f[9], double inverse[9]) {
  for (int i = 0; i < 3; i++) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; j++) { // transposed cofactors
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      inverse[3 * j + i] = f[3 * i1 + j1] * f[3 * i2 + j2] - f[3 * i1 + j2] * f[3 * i2 + j1];
    }
  }
  const double det = f[0] * inverse[0] + f[1] * inverse[3] + f[2] * inverse[6];
  const double stretch = smallest_singular_value(f);
  if (!(det > 0) || !(stretch >= smallest_stretch)) {
    for (int i = 0; i < 9; i++) inverse[i] = i % 4 == 0;
    return 0;
  }
  for (int i = 0; i < 9; i++) inverse[i] /= det;
  const double share = fmin(1, stretch / full_weight_stretch);
  return det * (share * share) * (share * share);
}
