// Eight doubles at a time through the compilers' vector extensions. Private to the kernels.
#ifndef EP_REDUCED_LANES_H
#define EP_REDUCED_LANES_H

#include <math.h>
#include <stdint.h>

// Both compilers let a vector alias its element type. Lanes never cross a call
// that is not inlined, so the kernels are compiled with -Wno-psabi.
typedef double lane __attribute__((vector_size(64)));
typedef int64_t lane_mask __attribute__((vector_size(64)));
#define LANE_INLINE static inline __attribute__((always_inline))

LANE_INLINE lane lane_all(double x) {
  return (lane){x, x, x, x, x, x, x, x};
}

LANE_INLINE lane lane_select(lane_mask mask, lane yes, lane no) {
  return (lane)((mask & (lane_mask)yes) | (~mask & (lane_mask)no));
}

LANE_INLINE int lane_any(lane_mask m) {
  return (m[0] | m[1] | m[2] | m[3] | m[4] | m[5] | m[6] | m[7]) != 0;
}

LANE_INLINE double lane_sum(lane x) {
  return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
}

// Lane i of the result: lane_sum(v[i]), the same order of additions.
LANE_INLINE lane lane_sum8(const lane v[8]) {
  lane t[4], u[2];
  for (int i = 0; i < 4; i++) {
    lane a = v[2 * i], b = v[2 * i + 1];
    t[i] = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14) +
           __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 2; i++) {
    lane a = t[2 * i], b = t[2 * i + 1];
    u[i] = __builtin_shufflevector(a, b, 0, 1, 8, 9, 4, 5, 12, 13) +
           __builtin_shufflevector(a, b, 2, 3, 10, 11, 6, 7, 14, 15);
  }
  return __builtin_shufflevector(u[0], u[1], 0, 1, 2, 3, 8, 9, 10, 11) +
         __builtin_shufflevector(u[0], u[1], 4, 5, 6, 7, 12, 13, 14, 15);
}

#endif
