// Inside of the picture module: a soft shadow on the ground below a panel's content, or on a floor.
#ifndef EP_RESULTS_SHADOW_H
#define EP_RESULTS_SHADOW_H

#include "results/raster.h"

typedef struct ep_shadow {
  int size;                 // cells a side; 0: no shadow
  float *dark;              // (size x size) 0..1
  double axis[2][3], up[3]; // orthonormal: along the ground and away from it
  double ground;            // height of the ground
  double low[2], cell;      // of the grid
} ep_shadow;

// Of all drawings that are no floors, on the level `ground` along view->up.
ep_status ep_shadow_make(const ep_view *view, const ep_camera *camera, const ep_panel *panel,
                         double ground, ep_shadow *out, ep_error *err);
void ep_shadow_free(ep_shadow *shadow);
// How much the shadow darkens the ground seen at a sample (x, y): 0..1.
double ep_shadow_at(const ep_shadow *shadow, const ep_camera *camera, const ep_frame *frame,
                    double x, double y);
// The same on what the frame shows at that level: its samples there are darkened.
void ep_shadow_fall(const ep_shadow *shadow, const ep_camera *camera, ep_frame *frame);

#endif
