#include "reduced/free_step.h"

#include <math.h>
#include <string.h>

#include "reduced/mean_rotation.h"
#include "reduced/rigid.h"

enum { TURNS_MAX = 200 };
// How far in a step [rad] the spin of an iterate's momenta may go from that of its rotation.
static const double spin_reach = 0.5;

// ---- C, and turning by it ------------------------------------------------------------------

// c (r x r) = C(omega): C_ba = omega . h_ab, so that C q = H^T omega.
static void fill_coriolis(const ep_model *m, const double omega[3], double *c) {
  const size_t r = (size_t)m->size.r, count = r * (r + 1) / 2;
  const double *h = m->rigid_h;
  for (size_t a = 0, at = 0; a < r; a++)
    for (size_t b = 0; b <= a; b++, at++) {
      const double value =
          omega[0] * h[at] + omega[1] * h[count + at] + omega[2] * h[2 * count + at];
      c[b * r + a] = value;
      c[a * r + b] = -value;
    }
}

static void times(int r, const double *a, const double *x, double *y) {
  for (int i = 0; i < r; i++) y[i] = ep_dot(r, a + (size_t)i * (size_t)r, x);
}

// y := exp(scale C) y by its series; term and next (r) are scratch. C is antisymmetric, and
// |scale C| is about the angle of the step: few terms.
static void turn(int r, const double *c, double scale, double *y, double *term, double *next) {
  const double size = ep_dot(r, y, y);
  memcpy(term, y, (size_t)r * sizeof *y);
  for (int n = 1; n < TURNS_MAX; n++) {
    times(r, c, term, next);
    for (int a = 0; a < r; a++) {
      term[a] = scale / n * next[a];
      y[a] += term[a];
    }
    if (!(ep_dot(r, term, term) > 1e-34 * size)) return;
  }
}

// ---- the step's beginning ------------------------------------------------------------------

static void predict3(const ep_free_step *f, const double q[3], const double v[3], const double a[3],
                     const double q_before[3], const double v_before[3], double base[3],
                     double ahead[3]) {
  double rate, inertia;
  const ep_motion motion = {.q = q,
                            .v = v,
                            .a = a,
                            .q_before = q_before,
                            .v_before = v_before,
                            .dt_before = f->dt_before};
  ep_integrator_predict(f->def->integrator, 3, f->def->dt, &motion, base, ahead, &rate, &inertia);
}

// v(ahead) of something whose value nothing depends on: the formula for velocities alone, so that
// momenta never pass through positions and their round-off.
static void carry(const ep_free_step *f, const double v[3], const double a[3],
                  const double v_before[3], double out[3]) {
  static const double zero[3] = {0};
  double base[3], ahead[3];
  predict3(f, zero, v, a, zero, v_before, base, ahead);
  for (int i = 0; i < 3; i++) out[i] = f->rate * (ahead[i] - base[i]);
}

// Force, and torque about c, of gravity and pulls at q and the axes R.
static void pull(ep_free_step *f, const double *q, const double rotation[9]) {
  const int r = f->state->model->size.r;
  for (int i = 0; i < 3; i++) f->force[i] = f->mass * f->def->gravity[i], f->torque[i] = 0;
  for (int p = 0; p < f->def->pulls; p++) {
    const ep_pull *one = &f->def->pull[p];
    double y[3], arm[3], torque[3];
    memcpy(y, one->at, sizeof y);
    for (int a = 0; a < r; a++)
      for (int i = 0; i < 3; i++) y[i] += one->modes[3 * a + i] * q[a];
    ep_rotate(rotation, y, arm);
    ep_cross(arm, one->force, torque);
    for (int i = 0; i < 3; i++) f->force[i] += one->force[i], f->torque[i] += torque[i];
  }
}

