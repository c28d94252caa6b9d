// The Green-strain potential on all unknowns: reference of the reduced one, and the unreduced
// simulation of Zhang et al. 2015 (sec. 3.2, table 1).
//   W_a = -sum y_i^2, y_i = <O_i, E(u)>, gradient -2 sum y_i J_i, J_i = dy_i/du
//   Hessian -2 sum y_i G_i kron I3 - 2 sum J_i J_i^T
// The first part is as sparse as the elastic stiffness: it is that of StVK with the stress of
// E - alpha sum w_j E_j. The second has rank `count` and is kept as columns (Woodbury).
#ifndef EP_BAKE_GREEN_FULL_H
#define EP_BAKE_GREEN_FULL_H

#include "linalg/petsc.h"
#include "reduced/bake/green_strains.h"
#include "reduced/eigenpose.h"

typedef struct ep_green_full {
  ep_green_space space;
  double *stress; // (count x nt x 6) of the orthonormal strains O_i
  ep_green weak;  // weak constraints on the weights (alpha is not used); the caller may set them
  double *block;  // (count, k) small vectors and matrices, written by every evaluation:
  double *y0, *y, *w, *last, *trial_w, *ones, *factor, *system, *small;
} ep_green_full;

// As ep_green_space_create; without weak constraints.
ep_status ep_green_full_create(const ep_fem *fem, const double *weight, int k, const double *poses,
                               const double *share, ep_log *log, ep_green_full *out, ep_error *err);
void ep_green_full_free(ep_green_full *full);

// W_a at u (3n); force f (3n) = dW_a/du and weights w (k) unless NULL. y (count) out. NaN where the
// weak constraints have no solution (u not finite).
double ep_green_full_energy(ep_green_full *full, const double *u, double *y, double *f, double *w);
// k += alpha times the sparse part (3x3-block pattern), columns (count x 3n) = J_i, zero at held
// unknowns: d2(alpha W_a)/du2 = sparse part - 2 alpha columns^T C^-1 columns. C (count x count) is
// the identity, or that of the weak constraints at y (reduced/green_weights.h); it stays in full
// for the functions below.
void ep_green_full_stiffness(ep_green_full *full, double alpha, const double *u, const double *y,
                             ep_csr *k, double *columns);
// alpha > 0: (K - 2 alpha columns^T C^-1 columns)^-1 by Woodbury, factor of K: first the small
// matrix C / (2 alpha) - columns K^-1 columns^T and work (count x 3n) = K^-1 columns^T, then any
// number of solves x = (..)^-1 b. Errors: EP_ERR_NUMERIC where the whole is not positive definite.
ep_status ep_green_full_woodbury(ep_green_full *full, double alpha, ep_factor *factor,
                                 const double *columns, double *work, ep_error *err);
ep_status ep_green_full_solve(const ep_green_full *full, ep_factor *factor, const double *columns,
                              const double *work, const double *b, double *x, ep_error *err);
// image (3n) -= 2 alpha columns^T C^-1 columns x
ep_status ep_green_full_subtract(const ep_green_full *full, double alpha, const double *columns,
                                 const double *x, double *image, ep_error *err);

typedef struct ep_green_full_report {
  int iterations, projections; // projections: the exact stiffness was not positive definite
  double residual;             // |gradient| over |load|
  double energy;               // W + alpha W_a - load . u
} ep_green_full_report;
// Equilibrium: minimum of W(u) + alpha W_a(u) - load . u from u (3n, in: start, zero at held
// unknowns), safeguarded Newton until the residual is below 1e-8 or round-off stops it.
// Errors: EP_ERR_NUMERIC with the residual reached in 200 iterations.
ep_status ep_green_full_equilibrium(ep_green_full *full, double alpha, const double *load,
                                    double *u, ep_green_full_report *report, ep_error *err);

#endif
