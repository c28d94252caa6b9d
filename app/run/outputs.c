#include "app/run/outputs.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "app/report.h"
#include "app/run/strip.h"
#include "mesh/io.h"
#include "results/csv.h"
#include "results/gltf.h"

enum { PATH_SHORT = 64 };

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory to write the results");
}

// ---- frames ----------------------------------------------------------------------------------

// Rows of the record that become frames: every `every`-th, and the last.
static int frame_rows(const ep_scene *scene, const ep_record *record, int *row) {
  int count = 0;
  for (int i = 0; i < record->rows; i += scene->every) row[count++] = i;
  if (count && row[count - 1] != record->rows - 1) row[count++] = record->rows - 1;
  return count;
}

// Files frames/STEM-0000.vtu .. of rows of the record, and the .pvd that gives them their times.
typedef struct series {
  const char *stem, *index; // "frames/frame", "animation.pvd"
  const ep_record *record;
  int frames;
  const int *row; // (frames)
  ep_status (*write)(void *user, const char *path, int row, ep_error *err);
  void *user;
  ep_log *log; // NULL: no progress is shown
} series;

// What an earlier, longer run left there would be taken for frames of this one.
static ep_status remove_later(const char *folder, const char *stem, int from, ep_error *err) {
  char name[PATH_SHORT], path[EP_PATH_MAX];
  for (int i = from;; i++) {
    snprintf(name, sizeof name, "%s-%04d.vtu", stem, i);
    EP_TRY(ep_path_join(folder, name, path, err));
    if (unlink(path) != 0) return EP_OK;
  }
}

static ep_status write_series(const char *folder, const series *s, ep_error *err) {
  const size_t count = (size_t)s->frames;
  char path[EP_PATH_MAX];
  char(*name)[PATH_SHORT] = calloc(count, sizeof *name);
  const char **names = calloc(count, sizeof *names);
  double *time = calloc(count, sizeof *time);
  ep_status status = name && names && time ? EP_OK : no_memory(err);
  for (int i = 0; i < s->frames && status == EP_OK; i++) {
    snprintf(name[i], sizeof name[i], "%s-%04d.vtu", s->stem, i);
    names[i] = name[i];
    time[i] = s->record->time[s->row[i]];
    status = ep_path_join(folder, name[i], path, err);
    if (status == EP_OK) status = s->write(s->user, path, s->row[i], err);
    if (s->log) ep_progress(s->log, i + 1);
  }
  if (status == EP_OK) status = remove_later(folder, s->stem, s->frames, err);
  if (status == EP_OK) status = ep_path_join(folder, s->index, path, err);
  if (status == EP_OK) status = ep_mesh_write_pvd(path, s->frames, time, names, err);
  free(name);
  free(names);
  free(time);
  return status;
}

typedef struct object_frames {
  const ep_mesh *mesh;
  const ep_model *model;
  const ep_record *record;
  double *x, *u; // (3 nv) scratch
} object_frames;

static ep_status write_frame(void *user, const char *path, int row, ep_error *err) {
  const object_frames *o = user;
  ep_record_positions(o->model, o->record, row, o->x);
  for (size_t i = 0; i < 3 * (size_t)o->mesh->nv; i++) o->u[i] = o->x[i] - o->mesh->x[i];
  const ep_field field = {"displacement", 3, o->u};
  return ep_mesh_write_vtu(path, o->mesh, o->x, 1, &field, 0, NULL, err);
}

static ep_status write_vtu(const char *folder, const ep_mesh *mesh, const ep_model *model,
                           const ep_record *record, int frames, const int *row, ep_log *log,
                           ep_error *err) {
  char path[EP_PATH_MAX];
  double *x = malloc(6 * (size_t)mesh->nv * sizeof *x);
  ep_status status = x ? EP_OK : no_memory(err);
  if (status == EP_OK) status = ep_path_join(folder, "frames", path, err);
  if (status == EP_OK) status = ep_make_folders(path, err);
  if (status == EP_OK) {
    object_frames user = {mesh, model, record, x, x + 3 * (size_t)mesh->nv};
    const series s = {"frames/frame", "animation.pvd", record, frames, row,
                      write_frame,    &user,           log};
    ep_progress_begin(log, "frames", frames);
    status = write_series(folder, &s, err);
    ep_progress_end(log);
  }
  free(x);
  return status;
}