// out (r) = 1/2 dJ/dq(omega, omega) + C C q + sum of pulls U^T R^T f. Leaves C(omega) in free_c and
// G in free_g.
static void inertial_forces(ep_free_step *f, const double *q, const double omega[3],
                            const double rotation[9], const double *ds, double *out) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  const size_t n = (size_t)r;
  fill_coriolis(state->model, omega, state->free_c);
  times(r, state->free_c, q, state->work);
  times(r, state->free_c, state->work, out);
  for (size_t a = 0; a < n; a++) {
    const double s[6] = {ds[a],         ds[n + a],     ds[2 * n + a],
                         ds[3 * n + a], ds[4 * n + a], ds[5 * n + a]};
    double j[9], g[3];
    ep_rigid_tensor(s, j);
    ep_rotate(j, omega, g);
    for (size_t i = 0; i < 3; i++) state->free_g[i * n + a] = g[i];
    out[a] += 0.5 * ep_dot(3, omega, g);
  }
  for (int p = 0; p < f->def->pulls; p++) {
    double force[3];
    ep_rotate_back(rotation, f->def->pull[p].force, force);
    for (int a = 0; a < r; a++) out[a] += ep_dot(3, f->def->pull[p].modes + 3 * a, force);
  }
}

// omega of momenta L_b and p at the configuration whose J and H are given:
// (J - H H^T) omega = L_b - H p. 0 where the matrix is not definite.
static int spin_of_momenta(int r, const double j[9], const double *h, const double l[3],
                           const double *p, double omega[3]) {
  double matrix[9], inverse[9], rest[3];
  for (int a = 0; a < 3; a++) {
    rest[a] = l[a] - ep_dot(r, h + (size_t)a * (size_t)r, p);
    for (int b = 0; b < 3; b++)
      matrix[3 * a + b] =
          j[3 * a + b] - ep_dot(r, h + (size_t)a * (size_t)r, h + (size_t)b * (size_t)r);
  }
  if (!ep_inverse3(matrix, inverse)) return 0;
  ep_rotate(inverse, rest, omega);
  return 1;
}

// p = q' + C(omega) q of the state into free_p; leaves J's derivatives in free_ds.
static void start_momentum(ep_free_step *f, double omega[3]) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  double s[6], j[9], inverse[9], l[3], h[3];
  ep_rigid_sums(state->model, state->q, s, state->free_ds, state->free_h);
  ep_rigid_tensor(s, j);
  ep_rigid_internal(state->model, state->q, state->v, h);
  ep_rotate_back(state->frame.R, state->angular, l);
  for (int i = 0; i < 3; i++) l[i] -= h[i];
  f->sound = ep_inverse3(j, inverse);
  if (!f->sound) return;
  ep_rotate(inverse, l, omega);
  for (int a = 0; a < r; a++) {
    state->free_p[a] = state->v[a];
    for (int i = 0; i < 3; i++) state->free_p[a] += omega[i] * state->free_h[i * r + a];
  }
}

// Newmark without a step before: accelerations of the equations of motion. a holds those of the
// deformation alone (step.c), where the damping by mass saw q' instead of p.
static void start_acceleration(ep_free_step *f, const double omega[3], double *a) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  const double drag = f->def->damping_mass;
  inertial_forces(f, state->q, omega, state->frame.R, state->free_ds, state->trial);
  for (int i = 0; i < r; i++) a[i] += state->trial[i] - drag * (state->free_p[i] - state->v[i]);
  pull(f, state->q, state->frame.R);
  for (int i = 0; i < 3; i++) {
    f->linear_rate[i] = f->force[i] - drag * state->linear[i];
    f->angular_rate[i] = f->torque[i] - drag * state->angular[i];
    if (!f->def->outer) continue; // step.c has evaluated it
    f->linear_rate[i] -= state->outer_g[r + i];
    f->angular_rate[i] -= state->outer_g[r + 3 + i];
  }
}

// Origin of the damping by stiffness, which acts on q' = rate (x - origin) itself. The same rate as
// P - C(omega) q would follow the rotation, and the rotation the iterate: times a bulk modulus that
// changes forces by more than Newton gains (nearly incompressible bodies took 25 to 80 iterations
// a step in free flight, or found none).
static void damp_from(ep_free_step *f) {
  ep_state *state = f->state;
  double rate, inertia;
  const ep_motion motion = {.q = state->q,
                            .v = state->v,
                            .a = f->a,
                            .q_before = state->free_q_before,
                            .v_before = state->v_before,
                            .dt_before = f->dt_before};
  ep_integrator_predict(f->def->integrator, (size_t)state->model->size.r, f->def->dt, &motion,
                        state->free_still, state->free_scratch, &rate, &inertia);
}

