// The folder of a stress test: a page, a table, a record, a file for every failure.
#include <dirent.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/report.h"
#include "app/stress/stress.h"
#include "base/escape.h"
#include "results/page.h"

// ---- sums over an axis -------------------------------------------------------------------------

typedef struct axis_sum {
  int cases, outcomes[EP_STRESS_OUTCOMES];
  double newton_median, growth; // the largest
  int newton_most;
} axis_sum;

static axis_sum sum_of(const ep_stress_report *report, int variant, int axis) {
  axis_sum sum = {.growth = NAN};
  for (int i = 0; i < report->count; i++) {
    const ep_stress_result *r = &report->result[i];
    if ((variant >= 0 && (int)r->what.variant != variant) || (int)r->what.axis != axis) continue;
    sum.cases++;
    sum.outcomes[r->outcome]++;
    sum.newton_median = fmax(sum.newton_median, r->newton_median);
    if (r->newton_most > sum.newton_most) sum.newton_most = r->newton_most;
    sum.growth = fmax(sum.growth, r->growth); // fmax passes NaN over
  }
  return sum;
}

void ep_stress_text(FILE *out, const ep_stress_report *report) {
  fprintf(out, "%-13s %-10s %5s %5s %5s %5s %5s %5s %5s  %6s %6s %9s\n", "variant", "axis", "cases",
          "safe", "subd", "inv", "grow", "refus", "BROKE", "Newton", "most", "growth");
  for (int v = 0; v < EP_VARIANTS; v++)
    for (int a = 0; a < EP_STRESS_AXES; a++) {
      const axis_sum s = sum_of(report, v, a);
      if (s.cases == 0) continue;
      fprintf(out, "%-13s %-10s %5d %5d %5d %5d %5d %5d %5d  %6.3g %6d %9.2g\n",
              ep_stress_variant_name((ep_stress_variant)v), ep_stress_axis_name((ep_stress_axis)a),
              s.cases, s.outcomes[0], s.outcomes[1], s.outcomes[2], s.outcomes[3], s.outcomes[4],
              s.outcomes[5], s.newton_median, s.newton_most, s.growth);
    }
}

// ---- record ------------------------------------------------------------------------------------

static json_t *case_json(const ep_stress_result *r) {
  char value[32];
  ep_stress_value_text(&r->what, value);
  return json_pack("{s:s, s:s, s:s, s:f, s:f, s:s, s:s, s:i, s:i, s:o, s:i, s:I, s:I, s:i, s:i, "
                   "s:i, s:i, s:i, s:o, "
                   "s:o}",
                   "variant", ep_stress_variant_name(r->what.variant), "axis",
                   ep_stress_axis_name(r->what.axis), "text", value, "value", r->what.value,
                   "second", r->what.second, "outcome", ep_stress_outcome_name(r->outcome), "why",
                   r->why, "steps", r->steps, "failed_step", r->failed_step, "newton_median",
                   ep_json_number(r->newton_median), "newton_most", r->newton_most,
                   "line_search_steps", (json_int_t)r->line_search, "projections",
                   (json_int_t)r->projections, "halved_steps", r->halvings, "unfolded_steps",
                   r->unfolded, "inverted_start", r->inverted_start, "inverted_most",
                   r->inverted_most, "inverted_end", r->inverted_end, "energy_growth",
                   ep_json_number(r->growth), "step_us", ep_json_number(r->step_us));
}

json_t *ep_stress_json(const ep_stress_report *report) {
  json_t *cases = json_array(), *outcomes = json_object();
  int counts[EP_STRESS_OUTCOMES] = {0};
  for (int i = 0; i < report->count && cases; i++) {
    json_array_append_new(cases, case_json(&report->result[i]));
    counts[report->result[i].outcome]++;
  }
  for (int o = 0; o < EP_STRESS_OUTCOMES && outcomes; o++)
    json_object_set_new(outcomes, ep_stress_outcome_name((ep_stress_outcome)o),
                        json_integer(counts[o]));
  return json_pack("{s:s, s:f, s:o, s:o}", "scene", report->name, "seconds", report->seconds,
                   "outcomes", outcomes, "cases", cases);
}

// A failure as `stress --replay` takes it.
static json_t *failure_json(const ep_stress_result *r) {
  return json_pack(
      "{s:i, s:s, s:s, s:f, s:f, s:i, s:f, s:b, s:b, s:o}", "format", (int)EP_STRESS_FORMAT,
      "variant", ep_stress_variant_name(r->what.variant), "axis", ep_stress_axis_name(r->what.axis),
      "value", r->what.value, "second", r->what.second, "step", r->failed_step, "t", r->t, "loaded",
      r->loaded, "coasting", r->coasting, "history", ep_json_numbers((int)r->numbers, r->history));
}

