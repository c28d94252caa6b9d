// The folder of a comparison: one page that needs nothing else, its chart alone, and tables.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/compare.h"
#include "results/chart.h"

enum { SERIES_MAX = 64, LABEL = 24 };

// ---- charts ------------------------------------------------------------------------------------

// Points of one method, material, solver and time step make one line of the chart.
static bool same_line(const ep_point *a, const ep_point *b) {
  return a->method == b->method && a->material == b->material && a->dt == b->dt &&
         a->precision == b->precision &&
         (a->method == EP_METHOD_FULL || strcmp(a->solver, b->solver) == 0) &&
         (a->method != EP_METHOD_CUBATURE || a->s == b->s);
}

static void name_line(const ep_comparison *c, const ep_point *p, char *name, size_t size) {
  const ep_sweep *s = &c->scene->sweep;
  static const char *const methods[EP_METHODS] = {"cubature", "cubic polynomials", "all elements",
                                                  "full space"};
  int n = snprintf(name, size, "%s", methods[p->method]);
  if (p->method == EP_METHOD_CUBATURE) n += snprintf(name + n, size - (size_t)n, ", s = %d", p->s);
  if (p->precision == EP_FLOAT) n += snprintf(name + n, size - (size_t)n, ", float");
  if (s->nmaterials > 1)
    n += snprintf(name + n, size - (size_t)n, ", %s", ep_material_name(p->material));
  if (s->ndt > 1) n += snprintf(name + n, size - (size_t)n, ", dt %.3g", p->dt);
  if (s->nsolvers > 1 && *p->solver && p->method != EP_METHOD_FULL)
    snprintf(name + n, size - (size_t)n, ", %.24s", p->solver);
}

typedef struct chart_data {
  double *x, *y;
  char (*text)[LABEL];
  const char **label;
  char (*name)[96];
  ep_chart_series list[SERIES_MAX];
  int series;
} chart_data;

static void free_data(chart_data *d) {
  free(d->x);
  free(d->text);
  free(d->label);
  free(d->name);
}

static ep_status make_data(size_t points, chart_data *d, ep_error *err) {
  *d = (chart_data){0};
  d->x = calloc(2 * points + 2, sizeof *d->x);
  d->text = calloc(points + 1, sizeof *d->text);
  d->label = calloc(points + 1, sizeof *d->label);
  d->name = calloc(SERIES_MAX, sizeof *d->name);
  d->y = d->x ? d->x + points + 1 : NULL;
  if (d->x && d->text && d->label && d->name) return EP_OK;
  free_data(d);
  return ep_fail(err, EP_ERR_MEMORY, "no memory for a chart");
}

// Error against time of a step: one series a line, ascending r. The reference itself has no error
// and no place on a logarithmic axis; its time stands in the title.
static void pareto_series(const ep_comparison *c, chart_data *d) {
  int used = 0;
  for (int i = 0; i < c->count && d->series < SERIES_MAX; i++) {
    bool first = !c->point[i].failed && c->point[i].position_error > 0;
    for (int j = 0; j < i && first; j++)
      first = c->point[j].failed || !same_line(&c->point[j], &c->point[i]);
    if (!first) continue;
    ep_chart_series *s = &d->list[d->series];
    *s = (ep_chart_series){.name = d->name[d->series],
                           .x = d->x + used,
                           .y = d->y + used,
                           .label = d->label + used,
                           .line = true,
                           .marks = true,
                           .color = d->series};
    name_line(c, &c->point[i], d->name[d->series++], sizeof *d->name);
    for (int j = i; j < c->count; j++) {
      const ep_point *p = &c->point[j];
      if (p->failed || !same_line(p, &c->point[i])) continue;
      d->x[used] = p->step_median_us;
      d->y[used] = 100 * p->position_error;
      snprintf(d->text[used], LABEL, "%d", p->r);
      d->label[used] = d->text[used];
      s->n++;
      used++;
    }
  }
}

