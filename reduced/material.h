// Constitutive laws as functions of the deformation gradient F (3x3 row-major): the plain scalar
// form, kept as the oracle of the lane kernels and used by the offline part. No dependency.
#ifndef EP_REDUCED_MATERIAL_H
#define EP_REDUCED_MATERIAL_H

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ep_material {
  EP_STVK,              // psi = lambda/2 tr(E)^2 + mu E:E, E = (F^T F - I)/2
  EP_STVK_VOLUME,       // the same plus k/2 min(0, J - 0.5)^2, k = 10 max(lambda, mu):
                        // 10 lambda from Poisson's ratio 0.25 on; below, mu keeps the penalty
                        // alive (lambda = 0 at ratio 0)
  EP_STABLE_NEOHOOKEAN, // Smith et al. 2018, in the cancellation-free strain form of
                        // docs/method.md "Elastic energy"
  EP_COROTATIONAL,      // mu |F - R|^2 + lambda/2 tr(R^T F - I)^2, R the nearest rotation
  EP_MATERIALS
} ep_material;

// Energy density [Pa] for Lame constants lambda, mu [Pa].
double ep_material_energy(ep_material model, double lambda, double mu, const double f[9]);
// First Piola-Kirchhoff stress P = dpsi/dF, row-major.
void ep_material_stress(ep_material model, double lambda, double mu, const double f[9],
                        double p[9]);
// Tangent dP/dF (9 x 9, row-major, symmetric). Corotational: where F is inverted and two singular
// values cancel (s_2 + s_3 -> 0) the rotation has no derivative; there the tangent is capped.
void ep_material_tangent(ep_material model, double lambda, double mu, const double f[9],
                         double h[81]);

// Nearest positive semidefinite matrix to a symmetric 9 x 9 (negative eigenvalues set to zero;
// cyclic Jacobi). Left as it is where it has none.
void ep_material_project(double h[81]);

// Nearest rotation R to F: argmax tr(R^T F) over det R = +1 (Horn 1987: largest eigenvector of a
// symmetric 4 x 4). Always a rotation, also for inverted or singular F.
void ep_material_rotation(const double f[9], double r[9]);

// Names as in scenes and model files ("stvk", "stvk-volume", "neohookean", "corotational");
// NULL outside the enumeration.
const char *ep_material_name(ep_material model);

#ifdef __cplusplus
}
#endif
#endif
