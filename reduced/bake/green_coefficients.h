// Polynomial coefficients of the Green-strain path in reduced coordinates (Zhang et al. 2015,
// sec. 4.2): with O_i = sum_j V_ji E_j the orthonormal strains of a space,
//   y_i(q) = <O_i, E(U q)> = linear_i . q + 1/2 q^T B_i q.
// B_i = U^T (G_i kron I3) U with the scalar geometric stiffness G_i,vw = sum_e g_v . S_i g_w of the
// stress S_i of O_i, and linear_i = U^T of its forces: sparse products, no loop over elements and
// pairs of modes.
#ifndef EP_BAKE_GREEN_COEFFICIENTS_H
#define EP_BAKE_GREEN_COEFFICIENTS_H

#include "reduced/bake/basis.h"
#include "reduced/bake/green_strains.h"

typedef struct ep_green_coefficients {
  int r, k, count; // count: independent strains
  double *b;       // (count x r x r) symmetric
  double *linear;  // (count x r)
  double *weights; // (k x count) w = V y
  double *energy;  // (k) strain energy of each example [J]
} ep_green_coefficients;

// Coefficients of the basis' own examples: poses NULL for U q_i as the basis holds them, or the
// poses themselves (basis->examples x 3n) where they are not in its span. weight, share: as in
// green_strains.h.
ep_status ep_green_coefficients_compute(const ep_fem *fem, const ep_basis *basis,
                                        const double *poses, const double *weight,
                                        const double *share, ep_log *log,
                                        ep_green_coefficients *out, ep_error *err);
void ep_green_coefficients_free(ep_green_coefficients *coefficients);

#endif
