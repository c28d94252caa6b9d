// What a state carries from one step into the next, as one list of numbers. Scratch memory, what
// was remembered to save work (guards, polynomials) and what the caller gives with every step are
// no part of it.
#include <math.h>
#include <string.h>

#include "reduced/state.h"

enum { LAYOUT = 3 }; // the first number: another list has another

typedef struct cursor {
  double *to; // both NULL: count only
  const double *from;
  size_t count;
} cursor;

static void pass(cursor *c, double *x, size_t count) {
  if (c->to && count) memcpy(c->to + c->count, x, count * sizeof *x);
  if (c->from && count) memcpy(x, c->from + c->count, count * sizeof *x);
  c->count += count;
}

static void pass_int(cursor *c, int *x) {
  double number = *x;
  pass(c, &number, 1);
  *x = (int)fmax(0, fmin(number, 1e6)); // flags and counts
}

static void pass_motion(cursor *c, ep_state *s) {
  pass(c, s->frame.c, 3);
  pass(c, s->frame.R, 9);
  pass(c, s->linear, 3);
  pass(c, s->angular, 3);
  pass(c, s->linear_rate, 3);
  pass(c, s->angular_rate, 3);
  pass(c, s->c_before, 3);
  pass(c, s->linear_before, 3);
  pass(c, s->angular_before, 3);
  if (s->model->size.rigid) pass(c, s->free_q_before, (size_t)s->model->size.r);
}

static void pass_unfold(cursor *c, ep_state *s) {
  pass_int(c, &s->guards_soft);
  pass_int(c, &s->never_unfolds);
  pass_int(c, &s->unfold.on);
  pass_int(c, &s->unfold.calm);
  pass(c, &s->unfold.bend, 1);
  pass(c, &s->unfold.from, 1);
}

static size_t pass_all(ep_state *s, cursor c) {
  const ep_model *m = s->model;
  const size_t r = (size_t)m->size.r, sets = (size_t)ep_model_regions(m);
  double layout = LAYOUT;
  pass(&c, &layout, 1);
  double *const own[] = {s->q, s->v, s->a, s->q_before, s->v_before, s->end_q, s->end_v};
  for (size_t i = 0; i < sizeof own / sizeof *own; i++) pass(&c, own[i], r);
  pass(&c, s->w, sets + (size_t)m->size.k);
  pass(&c, s->target, sets * r);
  pass(&c, s->shift, 3 * (size_t)m->size.m);
  pass(&c, &s->dt_before, 1);
  pass_int(&c, &s->end_integrator);
  pass_int(&c, &s->has_target);
  pass_int(&c, &s->touched);
  pass_unfold(&c, s);
  pass_motion(&c, s);
  return c.count;
}

size_t ep_state_history_size(const ep_state *state) {
  ep_state copy = *state; // counting changes nothing
  return pass_all(&copy, (cursor){0});
}

void ep_state_get_history(const ep_state *state, double *out) {
  ep_state copy = *state;
  pass_all(&copy, (cursor){.to = out});
}

ep_status ep_state_set_history(ep_state *state, size_t count, const double *history) {
  if (count != ep_state_history_size(state) || history[0] != LAYOUT) return EP_ERR_ARGUMENT;
  for (size_t i = 0; i < count; i++)
    if (!isfinite(history[i])) return EP_ERR_ARGUMENT;
  pass_all(state, (cursor){.from = history});
  return EP_OK;
}
