// Poses of local examples: what an example says about its region, carried on to the whole object
// (Zhao et al. 2018, sec. 5 "Local examples" sets everything outside to rest).
//
// The rest of the object falls into parts, which only the region connects. A part with fixed
// vertices stays at rest (where nothing is fixed at all, the largest one does); any other part is
// carried along by its edge, rigidly: set to rest too, it would hold the region where it is,
// although the example says nothing about it.
#ifndef EP_APP_BAKE_POSE_LOCAL_H
#define EP_APP_BAKE_POSE_LOCAL_H

#include "app/scene/shapes.h"

typedef struct ep_pose_limits {
  const ep_mesh *mesh;  // borrowed, as is weight
  const double *weight; // (nv) of the region
  int parts;            // of the object outside
  int *part; // (nv) of each vertex with a weight below 1; -1 inside, or where none is near
  unsigned char *stays; // (parts) at rest
  unsigned char *edge;  // (nv) shares a tet with the region, and has a weight below 1/2 itself
  unsigned char *held;  // (nv) at rest in the pose: fixed vertices, and parts that stay
  double *anchor;       // (nv) 1: tells where the pose belongs; else 0
} ep_pose_limits;

// Errors: EP_ERR_MEMORY.
ep_status ep_pose_limits_make(const ep_shapes *shapes, const double *weight, ep_pose_limits *out,
                              ep_error *err);
void ep_pose_limits_free(ep_pose_limits *limits);

// u (nv x 3), a displacement of the whole object: moved rigidly so that the region's edge to what
// stays (and its fixed vertices) comes to rest as well as it can, then limited to the region,
// blended by its weight. *shift: how far that edge remains off rest, rms over the diagonal.
ep_status ep_pose_limit(const ep_pose_limits *limits, double *u, double *shift, ep_error *err);

#endif
