// One element at a time: deformation gradients in, forces and stiffness blocks out. Shared by every
// potential of the offline part that is a sum over elements of a function of F.
#ifndef EP_BAKE_FEM_ASSEMBLY_H
#define EP_BAKE_FEM_ASSEMBLY_H

#include "reduced/bake/fem.h"

// F = I + sum_v u_v g_v^T of tet e (row-major 3x3). u (3 nv).
void ep_fem_deformation(const ep_fem *fem, int e, const double *u, double f[9]);
// The same without I: the displacement gradient.
void ep_fem_displacement_gradient(const ep_fem *fem, int e, const double *u, double d[9]);
// force_v += scale P g_v for the four vertices of tet e. force (3 nv).
void ep_fem_scatter_stress(const ep_fem *fem, int e, double scale, const double p[9],
                           double *force);
// K_vw += scale g_v . H . g_w: the tangent H = dP/dF (9x9) spread over the 16 blocks of tet e.
void ep_fem_scatter_tangent(const ep_fem *fem, int e, double scale, const double h[81], ep_csr *k);

#endif