// Newmark's rate goes on from that of the step before, and nothing but damping takes errors out of
// it: there it has to act on the very rate the step ends with, P - C(omega) q.
static void damp_end_from(ep_free_step *f, const double *x) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  times(r, state->free_c, x, state->free_still);
  for (int a = 0; a < r; a++)
    state->free_still[a] = state->base[a] + state->free_still[a] / f->rate;
}

void ep_free_begin(ep_free_step *f, ep_state *state, const ep_step_def *def, double dt_before,
                   double *a) {
  const size_t r = (size_t)state->model->size.r;
  double omega[3], velocity[3], acceleration[3], before[3];
  *f = (ep_free_step){.state = state,
                      .def = def,
                      .dt_before = dt_before,
                      .a = a,
                      .mass = state->model->rigid_mass[0]};
  memcpy(f->linear_rate, state->linear_rate, sizeof f->linear_rate);
  memcpy(f->angular_rate, state->angular_rate, sizeof f->angular_rate);
  start_momentum(f, omega);
  if (!f->sound) return;
  memcpy(f->omega_start, omega, sizeof omega);
  if (def->integrator == EP_NEWMARK && dt_before == 0) start_acceleration(f, omega, a);
  const ep_motion motion = {.q = state->q,
                            .v = state->free_p,
                            .a = a,
                            .q_before = state->q_before,
                            .v_before = state->v_before,
                            .dt_before = f->dt_before};
  ep_integrator_predict(def->integrator, r, def->dt, &motion, state->free_base, state->free_ahead,
                        &f->rate, &f->inertia);
  if (def->integrator != EP_NEWMARK) damp_from(f);
  f->turn_inertia = f->inertia;
  if (def->integrator == EP_BDF2 && f->dt_before > 0) f->turn_inertia = 2 * f->rate / def->dt;
  for (int i = 0; i < 3; i++) {
    velocity[i] = state->linear[i] / f->mass;
    acceleration[i] = f->linear_rate[i] / f->mass;
    before[i] = state->linear_before[i] / f->mass;
  }
  predict3(f, state->frame.c, velocity, acceleration, state->c_before, before, f->c_base,
           f->c_ahead);
  carry(f, state->linear, f->linear_rate, state->linear_before, f->linear_ahead);
  carry(f, state->angular, f->angular_rate, state->angular_before, f->angular_ahead);
  memcpy(f->turned, state->frame.R, sizeof f->turned);
}

// ---- the step's rotation -------------------------------------------------------------------

// Momentum at the end of the step with the torque at hand.
static void end_momentum(const ep_free_step *f, const double ahead[3], const double force[3],
                         const double contact[3], double out[3]) {
  const double drag = 1 / (1 + f->def->damping_mass / f->rate);
  for (int i = 0; i < 3; i++) out[i] = drag * (ahead[i] + (force[i] + contact[i]) / f->rate);
}

// R at the end of the step free of contact, into f->turned. The torque of pulls depends on where
// the step ends: there, or at the iterate's rotation.
static int free_rotation(ep_free_step *f, const double *x, const double *rotation) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  static const double none[3] = {0};
  double s[6], j[9], h[3], psi[3] = {0}, last[9];
  for (int a = 0; a < r; a++) state->work[a] = 0.5 * (state->q[a] + x[a]);
  ep_rigid_sums(state->model, state->work, s, NULL, NULL);
  ep_rigid_tensor(s, j);
  ep_rigid_internal(state->model, state->q, x, h);
  for (int i = 0; i < 3; i++) h[i] /= f->def->dt;
  for (int n = 0; n < TURNS_MAX; n++) {
    double l[3], mean[3], turned[9], change = 0;
    pull(f, x, rotation ? rotation : f->turned);
    end_momentum(f, f->angular_ahead, f->torque, none, l);
    for (int i = 0; i < 3; i++) l[i] = 0.5 * (l[i] + state->angular[i]);
    ep_rotate_back(state->frame.R, l, mean);
    if (!ep_mean_rotation(j, mean, h, f->def->dt, psi)) return 0;
    memcpy(last, f->turned, sizeof last);
    ep_rotation_exp(psi, turned);
    ep_multiply3(state->frame.R, turned, f->turned);
    for (int i = 0; i < 9; i++) change = fmax(change, fabs(f->turned[i] - last[i]));
    if (rotation || f->def->pulls == 0 || change < 1e-13) return 1;
  }
  return 0;
}

