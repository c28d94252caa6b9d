// What an obstacle does to one point of a surface in one implicit step: a penalty in the normal
// direction, damping of the normal motion, Coulomb friction. Shared by the subspace
// (reduced/contact.c) and the full space (reduced/bake/full_contact.c), so that they differ in
// nothing else. World coordinates throughout.
#ifndef EP_REDUCED_CONTACT_POINT_H
#define EP_REDUCED_CONTACT_POINT_H

#include "reduced/obstacle.h"

// The law of one step.
typedef struct ep_contact_law {
  double stiffness; // k: pressure per depth [Pa/m]
  double thickness; // h: contact begins at this distance [length]
  double depth;     // delta: penetration at which it gets stiffer [length]
  double damping;   // c [s]: normal pressure c k phi'' times the speed
  double creep;     // speed up to which friction is viscous [length/s]
  double dt;        // of the step [s]
  int careful;      // Hessian of friction that lies above it everywhere: Newton cannot overshoot
                    // from sliding past sticking, but converges linearly
} ep_contact_law;

// Where the point is. Pointers that a law does not need may be NULL: start and lag without
// friction and damping, ahead where `fast` is 0.
typedef struct ep_contact_path {
  const double *now;   // x (3)
  const double *start; // at the beginning of the step
  const double *lag;   // where the normal force that friction goes by is taken
  const double *ahead; // where free flight would take it
  int fast;            // it may cross much of the obstacle in the step: mind its path
} ep_contact_path;

// What acts on the point: energy to minimise (normal, damping, friction), its gradient and a
// positive semidefinite approximation of its Hessian. All are added to, but distance and pressing.
typedef struct ep_contact_action {
  double energy, gradient[3], hessian[9];
  double normal_energy; // of the penalty alone: what is stored
  double distance;      // signed, at x
  double pressing;      // normal force at x [N]
} ep_contact_action;

// phi(p), p = h - distance, y = (p - h) / delta the penetration: phi'' = p / h up to p = h, then 1
// + 20 y^3, constant from y = 4 on: twice continuously differentiable, convex. Soft where things
// rest, stiffer the deeper they go: to y = 4 it takes 300 times the pressure of a penalty with
// phi'' = 1, so that impacts end before, without a stiffness that changes over time and would bring
// energy in. Returns phi; slope and curvature too.
double ep_contact_penalty(const ep_contact_law *law, double p, double *slope, double *curvature);

// A point with surface area `area`. With d the distance, p = h - d:
//   normal   k A phi(p): Hessian k A phi''(p) n n^T (the obstacle's own curvature would make it
//            indefinite and is left out);
//   damping  1/2 (c k A phi''(p_lag) / dt) (n . s)^2, s the point's motion in the step relative to
//            the obstacle's, n the normal at x_lag;
//   friction mu N f0(|s_t|), N = k A phi'(p_lag): f0 = |s_t| smoothed below creep dt (Li et al.
//            2020, Incremental Potential Contact, eq. 11 to 14). Opposes sliding: only dissipates.
// Against tunnelling: a point that is `fast` and whose path from start to ahead enters the obstacle
// meets the half-space that touches it there, in this step. Returns 1 where anything acts.
int ep_contact_point(const ep_contact_law *law, const ep_obstacle *obstacle,
                     const ep_contact_path *path, double area, ep_contact_action *action);

// How friction's normal force at lag differs from that at now: |difference| [N] added to change,
// that at now to pressing. Nothing without path->lag.
void ep_contact_change(const ep_contact_law *law, const ep_obstacle *obstacle,
                       const ep_contact_path *path, double area, double *change, double *pressing);

#endif
