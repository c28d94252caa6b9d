#include "reduced/bake/full_step.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/petsc.h"
#include "reduced/bake/fem_assembly.h"
#include "reduced/bake/vectors.h"

// clang-format off
#define VECTORS(X)                                                                                 \
  X(u) X(v) X(a) X(u_before) X(v_before) X(end_u) X(end_v) /* the motion: reduced/integrator.h */   \
  X(base) X(ahead) X(x) X(g) X(direction) X(trial)         /* Newton */                            \
  X(moved) X(pull)                                         /* products */                          \
  X(residual) X(steered) X(search) X(image)                /* conjugate gradients */
// clang-format on

struct ep_full {
  const ep_fem *fem;
  ep_state *examples;
  int n3, r;
  ep_csr mass, k0, k;
  ep_factor *factor;
  double dt_before;
  double force_scale;  // sum_e V (lambda + 2 mu) |gradients|: nodal force at unit strain
  double energy_scale; // sum_e V (lambda + 2 mu): energy at unit strain
  double *block;       // all vectors
  double *mu;          // (r x 3n) rows M u_a
  double *q, *f, *fh;  // (r) coordinates, example force, Hessian (r x r)
#define X(name) double *name;
  VECTORS(X)
#undef X
};

// ---- set-up ------------------------------------------------------------------------------------

