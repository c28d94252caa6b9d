// Colours of vertices for pictures.
#ifndef EP_RESULTS_COLORS_H
#define EP_RESULTS_COLORS_H

typedef enum ep_colors {
  EP_COLORS_SEQUENTIAL, // dark violet - teal - yellow, lightness ascending
  EP_COLORS_DIVERGING   // blue - near white - red, for signed values
} ep_colors;

// t in 0..1 (clamped; NaN: grey) -> sRGB 0..1
void ep_color(ep_colors colors, double t, float rgb[3]);

// value (n) -> rgb (n x 3): low and high are the ends of the scale (equal: the middle).
void ep_color_values(int n, const double *value, double low, double high, ep_colors colors,
                     float *rgb);
// A signed function, 0 in the middle of the diverging scale, its largest |value| at the ends.
void ep_color_signed(int n, const double *value, float *rgb);
// Position as colour: x, y, z between low and high become red, green, blue (lightened, so that
// shading still shows). Two meshes coloured through the same map show which points correspond.
void ep_color_position(int n, const double *x, const double low[3], const double high[3],
                       float *rgb);

#endif
