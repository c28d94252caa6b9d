// Damped springs that drag the centre of some vertices along a path: what a mouse does. An outer
// potential (reduced/eigenpose.h) of O(r) a step and O(r^2) for its Hessian; nothing of length n.
#ifndef EP_REDUCED_SPRING_H
#define EP_REDUCED_SPRING_H

#include "reduced/eigenpose.h"

#ifdef __cplusplus
extern "C" {
#endif

// Energy k/2 |p - b|^2 + c/(2 dt) |(p - p_0) - (b - b_0)|^2 of the centre p = sum_i w_i x_i, sum w
// = 1, and the point b it is dragged to; p_0, b_0: at the beginning of the step. A held object:
// p = rest + rows q; a free one: p = c + R (rest - X_0 + rows q).
typedef struct ep_spring {
  const double *rows;    // (3 x r) sum_i w_i U_i
  double rest[3];        // sum_i w_i X_i [length]
  double stiffness;      // k [N/m]; 0: let go
  double damping;        // c [N s/m]
  double from[3], to[3]; // b_0 and b [length]
  double start[3];       // p_0: ep_springs_begin
} ep_spring;

typedef struct ep_springs {
  int count;
  ep_spring *spring; // (count) caller's
  double dt;         // of the step [s]
} ep_springs;

// Where the centre is now, p (3).
void ep_spring_center(const ep_state *state, const ep_spring *spring, double p[3]);
// Before each step: takes p_0 from the state.
void ep_springs_begin(const ep_state *state, double dt, ep_springs *springs);
// ep_step_def.outer, with the springs as outer_user.
double ep_springs_energy(void *springs, const ep_state *state, const ep_frame *frame,
                         const double *q, double *g, double *h, int n);

#ifdef __cplusplus
}
#endif
#endif
