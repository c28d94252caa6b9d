// Vertex selections of a scene: boxes, half spaces, lists in files.
#ifndef EP_APP_SCENE_SELECT_H
#define EP_APP_SCENE_SELECT_H

#include "app/scene/scene.h"

// Mark the vertices of `mesh` (rest positions) a selection holds: chosen (nv) is set to 1 there and
// left alone elsewhere. *count receives how many it holds.
// Errors: EP_ERR_SCENE where none is held; EP_ERR_FORMAT with file and line for a bad list.
ep_status ep_select_vertices(const ep_selection *selection, const ep_mesh *mesh,
                             unsigned char *chosen, int *count, ep_error *err);

// Distance of a point (3) from a box or half space, 0 inside.
double ep_select_distance(const ep_selection *selection, const double *x);

// The union of the scene's fixed selections as ascending vertex numbers; *vertex malloc'd, NULL and
// *count 0 without any. Errors as above, and EP_ERR_SCENE where every vertex is fixed.
ep_status ep_select_fixed(const ep_scene *scene, const ep_mesh *mesh, int *count, int **vertex,
                          ep_error *err);

// Read 1-based vertex numbers separated by commas or white space ('#' to the end of the line is a
// comment) and mark them. name and text (NUL-terminated) as for a file.
ep_status ep_select_parse(const char *name, const char *text, const ep_mesh *mesh,
                          unsigned char *chosen, int *count, ep_error *err);

#endif
