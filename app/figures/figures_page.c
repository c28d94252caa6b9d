#include <math.h>
#include <stdio.h>
#include <string.h>

#include "app/figures/figures.h"
#include "app/report.h"
#include "base/escape.h"
#include "base/files.h"
#include "results/page.h"

// What the shared look does not have.
static const char STYLE[] =
    "body{max-width:1400px}h1{font-size:1.6rem;margin:0 0 .3rem}h2{font-size:1.25rem;"
    "margin:3rem 0 .3rem;border-top:2px solid #dde2e7;padding-top:1rem}h3{font-size:1rem;"
    "margin:0 0 .3rem;font-weight:600}p{max-width:62rem}"
    ".runs{display:grid;grid-template-columns:repeat(auto-fit,minmax(520px,1fr));gap:1.2rem;"
    "margin:.8rem 0}.run{border:1px solid #dde2e7;border-radius:6px;padding:.7rem;min-width:0}"
    ".run img{width:100%;display:block;border-radius:4px}.finals{display:grid;gap:.6rem;"
    "grid-template-columns:repeat(auto-fill,minmax(280px,1fr))}.finals figure{margin:0}"
    ".finals img{width:100%;border-radius:4px}figcaption{font-size:13px;color:#566070}"
    "th,td{padding:.22rem .5rem}tr.paper{background:#f6f1e4}"
    "details{font-size:13px;margin:.5rem 0 0}summary{cursor:pointer;color:#345a8a}"
    "details ul{margin:.3rem 0;padding-left:1.2rem}.out{color:#566070}.note{font-size:13px}";

// ---- pictures ----------------------------------------------------------------------------------

static void image(FILE *out, const ep_figure_run *run, const char *file) {
  fputs("<img loading=\"lazy\" src=\"", out);
  ep_write_escaped(out, run->scene);
  fprintf(out, "/%s\" alt=\"", file);
  ep_write_escaped(out, run->label);
  fputs("\">", out);
}

static void finals(FILE *out, const ep_figure *figure) {
  bool any = false;
  for (int i = 0; i < figure->nruns; i++) any |= figure->run[i].final;
  if (!any) return;
  fputs("<div class=\"finals\">\n", out);
  for (int i = 0; i < figure->nruns; i++) {
    const ep_figure_run *run = &figure->run[i];
    if (!run->final) continue;
    fputs("<figure>", out);
    image(out, run, "final.png");
    fputs("<figcaption>", out);
    ep_write_escaped(out, run->label);
    fprintf(out, ", at %.3g s</figcaption></figure>\n",
            ep_json_get_number(run->summary, "dt") *
                ep_json_get_number(run->summary, "steps_done"));
  }
  fputs("</div>\n", out);
}

// What of the plan ran, or what was left out.
static void stages(FILE *out, const json_t *plan, bool ran, const char *title) {
  size_t i;
  json_t *stage;
  fprintf(out, "<div class=\"%s\"><b>%s</b><ul>", ran ? "in" : "out", title);
  json_array_foreach(json_object_get(plan, "stages"), i, stage) {
    const char *name = json_string_value(json_object_get(stage, "name"));
    const char *reason = json_string_value(json_object_get(stage, "reason"));
    if (!name || json_is_true(json_object_get(stage, "runs")) != ran) continue;
    fputs("<li>", out);
    ep_write_escaped(out, name);
    fputs(": ", out);
    ep_write_escaped(out, reason ? reason : "");
    fputs("</li>", out);
  }
  fputs("</ul></div>", out);
}

static void run_card(FILE *out, const ep_figure_run *run) {
  fputs("<div class=\"run\"><h3>", out);
  ep_write_escaped(out, run->label);
  fputs("</h3>\n", out);
  if (!run->summary) {
    fputs("<p class=\"failed\">Failed: ", out);
    ep_write_escaped(out, run->why);
    fputs("</p>\n", out);
  }
  if (run->strip) image(out, run, "strip.png");
  if (run->reference) image(out, run, "full/reference.png");
  fputs("<p class=\"note\">", out);
  ep_write_escaped(out, run->scene);
  fputs(".yaml</p>\n", out);
  if (run->plan) {
    fputs("<details><summary>What the run used and left out</summary>", out);
    stages(out, run->plan, true, "Used");
    stages(out, run->plan, false, "Left out");
    fputs("</details>", out);
  }
  fputs("</div>\n", out);
}

// ---- numbers -----------------------------------------------------------------------------------

static void run_row(FILE *out, const ep_figure_run *run) {
  const json_t *s = run->summary, *contact = json_object_get(s, "contact");
  fputs("<tr><th>", out);
  ep_write_escaped(out, run->label);
  fputs("</th>", out);
  if (!s) {
    fputs("<td colspan=\"14\" class=\"failed\">failed</td></tr>\n", out);
    return;
  }
  const double steps = ep_json_get_number(s, "steps_done"), m = ep_json_get_number(s, "m");
  ep_page_cell(out, "%.0f", ep_json_get_number(s, "vertices"));
  ep_page_cell(out, "%.0f", ep_json_get_number(s, "tets"));
  ep_page_cell(out, "%.0f", ep_json_get_number(s, "examples"));
  ep_page_cell(out, "%.0f", m > 0 ? m : NAN);
  ep_page_cell(out, "%.0f", ep_json_get_number(s, "r"));
  ep_page_cell(out, "%.0f", ep_json_get_number(s, "s"));
  ep_page_cell(out, "%.3f", ep_json_get_number(s, "t_interp_ms"));
  ep_page_cell(out, "%.3f", ep_json_get_number(s, "t_step_ms"));
  ep_page_cell(out, "%.4g", 1e3 * ep_json_get_number(s, "dt"));
  ep_page_cell(out, "%.2f", steps > 0 ? ep_json_get_number(s, "newton_iterations") / steps : NAN);
  ep_page_cell(out, "%.1f", 100 * ep_json_get_number(s, "example_fraction_most"));
  ep_page_cell(out, "%.1f", 100 * ep_json_get_number(s, "example_fraction"));
  ep_page_cell(out, "%.2f", 100 * ep_json_get_number(contact, "penetration_share"));
  ep_page_cell(out, "%.0f", ep_json_get_number(s, "inverted_tets"));
  fputs("</tr>\n", out);
}

