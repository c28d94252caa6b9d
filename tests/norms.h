// Euclidean norms of vectors.
#ifndef EP_TESTS_NORMS_H
#define EP_TESTS_NORMS_H

#include <math.h>
#include <stddef.h>

static inline double norm_of(size_t n, const double *x) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += x[i] * x[i];
  return sqrt(sum);
}

static inline double distance_of(size_t n, const double *x, const double *y) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += (x[i] - y[i]) * (x[i] - y[i]);
  return sqrt(sum);
}

#endif
