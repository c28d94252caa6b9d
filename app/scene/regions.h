// Regions of the object with soft edges: where local examples act (Zhao et al. 2018, sec. 5 "Local
// examples"). The one owner of their weights; both paths take them from here.
#ifndef EP_APP_SCENE_REGIONS_H
#define EP_APP_SCENE_REGIONS_H

#include "app/scene/scene.h"

// Weight of each vertex (nv), 1 on the selection, 1 - 3 t^2 + 2 t^3 at the distance t soft from it,
// 0 from t = 1 on. The distance from a box or a plane is the straight one; from the vertices of a
// file it goes along the edges of the mesh, so that an edge does not jump from an arm to the body
// beside it.
// Errors: EP_ERR_SCENE where no vertex lies in the selection; EP_ERR_FORMAT for a bad list.
ep_status ep_region_weights(const ep_scene_region *region, const ep_mesh *mesh, double *weight,
                            ep_error *err);

// Share of each tet in a region, out (nt): the mean weight of its vertices. weight (nv) NULL:
// everywhere.
void ep_region_shares(const ep_mesh *mesh, const double *weight, double *out);

#endif
