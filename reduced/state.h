// What a state holds: configuration and every scratch array of a step, in one block of the
// caller's. Private to the run time.
#ifndef EP_REDUCED_STATE_H
#define EP_REDUCED_STATE_H

#include "reduced/contact_law.h"
#include "reduced/eigenpose.h"
#include "reduced/green.h"
#include "reduced/guard.h"
#include "reduced/guard_kernel.h"
#include "reduced/kernel.h"
#include "reduced/region.h"
#include "reduced/unfold.h"

// Arrays of a state: X(name, number of doubles). width = 8 ceil(r / 8), sets = ep_model_regions;
// free = r where the object is free, else 0; n = r, or r + 6 unknowns where it is free.
// clang-format off
#define EP_STATE_ARRAYS(X)                                                                        \
  X(q, r)                  /* configuration and velocity */                                        \
  X(v, r)                                                                                         \
  X(w, sets + k)           /* weights of rest and examples, target of the last interpolation */   \
  X(target, sets * r)                                                                                    \
  X(shift, 3 * m)          /* what nonlinear interpolation adds to the blend: target.c */          \
  X(next_shift, 3 * m)     /* and that of an interpolation under way */                            \
  X(k0_factor, r * r)      /* lower Cholesky factor of K0 */                                      \
  X(target_inverse, examples * sets * s * 9)  /* the target as undeformed shape: F_t^-1, w |det F_t| */   \
  X(target_weight, examples * sets * s)                                                                  \
  X(c, 3 * m)              /* descriptor */                                                       \
  X(gram, examples * (k + 1) * (k + 1))   /* weights: Gram matrix, factor, small vectors */       \
  X(corral, examples * (k + 1) * (k + 1))                                                         \
  X(small, examples * 5 * (k + 1))                                                                \
  X(padded_q, width)       /* what the kernels read and write */                                  \
  X(padded_f, width)                                                                              \
  X(padded_k, width * width)                                                                      \
  X(kernel_scratch, scratch)                                                                      \
  X(x, n)                  /* Newton: point, gradient, direction, trial, Hessian, its factor */   \
  X(g, n)                                                                                         \
  X(direction, n)                                                                                 \
  X(trial, n)                                                                                     \
  X(trial_g, n)                                                                                   \
  X(h, n * n)                                                                                     \
  X(factor, n * n)                                                                                \
  X(aside, r)              /* step: reduced/integrator.h's ahead and base */                       \
  X(base, r)                                                                                      \
  X(a, r)                  /* the motion so far: acceleration, the step before, and where the */  \
  X(q_before, r)           /* last step ended (the caller may have written q or v since) */       \
  X(v_before, r)                                                                                  \
  X(end_q, r)                                                                                     \
  X(end_v, r)                                                                                     \
  X(next_w, sets + k)         /* interpolation under way: kept only when the step succeeds */        \
  X(next_target, sets * r)                                                                               \
  X(load, free ? 0 : r)       /* force and gravity of a held object */                            \
  X(work, r)                                                                                      \
  X(set_w, regions ? sets + k : 0)     /* regions: weights of one set; the material's elements */  \
  X(kept_weight, regions ? s : 0)      /* less what relief leaves out */                          \
  X(cubic_scratch, cubic_words)  /* cubic path: scratch, and what it gave last */                  \
  X(cubic_at, cubic_words ? r : 0)                                                                \
  X(cubic_f, cubic_words ? r : 0)                                                                 \
  X(cubic_k, cubic_words ? r * r : 0)                                                             \
  X(guard_at, guard_groups * width) /* guards: where each group was looked at, and its way from there */ \
  X(guard_reach, guard_groups)                                                                    \
  X(guard_gone, guard_groups)       /* how far it is from there; largest growth of any group, */  \
  X(guard_most, guard_groups ? width : 0) /* and where the last step began */                     \
  X(guard_hub, guard_groups ? width : 0)                                                          \
  X(green_y0, greens)      /* Green-strain path (reduced/green.c) */                              \
  X(green_y, greens)                                                                              \
  X(green_last, greens)                                                                           \
  X(green_a, greens)                                                                              \
  X(green_c, greens * greens)                                                                     \
  X(green_w, k)                                                                                   \
  X(green_trial_w, k)                                                                             \
  X(green_jacobian, greens * width)                                                               \
  X(green_low, greens * width)                                                                    \
  X(green_f, greens ? r : 0)   /* W_StVK beside another material */                              \
  X(green_h, greens ? r * r : 0)                                                                  \
  X(contact_start, contacts ? r : 0) /* contact: q at the step's start, where friction takes */   \
  X(contact_lag, contacts ? r : 0)   /* normal forces from, after free flight; rows of one */     \
  X(contact_ahead, contacts ? r : 0) /* vertex */                \
  X(contact_rows, contacts ? 6 * (r + 6) : 0)                                                     \
  X(outer_g, n)            /* gradient of potentials outside the object */                        \
  X(inner_g, free ? n : 0) /* free motion: gradient without what is frozen, and */                \
  X(free_p, free)          /* reduced/free_step.h: momentum, unturned base and ahead at the */    \
  X(free_base, free)       /* start; where it was frozen, force, origin of the damping, q at the */ \
  X(free_ahead, free)      /* start of the step before; C, softening; dS/dq, H, G */              \
  X(free_at, free)                                                                                \
  X(free_force, free)                                                                             \
  X(free_still, free)                                                                             \
  X(free_q_before, free)                                                                          \
  X(free_scratch, free)                                                                           \
  X(free_c, free * free)                                                                          \
  X(free_n, free * free)                                                                          \
  X(free_ds, 6 * free)                                                                            \
  X(free_h, 3 * free)                                                                             \
  X(free_g, 3 * free)
// clang-format on

