#include "cubature/gram.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/parallel.h"

enum { LANES = 4 };
typedef double lanes __attribute__((vector_size(LANES * sizeof(double)), aligned(8)));

ep_status ep_gram_create(int n, int rows, ep_gram *out, ep_error *err) {
  const int stride = (rows + LANES - 1) / LANES * LANES;
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
  lanes sum = {0};
  for (int i = 0; i < n; i += LANES) sum += *(const lanes *)(a + i) * *(const lanes *)(b + i);
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

typedef struct prepare_work {
  ep_gram *gram;
  const unsigned char *barred;
} prepare_work;

static void prepare_range(void *context, int piece, int from, int to) {
  (void)piece;
  const prepare_work *w = context;
  ep_gram *gram = w->gram;
  for (int e = from; e < to; e++) {
    double *a = gram->a + (size_t)e * (size_t)gram->stride;
    const double norm = sqrt(dot(gram->stride, a, a));
    gram->norm[e] = w->barred && w->barred[e] ? 0 : norm;
    const double scale = gram->norm[e] > 0 ? 1 / norm : 0;
    if (isfinite(norm))
      for (int i = 0; i < gram->rows; i++) a[i] *= scale;
    gram->c[e] = dot(gram->stride, a, gram->b);
  }
}

ep_status ep_gram_prepare(ep_gram *gram, const unsigned char *barred, ep_error *err) {
  ep_parallel_ranges(gram->n, prepare_range, &(prepare_work){gram, barred});
  for (int e = 0; e < gram->n; e++)
    if (!isfinite(gram->norm[e]) || !isfinite(gram->c[e]))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "cubature: the training forces of element %d are not finite", e);
  gram->squared = dot(gram->stride, gram->b, gram->b);
  return EP_OK;
}

// out[q] = a . (column q of packed (n x EP_GRAM_BATCH)). Each product has an accumulator of its own
// in row order, so neither batch nor lanes change it.
static void batch_products(int n, const double *restrict a, const double *restrict packed,
                           double *restrict out) {
  lanes low = {0}, high = {0};
  for (int i = 0; i < n; i++) {
    const lanes *p = (const lanes *)(packed + (size_t)i * EP_GRAM_BATCH);
    low += a[i] * p[0];
    high += a[i] * p[1];
  }
  memcpy(out, &low, sizeof low);
  memcpy(out + LANES, &high, sizeof high);
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
  double product[EP_GRAM_BATCH];
  for (int e = from; e < to; e++) {
    batch_products(gram->rows, gram->a + (size_t)e * (size_t)gram->stride, gram->packed, product);
    for (int q = 0; q < w->count; q++) gram->column[w->candidate[q]][e] = product[q];
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
