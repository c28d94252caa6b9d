#include "app/plan/plan.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/hash_text.h"
#include "app/scene/landmarks.h"
#include "app/scene/map_fields.h"

// Raised whenever a stage computes something else from the same input: old results are then not
// found any more.
static const int stage_version[] = {
    [EP_STAGE_EIGEN] = 1, [EP_STAGE_MAP] = 7,    [EP_STAGE_POSES] = 4,    [EP_STAGE_MODES] = 1,
    [EP_STAGE_PATHS] = 2, [EP_STAGE_BASIS] = 1,  [EP_STAGE_CUBATURE] = 1, [EP_STAGE_GREEN] = 1,
    [EP_STAGE_MODEL] = 7, [EP_STAGE_CUBIC] = 1,  [EP_STAGE_TARGET] = 1,   [EP_STAGE_CONTACT] = 1,
    [EP_STAGE_FRAME] = 1, [EP_STAGE_GUARDS] = 3,
};

// Matching raises the number of functions to 20 (align/match.c), between the rest shape and a pose
// of one family to 32; coupling uses 2 m.
enum { MATCH_FUNCTIONS = 25, MATCH_FAMILY = 32 };

typedef struct planner {
  const ep_scene *scene;
  const ep_shapes *shapes;
  ep_plan *plan;
  ep_error *err;
} planner;

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

// Add a stage; its name is the kind, with ":detail" where detail is given.
static ep_stage *add(planner *p, ep_stage_kind kind, const char *detail, bool runs,
                     const char *format, ...) __attribute__((format(printf, 5, 6)));
