// A list of figures (data/figures.json) and the runs that show them, for one page to look at.
#ifndef EP_APP_FIGURES_FIGURES_H
#define EP_APP_FIGURES_FIGURES_H

#include <jansson.h>
#include <stdbool.h>

#include "base/error.h"

// One run of a figure: the folder `ROOT/scene`, where `run` and `plan --json` left their results.
typedef struct ep_figure_run {
  const char *scene, *label;    // borrowed from the list
  json_t *summary;              // summary.json; NULL: the run failed
  json_t *plan;                 // plan.json; NULL where there is none
  json_t *full;                 // full/results.json of `compare`; NULL where there is none
  char why[1024];               // the last line of run.log, where the run failed
  bool strip, final, reference; // strip.png, final.png, full/reference.png are there
} ep_figure_run;

// A row of the paper's own tables; NaN where it says nothing.
typedef struct ep_figure_paper {
  const char *model;
  double vertices, tets, examples, m, r, s, t_interp, t_total; // [ms]
} ep_figure_paper;

typedef struct ep_figure {
  const char *name, *text, *note; // note: what the paper's row means; NULL: none
  int nruns, npapers;
  ep_figure_run *run;
  ep_figure_paper *paper;
} ep_figure;

typedef struct ep_figures {
  const char *title, *text;
  int count, runs, failed; // figures; their runs, and how many of them left no summary
  ep_figure *figure;
  json_t *list; // owns the strings
} ep_figures;

// Read the list, and of each run what is there in its folder below `root`. *out is to be freed
// after EP_OK alone.
// Errors: EP_ERR_IO, EP_ERR_FORMAT (no such list: where, and what is expected), EP_ERR_MEMORY.
ep_status ep_figures_read(const char *path, const char *root, ep_figures *out, ep_error *err);
void ep_figures_free(ep_figures *figures);

// Write root/index.html; its pictures are named relative to it.
ep_status ep_figures_write(const char *root, const ep_figures *figures, ep_error *err);

#endif
