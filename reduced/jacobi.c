#include "reduced/jacobi.h"

#include <math.h>

enum { SWEEPS = 30 }; // quadratic convergence: 4-7 are used

static double off_diagonal(int n, const double *a) {
  double sum = 0;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) sum += a[n * i + j] * a[n * i + j];
  return sum;
}

static void rotate(int n, double *a, double *v, int p, int q) {
  double apq = a[n * p + q];
  if (apq == 0) return;
  double theta = (a[n * q + q] - a[n * p + p]) / (2 * apq);
  double t = copysign(1 / (fabs(theta) + sqrt(theta * theta + 1)), theta);
  double c = 1 / sqrt(t * t + 1), s = t * c;
  for (int k = 0; k < n; k++) {
    double x = a[n * k + p], y = a[n * k + q];
    a[n * k + p] = c * x - s * y;
    a[n * k + q] = s * x + c * y;
  }
  for (int k = 0; k < n; k++) {
    double x = a[n * p + k], y = a[n * q + k];
    a[n * p + k] = c * x - s * y;
    a[n * q + k] = s * x + c * y;
    x = v[n * k + p], y = v[n * k + q];
    v[n * k + p] = c * x - s * y;
    v[n * k + q] = s * x + c * y;
  }
  a[n * p + q] = a[n * q + p] = 0;
}

void ep_jacobi(int n, double *a, double *v) {
  double norm = 0;
  for (int i = 0; i < n * n; i++) {
    norm += a[i] * a[i];
    v[i] = i % (n + 1) == 0;
  }
  for (int sweep = 0; sweep < SWEEPS && off_diagonal(n, a) > 1e-34 * norm; sweep++)
    for (int p = 0; p < n; p++)
      for (int q = p + 1; q < n; q++) rotate(n, a, v, p, q);
}
