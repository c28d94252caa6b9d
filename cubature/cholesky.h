// Cholesky factor of a growing and shrinking Gram matrix: columns come and go one at a time.
#ifndef EP_CUBATURE_CHOLESKY_H
#define EP_CUBATURE_CHOLESKY_H

#include <stdbool.h>

#include "base/error.h"

// G = L L^T, L lower triangular, row-major with row length `capacity`.
typedef struct ep_cholesky {
  int n, capacity;
  double *l; // (capacity x capacity)
} ep_cholesky;

ep_status ep_cholesky_create(int capacity, ep_cholesky *out, ep_error *err);
void ep_cholesky_free(ep_cholesky *chol);

// Append a row and column: g (n) products with those present, diagonal its squared norm.
// false, and nothing changed, where the new column depends on the present ones: what it adds is
// below EP_DEPENDENT of its squared norm (round-off of the Gram matrix itself is about 1e-16 n).
bool ep_cholesky_append(ep_cholesky *chol, const double *g, double diagonal);
#define EP_DEPENDENT 1e-12

// Remove row and column k; those after it move up (Givens rotations, Golub and Van Loan 6.5.2).
void ep_cholesky_remove(ep_cholesky *chol, int k);

// x = G^-1 b; b, x (n), may alias.
void ep_cholesky_solve(const ep_cholesky *chol, const double *b, double *x);

#endif
