// Obstacles as bodies to look at: in pictures, glTF and ParaView files.
#ifndef EP_APP_SCENE_OBSTACLE_MESH_H
#define EP_APP_SCENE_OBSTACLE_MESH_H

#include "app/scene/obstacles.h"

// All obstacles as one mesh of tets, each vertex in the coordinates of its obstacle.
typedef struct ep_solids {
  ep_mesh mesh;        // x: local coordinates
  int *first;          // (nobstacles + 1) first vertex of each
  int triangles;       // surface
  int *triangle;       // (triangles x 3) outward
  int *first_triangle; // (nobstacles + 1) of each
} ep_solids;

// low, high (3): what the pictures show; planes become slabs as wide as that below it.
// Nothing (all zero) without obstacles. Errors: EP_ERR_MEMORY.
ep_status ep_solids_make(const ep_scene *scene, const double low[3], const double high[3],
                         ep_solids *out, ep_error *err);
void ep_solids_free(ep_solids *solids);

// World positions at time t, x (mesh.nv x 3).
void ep_solids_place(const ep_scene *scene, const ep_solids *solids, double t, double *x);

#endif
