// A picture in memory, text drawn into it, and the PNG file made of it.
#ifndef EP_RESULTS_IMAGE_H
#define EP_RESULTS_IMAGE_H

#include "base/error.h"

typedef struct ep_image {
  int width, height;
  unsigned char *rgb; // (height x width x 3), sRGB, row 0 at the top
} ep_image;

// Filled with one colour. Errors: EP_ERR_ARGUMENT (size not in 1..32768), EP_ERR_MEMORY.
ep_status ep_image_make(int width, int height, const float color[3], ep_image *out, ep_error *err);
void ep_image_free(ep_image *image);

// 8-bit RGB, no time stamp: the same pixels give the same bytes. Written whole or not at all.
ep_status ep_image_write_png(const char *path, const ep_image *image, ep_error *err);

// A text in the built-in stroke font (results/font.c), antialiased. ASCII; other bytes show a box.
//   x, y: left end of the baseline [pixels]; size: height of capitals [pixels]; what lies outside
//   the image is cut off.
ep_status ep_image_text(ep_image *image, double x, double y, double size, const float color[3],
                        const char *text, ep_error *err);
double ep_text_width(double size, const char *text); // [pixels]

// An antialiased line with round ends, `width` pixels wide.
void ep_image_line(ep_image *image, double x0, double y0, double x1, double y1, double width,
                   const float color[3]);

#endif
