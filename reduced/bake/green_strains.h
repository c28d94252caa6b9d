// The examples' Green strains as a space to project on (Zhang et al. 2015, sec. 3.2), shared by the
// reduced coefficients and the full-space version.
//
// Inner product <A, B> = 1/2 sum_e w_e A : C : B over tets with weights w: volumes (exact), or the
// weights of cubature elements and 0 elsewhere; C : B = lambda tr(B) I + 2 mu B, so that
// <E, E> = W_StVK. (The paper's E^T D E: its D carries V / 2 and takes engineering shear.)
#ifndef EP_BAKE_GREEN_STRAINS_H
#define EP_BAKE_GREEN_STRAINS_H

#include "base/log.h"
#include "reduced/bake/fem.h"

// Symmetric tensors are 6 numbers: xx yy zz xy xz yz.
typedef struct ep_green_space {
  const ep_fem *fem; // borrowed
  int k, count;      // examples; independent strains, count <= k
  double *stress;    // (k x nt x 6) 1/2 w_e chi_j C : E_j: <E_j, E> = sum_e stress_j : E
  double *gram;      // (k x k) Q_ij = <chi_i E_i, chi_j E_j>, the paper's Ep^T D Ep
  double *weights;   // (k x count) V: V V^T is the pseudo-inverse of Q, V^T Q V = I
  double *apart;     // (k) share of an example's strain energy outside the span of the others
} ep_green_space;

// poses (k x 3n) displacements; weight (nt) >= 0; share (k x nt) the regions chi in [0, 1], or
// NULL: every example acts everywhere. Correlations of strains below 1e-8 of the largest are
// dropped (rank-revealing, eigenvalues of Q scaled to a unit diagonal): what is left of an example
// there is 1e-4 of its strain; each example concerned is named by a warning.
// Errors: EP_ERR_ARGUMENT for an example without strain in its region (or only a rigid motion).
ep_status ep_green_space_create(const ep_fem *fem, const double *weight, int k, const double *poses,
                                const double *share, ep_log *log, ep_green_space *out,
                                ep_error *err);
void ep_green_space_free(ep_green_space *space);

// E = (A + A^T + A^T A) / 2 of tet e, A the displacement gradient of u, as 6 numbers.
void ep_green_strain6(const ep_fem *fem, int e, const double *u, double strain[6]);
// A : B
static inline double ep_inner6(const double a[6], const double b[6]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5]);
}

#endif
