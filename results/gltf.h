// Animations as binary glTF 2.0 (.glb): the surface at rest, the modes as morph targets, q(t) as
// their weights. Blender, engines and browsers play it without knowing anything of Eigenpose.
#ifndef EP_RESULTS_GLTF_H
#define EP_RESULTS_GLTF_H

#include <stdbool.h>

#include "base/error.h"

// A rigid body beside the object. Arrays are borrowed.
typedef struct ep_gltf_solid {
  int n;           // vertices of x; only those its triangles use are stored
  const double *x; // (n x 3) in the body's own coordinates
  int triangles;
  const int *triangle; // (triangles x 3) outward
  bool flat;           // faces shaded flat (boxes), else smoothly (spheres)
  const double *pose;  // (frames x 12) position (3) and rotation (row-major 9) in every frame
} ep_gltf_solid;

// Blender clamps weights to [0, 1], so each mode is shifted and scaled to its own range over the
// trajectory: base shape X + sum_a U_a min_a, target a = U_a (max_a - min_a), weight a =
// (q_a - min_a) / (max_a - min_a), 0 where a mode does not move. Hence base + sum of weight x
// target = X + U q up to single precision. Only vertices that triangles use are stored.
typedef struct ep_gltf_animation {
  const char *name;    // of the node and the mesh
  int n, r, frames;    // vertices, modes (0: a still), frames (0: a still at rest)
  const double *x;     // (n x 3) rest positions [m; glTF is in metres]
  const double *u;     // (r x n x 3) modes
  const double *q;     // (frames x r)
  const double *time;  // (frames) [s], strictly ascending, from >= 0
  int triangles;       // surface
  const int *triangle; // (triangles x 3) outward
  const float *color;  // (n x 3) linear RGB per vertex, or NULL
  float base_color[3]; // linear RGB of the material; white where `color` is given makes sense
  const double *pose;  // (frames x 12) where the object is as a whole, as of a solid; NULL: stays
  int solids;
  const ep_gltf_solid *solid; // (solids)
  bool target_normals;        // store how each target changes the normals: larger, better lit
} ep_gltf_animation;
ep_gltf_animation ep_default_gltf(void);

// Errors: EP_ERR_ARGUMENT (times not ascending, vertex out of range, NaN), EP_ERR_UNSUPPORTED
// (more than 4 GiB), EP_ERR_IO, EP_ERR_MEMORY. Same input, same bytes.
ep_status ep_gltf_write(const char *path, const ep_gltf_animation *animation, ep_error *err);

#endif
