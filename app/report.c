#include "app/report.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/escape.h"

json_t *ep_json_number(double value) {
  return isfinite(value) ? json_real(value) : json_null();
}

json_t *ep_json_text(const char *text) {
  if (ep_text_is_utf8(text)) return json_string(text);
  char *readable = ep_text_to_utf8(text);
  json_t *out = readable ? json_string(readable) : NULL;
  free(readable);
  return out;
}

json_t *ep_json_numbers(int count, const double *value) {
  json_t *list = json_array();
  for (int i = 0; list && i < count; i++) json_array_append_new(list, ep_json_number(value[i]));
  return list;
}

double ep_json_get_number(const json_t *object, const char *key) {
  const json_t *value = json_object_get(object, key);
  return json_is_number(value) ? json_number_value(value) : NAN;
}

static bool baked(const ep_stage *stage) {
  return stage->runs && ep_stage_is_baked(stage->kind);
}

json_t *ep_report_stages(const ep_plan *plan) {
  json_t *list = json_array();
  for (int i = 0; list && i < plan->count; i++) {
    const ep_stage *stage = &plan->stage[i];
    if (!baked(stage)) continue;
    json_array_append_new(list, json_pack("{s:o, s:f, s:b}", "name", ep_json_text(stage->name),
                                          "seconds", stage->seconds, "cached", (int)stage->cached));
  }
  return list;
}

bool ep_report_take_stages(ep_plan *plan, const json_t *stages) {
  size_t index;
  json_t *entry;
  if (!json_is_array(stages)) return false;
  json_array_foreach(stages, index, entry) {
    const char *name = json_string_value(json_object_get(entry, "name"));
    if (!name) return false;
    for (int i = 0; i < plan->count; i++) {
      if (strcmp(plan->stage[i].name, name) != 0) continue;
      plan->stage[i].seconds = json_number_value(json_object_get(entry, "seconds"));
      plan->stage[i].cached = json_is_true(json_object_get(entry, "cached"));
    }
  }
  return true;
}

json_t *ep_report_plan(const ep_scene *scene, const ep_shapes *shapes, const ep_plan *plan,
                       const bool *in_cache) {
  json_t *list = json_array();
  for (int i = 0; list && i < plan->count; i++) {
    const ep_stage *stage = &plan->stage[i];
    json_t *entry = json_pack("{s:o, s:b, s:o}", "name", ep_json_text(stage->name), "runs",
                              (int)stage->runs, "reason", ep_json_text(stage->reason));
    if (entry && baked(stage)) {
      json_object_set_new(entry, "key", json_string(stage->key.hex));
      json_object_set_new(entry, "cached", json_boolean(in_cache[i]));
    }
    json_array_append_new(list, entry);
  }
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  return json_pack("{s:s, s:i, s:i, s:i, s:i, s:i, s:i, s:i, s:o}", "scene", scene->name,
                   "vertices", mesh->nv, "tets", mesh->nt, "fixed", shapes->nfixed, "examples",
                   shapes->examples, "m", shapes->examples ? scene->eigenfunctions : 0, "r",
                   scene->modes, "s", scene->elements, "stages", list);
}

void ep_report_plan_text(const ep_scene *scene, const ep_shapes *shapes, const ep_plan *plan,
                         const bool *in_cache) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  printf("%s: %d vertices, %d tets, %d fixed vertices, %d example%s\n", scene->name, mesh->nv,
         mesh->nt, shapes->nfixed, shapes->examples, shapes->examples == 1 ? "" : "s");
  for (int i = 0; i < plan->count; i++) {
    const ep_stage *stage = &plan->stage[i];
    const char *state = !stage->runs ? "left out" : in_cache[i] ? "cached" : "runs";
    printf("  %-30s %-9s %s\n", stage->name, state, stage->reason);
  }
}

ep_status ep_report_print(json_t *root, ep_error *err) {
  if (!root) return ep_fail(err, EP_ERR_MEMORY, "no memory for the report");
  const bool good = json_dumpf(root, stdout, JSON_INDENT(2) | JSON_REAL_PRECISION(15)) == 0;
  json_decref(root);
  if (!good || putchar('\n') == EOF || fflush(stdout) != 0)
    return ep_fail(err, EP_ERR_IO, "cannot write to stdout: %s", strerror(errno));
  return EP_OK;
}

ep_status ep_report_write(const char *path, json_t *root, ep_error *err) {
  char *text = root ? json_dumps(root, JSON_INDENT(1) | JSON_REAL_PRECISION(17)) : NULL;
  json_decref(root);
  if (!text) return ep_fail(err, EP_ERR_MEMORY, "no memory for %s", path);
  const ep_status status = ep_file_write(path, text, strlen(text), err);
  free(text);
  return status;
}
