// From scene text to the raw structs: libyaml for overrides and places, libcyaml for the schema.
#ifndef EP_APP_SCENE_SCENE_LOAD_H
#define EP_APP_SCENE_SCENE_LOAD_H

#include "app/scene/scene_schema.h"
#include "app/scene/yaml_doc.h"

// yaml: the tree with overrides applied, for the place of a value in later messages.
typedef struct ep_scene_text {
  raw_scene *raw;
  ep_yaml yaml;
} ep_scene_text;

// Errors: EP_ERR_SCENE with name:line:column for what does not fit the schema.
ep_status ep_scene_load(const char *name, const char *text, size_t size, int nsets,
                        const char *const *sets, ep_scene_text *out, ep_error *err);
void ep_scene_unload(ep_scene_text *loaded);

#endif
