#include "app/run/strip.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "results/picture.h"

enum { EQUAL_MOMENTS = 6, EXAMPLES_SHOWN = 8, LABEL = 48 };

// What all panels share.
typedef struct stage {
  const ep_scene *scene;
  const ep_mesh *mesh;
  const ep_model *model;
  const ep_record *record;
  const ep_solids *solids;
  int triangles, *triangle; // the object's surface
} stage;

// One panel with its own memory.
typedef struct shot {
  double *x; // the object (n x 3), then the obstacles
  char label[LABEL];
  ep_drawing *drawing; // the object's, then each obstacle's
  ep_panel panel;
} shot;

static ep_status make_shot(const stage *s, shot *out, ep_error *err) {
  const size_t n = 3 * (size_t)s->mesh->nv;
  *out = (shot){.x = calloc(n + 3 * (size_t)s->solids->mesh.nv + 1, sizeof(double))};
  out->drawing = calloc((size_t)s->scene->nobstacles + 1, sizeof *out->drawing);
  if (!out->x || !out->drawing) return ep_fail(err, EP_ERR_MEMORY, "no memory for the pictures");
  out->drawing[0] = ep_default_drawing(s->mesh->nv, out->x, s->triangles, s->triangle);
  return EP_OK;
}

static void finish_shot(shot *out, int drawings) {
  out->panel = (ep_panel){.drawings = drawings, .drawing = out->drawing, .label = out->label};
}

// x: positions of all obstacles at time t. A plane that is level is a floor.
static void draw_obstacle(const stage *s, int i, double t, const double *x, ep_drawing *out) {
  static const float grey[2][3] = {{0.62f, 0.63f, 0.64f}, {0.78f, 0.78f, 0.76f}}; // body, floor
  const int first = s->solids->first_triangle[i], end = s->solids->first_triangle[i + 1];
  const ep_view view = ep_default_view();
  ep_frame pose;
  double level = 0;
  ep_obstacle_pose(&s->scene->obstacle[i], t, &pose);
  for (int k = 0; k < 3; k++) level += pose.R[3 * k + 2] * view.up[k];
  *out = ep_default_drawing(s->solids->mesh.nv, x, end - first,
                            s->solids->triangle + 3 * (size_t)first);
  out->floor = s->scene->obstacle[i].kind == EP_OBSTACLE_PLANE && level > 0.9999;
  memcpy(out->tint, grey[out->floor], sizeof grey[0]);
}

static void drop_shot(shot *out) {
  free(out->x);
  free(out->drawing);
}

static ep_status shoot_moment(const stage *s, int row, shot *out, ep_error *err) {
  EP_TRY(make_shot(s, out, err));
  ep_record_positions(s->model, s->record, row, out->x);
  snprintf(out->label, LABEL, "t = %.2f s", s->record->time[row]);
  ep_solids_place(s->scene, s->solids, s->record->time[row], out->x + 3 * (size_t)s->mesh->nv);
  for (int i = 0; i < s->scene->nobstacles; i++)
    draw_obstacle(s, i, s->record->time[row], out->x + 3 * (size_t)s->mesh->nv,
                  &out->drawing[i + 1]);
  finish_shot(out, s->scene->nobstacles + 1);
  return EP_OK;
}

// An example stands where the run begins.
static ep_status shoot_example(const stage *s, int example, shot *out, ep_error *err) {
  const float orange[3] = {0.85f, 0.55f, 0.25f};
  EP_TRY(make_shot(s, out, err));
  const double *q = s->model->example_q + (size_t)example * (size_t)s->model->size.r;
  ep_positions(s->model, q, out->x);
  if (s->record->frame) ep_place(s->model, &s->record->frame[0], out->x);
  snprintf(out->label, LABEL, "example %d", example + 1);
  memcpy(out->drawing[0].tint, orange, sizeof orange);
  finish_shot(out, 1);
  return EP_OK;
}

// The record's row nearest to a time.
static int row_at(const ep_record *record, double time) {
  int best = 0;
  for (int i = 1; i < record->rows; i++)
    if (fabs(record->time[i] - time) < fabs(record->time[best] - time)) best = i;
  return best;
}

static int moment_count(const stage *s) {
  if (s->scene->nmoments) return s->scene->nmoments;
  return s->record->rows < EQUAL_MOMENTS ? s->record->rows : EQUAL_MOMENTS;
}

static int moment_row(const stage *s, int i, int moments) {
  if (s->scene->nmoments) return row_at(s->record, s->scene->moment[i]);
  return moments > 1 ? i * (s->record->rows - 1) / (moments - 1) : 0;
}

static ep_status shoot_all(const stage *s, int moments, int count, shot *list, ep_error *err) {
  for (int i = 0; i < count; i++)
    EP_TRY(i < moments ? shoot_moment(s, moment_row(s, i, moments), &list[i], err)
                       : shoot_example(s, i - moments, &list[i], err));
  return EP_OK;
}

static ep_status write_strip(const char *folder, const stage *s, ep_error *err) {
  const int k = s->model->size.k, shown = k < EXAMPLES_SHOWN ? k : EXAMPLES_SHOWN;
  const int moments = moment_count(s), count = moments + shown;
  char path[EP_PATH_MAX], title[256];
  shot *list = calloc((size_t)count, sizeof *list);
  ep_panel *panel = calloc((size_t)count, sizeof *panel);
  ep_status status =
      list && panel ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for the pictures");
  if (status == EP_OK) status = shoot_all(s, moments, count, list, err);
  if (status == EP_OK) status = ep_path_join(folder, "strip.png", path, err);
  if (status == EP_OK) {
    ep_view view = ep_default_view();
    snprintf(title, sizeof title, shown < k ? "%s (the first %d of %d examples)" : "%s",
             s->scene->name, shown, k);
    for (int i = 0; i < count; i++) panel[i] = list[i].panel;
    view.shared = true;
    view.columns = count > 10 ? (count + 2) / 3 : count > 4 ? (count + 1) / 2 : 0;
    view.title = title;
    status = ep_picture_write(path, &view, count, panel, err);
  }
  for (int i = 0; i < count && list; i++) drop_shot(&list[i]);
  free(list);
  free(panel);
  return status;
}

static ep_status write_final(const char *folder, const stage *s, ep_error *err) {
  char path[EP_PATH_MAX];
  shot last = {0};
  ep_status status = ep_path_join(folder, "final.png", path, err);
  if (status == EP_OK) status = shoot_moment(s, s->record->rows - 1, &last, err);
  if (status == EP_OK) {
    ep_view view = ep_default_view();
    view.width = 640;
    view.height = 480;
    status = ep_picture_write(path, &view, 1, &last.panel, err);
  }
  drop_shot(&last);
  return status;
}

ep_status ep_strip_write(const char *folder, const ep_scene *scene, const ep_mesh *mesh,
                         const ep_model *model, const ep_record *record, const ep_solids *solids,
                         ep_error *err) {
  stage s = {.scene = scene, .mesh = mesh, .model = model, .record = record, .solids = solids};
  EP_TRY(ep_mesh_surface(mesh, &s.triangles, &s.triangle, err));
  ep_status status = write_strip(folder, &s, err);
  if (status == EP_OK) status = write_final(folder, &s, err);
  free(s.triangle);
  return status;
}
