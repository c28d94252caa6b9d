// The reduced basis: linear modes, modal derivatives, example path samples, mass-PCA.
// (Barbic and James 2005; Zhang et al. 2015 sec. 5; docs/method.md "Basis".)
#ifndef EP_BAKE_BASIS_H
#define EP_BAKE_BASIS_H

#include "base/log.h"
#include "reduced/bake/fem.h"

// Linear modes K psi = omega^2 M psi with the fixed vertices held, and all modal derivatives
// K Psi_ij = -(H : psi_j) psi_i, i >= j.
typedef struct ep_modes {
  int n, linear, derivatives; // derivatives = linear (linear + 1) / 2
  double *omega2;             // (linear) [1/s^2]
  double *mode;               // ((linear + derivatives) x 3n) rows
} ep_modes;
// Where nothing is fixed: the modes above the six rigid ones, and derivatives free of them.
// Errors: EP_ERR_UNSUPPORTED where something is fixed, but fewer than three non-collinear vertices.
ep_status ep_modes_compute(const ep_fem *fem, int linear, ep_log *log, ep_modes *out,
                           ep_error *err);
void ep_modes_free(ep_modes *modes);

// Samples of the path from rest to an example pose: x(w) = argmin |E(x) - w E(P)|^2_D (+ tiny
// regularisation), w = 1/samples .. 1, Newton in full space. pose (3n displacement), out (samples x
// 3n); the last sample is the pose itself.
ep_status ep_path_samples(const ep_fem *fem, const double *pose, int samples, ep_log *log,
                          double *out, ep_error *err);

typedef struct ep_basis {
  int n, r, examples;
  double *u;         // (r x 3n) rows: mode a is u[a * 3n ..]; U^T M_rho U = I; of a free object
                     // mass-orthogonal to the rigid modes at rest
  double *stiffness; // (r x r) K0 = U^T K(0) U
  double *example_q; // (examples x r): poses are exactly U q
  double *example_residual; // (examples) |pose - U q|_M / |pose|_M, round-off when in the span
} ep_basis;
// poses (examples x 3n) displacements, zero at fixed vertices, of a free object fitted to rest
// (ep_rigid_fit), or they are not in the span; paths (npaths x 3n) further samples
// (may be 0). Examples first (Gram-Schmidt twice), then mass-PCA of modes and paths scaled as in
// Barbic and James. r <= what the candidates span, else EP_ERR_ARGUMENT names the largest r.
ep_status ep_basis_build(const ep_fem *fem, const ep_modes *modes, int examples,
                         const double *poses, int npaths, const double *paths, int r, ep_log *log,
                         ep_basis *out, ep_error *err);
void ep_basis_free(ep_basis *basis);

#endif
