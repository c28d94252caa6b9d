// The obstacles of a scene over time: for the steps, and as surfaces for pictures and files.
#ifndef EP_APP_SCENE_OBSTACLES_H
#define EP_APP_SCENE_OBSTACLES_H

#include "app/scene/scene.h"

// Sizes and friction of the scene's obstacles, standing as at time 0. extent: of the object;
// edges of boxes are rounded by 1 % of it (at most a quarter of the box's smallest half length), so
// that normals are continuous down to that depth. out (scene->nobstacles), caller-owned.
void ep_obstacles_make(const ep_scene *scene, double extent, ep_obstacle *out);
// Their poses at the beginning and the end of a step.
void ep_obstacles_move(const ep_scene *scene, double from, double to, ep_obstacle *out);
// Pose of one obstacle at time t: world = c + R local (reduced/obstacle.h).
void ep_obstacle_pose(const ep_scene_obstacle *obstacle, double t, ep_frame *out);

#endif
