// What the schema itself can tell: values libcyaml lets pass, and the key somebody meant.
#ifndef EP_APP_SCENE_SCHEMA_WALK_H
#define EP_APP_SCENE_SCHEMA_WALK_H

#include "app/scene/scene_schema.h"
#include "app/scene/yaml_doc.h"

// libcyaml reads "3e5 Pa" as 3e5, "1,5" as 1 and "flase" as true. Here numbers must be numbers to
// their end, and what is true or false one of true, yes, 1, enable, false, no, 0, disable (case
// does not matter). The tree must fit the schema otherwise. overridden: places do not tell, values
// of --set are among them. Errors: EP_ERR_SCENE with the place and the key.
ep_status ep_schema_check_values(ep_yaml *yaml, bool overridden, ep_error *err);

// The dotted path of the schema's key nearest to `key` (itself, where it stands elsewhere), "[]"
// for lists, into path; of equals one in the mapping `within` ("" at the top). False where none is
// near.
bool ep_schema_nearest(const char *within, const char *key, char *path, size_t size);

#endif