// What the run's frames fill, every 16th of them: where planes are to be seen.
static void bounds_of_run(const ep_mesh *mesh, const ep_model *model, const ep_record *record,
                          double *x, double low[3], double high[3]) {
  const int stride = record->rows / 16 + 1;
  if (!record->frame) ep_mesh_bounds(mesh, low, high);
  for (int a = 0; record->frame && a < 3; a++) low[a] = high[a] = record->frame[0].c[a];
  for (int row = 0; row < record->rows; row += stride) {
    ep_record_positions(model, record, row, x);
    for (int i = 0; i < 3 * mesh->nv; i++) {
      low[i % 3] = fmin(low[i % 3], x[i]);
      high[i % 3] = fmax(high[i % 3], x[i]);
    }
  }
}

static ep_status make_solids(const ep_scene *scene, const ep_mesh *mesh, const ep_model *model,
                             const ep_record *record, ep_solids *out, ep_error *err) {
  double low[3], high[3];
  *out = (ep_solids){0};
  if (!scene->nobstacles) return EP_OK;
  double *x = malloc(3 * (size_t)mesh->nv * sizeof *x);
  if (!x) return no_memory(err);
  bounds_of_run(mesh, model, record, x, low, high);
  free(x);
  return ep_solids_make(scene, low, high, out, err);
}

typedef struct obstacle_frames {
  const ep_scene *scene;
  const ep_solids *solids;
  const ep_record *record;
  double *x; // (3 nv of the solids) scratch
} obstacle_frames;

static ep_status write_obstacle_frame(void *user, const char *path, int row, ep_error *err) {
  const obstacle_frames *o = user;
  ep_solids_place(o->scene, o->solids, o->record->time[row], o->x);
  return ep_mesh_write_vtu(path, &o->solids->mesh, o->x, 0, NULL, 0, NULL, err);
}

static ep_status write_obstacles_vtu(const char *folder, const ep_scene *scene,
                                     const ep_solids *solids, const ep_record *record, int frames,
                                     const int *row, ep_error *err) {
  double *x = malloc(3 * (size_t)solids->mesh.nv * sizeof *x);
  if (!x) return no_memory(err);
  obstacle_frames user = {scene, solids, record, x};
  const series s = {"frames/obstacles",   "obstacles.pvd", record, frames, row,
                    write_obstacle_frame, &user,           NULL};
  const ep_status status = write_series(folder, &s, err);
  free(x);
  return status;
}

// Each obstacle as a body of its own, with its pose in every frame.
static ep_status make_gltf_solids(const ep_scene *scene, const ep_solids *solids, int frames,
                                  const double *time, ep_gltf_animation *a, ep_error *err) {
  const size_t count = (size_t)scene->nobstacles;
  if (!count) return EP_OK;
  ep_gltf_solid *solid = calloc(count, sizeof *solid);
  double *pose = calloc(count * (size_t)frames * 12, sizeof *pose);
  a->solid = solid;
  if (!solid || !pose) {
    free(pose);
    free(solid);
    a->solid = NULL;
    return no_memory(err);
  }
  a->solids = (int)count;
  for (size_t i = 0; i < count; i++) {
    double *to = pose + i * (size_t)frames * 12;
    solid[i] =
        (ep_gltf_solid){.n = solids->mesh.nv,
                        .x = solids->mesh.x,
                        .triangles = solids->first_triangle[i + 1] - solids->first_triangle[i],
                        .triangle = solids->triangle + 3 * (size_t)solids->first_triangle[i],
                        .flat = scene->obstacle[i].kind != EP_OBSTACLE_SPHERE,
                        .pose = to};
    for (int f = 0; f < frames; f++) {
      ep_frame at;
      ep_obstacle_pose(&scene->obstacle[i], time[f], &at);
      memcpy(to + 12 * (size_t)f, at.c, sizeof at.c);
      memcpy(to + 12 * (size_t)f + 3, at.R, sizeof at.R);
    }
  }
  return EP_OK;
}

// What rest positions count from: the centre of mass of a free object; of a held one the middle of
// its mesh where it stands so far out that floats would not tell its vertices apart, else NULL.
static const double *origin_of(const ep_mesh *mesh, const ep_model *model, const ep_record *record,
                               double middle[3]) {
  static const double far = 100; // extents: floats are good to 1e-5 of the extent there
  double low[3], high[3], away = 0, extent = 0;
  if (record->frame) return model->rigid_origin;
  ep_mesh_bounds(mesh, low, high);
  for (int i = 0; i < 3; i++) {
    middle[i] = 0.5 * (low[i] + high[i]);
    away = fmax(away, fabs(middle[i]));
    extent = fmax(extent, high[i] - low[i]);
  }
  return away > far * extent ? middle : NULL;
}

