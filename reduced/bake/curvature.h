// How the stiffness changes to first order from rest: what modal derivatives are made of.
#ifndef EP_BAKE_CURVATURE_H
#define EP_BAKE_CURVATURE_H

#include "reduced/bake/fem.h"

// C[ab][cd][ef] = d^3 psi / dF_ab dF_cd dF_ef at F = I, for every law of ep_material. Near rest all
// laws are linear in (lambda, mu), so two tensors serve all elements: C = lambda * by_lambda + mu *
// by_mu. Central differences of the analytic tangent, extrapolated (Richardson) to order 8 from
// steps of 1/32 to 1/256: exact but for round-off (~1e-13 of mu) for StVK, whose tangent is
// quadratic in F, and to the same digits for the others, whose further terms the extrapolation
// removes.
typedef struct ep_curvature {
  double by_lambda[729], by_mu[729];
} ep_curvature;
void ep_rest_curvature(ep_material model, ep_curvature *out);

// f (3n x pairs interleaved) = second derivatives of the internal force at rest,
//   f_ij = (H : u_j) u_i = d^2 f(s u_i + t u_j) / ds dt,  pairs (i, j), j <= i, at i (i + 1) / 2 +
//   j.
// u (count x 3n) rows. Errors: memory.
ep_status ep_fem_rest_curvature_forces(const ep_fem *fem, int count, const double *u, double *f,
                                       ep_error *err);

#endif
