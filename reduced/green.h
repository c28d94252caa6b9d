// Private part of the Green-strain path: products with the coefficients, compiled per instruction
// set like the cubature kernels (green_body.h). The weights: green_weights.h; the potential: state.h.
#ifndef EP_REDUCED_GREEN_H
#define EP_REDUCED_GREEN_H

#include "reduced/isa.h"

// One evaluation of count quadratic forms y_i = linear_i . z + 1/2 z^T B_i z over width = 8 blocks
// lanes. B_i: tiles (a, b), b <= a, of 8 rows a and 8 lanes b, in the order of a; tiles on the
// diagonal hold the lower triangle with half the diagonal and zeros above, so that L + L^T = B.
typedef struct ep_green_task {
  int count, blocks;
  const double *b;      // (count x blocks (blocks + 1) / 2 x 64)
  const double *linear; // (count x width)
  const double *z;      // (width)
  double *y;            // (count) out
  double *jacobian;     // (count x width) out: dy_i/dz
} ep_green_task;
typedef void (*ep_green_products)(const ep_green_task *task);

// h (r x r, row-major) += sum_i scale_i B_i - low^T low with low (count x width).
typedef void (*ep_green_curvature)(const ep_green_task *task, int r, const double *scale,
                                   const double *low, double *h);

typedef struct ep_green_kernel {
  ep_green_products products;
  ep_green_curvature curvature;
} ep_green_kernel;

ep_green_kernel ep_green_baseline(void);
#if defined(__x86_64__)
ep_green_kernel ep_green_avx2(void);
ep_green_kernel ep_green_avx512(void);
#endif
// The kernels of an instruction set this processor runs.
ep_green_kernel ep_green_of(ep_isa isa);

#endif
