// Checks of a new mesh (private to mesh/).
#ifndef EP_MESH_CHECK_H
#define EP_MESH_CHECK_H

#include "mesh/mesh.h"

// A tet is degenerate where |V| is not above this times (longest edge)^3: independent of units. A
// regular tet has 0.118; coordinates written with 6 digits leave noise of 1e-7.
#define EP_DEGENERATE_VOLUME 1e-12
// Whether the tet v (4) at positions x (nv x 3), of that volume, is; so is one with a vertex twice.
bool ep_tet_degenerate(const double *x, const int *v, double volume);

// Turns inverted tets round, leaves out repeated tets, and fills the findings on degenerate and
// repeated tets, duplicate vertices and components. Vertices must be used, indices in range.
ep_status ep_check_mesh(ep_mesh *mesh, ep_mesh_findings *findings, ep_error *err);

#endif
