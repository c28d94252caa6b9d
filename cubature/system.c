#include "cubature/system.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/cubature.h"
#include "cubature/parallel.h"

// Signs per row of the sketch.
enum { SKETCH_DEPTH = 4 };

static double dot(size_t n, const double *a, const double *b) {
  double sum[4] = {0};
  size_t i = 0;
  for (; i + 4 <= n; i += 4)
    for (size_t k = 0; k < 4; k++) sum[k] += a[i + k] * b[i + k];
  for (; i < n; i++) sum[0] += a[i] * b[i];
  return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

typedef struct force_work {
  ep_training *training;
  double *scratch; // (poses x r)
} force_work;

// Each pose sums over the elements in mesh order, so threads do not matter.
static void force_range(void *context, int piece, int from, int to) {
  (void)piece;
  const force_work *w = context;
  const ep_elements *elements = w->training->elements;
  const size_t r = (size_t)elements->r;
  for (int p = from; p < to; p++) {
    const ep_pose pose = ep_pose_at(w->training->poses, p);
    double *sum = w->training->force + (size_t)p * r, *one = w->scratch + (size_t)p * r;
    double squared = 0;
    for (int e = 0; e < elements->nt; e++) {
      ep_element_force(elements, e, &pose, one);
      for (size_t a = 0; a < r; a++) sum[a] += elements->fem->volume[e] * one[a];
    }
    for (size_t a = 0; a < r; a++) squared += sum[a] * sum[a];
    w->training->scale[p] = 1 / sqrt(squared);
  }
}

ep_status ep_training_make(const ep_elements *elements, const ep_pose_set *poses, ep_training *out,
                           ep_error *err) {
  const size_t count = (size_t)poses->count, r = (size_t)elements->r;
  *out = (ep_training){.elements = elements, .poses = poses};
  out->force = calloc(count * r + 1, sizeof *out->force);
  out->scale = calloc(count + 1, sizeof *out->scale);
  double *scratch = calloc(count * r + 1, sizeof *scratch);
  if (!out->force || !out->scale || !scratch) {
    free(scratch);
    ep_training_free(out);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the forces of %d poses", poses->count);
  }
  ep_parallel_ranges(poses->count, force_range, &(force_work){out, scratch});
  free(scratch);
  for (int p = 0; p < poses->count; p++)
    if (!isfinite(out->scale[p]) || !(out->scale[p] > 0)) {
      ep_training_free(out);
      return ep_fail(err, EP_ERR_NUMERIC, "cubature: training pose %d has no finite elastic force",
                     p);
    }
  return EP_OK;
}

void ep_training_free(ep_training *training) {
  free(training->force);
  free(training->scale);
  *training = (ep_training){0};
}

// One element over all poses: column (poses x r), scaled rows, for weight = its own volume.
static void element_column(const ep_training *training, int e, double *column) {
  const ep_elements *elements = training->elements;
  const size_t r = (size_t)elements->r;
  for (int p = 0; p < training->poses->count; p++) {
    const ep_pose pose = ep_pose_at(training->poses, p);
    const double scale = training->scale[p] * elements->fem->volume[e];
    double *out = column + (size_t)p * r;
    ep_element_force(elements, e, &pose, out);
    for (size_t a = 0; a < r; a++) out[a] *= scale;
  }
}

typedef struct sketch {
  int rows, depth;
  int *bin;     // (full rows x depth)
  double *sign; // (full rows x depth) +- 1 / sqrt(depth)
} sketch;

static ep_status sketch_create(int full, int rows, ep_random *random, sketch *out, ep_error *err) {
  const size_t count = (size_t)full * SKETCH_DEPTH;
  *out = (sketch){.rows = rows, .depth = SKETCH_DEPTH};
  out->bin = malloc(count * sizeof *out->bin);
  out->sign = malloc(count * sizeof *out->sign);
  if (!out->bin || !out->sign)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a sketch of %d rows", full);
  const double size = 1 / sqrt((double)SKETCH_DEPTH);
  for (size_t i = 0; i < count; i++) {
    out->bin[i] = ep_random_below(random, rows);
    out->sign[i] = ep_random_u32(random) >> 31 ? size : -size;
  }
  return EP_OK;
}

static void sketch_apply(const sketch *s, int full, const double *from, double *to) {
  for (int i = 0; i < full; i++)
    for (int k = 0; k < s->depth; k++) {
      const size_t at = (size_t)i * (size_t)s->depth + (size_t)k;
      to[s->bin[at]] += s->sign[at] * from[i];
    }
}

typedef struct column_work {
  const ep_training *training;
  const sketch *sketch; // NULL: all rows
  ep_gram *gram;
  double *scratch; // (EP_PIECES x full rows), for the sketch
} column_work;

static void column_range(void *context, int piece, int from, int to) {
  const column_work *w = context;
  const int full = w->training->poses->count * w->training->elements->r;
  double *scratch = w->sketch ? w->scratch + (size_t)piece * (size_t)full : NULL;
  for (int e = from; e < to; e++) {
    double *column = w->gram->a + (size_t)e * (size_t)w->gram->stride;
    element_column(w->training, e, w->sketch ? scratch : column);
    if (w->sketch) sketch_apply(w->sketch, full, scratch, column);
  }
}

static void scaled_target(const ep_training *training, double *b) {
  const size_t r = (size_t)training->elements->r;
  for (size_t p = 0; p < (size_t)training->poses->count; p++)
    for (size_t a = 0; a < r; a++) b[p * r + a] = training->scale[p] * training->force[p * r + a];
}

ep_status ep_training_system(const ep_training *training, ep_random *random, ep_gram *gram,
                             ep_error *err) {
  const int full = training->poses->count * training->elements->r;
  if (gram->rows >= full) {
    scaled_target(training, gram->b);
    ep_parallel_ranges(gram->n, column_range, &(column_work){training, NULL, gram, NULL});
    return EP_OK;
  }
  sketch s = {0};
  ep_status status = EP_OK;
  double *scratch = malloc((size_t)full * EP_PIECES * sizeof *scratch);
  if (!scratch)
    EP_TRY_GOTO(status, ep_fail(err, EP_ERR_MEMORY, "no memory for a sketch of %d rows", full),
                done);
  EP_TRY_GOTO(status, sketch_create(full, gram->rows, random, &s, err), done);
  scaled_target(training, scratch);
  sketch_apply(&s, full, scratch, gram->b);
  ep_parallel_ranges(gram->n, column_range, &(column_work){training, &s, gram, scratch});
done:
  free(scratch);
  free(s.bin);
  free(s.sign);
  return status;
}

ep_status ep_training_refit(const ep_training *training, int count, const int *tet, double *weight,
                            ep_error *err) {
  const size_t rows = (size_t)training->poses->count * (size_t)training->elements->r;
  const size_t n = (size_t)count;
  ep_status status = EP_OK;
  double *a = malloc(((n + 1) * rows + n * n + n + 1) * sizeof *a);
  if (!a) return ep_fail(err, EP_ERR_MEMORY, "no memory to fit %d weights", count);
  double *b = a + n * rows, *g = b + rows, *c = g + n * n;
  scaled_target(training, b);
  for (size_t j = 0; j < n; j++) element_column(training, tet[j], a + j * rows);
  for (size_t j = 0; j < n; j++) {
    c[j] = dot(rows, a + j * rows, b);
    for (size_t k = 0; k <= j; k++)
      g[j * n + k] = g[k * n + j] = dot(rows, a + j * rows, a + k * rows);
  }
  EP_TRY_GOTO(status, ep_nnls_gram(count, g, c, weight, err), done);
  for (size_t j = 0; j < n; j++) weight[j] *= training->elements->fem->volume[tet[j]];
done:
  free(a);
  return status;
}

typedef struct error_work {
  const ep_training *training;
  int count;
  const int *tet;
  const double *weight;
  double *scratch; // (poses x 2 r)
  double *squared; // (poses) relative squared error
} error_work;

static void error_range(void *context, int piece, int from, int to) {
  (void)piece;
  const error_work *w = context;
  const ep_elements *elements = w->training->elements;
  const size_t r = (size_t)elements->r;
  for (int p = from; p < to; p++) {
    const ep_pose pose = ep_pose_at(w->training->poses, p);
    double *left = w->scratch + 2 * (size_t)p * r, *one = left + r, squared = 0;
    memcpy(left, w->training->force + (size_t)p * r, r * sizeof *left);
    for (int j = 0; j < w->count; j++) {
      ep_element_force(elements, w->tet[j], &pose, one);
      for (size_t a = 0; a < r; a++) left[a] -= w->weight[j] * one[a];
    }
    for (size_t a = 0; a < r; a++) squared += left[a] * left[a];
    w->squared[p] = squared * w->training->scale[p] * w->training->scale[p];
  }
}

ep_status ep_training_error(const ep_training *training, int count, const int *tet,
                            const double *weight, double *error, ep_error *err) {
  return ep_training_region_error(training, EP_ALL_POSES, count, tet, weight, error, err);
}

ep_status ep_training_region_error(const ep_training *training, int region, int count,
                                   const int *tet, const double *weight, double *error,
                                   ep_error *err) {
  const size_t poses = (size_t)training->poses->count, r = (size_t)training->elements->r;
  double *memory = malloc((poses * (2 * r + 1) + 1) * sizeof *memory);
  if (!memory) return ep_fail(err, EP_ERR_MEMORY, "no memory for the errors of %zu poses", poses);
  error_work w = {training, count, tet, weight, memory, memory + poses * 2 * r};
  ep_parallel_ranges((int)poses, error_range, &w);
  double sum = 0;
  size_t met = 0;
  for (size_t p = 0; p < poses; p++) {
    if (region != EP_ALL_POSES && training->poses->region[p] != region) continue;
    sum += w.squared[p];
    met++;
  }
  *error = met ? sqrt(sum / (double)met) : 0;
  free(memory);
  return EP_OK;
}
