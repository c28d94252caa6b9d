// The full-space run of a comparison.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/compare/compare.h"
#include "app/run/stepper.h"
#include "reduced/bake/full_step.h"

typedef struct run {
  ep_bench *bench;
  ep_full *full;
  ep_state *examples;   // of the interpolation path, or NULL
  ep_green_full *green; // of the Green-strain path, or NULL
  ep_step_def def;
  double *load, *force; // (nloads x n3) at full strength, (n3) of the step at hand
  double energy;        // elastic + kinetic of the last step
  double target_seconds;
  int newton, halvings;
} run;

static ep_status make_loads(run *r, ep_error *err) {
  const ep_shapes *shapes = &r->bench->shapes;
  const ep_scene *scene = &r->bench->scene;
  const size_t n3 = 3 * (size_t)shapes->shape[0].mesh.nv;
  double *mass = malloc(n3 * sizeof *mass);
  r->load = calloc((size_t)scene->nloads * n3 + 1, sizeof *r->load);
  r->force = calloc(n3, sizeof *r->force);
  ep_status status = EP_OK;
  if (!mass || !r->load || !r->force)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for the loads");
  if (status == EP_OK) ep_shapes_vertex_mass(shapes, mass);
  for (int i = 0; i < scene->nloads && status == EP_OK; i++)
    status = ep_load_forces(&scene->load[i], &shapes->shape[0].mesh, mass, r->load + (size_t)i * n3,
                            err);
  free(mass);
  return status;
}

static void set_force(run *r, double t) {
  const ep_scene *scene = &r->bench->scene;
  const size_t n3 = 3 * (size_t)r->bench->shapes.shape[0].mesh.nv;
  memset(r->force, 0, n3 * sizeof *r->force);
  for (int i = 0; i < scene->nloads; i++) {
    const double strength = ep_load_profile(&scene->load[i], t);
    for (size_t j = 0; j < n3; j++) r->force[j] += strength * r->load[(size_t)i * n3 + j];
  }
}

// As in app/run/stepper.c: a failed step is done in two halves.
static ep_status advance(run *r, double t, double dt, int level, ep_error *err) {
  ep_full_report report;
  ep_error here = {0};
  r->def.dt = dt;
  set_force(r, t + dt);
  const ep_status status = ep_full_step(r->full, &r->def, &report, &here);
  r->newton += report.newton_iterations;
  r->energy = report.elastic_energy + report.kinetic_energy;
  if (status == EP_OK) return EP_OK;
  if (status != EP_ERR_NUMERIC || level == EP_HALVINGS_MAX)
    return ep_fail(err, status, "t = %.4g s: %s", t, here.text);
  r->halvings++;
  EP_TRY(advance(r, t, dt / 2, level + 1, err));
  return advance(r, t + dt / 2, dt / 2, level + 1, err);
}

static ep_status timed_newton(void *user, ep_state *state, const double *w, double *q,
                              double tolerance, ep_target_report *report) {
  run *r = user;
  const double started = ep_seconds();
  const ep_status status = ep_target_newton(NULL, state, w, q, tolerance, report);
  r->target_seconds += ep_seconds() - started;
  return status;
}

static void set_up_step(run *r) {
  const ep_scene *scene = &r->bench->scene;
  r->def = ep_default_step();
  r->def.integrator = scene->integrator;
  r->def.force = r->force;
  r->def.damping_mass = scene->damping_mass;
  r->def.damping_stiffness = scene->damping_stiffness;
  r->def.strength = r->examples ? scene->strength : 0;
  r->def.green = scene->green;
  r->def.relief = scene->relief;
  r->def.example_force = scene->force;
  r->def.target_solver = timed_newton;
  r->def.target_user = r;
}

// Weights of the examples at the shape at hand, in sets (ep_weight_sets).
static ep_status take_weights(run *r, double *out, ep_error *err) {
  const size_t k = (size_t)r->bench->shapes.examples;
  if (r->examples) {
    const ep_model *model = ep_state_model(r->examples);
    const size_t reduced = (size_t)model->size.r, descriptor = 3 * (size_t)model->size.m;
    double *q = malloc((reduced + descriptor + k + 1) * sizeof *q), *c = q + reduced;
    if (!q) return ep_fail(err, EP_ERR_MEMORY, "no memory for a run");
    ep_full_coordinates(r->full, q);
    ep_descriptor(model, q, c);
    const ep_status status = ep_example_weights(r->examples, c, c + descriptor);
    memcpy(out, c + descriptor + 1, k * sizeof *out); // the rest shape's comes first
    free(q);
    if (status != EP_OK) return ep_fail(err, status, "the weights of the examples failed");
    out += k;
  }
  if (r->green) {
    double *y = malloc((size_t)r->green->space.count * sizeof *y);
    if (!y) return ep_fail(err, EP_ERR_MEMORY, "no memory for a run");
    ep_green_full_energy(r->green, ep_full_displacement(r->full), y, NULL, out);
    free(y);
  }
  return EP_OK;
}

