// What `eigenpose compare` sweeps: the lists of a scene, their defaults and its budget.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/scene_reader.h"

const char *ep_method_name(ep_method method) {
  static const char *const names[EP_METHODS] = {"cubature", "cubic", "all", "full"};
  return (int)method >= 0 && method < EP_METHODS ? names[method] : NULL;
}

// Whole numbers of a list, ascending, each once.
static ep_status wholes(const ep_scene_reader *r, const char *key, unsigned given,
                        const double *value, int low, int high, int *count, int *out) {
  *count = 0;
  for (unsigned i = 0; i < given; i++) {
    int next = 0, at = 0;
    EP_TRY(ep_read_whole(r, key, &value[i], 0, low, high, &next));
    while (at < *count && out[at] < next) at++;
    if (at < *count && out[at] == next) continue;
    memmove(out + at + 1, out + at, (size_t)(*count - at) * sizeof *out);
    out[at] = next;
    ++*count;
  }
  return EP_OK;
}

// Time steps, descending; each must go into the longest, so that all runs meet at the same times.
static ep_status time_steps(const ep_scene_reader *r, const raw_compare *raw, const ep_scene *scene,
                            ep_sweep *out) {
  const double *list = raw->dt_count ? raw->dt : &scene->dt;
  out->ndt = 0;
  for (unsigned i = 0; i < (raw->dt_count ? raw->dt_count : 1); i++) {
    double next = 0;
    int at = 0;
    EP_TRY(ep_read_number(r, "compare.dt", &list[i], 0, 1e-6, 1, &next));
    while (at < out->ndt && out->dt[at] > next) at++;
    if (at < out->ndt && out->dt[at] == next) continue;
    memmove(out->dt + at + 1, out->dt + at, (size_t)(out->ndt - at) * sizeof *out->dt);
    out->dt[at] = next;
    out->ndt++;
  }
  for (int i = 1; i < out->ndt; i++) {
    const double ratio = out->dt[0] / out->dt[i];
    if (fabs(ratio - round(ratio)) > 1e-6)
      return ep_read_refuse(r, "compare.dt", "%g s does not go into %g s a whole number of times",
                            out->dt[i], out->dt[0]);
  }
  return EP_OK;
}

static ep_status budget(const ep_scene_reader *r, const char *text, ep_sweep *out) {
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
      return ep_read_refuse(r, "compare.budget",
                            "'%.40s': use a time or an error, as 2 ms, 500 us or 1 %%", text);
    text = end + length + strspn(end + length, ", ");
  }
  return EP_OK;
}

static ep_status solvers(const ep_scene_reader *r, const raw_compare *raw, const ep_scene *scene,
                         ep_sweep *out) {
  out->nsolvers = 1;
  snprintf(out->solver[0], sizeof out->solver[0], "%s",
           scene->solver == EP_SOLVER_NEWTON ? "newton" : scene->algorithm);
  for (unsigned i = 0; i < raw->solvers_count; i++) {
    out->nsolvers = (int)i + 1;
    if (strcmp(raw->solvers[i], "newton") == 0)
      strcpy(out->solver[i], "newton");
    else
      EP_TRY(ep_read_algorithm(r, "compare.solvers", raw->solvers[i], out->solver[i]));
  }
  return EP_OK;
}

static ep_status paths(const ep_scene_reader *r, const raw_compare *raw, const ep_scene *scene,
                       ep_sweep *out) {
  for (unsigned i = 0; i < (raw->paths_count ? raw->paths_count : 1); i++) {
    const int path = raw->paths_count ? raw->paths[i] : scene->methods;
    int at = 0;
    while (at < out->npaths && out->path[at] != path) at++;
    if (at < out->npaths) continue;
    if (ep_scene_local(scene) && (path & EP_METHOD_LB) && !(scene->methods & EP_METHOD_LB))
      return ep_read_refuse(r, "compare.paths",
                            "examples with a region are compared on the paths the scene runs; "
                            "give examples.path: %s",
                            scene->methods & EP_METHOD_GREEN ? "both" : "lb");
    out->path[out->npaths++] = path;
  }
  return EP_OK;
}

// Defaults: r and s of the scene and about half and double of them, all methods, its own material.
ep_status ep_read_sweep(const ep_scene_reader *r, const raw_scene *given, ep_scene *out) {
  const raw_compare none = {0}, *raw = given->compare ? given->compare : &none;
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
    return ep_read_refuse(r, "compare.reference",
                          "use full (the full space) or all (all elements)");
  EP_TRY(paths(r, raw, out, sweep));
  EP_TRY(ep_read_green(r, given->examples, &sweep->green));
  EP_TRY(solvers(r, raw, out, sweep));
  EP_TRY(time_steps(r, raw, out, sweep));
  return budget(r, raw->budget, sweep);
}
