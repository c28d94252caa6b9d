#include "app/scene.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene_load.h"
#include "base/files.h"

enum { SCENE_BYTES_MAX = 1 << 20 };

// What the conversion of one scene needs everywhere.
typedef struct reader {
  ep_scene_text *loaded;
  const char *name, *folder;
  bool overridden; // with --set the places of the file no longer tell
  ep_error *err;
} reader;

// A complaint about the value at a dotted key.
static ep_status bad(const reader *r, const char *key, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static ep_status bad(const reader *r, const char *key, const char *format, ...) {
  char text[512];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  int line, column;
  ep_yaml_locate(&r->loaded->yaml, key, &line, &column);
  return ep_fail(r->err, EP_ERR_SCENE, "%s:%d:%d: %s: %s%s", r->name, line, column, key, text,
                 r->overridden ? " (with --set)" : "");
}

static ep_status number(const reader *r, const char *key, const double *given, double fallback,
                        double low, double high, double *out) {
  *out = given ? *given : fallback;
  if (!isfinite(*out) || *out < low || *out > high)
    return bad(r, key, "%g is out of range; use %g to %g", *out, low, high);
  return EP_OK;
}

static ep_status whole(const reader *r, const char *key, const double *given, int fallback, int low,
                       int high, int *out) {
  double value;
  EP_TRY(number(r, key, given, fallback, low, high, &value));
  if (value != floor(value)) return bad(r, key, "%g is not a whole number", value);
  *out = (int)value;
  return EP_OK;
}

static ep_status vector(const reader *r, const char *key, const double *given, double *out) {
  for (int i = 0; i < 3; i++) {
    if (!isfinite(given[i]) || fabs(given[i]) > 1e12)
      return bad(r, key, "component %d is %g; use finite numbers", i, given[i]);
    out[i] = given[i];
  }
  return EP_OK;
}

static ep_status copy_text(const reader *r, const char *text, char **out) {
  *out = strdup(text);
  return *out ? EP_OK : ep_fail(r->err, EP_ERR_MEMORY, "no memory for the scene");
}

// Resolve a path relative to the scene and see that the file is there.
static ep_status file(const reader *r, const char *key, const char *path, char **out) {
  char joined[EP_PATH_MAX];
  EP_TRY(ep_path_join(r->folder, path, joined, r->err));
  if (!ep_path_exists(joined)) return bad(r, key, "there is no file %s", joined);
  return copy_text(r, joined, out);
}

static ep_status selection(const reader *r, const char *key, const raw_box *box,
                           const raw_plane *plane, const char *path, ep_selection *out) {
  snprintf(out->key, sizeof out->key, "%s", key);
  if ((box != NULL) + (plane != NULL) + (path != NULL) != 1)
    return bad(r, key, "give one of box, plane, file");
  if (path) {
    out->kind = EP_SELECT_FILE;
    return file(r, key, path, &out->path);
  }
  out->kind = box ? EP_SELECT_BOX : EP_SELECT_PLANE;
  EP_TRY(vector(r, key, box ? box->low : plane->point, out->a));
  EP_TRY(vector(r, key, box ? box->high : plane->normal, out->b));
  for (int i = 0; box && i < 3; i++)
    if (out->a[i] > out->b[i])
      return bad(r, key, "box: low %g lies above high %g on axis %d", out->a[i], out->b[i], i);
  if (plane && out->b[0] == 0 && out->b[1] == 0 && out->b[2] == 0)
    return bad(r, key, "plane: the normal is zero");
  return EP_OK;
}

static ep_status no_memory(const reader *r) {
  return ep_fail(r->err, EP_ERR_MEMORY, "no memory for the scene");
}

static ep_status read_object(const reader *r, const raw_object *raw, ep_scene *out) {
  EP_TRY(file(r, "object.mesh", raw->mesh, &out->mesh));
  out->model = EP_STVK_VOLUME;
  const raw_material *m = raw->material;
  if (!m) return EP_OK;
  if (m->model) out->model = (ep_material)*m->model;
  const int given = (m->density != NULL) + (m->young != NULL) + (m->poisson != NULL);
  if (given == 0) return EP_OK;
  if (given < 3)
    return bad(r, "object.material",
               "give all of density, young, poisson, or none of them "
               "(then the mesh file's own are used)");
  out->has_material = true;
  EP_TRY(number(r, "object.material.density", m->density, 0, 1e-9, 1e9, &out->material.density));
  EP_TRY(number(r, "object.material.young", m->young, 0, 1e-9, 1e15, &out->material.young));
  EP_TRY(number(r, "object.material.poisson", m->poisson, 0, 0, 0.4999, &out->material.poisson));
  return EP_OK;
}

static ep_status read_fixed(const reader *r, const raw_scene *raw, ep_scene *out) {
  if (!raw->fixed_count) return EP_OK;
  out->fixed = calloc(raw->fixed_count, sizeof *out->fixed);
  if (!out->fixed) return no_memory(r);
  for (unsigned i = 0; i < raw->fixed_count; i++) {
    char key[64];
    snprintf(key, sizeof key, "fixed.%u", i);
    out->nfixed++;
    EP_TRY(selection(r, key, raw->fixed[i].box, raw->fixed[i].plane, raw->fixed[i].file,
                     &out->fixed[i]));
  }
  return EP_OK;
}

// A place of a landmark on one shape: a vertex, a point, or nothing.
static ep_status mark(const reader *r, const char *key, const double *vertex, const double *point,
                      ep_mark *out) {
  if (vertex && point) return bad(r, key, "give a vertex or a point, not both");
  out->given = vertex || point;
  if (point) return vector(r, key, point, out->at);
  return vertex ? whole(r, key, vertex, 0, 1, 2147483647, &out->vertex) : EP_OK;
}

static ep_status read_landmark(const reader *r, const char *key, const raw_landmark *raw,
                               const ep_family *family, ep_scene_landmark *out) {
  char part[112];
  EP_TRY(mark(r, key, raw->object, raw->object_at, &out->object));
  EP_TRY(mark(r, key, raw->rest, raw->rest_at, &out->rest));
  if (out->rest.given && !family->rest)
    return bad(r, key, "the family has no rest shape of its own; give object and poses");
  if (out->object.given + out->rest.given + (raw->poses_count > 0) < 2)
    return bad(r, key, "name the place on two shapes: object, rest (or object_at, rest_at), poses");
  if (raw->poses_count && (int)raw->poses_count != family->poses)
    return bad(r, key, "poses lists %u vertices, but the family has %d poses; give one for each",
               raw->poses_count, family->poses);
  out->pose = calloc(raw->poses_count + 1, sizeof *out->pose);
  if (!out->pose) return no_memory(r);
  out->poses = (int)raw->poses_count;
  for (unsigned i = 0; i < raw->poses_count; i++) {
    snprintf(part, sizeof part, "%.90s.poses.%u", key, i);
    EP_TRY(mark(r, part, &raw->poses[i], NULL, &out->pose[i]));
  }
  return EP_OK;
}

static ep_status read_map(const reader *r, unsigned index, const raw_map *raw, ep_family *out) {
  char key[64];
  out->accept = raw->accept && *raw->accept;
  out->reflections = raw->reflections && *raw->reflections;
  if (raw->frame) out->frame = (ep_map_frame)*raw->frame;
  snprintf(key, sizeof key, "families.%u.map.eigenfunctions", index);
  if (raw->eigenfunctions)
    EP_TRY(whole(r, key, raw->eigenfunctions, 0, 1, 200, &out->eigenfunctions));
  out->landmark = calloc(raw->landmarks_count + 1, sizeof *out->landmark);
  if (!out->landmark) return no_memory(r);
  for (unsigned i = 0; i < raw->landmarks_count; i++) {
    snprintf(key, sizeof key, "families.%u.map.landmarks.%u", index, i);
    out->landmarks++;
    EP_TRY(read_landmark(r, key, &raw->landmarks[i], out, &out->landmark[i]));
  }
  snprintf(key, sizeof key, "families.%u.map.regions", index);
  return raw->regions ? file(r, key, raw->regions, &out->regions) : EP_OK;
}

static ep_status read_family(const reader *r, unsigned index, const raw_family *raw,
                             ep_family *out) {
  char key[64], fallback[32];
  snprintf(fallback, sizeof fallback, "family%u", index);
  EP_TRY(copy_text(r, raw->name ? raw->name : fallback, &out->name));
  snprintf(key, sizeof key, "families.%u.name", index);
  if (strlen(out->name) > 24 || strpbrk(out->name, "/ \t\n"))
    return bad(r, key, "use at most 24 characters, without '/' and blanks");
  snprintf(key, sizeof key, "families.%u.rest", index);
  if (raw->rest) EP_TRY(file(r, key, raw->rest, &out->rest));
  out->pose = calloc(raw->poses_count, sizeof *out->pose);
  if (!out->pose) return no_memory(r);
  for (unsigned i = 0; i < raw->poses_count; i++) {
    snprintf(key, sizeof key, "families.%u.poses.%u", index, i);
    out->poses++;
    EP_TRY(file(r, key, raw->poses[i], &out->pose[i]));
  }
  if (raw->region) {
    snprintf(key, sizeof key, "families.%u.region", index);
    out->has_region = true;
    EP_TRY(
        selection(r, key, raw->region->box, raw->region->plane, raw->region->file, &out->region));
  }
  return raw->map ? read_map(r, index, raw->map, out) : EP_OK;
}

static ep_status read_families(const reader *r, const raw_scene *raw, ep_scene *out) {
  if (!raw->families_count) return EP_OK;
  out->family = calloc(raw->families_count, sizeof *out->family);
  if (!out->family) return no_memory(r);
  for (unsigned i = 0; i < raw->families_count; i++) {
    out->nfamilies++;
    EP_TRY(read_family(r, i, &raw->families[i], &out->family[i]));
    for (unsigned j = 0; j < i; j++)
      if (strcmp(out->family[i].name, out->family[j].name) == 0) {
        char key[64];
        snprintf(key, sizeof key, "families.%u.name", i);
        return bad(r, key, "another family is called '%s' too", out->family[i].name);
      }
  }
  return EP_OK;
}

static ep_status read_reduction(const reader *r, const raw_reduction *given, ep_scene *out) {
  const raw_reduction none = {0}, *raw = given ? given : &none;
  const struct {
    const char *key;
    const double *value;
    int fallback, low, high, *out;
  } wholes[] = {
      {"eigenfunctions", raw->eigenfunctions, 10, 1, 200, &out->eigenfunctions},
      {"modes", raw->modes, 30, 1, 200, &out->modes},
      {"linear_modes", raw->linear_modes, 15, 1, 100, &out->linear_modes},
      {"path_samples", raw->path_samples, 4, 0, 32, &out->path_samples},
      {"elements", raw->elements, 60, 1, 10000, &out->elements},
      {"training_poses", raw->training_poses, 200, 10, 10000, &out->training_poses},
  };
  for (size_t i = 0; i < sizeof wholes / sizeof *wholes; i++) {
    char key[64];
    snprintf(key, sizeof key, "reduction.%s", wholes[i].key);
    EP_TRY(whole(r, key, wholes[i].value, wholes[i].fallback, wholes[i].low, wholes[i].high,
                 wholes[i].out));
  }
  for (int i = 0; i < out->nfamilies; i++)
    if (!out->family[i].eigenfunctions) out->family[i].eigenfunctions = out->eigenfunctions;
  EP_TRY(number(r, "reduction.amplitude", raw->amplitude, 0.2, 1e-4, 2, &out->amplitude));
  out->evaluator = raw->evaluator ? (ep_evaluator)*raw->evaluator : EP_EVALUATE_CUBATURE;
  if (out->evaluator == EP_EVALUATE_CUBIC && out->model != EP_STVK && out->model != EP_STVK_VOLUME)
    return bad(r, "reduction.evaluator",
               "cubic polynomials are exact for stvk and stvk-volume only, not for the material "
               "model %s; use cubature",
               ep_material_name(out->model));
  const int examples = ep_scene_examples(out);
  if (examples > out->modes)
    return bad(r, "reduction.modes", "%d modes cannot hold %d examples; use at least %d",
               out->modes, examples, examples);
  return EP_OK;
}

static ep_status read_simulation(const reader *r, const raw_simulation *given, ep_scene *out) {
  const raw_simulation none = {0}, *raw = given ? given : &none;
  const raw_damping undamped = {0}, *damping = raw->damping ? raw->damping : &undamped;
  out->integrator = raw->integrator ? (ep_integrator)*raw->integrator : EP_IMPLICIT_EULER;
  if (raw->precision && (ep_precision)*raw->precision == EP_FLOAT) {
    if (out->evaluator != EP_EVALUATE_CUBIC)
      return bad(r, "simulation.precision",
                 "float is for the cubic polynomials; give reduction.evaluator: cubic");
    out->evaluator = EP_EVALUATE_CUBIC_FLOAT;
  }
  EP_TRY(number(r, "simulation.dt", raw->dt, 1.0 / 60, 1e-6, 1, &out->dt));
  EP_TRY(whole(r, "simulation.steps", raw->steps, 120, 1, 1000000, &out->steps));
  EP_TRY(number(r, "simulation.damping.mass", damping->mass, 0.1, 0, 1e6, &out->damping_mass));
  return number(r, "simulation.damping.stiffness", damping->stiffness, 0.01, 0, 1e3,
                &out->damping_stiffness);
}

static ep_status read_push(const reader *r, const char *key, const raw_push *raw, ep_load *out) {
  char part[96];
  EP_TRY(selection(r, key, raw->box, raw->plane, raw->file, &out->where));
  snprintf(part, sizeof part, "%s.force", key);
  EP_TRY(vector(r, part, raw->force, out->vector));
  snprintf(part, sizeof part, "%s.from", key);
  EP_TRY(number(r, part, raw->from, 0, 0, 1e9, &out->from));
  snprintf(part, sizeof part, "%s.until", key);
  EP_TRY(number(r, part, raw->until, 1e9, 0, 1e9, &out->until));
  if (out->until <= out->from)
    return bad(r, part, "the push ends at %g s, before it begins at %g s", out->until, out->from);
  snprintf(part, sizeof part, "%s.ramp", key);
  EP_TRY(number(r, part, raw->ramp, 0, 0, 1e9, &out->ramp));
  if (2 * out->ramp > out->until - out->from)
    return bad(r, part, "rise and fall of %g s each do not fit between %g and %g s", out->ramp,
               out->from, out->until);
  return EP_OK;
}

static ep_status read_loads(const reader *r, const raw_scene *raw, ep_scene *out) {
  if (!raw->loads_count) return EP_OK;
  out->load = calloc(raw->loads_count, sizeof *out->load);
  if (!out->load) return no_memory(r);
  for (unsigned i = 0; i < raw->loads_count; i++) {
    const raw_load *given = &raw->loads[i];
    ep_load *load = &out->load[i];
    char key[64];
    snprintf(key, sizeof key, "loads.%u", i);
    out->nloads++;
    if ((given->gravity != NULL) == (given->push != NULL))
      return bad(r, key, "give one of gravity, push");
    load->gravity = given->gravity != NULL;
    if (load->gravity) {
      EP_TRY(vector(r, key, given->gravity, load->vector));
    } else {
      snprintf(key, sizeof key, "loads.%u.push", i);
      EP_TRY(read_push(r, key, given->push, load));
    }
  }
  return EP_OK;
}

// A scene may hold the keys of both paths, so that --set examples.path can switch between them.
static ep_status read_path(const reader *r, const raw_examples *raw, ep_scene *out) {
  out->methods = raw->path ? *raw->path : EP_METHOD_LB;
  const raw_constraints none = {0}, *weak = raw->constraints ? raw->constraints : &none;
  const bool green = out->methods & EP_METHOD_GREEN;
  for (int i = 0; i < out->nfamilies; i++)
    if (out->family[i].has_region && out->methods != EP_METHOD_GREEN)
      return bad(r, out->family[i].region.key,
                 "regions of examples need examples.path: green in this version");
  if (!green) return EP_OK;
  EP_TRY(number(r, "examples.alpha", raw->alpha, 0.5, 0, 1, &out->green.alpha));
  EP_TRY(number(r, "examples.constraints.sum_to_one", weak->sum_to_one, 0, 0, 1e6,
                &out->green.sum_to_one));
  return number(r, "examples.constraints.non_negative", weak->non_negative, 0, 0, 1e6,
                &out->green.non_negative);
}

// A local gradient-based algorithm of NLopt by name; whether NLopt has it shows when it is made.
static ep_status algorithm(const reader *r, const char *key, const char *name, char out[48]) {
  if (strncmp(name, "LD_", 3) != 0 || strlen(name) > 47)
    return bad(r, key, "'%.60s' is no local algorithm with gradients; use one as LD_LBFGS", name);
  snprintf(out, 48, "%s", name);
  return EP_OK;
}

static ep_status read_rest(const reader *r, const raw_scene *raw, ep_scene *out) {
  const raw_examples no_examples = {0};
  const raw_examples *examples = raw->examples ? raw->examples : &no_examples;
  EP_TRY(number(r, "examples.strength", examples->strength, 1, 0, 1e4, &out->strength));
  EP_TRY(number(r, "examples.relief", examples->relief, 0, 0, 1, &out->relief));
  out->force = examples->force ? (ep_example_force)*examples->force : EP_EXAMPLE_ENERGY;
  out->solver = examples->solver ? (ep_solver)*examples->solver : EP_SOLVER_NLOPT;
  EP_TRY(read_path(r, examples, out));
  EP_TRY(algorithm(r, "examples.algorithm", examples->algorithm ? examples->algorithm : "LD_LBFGS",
                   out->algorithm));
  const raw_output *output = raw->output;
  EP_TRY(whole(r, "output.every", output ? output->every : NULL, 2, 1, 1000000, &out->every));
  out->formats = EP_FORMAT_VTU | EP_FORMAT_GLB | EP_FORMAT_PNG;
  if (output && output->formats) {
    out->formats = 0;
    for (unsigned i = 0; i < output->formats_count; i++)
      out->formats |= (unsigned)output->formats[i];
  }
  return EP_OK;
}

const char *ep_method_name(ep_method method) {
  static const char *const names[EP_METHODS] = {"cubature", "cubic", "all", "full"};
  return (int)method >= 0 && method < EP_METHODS ? names[method] : NULL;
}

// Whole numbers of a list, ascending, each once.
static ep_status wholes(const reader *r, const char *key, unsigned given, const double *value,
                        int low, int high, int *count, int *out) {
  *count = 0;
  for (unsigned i = 0; i < given; i++) {
    int next = 0, at = 0;
    EP_TRY(whole(r, key, &value[i], 0, low, high, &next));
    while (at < *count && out[at] < next) at++;
    if (at < *count && out[at] == next) continue;
    memmove(out + at + 1, out + at, (size_t)(*count - at) * sizeof *out);
    out[at] = next;
    ++*count;
  }
  return EP_OK;
}

// Time steps, descending; each must go into the longest, so that all runs meet at the same times.
static ep_status time_steps(const reader *r, const raw_compare *raw, const ep_scene *scene,
                            ep_sweep *out) {
  const double *list = raw->dt_count ? raw->dt : &scene->dt;
  out->ndt = 0;
  for (unsigned i = 0; i < (raw->dt_count ? raw->dt_count : 1); i++) {
    double next = 0;
    int at = 0;
    EP_TRY(number(r, "compare.dt", &list[i], 0, 1e-6, 1, &next));
    while (at < out->ndt && out->dt[at] > next) at++;
    if (at < out->ndt && out->dt[at] == next) continue;
    memmove(out->dt + at + 1, out->dt + at, (size_t)(out->ndt - at) * sizeof *out->dt);
    out->dt[at] = next;
    out->ndt++;
  }
  for (int i = 1; i < out->ndt; i++) {
    const double ratio = out->dt[0] / out->dt[i];
    if (fabs(ratio - round(ratio)) > 1e-6)
      return bad(r, "compare.dt", "%g s does not go into %g s a whole number of times", out->dt[i],
                 out->dt[0]);
  }
  return EP_OK;
}

static ep_status budget(const reader *r, const char *text, ep_sweep *out) {
  while (text && *text) {
    char *end;
    const double value = strtod(text, &end);
    while (*end == ' ') end++;
    const size_t length = strcspn(end, ", ");
    const bool sound = end != text && isfinite(value) && value > 0;
    if (sound && length == 2 && strncmp(end, "ms", 2) == 0)
      out->budget_seconds = 1e-3 * value;
    else if (sound && length == 2 && strncmp(end, "us", 2) == 0)
      out->budget_seconds = 1e-6 * value;
    else if (sound && length == 1 && *end == '%')
      out->budget_error = 1e-2 * value;
    else
      return bad(r, "compare.budget", "'%.40s': use a time or an error, as 2 ms, 500 us or 1 %%",
                 text);
    text = end + length + strspn(end + length, ", ");
  }
  return EP_OK;
}

static ep_status solvers(const reader *r, const raw_compare *raw, const ep_scene *scene,
                         ep_sweep *out) {
  out->nsolvers = 1;
  snprintf(out->solver[0], sizeof out->solver[0], "%s",
           scene->solver == EP_SOLVER_NEWTON ? "newton" : scene->algorithm);
  for (unsigned i = 0; i < raw->solvers_count; i++) {
    out->nsolvers = (int)i + 1;
    if (strcmp(raw->solvers[i], "newton") == 0)
      strcpy(out->solver[i], "newton");
    else
      EP_TRY(algorithm(r, "compare.solvers", raw->solvers[i], out->solver[i]));
  }
  return EP_OK;
}

// Defaults: r and s of the scene and about half and double of them, all methods, its own material.
static ep_status read_sweep(const reader *r, const raw_compare *given, ep_scene *out) {
  const raw_compare none = {0}, *raw = given ? given : &none;
  ep_sweep *sweep = &out->sweep;
  const int examples = ep_scene_examples(out), low = examples > 4 ? examples : 4;
  const double modes[3] = {fmax(low, out->modes / 2), out->modes, fmin(200, 2 * out->modes)};
  const double elements[3] = {fmax(1, out->elements / 2), out->elements, 2 * out->elements};
  EP_TRY(wholes(r, "compare.modes", raw->modes_count ? raw->modes_count : 3,
                raw->modes_count ? raw->modes : modes, examples > 1 ? examples : 1, 200,
                &sweep->nmodes, sweep->modes));
  EP_TRY(wholes(r, "compare.elements", raw->elements_count ? raw->elements_count : 3,
                raw->elements_count ? raw->elements : elements, 1, 20000, &sweep->nelements,
                sweep->elements));
  sweep->nmethods = raw->methods_count ? (int)raw->methods_count : EP_METHODS;
  for (int i = 0; i < sweep->nmethods; i++)
    sweep->method[i] = raw->methods_count ? (ep_method)raw->methods[i] : (ep_method)i;
  sweep->nprecisions = raw->precisions_count ? (int)raw->precisions_count : 2;
  for (int i = 0; i < sweep->nprecisions; i++)
    sweep->precision[i] = raw->precisions_count ? raw->precisions[i] : i;
  sweep->nmaterials = raw->materials_count ? (int)raw->materials_count : 1;
  for (int i = 0; i < sweep->nmaterials; i++)
    sweep->material[i] = raw->materials_count ? (ep_material)raw->materials[i] : out->model;
  sweep->reference = raw->reference ? (ep_method)*raw->reference : EP_METHOD_FULL;
  if (sweep->reference != EP_METHOD_FULL && sweep->reference != EP_METHOD_ALL)
    return bad(r, "compare.reference", "use full (the full space) or all (all elements)");
  EP_TRY(solvers(r, raw, out, sweep));
  EP_TRY(time_steps(r, raw, out, sweep));
  return budget(r, raw->budget, sweep);
}

static ep_status convert(const reader *r, const raw_scene *raw, ep_scene *out) {
  if (raw->schema != 1)
    return bad(r, "schema", "%g is not a schema this version reads; it reads schema: 1",
               raw->schema);
  char stem[EP_PATH_MAX];
  EP_TRY(ep_path_stem(r->name, stem, r->err));
  EP_TRY(copy_text(r, r->name, &out->path));
  EP_TRY(copy_text(r, raw->name ? raw->name : stem, &out->name));
  if (strpbrk(out->name, "/\n")) return bad(r, "name", "a name must not contain '/'");
  int seed = 0;
  EP_TRY(whole(r, "seed", raw->seed, 1, 0, 2147483647, &seed));
  out->seed = (uint64_t)seed;
  EP_TRY(read_object(r, &raw->object, out));
  EP_TRY(read_fixed(r, raw, out));
  EP_TRY(read_families(r, raw, out));
  EP_TRY(read_reduction(r, raw->reduction, out));
  EP_TRY(read_simulation(r, raw->simulation, out));
  EP_TRY(read_loads(r, raw, out));
  EP_TRY(read_rest(r, raw, out));
  return read_sweep(r, raw->compare, out);
}

ep_status ep_scene_parse(const char *path, const char *folder, const char *text, size_t size,
                         int nsets, const char *const *sets, ep_scene *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  if (size > SCENE_BYTES_MAX)
    return ep_fail(err, EP_ERR_SCENE,
                   "%s: %zu bytes are too many for a scene; name mesh files "
                   "in it instead of their content",
                   path, size);
  ep_scene_text loaded;
  EP_TRY(ep_scene_load(path, text, size, nsets, sets, &loaded, err));
  const reader r = {
      .loaded = &loaded, .name = path, .folder = folder, .overridden = nsets > 0, .err = err};
  const ep_status status = convert(&r, loaded.raw, out);
  ep_scene_unload(&loaded);
  if (status != EP_OK) ep_scene_free(out);
  return status;
}

ep_status ep_scene_read(const char *path, int nsets, const char *const *sets, ep_scene *out,
                        ep_error *err) {
  memset(out, 0, sizeof *out);
  char folder[EP_PATH_MAX], *text;
  size_t size;
  EP_TRY(ep_path_folder(path, folder, err));
  EP_TRY(ep_file_read(path, &text, &size, err));
  const ep_status status = ep_scene_parse(path, folder, text, size, nsets, sets, out, err);
  free(text);
  return status;
}

void ep_scene_free(ep_scene *scene) {
  for (int i = 0; i < scene->nfixed; i++) free(scene->fixed[i].path);
  for (int i = 0; i < scene->nloads; i++) free(scene->load[i].where.path);
  for (int i = 0; i < scene->nfamilies; i++) {
    ep_family *family = &scene->family[i];
    for (int j = 0; j < family->poses; j++) free(family->pose[j]);
    free(family->pose);
    free(family->name);
    free(family->rest);
    free(family->regions);
    for (int j = 0; j < family->landmarks; j++) free(family->landmark[j].pose);
    free(family->landmark);
    free(family->region.path);
  }
  free(scene->fixed);
  free(scene->load);
  free(scene->family);
  free(scene->path);
  free(scene->name);
  free(scene->mesh);
  memset(scene, 0, sizeof *scene);
}

int ep_scene_examples(const ep_scene *scene) {
  int count = 0;
  for (int i = 0; i < scene->nfamilies; i++) count += scene->family[i].poses;
  return count;
}
