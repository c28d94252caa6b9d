// Small dense algebra and the safeguarded Newton both minimisations use (docs/method.md "Time
// step").
#include <math.h>
#include <string.h>

#include "reduced/state.h"

// Four chains of additions in a fixed order: one chain would wait for every addition.
double ep_dot(int n, const double *a, const double *b) {
  double sum[4] = {0, 0, 0, 0};
  int i = 0;
  for (; i + 4 <= n; i += 4)
    for (int c = 0; c < 4; c++) sum[c] += a[i + c] * b[i + c];
  for (; i < n; i++) sum[0] += a[i] * b[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

int ep_cholesky(int n, const double *a, double *l) {
  for (int i = 0; i < n; i++) {
    for (int j = 0; j <= i; j++) {
      double sum = a[n * i + j] - ep_dot(j, l + n * i, l + n * j);
      if (i > j) {
        l[n * i + j] = sum / l[n * j + j];
      } else {
        if (!(sum > 1e-13 * fabs(a[n * i + i])) || !isfinite(sum)) return 0;
        l[n * i + i] = sqrt(sum);
      }
    }
  }
  for (int i = 0; i < n; i++)
    for (int j = i + 1; j < n; j++) l[n * i + j] = 0;
  return 1;
}

void ep_solve_lower(int n, const double *l, double *x) {
  for (int i = 0; i < n; i++) x[i] = (x[i] - ep_dot(i, l + n * i, x)) / l[n * i + i];
}

void ep_solve_lower_transposed(int n, const double *l, double *x) {
  for (int i = n - 1; i >= 0; i--) {
    x[i] /= l[n * i + i];
    for (int j = 0; j < i; j++) x[j] -= l[n * i + j] * x[i];
  }
}

// ---- Newton ------------------------------------------------------------------------------------

enum { MAX_BACKTRACKS = 40 };

// A Newton step that gains less than this share of the energies' round-off brings nothing, unless
// the gradient still falls: in floats a nearly incompressible polynomial stalls above the
// tolerance.
static const double no_gain = 1e-3;

// A Newton step which strains no element by more than this is lost in the round-off of forces:
// converged whatever the residual; the larger one where energies no longer tell points apart.
static const double tiny_strain = 1e-13, small_strain = 1e-9;

// Hessian at state->x, factored. Where it is not positive definite: once more with projected
// elements, then with growing shifts of the diagonal (a projected one can still be singular).
static int factor_hessian(ep_state *state, ep_newton *newton) {
  const int r = newton->n;
  newton->energy(newton->user, state->x, NULL, state->h, 0);
  if (ep_cholesky(r, state->h, state->factor)) return 1;
  newton->projections++;
  newton->energy(newton->user, state->x, NULL, state->h, 1);
  double largest = 0, shift = 0;
  for (int i = 0; i < r; i++) largest = fmax(largest, fabs(state->h[(r + 1) * i]));
  for (int attempt = 0; attempt < 12; attempt++) {
    if (ep_cholesky(r, state->h, state->factor)) return 1;
    double next = shift == 0 ? 1e-10 * largest : 10 * shift;
    for (int i = 0; i < r; i++) state->h[(r + 1) * i] += next - shift;
    shift = next;
  }
  return 0;
}

// Armijo along state->direction; leaves the new point, its gradient and energy. `noise`: energies
// closer than this are equal to round-off; where not much more is to be gained, the gradient
// decides. Returns the step, 0: none.
static double line_search(ep_state *state, ep_newton *newton, double slope, double noise) {
  const int r = newton->n;
  const double flat = ep_dot(r, state->g, state->g);
  double step = 1;
  for (int i = 0; i < MAX_BACKTRACKS; i++, step *= 0.5) {
    for (int a = 0; a < r; a++) state->trial[a] = state->x[a] + step * state->direction[a];
    double energy = newton->energy(newton->user, state->trial, state->trial_g, NULL, 0);
    newton->evaluations++;
    const int lower = energy <= newton->energy_now + 1e-4 * step * slope + noise; // 0 for NaN
    const int flatter = -slope <= 10 * noise && isfinite(energy) &&
                        ep_dot(r, state->trial_g, state->trial_g) < 0.25 * flat;
    if (lower || flatter) {
      newton->energy_now = energy;
      memcpy(state->x, state->trial, (size_t)r * sizeof *state->x);
      memcpy(state->g, state->trial_g, (size_t)r * sizeof *state->g);
      return step;
    }
    newton->line_search_steps++;
  }
  return 0;
}

ep_status ep_newton_minimise(ep_state *state, ep_newton *newton) {
  const int r = newton->n;
  double before = INFINITY; // residual of the point before
  newton->energy_now = newton->energy(newton->user, state->x, state->g, NULL, 0);
  newton->evaluations++;
  for (;;) {
    newton->residual_now = newton->residual(newton->user, state->x, state->g);
    if (!isfinite(newton->energy_now) || !isfinite(newton->residual_now)) return EP_ERR_NUMERIC;
    if (newton->residual_now <= newton->tolerance) return EP_OK;
    if (newton->iterations == newton->max_iterations) return EP_ERR_NUMERIC;
    newton->iterations++;
    if (!factor_hessian(state, newton)) return EP_ERR_NUMERIC;
    for (int a = 0; a < r; a++) state->direction[a] = -state->g[a];
    ep_solve_lower(r, state->factor, state->direction);
    ep_solve_lower_transposed(r, state->factor, state->direction);
    double slope = ep_dot(r, state->g, state->direction);
    if (!(slope < 0)) return EP_ERR_NUMERIC;
    // Strains are known to 1e-16, energies ~ strain^2 therefore to 1e-16 sqrt(energy at strain 1).
    const double terms = newton->cancelling ? *newton->cancelling : 0;
    double noise = state->energy_noise * (fmax(terms, fabs(newton->energy_now)) + fabs(slope)) +
                   1e-15 * sqrt(fabs(newton->energy_now) * state->energy_scale);
    if (-slope <= no_gain * noise && newton->residual_now > 0.5 * before) return EP_OK;
    before = newton->residual_now;
    double strain = state->strain_scale * sqrt(ep_dot(r, state->direction, state->direction));
    double step = line_search(state, newton, slope, noise);
    if (step > 0 && newton->refresh)
      newton->energy_now = newton->refresh(newton->user, state->x, state->g);
    if (strain <= (step > 0 ? tiny_strain : small_strain)) break; // nothing left but round-off
    if (step == 0) return EP_ERR_NUMERIC;
  }
  newton->residual_now = newton->residual(newton->user, state->x, state->g);
  return isfinite(newton->energy_now) && isfinite(newton->residual_now) ? EP_OK : EP_ERR_NUMERIC;
}
