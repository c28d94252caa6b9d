// What a run looks like: a strip of its moments and examples, and its final shape.
#ifndef EP_APP_RUN_STRIP_H
#define EP_APP_RUN_STRIP_H

#include "app/run/simulate.h"
#include "app/scene/obstacle_mesh.h"

// strip.png: the scene's moments (output.moments; six equally spaced ones otherwise), then the
// examples as the object would wear them; final.png: the last moment alone.
ep_status ep_strip_write(const char *folder, const ep_scene *scene, const ep_mesh *mesh,
                         const ep_model *model, const ep_record *record, const ep_solids *solids,
                         ep_error *err);

#endif