static ep_status allocate(ep_full *full, ep_error *err) {
  const size_t n3 = (size_t)full->n3, r = (size_t)full->r;
  size_t vectors = 0, at = 0;
#define X(name) vectors++;
  VECTORS(X)
#undef X
  full->block = calloc((vectors + r) * n3 + r * (r + 2) + 1, sizeof *full->block);
  if (!full->block)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a full-space run of %d unknowns", full->n3);
#define X(name) full->name = full->block + n3 * at++;
  VECTORS(X)
#undef X
  full->mu = full->block + n3 * vectors;
  full->q = full->mu + r * n3;
  full->f = full->q + r;
  full->fh = full->f + r;
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

ep_status ep_full_create(const ep_fem *fem, ep_state *examples, ep_full **out, ep_error *err) {
  *out = NULL;
  const ep_model *model = examples ? ep_state_model(examples) : NULL;
  if (model && (model->size.n != fem->mesh->nv || model->size.nt != fem->mesh->nt))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "full-space run: the model of the examples has %d vertices and %d tets, the "
                   "mesh %d and %d",
                   model->size.n, model->size.nt, fem->mesh->nv, fem->mesh->nt);
  ep_full *full = calloc(1, sizeof *full);
  if (!full) return ep_fail(err, EP_ERR_MEMORY, "no memory for a full-space run");
  full->fem = fem;
  full->n3 = 3 * fem->mesh->nv;
  if (model && model->size.k > 0) {
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
  ep_factor_free(full->factor);
  free(full->block);
  free(full);
}

double *ep_full_displacement(ep_full *full) {
  return full->u;
}
double *ep_full_velocity(ep_full *full) {
  return full->v;
}

size_t ep_full_bytes(const ep_full *full) {
  const size_t entries = (size_t)full->k.start[full->n3], r = (size_t)full->r;
  size_t vectors = 0;
#define X(name) vectors++;
  VECTORS(X)
#undef X
  return 3 * (entries * (sizeof(double) + sizeof(int)) + (size_t)full->n3 * sizeof(int)) +
         ep_factor_bytes(full->factor) +
         ((vectors + r) * (size_t)full->n3 + r * (r + 2)) * sizeof(double);
}

// ---- the incremental potential -----------------------------------------------------------------

typedef struct step {
  ep_full *full;
  const ep_step_def *def;
  double rate, inertia;            // of the integrator
  double internal;                 // |forces inside| of the last gradient
  double elastic, example, energy; // of the last evaluation
  ep_full_report *report;
} step;

static void release_held(const ep_full *full, double *g) {
  for (int i = 0; i < full->n3; i++)
    if (full->fem->held[i]) g[i] = 0;
}

static void to_coordinates(ep_full *full, const double *x) {
  for (int a = 0; a < full->r; a++)
    full->q[a] = ep_dot((size_t)full->n3, full->mu + (size_t)a * (size_t)full->n3, x);
}

// g += M U f
static void lift(const ep_full *full, const double *f, double *g) {
  for (int a = 0; a < full->r; a++)
    ep_axpy((size_t)full->n3, f[a], full->mu + (size_t)a * (size_t)full->n3, g);
}

// What is left of the material's own energy beside the example force.
static double material_share(const step *s) {
  return s->full->examples && s->def->strength > 0 ? 1 - s->def->relief : 1;
}

// (1 - relief) W(x) + beta W_t(U^T M x), gradient into g (3n) unless NULL.
static double inner_energy(step *s, const double *x, double *g) {
  ep_full *full = s->full;
  const double share = material_share(s);
  s->elastic = share * ep_fem_energy(full->fem, x);
  s->example = 0;
  if (g) ep_fem_force(full->fem, x, g);
  for (int i = 0; g && share != 1 && i < full->n3; i++) g[i] *= share;
  if (full->examples) {
    to_coordinates(full, x);
    s->example =
        ep_example_force_energy(full->examples, s->def, full->q, g ? full->f : NULL, NULL, 0);
    if (g) lift(full, full->f, g);
  }
  if (g) release_held(full, g);
  return s->elastic + s->example;
}

// 1/2 scale |x - origin|_A^2, gradient added to g unless NULL.
static double add_quadratic(ep_full *full, const ep_csr *a, double scale, const double *x,
                            const double *origin, double *g) {
  const size_t n3 = (size_t)full->n3;
  if (scale == 0) return 0;
  for (size_t i = 0; i < n3; i++) full->moved[i] = x[i] - (origin ? origin[i] : 0);
  ep_csr_multiply(a, 1, full->moved, full->pull);
  if (g) ep_axpy(n3, scale, full->pull, g);
  return 0.5 * scale * ep_dot(n3, full->moved, full->pull);
}

static double evaluate(step *s, const double *x, double *g) {
  ep_full *full = s->full;
  const ep_step_def *def = s->def;
  const size_t n3 = (size_t)full->n3;
  double sum = inner_energy(s, x, g);
  if (g) s->internal = sqrt(ep_dot(n3, g, g));
  sum += add_quadratic(full, &full->mass, s->inertia, x, full->ahead, g);
  sum += add_quadratic(full, &full->mass, s->rate * def->damping_mass, x, full->base, g);
  sum += add_quadratic(full, &full->k0, s->rate * def->damping_stiffness, x, full->base, g);
  if (def->force) {
    sum -= ep_dot(n3, def->force, x);
    if (g) ep_axpy(n3, -1, def->force, g);
  }
  if (g) release_held(full, g);
  return sum;
}

// |gradient| over the forces in play; never less than what a strain of 1e-8 makes.
static double residual(const step *s) {
  ep_full *full = s->full;
  const size_t n3 = (size_t)full->n3;
  double outer = 0;
  for (size_t i = 0; i < n3; i++) {
    full->moved[i] = full->x[i] - full->ahead[i];
    if (s->def->force && !full->fem->held[i]) outer += s->def->force[i] * s->def->force[i];
  }
  ep_csr_multiply(&full->mass, 1, full->moved, full->pull);
  const double scale = sqrt(outer) + s->internal +
                       s->inertia * sqrt(ep_dot(n3, full->pull, full->pull)) +
                       1e-8 * full->force_scale;
  return sqrt(ep_dot(n3, full->g, full->g)) / scale;
}

// ---- Newton ------------------------------------------------------------------------------------

enum { BACKTRACKS = 40, CONJUGATE_ITERATIONS = 200 };
// As in reduced/newton.c: a step which strains no element by more than this is lost in round-off;
// the larger one where energies no longer tell points apart.
static const double TINY_STRAIN = 1e-13, SMALL_STRAIN = 1e-9;
static const double CONJUGATE_TOLERANCE = 1e-8;

static ep_status factorise(step *s, int project, ep_error *err) {
  ep_full *full = s->full;
  const size_t entries = (size_t)full->k.start[full->n3];
  ep_fem_stiffness(full->fem, full->x, project, &full->k);
  const double share = material_share(s);
  for (size_t i = 0; share != 1 && i < entries; i++) full->k.value[i] *= share;
  ep_axpy(entries, s->inertia + s->rate * s->def->damping_mass, full->mass.value, full->k.value);
  ep_axpy(entries, s->rate * s->def->damping_stiffness, full->k0.value, full->k.value);
  if (full->examples) {
    to_coordinates(full, full->x);
    ep_example_force_energy(full->examples, s->def, full->q, NULL, full->fh, project);
  }
  return ep_factor_update(full->factor, &full->k, err);
}

// image = (K + M U H_t U^T M) search
static void apply(ep_full *full, const double *search, double *image) {
  const size_t r = (size_t)full->r;
  ep_csr_multiply(&full->k, 1, search, image);
  to_coordinates(full, search);
  for (size_t a = 0; a < r; a++) full->f[a] = ep_dot(r, full->fh + a * r, full->q);
  lift(full, full->f, image);
  release_held(full, image);
}

static ep_status solve(step *s, const double *b, double *x, ep_error *err) {
  s->report->solves++;
  return ep_factor_solve(s->full->factor, 1, b, x, err);
}

// The examples couple everything through r coordinates: their part of the matrix is left to
// conjugate gradients, preconditioned by the factor of the rest (exact at once where they add
// nothing). Ends early, with a direction of descent, where the curvature is negative.
static ep_status conjugate(step *s, ep_error *err) {
  ep_full *full = s->full;
  const size_t n3 = (size_t)full->n3;
  double *d = full->direction, *res = full->residual, *z = full->steered;
  memset(d, 0, n3 * sizeof *d);
  for (size_t i = 0; i < n3; i++) res[i] = -full->g[i];
  EP_TRY(solve(s, res, z, err));
  memcpy(full->search, z, n3 * sizeof *z);
  double rz = ep_dot(n3, res, z);
  const double enough = CONJUGATE_TOLERANCE * CONJUGATE_TOLERANCE * rz;
  for (int i = 0; i < CONJUGATE_ITERATIONS; i++) {
    apply(full, full->search, full->image);
    const double curvature = ep_dot(n3, full->search, full->image);
    if (!(curvature > 0)) {
      if (i == 0) memcpy(d, z, n3 * sizeof *d);
      return EP_OK;
    }
    ep_axpy(n3, rz / curvature, full->search, d);
    ep_axpy(n3, -rz / curvature, full->image, res);
    EP_TRY(solve(s, res, z, err));
    const double next = ep_dot(n3, res, z);
    if (next <= enough) return EP_OK;
    for (size_t j = 0; j < n3; j++) full->search[j] = z[j] + next / rz * full->search[j];
    rz = next;
  }
  return EP_OK;
}

// Newton direction: the exact stiffness where it is positive definite, else with the elements'
// tangents projected; with the inertia that always has a factor.
static ep_status find_direction(step *s, ep_error *err) {
  ep_full *full = s->full;
  ep_error indefinite = {0}; // expected at times: not the caller's concern
  ep_status status = factorise(s, 0, &indefinite);
  if (status == EP_ERR_NUMERIC) {
    s->report->projections++;
    status = factorise(s, 1, err);
  } else if (status != EP_OK) {
    return ep_fail(err, status, "%s", indefinite.text);
  }
  if (status != EP_OK) return status;
  if (full->examples && s->def->strength > 0) return conjugate(s, err);
  EP_TRY(solve(s, full->g, full->direction, err));
  for (int i = 0; i < full->n3; i++) full->direction[i] = -full->direction[i];
  return EP_OK;
}

static double largest_strain(const ep_full *full) {
  double largest = 0;
  for (int e = 0; e < full->fem->mesh->nt; e++) {
    double d[9];
    ep_fem_displacement_gradient(full->fem, e, full->direction, d);
    largest = fmax(largest, ep_dot(9, d, d));
  }
  return sqrt(largest);
}

// Armijo along the direction; moves x. Returns the step, 0: none.
static double line_search(step *s) {
  ep_full *full = s->full;
  const size_t n3 = (size_t)full->n3;
  const double slope = ep_dot(n3, full->g, full->direction);
  // Strains are known to 1e-16, energies ~ strain^2 therefore to 1e-16 sqrt(energy at strain 1).
  const double noise =
      1e-13 * (fabs(s->energy) + fabs(slope)) + 1e-15 * sqrt(fabs(s->energy) * full->energy_scale);
  double length = 1;
  if (!(slope < 0)) return 0;
  for (int i = 0; i < BACKTRACKS; i++, length *= 0.5) {
    memcpy(full->trial, full->x, n3 * sizeof *full->x);
    ep_axpy(n3, length, full->direction, full->trial);
    if (evaluate(s, full->trial, NULL) <= s->energy + 1e-4 * length * slope + noise) {
      memcpy(full->x, full->trial, n3 * sizeof *full->x);
      return length;
    }
    s->report->line_search_steps++;
  }
  return 0;
}

static ep_status minimise(step *s, ep_error *err) {
  ep_full *full = s->full;
  for (;;) {
    s->energy = evaluate(s, full->x, full->g);
    s->report->residual = residual(s);
    if (s->report->residual <= s->def->tolerance) return EP_OK;
    if (s->report->newton_iterations == s->def->max_iterations || !isfinite(s->energy) ||
        !isfinite(s->report->residual))
      break;
    s->report->newton_iterations++;
    EP_TRY(find_direction(s, err));
    const double strain = largest_strain(full);
    const double length = line_search(s);
    if (strain <= (length > 0 ? TINY_STRAIN : SMALL_STRAIN)) { // nothing left but round-off
      s->energy = evaluate(s, full->x, full->g);
      s->report->residual = residual(s);
      return EP_OK;
    }
    if (length == 0) break;
  }
  return ep_fail(err, EP_ERR_NUMERIC,
                 "full-space step: residual %.3g after %d Newton iterations; take a smaller time "
                 "step",
                 s->report->residual, s->report->newton_iterations);
}

// ---- step --------------------------------------------------------------------------------------

// a = M^-1 (f - dW/du - D v), where no step before left it.
static ep_status start_acceleration(step *s, ep_error *err) {
  ep_full *full = s->full;
  const size_t n3 = (size_t)full->n3;
  inner_energy(s, full->u, full->g);
  add_quadratic(full, &full->mass, s->def->damping_mass, full->v, NULL, full->g);
  add_quadratic(full, &full->k0, s->def->damping_stiffness, full->v, NULL, full->g);
  for (size_t i = 0; i < n3; i++) full->g[i] = (s->def->force ? s->def->force[i] : 0) - full->g[i];
  release_held(full, full->g);
  EP_TRY(ep_factor_update(full->factor, &full->mass, err));
  return ep_factor_solve(full->factor, 1, full->g, full->a, err);
}

static ep_status predict(step *s, ep_error *err) {
  ep_full *full = s->full;
  const size_t n3 = (size_t)full->n3;
  if (memcmp(full->u, full->end_u, n3 * sizeof *full->u) != 0 ||
      memcmp(full->v, full->end_v, n3 * sizeof *full->v) != 0)
    full->dt_before = 0;
  if (s->def->integrator == EP_NEWMARK && full->dt_before == 0) EP_TRY(start_acceleration(s, err));
  const ep_motion motion = {.q = full->u,
                            .v = full->v,
                            .a = full->a,
                            .q_before = full->u_before,
                            .v_before = full->v_before,
                            .dt_before = full->dt_before};
  ep_integrator_predict(s->def->integrator, n3, s->def->dt, &motion, full->base, full->ahead,
                        &s->rate, &s->inertia);
  const double still = evaluate(s, full->u, NULL), flight = evaluate(s, full->ahead, NULL);
  memcpy(full->x, flight < still ? full->ahead : full->u, n3 * sizeof *full->x);
  return EP_OK;
}

static ep_status interpolate(step *s, ep_error *err) {
  ep_full *full = s->full;
  to_coordinates(full, full->u);
  memcpy(ep_state_q(full->examples), full->q, (size_t)full->r * sizeof *full->q);
  to_coordinates(full, full->v);
  memcpy(ep_state_velocity(full->examples), full->q, (size_t)full->r * sizeof *full->q);
  ep_status status = ep_interpolate(full->examples, s->def, &s->report->target);
  if (status == EP_OK) return EP_OK;
  return ep_fail(err, status, "full-space step: the interpolation of the examples failed");
}

static void finish(step *s) {
  ep_full *full = s->full;
  const size_t n3 = (size_t)full->n3, bytes = n3 * sizeof(double);
  memcpy(full->u_before, full->u, bytes);
  memcpy(full->v_before, full->v, bytes);
  for (size_t i = 0; i < n3; i++) {
    full->a[i] = s->inertia * (full->x[i] - full->ahead[i]);
    full->v[i] = s->rate * (full->x[i] - full->base[i]);
  }
  memcpy(full->u, full->x, bytes);
  memcpy(full->end_u, full->u, bytes);
  memcpy(full->end_v, full->v, bytes);
  full->dt_before = s->def->dt;
  ep_csr_multiply(&full->mass, 1, full->v, full->pull);
  s->report->kinetic_energy = 0.5 * ep_dot(n3, full->v, full->pull);
  s->report->elastic_energy = s->elastic;
  s->report->example_energy = s->example;
}

ep_status ep_full_step(ep_full *full, const ep_step_def *def, ep_full_report *report,
                       ep_error *err) {
  ep_full_report unused;
  if (!report) report = &unused;
  *report = (ep_full_report){0};
  if (!ep_step_def_valid(def))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "full-space step: the definition of the step is not valid");
  step s = {.full = full, .def = def, .report = report};
  if (full->examples && def->strength > 0) EP_TRY(interpolate(&s, err));
  EP_TRY(predict(&s, err));
  EP_TRY(minimise(&s, err));
  finish(&s);
  return EP_OK;
}
