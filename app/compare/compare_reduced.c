// A reduced run of a comparison, and the errors of any run against the reference.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/compare/compare.h"
#include "reduced/bake/cubic_coefficients.h"

enum { REPEATS = 5, FORCE_SAMPLES = 12 };
static const double REPEAT_SECONDS = 1.0; // runs are repeated for timing up to this

// ---- the run -----------------------------------------------------------------------------------

static ep_scene scene_of(const ep_bench *bench, const ep_point *point, const ep_frames *frames) {
  ep_scene scene = bench->scene;
  scene.dt = point->dt;
  scene.steps = (int)lround(frames->interval * frames->count / point->dt);
  scene.solver = strcmp(point->solver, "newton") == 0 ? EP_SOLVER_NEWTON : EP_SOLVER_NLOPT;
  if (scene.solver == EP_SOLVER_NLOPT && *point->solver)
    snprintf(scene.algorithm, sizeof scene.algorithm, "%s", point->solver);
  return scene;
}

// Repeated runs are the same to the bit: the smallest time of each step is its time.
static ep_status simulate(const ep_bench *bench, const ep_scene *scene, const ep_model *model,
                          ep_record *out, ep_error *err) {
  ep_log quiet = *bench->log;
  quiet.quiet = true;
  const double started = ep_seconds();
  EP_TRY(ep_simulate(scene, &bench->shapes, model, NULL, &quiet, out, err));
  for (int i = 1; i < REPEATS && ep_seconds() - started < REPEAT_SECONDS; i++) {
    ep_record again;
    const ep_status status = ep_simulate(scene, &bench->shapes, model, NULL, &quiet, &again, err);
    for (int j = 0; j < scene->steps && status == EP_OK; j++) {
      out->step_ms[j] = fmin(out->step_ms[j], again.step_ms[j]);
      out->target_ms[j] = fmin(out->target_ms[j], again.target_ms[j]);
    }
    ep_record_free(&again);
    if (status != EP_OK) return status;
  }
  return EP_OK;
}

