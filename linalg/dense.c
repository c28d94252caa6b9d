#include "linalg/dense.h"

#include <cblas.h>
#include <lapacke.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static int at_least_one(int n) {
  return n > 0 ? n : 1;
}

void ep_gemm(int m, int n, int k, const double *a, const double *b, double *c) {
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, m, n, k, 1, a, at_least_one(k), b,
              at_least_one(n), 0, c, at_least_one(n));
}

void ep_gemm_tn(int m, int n, int k, const double *a, const double *b, double *c) {
  cblas_dgemm(CblasRowMajor, CblasTrans, CblasNoTrans, m, n, k, 1, a, at_least_one(m), b,
              at_least_one(n), 0, c, at_least_one(n));
}

void ep_gemm_nt(int m, int n, int k, const double *a, const double *b, double *c) {
  cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasTrans, m, n, k, 1, a, at_least_one(k), b,
              at_least_one(k), 0, c, at_least_one(n));
}

void ep_syrk_tn(int n, int k, const double *a, int add, double *c) {
  cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, n, k, 1, a, at_least_one(n), add ? 1 : 0, c,
              at_least_one(n));
}

// LAPACK may loop for ever or answer nonsense when it meets a NaN.
static ep_status require_finite(const char *what, int m, int n, const double *a, ep_error *err) {
  for (size_t i = 0; i < (size_t)m * (size_t)n; i++)
    if (!isfinite(a[i]))
      return ep_fail(err, EP_ERR_NUMERIC, "%s: entry (%d, %d) of the %d x %d matrix is not finite",
                     what, (int)(i / (size_t)n), (int)(i % (size_t)n), m, n);
  return EP_OK;
}

static ep_status lapack_status(const char *what, int m, int n, lapack_int info, ep_error *err) {
  if (info == 0) return EP_OK;
  if (info == LAPACK_WORK_MEMORY_ERROR || info == LAPACK_TRANSPOSE_MEMORY_ERROR)
    return ep_fail(err, EP_ERR_MEMORY, "%s: no memory for a %d x %d matrix", what, m, n);
  return ep_fail(err, EP_ERR_NUMERIC, "%s of a %d x %d matrix failed (LAPACK info %d)", what, m, n,
                 (int)info);
}

ep_status ep_svd(int m, int n, double *a, double *u, double *s, double *vt, ep_error *err) {
  if (m < 1 || n < 1) return ep_fail(err, EP_ERR_ARGUMENT, "SVD of a %d x %d matrix", m, n);
  EP_TRY(require_finite("SVD", m, n, a, err));
  const int p = m < n ? m : n;
  // Row-major A is column-major A^T = V diag(s) U^T: swapping the factors saves the transposes.
  const lapack_int info = LAPACKE_dgesdd(LAPACK_COL_MAJOR, 'S', n, m, a, n, s, vt, n, u, p);
  return lapack_status("singular value decomposition", m, n, info, err);
}

ep_status ep_polar(int m, int n, const double *a, double *q, ep_error *err) {
  if (m < n || n < 1)
    return ep_fail(err, EP_ERR_ARGUMENT, "polar factor of a %d x %d matrix needs rows >= columns",
                   m, n);
  const size_t rows = (size_t)m, columns = (size_t)n;
  double *copy = malloc((2 * rows * columns + columns * columns + columns) * sizeof *copy);
  if (!copy) return ep_fail(err, EP_ERR_MEMORY, "no memory for the polar factor (%d x %d)", m, n);
  double *u = copy + rows * columns, *vt = u + rows * columns, *s = vt + columns * columns;
  memcpy(copy, a, rows * columns * sizeof *copy);
  const ep_status status = ep_svd(m, n, copy, u, s, vt, err);
  if (status == EP_OK) ep_gemm(m, n, n, u, vt, q);
  free(copy);
  return status;
}

ep_status ep_eigen_symmetric(int n, double *a, double *lambda, double *v, ep_error *err) {
  if (n < 1) return ep_fail(err, EP_ERR_ARGUMENT, "eigenvalues of a %d x %d matrix", n, n);
  EP_TRY(require_finite("eigenvalues", n, n, a, err));
  // Column-major eigenvectors in columns are, read row-major, eigenvectors in rows.
  const lapack_int info = LAPACKE_dsyevd(LAPACK_COL_MAJOR, 'V', 'L', n, a, n, lambda);
  if (info == 0) memcpy(v, a, (size_t)n * (size_t)n * sizeof *v);
  return lapack_status("symmetric eigenvalue decomposition", n, n, info, err);
}

ep_status ep_solve_spd(int n, double *a, int nrhs, double *b, ep_error *err) {
  if (n < 1 || nrhs < 1)
    return ep_fail(err, EP_ERR_ARGUMENT, "solve of a %d x %d system with %d right-hand sides", n, n,
                   nrhs);
  EP_TRY(require_finite("solve", n, n, a, err));
  const lapack_int info = LAPACKE_dpotrf(LAPACK_COL_MAJOR, 'U', n, a, n);
  if (info > 0)
    return ep_fail(err, EP_ERR_NUMERIC,
                   "%d x %d matrix is not positive definite (pivot %d of its Cholesky factor)", n,
                   n, (int)info);
  EP_TRY(lapack_status("Cholesky factor", n, n, info, err));
  // A = R^T R with R in column-major upper = row-major lower L = R^T.
  cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasNoTrans, CblasNonUnit, n, nrhs, 1, a, n, b,
              nrhs);
  cblas_dtrsm(CblasRowMajor, CblasLeft, CblasLower, CblasTrans, CblasNonUnit, n, nrhs, 1, a, n, b,
              nrhs);
  return EP_OK;
}
