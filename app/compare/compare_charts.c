#include "app/compare/compare_charts.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { LABEL = 24, NAME = 96, TITLE = 200, LEGEND_ROW = 20, AROUND_LEGEND = 130 };

// Points of one method, material, solver and time step make one line of the chart.
static bool same_line(const ep_point *a, const ep_point *b) {
  return a->method == b->method && a->material == b->material && a->dt == b->dt &&
         a->precision == b->precision && a->path == b->path &&
         (a->method == EP_METHOD_FULL || strcmp(a->solver, b->solver) == 0) &&
         (a->method != EP_METHOD_CUBATURE || a->s == b->s);
}

void ep_compare_line_name(const ep_comparison *c, const ep_point *p, char *name, size_t size) {
  const ep_sweep *s = &c->scene->sweep;
  static const char *const methods[EP_METHODS] = {"cubature", "cubic polynomials", "all elements",
                                                  "full space"};
  int n = snprintf(name, size, "%s", methods[p->method]);
  if (p->method == EP_METHOD_CUBATURE) n += snprintf(name + n, size - (size_t)n, ", s = %d", p->s);
  if (p->precision == EP_FLOAT) n += snprintf(name + n, size - (size_t)n, ", float");
  if (s->npaths > 1 && p->path)
    n += snprintf(name + n, size - (size_t)n, ", %s", ep_path_name(p->path));
  if (s->nmaterials > 1)
    n += snprintf(name + n, size - (size_t)n, ", %s", ep_material_name(p->material));
  if (s->ndt > 1) n += snprintf(name + n, size - (size_t)n, ", dt %.3g", p->dt);
  if (s->nsolvers > 1 && *p->solver && p->method != EP_METHOD_FULL)
    snprintf(name + n, size - (size_t)n, ", %.24s", p->solver);
}

// Memory of one chart: series with room for `points` points in all.
typedef struct chart_data {
  ep_chart_series *list;
  char (*name)[NAME];
  double *x, *y;
  const char **label;
  char (*text)[LABEL];
  char title[TITLE];
} chart_data;

static void free_data(chart_data *d) {
  if (!d) return;
  free(d->list);
  free(d->name);
  free(d->x);
  free(d->y);
  free(d->label);
  free(d->text);
  free(d);
}

static ep_status make_data(size_t series, size_t points, chart_data **out, ep_error *err) {
  chart_data *d = *out = calloc(1, sizeof *d);
  if (!d) return ep_fail(err, EP_ERR_MEMORY, "no memory for a chart");
  d->list = calloc(series + 1, sizeof *d->list);
  d->name = calloc(series + 1, sizeof *d->name);
  d->x = calloc(points + 1, sizeof *d->x);
  d->y = calloc(points + 1, sizeof *d->y);
  d->label = calloc(points + 1, sizeof *d->label);
  d->text = calloc(points + 1, sizeof *d->text);
  if (d->list && d->name && d->x && d->y && d->label && d->text) return EP_OK;
  return ep_fail(err, EP_ERR_MEMORY, "no memory for a chart");
}

// High enough for the legend.
static int height_for(int least, int series) {
  const int legend = LEGEND_ROW * series + AROUND_LEGEND;
  return legend > least ? legend : least;
}

// ---- error against time ------------------------------------------------------------------------

static bool begins_line(const ep_comparison *c, int i) {
  if (c->point[i].failed || !(c->point[i].position_error > 0)) return false;
  for (int j = 0; j < i; j++)
    if (!c->point[j].failed && c->point[j].position_error > 0 &&
        same_line(&c->point[j], &c->point[i]))
      return false;
  return true;
}

static void add_line(const ep_comparison *c, int first, chart_data *d, int series, int *used) {
  ep_chart_series *s = &d->list[series];
  *s = (ep_chart_series){.name = d->name[series],
                         .x = d->x + *used,
                         .y = d->y + *used,
                         .label = d->label + *used,
                         .line = true,
                         .marks = true,
                         .color = series};
  ep_compare_line_name(c, &c->point[first], d->name[series], NAME);
  for (int j = first; j < c->count; j++) {
    const ep_point *p = &c->point[j];
    if (p->failed || !same_line(p, &c->point[first])) continue;
    d->x[*used] = p->step_median_us;
    d->y[*used] = 100 * p->position_error;
    if (p->method == EP_METHOD_FULL)
      snprintf(d->text[*used], LABEL, "full");
    else
      snprintf(d->text[*used], LABEL, "%d", p->r);
    d->label[*used] = d->text[*used];
    s->n++;
    ++*used;
  }
}