// ---- freezing ------------------------------------------------------------------------------

// Hessian of -1/2 J(omega, omega) + 1/2 |C x|^2: -|omega|^2 I + omega . S2 omega + C^T C.
static void fill_softening(ep_state *state, const double w[3]) {
  const ep_model *m = state->model;
  const size_t r = (size_t)m->size.r, count = r * (r + 1) / 2;
  const double weight[6] = {w[0] * w[0],     w[1] * w[1],     w[2] * w[2],
                            2 * w[1] * w[2], 2 * w[2] * w[0], 2 * w[0] * w[1]};
  const double square = ep_dot(3, w, w);
  for (size_t a = 0, at = 0; a < r; a++)
    for (size_t b = 0; b <= a; b++, at++) {
      double sum = ep_dot((int)r, state->free_c + a * r, state->free_c + b * r);
      for (size_t k = 0; k < 6; k++) sum += weight[k] * m->rigid_s2[k * count + at];
      state->free_n[a * r + b] = state->free_n[b * r + a] = sum - (a == b ? square : 0);
    }
}

// log(A^T B)
static void difference_of(const double a[9], const double b[9], double log[3]) {
  double back[9], turn[9];
  for (int i = 0; i < 9; i++) back[i] = a[i % 3 * 3 + i / 3];
  ep_multiply3(back, b, turn);
  ep_rotation_log(turn, log);
}

// c (r x r) = C of the mean angular velocity from the step's start to f->turned.
static void fill_mean_coriolis(const ep_free_step *f, double *c) {
  double omega[3];
  difference_of(f->state->frame.R, f->turned, omega);
  for (int i = 0; i < 3; i++) omega[i] /= f->def->dt;
  fill_coriolis(f->state->model, omega, c);
}

// a and b (r), known in the axes of the step's start, in those of its end.
static void turn_both(const ep_free_step *f, const double *c, double *a, double *b) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  turn(r, c, -f->def->dt, a, state->work, state->free_scratch);
  turn(r, c, -f->def->dt, b, state->work, state->free_scratch);
}

// omega at the end of the step, of its momenta. 0 where the deformation could turn the body alone.
static int spin_at_end(ep_free_step *f, const double *x) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  double l[3], l_body[3];
  end_momentum(f, f->angular_ahead, f->torque, f->contact + 3, l);
  ep_rotate_back(f->turned, l, l_body);
  for (int a = 0; a < r; a++) state->free_scratch[a] = f->rate * (x[a] - state->base[a]);
  return spin_of_momenta(r, f->j, state->free_h, l_body, state->free_scratch, f->omega);
}

// The same with something outside. An iterate deep in an obstacle feels a torque that no step ends
// with; taken for spin, its centrifugal force would drive the iterates apart. So it is that of the
// rotation at hand: of free flight (free_turn: twice the mean less that at the start), and what was
// turned from there. An outer potential is smooth, and acts in every step: where half of its torque
// turns the step (Newmark, BDF2) errors of the rotation would double, and it is that of the momenta
// as far as that is within reach.
static void spin_in_contact(ep_free_step *f, const double *x, const double free_turn[3]) {
  const double dt = f->def->dt, outside = f->turn_inertia / f->rate;
  double turned[3], away[3];
  for (int i = 0; i < 3; i++)
    turned[i] = 2 * free_turn[i] / dt - f->omega_start[i] + outside * f->zeta[i];
  const int known = f->def->outer && f->def->integrator != EP_IMPLICIT_EULER && spin_at_end(f, x);
  for (int i = 0; i < 3; i++) away[i] = known ? f->omega[i] - turned[i] : 0;
  const double far = sqrt(ep_dot(3, away, away)) * dt, share = fmin(1, spin_reach / far);
  for (int i = 0; i < 3; i++) f->omega[i] = turned[i] + (far > 0 ? share * away[i] : 0);
}

