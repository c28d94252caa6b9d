#include "app/bake/bake.h"

#include <stdlib.h>
#include <string.h>

#include "linalg/petsc.h"

ep_status ep_bake_open(const ep_scene *scene, const ep_shapes *shapes, ep_plan *plan,
                       const ep_cache *cache, ep_log *log, ep_bake *out, ep_error *err) {
  *out = (ep_bake){.scene = scene, .shapes = shapes, .plan = plan, .cache = cache, .log = log};
  out->lb = calloc((size_t)shapes->count, sizeof *out->lb);
  out->mass = calloc((size_t)shapes->count, sizeof *out->mass);
  out->map = calloc((size_t)plan->count, sizeof *out->map);
  if (out->lb && out->mass && out->map) return EP_OK;
  ep_bake_close(out);
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the bake");
}

void ep_bake_close(ep_bake *bake) {
  for (int i = 0; bake->lb && i < bake->shapes->count; i++) ep_lb_free(&bake->lb[i]);
  for (int i = 0; bake->mass && i < bake->shapes->count; i++) ep_csr_free(&bake->mass[i]);
  for (int i = 0; bake->map && i < bake->plan->count; i++) ep_map_free(&bake->map[i]);
  free(bake->lb);
  free(bake->mass);
  free(bake->map);
  free(bake->poses);
  free(bake->quality);
  free(bake->paths);
  free(bake->cubic);
  free(bake->region);
  free(bake->example_region);
  ep_modes_free(&bake->modes);
  ep_basis_free(&bake->basis);
  ep_cubature_free(&bake->cubature);
  ep_guards_free(&bake->guards);
  ep_green_coefficients_free(&bake->green);
  ep_fem_free(&bake->fem);
  if (bake->petsc) ep_petsc_stop();
  memset(bake, 0, sizeof *bake);
}

void ep_bake_begin(ep_bake *bake, ep_stage *stage, ep_bake_step *step) {
  *step = (ep_bake_step){.stage = stage, .started = ep_seconds()};
  step->found = ep_cache_find(bake->cache, stage->name, &stage->key, bake->log, &step->artifact);
  stage->cached = step->found;
}

void ep_bake_reject(ep_bake *bake, ep_bake_step *step) {
  ep_notice(bake->log, "cache: the result of stage %s is incomplete; it is computed again",
            step->stage->name);
  ep_artifact_close(&step->artifact);
  step->found = step->stage->cached = false;
}

ep_status ep_bake_compute(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  if (!bake->petsc) {
    EP_TRY(ep_petsc_start(err));
    bake->petsc = true;
  }
  step->started = ep_seconds();
  return EP_OK;
}

ep_status ep_bake_status(const ep_stage *stage, ep_status status, ep_error *err) {
  if (status == EP_OK || strncmp(err->text, "stage ", 6) == 0) return status;
  // what a stage does not accept was asked for by the scene, not on the command line
  if (err->status == EP_ERR_ARGUMENT) err->status = EP_ERR_SCENE;
  return ep_fail_context(err, "stage %s", stage->name);
}

void ep_bake_end(ep_bake_step *step) {
  ep_artifact_close(&step->artifact);
  step->stage->seconds = ep_seconds() - step->started;
}

ep_status ep_bake_stage(ep_bake *bake, ep_stage *stage, ep_bake_taker *take, ep_bake_maker *compute,
                        ep_error *err) {
  ep_bake_step step;
  ep_status status = EP_OK;
  ep_bake_begin(bake, stage, &step);
  if (step.found && !take(bake, &step)) ep_bake_reject(bake, &step);
  if (!step.found) status = compute(bake, &step, err);
  ep_bake_end(&step);
  return ep_bake_status(stage, status, err);
}

bool ep_bake_take(const ep_bake_step *step, const char *name, size_t count, double **out) {
  const double *found = ep_artifact_array(&step->artifact, name, EP_F64, count);
  *out = found ? malloc((count + 1) * sizeof **out) : NULL;
  if (*out) memcpy(*out, found, count * sizeof **out);
  return *out != NULL;
}

bool ep_bake_take_int(const ep_bake_step *step, const char *name, size_t count, int **out) {
  const int *found = ep_artifact_array(&step->artifact, name, EP_I32, count);
  *out = found ? malloc((count + 1) * sizeof **out) : NULL;
  if (*out) memcpy(*out, found, count * sizeof **out);
  return *out != NULL;
}
