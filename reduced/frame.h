// Free motion: the moving frame of an object nothing holds (docs/method.md "Free motion").
//
//   x_i = c + R (X_i - X_0 + U_i q)
//
// c is the centre of mass, R turns body axes into world axes, X_0 the centre of mass of the rest
// shape (model->rigid_origin): at the start c = X_0 and R = I, so that model space is the world.
// The modes are mass-orthogonal to the six rigid modes at rest, hence sum m U_a = 0 and
// sum m (X - X_0) x U_a = 0: c stays the centre of mass whatever q does.
#ifndef EP_REDUCED_FRAME_H
#define EP_REDUCED_FRAME_H

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ep_frame {
  double c[3]; // centre of mass in the world [length]
  double R[9]; // row-major, orthonormal: body axes to world axes
} ep_frame;

#ifdef __cplusplus
}
#endif
#endif
