#include "reduced/bake/nlopt_target.h"

#include <math.h>
#include <nlopt.h>
#include <stdlib.h>
#include <string.h>

enum { DEFAULT_EVALUATIONS = 1000, MAX_STARTS = 10 };

struct ep_nlopt_target {
  nlopt_opt optimizer;
  nlopt_result result;
  int r, max_evaluations;
  double *factor;           // (r x r) L of K0 = L L^T
  double *y, *q, *g, *best; // (r) scaled unknowns y = L^T q, q, gradient, best q
  double unit;              // of the scaled unknowns
  double best_energy, best_residual;
  // the solve under way
  ep_state *state;
  const double *w;
  double tolerance;
  int evaluations;
};

// ---- scaling: y = L^T q / unit, E / unit^2, so that gradients are L^-1 dE/dq / unit ------------
//
// NLopt's algorithms stop at gradients below 1e-8 whatever the units: with a small weight they
// would stop before they began. The unit is a power of two, which changes no digit otherwise.

static void to_scaled(const ep_nlopt_target *t, const double *q, double *y) {
  for (int a = 0; a < t->r; a++) {
    y[a] = 0;
    for (int b = a; b < t->r; b++) y[a] += t->factor[t->r * b + a] * q[b];
    y[a] /= t->unit;
  }
}

static void from_scaled(const ep_nlopt_target *t, const double *y, double *q) {
  for (int a = 0; a < t->r; a++) q[a] = t->unit * y[a];
  for (int a = t->r - 1; a >= 0; a--) {
    q[a] /= t->factor[t->r * a + a];
    for (int b = 0; b < a; b++) q[b] -= t->factor[t->r * a + b] * q[a];
  }
}

static void scale_gradient(const ep_nlopt_target *t, const double *g, double *out) {
  for (int a = 0; a < t->r; a++) {
    double sum = g[a];
    for (int b = 0; b < a; b++) sum -= t->factor[t->r * a + b] * out[b];
    out[a] = sum / t->factor[t->r * a + a];
  }
}

// What gradients are relative to (ep_target_residual), up to a factor of two: |L^-1 g| = 1 for the
// first column g of L.
static double unit_of(ep_nlopt_target *t) {
  for (int a = 0; a < t->r; a++) t->g[a] = t->factor[t->r * a];
  const double scale = 1 / ep_target_residual(t->state, t->w, t->g);
  return isfinite(scale) && scale > 0 ? ldexp(1, ilogb(scale)) : 1;
}

// ---- objective ---------------------------------------------------------------------------------

static double objective(unsigned n, const double *y, double *gradient, void *user) {
  (void)n;
  ep_nlopt_target *t = user;
  from_scaled(t, y, t->q);
  t->evaluations++;
  double energy = ep_target_energy(t->state, t->w, t->q, t->g, NULL, 0);
  if (!isfinite(energy)) { // far outside: NLopt's line searches expect a number
    if (gradient) memset(gradient, 0, (size_t)t->r * sizeof *gradient);
    return HUGE_VAL;
  }
  if (gradient) scale_gradient(t, t->g, gradient);
  for (int a = 0; gradient && a < t->r; a++) gradient[a] /= t->unit;
  double residual = ep_target_residual(t->state, t->w, t->g);
  if (energy < t->best_energy || residual <= t->tolerance) {
    t->best_energy = energy, t->best_residual = residual;
    memcpy(t->best, t->q, (size_t)t->r * sizeof *t->best);
  }
  if (residual <= t->tolerance) nlopt_force_stop(t->optimizer);
  return energy / (t->unit * t->unit);
}

// ---- public ------------------------------------------------------------------------------------

// LD_AUGLAG and LD_AUGLAG_EQ call a second optimizer without looking whether there is one;
// LD_LBFGS_NOCEDAL is a name without an algorithm.
static int usable(nlopt_algorithm a) {
  const char *name = nlopt_algorithm_to_string(a);
  return strncmp(name, "LD_", 3) == 0 && strncmp(name, "LD_AUGLAG", 9) != 0 &&
         strcmp(name, "LD_LBFGS_NOCEDAL") != 0;
}

static ep_status allocate(ep_nlopt_target *t, const ep_state *state, ep_error *err) {
  const size_t r = (size_t)t->r;
  t->factor = malloc((r * r + 4 * r) * sizeof *t->factor);
  if (!t->optimizer || !t->factor)
    return ep_fail(err, EP_ERR_MEMORY, "out of memory for the interpolation with NLopt");
  t->y = t->factor + r * r, t->q = t->y + r, t->g = t->q + r, t->best = t->g + r;
  memcpy(t->factor, ep_state_k0_factor(state), r * r * sizeof *t->factor);
  if (nlopt_set_min_objective(t->optimizer, objective, t) < 0)
    return ep_fail(err, EP_ERR_MEMORY, "NLopt refuses the objective");
  return EP_OK;
}

ep_status ep_nlopt_target_create(const ep_state *state, const char *algorithm, int max_evaluations,
                                 ep_nlopt_target **out, ep_error *err) {
  *out = NULL;
  if (!algorithm) algorithm = "LD_LBFGS";
  int number = nlopt_algorithm_from_string(algorithm);
  if (number < 0 || number >= NLOPT_NUM_ALGORITHMS || !usable((nlopt_algorithm)number))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "NLopt algorithm \"%s\": use a local one with gradients, as LD_LBFGS",
                   algorithm);
  ep_nlopt_target *t = calloc(1, sizeof *t);
  if (!t) return ep_fail(err, EP_ERR_MEMORY, "out of memory for the interpolation with NLopt");
  t->r = ep_state_model(state)->size.r;
  t->max_evaluations = max_evaluations > 0 ? max_evaluations : DEFAULT_EVALUATIONS;
  t->optimizer = nlopt_create((nlopt_algorithm)number, (unsigned)t->r);
  ep_status status = allocate(t, state, err);
  if (status != EP_OK) {
    ep_nlopt_target_free(t);
    return status;
  }
  *out = t;
  return EP_OK;
}

void ep_nlopt_target_free(ep_nlopt_target *target) {
  if (!target) return;
  nlopt_destroy(target->optimizer);
  free(target->factor);
  free(target);
}

ep_status ep_nlopt_target_solve(void *user, ep_state *state, const double *w, double *q,
                                double tolerance, ep_target_report *report) {
  ep_nlopt_target *t = user;
  const size_t bytes = (size_t)t->r * sizeof *q;
  int starts = 0;
  t->state = state, t->w = w, t->tolerance = tolerance, t->evaluations = 0;
  t->best_energy = HUGE_VAL, t->best_residual = HUGE_VAL;
  t->unit = unit_of(t);
  memcpy(t->best, q, bytes);
  while (t->best_residual > tolerance && starts < MAX_STARTS &&
         t->evaluations < t->max_evaluations) {
    double before = t->best_energy, energy;
    to_scaled(t, t->best, t->y);
    nlopt_set_force_stop(t->optimizer, 0);
    nlopt_set_maxeval(t->optimizer, t->max_evaluations - t->evaluations);
    t->result = nlopt_optimize(t->optimizer, t->y, &energy);
    if (++starts > 1 && !(t->best_energy < before)) break; // a restart gains nothing any more
  }
  if (report) *report = (ep_target_report){t->evaluations, starts, t->best_residual};
  if (!(t->best_residual <= tolerance)) return EP_ERR_NUMERIC;
  memcpy(q, t->best, bytes);
  return EP_OK;
}

const char *ep_nlopt_target_result(const ep_nlopt_target *target) {
  return nlopt_result_to_string(target->result);
}
