#include "app/maps/align_view.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/maps/quality_json.h"
#include "app/scene/landmarks.h"
#include "linalg/dense.h"
#include "mesh/io.h"
#include "results/colors.h"
#include "results/gallery.h"

enum { FUNCTIONS = 4, NAME = 140, SWEEPS = 30 };

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the pictures of maps");
}

// folder/PREFIX-NAME ENDING with characters that do not fit a file name replaced.
static ep_status file_path(const char *folder, const char *name, const char *ending, char *path,
                           ep_error *err) {
  char file[NAME + 40];
  snprintf(file, sizeof file, "%.*s%s", NAME, name, ending);
  for (char *p = file; *p; p++)
    if (*p == ':' || *p == '/') *p = '-';
  return ep_path_join(folder, file, path, err);
}

// Positions turned into the frame of the map's first shape, so that both look the same way.
static double *turned(const ep_mesh *mesh, const double *x, const double *r) {
  double *out = malloc(3 * (size_t)mesh->nv * sizeof *out);
  for (size_t v = 0; out && v < (size_t)mesh->nv; v++)
    for (size_t a = 0; a < 3; a++)
      out[3 * v + a] =
          r[3 * a] * x[3 * v] + r[3 * a + 1] * x[3 * v + 1] + r[3 * a + 2] * x[3 * v + 2];
  return out;
}

static void bounds(int n, const double *x, double low[3], double high[3]) {
  for (int a = 0; a < 3; a++) low[a] = high[a] = x[a];
  for (int i = 0; i < 3 * n; i++) {
    low[i % 3] = fmin(low[i % 3], x[i]);
    high[i % 3] = fmax(high[i % 3], x[i]);
  }
}

// ---- a map -----------------------------------------------------------------------------------

// What the pictures of a map need.
typedef struct map_view {
  const ep_mesh *from, *to;
  const ep_lb *lb_from, *lb_to;
  const ep_map *map;
  const char *from_name, *to_name;
  int functions;
  double *there;                  // (to->nv x 3) positions of `to` in from's frame
  double *images;                 // (from->nv x 3) those of the images
  float *color_from, *color_to;   // (nv x 3)
  double *own, *coupled, *pulled; // (functions x nv) of from, of to, of to carried to from
  // places shown on both: the landmarks given, else the one that would settle the frame
  int dots;
  double dot[2][3 * EP_LANDMARKS_MAX];
} map_view;

static void free_view(map_view *v) {
  free(v->there);
  free(v->images);
  free(v->color_from);
  free(v->color_to);
  free(v->own);
  free(v->coupled);
  free(v->pulled);
}

// Dot at a vertex, or where a point was given at the vertex nearest to it: on the mesh.
static void place_dot(const ep_mesh *mesh, const double *x, int vertex, const double at[3],
                      double *out) {
  double least = HUGE_VAL;
  for (int v = 0; v < mesh->nv && vertex < 0; v++) {
    double d2 = 0;
    for (int a = 0; a < 3; a++) d2 += pow(x[3 * (size_t)v + (size_t)a] - at[a], 2);
    if (d2 >= least) continue;
    least = d2;
    memcpy(out, x + 3 * (size_t)v, 3 * sizeof *out);
  }
  if (vertex >= 0) memcpy(out, x + 3 * (size_t)vertex, 3 * sizeof *out);
}

static ep_status fill_dots(map_view *v, const ep_bake *bake, const ep_stage *stage, ep_error *err) {
  static const double nowhere[3] = {0, 0, 0};
  const ep_map_quality *q = &v->map->quality;
  ep_landmark mark[EP_LANDMARKS_MAX];
  EP_TRY(ep_landmarks_of_map(bake->scene, bake->shapes, stage->family, stage->from, stage->to, mark,
                             &v->dots, err));
  for (int m = 0; m < v->dots; m++) {
    double there[3];
    const double *r = v->map->rotation, *to = mark[m].to;
    for (int a = 0; a < 3; a++)
      there[a] = r[3 * a] * to[0] + r[3 * a + 1] * to[1] + r[3 * a + 2] * to[2];
    place_dot(v->from, v->from->x, mark[m].from_vertex, mark[m].from, v->dot[0] + 3 * m);
    place_dot(v->to, v->there, mark[m].to_vertex, there, v->dot[1] + 3 * m);
  }
  if (v->dots || q->settle_from < 0 || q->settle_to < 0) return EP_OK;
  v->dots = 1;
  place_dot(v->from, v->from->x, q->settle_from, nowhere, v->dot[0]);
  place_dot(v->to, v->there, q->settle_to, nowhere, v->dot[1]);
  return EP_OK;
}

