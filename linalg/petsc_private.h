// Shared by the PETSc-facing files only: error translation and matrices of free unknowns.
#ifndef EP_LINALG_PETSC_PRIVATE_H
#define EP_LINALG_PETSC_PRIVATE_H

#include <petscmat.h>

#include "base/error.h"
#include "linalg/sparse.h"

// Turn a PETSc error code into an ep_error: "<what>: <PETSc's own text>".
ep_status ep_petsc_status(PetscErrorCode code, const char *what, ep_error *err);
// Fails where ep_petsc_start has not been called.
ep_status ep_petsc_ready(ep_error *err);

// Numbering of the unknowns that are not held.
typedef struct ep_free_map {
  int n, count;                // all unknowns; free ones
  int *slot;                   // (n) number among the free ones, -1 where held
  PetscMPIInt size;            // ranks of the session
  PetscInt begin, end;         // free unknowns owned by this rank
  PetscMPIInt *owned, *offset; // (size) number and first of each rank's free unknowns
} ep_free_map;

ep_status ep_free_map_make(int n, const unsigned char *held, ep_free_map *map, ep_error *err);
void ep_free_map_free(ep_free_map *map);

// A as a distributed PETSc matrix of its free rows and columns (AIJ, owned rows only).
PetscErrorCode ep_petsc_matrix(const ep_csr *a, const ep_free_map *map, Mat *out);
// New values on the pattern the matrix was made with.
PetscErrorCode ep_petsc_matrix_values(const ep_csr *a, const ep_free_map *map, Mat out);
// Replicate a distributed vector's entries on all ranks: local (end - begin), all (map->count).
PetscErrorCode ep_petsc_gather(const ep_free_map *map, const PetscScalar *local, double *all);

// The package behind every factorisation, and why: see petsc_factor.c.
extern const char *const ep_petsc_solver_package;
// Number of negative pivots of a factor, and whether the factorisation met a zero pivot.
PetscErrorCode ep_petsc_inertia(Mat factor, int *negative, int *broken);

#endif
