// Given motions: of obstacles, of what drags.
#ifndef EP_APP_SCENE_MOTION_H
#define EP_APP_SCENE_MOTION_H

#include <stdbool.h>

#include "reduced/frame.h"

// Rotation by an angle about an axis (any length but zero; unused where the angle is 0).
typedef struct ep_turn {
  double axis[3], degrees;
} ep_turn;

typedef struct ep_keyframe {
  double time;    // [s]
  double move[3]; // from where it stands at first
  ep_turn turn;   // about its own centre, from how it stands at first
} ep_keyframe;

// Keyframes ascending in time. Before the first and after the last it stands still.
typedef struct ep_motion_path {
  int keys;
  ep_keyframe *key;
  bool smooth; // slow in and out of every keyframe (3 s^2 - 2 s^3), else with constant speed
} ep_motion_path;

void ep_turn_matrix(const ep_turn *turn, double R[9]); // row-major

// Position and rotation at time t, relative to the first: move (3), R (9). Between keyframes about
// one axis the angle is interpolated (more than half a turn is possible), otherwise the rotation on
// the shortest way. A path without keys stands still.
void ep_motion_at(const ep_motion_path *path, double t, double move[3], double R[9]);

#endif
