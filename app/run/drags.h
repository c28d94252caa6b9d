// The drags of a scene as springs of a step (reduced/spring.h).
#ifndef EP_APP_RUN_DRAGS_H
#define EP_APP_RUN_DRAGS_H

#include "app/scene/shapes.h"
#include "reduced/spring.h"

// Centres of mass of what each drag holds. Errors: EP_ERR_MEMORY, those of selections.
ep_status ep_drags_make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                        ep_springs *out, ep_error *err);
void ep_drags_free(ep_springs *springs);
// Before a step from t to t + dt: where they pull to; act false: they let go.
void ep_drags_set(const ep_scene *scene, const ep_state *state, double t, double dt, bool act,
                  ep_springs *springs);

#endif
