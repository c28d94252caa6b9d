// Ready-made pictures of meshes: rows of poses.
#ifndef EP_RESULTS_GALLERY_H
#define EP_RESULTS_GALLERY_H

#include "mesh/mesh.h"
#include "results/picture.h"

// One pose of one mesh; several may share a picture (an object beside its example).
typedef struct ep_gallery_item {
  const ep_mesh *mesh;
  const double *x;    // (nv x 3) positions, NULL: rest
  const float *color; // (nv x 3) sRGB per vertex, or NULL: tint
  const char *label;  // or NULL
  int dots;           // places shown as dots, the i-th of every item in the same colour
  const double *dot;  // (dots x 3)
} ep_gallery_item;

// Every item a panel, all in one scale where view->shared. edges as in ep_drawing.
ep_status ep_gallery_poses(const char *path, const ep_view *view, int items,
                           const ep_gallery_item *item, float edges, ep_error *err);

#endif
