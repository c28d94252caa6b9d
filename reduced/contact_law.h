// What a step makes of the contact numbers it is given, and when it is solved again for friction.
// Shared by the subspace and the full space.
#ifndef EP_REDUCED_CONTACT_LAW_H
#define EP_REDUCED_CONTACT_LAW_H

#include "reduced/contact_point.h"
#include "reduced/eigenpose.h"

enum { EP_FRICTION_PASSES = 4 }; // a step is solved at most so often again for friction
// Friction is settled when the normal forces it goes by are right to this share of their sum.
#define EP_FRICTION_TOLERANCE 0.02

// What contact keeps of the step at hand.
typedef struct ep_contact_memory {
  int passes;   // solved again for friction
  int hessians; // evaluated
  double share; // ep_contact_share
} ep_contact_memory;

// 1 where the contact numbers of a step are finite and in range, its obstacles too.
int ep_contact_def_valid(const ep_step_def *def);

// hessian: one is to be evaluated. Every other one is careful: exact ones alone jump to and fro
// between sliding and sticking, careful ones alone converge slowly (4 to 10 times as many steps).
// unit: Young's modulus over the extent [Pa/m]; extent: of the object at rest.
ep_contact_law ep_contact_choose(const ep_step_def *def, double unit, double extent, int hessian,
                                 ep_contact_memory *memory);

// Factor of the contact energy in the incremental potential: rate dt (reduced/integrator.h), so
// that its impulse in the step is all of dt times its force (Kane, Repetto, Ortiz and Marsden
// 1999). With Newmark half of the force would come from the step before; with BDF2 a third of the
// impulse would follow in the steps after, whether the object still touches or not. Both feed
// energy in. So the motion they go on with is free of contact: ep_contact_split. dt_before: 0 where
// no step before counts.
double ep_contact_share(const ep_step_def *def, double dt_before);

void ep_contact_memory_begin(const ep_step_def *def, double dt_before, ep_contact_memory *memory);

// Does the integrator go on with a motion that is to be free of contact?
int ep_contact_split(const ep_step_def *def);

// After a minimum: 1 where the step has to be solved again for friction. change, pressing: of the
// normal forces friction goes by, and their sum.
int ep_contact_retry(double change, double pressing, ep_contact_memory *memory);

// One point's action into the report; arm (3): from where torques are taken to the point.
void ep_contact_report_add(const ep_contact_law *law, const ep_contact_action *action,
                           const double arm[3], ep_contact_report *report);

#endif
