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

// A lane in registers of the level's width: gcc splits wider vectors through memory, so the loops
// over modes, where nearly all time goes, take them apart themselves.
#if defined(__AVX512F__)
enum { PART = 8 };
#elif defined(__AVX2__)
enum { PART = 4 };
#else
enum { PART = 2 };
#endif
enum { PARTS = 8 / PART };
typedef double part __attribute__((vector_size(8 * PART)));

// Part p of a lane in memory.
LANE_INLINE part part_of(const lane *x, int p) {
  return ((const part *)x)[p];
}

LANE_INLINE part part_all(double x) {
#if defined(__AVX512F__)
  return (part){x, x, x, x, x, x, x, x};
#elif defined(__AVX2__)
  return (part){x, x, x, x};
#else
  return (part){x, x};
#endif
}

LANE_INLINE lane lane_all(double x) {
  return (lane){x, x, x, x, x, x, x, x};
}

LANE_INLINE lane lane_select(lane_mask mask, lane yes, lane no) {
  return (lane)((mask & (lane_mask)yes) | (~mask & (lane_mask)no));
}

LANE_INLINE int lane_any(lane_mask m) {
  return (m[0] | m[1] | m[2] | m[3] | m[4] | m[5] | m[6] | m[7]) != 0;
}

LANE_INLINE double array_sum(const double x[8]) {
  return ((x[0] + x[1]) + (x[2] + x[3])) + ((x[4] + x[5]) + (x[6] + x[7]));
}

LANE_INLINE double lane_sum(lane x) {
  return array_sum((const double *)&x);
}

// Lane i of the result: lane_sum(v[i]), the same order of additions.
LANE_INLINE lane lane_sum8(const lane v[8]) {
#if !defined(__AVX512F__)
  lane sum;
  for (int i = 0; i < 8; i++) ((double *)&sum)[i] = array_sum((const double *)(v + i));
  return sum;
#else
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
#endif
}

#endif
