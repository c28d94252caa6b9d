// Shared by the files of lbspace/ only.
#ifndef EP_LBSPACE_PRIVATE_H
#define EP_LBSPACE_PRIVATE_H

#include "lbspace/lbspace.h"

// Connected components: *count and component (nv), numbered by their lowest vertex.
ep_status ep_lb_components(const ep_mesh *mesh, int *count, int *component, ep_error *err);

// Choose signs, and rotations within groups of near-equal eigenvalues, by the mesh's geometry
// alone: see canonical.c. phi (count x n) M-orthonormal rows, lambda (count) ascending.
ep_status ep_lb_make_canonical(const ep_mesh *mesh, const ep_csr *mass, int count,
                               const double *lambda, double *phi, ep_error *err);
// One past the last eigenvalue that is near-equal to its neighbours from `first` on.
int ep_lb_group_end(int count, const double *lambda, int first);

#endif