static ep_status fill_view(map_view *v, ep_error *err) {
  const size_t n = (size_t)v->from->nv, k = (size_t)v->to->nv, f = (size_t)v->functions;
  double low[3], high[3];
  v->there = turned(v->to, v->to->x, v->map->rotation);
  v->images = malloc(3 * n * sizeof *v->images);
  v->color_from = malloc(3 * n * sizeof *v->color_from);
  v->color_to = malloc(3 * k * sizeof *v->color_to);
  v->own = malloc(f * n * sizeof *v->own);
  v->coupled = calloc(f * k, sizeof *v->coupled);
  v->pulled = malloc(f * n * sizeof *v->pulled);
  if (!v->there || !v->images || !v->color_from || !v->color_to || !v->own || !v->coupled ||
      !v->pulled)
    return no_memory(err);
  bounds(v->to->nv, v->there, low, high);
  ep_map_pull(v->map, v->to, 3, v->there, v->images);
  ep_color_position(v->to->nv, v->there, low, high, v->color_to);
  ep_color_position(v->from->nv, v->images, low, high, v->color_from);
  const double size_from = sqrt(v->lb_from->volume), size_to = sqrt(v->lb_to->volume);
  for (size_t j = 0; j < f; j++) {
    for (size_t i = 0; i < n; i++) v->own[j * n + i] = size_from * v->lb_from->phi[j * n + i];
    for (size_t l = 0; l < (size_t)v->map->m; l++) {
      const double a = size_to * v->map->a[l * (size_t)v->map->m + j];
      for (size_t i = 0; i < k; i++) v->coupled[j * k + i] += a * v->lb_to->phi[l * k + i];
    }
    ep_map_pull(v->map, v->to, 1, v->coupled + j * k, v->pulled + j * n);
  }
  return EP_OK;
}

static ep_status draw_colors(const map_view *v, const char *path, ep_error *err) {
  char label[2][100], title[240], note[sizeof v->map->quality.reasons + 32];
  snprintf(label[0], sizeof label[0], "%s, coloured by its images", v->from_name);
  snprintf(label[1], sizeof label[1], "%s, coloured by position", v->to_name);
  snprintf(title, sizeof title, "%.70s -> %.70s: the map is %s", v->from_name, v->to_name,
           ep_verdict_name(v->map->quality.verdict));
  const ep_gallery_item item[2] = {{.mesh = v->from,
                                    .color = v->color_from,
                                    .label = label[0],
                                    .dots = v->dots,
                                    .dot = v->dot[0]},
                                   {.mesh = v->to,
                                    .x = v->there,
                                    .color = v->color_to,
                                    .label = label[1],
                                    .dots = v->dots,
                                    .dot = v->dot[1]}};
  ep_view view = ep_default_view();
  view.shared = false;
  view.width = 560;
  view.height = 460;
  view.title = title;
  ep_map_note(&v->map->quality, v->dots, note, sizeof note);
  view.note = note;
  return ep_gallery_poses(path, &view, 2, item, 0, err);
}

