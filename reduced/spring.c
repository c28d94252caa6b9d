#include "reduced/spring.h"

#include "reduced/state.h"

// p in the world and its arm from the frame's origin (free objects).
static void center(const ep_model *model, const ep_spring *s, const ep_frame *frame,
                   const double *q, double p[3]) {
  const int r = model->size.r;
  double body[3];
  for (int i = 0; i < 3; i++)
    body[i] = s->rest[i] - (model->size.rigid ? model->rigid_origin[i] : 0) +
              ep_dot(r, s->rows + i * r, q);
  for (int i = 0; i < 3; i++)
    p[i] = model->size.rigid ? frame->c[i] + ep_dot(3, frame->R + 3 * i, body) : body[i];
}

void ep_spring_center(const ep_state *state, const ep_spring *spring, double p[3]) {
  center(state->model, spring, &state->frame, state->q, p);
}

void ep_springs_begin(const ep_state *state, double dt, ep_springs *springs) {
  springs->dt = dt;
  for (int i = 0; i < springs->count; i++)
    ep_spring_center(state, &springs->spring[i], springs->spring[i].start);
}

// Row `axis` of dp/d(unknowns), entry j.
static double derivative(const ep_model *model, const ep_spring *s, const ep_frame *frame,
                         const double arm[3], int axis, int j) {
  const int r = model->size.r;
  if (!model->size.rigid) return s->rows[axis * r + j];
  if (j < r) {
    double sum = 0;
    for (int i = 0; i < 3; i++) sum += frame->R[3 * axis + i] * s->rows[i * r + j];
    return sum;
  }
  if (j < r + 3) return j - r == axis;
  // dtheta x arm
  const int turn = j - r - 3;
  if (turn == axis) return 0;
  return (axis - turn + 3) % 3 == 1 ? -arm[3 - axis - turn] : arm[3 - axis - turn];
}

static double add_spring(const ep_model *model, const ep_spring *s, double dt,
                         const ep_frame *frame, const double *q, double *g, double *h, int n) {
  double p[3], pull[3], arm[3] = {0, 0, 0}, sum = 0;
  const double viscous = s->damping / dt, stiff = s->stiffness + viscous;
  center(model, s, frame, q, p);
  for (int i = 0; i < 3; i++) {
    const double apart = p[i] - s->to[i], moved = p[i] - s->start[i] - (s->to[i] - s->from[i]);
    sum += 0.5 * (s->stiffness * apart * apart + viscous * moved * moved);
    pull[i] = s->stiffness * apart + viscous * moved;
    if (model->size.rigid) arm[i] = p[i] - frame->c[i];
  }
  for (int j = 0; (g || h) && j < n; j++) {
    double row[3];
    for (int i = 0; i < 3; i++) {
      row[i] = derivative(model, s, frame, arm, i, j);
      if (g) g[j] += pull[i] * row[i];
    }
    for (int k = 0; h && k <= j; k++) {
      double entry = 0;
      for (int i = 0; i < 3; i++) entry += stiff * row[i] * derivative(model, s, frame, arm, i, k);
      h[j * n + k] += entry;
      if (k < j) h[k * n + j] += entry;
    }
  }
  return sum;
}

double ep_springs_energy(void *springs, const ep_state *state, const ep_frame *frame,
                         const double *q, double *g, double *h, int n) {
  const ep_springs *all = springs;
  double sum = 0;
  for (int i = 0; i < all->count; i++) {
    const ep_spring *s = &all->spring[i];
    if (s->stiffness > 0 || s->damping > 0)
      sum += add_spring(state->model, s, all->dt, frame, q, g, h, n);
  }
  return sum;
}
