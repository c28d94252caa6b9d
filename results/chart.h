// A chart of marks and lines with linear or logarithmic axes, as SVG (for pages and papers) and as
// PNG; both come from the same drawing.
#ifndef EP_RESULTS_CHART_H
#define EP_RESULTS_CHART_H

#include <stdbool.h>
#include <stdio.h>

#include "base/error.h"

typedef struct ep_chart_series {
  const char *name;
  int n;
  const double *x, *y;      // (n) points; those a logarithmic axis cannot hold are left out
  const char *const *label; // (n) beside the marks, or NULL; left out where there is no room
  bool line, marks;
  int color; // 0..63: eight colours, each with eight marks
} ep_chart_series;

typedef struct ep_chart {
  const char *title, *x_label, *y_label;
  bool log_x, log_y;
  int width, height; // pixels
  int series;
  const ep_chart_series *list;
} ep_chart;

// Write an <svg> element (no XML header), self-contained. Errors: EP_ERR_ARGUMENT where there is
// nothing to draw; the stream's state tells of failed writes.
ep_status ep_chart_svg(const ep_chart *chart, FILE *out, ep_error *err);
ep_status ep_chart_write_svg(const char *path, const ep_chart *chart, ep_error *err);
// Twice the chart's size in pixels.
ep_status ep_chart_write_png(const char *path, const ep_chart *chart, ep_error *err);

// A range of round numbers around low..high in steps of 1, 2 or 5 times a power of ten.
//   *first <= low, first + count step >= high, but for 1e-6 of a step; about `wanted` steps.
void ep_chart_ticks(double low, double high, int wanted, double *first, double *step, int *count);

#endif
