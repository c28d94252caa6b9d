#include "app/scene/scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/scene_reader.h"
#include "base/escape.h"
#include "base/files.h"

enum { SCENE_BYTES_MAX = 1 << 20, NAME_MOST = 200 };

static ep_status read_object(const ep_scene_reader *r, const raw_object *raw, ep_scene *out) {
  EP_TRY(ep_read_file(r, "object.mesh", raw->mesh, &out->mesh));
  out->model = EP_STVK_VOLUME;
  const raw_material *m = raw->material;
  if (!m) return EP_OK;
  if (m->model) out->model = (ep_material)*m->model;
  const int given = (m->density != NULL) + (m->young != NULL) + (m->poisson != NULL);
  if (given == 0) return EP_OK;
  if (given < 3)
    return ep_read_refuse(r, "object.material",
                          "give all of density, young, poisson, or none of them "
                          "(then the mesh file's own are used)");
  out->has_material = true;
  EP_TRY(ep_read_number(r, "object.material.density", m->density, 0, 1e-9, 1e9,
                        &out->material.density));
  EP_TRY(ep_read_number(r, "object.material.young", m->young, 0, 1e-9, 1e15, &out->material.young));
  EP_TRY(ep_read_number(r, "object.material.poisson", m->poisson, 0, 0, 0.4999,
                        &out->material.poisson));
  return EP_OK;
}

static ep_status read_fixed(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out) {
  if (!raw->fixed_count) return EP_OK;
  out->fixed = calloc(raw->fixed_count, sizeof *out->fixed);
  if (!out->fixed) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->fixed_count; i++) {
    char key[64];
    snprintf(key, sizeof key, "fixed.%u", i);
    out->nfixed++;
    EP_TRY(ep_read_selection(r, key, &raw->fixed[i], &out->fixed[i]));
  }
  return EP_OK;
}

static ep_status read_reduction(const ep_scene_reader *r, const raw_reduction *given,
                                ep_scene *out) {
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
      {"guards", raw->guards, 256, 0, 4096, &out->guards},
      {"training_poses", raw->training_poses, 200, 10, 10000, &out->training_poses},
  };
  for (size_t i = 0; i < sizeof wholes / sizeof *wholes; i++) {
    char key[64];
    snprintf(key, sizeof key, "reduction.%s", wholes[i].key);
    EP_TRY(ep_read_whole(r, key, wholes[i].value, wholes[i].fallback, wholes[i].low, wholes[i].high,
                         wholes[i].out));
  }
  for (int i = 0; i < out->nfamilies; i++)
    if (!out->family[i].eigenfunctions) out->family[i].eigenfunctions = out->eigenfunctions;
  for (int i = 0; i < out->nregions; i++)
    if (!out->region[i].eigenfunctions) out->region[i].eigenfunctions = out->eigenfunctions;
  EP_TRY(ep_read_number(r, "reduction.amplitude", raw->amplitude, 0.2, 1e-4, 2, &out->amplitude));
  out->evaluator = raw->evaluator ? (ep_evaluator)*raw->evaluator : EP_EVALUATE_CUBATURE;
  if (out->evaluator == EP_EVALUATE_CUBIC && out->model != EP_STVK && out->model != EP_STVK_VOLUME)
    return ep_read_refuse(
        r, "reduction.evaluator",
        "cubic polynomials are exact for stvk and stvk-volume only, not for the material "
        "model %s; use cubature",
        ep_material_name(out->model));
  const int examples = ep_scene_examples(out);
  if (examples > out->modes)
    return ep_read_refuse(r, "reduction.modes", "%d modes cannot hold %d examples; use at least %d",
                          out->modes, examples, examples);
  return EP_OK;
}

