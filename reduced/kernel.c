#include "reduced/kernel.h"

#include <stddef.h>

ep_kernel ep_kernel_select(const char **name) {
  const char *unused;
  if (!name) name = &unused;
#if defined(__x86_64__)
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq")) {
    *name = "avx512";
    return ep_kernel_avx512;
  }
  if (__builtin_cpu_supports("avx2")) {
    *name = "avx2";
    return ep_kernel_avx2;
  }
#endif
  *name = "baseline";
  return ep_kernel_baseline;
}

// Tangents of 8 elements (81 lanes), their products with G (8 x blocks x 9 lanes); for floats also
// the stiffness, all in rows of 16.
int ep_kernel_scratch(int blocks, int floats) {
  const int row = (blocks + 1) / 2 * 16;
  if (floats) return 81 * EP_LANES + (row + 9 * EP_LANES) * row / 2;
  return (81 + EP_LANES * 9 * blocks) * EP_LANES;
}
