// A free object in a run: how it starts, and the loads of the scene as forces of the world.
#ifndef EP_APP_RUN_FREE_OBJECT_H
#define EP_APP_RUN_FREE_OBJECT_H

#include "app/scene/shapes.h"

// Place the state's frame and set its motion as scene->start says. Errors: EP_ERR_SCENE where a
// spin is out of what a state takes.
ep_status ep_free_start(const ep_scene *scene, ep_state *state, ep_error *err);

typedef struct ep_free_loads {
  int pulls; // all loads but gravity, which acts on held objects too (stepper.c)
  ep_pull *pull;     // (pulls) of the step at hand
  double *modes; // (scene's loads x r x 3)
} ep_free_loads;
// Means of positions and modes over what each push acts on. Errors: those of selections.
ep_status ep_free_loads_make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                             ep_free_loads *out, ep_error *err);
void ep_free_loads_free(ep_free_loads *loads);
// Forces at time t into def; act false: none.
void ep_free_loads_set(const ep_scene *scene, ep_free_loads *loads, double t, bool act,
                       ep_step_def *def);

#endif
