// Implicit time integrators as one incremental potential (docs/method.md "Time step"): each is told
// by what it makes of velocity and acceleration at the new configuration x,
//   v(x) = rate (x - base),   a(x) = inertia (x - ahead),
// and then x minimises inertia/2 |x - ahead|_M^2 + rate/2 |x - base|_D^2 + W(x) - f . x, which is
// the equation of motion M a + D v + dW/dx = f at the end of the step. The subspace and the full
// space share this file, so that they differ in nothing else.
#ifndef EP_REDUCED_INTEGRATOR_H
#define EP_REDUCED_INTEGRATOR_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ep_integrator {
  EP_IMPLICIT_EULER, // order 1, damps
  EP_NEWMARK,        // Newmark 1959 with gamma 1/2, beta 1/4 (average acceleration): order 2, no
                     // damping of its own
  EP_BDF2,           // Gear's two-step formula with variable steps: order 2, damps high frequencies
  EP_INTEGRATORS
} ep_integrator;

// "implicit-euler", "newmark", "bdf2"; NULL outside the enumeration.
const char *ep_integrator_name(ep_integrator kind);

// The motion so far, n unknowns each.
typedef struct ep_motion {
  const double *q, *v;               // now
  const double *a;                   // acceleration now: Newmark only
  const double *q_before, *v_before; // one step of dt_before earlier: BDF2 only
  double dt_before;                  // 0: nothing before; BDF2 then takes one step of Euler, whose
                                     // local error h^2 keeps the order
} ep_motion;

// dt_before, or 0 where the step before it is not to be gone by: BDF2 is not stable where steps
// grow more than 1 + sqrt(2) times (Hairer, Norsett, Wanner, Solving ODEs I, III.5): what the two
// steps before differ in would be drawn out far ahead, after an impact or where Newton's errors are
// all there is.
double ep_integrator_before(ep_integrator kind, double dt, double dt_before);

// base and ahead (n) of a step of dt; returns through rate [1/s] and inertia [1/s^2].
void ep_integrator_predict(ep_integrator kind, size_t n, double dt, const ep_motion *motion,
                           double *base, double *ahead, double *rate, double *inertia);

#ifdef __cplusplus
}
#endif
#endif
