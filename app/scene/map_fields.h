// Corresponding regions that the meshes mark themselves: labels and painted weights on the vertices
// (scene: families[].map.fields).
#ifndef EP_APP_SCENE_MAP_FIELDS_H
#define EP_APP_SCENE_MAP_FIELDS_H

#include "align/align.h"
#include "app/scene/shapes.h"

// More labels than this are no regions but numbers of vertices or the like.
enum { EP_LABELS_MAX = 256 };

// The regions two shapes (shape numbers) of a map of a family have in common: column 0 `from`, 1
// `to`. An array of whole numbers on both is labels: equal ones correspond, 0 is no region. Any
// other is painted from 0 to 1: one region, where it is above 0.5. count 0 where the family gives
// no fields, or (poses not named in the scene) the pose carries none of them. Errors: EP_ERR_SCENE
// with the key: those of ep_scalar_of; a label on one shape only; too many labels; values that are
// neither labels nor weights; an empty region.
ep_status ep_map_fields(const ep_scene *scene, const ep_shapes *shapes, int family, int from,
                        int to, ep_regions *out, ep_error *err);
void ep_map_fields_free(ep_regions *regions); // without the library of maps

#endif
