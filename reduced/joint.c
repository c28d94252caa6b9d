// A free object together with the world (docs/method.md "Free motion", "Contact").
#include <math.h>
#include <string.h>

#include "reduced/contact.h"
#include "reduced/rigid.h"
#include "reduced/step_run.h"

double ep_outside_energy(ep_step_run *s, const ep_frame *frame, const double *x, double *g,
                         double *h) {
  const int n = s->state->model->size.r + (s->free ? 6 : 0);
  double sum = 0;
  if (s->contact) sum += ep_contact_energy(s->state, s->def, s->free ? frame : NULL, x, g, h, n);
  if (s->outer) sum += s->def->outer(s->def->outer_user, s->state, frame, x, g, h, n);
  return sum;
}

static void frame_of(const ep_step_run *s, const double *x, ep_frame *frame) {
  const int r = s->state->model->size.r;
  double theta[3], turn[9];
  for (int i = 0; i < 3; i++) {
    frame->c[i] = s->state->frame.c[i] + x[r + i] / s->unit[0];
    theta[i] = x[r + 3 + i] / s->unit[1];
  }
  ep_rotation_exp(theta, turn);
  ep_multiply3(turn, s->iterate.R, frame->R);
}

// The iterate's frame becomes the one increments are counted from; what acts there is noted.
void ep_joint_take_iterate(ep_step_run *s, double *x) {
  const int r = s->state->model->size.r;
  ep_frame frame;
  frame_of(s, x, &frame);
  s->iterate = frame;
  for (int i = 0; i < 6; i++) s->motion.contact[i] = -s->state->outer_g[r + i] * s->unit[i / 3];
  memset(x + r + 3, 0, 3 * sizeof *x);
}

// Translation: energy, gradient added to g unless NULL.
static double translation_energy(const ep_step_run *s, const double *x, double *g) {
  const ep_free_step *f = &s->motion;
  const int r = s->state->model->size.r;
  const double drag = s->def->damping_mass * s->rate;
  double sum = 0;
  for (int i = 0; i < 3; i++) {
    const double moved = x[r + i] / s->unit[0], c = s->state->frame.c[i] + moved;
    const double ahead = c - f->c_ahead[i], base = c - f->c_base[i];
    sum += 0.5 * f->mass * (s->inertia * ahead * ahead + drag * base * base) - f->force[i] * moved;
    if (g) g[r + i] += (f->mass * (s->inertia * ahead + drag * base) - f->force[i]) / s->unit[0];
  }
  return sum;
}

// Rotation, and how it goes with q.
static double rotation_energy(const ep_step_run *s, const double *x, double *g) {
  const ep_free_step *f = &s->motion;
  const ep_state *state = s->state;
  const int r = state->model->size.r;
  double theta[3], body[3], z[3], jz[3], hd[3] = {0}, world[3];
  for (int i = 0; i < 3; i++) theta[i] = x[r + 3 + i] / s->unit[1];
  ep_rotate_back(s->iterate.R, theta, body);
  for (int i = 0; i < 3; i++) {
    z[i] = f->zeta[i] + body[i];
    for (int a = 0; a < r; a++) hd[i] += state->free_h[i * r + a] * (x[a] - state->free_at[a]);
  }
  ep_rotate(f->j, z, jz);
  const double coupling = s->inertia * ep_dot(3, body, hd);
  const double turning = 0.5 * f->turn_inertia * ep_dot(3, z, jz);
  if (!g) return coupling + turning;
  for (int a = 0; a < r; a++)
    for (int i = 0; i < 3; i++) g[a] += s->inertia * body[i] * state->free_h[i * r + a];
  for (int i = 0; i < 3; i++) hd[i] = s->inertia * hd[i] + f->turn_inertia * jz[i];
  ep_rotate(s->iterate.R, hd, world);
  for (int i = 0; i < 3; i++) g[r + 3 + i] += world[i] / s->unit[1];
  return coupling + turning;
}

static void rigid_hessian(const ep_step_run *s, double *h) {
  const ep_free_step *f = &s->motion;
  const int r = s->state->model->size.r, n = r + 6;
  const double drag = s->def->damping_mass * s->rate;
  for (int i = 0; i < 3; i++) h[(r + i) * (n + 1)] += s->inertia + drag;
  for (int c = 0; c < 3; c++) { // column c of J R^T and of R
    double column[3], jc[3], world[3], unit[3] = {c == 0, c == 1, c == 2};
    ep_rotate_back(s->iterate.R, unit, column);
    ep_rotate(f->j, column, jc);
    ep_rotate(s->iterate.R, jc, world);
    for (int i = 0; i < 3; i++)
      h[(r + 3 + i) * n + r + 3 + c] += f->turn_inertia * world[i] / (s->unit[1] * s->unit[1]);
    for (int a = 0; a < r; a++) {
      double coupling = 0;
      for (int i = 0; i < 3; i++) coupling += column[i] * s->state->free_h[i * r + a];
      coupling *= s->inertia / s->unit[1];
      h[a * n + r + 3 + c] += coupling;
      h[(r + 3 + c) * n + a] += coupling;
    }
  }
}

// Inertia of the rigid motion about the one free of contact, and how it goes with that of q:
// inertia / 2 m |c - c_ahead|^2 + turn_inertia / 2 |zeta + theta|_J^2
// + inertia theta . H (x - x_frozen).
double ep_joint_rigid(const ep_step_run *s, const double *x, double *g, double *h) {
  if (h) rigid_hessian(s, h);
  return translation_energy(s, x, g) + rotation_energy(s, x, g);
}

