#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/cubature.h"
#include "cubature/select.h"
#include "cubature/system.h"
#include "reduced/reference.h"

// The matrix of element forces may take this much memory; above, its rows are sketched, but to no
// fewer than ROWS_PER_ELEMENT for each element wanted. On 30,481 tets, s = 60:
// 1,049 of 6,000 rows gave a held-out error of .0076 in 9 s, 2,099 rows .0084 in 22 s.
static const double matrix_bytes = 256e6;
enum { ROWS_PER_ELEMENT = 5, SHORTLIST = 64, POOL = 100, EXCHANGES = 12 };
enum { STREAM_TRAIN = 101, STREAM_HELD_OUT, STREAM_SKETCH, STREAM_POOL };

ep_cubature_options ep_default_cubature_options(void) {
  return (ep_cubature_options){.elements = 60, .poses = 200, .amplitude = 0.2, .seed = 1};
}

void ep_cubature_free(ep_cubature *cubature) {
  free(cubature->tet);
  free(cubature->weight);
  free(cubature->curve);
  free(cubature->region);
  *cubature = (ep_cubature){0};
}

static ep_status check(const ep_fem *fem, const ep_basis *basis, const ep_cubature_options *o,
                       ep_error *err) {
  if (o->elements < 1 || o->poses < 1)
    return ep_fail(err, EP_ERR_ARGUMENT, "cubature: %d elements from %d poses; both must be >= 1",
                   o->elements, o->poses);
  if (!(o->amplitude > 0) || !(o->tolerance >= 0) || !isfinite(o->amplitude))
    return ep_fail(err, EP_ERR_ARGUMENT, "cubature: amplitude %g must be > 0, tolerance %g >= 0",
                   o->amplitude, o->tolerance);
  if (o->method != 0 && o->method != 1)
    return ep_fail(err, EP_ERR_ARGUMENT, "cubature: there is no method %d", o->method);
  if (basis->n != fem->mesh->nv || basis->r < 1)
    return ep_fail(err, EP_ERR_ARGUMENT, "cubature: basis of %d modes for %d vertices, mesh has %d",
                   basis->r, basis->n, fem->mesh->nv);
  for (int i = 0; i < o->curve_count; i++)
    if (o->curve_size[i] < 1 || (i > 0 && o->curve_size[i] <= o->curve_size[i - 1]))
      return ep_fail(err, EP_ERR_ARGUMENT, "cubature: curve sizes must be ascending and >= 1");
  return EP_OK;
}

// What a training needs, released as one.
typedef struct trainer {
  const ep_cubature_options *options;
  ep_log *log;
  ep_elements elements;
  double *paths;
  ep_pose_set poses, held_poses;
  ep_training training, held;
  ep_gram gram;
  ep_growth growth;
  ep_random pool_random;
  ep_passive base, chosen; // greedy so far, and its refined copy
  int *tet;                // (largest set) elements in mesh order
  double *weight;
} trainer;

static void release(trainer *t) {
  free(t->tet);
  free(t->weight);
  ep_passive_free(&t->base);
  ep_passive_free(&t->chosen);
  ep_gram_free(&t->gram);
  ep_training_free(&t->training);
  ep_training_free(&t->held);
  ep_poses_free(&t->poses);
  ep_poses_free(&t->held_poses);
  free(t->paths);
  ep_elements_free(&t->elements);
}

static ep_status make_poses(trainer *t, const ep_basis *basis, ep_error *err) {
  const ep_cubature_options *o = t->options;
  const size_t stations = (size_t)basis->examples * EP_PATH_STATIONS;
  t->paths = malloc((stations * (size_t)basis->r + 1) * sizeof *t->paths);
  if (!t->paths) return ep_fail(err, EP_ERR_MEMORY, "no memory for the example paths");
  EP_TRY(ep_example_paths(&t->elements, basis, t->paths, err));
  EP_TRY(ep_poses_make(&t->elements, basis, t->paths, o, o->poses, STREAM_TRAIN, &t->poses, err));
  const int held = (o->poses + 1) / 2;
  EP_TRY(
      ep_poses_make(&t->elements, basis, t->paths, o, held, STREAM_HELD_OUT, &t->held_poses, err));
  EP_TRY(ep_training_make(&t->elements, &t->poses, &t->training, err));
  return ep_training_make(&t->elements, &t->held_poses, &t->held, err);
}

