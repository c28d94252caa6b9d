// A step as the minimum of the incremental potential (docs/method.md "Time step";
// reduced/integrator.h), in mass-orthonormal coordinates (U^T M U = I):
//   Phi(x) = inertia |x - ahead|^2 / 2 + rate (x - base)^T D (x - base) / 2 + W(x) + beta W_t(x) -
//   f . x + contact(x)
// with D = alpha I + beta' K0 and the target's energy W_t frozen within the step; relief takes its
// share off W while an example force acts.
#include <math.h>
#include <string.h>

#include "reduced/contact.h"
#include "reduced/step_run.h"

enum { COOKIE = 0x45504f31 }; // "EPO1"

ep_step_def ep_default_step(void) {
  return (ep_step_def){.cookie = COOKIE,
                       .dt = 1.0 / 60,
                       .strength = 1,
                       .target_tolerance = 1e-6,
                       .tolerance = 1e-6,
                       .max_iterations = 50};
}

static int valid_pulls(const ep_step_def *d) {
  double sum = d->gravity[0] + d->gravity[1] + d->gravity[2];
  if (d->pulls < 0 || (d->pulls > 0 && !d->pull)) return 0;
  for (int i = 0; i < d->pulls; i++) {
    if (!d->pull[i].modes) return 0;
    for (int a = 0; a < 3; a++) sum += d->pull[i].force[a] + d->pull[i].at[a];
  }
  return isfinite(sum);
}

int ep_step_def_valid(const ep_step_def *d) {
  return d->cookie == COOKIE && d->dt > 0 && isfinite(d->dt) && d->damping_mass >= 0 &&
         isfinite(d->damping_mass) && d->damping_stiffness >= 0 && isfinite(d->damping_stiffness) &&
         d->strength >= 0 && isfinite(d->strength) && d->relief >= 0 && d->relief <= 1 &&
         d->tolerance > 0 && isfinite(d->tolerance) && d->target_tolerance > 0 &&
         isfinite(d->target_tolerance) && d->max_iterations > 0 && valid_pulls(d) &&
         ep_contact_def_valid(d) && ep_green_valid(&d->green) &&
         ep_integrator_name(d->integrator) != NULL &&
         (d->example_force == EP_EXAMPLE_ENERGY || d->example_force == EP_EXAMPLE_LINEAR);
}

