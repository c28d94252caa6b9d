// Sparse matrices in compressed row form, without PETSc: assembly, products, residual checks.
#ifndef EP_LINALG_SPARSE_H
#define EP_LINALG_SPARSE_H

#include "base/error.h"

// Square, structurally symmetric, all entries stored (both triangles), columns ascending in a row.
typedef struct ep_csr {
  int n;         // rows
  int *start;    // (n + 1)
  int *column;   // (start[n])
  double *value; // (start[n])
} ep_csr;

// Pattern of a tetrahedral mesh: vertex i meets vertex j where they share a tet.
//   tets (nt x 4), block = 1 for scalar operators, 3 for xyz-interleaved vector operators
//   (3 x 3 dense blocks). Values are zero. Errors: EP_ERR_MEMORY, EP_ERR_ARGUMENT (sizes, a vertex
//   that does not exist), EP_ERR_UNSUPPORTED (2^31 entries or more).
ep_status ep_csr_from_tets(int nv, int nt, const int *tets, int block, ep_csr *out, ep_error *err);
void ep_csr_free(ep_csr *a);

// Position of entry (i, j) in value, or -1.
int ep_csr_find(const ep_csr *a, int i, int j);

// y = A x, for column vectors of `width` interleaved components: x, y (n x width). No aliasing.
void ep_csr_multiply(const ep_csr *a, int width, const double *x, double *y);

#endif
