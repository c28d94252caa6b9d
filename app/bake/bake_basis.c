// Stages in the object's full space: modes, paths, basis, cubature, model.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/bake/bake.h"
#include "app/plan/model_file.h"
#include "app/scene/regions.h"
#include "reduced/bake/model_build.h"

static size_t unknowns(const ep_bake *bake) {
  return 3 * (size_t)bake->shapes->shape[0].mesh.nv;
}

ep_status ep_bake_fem(ep_bake *bake, ep_error *err) {
  if (bake->fem.mesh) return EP_OK;
  const ep_shapes *s = bake->shapes;
  return ep_fem_create(&s->shape[0].mesh, bake->scene->model, s->nmaterials, s->material, s->nfixed,
                       s->fixed, &bake->fem, err);
}

// ---- modes -----------------------------------------------------------------------------------

static bool take_modes(ep_bake *bake, const ep_bake_step *step) {
  const size_t linear = (size_t)bake->scene->linear_modes;
  const size_t derivatives = linear * (linear + 1) / 2;
  ep_modes *modes = &bake->modes;
  if (!ep_bake_take(step, "omega2", linear, &modes->omega2) ||
      !ep_bake_take(step, "mode", (linear + derivatives) * unknowns(bake), &modes->mode)) {
    ep_modes_free(modes);
    return false;
  }
  modes->n = bake->shapes->shape[0].mesh.nv;
  modes->linear = (int)linear;
  modes->derivatives = (int)derivatives;
  return true;
}

static ep_status compute_modes(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  ep_modes *modes = &bake->modes;
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  EP_TRY(ep_modes_compute(&bake->fem, bake->scene->linear_modes, bake->log, modes, err));
  const ep_tensor tensors[] = {
      ep_tensor_of("omega2", EP_F64, modes->omega2, modes->linear, 0, 0),
      ep_tensor_of("mode", EP_F64, modes->mode, modes->linear + modes->derivatives,
                   (int64_t)unknowns(bake), 0),
  };
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, 2, tensors, 0, NULL,
                        err);
}

ep_status ep_bake_modes(ep_bake *bake, ep_error *err) {
  if (bake->modes.mode) return EP_OK;
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_MODES);
  return ep_bake_stage(bake, stage, take_modes, compute_modes, err);
}

// ---- paths -----------------------------------------------------------------------------------

static bool take_paths(ep_bake *bake, const ep_bake_step *step) {
  const size_t count = (size_t)bake->shapes->examples * (size_t)bake->scene->path_samples;
  return ep_bake_take(step, "x", count * unknowns(bake), &bake->paths);
}

static ep_status compute_paths(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  const size_t n3 = unknowns(bake), samples = (size_t)bake->scene->path_samples;
  const size_t k = (size_t)bake->shapes->examples;
  EP_TRY(ep_bake_poses(bake, err));
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  double *paths = malloc(k * samples * n3 * sizeof *paths);
  if (!paths) return ep_fail(err, EP_ERR_MEMORY, "no memory for example paths");
  ep_status status = EP_OK;
  for (size_t i = 0; i < k && status == EP_OK; i++)
    status = ep_path_samples(&bake->fem, bake->poses + i * n3, (int)samples, bake->log,
                             paths + i * samples * n3, err);
  if (status != EP_OK) {
    free(paths);
    return status;
  }
  bake->paths = paths;
  const ep_tensor tensor = ep_tensor_of("x", EP_F64, paths, (int64_t)(k * samples), (int64_t)n3, 0);
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, 1, &tensor, 0, NULL,
                        err);
}

ep_status ep_bake_paths(ep_bake *bake, ep_error *err) {
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_PATHS);
  if (bake->paths || !stage->runs) return EP_OK;
  return ep_bake_stage(bake, stage, take_paths, compute_paths, err);
}

// ---- basis -----------------------------------------------------------------------------------

static bool take_basis(ep_bake *bake, const ep_bake_step *step) {
  const size_t r = (size_t)bake->scene->modes, k = (size_t)bake->shapes->examples;
  ep_basis *basis = &bake->basis;
  bool good = ep_bake_take(step, "u", r * unknowns(bake), &basis->u) &&
              ep_bake_take(step, "stiffness", r * r, &basis->stiffness);
  if (good && k)
    good = ep_bake_take(step, "example_q", k * r, &basis->example_q) &&
           ep_bake_take(step, "example_residual", k, &basis->example_residual);
  if (!good) {
    ep_basis_free(basis);
    return false;
  }
  basis->n = bake->shapes->shape[0].mesh.nv;
  basis->r = (int)r;
  basis->examples = (int)k;
  return true;
}

