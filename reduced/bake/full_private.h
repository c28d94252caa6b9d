// Private part of the full-space step: what full_step.c (set-up, integrator, Newton), full_energy.c
// (the incremental potential) and full_direction.c (its matrix and Newton's direction) share.
#ifndef EP_BAKE_FULL_PRIVATE_H
#define EP_BAKE_FULL_PRIVATE_H

#include "linalg/petsc.h"
#include "reduced/bake/full_contact.h"
#include "reduced/bake/full_step.h"

// clang-format off
#define EP_FULL_VECTORS(X)                                                                         \
  X(u) X(v) X(a) X(u_before) X(v_before) X(end_u) X(end_v) /* the motion: reduced/integrator.h */   \
  X(base) X(ahead) X(x) X(g) X(direction) X(trial)         /* Newton */                            \
  X(moved) X(pull)                                         /* products */                          \
  X(residual) X(steered) X(search) X(image)                /* conjugate gradients */
// clang-format on

struct ep_full {
  const ep_fem *fem;
  ep_state *examples;   // of the interpolation path, or NULL
  ep_green_full *green; // of the Green-strain path, or NULL
  ep_fem stvk;          // fem with the law of the Green-strain path; borrows everything of it
  int n3, r, p;         // unknowns; modes of the examples' model; independent strains
  ep_csr mass, k0, k;
  ep_csr k_stvk; // empty where fem is StVK itself
  ep_factor *factor;
  ep_full_contact *contact; // made by the first step with obstacles
  double dt_before;
  int end_integrator;  // of the last step
  double force_scale;  // sum_e V (lambda + 2 mu) |gradients|: nodal force at unit strain
  double energy_scale; // sum_e V (lambda + 2 mu): energy at unit strain
  double *block;       // all vectors
  double *mu;          // (r x 3n) rows M u_a
  double *columns;     // (p x 3n) J_i of the Green-strain path
  double *back;        // (p x 3n) K^-1 J_i
  double *q, *f, *fh;  // (r) coordinates, example force, Hessian (r x r)
  double *y;           // (p) of the last evaluation
#define X(name) double *name;
  EP_FULL_VECTORS(X)
#undef X
};

// One step in the making.
typedef struct ep_full_move {
  ep_full *full;
  const ep_step_def *def;
  double rate, inertia;                     // of the integrator
  double internal;                          // |forces inside| of the last gradient
  double elastic, example, strains, energy; // of the last evaluation
  int iterations;                           // of Newton, at most
  ep_full_report *report;
} ep_full_move;

// Which example forces act in this step.
int ep_full_pulls(const ep_full_move *m); // interpolation path
// alpha of the Green-strain path, less what relief takes; 0 where it does not act.
double ep_full_alpha(const ep_full_move *m);
// What is left of the material's own energy beside the example forces.
double ep_full_share(const ep_full_move *m);
// Another material than StVK with the Green-strain path: the mixed form.
int ep_full_mixed(const ep_full_move *m);

void ep_full_release_held(const ep_full *full, double *g);
void ep_full_to_coordinates(ep_full *full, const double *x);        // q = U^T M x
void ep_full_lift(const ep_full *full, const double *f, double *g); // g += M U f

// Energy inside the body at x with gradient g (3n, zero at held unknowns) unless NULL.
double ep_full_inner_energy(ep_full_move *m, const double *x, double *g);
// 1/2 scale |x - origin|_A^2, gradient added to g unless NULL; origin NULL: 0.
double ep_full_add_quadratic(ep_full *full, const ep_csr *a, double scale, const double *x,
                             const double *origin, double *g);
// The incremental potential at x, gradient g unless NULL.
double ep_full_evaluate(ep_full_move *m, const double *x, double *g);
// Obstacles act in this step.
int ep_full_touches(const ep_full_move *m);
// |gradient| over the forces in play; never less than what a strain of 1e-8 makes.
double ep_full_residual(const ep_full_move *m);
// Newton direction at full->x, where the last evaluation with a gradient was: the exact stiffness
// where it is positive definite, else the elements' tangents projected and without the Green-strain
// path, whose curvature is negative; with the inertia that always has a factor.
ep_status ep_full_find_direction(ep_full_move *m, ep_error *err);

#endif
