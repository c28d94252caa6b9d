#include "reduced/bake/full_step.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "reduced/bake/fem_assembly.h"
#include "reduced/bake/full_private.h"
#include "reduced/bake/vectors.h"

// ---- set-up ------------------------------------------------------------------------------------

static size_t vectors(void) {
  size_t count = 0;
#define X(name) count++;
  EP_FULL_VECTORS(X)
#undef X
  return count;
}

// Doubles of all vectors and small matrices.
static size_t numbers(const ep_full *full) {
  const size_t r = (size_t)full->r, p = (size_t)full->p;
  return (vectors() + r + 2 * p) * (size_t)full->n3 + r * (r + 2) + p;
}

static ep_status allocate(ep_full *full, ep_error *err) {
  const size_t n3 = (size_t)full->n3, r = (size_t)full->r, p = (size_t)full->p;
  size_t at = 0;
  full->block = calloc(numbers(full), sizeof *full->block);
  if (!full->block)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a full-space run of %d unknowns", full->n3);
#define X(name) full->name = full->block + n3 * at++;
  EP_FULL_VECTORS(X)
#undef X
  full->mu = full->block + n3 * vectors();
  full->columns = full->mu + r * n3;
  full->back = full->columns + p * n3;
  full->q = full->back + p * n3;
  full->f = full->q + r;
  full->fh = full->f + r;
  full->y = full->fh + r * r;
  return EP_OK;
}

static double gradient_norm(const ep_fem *fem, int e) {
  double square = 0;
  for (int i = 0; i < 12; i++)
    square += fem->gradient[12 * (size_t)e + i] * fem->gradient[12 * (size_t)e + i];
  return sqrt(square);
}

static ep_status set_up(ep_full *full, ep_error *err) {
  const ep_fem *fem = full->fem;
  EP_TRY(allocate(full, err));
  EP_TRY(ep_fem_mass(fem, &full->mass, err));
  EP_TRY(ep_fem_rest_stiffness(fem, &full->k0, err));
  EP_TRY(ep_csr_from_tets(fem->mesh->nv, fem->mesh->nt, fem->mesh->tet, 3, &full->k, err));
  if (full->green && fem->model != EP_STVK && fem->model != EP_STVK_VOLUME)
    EP_TRY(ep_csr_from_tets(fem->mesh->nv, fem->mesh->nt, fem->mesh->tet, 3, &full->k_stvk, err));
  full->stvk = *fem;
  full->stvk.model = EP_STVK_VOLUME;
  EP_TRY(ep_factor_create(&full->mass, fem->held, 1, &full->factor, err));
  for (int e = 0; e < fem->mesh->nt; e++) {
    const double stiffness = fem->volume[e] * (fem->lambda[e] + 2 * fem->mu[e]);
    full->energy_scale += stiffness;
    full->force_scale += stiffness * gradient_norm(fem, e);
  }
  for (int a = 0; a < full->r; a++)
    ep_csr_multiply(&full->mass, 1,
                    ep_state_model(full->examples)->u + (size_t)a * (size_t)full->n3,
                    full->mu + (size_t)a * (size_t)full->n3);
  return EP_OK;
}

static ep_status check_meshes(const ep_fem *fem, const ep_model *model, const ep_green_full *green,
                              ep_error *err) {
  const int nv = fem->mesh->nv, nt = fem->mesh->nt;
  if (model && (model->size.n != nv || model->size.nt != nt))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "full-space run: the model of the examples has %d vertices and %d tets, the "
                   "mesh %d and %d",
                   model->size.n, model->size.nt, nv, nt);
  if (green && (green->space.fem->mesh->nv != nv || green->space.fem->mesh->nt != nt))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "full-space run: the strains of the examples have %d vertices and %d tets, the "
                   "mesh %d and %d",
                   green->space.fem->mesh->nv, green->space.fem->mesh->nt, nv, nt);
  return EP_OK;
}

