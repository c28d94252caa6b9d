#include "app/scene/obstacles.h"

#include <math.h>
#include <string.h>

// Rounding of boxes' edges over the object's extent.
static const double rounding_share = 0.01;

void ep_obstacle_pose(const ep_scene_obstacle *obstacle, double t, ep_frame *out) {
  double move[3], by[9];
  ep_motion_at(&obstacle->motion, t, move, by);
  for (int i = 0; i < 3; i++) {
    out->c[i] = obstacle->at.c[i] + move[i];
    for (int j = 0; j < 3; j++) {
      out->R[3 * i + j] = 0;
      for (int l = 0; l < 3; l++) out->R[3 * i + j] += by[3 * i + l] * obstacle->at.R[3 * l + j];
    }
  }
}

void ep_obstacles_make(const ep_scene *scene, double extent, ep_obstacle *out) {
  for (int i = 0; i < scene->nobstacles; i++) {
    const ep_scene_obstacle *o = &scene->obstacle[i];
    out[i] = (ep_obstacle){.kind = o->kind, .friction = o->friction};
    memcpy(out[i].size, o->size, sizeof o->size);
    if (o->kind == EP_OBSTACLE_BOX)
      out[i].rounding = fmin(rounding_share * extent, 0.25 * ep_obstacle_inner_radius(&out[i]));
  }
  ep_obstacles_move(scene, 0, 0, out);
}

void ep_obstacles_move(const ep_scene *scene, double from, double to, ep_obstacle *out) {
  for (int i = 0; i < scene->nobstacles; i++) {
    ep_obstacle_pose(&scene->obstacle[i], from, &out[i].start);
    ep_obstacle_pose(&scene->obstacle[i], to, &out[i].end);
  }
}
