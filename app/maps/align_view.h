// Pictures and .vtu files by which a person can judge maps and transferred poses.
#ifndef EP_APP_MAPS_ALIGN_VIEW_H
#define EP_APP_MAPS_ALIGN_VIEW_H

#include "app/bake/bake.h"

// In folder, which must be there, for the map of a stage (its name with '-' for ':' and '/'):
//   NAME.png            both shapes, the same colour where mapped
//   NAME-functions.png  eigenfunctions 1-4 of the one above the coupled ones of the other
//   NAME.vtu            the first shape with images, colours and functions; NAME-example.vtu: other
ep_status ep_align_view_map(const char *folder, ep_bake *bake, const ep_stage *stage,
                            const ep_map *map, ep_error *err);

// pose-NAME.png: the example at rest and in its pose above the object at rest and in the
// transferred pose, the same colour where mapped; pose-NAME.vtu: the object in that pose.
// After ep_bake_poses.
ep_status ep_align_view_pose(const char *folder, ep_bake *bake, int example, ep_error *err);

#endif