// y = scale * K0 (x - origin) added to g; returns (x - origin)^T K0 (x - origin). origin NULL: 0.
static double add_k0(const ep_step_run *s, double scale, const double *x, const double *origin,
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
static double inner_energy(ep_step_run *s, const double *x, double *g, double *h, int project) {
  ep_state *state = s->state;
  const ep_step_def *def = s->def;
  if (state->unfold.on) {
    s->pull = s->strains = 0;
    s->cancelling = s->elastic = ep_unfold_energy(state, x, g, h);
    if (g) s->internal = sqrt(ep_dot(state->model->size.r, g, g));
    return s->elastic;
  }
  const int as_energy = s->examples && def->example_force == EP_EXAMPLE_ENERGY;
  const int by_cubature = ep_is_cubature(state->model->evaluator);
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
  s->elastic += ep_guard_add(state, x, g, h, project);
  if (s->examples && !as_energy)
    s->pull = 0.5 * def->strength * add_k0(s, def->strength, x, state->next_target, g);
  // At alpha = 1 elastic and example force cancel: the residual is relative to each.
  if (g) s->internal = sqrt(ep_dot(state->model->size.r, g, g));
  s->strains = ep_green_potential(state, &green, x, g, h, project);
  s->cancelling = fabs(s->elastic) + fabs(s->strains);
  // what a polynomial in floats sums up is as large as its quadratic part, however much cancels
  if (state->model->evaluator == EP_EVALUATE_CUBIC_FLOAT)
    s->cancelling += 0.5 * share * add_k0(s, 0, x, NULL, NULL);
  return s->elastic + s->pull + s->strains;
}

// [s] Factor of K0 in the damping.
static double damping_stiffness(const ep_step_run *s) {
  return fmax(s->def->damping_stiffness, s->state->unfold.viscosity);
}

// What follows the time step: inertia, damping, external forces; sum and gradient and Hessian (r x
// r) go on from there.
static double moving_energy(ep_step_run *s, double sum, const double *x, double *g, double *h) {
  ep_state *state = s->state;
  const ep_step_def *def = s->def;
  const int r = state->model->size.r;
  const double inertia = s->inertia, drag = def->damping_mass * s->rate;
  const double viscous = damping_stiffness(s) * s->rate;
  const double *origin = s->free ? state->free_still : state->base;
  if (viscous > 0) sum += 0.5 * viscous * add_k0(s, viscous, x, origin, g);
  for (int a = 0; a < r; a++) {
    double ahead = x[a] - state->aside[a], moved = x[a] - state->base[a];
    double force = def->force ? def->force[a] : 0;
    sum += 0.5 * (inertia * ahead * ahead + drag * moved * moved) - force * x[a];
    if (g) g[a] += inertia * ahead + drag * moved - force;
  }
  const int linear = s->examples && def->example_force == EP_EXAMPLE_LINEAR && !state->unfold.on;
  const double stiff = viscous + (linear ? def->strength : 0);
  for (int i = 0; h && stiff > 0 && i < r * r; i++) h[i] += stiff * state->model->k0[i];
  for (int a = 0; h && a < r; a++) h[(r + 1) * a] += inertia + drag;
  return s->free ? sum + ep_free_energy(&s->motion, x, s->joint, g, h) : sum;
}

double ep_step_energy(void *user, const double *x, double *g, double *h, int project) {
  ep_step_run *s = user;
  ep_state *state = s->state;
  const int r = state->model->size.r;
  const size_t bytes = (size_t)r * sizeof *x;
  double sum = s->inside = inner_energy(s, x, g, h, project);
  if (g) s->internal = fmax(s->internal, sqrt(ep_dot(r, g, g)));
  if (s->free && g) memcpy(state->inner_g, g, bytes);
  sum = moving_energy(s, sum, x, g, h);
  if (s->joint) return sum + ep_joint_energy(s, x, g, h);
  return s->free || !(s->contact || s->outer) ? sum
                                              : sum + ep_outside_energy(s, &state->frame, x, g, h);
}

// After a step of Newton: the frame goes to the iterate, inertial forces with it.
static double refresh(void *user, double *x, double *g) {
  ep_step_run *s = user;
  ep_state *state = s->state;
  const int r = state->model->size.r;
  if (s->joint) ep_joint_take_iterate(s, x);
  ep_free_freeze(&s->motion, x, s->joint ? s->iterate.R : NULL);
  memcpy(g, state->inner_g, (size_t)(s->joint ? r + 6 : r) * sizeof *g);
  const double sum = moving_energy(s, s->inside, x, g, NULL);
  return s->joint ? sum + ep_joint_rigid(s, x, g, NULL) : sum;
}

// |gradient| over the forces in play; never less than what a strain of 1e-8 makes.
static double residual(void *user, const double *x, const double *g) {
  ep_step_run *s = user;
  const ep_state *state = s->state;
  const int r = state->model->size.r;
  double ahead = 0, force = s->def->force ? sqrt(ep_dot(r, s->def->force, s->def->force)) : 0;
  for (int a = 0; a < r; a++) ahead += (x[a] - state->aside[a]) * (x[a] - state->aside[a]);
  if (s->joint) ahead += ep_joint_ahead(s, x);
  double scale = force + s->internal + sqrt(ahead) * s->inertia + 1e-8 * state->force_scale;
  const int n = s->joint ? r + 6 : r;
  return sqrt(ep_dot(n, g, g)) / scale;
}

// Acceleration from the equation of motion, a = f - dW/dq - D v, where no step before left it.
static void start_acceleration(ep_step_run *s) {
  ep_state *state = s->state;
  const ep_step_def *def = s->def;
  inner_energy(s, state->q, state->g, NULL, 0);
  s->a = state->direction; // what the state holds stays: the step may fail
  if (s->outer) {
    const int n = state->model->size.r + (s->free ? 6 : 0);
    memset(state->outer_g, 0, (size_t)n * sizeof *state->outer_g);
    def->outer(def->outer_user, state, &state->frame, state->q, state->outer_g, NULL, n);
    for (int a = 0; a < state->model->size.r; a++) state->g[a] += state->outer_g[a];
  }
  const double viscous = damping_stiffness(s);
  if (viscous > 0) add_k0(s, viscous, state->v, NULL, state->g);
  for (int a = 0; a < state->model->size.r; a++)
    s->a[a] = (def->force ? def->force[a] : 0) - state->g[a] - def->damping_mass * state->v[a];
}

// Where the caller wrote q or v since the last step, or another integrator made it, there is no
// motion before; of another q it is not known that it is turned over, or how it would unfold.
static void notice_writing(ep_step_run *s) {
  ep_state *state = s->state;
  const size_t bytes = (size_t)state->model->size.r * sizeof *state->q;
  const int wrote_q = memcmp(state->q, state->end_q, bytes) != 0;
  const int wrote = wrote_q || memcmp(state->v, state->end_v, bytes) != 0;
  const int anew = wrote || state->end_integrator != (int)s->def->integrator;
  s->dt_before = anew ? 0 : ep_integrator_before(s->def->integrator, s->def->dt, state->dt_before);
  s->a = state->a;
  if (!wrote_q) return;
  state->guards_soft = 0;
  state->unfold = (ep_unfold){0};
}

// What the integrator makes of the motion so far.
static void predict(ep_step_run *s) {
  ep_state *state = s->state;
  const size_t r = (size_t)state->model->size.r;
  if (s->def->integrator == EP_NEWMARK && s->dt_before == 0) start_acceleration(s);
  if (s->free) {
    ep_free_begin(&s->motion, state, s->def, s->dt_before, s->a);
    s->rate = s->motion.rate, s->inertia = s->motion.inertia;
    return;
  }
  const ep_motion motion = {.q = state->q,
                            .v = state->v,
                            .a = s->a,
                            .q_before = state->q_before,
                            .v_before = state->v_before,
                            .dt_before = s->dt_before};
  ep_integrator_predict(s->def->integrator, r, s->def->dt, &motion, state->base, state->aside,
                        &s->rate, &s->inertia);
}

// Starts contact from the step's start and free flight (a free object is frozen there).
static void begin_contact(ep_step_run *s) {
  ep_state *state = s->state;
  ep_frame ahead;
  if (s->free) ep_joint_flight(s, &ahead);
  ep_contact_begin(state, s->def, s->dt_before, s->free ? &state->frame : NULL,
                   s->free ? &ahead : NULL, state->q, state->aside);
}

// Start at the free flight or at rest, whichever has the lower potential.
static void choose_start(ep_step_run *s) {
  ep_state *state = s->state;
  const size_t bytes = (size_t)state->model->size.r * sizeof(double);
  double still = ep_step_energy(s, state->q, NULL, NULL, 0);
  double flight = ep_step_energy(s, state->aside, NULL, NULL, 0);
  memcpy(state->x, flight < still ? state->aside : state->q, bytes);
  if (s->free && flight < still) ep_free_freeze(&s->motion, state->x, NULL); // it is, at q
}

// Minimise; again while friction asks for it.
static ep_status minimise_contact(ep_step_run *s, ep_newton *newton) {
  for (;;) {
    const ep_status status = ep_newton_minimise(s->state, newton);
    if (status != EP_OK || !s->contact) return status;
    if (!ep_contact_again(s->state, s->def, s->free ? &s->iterate : NULL, s->state->x))
      return EP_OK;
    newton->max_iterations = newton->iterations + s->def->max_iterations;
  }
}

// A free object first flies free of the world, unless something outside acted in the last step.
static ep_status minimise(ep_step_run *s, ep_newton *newton) {
  ep_state *state = s->state;
  if (!s->free) return minimise_contact(s, newton);
  if (!s->motion.sound) return EP_ERR_NUMERIC;
  const int outside = s->contact || s->outer;
  newton->refresh = refresh;
  if (!outside || !state->touched) {
    const ep_status status = ep_newton_minimise(state, newton);
    if (status != EP_OK || !outside || !ep_joint_needed(s)) return status;
    newton->max_iterations += newton->iterations;
  }
  ep_joint_begin(s);
  newton->n += 6;
  return minimise_contact(s, newton);
}

// Gradient of contact alone at the end of the step of a held object, into outer_g.
static void contact_gradient(ep_step_run *s) {
  ep_state *state = s->state;
  const int r = state->model->size.r;
  memset(state->outer_g, 0, (size_t)r * sizeof *state->outer_g);
  ep_contact_energy(state, s->def, NULL, state->x, state->outer_g, NULL, r);
}

// The motion the integrator goes on with is made free of contact, whose gradient is in outer_g: the
// acceleration of Newmark's formula; the velocity before of BDF2, as if it had had the impulse.
static void split_contact(ep_step_run *s) {
  ep_state *state = s->state;
  const double time = 1 / (s->rate + s->def->damping_mass);
  for (int a = 0; a < state->model->size.r; a++)
    if (s->def->integrator == EP_NEWMARK)
      state->a[a] += state->outer_g[a];
    else
      state->v_before[a] -= time * state->outer_g[a];
}

static void finish_held(ep_step_run *s) {
  ep_state *state = s->state;
  for (int a = 0; a < state->model->size.r; a++) {
    state->q_before[a] = state->q[a];
    state->v_before[a] = state->v[a];
    state->a[a] = s->inertia * (state->x[a] - state->aside[a]);
    state->v[a] = state->end_v[a] = s->rate * (state->x[a] - state->base[a]);
    state->q[a] = state->end_q[a] = state->x[a];
  }
}

static ep_status finish(ep_step_run *s, ep_contact_report *contact) {
  ep_state *state = s->state;
  const ep_frame *frame = s->free ? (s->joint ? &s->iterate : &state->frame) : NULL;
  const int split = ep_contact_split(s->def) && s->contact && (!s->free || s->joint);
  int touched = 0;
  if (s->joint)
    touched = ep_joint_finish(s);
  else if (split)
    contact_gradient(s);
  if (s->joint && !ep_free_settle(&s->motion, state->x)) return EP_ERR_NUMERIC;
  if (s->contact && (!s->free || s->joint))
    ep_contact_measure(state, s->def, frame, state->x, contact);
  if (s->free)
    ep_free_finish(&s->motion, state->x, s->joint ? &s->iterate : NULL);
  else
    finish_held(s);
  if (split) split_contact(s);
  state->touched = touched;
  state->dt_before = s->def->dt;
  state->end_integrator = (int)s->def->integrator;
  if (s->examples) ep_commit_target(state);
  return EP_OK;
}

// What the model cannot do with its regions: act on a part of the object by K0 or by polynomials.
static int suits_regions(const ep_model *m, const ep_step_def *def) {
  if (!m->size.regions || def->strength == 0) return 1;
  for (int g = 0; def->region_strength && g < m->size.regions; g++)
    if (!(def->region_strength[g] >= 0) || !isfinite(def->region_strength[g])) return 0;
  return def->example_force == EP_EXAMPLE_ENERGY &&
         (def->relief == 0 || ep_is_cubature(m->evaluator));
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

static void set_report(const ep_step_run *s, const ep_newton *newton, ep_step_report *report) {
  report->newton_iterations = newton->iterations;
  report->line_search_steps = newton->line_search_steps;
  report->projections = newton->projections;
  report->residual = newton->residual_now;
  report->elastic_energy = s->elastic;
  report->example_energy = s->pull;
  report->green_energy = s->strains;
  report->unfolding = s->state->unfold.on;
}

// Pulls of a held object are in its `force`.
static int suits_model(const ep_model *m, const ep_step_def *def) {
  return suits_regions(m, def) && (m->size.rigid || def->pulls == 0);
}

// The definition with a held object's gravity in its force: a free one's moves its frame instead.
static ep_step_def load_held(ep_state *state, const ep_step_def *given) {
  const ep_model *m = state->model;
  const double *g = given->gravity;
  ep_step_def def = *given;
  if (m->size.rigid || (g[0] == 0 && g[1] == 0 && g[2] == 0)) return def;
  for (int a = 0; a < m->size.r; a++) {
    state->load[a] = given->force ? given->force[a] : 0;
    for (int i = 0; i < 3; i++) state->load[a] += g[i] * m->gravity_modes[i * m->size.r + a];
  }
  def.force = state->load;
  return def;
}

static ep_status find_target(ep_step_run *s, ep_step_report *report) {
  if (!s->examples) return EP_OK;
  const ep_status status = ep_find_target(s->state, s->def, &report->target);
  if (status == EP_OK && s->state->model->size.regions && s->def->relief > 0)
    s->kept_weight = relieve_regions(s->state, s->def);
  return status;
}

// Does a load or the world act?
static int is_loaded(const ep_step_run *s) {
  const ep_step_def *def = s->def;
  double sum = 0;
  for (int i = 0; i < 3; i++) sum += fabs(def->gravity[i]);
  for (int i = 0; i < def->pulls; i++)
    for (int c = 0; c < 3; c++) sum += fabs(def->pull[i].force[c]);
  for (int a = 0; def->force && a < s->state->model->size.r; a++) sum += fabs(def->force[a]);
  return sum > 0 || s->contact || s->outer;
}

// Walls, parabolas, or the way out of a jam. Returns whether the state is calm (reduced/unfold.h).
static int begin_guards(ep_step_run *s) {
  ep_state *state = s->state;
  ep_guard_begin(state);
  state->unfold.viscosity = 0; // that of another step, where a history was taken since
  if (!state->guards_soft && !state->unfold.on) return 0;
  const int unfolds = state->unfold.on;
  state->unfold.on = 0;
  const double energy = inner_energy(s, state->q, state->g, NULL, 0);
  state->unfold.on = unfolds;
  return ep_unfold_begin(state, energy, state->g, is_loaded(s));
}

ep_status ep_step(ep_state *state, const ep_step_def *given, ep_step_report *report) {
  ep_step_report unused;
  const ep_model_sizes *size = &state->model->size;
  if (!report) report = &unused;
  *report = (ep_step_report){0};
  if (!ep_step_def_valid(given) || !suits_model(state->model, given)) return EP_ERR_ARGUMENT;
  const ep_step_def loaded = load_held(state, given), *def = &loaded;
  // Without m only the examples' strains are known.
  ep_step_run s = {.state = state,
                   .def = def,
                   .examples = size->k > 0 && size->m > 0 && def->strength > 0,
                   .contact = ep_contact_acts(state, def),
                   .outer = def->outer != NULL,
                   .free = size->rigid};
  ep_newton newton = {.energy = ep_step_energy,
                      .residual = residual,
                      .user = &s,
                      .n = size->r,
                      .cancelling = &s.cancelling,
                      .tolerance = fmax(def->tolerance, state->force_noise),
                      .max_iterations = def->max_iterations};
  ep_status status = find_target(&s, report);
  if (status != EP_OK) return status;
  const ep_unfold before = state->unfold;
  const int soft = state->guards_soft;
  notice_writing(&s);
  const int calm = begin_guards(&s);
  predict(&s);
  if (s.free && s.motion.sound) ep_free_freeze(&s.motion, state->q, NULL);
  if (s.contact) begin_contact(&s);
  choose_start(&s);
  status = minimise(&s, &newton);
  set_report(&s, &newton, report);
  if (status == EP_OK) status = finish(&s, &report->contact);
  if (status != EP_OK) {
    state->unfold = before;
    state->guards_soft = soft;
    return status;
  }
  ep_unfold_end(state, calm);
  report->kinetic_energy =
      s.free ? ep_free_kinetic(state) : 0.5 * ep_dot(size->r, state->v, state->v);
  return EP_OK;
}

double ep_example_force_energy(ep_state *state, const ep_step_def *def, const double *q, double *f,
                               double *h, int project) {
  const int r = state->model->size.r;
  const ep_step_run s = {.state = state, .def = def};
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
