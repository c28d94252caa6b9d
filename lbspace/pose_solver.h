// One alternation of LB-ARAP: local rotations, then the global step with the low coefficients met.
#ifndef EP_LBSPACE_POSE_SOLVER_H
#define EP_LBSPACE_POSE_SOLVER_H

#include "lbspace/private.h"
#include "linalg/petsc.h"

// What stays the same over the iterations. A = Phi^T M is m x n.
typedef struct ep_pose_solver {
  const ep_mesh *mesh;
  int m, held;                // coefficients; whether vertices are held
  double *gradient;           // (nt x 12)
  double *volume;             // (nt)
  double *vertex_volume;      // (nv) M 1
  int components, *component; // (nv)
  double *mphi;               // (m x n) A
  const double *phi, *lambda; // (m x n), (m)
  ep_factor *factor;          // of K with the held vertices, or one vertex of each component, held
  double *response;           // (m x n) rows of K_ff^-1 A^T; NULL where nothing is held
  double *compliance; // (m x m) inverse of A K_ff^-1 A^T + softness; NULL where nothing is held
  double *rhs, *next; // (n x 3)
} ep_pose_solver;

// held (n) or NULL. Borrowed: mesh, lb.
ep_status ep_pose_solver_make(const ep_mesh *mesh, const ep_lb *lb, int m,
                              const unsigned char *held, ep_pose_solver *s, ep_error *err);
void ep_pose_solver_free(ep_pose_solver *s);

// Replace the low coefficients of u (n x 3) by d (m x 3; NULL: zero): exactly where nothing is
// held.
void ep_pose_set_coefficients(ep_pose_solver *s, const double *d, double *u);
// One alternation on u (n x 3); *moved receives the largest displacement of a vertex.
ep_status ep_pose_iterate(ep_pose_solver *s, const double *d, double *u, double *moved,
                          ep_error *err);
// Coefficients of u: d (m x 3).
void ep_pose_coefficients(const ep_pose_solver *s, const double *u, double *d);
// The displacement x (n x 3) that minimises 1/2 |grad x|^2 - b.x with its low coefficients zero
// (nothing held) or on springs lambda_j / softness about zero (held). b (n x 3) sums to zero on
// each component where nothing is held; it may be s->rhs, which is lost.
ep_status ep_pose_solve(ep_pose_solver *s, const double *b, double *x, ep_error *err);
// What those springs hold: sum_j lambda_j / softness |Phi^T M u|_j^2, zero where nothing is held.
// d (m x 3): work.
double ep_pose_spring_energy(const ep_pose_solver *s, const double *u, double *d);

#endif