// Say how many elements an example has flattened or turned over: poses relative to that example
// get no force from them.
static void tell_flat_elements(const trainer *t, const ep_basis *basis) {
  for (int i = 0; i < basis->examples; i++) {
    int count = 0, first = -1;
    for (int e = 0; e < t->elements.nt; e++) {
      double f[9], inverse[9];
      ep_element_gradient(&t->elements, e, basis->example_q + (size_t)i * (size_t)basis->r, f);
      if (ep_reference_element(f, inverse) > 0) continue;
      if (count++ == 0) first = e;
    }
    if (count > 0)
      ep_warn(t->log,
              "cubature: example %d flattens or turns over %d of %d elements (first: tet %d); they "
              "count for nothing in its energy",
              i + 1, count, t->elements.nt, first);
  }
}

static int largest_set(const ep_cubature_options *o) {
  const int last = o->curve_count > 0 ? o->curve_size[o->curve_count - 1] : 0;
  return last > o->elements ? last : o->elements;
}

static int system_rows(const trainer *t) {
  const double full = (double)t->poses.count * t->elements.r;
  const double affordable = matrix_bytes / (8.0 * t->elements.nt);
  const double needed = (double)ROWS_PER_ELEMENT * largest_set(t->options);
  return (int)fmin(full, fmax(affordable, needed));
}

static ep_status make_system(trainer *t, const ep_basis *basis, ep_error *err) {
  const int rows = system_rows(t);
  ep_random random = ep_random_seed(t->options->seed, STREAM_SKETCH);
  EP_TRY(ep_gram_create(t->elements.nt, rows, &t->gram, err));
  EP_TRY(ep_training_system(&t->training, &random, &t->gram, err));
  tell_flat_elements(t, basis);
  EP_TRY(ep_gram_prepare(&t->gram, err));
  if (rows < t->poses.count * t->elements.r)
    ep_notice(t->log, "cubature: %d equations sketched to %d", t->poses.count * t->elements.r,
              rows);
  return EP_OK;
}

static ep_status make_sets(trainer *t, ep_error *err) {
  const ep_cubature_options *o = t->options;
  const int largest = largest_set(o);
  const size_t capacity = (size_t)(largest + largest / 2 + 1);
  t->pool_random = ep_random_seed(o->seed, STREAM_POOL);
  t->growth = (ep_growth){.pool = o->method == 1 ? POOL : 0,
                          .shortlist = o->method == 1 ? 1 : SHORTLIST,
                          .residual = o->tolerance * o->tolerance,
                          .random = &t->pool_random};
  t->tet = malloc(capacity * sizeof *t->tet);
  t->weight = malloc(capacity * sizeof *t->weight);
  if (!t->tet || !t->weight)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d elements", largest);
  EP_TRY(ep_passive_create((int)capacity, &t->base, err));
  return ep_passive_create((int)capacity, &t->chosen, err);
}

static int by_number(const void *a, const void *b) {
  const int x = *(const int *)a, y = *(const int *)b;
  return (x > y) - (x < y);
}

// The set of at most `size` elements: greedy continues from the smaller size before, exchanges work
// on a copy, so that the result at a size does not depend on the other sizes asked for.
// Fills t->tet, t->weight; *count elements.
static ep_status choose(trainer *t, int size, int *count, ep_error *err) {
  EP_TRY(ep_select_grow(&t->gram, &t->growth, size, &t->base, err));
  ep_passive_copy(&t->chosen, &t->base);
  if (t->options->method == 0) {
    ep_growth free_growth = t->growth;
    free_growth.residual = 0;
    EP_TRY(ep_select_exchange(&t->gram, &free_growth, EXCHANGES, &t->chosen, err));
  }
  const int chosen = t->chosen.count;
  memcpy(t->tet, t->chosen.index, (size_t)chosen * sizeof *t->tet);
  qsort(t->tet, (size_t)chosen, sizeof *t->tet, by_number);
  EP_TRY(ep_training_refit(&t->training, chosen, t->tet, t->weight, err));
  *count = 0;
  for (int j = 0; j < chosen; j++) {
    if (!(t->weight[j] > 0)) continue;
    t->tet[*count] = t->tet[j];
    t->weight[(*count)++] = t->weight[j];
  }
  if (*count == 0)
    return ep_fail(err, EP_ERR_NUMERIC, "cubature: no element lowers the training error");
  return EP_OK;
}