// The moving frame, or where a held object stands, as the pose of the node, with rest positions
// about its origin: they take the first (n x 3) of *motion, poses follow; malloc'd.
static ep_status take_motion(ep_gltf_animation *a, const ep_mesh *mesh, const ep_model *model,
                             const ep_record *record, const int *row, double **motion,
                             ep_error *err) {
  const size_t n3 = 3 * (size_t)a->n, frames = (size_t)a->frames;
  ep_frame still = {.R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
  const double *origin = origin_of(mesh, model, record, still.c);
  *motion = NULL;
  if (!origin) return EP_OK;
  *motion = malloc((n3 + 12 * frames) * sizeof **motion);
  if (!*motion) return no_memory(err);
  double *pose = *motion + n3;
  for (size_t i = 0; i < n3; i++) (*motion)[i] = a->x[i] - origin[i % 3];
  for (size_t f = 0; f < frames; f++) {
    const ep_frame *at = record->frame ? &record->frame[row[f]] : &still;
    memcpy(pose + 12 * f, at->c, 3 * sizeof *pose);
    memcpy(pose + 12 * f + 3, at->R, 9 * sizeof *pose);
  }
  a->x = *motion;
  a->pose = pose;
  return EP_OK;
}

static ep_status write_glb(const char *folder, const ep_scene *scene, const ep_mesh *mesh,
                           const ep_model *model, const ep_record *record, int frames,
                           const int *row, const ep_solids *solids, ep_error *err) {
  const size_t r = (size_t)model->size.r;
  char path[EP_PATH_MAX];
  int *triangle = NULL;
  double *motion = NULL;
  ep_gltf_animation a = ep_default_gltf();
  double *q = calloc((size_t)frames * (r + 1), sizeof *q), *time = q + (size_t)frames * r;
  ep_status status = q ? ep_mesh_surface(mesh, &a.triangles, &triangle, err) : no_memory(err);
  for (int i = 0; i < frames && status == EP_OK; i++) {
    memcpy(q + (size_t)i * r, record->q + (size_t)row[i] * r, r * sizeof *q);
    time[i] = record->time[row[i]];
  }
  if (status == EP_OK) status = ep_path_join(folder, "animation.glb", path, err);
  if (status == EP_OK) {
    a.name = scene->name;
    a.n = mesh->nv;
    a.r = model->size.r;
    a.frames = frames;
    a.x = mesh->x;
    a.u = model->u;
    a.q = q;
    a.time = time;
    a.triangle = triangle;
    status = make_gltf_solids(scene, solids, frames, time, &a, err);
  }
  if (status == EP_OK) status = take_motion(&a, mesh, model, record, row, &motion, err);
  if (status == EP_OK) status = ep_gltf_write(path, &a, err);
  if (a.solid) {
    free((void *)a.solid[0].pose);
    free((void *)a.solid);
  }
  free(motion);
  free(triangle);
  free(q);
  return status;
}

// Results of an earlier run in a format this one does not write: they would stand beside its
// summary.
static ep_status remove_others(const char *folder, unsigned formats, bool solids, ep_error *err) {
  const bool vtu = formats & EP_FORMAT_VTU, glb = formats & EP_FORMAT_GLB;
  const bool png = formats & EP_FORMAT_PNG;
  const struct {
    const char *file, *stem;
    bool written;
  } results[] = {
      {"animation.pvd", "frames/frame", vtu},
      {"obstacles.pvd", "frames/obstacles", vtu && solids},
      {"animation.glb", NULL, glb},
      {"strip.png", NULL, png},
      {"final.png", NULL, png},
  };
  char path[EP_PATH_MAX];
  for (size_t i = 0; i < sizeof results / sizeof *results; i++) {
    if (results[i].written) continue;
    EP_TRY(ep_path_join(folder, results[i].file, path, err));
    EP_TRY(ep_file_remove(path, err));
    if (results[i].stem) EP_TRY(remove_later(folder, results[i].stem, 0, err));
  }
  return EP_OK;
}

// ---- tables ----------------------------------------------------------------------------------

static ep_status write_csv(const char *folder, const ep_model *model, const ep_record *record,
                           ep_error *err) {
  char path[EP_PATH_MAX];
  EP_TRY(ep_path_join(folder, "trajectory.csv", path, err));
  const bool green = record->green_weights != NULL;
  const size_t rows = (size_t)record->rows;
  double *center = calloc(12 * rows, sizeof *center); // and rotations behind
  if (!center) return no_memory(err);
  for (size_t i = 0; record->frame && i < rows; i++) {
    memcpy(center + 3 * i, record->frame[i].c, 3 * sizeof *center);
    memcpy(center + 3 * rows + 9 * i, record->frame[i].R, 9 * sizeof *center);
  }
  const ep_csv_group groups[] = {
      {.name = "t", .components = 1, .data = record->time},
      {.name = "q", .components = model->size.r, .data = record->q, .numbered = true},
      {.name = "w",
       .components = record->weights ? model->size.k + ep_model_regions(model) : 0,
       .data = record->weights,
       .numbered = true},
      {.name = "g",
       .components = green ? model->size.k : 0,
       .data = record->green_weights,
       .numbered = true},
      {.name = "contact", // touching, penetration, force x y z
       .components = record->contact ? EP_CONTACT_COLUMNS : 0,
       .data = record->contact,
       .numbered = true},
      {.name = "c", .components = record->frame ? 3 : 0, .data = center, .numbered = true},
      {.name = "R", .components = record->frame ? 9 : 0, .data = center + 3 * rows},
      {.name = "momentum", .components = record->frame ? 6 : 0, .data = record->momentum},
  };
  const ep_status status = ep_csv_write(path, record->rows, 8, groups, err);
  free(center);
  return status;
}

ep_status ep_outputs_write(const char *folder, const ep_scene *scene, const ep_shapes *shapes,
                           const ep_model *model, const ep_record *record, ep_log *log,
                           ep_error *err) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  if (record->rows == 0) return EP_OK;
  EP_TRY(write_csv(folder, model, record, err));
  int *row = malloc(((size_t)record->rows + 1) * sizeof *row);
  if (!row) return no_memory(err);
  const int frames = frame_rows(scene, record, row);
  ep_solids solids;
  ep_status status = make_solids(scene, mesh, model, record, &solids, err);
  if (status == EP_OK && (scene->formats & EP_FORMAT_VTU))
    status = write_vtu(folder, mesh, model, record, frames, row, log, err);
  if (status == EP_OK && (scene->formats & EP_FORMAT_VTU) && solids.triangles)
    status = write_obstacles_vtu(folder, scene, &solids, record, frames, row, err);
  if (status == EP_OK && (scene->formats & EP_FORMAT_GLB))
    status = write_glb(folder, scene, mesh, model, record, frames, row, &solids, err);
  if (status == EP_OK && (scene->formats & EP_FORMAT_PNG))
    status = ep_strip_write(folder, scene, mesh, model, record, &solids, err);
  if (status == EP_OK) status = remove_others(folder, scene->formats, solids.triangles > 0, err);
  ep_solids_free(&solids);
  free(row);
  return status;
}

