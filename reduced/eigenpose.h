// Eigenpose run time: one immutable model, many small states, one step function.
//
// No library but libm, no allocation, no input or output, no globals: an engine maps an .epm file,
// opens the model in place, gives each state a block of memory and calls ep_step. The model is
// shared by any number of states, which may step in parallel.
#ifndef EP_REDUCED_EIGENPOSE_H
#define EP_REDUCED_EIGENPOSE_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"
#include "reduced/cubic.h"
#include "reduced/frame.h"
#include "reduced/integrator.h"
#include "reduced/material.h"
#include "reduced/model_arrays.h"
#include "reduced/obstacle.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef int32_t ep_model_int32; // "int32" of the array list
typedef double ep_model_double;
typedef float ep_model_float;

typedef struct ep_model_sizes {
#define X(name) int name;
  EP_MODEL_SIZES(X)
#undef X
} ep_model_sizes;

// How the elastic energy of a step is evaluated: by cubature (any material), or exactly by cubic
// polynomials (StVK; reduced/cubic.h) in doubles or floats. With EP_STVK_VOLUME the polynomial
// carries the penalty of the cubature elements beside it. Floats: of polynomials, residuals below
// 1e-5 are round-off; of cubature, energy and force are those of a model whose G is rounded to
// floats (6e-8), in doubles, and the stiffness is right to 1e-6: Newton converges as with doubles.
typedef enum ep_evaluator {
  EP_EVALUATE_CUBATURE,
  EP_EVALUATE_CUBIC,
  EP_EVALUATE_CUBIC_FLOAT,
  EP_EVALUATE_CUBATURE_FLOAT
} ep_evaluator;

static inline int ep_is_cubature(ep_evaluator evaluator) {
  return evaluator == EP_EVALUATE_CUBATURE || evaluator == EP_EVALUATE_CUBATURE_FLOAT;
}

// All arrays are borrowed from the bytes the model was opened in (or from a baker's memory).
typedef struct ep_model {
  ep_model_sizes size;
  ep_material material; // constitutive law at the cubature elements
  // The exact one where the model has it (double before float). May be set to another the model has
  // the arrays of, before states are made.
  ep_evaluator evaluator;
  double rest_scale; // extent of the rest shape: twice the largest distance of a vertex
                     // from its centroid; a box's diagonal [length]
#define X(type, name, d1, d2, d3) const ep_model_##type *name;
  EP_MODEL_ARRAYS(X)
#undef X
} ep_model;

// Open an .epm (docs/method.md "Model file") in memory: `bytes` 64-byte aligned, kept by the caller
// as long as the model is used. Every offset, size and dtype is checked, contents (finite, weights
// >= 0) too.
//   message (may be NULL; at least 256 chars): what is wrong and where.
// Errors: EP_ERR_FORMAT (truncated, foreign, future schema), EP_ERR_ARGUMENT (alignment).
ep_status ep_model_open(const void *bytes, size_t size, ep_model *model, char *message);

// The layout of cubature_g. g (s x 9 x r) row-major: dF/dq of each cubature element, row 3 i + j of
// F; out (s x blocks x 72), blocks = ceil(r / 8), i.e. ep_packed_cubature_size(r, s) doubles.
size_t ep_packed_cubature_size(int r, int s);
void ep_pack_cubature(int r, int s, const double *g, double *out);
// The same for cubature_g_float: (s x 9 x 16 ceil(r / 16)), modes beyond r zero. EP_ERR_NUMERIC
// where a number does not fit a float.
size_t ep_packed_cubature_float_size(int r, int s);
ep_status ep_pack_cubature_float(int r, int s, const double *g, float *out);
// The layout of green_b, one matrix: b (r x r) symmetric, row-major; out ep_packed_green_size(r)
// doubles: the lower triangle in 8 x 8 tiles, half the diagonal (reduced/green.h).
size_t ep_packed_green_size(int r);
void ep_pack_green(int r, const double *b, double *out);

