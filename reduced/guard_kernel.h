// Where the guards stand (reduced/guard.h): sums over the modes, compiled per instruction set like
// the cubature kernels, with the same bits in all of them (guard_body.h). Private.
#ifndef EP_REDUCED_GUARD_KERNEL_H
#define EP_REDUCED_GUARD_KERNEL_H

#include "reduced/isa.h"

// Way of one group of at most 8 guards to the limit of any of them: how far each F may go
// (Frobenius norm) from where it is at q. 0 where one is there, or nothing is known (not finite).
//   g (count x blocks x 72) as packed, limit (count), q (8 blocks) padded with zeros;
//   jacobian (8), out: det F of the first `count`.
typedef double (*ep_guard_reach)(int count, int blocks, const double *g, const double *limit,
                                 const double *q, double *jacobian);

// gone (count): sum_a |q_a - at_a| growth_a for rows of at and growth (count x 8 blocks).
typedef void (*ep_guard_gone)(int count, int blocks, const double *growth, const double *at,
                              const double *q, double *gone);

typedef struct ep_guard_kernel {
  ep_guard_reach reach;
  ep_guard_gone gone;
} ep_guard_kernel;

ep_guard_kernel ep_guard_baseline(void);
#if defined(__x86_64__)
ep_guard_kernel ep_guard_avx2(void);
ep_guard_kernel ep_guard_avx512(void);
#endif
// The kernels of an instruction set this processor runs.
ep_guard_kernel ep_guard_of(ep_isa isa);

#endif
