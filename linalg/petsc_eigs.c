// Generalised symmetric eigenproblems by shift-invert Krylov-Schur, checked by inertia.
//
// A Krylov space grown from one vector sees one direction of each multiple eigenvalue; the other
// copies come in through round-off only, and may come late. Symmetric shapes (a cube, a bar of
// square section) have such eigenvalues. So what was found is counted against Sylvester's law of
// inertia, and missing copies are searched for in the M-orthogonal complement of what is known.
#include "linalg/petsc.h"

#include <math.h>
#include <slepceps.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/petsc_private.h"

enum {
  MORE_PAIRS = 4,    // searched for beyond the count asked, so that a gap to count at is found
  SEARCH_ROUNDS = 8, // complements searched before giving up
  EPS_ITERATIONS = 300
};
static const double eps_tolerance = 1e-11;
// Relative residual |K x - lambda M x| / |lambda - shift| |M x| that is accepted at the end.
static const double residual_limit = 1e-7;
static const double orthonormality_limit = 1e-9;
// Two eigenvalues closer than this share of their distance from the shift count as equal: no
// counting point is put between them.
static const double counting_gap = 1e-6;

typedef struct search {
  ep_free_map map;
  Mat k, m;
  double shift;
  int wanted;     // pairs searched for
  int count;      // pairs found, ascending
  double *lambda; // (capacity)
  Vec *x;         // (capacity)
  int capacity;
} search;

// A start vector that depends on the global index only: the same on any number of ranks.
static PetscErrorCode start_vector(Mat m, PetscInt begin, PetscInt end, int round, Vec *v) {
  PetscScalar *values;
  PetscFunctionBeginUser;
  PetscCall(MatCreateVecs(m, v, NULL));
  PetscCall(VecGetArray(*v, &values));
  for (PetscInt i = begin; i < end; i++) {
    // splitmix64 of the index
    uint64_t z = (uint64_t)(i + 1) * 0x9e3779b97f4a7c15u + (uint64_t)round * 0xd1342543de82ef95u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    values[i - begin] = (double)((z ^ (z >> 31)) >> 11) * 0x1p-53 - 0.5;
  }
  PetscCall(VecRestoreArray(*v, &values));
  PetscFunctionReturn(0);
}

static PetscErrorCode configure(EPS eps, const search *s, int wanted) {
  ST st;
  KSP ksp;
  PC pc;
  PetscFunctionBeginUser;
  PetscCall(EPSSetOperators(eps, s->k, s->m));
  PetscCall(EPSSetProblemType(eps, EPS_GHEP));
  PetscCall(EPSSetType(eps, EPSKRYLOVSCHUR));
  PetscCall(EPSSetTarget(eps, s->shift));
  PetscCall(EPSSetWhichEigenpairs(eps, EPS_TARGET_MAGNITUDE));
  PetscCall(EPSSetTolerances(eps, eps_tolerance, EPS_ITERATIONS));
  PetscCall(EPSSetDimensions(eps, wanted, PETSC_DEFAULT, PETSC_DEFAULT));
  PetscCall(EPSGetST(eps, &st));
  PetscCall(STSetType(st, STSINVERT));
  PetscCall(STGetKSP(st, &ksp));
  PetscCall(KSPSetType(ksp, KSPPREONLY));
  PetscCall(KSPGetPC(ksp, &pc));
  PetscCall(PCSetType(pc, PCCHOLESKY));
  PetscCall(PCFactorSetMatSolverType(pc, ep_petsc_solver_package));
  PetscCall(EPSSetFromOptions(eps));
  PetscFunctionReturn(0);
}

// Keep pairs ascending; s takes over x.
static void insert_pair(search *s, double lambda, Vec x) {
  int at = s->count++;
  for (; at > 0 && s->lambda[at - 1] > lambda; at--) {
    s->lambda[at] = s->lambda[at - 1];
    s->x[at] = s->x[at - 1];
  }
  s->lambda[at] = lambda;
  s->x[at] = x;
}

