// Pictures without a display: shaded surfaces by a software rasteriser, several panels side by
// side with labels, written as PNG. Same input, same bytes.
#ifndef EP_RESULTS_PICTURE_H
#define EP_RESULTS_PICTURE_H

#include <stdbool.h>

#include "results/image.h"

// One surface in a panel. Arrays are borrowed.
typedef struct ep_drawing {
  int nv, nt;
  const double *x;     // (nv x 3) positions
  const int *triangle; // (nt x 3) outward
  const float *color;  // (nv x 3) sRGB 0..1 per vertex, or NULL: tint
  float tint[3];       // sRGB
  double crease;       // edges sharper than this are shaded sharp [degrees]; 0: all flat
  float edges;         // darkness of triangle edges, 0 (none) .. 1
  const unsigned char *hidden_edges; // (nt) bit c set: do not draw the edge opposite corner c; NULL
  bool floor; // level: the panel's other drawings cast their shadows on its upper side
} ep_drawing;
// No edges, crease at 40 degrees, a calm blue.
ep_drawing ep_default_drawing(int nv, const double *x, int nt, const int *triangle);

typedef struct ep_panel {
  int drawings;
  const ep_drawing *drawing;
  const char *label; // below the panel; NULL: none
} ep_panel;

typedef struct ep_view {
  double from[3]; // direction from the object towards the viewer
  double up[3];
  double perspective;      // field of view [degrees], 0: parallel projection
  bool shared;             // one frame (scale and centre) for all panels: shapes can be compared;
                           // otherwise every panel is fitted to its own content
  bool shadow;             // soft shadow on floors, or on a plane below (along -up) all points
  double margin;           // free share of the panel's smaller side on each side
  int width, height;       // of one panel's drawing [pixels]
  int columns;             // panels in a row; 0: all in one
  int samples;             // per pixel and axis, 1..8
  double label_size;       // height of capitals [pixels]
  float top[3], bottom[3]; // background colours, sRGB
  const char *title;       // above everything; NULL: none
  const char *note;        // small text below the title, broken into lines; NULL: none
} ep_view;
ep_view ep_default_view(void);

// Errors: EP_ERR_ARGUMENT (nothing to show, vertex out of range, NaN position; message names the
// panel), EP_ERR_MEMORY.
ep_status ep_picture_render(const ep_view *view, int panels, const ep_panel *panel, ep_image *out,
                            ep_error *err);
// Render and write a PNG.
ep_status ep_picture_write(const char *path, const ep_view *view, int panels, const ep_panel *panel,
                           ep_error *err);

#endif
