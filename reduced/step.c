// A step as the minimum of the incremental potential (DESIGN "Time step"; reduced/integrator.h), in
// mass-orthonormal coordinates (U^T M U = I):
//   Phi(x) = inertia |x - ahead|^2 / 2 + rate (x - base)^T D (x - base) / 2 + W(x) + beta W_t(x) -
//   f . x + contact(x)
// with D = alpha I + beta' K0 and the target's energy W_t frozen within the step; relief takes its
// share off W while an example force acts.
#include <math.h>
#include <string.h>

#include "reduced/contact.h"
#include "reduced/state.h"

enum { COOKIE = 0x45504f31 }; // "EPO1"

ep_step_def ep_default_step(void) {
  return (ep_step_def){.cookie = COOKIE,
                       .dt = 1.0 / 60,
                       .strength = 1,
                       .target_tolerance = 1e-6,
                       .tolerance = 1e-6,
                       .max_iterations = 50};
}

int ep_step_def_valid(const ep_step_def *d) {
  return d->cookie == COOKIE && d->dt > 0 && isfinite(d->dt) && d->damping_mass >= 0 &&
         isfinite(d->damping_mass) && d->damping_stiffness >= 0 && isfinite(d->damping_stiffness) &&
         d->strength >= 0 && isfinite(d->strength) && d->relief >= 0 && d->relief <= 1 &&
         d->tolerance > 0 && d->target_tolerance > 0 && d->max_iterations > 0 &&
         ep_contact_def_valid(d) && ep_green_valid(&d->green) &&
         ep_integrator_name(d->integrator) != NULL &&
         (d->example_force == EP_EXAMPLE_ENERGY || d->example_force == EP_EXAMPLE_LINEAR);
}

typedef struct step {
  ep_state *state;
  const ep_step_def *def;
  int examples;              // an example force acts
  const double *kept_weight; // (s) of the material where relief takes a part of it; NULL: all alike
  int contact;               // there are obstacles
  double rate, inertia;      // of the integrator
  double internal;           // last evaluation: |force| inside, energies
  double elastic, pull, strains;
  double cancelling; // energy of terms that cancel: round-off counts from there
} step;

// y = scale * K0 (x - origin) added to g; returns (x - origin)^T K0 (x - origin). origin NULL: 0.
static double add_k0(const step *s, double scale, const double *x, const double *origin,
                     double *g) {
  const int r = s->state->model->size.r;
  const double *k0 = s->state->model->k0;
  double *d = s->state->work, square = 0;
  for (int a = 0; a < r; a++) d[a] = x[a] - (origin ? origin[a] : 0);
  for (int a = 0; a < r; a++) {
    double sum = ep_dot(r, k0 + (size_t)a * (size_t)r, d);
    square += d[a] * sum;
    if (g) g[a] += scale * sum;
  }
  return square;
}

// Elastic and example energy with gradient and Hessian.
static double inner_energy(step *s, const double *x, double *g, double *h, int project) {
  ep_state *state = s->state;
  const ep_step_def *def = s->def;
  const int as_energy = s->examples && def->example_force == EP_EXAMPLE_ENERGY;
  const int by_cubature = state->model->evaluator == EP_EVALUATE_CUBATURE;
  const double kept = s->examples ? 1 - def->relief : 1;
  const double share = (s->kept_weight ? 1 : kept) * ep_green_share(state->model, &def->green);
  ep_green green = def->green; // shares what relief leaves, or the sum would have no lower bound
  green.alpha *= kept;
  int terms = 0;
  if (by_cubature) {
    const double *weight = s->kept_weight ? s->kept_weight : state->model->cubature_w;
    state->term[terms++] = (ep_kernel_term){.scale = share, .weight = weight};
  }
  const int first = terms;
  if (as_energy) terms = ep_force_terms(state, def, terms);
  ep_evaluate(state, terms, x, g, h, project);
  s->pull = 0;
  for (int i = first; i < terms; i++) s->pull += state->term[i].energy;
  s->elastic = by_cubature ? state->term[0].energy : ep_cubic_add(state, share, x, g, h, project);
  if (s->examples && !as_energy)
    s->pull = 0.5 * def->strength * add_k0(s, def->strength, x, state->next_target, g);
  // At alpha = 1 elastic and example force cancel: the residual is relative to each.
  if (g) s->internal = sqrt(ep_dot(state->model->size.r, g, g));
  s->strains = ep_green_potential(state, &green, x, g, h, project);
  s->cancelling = fabs(s->elastic) + fabs(s->strains);
  return s->elastic + s->pull + s->strains;
}

