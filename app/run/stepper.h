// A state of a model that steps through a scene: loads, obstacles and the interpolation's solver
// set up as the scene says; a step that fails is done in halves.
#ifndef EP_APP_RUN_STEPPER_H
#define EP_APP_RUN_STEPPER_H

#include "app/run/loads.h"

enum { EP_HALVINGS_MAX = 6 }; // a step is divided into 2^6 at most

typedef struct ep_stepper ep_stepper;

// scene, shapes and model are borrowed. Errors: EP_ERR_MEMORY, EP_ERR_NUMERIC (no state of this
// model), those of selections and of NLopt's algorithm.
ep_status ep_stepper_open(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                          ep_stepper **out, ep_error *err);
void ep_stepper_close(ep_stepper *stepper);
ep_state *ep_stepper_state(ep_stepper *stepper);
// The step's definition as the scene has it; may be changed between steps.
ep_step_def *ep_stepper_def(ep_stepper *stepper);

// What the steps of one advance came to.
typedef struct ep_advance {
  ep_step_report last; // of the last step done
  double deepest;      // of its contact: over all steps
  int touching;        // the most
  int newton_iterations, line_search_steps, projections, halvings;
  int unfolding;         // steps in which a jammed object unfolded
  long evaluations;      // of the interpolation
  double seconds;        // wall time, interpolation included
  double target_seconds; // of the interpolation alone
} ep_advance;

// Go from time t to t + dt [s]. loads false: without the scene's loads. EP_ERR_NUMERIC where a step
// fails even at dt / 2^EP_HALVINGS_MAX: what was done of dt before stays done.
ep_status ep_stepper_advance(ep_stepper *stepper, double t, double dt, bool loads, ep_advance *out);

#endif
