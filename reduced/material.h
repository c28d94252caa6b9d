// Constitutive laws as functions of the deformation gradient F (3x3 row-major): the plain scalar
// form, kept as the oracle of the lane kernels and used by the offline part. No dependency.
#ifndef EP_REDUCED_MATERIAL_H
#define EP_REDUCED_MATERIAL_H

typedef enum ep_material {
  EP_STVK,              // psi = lambda/2 tr(E)^2 + mu E:E, E = (F^T F - I)/2
  EP_STVK_VOLUME,       // the same plus 5 lambda min(0, J - 0.5)^2 (DESIGN "Cubature")
  EP_STABLE_NEOHOOKEAN, // Smith et al. 2018, in the cancellation-free strain form of DESIGN
  EP_COROTATIONAL,      // mu |F - R|^2 + lambda/2 tr(R^T F - I)^2
  EP_MATERIALS
} ep_material;

// Energy density [Pa] for Lame constants lambda, mu [Pa].
double ep_material_energy(ep_material model, double lambda, double mu, const double f[9]);
// First Piola-Kirchhoff stress P = dpsi/dF, row-major.
void ep_material_stress(ep_material model, double lambda, double mu, const double f[9],
                        double p[9]);
// Tangent dP/dF (9 x 9, row-major, symmetric).
void ep_material_tangent(ep_material model, double lambda, double mu, const double f[9],
                         double h[81]);

#endif
