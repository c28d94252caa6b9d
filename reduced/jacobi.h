// Eigenvalues of small symmetric matrices by cyclic Jacobi rotations (Golub and Van Loan, 8.5):
// robust, accurate, no dependency. Private to the run time.
#ifndef EP_REDUCED_JACOBI_H
#define EP_REDUCED_JACOBI_H

// a (n x n, symmetric, n <= 9): becomes diagonal (the eigenvalues, in no order). v (n x n):
// eigenvector m is column m.
void ep_jacobi(int n, double *a, double *v);

#endif
