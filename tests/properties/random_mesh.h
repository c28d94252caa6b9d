// Random solids: boxes, bent and hollow bars, branches, ellipsoids cut from a lattice, with moved
// vertices and graded cells; and where they stand: in which unit, frame and numbering.
#ifndef EP_TESTS_PROPERTIES_RANDOM_MESH_H
#define EP_TESTS_PROPERTIES_RANDOM_MESH_H

#include "mesh/mesh.h"
#include "tests/properties/seeds.h"

typedef enum solid_shape {
  SOLID_BOX,
  SOLID_BENT,   // a bar along an arc
  SOLID_HOLLOW, // the same without its core
  SOLID_BRANCH, // arms from a middle
  SOLID_ELLIPSOID,
  SOLID_SHAPES
} solid_shape;

// A solid in coordinates of its own, about 1 long, its longest way along x.
typedef struct random_solid {
  solid_shape shape;
  int cells[3];
  double size[3];
  double arc;        // angle it is bent by [rad]
  double grading[3]; // last cell over first, along each axis
  double jitter;     // of vertices, over the cell
  int arms;          // of a branch, 2 to 5: the ends of x, y, z
  uint64_t seed;     // of the jitter
} random_solid;

random_solid draw_solid(ep_random *rng);
const char *solid_name(solid_shape shape);
// The same solid in another lattice, about `finer` times as fine.
random_solid other_lattice(const random_solid *solid, double finer, uint64_t seed);

// How far it reaches along x.
double solid_length(const random_solid *solid);

// Lattice order, no tet turned round. Fails the test where memory ends.
ep_mesh solid_mesh(const random_solid *solid);

// A pose: displacements that are smooth in the solid's own coordinates, whatever its lattice.
typedef struct random_pose {
  double bend[2], twist, stretch; // bend towards y and z, twist about x; over the length
} random_pose;
random_pose draw_pose(ep_random *rng, double amount);
// x (n x 3) in the solid's own coordinates, in place. x low is held still.
void pose_points(const random_solid *solid, const random_pose *pose, int n, double *x);

// Where a solid stands: x -> unit (R x + t).
typedef struct placement {
  double unit, R[9], t[3];
  uint64_t numbering; // 0: as it is; else of vertices, tets and of the corners of tets
} placement;
placement at_home(void);
placement draw_placement(ep_random *rng);
void place_point(const placement *at, const double x[3], double out[3]);
void place_vector(const placement *at, const double x[3], double out[3]); // without unit and t
// Vertex i of the mesh becomes vertex to[i] (nv, or NULL). share: of the tets that are turned
// inside out (readers turn them back); *inverted (or NULL): how many these are.
ep_mesh placed_mesh(const ep_mesh *mesh, const placement *at, double share, int *to,
                    ep_mesh_findings *findings, int *inverted);

#endif
