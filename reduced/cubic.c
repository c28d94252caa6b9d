#include "reduced/cubic.h"

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "reduced/cubic_kernel.h"

enum { ALIGNMENT = 64 };

size_t ep_cubic_quartic_count(int r) {
  const size_t n = (size_t)r;
  return n * (n + 1) * (n + 2) * (n + 3) / 24;
}

size_t ep_cubic_count(int r) {
  return ep_cubic_quartic_count(r + 1);
}

size_t ep_cubic_index(int a, int b, int c, int d) {
  const size_t y = (size_t)b, z = (size_t)c;
  return ep_cubic_quartic_count(a) + y * (y + 1) * (y + 2) / 6 + z * (z + 1) / 2 + (size_t)d;
}

// ---- the stream ------------------------------------------------------------------------------

// Writes the stream, or only counts where there is nowhere to write.
typedef struct writer {
  const double *packed;
  double *wide;
  float *narrow;
  int n, lanes;
  size_t count;
  int bad; // a coefficient that is not finite in this precision
} writer;

static const double largest_float = 3.4e38, smallest_float = 1.2e-38;

static void put(writer *w, double x) {
  if (w->wide) w->wide[w->count] = x;
  if (w->narrow) {
    // what a float has no normal form for is nothing beside the others, and slow
    w->narrow[w->count] = fabs(x) < smallest_float ? 0 : (float)(fabs(x) <= largest_float ? x : 0);
    w->bad |= fabs(x) > largest_float;
  }
  w->bad |= !isfinite(x);
  w->count++;
}

// Vectors v .. end of the columns of one block (cubic_body.h), its pairs (i, j) with j >= j0.
static void put_segment(writer *w, int x, int y, int j0, int v, int end) {
  const int rows = ep_least(4, w->n - 4 * x);
  for (; v < end; v++) {
    for (int i = 0; i < rows; i++) {
      for (int j = j0; j < 4; j++) {
        if (x == y && j > i) continue;
        if (!w->packed) {
          w->count += (size_t)w->lanes;
          continue;
        }
        const double *from = w->packed + ep_cubic_index(4 * x + i, 4 * y + j, 0, 0);
        const int prefix = ep_triangle(4 * y + j + 1); // c <= b
        for (int place = v * w->lanes; place < (v + 1) * w->lanes; place++)
          put(w, place < prefix ? from[place] : 0);
      }
    }
  }
}

static void put_blocks(writer *w) {
  const int blocks = (w->n + 3) / 4;
  for (int x = 0; x < blocks; x++)
    for (int step = 0; step <= x; step++) { // the diagonal block first
      const int y = step ? step - 1 : x, full = ep_cubic_full(y, w->lanes);
      put_segment(w, x, y, 0, 0, full);
      put_segment(w, x, y, 2, full, ep_cubic_vectors(y, w->lanes));
    }
}

// d2W/dz_a dz_b as a quadratic form: the coefficient of z_c z_d (c >= d).
static double second_derivative(const double *packed, int a, int b, int c, int d) {
  int index[4] = {a, b, c, d};
  for (int i = 1; i < 4; i++) // insertion sort, falling
    for (int j = i; j > 0 && index[j] > index[j - 1]; j--) {
      const int swap = index[j];
      index[j] = index[j - 1], index[j - 1] = swap;
    }
  // d2/dz_a dz_b of z_0 z_1 z_2 z_3: the ways to take a and b out and leave {c, d}
  int ways = 0;
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) {
      if (i == j || index[i] != a || index[j] != b) continue;
      ways++;
    }
  return ways * packed[ep_cubic_index(index[0], index[1], index[2], index[3])];
}

static void pair_of(int place, int *c, int *d) {
  *c = 0;
  while (ep_triangle(*c + 1) <= place) ++*c;
  *d = place - ep_triangle(*c);
}

static void put_square(writer *w) {
  const int pairs = ep_triangle(w->n);
  if (!w->packed) {
    w->count = (size_t)ep_round_up(pairs, 4) * (size_t)ep_round_up(pairs, w->lanes);
    return;
  }
  for (int row = 0; row < pairs; row += 4)
    for (int v = 0; v < pairs; v += w->lanes)
      for (int i = 0; i < 4; i++)
        for (int l = 0; l < w->lanes; l++) {
          int a, b, c, d;
          if (row + i >= pairs || v + l >= pairs) {
            put(w, 0);
            continue;
          }
          pair_of(row + i, &a, &b);
          pair_of(v + l, &c, &d);
          put(w, second_derivative(w->packed, a, b, c, d));
        }
}

static void put_all(writer *w) {
  if (w->n < EP_CUBIC_BLOCKS_FROM)
    put_square(w);
  else
    put_blocks(w);
}