// ---- summary ---------------------------------------------------------------------------------

static void text_weights(FILE *out, const json_t *report) {
  const json_t *weights = json_object_get(report, "weights");
  const json_t *green = json_object_get(report, "green_weights");
  const json_t *regions = json_object_get(report, "regions"); // rest of each, then the examples
  const size_t sets = json_array_size(regions) ? json_array_size(regions) : 1;
  for (size_t i = 0; i < json_array_size(weights); i++) {
    fprintf(out, i ? ", " : "final weights: ");
    if (i < sets && json_array_size(regions))
      fprintf(out, "%s at rest", json_string_value(json_array_get(regions, i)));
    else if (i < sets)
      fprintf(out, "rest");
    else
      fprintf(out, "example %zu", i - sets + 1);
    fprintf(out, " %.3f", json_number_value(json_array_get(weights, i)));
  }
  if (json_array_size(weights)) fprintf(out, "\n");
  for (size_t i = 0; i < json_array_size(green); i++)
    fprintf(out, "%s example %zu %.3f", i ? "," : "final Green-strain weights:", i + 1,
            json_number_value(json_array_get(green, i)));
  if (json_array_size(green)) fprintf(out, "\n");
  if (ep_json_get_number(report, "examples") > 0)
    fprintf(out, "example fraction: %.3f of the way from rest to the nearest example\n",
            ep_json_get_number(report, "example_fraction"));
}

static void text_vector(FILE *out, const json_t *list, size_t first) {
  for (size_t i = 0; i < 3; i++)
    fprintf(out, "%s%.4g", i ? ", " : "(", json_number_value(json_array_get(list, first + i)));
  fprintf(out, ")");
}

