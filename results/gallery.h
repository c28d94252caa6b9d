// Ready-made pictures of meshes: rows of poses, eigenfunctions, a look inside.
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

// Functions on the vertices, phi (m x nv, rows), each a panel in diverging colours about 0; labels
// give the number (from 1) and value (m) (eigenvalues; NULL: the number alone).
ep_status ep_gallery_functions(const char *path, const ep_view *view, const ep_mesh *mesh, int m,
                               const double *phi, const double *value, ep_error *err);

// The mesh cut open (results/cut.h), inside coloured by a signed field (nv) or in one colour
// (NULL), edges of the cut tets drawn.
ep_status ep_gallery_cut(const char *path, const ep_view *view, const ep_mesh *mesh,
                         const double *x, const double point[3], const double normal[3],
                         const double *field, const char *label, ep_error *err);

#endif
