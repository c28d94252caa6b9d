#include "reduced/reference.h"

#include <math.h>

#include "reduced/jacobi.h"

// Stretches above the first carry full weight; elements below the second are left out.
static const double full_weight_stretch = 0.7, smallest_stretch = 0.05;

// C = F^T F.
static void cauchy_green(const double f[9], double c[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      c[3 * i + j] = f[i] * f[j] + f[3 + i] * f[3 + j] + f[6 + i] * f[6 + j];
}

// min(1, sigma_min / full_weight_stretch). Most elements are not squeezed: C - stretch^2 I is then
// positive definite by its leading minors, and no eigenvalue is needed.
static double smallest_share(const double f[9]) {
  double c[9], v[9];
  cauchy_green(f, c);
  const double limit = full_weight_stretch * full_weight_stretch;
  const double a = c[0] - limit, b = c[4] - limit, d = c[8] - limit;
  const double minor = a * b - c[1] * c[1];
  const double det =
      a * (b * d - c[5] * c[5]) - c[1] * (c[1] * d - c[5] * c[2]) + c[2] * (c[1] * c[5] - b * c[2]);
  if (a > 0 && minor > 0 && det > 0) return 1;
  ep_jacobi(3, c, v);
  return sqrt(fmax(0, fmin(c[0], fmin(c[4], c[8])))) / full_weight_stretch;
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
  const double share = fmin(1, smallest_share(f));
  if (!(det > 0) || !(share * full_weight_stretch >= smallest_stretch)) {
    for (int i = 0; i < 9; i++) inverse[i] = i % 4 == 0;
    return 0;
  }
  for (int i = 0; i < 9; i++) inverse[i] /= det;
  return det * (share * share) * (share * share);
}