static ep_status compute_basis(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  const ep_scene *scene = bake->scene;
  ep_basis *basis = &bake->basis;
  EP_TRY(ep_bake_modes(bake, err));
  EP_TRY(ep_bake_poses(bake, err));
  EP_TRY(ep_bake_paths(bake, err));
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  const int k = bake->shapes->examples;
  EP_TRY(ep_basis_build(&bake->fem, &bake->modes, k, bake->poses,
                        bake->paths ? k * scene->path_samples : 0, bake->paths, scene->modes,
                        bake->log, basis, err));
  const int64_t r = basis->r;
  const ep_tensor tensors[] = {
      ep_tensor_of("u", EP_F64, basis->u, r, (int64_t)unknowns(bake), 0),
      ep_tensor_of("stiffness", EP_F64, basis->stiffness, r, r, 0),
      ep_tensor_of("example_q", EP_F64, basis->example_q, k, r, 0),
      ep_tensor_of("example_residual", EP_F64, basis->example_residual, k, 0, 0),
  };
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, k ? 4 : 2, tensors, 0,
                        NULL, err);
}

ep_status ep_bake_basis(ep_bake *bake, ep_error *err) {
  if (bake->basis.u) return EP_OK;
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_BASIS);
  return ep_bake_stage(bake, stage, take_basis, compute_basis, err);
}

// ---- cubature --------------------------------------------------------------------------------

static bool take_cubature(ep_bake *bake, const ep_bake_step *step) {
  ep_cubature *c = &bake->cubature;
  const int *count = ep_artifact_array(&step->artifact, "count", EP_I32, 1);
  const double *errors = ep_artifact_array(&step->artifact, "errors", EP_F64, 2);
  if (!count || !errors || *count < 1 || *count > bake->shapes->shape[0].mesh.nt) return false;
  if (!ep_bake_take_int(step, "tet", (size_t)*count, &c->tet) ||
      !ep_bake_take(step, "weight", (size_t)*count, &c->weight)) {
    ep_cubature_free(c);
    return false;
  }
  const size_t numbers = (size_t)bake->shapes->sets * EP_REGION_NUMBERS;
  if (numbers && !ep_bake_take(step, "regions", numbers, &c->region)) {
    ep_cubature_free(c);
    return false;
  }
  c->regions = bake->shapes->sets;
  c->count = *count;
  c->train_error = errors[0];
  c->held_out_error = errors[1];
  return true;
}

// A region integrated worse than this has too few elements for its examples to act as they should.
static const double region_doubtful = 0.25;

static void warn_of_regions(const ep_bake *bake) {
  const ep_cubature *c = &bake->cubature;
  for (int i = 0; i < c->regions; i++) {
    const double *about = c->region + (size_t)i * EP_REGION_NUMBERS;
    const int region = bake->shapes->set[i];
    if (about[EP_REGION_HELD_OUT] > region_doubtful)
      ep_warn(
          bake->log,
          "cubature: the forces of region %s are off by %.2g (held out) with its %.0f elements; "
          "raise reduction.elements",
          region < 0 ? "everywhere" : bake->scene->region[region].name, about[EP_REGION_HELD_OUT],
          about[EP_REGION_ELEMENTS]);
  }
}

// *share (sets x nt) is the caller's to free.
static ep_status regions_of_training(ep_bake *bake, ep_cubature_options *options, double **share,
                                     ep_error *err) {
  const ep_mesh *mesh = &bake->shapes->shape[0].mesh;
  const size_t sets = (size_t)bake->shapes->sets, nt = (size_t)mesh->nt;
  if (!sets) return EP_OK;
  EP_TRY(ep_bake_regions(bake, err));
  *share = malloc(sets * nt * sizeof **share);
  if (!*share) return ep_fail(err, EP_ERR_MEMORY, "no memory for the examples' regions");
  for (size_t i = 0; i < sets; i++) ep_region_shares(mesh, bake->region[i].weight, *share + i * nt);
  options->regions = (int)sets;
  options->share = *share;
  options->example_region = bake->example_region;
  return EP_OK;
}

static ep_status compute_cubature(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  const ep_scene *scene = bake->scene;
  ep_cubature *c = &bake->cubature;
  EP_TRY(ep_bake_basis(bake, err));
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  ep_cubature_options options = ep_default_cubature_options();
  options.elements = scene->elements;
  options.poses = scene->training_poses;
  options.amplitude = scene->amplitude;
  options.seed = scene->seed;
  double *share = NULL;
  EP_TRY(regions_of_training(bake, &options, &share, err));
  const ep_status status = ep_cubature_train(&bake->fem, &bake->basis, &options, bake->log, c, err);
  free(share);
  if (status != EP_OK) return status;
  warn_of_regions(bake);
  const double errors[2] = {c->train_error, c->held_out_error};
  const ep_tensor tensors[] = {
      ep_tensor_of("count", EP_I32, &c->count, 1, 0, 0),
      ep_tensor_of("errors", EP_F64, errors, 2, 0, 0),
      ep_tensor_of("tet", EP_I32, c->tet, c->count, 0, 0),
      ep_tensor_of("weight", EP_F64, c->weight, c->count, 0, 0),
      ep_tensor_of("regions", EP_F64, c->region, c->regions, EP_REGION_NUMBERS, 0),
  };
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, c->regions ? 5 : 4,
                        tensors, 0, NULL, err);
}

