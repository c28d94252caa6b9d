#include "app/figures/figures.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/report.h"
#include "base/files.h"

typedef struct reader {
  const char *path; // of the list
  const char *root;
  ep_error *err;
} reader;

static ep_status bad(const reader *r, const char *where, const char *what) {
  return ep_fail(r->err, EP_ERR_FORMAT, "%s: %s: %s", r->path, where, what);
}

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the figures");
}

// A string of an object; NULL where it may be left out.
static ep_status text(const reader *r, const json_t *object, const char *where, const char *key,
                      bool needed, const char **out) {
  const json_t *value = json_object_get(object, key);
  *out = json_string_value(value);
  if (value && !*out) return bad(r, where, "a value that must be text is none");
  if (!value && needed) {
    char what[96];
    snprintf(what, sizeof what, "'%s' is missing", key);
    return bad(r, where, what);
  }
  return EP_OK;
}

// ---- runs --------------------------------------------------------------------------------------

// The last line of run.log that says something.
static void last_words(const char *path, char *out, size_t size) {
  char line[1024];
  snprintf(out, size, "it was not run");
  FILE *file = fopen(path, "r");
  if (!file) return;
  while (fgets(line, sizeof line, file)) {
    line[strcspn(line, "\r\n")] = '\0';
    if (*line) snprintf(out, size, "%.*s", (int)size - 1, line);
  }
  fclose(file);
}

static ep_status look_at_run(const reader *r, ep_figure_run *run) {
  char folder[EP_PATH_MAX], path[EP_PATH_MAX];
  EP_TRY(ep_path_join(r->root, run->scene, folder, r->err));
  EP_TRY(ep_path_join(folder, "summary.json", path, r->err));
  run->summary = json_load_file(path, 0, NULL);
  EP_TRY(ep_path_join(folder, "plan.json", path, r->err));
  run->plan = json_load_file(path, 0, NULL);
  EP_TRY(ep_path_join(folder, "full/results.json", path, r->err));
  run->full = json_load_file(path, 0, NULL);
  EP_TRY(ep_path_join(folder, "full/reference.png", path, r->err));
  run->reference = ep_path_exists(path);
  EP_TRY(ep_path_join(folder, "strip.png", path, r->err));
  run->strip = ep_path_exists(path);
  EP_TRY(ep_path_join(folder, "final.png", path, r->err));
  run->final = ep_path_exists(path);
  EP_TRY(ep_path_join(folder, "run.log", path, r->err));
  if (!run->summary) last_words(path, run->why, sizeof run->why);
  return EP_OK;
}

static ep_status read_runs(const reader *r, const json_t *list, const char *where, ep_figure *out) {
  const size_t count = json_array_size(list);
  if (count == 0) return bad(r, where, "'runs' must be a list of {scene, label}");
  out->run = calloc(count, sizeof *out->run);
  if (!out->run) return no_memory(r->err);
  for (size_t i = 0; i < count; i++) {
    ep_figure_run *run = &out->run[out->nruns++];
    const json_t *entry = json_array_get(list, i);
    EP_TRY(text(r, entry, where, "scene", true, &run->scene));
    EP_TRY(text(r, entry, where, "label", true, &run->label));
    EP_TRY(look_at_run(r, run));
  }
  return EP_OK;
}

static ep_status read_papers(const reader *r, const json_t *list, const char *where,
                             ep_figure *out) {
  const size_t count = json_array_size(list);
  if (count == 0) return EP_OK;
  out->paper = calloc(count, sizeof *out->paper);
  if (!out->paper) return no_memory(r->err);
  for (size_t i = 0; i < count; i++) {
    const json_t *entry = json_array_get(list, i);
    ep_figure_paper *paper = &out->paper[out->npapers++];
    EP_TRY(text(r, entry, where, "model", true, &paper->model));
    paper->vertices = ep_json_get_number(entry, "vertices");
    paper->tets = ep_json_get_number(entry, "tets");
    paper->examples = ep_json_get_number(entry, "examples");
    paper->m = ep_json_get_number(entry, "m");
    paper->r = ep_json_get_number(entry, "r");
    paper->s = ep_json_get_number(entry, "s");
    paper->t_interp = ep_json_get_number(entry, "t_interp");
    paper->t_total = ep_json_get_number(entry, "t_total");
  }
  return EP_OK;
}

static ep_status read_figures(const reader *r, ep_figures *out) {
  const json_t *list = json_object_get(out->list, "figures");
  const size_t count = json_array_size(list);
  EP_TRY(text(r, out->list, "top", "title", true, &out->title));
  EP_TRY(text(r, out->list, "top", "text", false, &out->text));
  if (count == 0) return bad(r, "top", "'figures' must be a list that is not empty");
  out->figure = calloc(count, sizeof *out->figure);
  if (!out->figure) return no_memory(r->err);
  for (size_t i = 0; i < count; i++) {
    const json_t *entry = json_array_get(list, i);
    ep_figure *figure = &out->figure[out->count++];
    char where[64];
    snprintf(where, sizeof where, "figures.%zu", i);
    EP_TRY(text(r, entry, where, "name", true, &figure->name));
    EP_TRY(text(r, entry, where, "text", true, &figure->text));
    EP_TRY(text(r, entry, where, "note", false, &figure->note));
    EP_TRY(read_runs(r, json_object_get(entry, "runs"), where, figure));
    EP_TRY(read_papers(r, json_object_get(entry, "paper"), where, figure));
    out->runs += figure->nruns;
    for (int k = 0; k < figure->nruns; k++) out->failed += !figure->run[k].summary;
  }
  return EP_OK;
}

ep_status ep_figures_read(const char *path, const char *root, ep_figures *out, ep_error *err) {
  const reader r = {path, root, err};
  json_error_t wrong;
  *out = (ep_figures){0};
  char *bytes;
  size_t size;
  EP_TRY(ep_file_read(path, &bytes, &size, err));
  out->list = json_loadb(bytes, size, 0, &wrong);
  free(bytes);
  if (!out->list)
    return ep_fail(err, EP_ERR_FORMAT, "%s:%d:%d: not JSON: %s", path, wrong.line, wrong.column,
                   wrong.text);
  const ep_status status = read_figures(&r, out);
  if (status != EP_OK) ep_figures_free(out);
  return status;
}

void ep_figures_free(ep_figures *figures) {
  for (int i = 0; i < figures->count; i++) {
    ep_figure *figure = &figures->figure[i];
    for (int k = 0; k < figure->nruns; k++) {
      json_decref(figure->run[k].summary);
      json_decref(figure->run[k].plan);
      json_decref(figure->run[k].full);
    }
    free(figure->run);
    free(figure->paper);
  }
  free(figures->figure);
  json_decref(figures->list);
  *figures = (ep_figures){0};
}
