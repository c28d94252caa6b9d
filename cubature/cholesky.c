#include "cubature/cholesky.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

ep_status ep_cholesky_create(int capacity, ep_cholesky *out, ep_error *err) {
  *out = (ep_cholesky){.capacity = capacity};
  const size_t n = (size_t)(capacity > 0 ? capacity : 1);
  out->l = calloc(n * n, sizeof *out->l);
  if (!out->l)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a %d x %d factor", capacity, capacity);
  return EP_OK;
}

void ep_cholesky_free(ep_cholesky *chol) {
  free(chol->l);
  *chol = (ep_cholesky){0};
}

static double *row(const ep_cholesky *chol, int i) {
  return chol->l + (size_t)i * (size_t)chol->capacity;
}

static double dot(int n, const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

bool ep_cholesky_append(ep_cholesky *chol, const double *g, double diagonal) {
  const int n = chol->n;
  if (n >= chol->capacity || !(diagonal > 0)) return false;
  double *last = row(chol, n);
  for (int i = 0; i < n; i++) last[i] = (g[i] - dot(i, row(chol, i), last)) / row(chol, i)[i];
  const double pivot = diagonal - dot(n, last, last);
  if (!(pivot > EP_DEPENDENT * diagonal)) return false;
  last[n] = sqrt(pivot);
  chol->n = n + 1;
  return true;
}

void ep_cholesky_remove(ep_cholesky *chol, int k) {
  const int n = --chol->n;
  for (int i = k; i < n; i++)
    memcpy(row(chol, i), row(chol, i + 1), (size_t)(i + 2) * sizeof(double));
  // Rows k.. now reach one column too far; rotate columns j, j + 1 so that (j, j + 1) vanishes.
  for (int j = k; j < n; j++) {
    double *pivot = row(chol, j);
    const double length = hypot(pivot[j], pivot[j + 1]);
    const double c = pivot[j] / length, s = pivot[j + 1] / length;
    for (int i = j; i < n; i++) {
      double *x = row(chol, i);
      const double a = x[j], b = x[j + 1];
      x[j] = c * a + s * b;
      x[j + 1] = c * b - s * a;
    }
    pivot[j + 1] = 0;
  }
}

void ep_cholesky_solve(const ep_cholesky *chol, const double *b, double *x) {
  const int n = chol->n;
  for (int i = 0; i < n; i++) x[i] = (b[i] - dot(i, row(chol, i), x)) / row(chol, i)[i];
  for (int i = n - 1; i >= 0; i--) {
    x[i] /= row(chol, i)[i];
    for (int j = 0; j < i; j++) x[j] -= row(chol, i)[j] * x[i];
  }
}
