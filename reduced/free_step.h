// The moving part of a free object's step (docs/method.md "Free motion"). Private to the run time.
//
// In the body's axes q obeys q'' + 2 C q' + C(omega') q = F + 1/2 dJ/dq(omega, omega), with
// C_ba = omega . h_ab antisymmetric. Written for the momentum p = q' + C q, q and p turn by -C
// together,
//   q' = p - C q,   p' = -C p + [F + C C q + 1/2 dJ/dq(omega, omega)],
// so that in axes turned by P(t), P' = -C P, Coriolis and Euler forces are gone: an integrator is
// applied to (q, p) turned by P = exp(-dt C(omega_m)) to the step's end. Nothing gyroscopic is left
// to be lagged; the Hessian is symmetric; turning costs no energy at any dt.
//
// Momenta are the state: L changes by torques alone, and the step's rotation psi = dt omega_m obeys
//   J_m psi / dt = (L_b + L_b') / 2 - h(q, x) / dt,   L_b = R^T L,  L_b' = exp(-psi) L_b,
// J_m at (q + x) / 2: of second order, exact for steady spin, and a rigid body keeps its energy
// exactly ((L_b' - L_b) . J^-1 (L_b + L_b') = 0). At the end of the step
// (J - H H^T) omega = L_b - H p, H = [h . q].
//
// What follows the iterate (psi, P, omega) is frozen between Newton steps and brought up to date
// after each (ep_newton.refresh); its first derivatives are in the Hessian where they are
// symmetric: -inertia H^T J^-1 H (the body turns back when q accelerates; with contact the rotation
// is an unknown and the coupling is explicit) and G^T J^-1 G, G_a = dJ/dq_a omega (stretched, it
// spins slower).
#ifndef EP_REDUCED_FREE_STEP_H
#define EP_REDUCED_FREE_STEP_H

#include "reduced/state.h"

typedef struct ep_free_step {
  ep_state *state;
  const ep_step_def *def;
  double rate, inertia;  // of the integrator
  double dt_before;      // of the step before; 0: none that counts
  const double *a;       // (r) acceleration at the start (Newmark)
  double linear_rate[3]; // of the momenta at the start (Newmark)
  double angular_rate[3];
  double omega_start[3]; // body axes
  // inertia of the rotation: a torque outside at the end turns the step by J^-1 torque /
  // turn_inertia: half its impulse where psi follows the mean momentum (Newmark, BDF2), all of it
  // for implicit Euler
  double turn_inertia;
  double mass;
  double c_base[3], c_ahead[3]; // as integrator.h, of the centre of mass
  double linear_ahead[3];       // momenta at the end if nothing acts
  double angular_ahead[3];      //
  double force[3], torque[3];   // of gravity and pulls at the end of the step
  double contact[6];            // force and torque (about c) of what is outside, in the same way
  double steady[6];             // of it, what is a force like others to the integrator
  // frozen:
  double turned[9];                    // R at the end, free of contact; with contact: the iterate
  double zeta[3];                      // rotation from the contact-free R to it, body axes
  double j[9], j_inverse[9], omega[3]; // at the end of the step, body axes
  int sound;                           // 0: the rotation was not found; energies are NaN
} ep_free_step;

// Predictions from the state's motion; fills the unturned base and ahead of q. dt_before: 0 where
// the motion before does not count. a (r): the state's acceleration; Newmark without motion before:
// that of the deformation alone (step.c), completed here.
void ep_free_begin(ep_free_step *f, ep_state *state, const ep_step_def *def, double dt_before,
                   double *a);

// Freeze at x: sets state->base, state->aside (turned), and everything above. rotation: NULL in
// free flight; else R of the iterate (9), contact set.
void ep_free_freeze(ep_free_step *f, const double *x, const double *rotation);

// Inertial forces and pulls frozen at state->free_at: energy relative to there, gradient added to g
// (r), Hessian to h (r x r) unless NULL. joint: without the part that eliminates the rotation.
double ep_free_energy(const ep_free_step *f, const double *x, int joint, double *g, double *h);

// The centre of mass at the end of the step, free of contact.
void ep_free_center(const ep_free_step *f, double c[3]);

// With contact: omega at the end of the step by its momenta, x and contact found; while they were
// looked for the rotation had a say. 0: there is none, and the state is as it was.
int ep_free_settle(ep_free_step *f, const double *x);

// Into the state: momenta, frame, acceleration of the rigid motion, velocity (q' from p at x).
// found: NULL in free flight, else c and R with contact.
void ep_free_finish(ep_free_step *f, const double *x, const ep_frame *found);

// Kinetic energy of the state.
double ep_free_kinetic(const ep_state *state);

#endif