ep_status ep_full_create(const ep_fem *fem, ep_state *examples, ep_green_full *green, ep_full **out,
                         ep_error *err) {
  *out = NULL;
  const ep_model *model = examples ? ep_state_model(examples) : NULL;
  EP_TRY(check_meshes(fem, model, green, err));
  ep_full *full = calloc(1, sizeof *full);
  if (!full) return ep_fail(err, EP_ERR_MEMORY, "no memory for a full-space run");
  full->fem = fem;
  full->green = green;
  full->n3 = 3 * fem->mesh->nv;
  full->p = green ? green->space.count : 0;
  if (model && model->size.k > 0 && model->size.m > 0) { // else only their strains are known
    full->examples = examples;
    full->r = model->size.r;
  }
  ep_status status = set_up(full, err);
  if (status == EP_OK) {
    *out = full;
    return EP_OK;
  }
  ep_full_free(full);
  return status;
}

void ep_full_free(ep_full *full) {
  if (!full) return;
  ep_csr_free(&full->mass);
  ep_csr_free(&full->k0);
  ep_csr_free(&full->k);
  ep_csr_free(&full->k_stvk);
  ep_factor_free(full->factor);
  ep_full_contact_free(full->contact);
  free(full->block);
  free(full);
}

double *ep_full_displacement(ep_full *full) {
  return full->u;
}
double *ep_full_velocity(ep_full *full) {
  return full->v;
}

void ep_full_coordinates(ep_full *full, double *q) {
  ep_full_to_coordinates(full, full->u);
  memcpy(q, full->q, (size_t)full->r * sizeof *q);
}

size_t ep_full_bytes(const ep_full *full) {
  const size_t entries = (size_t)full->k.start[full->n3], matrices = full->k_stvk.n ? 4 : 3;
  const size_t stresses = 6 * (size_t)full->p * (size_t)full->fem->mesh->nt;
  return matrices * (entries * (sizeof(double) + sizeof(int)) + (size_t)full->n3 * sizeof(int)) +
         ep_factor_bytes(full->factor) + (numbers(full) + stresses) * sizeof(double);
}

// ---- Newton ------------------------------------------------------------------------------------

enum { BACKTRACKS = 40 };
// As in reduced/newton.c: a step which strains no element by more than this is lost in round-off;
// the larger one where energies no longer tell points apart.
static const double TINY_STRAIN = 1e-13, SMALL_STRAIN = 1e-9;

// Of the Newton step; or how far it goes over the diagonal: rigid motion strains nothing.
static double largest_strain(const ep_full *full) {
  double largest = 0;
  const double diagonal = ep_mesh_diagonal(full->fem->mesh);
  for (int i = 0; i < full->n3; i++) largest = fmax(largest, fabs(full->direction[i]) / diagonal);
  largest *= largest;
  for (int e = 0; e < full->fem->mesh->nt; e++) {
    double d[9];
    ep_fem_displacement_gradient(full->fem, e, full->direction, d);
    largest = fmax(largest, ep_dot(9, d, d));
  }
  return sqrt(largest);
}

// Armijo along the direction; moves x. Returns the step, 0: none.
static double line_search(ep_full_move *m) {
  ep_full *full = m->full;
  const size_t n3 = (size_t)full->n3;
  const double slope = ep_dot(n3, full->g, full->direction);
  // Strains are known to 1e-16, energies ~ strain^2 therefore to 1e-16 sqrt(energy at strain 1).
  // Elastic energy and example potential may cancel: round-off counts from each.
  const double size = fabs(m->energy) + fabs(m->elastic) + fabs(m->strains);
  const double noise = 1e-13 * (size + fabs(slope)) + 1e-15 * sqrt(size * full->energy_scale);
  double length = 1;
  if (!(slope < 0)) return 0;
  for (int i = 0; i < BACKTRACKS; i++, length *= 0.5) {
    memcpy(full->trial, full->x, n3 * sizeof *full->x);
    ep_axpy(n3, length, full->direction, full->trial);
    if (ep_full_evaluate(m, full->trial, NULL) <= m->energy + 1e-4 * length * slope + noise) {
      memcpy(full->x, full->trial, n3 * sizeof *full->x);
      return length;
    }
    m->report->line_search_steps++;
  }
  return 0;
}

