// Start-up and shut-down, error texts, matrices of free unknowns.
#include "linalg/petsc.h"

#include <slepcsys.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/petsc_private.h"

ep_status ep_petsc_status(PetscErrorCode code, const char *what, ep_error *err) {
  if (code == 0) return EP_OK;
  const char *general = NULL;
  char *specific = NULL;
  PetscErrorMessage(code, &general, &specific);
  return ep_fail(err, code == PETSC_ERR_MEM ? EP_ERR_MEMORY : EP_ERR_NUMERIC, "%s: %s%s%s", what,
                 general ? general : "PETSc error", specific && *specific ? ": " : "",
                 specific ? specific : "");
}

ep_status ep_petsc_ready(ep_error *err) {
  PetscBool begun = PETSC_FALSE, ended = PETSC_FALSE;
  PetscInitialized(&begun);
  PetscFinalized(&ended);
  if (begun && !ended) return EP_OK;
  return ep_fail(err, EP_ERR_ARGUMENT, "the sparse solvers were not started (ep_petsc_start)");
}

// A process started without mpiexec talks to nobody: keep Open MPI from probing networks (time)
// and from warnings about missing hardware in a container. What a user has set stays.
static void quiet_mpi(void) {
  static const char *const settings[][2] = {
      {"OMPI_MCA_btl", "self,vader"},
      {"OMPI_MCA_btl_base_warn_component_unused", "0"},
      {"OMPI_MCA_btl_vader_single_copy_mechanism", "none"},
      {"OMPI_MCA_pml", "ob1"},
      {"OMPI_MCA_orte_base_help_aggregate", "0"},
      {"OMPI_MCA_hwloc_base_binding_policy", "none"},
      {"OMPI_MCA_plm_rsh_agent", "sh"}, // no complaint where there is no ssh
      {"OMPI_ALLOW_RUN_AS_ROOT", "1"},
      {"OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"},
  };
  if (getenv("OMPI_COMM_WORLD_SIZE")) return; // under mpiexec: its settings rule
  for (size_t i = 0; i < sizeof settings / sizeof *settings; i++)
    setenv(settings[i][0], settings[i][1], 0);
}

static PetscErrorCode initialise(void) {
  PetscFunctionBeginUser;
  PetscCall(PetscOptionsSetValue(NULL, "-skip_petscrc", "1"));
  PetscCall(PetscOptionsSetValue(NULL, "-no_signal_handler", "1"));
  PetscCall(SlepcInitialize(NULL, NULL, NULL, NULL));
  PetscCall(PetscPushErrorHandler(PetscReturnErrorHandler, NULL));
  const char *options = getenv("EIGENPOSE_PETSC_OPTIONS");
  if (options) PetscCall(PetscOptionsInsertString(NULL, options));
  PetscFunctionReturn(0);
}

ep_status ep_petsc_start(ep_error *err) {
  PetscBool begun = PETSC_FALSE;
  PetscInitialized(&begun);
  if (begun) return ep_fail(err, EP_ERR_ARGUMENT, "the sparse solvers can be started once only");
  quiet_mpi();
  // PETSC_OPTIONS is meant for other programs; ours has a name of its own.
  char *foreign = NULL;
  if (getenv("PETSC_OPTIONS")) {
    foreign = strdup(getenv("PETSC_OPTIONS"));
    if (!foreign) return ep_fail(err, EP_ERR_MEMORY, "no memory to start the sparse solvers");
    unsetenv("PETSC_OPTIONS");
  }
  const PetscErrorCode code = initialise();
  if (foreign) setenv("PETSC_OPTIONS", foreign, 1);
  free(foreign);
  return ep_petsc_status(code, "cannot start PETSc and SLEPc", err);
}

void ep_petsc_stop(void) {
  if (ep_petsc_ready(NULL) != EP_OK) return;
  PetscPopErrorHandler();
  SlepcFinalize();
}

static ep_status share_rows(ep_free_map *map, ep_error *err) {
  MPI_Comm_size(PETSC_COMM_WORLD, &map->size);
  PetscMPIInt rank;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  map->owned = malloc((size_t)map->size * sizeof *map->owned);
  map->offset = malloc((size_t)map->size * sizeof *map->offset);
  if (!map->owned || !map->offset) return ep_fail(err, EP_ERR_MEMORY, "no memory for row ranges");
  for (PetscMPIInt i = 0, next = 0; i < map->size; i++) {
    map->owned[i] = map->count / map->size + (i < map->count % map->size);
    map->offset[i] = next;
    next += map->owned[i];
  }
  map->begin = map->offset[rank];
  map->end = map->begin + map->owned[rank];
  return EP_OK;
}

