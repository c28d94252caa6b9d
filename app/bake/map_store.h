// Maps in the cache: points, matrices and the whole quality record.
#ifndef EP_APP_BAKE_MAP_STORE_H
#define EP_APP_BAKE_MAP_STORE_H

#include "align/align.h"
#include "app/plan/cache.h"

ep_status ep_map_store(const ep_cache *cache, const char *stage, const ep_digest *key,
                       const ep_map *map, ep_error *err);

// The map of n vertices and m functions into a mesh; false, with *map empty, where the artifact
// does not hold one that fits.
bool ep_map_take(const ep_artifact *artifact, int n, int m, const ep_mesh *to, ep_map *map);

#endif
