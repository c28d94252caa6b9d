#include "reduced/unfold.h"

#include <math.h>

#include "reduced/state.h"

// v^2 / 2 over W and |dW/dq| over |K0 q| below which a state is calm; v^2 / 2 over V of one that a
// load holds while it unfolds.
static const double slow = 0.2, weak = 0.2, held = 0.01;

// Share of the guards that is turned over of a collapsed object, and how many at least: of a few,
// one flipped tet would be the whole object. How near to rest it ends, and what a change of stage
// may add, as shares of V where unfolding began.
static const double crowd = 0.5, near = 0.01, noise = 1e-8;
enum { CROWD_LEAST = 8 };

// work := K0 q; returns q^T K0 q / 2.
static double linear_energy(ep_state *state, const double *q) {
  const int r = state->model->size.r;
  for (int a = 0; a < r; a++)
    state->work[a] = ep_dot(r, state->model->k0 + (size_t)a * (size_t)r, q);
  return 0.5 * ep_dot(r, state->work, q);
}

// V and its first two derivatives to y.
static double value(const ep_unfold *u, double y, double *first, double *second) {
  const double a = u->bend;
  *first = 1, *second = 0;
  if (a == 0) return y;
  const double root = sqrt(1 + y / a);
  *first = 1 / root;
  *second = -0.5 / (a * root * root * root);
  return 2 * y / (1 + root); // 2 a (root - 1) without its cancellation
}

double ep_unfold_energy(ep_state *state, const double *q, double *g, double *h) {
  const int r = state->model->size.r;
  double first, second;
  const double energy = value(&state->unfold, linear_energy(state, q), &first, &second);
  for (int a = 0; g && a < r; a++) g[a] = first * state->work[a];
  for (int a = 0; h && a < r; a++)
    for (int b = 0; b < r; b++)
      h[a * r + b] = first * state->model->k0[a * r + b] + second * state->work[a] * state->work[b];
  return energy;
}

// V = W by the bend: W = 2 a (sqrt(1 + y / a) - 1).
static void start(ep_unfold *u, double energy, double y) {
  u->on = 1;
  u->from = fmin(energy, y);
  u->bend = y > energy ? 0.25 * energy * energy / (y - energy) : 0;
}

// [s] beta that damps V along q critically, with the stiffness lambda = 2 y / |q|^2 of K0 there:
// beta lambda = 2 sqrt(V' lambda); 0.3 of it while guards are turned over, where haste is better.
static double viscosity(const ep_state *state, double y) {
  const double *q = state->q;
  double first, second;
  value(&state->unfold, y, &first, &second);
  const double critical =
      y > 0 ? 2 * sqrt(first * ep_dot(state->model->size.r, q, q) / (2 * y)) : 0;
  return state->guards_soft ? 0.3 * critical : critical;
}

// Back to the material? Returns whether the object is calm.
static int go_on(ep_state *state, double energy, double kinetic, double y, int loaded) {
  ep_unfold *u = &state->unfold;
  double first, second;
  const double now = value(u, y, &first, &second);
  const int calm = kinetic < held * now;
  const int at_rest = (u->bend == 0 || y <= near * u->from) && energy <= now + noise * u->from;
  const int is_held = loaded && calm && u->calm >= EP_UNFOLD_CALM;
  if (!state->guards_soft && (at_rest || is_held)) *u = (ep_unfold){0};
  return calm;
}

static int is_collapsed(const ep_state *state, double kinetic, double y) {
  const int over = state->guards_over;
  return kinetic < y && over >= CROWD_LEAST && over > crowd * state->model->size.guards;
}

int ep_unfold_begin(ep_state *state, double energy, const double *force, int loaded) {
  const int r = state->model->size.r;
  const double kinetic = 0.5 * ep_dot(r, state->v, state->v), y = linear_energy(state, state->q);
  ep_unfold *u = &state->unfold;
  int calm;
  if (u->on) {
    calm = go_on(state, energy, kinetic, y, loaded);
  } else {
    const double pull = sqrt(ep_dot(r, force, force));
    const double linear = sqrt(ep_dot(r, state->work, state->work));
    calm = kinetic < slow * energy && pull < weak * linear;
    const int jammed = calm && u->calm >= EP_UNFOLD_CALM;
    if (!state->never_unfolds && (jammed || is_collapsed(state, kinetic, y))) start(u, energy, y);
  }
  u->viscosity = u->on ? viscosity(state, y) : 0;
  return calm;
}

void ep_unfold_end(ep_state *state, int calm) {
  state->unfold.calm = calm ? state->unfold.calm + 1 : 0;
}

void ep_unfold_never(ep_state *state) {
  state->never_unfolds = 1;
  state->unfold = (ep_unfold){0};
}