// h (r x r) becomes the first rows and columns of an n x n matrix, zero elsewhere.
static void spread(int r, int n, double *h) {
  for (int i = r - 1; i >= 0; i--) {
    memmove(h + i * n, h + i * r, (size_t)r * sizeof *h);
    memset(h + i * n + r, 0, (size_t)(n - r) * sizeof *h);
  }
  memset(h + r * n, 0, (size_t)((n - r) * n) * sizeof *h);
}

// What is outside, and the rigid motion; the gradient outside goes to inner_g too.
double ep_joint_energy(ep_step_run *s, const double *x, double *g, double *h) {
  ep_state *state = s->state;
  const int r = state->model->size.r, n = r + 6;
  ep_frame frame;
  if (!s->motion.sound) return NAN;
  frame_of(s, x, &frame);
  if (h) spread(r, n, h);
  if (g) memset(state->outer_g, 0, (size_t)n * sizeof *g);
  const double sum = ep_outside_energy(s, &frame, x, g ? state->outer_g : NULL, h);
  s->inside += sum;
  for (int i = 0; i < 6; i++) {
    const double scale = 1 / s->unit[i / 3];
    if (g) {
      state->outer_g[r + i] *= scale;
      g[r + i] = 0;
      state->inner_g[r + i] = 0;
    }
    for (int a = 0; h && a < n; a++) h[(r + i) * n + a] *= scale;
    for (int a = 0; h && a < n; a++) h[a * n + r + i] *= scale;
  }
  for (int a = 0; g && a < n; a++) {
    g[a] += state->outer_g[a];
    state->inner_g[a] += state->outer_g[a];
  }
  if (g) s->internal = fmax(s->internal, sqrt(ep_dot(n, state->outer_g, state->outer_g)));
  return sum + ep_joint_rigid(s, x, g, h);
}

// How far the rigid motion is from the one free of contact, squared, in units of q.
double ep_joint_ahead(const ep_step_run *s, const double *x) {
  const int r = s->state->model->size.r;
  double jz[3], sum = 0;
  for (int i = 0; i < 3; i++) {
    const double c = s->state->frame.c[i] + x[r + i] / s->unit[0] - s->motion.c_ahead[i];
    sum += s->motion.mass * c * c;
  }
  ep_rotate(s->motion.j, s->motion.zeta, jz);
  return sum + ep_dot(3, s->motion.zeta, jz);
}

void ep_joint_flight(const ep_step_run *s, ep_frame *frame) {
  ep_free_center(&s->motion, frame->c);
  memcpy(frame->R, s->motion.turned, sizeof frame->R);
}

// Does anything outside act where free flight ends?
int ep_joint_needed(ep_step_run *s) {
  ep_state *state = s->state;
  const int n = state->model->size.r + 6;
  ep_frame frame;
  ep_joint_flight(s, &frame);
  memset(state->outer_g, 0, (size_t)n * sizeof *state->outer_g);
  const double sum = ep_outside_energy(s, &frame, state->x, state->outer_g, NULL);
  return sum != 0 || ep_dot(n, state->outer_g, state->outer_g) != 0;
}

// From the end of free flight, or from where the step began, whichever has the lower potential.
void ep_joint_begin(ep_step_run *s) {
  ep_state *state = s->state;
  const size_t r = (size_t)state->model->size.r;
  ep_frame frame;
  s->joint = 1;
  ep_joint_flight(s, &frame);
  double size[9];
  ep_rigid_tensor(state->model->rigid_s0, size);
  s->unit[0] = sqrt(s->motion.mass);
  s->unit[1] = sqrt((size[0] + size[4] + size[8]) / 3);
  double best = INFINITY;
  for (int still = 0; still < 2; still++) {
    if (still) memcpy(state->trial, state->x, (r + 6) * sizeof *state->x);
    if (still) memcpy(state->x, state->q, r * sizeof *state->x);
    s->iterate = still ? state->frame : frame;
    for (size_t i = 0; i < 3; i++) {
      state->x[r + i] = s->unit[0] * (s->iterate.c[i] - state->frame.c[i]);
      state->x[r + 3 + i] = 0;
    }
    ep_free_freeze(&s->motion, state->x, s->iterate.R);
    const double sum = ep_step_energy(s, state->x, NULL, NULL, 0);
    if (!still) best = sum;
    if (!still || sum < best) continue;
    memcpy(state->x, state->trial, (r + 6) * sizeof *state->x);
    s->iterate = frame;
    ep_free_freeze(&s->motion, state->x, s->iterate.R);
  }
}

// An outer potential is a force like others to the integrator; contact is not (ep_contact_share).
// Leaves the gradient of contact alone in outer_g where the integrator has to know it.
int ep_joint_finish(ep_step_run *s) {
  ep_state *state = s->state;
  const int r = state->model->size.r, n = r + 6;
  const size_t bytes = (size_t)n * sizeof *state->outer_g;
  memset(state->outer_g, 0, bytes);
  if (s->outer)
    s->def->outer(s->def->outer_user, state, &s->iterate, state->x, state->outer_g, NULL, n);
  for (int i = 0; i < 6; i++) s->motion.steady[i] = -state->outer_g[r + i];
  memset(state->outer_g, 0, bytes);
  ep_outside_energy(s, &s->iterate, state->x, state->outer_g, NULL);
  for (int i = 0; i < 6; i++) s->motion.contact[i] = -state->outer_g[r + i];
  const int acted = ep_dot(n, state->outer_g, state->outer_g) != 0;
  if (!s->outer || !s->contact || !ep_contact_split(s->def)) return acted;
  memset(state->outer_g, 0, bytes);
  ep_contact_energy(state, s->def, &s->iterate, state->x, state->outer_g, NULL, n);
  return acted;
}
