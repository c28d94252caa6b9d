// The instruction sets this processor runs, for tests that compare them.
#ifndef EP_TESTS_REDUCED_LEVELS_H
#define EP_TESTS_REDUCED_LEVELS_H

#include "reduced/kernel.h"

enum { LEVELS_MOST = 3 };

// Baseline first. Returns how many there are.
static inline int kernels_here(ep_kernel out[LEVELS_MOST]) {
  int count = 0;
  out[count++] = ep_kernel_baseline;
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx2")) out[count++] = ep_kernel_avx2;
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq"))
    out[count++] = ep_kernel_avx512;
#endif
  return count;
}

#endif