static double energy(void *user, const double *x, double *g, double *h, int project) {
  step *s = user;
  ep_state *state = s->state;
  const ep_step_def *def = s->def;
  const int r = state->model->size.r;
  const double inertia = s->inertia, drag = def->damping_mass * s->rate;
  double sum = inner_energy(s, x, g, h, project);
  if (g) s->internal = fmax(s->internal, sqrt(ep_dot(r, g, g)));
  const double viscous = def->damping_stiffness * s->rate;
  if (viscous > 0) sum += 0.5 * viscous * add_k0(s, viscous, x, state->base, g);
  for (int a = 0; a < r; a++) {
    double ahead = x[a] - state->aside[a], moved = x[a] - state->base[a];
    double force = def->force ? def->force[a] : 0;
    sum += 0.5 * (inertia * ahead * ahead + drag * moved * moved) - force * x[a];
    if (g) g[a] += inertia * ahead + drag * moved - force;
  }
  if (s->contact) sum += ep_contact_energy(state, def, NULL, x, g, h, r);
  if (!h) return sum;
  const int linear = s->examples && def->example_force == EP_EXAMPLE_LINEAR;
  const double stiff = viscous + (linear ? def->strength : 0);
  for (int i = 0; stiff > 0 && i < r * r; i++) h[i] += stiff * state->model->k0[i];
  for (int a = 0; a < r; a++) h[(r + 1) * a] += inertia + drag;
  return sum;
}

// |gradient| over the forces in play; never less than what a strain of 1e-8 makes.
static double residual(void *user, const double *x, const double *g) {
  step *s = user;
  const ep_state *state = s->state;
  const int r = state->model->size.r;
  double ahead = 0, force = s->def->force ? sqrt(ep_dot(r, s->def->force, s->def->force)) : 0;
  for (int a = 0; a < r; a++) ahead += (x[a] - state->aside[a]) * (x[a] - state->aside[a]);
  double scale = force + s->internal + sqrt(ahead) * s->inertia + 1e-8 * state->force_scale;
  return sqrt(ep_dot(r, g, g)) / scale;
}

// Acceleration from the equation of motion, a = f - dW/dq - D v, where no step before left it.
static void start_acceleration(step *s) {
  ep_state *state = s->state;
  const ep_step_def *def = s->def;
  inner_energy(s, state->q, state->g, NULL, 0);
  if (def->damping_stiffness > 0) add_k0(s, def->damping_stiffness, state->v, NULL, state->g);
  for (int a = 0; a < state->model->size.r; a++)
    state->a[a] = (def->force ? def->force[a] : 0) - state->g[a] - def->damping_mass * state->v[a];
}

// What the integrator makes of the motion so far. Where the caller wrote q or v since the last
// step, there is no motion before.
static void predict(step *s) {
  ep_state *state = s->state;
  const size_t r = (size_t)state->model->size.r;
  if (memcmp(state->q, state->end_q, r * sizeof *state->q) != 0 ||
      memcmp(state->v, state->end_v, r * sizeof *state->v) != 0)
    state->dt_before = 0;
  if (s->def->integrator == EP_NEWMARK && state->dt_before == 0) start_acceleration(s);
  const ep_motion motion = {.q = state->q,
                            .v = state->v,
                            .a = state->a,
                            .q_before = state->q_before,
                            .v_before = state->v_before,
                            .dt_before = state->dt_before};
  ep_integrator_predict(s->def->integrator, r, s->def->dt, &motion, state->base, state->aside,
                        &s->rate, &s->inertia);
}

// The acceleration Newmark's formula goes on with is free of contact (reduced/contact.c).
static void take_contact_off(step *s) {
  ep_state *state = s->state;
  const int r = state->model->size.r;
  memset(state->contact_g, 0, (size_t)r * sizeof *state->contact_g);
  ep_contact_energy(state, s->def, NULL, state->x, state->contact_g, NULL, r);
  for (int a = 0; a < r; a++) state->a[a] += state->contact_g[a];
}

// Minimise; again where friction or the depth ask for it.
static ep_status minimise(step *s, ep_newton *newton) {
  for (;;) {
    const ep_status status = ep_newton_minimise(s->state, newton);
    if (status != EP_OK || !s->contact) return status;
    if (!ep_contact_again(s->state, s->def, NULL, s->state->x)) return EP_OK;
    newton->max_iterations = newton->iterations + s->def->max_iterations;
  }
}

// Start at the free flight or at rest, whichever has the lower potential.
static void choose_start(step *s) {
  ep_state *state = s->state;
  const size_t bytes = (size_t)state->model->size.r * sizeof(double);
  double still = energy(s, state->q, NULL, NULL, 0);
  double flight = energy(s, state->aside, NULL, NULL, 0);
  memcpy(state->x, flight < still ? state->aside : state->q, bytes);
}

