// A YAML (or JSON) text as a tree: where a key stands, and overrides from the command line.
#ifndef EP_APP_SCENE_YAML_DOC_H
#define EP_APP_SCENE_YAML_DOC_H

#include <stddef.h>
#include <yaml.h>

#include "base/error.h"

// One document. `name` (borrowed) opens every message.
typedef struct ep_yaml {
  yaml_document_t document;
  const char *name;
} ep_yaml;

// Errors: EP_ERR_SCENE with line and column: no YAML, empty, more than one document, a key twice.
ep_status ep_yaml_parse(const char *name, const char *text, size_t size, ep_yaml *out,
                        ep_error *err);
void ep_yaml_free(ep_yaml *yaml);

// Line and column, from 1, of the value at a dotted path ("families.0.map.accept"), of the nearest
// ancestor that exists otherwise. Returns 0 where the value itself is not there.
int ep_yaml_locate(ep_yaml *yaml, const char *path, int *line, int *column);

// Line and column of the first mapping key `key` that starts after the given place.
// Returns 0 where there is none.
int ep_yaml_find_key(ep_yaml *yaml, const char *key, int *line, int *column);

// Apply "path=value": value is YAML itself (numbers, [lists], {mappings}). Missing mappings on the
// way are made; a list index must exist or be the next one.
// Errors: EP_ERR_SCENE: no '=', a path through a scalar, a list index out of range, bad YAML.
ep_status ep_yaml_set(ep_yaml *yaml, const char *assignment, ep_error *err);

// The tree as text, malloc'd with a NUL after *size bytes. The tree is used up: only ep_yaml_free
// may follow.
ep_status ep_yaml_print(ep_yaml *yaml, char **text, size_t *size, ep_error *err);

#endif
