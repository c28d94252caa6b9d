// Full-space finite elements of an elastic object: what every offline stage evaluates.
#ifndef EP_BAKE_FEM_H
#define EP_BAKE_FEM_H

#include "linalg/sparse.h"
#include "mesh/mesh.h"
#include "reduced/material.h"

typedef struct ep_fem {
  const ep_mesh *mesh; // borrowed
  ep_material model;   // constitutive law, the same everywhere
  double *gradient;    // (nt x 12) shape function gradients at rest [1/length]
  double *volume;      // (nt)
  double *lambda, *mu; // (nt) Lame constants [Pa]
  double *density;     // (nt)
  unsigned char *held; // (3 nv) fixed unknowns
  int nheld;           // fixed vertices
  int *slot;           // (nt x 16) place of vertex tet[j] among the neighbours of tet[i], ascending
} ep_fem;

// material: (nmaterials) used through mesh->tet_material, or one for all. Numbers repeated in fixed
// (nfixed vertices of the mesh) count once.
// Errors: EP_ERR_MESH names a degenerate tet; EP_ERR_ARGUMENT a density or Young's modulus that is
// not positive, Poisson's ratio outside [0, 0.5), a fixed vertex that does not exist.
ep_status ep_fem_create(const ep_mesh *mesh, ep_material model, int nmaterials,
                        const ep_elastic *material, int nfixed, const int *fixed, ep_fem *out,
                        ep_error *err);
void ep_fem_free(ep_fem *fem);

// Mean Young's modulus, by volume, over the extent [Pa/m]: the unit of the contact's stiffness.
double ep_fem_contact_unit(const ep_fem *fem);

// Displacement u (3 nv). Energy; internal force f = dW/du (3 nv); stiffness K = d2W/du2 on
// ep_csr_from_tets(.., block 3). project != 0: element blocks projected to positive semidefinite.
double ep_fem_energy(const ep_fem *fem, const double *u);
void ep_fem_force(const ep_fem *fem, const double *u, double *f);
void ep_fem_stiffness(const ep_fem *fem, const double *u, int project, ep_csr *k);
// K(0) on a pattern of its own.
ep_status ep_fem_rest_stiffness(const ep_fem *fem, ep_csr *k, ep_error *err);
// Consistent mass with density, 3x3-block pattern.
ep_status ep_fem_mass(const ep_fem *fem, ep_csr *m, ep_error *err);
// y = M_rho u for fields (nv x 3) without building the 3n matrix: scalar mass m (nv), width 3.
ep_status ep_fem_scalar_mass(const ep_fem *fem, ep_csr *m, ep_error *err);

#endif