static void finish(step *s) {
  ep_state *state = s->state;
  for (int a = 0; a < state->model->size.r; a++) {
    state->q_before[a] = state->q[a];
    state->v_before[a] = state->v[a];
    state->a[a] = s->inertia * (state->x[a] - state->aside[a]);
    state->v[a] = state->end_v[a] = s->rate * (state->x[a] - state->base[a]);
    state->q[a] = state->end_q[a] = state->x[a];
  }
  if (s->contact && s->def->integrator == EP_NEWMARK) take_contact_off(s);
  state->dt_before = s->def->dt;
  if (s->examples) ep_commit_target(state);
}

// What the model cannot do with its regions: act on a part of the object by K0 or by polynomials.
static int suits_regions(const ep_model *m, const ep_step_def *def) {
  if (!m->size.regions || def->strength == 0) return 1;
  for (int g = 0; def->region_strength && g < m->size.regions; g++)
    if (!(def->region_strength[g] >= 0) || !isfinite(def->region_strength[g])) return 0;
  return def->example_force == EP_EXAMPLE_ENERGY &&
         (def->relief == 0 || m->evaluator == EP_EVALUATE_CUBATURE);
}

// Relief of regions: the share of an element that some region with strength takes.
static const double *relieve_regions(ep_state *state, const ep_step_def *def) {
  const ep_model *m = state->model;
  for (int e = 0; e < m->size.s; e++) {
    double taken = 0;
    for (int g = 0; g < m->size.regions; g++)
      if (!def->region_strength || def->region_strength[g] > 0)
        taken = fmax(taken, m->region_inside[(size_t)g * (size_t)m->size.s + (size_t)e]);
    state->kept_weight[e] = m->cubature_w[e] - def->relief * taken;
  }
  return state->kept_weight;
}

ep_status ep_step(ep_state *state, const ep_step_def *def, ep_step_report *report) {
  ep_step_report unused;
  if (!report) report = &unused;
  *report = (ep_step_report){0};
  if (!ep_step_def_valid(def) || !suits_regions(state->model, def)) return EP_ERR_ARGUMENT;
  step s = {.state = state, .def = def, .examples = state->model->size.k > 0 && def->strength > 0};
  s.examples = s.examples && state->model->size.m > 0; // else only their strains are known
  s.contact = ep_contact_acts(state, def);
  if (s.examples) {
    ep_status status = ep_find_target(state, def, &report->target);
    if (status != EP_OK) return status;
  }
  if (s.examples && state->model->size.regions && def->relief > 0)
    s.kept_weight = relieve_regions(state, def);
  ep_newton newton = {.energy = energy,
                      .residual = residual,
                      .user = &s,
                      .cancelling = &s.cancelling,
                      .tolerance = fmax(def->tolerance, state->force_noise),
                      .max_iterations = def->max_iterations};
  predict(&s);
  if (s.contact) ep_contact_begin(state, def, NULL, NULL, state->q, state->aside);
  choose_start(&s);
  ep_status status = minimise(&s, &newton);
  report->newton_iterations = newton.iterations;
  report->line_search_steps = newton.line_search_steps;
  report->projections = newton.projections;
  report->residual = newton.residual_now;
  if (status != EP_OK) return status;
  if (s.contact) {
    ep_contact_measure(state, def, NULL, state->x, &report->contact);
    ep_contact_commit(state, &report->contact);
  }
  finish(&s);
  report->elastic_energy = s.elastic;
  report->example_energy = s.pull;
  report->green_energy = s.strains;
  report->kinetic_energy = 0.5 * ep_dot(state->model->size.r, state->v, state->v);
  return EP_OK;
}

double ep_example_force_energy(ep_state *state, const ep_step_def *def, const double *q, double *f,
                               double *h, int project) {
  const int r = state->model->size.r;
  const step s = {.state = state, .def = def};
  if (f) memset(f, 0, (size_t)r * sizeof *f);
  if (h) memset(h, 0, (size_t)(r * r) * sizeof *h);
  if (state->model->size.k == 0 || state->model->size.m == 0 || def->strength == 0) return 0;
  if (def->example_force == EP_EXAMPLE_ENERGY)
    return ep_evaluate(state, ep_force_terms(state, def, 0), q, f, h, project);
  for (int i = 0; h && i < r * r; i++) h[i] = def->strength * state->model->k0[i];
  return 0.5 * def->strength * add_k0(&s, def->strength, q, state->target, f);
}

ep_status ep_interpolate(ep_state *state, const ep_step_def *def, ep_target_report *report) {
  ep_target_report unused;
  if (!report) report = &unused;
  *report = (ep_target_report){0};
  if (!ep_step_def_valid(def) || !suits_regions(state->model, def)) return EP_ERR_ARGUMENT;
  if (state->model->size.k == 0 || state->model->size.m == 0) return EP_OK;
  ep_status status = ep_find_target(state, def, report);
  if (status == EP_OK) ep_commit_target(state);
  return status;
}
