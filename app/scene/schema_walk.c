#include "app/scene/schema_walk.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

// ---- values ------------------------------------------------------------------------------------

typedef struct walker {
  ep_yaml *yaml;
  bool overridden;
  ep_error *err;
} walker;

static ep_status refuse(const walker *w, const yaml_node_t *node, const char *key,
                        const char *wanted) {
  const char *text = (const char *)node->data.scalar.value;
  if (w->overridden)
    return ep_fail(w->err, EP_ERR_SCENE, "%s with --set: %s: '%.60s' is %s", w->yaml->name, key,
                   text, wanted);
  return ep_fail(w->err, EP_ERR_SCENE, "%s:%zu:%zu: %s: '%.60s' is %s", w->yaml->name,
                 node->start_mark.line + 1, node->start_mark.column + 1, key, text, wanted);
}

static ep_status check_number(const walker *w, const yaml_node_t *node, const char *key) {
  const char *text = (const char *)node->data.scalar.value;
  char *end;
  strtod(text, &end);
  if (end != text && (size_t)(end - text) == node->data.scalar.length) return EP_OK;
  return refuse(w, node, key, "no number (units are SI and not written, the point is '.')");
}

static ep_status check_bool(const walker *w, const yaml_node_t *node, const char *key) {
  static const char *const words[] = {"true", "yes", "1", "enable", "false", "no", "0", "disable"};
  for (size_t i = 0; i < sizeof words / sizeof *words; i++)
    if (strcasecmp((const char *)node->data.scalar.value, words[i]) == 0) return EP_OK;
  return refuse(w, node, key, "neither true nor false");
}

static ep_status check(const walker *w, int number, const cyaml_schema_value_t *schema,
                       const char *key);

static ep_status check_mapping(const walker *w, const yaml_node_t *node,
                               const cyaml_schema_value_t *schema) {
  const yaml_node_pair_t *pair = node->data.mapping.pairs.start;
  for (; pair < node->data.mapping.pairs.top; pair++) {
    const yaml_node_t *key = yaml_document_get_node(&w->yaml->document, pair->key);
    const char *name = (const char *)key->data.scalar.value;
    for (const cyaml_schema_field_t *f = schema->mapping.fields; f->key; f++)
      if (strcasecmp(f->key, name) == 0) EP_TRY(check(w, pair->value, &f->value, name));
  }
  return EP_OK;
}

static ep_status check(const walker *w, int number, const cyaml_schema_value_t *schema,
                       const char *key) {
  const yaml_node_t *node = yaml_document_get_node(&w->yaml->document, number);
  if (node->type == YAML_SCALAR_NODE) {
    if (schema->type == CYAML_FLOAT) return check_number(w, node, key);
    return schema->type == CYAML_BOOL ? check_bool(w, node, key) : EP_OK;
  }
  if (node->type == YAML_MAPPING_NODE)
    return schema->type == CYAML_MAPPING ? check_mapping(w, node, schema) : EP_OK;
  if (schema->type != CYAML_SEQUENCE && schema->type != CYAML_SEQUENCE_FIXED) return EP_OK;
  const yaml_node_item_t *item = node->data.sequence.items.start;
  for (; item < node->data.sequence.items.top; item++)
    EP_TRY(check(w, *item, schema->sequence.entry, key));
  return EP_OK;
}

ep_status ep_schema_check_values(ep_yaml *yaml, bool overridden, ep_error *err) {
  const walker w = {yaml, overridden, err};
  return check(&w, 1, &ep_scene_schema, "scene"); // the root is the first node
}

// ---- keys --------------------------------------------------------------------------------------

enum { LONGEST = 32, NEAR = 2, PATH = 160 };

// Letters to put in, take out, change or exchange with the next one (Damerau 1964).
static int distance(const char *a, const char *b) {
  const size_t m = strlen(a), n = strlen(b);
  int d[LONGEST + 1][LONGEST + 1];
  if (m > LONGEST || n > LONGEST) return LONGEST;
  for (size_t i = 0; i <= m; i++)
    for (size_t j = 0; j <= n; j++) {
      if (i == 0 || j == 0) {
        d[i][j] = (int)(i + j);
        continue;
      }
      const int change = d[i - 1][j - 1] + (a[i - 1] != b[j - 1]);
      const int one = 1 + (d[i - 1][j] < d[i][j - 1] ? d[i - 1][j] : d[i][j - 1]);
      d[i][j] = change < one ? change : one;
      const bool turned = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (turned && d[i - 2][j - 2] + 1 < d[i][j]) d[i][j] = d[i - 2][j - 2] + 1;
    }
  return d[m][n];
}

typedef struct search {
  const char *within, *key;
  int best; // twice the distance, and 1 outside of `within`
  char path[PATH];
} search;

static void look(const cyaml_schema_value_t *schema, const char *parent, const char *path,
                 search *s) {
  char below[PATH];
  while (schema->type == CYAML_SEQUENCE || schema->type == CYAML_SEQUENCE_FIXED)
    schema = schema->sequence.entry;
  if (schema->type != CYAML_MAPPING) return;
  for (const cyaml_schema_field_t *f = schema->mapping.fields; f->key; f++) {
    const bool list = f->value.type == CYAML_SEQUENCE;
    const int away = 2 * distance(s->key, f->key) + (strcmp(parent, s->within) != 0);
    snprintf(below, sizeof below, "%.100s%s%.40s", path, *path ? "." : "", f->key);
    if (away < s->best) {
      s->best = away;
      memcpy(s->path, below, sizeof below);
    }
    if (list) strcat(below, "[]"); // of lists the entries
    look(&f->value, f->key, below, s);
  }
}

bool ep_schema_nearest(const char *within, const char *key, char *path, size_t size) {
  const int near = strlen(key) > 2 * NEAR ? NEAR : 1, none = 2 * near + 2;
  search s = {.within = within, .key = key, .best = none};
  look(&ep_scene_schema, "", "", &s);
  snprintf(path, size, "%s", s.path);
  return s.best < none;
}