// The reference itself has no error and no place on a logarithmic axis; its time stands in the
// title.
static void pareto_title(const ep_comparison *c, char *title) {
  int n = snprintf(title, TITLE, "%.60s: error and run time (numbers: r)", c->name);
  const char *before = "; full space";
  for (int i = 0; i < c->count && n < TITLE - 60; i++) {
    const ep_point *p = &c->point[i];
    if (p->method != EP_METHOD_FULL || p->failed || p->position_error > 0) continue;
    n += snprintf(title + n, TITLE - (size_t)n, "%s %.3g ms", before, 1e-3 * p->step_median_us);
    if (c->paths > 1) n += snprintf(title + n, TITLE - (size_t)n, " (%s)", ep_path_name(p->path));
    before = ",";
  }
}

static ep_status pareto(const ep_comparison *c, chart_data **data, ep_chart *out, ep_error *err) {
  int series = 0, used = 0;
  EP_TRY(make_data((size_t)c->count, (size_t)c->count, data, err));
  for (int i = 0; i < c->count; i++)
    if (begins_line(c, i)) add_line(c, i, *data, series++, &used);
  pareto_title(c, (*data)->title);
  *out = (ep_chart){.title = (*data)->title,
                    .x_label = "time of a step [us], median",
                    .y_label = "position error [% of the diagonal]",
                    .log_x = true,
                    .log_y = true,
                    .width = 960,
                    .height = height_for(520, series),
                    .series = series,
                    .list = (*data)->list};
  return EP_OK;
}

// ---- over time ---------------------------------------------------------------------------------

static ep_status make_frames(const ep_comparison *c, size_t series, chart_data **data,
                             ep_error *err) {
  const size_t frames = (size_t)c->frames;
  EP_TRY(make_data(series, frames * series + frames, data, err));
  for (size_t i = 0; i < frames; i++) (*data)->x[i] = (double)(i + 1) * c->frame_interval;
  return EP_OK;
}

// A series of count frames, every `stride`-th number of `from`, times scale; its name is written by
// the caller.
static void add_frames(const ep_comparison *c, chart_data *d, int series, double scale,
                       const double *from, size_t stride) {
  const size_t frames = (size_t)c->frames;
  double *y = d->y + (size_t)series * frames;
  for (size_t i = 0; i < frames; i++) y[i] = scale * from[i * stride];
  d->list[series] = (ep_chart_series){
      .name = d->name[series], .n = c->frames, .x = d->x, .y = y, .line = true, .color = series};
}

static ep_chart over_time(const chart_data *d, int series, const char *y_label, bool log_y) {
  return (ep_chart){.title = d->title,
                    .x_label = "time [s]",
                    .y_label = y_label,
                    .log_y = log_y,
                    .width = 960,
                    .height = height_for(420, series),
                    .series = series,
                    .list = d->list};
}

// Of each method the point of the scene's own r, or of the most modes, with the first solver.
static int shown_modes(const ep_sweep *s, const ep_scene *scene) {
  for (int j = 0; j < s->nmodes; j++)
    if (s->modes[j] == scene->modes) return scene->modes;
  return s->modes[s->nmodes - 1];
}

static bool shown_over_time(const ep_comparison *c, const ep_point *p) {
  const ep_sweep *s = &c->scene->sweep;
  if (p->failed || !p->error_at || !(p->position_error > 0) || p->dt != s->dt[s->ndt - 1])
    return false;
  if (p->method == EP_METHOD_FULL) return true;
  return p->r == shown_modes(s, c->scene) &&
         (!(p->path & EP_METHOD_LB) || strcmp(p->solver, s->solver[0]) == 0);
}

static ep_status errors_over_time(const ep_comparison *c, chart_data **data, ep_chart *out,
                                  ep_error *err) {
  int series = 0;
  EP_TRY(make_frames(c, (size_t)c->count, data, err));
  for (int i = 0; i < c->count; i++) {
    if (!shown_over_time(c, &c->point[i])) continue;
    ep_compare_line_name(c, &c->point[i], (*data)->name[series], NAME);
    add_frames(c, *data, series++, 100, c->point[i].error_at, 1);
  }
  snprintf((*data)->title, TITLE, "Position error over time at r = %d",
           shown_modes(&c->scene->sweep, c->scene));
  *out = over_time(*data, series, "position error [% of the diagonal]", true);
  return EP_OK;
}

