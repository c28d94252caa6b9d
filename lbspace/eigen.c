#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lbspace/private.h"
#include "linalg/petsc.h"

enum {
  // Solved for beyond the count asked, so that a group of near-equal eigenvalues that the count
  // would cut is seen whole.
  MORE_FUNCTIONS = 6
};
// An eigenvalue below this share of the first one kept belongs to a constant.
static const double constant_eigenvalue = 1e-7;

void ep_lb_free(ep_lb *lb) {
  free(lb->lambda);
  free(lb->phi);
  memset(lb, 0, sizeof *lb);
}

// Pairs asked of the solver: constants, those wanted and a few more where the mesh has them.
static int pairs_to_solve(const ep_mesh *mesh, int constants, int count) {
  const int most = mesh->nv - 1, wish = constants + count + MORE_FUNCTIONS;
  return wish < most ? wish : most;
}

static ep_status check_constants(const ep_mesh *mesh, int constants, const double *lambda,
                                 ep_error *err) {
  const double first = lambda[constants];
  for (int i = 0; i < constants; i++)
    if (!(fabs(lambda[i]) < constant_eigenvalue * first))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "%s: eigenvalue %d should be zero (%d connected components) but is %g; the "
                     "first of the others is %g",
                     mesh->name, i, constants, lambda[i], first);
  return EP_OK;
}

static ep_status copy_out(const ep_mesh *mesh, int count, const double *lambda, const double *phi,
                          ep_lb *out, ep_error *err) {
  const size_t entries = (size_t)count * (size_t)mesh->nv;
  out->n = mesh->nv;
  out->m = count;
  out->volume = ep_mesh_volume(mesh);
  out->lambda = malloc((size_t)count * sizeof *out->lambda);
  out->phi = malloc(entries * sizeof *out->phi);
  if (!out->lambda || !out->phi)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d eigenfunctions", count);
  memcpy(out->lambda, lambda, (size_t)count * sizeof *lambda);
  memcpy(out->phi, phi, entries * sizeof *phi);
  return EP_OK;
}

// What the solve needs besides its input.
typedef struct work {
  ep_csr k, m;
  int constants, solved;
  int *component;       // (nv)
  double *lambda, *phi; // (solved), (solved x nv)
} work;

static ep_status solve_all(const ep_mesh *mesh, int count, ep_log *log, work *w, ep_lb *out,
                           ep_error *err) {
  w->component = malloc((size_t)mesh->nv * sizeof *w->component);
  if (!w->component) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d vertices", mesh->nv);
  EP_TRY(ep_lb_components(mesh, &w->constants, w->component, err));
  if (count < 1 || count >= mesh->nv - w->constants)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "%s: %d eigenfunctions asked; a mesh of %d vertices in %d component(s) gives 1 "
                   "to %d",
                   mesh->name, count, mesh->nv, w->constants, mesh->nv - w->constants - 1);
  w->solved = pairs_to_solve(mesh, w->constants, count);
  w->lambda = malloc((size_t)w->solved * sizeof *w->lambda);
  w->phi = malloc((size_t)w->solved * (size_t)mesh->nv * sizeof *w->phi);
  if (!w->lambda || !w->phi)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d eigenfunctions", w->solved);
  EP_TRY(ep_lb_stiffness(mesh, &w->k, err));
  EP_TRY(ep_lb_mass(mesh, &w->m, err));
  // A little below zero on the scale of the lowest eigenvalue, about (pi / length)^2.
  const double diagonal = ep_mesh_diagonal(mesh), shift = -1 / (diagonal * diagonal);
  EP_TRY(ep_eigenpairs(&w->k, &w->m, NULL, shift, w->solved, w->lambda, w->phi, log, err));
  EP_TRY(check_constants(mesh, w->constants, w->lambda, err));
  double *lambda = w->lambda + w->constants;
  double *phi = w->phi + (size_t)w->constants * (size_t)mesh->nv;
  EP_TRY(ep_lb_make_canonical(mesh, &w->m, w->solved - w->constants, lambda, phi, err));
  return copy_out(mesh, count, lambda, phi, out, err);
}

ep_status ep_lb_eigen(const ep_mesh *mesh, int count, ep_log *log, ep_lb *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  work w = {0};
  const ep_status status = solve_all(mesh, count, log, &w, out, err);
  ep_csr_free(&w.k);
  ep_csr_free(&w.m);
  free(w.component);
  free(w.lambda);
  free(w.phi);
  if (status != EP_OK) ep_lb_free(out);
  return status;
}
