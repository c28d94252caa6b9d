// Stages of the subspace: modes, basis, elements and coefficients, the model file.
#include "app/plan/planner.h"

static ep_status plan_modes(ep_planner *p) {
  const ep_shapes *shapes = p->shapes;
  const int unknowns = 3 * (shapes->shape[0].mesh.nv - shapes->nfixed) - (shapes->nfixed ? 0 : 6);
  if (p->scene->modes > unknowns || p->scene->linear_modes > unknowns)
    return ep_fail(p->err, EP_ERR_SCENE,
                   "%s: reduction.modes is %d and linear_modes %d, but %s has only %d unknowns",
                   p->scene->path, p->scene->modes, p->scene->linear_modes,
                   shapes->shape[0].mesh.name, unknowns);
  ep_stage *stage =
      ep_plan_add(p, EP_STAGE_MODES, NULL, true, "%d linear modes and their derivatives%s",
                  p->scene->linear_modes, shapes->nfixed ? "" : ", without the six rigid ones");
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_hash_add(&text, "%s %s %d", shapes->shape[0].geometry.hex, shapes->physics.hex,
              p->scene->linear_modes);
  ep_plan_key_add_fixed(p, &text);
  stage->key = ep_hash_done(&text);
  return EP_OK;
}

static void plan_paths(ep_planner *p) {
  const int samples = p->scene->path_samples;
  if (!p->shapes->examples || !samples) {
    ep_plan_add(p, EP_STAGE_PATHS, NULL, false, "%s",
                samples ? "no examples" : "reduction.path_samples is 0");
    return;
  }
  ep_stage *stage =
      ep_plan_add(p, EP_STAGE_PATHS, NULL, true, "%d samples from rest to each example", samples);
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_hash_add(&text, "%s %s %d", ep_plan_find(p->plan, EP_STAGE_POSES)->key.hex,
              p->shapes->physics.hex, samples);
  stage->key = ep_hash_done(&text);
}

static void plan_basis(ep_planner *p) {
  ep_stage *stage = ep_plan_add(p, EP_STAGE_BASIS, NULL, true, "%d modes%s", p->scene->modes,
                                p->shapes->examples ? ", the examples first" : "");
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_hash_add(&text, "r=%d", p->scene->modes);
  ep_plan_key_add_stage(p, &text, EP_STAGE_MODES);
  ep_plan_key_add_stage(p, &text, EP_STAGE_POSES);
  ep_plan_key_add_stage(p, &text, EP_STAGE_PATHS);
  stage->key = ep_hash_done(&text);
}

static bool is_cubic(const ep_planner *p) {
  return !ep_is_cubature(p->scene->evaluator);
}

static void plan_cubature(ep_planner *p) {
  const ep_scene *scene = p->scene;
  if (is_cubic(p) && !ep_plan_uses_descriptors(p) && scene->model == EP_STVK) {
    ep_plan_add(p, EP_STAGE_CUBATURE, NULL, false, "%s",
                "the exact polynomials need no elements, and no shape is interpolated");
    return;
  }
  ep_stage *stage = ep_plan_add(p, EP_STAGE_CUBATURE, NULL, true, "up to %d elements from %d poses",
                                scene->elements, scene->training_poses);
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_plan_key_add_stage(p, &text, EP_STAGE_BASIS);
  ep_hash_add(&text, "s=%d poses=%d amplitude=%.17g seed=%llu", scene->elements,
              scene->training_poses, scene->amplitude, (unsigned long long)scene->seed);
  ep_plan_key_add_sets(p, &text);
  stage->key = ep_hash_done(&text);
}

