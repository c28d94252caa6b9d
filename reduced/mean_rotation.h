// The turn of a step (reduced/free_step.h). Private to the run time.
#ifndef EP_REDUCED_MEAN_ROTATION_H
#define EP_REDUCED_MEAN_ROTATION_H

// Rotation vector psi [rad], body axes of the step's start, with
//   J psi / dt = (L + exp(-psi) L) / 2 - h
// for the inertia tensor j (9), the angular momentum l (3) and that inside the body, h (3). psi:
// where to begin. 0 where none of less than half a turn was found.
int ep_mean_rotation(const double j[9], const double l[3], const double h[3], double dt,
                     double psi[3]);

#endif