static ep_chart pareto_chart(const ep_comparison *c, const chart_data *d, char *title,
                             size_t size) {
  double full = NAN;
  for (int i = 0; i < c->count; i++)
    if (c->point[i].method == EP_METHOD_FULL && !c->point[i].failed)
      full = c->point[i].step_median_us;
  int n = snprintf(title, size, "%s: error and run time (numbers: r)", c->name);
  if (isfinite(full))
    snprintf(title + n, size - (size_t)n, "; full space %.3g ms a step", 1e-3 * full);
  return (ep_chart){.title = title,
                    .x_label = "time of a step [us], median",
                    .y_label = "position error [% of the diagonal]",
                    .log_x = true,
                    .log_y = true,
                    .width = 900,
                    .height = 520,
                    .series = d->series,
                    .list = d->list};
}

// Error over time: of each method the point of the scene's own r, or of the most modes.
static bool shown_over_time(const ep_comparison *c, int i) {
  const ep_sweep *s = &c->scene->sweep;
  const ep_point *p = &c->point[i];
  int r = s->modes[s->nmodes - 1];
  for (int j = 0; j < s->nmodes; j++)
    if (s->modes[j] == c->scene->modes) r = s->modes[j];
  return !p->failed && p->error_at && p->r == r && p->position_error > 0 &&
         p->dt == s->dt[s->ndt - 1] &&
         (p->method == EP_METHOD_FULL || strcmp(p->solver, c->point[0].solver) == 0);
}

static ep_status time_chart(const ep_comparison *c, FILE *out, ep_error *err) {
  chart_data d;
  char title[160];
  const size_t frames = (size_t)c->frames;
  int r = 0;
  EP_TRY(make_data(frames * (SERIES_MAX + 1), &d, err));
  for (size_t i = 0; i < frames; i++) d.x[i] = (double)(i + 1) * c->frame_interval;
  for (int i = 0; i < c->count && d.series < SERIES_MAX; i++) {
    if (!shown_over_time(c, i)) continue;
    double *y = d.y + (size_t)d.series * frames;
    for (size_t j = 0; j < frames; j++) y[j] = 100 * c->point[i].error_at[j];
    r = c->point[i].r;
    name_line(c, &c->point[i], d.name[d.series], sizeof *d.name);
    d.list[d.series] = (ep_chart_series){.name = d.name[d.series],
                                         .n = c->frames,
                                         .x = d.x,
                                         .y = y,
                                         .line = true,
                                         .color = d.series};
    d.series++;
  }
  snprintf(title, sizeof title, "Position error over time at r = %d", r);
  const ep_chart chart = {.title = title,
                          .x_label = "time [s]",
                          .y_label = "position error [% of the diagonal]",
                          .log_y = true,
                          .width = 900,
                          .height = 420,
                          .series = d.series,
                          .list = d.list};
  const ep_status status = d.series > 0 ? ep_chart_svg(&chart, out, err) : EP_OK;
  free_data(&d);
  return status;
}

// ---- tables ------------------------------------------------------------------------------------

static ep_status write_csv(const char *path, const ep_comparison *c, ep_error *err) {
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  fputs("method,precision,material,r,s,dt,solver,failed", out.file);
#define X(name, text) fputs("," #name, out.file);
  EP_POINT_NUMBERS(X)
#undef X
  fputc('\n', out.file);
  for (int i = 0; i < c->count; i++) {
    const ep_point *p = &c->point[i];
    fprintf(out.file, "%s,%s,%s,%d,%d,%.17g,%s,%d", ep_method_name(p->method),
            ep_precision_name(p->precision), ep_material_name(p->material), p->r, p->s, p->dt,
            p->solver, p->failed);
#define X(name, text) fprintf(out.file, ",%.9g", p->failed ? NAN : p->name);
    EP_POINT_NUMBERS(X)
#undef X
    fputc('\n', out.file);
  }
  return ep_output_commit(&out, err);
}

static void cell(FILE *out, const char *format, double value) {
  fputs("<td>", out);
  if (isfinite(value)) fprintf(out, format, value);
  fputs("</td>", out);
}