// What contact keeps from step to step and within one (reduced/contact.c).
typedef struct ep_contact {
  ep_frame start, lag, ahead; // of a free object, beside contact_start, contact_lag, contact_ahead
  double way;                 // longest way of a point in free flight
  ep_contact_memory memory;
} ep_contact;

struct ep_state {
  const ep_model *model;
  ep_kernel kernel;
  ep_green_kernel green_kernel;
  ep_guard_kernel guard_kernel;
  const char *isa;
  ep_cubic cubic;      // where the model's evaluator is cubic
  double cubic_energy; // at cubic_at, where cubic_known
  int cubic_known;
  double energy_noise, force_noise; // relative round-off of energies and residuals
  ep_kernel_term *term;             // (k + 2 sets) terms of one evaluation
  double energy_scale;              // sum_j w_j (lambda + 2 mu): energy at unit strain
  double force_scale;  // sum_j w_j (lambda + 2 mu) |G_j|: generalised force at unit strain
  double strain_scale; // max_j |G_j|_F: strain by a unit q
  ep_contact contact;
  double guard_calm;  // way from guard_hub on which no guard can reach its limit
  int guards_soft;    // parabolas in place of walls (reduced/guard.h)
  int guards_over;    // guards with J < 0 at the beginning of the step
  ep_unfold unfold;   // the way out of a jam
  int never_unfolds;  // ep_unfold_never
  int has_target;     // a target was found before
  double dt_before;   // of the last step; 0: none, or the frame or motion was set since
  int end_integrator; // of it
  ep_frame frame;     // free motion: reduced/frame.h; at the end of the last step
  double linear[3];   // momentum, angular momentum about the centre of mass; world axes
  double angular[3];
  double linear_rate[3], angular_rate[3]; // of the last step, without contact (Newmark)
  double c_before[3], linear_before[3], angular_before[3]; // at its beginning (BDF2)
  int touched;                                             // something outside acted in it
#define X(name, count) double *name;
  EP_STATE_ARRAYS(X)
#undef X
};

// (reduced/frame.c) Model space is the world; at rest.
void ep_state_rest_frame(ep_state *state);

// (reduced/model.c) The evaluator a model should use; EP_ERR_FORMAT and why where it lacks the
// arrays.
ep_evaluator ep_model_best_evaluator(const ep_model *model);
ep_status ep_model_check_evaluator(const ep_model *model, char *message);

// Evaluate the first `terms` of state->term at q: sum of the energies (each in its term), f (r) and
// k (r x r) unless NULL.
double ep_evaluate(ep_state *state, int terms, const double *q, double *f, double *k, int project);
// The same with another law than the model's.
double ep_evaluate_law(ep_state *state, ep_material material, int terms, const double *q, double *f,
                       double *k, int project);

// scale W by cubic polynomials, with the volume penalty where the material has it: its gradient and
// Hessian are added to f and h unless NULL. Only where the model's evaluator is cubic. Uses
// term[0]. The last result is kept: a gradient and then the Hessian at one point cost one
// evaluation.
double ep_cubic_add(ep_state *state, double scale, const double *q, double *f, double *h,
                    int project);

// What the examples' strains add to (1 - alpha or 1) W (eigenpose.h): alpha W_a, for a law other
// than StVK alpha (W_StVK + W_a), W_StVK with the volume penalty; added to f and h unless NULL.
double ep_green_potential(ep_state *state, const ep_green *green, const double *q, double *f,
                          double *h, int project);
// Factor of the material's own energy beside it.
double ep_green_share(const ep_model *model, const ep_green *green);
// strength W_a at q; its gradient and Hessian are added to f and h unless NULL (reduced/green.c).
double ep_green_add(ep_state *state, const ep_green *green, double strength, const double *q,
                    double *f, double *h);

// Terms of the example force with the targets as they are frozen, from `term` on: one for each
// region with strength. Returns how many terms there are then.
int ep_force_terms(ep_state *state, const ep_step_def *def, int terms);

// Weights and target of the state's q into next_w and next_target, and the target as undeformed
// shape of an energy into target_inverse and target_weight (without elements it crushes).
// ep_commit_target makes them those of the state. Needs k > 0.
ep_status ep_find_target(ep_state *state, const ep_step_def *def, ep_target_report *report);
void ep_freeze_target(ep_state *state);
void ep_commit_target(ep_state *state);

// ---- small dense algebra (reduced/newton.c), row-major n x n -----------------------------------
// Lower Cholesky factor of a into l (l may be a). 0 where a is not positive definite.
int ep_cholesky(int n, const double *a, double *l);
void ep_solve_lower(int n, const double *l, double *x); // x := L^-1 x
void ep_solve_lower_transposed(int n, const double *l, double *x);
double ep_dot(int n, const double *a, const double *b);

// ---- safeguarded Newton (reduced/newton.c) -----------------------------------------------------
typedef struct ep_newton {
  // Energy at x; gradient g and Hessian h unless NULL; project: positive semidefinite.
  double (*energy)(void *user, const double *x, double *g, double *h, int project);
  double (*residual)(void *user, const double *x, const double *g); // relative
  // Terms that follow the iterate are brought up to date at x (which it may rewrite in other
  // coordinates), the gradient with them: returns the energy. NULL: there are none.
  double (*refresh)(void *user, double *x, double *g);
  void *user;
  int n;                    // unknowns
  const double *cancelling; // size of the terms of the last energy, where they cancel; or NULL
  double tolerance;
  int max_iterations;
  int iterations, evaluations, line_search_steps, projections; // out
  double residual_now, energy_now;                             // out
} ep_newton;
// Minimise from state->x to state->x. EP_ERR_NUMERIC: no convergence, or not finite.
ep_status ep_newton_minimise(ep_state *state, ep_newton *newton);

#endif