// Of a free object: where it is, and its momenta from start to end.
static void text_motion(FILE *out, const json_t *report) {
  const json_t *momentum = json_object_get(report, "momentum");
  if (!momentum) return;
  fprintf(out, "free: centre of mass ends at ");
  text_vector(out, json_object_get(report, "center"), 0);
  for (size_t part = 0; part < 6; part += 3) {
    fprintf(out, part ? " kg m/s, angular " : " m; momentum ");
    text_vector(out, json_object_get(momentum, "start"), part);
    fprintf(out, " -> ");
    text_vector(out, json_object_get(momentum, "end"), part);
  }
  fprintf(out, " kg m^2/s\n");
}

void ep_summary_text(FILE *out, const json_t *report) {
  size_t index;
  json_t *stage;
  const double examples = ep_json_get_number(report, "examples");
  fprintf(out, "%s: %.0f vertices, %.0f tets, %.0f example%s\n",
          json_string_value(json_object_get(report, "scene")),
          ep_json_get_number(report, "vertices"), ep_json_get_number(report, "tets"), examples,
          examples == 1 ? "" : "s");
  fprintf(out, "m = %.0f eigenfunctions, r = %.0f modes, s = %.0f cubature elements\n",
          ep_json_get_number(report, "m"), ep_json_get_number(report, "r"),
          ep_json_get_number(report, "s"));
  json_array_foreach(json_object_get(report, "stages"), index, stage)
      fprintf(out, "  %-30s %8.3f s%s\n", json_string_value(json_object_get(stage, "name")),
              ep_json_get_number(stage, "seconds"),
              json_is_true(json_object_get(stage, "cached")) ? "  (cached)" : "");
  const json_t *error = json_object_get(report, "cubature_error");
  if (ep_json_get_number(report, "s") > 0)
    fprintf(out, "cubature: relative force error %.3g in training, %.3g held out\n",
            ep_json_get_number(error, "train"), ep_json_get_number(error, "held_out"));
  fprintf(out, "%.0f of %.0f steps of %.4g s; median %.3f ms a step, %.3f ms of it interpolation\n",
          ep_json_get_number(report, "steps_done"), ep_json_get_number(report, "steps"),
          ep_json_get_number(report, "dt"), ep_json_get_number(report, "t_step_ms"),
          ep_json_get_number(report, "t_interp_ms"));
  text_weights(out, report);
  text_motion(out, report);
  const json_t *contact = json_object_get(report, "contact");
  if (contact)
    fprintf(out, "contact: up to %.0f vertices touch; deepest %.3g m, %.2f %% of the extent\n",
            ep_json_get_number(contact, "touching"), ep_json_get_number(contact, "penetration"),
            100 * ep_json_get_number(contact, "penetration_share"));
  fprintf(out, "inverted tets: at most %.0f after any step\n",
          ep_json_get_number(report, "inverted_tets"));
}

static ep_status not_of_frames(void *user, const char *path, ep_error *err) {
  const char *frames = user;
  char folder[EP_PATH_MAX];
  EP_TRY(ep_path_folder(path, folder, err));
  if (!ep_path_same(folder, frames)) return EP_OK;
  return ep_fail(err, EP_ERR_IO,
                 "the scene reads %s, which the frames of this run would write over; copy it "
                 "elsewhere or give another --out",
                 path);
}

ep_status ep_outputs_begin(const char *folder, const ep_scene *scene, ep_error *err) {
  static const char *const verdicts[] = {"summary.json", "summary.txt"};
  char path[EP_PATH_MAX];
  EP_TRY(ep_output_folder(folder, err));
  EP_TRY(ep_path_join(folder, "frames", path, err));
  EP_TRY(ep_scene_each_file(scene, not_of_frames, path, err));
  for (size_t i = 0; i < sizeof verdicts / sizeof *verdicts; i++) {
    EP_TRY(ep_path_join(folder, verdicts[i], path, err));
    EP_TRY(ep_file_remove(path, err));
  }
  return EP_OK;
}

ep_status ep_outputs_summary(const char *folder, json_t *report, ep_error *err) {
  char path[EP_PATH_MAX];
  ep_output out;
  EP_TRY(ep_path_join(folder, "summary.json", path, err));
  EP_TRY(ep_report_write(path, json_incref(report), err));
  EP_TRY(ep_path_join(folder, "summary.txt", path, err));
  EP_TRY(ep_output_open(&out, path, err));
  ep_summary_text(out.file, report);
  return ep_output_commit(&out, err);
}
