// What the cubic kernels and their dispatch share: sizes of the stream and of scratch memory, in
// reals, for a lane count (8 doubles or 16 floats). Private.
#ifndef EP_REDUCED_CUBIC_KERNEL_H
#define EP_REDUCED_CUBIC_KERNEL_H

#include "reduced/cubic.h"
#include "reduced/isa.h"

enum {
  // From this many entries of z on, blocks of the quartic form; below, the plain square matrix over
  // pairs: four times the coefficients, but no padding and no second pass.
  EP_CUBIC_BLOCKS_FROM = 17,
  // Batches: vectors of columns whose T is kept at a time.
  EP_CUBIC_TILE = 4
};

struct ep_cubic_task {
  int r;
  const void *stream;
  int states;      // 0: one state, all outputs given; else a group of at most as many as lanes
  const double *q; // (r), or (states x r)
  double *energy, *f, *k; // as in ep_cubic_evaluate and ep_cubic_batch
  void *scratch;
};

typedef void (*ep_cubic_kernel)(const ep_cubic_task *task);

void ep_cubic_f64_baseline(const ep_cubic_task *task);
void ep_cubic_f32_baseline(const ep_cubic_task *task);
#if defined(__x86_64__)
void ep_cubic_f64_avx2(const ep_cubic_task *task);
void ep_cubic_f32_avx2(const ep_cubic_task *task);
void ep_cubic_f64_avx512(const ep_cubic_task *task);
void ep_cubic_f32_avx512(const ep_cubic_task *task);
#endif

// The kernel of an instruction set this processor runs.
ep_cubic_kernel ep_cubic_kernel_of(ep_isa isa, ep_precision precision);

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

// Columns of the row blocks (x, y): in the vectors before `full` all pairs (a, b) may have
// coefficients; from there to the last one only the pairs of the two larger b (c <= b).
static inline int ep_cubic_full(int y, int lanes) {
  return (ep_triangle(4 * y + 2) + lanes - 1) / lanes;
}
static inline int ep_cubic_vectors(int y, int lanes) {
  return (ep_triangle(4 * y + 4) + lanes - 1) / lanes;
}

// Row of T, for a block of 4 entries x: the pairs c >= d up to the block's last entry, and room for
// a vector reaching over its end.
static inline int ep_cubic_row(int x, int lanes) {
  return (ep_cubic_vectors(x, lanes) + 1) * lanes;
}

// Row of the matrix over entries; pairs of entries, with room as above.
static inline int ep_cubic_stride(int r, int lanes) {
  return ep_round_up(r + 1, lanes);
}
static inline int ep_cubic_pairs(int r, int lanes) {
  return ep_cubic_row((r + 4) / 4 - 1, lanes);
}

#endif
