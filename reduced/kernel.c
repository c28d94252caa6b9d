#include "reduced/kernel.h"

ep_kernel ep_kernel_of(ep_isa isa) {
#if defined(__x86_64__)
  if (isa == EP_ISA_AVX512) return ep_kernel_avx512;
  if (isa == EP_ISA_AVX2) return ep_kernel_avx2;
#endif
  (void)isa;
  return ep_kernel_baseline;
}

// Tangents of 8 elements (81 lanes), their products with G (8 x blocks x 9 lanes); for floats also
// the stiffness, all in rows of 16.
int ep_kernel_scratch(int blocks, int floats) {
  const int row = (blocks + 1) / 2 * 16;
  if (floats) return 81 * EP_LANES + (row + 9 * EP_LANES) * row / 2;
  return (81 + EP_LANES * 9 * blocks) * EP_LANES;
}