// An earlier report in the same folder may have left failures of its own.
static ep_status remove_failures(const char *folder, ep_error *err) {
  char path[EP_PATH_MAX], file[EP_PATH_MAX];
  EP_TRY(ep_path_join(folder, "failures", path, err));
  DIR *list = opendir(path);
  if (!list) return EP_OK; // there are none; what stands in the way shows on writing
  ep_status status = EP_OK;
  for (struct dirent *entry; status == EP_OK && (entry = readdir(list));) {
    int number, end = 0;
    if (sscanf(entry->d_name, "case-%d.json%n", &number, &end) != 1 || !end || entry->d_name[end])
      continue;
    status = ep_path_join(path, entry->d_name, file, err);
    if (status == EP_OK) status = ep_file_remove(file, err);
  }
  closedir(list);
  rmdir(path); // stays where it holds files of somebody else
  return status;
}

static ep_status write_failures(const char *folder, const ep_stress_report *report, ep_error *err) {
  char path[EP_PATH_MAX], name[96];
  for (int i = 0; i < report->count; i++) {
    if (!report->result[i].history) continue;
    EP_TRY(ep_path_join(folder, "failures", path, err));
    EP_TRY(ep_make_folders(path, err));
    snprintf(name, sizeof name, "failures/case-%04d.json", i + 1);
    EP_TRY(ep_path_join(folder, name, path, err));
    EP_TRY(ep_report_write(path, failure_json(&report->result[i]), err));
  }
  return EP_OK;
}

// ---- table and page ----------------------------------------------------------------------------

static void csv(FILE *out, const ep_stress_report *report) {
  fprintf(out,
          "case,variant,axis,value,dt,outcome,steps,newton_median,newton_most,"
          "line_search_steps,projections,halved_steps,unfolded_steps,inverted_start,inverted_most,"
          "inverted_end,energy_growth,step_us\n");
  for (int i = 0; i < report->count; i++) {
    const ep_stress_result *r = &report->result[i];
    fprintf(out, "%d,%s,%s,%.10g,%.10g,%s,%d,%g,%d,%ld,%ld,%d,%d,%d,%d,%d,%g,%.4g\n", i + 1,
            ep_stress_variant_name(r->what.variant), ep_stress_axis_name(r->what.axis),
            r->what.value, r->what.second, ep_stress_outcome_name(r->outcome), r->steps,
            r->newton_median, r->newton_most, r->line_search, r->projections, r->halvings,
            r->unfolded, r->inverted_start, r->inverted_most, r->inverted_end, r->growth,
            r->step_us);
  }
}

// What the shared look does not have.
static const char STYLE[] =
    "body{max-width:1100px}h1{font-size:2rem}h2{font-size:1.5rem;margin:1.3rem 0 .8rem}"
    "p{max-width:none}table{font-size:15px;margin:.6rem 0 1.6rem}"
    "th,td{padding:.25rem .6rem;border:1px solid #fff;white-space:normal}"
    "th,th:first-child{font-weight:600;background:#f2f2f4}"
    ".safe{background:#d9efdc}.subdivided{background:#fdf3c7}.inverted{background:#fbdcb2}"
    ".growth{background:#f6c7b5}.refused{background:#e3d3ea}.broken{background:#d33;color:#fff}"
    ".key span{padding:.15rem .6rem;margin-right:.4rem}small{color:#666}";

static void cell(FILE *out, const ep_stress_result *r, const char *text) {
  fprintf(out, "<td class=%s title='", ep_stress_outcome_name(r->outcome));
  ep_write_escaped(out, r->why[0] ? r->why : ep_stress_outcome_name(r->outcome));
  fprintf(out, "'>%s</td>", text);
}

static const ep_stress_result *grid_result(const ep_stress_report *report, double value,
                                           double dt) {
  for (int i = 0; i < report->count; i++) {
    const ep_stress_case *c = &report->result[i].what;
    if (c->axis == EP_STRESS_STIFFNESS && c->second == dt && c->value == value)
      return &report->result[i];
  }
  return NULL;
}

