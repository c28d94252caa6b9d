#include "reduced/guard.h"

#include <math.h>
#include <string.h>

#include "reduced/state.h"

// Round-off of F and of the bound: a group within this of its limit is evaluated.
static const double slack = 1e-9;

static int groups_of(const ep_model *m) {
  return (m->size.guards + EP_LANES - 1) / EP_LANES;
}

// How far F may go (Frobenius) before its determinant can be `room` smaller: a lower bound, from
// d -> room / (c1 + c2 d + c3 d^2), which swaps the sides of the root.
static double way_to(const double f[9], const double cof[9], double room) {
  double a = 0, b = 0;
  for (int i = 0; i < 9; i++) a += f[i] * f[i], b += cof[i] * cof[i];
  const double c1 = sqrt(b), c2 = sqrt(a / 3), c3 = 1 / (3 * sqrt(3));
  double d = room / c1;
  for (int i = 0; i < 3; i++) d = room / (c1 + c2 * d + c3 * d * d);
  return d;
}

// Way of one guard to its limit; <= 0 where it is there, or F is not finite. *jacobian: J.
static double way_of(const ep_state *state, int e, double *jacobian) {
  double f[9], cof[9];
  ep_packed_gradient(state, state->model->guard_g, e, f);
  for (int i = 0; i < 3; i++) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; j++) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      cof[3 * i + j] = f[3 * i1 + j1] * f[3 * i2 + j2] - f[3 * i1 + j2] * f[3 * i2 + j1];
    }
  }
  *jacobian = f[0] * cof[0] + f[1] * cof[1] + f[2] * cof[2];
  const double room = *jacobian - state->model->guard_limit[e] - slack;
  return room > 0 ? way_to(f, cof, room) : 0; // false for NaN
}

// Could a guard of this group be at its limit? (state->padded_q holds q and zeros.)
static int to_be_evaluated(ep_state *state, int group) {
  const ep_model *m = state->model;
  const int width = EP_LANES * m->size.blocks, first = EP_LANES * group;
  const int end = m->size.guards < first + EP_LANES ? m->size.guards : first + EP_LANES;
  double *at = state->guard_at + (size_t)group * (size_t)width;
  const double *growth = m->guard_growth + (size_t)group * (size_t)width, *q = state->padded_q;
  double sum[EP_LANES] = {0};
  for (int b = 0; b < width; b += EP_LANES)
    for (int i = 0; i < EP_LANES; i++) sum[i] += fabs(q[b + i] - at[b + i]) * growth[b + i];
  const double gone =
      ((sum[0] + sum[1]) + (sum[2] + sum[3])) + ((sum[4] + sum[5]) + (sum[6] + sum[7]));
  if (gone < state->guard_reach[group] * (1 - slack)) return 0;
  double reach = INFINITY, jacobian;
  for (int e = first; e < end && reach > 0; e++) reach = fmin(reach, way_of(state, e, &jacobian));
  if (!isfinite(reach)) reach = 0; // overflow: nothing is known
  memcpy(at, q, (size_t)width * sizeof *at);
  state->guard_reach[group] = reach;
  return !(reach > 0);
}

// Energy of a group, gradient and Hessian into padded_f and padded_k.
static double evaluate(ep_state *state, int group, int want_f, int want_k, int project) {
  const ep_model *m = state->model;
  const int from = EP_LANES * group, to = from + EP_LANES;
  ep_kernel_term term = {.scale = 1, .weight = m->guard_w + from};
  ep_kernel_task task = {.r = m->size.r,
                         .s = (to < m->size.guards ? to : m->size.guards) - from,
                         .blocks = m->size.blocks,
                         .material = state->guards_soft ? EP_GUARD_SOFT : EP_GUARD_WALL,
                         .g = m->guard_g + (size_t)from * (size_t)m->size.blocks * 72,
                         .lambda = m->guard_stiffness + from,
                         .mu = m->guard_limit + from,
                         .terms = 1,
                         .term = &term,
                         .q = state->padded_q,
                         .f = want_f ? state->padded_f : NULL,
                         .k = want_k ? state->padded_k : NULL,
                         .project = project,
                         .scratch = state->kernel_scratch};
  state->kernel(&task);
  return term.energy;
}

double ep_guard_add(ep_state *state, const double *q, double *f, double *h, int project) {
  const ep_model *m = state->model;
  const int r = m->size.r, width = EP_LANES * m->size.blocks, groups = groups_of(m);
  double energy = 0;
  if (groups > 0) memcpy(state->padded_q, q, (size_t)r * sizeof *q); // its tail stays zero
  for (int group = 0; group < groups; group++) {
    if (!to_be_evaluated(state, group)) continue;
    const double part = evaluate(state, group, f != NULL, h != NULL, project);
    if (part == 0) continue; // NaN goes on
    energy += part;
    for (int a = 0; f && a < r; a++) f[a] += state->padded_f[a];
    for (int a = 0; h && a < r; a++)
      for (int b = 0; b < r; b++) h[a * r + b] += state->padded_k[a * width + b];
  }
  return energy;
}

void ep_guard_begin(ep_state *state) {
  const ep_model *m = state->model;
  const int groups = groups_of(m);
  int touched = 0, over = 0;
  if (groups > 0) memcpy(state->padded_q, state->q, (size_t)m->size.r * sizeof *state->q);
  for (int group = 0; group < groups; group++) {
    if (!to_be_evaluated(state, group)) continue;
    touched = 1;
    for (int e = EP_LANES * group; e < m->size.guards && e < EP_LANES * (group + 1); e++) {
      double jacobian;
      way_of(state, e, &jacobian);
      over += jacobian < 0;
    }
  }
  state->guards_over = over;
  state->guards_soft = over > 0 || (state->guards_soft && touched);
}