// ---- state -----------------------------------------------------------------------------------
typedef struct ep_state ep_state;
// Bytes of one state with all scratch memory a step needs; 64-byte aligned block from the caller.
size_t ep_state_bytes(const ep_model *model);
// The model must outlive the state. Starts at rest. Errors: EP_ERR_ARGUMENT (too small, unaligned),
// EP_ERR_NUMERIC (K0 is not positive definite).
ep_status ep_state_init(const ep_model *model, void *memory, size_t bytes, ep_state **out);
const ep_model *ep_state_model(const ep_state *state);
const double *ep_state_k0_factor(const ep_state *state);  // L (r x r, lower), K0 = L L^T
void ep_state_solve_k0(const ep_state *state, double *x); // x (r) := K0^-1 x
const char *ep_state_isa(const ep_state *state); // kernels in use: "baseline", "avx2", "avx512"
// Use these kernels instead of the widest the processor runs; all give the same bits. Errors:
// EP_ERR_UNSUPPORTED (not on this processor), EP_ERR_ARGUMENT (no such name): nothing is changed.
ep_status ep_state_use_isa(ep_state *state, const char *name);
ep_status ep_isa_check(const char *name);              // would it take this name?
double *ep_state_q(ep_state *state);                   // (r) reduced coordinates, may be written
double *ep_state_velocity(ep_state *state);            // (r) may be written
const double *ep_state_weights(const ep_state *state); // (k) example weights of the last step
// (regions x r) target configurations of the last step, regions = ep_model_regions.
const double *ep_state_target(const ep_state *state);

// All that a state carries from a step into the next - configuration, motion, place, the target of
// the interpolation, what integrators, guards and unfolding remember - as a list of numbers: to put
// a state aside, or another of the same model in its place, which then goes on with the same bits.
// q and velocity alone (above) begin a new motion. set: EP_ERR_ARGUMENT where it is no list of a
// state of this model and version; the state is unchanged.
size_t ep_state_history_size(const ep_state *state);
void ep_state_get_history(const ep_state *state, double *out); // (size)
ep_status ep_state_set_history(ep_state *state, size_t count, const double *history);

// ---- free motion (reduced/frame.h) -----------------------------------------------------------
// A model is free where nothing holds it (size.rigid): its states then move as a whole too. For a
// held model the frame stays the identity about the origin: world and model space are the same.
const ep_frame *ep_state_frame(const ep_state *state); // at the end of the last step
// Put the object elsewhere, keeping its momenta. Errors: EP_ERR_ARGUMENT (held, not finite, R no
// rotation to 1e-9).
ep_status ep_state_set_frame(ep_state *state, const ep_frame *frame);
// Velocity of the centre of mass and angular velocity [rad/s], both in world axes; set: momenta
// follow for the state's q and velocity. Errors: EP_ERR_ARGUMENT (held, not finite).
void ep_state_motion(const ep_state *state, double velocity[3], double spin[3]);
ep_status ep_state_set_motion(ep_state *state, const double velocity[3], const double spin[3]);
// Linear momentum and angular momentum about the centre of mass, world axes; 0 for a held model.
void ep_state_momentum(const ep_state *state, double linear[3], double angular[3]);
// Positions in the world (n x 3): c + R (X - X_0 + U q), for a held model X + U q.
void ep_state_positions(const ep_state *state, double *x);

// ---- energies --------------------------------------------------------------------------------
// (Not ep_elastic: that is the type of material constants in mesh/mesh.h.)
// Elastic energy of the model at q by its evaluator, with that of its guards; f (r) = dW/dq and
// stiffness k (r x r, symmetric, both triangles) unless NULL. project != 0: element tangents
// projected to positive semidefinite. Uses the state's scratch, changes nothing else.
double ep_elastic_energy(ep_state *state, const double *q, double *f, double *k, int project);

// Energy of deforming the examples, weighted by w (k), into configuration q:
//   sum_i w_i sum_j w_j v_ij psi(F_j(q) F_ij^-1)   (Zhao et al. 2018 eq. 4 and 6; docs/method.md
// "Shape interpolation"; v_ij: |det F_ij|, less where squeezed, reduced/reference.h), gradient f
// and Hessian h as in ep_elastic_energy.
double ep_example_energy(ep_state *state, const double *w, const double *q, double *f, double *h,
                         int project);

// Sets of examples: size.regions, 1 where all examples act everywhere. Each has weights and a
// target of its own (Zhao et al. 2018, sec. 5 "Local examples"; reduced/region.h). What is counted
// over shapes is in the order: rest of each set, then the examples.
int ep_model_regions(const ep_model *model);

// c = c0 + T q (Zhao et al. 2018, sec. 4.2): q (r), c (3m). Of a region nothing holds, the motion
// as a whole is taken out before: c is then that of R^T (x - xc) + Xc, not linear in q.
void ep_descriptor(const ep_model *model, const double *q, double *c);

