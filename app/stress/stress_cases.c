// Which cases a scene is stressed with.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/stress/stress.h"

const char *ep_stress_axis_name(ep_stress_axis axis) {
  static const char *const names[EP_STRESS_AXES] = {"stiffness", "poisson", "stiff",   "density",
                                                    "dt",        "load",    "impulse", "start",
                                                    "alpha",     "strength"};
  return names[axis];
}

const char *ep_stress_start_name(ep_stress_start start) {
  static const char *const names[EP_STRESS_STARTS] = {"inverted", "point", "plane", "random",
                                                      "far"};
  return names[start];
}

const char *ep_stress_variant_name(ep_stress_variant variant) {
  static const char *const names[EP_VARIANTS] = {
      "scene",    "stvk",  "stvk-volume", "neohookean", "corotational",
      "cubature", "cubic", "lb",          "green",      "free"};
  return names[variant];
}

const char *ep_stress_outcome_name(ep_stress_outcome outcome) {
  static const char *const names[EP_STRESS_OUTCOMES] = {"safe",   "subdivided", "inverted",
                                                        "growth", "refused",    "broken"};
  return names[outcome];
}

void ep_stress_value_text(const ep_stress_case *c, char *text) {
  if (c->axis == EP_STRESS_START)
    snprintf(text, 32, "%s", ep_stress_start_name((ep_stress_start)c->value));
  else if (c->second > 0)
    snprintf(text, 32, "%.4g @ %.3g s", c->value, c->second);
  else
    snprintf(text, 32, "%.6g", c->value);
}

// ---- values ------------------------------------------------------------------------------------

static const double stiffness[] = {1e-3, 1e-2, 1e-1, 1, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6};
static const double poisson[] = {0, 0.2, 0.4, 0.45, 0.49, 0.499, 0.4999};
static const double stiff[] = {1e6}, nearly_incompressible = 0.4999;
static const double density[] = {1e-3, 1e-2, 1e-1, 1e1, 1e2, 1e3};
static const double steps[] = {1e-4, 1e-3, 1.0 / 240, 1.0 / 60, 1.0 / 30, 0.1};
static const double powers[] = {1, 1e1, 1e2, 1e3, 1e4};
static const double starts[] = {EP_START_INVERTED, EP_START_POINT, EP_START_PLANE, EP_START_RANDOM,
                                EP_START_FAR};
static const double alphas[] = {0, 0.25, 0.5, 0.75, 1};
static const double strengths[] = {0, 1, 1e1, 1e2, 1e3, 1e4};

#define VALUES(list)                                                                               \
  { sizeof(list) / sizeof *(list), list }
static const struct {
  size_t count;
  const double *value;
} values[EP_STRESS_AXES] = {[EP_STRESS_STIFFNESS] = VALUES(stiffness),
                            [EP_STRESS_POISSON] = VALUES(poisson),
                            [EP_STRESS_STIFF] = VALUES(stiff),
                            [EP_STRESS_DENSITY] = VALUES(density),
                            [EP_STRESS_DT] = VALUES(steps),
                            [EP_STRESS_LOAD] = VALUES(powers),
                            [EP_STRESS_IMPULSE] = VALUES(powers),
                            [EP_STRESS_START] = VALUES(starts),
                            [EP_STRESS_ALPHA] = VALUES(alphas),
                            [EP_STRESS_STRENGTH] = VALUES(strengths)};

// ---- which apply -------------------------------------------------------------------------------

static bool is_stvk(ep_material m) {
  return m == EP_STVK || m == EP_STVK_VOLUME;
}

static int methods_of(const ep_scene *scene, ep_stress_variant v) {
  if (v == EP_VARIANT_LB) return EP_METHOD_LB;
  if (v == EP_VARIANT_GREEN) return EP_METHOD_GREEN;
  return scene->methods;
}

static bool variant_applies(const ep_session *base, ep_stress_variant v) {
  const ep_scene *scene = &base->scene;
  const bool examples = base->shapes.examples > 0;
  switch (v) {
  case EP_VARIANT_SCENE:
    return true;
  case EP_VARIANT_STVK:
  case EP_VARIANT_STVK_VOLUME:
  case EP_VARIANT_NEOHOOKEAN:
  case EP_VARIANT_COROTATIONAL: {
    const ep_material m = (ep_material)(v - EP_VARIANT_STVK + EP_STVK);
    return m != scene->model && (ep_is_cubature(scene->evaluator) || is_stvk(m));
  }
  case EP_VARIANT_CUBATURE:
    return !ep_is_cubature(scene->evaluator);
  case EP_VARIANT_CUBIC:
    return ep_is_cubature(scene->evaluator) && is_stvk(scene->model);
  case EP_VARIANT_LB:
    return examples && scene->methods != EP_METHOD_LB;
  case EP_VARIANT_GREEN:
    return examples && scene->methods != EP_METHOD_GREEN;
  case EP_VARIANT_FREE:
    return scene->nfixed > 0;
  default:
    return false;
  }
}

