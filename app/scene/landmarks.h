// The landmarks of a family as the maps between its shapes need them.
#ifndef EP_APP_SCENE_LANDMARKS_H
#define EP_APP_SCENE_LANDMARKS_H

#include "align/align.h"
#include "app/scene/shapes.h"

// Those landmarks that name a place on both shapes of a map (shape numbers from, to), in the order
// of the scene; out (EP_LANDMARKS_MAX). Errors: EP_ERR_SCENE with the key, where a vertex is none
// of the mesh.
ep_status ep_landmarks_of_map(const ep_scene *scene, const ep_shapes *shapes, int family, int from,
                              int to, ep_landmark *out, int *count, ep_error *err);

#endif
