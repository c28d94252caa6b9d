#include "app/scene/scene_load.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/schema_walk.h"

// What libcyaml says about a failure: the cause, then a backtrace from the innermost field.
typedef struct complaint {
  char cause[256], field[128], outer[128]; // outer: the field around `field`
  int line, column;
} complaint;

static void strip_newline(char *text) {
  const size_t length = strlen(text);
  if (length && text[length - 1] == '\n') text[length - 1] = '\0';
}

static void listen(cyaml_log_t level, void *user, const char *format, va_list args) {
  complaint *heard = user;
  if (level < CYAML_LOG_ERROR) return;
  char message[256];
  vsnprintf(message, sizeof message, format, args);
  strip_newline(message);
  int line, column;
  const char *place = strstr(message, "(line: ");
  if (place && sscanf(place, "(line: %d, column: %d)", &line, &column) == 2) {
    if (!heard->line) {
      heard->line = line;
      heard->column = column;
    }
    char *to = heard->field[0] ? heard->outer : heard->field;
    if (!*to) sscanf(message, "  in mapping field '%127[^']'", to);
  } else if (!heard->cause[0] && strncmp(message, "Load: ", 6) == 0) {
    snprintf(heard->cause, sizeof heard->cause, "%s", message + 6);
  }
}

static cyaml_config_t configuration(complaint *heard) {
  return (cyaml_config_t){
      .log_fn = listen, .log_ctx = heard, .mem_fn = cyaml_mem, .log_level = CYAML_LOG_WARNING};
}

static ep_status say_unknown(const char *where, const char *within, const char *key,
                             ep_error *err) {
  char meant[200];
  const bool near = ep_schema_nearest(within, key, meant, sizeof meant);
  return ep_fail(err, EP_ERR_SCENE, "%s: unknown key '%s'%s%s; docs/scene.md lists the keys", where,
                 key, near ? "; is it meant to be " : "", near ? meant : "");
}

// The innermost field is then the one that was read last, the next one lacks the key.
static ep_status say_missing(const char *where, const complaint *heard, const char *key,
                             ep_error *err) {
  return ep_fail(err, EP_ERR_SCENE, "%s: %s%s%s is missing", where, heard->outer,
                 heard->outer[0] ? "." : "", key);
}

// libcyaml gives the place of the value before an unexpected key: find the key itself.
static ep_status say(ep_yaml *yaml, complaint *heard, cyaml_err_t code, bool overridden,
                     ep_error *err) {
  static const char unexpected[] = "Unexpected key: ";
  static const char missing[] = "Missing required mapping field: ";
  char where[512] = "";
  const bool unknown = strncmp(heard->cause, unexpected, sizeof unexpected - 1) == 0;
  if (unknown) {
    int line = heard->line, column = heard->column;
    if (ep_yaml_find_key(yaml, heard->cause + sizeof unexpected - 1, &line, &column)) {
      heard->line = line;
      heard->column = column;
    }
  }
  if (heard->line == 0) heard->line = heard->column = 1;
  if (overridden)
    snprintf(where, sizeof where, "%s with --set", yaml->name);
  else
    snprintf(where, sizeof where, "%s:%d:%d", yaml->name, heard->line, heard->column);
  if (unknown) return say_unknown(where, heard->field, heard->cause + sizeof unexpected - 1, err);
  if (strncmp(heard->cause, missing, sizeof missing - 1) == 0)
    return say_missing(where, heard, heard->cause + sizeof missing - 1, err);
  if (!heard->cause[0]) snprintf(heard->cause, sizeof heard->cause, "%s", cyaml_strerror(code));
  const bool named = heard->field[0];
  return ep_fail(err, EP_ERR_SCENE, "%s: %s%s%s%s", where, named ? "'" : "",
                 named ? heard->field : "", named ? "': " : "", heard->cause);
}

// Fit a text to the schema; the result is dropped where out is NULL.
static ep_status fit(ep_yaml *yaml, const char *text, size_t size, bool overridden, raw_scene **out,
                     ep_error *err) {
  complaint heard = {0};
  const cyaml_config_t config = configuration(&heard);
  cyaml_data_t *data = NULL;
  const cyaml_err_t code =
      cyaml_load_data((const uint8_t *)text, size, &config, &ep_scene_schema, &data, NULL);
  if (code != CYAML_OK) return say(yaml, &heard, code, overridden, err);
  if (!data) return ep_fail(err, EP_ERR_SCENE, "%s: empty file", yaml->name);
  if (out)
    *out = (raw_scene *)data;
  else
    cyaml_free(&config, &ep_scene_schema, data, 0);
  return EP_OK;
}

// Overrides are merged into the tree, the tree printed again and fitted like a file.
static ep_status fit_with_sets(ep_scene_text *out, int nsets, const char *const *sets,
                               const char *text, size_t size, ep_error *err) {
  ep_yaml merged;
  EP_TRY(ep_yaml_parse(out->yaml.name, text, size, &merged, err));
  ep_status status = EP_OK;
  for (int i = 0; i < nsets && status == EP_OK; i++) status = ep_yaml_set(&merged, sets[i], err);
  if (status == EP_OK) status = ep_schema_check_values(&merged, true, err);
  char *printed = NULL;
  size_t length = 0;
  if (status == EP_OK) status = ep_yaml_print(&merged, &printed, &length, err);
  ep_yaml_free(&merged);
  if (status == EP_OK) status = fit(&out->yaml, printed, length, true, &out->raw, err);
  free(printed);
  return status;
}

ep_status ep_scene_load(const char *name, const char *text, size_t size, int nsets,
                        const char *const *sets, ep_scene_text *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  EP_TRY(ep_yaml_parse(name, text, size, &out->yaml, err));
  // The file alone first, so that its own mistakes are reported with their line.
  ep_status status = fit(&out->yaml, text, size, false, nsets ? NULL : &out->raw, err);
  if (status == EP_OK) status = ep_schema_check_values(&out->yaml, false, err);
  if (status == EP_OK && nsets) status = fit_with_sets(out, nsets, sets, text, size, err);
  if (status != EP_OK) ep_scene_unload(out);
  return status;
}

void ep_scene_unload(ep_scene_text *loaded) {
  complaint heard = {0};
  const cyaml_config_t config = configuration(&heard);
  if (loaded->raw) cyaml_free(&config, &ep_scene_schema, loaded->raw, 0);
  if (loaded->yaml.name) ep_yaml_free(&loaded->yaml);
  memset(loaded, 0, sizeof *loaded);
}