static bool axis_applies(const ep_session *base, ep_stress_variant v, ep_stress_axis axis) {
  const bool examples = base->shapes.examples > 0;
  if (axis == EP_STRESS_LOAD) return base->scene.nloads > 0;
  if (axis == EP_STRESS_ALPHA)
    return examples && (methods_of(&base->scene, v) & EP_METHOD_GREEN) != 0;
  if (axis == EP_STRESS_STRENGTH)
    return examples && (methods_of(&base->scene, v) & EP_METHOD_LB) != 0;
  return true;
}

typedef struct list {
  int count;
  ep_stress_case *item; // NULL while counting
} list;

static void add(list *l, ep_stress_case c) {
  if (l->item) l->item[l->count] = c;
  l->count++;
}

// In the scene itself every stiffness meets every time step: the map of the safe region.
static void add_axis(list *l, ep_stress_variant v, ep_stress_axis axis, bool quick) {
  const size_t count = values[axis].count;
  const bool grid = v == EP_VARIANT_SCENE && axis == EP_STRESS_STIFFNESS && !quick;
  for (size_t i = 0; i < count; i++) {
    if (quick && axis != EP_STRESS_START && i > 0 && i + 1 < count) continue;
    ep_stress_case c = {.variant = v, .axis = axis, .value = values[axis].value[i]};
    if (!grid) add(l, c);
    for (size_t j = 0; grid && j < sizeof steps / sizeof *steps; j++) {
      c.second = steps[j];
      add(l, c);
    }
  }
}

static void fill(const ep_session *base, bool quick, list *l) {
  l->count = 0;
  for (int v = 0; v < (quick ? 1 : EP_VARIANTS); v++)
    for (int axis = 0; axis < EP_STRESS_AXES && variant_applies(base, (ep_stress_variant)v); axis++)
      if (axis_applies(base, (ep_stress_variant)v, (ep_stress_axis)axis))
        add_axis(l, (ep_stress_variant)v, (ep_stress_axis)axis, quick);
}

ep_status ep_stress_list(const ep_session *base, bool quick, int *count, ep_stress_case **out,
                         ep_error *err) {
  list l = {0};
  fill(base, quick, &l);
  l.item = calloc((size_t)l.count + 1, sizeof *l.item);
  if (!l.item) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d cases", l.count);
  fill(base, quick, &l);
  *count = l.count;
  *out = l.item;
  return EP_OK;
}

// ---- the scene of a case -----------------------------------------------------------------------

static void apply_variant(ep_stress_variant v, ep_scene *scene) {
  const bool in_floats =
      scene->evaluator == EP_EVALUATE_CUBATURE_FLOAT || scene->evaluator == EP_EVALUATE_CUBIC_FLOAT;
  switch (v) {
  case EP_VARIANT_STVK:
  case EP_VARIANT_STVK_VOLUME:
  case EP_VARIANT_NEOHOOKEAN:
  case EP_VARIANT_COROTATIONAL:
    scene->model = (ep_material)(v - EP_VARIANT_STVK + EP_STVK);
    break;
  case EP_VARIANT_CUBATURE:
    scene->evaluator = in_floats ? EP_EVALUATE_CUBATURE_FLOAT : EP_EVALUATE_CUBATURE;
    break;
  case EP_VARIANT_CUBIC:
    scene->evaluator = in_floats ? EP_EVALUATE_CUBIC_FLOAT : EP_EVALUATE_CUBIC;
    if (ep_scene_local(scene)) scene->relief = 0; // polynomials know no part of the object
    break;
  case EP_VARIANT_LB:
  case EP_VARIANT_GREEN:
    scene->methods = v == EP_VARIANT_LB ? EP_METHOD_LB : EP_METHOD_GREEN;
    scene->green.alpha = v == EP_VARIANT_LB ? 0 : 0.5;
    break;
  case EP_VARIANT_FREE:
    scene->nfixed = 0;
    break;
  default:
    break;
  }
}

void ep_stress_apply(const ep_stress_case *c, ep_scene *scene) {
  ep_elastic_change *change = &scene->change;
  apply_variant(c->variant, scene);
  switch (c->axis) {
  case EP_STRESS_STIFFNESS:
    change->young = c->value;
    if (c->second > 0) scene->dt = c->second;
    break;
  case EP_STRESS_POISSON:
    change->sets_poisson = true;
    change->poisson = c->value;
    break;
  case EP_STRESS_STIFF:
    *change = (ep_elastic_change){
        .young = c->value, .sets_poisson = true, .poisson = nearly_incompressible};
    break;
  case EP_STRESS_DENSITY:
    change->density = c->value;
    break;
  case EP_STRESS_DT:
    scene->dt = c->value;
    break;
  case EP_STRESS_LOAD:
    for (int i = 0; i < scene->nloads; i++)
      for (int k = 0; k < 3; k++) scene->load[i].vector[k] *= c->value;
    break;
  case EP_STRESS_ALPHA:
    scene->green.alpha = c->value;
    break;
  case EP_STRESS_STRENGTH:
    scene->strength = c->value;
    break;
  default: // start and impulse change the state, not the scene
    break;
  }
}