static ep_status take_frame(run *r, size_t frame, ep_point *point, ep_frames *frames, double *x,
                            ep_error *err) {
  const ep_mesh *mesh = &r->bench->shapes.shape[0].mesh;
  const double *u = ep_full_displacement(r->full);
  memcpy(frames->x + frame * frames->n3, u, frames->n3 * sizeof *x);
  memcpy(frames->v + frame * frames->n3, ep_full_velocity(r->full), frames->n3 * sizeof *x);
  frames->energy[frame] = r->energy;
  for (size_t j = 0; j < frames->n3; j++) x[j] = mesh->x[j] + u[j];
  point->inverted = fmax(point->inverted, ep_mesh_inverted(mesh, x, NULL));
  return take_weights(r, frames->weight + frame * (size_t)frames->nweights, err);
}

static void take_times(const run *r, int steps, const double *us, ep_point *point) {
  point->step_median_us = ep_median(steps, us);
  point->target_median_us = ep_median(steps, us + steps);
  point->step_min_us = us[0];
  for (int i = 1; i < steps; i++) point->step_min_us = fmin(point->step_min_us, us[i]);
  point->newton_per_step = (double)r->newton / steps;
  point->halvings = r->halvings;
}

static ep_status all_steps(run *r, ep_point *point, ep_frames *frames, ep_error *err) {
  const int steps = (int)lround(frames->interval * frames->count / point->dt);
  const int stride = (int)lround(frames->interval / point->dt);
  double *us = malloc(2 * (size_t)steps * sizeof *us);
  double *x = malloc(frames->n3 * sizeof *x);
  ep_status status = us && x ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for a run");
  ep_progress_begin(r->bench->log, "full space", steps);
  for (int i = 0; i < steps && status == EP_OK; i++) {
    const double started = ep_seconds();
    r->target_seconds = 0;
    status = advance(r, i * point->dt, point->dt, 0, err);
    us[i] = 1e6 * (ep_seconds() - started);
    us[steps + i] = 1e6 * r->target_seconds;
    ep_progress(r->bench->log, i + 1);
    if ((i + 1) % stride || status != EP_OK) continue;
    status = take_frame(r, (size_t)(i + 1) / (size_t)stride - 1, point, frames, x, err);
  }
  ep_progress_end(r->bench->log);
  if (status == EP_OK) take_times(r, steps, us, point);
  free(us);
  free(x);
  return status;
}

static ep_status simulate(run *r, ep_point *point, ep_frames *frames, ep_error *err) {
  const double started = ep_seconds();
  EP_TRY(ep_full_create(&r->bench->bake.fem, r->examples, r->green, &r->full, err));
  point->offline_s = ep_seconds() - started;
  point->memory_bytes = (double)ep_full_bytes(r->full);
  EP_TRY(make_loads(r, err));
  set_up_step(r);
  return all_steps(r, point, frames, err);
}

// The interpolation's forces come from this bench's subspace with all elements.
static ep_status make_state(ep_bench *bench, ep_model_memory *memory, void **block, ep_state **out,
                            ep_error *err) {
  EP_TRY(ep_bench_model(bench, NULL, NULL, EP_DOUBLE, memory, err));
  const size_t bytes = (ep_state_bytes(&memory->model) + 63) / 64 * 64;
  *block = aligned_alloc(64, bytes);
  if (!*block) return ep_fail(err, EP_ERR_MEMORY, "no memory for a state");
  if (ep_state_init(&memory->model, *block, bytes, out) != EP_OK)
    return ep_fail(err, EP_ERR_NUMERIC, "cannot set up a state of the model");
  return EP_OK;
}

static ep_status make_strains(ep_bench *bench, ep_green_full *out, ep_error *err) {
  const ep_bake *bake = &bench->bake;
  double *share;
  EP_TRY(ep_bake_shares(bake, &share, err));
  const ep_status status =
      ep_green_full_create(&bake->fem, bake->fem.volume, bench->shapes.examples, bake->poses, share,
                           bench->log, out, err);
  free(share);
  return status;
}

ep_status ep_compare_full(ep_bench *bench, ep_point *point, ep_frames *frames, ep_error *err) {
  run r = {.bench = bench};
  ep_model_memory memory = {.count = 0};
  ep_green_full green = {0};
  void *block = NULL;
  ep_status status = ep_bench_prepare(bench, err);
  if (status == EP_OK && (point->path & EP_METHOD_LB))
    status = make_state(bench, &memory, &block, &r.examples, err);
  if (status == EP_OK && (point->path & EP_METHOD_GREEN)) {
    status = make_strains(bench, &green, err);
    r.green = &green;
  }
  if (status == EP_OK) status = simulate(&r, point, frames, err);
  ep_full_free(r.full);
  ep_green_full_free(&green);
  free(r.load);
  free(r.force);
  free(block);
  ep_model_memory_free(&memory);
  return status;
}
