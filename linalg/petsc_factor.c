// Sparse Cholesky and LDL^T factors by MUMPS, LDL^T with pivoting in both cases: it runs on any
// number of ranks, and its count of negative pivots tells a matrix that is not positive definite.
// CHOLMOD through PETSc is two to four times faster on one rank (letter C, 21,210 unknowns: numeric
// factor .16-.35 s against .7 s, three columns 25 ms against 71), but through PETSc's interface a
// supernodal refactorisation of an indefinite matrix was accepted without a word.
#include "linalg/petsc.h"

#include <petscmat.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/petsc_private.h"

const char *const ep_petsc_solver_package = MATSOLVERMUMPS;

struct ep_factor {
  ep_free_map map;
  int definite, usable;
  int width;        // columns of rhs and solution, 0 before the first solve
  double *gathered; // (map.count) one component, replicated
  Mat matrix, factor, rhs, solution;
};

PetscErrorCode ep_petsc_inertia(Mat factor, int *negative, int *broken) {
  PetscFunctionBeginUser;
  MatFactorError problem;
  PetscInt count = 0;
  PetscCall(MatFactorGetError(factor, &problem));
  *broken = problem != MAT_FACTOR_NOERROR;
  if (!*broken) PetscCall(MatMumpsGetInfog(factor, 12, &count));
  *negative = (int)count;
  PetscFunctionReturn(0);
}

static PetscErrorCode analyse(ep_factor *f, const ep_csr *a) {
  IS rows, columns;
  MatFactorInfo info;
  PetscFunctionBeginUser;
  PetscCall(ep_petsc_matrix(a, &f->map, &f->matrix));
  PetscCall(MatGetFactor(f->matrix, ep_petsc_solver_package, MAT_FACTOR_CHOLESKY, &f->factor));
  PetscCall(MatGetOrdering(f->matrix, MATORDERINGEXTERNAL, &rows, &columns));
  PetscCall(MatFactorInfoInitialize(&info));
  PetscCall(MatCholeskyFactorSymbolic(f->factor, f->matrix, rows, &info));
  // Detect null pivots: a singular matrix must not pass for a definite one by a pivot of +1e-17.
  PetscCall(MatMumpsSetIcntl(f->factor, 24, 1));
  PetscCall(ISDestroy(&rows));
  PetscCall(ISDestroy(&columns));
  PetscFunctionReturn(0);
}

static PetscErrorCode factorise(ep_factor *f, int *negative, int *broken) {
  MatFactorInfo info;
  PetscFunctionBeginUser;
  PetscCall(MatFactorInfoInitialize(&info));
  PetscCall(MatCholeskyFactorNumeric(f->factor, f->matrix, &info));
  PetscCall(ep_petsc_inertia(f->factor, negative, broken));
  PetscInt null_pivots = 0;
  if (!*broken) PetscCall(MatMumpsGetInfog(f->factor, 28, &null_pivots));
  *broken |= null_pivots > 0;
  PetscFunctionReturn(0);
}

static ep_status factor_values(ep_factor *f, ep_error *err) {
  int negative = 0, broken = 0;
  f->usable = 0;
  EP_TRY(ep_petsc_status(factorise(f, &negative, &broken), "sparse factorisation", err));
  if (broken)
    return ep_fail(err, EP_ERR_NUMERIC, "sparse factorisation: the %d x %d matrix is singular",
                   f->map.count, f->map.count);
  if (f->definite && negative > 0)
    return ep_fail(err, EP_ERR_NUMERIC,
                   "sparse Cholesky: the %d x %d matrix is not positive definite (%d negative "
                   "pivots)",
                   f->map.count, f->map.count, negative);
  f->usable = 1;
  return EP_OK;
}

ep_status ep_factor_create(const ep_csr *a, const unsigned char *held, int definite,
                           ep_factor **out, ep_error *err) {
  *out = NULL;
  EP_TRY(ep_petsc_ready(err));
  ep_factor *f = calloc(1, sizeof *f);
  if (!f) return ep_fail(err, EP_ERR_MEMORY, "no memory for a sparse factor");
  f->definite = definite;
  ep_status status;
  EP_TRY_GOTO(status, ep_free_map_make(a->n, held, &f->map, err), failed);
  f->gathered = malloc((size_t)f->map.count * sizeof *f->gathered);
  if (!f->gathered) {
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for a sparse factor");
    goto failed;
  }
  EP_TRY_GOTO(status, ep_petsc_status(analyse(f, a), "sparse factorisation (analysis)", err),
              failed);
  EP_TRY_GOTO(status, factor_values(f, err), failed);
  *out = f;
  return EP_OK;
failed:
  ep_factor_free(f);
  return status;
}