// base and ahead in the axes of the step's end.
static void turn_predictions(ep_free_step *f) {
  ep_state *state = f->state;
  const size_t bytes = (size_t)state->model->size.r * sizeof(double);
  fill_mean_coriolis(f, state->free_c);
  memcpy(state->base, state->free_base, bytes);
  memcpy(state->aside, state->free_ahead, bytes);
  turn_both(f, state->free_c, state->base, state->aside);
}

void ep_free_freeze(ep_free_step *f, const double *x, const double *rotation) {
  ep_state *state = f->state;
  double s[6], free_turn[3];
  memcpy(state->free_at, x, (size_t)state->model->size.r * sizeof *x);
  f->sound = free_rotation(f, x, rotation);
  if (!f->sound) return;
  memset(f->zeta, 0, sizeof f->zeta);
  if (rotation) {
    difference_of(state->frame.R, f->turned, free_turn);
    difference_of(f->turned, rotation, f->zeta);
    memcpy(f->turned, rotation, sizeof f->turned);
  }
  turn_predictions(f);
  ep_rigid_sums(state->model, x, s, state->free_ds, state->free_h);
  ep_rigid_tensor(s, f->j);
  f->sound = ep_inverse3(f->j, f->j_inverse) && (rotation || spin_at_end(f, x));
  if (!f->sound) return;
  if (rotation) spin_in_contact(f, x, free_turn);
  inertial_forces(f, x, f->omega, f->turned, state->free_ds, state->free_force);
  fill_softening(state, f->omega);
  if (f->def->integrator == EP_NEWMARK) damp_end_from(f, x);
}

int ep_free_settle(ep_free_step *f, const double *x) {
  if (!spin_at_end(f, x)) return 0;
  fill_coriolis(f->state->model, f->omega, f->state->free_c);
  return 1;
}

// a . M b for symmetric M (9).
static double inner3(const double m[9], const double a[3], const double b[3]) {
  double mb[3];
  ep_rotate(m, b, mb);
  return ep_dot(3, a, mb);
}

// scale/2 |B d|^2_M of rows b (3 x r), gradient and Hessian added.
static double add_low_rank(int r, double scale, const double m[9], const double *b, const double *d,
                           double *g, double *h) {
  const size_t n = (size_t)r;
  double along[3], pulled[3];
  for (size_t i = 0; i < 3; i++) along[i] = ep_dot(r, b + i * n, d);
  ep_rotate(m, along, pulled);
  for (size_t a = 0; g && a < n; a++)
    for (size_t i = 0; i < 3; i++) g[a] += scale * pulled[i] * b[i * n + a];
  for (size_t a = 0; h && a < n; a++) {
    const double column[3] = {b[a], b[n + a], b[2 * n + a]};
    double mc[3];
    ep_rotate(m, column, mc);
    for (size_t i = 0; i < 3; i++)
      for (size_t c = 0; c < n; c++) h[a * n + c] += scale * mc[i] * b[i * n + c];
  }
  return 0.5 * scale * ep_dot(3, along, pulled);
}

double ep_free_energy(const ep_free_step *f, const double *x, int joint, double *g, double *h) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  double *d = state->free_scratch, *nd = state->work;
  if (!f->sound) return NAN;
  for (int a = 0; a < r; a++) d[a] = x[a] - state->free_at[a];
  times(r, state->free_n, d, nd);
  double sum = 0.5 * ep_dot(r, d, nd) - ep_dot(r, state->free_force, d);
  for (int a = 0; g && a < r; a++) g[a] += nd[a] - state->free_force[a];
  for (int i = 0; h && i < r * r; i++) h[i] += state->free_n[i];
  sum += add_low_rank(r, 1, f->j_inverse, state->free_g, d, g, h);
  if (!joint) sum += add_low_rank(r, -f->inertia, f->j_inverse, state->free_h, d, g, h);
  return sum;
}