size_t ep_cubic_stream_size(int r, ep_precision precision) {
  writer w = {.n = r + 1, .lanes = ep_cubic_lanes(precision)};
  put_all(&w);
  return w.count;
}

static ep_status pack(int r, const double *packed, double *wide, float *narrow) {
  if (r < 1 || r > EP_CUBIC_MAX_MODES) return EP_ERR_ARGUMENT;
  writer w = {.packed = packed,
              .wide = wide,
              .narrow = narrow,
              .n = r + 1,
              .lanes = ep_cubic_lanes(wide ? EP_DOUBLE : EP_FLOAT)};
  put_all(&w);
  return w.bad ? EP_ERR_NUMERIC : EP_OK;
}

ep_status ep_cubic_pack(int r, const double *packed, double *stream) {
  return pack(r, packed, stream, NULL);
}

ep_status ep_cubic_pack_float(int r, const double *packed, float *stream) {
  return pack(r, packed, NULL, stream);
}

// ---- evaluation ------------------------------------------------------------------------------

ep_cubic_kernel ep_cubic_kernel_of(ep_isa isa, ep_precision precision) {
  const int wide = precision == EP_DOUBLE;
#if defined(__x86_64__)
  if (isa == EP_ISA_AVX512) return wide ? ep_cubic_f64_avx512 : ep_cubic_f32_avx512;
  if (isa == EP_ISA_AVX2) return wide ? ep_cubic_f64_avx2 : ep_cubic_f32_avx2;
#endif
  (void)isa;
  return wide ? ep_cubic_f64_baseline : ep_cubic_f32_baseline;
}

ep_status ep_cubic_open(int r, ep_precision precision, const void *stream, ep_cubic *out) {
  memset(out, 0, sizeof *out);
  if (r < 1 || r > EP_CUBIC_MAX_MODES || (precision != EP_DOUBLE && precision != EP_FLOAT) ||
      !stream || (uintptr_t)stream % ALIGNMENT)
    return EP_ERR_ARGUMENT;
  const ep_isa isa = ep_isa_here();
  *out = (ep_cubic){.r = r,
                    .precision = precision,
                    .stream = stream,
                    .isa = ep_isa_name(isa),
                    .kernel = ep_cubic_kernel_of(isa, precision)};
  return EP_OK;
}

// The arrays of lay_out in cubic_body.h, and f and k (doubles) in front.
static size_t reals(int r, int lanes) {
  const int blocks = (r + 4) / 4;
  const size_t stride = (size_t)ep_cubic_stride(r, lanes);
  size_t count = stride + (size_t)lanes + 2 * (size_t)ep_cubic_pairs(r, lanes) + stride * stride;
  for (int x = 0; x < blocks; x++) count += 4 * (size_t)ep_cubic_row(x, lanes);
  return count;
}

static size_t outputs(int r) {
  const size_t bytes = (size_t)r * (size_t)(r + 1) * sizeof(double);
  return (bytes + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
}

size_t ep_cubic_scratch(int r, ep_precision precision) {
  const size_t size = precision == EP_DOUBLE ? sizeof(double) : sizeof(float);
  return outputs(r) + reals(r, ep_cubic_lanes(precision)) * size;
}

size_t ep_cubic_batch_scratch(int r, ep_precision precision) {
  const size_t stride = (size_t)ep_round_up(r + 1, 4); // batch_lay_out in cubic_batch_body.h
  const size_t vectors = stride + (size_t)ep_triangle((int)stride) +
                         stride * (stride + EP_CUBIC_TILE * (size_t)ep_cubic_lanes(precision));
  return vectors * ALIGNMENT;
}

double ep_cubic_evaluate(const ep_cubic *cubic, const double *q, double *f, double *k,
                         void *scratch) {
  double *own = scratch, energy;
  const ep_cubic_task task = {.r = cubic->r,
                              .stream = cubic->stream,
                              .q = q,
                              .energy = &energy,
                              .f = f ? f : own,
                              .k = k ? k : own + cubic->r,
                              .scratch = (char *)scratch + outputs(cubic->r)};
  cubic->kernel(&task);
  return energy;
}

void ep_cubic_batch(const ep_cubic *cubic, int states, const double *q, double *energy, double *f,
                    double *k, void *scratch) {
  const int lanes = ep_cubic_lanes(cubic->precision);
  const size_t r = (size_t)cubic->r;
  for (int first = 0; first < states; first += lanes) {
    const size_t at = (size_t)first;
    const ep_cubic_task task = {.r = cubic->r,
                                .stream = cubic->stream,
                                .states = ep_least(lanes, states - first),
                                .q = q + at * r,
                                .energy = energy ? energy + at : NULL,
                                .f = f ? f + at * r : NULL,
                                .k = k ? k + at * r * r : NULL,
                                .scratch = scratch};
    cubic->kernel(&task);
  }
}