static ep_status minimise(ep_full_move *m, ep_error *err) {
  ep_full *full = m->full;
  for (;;) {
    m->energy = ep_full_evaluate(m, full->x, full->g);
    m->report->residual = ep_full_residual(m);
    if (m->report->residual <= m->def->tolerance) return EP_OK;
    if (m->report->newton_iterations == m->iterations || !isfinite(m->energy) ||
        !isfinite(m->report->residual))
      break;
    m->report->newton_iterations++;
    EP_TRY(ep_full_find_direction(m, err));
    const double strain = largest_strain(full);
    const double length = line_search(m);
    if (strain <= (length > 0 ? TINY_STRAIN : SMALL_STRAIN)) { // nothing left but round-off
      m->energy = ep_full_evaluate(m, full->x, full->g);
      m->report->residual = ep_full_residual(m);
      return EP_OK;
    }
    if (length == 0) break;
  }
  return ep_fail(err, EP_ERR_NUMERIC,
                 "full-space step: residual %.3g after %d Newton iterations; take a smaller time "
                 "step",
                 m->report->residual, m->report->newton_iterations);
}

// ---- step --------------------------------------------------------------------------------------

// a = M^-1 (f - dW/du - D v), where no step before left it.
static ep_status start_acceleration(ep_full_move *m, ep_error *err) {
  ep_full *full = m->full;
  const size_t n3 = (size_t)full->n3;
  ep_full_inner_energy(m, full->u, full->g);
  ep_full_add_quadratic(full, &full->mass, m->def->damping_mass, full->v, NULL, full->g);
  ep_full_add_quadratic(full, &full->k0, m->def->damping_stiffness, full->v, NULL, full->g);
  for (size_t i = 0; i < n3; i++) full->g[i] = (m->def->force ? m->def->force[i] : 0) - full->g[i];
  ep_full_release_held(full, full->g);
  EP_TRY(ep_factor_update(full->factor, &full->mass, err));
  return ep_factor_solve(full->factor, 1, full->g, full->a, err);
}

static ep_status predict(ep_full_move *m, ep_error *err) {
  ep_full *full = m->full;
  const size_t n3 = (size_t)full->n3;
  if (memcmp(full->u, full->end_u, n3 * sizeof *full->u) != 0 ||
      memcmp(full->v, full->end_v, n3 * sizeof *full->v) != 0 ||
      full->end_integrator != (int)m->def->integrator)
    full->dt_before = 0;
  full->dt_before = ep_integrator_before(m->def->integrator, m->def->dt, full->dt_before);
  if (m->def->integrator == EP_NEWMARK && full->dt_before == 0) EP_TRY(start_acceleration(m, err));
  const ep_motion motion = {.q = full->u,
                            .v = full->v,
                            .a = full->a,
                            .q_before = full->u_before,
                            .v_before = full->v_before,
                            .dt_before = full->dt_before};
  ep_integrator_predict(m->def->integrator, n3, m->def->dt, &motion, full->base, full->ahead,
                        &m->rate, &m->inertia);
  if (ep_full_touches(m))
    ep_full_contact_begin(full->contact, m->def, full->dt_before, full->u, full->ahead);
  const double still = ep_full_evaluate(m, full->u, NULL),
               flight = ep_full_evaluate(m, full->ahead, NULL);
  memcpy(full->x, flight < still ? full->ahead : full->u, n3 * sizeof *full->x);
  return EP_OK;
}

