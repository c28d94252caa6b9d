// The charts of a comparison: what the page draws and the tables hold are the same numbers.
#ifndef EP_APP_COMPARE_COMPARE_CHARTS_H
#define EP_APP_COMPARE_COMPARE_CHARTS_H

#include "app/compare/compare.h"
#include "results/chart.h"

typedef enum ep_chart_kind {
  EP_CHART_PARETO,  // position error against the time of a step, points along r
  EP_CHART_ERROR,   // position error over time
  EP_CHART_WEIGHTS, // weights of the examples over time, of the reference of each path
  EP_CHART_APART,   // distance of the paths' shapes over time
  EP_CHARTS
} ep_chart_kind;

// A chart without series has nothing to show.
typedef struct ep_compare_charts {
  ep_chart chart[EP_CHARTS];
  void *owned[EP_CHARTS];
} ep_compare_charts;

// c must outlive the charts.
ep_status ep_compare_charts_make(const ep_comparison *c, ep_compare_charts *out, ep_error *err);
void ep_compare_charts_free(ep_compare_charts *charts);

// What a point's line is called: what the sweep varies, but for r.
void ep_compare_line_name(const ep_comparison *c, const ep_point *p, char *name, size_t size);

// frames.csv: time and every series of the charts over time, a column each.
ep_status ep_compare_write_frames(const char *path, const ep_comparison *c,
                                  const ep_compare_charts *charts, ep_error *err);

#endif
