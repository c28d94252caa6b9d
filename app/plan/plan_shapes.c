// Stages on whole shapes: Laplace-Beltrami spaces, maps, poses on the object's mesh.
#include "align/align.h"
#include "app/plan/planner.h"
#include "app/scene/landmarks.h"
#include "app/scene/map_fields.h"

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
static int most_functions(const ep_planner *p) {
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

static void plan_eigen(ep_planner *p) {
  const ep_shapes *shapes = p->shapes;
  const int m = most_functions(p);
  if (!shapes->examples) {
    ep_plan_add(p, EP_STAGE_EIGEN, NULL, false, "no examples: no Laplace-Beltrami space is needed");
    return;
  }
  const bool maps = any_map(shapes);
  for (int i = 0; i < shapes->count; i++) {
    const ep_shape_file *shape = &shapes->shape[i];
    if (!shape->needs_lb) {
      ep_plan_add(p, EP_STAGE_EIGEN, shape->name, false,
                  i ? "same connectivity: vertices correspond already"
                    : "same connectivity, and the Green-strain path needs no descriptors");
      continue;
    }
    const int match = in_family_map(shapes, i) ? EP_MAP_SPACE_FAMILY : EP_MAP_SPACE;
    const int wanted = maps ? larger(match, 2 * m) : m;
    ep_stage *stage = ep_plan_add(p, EP_STAGE_EIGEN, shape->name, true, "%s",
                                  i      ? "its map to the object needs it"
                                  : maps ? "descriptors of the motion, and the maps"
                                         : "descriptors of the motion");
    stage->shape = i;
    stage->functions = smaller(wanted, shape->mesh.nv - 2);
    ep_hash_text text = ep_plan_key_of(stage->kind);
    ep_hash_add(&text, "%s %d", shape->geometry.hex, stage->functions);
    stage->key = ep_hash_done(&text);
  }
}

static ep_status check_functions(const ep_planner *p) {
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

static ep_status add_landmarks(const ep_planner *p, int family, int from, int to,
                               ep_hash_text *text) {
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
static ep_status add_fields(const ep_planner *p, int family, int from, int to, ep_hash_text *text,
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

static ep_status plan_map(ep_planner *p, int family, int from, int to, const char *why) {
  if (ep_plan_map(p->plan, from, to)) return EP_OK;
  const ep_family *f = &p->scene->family[family];
  const ep_shape_file *target = &p->shapes->shape[to], *source = &p->shapes->shape[from];
  int by_fields = 0;
  ep_hash_text text = ep_plan_key_of(EP_STAGE_MAP);
  EP_TRY(add_fields(p, family, from, to, &text, &by_fields));
  ep_stage *stage =
      ep_plan_add(p, EP_STAGE_MAP, target->name, true, "%s, %s", why, how(f, by_fields));
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

static ep_status plan_maps(ep_planner *p) {
  const ep_shapes *shapes = p->shapes;
  if (!shapes->examples) {
    ep_plan_add(p, EP_STAGE_MAP, NULL, false, "no examples: nothing to map");
    return EP_OK;
  }
  for (int i = 0; i < shapes->examples; i++) {
    const ep_pose_source *example = &shapes->example[i];
    const char *name = shapes->shape[example->shape].name;
    if (example->route == EP_ROUTE_SAME) {
      ep_plan_add(p, EP_STAGE_MAP, name, false, "same connectivity as the object: no alignment");
      continue;
    }
    if (!example->rest_same)
      EP_TRY(plan_map(p, example->family, 0, example->rest,
                      "the example's rest shape is another mesh than the object"));
    if (example->pose_same)
      ep_plan_add(p, EP_STAGE_MAP, name, false,
                  "same connectivity as its rest shape: no alignment");
    else
      EP_TRY(plan_map(p, example->family, example->rest, example->shape,
                      "the pose is another mesh than its rest shape"));
  }
  return EP_OK;
}

// ---- poses -----------------------------------------------------------------------------------

static void plan_poses(ep_planner *p) {
  const ep_shapes *shapes = p->shapes;
  if (!shapes->examples) {
    ep_plan_add(p, EP_STAGE_POSES, NULL, false, "no examples");
    return;
  }
  const bool maps = any_map(shapes);
  ep_stage *stage = ep_plan_add(p, EP_STAGE_POSES, NULL, true, "%d example%s %s", shapes->examples,
                                shapes->examples > 1 ? "s" : "",
                                maps ? "on the object's mesh, through descriptors and LB-ARAP"
                                : shapes->nfixed ? "read directly, aligned at the fixed vertices"
                                                 : "read directly, aligned by mass");
  ep_hash_text text = ep_plan_key_of(stage->kind);
  ep_hash_add(&text, "m=%d", maps ? p->scene->eigenfunctions : 0);
  ep_plan_key_add_fixed(p, &text);
  for (int i = 0; i < shapes->examples; i++) {
    const ep_pose_source *e = &shapes->example[i];
    ep_hash_add(&text, "%d %s %s %s", (int)e->route, shapes->shape[0].geometry.hex,
                shapes->shape[e->rest].geometry.hex, shapes->shape[e->shape].geometry.hex);
    // A bad map stops the poses where it is not accepted: what was made by accepting it must not
    // be found when it is not.
    ep_hash_add(&text, "accept %d", (int)p->scene->family[e->family].accept);
    if (shapes->sets) ep_plan_key_add_set(p, &text, e->set);
    if (e->route == EP_ROUTE_SAME) continue;
    ep_hash_add(&text, "lb %s", ep_plan_eigen(p->plan, 0)->key.hex);
    if (!e->rest_same) ep_hash_add(&text, "rest %s", ep_plan_map(p->plan, 0, e->rest)->key.hex);
    if (!e->pose_same)
      ep_hash_add(&text, "pose %s", ep_plan_map(p->plan, e->rest, e->shape)->key.hex);
  }
  stage->key = ep_hash_done(&text);
}

ep_status ep_plan_shapes(ep_planner *p) {
  plan_eigen(p);
  EP_TRY(check_functions(p));
  EP_TRY(plan_maps(p));
  plan_poses(p);
  return EP_OK;
}
