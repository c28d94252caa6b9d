#include "reduced/green_weights.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "reduced/state.h"

// Changes of the set of negative weights before giving up; each strictly lowers a convex function,
// and the sets met in practice are reached in two or three.
enum { SETS_MAX = 64 };

static const double *row_of(const ep_green_problem *s, int j) {
  return s->v + (size_t)j * (size_t)s->p;
}

static void weights_of(const ep_green_problem *s, const double *y, double *w) {
  for (int j = 0; j < s->k; j++) w[j] = ep_dot(s->p, row_of(s, j), y);
}

int ep_green_constrained(const ep_green_problem *problem) {
  return problem->sigma > 0 || problem->nu > 0;
}

void ep_green_system(const ep_green_problem *s, const double *w, double *c, double *a) {
  const int p = s->p;
  memset(a, 0, (size_t)p * sizeof *a);
  memset(c, 0, (size_t)(p * p) * sizeof *c);
  for (int i = 0; i < p; i++) c[(p + 1) * i] = 1;
  for (int j = 0; j < s->k; j++) {
    const double *v = row_of(s, j);
    for (int i = 0; i < p; i++) a[i] += v[i];
    if (w[j] >= 0 || s->nu == 0) continue;
    for (int i = 0; i < p; i++)
      for (int l = 0; l < p; l++) c[p * i + l] += s->nu * v[i] * v[l];
  }
  for (int i = 0; s->sigma > 0 && i < p; i++)
    for (int l = 0; l < p; l++) c[p * i + l] += s->sigma * a[i] * a[l];
}

// The function minimised, at y with its weights w.
static double objective(const ep_green_problem *s, const double *y0, const double *y,
                        const double *w) {
  double sum = 0, negative = 0;
  for (int j = 0; j < s->k; j++) {
    sum += w[j];
    if (w[j] < 0) negative += w[j] * w[j];
  }
  double energy = s->nu * negative;
  if (s->sigma > 0) energy += s->sigma * (sum - 1) * (sum - 1);
  for (int i = 0; i < s->p; i++) energy += y[i] * (y[i] - 2 * y0[i]);
  return energy;
}

static int same_signs(int k, const double *v, const double *w) {
  for (int j = 0; j < k; j++)
    if ((v[j] < 0) != (w[j] < 0)) return 0;
  return 1;
}

// The minimum for the set of negative weights of out->w, and its factor. 0: not positive definite.
static int minimum_of_set(const ep_green_problem *s, const double *y0, ep_green_solution *out) {
  ep_green_system(s, out->w, out->c, out->a);
  for (int i = 0; i < s->p; i++) out->y[i] = y0[i] + s->sigma * out->a[i];
  if (!ep_cholesky(s->p, out->c, out->c)) return 0;
  ep_solve_lower(s->p, out->c, out->y);
  ep_solve_lower_transposed(s->p, out->c, out->y);
  weights_of(s, out->y, out->trial_w);
  return 1;
}

// Newton on the convex, piecewise quadratic objective: exact once the set of negative weights
// stays. Where a full step does not lower the objective it is halved (the set may cycle otherwise).
static int constrained(const ep_green_problem *s, const double *y0, ep_green_solution *out) {
  const size_t strains = (size_t)s->p * sizeof *y0, weights = (size_t)s->k * sizeof *y0;
  memcpy(out->last, y0, strains);
  weights_of(s, out->last, out->w);
  double best = objective(s, y0, out->last, out->w);
  for (int set = 0; set < SETS_MAX; set++) {
    if (!minimum_of_set(s, y0, out)) return 0;
    const int settled = s->nu == 0 || same_signs(s->k, out->w, out->trial_w);
    double energy = objective(s, y0, out->y, out->trial_w);
    for (int i = 0; !settled && i < 40 && energy > best; i++) {
      for (int j = 0; j < s->p; j++) out->y[j] = 0.5 * (out->y[j] + out->last[j]);
      weights_of(s, out->y, out->trial_w);
      energy = objective(s, y0, out->y, out->trial_w);
    }
    const int stuck = !settled && energy >= best; // round-off: nothing left to gain
    best = energy;
    memcpy(out->last, out->y, strains);
    memcpy(out->w, out->trial_w, weights);
    if (settled || stuck) return 1;
  }
  return 0;
}

double ep_green_weights(const ep_green_problem *problem, const double *y0, ep_green_solution *out) {
  if (!ep_green_constrained(problem)) {
    memcpy(out->y, y0, (size_t)problem->p * sizeof *y0);
    weights_of(problem, out->y, out->w);
  } else if (!constrained(problem, y0, out)) {
    return NAN;
  }
  return objective(problem, y0, out->y, out->w);
}
