// The training system: what the elements' forces must add up to, and how well a set of elements
// does.
#ifndef EP_CUBATURE_SYSTEM_H
#define EP_CUBATURE_SYSTEM_H

#include "cubature/gram.h"
#include "cubature/poses.h"

// Poses with the force of all elements.
typedef struct ep_training {
  const ep_elements *elements; // borrowed
  const ep_pose_set *poses;    // borrowed
  double *force;               // (poses x r) f = sum_e V_e f_e
  double *scale;               // (poses) 1 / |f|, so that every pose counts the same
} ep_training;

// Errors: EP_ERR_NUMERIC for a force that is zero or not finite (message: pose).
ep_status ep_training_make(const ep_elements *elements, const ep_pose_set *poses, ep_training *out,
                           ep_error *err);
void ep_training_free(ep_training *training);

// Fill a and b of a Gram system whose column e is V_e f_e over all poses, rows scaled per pose.
// gram->rows is poses x r, or less: then rows are sketched with a sparse random sign embedding
// (Nelson and Nguyen 2013), which keeps inner products up to ~ sqrt(1 / rows), drawn from random.
ep_status ep_training_system(const ep_training *training, ep_random *random, ep_gram *gram,
                             ep_error *err);

// Weights >= 0 (count; absolute volumes) of the given elements that fit all rows best, never
// sketched.
ep_status ep_training_refit(const ep_training *training, int count, const int *tet, double *weight,
                            ep_error *err);

// sqrt(mean over poses of |f - f~|^2 / |f|^2) of elements with weights.
ep_status ep_training_error(const ep_training *training, int count, const int *tet,
                            const double *weight, double *error, ep_error *err);

// The same over the poses of one region (EP_ALL_POSES: all); 0 where there is none.
enum { EP_ALL_POSES = -2 };
ep_status ep_training_region_error(const ep_training *training, int region, int count,
                                   const int *tet, const double *weight, double *error,
                                   ep_error *err);

#endif
