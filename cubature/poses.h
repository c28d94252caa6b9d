// Training poses (docs/method.md "Cubature training"): random in the subspace, along the example
// paths, relative to the examples.
#ifndef EP_CUBATURE_POSES_H
#define EP_CUBATURE_POSES_H

#include "base/random.h"
#include "cubature/cubature.h"
#include "cubature/forces.h"

enum { EP_PATH_STATIONS = 4 };

// Reduced coordinates along the way from rest to each example, equidistant in Green strain:
//   q(w) = argmin |E(q) - w E(q_i)|^2_D, w = 1/4, 1/2, 3/4, 1    (Zhang et al. 2015, sec. 5).
// out (examples x EP_PATH_STATIONS x r); the last station is the example itself.
ep_status ep_example_paths(const ep_elements *elements, const ep_basis *basis, double *out,
                           ep_error *err);

typedef enum ep_pose_kind {
  EP_POSE_RANDOM,
  EP_POSE_PATH,
  EP_POSE_RELATIVE,
  EP_POSE_KINDS
} ep_pose_kind;

typedef struct ep_pose_set {
  int count, r;
  double *q;           // (count x r)
  double *reference;   // (count x r), used where kind is EP_POSE_RELATIVE
  ep_pose_kind *kind;  // (count)
  int *region;         // (count) only the force of this region counts; -1: all
  const double *share; // (regions x nt), borrowed
  int nt;
  int shrunk; // how many had to be made smaller because too many elements turned over
} ep_pose_set;

// `stream` tells training from held-out poses of one seed; both hold the kinds in the same
// proportion (without examples all are random; with examples 1/2, 1/8, 3/8). With regions, poses
// relative to an example count in its region only, and half of `count` more, along the paths, count
// the force of the material in the region of their example.
// options: amplitude, seed, regions.
// paths from ep_example_paths (unused without examples).
// Errors: EP_ERR_NUMERIC where K0 is not positive definite or no pose can be made.
ep_status ep_poses_make(const ep_elements *elements, const ep_basis *basis, const double *paths,
                        const ep_cubature_options *options, int count, uint64_t stream,
                        ep_pose_set *out, ep_error *err);
void ep_poses_free(ep_pose_set *poses);
ep_pose ep_pose_at(const ep_pose_set *poses, int i);

#endif