// Stiffness down, time step across: what happened, and the median of Newton iterations.
static void grid(FILE *out, const ep_stress_report *report) {
  double value[64], dt[64];
  int rows = 0, columns = 0;
  for (int i = 0; i < report->count; i++) {
    const ep_stress_case *c = &report->result[i].what;
    if (c->axis != EP_STRESS_STIFFNESS || c->second == 0) continue;
    int a = 0, b = 0;
    while (a < rows && value[a] != c->value) a++;
    while (b < columns && dt[b] != c->second) b++;
    if (a == rows && rows < 64) value[rows++] = c->value;
    if (b == columns && columns < 64) dt[columns++] = c->second;
  }
  if (rows == 0) return;
  fprintf(out, "<h2>Stiffness against time step</h2><p>Median of Newton iterations a step.</p>"
               "<table><tr><th>Young's modulus &times;</th>");
  for (int b = 0; b < columns; b++) fprintf(out, "<th>%.3g s</th>", dt[b]);
  fprintf(out, "</tr>");
  for (int a = 0; a < rows; a++) {
    fprintf(out, "<tr><th>%g</th>", value[a]);
    for (int b = 0; b < columns; b++) {
      const ep_stress_result *r = grid_result(report, value[a], dt[b]);
      char text[32] = "";
      if (r) snprintf(text, sizeof text, "%g", r->newton_median);
      if (r) cell(out, r, text);
    }
    fprintf(out, "</tr>");
  }
  fprintf(out, "</table>");
}

// Is there a case of this variant (-1: any) outside the grid?
static bool in_row(const ep_stress_report *report, int variant, ep_stress_axis axis) {
  for (int i = 0; i < report->count; i++) {
    const ep_stress_case *c = &report->result[i].what;
    if (c->axis == axis && c->second == 0 && (variant < 0 || (int)c->variant == variant))
      return true;
  }
  return false;
}

static const char *const titles[EP_STRESS_AXES] = {
    "Young's modulus &times; value",
    "Poisson's ratio",
    "Young's modulus &times; value, Poisson's ratio 0.4999",
    "Density &times; value",
    "Time step [s]",
    "Loads &times; value",
    "Start with a speed of value tenths of the extent a second",
    "Start inverted, collapsed, random, three extents away",
    "Share alpha of the examples",
    "Strength of the example force"};

static void axis_table(FILE *out, const ep_stress_report *report, ep_stress_axis axis) {
  if (!in_row(report, -1, axis)) return;
  fprintf(out, "<h2>%s</h2><table>", titles[axis]);
  for (int v = 0; v < EP_VARIANTS; v++) {
    if (!in_row(report, v, axis)) continue;
    fprintf(out, "<tr><th>%s</th>", ep_stress_variant_name((ep_stress_variant)v));
    for (int i = 0; i < report->count; i++) {
      const ep_stress_result *r = &report->result[i];
      if (r->what.axis != axis || (int)r->what.variant != v || r->what.second > 0) continue;
      char value[32], text[128];
      ep_stress_value_text(&r->what, value);
      snprintf(text, sizeof text, "%s<br><small>%g it., %d inv.</small>", value, r->newton_median,
               r->inverted_end);
      cell(out, r, text);
    }
    fprintf(out, "</tr>");
  }
  fprintf(out, "</table>");
}

static void page(FILE *out, const ep_stress_report *report) {
  char title[256];
  snprintf(title, sizeof title, "Stress: %.200s", report->name);
  ep_page_begin(out, title, STYLE);
  fprintf(out,
          "<p>%d cases in %.0f s: 60 steps with the scene's loads, 60 (from start states 300) "
          "without loads and "
          "example force. In a cell: the value, the median of Newton iterations a step, inverted "
          "tets at "
          "the end. Point at one for its reason.</p><p class=key>",
          report->count, report->seconds);
  for (int o = 0; o < EP_STRESS_OUTCOMES; o++)
    fprintf(out, "<span class=%s>%s</span>", ep_stress_outcome_name((ep_stress_outcome)o),
            ep_stress_outcome_name((ep_stress_outcome)o));
  fprintf(out, "</p>");
  grid(out, report);
  for (int a = 0; a < EP_STRESS_AXES; a++) axis_table(out, report, (ep_stress_axis)a);
  ep_page_end(out);
}

static ep_status write_text(const char *folder, const char *name, const ep_stress_report *report,
                            void (*write)(FILE *, const ep_stress_report *), ep_error *err) {
  char path[EP_PATH_MAX];
  ep_output output;
  EP_TRY(ep_path_join(folder, name, path, err));
  EP_TRY(ep_output_open(&output, path, err));
  write(output.file, report);
  return ep_output_commit(&output, err);
}

ep_status ep_stress_write(const char *folder, const ep_stress_report *report, ep_error *err) {
  char path[EP_PATH_MAX];
  EP_TRY(ep_make_folders(folder, err));
  EP_TRY(remove_failures(folder, err));
  EP_TRY(write_text(folder, "index.html", report, page, err));
  EP_TRY(write_text(folder, "results.csv", report, csv, err));
  EP_TRY(ep_path_join(folder, "results.json", path, err));
  EP_TRY(ep_report_write(path, ep_stress_json(report), err));
  return write_failures(folder, report, err);
}
