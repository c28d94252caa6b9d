// Stages of shapes: LB spaces and maps.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/bake/bake.h"
#include "app/bake/map_store.h"
#include "app/scene/landmarks.h"
#include "app/scene/map_fields.h"

// ---- LB spaces -------------------------------------------------------------------------------

static bool take_lb(const ep_bake_step *step, int n, ep_lb *lb) {
  const int m = step->stage->functions;
  double *volume = NULL;
  const bool good = ep_bake_take(step, "volume", 1, &volume) &&
                    ep_bake_take(step, "lambda", (size_t)m, &lb->lambda) &&
                    ep_bake_take(step, "phi", (size_t)m * (size_t)n, &lb->phi);
  if (good) {
    lb->n = n;
    lb->m = m;
    lb->volume = *volume;
  } else {
    ep_lb_free(lb);
  }
  free(volume);
  return good;
}

static ep_status compute_lb(ep_bake *bake, ep_bake_step *step, int shape, ep_error *err) {
  ep_lb *lb = &bake->lb[shape];
  EP_TRY(ep_bake_compute(bake, step, err));
  EP_TRY(ep_lb_eigen(&bake->shapes->shape[shape].mesh, step->stage->functions, bake->log, lb, err));
  const ep_tensor tensors[] = {
      ep_tensor_of("volume", EP_F64, &lb->volume, 1, 0, 0),
      ep_tensor_of("lambda", EP_F64, lb->lambda, lb->m, 0, 0),
      ep_tensor_of("phi", EP_F64, lb->phi, lb->m, lb->n, 0),
  };
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, 3, tensors, 0, NULL,
                        err);
}

ep_status ep_bake_lb(ep_bake *bake, int shape, ep_error *err) {
  if (bake->lb[shape].phi) return EP_OK;
  ep_stage *stage = ep_plan_eigen(bake->plan, shape);
  const ep_mesh *mesh = &bake->shapes->shape[shape].mesh;
  ep_bake_step step;
  ep_status status = EP_OK;
  if (!bake->mass[shape].value) EP_TRY(ep_lb_mass(mesh, &bake->mass[shape], err));
  ep_bake_begin(bake, stage, &step);
  if (step.found && !take_lb(&step, mesh->nv, &bake->lb[shape])) ep_bake_reject(bake, &step);
  if (!step.found) status = compute_lb(bake, &step, shape, err);
  ep_bake_end(&step);
  return ep_bake_status(stage, status, err);
}

// ---- maps ------------------------------------------------------------------------------------

// Columns of a regions file: the object, the family's rest shape where it has one of its own, then
// its poses in order.
static int region_column(const ep_bake *bake, int family, int shape) {
  if (shape == 0) return 0;
  const int rest = bake->shapes->rest[family];
  if (rest && shape == rest) return 1;
  for (int i = 0; i < bake->shapes->examples; i++) {
    const ep_pose_source *example = &bake->shapes->example[i];
    if (example->family == family && example->shape == shape)
      return example->index + (rest ? 2 : 1);
  }
  return -1;
}

static ep_status read_regions(const ep_bake *bake, int family, ep_regions *out, ep_error *err) {
  const ep_family *f = &bake->scene->family[family];
  const int rest = bake->shapes->rest[family], columns = f->poses + (rest ? 2 : 1);
  const ep_mesh **meshes = calloc((size_t)columns, sizeof *meshes);
  if (!meshes) return ep_fail(err, EP_ERR_MEMORY, "no memory for regions");
  meshes[0] = &bake->shapes->shape[0].mesh;
  if (rest) meshes[1] = &bake->shapes->shape[rest].mesh;
  for (int i = 0; i < bake->shapes->examples; i++) {
    const ep_pose_source *example = &bake->shapes->example[i];
    if (example->family == family)
      meshes[example->index + (rest ? 2 : 1)] = &bake->shapes->shape[example->shape].mesh;
  }
  const ep_status status = ep_regions_read(f->regions, columns, meshes, out, err);
  free(meshes);
  return status;
}

static ep_status compute_map(ep_bake *bake, ep_bake_step *step, ep_map *map, ep_error *err) {
  const ep_stage *stage = step->stage;
  ep_regions regions = {0};
  const ep_family *family = &bake->scene->family[stage->family];
  ep_landmark landmark[EP_LANDMARKS_MAX];
  ep_map_options options = ep_default_map_options();
  options.m = stage->functions;
  options.same_family = stage->same_family;
  options.reflections = family->reflections;
  options.keep_frame = family->frame == EP_FRAME_AUTHORED;
  options.landmark = landmark;
  EP_TRY(ep_landmarks_of_map(bake->scene, bake->shapes, stage->family, stage->from, stage->to,
                             landmark, &options.landmarks, err));
  EP_TRY(ep_bake_lb(bake, stage->from, err));
  EP_TRY(ep_bake_lb(bake, stage->to, err));
  EP_TRY(ep_map_fields(bake->scene, bake->shapes, stage->family, stage->from, stage->to, &regions,
                       err));
  if (regions.count) {
    options.regions = &regions;
    options.to_column = 1; // from_column: 0
  }
  if (family->regions) {
    EP_TRY(read_regions(bake, stage->family, &regions, err));
    options.regions = &regions;
    options.from_column = region_column(bake, stage->family, stage->from);
    options.to_column = region_column(bake, stage->family, stage->to);
  }
  const ep_shape from = {&bake->shapes->shape[stage->from].mesh, &bake->lb[stage->from],
                         &bake->mass[stage->from]};
  const ep_shape to = {&bake->shapes->shape[stage->to].mesh, &bake->lb[stage->to],
                       &bake->mass[stage->to]};
  ep_status status = ep_bake_compute(bake, step, err);
  if (status == EP_OK) status = ep_map_match(&from, &to, &options, bake->log, map, err);
  if (status == EP_ERR_ARGUMENT && options.landmarks) // what else is given is checked by now
    status = ep_fail_context(err, "families.%d.map.landmarks", stage->family);
  if (status == EP_OK) status = ep_map_store(bake->cache, stage->name, &stage->key, map, err);
  ep_regions_free(&regions);
  return status;
}

ep_status ep_bake_map(ep_bake *bake, ep_stage *stage, const ep_map **out, ep_error *err) {
  ep_map *map = &bake->map[stage - bake->plan->stage];
  *out = map;
  if (map->p) return EP_OK;
  ep_bake_step step;
  ep_status status = EP_OK;
  ep_bake_begin(bake, stage, &step);
  if (step.found && !ep_map_take(&step.artifact, bake->shapes->shape[stage->from].mesh.nv,
                                 stage->functions, &bake->shapes->shape[stage->to].mesh, map))
    ep_bake_reject(bake, &step);
  if (!step.found) status = compute_map(bake, &step, map, err);
  ep_bake_end(&step);
  return ep_bake_status(stage, status, err);
}
