#include "reduced/guard.h"

#include <math.h>
#include <string.h>

#include "reduced/state.h"

// Round-off of the bounds, relative to the reach.
static const double slack = 1e-9;

ep_guard_kernel ep_guard_of(ep_isa isa) {
#if defined(__x86_64__)
  if (isa == EP_ISA_AVX512) return ep_guard_avx512();
  if (isa == EP_ISA_AVX2) return ep_guard_avx2();
#endif
  (void)isa;
  return ep_guard_baseline();
}

static int groups_of(const ep_model *m) {
  return (m->size.guards + EP_LANES - 1) / EP_LANES;
}

static int guards_in(const ep_model *m, int group) {
  const int left = m->size.guards - EP_LANES * group;
  return left < EP_LANES ? left : EP_LANES;
}

void ep_guard_init(ep_state *state) {
  const ep_model *m = state->model;
  const int width = EP_LANES * m->size.blocks, groups = groups_of(m);
  for (int group = 0; group < groups; group++)
    for (int a = 0; a < width; a++)
      state->guard_most[a] =
          fmax(state->guard_most[a], m->guard_growth[(size_t)group * (size_t)width + (size_t)a]);
}

// Can no guard be at its limit? (state->padded_q holds q and zeros.)
static int is_calm(const ep_state *state) {
  double gone;
  state->guard_kernel.gone(1, state->model->size.blocks, state->guard_most, state->guard_hub,
                           state->padded_q, &gone);
  return gone < state->guard_calm;
}

// Looks at a group: its reach from here, 0 where a guard may be at its limit. Returns how many are
// turned over.
static int look_at(ep_state *state, int group) {
  const ep_model *m = state->model;
  const int blocks = m->size.blocks, width = EP_LANES * blocks, first = EP_LANES * group;
  const int count = guards_in(m, group);
  double jacobian[EP_LANES];
  int over = 0;
  const double reach =
      state->guard_kernel.reach(count, blocks, m->guard_g + (size_t)first * (size_t)blocks * 72,
                                m->guard_limit + first, state->padded_q, jacobian);
  state->guard_reach[group] = reach * (1 - slack);
  memcpy(state->guard_at + (size_t)group * (size_t)width, state->padded_q,
         (size_t)width * sizeof *state->guard_at);
  state->guard_gone[group] = 0;
  for (int i = 0; i < count; i++) over += jacobian[i] < 0;
  return over;
}

// Finds the groups which may have a guard at its limit: those whose reach is 0 then. Returns
// whether there are any; over: guards that are turned over, of these groups.
static int survey(ep_state *state, const double *q, int *over) {
  const ep_model *m = state->model;
  const int groups = groups_of(m), width = EP_LANES * m->size.blocks;
  *over = 0;
  if (groups == 0) return 0;
  memcpy(state->padded_q, q, (size_t)m->size.r * sizeof *q); // its tail stays zero
  if (is_calm(state)) return 0;
  double calm = INFINITY;
  int due = 0;
  state->guard_kernel.gone(groups, m->size.blocks, m->guard_growth, state->guard_at,
                           state->padded_q, state->guard_gone);
  for (int group = 0; group < groups; group++) {
    if (!(state->guard_gone[group] < state->guard_reach[group])) *over += look_at(state, group);
    due |= !(state->guard_reach[group] > 0);
    calm = fmin(calm, state->guard_reach[group] - state->guard_gone[group]);
  }
  memcpy(state->guard_hub, state->padded_q, (size_t)width * sizeof *state->guard_hub);
  state->guard_calm = calm;
  return due;
}

// Energy of a group, gradient and Hessian into padded_f and padded_k.
static double evaluate(ep_state *state, int group, int want_f, int want_k, int project) {
  const ep_model *m = state->model;
  const int from = EP_LANES * group;
  ep_kernel_term term = {.scale = 1, .weight = m->guard_w + from};
  ep_kernel_task task = {.r = m->size.r,
                         .s = guards_in(m, group),
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
  int over;
  if (!survey(state, q, &over)) return 0;
  for (int group = 0; group < groups; group++) {
    if (state->guard_reach[group] > 0) continue;
    const double part = evaluate(state, group, f != NULL, h != NULL, project);
    if (part == 0) continue; // where q is no number too: the material's energy says so
    energy += part;
    for (int a = 0; f && a < r; a++) f[a] += state->padded_f[a];
    for (int a = 0; h && a < r; a++)
      for (int b = 0; b < r; b++) h[a * r + b] += state->padded_k[a * width + b];
  }
  return energy;
}

void ep_guard_begin(ep_state *state) {
  const int touched = survey(state, state->q, &state->guards_over);
  state->guards_soft = state->guards_over > 0 || (state->guards_soft && touched);
}

double ep_guard_stiffness(double lambda, double mu) {
  return EP_GUARD_STIFFNESS * fmax(lambda, mu);
}

void ep_guard_add_growth(int r, const double *g, double *growth) {
  for (int a = 0; a < r; a++) {
    double square = 0;
    for (int c = 0; c < 9; c++) square += g[c * r + a] * g[c * r + a];
    growth[a] = fmax(growth[a], sqrt(square));
  }
}