// Both rows in one scale of colours for each function: that of the first shape.
static ep_status draw_functions(const map_view *v, const char *path, ep_error *err) {
  const size_t n = (size_t)v->from->nv, k = (size_t)v->to->nv, f = (size_t)v->functions;
  float *color = malloc(3 * f * (n + k) * sizeof *color);
  ep_gallery_item item[2 * FUNCTIONS];
  char label[2 * FUNCTIONS][100];
  if (!color) return no_memory(err);
  for (size_t j = 0; j < f; j++) {
    float *above = color + 3 * j * (n + k), *below = above + 3 * n;
    double most = 0;
    for (size_t i = 0; i < n; i++) most = fmax(most, fabs(v->own[j * n + i]));
    ep_color_values(v->from->nv, v->own + j * n, -most, most, EP_COLORS_DIVERGING, above);
    ep_color_values(v->to->nv, v->coupled + j * k, -most, most, EP_COLORS_DIVERGING, below);
    snprintf(label[j], sizeof label[j], "%s: function %zu", v->from_name, j + 1);
    snprintf(label[f + j], sizeof label[f + j], "%s: coupled %zu", v->to_name, j + 1);
    item[j] = (ep_gallery_item){.mesh = v->from, .color = above, .label = label[j]};
    item[f + j] =
        (ep_gallery_item){.mesh = v->to, .x = v->there, .color = below, .label = label[f + j]};
  }
  ep_view view = ep_default_view();
  view.shared = false;
  view.width = 360;
  view.height = 320;
  view.columns = v->functions;
  view.title = "eigenfunctions above, the coupled ones of the other shape below";
  view.note = "red above zero, blue below, one scale for each column; where the map is right both "
              "rows agree";
  const ep_status status = ep_gallery_poses(path, &view, 2 * v->functions, item, 0, err);
  free(color);
  return status;
}

static double *widened(int n, const float *color) {
  double *out = malloc(3 * (size_t)n * sizeof *out);
  for (int i = 0; out && i < 3 * n; i++) out[i] = color[i];
  return out;
}

static ep_status write_from(const map_view *v, const char *path, ep_error *err) {
  ep_field field[2 + 2 * FUNCTIONS];
  char name[2 * FUNCTIONS][24];
  const size_t n = (size_t)v->from->nv;
  double *rgb = widened(v->from->nv, v->color_from), *images = malloc(3 * n * sizeof *images);
  int count = 0;
  if (!rgb || !images) {
    free(rgb);
    free(images);
    return no_memory(err);
  }
  ep_map_pull(v->map, v->to, 3, v->to->x, images); // where the other file has them
  field[count++] = (ep_field){"image", 3, images};
  field[count++] = (ep_field){"rgb", 3, rgb};
  for (int j = 0; j < v->functions; j++) {
    snprintf(name[2 * j], sizeof name[0], "phi%d", j + 1);
    snprintf(name[2 * j + 1], sizeof name[0], "carried%d", j + 1);
    field[count++] = (ep_field){name[2 * j], 1, v->own + (size_t)j * n};
    field[count++] = (ep_field){name[2 * j + 1], 1, v->pulled + (size_t)j * n};
  }
  const ep_status status = ep_mesh_write_vtu(path, v->from, NULL, count, field, 0, NULL, err);
  free(rgb);
  free(images);
  return status;
}

static ep_status write_to(const map_view *v, const char *path, ep_error *err) {
  ep_field field[1 + FUNCTIONS];
  char name[FUNCTIONS][24];
  double *rgb = widened(v->to->nv, v->color_to);
  int count = 0;
  if (!rgb) return no_memory(err);
  field[count++] = (ep_field){"rgb", 3, rgb};
  for (int j = 0; j < v->functions; j++) {
    snprintf(name[j], sizeof name[0], "coupled%d", j + 1);
    field[count++] = (ep_field){name[j], 1, v->coupled + (size_t)j * (size_t)v->to->nv};
  }
  const ep_status status = ep_mesh_write_vtu(path, v->to, NULL, count, field, 0, NULL, err);
  free(rgb);
  return status;
}

static ep_status leave_map(const map_view *v, const char *folder, const char *name, ep_error *err) {
  char path[EP_PATH_MAX];
  EP_TRY(file_path(folder, name, ".png", path, err));
  EP_TRY(draw_colors(v, path, err));
  EP_TRY(file_path(folder, name, "-functions.png", path, err));
  EP_TRY(draw_functions(v, path, err));
  EP_TRY(file_path(folder, name, ".vtu", path, err));
  EP_TRY(write_from(v, path, err));
  EP_TRY(file_path(folder, name, "-example.vtu", path, err));
  return write_to(v, path, err);
}