ep_status ep_factor_update(ep_factor *f, const ep_csr *a, ep_error *err) {
  if (a->n != f->map.n)
    return ep_fail(err, EP_ERR_ARGUMENT, "sparse factor of %d unknowns updated with %d", f->map.n,
                   a->n);
  f->usable = 0;
  EP_TRY(ep_petsc_status(ep_petsc_matrix_values(a, &f->map, f->matrix),
                         "sparse factorisation (new values)", err));
  return factor_values(f, err);
}

// Dense right-hand sides and solutions of `width` columns, kept between solves.
static PetscErrorCode prepare_columns(ep_factor *f, int width) {
  PetscFunctionBeginUser;
  if (f->width == width) PetscFunctionReturn(0);
  f->width = 0;
  PetscCall(MatDestroy(&f->rhs));
  PetscCall(MatDestroy(&f->solution));
  const PetscInt rows = f->map.end - f->map.begin;
  PetscCall(
      MatCreateDense(PETSC_COMM_WORLD, rows, PETSC_DECIDE, f->map.count, width, NULL, &f->rhs));
  PetscCall(MatDuplicate(f->rhs, MAT_DO_NOT_COPY_VALUES, &f->solution));
  f->width = width;
  PetscFunctionReturn(0);
}

static PetscErrorCode load_columns(ep_factor *f, int width, const double *b) {
  PetscScalar *local;
  PetscInt rows;
  PetscFunctionBeginUser;
  PetscCall(MatDenseGetLDA(f->rhs, &rows));
  PetscCall(MatDenseGetArrayWrite(f->rhs, &local));
  for (int i = 0; i < f->map.n; i++) {
    const PetscInt row = f->map.slot[i];
    if (row < f->map.begin || row >= f->map.end) continue;
    for (int c = 0; c < width; c++)
      local[c * rows + row - f->map.begin] = b[(size_t)i * (size_t)width + (size_t)c];
  }
  PetscCall(MatDenseRestoreArrayWrite(f->rhs, &local));
  PetscFunctionReturn(0);
}

static PetscErrorCode unload_columns(ep_factor *f, int width, double *x) {
  const PetscScalar *local;
  PetscInt rows;
  PetscFunctionBeginUser;
  PetscCall(MatDenseGetLDA(f->solution, &rows));
  PetscCall(MatDenseGetArrayRead(f->solution, &local));
  for (int c = 0; c < width; c++) {
    PetscCall(ep_petsc_gather(&f->map, local + c * rows, f->gathered));
    for (int i = 0; i < f->map.n; i++) {
      const int slot = f->map.slot[i];
      x[(size_t)i * (size_t)width + (size_t)c] = slot < 0 ? 0 : f->gathered[slot];
    }
  }
  PetscCall(MatDenseRestoreArrayRead(f->solution, &local));
  PetscFunctionReturn(0);
}

static PetscErrorCode solve(ep_factor *f, int width, const double *b, double *x) {
  PetscFunctionBeginUser;
  PetscCall(prepare_columns(f, width));
  PetscCall(load_columns(f, width, b));
  PetscCall(MatMatSolve(f->factor, f->rhs, f->solution));
  PetscCall(unload_columns(f, width, x));
  PetscFunctionReturn(0);
}

ep_status ep_factor_solve(ep_factor *f, int width, const double *b, double *x, ep_error *err) {
  if (!f->usable)
    return ep_fail(err, EP_ERR_ARGUMENT, "solve with a factor whose last update failed");
  if (width < 1) return ep_fail(err, EP_ERR_ARGUMENT, "solve with %d right-hand sides", width);
  return ep_petsc_status(solve(f, width, b, x), "sparse solve", err);
}

// MUMPS' INFOG(29): entries in the factors over all ranks; in millions where negative.
size_t ep_factor_bytes(const ep_factor *f) {
  PetscInt entries = 0;
  if (MatMumpsGetInfog(f->factor, 29, &entries)) return 0;
  const double count = entries < 0 ? -1e6 * (double)entries : (double)entries;
  return (size_t)count * sizeof(double);
}

void ep_factor_free(ep_factor *f) {
  if (!f) return;
  MatDestroy(&f->rhs);
  MatDestroy(&f->solution);
  MatDestroy(&f->factor);
  MatDestroy(&f->matrix);
  ep_free_map_free(&f->map);
  free(f->gathered);
  free(f);
}