static PetscErrorCode collect(EPS eps, search *s, int *converged) {
  PetscInt count;
  PetscFunctionBeginUser;
  PetscCall(EPSGetConverged(eps, &count));
  *converged = (int)count;
  for (PetscInt i = 0; i < count && s->count < s->capacity; i++) {
    Vec x;
    PetscScalar lambda;
    PetscCall(MatCreateVecs(s->k, &x, NULL));
    PetscCall(EPSGetEigenpair(eps, i, &lambda, NULL, x, NULL));
    insert_pair(s, lambda, x);
  }
  PetscFunctionReturn(0);
}

// Search `wanted` pairs in the M-orthogonal complement of those known.
static PetscErrorCode search_round(search *s, int wanted, int round, int *converged) {
  EPS eps;
  Vec start;
  PetscFunctionBeginUser;
  PetscCall(EPSCreate(PETSC_COMM_WORLD, &eps));
  PetscCall(configure(eps, s, wanted));
  PetscCall(start_vector(s->m, s->map.begin, s->map.end, round, &start));
  PetscCall(EPSSetInitialSpace(eps, 1, &start));
  if (s->count) PetscCall(EPSSetDeflationSpace(eps, s->count, s->x));
  PetscCall(EPSSolve(eps));
  PetscCall(collect(eps, s, converged));
  PetscCall(VecDestroy(&start));
  PetscCall(EPSDestroy(&eps));
  PetscFunctionReturn(0);
}

// How many eigenvalues lie below sigma: negative pivots of K - sigma M (Sylvester).
static PetscErrorCode count_below(const search *s, double sigma, int *count, int *broken) {
  Mat shifted, factor;
  IS rows, columns;
  MatFactorInfo info;
  PetscFunctionBeginUser;
  PetscCall(MatDuplicate(s->k, MAT_COPY_VALUES, &shifted));
  PetscCall(MatAXPY(shifted, -sigma, s->m, UNKNOWN_NONZERO_PATTERN));
  PetscCall(MatSetOption(shifted, MAT_SYMMETRIC, PETSC_TRUE));
  PetscCall(MatGetFactor(shifted, ep_petsc_solver_package, MAT_FACTOR_CHOLESKY, &factor));
  PetscCall(MatGetOrdering(shifted, MATORDERINGEXTERNAL, &rows, &columns));
  PetscCall(MatFactorInfoInitialize(&info));
  PetscCall(MatCholeskyFactorSymbolic(factor, shifted, rows, &info));
  PetscCall(MatCholeskyFactorNumeric(factor, shifted, &info));
  PetscCall(ep_petsc_inertia(factor, count, broken));
  PetscCall(ISDestroy(&rows));
  PetscCall(ISDestroy(&columns));
  PetscCall(MatDestroy(&factor));
  PetscCall(MatDestroy(&shifted));
  PetscFunctionReturn(0);
}

// The first place at or after `count` pairs where the spectrum has a gap; s->count where none has.
static int counting_point(const search *s, int count) {
  int at = count;
  while (at < s->count &&
         s->lambda[at] - s->lambda[at - 1] <= counting_gap * fabs(s->lambda[at] - s->shift))
    at++;
  return at;
}

// Make sure that no eigenvalue below the `count`-th was missed; *missing is how many were.
static ep_status count_missing(const search *s, int count, int *missing, ep_error *err) {
  const int at = counting_point(s, count);
  int below = 0, broken = 0;
  // Behind the last pair there is nothing to be halfway to: go a little above it.
  const double last = s->lambda[at - 1];
  const double sigma =
      at < s->count ? 0.5 * (last + s->lambda[at]) : last + counting_gap * fabs(last - s->shift);
  EP_TRY(ep_petsc_status(count_below(s, sigma, &below, &broken), "counting eigenvalues", err));
  if (broken)
    return ep_fail(err, EP_ERR_NUMERIC, "counting eigenvalues below %g: the factorisation failed",
                   sigma);
  *missing = below - at;
  return EP_OK;
}

