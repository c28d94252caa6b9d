#include "cubature/gram.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/parallel.h"

enum { LANES = 2 }; // what every x86-64 and ARMv8 has in one register
typedef double lanes __attribute__((vector_size(LANES * sizeof(double)), aligned(8)));

ep_status ep_gram_create(int n, int rows, ep_gram *out, ep_error *err) {
  const int stride = (rows + 2 * LANES - 1) / (2 * LANES) * (2 * LANES);
  *out = (ep_gram){.n = n, .rows = rows, .stride = stride};
  const size_t count = (size_t)n + 1, height = (size_t)stride + 1;
  out->a = calloc((size_t)n * (size_t)stride + 1, sizeof *out->a);
  out->norm = calloc(2 * count, sizeof *out->norm);
  out->b = calloc(height, sizeof *out->b);
  out->packed = calloc(height * EP_GRAM_BATCH, sizeof *out->packed);
  out->column = calloc(count, sizeof *out->column);
  if (!out->a || !out->norm || !out->b || !out->packed || !out->column) {
    ep_gram_free(out);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a training system of %d x %d numbers", n,
                   rows);
  }
  out->c = out->norm + count;
  return EP_OK;
}

void ep_gram_free(ep_gram *gram) {
  if (gram->column)
    for (int e = 0; e < gram->n; e++) free(gram->column[e]);
  free(gram->column);
  free(gram->packed);
  free(gram->b);
  free(gram->norm);
  free(gram->a);
  *gram = (ep_gram){0};
}

// Four partial sums in a fixed order: the same bytes whatever the instruction set.
static double dot(int n, const double *restrict a, const double *restrict b) {
  lanes low = {0}, high = {0};
  for (int i = 0; i < n; i += 2 * LANES) {
    low += *(const lanes *)(a + i) * *(const lanes *)(b + i);
    high += *(const lanes *)(a + i + LANES) * *(const lanes *)(b + i + LANES);
  }
  return (low[0] + low[1]) + (high[0] + high[1]);
}

static void prepare_range(void *context, int piece, int from, int to) {
  (void)piece;
  ep_gram *gram = context;
  for (int e = from; e < to; e++) {
    double *a = gram->a + (size_t)e * (size_t)gram->stride;
    const double norm = sqrt(dot(gram->stride, a, a));
    gram->norm[e] = norm;
    const double scale = norm > 0 ? 1 / norm : 0;
    if (isfinite(norm))
      for (int i = 0; i < gram->rows; i++) a[i] *= scale;
    gram->c[e] = dot(gram->stride, a, gram->b);
  }
}

ep_status ep_gram_prepare(ep_gram *gram, ep_error *err) {
  ep_parallel_ranges(gram->n, prepare_range, gram);
  for (int e = 0; e < gram->n; e++)
    if (!isfinite(gram->norm[e]) || !isfinite(gram->c[e]))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "cubature: the training forces of element %d are not finite", e);
  gram->squared = dot(gram->stride, gram->b, gram->b);
  return EP_OK;
}

// out[e][q] = (row e of a) . (column q of packed (n x EP_GRAM_BATCH)) for two rows of a. Each
// product has an accumulator of its own in row order, so neither batch nor lanes change it.
// Per row of packed: 32 flops for 16 bytes of a from memory (packed stays in cache).
static void pair_products(int n, const double *restrict a0, const double *restrict a1,
                          const double *restrict packed, double *restrict out) {
  lanes s0 = {0}, s1 = {0}, s2 = {0}, s3 = {0}, t0 = {0}, t1 = {0}, t2 = {0}, t3 = {0};
  for (int i = 0; i < n; i++) {
    const lanes *p = (const lanes *)(packed + (size_t)i * EP_GRAM_BATCH);
    const lanes x = {a0[i], a0[i]}, y = {a1[i], a1[i]};
    s0 += x * p[0];
    s1 += x * p[1];
    s2 += x * p[2];
    s3 += x * p[3];
    t0 += y * p[0];
    t1 += y * p[1];
    t2 += y * p[2];
    t3 += y * p[3];
  }
  const lanes sums[8] = {s0, s1, s2, s3, t0, t1, t2, t3};
  memcpy(out, sums, sizeof sums);
}

typedef struct batch_work {
  ep_gram *gram;
  int count;
  const int *candidate; // (count) columns to fill
} batch_work;

static void batch_range(void *context, int piece, int from, int to) {
  (void)piece;
  const batch_work *w = context;
  ep_gram *gram = w->gram;
  double product[2 * EP_GRAM_BATCH];
  for (int e = from; e < to; e += 2) {
    const int second = e + 1 < to ? e + 1 : e;
    pair_products(gram->rows, gram->a + (size_t)e * (size_t)gram->stride,
                  gram->a + (size_t)second * (size_t)gram->stride, gram->packed, product);
    for (int q = 0; q < w->count; q++) {
      gram->column[w->candidate[q]][e] = product[q];
      gram->column[w->candidate[q]][second] = product[second > e ? EP_GRAM_BATCH + q : q];
    }
  }
}

static ep_status compute_batch(ep_gram *gram, int count, const int *candidate, ep_error *err) {
  memset(gram->packed, 0, (size_t)gram->stride * EP_GRAM_BATCH * sizeof(double));
  for (int q = 0; q < count; q++) {
    double **column = &gram->column[candidate[q]];
    *column = malloc((size_t)gram->n * sizeof(double));
    if (!*column)
      return ep_fail(err, EP_ERR_MEMORY, "no memory for a column of %d numbers", gram->n);
    const double *a = gram->a + (size_t)candidate[q] * (size_t)gram->stride;
    for (int i = 0; i < gram->rows; i++) gram->packed[(size_t)i * EP_GRAM_BATCH + (size_t)q] = a[i];
  }
  ep_parallel_ranges(gram->n, batch_range, &(batch_work){gram, count, candidate});
  return EP_OK;
}

ep_status ep_gram_need(ep_gram *gram, int count, const int *candidate, ep_error *err) {
  int missing[EP_GRAM_BATCH], pending = 0;
  for (int i = 0; i < count; i++) {
    if (!gram->column[candidate[i]]) missing[pending++] = candidate[i];
    if (pending < EP_GRAM_BATCH && (pending == 0 || i + 1 < count)) continue;
    EP_TRY(compute_batch(gram, pending, missing, err));
    pending = 0;
  }
  return EP_OK;
}
