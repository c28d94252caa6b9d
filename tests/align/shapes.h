// Test shapes: bars of tets with known parameters, and whole shapes with their LB space.
#ifndef EP_TESTS_ALIGN_SHAPES_H
#define EP_TESTS_ALIGN_SHAPES_H

#include <stddef.h>

#include "align/align.h"

typedef struct test_shape {
  ep_mesh mesh;
  ep_lb lb;
  ep_csr mass;
  ep_shape shape;
} test_shape;

// Takes the mesh over and computes `count` eigenpairs.
void shape_from_mesh(test_shape *s, ep_mesh *mesh, int count);
void shape_from_file(test_shape *s, const char *folder, const char *file, int count);
void shape_free(test_shape *s);
// Path of the data folder, or NULL where it is absent.
const char *data_folder(const char *name, char *path, size_t size);

// Where a point (u, v, w) of the body [0, 1]^3 of parameters lies in space.
typedef void (*placement)(const double u[3], double x[3]);
// cells[0] x cells[1] x cells[2] cubes of six tets; the vertices' parameters into u (nv x 3).
void lattice(const int cells[3], placement place, ep_mesh *mesh, double **u);
// A bar with a bulge at one end and a bow, so that no symmetry is left.
void place_club(const double u[3], double x[3]);
// The same with its far half turned by 90 degrees.
void place_bent_club(const double u[3], double x[3]);
// x <- scale R x + shift, R about an axis.
void move_mesh(ep_mesh *mesh, const double axis[3], double degrees, double scale, double shift);
// Reorder vertices: new vertex i is old vertex order[i].
void permute_mesh(const ep_mesh *mesh, const int *order, ep_mesh *out);

#endif
