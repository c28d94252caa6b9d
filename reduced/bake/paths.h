// The path from rest to an example pose by shrinking its Green strain (Zhang et al. 2015, sec. 5).
#ifndef EP_BAKE_PATHS_H
#define EP_BAKE_PATHS_H

#include "linalg/petsc.h"
#include "reduced/bake/fem.h"

// The potential minimised at strength w, with D the isotropic elasticity (lambda, mu):
//   W(u) = sum_e V (lambda/2 tr(Z)^2 + mu Z : Z),  Z = E(u) - w E(P),  E = (F^T F - I) / 2
// strain (nt x 9) holds E(P). Energy at u (3n) and force g (3n) unless NULL; stiffness into k
// (3x3-block pattern).
// project != 0: the Gauss-Newton part only, which is positive semidefinite.
typedef struct ep_strain_fit {
  const ep_fem *fem;
  const double *strain;
  double w;
} ep_strain_fit;
double ep_strain_fit_energy(const ep_strain_fit *fit, const double *u, double *g);
void ep_strain_fit_stiffness(const ep_strain_fit *fit, const double *u, int project, ep_csr *k);
// E(u) of each tet (nt x 9, row-major).
void ep_green_strains(const ep_fem *fem, const double *u, double *strain);

typedef struct ep_strain_fit_report {
  int iterations, projections;
  double residual; // Newton decrement over |w E(P)|_D
  double energy;   // W at the end
} ep_strain_fit_report;

// Newton from u (3n, in: start, zero at held unknowns; out: minimum). A proximal term
// 1e-8/2 |u - start|^2_K0 keeps crushed elements from making the system singular.
//   factor: of a matrix on the mesh's 3x3-block pattern with the held unknowns (only its symbolic
//   part matters); k0: K(0); k: work matrix on the same pattern.
// Errors: EP_ERR_NUMERIC where even the Gauss-Newton stiffness has no Cholesky factor.
ep_status ep_strain_fit_minimise(const ep_strain_fit *fit, ep_factor *factor, const ep_csr *k0,
                                 ep_csr *k, double *u, ep_strain_fit_report *report, ep_error *err);

#endif