static void html_row(FILE *out, const ep_comparison *c, const ep_point *p, bool best) {
  char name[96];
  name_line(c, p, name, sizeof name);
  fprintf(out, "<tr%s><th>", best ? " class=\"best\"" : "");
  ep_write_escaped(out, name);
  if (p->method == EP_METHOD_FULL)
    fputs("</th><td></td>", out);
  else
    fprintf(out, "</th><td>%d</td>", p->r);
  if (p->failed) {
    fputs("<td colspan=\"12\" class=\"failed\">", out);
    ep_write_escaped(out, p->why);
    fputs("</td></tr>\n", out);
    return;
  }
  cell(out, "%.1f", p->step_median_us);
  cell(out, "%.1f", p->step_min_us);
  cell(out, "%.1f", p->target_median_us);
  cell(out, "%.2f", p->newton_per_step);
  cell(out, "%.2f", p->offline_s);
  cell(out, "%.1f", p->memory_bytes / 1024);
  cell(out, "%.2e", p->position_error);
  cell(out, "%.2e", p->velocity_error);
  cell(out, "%.2e", p->energy_error);
  cell(out, "%.2e", p->force_error);
  cell(out, "%.0f", p->inverted);
  cell(out, "%.0f", p->halvings);
  fputs("</tr>\n", out);
}

static const char STYLE[] =
    "body{font:15px/1.5 system-ui,sans-serif;color:#1d2430;background:#fff;max-width:1240px;"
    "margin:2rem auto;padding:0 1rem}h1{font-size:1.5rem;margin:0 0 .2rem}h2{font-size:1.1rem;"
    "margin:2rem 0 .5rem}p{margin:.4rem 0;max-width:60rem}svg{max-width:100%;height:auto}"
    ".scroll{overflow-x:auto}table{border-collapse:collapse;font-size:13px;"
    "font-variant-numeric:tabular-nums}th,td{padding:.22rem .42rem;border-bottom:1px solid #dde2e7;"
    "text-align:right;white-space:nowrap}th:first-child{text-align:left;font-weight:500}"
    "thead th{border-bottom:2px solid #8a93a0;font-weight:600}tr.best{background:#e8f4ec}"
    "td.failed{color:#a11;text-align:left;white-space:normal}.note{color:#566070}"
    ".pick{background:#e8f4ec;border-left:4px solid #218c54;padding:.6rem .9rem}";

static void html_head(FILE *out, const ep_comparison *c) {
  fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width, initial-scale=1\"><title>",
        out);
  ep_write_escaped(out, c->name);
  fprintf(out, ": methods compared</title><style>%s</style></head><body>\n<h1>", STYLE);
  ep_write_escaped(out, c->name);
  const ep_sweep *s = &c->scene->sweep;
  fprintf(out,
          ": methods compared</h1>\n<p class=\"note\">%d vertices, %d tets, %d examples; %g s "
          "simulated, %s. Errors are against %s at dt = %.4g s.</p>\n",
          c->vertices, c->tets, c->examples, c->frames * c->frame_interval,
          ep_integrator_name(c->scene->integrator),
          s->reference == EP_METHOD_FULL ? "the full space"
                                         : "all elements in the largest subspace",
          s->dt[s->ndt - 1]);
}

static void html_advice(FILE *out, const ep_comparison *c) {
  char why[256], name[96];
  const int best = ep_compare_recommend(c, why);
  if (best >= 0) {
    const ep_point *p = &c->point[best];
    name_line(c, p, name, sizeof name);
    fputs("<p class=\"pick\"><strong>Recommended: ", out);
    ep_write_escaped(out, name);
    fprintf(out, ", r = %d</strong>: %.3g ms a step, position error %.3g %%. It is ", p->r,
            1e-3 * p->step_median_us, 100 * p->position_error);
    ep_write_escaped(out, why);
    fputs(".</p>\n", out);
  } else if (*why) {
    fputs("<p class=\"pick\"><strong>No recommendation:</strong> ", out);
    ep_write_escaped(out, why);
    fputs(".</p>\n", out);
  }
  bool compared = false;
  for (int i = 0; i < c->count; i++)
    compared |= c->point[i].method == EP_METHOD_CUBIC && !c->point[i].failed;
  for (int i = 0; i < c->scene->sweep.nelements && compared; i++) {
    const int s = c->scene->sweep.elements[i];
    const double r = ep_compare_crossover(c, s);
    if (s >= c->tets) continue;
    if (isfinite(r))
      fprintf(out,
              "<p>Cubature with %d elements overtakes the cubic polynomials at r = %.0f (step "
              "without interpolation).</p>\n",
              s, r);
    else
      fprintf(out,
              "<p>Cubature with %d elements is slower than the cubic polynomials at every r "
              "of this sweep.</p>\n",
              s);
  }
}

