// Inside of the picture module: a supersampled frame with depth, triangles shaded into it.
#ifndef EP_RESULTS_RASTER_H
#define EP_RESULTS_RASTER_H

#include "results/picture.h"

// Where the viewer stands: p' = (x right, y up, depth towards the viewer), then to pixels.
typedef struct ep_camera {
  double right[3], up[3], back[3]; // orthonormal; back points to the viewer
  double centre[3];                // of what is shown
  double distance;                 // of the eye from centre; 0: parallel projection
  double scale;                    // samples per length unit (at the centre's depth)
  double offset[2];                // samples, added to the centre of the frame
} ep_camera;

typedef struct ep_frame {
  int width, height; // samples
  float *color;      // (height x width x 3) linear light; alpha by depth > -inf
  float *depth;      // (height x width) larger is nearer; -FLT_MAX: background
} ep_frame;

ep_status ep_frame_make(int width, int height, ep_frame *out, ep_error *err);
void ep_frame_free(ep_frame *frame);

// p (3) -> screen (x, y in samples, y down, depth).
void ep_camera_project(const ep_camera *camera, const ep_frame *frame, const double *p, double *s);

// Corner normals (nt x 3 x 3): area-weighted over the faces round the vertex within the crease.
ep_status ep_corner_normals(const ep_drawing *drawing, double *normal, ep_error *err);

// Shade a drawing into the frame. line: width of edges in samples.
ep_status ep_frame_draw(ep_frame *frame, const ep_camera *camera, const ep_drawing *drawing,
                        double line, ep_error *err);

double ep_linear_from_srgb(double s);
double ep_srgb_from_linear(double l);

#endif
