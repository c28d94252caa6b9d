// Meshes for the tests of lbspace/.
#ifndef EP_TESTS_LBSPACE_SHAPES_H
#define EP_TESTS_LBSPACE_SHAPES_H

#include "lbspace/lbspace.h"

// A box of nx x ny x nz cells, lx x ly x lz, one corner at the origin.
ep_mesh shape_box(int nx, int ny, int nz, double lx, double ly, double lz);
// The same solid with its vertices and tets renumbered by a fixed pseudo-random permutation:
// vertex i of the mesh is vertex to[i] of the result.
ep_mesh shape_permuted(const ep_mesh *mesh, int *to);
// A file of the shared data folder, 0 where the folder is absent (then the caller skips).
int shape_from_data(const char *file, ep_mesh *out);

#endif
