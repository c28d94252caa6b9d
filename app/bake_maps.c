// Stages of shapes: LB spaces and maps.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/bake.h"

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
  return status == EP_OK ? EP_OK : ep_fail_context(err, "stage %s", stage->name);
}

// ---- maps ------------------------------------------------------------------------------------

// The numbers of a quality record in the order they are stored.
enum { QUALITY_NUMBERS = 13, REGION_NUMBERS = 5, FRAME_NUMBERS = 7, REASONS = 1024 };

static void pack_quality(const ep_map_quality *q, double *out) {
  const double numbers[QUALITY_NUMBERS] = {
      q->verdict,
      q->residual_before,
      q->residual_after,
      q->orthogonality,
      q->determinant,
      q->coverage,
      q->cycle,
      q->dirichlet,
      q->near_multiple,
      q->reframe_rounds,
      q->frame_angle,
      q->regions,
      0,
  };
  memcpy(out, numbers, sizeof numbers);
}

static void unpack_quality(const double *in, ep_map_quality *q) {
  q->verdict = (ep_verdict)(int)in[0];
  q->residual_before = in[1];
  q->residual_after = in[2];
  q->orthogonality = in[3];
  q->determinant = in[4];
  q->coverage = in[5];
  q->cycle = in[6];
  q->dirichlet = in[7];
  q->near_multiple = (int)in[8];
  q->reframe_rounds = (int)in[9];
  q->frame_angle = in[10];
  q->regions = (int)in[11];
}

static void pack_region(const ep_region_quality *r, double *out) {
  out[0] = r->residual_before;
  out[1] = r->residual_after;
  out[2] = r->jaccard;
  out[3] = r->best_match;
  out[4] = r->suspect;
}

static void unpack_region(const double *in, ep_region_quality *r) {
  r->residual_before = in[0];
  r->residual_after = in[1];
  r->jaccard = in[2];
  r->best_match = (int)in[3];
  r->suspect = in[4] != 0;
}

static bool take_regions(const ep_bake_step *step, ep_map_quality *q) {
  double *numbers;
  const size_t count = (size_t)q->regions;
  if (!count) return true;
  if (count > 100000 || !ep_bake_take(step, "regions", count * REGION_NUMBERS, &numbers))
    return false;
  q->region = calloc(count, sizeof *q->region);
  for (size_t i = 0; q->region && i < count; i++)
    unpack_region(numbers + REGION_NUMBERS * i, &q->region[i]);
  free(numbers);
  return q->region != NULL;
}

static bool take_map(const ep_bake_step *step, int n, int vertices_to, ep_map *map) {
  const size_t m = (size_t)step->stage->functions;
  const double *rotation = ep_artifact_array(&step->artifact, "rotation", EP_F64, 9);
  const double *frame = ep_artifact_array(&step->artifact, "frame", EP_F64, FRAME_NUMBERS);
  const double *quality = ep_artifact_array(&step->artifact, "quality", EP_F64, QUALITY_NUMBERS);
  const char *reasons = ep_artifact_array(&step->artifact, "reasons", EP_U8, REASONS);
  if (!rotation || !frame || !quality || !reasons) return false;
  map->n = n;
  map->m = (int)m;
  unpack_quality(quality, &map->quality);
  memcpy(map->quality.reasons, reasons, REASONS - 1);
  memcpy(map->rotation, rotation, sizeof map->rotation);
  map->scale = frame[0];
  memcpy(map->center_from, frame + 1, sizeof map->center_from);
  memcpy(map->center_to, frame + 4, sizeof map->center_to);
  bool good = ep_bake_take_int(step, "p", (size_t)n, &map->p) &&
              ep_bake_take(step, "c", m * m, &map->c) && ep_bake_take(step, "a", m * m, &map->a) &&
              take_regions(step, &map->quality);
  for (int v = 0; good && v < n; v++) good = map->p[v] >= 0 && map->p[v] < vertices_to;
  if (!good) ep_map_free(map);
  return good;
}

static ep_status store_map(const ep_bake *bake, const ep_stage *stage, const ep_map *map,
                           ep_error *err) {
  const ep_map_quality *q = &map->quality;
  double quality[QUALITY_NUMBERS], frame[FRAME_NUMBERS] = {map->scale};
  char reasons[REASONS] = "";
  double *regions = calloc((size_t)q->regions * REGION_NUMBERS + 1, sizeof *regions);
  if (!regions) return ep_fail(err, EP_ERR_MEMORY, "no memory for the regions of a map");
  for (int i = 0; i < q->regions; i++) pack_region(&q->region[i], regions + REGION_NUMBERS * i);
  pack_quality(q, quality);
  snprintf(reasons, sizeof reasons, "%s", q->reasons);
  memcpy(frame + 1, map->center_from, sizeof map->center_from);
  memcpy(frame + 4, map->center_to, sizeof map->center_to);
  const ep_tensor tensors[] = {
      ep_tensor_of("p", EP_I32, map->p, map->n, 0, 0),
      ep_tensor_of("c", EP_F64, map->c, map->m, map->m, 0),
      ep_tensor_of("a", EP_F64, map->a, map->m, map->m, 0),
      ep_tensor_of("rotation", EP_F64, map->rotation, 9, 0, 0),
      ep_tensor_of("frame", EP_F64, frame, FRAME_NUMBERS, 0, 0),
      ep_tensor_of("quality", EP_F64, quality, QUALITY_NUMBERS, 0, 0),
      ep_tensor_of("reasons", EP_U8, reasons, REASONS, 0, 0),
      ep_tensor_of("regions", EP_F64, regions, q->regions, REGION_NUMBERS, 0),
  };
  const ep_status status = ep_cache_store(bake->cache, stage->name, &stage->key, q->regions ? 8 : 7,
                                          tensors, 0, NULL, err);
  free(regions);
  return status;
}

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
  ep_map_options options = ep_default_map_options();
  options.m = stage->functions;
  options.same_family = stage->same_family;
  EP_TRY(ep_bake_lb(bake, stage->from, err));
  EP_TRY(ep_bake_lb(bake, stage->to, err));
  if (bake->scene->family[stage->family].regions) {
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
  if (status == EP_OK) status = store_map(bake, stage, map, err);
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
  if (step.found && !take_map(&step, bake->shapes->shape[stage->from].mesh.nv,
                              bake->shapes->shape[stage->to].mesh.nv, map))
    ep_bake_reject(bake, &step);
  if (!step.found) status = compute_map(bake, &step, map, err);
  ep_bake_end(&step);
  return status == EP_OK ? EP_OK : ep_fail_context(err, "stage %s", stage->name);
}
