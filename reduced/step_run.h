// The step at hand, shared by its parts: what acts inside the object and what goes with time
// (step.c), a free object together with the world (joint.c). Private to the run time.
#ifndef EP_REDUCED_STEP_RUN_H
#define EP_REDUCED_STEP_RUN_H

#include "reduced/free_step.h"

typedef struct ep_step_run {
  ep_state *state;
  const ep_step_def *def;
  int examples;              // an example force acts
  const double *kept_weight; // (s) of the material where relief takes a part of it; NULL: all alike
  int contact, outer;        // there are obstacles, or an outer potential: something outside acts
  int free;                  // the object is free
  int joint;                 // its rigid motion is among the unknowns
  double dt_before;          // of the step before; 0: none that counts
  double *a;                 // (r) acceleration at the start (Newmark)
  double rate, inertia;      // of the integrator
  ep_free_step motion;       // of a free object
  ep_frame iterate;          // joint: where increments are counted from
  double unit[2];            // joint: sqrt of mass and of a mean moment of inertia
  double inside;             // last evaluation: energy without what is frozen
  double internal;           // last evaluation: |force| inside, energies
  double elastic, pull, strains;
  double cancelling; // energy of terms that cancel: round-off counts from there
} ep_step_run;

// The incremental potential at x (step.c), as ep_newton.energy; its user is the ep_step_run.
double ep_step_energy(void *user, const double *x, double *g, double *h, int project);

// ---- what is outside (joint.c) ---------------------------------------------------------------
// Energy of contact and outer potential at x, frame; gradient added to g (n), Hessian to h (n x n)
// unless NULL, n = r for a held object, r + 6 for a free one.
double ep_outside_energy(ep_step_run *s, const ep_frame *frame, const double *x, double *g,
                         double *h);

// Where something outside acts on a free object, q, the centre of mass and the rotation are found
// together: unknowns x (r), sqrt(m) (c - c_start), sqrt(j) theta with R = exp(theta) R_iterate, j a
// mean moment of inertia, so that all are in the units of q.
//
// ep_joint_energy adds what is outside and the rigid motion to g (r -> n) and h (r x r -> n x n),
// and the former to inner_g; ep_joint_rigid the inertia of the rigid motion alone.
double ep_joint_energy(ep_step_run *s, const double *x, double *g, double *h);
double ep_joint_rigid(const ep_step_run *s, const double *x, double *g, double *h);
// After a step of Newton: the iterate's frame becomes the one increments are counted from.
void ep_joint_take_iterate(ep_step_run *s, double *x);
// |rigid motion - that free of contact|^2 in the units of q.
double ep_joint_ahead(const ep_step_run *s, const double *x);
// Frame at the end of free flight (frozen at x).
void ep_joint_flight(const ep_step_run *s, ep_frame *frame);
// Does anything outside act where free flight ends?
int ep_joint_needed(ep_step_run *s);
// Make the rigid motion part of the unknowns, from the end of free flight or from where the step
// began, whichever has the lower potential.
void ep_joint_begin(ep_step_run *s);
// Force and torque of what is outside at the end of the step; 0 where nothing acted after all.
int ep_joint_finish(ep_step_run *s);

#endif
