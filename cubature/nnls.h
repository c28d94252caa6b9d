// The passive set of non-negative least squares in Gram form (Lawson and Hanson 1974, ch. 23),
// shared by ep_nnls_gram and the greedy selection.
#ifndef EP_CUBATURE_NNLS_H
#define EP_CUBATURE_NNLS_H

#include <stdbool.h>

#include "cubature/cholesky.h"

// Variables that are not at their bound, with the least squares solution over them.
typedef struct ep_passive {
  int count, capacity;
  int *index;    // (count) variables, in order of entry
  double *x;     // (count) values > 0 after ep_passive_solve
  double *c;     // (count) right-hand side A^T b of each
  double *trial; // (capacity) work
  ep_cholesky factor;
} ep_passive;

ep_status ep_passive_create(int capacity, ep_passive *out, ep_error *err);
void ep_passive_free(ep_passive *set);
void ep_passive_copy(ep_passive *to, const ep_passive *from); // equal capacity

// Add variable j at 0: column (n) of the Gram matrix, c = its right-hand side. false where the
// column depends on those present or the set is full.
bool ep_passive_add(ep_passive *set, int j, const double *column, double c);
void ep_passive_remove(ep_passive *set, int position);

// Move x to the least squares solution over the set, removing variables that would leave x >= 0 on
// the way. The objective does not rise. Returns how many were removed.
int ep_passive_solve(ep_passive *set);

// c^T x: by how much the squared residual is below |b|^2 at the solution.
double ep_passive_gain(const ep_passive *set);

#endif
