// A line chart: weights, energies or timings over time.
#ifndef EP_RESULTS_PLOT_H
#define EP_RESULTS_PLOT_H

#include "results/image.h"

typedef struct ep_plot {
  const char *title, *x_label, *y_label; // NULL: none
  int width, height;                     // pixels
  int n, series;                         // points, lines
  const double *x;                       // (n) ascending
  const double *y;                       // (n x series) row-major; a NaN leaves a gap
  const char *const *name;               // (series) for the legend, or NULL
} ep_plot;

// A range of round numbers around low..high in steps of 1, 2 or 5 times a power of ten.
//   *first <= low, first + count step >= high, but for 1e-6 of a step; about `wanted` steps.
void ep_plot_ticks(double low, double high, int wanted, double *first, double *step, int *count);

// Errors: EP_ERR_ARGUMENT (fewer than 2 points, no line, x not ascending, no finite value).
ep_status ep_plot_render(const ep_plot *plot, ep_image *out, ep_error *err);
ep_status ep_plot_write(const char *path, const ep_plot *plot, ep_error *err);

#endif
