// Eigenfunctions for people: a table, a .vtu file, and a picture of the inside.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/commands.h"
#include "app/report.h"
#include "linalg/petsc.h"
#include "mesh/io.h"
#include "results/colors.h"
#include "results/cut.h"
#include "results/picture.h"

enum { SHOWN = 8, COLUMNS = 4 }; // functions in the picture

static ep_status write_functions(const char *path, const ep_mesh *mesh, const ep_lb *lb,
                                 ep_error *err) {
  ep_field *field = calloc((size_t)lb->m, sizeof *field);
  char(*name)[16] = calloc((size_t)lb->m, sizeof *name);
  ep_status status = field && name ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for %s", path);
  for (int i = 0; i < lb->m && status == EP_OK; i++) {
    snprintf(name[i], sizeof name[i], "phi%03d", i + 1);
    field[i] = (ep_field){name[i], 1, lb->phi + (size_t)i * (size_t)lb->n};
  }
  if (status == EP_OK) status = ep_mesh_write_vtu(path, mesh, NULL, lb->m, field, 0, NULL, err);
  free(field);
  free(name);
  return status;
}

// ---- the picture -----------------------------------------------------------------------------

// The plane through the middle across the shortest side shows most of the inside; it is looked at
// from the front, a little from above and from the right.
static void choose_cut(const ep_mesh *mesh, double point[3], double normal[3], ep_view *view) {
  double low[3], high[3];
  int shortest = 2;
  ep_mesh_bounds(mesh, low, high);
  for (int a = 1; a >= 0; a--)
    if (high[a] - low[a] < 0.999 * (high[shortest] - low[shortest])) shortest = a;
  for (int a = 0; a < 3; a++) {
    normal[a] = a == shortest;
    point[a] = 0.5 * (low[a] + high[a]);
  }
  const double from[3][3] = {{1, 0.4, -0.45}, {0.3, 1, 0.55}, {0.35, 0.4, 1}};
  memcpy(view->from, from[shortest], sizeof view->from);
}

// One function on what is left of the body and on the cut.
typedef struct function_panel {
  ep_drawing part[2];
  float *color;
  char label[48];
} function_panel;

static ep_status make_panel(const ep_cut *cut, const ep_lb *lb, int i, function_panel *f,
                            ep_panel *panel, ep_error *err) {
  const size_t nv = (size_t)cut->nv;
  double *value = malloc(nv * sizeof *value);
  f->color = malloc(3 * nv * sizeof *f->color);
  if (!value || !f->color) {
    free(value);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a picture of eigenfunctions");
  }
  ep_cut_field(cut, 1, lb->phi + (size_t)i * (size_t)lb->n, value);
  ep_color_signed(cut->nv, value, f->color);
  free(value);
  const int count[2] = {cut->outer, cut->nt - cut->outer};
  int parts = 0;
  for (int inside = 0; inside < 2; inside++) {
    if (!count[inside]) continue;
    const int first = inside ? cut->outer : 0;
    ep_drawing *d = &f->part[parts++];
    *d = ep_default_drawing(cut->nv, cut->x, count[inside], cut->triangle + 3 * (size_t)first);
    d->color = f->color;
    d->hidden_edges = cut->hidden + first;
    d->edges = inside ? 0.18f : 0;
  }
  snprintf(f->label, sizeof f->label, "%d: %.4g", i + 1, lb->lambda[i]);
  *panel = (ep_panel){parts, f->part, f->label};
  return EP_OK;
}

static ep_status draw_functions(const char *path, const ep_mesh *mesh, const ep_lb *lb,
                                ep_error *err) {
  const int shown = lb->m < SHOWN ? lb->m : SHOWN;
  function_panel function[SHOWN] = {0};
  ep_panel panel[SHOWN];
  ep_view view = ep_default_view();
  double point[3], normal[3];
  ep_cut cut;
  choose_cut(mesh, point, normal, &view);
  view.columns = shown < COLUMNS ? shown : COLUMNS;
  view.title = "eigenfunctions inside the volume: number and eigenvalue";
  EP_TRY(ep_cut_mesh(mesh, NULL, point, normal, &cut, err));
  ep_status status = EP_OK;
  for (int i = 0; i < shown && status == EP_OK; i++)
    status = make_panel(&cut, lb, i, &function[i], &panel[i], err);
  if (status == EP_OK) status = ep_picture_write(path, &view, shown, panel, err);
  for (int i = 0; i < shown; i++) free(function[i].color);
  ep_cut_free(&cut);
  return status;
}

// ---- the command -----------------------------------------------------------------------------

// F.vtu -> F.png; anything else gets .png at its end.
static ep_status picture_path(const char *out, char *path, ep_error *err) {
  const size_t length = strlen(out);
  const bool vtu = length > 4 && strcmp(out + length - 4, ".vtu") == 0;
  if (length + 5 > EP_PATH_MAX) return ep_fail(err, EP_ERR_IO, "%s: the path is too long", out);
  snprintf(path, EP_PATH_MAX, "%.*s.png", (int)(vtu ? length - 4 : length), out);
  return EP_OK;
}

static ep_status leave_files(const char *out, const ep_mesh *mesh, const ep_lb *lb, ep_error *err) {
  char path[EP_PATH_MAX];
  EP_TRY(picture_path(out, path, err));
  EP_TRY(write_functions(out, mesh, lb, err));
  return draw_functions(path, mesh, lb, err);
}

static ep_status print(const ep_cli *cli, const ep_mesh *mesh, const ep_lb *lb, ep_error *err) {
  if (cli->json)
    return ep_report_print(json_pack("{s:o, s:i, s:i, s:f, s:o}", "mesh", ep_json_text(mesh->name),
                                     "vertices", mesh->nv, "tets", mesh->nt, "volume", lb->volume,
                                     "eigenvalues", ep_json_numbers(lb->m, lb->lambda)),
                           err);
  printf("%s: %d vertices, %d tets, volume %.8g\n", mesh->name, mesh->nv, mesh->nt, lb->volume);
  for (int i = 0; i < lb->m; i++) printf("%4d  %.10g\n", i + 1, lb->lambda[i]);
  return EP_OK;
}

ep_status ep_command_eigen(const ep_cli *cli, ep_error *err) {
  ep_log log = ep_log_default(cli->quiet);
  ep_mesh mesh = {0};
  ep_mesh_findings findings;
  ep_lb lb = {0};
  if (cli->out) {
    EP_TRY(ep_output_place(cli->out, err));
    EP_TRY(ep_output_spares(cli->out, cli->input, err));
  }
  EP_TRY(ep_mesh_read(cli->input, &mesh, &findings, &log, err));
  ep_status status = ep_mesh_require_sound(&mesh, &findings, false, err);
  if (status == EP_OK) {
    status = ep_petsc_start(err);
    if (status == EP_OK) status = ep_lb_eigen(&mesh, cli->count, &log, &lb, err);
    ep_petsc_stop();
  }
  if (status == EP_OK && cli->out) status = leave_files(cli->out, &mesh, &lb, err);
  if (status == EP_OK) status = print(cli, &mesh, &lb, err);
  ep_lb_free(&lb);
  ep_mesh_free(&mesh);
  return status;
}