ep_status ep_align_view_map(const char *folder, ep_bake *bake, const ep_stage *stage,
                            const ep_map *map, ep_error *err) {
  const ep_shape_file *from = &bake->shapes->shape[stage->from];
  const ep_shape_file *to = &bake->shapes->shape[stage->to];
  EP_TRY(ep_bake_lb(bake, stage->from, err));
  EP_TRY(ep_bake_lb(bake, stage->to, err));
  map_view v = {.from = &from->mesh,
                .to = &to->mesh,
                .lb_from = &bake->lb[stage->from],
                .lb_to = &bake->lb[stage->to],
                .map = map,
                .from_name = from->name,
                .to_name = to->name,
                .functions = map->m < FUNCTIONS ? map->m : FUNCTIONS};
  ep_status status = fill_view(&v, err);
  if (status == EP_OK) status = fill_dots(&v, bake, stage, err);
  if (status == EP_OK) status = leave_map(&v, folder, stage->name, err);
  free_view(&v);
  return status;
}

// ---- a pose ----------------------------------------------------------------------------------

typedef struct pose_view {
  const ep_mesh *object, *rest, *pose;
  const ep_map *to_rest, *to_pose;    // NULL: vertices correspond
  double *rest_x, *pose_x, *object_x; // positions drawn
  float *object_color, *rest_color, *pose_color;
} pose_view;

static void free_pose_view(pose_view *v) {
  free(v->rest_x);
  free(v->pose_x);
  free(v->object_x);
  free(v->object_color);
  free(v->rest_color);
  free(v->pose_color);
}

// Where the object's vertices are in the example's pose (n x 3).
static ep_status follow(const pose_view *v, double *seen, ep_error *err) {
  double *on_rest = malloc(3 * (size_t)v->rest->nv * sizeof *on_rest);
  if (!on_rest) return no_memory(err);
  if (v->to_pose)
    ep_map_pull(v->to_pose, v->pose, 3, v->pose->x, on_rest);
  else
    memcpy(on_rest, v->pose->x, 3 * (size_t)v->rest->nv * sizeof *on_rest);
  if (v->to_rest)
    ep_map_pull(v->to_rest, v->rest, 3, on_rest, seen);
  else
    memcpy(seen, on_rest, 3 * (size_t)v->object->nv * sizeof *seen);
  free(on_rest);
  return EP_OK;
}

// The example at rest in the object's frame; its pose turned so that it stands as the object does
// in that pose.
static ep_status place_example(pose_view *v, ep_error *err) {
  static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double r[9], from[3], to[3], *seen = malloc(3 * (size_t)v->object->nv * sizeof *seen);
  ep_status status = seen ? follow(v, seen, err) : no_memory(err);
  if (status == EP_OK) status = ep_kabsch(v->object->nv, seen, v->object_x, NULL, r, from, to, err);
  free(seen);
  if (status != EP_OK) return status;
  v->rest_x = turned(v->rest, v->rest->x, v->to_rest ? v->to_rest->rotation : identity);
  v->pose_x = turned(v->pose, v->pose->x, r);
  return v->rest_x && v->pose_x ? EP_OK : no_memory(err);
}

// Colours and what they weigh, (n x 4), become colours of weight one.
static void settle_colors(int n, double *sum) {
  for (int i = 0; i < n; i++) {
    double *at = sum + 4 * (size_t)i;
    for (int a = 0; a < 4 && at[3] > 0; a++) at[a] /= a < 3 ? at[3] : 1;
    if (at[3] > 0) at[3] = 1;
  }
}