static ep_stage *add(planner *p, ep_stage_kind kind, const char *detail, bool runs,
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

static ep_hash_text key_of(ep_stage_kind kind) {
  ep_hash_text text = {0};
  ep_hash_add(&text, "%s %d", ep_stage_kind_name(kind), stage_version[kind]);
  return text;
}

static int smaller(int a, int b) {
  return a < b ? a : b;
}
static int larger(int a, int b) {
  return a > b ? a : b;
}

static bool any_map(const ep_shapes *shapes) {
  for (int i = 0; i < shapes->examples; i++)
    if (shapes->example[i].route == EP_ROUTE_MAP) return true;
  return false;
}

// ---- LB spaces -------------------------------------------------------------------------------

// Poses need reduction.eigenfunctions or those of their region, maps those of their family.
static int most_functions(const planner *p) {
  const ep_scene *scene = p->scene;
  int most = scene->eigenfunctions;
  for (int i = 0; i < p->shapes->sets; i++)
    most = larger(most, ep_shapes_set_functions(scene, p->shapes, i));
  for (int i = 0; i < scene->nfamilies && any_map(p->shapes); i++)
    most = larger(most, scene->family[i].eigenfunctions);
  return most;
}

// Whether a map between a family's rest shape and its pose takes this shape.
static bool in_family_map(const ep_shapes *shapes, int shape) {
  for (int i = 0; i < shapes->examples; i++) {
    const ep_pose_source *e = &shapes->example[i];
    if (!e->pose_same && (e->rest == shape || e->shape == shape)) return true;
  }
  return false;
}

static void plan_eigen(planner *p) {
  const ep_shapes *shapes = p->shapes;
  const int m = most_functions(p);
  if (!shapes->examples) {
    add(p, EP_STAGE_EIGEN, NULL, false, "no examples: no Laplace-Beltrami space is needed");
    return;
  }
  const bool maps = any_map(shapes);
  for (int i = 0; i < shapes->count; i++) {
    const ep_shape_file *shape = &shapes->shape[i];
    if (!shape->needs_lb) {
      add(p, EP_STAGE_EIGEN, shape->name, false,
          i ? "same connectivity: vertices correspond already"
            : "same connectivity, and the Green-strain path needs no descriptors");
      continue;
    }
    const int match = in_family_map(shapes, i) ? MATCH_FAMILY : MATCH_FUNCTIONS;
    const int wanted = maps ? larger(match, 2 * m) : m;
    ep_stage *stage = add(p, EP_STAGE_EIGEN, shape->name, true, "%s",
                          i      ? "its map to the object needs it"
                          : maps ? "descriptors of the motion, and the maps"
                                 : "descriptors of the motion");
    stage->shape = i;
    stage->functions = smaller(wanted, shape->mesh.nv - 2);
    ep_hash_text text = key_of(stage->kind);
    ep_hash_add(&text, "%s %d", shape->geometry.hex, stage->functions);
    stage->key = ep_hash_done(&text);
  }
}

static ep_status check_functions(const planner *p) {
  const int m = most_functions(p);
  for (int i = 0; i < p->plan->count; i++) {
    const ep_stage *stage = &p->plan->stage[i];
    if (stage->kind == EP_STAGE_EIGEN && stage->runs && stage->functions < m)
      return ep_fail(p->err, EP_ERR_SCENE,
                     "%s: %d eigenfunctions are asked for, but %s (%d vertices) has only %d",
                     p->scene->path, m, p->shapes->shape[stage->shape].mesh.name,
                     p->shapes->shape[stage->shape].mesh.nv, stage->functions);
  }
  return EP_OK;
}

// ---- maps ------------------------------------------------------------------------------------

static ep_status add_landmarks(const planner *p, int family, int from, int to, ep_hash_text *text) {
  ep_landmark landmark[EP_LANDMARKS_MAX];
  int count;
  EP_TRY(ep_landmarks_of_map(p->scene, p->shapes, family, from, to, landmark, &count, p->err));
  for (int i = 0; i < count; i++) {
    const ep_landmark *l = &landmark[i];
    ep_hash_add(text, "landmark %d %d %.17g %.17g %.17g %.17g %.17g %.17g", l->from_vertex,
                l->to_vertex, l->from[0], l->from[1], l->from[2], l->to[0], l->to[1], l->to[2]);
  }
  return EP_OK;
}

static const char *how(const ep_family *f, int by_fields) {
  if (f->regions && f->landmarks) return "by the given regions and landmarks";
  if (f->regions) return "by the given regions";
  if (by_fields && f->landmarks) return "by fields of the meshes and the given landmarks";
  if (by_fields) return "by fields of the meshes";
  return f->landmarks ? "by the given landmarks" : "automatic";
}

// The regions the meshes mark themselves, into the key of their map.
static ep_status add_fields(const planner *p, int family, int from, int to, ep_hash_text *text,
                            int *count) {
  ep_regions regions;
  EP_TRY(ep_map_fields(p->scene, p->shapes, family, from, to, &regions, p->err));
  *count = regions.count;
  if (regions.count) {
    const size_t lists = 2 * (size_t)regions.count, vertices = (size_t)regions.start[lists];
    ep_hash_add_bytes(text, "fields", regions.start, (lists + 1) * sizeof *regions.start);
    ep_hash_add_bytes(text, "fields", regions.vertex, vertices * sizeof *regions.vertex);
  }
  ep_map_fields_free(&regions);
  return EP_OK;
}

static ep_status plan_map(planner *p, int family, int from, int to, const char *why) {
  if (ep_plan_map(p->plan, from, to)) return EP_OK;
  const ep_family *f = &p->scene->family[family];
  const ep_shape_file *target = &p->shapes->shape[to], *source = &p->shapes->shape[from];
  int by_fields = 0;
  ep_hash_text text = key_of(EP_STAGE_MAP);
  EP_TRY(add_fields(p, family, from, to, &text, &by_fields));
  ep_stage *stage = add(p, EP_STAGE_MAP, target->name, true, "%s, %s", why, how(f, by_fields));
  stage->from = from;
  stage->to = to;
  stage->family = family;
  stage->same_family = to != p->shapes->rest[family];
  stage->functions = f->eigenfunctions;
  ep_hash_add(&text, "%s %s m=%d same=%d frame=%d reflections=%d", source->geometry.hex,
              target->geometry.hex, stage->functions, (int)stage->same_family, (int)f->frame,
              (int)f->reflections);
  EP_TRY(add_landmarks(p, family, from, to, &text));
  ep_hash_add(&text, "%s %s", ep_plan_eigen(p->plan, from)->key.hex,
              ep_plan_eigen(p->plan, to)->key.hex);
  if (f->regions) {
    ep_digest digest;
    EP_TRY(ep_hash_file(f->regions, &digest, p->err));
    // The columns of the file are the shapes in order: which two belong to this map matters.
    ep_hash_add(&text, "regions %s %d %d %d", digest.hex, f->poses, from - p->shapes->rest[family],
                to - p->shapes->rest[family]);
  }
  stage->key = ep_hash_done(&text);
  return EP_OK;
}

static ep_status plan_maps(planner *p) {
  const ep_shapes *shapes = p->shapes;
  if (!shapes->examples) {
    add(p, EP_STAGE_MAP, NULL, false, "no examples: nothing to map");
    return EP_OK;
  }
  for (int i = 0; i < shapes->examples; i++) {
    const ep_pose_source *example = &shapes->example[i];
    const char *name = shapes->shape[example->shape].name;
    if (example->route == EP_ROUTE_SAME) {
      add(p, EP_STAGE_MAP, name, false, "same connectivity as the object: no alignment");
      continue;
    }
    if (!example->rest_same)
      EP_TRY(plan_map(p, example->family, 0, example->rest,
                      "the example's rest shape is another mesh than the object"));
    if (example->pose_same)
      add(p, EP_STAGE_MAP, name, false, "same connectivity as its rest shape: no alignment");
    else
      EP_TRY(plan_map(p, example->family, example->rest, example->shape,
                      "the pose is another mesh than its rest shape"));
  }
  return EP_OK;
}

// ---- the rest --------------------------------------------------------------------------------

static void add_fixed(const planner *p, ep_hash_text *text) {
  ep_hash_add_bytes(text, "fixed", p->shapes->fixed, (size_t)p->shapes->nfixed * sizeof(int));
}

static void add_set(const planner *p, ep_hash_text *text, int set) {
  const double *weight = ep_shapes_set_weight(p->shapes, set);
  ep_hash_add(text, "set %d m=%d", set, ep_shapes_set_functions(p->scene, p->shapes, set));
  if (weight)
    ep_hash_add_bytes(text, "region", weight, (size_t)p->shapes->shape[0].mesh.nv * sizeof *weight);
}

// Which examples act where.
static void add_sets(const planner *p, ep_hash_text *text) {
  for (int i = 0; i < p->shapes->sets; i++) add_set(p, text, i);
  for (int i = 0; p->shapes->sets && i < p->shapes->examples; i++)
    ep_hash_add(text, "example %d", p->shapes->example[i].set);
}

static void plan_poses(planner *p) {
  const ep_shapes *shapes = p->shapes;
  if (!shapes->examples) {
    add(p, EP_STAGE_POSES, NULL, false, "no examples");
    return;
  }
  const bool maps = any_map(shapes);
  ep_stage *stage = add(p, EP_STAGE_POSES, NULL, true, "%d example%s %s", shapes->examples,
                        shapes->examples > 1 ? "s" : "",
                        maps             ? "on the object's mesh, through descriptors and LB-ARAP"
                        : shapes->nfixed ? "read directly, aligned at the fixed vertices"
                                         : "read directly, aligned by mass");
  ep_hash_text text = key_of(stage->kind);
  ep_hash_add(&text, "m=%d", maps ? p->scene->eigenfunctions : 0);
  add_fixed(p, &text);
  for (int i = 0; i < shapes->examples; i++) {
    const ep_pose_source *e = &shapes->example[i];
    ep_hash_add(&text, "%d %s %s %s", (int)e->route, shapes->shape[0].geometry.hex,
                shapes->shape[e->rest].geometry.hex, shapes->shape[e->shape].geometry.hex);
    // A bad map stops the poses where it is not accepted: what was made by accepting it must not
    // be found when it is not.
    ep_hash_add(&text, "accept %d", (int)p->scene->family[e->family].accept);
    if (shapes->sets) add_set(p, &text, e->set);
    if (e->route == EP_ROUTE_SAME) continue;
    ep_hash_add(&text, "lb %s", ep_plan_eigen(p->plan, 0)->key.hex);
    if (!e->rest_same) ep_hash_add(&text, "rest %s", ep_plan_map(p->plan, 0, e->rest)->key.hex);
    if (!e->pose_same)
      ep_hash_add(&text, "pose %s", ep_plan_map(p->plan, e->rest, e->shape)->key.hex);
  }
  stage->key = ep_hash_done(&text);
}

static ep_status plan_modes(planner *p) {
  const ep_shapes *shapes = p->shapes;
  const int unknowns = 3 * (shapes->shape[0].mesh.nv - shapes->nfixed) - (shapes->nfixed ? 0 : 6);
  if (p->scene->modes > unknowns || p->scene->linear_modes > unknowns)
    return ep_fail(p->err, EP_ERR_SCENE,
                   "%s: reduction.modes is %d and linear_modes %d, but %s has only %d unknowns",
                   p->scene->path, p->scene->modes, p->scene->linear_modes,
                   shapes->shape[0].mesh.name, unknowns);
  ep_stage *stage =
      add(p, EP_STAGE_MODES, NULL, true, "%d linear modes and their derivatives%s",
          p->scene->linear_modes, shapes->nfixed ? "" : ", without the six rigid ones");
  ep_hash_text text = key_of(stage->kind);
  ep_hash_add(&text, "%s %s %d", shapes->shape[0].geometry.hex, shapes->physics.hex,
              p->scene->linear_modes);
  add_fixed(p, &text);
  stage->key = ep_hash_done(&text);
  return EP_OK;
}

static void plan_paths(planner *p) {
  const int samples = p->scene->path_samples;
  if (!p->shapes->examples || !samples) {
    add(p, EP_STAGE_PATHS, NULL, false, "%s",
        samples ? "no examples" : "reduction.path_samples is 0");
    return;
  }
  ep_stage *stage =
      add(p, EP_STAGE_PATHS, NULL, true, "%d samples from rest to each example", samples);
  ep_hash_text text = key_of(stage->kind);
  ep_hash_add(&text, "%s %s %d", ep_plan_find(p->plan, EP_STAGE_POSES)->key.hex,
              p->shapes->physics.hex, samples);
  stage->key = ep_hash_done(&text);
}

static void add_stage_key(const planner *p, ep_hash_text *text, ep_stage_kind kind) {
  const ep_stage *stage = ep_plan_find(p->plan, kind);
  ep_hash_add(text, "%s %s", ep_stage_kind_name(kind), stage->runs ? stage->key.hex : "none");
}

static void plan_basis(planner *p) {
  ep_stage *stage = add(p, EP_STAGE_BASIS, NULL, true, "%d modes%s", p->scene->modes,
                        p->shapes->examples ? ", the examples first" : "");
  ep_hash_text text = key_of(stage->kind);
  ep_hash_add(&text, "r=%d", p->scene->modes);
  add_stage_key(p, &text, EP_STAGE_MODES);
  add_stage_key(p, &text, EP_STAGE_POSES);
  add_stage_key(p, &text, EP_STAGE_PATHS);
  stage->key = ep_hash_done(&text);
}

static bool uses_descriptors(const planner *p) {
  return p->shapes->examples && (p->scene->methods & EP_METHOD_LB);
}

static bool is_cubic(const planner *p) {
  return !ep_is_cubature(p->scene->evaluator);
}

static void plan_cubature(planner *p) {
  const ep_scene *scene = p->scene;
  if (is_cubic(p) && !uses_descriptors(p) && scene->model == EP_STVK) {
    add(p, EP_STAGE_CUBATURE, NULL, false, "%s",
        "the exact polynomials need no elements, and no shape is interpolated");
    return;
  }
  ep_stage *stage = add(p, EP_STAGE_CUBATURE, NULL, true, "up to %d elements from %d poses",
                        scene->elements, scene->training_poses);
  ep_hash_text text = key_of(stage->kind);
  add_stage_key(p, &text, EP_STAGE_BASIS);
  ep_hash_add(&text, "s=%d poses=%d amplitude=%.17g seed=%llu", scene->elements,
              scene->training_poses, scene->amplitude, (unsigned long long)scene->seed);
  add_sets(p, &text);
  stage->key = ep_hash_done(&text);
}

static void plan_guards(planner *p) {
  const ep_scene *scene = p->scene;
  if (scene->model == EP_STVK || scene->guards == 0) {
    add(p, EP_STAGE_GUARDS, NULL, false, "%s",
        scene->guards ? "stvk does not keep elements from turning over; stvk-volume does"
                      : "reduction.guards is 0");
    return;
  }
  ep_stage *stage =
      add(p, EP_STAGE_GUARDS, NULL, true,
          "up to %d of the elements that turn over unseen when pushed hard", scene->guards);
  ep_hash_text text = key_of(stage->kind);
  add_stage_key(p, &text, EP_STAGE_BASIS);
  add_stage_key(p, &text, EP_STAGE_CUBATURE);
  ep_hash_add(&text, "guards=%d seed=%llu", scene->guards, (unsigned long long)scene->seed);
  stage->key = ep_hash_done(&text);
}

static void plan_cubic(planner *p) {
  if (!is_cubic(p)) {
    add(p, EP_STAGE_CUBIC, NULL, false, "reduction.evaluator is cubature");
    return;
  }
  ep_stage *stage = add(p, EP_STAGE_CUBIC, NULL, true,
                        "%zu coefficients of the elastic energy, over all elements",
                        ep_cubic_count(p->scene->modes));
  ep_hash_text text = key_of(stage->kind);
  add_stage_key(p, &text, EP_STAGE_BASIS);
  ep_hash_add(&text, "%s", p->shapes->physics.hex);
  stage->key = ep_hash_done(&text);
}

static void plan_green(planner *p) {
  const ep_scene *scene = p->scene;
  if (!p->shapes->examples || !(scene->methods & EP_METHOD_GREEN)) {
    add(p, EP_STAGE_GREEN, NULL, false, "%s",
        p->shapes->examples ? "examples.path is lb" : "no examples");
    return;
  }
  ep_stage *stage = add(p, EP_STAGE_GREEN, NULL, true,
                        "weights of %d example%s as quadratic forms, explicit in every step",
                        p->shapes->examples, p->shapes->examples > 1 ? "s" : "");
  ep_hash_text text = key_of(stage->kind);
  add_stage_key(p, &text, EP_STAGE_BASIS);
  add_stage_key(p, &text, EP_STAGE_CUBATURE);
  if (is_cubic(p)) ep_hash_add(&text, "all elements");
  for (int i = 0; i < scene->nfamilies; i++) {
    const ep_family *f = &scene->family[i];
    if (f->region >= 0)
      ep_hash_add_bytes(&text, f->name, p->shapes->region[f->region],
                        (size_t)p->shapes->shape[0].mesh.nv * sizeof(double));
  }
  stage->key = ep_hash_done(&text);
}

static void plan_model(planner *p) {
  ep_stage *stage = add(p, EP_STAGE_MODEL, NULL, true, "everything a run needs, in one file");
  ep_hash_text text = key_of(stage->kind);
  add_stage_key(p, &text, EP_STAGE_BASIS);
  add_stage_key(p, &text, EP_STAGE_CUBATURE);
  add_stage_key(p, &text, EP_STAGE_GUARDS);
  const bool descriptors = uses_descriptors(p);
  ep_hash_add(&text, "m=%d %s", descriptors ? p->scene->eigenfunctions : 0,
              descriptors ? ep_plan_eigen(p->plan, 0)->key.hex : "none");
  add_sets(p, &text);
  add_stage_key(p, &text, EP_STAGE_GREEN);
  add_stage_key(p, &text, EP_STAGE_CUBIC);
  if (p->scene->evaluator != EP_EVALUATE_CUBATURE)
    ep_hash_add(&text, "evaluator %d", (int)p->scene->evaluator);
  if (p->scene->nobstacles) ep_hash_add(&text, "contact");
  stage->key = ep_hash_done(&text);
}

// "2 examples in 2 sets, each with weights and a target of its own: left, right"
static void plan_local_target(planner *p, int k) {
  const ep_shapes *shapes = p->shapes;
  char list[120] = "";
  size_t used = 0;
  for (int i = 0; i < shapes->sets && used + 30 < sizeof list; i++)
    used +=
        (size_t)snprintf(list + used, sizeof list - used, "%s%.24s", i ? ", " : "",
                         shapes->set[i] < 0 ? "everywhere" : p->scene->region[shapes->set[i]].name);
  add(p, EP_STAGE_TARGET, NULL, true,
      "%d example%s in %d region%s, each with weights and a target of its own: %s", k,
      k > 1 ? "s" : "", shapes->sets, shapes->sets > 1 ? "s" : "", list);
}

static void plan_target(planner *p) {
  const int k = p->shapes->examples;
  if (!k)
    add(p, EP_STAGE_TARGET, NULL, false, "no examples: nothing to interpolate in a step");
  else if (!uses_descriptors(p))
    add(p, EP_STAGE_TARGET, NULL, false,
        "examples.path is green: weights are explicit, nothing is interpolated in a step");
  else if (p->scene->strength == 0)
    add(p, EP_STAGE_TARGET, NULL, false, "examples.strength is 0: examples are only measured");
  else if (p->shapes->sets)
    plan_local_target(p, k);
  else
    add(p, EP_STAGE_TARGET, NULL, true, "%d example%s and the rest shape, in every step", k,
        k > 1 ? "s" : "");
}

static void plan_frame(planner *p) {
  if (p->shapes->nfixed)
    add(p, EP_STAGE_FRAME, NULL, false, "something is fixed: the object does not move as a whole");
  else
    add(p, EP_STAGE_FRAME, NULL, true,
        "nothing is fixed: momenta, rotation and inertial forces in every step");
}

static void plan_contact(planner *p) {
  const int count = p->scene->nobstacles;
  if (!count)
    add(p, EP_STAGE_CONTACT, NULL, false, "no obstacles: surface rows and their tree are not kept");
  else
    add(p, EP_STAGE_CONTACT, NULL, true, "%d obstacle%s, in every step", count,
        count > 1 ? "s" : "");
}

static ep_status fill(planner *p) {
  plan_eigen(p);
  EP_TRY(check_functions(p));
  EP_TRY(plan_maps(p));
  plan_poses(p);
  EP_TRY(plan_modes(p));
  plan_paths(p);
  plan_basis(p);
  plan_cubature(p);
  plan_guards(p);
  plan_cubic(p);
  plan_green(p);
  plan_model(p);
  plan_target(p);
  plan_frame(p);
  plan_contact(p);
  return EP_OK;
}

ep_status ep_plan_make(const ep_scene *scene, const ep_shapes *shapes, ep_plan *out,
                       ep_error *err) {
  memset(out, 0, sizeof *out);
  const size_t most = (size_t)shapes->count + 2 * (size_t)shapes->examples + 14;
  out->stage = calloc(most, sizeof *out->stage);
  if (!out->stage) return ep_fail(err, EP_ERR_MEMORY, "no memory for the plan");
  planner p = {.scene = scene, .shapes = shapes, .plan = out, .err = err};
  const ep_status status = fill(&p);
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
