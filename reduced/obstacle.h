// Rigid obstacles an elastic object may touch: half-spaces, spheres, boxes, each with its pose at
// the beginning and at the end of a step. Distances are exact; no allocation, libm only.
#ifndef EP_REDUCED_OBSTACLE_H
#define EP_REDUCED_OBSTACLE_H

#include "reduced/frame.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ep_obstacle_kind {
  EP_OBSTACLE_PLANE,  // half-space: local z <= 0 is solid
  EP_OBSTACLE_SPHERE, // centre at the local origin
  EP_OBSTACLE_BOX     // centre at the local origin, along the local axes
} ep_obstacle_kind;

typedef struct ep_obstacle {
  ep_obstacle_kind kind;
  double size[3];  // sphere: radius in size[0]; box: half lengths [length]; plane: unused
  double rounding; // box: radius of its edges, 0 to the smallest half length; 0: sharp
  double friction; // Coulomb's coefficient, >= 0
  // Poses: world = c + R local. Equal for an obstacle that stands still.
  ep_frame start, end; // at the beginning and at the end of the step
} ep_obstacle;

// 1 where every number is finite and in range (rotations are not checked).
int ep_obstacle_valid(const ep_obstacle *obstacle);

// world = c + R local and back.
void ep_obstacle_to_world(const ep_frame *pose, const double local[3], double world[3]);
void ep_obstacle_to_local(const ep_frame *pose, const double world[3], double local[3]);

// Signed distance of a point in local coordinates (negative inside) and its gradient, a unit
// vector. Euclidean outside; inside a box the distance to the nearest face (of the box without its
// rounding, less the rounding). Continuous, with a continuous gradient outside and inside down to
// the depth of the rounding; at a sphere's centre the gradient is the local z axis.
double ep_obstacle_distance(const ep_obstacle *obstacle, const double local[3], double normal[3]);

// Radius of the largest ball inside: half the thickness a point must cross to come out on the wrong
// side. Infinite for a half-space.
double ep_obstacle_inner_radius(const ep_obstacle *obstacle);

// Against tunnelling: does the straight path from `from` to `to` (local coordinates) enter the
// obstacle? If so 1, and the half-space {y: normal . y <= offset} that touches it where the path
// enters (a sphere's tangent plane, a box's face; at a path that begins inside: the nearest one).
int ep_obstacle_entry(const ep_obstacle *obstacle, const double from[3], const double to[3],
                      double normal[3], double *offset);

#ifdef __cplusplus
}
#endif
#endif
