// The matrix of a full-space Newton step and its direction.
#include <math.h>
#include <string.h>

#include "reduced/bake/full_private.h"
#include "reduced/bake/vectors.h"

enum { CONJUGATE_ITERATIONS = 200 };
static const double CONJUGATE_TOLERANCE = 1e-8;

// The sparse part of the Green-strain path, and its columns.
static void add_strains(ep_full_move *m, int project) {
  ep_full *full = m->full;
  const double alpha = ep_full_alpha(m);
  if (ep_full_mixed(m)) {
    ep_fem_stiffness(&full->stvk, full->x, project, &full->k_stvk);
    ep_axpy((size_t)full->k.start[full->n3], alpha, full->k_stvk.value, full->k.value);
  }
  if (alpha > 0 && !project)
    ep_green_full_stiffness(full->green, alpha, full->x, full->y, &full->k, full->columns);
}

static ep_status factorise(ep_full_move *m, int project, ep_error *err) {
  ep_full *full = m->full;
  const size_t entries = (size_t)full->k.start[full->n3];
  ep_fem_stiffness(full->fem, full->x, project, &full->k);
  const double share = ep_full_share(m);
  for (size_t i = 0; share != 1 && i < entries; i++) full->k.value[i] *= share;
  add_strains(m, project);
  ep_axpy(entries, m->inertia + m->rate * m->def->damping_mass, full->mass.value, full->k.value);
  ep_axpy(entries, m->rate * m->def->damping_stiffness, full->k0.value, full->k.value);
  if (ep_full_touches(m)) ep_full_contact_energy(full->contact, m->def, full->x, NULL, &full->k);
  if (ep_full_pulls(m)) {
    ep_full_to_coordinates(full, full->x);
    ep_example_force_energy(full->examples, m->def, full->q, NULL, full->fh, project);
  }
  EP_TRY(ep_factor_update(full->factor, &full->k, err));
  if (ep_full_alpha(m) == 0 || project) return EP_OK;
  m->report->solves += full->p;
  return ep_green_full_woodbury(full->green, ep_full_alpha(m), full->factor, full->columns,
                                full->back, err);
}

// image = (K - 2 alpha J^T C^-1 J + M U H_t U^T M) search; the second term where `strains`.
static ep_status apply(ep_full_move *m, int strains, const double *search, double *image,
                       ep_error *err) {
  ep_full *full = m->full;
  const size_t r = (size_t)full->r;
  ep_csr_multiply(&full->k, 1, search, image);
  if (strains)
    EP_TRY(
        ep_green_full_subtract(full->green, ep_full_alpha(m), full->columns, search, image, err));
  ep_full_to_coordinates(full, search);
  for (size_t a = 0; a < r; a++) full->f[a] = ep_dot(r, full->fh + a * r, full->q);
  ep_full_lift(full, full->f, image);
  ep_full_release_held(full, image);
  return EP_OK;
}

static ep_status solve(ep_full_move *m, int strains, const double *b, double *x, ep_error *err) {
  ep_full *full = m->full;
  m->report->solves++;
  if (!strains) return ep_factor_solve(full->factor, 1, b, x, err);
  return ep_green_full_solve(full->green, full->factor, full->columns, full->back, b, x, err);
}

// The examples couple everything through r coordinates: their part of the matrix is left to
// conjugate gradients, preconditioned by the factor of the rest (exact at once where they add
// nothing). Ends early, with a direction of descent, where the curvature is negative.
static ep_status conjugate(ep_full_move *m, int strains, ep_error *err) {
  ep_full *full = m->full;
  const size_t n3 = (size_t)full->n3;
  double *d = full->direction, *res = full->residual, *z = full->steered;
  memset(d, 0, n3 * sizeof *d);
  for (size_t i = 0; i < n3; i++) res[i] = -full->g[i];
  EP_TRY(solve(m, strains, res, z, err));
  memcpy(full->search, z, n3 * sizeof *z);
  double rz = ep_dot(n3, res, z);
  const double enough = CONJUGATE_TOLERANCE * CONJUGATE_TOLERANCE * rz;
  for (int i = 0; i < CONJUGATE_ITERATIONS; i++) {
    EP_TRY(apply(m, strains, full->search, full->image, err));
    const double curvature = ep_dot(n3, full->search, full->image);
    if (!(curvature > 0)) {
      if (i == 0) memcpy(d, z, n3 * sizeof *d);
      return EP_OK;
    }
    ep_axpy(n3, rz / curvature, full->search, d);
    ep_axpy(n3, -rz / curvature, full->image, res);
    EP_TRY(solve(m, strains, res, z, err));
    const double next = ep_dot(n3, res, z);
    if (next <= enough) return EP_OK;
    for (size_t j = 0; j < n3; j++) full->search[j] = z[j] + next / rz * full->search[j];
    rz = next;
  }
  return EP_OK;
}

ep_status ep_full_find_direction(ep_full_move *m, ep_error *err) {
  ep_full *full = m->full;
  ep_error indefinite = {0}; // expected at times: not the caller's concern
  ep_status status = factorise(m, 0, &indefinite);
  int strains = ep_full_alpha(m) > 0;
  if (status == EP_ERR_NUMERIC) {
    m->report->projections++;
    strains = 0;
    status = factorise(m, 1, err);
  } else if (status != EP_OK) {
    return ep_fail(err, status, "%s", indefinite.text);
  }
  if (status != EP_OK) return status;
  if (ep_full_pulls(m)) return conjugate(m, strains, err);
  EP_TRY(solve(m, strains, full->g, full->direction, err));
  for (int i = 0; i < full->n3; i++) full->direction[i] = -full->direction[i];
  return EP_OK;
}
