#include "reduced/unfold.h"

#include <math.h>

#include "reduced/state.h"

// v^2 / 2 over W and |dW/dq| over |K0 q| below which a state is calm; v^2 / 2 over V of one that a
// load holds while it unfolds.
static const double slow = 0.2, weak = 0.2, held = 0.01;

// Share of the guards that is turned over of a collapsed object; depth of the well, and what a
// change of stage may add, as shares of W where unfolding began.
static const double crowd = 0.5, depth = 0.01, noise = 1e-8;

// work := K0 q; returns q^T K0 q / 2.
static double linear_energy(ep_state *state, const double *q) {
  const int r = state->model->size.r;
  for (int a = 0; a < r; a++)
    state->work[a] = ep_dot(r, state->model->k0 + (size_t)a * (size_t)r, q);
  return 0.5 * ep_dot(r, state->work, q);
}

// V and its first two derivatives to y.
static double value(const ep_unfold *u, double y, double *first, double *second) {
  const double share = u->well > 0 ? u->well / (u->well + y) : 1;
  *first = u->slope + (1 - u->slope) * share * share;
  *second = u->well > 0 ? -2 * (1 - u->slope) * share * share / (u->well + y) : 0;
  return (u->slope + (1 - u->slope) * share) * y;
}

double ep_unfold_energy(ep_state *state, const double *q, double *g, double *h, int project) {
  const int r = state->model->size.r;
  double first, second;
  const double energy = value(&state->unfold, linear_energy(state, q), &first, &second);
  if (project) second = 0; // never positive
  for (int a = 0; g && a < r; a++) g[a] = first * state->work[a];
  for (int a = 0; h && a < r; a++)
    for (int b = 0; b < r; b++)
      h[a * r + b] = first * state->model->k0[a * r + b] + second * state->work[a] * state->work[b];
  return energy;
}

static void start(ep_unfold *u, double energy, double y) {
  const double well = depth * energy;
  u->on = 1;
  u->from = energy;
  u->well = y > energy ? well : 0;
  u->slope = 1;
  if (y > energy) { // slope y + (1 - slope) z = energy
    const double z = well * y / (well + y);
    u->slope = (energy - z) / (y - z);
  }
}

// Back to the material? Returns whether the object is calm.
static int go_on(ep_state *state, double energy, double kinetic, double y, int loaded) {
  ep_unfold *u = &state->unfold;
  double first, second;
  const double now = value(u, y, &first, &second);
  const int calm = kinetic < held * now;
  const int at_rest = (u->well == 0 || y <= u->well) && energy <= now + noise * u->from;
  const int is_held = loaded && calm && u->calm >= EP_UNFOLD_CALM;
  if (!state->guards_soft && (at_rest || is_held)) *u = (ep_unfold){0};
  return calm;
}

int ep_unfold_begin(ep_state *state, double energy, const double *force, int loaded) {
  const int r = state->model->size.r;
  const double kinetic = 0.5 * ep_dot(r, state->v, state->v), y = linear_energy(state, state->q);
  if (state->unfold.on) return go_on(state, energy, kinetic, y, loaded);
  const double pull = sqrt(ep_dot(r, force, force));
  const double linear = sqrt(ep_dot(r, state->work, state->work));
  const int calm = kinetic < slow * energy && pull < weak * linear;
  const int collapsed = kinetic < y && state->guards_over > crowd * state->model->size.guards;
  if (collapsed || (calm && state->unfold.calm >= EP_UNFOLD_CALM)) start(&state->unfold, energy, y);
  return calm;
}

void ep_unfold_end(ep_state *state, int calm) {
  state->unfold.calm = calm ? state->unfold.calm + 1 : 0;
}