static void html_table(FILE *out, const ep_comparison *c) {
  char why[256];
  const int best = ep_compare_recommend(c, why);
  static const char *const heads[] = {
      "method", "r",           "step, median [us]", "min [us]", "interpolation [us]",
      "Newton", "offline [s]", "memory [KiB]",      "position", "velocity",
      "energy", "force",       "inverted",          "halved"};
  fputs("<h2>All settings</h2>\n<div class=\"scroll\"><table><thead><tr>", out);
  for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) fprintf(out, "<th>%s</th>", heads[i]);
  fputs("</tr></thead><tbody>\n", out);
  for (int i = 0; i < c->count; i++) html_row(out, c, &c->point[i], i == best);
  fputs("</tbody></table></div>\n", out);
}

static void html_notes(FILE *out) {
  fputs(
      "<h2>What the columns mean</h2>\n<p>Step: wall time of one step on one core, interpolation "
      "of the examples included; of each step the smallest time of its repetitions, then the "
      "median and the smallest over the run. Newton: iterations per step. Offline: basis, "
      "training and model of the setting; what all settings share (eigenfunctions, maps, poses, "
      "modes, paths) is not in it; full space: symbolic analysis. Memory: what a step may touch "
      "(model and state; matrices, factor and vectors in full space).</p>\n<p>Position: largest "
      "distance of any vertex at any frame from the reference, over the diagonal of the bounding "
      "box at rest. Velocity: the same over the largest speed of the reference. Energy: largest "
      "difference of elastic and kinetic energy from the reference's, over its largest. Force: "
      "reduced elastic force against the projected force of all elements at configurations of the "
      "run, root mean square; it holds the quadrature's error alone.</p>\n<p class=\"note\">The "
      "numbers of the charts are in results.csv; everything, with the errors of every frame, in "
      "results.json.</p>\n</body></html>\n",
      out);
}

static ep_status write_page(const char *path, const ep_comparison *c, const ep_chart *chart,
                            ep_error *err) {
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  html_head(out.file, c);
  html_advice(out.file, c);
  ep_status status = chart->series > 0 ? ep_chart_svg(chart, out.file, err) : EP_OK;
  if (status == EP_OK) {
    html_table(out.file, c);
    fputs("<h2>Error over time</h2>\n", out.file);
    status = time_chart(c, out.file, err);
  }
  html_notes(out.file);
  if (status == EP_OK) return ep_output_commit(&out, err);
  ep_output_discard(&out);
  return status;
}

static ep_status write_json(const char *path, const ep_comparison *c, ep_error *err) {
  json_t *root = ep_compare_json(c);
  ep_output out;
  if (!root) return ep_fail(err, EP_ERR_MEMORY, "no memory for the report");
  ep_status status = ep_output_open(&out, path, err);
  if (status == EP_OK) {
    json_dumpf(root, out.file, JSON_INDENT(1) | JSON_REAL_PRECISION(9));
    fputc('\n', out.file);
    status = ep_output_commit(&out, err);
  }
  json_decref(root);
  return status;
}

ep_status ep_compare_write(const char *folder, const ep_comparison *c, ep_error *err) {
  char path[EP_PATH_MAX], title[200];
  chart_data d;
  EP_TRY(ep_make_folders(folder, err));
  EP_TRY(make_data((size_t)c->count, &d, err));
  pareto_series(c, &d);
  const ep_chart chart = pareto_chart(c, &d, title, sizeof title);
  ep_status status = ep_path_join(folder, "index.html", path, err);
  if (status == EP_OK) status = write_page(path, c, &chart, err);
  if (status == EP_OK) status = ep_path_join(folder, "results.csv", path, err);
  if (status == EP_OK) status = write_csv(path, c, err);
  if (status == EP_OK) status = ep_path_join(folder, "results.json", path, err);
  if (status == EP_OK) status = write_json(path, c, err);
  if (chart.series > 0) {
    if (status == EP_OK) status = ep_path_join(folder, "chart.svg", path, err);
    if (status == EP_OK) status = ep_chart_write_svg(path, &chart, err);
    if (status == EP_OK) status = ep_path_join(folder, "chart.png", path, err);
    if (status == EP_OK) status = ep_chart_write_png(path, &chart, err);
  }
  free_data(&d);
  return status;
}
