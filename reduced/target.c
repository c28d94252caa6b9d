// The target configuration: minimum over q of sum_i w_i E(q, e_i) (Zhao et al. 2018 eq. 6; DESIGN
// "Shape interpolation").
#include <math.h>
#include <string.h>

#include "reduced/state.h"

static const double *pose(const ep_model *m, int i) {
  return m->example_q + (size_t)(i - 1) * (size_t)m->size.r;
}

// sqrt(sum_i w_i |L^T (q_w - q_i)|^2) over rest (q = 0) and examples; uses state->work.
static double spread(ep_state *state, const double *w) {
  const ep_model *m = state->model;
  const int r = m->size.r;
  const double *l = state->k0_factor;
  double total = 0;
  for (int i = 0; i <= m->size.k; i++) {
    if (w[i] == 0) continue;
    for (int a = 0; a < r; a++) {
      double mean = 0;
      for (int j = 1; j <= m->size.k; j++) mean += w[j] * pose(m, j)[a];
      state->work[a] = mean - (i > 0 ? pose(m, i)[a] : 0);
    }
    for (int a = 0; a < r; a++) { // row a of L^T
      double sum = 0;
      for (int b = a; b < r; b++) sum += l[r * b + a] * state->work[b];
      total += w[i] * sum * sum;
    }
  }
  return sqrt(total);
}

static double scaled_norm(ep_state *state, const double *g) {
  const int r = state->model->size.r;
  memcpy(state->work, g, (size_t)r * sizeof *g);
  ep_solve_lower(r, state->k0_factor, state->work);
  return sqrt(ep_dot(r, state->work, state->work));
}

// Equal shapes have no spread: the scale is never less than what a strain of 1e-7 makes.
static double relative(ep_state *state, double scale, const double *g) {
  return scaled_norm(state, g) / fmax(scale, 1e-7 * sqrt(state->energy_scale));
}

double ep_target_residual(ep_state *state, const double *w, const double *g) {
  return relative(state, spread(state, w), g);
}

typedef struct interpolation {
  ep_state *state;
  const double *w;
  double scale;
} interpolation;

static double energy(void *user, const double *x, double *g, double *h, int project) {
  interpolation *it = user;
  return ep_target_energy(it->state, it->w, x, g, h, project);
}

static double residual(void *user, const double *x, const double *g) {
  interpolation *it = user;
  (void)x;
  return relative(it->state, it->scale, g);
}

ep_status ep_target_newton(void *user, ep_state *state, const double *w, double *q,
                           double tolerance, ep_target_report *report) {
  (void)user;
  const size_t bytes = (size_t)state->model->size.r * sizeof *q;
  interpolation it = {state, w, spread(state, w)};
  ep_newton newton = {.energy = energy,
                      .residual = residual,
                      .user = &it,
                      .tolerance = tolerance,
                      .max_iterations = 100};
  memcpy(state->x, q, bytes);
  ep_status status = ep_newton_minimise(state, &newton);
  if (status == EP_OK) memcpy(q, state->x, bytes);
  if (report)
    *report = (ep_target_report){newton.evaluations, newton.iterations, newton.residual_now};
  return status;
}

// 1 where all weight is on one shape: then the target is that shape, exactly.
static int single_shape(const ep_state *state, double *q) {
  const ep_model *m = state->model;
  const size_t bytes = (size_t)m->size.r * sizeof *q;
  int shape = -1;
  for (int i = 0; i <= m->size.k; i++) {
    if (state->next_w[i] == 0) continue;
    if (shape >= 0) return 0;
    shape = i;
  }
  if (shape > 0)
    memcpy(q, pose(m, shape), bytes);
  else
    memset(q, 0, bytes);
  return 1;
}

// Start of the minimisation: the last target or the linear blend, whichever has less energy.
static void choose_start(ep_state *state, double *q) {
  const ep_model *m = state->model;
  const int r = m->size.r;
  for (int a = 0; a < r; a++) {
    q[a] = 0;
    for (int i = 1; i <= m->size.k; i++) q[a] += state->next_w[i] * pose(m, i)[a];
  }
  if (!state->has_target) return;
  double blend = ep_target_energy(state, state->next_w, q, NULL, NULL, 0);
  double last = ep_target_energy(state, state->next_w, state->target, NULL, NULL, 0);
  if (last < blend) memcpy(q, state->target, (size_t)r * sizeof *q);
}

// The target should be the shape of the example manifold *nearest* to c (Zhao et al. 2018 eq. 1),
// but eq. 5 measures the distance to sum w_i e_i, and the nonlinear target t(w) of eq. 4 lies
// elsewhere: at w = .1 anywhere from .04 to .2 of the way. A strong example force would amplify
// that step by step: a shape right on the manifold would creep along it. So the weights are
// measured against c less the shift c(t) - sum w_i e_i of the target before; half of its change is
// taken each time, which converges as long as t moves less than four times as fast as the blend. At
// rest then c(t(w)) is nearest to c, and a shape on the manifold is its own target.
static const double shift_relaxation = 0.5;

static void subtract_shift(const ep_state *state, double *c) {
  for (int i = 0; i < 3 * state->model->size.m; i++) c[i] -= state->shift[i];
}

static void update_shift(ep_state *state) {
  const ep_model *m = state->model;
  const int length = 3 * m->size.m;
  ep_descriptor(m, state->target, state->c);
  for (int i = 0; i < length; i++) {
    double blend = state->w[0] * m->c0[i];
    for (int e = 0; e < m->size.k; e++)
      blend += state->w[e + 1] * m->example_c[(size_t)e * (size_t)length + (size_t)i];
    state->shift[i] += shift_relaxation * (state->c[i] - blend - state->shift[i]);
  }
}

// Where the object will be at the end of the step if nothing acts: the target is frozen within a
// step, and one that belonged to the beginning would drag like honey (strength K0 dt of viscosity
// along the manifold). Aimed ahead, it adds inertia instead, and motion along the examples is free.
static void aim_ahead(ep_state *state, double dt) {
  for (int a = 0; a < state->model->size.r; a++) state->x[a] = state->q[a] + dt * state->v[a];
}

ep_status ep_find_target(ep_state *state, const ep_step_def *def, ep_target_report *report) {
  aim_ahead(state, def->dt);
  ep_descriptor(state->model, state->x, state->c);
  subtract_shift(state, state->c);
  ep_status status = ep_example_weights(state, state->c, state->next_w);
  if (status != EP_OK) return status;
  if (!single_shape(state, state->next_target)) {
    choose_start(state, state->next_target);
    ep_target_solver solver = def->target_solver ? def->target_solver : ep_target_newton;
    status = solver(def->target_user, state, state->next_w, state->next_target,
                    def->target_tolerance, report);
    if (status != EP_OK) return status;
  }
  ep_freeze_target(state);
  return EP_OK;
}

void ep_commit_target(ep_state *state) {
  memcpy(state->w, state->next_w, (size_t)(state->model->size.k + 1) * sizeof *state->w);
  memcpy(state->target, state->next_target, (size_t)state->model->size.r * sizeof *state->target);
  state->has_target = 1;
  update_shift(state);
}
