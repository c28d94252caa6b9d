// Obstacles that stand in the object before anything has moved.
#ifndef EP_APP_SCENE_OBSTACLE_START_H
#define EP_APP_SCENE_OBSTACLE_START_H

#include "app/scene/shapes.h"

// Depth that contact pushes out, over the object's extent. Measured (docs/free-motion.md
// "Obstacles at the start"): nothing is left inside out and nothing stuck up to here; from 6 % on
// objects stay stuck or tets turn over, from 8 % on the first step fails.
#define EP_OVERLAP_MOST 0.05

// Refuses a scene in which a vertex that contact acts on - of the surface, not fixed - stands
// deeper in an obstacle than that at time 0, where the mesh or `start` puts it. The message says
// which obstacle (the deepest), where in the file, how deep, how many vertices, what to do. Errors:
// EP_ERR_SCENE, EP_ERR_MEMORY.
ep_status ep_obstacles_check_start(const ep_scene *scene, const ep_shapes *shapes, ep_error *err);

#endif