static ep_status read_simulation(const ep_scene_reader *r, const raw_simulation *given,
                                 ep_scene *out) {
  const raw_simulation none = {0}, *raw = given ? given : &none;
  const raw_damping undamped = {0}, *damping = raw->damping ? raw->damping : &undamped;
  out->integrator = raw->integrator ? (ep_integrator)*raw->integrator : EP_IMPLICIT_EULER;
  if (raw->precision && (ep_precision)*raw->precision == EP_FLOAT)
    out->evaluator =
        ep_is_cubature(out->evaluator) ? EP_EVALUATE_CUBATURE_FLOAT : EP_EVALUATE_CUBIC_FLOAT;
  EP_TRY(ep_read_number(r, "simulation.dt", raw->dt, 1.0 / 60, 1e-6, 1, &out->dt));
  EP_TRY(ep_read_whole(r, "simulation.steps", raw->steps, 120, 1, 1000000, &out->steps));
  // Damping by mass is a drag against the still world: free objects fly undamped unless told.
  EP_TRY(ep_read_number(r, "simulation.damping.mass", damping->mass, out->nfixed ? 0.1 : 0, 0, 1e6,
                        &out->damping_mass));
  return ep_read_number(r, "simulation.damping.stiffness", damping->stiffness, 0.01, 0, 1e3,
                        &out->damping_stiffness);
}

ep_status ep_read_green(const ep_scene_reader *r, const raw_examples *raw, ep_green *out) {
  const raw_constraints none = {0};
  const raw_constraints *weak = raw && raw->constraints ? raw->constraints : &none;
  EP_TRY(ep_read_number(r, "examples.alpha", raw ? raw->alpha : NULL, 0.5, 0, 1, &out->alpha));
  EP_TRY(ep_read_number(r, "examples.constraints.sum_to_one", weak->sum_to_one, 0, 0, 1e6,
                        &out->sum_to_one));
  return ep_read_number(r, "examples.constraints.non_negative", weak->non_negative, 0, 0, 1e6,
                        &out->non_negative);
}

const char *ep_path_name(int methods) {
  static const char *const names[EP_PATHS + 1] = {"none", "lb", "green", "both"};
  return names[methods & (EP_METHOD_LB | EP_METHOD_GREEN)];
}

// A scene may hold the keys of both paths, so that --set examples.path can switch between them.
static ep_status read_path(const ep_scene_reader *r, const raw_examples *raw, ep_scene *out) {
  out->methods = raw->path ? *raw->path : EP_METHOD_LB;
  return out->methods & EP_METHOD_GREEN ? ep_read_green(r, raw, &out->green) : EP_OK;
}

// What examples of a region cannot do: both would act on the whole object.
static ep_status check_local(const ep_scene_reader *r, const ep_scene *scene) {
  if (scene->force == EP_EXAMPLE_LINEAR)
    return ep_read_refuse(r, "examples.force",
                          "linear pulls the whole object; examples with a region need energy");
  if (scene->relief > 0 && !ep_is_cubature(scene->evaluator))
    return ep_read_refuse(r, "examples.relief",
                          "exact polynomials cannot leave out a part of the object; with examples "
                          "of a region use reduction.evaluator: cubature, or relief: 0");
  return EP_OK;
}

static ep_status read_examples(const ep_scene_reader *r, const raw_examples *given, ep_scene *out) {
  const raw_examples none = {0}, *raw = given ? given : &none;
  EP_TRY(ep_read_number(r, "examples.strength", raw->strength, 1, 0, 1e4, &out->strength));
  EP_TRY(ep_read_number(r, "examples.relief", raw->relief, 0, 0, 1, &out->relief));
  out->force = raw->force ? (ep_example_force)*raw->force : EP_EXAMPLE_ENERGY;
  out->solver = raw->solver ? (ep_solver)*raw->solver : EP_SOLVER_NLOPT;
  EP_TRY(read_path(r, raw, out));
  if (ep_scene_local(out) && (out->methods & EP_METHOD_LB)) EP_TRY(check_local(r, out));
  return ep_read_algorithm(r, "examples.algorithm", raw->algorithm ? raw->algorithm : "LD_LBFGS",
                           out->algorithm);
}

static ep_status read_output(const ep_scene_reader *r, const raw_output *raw, ep_scene *out) {
  EP_TRY(ep_read_whole(r, "output.every", raw ? raw->every : NULL, 2, 1, 1000000, &out->every));
  out->formats = EP_FORMAT_VTU | EP_FORMAT_GLB | EP_FORMAT_PNG;
  for (unsigned i = 0; raw && i < raw->moments_count; i++)
    EP_TRY(ep_read_number(r, "output.moments", &raw->moments[i], 0, 0, out->dt * (out->steps + 0.5),
                          &out->moment[out->nmoments++]));
  if (!raw || (!raw->formats && !ep_read_given(r, "output.formats"))) return EP_OK;
  out->formats = 0;
  for (unsigned i = 0; i < raw->formats_count; i++) out->formats |= (unsigned)raw->formats[i];
  return EP_OK;
}

