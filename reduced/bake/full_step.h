// The full-space reference: the time step of reduced/step.c on all 3n unknowns, with sparse
// Cholesky Newton. Same materials, loads, damping, integrators and safeguards, so that a reduced
// run differs from it by its subspace and its quadrature alone. Every error figure is against it.
#ifndef EP_BAKE_FULL_STEP_H
#define EP_BAKE_FULL_STEP_H

#include "reduced/bake/fem.h"
#include "reduced/bake/green_full.h"
#include "reduced/eigenpose.h"

typedef struct ep_full ep_full;

// examples: a state of a model of the same mesh, or NULL without example forces; borrowed. The
// example force of a step is that of the model at q = U^T M u, lifted by M U: U U^T of the papers,
// as the gradient of a potential of u. green: the strains of the examples on the same mesh, or NULL
// without the Green-strain path; def->green says how they act, as in ep_step (mixed form for other
// materials than StVK, weak constraints). Its Hessian is sparse but for one dense column per
// strain: Newton solves by Woodbury, with the interpolation path by conjugate gradients
// preconditioned so. fem and green are borrowed too. Needs a PETSc session. Errors: EP_ERR_ARGUMENT
// (another mesh), EP_ERR_NUMERIC, EP_ERR_MEMORY.
ep_status ep_full_create(const ep_fem *fem, ep_state *examples, ep_green_full *green, ep_full **out,
                         ep_error *err);
void ep_full_free(ep_full *full);

// (3n) displacement and velocity; may be written (zero at held unknowns).
double *ep_full_displacement(ep_full *full);
double *ep_full_velocity(ep_full *full);
// q (r of the examples' model) = U^T M u of the displacement; not without examples.
void ep_full_coordinates(ep_full *full, double *q);
// Memory of matrices, factor and vectors [bytes].
size_t ep_full_bytes(const ep_full *full);

typedef struct ep_full_report {
  int newton_iterations, line_search_steps, projections, solves;
  double residual; // |gradient| over the forces in play
  ep_target_report target;
  ep_contact_report contact;                             // torque about the origin
  double elastic_energy, example_energy, kinetic_energy; // at the end of the step
  double green_energy;                                   // as in ep_step_report
} ep_full_report;

// One step. def as for ep_step, but def->force is the nodal force (3n) [N] at the end of the step
// (NULL: none), gravity included: def->gravity is not read; report may be NULL.
// Errors: EP_ERR_ARGUMENT (def), EP_ERR_NUMERIC (no convergence): the motion is unchanged.
ep_status ep_full_step(ep_full *full, const ep_step_def *def, ep_full_report *report,
                       ep_error *err);

#endif
