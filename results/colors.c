#include "results/colors.h"

#include <math.h>

void ep_color(ep_colors colors, double t, float rgb[3]) {
  static const float sequential[9][3] = {
      {0.26f, 0.05f, 0.35f}, {0.28f, 0.17f, 0.48f}, {0.23f, 0.31f, 0.55f},
      {0.17f, 0.43f, 0.56f}, {0.12f, 0.56f, 0.55f}, {0.18f, 0.68f, 0.49f},
      {0.42f, 0.78f, 0.36f}, {0.70f, 0.86f, 0.22f}, {0.98f, 0.90f, 0.20f}};
  static const float diverging[9][3] = {
      {0.10f, 0.23f, 0.55f}, {0.19f, 0.42f, 0.74f}, {0.42f, 0.64f, 0.86f},
      {0.70f, 0.82f, 0.92f}, {0.95f, 0.95f, 0.94f}, {0.97f, 0.78f, 0.68f},
      {0.92f, 0.53f, 0.42f}, {0.80f, 0.27f, 0.24f}, {0.58f, 0.07f, 0.16f}};
  const float(*table)[3] = colors == EP_COLORS_DIVERGING ? diverging : sequential;
  if (isnan(t)) {
    rgb[0] = rgb[1] = rgb[2] = 0.5f;
    return;
  }
  const double at = 8 * fmin(1, fmax(0, t));
  const int i = at >= 8 ? 7 : (int)at;
  const float f = (float)(at - i);
  for (int k = 0; k < 3; k++) rgb[k] = table[i][k] + f * (table[i + 1][k] - table[i][k]);
}

void ep_color_values(int n, const double *value, double low, double high, ep_colors colors,
                     float *rgb) {
  for (int v = 0; v < n; v++)
    ep_color(colors, high > low ? (value[v] - low) / (high - low) : 0.5, rgb + 3 * v);
}

void ep_color_signed(int n, const double *value, float *rgb) {
  double largest = 0;
  for (int v = 0; v < n; v++) largest = fmax(largest, fabs(value[v]));
  ep_color_values(n, value, -largest, largest, EP_COLORS_DIVERGING, rgb);
}

void ep_color_position(int n, const double *x, const double low[3], const double high[3],
                       float *rgb) {
  for (int v = 0; v < n; v++)
    for (int k = 0; k < 3; k++) {
      const double size = high[k] - low[k];
      const double t = size > 0 ? (x[3 * v + k] - low[k]) / size : 0.5;
      rgb[3 * v + k] = (float)(0.15 + 0.8 * fmin(1, fmax(0, t)));
    }
}
