// What the cubic kernels and their dispatch share: sizes of the stream and of scratch memory, in
// reals, for a lane count (8 doubles or 16 floats). Private.
#ifndef EP_REDUCED_CUBIC_KERNEL_H
#define EP_REDUCED_CUBIC_KERNEL_H

#include "reduced/cubic.h"

enum {
  // From this many entries of z on, blocks of the quartic form; below, the plain square matrix over
  // pairs: four times the coefficients, but no padding and no second pass.
  EP_CUBIC_BLOCKS_FROM = 17
};

struct ep_cubic_task {
  int r;
  const void *stream;
  int states;      // 0: one state, all outputs given; else a group of at most as many as lanes
  const double *q; // (r), or (states x r)
  double *energy, *f, *k; // as in ep_cubic_evaluate and ep_cubic_batch
  void *scratch;
};

void ep_cubic_f64_baseline(const ep_cubic_task *task);
void ep_cubic_f32_baseline(const ep_cubic_task *task);
#if defined(__x86_64__)
void ep_cubic_f64_avx2(const ep_cubic_task *task);
void ep_cubic_f32_avx2(const ep_cubic_task *task);
void ep_cubic_f64_avx512(const ep_cubic_task *task);
void ep_cubic_f32_avx512(const ep_cubic_task *task);
#endif

static inline int ep_cubic_lanes(ep_precision precision) {
  return precision == EP_DOUBLE ? 8 : 16;
}

static inline int ep_triangle(int n) {
  return n * (n + 1) / 2;
}

static inline int ep_round_up(int n, int step) {
  return (n + step - 1) / step * step;
}

static inline int ep_least(int a, int b) {
  return a < b ? a : b;
}

// Rows of T, one block of 4 entries x: the triangle of pairs c >= d of entries up to the block's
// last, and room for a vector reaching over its end.
static inline int ep_cubic_row(int block, int lanes) {
  return ep_round_up(ep_triangle(4 * block + 4), lanes) + lanes;
}

#endif