// Bytes a step may touch: all arrays but those for display, and the state.
static double memory_of(const ep_model *model) {
#define X(name)                                                                                    \
  const int name = model->size.name;                                                               \
  (void)name;
  EP_MODEL_SIZES(X)
#undef X
  double sum = (double)ep_state_bytes(model);
#define X(type, name, d1, d2, d3)                                                                  \
  sum += (double)sizeof(ep_model_##type) * (double)(d1) * (double)(d2) * (double)(d3);
  EP_MODEL_ARRAYS(X)
#undef X
  return sum - 24.0 * n - 16.0 * nt - 24.0 * r * n;
}

static void product(const ep_model *model, const double *q, double *u) {
  const size_t n3 = 3 * (size_t)model->size.n;
  memset(u, 0, n3 * sizeof *u);
  for (int a = 0; a < model->size.r; a++)
    for (size_t i = 0; i < n3; i++) u[i] += q[a] * model->u[(size_t)a * n3 + i];
}

// Weights of the examples at frame i, in sets (ep_weight_sets).
static void take_weights(const ep_record *record, size_t row, int k, double *out) {
  const size_t count = (size_t)k;
  if (record->weights) {
    memcpy(out, record->weights + row * (count + 1) + 1, count * sizeof *out);
    out += k;
  }
  if (record->green_weights) memcpy(out, record->green_weights + row * count, count * sizeof *out);
}

static void take_frames(const ep_model *model, const ep_record *record, double dt,
                        ep_frames *frames) {
  const size_t stride = (size_t)lround(frames->interval / dt), r = (size_t)model->size.r;
  for (size_t i = 0; i < (size_t)frames->count; i++) {
    const size_t row = (i + 1) * stride;
    product(model, record->q + row * r, frames->x + i * frames->n3);
    product(model, record->velocity + row * r, frames->v + i * frames->n3);
    frames->energy[i] = record->energy[row];
    take_weights(record, row, model->size.k, frames->weight + i * (size_t)frames->nweights);
  }
}

static void take_times(const ep_record *record, int steps, ep_point *point) {
  point->step_median_us = 1e3 * ep_median(steps, record->step_ms);
  point->target_median_us = 1e3 * ep_median(steps, record->target_ms);
  point->step_min_us = 1e3 * record->step_ms[0];
  for (int i = 1; i < steps; i++)
    point->step_min_us = fmin(point->step_min_us, 1e3 * record->step_ms[i]);
  point->newton_per_step = (double)record->newton_iterations / steps;
  point->halvings = record->halvings;
  point->inverted = record->max_inverted;
}

// ---- force error -------------------------------------------------------------------------------

// Elastic forces at configurations of the run against U^T f of the full space at U q: the
// quadrature's error alone, without the subspace's.
static ep_status force_error(const ep_bench *bench, const ep_model *model, const ep_record *record,
                             ep_point *point, ep_error *err) {
  const size_t n3 = 3 * (size_t)model->size.n, r = (size_t)model->size.r;
  const size_t bytes = (ep_state_bytes(model) + 63) / 64 * 64;
  void *block = aligned_alloc(64, bytes);
  double *u = malloc((2 * n3 + r) * sizeof *u);
  ep_state *state = NULL;
  double wrong = 0, whole = 0;
  if (!block || !u || ep_state_init(model, block, bytes, &state) != EP_OK) {
    free(block);
    free(u);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for force errors");
  }
  double *full = u + n3, *f = full + n3;
  for (int i = 1; i <= FORCE_SAMPLES; i++) {
    const double *q = record->q + (size_t)((record->rows - 1) * i / FORCE_SAMPLES) * r;
    product(model, q, u);
    ep_fem_force(&bench->bake.fem, u, full);
    ep_elastic_energy(state, q, f, NULL, 0);
    for (size_t a = 0; a < r; a++) {
      double exact = 0;
      for (size_t j = 0; j < n3; j++) exact += model->u[a * n3 + j] * full[j];
      wrong += (f[a] - exact) * (f[a] - exact);
      whole += exact * exact;
    }
  }
  point->force_error = whole > 0 ? sqrt(wrong / whole) : 0;
  free(block);
  free(u);
  return EP_OK;
}

// ---- point -------------------------------------------------------------------------------------

static ep_status train(ep_bench *bench, ep_point *point, ep_cubature *out, ep_error *err) {
  ep_cubature_options options = ep_default_cubature_options();
  ep_log quiet = *bench->log;
  quiet.quiet = true;
  options.elements = point->s;
  options.poses = bench->scene.training_poses;
  options.amplitude = bench->scene.amplitude;
  options.seed = bench->scene.seed;
  EP_TRY(ep_cubature_train(&bench->bake.fem, &bench->bake.basis, &options, &quiet, out, err));
  return EP_OK;
}

static ep_status run_model(ep_bench *bench, const ep_model *model, ep_point *point,
                           ep_frames *frames, ep_error *err) {
  const ep_scene scene = scene_of(bench, point, frames);
  ep_record record = {0};
  ep_status status = simulate(bench, &scene, model, &record, err);
  if (status == EP_OK) status = force_error(bench, model, &record, point, err);
  if (status == EP_OK) {
    take_times(&record, scene.steps, point);
    take_frames(model, &record, point->dt, frames);
  }
  ep_record_free(&record);
  return status;
}

// Coefficients of the polynomials, malloc'd.
static ep_status coefficients(ep_bench *bench, double **out, ep_error *err) {
  const ep_basis *basis = &bench->bake.basis;
  ep_log quiet = *bench->log;
  quiet.quiet = true;
  *out = malloc(ep_cubic_count(basis->r) * sizeof **out);
  if (!*out)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the polynomials of %d modes", basis->r);
  return ep_cubic_coefficients(&bench->bake.fem, basis->r, basis->u, &quiet, *out, NULL, err);
}

static ep_status build(ep_bench *bench, ep_point *point, ep_model_memory *out, ep_error *err) {
  ep_cubature cubature = {0};
  double *cubic = NULL;
  ep_status status = EP_OK;
  if (point->method != EP_METHOD_ALL && point->s > 0) status = train(bench, point, &cubature, err);
  if (status == EP_OK && point->method == EP_METHOD_CUBIC)
    status = coefficients(bench, &cubic, err);
  if (status == EP_OK)
    status = ep_bench_model(bench, point->method == EP_METHOD_ALL ? NULL : &cubature, cubic,
                            point->precision, out, err);
  ep_cubature_free(&cubature);
  free(cubic);
  return status;
}

ep_status ep_compare_reduced(ep_bench *bench, ep_point *point, ep_frames *frames, ep_error *err) {
  ep_model_memory memory = {.count = 0};
  EP_TRY(ep_bench_prepare(bench, err));
  const double started = ep_seconds();
  ep_status status = build(bench, point, &memory, err);
  point->offline_s = bench->basis_seconds + ep_seconds() - started;
  if (status == EP_OK) {
    point->memory_bytes = memory_of(&memory.model);
    status = run_model(bench, &memory.model, point, frames, err);
  }
  ep_model_memory_free(&memory);
  return status;
}

// ---- errors ------------------------------------------------------------------------------------

double ep_compare_farthest(size_t n3, const double *a, const double *b) {
  double largest = 0;
  for (size_t v = 0; v < n3; v += 3) {
    double square = 0;
    for (size_t c = v; c < v + 3; c++) {
      const double d = a[c] - (b ? b[c] : 0);
      square += d * d;
    }
    if (!(square <= largest)) largest = square; // NaN comes through
  }
  return sqrt(largest);
}

ep_status ep_compare_errors(const ep_frames *run, const ep_frames *reference, double diagonal,
                            ep_point *point, ep_error *err) {
  const size_t n3 = run->n3;
  double fastest = 0, greatest = 0;
  point->position_error = point->velocity_error = point->energy_error = point->weight_error = 0;
  free(point->error_at);
  point->error_at = calloc((size_t)run->count + 1, sizeof *point->error_at);
  if (!point->error_at) return ep_fail(err, EP_ERR_MEMORY, "no memory for errors");
  for (size_t i = 0; i < (size_t)run->count; i++) {
    const double *x = reference->x + i * n3, *v = reference->v + i * n3;
    point->error_at[i] = ep_compare_farthest(n3, run->x + i * n3, x) / diagonal;
    point->position_error = fmax(point->position_error, point->error_at[i]);
    point->velocity_error =
        fmax(point->velocity_error, ep_compare_farthest(n3, run->v + i * n3, v));
    point->energy_error = fmax(point->energy_error, fabs(run->energy[i] - reference->energy[i]));
    for (size_t j = 0, n = (size_t)run->nweights; j < n; j++)
      point->weight_error =
          fmax(point->weight_error, fabs(run->weight[i * n + j] - reference->weight[i * n + j]));
    fastest = fmax(fastest, ep_compare_farthest(n3, v, NULL));
    greatest = fmax(greatest, fabs(reference->energy[i]));
  }
  point->velocity_error = fastest > 0 ? point->velocity_error / fastest : point->velocity_error;
  point->energy_error = greatest > 0 ? point->energy_error / greatest : point->energy_error;
  return EP_OK;
}
