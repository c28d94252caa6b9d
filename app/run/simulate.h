// The simulation of a run: loads, steps, what is recorded.
#ifndef EP_APP_RUN_SIMULATE_H
#define EP_APP_RUN_SIMULATE_H

#include "app/plan/model_file.h"
#include "app/scene/shapes.h"

// Of contact after each step: vertices that touch, deepest penetration [m], force on the object
// [N].
enum { EP_CONTACT_TOUCHING, EP_CONTACT_DEEPEST, EP_CONTACT_FORCE, EP_CONTACT_COLUMNS = 5 };

typedef struct ep_record {
  int rows;              // steps done + 1 (row 0 is rest)
  const char *isa;       // instruction set of the kernels
  double *time;          // (rows) [s]
  double *q;             // (rows x r)
  double *velocity;      // (rows x r)
  double *energy;        // (rows) elastic + kinetic, by the model's own quadrature [J]
  double *weights;       // (rows x (regions + k)), the rest shape's first; NULL without that path
  double *green_weights; // (rows x k) of the Green-strain path; NULL without it
  double *contact;       // (rows x EP_CONTACT_COLUMNS); NULL without obstacles
  double *step_ms;       // (rows - 1) wall time of each step, interpolation included
  double *target_ms;     // (rows - 1) of the interpolation alone
  ep_frame *frame;       // (rows) of a free object; NULL for a held one
  double *momentum;      // (rows x 6) of a free object: linear, angular about the centre of mass
  int max_inverted;      // most inverted tets after any step
  int halvings;          // steps that had to be halved
  int unfolded;          // steps in which a jammed object unfolded (reduced/unfold.h)
  int newton_iterations, target_evaluations; // over the run
  int most_touching;                         // vertices at the end of any step
  double deepest;                            // penetration at the end of any step [m]
} ep_record;

// Simulate scene->steps steps. What was done before a failure stays in the record.
// kernels: instruction set of the steps (reduced/eigenpose.h, ep_isa_check), NULL for the widest.
// Errors: EP_ERR_NUMERIC where a step fails even after halving, with its number; those of
// selections.
ep_status ep_simulate(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                      const char *kernels, ep_log *log, ep_record *out, ep_error *err);
void ep_record_free(ep_record *record);

// Positions x (n x 3) of the model into the world, in place.
void ep_place(const ep_model *model, const ep_frame *frame, double *x);
// Positions in the world after a step (n x 3).
void ep_record_positions(const ep_model *model, const ep_record *record, int row, double *x);

// Median of count values; 0 for none, NaN without memory.
double ep_median(int count, const double *value);

// How far shape q has gone from rest towards an example, <u, u_ex>_M / <u_ex, u_ex>_M. The modes
// are mass-orthonormal, so this is q . q_ex / |q_ex|^2.
double ep_example_fraction(const ep_model *model, const double *q, int example);

#endif
