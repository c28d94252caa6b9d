#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/plan/planner.h"
#include "app/scene/obstacle_start.h"

// Raised whenever a stage computes something else from the same input: old results are then not
// found any more.
static const int stage_version[] = {
    [EP_STAGE_EIGEN] = 1, [EP_STAGE_MAP] = 9,    [EP_STAGE_POSES] = 5,    [EP_STAGE_MODES] = 1,
    [EP_STAGE_PATHS] = 2, [EP_STAGE_BASIS] = 2,  [EP_STAGE_CUBATURE] = 2, [EP_STAGE_GREEN] = 1,
    [EP_STAGE_MODEL] = 8, [EP_STAGE_CUBIC] = 1,  [EP_STAGE_TARGET] = 1,   [EP_STAGE_CONTACT] = 1,
    [EP_STAGE_FRAME] = 1, [EP_STAGE_GUARDS] = 10,
};

const char *ep_stage_kind_name(ep_stage_kind kind) {
  static const char *const names[] = {
      [EP_STAGE_EIGEN] = "eigen",       [EP_STAGE_MAP] = "map",
      [EP_STAGE_POSES] = "poses",       [EP_STAGE_MODES] = "modes",
      [EP_STAGE_PATHS] = "paths",       [EP_STAGE_BASIS] = "basis",
      [EP_STAGE_CUBATURE] = "cubature", [EP_STAGE_MODEL] = "model",
      [EP_STAGE_CUBIC] = "cubic",       [EP_STAGE_TARGET] = "interpolation",
      [EP_STAGE_CONTACT] = "contact",   [EP_STAGE_GREEN] = "green",
      [EP_STAGE_FRAME] = "frame",       [EP_STAGE_GUARDS] = "guards",
  };
  return names[kind];
}

bool ep_stage_is_baked(ep_stage_kind kind) {
  return kind != EP_STAGE_TARGET && kind != EP_STAGE_CONTACT && kind != EP_STAGE_FRAME;
}

ep_stage *ep_plan_add(ep_planner *p, ep_stage_kind kind, const char *detail, bool runs,
                      const char *format, ...) {
  ep_stage *stage = &p->plan->stage[p->plan->count++];
  memset(stage, 0, sizeof *stage);
  stage->kind = kind;
  stage->runs = runs;
  stage->shape = stage->from = stage->to = stage->family = -1;
  snprintf(stage->name, sizeof stage->name, "%s%s%s", ep_stage_kind_name(kind), detail ? ":" : "",
           detail ? detail : "");
  va_list args;
  va_start(args, format);
  vsnprintf(stage->reason, sizeof stage->reason, format, args);
  va_end(args);
  return stage;
}

ep_hash_text ep_plan_key_of(ep_stage_kind kind) {
  ep_hash_text text = {0};
  ep_hash_add(&text, "%s %d", ep_stage_kind_name(kind), stage_version[kind]);
  return text;
}

// ---- parts of keys ------------------------------------------------------------------------------

void ep_plan_key_add_fixed(const ep_planner *p, ep_hash_text *text) {
  ep_hash_add_bytes(text, "fixed", p->shapes->fixed, (size_t)p->shapes->nfixed * sizeof(int));
}

void ep_plan_key_add_set(const ep_planner *p, ep_hash_text *text, int set) {
  const double *weight = ep_shapes_set_weight(p->shapes, set);
  ep_hash_add(text, "set %d m=%d", set, ep_shapes_set_functions(p->scene, p->shapes, set));
  if (weight)
    ep_hash_add_bytes(text, "region", weight, (size_t)p->shapes->shape[0].mesh.nv * sizeof *weight);
}

// Which examples act where.
void ep_plan_key_add_sets(const ep_planner *p, ep_hash_text *text) {
  for (int i = 0; i < p->shapes->sets; i++) ep_plan_key_add_set(p, text, i);
  for (int i = 0; p->shapes->sets && i < p->shapes->examples; i++)
    ep_hash_add(text, "example %d", p->shapes->example[i].set);
}

void ep_plan_key_add_stage(const ep_planner *p, ep_hash_text *text, ep_stage_kind kind) {
  const ep_stage *stage = ep_plan_find(p->plan, kind);
  ep_hash_add(text, "%s %s", ep_stage_kind_name(kind), stage->runs ? stage->key.hex : "none");
}

bool ep_plan_uses_descriptors(const ep_planner *p) {
  return p->shapes->examples && (p->scene->methods & EP_METHOD_LB);
}

// ---- plans -------------------------------------------------------------------------------------

ep_status ep_plan_make(const ep_scene *scene, const ep_shapes *shapes, ep_plan *out,
                       ep_error *err) {
  memset(out, 0, sizeof *out);
  EP_TRY(ep_obstacles_check_start(scene, shapes, err));
  const size_t most = (size_t)shapes->count + 2 * (size_t)shapes->examples + 14;
  out->stage = calloc(most, sizeof *out->stage);
  if (!out->stage) return ep_fail(err, EP_ERR_MEMORY, "no memory for the plan");
  ep_planner p = {.scene = scene, .shapes = shapes, .plan = out, .err = err};
  ep_status status = ep_plan_shapes(&p);
  if (status == EP_OK) status = ep_plan_subspace(&p);
  if (status == EP_OK) ep_plan_steps(&p);
  if (status != EP_OK) ep_plan_free(out);
  return status;
}

void ep_plan_free(ep_plan *plan) {
  free(plan->stage);
  memset(plan, 0, sizeof *plan);
}

ep_stage *ep_plan_find(const ep_plan *plan, ep_stage_kind kind) {
  for (int i = 0; i < plan->count; i++)
    if (plan->stage[i].kind == kind) return &plan->stage[i];
  return NULL;
}

ep_stage *ep_plan_eigen(const ep_plan *plan, int shape) {
  for (int i = 0; i < plan->count; i++)
    if (plan->stage[i].kind == EP_STAGE_EIGEN && plan->stage[i].shape == shape)
      return &plan->stage[i];
  return NULL;
}

ep_stage *ep_plan_map(const ep_plan *plan, int from, int to) {
  for (int i = 0; i < plan->count; i++)
    if (plan->stage[i].kind == EP_STAGE_MAP && plan->stage[i].from == from &&
        plan->stage[i].to == to)
      return &plan->stage[i];
  return NULL;
}