static ep_status interpolate(ep_full_move *m, ep_error *err) {
  ep_full *full = m->full;
  ep_full_to_coordinates(full, full->u);
  memcpy(ep_state_q(full->examples), full->q, (size_t)full->r * sizeof *full->q);
  ep_full_to_coordinates(full, full->v);
  memcpy(ep_state_velocity(full->examples), full->q, (size_t)full->r * sizeof *full->q);
  ep_status status = ep_interpolate(full->examples, m->def, &m->report->target);
  if (status == EP_OK) return EP_OK;
  return ep_fail(err, status, "full-space step: the interpolation of the examples failed");
}

// Minimise; again while friction asks for it.
static ep_status minimise_all(ep_full_move *m, ep_error *err) {
  m->iterations = m->def->max_iterations;
  for (;;) {
    EP_TRY(minimise(m, err));
    if (!ep_full_touches(m) || !ep_full_contact_again(m->full->contact, m->def, m->full->x))
      return EP_OK;
    m->iterations = m->report->newton_iterations + m->def->max_iterations;
  }
}

// Acceleration by contact, the other way round, into `trial`: what the integrator goes on with is
// free of it (ep_contact_share).
static ep_status contact_acceleration(ep_full_move *m, ep_error *err) {
  ep_full *full = m->full;
  memset(full->g, 0, (size_t)full->n3 * sizeof *full->g);
  ep_full_contact_energy(full->contact, m->def, full->x, full->g, NULL);
  ep_full_release_held(full, full->g);
  EP_TRY(ep_factor_update(full->factor, &full->mass, err));
  return ep_factor_solve(full->factor, 1, full->g, full->trial, err);
}

// Nothing can fail any more.
static void finish(ep_full_move *m, int contact_free) {
  ep_full *full = m->full;
  const size_t n3 = (size_t)full->n3, bytes = n3 * sizeof(double);
  memcpy(full->u_before, full->u, bytes);
  memcpy(full->v_before, full->v, bytes);
  for (size_t i = 0; i < n3; i++) {
    full->a[i] = m->inertia * (full->x[i] - full->ahead[i]);
    full->v[i] = m->rate * (full->x[i] - full->base[i]);
  }
  const double time = 1 / (m->rate + m->def->damping_mass);
  if (contact_free && m->def->integrator == EP_NEWMARK)
    ep_axpy(n3, 1, full->trial, full->a);
  else if (contact_free)
    ep_axpy(n3, -time, full->trial, full->v_before);
  memcpy(full->u, full->x, bytes);
  memcpy(full->end_u, full->u, bytes);
  memcpy(full->end_v, full->v, bytes);
  full->dt_before = m->def->dt;
  full->end_integrator = (int)m->def->integrator;
  ep_csr_multiply(&full->mass, 1, full->v, full->pull);
  m->report->kinetic_energy = 0.5 * ep_dot(n3, full->v, full->pull);
  m->report->elastic_energy = m->elastic;
  m->report->example_energy = m->example;
  m->report->green_energy = m->strains;
}

ep_status ep_full_step(ep_full *full, const ep_step_def *def, ep_full_report *report,
                       ep_error *err) {
  ep_full_report unused;
  if (!report) report = &unused;
  *report = (ep_full_report){0};
  if (!ep_step_def_valid(def))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "full-space step: the definition of the step is not valid");
  if (full->green) full->green->weak = def->green;
  ep_full_move m = {.full = full, .def = def, .report = report};
  if (ep_full_pulls(&m)) EP_TRY(interpolate(&m, err));
  if (ep_full_touches(&m) && !full->contact)
    EP_TRY(ep_full_contact_create(full->fem, &full->contact, err));
  EP_TRY(predict(&m, err));
  EP_TRY(minimise_all(&m, err));
  const int contact_free = ep_full_touches(&m) && ep_contact_split(def);
  if (contact_free) EP_TRY(contact_acceleration(&m, err));
  if (ep_full_touches(&m)) ep_full_contact_measure(full->contact, def, full->x, &report->contact);
  finish(&m, contact_free);
  return EP_OK;
}