static void plan_guards(ep_planner *p) {
  const ep_scene *scene = p->scene;
  if (scene->model == EP_STVK || scene->guards == 0) {
    ep_plan_add(p, EP_STAGE_GUARDS, NULL, false, "%s",
                scene->guards ? "stvk does not keep elements from turning over; stvk-volume does"
                              : "reduction.guards is 0");
    return;
  }
  ep_stage *stage =
      ep_plan_add(p, EP_STAGE_GUARDS, NULL, true,
                  "up to %d of the elements that turn over unseen when pushed hard", scene->guards);
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_plan_key_add_stage(p, &text, EP_STAGE_BASIS);
  ep_plan_key_add_stage(p, &text, EP_STAGE_CUBATURE);
  ep_hash_add(&text, "guards=%d seed=%llu", scene->guards, (unsigned long long)scene->seed);
  stage->key = ep_hash_done(&text);
}

static void plan_cubic(ep_planner *p) {
  if (!is_cubic(p)) {
    ep_plan_add(p, EP_STAGE_CUBIC, NULL, false, "reduction.evaluator is cubature");
    return;
  }
  ep_stage *stage = ep_plan_add(p, EP_STAGE_CUBIC, NULL, true,
                                "%zu coefficients of the elastic energy, over all elements",
                                ep_cubic_count(p->scene->modes));
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_plan_key_add_stage(p, &text, EP_STAGE_BASIS);
  ep_hash_add(&text, "%s", p->shapes->physics.hex);
  stage->key = ep_hash_done(&text);
}

static void plan_green(ep_planner *p) {
  const ep_scene *scene = p->scene;
  if (!p->shapes->examples || !(scene->methods & EP_METHOD_GREEN)) {
    ep_plan_add(p, EP_STAGE_GREEN, NULL, false, "%s",
                p->shapes->examples ? "examples.path is lb" : "no examples");
    return;
  }
  ep_stage *stage =
      ep_plan_add(p, EP_STAGE_GREEN, NULL, true,
                  "weights of %d example%s as quadratic forms, explicit in every step",
                  p->shapes->examples, p->shapes->examples > 1 ? "s" : "");
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_plan_key_add_stage(p, &text, EP_STAGE_BASIS);
  ep_plan_key_add_stage(p, &text, EP_STAGE_CUBATURE);
  if (is_cubic(p)) ep_hash_add(&text, "all elements");
  for (int i = 0; i < scene->nfamilies; i++) {
    const ep_family *f = &scene->family[i];
    if (f->region >= 0)
      ep_hash_add_bytes(&text, f->name, p->shapes->region[f->region],
                        (size_t)p->shapes->shape[0].mesh.nv * sizeof(double));
  }
  stage->key = ep_hash_done(&text);
}

static void plan_model(ep_planner *p) {
  ep_stage *stage =
      ep_plan_add(p, EP_STAGE_MODEL, NULL, true, "everything a run needs, in one file");
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_plan_key_add_stage(p, &text, EP_STAGE_BASIS);
  ep_plan_key_add_stage(p, &text, EP_STAGE_CUBATURE);
  ep_plan_key_add_stage(p, &text, EP_STAGE_GUARDS);
  const bool descriptors = ep_plan_uses_descriptors(p);
  ep_hash_add(&text, "m=%d %s", descriptors ? p->scene->eigenfunctions : 0,
              descriptors ? ep_plan_eigen(p->plan, 0)->key.hex : "none");
  ep_plan_key_add_sets(p, &text);
  ep_plan_key_add_stage(p, &text, EP_STAGE_GREEN);
  ep_plan_key_add_stage(p, &text, EP_STAGE_CUBIC);
  if (p->scene->evaluator != EP_EVALUATE_CUBATURE)
    ep_hash_add(&text, "evaluator %d", (int)p->scene->evaluator);
  if (p->scene->nobstacles) ep_hash_add(&text, "contact");
  stage->key = ep_hash_done(&text);
}

ep_status ep_plan_subspace(ep_planner *p) {
  EP_TRY(plan_modes(p));
  plan_paths(p);
  plan_basis(p);
  plan_cubature(p);
  plan_guards(p);
  plan_cubic(p);
  plan_green(p);
  plan_model(p);
  return EP_OK;
}
