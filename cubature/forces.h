// Forces of single elements in reduced coordinates, for training poses.
#ifndef EP_CUBATURE_FORCES_H
#define EP_CUBATURE_FORCES_H

#include "reduced/bake/basis.h"

// F_e = I + G_e q;  G_e: (9 x r), rows are the entries of F row-major.
typedef struct ep_elements {
  const ep_fem *fem; // borrowed
  int nt, r;
  double *g; // (nt x 9 x r) [1/length]
} ep_elements;

ep_status ep_elements_create(const ep_fem *fem, const ep_basis *basis, ep_elements *out,
                             ep_error *err);
void ep_elements_free(ep_elements *elements);

// g (9 x r) of one element: G[3 i + j][a] = sum over its four vertices of U_a,i(v) grad_j(v).
void ep_element_rows(const ep_fem *fem, const ep_basis *basis, int e, double *g);

// A training pose: the object at q, and what counts as its undeformed shape.
typedef struct ep_pose {
  const double *q;         // (r)
  const double *reference; // (r) the undeformed shape; NULL: rest
  const double *share;     // (nt) share of each element in a region; NULL: all of it
} ep_pose;

// F_e at q, row-major. Returns det F.
double ep_element_gradient(const ep_elements *elements, int e, const double *q, double f[9]);

// Generalised force of element e per unit of its rest volume (docs/method.md "Cubature training"):
//   rest:      G^T P(F)
//   reference: v_i G^T P(F F_i^-1) F_i^-T, v_i from ep_reference_element
// times its share, into out (r). Returns det of F or of F F_i^-1; 1 and a zero force where the
// reference shape has no usable element.
double ep_element_force(const ep_elements *elements, int e, const ep_pose *pose, double *out);

// The determinant ep_element_force would return.
double ep_element_volume_ratio(const ep_elements *elements, int e, const ep_pose *pose);

// out (r) = G_e^T P for a stress P.
void ep_element_pull_back(const ep_elements *elements, int e, const double stress[9], double *out);

#endif