static ep_status not_converged(const search *s, int count, ep_error *err) {
  return ep_fail(err, EP_ERR_NUMERIC,
                 "only %d of %d eigenpairs of the %d x %d problem converged; check the mesh for "
                 "degenerate elements or ask for fewer",
                 s->count, count, s->map.count, s->map.count);
}

static ep_status search_all(search *s, int count, ep_log *log, ep_error *err) {
  int converged = 0, missing = 0;
  EP_TRY(ep_petsc_status(search_round(s, s->wanted, 0, &converged), "eigenvalue solver", err));
  if (s->count < count) return not_converged(s, count, err);
  for (int round = 1; round < SEARCH_ROUNDS; round++) {
    EP_TRY(count_missing(s, count, &missing, err));
    if (missing <= 0) break;
    ep_notice(log, "eigenvalues: searching for %d more copies of multiple ones", missing);
    if (s->count + missing > s->capacity) return not_converged(s, s->count + missing, err);
    EP_TRY(ep_petsc_status(search_round(s, missing, round, &converged), "eigenvalue solver", err));
    if (converged == 0) return not_converged(s, s->count + missing, err);
  }
  if (missing == 0) return EP_OK;
  return ep_fail(err, EP_ERR_NUMERIC,
                 "eigenvalue solver: %d eigenvalues among the first %d are %s by the count of "
                 "negative pivots",
                 abs(missing), count, missing > 0 ? "missing" : "too many");
}

// Copies the first `count` pairs out, M-normalised.
static PetscErrorCode export_pairs(const search *s, int count, double *gathered, double *lambda,
                                   double *x) {
  PetscFunctionBeginUser;
  for (int j = 0; j < count; j++) {
    const PetscScalar *local;
    lambda[j] = s->lambda[j];
    PetscCall(VecGetArrayRead(s->x[j], &local));
    PetscCall(ep_petsc_gather(&s->map, local, gathered));
    PetscCall(VecRestoreArrayRead(s->x[j], &local));
    double *row = x + (size_t)j * (size_t)s->map.n;
    for (int i = 0; i < s->map.n; i++) row[i] = s->map.slot[i] < 0 ? 0 : gathered[s->map.slot[i]];
  }
  PetscFunctionReturn(0);
}

static double dot(int n, const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// Residual of pair j over free unknowns, relative to |lambda - shift| |M x|.
static double relative_residual(const ep_csr *k, const search *s, double lambda, const double *x,
                                const double *mx, double *kx) {
  ep_csr_multiply(k, 1, x, kx);
  double residual = 0, size = 0;
  for (int i = 0; i < k->n; i++) {
    if (s->map.slot[i] < 0) continue;
    const double r = kx[i] - lambda * mx[i];
    residual += r * r;
    size += mx[i] * mx[i];
  }
  return sqrt(residual) / (fabs(lambda - s->shift) * sqrt(size));
}

// Residuals and M-orthonormality, on this side of PETSc: with the matrices the caller gave.
static ep_status check_pairs(const ep_csr *k, const ep_csr *m, const search *s, int count,
                             const double *lambda, const double *x, double *work, ep_error *err) {
  const size_t n = (size_t)k->n;
  double *mx = work, *kx = work + n;
  for (int j = 0; j < count; j++) {
    ep_csr_multiply(m, 1, x + (size_t)j * n, mx);
    const double residual = relative_residual(k, s, lambda[j], x + (size_t)j * n, mx, kx);
    if (!(residual <= residual_limit))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "eigenpair %d (eigenvalue %g) has a relative residual of %.2g, above %.0g: "
                     "a mesh with tets of next to no volume does that; see 'eigenpose check'",
                     j, lambda[j], residual, residual_limit);
    for (int i = 0; i <= j; i++) {
      const double off = fabs(dot(k->n, mx, x + (size_t)i * n) - (i == j));
      if (!(off <= orthonormality_limit))
        return ep_fail(err, EP_ERR_NUMERIC,
                       "eigenvectors %d and %d miss M-orthonormality by %.2g, above %.0g", i, j,
                       off, orthonormality_limit);
    }
  }
  return EP_OK;
}