// Weights: min 1/2 |sum_i w_i e_i - c|^2, sum w = 1, w >= 0 over the rest shape and the examples
// (Zhao et al. 2018 eq. 5), of each region by itself. c (3m); w (regions + k), the first belong to
// the rest shape. Exact active set.
ep_status ep_example_weights(ep_state *state, const double *c, double *w);

// ---- target ----------------------------------------------------------------------------------
// How the target configuration is found: NULL for the built-in Newton, or another solver (NLopt in
// the offline part). Minimise ep_target_energy from q (r, in: warm start, out: minimum).
typedef struct ep_target_report {
  int evaluations, iterations; // of all regions and rounds (reduced/target.c)
  double relative_gradient;    // ep_target_residual at the end, the largest of all regions
} ep_target_report;
typedef ep_status (*ep_target_solver)(void *user, ep_state *state, const double *w, double *q,
                                      double tolerance, ep_target_report *report);
// w (regions + k) as from ep_example_weights: rest counts as one more example with F_i = I. With
// regions: the sum over those with weight of their own energies, over their elements only, and of
// 1/100 of the energy of what lies outside, which settles how the region's target goes on there.
double ep_target_energy(ep_state *state, const double *w, const double *q, double *f, double *h,
                        int project);
// |L^-1 g|, K0 = L L^T, over sqrt(sum_i w_i |L^T (q_w - q_i)|^2), q_w = sum w_i q_i: what the
// gradients of the single energies are to first order, so a warm start changes nothing in it.
double ep_target_residual(ep_state *state, const double *w, const double *g);
ep_status ep_target_newton(void *user, ep_state *state, const double *w, double *q,
                           double tolerance, ep_target_report *report);

// ---- Green-strain example potential ----------------------------------------------------------
// The potential W_a of Zhang et al. 2015 (eq. 8 to 10), W_StVK + alpha W_a >= 0 for alpha <= 1,
// with the weights of the examples explicit in q (reduced/green.c). A model has it where
// size.greens > 0.
typedef struct ep_green {
  double alpha;        // share of the examples, 0 (none) to 1 (no resistance along the examples)
  double sum_to_one;   // weak constraints on the weights: quadratic penalties in units of the
  double non_negative; // examples' mean strain energy; 0: none
} ep_green;
int ep_green_valid(const ep_green *green); // alpha in [0, 1], penalties finite and >= 0

// W_a at q, gradient f (r) and Hessian h (r x r, both triangles) unless NULL; alpha is not applied.
// 0 where the model has no such coefficients; NaN where q is not finite.
double ep_green_energy(ep_state *state, const ep_green *green, const double *q, double *f,
                       double *h);
// (k) weights of the examples at the last evaluation; the rest shape has what is missing to 1.
const double *ep_state_green_weights(const ep_state *state);

// ---- step ------------------------------------------------------------------------------------
typedef enum ep_example_force { EP_EXAMPLE_ENERGY, EP_EXAMPLE_LINEAR } ep_example_force;

// How obstacles resist (reduced/contact_point.h); 0: chosen. What rests sinks in by a part of the
// thickness; the deeper, the stiffer, so that impacts end above `depth`.
typedef struct ep_contact_def {
  double stiffness; // pressure per depth [Pa/m]; 0: 100 times Young's modulus over the extent
  double thickness; // contact begins at this distance [length]; 0: 0.2 % of the extent
  double depth;     // bound of the penetration in impacts [length]; 0: 1 % of the extent
  double damping;   // of the normal motion [s]: pressure damping x stiffness x speed
} ep_contact_def;

// A force whose direction is fixed in the world, spread over vertices: f_i = w_i force, sum w = 1.
typedef struct ep_pull {
  double force[3];     // [N]
  double at[3];        // sum w_i (X_i - X_0) [length]
  const double *modes; // (r x 3) sum w_i U_a,i
} ep_pull;

// A potential of where the object is, besides obstacles: springs, fields, an engine's own contact.
// frame: where a free object stands (the identity for a held one), q (r). Returns the energy; adds
// its gradient to g (n) and a positive semidefinite Hessian to h (n x n row-major) unless NULL.
// Unknowns: n = r for a held object; n = r + 6 for a free one: q, translation, rotation vector
// about frame->c, both in world axes: dx_i = dc + dtheta x (x_i - c) + R U_i dq.
typedef double (*ep_outer_potential)(void *user, const ep_state *state, const ep_frame *frame,
                                     const double *q, double *g, double *h, int n);

