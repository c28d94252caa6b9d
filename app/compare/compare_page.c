// The folder of a comparison: one page that needs nothing else, its chart alone, and tables.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/compare/compare_charts.h"
#include "app/report.h"
#include "base/escape.h"
#include "results/page.h"

// ---- tables ------------------------------------------------------------------------------------

static ep_status write_csv(const char *path, const ep_comparison *c, ep_error *err) {
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  fputs("method,precision,material,path,r,s,dt,solver,failed", out.file);
#define X(name, text) fputs("," #name, out.file);
  EP_POINT_NUMBERS(X)
#undef X
  fputc('\n', out.file);
  for (int i = 0; i < c->count; i++) {
    const ep_point *p = &c->point[i];
    fprintf(out.file, "%s,%s,%s,%s,%d,%d,%.17g,%s,%d", ep_method_name(p->method),
            ep_precision_name(p->precision), ep_material_name(p->material), ep_path_name(p->path),
            p->r, p->s, p->dt, p->solver, p->failed);
#define X(name, text) fprintf(out.file, ",%.9g", p->failed ? NAN : p->name);
    EP_POINT_NUMBERS(X)
#undef X
    fputc('\n', out.file);
  }
  return ep_output_commit(&out, err);
}

static void html_row(FILE *out, const ep_comparison *c, const ep_point *p, bool best) {
  char name[96];
  ep_compare_line_name(c, p, name, sizeof name);
  fprintf(out, "<tr%s><th>", best ? " class=\"best\"" : "");
  ep_write_escaped(out, name);
  if (p->method == EP_METHOD_FULL)
    fputs("</th><td></td>", out);
  else
    fprintf(out, "</th><td>%d</td>", p->r);
  if (p->failed) {
    fprintf(out, "<td colspan=\"%d\" class=\"failed\">", c->examples ? 13 : 12);
    ep_write_escaped(out, p->why);
    fputs("</td></tr>\n", out);
    return;
  }
  ep_page_cell(out, "%.1f", p->step_median_us);
  ep_page_cell(out, "%.1f", p->step_min_us);
  ep_page_cell(out, "%.1f", p->target_median_us);
  ep_page_cell(out, "%.2f", p->newton_per_step);
  ep_page_cell(out, "%.2f", p->offline_s);
  ep_page_cell(out, "%.1f", p->memory_bytes / 1024);
  ep_page_cell(out, "%.2e", p->position_error);
  ep_page_cell(out, "%.2e", p->velocity_error);
  ep_page_cell(out, "%.2e", p->energy_error);
  ep_page_cell(out, "%.2e", p->force_error);
  if (c->examples) ep_page_cell(out, "%.2e", p->weight_error);
  ep_page_cell(out, "%.0f", p->inverted);
  ep_page_cell(out, "%.0f", p->halvings);
  fputs("</tr>\n", out);
}

// What the shared look does not have.
static const char STYLE[] =
    "svg{max-width:100%;height:auto}thead th{white-space:normal;vertical-align:bottom}"
    "tr.best{background:#e8f4ec}td.failed{text-align:left;white-space:normal}"
    ".pick{background:#e8f4ec;border-left:4px solid #218c54;padding:.6rem .9rem}";

static void html_head(FILE *out, const ep_comparison *c) {
  char title[256];
  const ep_sweep *s = &c->scene->sweep;
  snprintf(title, sizeof title, "%.200s: methods compared", c->name);
  ep_page_begin(out, title, STYLE);
  fprintf(out,
          "<p class=\"note\">%d vertices, %d tets, %d examples; %g s simulated, %s. Errors are "
          "against %s at dt = %.4g s.</p>\n",
          c->vertices, c->tets, c->examples, c->frames * c->frame_interval,
          ep_integrator_name(c->scene->integrator),
          s->reference == EP_METHOD_FULL ? "the full space"
                                         : "all elements in the largest subspace",
          s->dt[s->ndt - 1]);
}

// From which r on cubature is faster, for each path and precision of the sweep.
static void html_crossover(FILE *out, const ep_comparison *c, int s) {
  ep_crossover list[EP_CROSSOVERS];
  char text[EP_CROSSOVER_TEXT];
  const int count = ep_compare_crossovers(c, s, list);
  for (int i = 0; i < count; i++) {
    ep_compare_crossover_text(c, s, &list[i], text);
    fputs("<p>", out);
    ep_write_escaped(out, text);
    fputs(".</p>\n", out);
  }
}

