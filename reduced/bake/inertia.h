// What an object nothing holds needs of the bake (docs/method.md "Free motion"): its six rigid
// modes, to keep the basis free of them; supports that take them out of equations; the best rigid
// fit of a pose to rest; the inertia sums of the moving frame.
#ifndef EP_BAKE_INERTIA_H
#define EP_BAKE_INERTIA_H

#include <stdbool.h>

#include "reduced/bake/fem.h"

static inline bool ep_fem_is_free(const ep_fem *fem) {
  return fem->nheld == 0;
}

// mass: scalar consistent mass with density (ep_fem_scalar_mass). Positions are those at rest.
// Total mass and centre of mass.
double ep_inertia_center(const ep_mesh *mesh, const ep_csr *mass, double center[3]);

// Six mass-orthonormal rigid modes at rest, rows of modes (6 x 3n), and M times them (6 x 3n).
// Errors: EP_ERR_MESH where all vertices lie on a line.
ep_status ep_rigid_modes(const ep_mesh *mesh, const ep_csr *mass, double *modes, double *mass_modes,
                         ep_error *err);

// Marks six unknowns of held (3n, zero before) whose support stops every rigid motion and nothing
// else: three of one vertex, two of a far one, one of a third. What is in equilibrium stays free of
// reactions.
void ep_rigid_supports(const ep_mesh *mesh, unsigned char *held);

// Displacement u (3n) becomes R (X + u) + t - X with the R, t that bring it nearest to rest in the
// mass norm (Kabsch with the consistent mass): then sum m u = 0 and sum m X x u = 0, so that u is
// mass-orthogonal to the rigid modes.
ep_status ep_rigid_fit(const ep_mesh *mesh, const ep_csr *mass, double *u, ep_error *err);

// The sums of reduced/model_arrays.h for modes u (r x 3n): mass (1), origin (3), s0 (6),
// s1 (6 x r), s2 (6 x r (r + 1) / 2), h (3 x r (r + 1) / 2).
ep_status ep_inertia_sums(const ep_mesh *mesh, const ep_csr *mass, int r, const double *u,
                          double *total, double *origin, double *s0, double *s1, double *s2,
                          double *h, ep_error *err);

#endif