// ---- the step's end ------------------------------------------------------------------------

void ep_free_center(const ep_free_step *f, double c[3]) {
  const double drag = f->def->damping_mass * f->rate;
  for (int i = 0; i < 3; i++)
    c[i] = (f->inertia * f->c_ahead[i] + drag * f->c_base[i] + f->force[i] / f->mass) /
           (f->inertia + drag);
}

// Frame and momenta; what the integrator goes on with without contact (ep_contact_share): rates of
// momenta (Newmark), momenta before (BDF2), which are given its impulse.
static void finish_rigid(ep_free_step *f, const ep_frame *found) {
  ep_state *state = f->state;
  const double drag = f->def->damping_mass;
  memcpy(state->c_before, state->frame.c, sizeof state->c_before);
  memcpy(state->linear_before, state->linear, sizeof state->linear_before);
  memcpy(state->angular_before, state->angular, sizeof state->angular_before);
  for (int i = 0; i < 3; i++) {
    state->linear_before[i] += (f->contact[i] - f->steady[i]) / (f->rate + drag);
    state->angular_before[i] += (f->contact[3 + i] - f->steady[3 + i]) / (f->rate + drag);
  }
  end_momentum(f, f->linear_ahead, f->force, f->contact, state->linear);
  end_momentum(f, f->angular_ahead, f->torque, f->contact + 3, state->angular);
  for (int i = 0; i < 3; i++) {
    state->linear_rate[i] = f->force[i] + f->steady[i] - drag * state->linear[i];
    state->angular_rate[i] = f->torque[i] + f->steady[3 + i] - drag * state->angular[i];
  }
  if (found)
    state->frame = *found;
  else
    ep_free_center(f, state->frame.c);
  memcpy(state->frame.R, f->turned, sizeof f->turned);
  ep_rotation_clean(state->frame.R);
}

void ep_free_finish(ep_free_step *f, const double *x, const ep_frame *found) {
  ep_state *state = f->state;
  const int r = state->model->size.r;
  if (f->def->integrator == EP_BDF2) { // the motion before, in the axes of the step's end
    memcpy(state->free_q_before, state->q, (size_t)r * sizeof *x);
    fill_mean_coriolis(f, state->free_n);
    memcpy(state->q_before, state->q, (size_t)r * sizeof *x);
    memcpy(state->v_before, state->free_p, (size_t)r * sizeof *x);
    turn_both(f, state->free_n, state->q_before, state->v_before);
  }
  for (int a = 0; a < r; a++) {
    state->a[a] = f->inertia * (x[a] - state->aside[a]);
    state->v[a] = f->rate * (x[a] - state->base[a]);
    state->q[a] = x[a];
  }
  times(r, state->free_c, state->q, state->work); // C(omega) of the end: q' = p - C q
  for (int a = 0; a < r; a++) state->v[a] -= state->work[a];
  memcpy(state->end_q, state->q, (size_t)r * sizeof *x);
  memcpy(state->end_v, state->v, (size_t)r * sizeof *x);
  finish_rigid(f, found);
}

double ep_free_kinetic(const ep_state *state) {
  const ep_model *m = state->model;
  double s[6], j[9], h[3], spin[3], velocity[3], omega[3];
  ep_state_motion(state, velocity, spin);
  ep_rotate_back(state->frame.R, spin, omega);
  ep_rigid_sums(m, state->q, s, NULL, NULL);
  ep_rigid_tensor(s, j);
  ep_rigid_internal(m, state->q, state->v, h);
  return 0.5 * (m->rigid_mass[0] * ep_dot(3, velocity, velocity) + inner3(j, omega, omega) +
                ep_dot(m->size.r, state->v, state->v)) +
         ep_dot(3, omega, h);
}
