// Small dense helpers over BLAS and LAPACK. Matrices are ROW-MAJOR (rows x cols) unless said.
#ifndef EP_LINALG_DENSE_H
#define EP_LINALG_DENSE_H

#include "base/error.h"

// C (m x n) = A (m x k) B (k x n);  _tn: A stored (k x m);  _nt: B stored (n x k).
void ep_gemm(int m, int n, int k, const double *a, const double *b, double *c);
void ep_gemm_tn(int m, int n, int k, const double *a, const double *b, double *c);
void ep_gemm_nt(int m, int n, int k, const double *a, const double *b, double *c);
// Lower triangle of C (n x n) = A^T A, A (k x n); added to C where `add`. The upper one is
// untouched.
void ep_syrk_tn(int n, int k, const double *a, int add, double *c);

// Determinant of a (3 x 3).
static inline double ep_determinant3(const double a[9]) {
  return a[0] * (a[4] * a[8] - a[5] * a[7]) - a[1] * (a[3] * a[8] - a[5] * a[6]) +
         a[2] * (a[3] * a[7] - a[4] * a[6]);
}

// Thin SVD A = U diag(s) V^T: A (m x n, destroyed), U (m x p), s (p), Vt (p x n), p = min(m, n).
ep_status ep_svd(int m, int n, double *a, double *u, double *s, double *vt, ep_error *err);

// Nearest matrix with orthonormal columns (m >= n): polar factor of A, into Q (m x n). q may be a.
ep_status ep_polar(int m, int n, const double *a, double *q, ep_error *err);

// Eigenvalues (ascending) and eigenvectors (rows of v) of a symmetric A (n x n, destroyed).
ep_status ep_eigen_symmetric(int n, double *a, double *lambda, double *v, ep_error *err);

// Solve A x = b, A symmetric positive definite (n x n, destroyed), nrhs right-hand sides b
// (n x nrhs, overwritten). EP_ERR_NUMERIC where A is not positive definite.
ep_status ep_solve_spd(int n, double *a, int nrhs, double *b, ep_error *err);

// Best rotation R (3 x 3, row-major, det +1) with R (x_i - cx) ~ y_i - cy in weighted least
// squares (Kabsch). x, y (count x 3), weight (count) or NULL; cx, cy (3) receive the centroids.
// EP_ERR_NUMERIC for fewer than three spread points (then R is the identity).
ep_status ep_kabsch(int count, const double *x, const double *y, const double *weight, double *r,
                    double *cx, double *cy, ep_error *err);

// Polar rotation of a 3x3 matrix (row-major), det +1 also where F is inverted or singular.
void ep_rotation_of(const double f[9], double r[9]);

#endif
