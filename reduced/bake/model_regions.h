// The part of a model that regions need (reduced/region.h): weighted functions and motion.
#ifndef EP_BAKE_MODEL_REGIONS_H
#define EP_BAKE_MODEL_REGIONS_H

#include "base/error.h"
#include "reduced/bake/basis.h"

// One set of examples and where it acts.
typedef struct ep_region_part {
  const double *weight; // (nv) in [0, 1]; NULL: everywhere
  int m;                // LB eigenfunctions of its descriptor
} ep_region_part;

// Whether nothing holds the region, so that the rest of the object may carry it anywhere: fewer
// than three of its vertices with a weight above 1/2 are fixed.
bool ep_region_carried(const ep_fem *fem, const ep_region_part *region);

// out (nv) = M_R phi, M_R = sum over tets of their share of the region times V/20 (1 + delta): the
// plain volume mass where the region is everywhere.
void ep_region_mass(const ep_mesh *mesh, const ep_region_part *region, const double *phi,
                    double *out);

// What tells the motion of the region as a whole: with b = M_R 1 / (1^T M_R 1), Xc = sum b_v X_v,
// rows 0..8 of map (12 x r) and rest (12): A = sum_v b_v x_v (X_v - Xc)^T row-major; rows 9..11:
// the centre sum_v b_v x_v. Errors: EP_ERR_MEMORY.
ep_status ep_region_motion(const ep_basis *basis, const ep_mesh *mesh, const ep_region_part *region,
                           double *map, double *rest, ep_error *err);

// Share of tet e in the region: the mean weight of its vertices.
double ep_region_share(const ep_mesh *mesh, const ep_region_part *region, int e);

#endif