// Shape difference and time of a step of the paths side by side.
static void html_paths(FILE *out, const ep_comparison *c) {
  for (int i = 1; i < c->paths; i++) {
    double apart = 0;
    for (int j = 0; j < c->frames; j++) apart = fmax(apart, c->path[i].apart[j]);
    fprintf(out,
            "<p>The shapes of path %s are at most %.2f %% of the diagonal from those of %s.</p>\n",
            ep_path_name(c->path[i].path), 100 * apart, ep_path_name(c->path[0].path));
  }
  for (int i = 0; i < c->count && c->paths > 1; i++) {
    const ep_point *p = &c->point[i];
    if (p->failed || p->method != EP_METHOD_CUBATURE || p->r != c->scene->modes ||
        p->s != c->scene->elements || p->dt != c->scene->sweep.dt[0] ||
        p->material != c->scene->sweep.material[0] ||
        (*p->solver && strcmp(p->solver, c->scene->sweep.solver[0])))
      continue;
    fprintf(out, "<p>Path %s, r = %d, %d elements: %.1f us a step", ep_path_name(p->path), p->r,
            p->s, p->step_median_us);
    if (p->path & EP_METHOD_LB) fprintf(out, ", %.1f of it interpolation", p->target_median_us);
    fputs(".</p>\n", out);
  }
}

static void html_advice(FILE *out, const ep_comparison *c) {
  char why[256], name[96];
  const int best = ep_compare_recommend(c, why);
  if (best >= 0) {
    const ep_point *p = &c->point[best];
    ep_compare_line_name(c, p, name, sizeof name);
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
  for (int i = 0; i < c->scene->sweep.nelements; i++)
    html_crossover(out, c, c->scene->sweep.elements[i]);
  html_paths(out, c);
}

static void html_table(FILE *out, const ep_comparison *c) {
  char why[256];
  const int best = ep_compare_recommend(c, why);
  const char *const heads[] = {"method",
                               "r",
                               "step, median [us]",
                               "min [us]",
                               "interpolation [us]",
                               "Newton",
                               "offline [s]",
                               "memory [KiB]",
                               "position",
                               "velocity",
                               "energy",
                               "force",
                               c->examples ? "weights" : NULL,
                               "inverted",
                               "halved"};
  fputs("<h2>All settings</h2>\n", out);
  ep_page_table(out, sizeof heads / sizeof *heads, heads);
  for (int i = 0; i < c->count; i++) html_row(out, c, &c->point[i], i == best);
  ep_page_table_end(out);
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
      "run, root mean square; it holds the quadrature's error alone. Weights: largest difference "
      "of "
      "an example's weight from the reference's.</p>\n<p>Every path of the examples has a "
      "reference of its own: the full space with the forces of that path.</p>\n<p "
      "class=\"note\">The numbers of the first chart are in results.csv, of those over time in "
      "frames.csv; everything in results.json.</p>\n",
      out);
  ep_page_end(out);
}

static ep_status html_chart(FILE *out, const char *heading, const ep_chart *chart, ep_error *err) {
  if (chart->series == 0) return EP_OK;
  fprintf(out, "<h2>%s</h2>\n", heading);
  return ep_chart_svg(chart, out, err);
}

static ep_status html_charts(FILE *out, const ep_compare_charts *charts, ep_error *err) {
  static const char *const headings[EP_CHARTS] = {"Error and run time", "Error over time",
                                                  "Weights of the examples",
                                                  "Difference of the paths"};
  for (int i = 0; i < EP_CHARTS; i++) EP_TRY(html_chart(out, headings[i], &charts->chart[i], err));
  return EP_OK;
}

static ep_status write_page(const char *path, const ep_comparison *c,
                            const ep_compare_charts *charts, ep_error *err) {
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  html_head(out.file, c);
  html_advice(out.file, c);
  const ep_status status = html_charts(out.file, charts, err);
  html_table(out.file, c);
  html_notes(out.file);
  if (status == EP_OK) return ep_output_commit(&out, err);
  ep_output_discard(&out);
  return status;
}

static ep_status write_files(const char *folder, const ep_comparison *c,
                             const ep_compare_charts *charts, ep_error *err) {
  char path[EP_PATH_MAX];
  EP_TRY(ep_path_join(folder, "index.html", path, err));
  EP_TRY(write_page(path, c, charts, err));
  EP_TRY(ep_path_join(folder, "results.csv", path, err));
  EP_TRY(write_csv(path, c, err));
  EP_TRY(ep_path_join(folder, "frames.csv", path, err));
  EP_TRY(ep_compare_write_frames(path, c, charts, err));
  EP_TRY(ep_path_join(folder, "results.json", path, err));
  EP_TRY(ep_report_write(path, ep_compare_json(c), err));
  if (charts->chart[EP_CHART_PARETO].series == 0) return EP_OK;
  EP_TRY(ep_path_join(folder, "chart.svg", path, err));
  EP_TRY(ep_chart_write_svg(path, &charts->chart[EP_CHART_PARETO], err));
  EP_TRY(ep_path_join(folder, "chart.png", path, err));
  return ep_chart_write_png(path, &charts->chart[EP_CHART_PARETO], err);
}

ep_status ep_compare_write(const char *folder, const ep_comparison *c, ep_error *err) {
  ep_compare_charts charts;
  EP_TRY(ep_compare_charts_make(c, &charts, err));
  const ep_status status = write_files(folder, c, &charts, err);
  ep_compare_charts_free(&charts);
  return status;
}
