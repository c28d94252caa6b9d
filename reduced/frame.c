// What a caller reads and sets of a free object's motion (reduced/frame.h).
#include "reduced/frame.h"

#include <math.h>
#include <string.h>

#include "reduced/rigid.h"
#include "reduced/state.h"

static int finite3(const double x[3]) {
  return isfinite(x[0]) && isfinite(x[1]) && isfinite(x[2]);
}

static int is_rotation(const double r[9]) {
  double cross[3];
  ep_cross(r, r + 3, cross);
  for (int i = 0; i < 3; i++)
    if (!(fabs(cross[i] - r[6 + i]) <= 1e-9)) return 0; // false for NaN
  return fabs(ep_dot(3, r, r) - 1) <= 1e-9 && fabs(ep_dot(3, r + 3, r + 3) - 1) <= 1e-9 &&
         fabs(ep_dot(3, r, r + 3)) <= 1e-9;
}

void ep_state_rest_frame(ep_state *state) {
  static const ep_frame identity = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  state->frame = identity;
  if (state->model->size.rigid)
    memcpy(state->frame.c, state->model->rigid_origin, sizeof state->frame.c);
}

const ep_frame *ep_state_frame(const ep_state *state) {
  return &state->frame;
}

ep_status ep_state_set_frame(ep_state *state, const ep_frame *frame) {
  if (!state->model->size.rigid || !finite3(frame->c) || !is_rotation(frame->R))
    return EP_ERR_ARGUMENT;
  state->frame = *frame;
  ep_rotation_clean(state->frame.R);
  state->dt_before = 0; // no motion before
  return EP_OK;
}

// Body-axes angular velocity of a configuration: J^-1 (L - h(q, v)).
static void spin_of(const ep_state *state, double omega[3]) {
  double s[6], j[9], inverse[9], l[3], h[3];
  ep_rigid_sums(state->model, state->q, s, NULL, NULL);
  ep_rigid_tensor(s, j);
  ep_rigid_internal(state->model, state->q, state->v, h);
  ep_rotate_back(state->frame.R, state->angular, l);
  for (int i = 0; i < 3; i++) l[i] -= h[i];
  if (ep_inverse3(j, inverse))
    ep_rotate(inverse, l, omega);
  else
    omega[0] = omega[1] = omega[2] = NAN;
}

void ep_state_motion(const ep_state *state, double velocity[3], double spin[3]) {
  double omega[3];
  for (int i = 0; i < 3; i++) velocity[i] = spin[i] = 0;
  if (!state->model->size.rigid) return;
  for (int i = 0; i < 3; i++) velocity[i] = state->linear[i] / state->model->rigid_mass[0];
  spin_of(state, omega);
  ep_rotate(state->frame.R, omega, spin);
}

ep_status ep_state_set_motion(ep_state *state, const double velocity[3], const double spin[3]) {
  double s[6], j[9], l[3], h[3], omega[3];
  if (!state->model->size.rigid || !finite3(velocity) || !finite3(spin)) return EP_ERR_ARGUMENT;
  ep_rigid_sums(state->model, state->q, s, NULL, NULL);
  ep_rigid_tensor(s, j);
  ep_rigid_internal(state->model, state->q, state->v, h);
  ep_rotate_back(state->frame.R, spin, omega);
  ep_rotate(j, omega, l);
  for (int i = 0; i < 3; i++) l[i] += h[i];
  ep_rotate(state->frame.R, l, state->angular);
  for (int i = 0; i < 3; i++) state->linear[i] = state->model->rigid_mass[0] * velocity[i];
  state->dt_before = 0; // no motion before
  return EP_OK;
}

void ep_state_momentum(const ep_state *state, double linear[3], double angular[3]) {
  memcpy(linear, state->linear, sizeof state->linear);
  memcpy(angular, state->angular, sizeof state->angular);
}

void ep_state_positions(const ep_state *state, double *x) {
  const ep_model *model = state->model;
  ep_positions(model, state->q, x);
  if (!model->size.rigid) return;
  for (size_t v = 0; v < (size_t)model->size.n; v++) {
    double y[3], turned[3];
    for (int i = 0; i < 3; i++) y[i] = x[3 * v + (size_t)i] - model->rigid_origin[i];
    ep_rotate(state->frame.R, y, turned);
    for (int i = 0; i < 3; i++) x[3 * v + (size_t)i] = state->frame.c[i] + turned[i];
  }
}
