// Pressure on the object's surface in the subspace: a force that follows the surface,
//   f_a(q) = -p sum_triangles n(q) . (U_a0 + U_a1 + U_a2) / 3,   n: area times outward normal,
// linear in q about rest: -p (f0 + B q). Taken at the beginning of each step.
#ifndef EP_APP_RUN_PRESSURES_H
#define EP_APP_RUN_PRESSURES_H

#include "app/scene/shapes.h"

typedef struct ep_pressures {
  int count, r;
  double *f0; // (count x r)
  double *b;  // (count x r x r)
} ep_pressures;

// Errors: EP_ERR_MEMORY, those of selections; EP_ERR_UNSUPPORTED for a part of the surface of a
// free object (its force and torque are not followed; on the whole surface they are zero).
ep_status ep_pressures_make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                            ep_pressures *out, ep_error *err);
void ep_pressures_free(ep_pressures *pressures);
// Adds the forces at time t, for the object at q (r), to force (r).
void ep_pressures_add(const ep_scene *scene, const ep_pressures *pressures, double t,
                      const double *q, double *force);

#endif
