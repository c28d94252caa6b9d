// Arrays of a mesh file on its vertices, as a scene names them.
#ifndef EP_APP_SCENE_POINT_DATA_H
#define EP_APP_SCENE_POINT_DATA_H

#include "mesh/mesh.h"

// The scalars (nv, borrowed) of that name. Errors: EP_ERR_SCENE beginning with the key: no such
// array (those there are listed), not a scalar, not a finite number (with the vertex).
ep_status ep_scalar_of(const ep_mesh *mesh, const char *key, const char *name, const double **value,
                       ep_error *err);
void ep_scalar_range(const ep_mesh *mesh, const double *value, double *low, double *high);

#endif
