// Small helpers on rows of length 3n, shared by modes, paths and basis.
#ifndef EP_BAKE_VECTORS_H
#define EP_BAKE_VECTORS_H

#include <math.h>
#include <stddef.h>

static inline double ep_dot(size_t n, const double *x, const double *y) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

static inline void ep_axpy(size_t n, double a, const double *x, double *y) {
  for (size_t i = 0; i < n; i++) y[i] += a * x[i];
}

// Of the vertices (n of x): length of the longest of their vectors. Components would do as well
// for one pose of the axes only.
static inline double ep_longest(size_t vertices, const double *x) {
  double square = 0;
  for (size_t v = 0; v < vertices; v++) square = fmax(square, ep_dot(3, x + 3 * v, x + 3 * v));
  return sqrt(square);
}

// Turn x so that its first entry of (nearly) largest size is positive. "Nearly": entries equal by
// symmetry differ by round-off only, and must not decide the sign between them.
static inline void ep_canonical_sign(size_t n, double *x) {
  double largest = 0;
  for (size_t i = 0; i < n; i++) largest = fmax(largest, fabs(x[i]));
  const double threshold = (1 - 1e-6) * largest;
  size_t first = 0;
  while (first < n && fabs(x[first]) < threshold) first++;
  if (first == n || x[first] >= 0) return;
  for (size_t i = 0; i < n; i++) x[i] = -x[i];
}

#endif
