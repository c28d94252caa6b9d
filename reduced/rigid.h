// Inertia of a free object in its moving frame, and rotations (docs/method.md "Free motion").
// Private to the run time. Symmetric 3 x 3 matrices are packed as xx yy zz yz zx xy, full ones
// row-major.
#ifndef EP_REDUCED_RIGID_H
#define EP_REDUCED_RIGID_H

#include "reduced/eigenpose.h"

// With y = X - X_0 + U q:
//   s (6)  sum m y y^T;   ds (6 x r) ds/dq, or NULL
//   h (3 x r) column b = sum_a q_a h_ab, so that sum m y x U q' = h q', or NULL
// O(r^2).
void ep_rigid_sums(const ep_model *model, const double *q, double s[6], double *ds, double *h);
// J = tr(S) I - S (9): inertia tensor about the centre of mass.
void ep_rigid_tensor(const double s[6], double j[9]);
// sum m U q x U v = h(q, v), axes of the body.
void ep_rigid_internal(const ep_model *model, const double *q, const double *v, double out[3]);

// ---- 3-vectors and rotations ---------------------------------------------------------------
void ep_cross(const double a[3], const double b[3], double out[3]);       // out is neither
void ep_rotate(const double r[9], const double x[3], double out[3]);      // R x
void ep_rotate_back(const double r[9], const double x[3], double out[3]); // R^T x
void ep_multiply3(const double a[9], const double b[9], double out[9]);   // a b, out is neither
// exp of a rotation vector; its inverse, |v| <= pi.
void ep_rotation_exp(const double v[3], double r[9]);
void ep_rotation_log(const double r[9], double v[3]);
// Gram-Schmidt on the rows: takes the round-off of many products out.
void ep_rotation_clean(double r[9]);
// Inverse of a symmetric positive definite matrix. 0 where it is not.
int ep_inverse3(const double a[9], double out[9]);

#endif