// Vertices without a colour take the mean of their neighbours'; sweep by sweep.
static void fill_colors(const ep_mesh *mesh, double *sum, double *next) {
  const size_t bytes = 4 * (size_t)mesh->nv * sizeof *sum;
  for (int sweep = 0; sweep < SWEEPS; sweep++) {
    memcpy(next, sum, bytes);
    for (int e = 0; e < mesh->nt; e++)
      for (int i = 0; i < 16; i++) {
        const double *from = sum + 4 * (size_t)mesh->tet[4 * e + i % 4];
        const size_t to = (size_t)mesh->tet[4 * e + i / 4];
        for (int a = 0; a < 4 && sum[4 * to + 3] == 0; a++) next[4 * to + (size_t)a] += from[a];
      }
    settle_colors(mesh->nv, next);
    memcpy(sum, next, bytes);
  }
}

// Colours of the rest shape's vertices, pushed on to the pose's mesh: every vertex takes those of
// the points that fall into its tets; the others take their neighbours'.
static ep_status push_colors(pose_view *v, ep_error *err) {
  const size_t n = (size_t)v->pose->nv;
  double *sum = calloc(8 * n, sizeof *sum);
  if (!sum) return no_memory(err);
  for (int i = 0; i < v->rest->nv; i++) {
    const int *corner = v->pose->tet + 4 * (size_t)v->to_pose->tet[i];
    for (int c = 0; c < 4; c++) {
      const double weight = v->to_pose->weight[4 * (size_t)i + (size_t)c];
      double *at = sum + 4 * (size_t)corner[c];
      for (int a = 0; a < 3; a++) at[a] += weight * v->rest_color[3 * i + a];
      at[3] += weight;
    }
  }
  settle_colors(v->pose->nv, sum);
  fill_colors(v->pose, sum, sum + 4 * n);
  for (size_t i = 0; i < 3 * n; i++) v->pose_color[i] = (float)sum[i / 3 * 4 + i % 3];
  free(sum);
  return EP_OK;
}

static ep_status color_pose_view(pose_view *v, ep_error *err) {
  double low[3], high[3];
  v->rest_color = malloc(3 * (size_t)v->rest->nv * sizeof *v->rest_color);
  v->pose_color = calloc(3 * (size_t)v->pose->nv, sizeof *v->pose_color);
  v->object_color = malloc(3 * (size_t)v->object->nv * sizeof *v->object_color);
  double *images = malloc(3 * (size_t)v->object->nv * sizeof *images);
  if (!v->rest_color || !v->pose_color || !v->object_color || !images) {
    free(images);
    return no_memory(err);
  }
  bounds(v->rest->nv, v->rest_x, low, high);
  ep_color_position(v->rest->nv, v->rest_x, low, high, v->rest_color);
  if (v->to_rest)
    ep_map_pull(v->to_rest, v->rest, 3, v->rest_x, images);
  else
    memcpy(images, v->rest_x, 3 * (size_t)v->object->nv * sizeof *images);
  ep_color_position(v->object->nv, images, low, high, v->object_color);
  free(images);
  if (v->to_pose) return push_colors(v, err);
  memcpy(v->pose_color, v->rest_color, 3 * (size_t)v->rest->nv * sizeof *v->pose_color);
  return EP_OK;
}

// What the pose is worth: its tets, and the maps it came through where they are not good.
static void pose_note(const pose_view *v, const ep_pose_quality *q, size_t size, char *note) {
  const ep_map *map[2] = {v->to_rest, v->to_pose};
  static const char *const to[2] = {"to the example at rest", "from there to its pose"};
  int used = snprintf(note, size, "same colour where mapped; %.0f inverted tets", q->inverted_tets);
  if (q->inverted_before > 0)
    used += snprintf(note + used, size - (size_t)used, " (%.0f before repair)", q->inverted_before);
  used += snprintf(note + used, size - (size_t)used, ", smallest volume %.2g of rest",
                   q->worst_volume_ratio);
  for (int i = 0; i < 2; i++)
    if (map[i] && map[i]->quality.verdict != EP_MAP_GOOD)
      used += snprintf(note + used, size - (size_t)used, "; the map %s is %s", to[i],
                       ep_verdict_name(map[i]->quality.verdict));
}