ep_status ep_bake_cubature(ep_bake *bake, ep_error *err) {
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_CUBATURE);
  if (bake->cubature.tet || !stage->runs) return EP_OK;
  return ep_bake_stage(bake, stage, take_cubature, compute_cubature, err);
}

// ---- regions ---------------------------------------------------------------------------------

ep_status ep_bake_regions(ep_bake *bake, ep_error *err) {
  const ep_shapes *shapes = bake->shapes;
  if (bake->region || !shapes->sets) return EP_OK;
  bake->region = calloc((size_t)shapes->sets, sizeof *bake->region);
  bake->example_region = calloc((size_t)shapes->examples, sizeof *bake->example_region);
  if (!bake->region || !bake->example_region)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the examples' regions");
  for (int i = 0; i < shapes->sets; i++)
    bake->region[i] = (ep_region_part){.weight = ep_shapes_set_weight(shapes, i),
                                       .m = ep_shapes_set_functions(bake->scene, shapes, i)};
  for (int i = 0; i < shapes->examples; i++) bake->example_region[i] = shapes->example[i].set;
  return EP_OK;
}

// ---- model -----------------------------------------------------------------------------------

static ep_status write_model(ep_bake *bake, const char *path, ep_error *err) {
  const bool examples = bake->shapes->examples > 0 && (bake->scene->methods & EP_METHOD_LB);
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_basis(bake, err));
  EP_TRY(ep_bake_green(bake, err));
  EP_TRY(ep_bake_cubic(bake, err));
  EP_TRY(ep_bake_guards(bake, err));
  EP_TRY(ep_bake_regions(bake, err));
  if (examples) EP_TRY(ep_bake_lb(bake, 0, err));
  ep_contact_tree tree = {.contacts = 0};
  if (bake->scene->nobstacles)
    EP_TRY(ep_contact_tree_build(bake->fem.mesh, bake->basis.r, bake->basis.u, &tree, err));
  const ep_model_parts parts = {
      .fem = &bake->fem,
      .basis = &bake->basis,
      .regions = bake->shapes->sets,
      .region = bake->region,
      .example_region = bake->example_region,
      .m = examples ? bake->scene->eigenfunctions : 0,
      .lb = examples ? &bake->lb[0] : NULL,
      .lb_mass = examples ? &bake->mass[0] : NULL,
      .s = bake->cubature.count,
      .tet = bake->cubature.tet,
      .weight = bake->cubature.weight,
      .guards = bake->guards.count,
      .guard_tet = bake->guards.tet,
      .guard_w = bake->guards.weight,
      .guard_limit = bake->guards.limit,
      .green = bake->green.b ? &bake->green : NULL,
      .cubic = bake->cubic,
      .contact = tree.contacts ? &tree : NULL,
      .precision = bake->scene->evaluator == EP_EVALUATE_CUBIC_FLOAT ||
                           bake->scene->evaluator == EP_EVALUATE_CUBATURE_FLOAT
                       ? EP_FLOAT
                       : EP_DOUBLE,
  };
  ep_model_memory memory;
  const ep_status built = ep_model_build(&parts, &memory, err);
  ep_contact_tree_free(&tree);
  if (built != EP_OK) return built;
  char train[40], held_out[40];
  snprintf(train, sizeof train, "%.17g", bake->cubature.train_error);
  snprintf(held_out, sizeof held_out, "%.17g", bake->cubature.held_out_error);
  const ep_metadata meta[] = {
      {"cubature_train_error", train},
      {"cubature_held_out_error", held_out},
      {"object", bake->shapes->shape[0].geometry.hex},
      {"key", ep_plan_find(bake->plan, EP_STAGE_MODEL)->key.hex},
  };
  const ep_status status = ep_model_write(path, &memory.model, 4, meta, err);
  ep_model_memory_free(&memory);
  return status;
}

// A stage nobody asked for stands behind a later result that was found: it counts as cached.
static void settle(ep_plan *plan) {
  for (int i = 0; i < plan->count; i++) {
    ep_stage *stage = &plan->stage[i];
    if (stage->runs && ep_stage_is_baked(stage->kind) && stage->seconds == 0) stage->cached = true;
  }
}

ep_status ep_bake_model(ep_bake *bake, char *path, ep_error *err) {
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_MODEL);
  ep_cache_path(bake->cache, stage->name, &stage->key, "epm", path);
  double started = ep_seconds();
  stage->cached = ep_model_usable(path, bake->log);
  ep_status status = EP_OK;
  if (!stage->cached) {
    status = ep_bake_cubature(bake, err);
    started = ep_seconds();
    if (status == EP_OK) status = ep_make_folders(bake->cache->folder, err);
    if (status == EP_OK) status = write_model(bake, path, err);
  }
  stage->seconds = ep_seconds() - started;
  if (status == EP_OK) settle(bake->plan);
  return ep_bake_status(stage, status, err);
}
