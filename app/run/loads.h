// Forces of a scene's loads: over time, on the vertices, in the subspace.
#ifndef EP_APP_RUN_LOADS_H
#define EP_APP_RUN_LOADS_H

#include "app/scene/shapes.h"

// Strength of a push at time t: 0 outside from..until, linear rise and fall over `ramp`.
double ep_load_profile(const ep_load *load, double t);

// Nodal forces of a load at full strength (3n) [N]: gravity by the vertices' lumped masses (mass,
// n), a push spread over the chosen vertices by theirs. Errors: those of selections.
ep_status ep_load_forces(const ep_load *load, const ep_mesh *mesh, const double *mass, double *out,
                         ep_error *err);

// U^T of them into out (r). mass (n) as above. Errors: EP_ERR_MEMORY and those of selections.
ep_status ep_load_project(const ep_load *load, const ep_shapes *shapes, const ep_model *model,
                          const double *mass, double *out, ep_error *err);

#endif