static ep_status draw_pose(const pose_view *v, const char *name, const char *rest,
                           const ep_pose_quality *q, const char *path, ep_error *err) {
  char title[140], note[320], label[2][120];
  snprintf(title, sizeof title, "%.100s on the object's mesh", name);
  snprintf(label[0], sizeof label[0], "example at rest: %.80s", rest);
  snprintf(label[1], sizeof label[1], "example in its pose: %.80s", name);
  pose_note(v, q, sizeof note, note);
  const ep_gallery_item item[4] = {
      {.mesh = v->rest, .x = v->rest_x, .color = v->rest_color, .label = label[0]},
      {.mesh = v->pose, .x = v->pose_x, .color = v->pose_color, .label = label[1]},
      {.mesh = v->object, .color = v->object_color, .label = "object at rest"},
      {.mesh = v->object,
       .x = v->object_x,
       .color = v->object_color,
       .label = "object in that pose"}};
  ep_view view = ep_default_view();
  view.shared = false;
  view.columns = 2;
  view.title = title;
  view.note = note;
  return ep_gallery_poses(path, &view, 4, item, 0, err);
}

static ep_status write_pose(const pose_view *v, const double *u, const char *path, ep_error *err) {
  const size_t nt = (size_t)v->object->nt;
  double *rgb = widened(v->object->nv, v->object_color), *volume = malloc(2 * nt * sizeof *volume);
  ep_status status = rgb && volume ? EP_OK : no_memory(err);
  if (status == EP_OK) {
    ep_tet_volumes(v->object, v->object->x, volume + nt);
    ep_tet_volumes(v->object, v->object_x, volume);
    for (size_t e = 0; e < nt; e++) volume[e] /= volume[nt + e];
    const ep_field point[2] = {{"displacement", 3, u}, {"rgb", 3, rgb}};
    const ep_field cell = {"volume_ratio", 1, volume};
    status = ep_mesh_write_vtu(path, v->object, v->object_x, 2, point, 1, &cell, err);
  }
  free(rgb);
  free(volume);
  return status;
}

static ep_status fill_pose_view(ep_bake *bake, const ep_pose_source *example, const double *u,
                                pose_view *v, ep_error *err) {
  const size_t n3 = 3 * (size_t)v->object->nv;
  if (!example->rest_same)
    EP_TRY(ep_bake_map(bake, ep_plan_map(bake->plan, 0, example->rest), &v->to_rest, err));
  if (!example->pose_same)
    EP_TRY(ep_bake_map(bake, ep_plan_map(bake->plan, example->rest, example->shape), &v->to_pose,
                       err));
  v->object_x = malloc(n3 * sizeof *v->object_x);
  if (!v->object_x) return no_memory(err);
  for (size_t i = 0; i < n3; i++) v->object_x[i] = v->object->x[i] + u[i];
  EP_TRY(place_example(v, err));
  return color_pose_view(v, err);
}

ep_status ep_align_view_pose(const char *folder, ep_bake *bake, int example, ep_error *err) {
  const ep_pose_source *source = &bake->shapes->example[example];
  const ep_shape_file *shape = bake->shapes->shape;
  pose_view v = {.object = &shape[0].mesh,
                 .rest = &shape[source->rest].mesh,
                 .pose = &shape[source->shape].mesh};
  const double *u = bake->poses + (size_t)example * 3 * (size_t)v.object->nv;
  const char *name = shape[source->shape].name;
  char path[EP_PATH_MAX], file[NAME];
  snprintf(file, sizeof file, "pose-%s", name);
  ep_status status = fill_pose_view(bake, source, u, &v, err);
  if (status == EP_OK) status = file_path(folder, file, ".png", path, err);
  if (status == EP_OK)
    status = draw_pose(&v, name, shape[source->rest].name, &bake->quality[example], path, err);
  if (status == EP_OK) status = file_path(folder, file, ".vtu", path, err);
  if (status == EP_OK) status = write_pose(&v, u, path, err);
  free_pose_view(&v);
  return status;
}