typedef struct ep_step_def {
  int cookie;               // set by ep_default_step; a def made otherwise is refused
  ep_integrator integrator; // EP_IMPLICIT_EULER
  double dt;                // [s]
  const double *force;      // (r) generalised external force U^T f, or NULL; of a free object:
  // forces that turn with it
  double gravity[3];        // [m/s^2] on everything: all of its weight, beside `force`
  int pulls;                // forces fixed in the world, free objects only
  const ep_pull *pull;      // (pulls)
  ep_outer_potential outer; // a potential of the world acting on the object, or NULL
  void *outer_user;
  double damping_mass;           // Rayleigh alpha [1/s]
  double damping_stiffness;      // Rayleigh beta [s], against K0
  double strength;               // example strength; 1: as stiff as the material itself; 0: none
  const double *region_strength; // (regions) factor of strength in each, >= 0; NULL: 1
  double relief;                 // share of the material's own energy left out while an example
                                 // force acts, 0 (default) to 1: the object then yields along the
                                 // examples (stiffness 1 - relief) and keeps 1 - relief + strength
                                 // across them (Zhang et al. 2015 eq. 3 has relief = strength);
                                 // with regions: there only, and only by cubature
  ep_green green; // Green-strain potential (alpha 0: none). StVK: W + alpha W_a; another material:
                  // (1 - alpha) W + alpha (W_StVK with volume penalty + W_a)
  ep_example_force example_force; // energy (target as undeformed shape) or strength K0 (q_t - q)
  ep_target_solver target_solver; // NULL: ep_target_newton
  void *target_user;
  double target_tolerance;     // relative gradient of the interpolation (1e-6)
  double tolerance;            // relative residual of the step's Newton (1e-6)
  int max_iterations;          // Newton iterations (50)
  const ep_obstacle *obstacle; // (obstacles) with their poses at the step's start and end, borrowed
  int obstacles;               // 0: none. They act where the model has contact vertices
  ep_contact_def contact;
} ep_step_def;
ep_step_def ep_default_step(void);
// 1 where ep_step accepts it for some model: made by ep_default_step, every number in range and
// finite (those of `force` and `modes` are not looked at: they show in the energy).
int ep_step_def_valid(const ep_step_def *def);

typedef struct ep_contact_report {
  int touching;     // pairs of vertex and obstacle nearer than the thickness
  double deepest;   // penetration below the obstacles' surface at the end of the step [length]
  double force[3];  // on the object [N], friction and damping included
  double torque[3]; // about the frame's origin (held object: about the origin) [N m]
  double pressing;  // sum of the normal forces' sizes [N]
  double energy;    // stored in the penalty [J]
  double stiffness; // in use [Pa/m]
  int passes;       // times the step was solved again for friction
} ep_contact_report;

typedef struct ep_step_report {
  int newton_iterations, line_search_steps, projections; // projections: Cholesky failed, fell back
  double residual;                                       // relative, at the end
  ep_target_report target;
  double elastic_energy, example_energy, kinetic_energy;
  ep_contact_report contact;
  double green_energy; // of the Green-strain potential: alpha W_a (negative), or its mixed form
  int unfolding; // 1: the object was jammed turned over and unfolds: elastic_energy is that of
                 // the unfolding, examples did not act (docs/green-strain.md)
} ep_step_report;

// One implicit step: weights and target from the state's q, then the minimum of the incremental
// potential with the target frozen. Writing q or velocity, or another integrator, between steps is
// fine: the two-step formula and the acceleration then start anew. report may be NULL.
// A free object moves as a whole too: gravity, pulls and outer potentials change its momenta,
// nothing else does (but damping_mass, a drag against the still world). The state's frame moves
// with them. Errors: EP_ERR_ARGUMENT (def, or pulls of a held object), EP_ERR_NUMERIC (no
// convergence, NaN): the state is unchanged.
ep_status ep_step(ep_state *state, const ep_step_def *def, ep_step_report *report);

// The example force of a step with the target of the last interpolation (ep_interpolate, ep_step)
// as a potential: its energy at q, gradient f and Hessian h as in ep_elastic_energy, with
// def->strength and def->example_force. Zero without examples.
double ep_example_force_energy(ep_state *state, const ep_step_def *def, const double *q, double *f,
                               double *h, int project);

// Only the interpolation part of a step, for timing and for engines that run it less often.
ep_status ep_interpolate(ep_state *state, const ep_step_def *def, ep_target_report *report);

// Vertex positions x = X + U q (n x 3).
void ep_positions(const ep_model *model, const double *q, double *x);

#ifdef __cplusplus
}
#endif
#endif