// How well each region alone is integrated.
static ep_status judge_regions(const trainer *t, int count, ep_cubature *out, ep_error *err) {
  const ep_cubature_options *o = t->options;
  if (!o->regions) return EP_OK;
  out->regions = o->regions;
  out->region = calloc((size_t)o->regions * EP_REGION_NUMBERS, sizeof *out->region);
  if (!out->region) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", o->regions);
  for (int g = 0; g < o->regions; g++) {
    double *about = out->region + (size_t)g * EP_REGION_NUMBERS;
    const double *share = o->share + (size_t)g * (size_t)t->elements.nt;
    for (int j = 0; j < count; j++) about[EP_REGION_ELEMENTS] += share[t->tet[j]] > 0.5;
    EP_TRY(ep_training_region_error(&t->training, g, count, t->tet, t->weight,
                                    &about[EP_REGION_TRAIN], err));
    EP_TRY(ep_training_region_error(&t->held, g, count, t->tet, t->weight,
                                    &about[EP_REGION_HELD_OUT], err));
  }
  return EP_OK;
}

static ep_status keep(const trainer *t, int count, ep_cubature *out, ep_error *err) {
  out->tet = malloc((size_t)count * sizeof *out->tet);
  out->weight = malloc((size_t)count * sizeof *out->weight);
  if (!out->tet || !out->weight)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d elements", count);
  out->count = count;
  memcpy(out->tet, t->tet, (size_t)count * sizeof *out->tet);
  memcpy(out->weight, t->weight, (size_t)count * sizeof *out->weight);
  EP_TRY(judge_regions(t, count, out, err));
  EP_TRY(ep_training_error(&t->training, count, t->tet, t->weight, &out->train_error, err));
  return ep_training_error(&t->held, count, t->tet, t->weight, &out->held_out_error, err);
}

// Sizes in ascending order: those of the curve, and the wanted one among them.
static ep_status choose_all(trainer *t, ep_cubature *out, ep_error *err) {
  const ep_cubature_options *o = t->options;
  out->curve = calloc((size_t)o->curve_count + 1, sizeof *out->curve);
  if (!out->curve) return ep_fail(err, EP_ERR_MEMORY, "no memory for the error curve");
  ep_progress_begin(t->log, "cubature", o->curve_count + 1);
  int done = 0;
  for (int i = 0; i <= o->curve_count; i++) {
    const int next = i < o->curve_count ? o->curve_size[i] : largest_set(o) + 1;
    int count;
    if (!out->tet && o->elements <= next) {
      EP_TRY(choose(t, o->elements, &count, err));
      EP_TRY(keep(t, count, out, err));
      ep_progress(t->log, ++done);
    }
    if (i == o->curve_count) break;
    if (next != o->elements)
      EP_TRY(choose(t, next, &count, err));
    else
      count = out->count;
    EP_TRY(ep_training_error(&t->held, count, t->tet, t->weight, &out->curve[i], err));
    ep_progress(t->log, ++done);
  }
  ep_progress_end(t->log);
  return EP_OK;
}

static ep_status train(trainer *t, const ep_fem *fem, const ep_basis *basis, ep_cubature *out,
                       ep_error *err) {
  ep_progress_begin(t->log, "training forces", 0);
  EP_TRY(ep_elements_create(fem, basis, &t->elements, err));
  EP_TRY(make_poses(t, basis, err));
  EP_TRY(make_system(t, basis, err));
  ep_progress_end(t->log);
  EP_TRY(make_sets(t, err));
  return choose_all(t, out, err);
}

ep_status ep_cubature_train(const ep_fem *fem, const ep_basis *basis,
                            const ep_cubature_options *options, ep_log *log, ep_cubature *out,
                            ep_error *err) {
  *out = (ep_cubature){0};
  EP_TRY(check(fem, basis, options, err));
  trainer t = {.options = options, .log = log};
  const ep_status status = train(&t, fem, basis, out, err);
  const int shrunk = t.poses.shrunk + t.held_poses.shrunk;
  if (status == EP_OK && shrunk > 0)
    ep_notice(log, "cubature: %d of %d poses were made smaller because elements turned over",
              shrunk, t.poses.count + t.held_poses.count);
  release(&t);
  if (status != EP_OK) ep_cubature_free(out);
  return status;
}
