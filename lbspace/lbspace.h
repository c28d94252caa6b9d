// Volumetric Laplace-Beltrami space of a tet mesh: operators, eigenpairs, descriptors, poses.
// K phi = lambda M phi with linear elements, consistent mass, natural boundary (docs/method.md
// "Laplace-Beltrami space").
#ifndef EP_LBSPACE_LBSPACE_H
#define EP_LBSPACE_LBSPACE_H

#include "base/log.h"
#include "linalg/sparse.h"
#include "mesh/mesh.h"

typedef struct ep_lb {
  int n, m;       // vertices; eigenfunctions, the constant one(s) left out
  double volume;  // of the mesh
  double *lambda; // (m) ascending [1/length^2]
  double *phi;    // (m x n) rows are eigenfunctions, M-orthonormal [length^-3/2]
} ep_lb;

// K_ij = sum_e V_e g_i.g_j  and  M_ij = V_e/20 (1 + delta_ij), on the mesh's vertex pattern.
ep_status ep_lb_stiffness(const ep_mesh *mesh, ep_csr *k, ep_error *err);
ep_status ep_lb_mass(const ep_mesh *mesh, ep_csr *m, ep_error *err);

// The first `count` eigenpairs above the constants (one constant per component, left out), signs
// and rotations within near-multiple eigenvalues made canonical, so that repeats agree.
// Errors: count >= nv - components (EP_ERR_ARGUMENT), solver (EP_ERR_NUMERIC).
ep_status ep_lb_eigen(const ep_mesh *mesh, int count, ep_log *log, ep_lb *out, ep_error *err);
void ep_lb_free(ep_lb *lb);

// d = Phi^T M u: coefficients of a vertex field. u (n x 3), d (m x 3).
void ep_lb_project(const ep_lb *lb, const ep_csr *mass, const double *u, double *d);
// u = Phi d. d (m x 3), u (n x 3).
void ep_lb_reconstruct(const ep_lb *lb, const double *d, double *u);

// Complete a pose: the shape whose low LB coefficients are Phi^T M X + d and which is otherwise as
// rigid as possible (LB-ARAP, docs/method.md "Pose transfer").
// Nothing held: the coefficients are met exactly; the mean displacement (the constant function) is
// zero. Held vertices: that pose is first moved rigidly so that they come to rest as well as they
// can, its coefficients become the target, and a second LB-ARAP among the displacements that vanish
// there meets them up to coefficient_error (see pose_solver.c). Descriptors of the pose are then
// those of the u found (ep_lb_project), not d.
typedef struct ep_pose_options {
  int m;                     // coefficients used, <= lb->m
  int iterations;            // about 100
  double tolerance;          // stop when no vertex moves more than this times the extent
  const unsigned char *held; // (n) vertices that stay at rest, or NULL
} ep_pose_options;
ep_pose_options ep_default_pose_options(void);

typedef struct ep_pose_report {
  int iterations, inverted_tets;
  double worst_volume_ratio; // smallest deformed / rest tet volume
  double coefficient_error;  // |Phi^T M u - target| / |target| at the end; the target is d, or the
                             // coefficients of the seated pose; round-off unless vertices are held
} ep_pose_report;

// d (options->m x 3) [length^(1 + 3/2)], u (n x 3) the displacement found; report may be NULL.
// Errors: EP_ERR_ARGUMENT for m out of range or a coefficient that is not finite,
// EP_ERR_UNSUPPORTED where some component of the mesh has held vertices and another none,
// EP_ERR_NUMERIC.
ep_status ep_lb_pose(const ep_mesh *mesh, const ep_lb *lb, const double *d,
                     const ep_pose_options *options, double *u, ep_pose_report *report,
                     ep_error *err);

// Give volume back to the tets a pose has inverted or crushed, moving the rest as little as
// possible (pose_repair.c): least change of the deformation gradients,
//   min sum_e V_e |F_e(u) - F_e(u0)|^2  with  det F_e(u) >= target  for every tet,
// the first m coefficients Phi^T M u kept: exactly where nothing is held, else up to the softness
// of ep_lb_pose. Held vertices do not move. A pose without such tets is left as it is, bit by bit.
// Where some cannot be repaired the pose that leaves fewest of them is kept, be it the one given.
typedef struct ep_repair_options {
  int m;                     // coefficients kept, <= lb->m; 0: none, lb may then be NULL
  const unsigned char *held; // (n) vertices that do not move, or NULL
  double floor;              // smallest deformed / rest volume that is no crushed tet: 0.05
  double target;             // what crushed tets are given: 0.12
  int iterations;            // Gauss-Newton steps at most; 0: the pose is left as it is
} ep_repair_options;
ep_repair_options ep_default_repair_options(void);

typedef struct ep_repair_report {
  int inverted_before, inverted_after; // volume <= 0
  int crushed_before, crushed_after;   // volume < floor, inverted ones counted too
  double worst_before, worst_after;    // smallest deformed / rest volume
  double moved, moved_most; // rms (by volume) and largest move of a vertex over the diagonal
  double moved_share;       // rms move over the rms displacement of the pose itself
  double coefficient_shift; // |Phi^T M (u - u0)| / |Phi^T M u0| over the first m; 0 where m is 0
  int iterations;
} ep_repair_report;

// u (n x 3): in the pose, out the repaired one. What could not be repaired is in the report, and is
// no error here. Errors: EP_ERR_ARGUMENT for options out of range or a u that is not finite,
// EP_ERR_UNSUPPORTED as in ep_lb_pose, EP_ERR_NUMERIC.
ep_status ep_lb_repair(const ep_mesh *mesh, const ep_lb *lb, const ep_repair_options *options,
                       double *u, ep_repair_report *report, ep_error *err);

#endif
