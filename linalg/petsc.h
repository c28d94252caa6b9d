// The only door to PETSc and SLEPc: start-up, sparse Cholesky, generalised eigenproblems.
// Nothing of PETSc shows in this header. Matrices are assembled by owned ranges of the session's
// communicator; meshes and small dense data are replicated on every rank.
#ifndef EP_LINALG_PETSC_H
#define EP_LINALG_PETSC_H

#include <stddef.h>

#include "base/error.h"
#include "base/log.h"
#include "linalg/sparse.h"

// Initialise and finalise SLEPc, PETSc and MPI. Once per process. Options are not read from the
// command line; EIGENPOSE_PETSC_OPTIONS in the environment is passed on for experts.
ep_status ep_petsc_start(ep_error *err);
void ep_petsc_stop(void);

// Sparse Cholesky (or LDL^T) factor of a symmetric matrix with some unknowns held: rows and
// columns i with held[i] != 0 are replaced by the identity, and solves return 0 there.
typedef struct ep_factor ep_factor;

// a: n x n; held (n) or NULL. definite = 1: Cholesky, EP_ERR_NUMERIC where a pivot is not positive.
// definite = 0: LDL^T. The symbolic part is kept for ep_factor_update.
ep_status ep_factor_create(const ep_csr *a, const unsigned char *held, int definite,
                           ep_factor **out, ep_error *err);
// New values on the same pattern. EP_ERR_NUMERIC where not positive definite (definite = 1): the
// factor is then unusable until the next successful update.
ep_status ep_factor_update(ep_factor *f, const ep_csr *a, ep_error *err);
// x = A^-1 b; b, x (n x width interleaved), may alias. Width > 1 solves component by component.
ep_status ep_factor_solve(ep_factor *f, int width, const double *b, double *x, ep_error *err);
// Memory of the factor's entries on this rank's machine [bytes].
size_t ep_factor_bytes(const ep_factor *f);
void ep_factor_free(ep_factor *f);

// The `count` eigenpairs of K x = lambda M x nearest above `shift` (shift-invert with Cholesky;
// shift below the spectrum, e.g. slightly negative for singular K).
//   held (n) or NULL: unknowns that stay zero. lambda (count) ascending, x (count x n) rows
//   M-orthonormal, zero at held unknowns. Checked: number converged, relative residuals,
//   M-orthonormality; EP_ERR_NUMERIC says which failed. Deterministic start vector.
ep_status ep_eigenpairs(const ep_csr *k, const ep_csr *m, const unsigned char *held, double shift,
                        int count, double *lambda, double *x, ep_log *log, ep_error *err);

#endif