// The same scene in the full space, and how far the reduced run is from it.
static void full_row(FILE *out, const ep_figure_run *run) {
  size_t i;
  json_t *point;
  const json_t *reduced = NULL, *full = NULL;
  json_array_foreach(json_object_get(run->full, "points"), i, point) {
    const char *method = json_string_value(json_object_get(point, "method"));
    if (method && strcmp(method, "full") == 0)
      full = point;
    else if (!reduced)
      reduced = point;
  }
  if (!full) return;
  fputs("<tr><th>", out);
  ep_write_escaped(out, run->label);
  fputs(", full space", out);
  if (reduced)
    fprintf(out, " (the reduced run stays within %.2g %% of the diagonal)",
            100 * ep_json_get_number(reduced, "position_error"));
  fputs("</th>", out);
  ep_page_cell(out, "%.0f", ep_json_get_number(run->full, "vertices"));
  ep_page_cell(out, "%.0f", ep_json_get_number(run->full, "tets"));
  ep_page_cell(out, "%.0f", ep_json_get_number(run->full, "examples"));
  fputs("<td></td><td></td><td></td>", out);
  const double interpolation = ep_json_get_number(full, "target_median_us");
  ep_page_cell(out, "%.3g", 1e-3 * interpolation);
  ep_page_cell(out, "%.4g", 1e-3 * ep_json_get_number(full, "step_median_us"));
  ep_page_cell(out, "%.4g", 1e3 * ep_json_get_number(full, "dt"));
  ep_page_cell(out, "%.2f", ep_json_get_number(full, "newton_per_step"));
  fputs("<td></td><td></td><td></td>", out);
  ep_page_cell(out, "%.0f", ep_json_get_number(full, "inverted"));
  fputs("</tr>\n", out);
}

static void paper_row(FILE *out, const ep_figure_paper *p) {
  fputs("<tr class=\"paper\"><th>paper: ", out);
  ep_write_escaped(out, p->model);
  fputs("</th>", out);
  ep_page_cell(out, "%.0f", p->vertices);
  ep_page_cell(out, "%.0f", p->tets);
  ep_page_cell(out, "%.0f", p->examples);
  ep_page_cell(out, "%.0f", p->m);
  ep_page_cell(out, "%.0f", p->r);
  ep_page_cell(out, "%.0f", p->s);
  ep_page_cell(out, "%.3g", p->t_interp);
  ep_page_cell(out, "%.4g", p->t_total);
  fputs("<td></td><td></td><td></td><td></td><td></td><td></td></tr>\n", out);
}

static void table(FILE *out, const ep_figure *figure) {
  static const char *const heads[] = {
      "",           "vertices",        "tets",         "examples", "m",      "r",
      "s",          "t_interp [ms]",   "t_total [ms]", "dt [ms]",  "Newton", "example, most [%]",
      "at end [%]", "penetration [%]", "inverted"};
  ep_page_table(out, sizeof heads / sizeof *heads, heads);
  for (int i = 0; i < figure->nruns; i++) {
    run_row(out, &figure->run[i]);
    if (figure->run[i].full) full_row(out, &figure->run[i]);
  }
  for (int i = 0; i < figure->npapers; i++) paper_row(out, &figure->paper[i]);
  ep_page_table_end(out);
  if (!figure->note) return;
  fputs("<p class=\"note\">", out);
  ep_write_escaped(out, figure->note);
  fputs("</p>\n", out);
}

// ---- page --------------------------------------------------------------------------------------

static void head(FILE *out, const ep_figures *all) {
  ep_page_begin(out, all->title, STYLE);
  fputs("<p>", out);
  if (all->text) ep_write_escaped(out, all->text);
  fprintf(out, "</p>\n<p class=\"%s\">%d of %d runs done.</p>\n", all->failed ? "failed" : "good",
          all->runs - all->failed, all->runs);
  fputs("<p class=\"note\">Times: medians over the steps of a run on one core; t_total is a whole "
        "step, t_interp the interpolation of the examples in it. Newton: iterations per step. "
        "Example: how far the object went from rest to an example, at most in the run and at its "
        "end. Penetration: "
        "deepest, over the extent of the object. Inverted: most inverted tets after any step."
        "</p>\n",
        out);
}

static void one_figure(FILE *out, const ep_figure *figure) {
  fputs("<h2>", out);
  ep_write_escaped(out, figure->name);
  fputs("</h2>\n<p>", out);
  ep_write_escaped(out, figure->text);
  fputs("</p>\n", out);
  finals(out, figure);
  fputs("<div class=\"runs\">\n", out);
  for (int i = 0; i < figure->nruns; i++) run_card(out, &figure->run[i]);
  fputs("</div>\n", out);
  table(out, figure);
}

ep_status ep_figures_write(const char *root, const ep_figures *figures, ep_error *err) {
  char path[EP_PATH_MAX];
  ep_output out;
  EP_TRY(ep_path_join(root, "index.html", path, err));
  EP_TRY(ep_output_open(&out, path, err));
  head(out.file, figures);
  for (int i = 0; i < figures->count; i++) one_figure(out.file, &figures->figure[i]);
  ep_page_end(out.file);
  return ep_output_commit(&out, err);
}