static void name_weight(const ep_comparison *c, const ep_path_run *run, int which, char *name) {
  const int set = which / c->examples, example = which % c->examples + 1;
  if (ep_weight_sets(run->path) < 2)
    snprintf(name, NAME, "%s, example %d", ep_path_name(run->path), example);
  else
    snprintf(name, NAME, "%s (%s), example %d", ep_path_name(run->path), set ? "green" : "lb",
             example);
}

static ep_status weights_over_time(const ep_comparison *c, chart_data **data, ep_chart *out,
                                   ep_error *err) {
  int series = 0, most = 0;
  for (int i = 0; i < c->paths; i++) most += c->path[i].nweights;
  EP_TRY(make_frames(c, (size_t)most, data, err));
  for (int i = 0; i < c->paths; i++)
    for (int j = 0; j < c->path[i].nweights; j++) {
      name_weight(c, &c->path[i], j, (*data)->name[series]);
      add_frames(c, *data, series++, 1, c->path[i].weight + j, (size_t)c->path[i].nweights);
    }
  snprintf((*data)->title, TITLE, "Weights of the examples over time, reference of each path");
  *out = over_time(*data, series, "weight", false);
  return EP_OK;
}

static ep_status paths_apart(const ep_comparison *c, chart_data **data, ep_chart *out,
                             ep_error *err) {
  int series = 0;
  EP_TRY(make_frames(c, EP_PATHS, data, err));
  for (int i = 1; i < c->paths; i++) {
    snprintf((*data)->name[series], NAME, "%s from %s", ep_path_name(c->path[i].path),
             ep_path_name(c->path[0].path));
    add_frames(c, *data, series++, 100, c->path[i].apart, 1);
  }
  snprintf((*data)->title, TITLE, "How far the paths' shapes are apart (reference of each)");
  *out = over_time(*data, series, "largest distance [% of the diagonal]", false);
  return EP_OK;
}

// ---- all ---------------------------------------------------------------------------------------

ep_status ep_compare_charts_make(const ep_comparison *c, ep_compare_charts *out, ep_error *err) {
  typedef ep_status maker(const ep_comparison *, chart_data **, ep_chart *, ep_error *);
  static maker *const makers[EP_CHARTS] = {pareto, errors_over_time, weights_over_time,
                                           paths_apart};
  *out = (ep_compare_charts){0};
  for (int i = 0; i < EP_CHARTS; i++) {
    chart_data *data = NULL;
    const ep_status status = makers[i](c, &data, &out->chart[i], err);
    out->owned[i] = data;
    if (status == EP_OK) continue;
    ep_compare_charts_free(out);
    return status;
  }
  return EP_OK;
}

void ep_compare_charts_free(ep_compare_charts *charts) {
  for (int i = 0; i < EP_CHARTS; i++) free_data(charts->owned[i]);
  *charts = (ep_compare_charts){0};
}

ep_status ep_compare_write_frames(const char *path, const ep_comparison *c,
                                  const ep_compare_charts *charts, ep_error *err) {
  static const char *const what[EP_CHARTS] = {
      [EP_CHART_ERROR] = "position error [%]",
      [EP_CHART_WEIGHTS] = "weight",
      [EP_CHART_APART] = "apart [%]",
  };
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  fputs("time", out.file);
  for (int k = EP_CHART_ERROR; k < EP_CHARTS; k++)
    for (int s = 0; s < charts->chart[k].series; s++) // names hold commas, never quotes
      fprintf(out.file, ",\"%s: %s\"", what[k], charts->chart[k].list[s].name);
  fputc('\n', out.file);
  for (int i = 0; i < c->frames; i++) {
    fprintf(out.file, "%.9g", (i + 1) * c->frame_interval);
    for (int k = EP_CHART_ERROR; k < EP_CHARTS; k++)
      for (int s = 0; s < charts->chart[k].series; s++)
        fprintf(out.file, ",%.9g", charts->chart[k].list[s].y[i]);
    fputc('\n', out.file);
  }
  return ep_output_commit(&out, err);
}