// Modified Gram-Schmidt in the M inner product, twice: later rounds and clustered values leave
// 1e-9 or so. work (n).
static void orthonormalise(const ep_csr *m, int count, double *x, double *work) {
  const size_t n = (size_t)m->n;
  for (int pass = 0; pass < 2; pass++)
    for (int j = 0; j < count; j++) {
      double *v = x + (size_t)j * n;
      for (int i = 0; i < j; i++) {
        ep_csr_multiply(m, 1, v, work);
        const double c = dot(m->n, work, x + (size_t)i * n);
        for (size_t p = 0; p < n; p++) v[p] -= c * x[(size_t)i * n + p];
      }
      ep_csr_multiply(m, 1, v, work);
      const double scale = 1 / sqrt(dot(m->n, work, v));
      for (size_t p = 0; p < n; p++) v[p] *= scale;
    }
}

static ep_status search_make(search *s, const ep_csr *k, const ep_csr *m, const unsigned char *held,
                             int count, ep_error *err) {
  EP_TRY(ep_free_map_make(k->n, held, &s->map, err));
  if (count >= s->map.count)
    return ep_fail(err, EP_ERR_ARGUMENT, "%d eigenpairs of a problem of %d unknowns; ask for fewer",
                   count, s->map.count);
  s->wanted = count + MORE_PAIRS < s->map.count ? count + MORE_PAIRS : s->map.count - 1;
  s->capacity = 4 * s->wanted + 64;
  s->lambda = malloc((size_t)s->capacity * sizeof *s->lambda);
  s->x = calloc((size_t)s->capacity, sizeof(Vec));
  if (!s->lambda || !s->x) return ep_fail(err, EP_ERR_MEMORY, "no memory for eigenpairs");
  EP_TRY(ep_petsc_status(ep_petsc_matrix(k, &s->map, &s->k), "eigenvalue solver (matrix)", err));
  return ep_petsc_status(ep_petsc_matrix(m, &s->map, &s->m), "eigenvalue solver (mass)", err);
}

static void search_free(search *s) {
  for (int i = 0; i < s->count; i++) VecDestroy(&s->x[i]);
  MatDestroy(&s->k);
  MatDestroy(&s->m);
  free(s->lambda);
  free(s->x);
  ep_free_map_free(&s->map);
}

ep_status ep_eigenpairs(const ep_csr *k, const ep_csr *m, const unsigned char *held, double shift,
                        int count, double *lambda, double *x, ep_log *log, ep_error *err) {
  EP_TRY(ep_petsc_ready(err));
  if (count < 1 || k->n != m->n)
    return ep_fail(err, EP_ERR_ARGUMENT, "%d eigenpairs of matrices of %d and %d rows", count, k->n,
                   m->n);
  search s = {.shift = shift};
  double *work = malloc(2 * (size_t)k->n * sizeof *work);
  ep_status status =
      work ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for eigenpairs of %d rows", k->n);
  if (status != EP_OK) goto done;
  EP_TRY_GOTO(status, search_make(&s, k, m, held, count, err), done);
  EP_TRY_GOTO(status, search_all(&s, count, log, err), done);
  EP_TRY_GOTO(status,
              ep_petsc_status(export_pairs(&s, count, work, lambda, x), "eigenvectors", err), done);
  orthonormalise(m, count, x, work);
  status = check_pairs(k, m, &s, count, lambda, x, work, err);
done:
  free(work);
  search_free(&s);
  return status;
}
