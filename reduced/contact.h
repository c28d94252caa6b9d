// Contact of the reduced object with rigid obstacles (docs/method.md "Contact"). Surface vertices
// are found by a tree of bounding balls whose centres and radii follow q (James and Pai 2004,
// BD-Tree: output-sensitive collision detection for reduced deformable models), so the cost follows
// the number of vertices that touch. Each acts by reduced/contact_point.h, its gradient pulled back
// by [R U_i, I, -(x - c) x]. Nothing is stored per vertex.
//
// A step: ep_contact_begin; minimise with ep_contact_energy; while ep_contact_again, minimise once
// more from there; ep_contact_measure.
#ifndef EP_REDUCED_CONTACT_H
#define EP_REDUCED_CONTACT_H

#include "reduced/eigenpose.h"

// 1 where the model knows its surface and the step has obstacles; else the functions below do
// nothing and return 0.
int ep_contact_acts(const ep_state *state, const ep_step_def *def);

// The step's beginning (q_start, start) and where free flight would take the object (q_ahead,
// ahead). Frames: NULL for a held object, whose model space is the world. All are copied.
// dt_before: of the step before, 0 where none counts.
void ep_contact_begin(ep_state *state, const ep_step_def *def, double dt_before,
                      const ep_frame *start, const ep_frame *ahead, const double *q_start,
                      const double *q_ahead);

// Contact energy of the object at q (r), frame. Gradient added to g (n), Hessian (positive
// semidefinite approximation) to h (n x n row-major, symmetric before and after) unless NULL.
// Unknowns: n = r for a held object (frame NULL); n = r + 6 for a free one: q, translation,
// rotation vector about frame->c, both in world axes: dx = dc + dtheta x (x - c) + R U_i dq. The
// Hessian is that of x linear in the unknowns.
double ep_contact_energy(ep_state *state, const ep_step_def *def, const ep_frame *frame,
                         const double *q, double *g, double *h, int n);

// After a minimum was found at q, frame: 1 where it has to be found once more, because friction has
// to go by the normal forces found (at most EP_FRICTION_PASSES times).
int ep_contact_again(ep_state *state, const ep_step_def *def, const ep_frame *frame,
                     const double *q);

// What acts at q, frame in this step. Force on the object and its torque about frame->c (the
// origin for a held object), friction and damping included.
void ep_contact_measure(ep_state *state, const ep_step_def *def, const ep_frame *frame,
                        const double *q, ep_contact_report *report);

// Checks the tree of a model that was read: ranges ascending and inside. 1 where sound.
int ep_contact_tree_sound(const ep_model *model);

#endif