ep_status ep_free_map_make(int n, const unsigned char *held, ep_free_map *map, ep_error *err) {
  memset(map, 0, sizeof *map);
  map->n = n;
  map->slot = malloc((size_t)n * sizeof *map->slot + 1);
  if (!map->slot) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d unknowns", n);
  for (int i = 0; i < n; i++) map->slot[i] = held && held[i] ? -1 : map->count++;
  const ep_status status =
      map->count > 0
          ? share_rows(map, err)
          : ep_fail(err, EP_ERR_ARGUMENT, "all %d unknowns are held; nothing is left to solve", n);
  if (status != EP_OK) ep_free_map_free(map);
  return status;
}

void ep_free_map_free(ep_free_map *map) {
  free(map->slot);
  free(map->owned);
  free(map->offset);
  memset(map, 0, sizeof *map);
}

// Free columns of row i into column and value (value may be NULL); returns their number.
static PetscInt free_row(const ep_csr *a, const ep_free_map *map, int i, PetscInt *column,
                         PetscScalar *value) {
  PetscInt count = 0;
  for (int p = a->start[i]; p < a->start[i + 1]; p++) {
    const int j = map->slot[a->column[p]];
    if (j < 0) continue;
    if (value) value[count] = a->value[p];
    column[count++] = j;
  }
  return count;
}

static PetscInt widest_row(const ep_csr *a) {
  PetscInt widest = 1;
  for (int i = 0; i < a->n; i++)
    if (a->start[i + 1] - a->start[i] > widest) widest = a->start[i + 1] - a->start[i];
  return widest;
}

PetscErrorCode ep_petsc_matrix_values(const ep_csr *a, const ep_free_map *map, Mat out) {
  PetscInt *column;
  PetscScalar *value;
  PetscFunctionBeginUser;
  const PetscInt widest = widest_row(a);
  PetscCall(PetscMalloc2(widest, &column, widest, &value));
  for (int i = 0; i < map->n; i++) {
    const PetscInt row = map->slot[i];
    if (row < map->begin || row >= map->end) continue;
    const PetscInt count = free_row(a, map, i, column, value);
    PetscCall(MatSetValues(out, 1, &row, count, column, value, INSERT_VALUES));
  }
  PetscCall(PetscFree2(column, value));
  PetscCall(MatAssemblyBegin(out, MAT_FINAL_ASSEMBLY));
  PetscCall(MatAssemblyEnd(out, MAT_FINAL_ASSEMBLY));
  PetscFunctionReturn(0);
}

PetscErrorCode ep_petsc_matrix(const ep_csr *a, const ep_free_map *map, Mat *out) {
  PetscInt *start, *column;
  PetscFunctionBeginUser;
  const PetscInt rows = map->end - map->begin;
  PetscCall(PetscMalloc2(rows + 1, &start, a->start[a->n] + 1, &column));
  start[0] = 0;
  for (int i = 0; i < map->n; i++) {
    const PetscInt row = map->slot[i] - map->begin;
    if (map->slot[i] < 0 || row < 0 || row >= rows) continue;
    start[row + 1] = start[row] + free_row(a, map, i, column + start[row], NULL);
  }
  PetscCall(MatCreate(PETSC_COMM_WORLD, out));
  PetscCall(MatSetSizes(*out, rows, rows, map->count, map->count));
  PetscCall(MatSetType(*out, MATAIJ));
  PetscCall(MatSeqAIJSetPreallocationCSR(*out, start, column, NULL));
  PetscCall(MatMPIAIJSetPreallocationCSR(*out, start, column, NULL));
  PetscCall(PetscFree2(start, column));
  PetscCall(MatSetOption(*out, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatSetOption(*out, MAT_SYMMETRY_ETERNAL, PETSC_TRUE));
  PetscCall(ep_petsc_matrix_values(a, map, *out));
  PetscFunctionReturn(0);
}

PetscErrorCode ep_petsc_gather(const ep_free_map *map, const PetscScalar *local, double *all) {
  PetscFunctionBeginUser;
  PetscCallMPI(MPI_Allgatherv(local, (PetscMPIInt)(map->end - map->begin), MPI_DOUBLE, all,
                              map->owned, map->offset, MPI_DOUBLE, PETSC_COMM_WORLD));
  PetscFunctionReturn(0);
}
