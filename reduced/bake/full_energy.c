// The incremental potential of a full-space step and its gradient.
#include <math.h>
#include <string.h>

#include "reduced/bake/full_private.h"
#include "reduced/bake/vectors.h"

int ep_full_pulls(const ep_full_move *m) {
  return m->full->examples && m->def->strength > 0;
}

// As in reduced/step.c: what relief leaves is shared, or the sum would have no lower bound.
static double kept(const ep_full_move *m) {
  return ep_full_pulls(m) ? 1 - m->def->relief : 1;
}

double ep_full_alpha(const ep_full_move *m) {
  return m->full->green ? m->def->green.alpha * kept(m) : 0;
}

int ep_full_touches(const ep_full_move *m) {
  return m->def->obstacles > 0;
}

int ep_full_mixed(const ep_full_move *m) {
  return ep_full_alpha(m) > 0 && m->full->k_stvk.n > 0;
}

double ep_full_share(const ep_full_move *m) {
  return kept(m) * (ep_full_mixed(m) ? 1 - m->def->green.alpha : 1);
}

void ep_full_release_held(const ep_full *full, double *g) {
  for (int i = 0; i < full->n3; i++)
    if (full->fem->held[i]) g[i] = 0;
}

void ep_full_to_coordinates(ep_full *full, const double *x) {
  for (int a = 0; a < full->r; a++)
    full->q[a] = ep_dot((size_t)full->n3, full->mu + (size_t)a * (size_t)full->n3, x);
}

void ep_full_lift(const ep_full *full, const double *f, double *g) {
  for (int a = 0; a < full->r; a++)
    ep_axpy((size_t)full->n3, f[a], full->mu + (size_t)a * (size_t)full->n3, g);
}

// alpha W_a, or alpha (W_StVK + W_a) beside another material; gradient added to g unless NULL.
static double strain_energy(ep_full_move *m, const double *x, double *g) {
  ep_full *full = m->full;
  const double alpha = ep_full_alpha(m);
  const size_t n3 = (size_t)full->n3;
  if (alpha == 0) return 0;
  double energy = ep_green_full_energy(full->green, x, full->y, g ? full->pull : NULL, NULL);
  if (g) ep_axpy(n3, alpha, full->pull, g);
  if (!ep_full_mixed(m)) return alpha * energy;
  energy += ep_fem_energy(&full->stvk, x);
  if (g) ep_fem_force(&full->stvk, x, full->pull);
  if (g) ep_axpy(n3, alpha, full->pull, g);
  return alpha * energy;
}

// share W(x) + beta W_t(U^T M x) + the Green-strain path.
double ep_full_inner_energy(ep_full_move *m, const double *x, double *g) {
  ep_full *full = m->full;
  const double share = ep_full_share(m);
  m->elastic = share * ep_fem_energy(full->fem, x);
  m->example = 0;
  if (g) ep_fem_force(full->fem, x, g);
  for (int i = 0; g && share != 1 && i < full->n3; i++) g[i] *= share;
  if (ep_full_pulls(m)) {
    ep_full_to_coordinates(full, x);
    m->example =
        ep_example_force_energy(full->examples, m->def, full->q, g ? full->f : NULL, NULL, 0);
    if (g) ep_full_lift(full, full->f, g);
  }
  if (g) ep_full_release_held(full, g);
  // At alpha = 1 elastic and example force cancel: residuals are relative to each.
  if (g) m->internal = sqrt(ep_dot((size_t)full->n3, g, g));
  m->strains = strain_energy(m, x, g);
  if (g) ep_full_release_held(full, g);
  if (g) m->internal = fmax(m->internal, sqrt(ep_dot((size_t)full->n3, g, g)));
  return m->elastic + m->example + m->strains;
}

double ep_full_add_quadratic(ep_full *full, const ep_csr *a, double scale, const double *x,
                             const double *origin, double *g) {
  const size_t n3 = (size_t)full->n3;
  if (scale == 0) return 0;
  for (size_t i = 0; i < n3; i++) full->moved[i] = x[i] - (origin ? origin[i] : 0);
  ep_csr_multiply(a, 1, full->moved, full->pull);
  if (g) ep_axpy(n3, scale, full->pull, g);
  return 0.5 * scale * ep_dot(n3, full->moved, full->pull);
}

double ep_full_evaluate(ep_full_move *m, const double *x, double *g) {
  ep_full *full = m->full;
  const ep_step_def *def = m->def;
  const size_t n3 = (size_t)full->n3;
  double sum = ep_full_inner_energy(m, x, g);
  sum += ep_full_add_quadratic(full, &full->mass, m->inertia, x, full->ahead, g);
  sum += ep_full_add_quadratic(full, &full->mass, m->rate * def->damping_mass, x, full->base, g);
  sum += ep_full_add_quadratic(full, &full->k0, m->rate * def->damping_stiffness, x, full->base, g);
  if (def->force) {
    sum -= ep_dot(n3, def->force, x);
    if (g) ep_axpy(n3, -1, def->force, g);
  }
  if (ep_full_touches(m)) sum += ep_full_contact_energy(full->contact, def, x, g, NULL);
  if (g) ep_full_release_held(full, g);
  return sum;
}

double ep_full_residual(const ep_full_move *m) {
  ep_full *full = m->full;
  const size_t n3 = (size_t)full->n3;
  double outer = 0;
  for (size_t i = 0; i < n3; i++) {
    full->moved[i] = full->x[i] - full->ahead[i];
    if (m->def->force && !full->fem->held[i]) outer += m->def->force[i] * m->def->force[i];
  }
  ep_csr_multiply(&full->mass, 1, full->moved, full->pull);
  const double scale = sqrt(outer) + m->internal +
                       m->inertia * sqrt(ep_dot(n3, full->pull, full->pull)) +
                       1e-8 * full->force_scale;
  return sqrt(ep_dot(n3, full->g, full->g)) / scale;
}