// Results go to out/NAME: one folder, and not out or what out lies in.
static ep_status check_name(const ep_scene_reader *r, const char *name) {
  if (strlen(name) > NAME_MOST)
    return ep_read_refuse(r, "name", "%zu bytes are too long for a name; use at most %d",
                          strlen(name), NAME_MOST);
  if (strcmp(name, ".") == 0 || strcmp(name, "..") == 0)
    return ep_read_refuse(r, "name", "'%s' names no folder of its own in out/; give another", name);
  for (const char *p = name; *p; p++)
    if (*p == '/' || (unsigned char)*p < ' ' || *p == 0x7f)
      return ep_read_refuse(r, "name", "a name must not contain '/' or control characters");
  if (ep_text_is_utf8(name)) return EP_OK;
  return ep_read_refuse(r, "name",
                        "the file's name, which is the scene's, is not UTF-8: rename the file or "
                        "give `name`");
}

static ep_status convert(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out) {
  if (raw->schema != 1)
    return ep_read_refuse(r, "schema", "%g is not a schema this version reads; it reads schema: 1",
                          raw->schema);
  char stem[EP_PATH_MAX];
  EP_TRY(ep_path_stem(r->name, stem, r->err));
  EP_TRY(ep_read_text(r, r->name, &out->path));
  EP_TRY(ep_read_text(r, raw->name ? raw->name : stem, &out->name));
  EP_TRY(check_name(r, out->name));
  int seed = 0;
  EP_TRY(ep_read_whole(r, "seed", raw->seed, 1, 0, 2147483647, &seed));
  out->seed = (uint64_t)seed;
  EP_TRY(read_object(r, &raw->object, out));
  EP_TRY(read_fixed(r, raw, out));
  EP_TRY(ep_read_start(r, raw, out));
  EP_TRY(ep_read_regions(r, raw, out));
  EP_TRY(ep_read_families(r, raw, out));
  EP_TRY(read_reduction(r, raw->reduction, out));
  EP_TRY(read_simulation(r, raw->simulation, out));
  EP_TRY(ep_read_loads(r, raw, out));
  EP_TRY(ep_read_contact(r, raw, out));
  EP_TRY(read_examples(r, raw->examples, out));
  EP_TRY(read_output(r, raw->output, out));
  return ep_read_sweep(r, raw, out);
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
  const ep_scene_reader r = {
      .loaded = &loaded, .name = path, .folder = folder, .nsets = nsets, .sets = sets, .err = err};
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
    for (int j = 0; j < family->fields; j++) {
      free(family->field[j].object);
      free(family->field[j].rest);
      free(family->field[j].poses);
    }
    free(family->field);
  }
  for (int i = 0; i < scene->nregions; i++) {
    free(scene->region[i].name);
    free(scene->region[i].where.path);
  }
  free(scene->region);
  for (int i = 0; i < scene->ndrags; i++) {
    free(scene->drag[i].where.path);
    free(scene->drag[i].path.key);
  }
  free(scene->drag);
  for (int i = 0; i < scene->npressures; i++) free(scene->pressure[i].where.path);
  free(scene->pressure);
  for (int i = 0; i < scene->nobstacles; i++) free(scene->obstacle[i].motion.key);
  free(scene->obstacle);
  free(scene->fixed);
  free(scene->load);
  free(scene->family);
  free(scene->path);
  free(scene->name);
  free(scene->mesh);
  memset(scene, 0, sizeof *scene);
}

bool ep_scene_local(const ep_scene *scene) {
  for (int i = 0; i < scene->nfamilies; i++)
    if (scene->family[i].region >= 0) return true;
  return false;
}

int ep_scene_examples(const ep_scene *scene) {
  int count = 0;
  for (int i = 0; i < scene->nfamilies; i++) count += scene->family[i].poses;
  return count;
}
