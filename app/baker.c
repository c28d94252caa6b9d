// The baker: commands that need PETSc and SLEPc. Run by `eigenpose`, or by hand with the same
// arguments.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/bake.h"
#include "app/blas_core.h"
#include "app/quality_json.h"
#include "app/report.h"
#include "app/session.h"
#include "linalg/petsc.h"
#include "mesh/io.h"
#include "results/colors.h"
#include "results/picture.h"

// ---- eigen -----------------------------------------------------------------------------------

static ep_status write_eigenfunctions(const char *path, const ep_mesh *mesh, const ep_lb *lb,
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

static ep_status print_eigen(const ep_cli *cli, const ep_mesh *mesh, const ep_lb *lb,
                             ep_error *err) {
  if (cli->json)
    return ep_report_print(json_pack("{s:s, s:i, s:i, s:f, s:o}", "mesh", mesh->name, "vertices",
                                     mesh->nv, "tets", mesh->nt, "volume", lb->volume,
                                     "eigenvalues", ep_json_numbers(lb->m, lb->lambda)),
                           err);
  printf("%s: %d vertices, %d tets, volume %.8g\n", mesh->name, mesh->nv, mesh->nt, lb->volume);
  for (int i = 0; i < lb->m; i++) printf("%4d  %.10g\n", i + 1, lb->lambda[i]);
  return EP_OK;
}

static ep_status command_eigen(const ep_cli *cli, ep_error *err) {
  ep_log log = ep_log_default(cli->quiet);
  ep_mesh mesh = {0};
  ep_mesh_findings findings;
  ep_lb lb = {0};
  EP_TRY(ep_mesh_read(cli->input, &mesh, &findings, &log, err));
  ep_status status = ep_mesh_require_sound(&mesh, &findings, false, err);
  if (status == EP_OK) {
    status = ep_petsc_start(err);
    if (status == EP_OK) status = ep_lb_eigen(&mesh, cli->count, &log, &lb, err);
    ep_petsc_stop();
  }
  if (status == EP_OK && cli->out) status = write_eigenfunctions(cli->out, &mesh, &lb, err);
  if (status == EP_OK) status = print_eigen(cli, &mesh, &lb, err);
  ep_lb_free(&lb);
  ep_mesh_free(&mesh);
  return status;
}

// ---- align -----------------------------------------------------------------------------------

// Two panels: the target coloured by position, and the source in the colours of its images.
static ep_status draw_map(const char *path, const ep_mesh *from, const ep_mesh *to,
                          const ep_map *map, ep_error *err) {
  float *color_to = calloc(3 * (size_t)to->nv, sizeof *color_to);
  float *color_from = calloc(3 * (size_t)from->nv, sizeof *color_from);
  int *triangle[2] = {NULL, NULL}, count[2];
  double low[3], high[3];
  ep_status status = color_to && color_from ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory");
  if (status == EP_OK) status = ep_mesh_surface(from, &count[0], &triangle[0], err);
  if (status == EP_OK) status = ep_mesh_surface(to, &count[1], &triangle[1], err);
  if (status == EP_OK) {
    ep_mesh_bounds(to, low, high);
    ep_color_position(to->nv, to->x, low, high, color_to);
    for (size_t v = 0; v < (size_t)from->nv; v++)
      memcpy(color_from + 3 * v, color_to + 3 * (size_t)map->p[v], 3 * sizeof *color_from);
    ep_drawing drawing[2] = {ep_default_drawing(from->nv, from->x, count[0], triangle[0]),
                             ep_default_drawing(to->nv, to->x, count[1], triangle[1])};
    drawing[0].color = color_from;
    drawing[1].color = color_to;
    const ep_panel panel[2] = {{1, &drawing[0], "coloured by its images"},
                               {1, &drawing[1], "coloured by position"}};
    ep_view view = ep_default_view();
    status = ep_picture_write(path, &view, 2, panel, err);
  }
  free(color_to);
  free(color_from);
  free(triangle[0]);
  free(triangle[1]);
  return status;
}

// The source mesh with its images and the object's functions beside the transferred ones.
static ep_status write_map(const ep_cli *cli, const ep_bake *bake, const ep_stage *stage,
                           const ep_map *map, ep_error *err) {
  const ep_mesh *from = &bake->shapes->shape[stage->from].mesh;
  const ep_mesh *to = &bake->shapes->shape[stage->to].mesh;
  char name[140], path[EP_PATH_MAX];
  EP_TRY(ep_make_folders(cli->out, err));
  double *image = malloc(3 * (size_t)from->nv * sizeof *image);
  if (!image) return ep_fail(err, EP_ERR_MEMORY, "no memory for a map");
  for (size_t v = 0; v < (size_t)from->nv; v++)
    memcpy(image + 3 * v, to->x + 3 * (size_t)map->p[v], 3 * sizeof *image);
  snprintf(name, sizeof name, "%s.vtu", stage->name);
  for (char *p = name; *p; p++)
    if (*p == ':' || *p == '/') *p = '-';
  const ep_field field = {"image", 3, image};
  ep_status status = ep_path_join(cli->out, name, path, err);
  if (status == EP_OK) status = ep_mesh_write_vtu(path, from, NULL, 1, &field, 0, NULL, err);
  free(image);
  if (status != EP_OK) return status;
  memcpy(name + strlen(name) - 4, ".png", 5);
  EP_TRY(ep_path_join(cli->out, name, path, err));
  return draw_map(path, from, to, map, err);
}

static ep_status align_one(const ep_cli *cli, ep_bake *bake, ep_stage *stage, json_t *list,
                           ep_error *err) {
  const ep_map *map;
  EP_TRY(ep_bake_map(bake, stage, &map, err));
  if (cli->out) EP_TRY(write_map(cli, bake, stage, map, err));
  if (!cli->json) {
    ep_quality_text(stdout, stage->name, &map->quality);
    return EP_OK;
  }
  json_t *quality = ep_quality_json(&map->quality);
  if (!quality) return ep_fail(err, EP_ERR_MEMORY, "no memory for the report");
  json_object_set_new(quality, "name", json_string(stage->name));
  json_object_set_new(quality, "from", json_string(bake->shapes->shape[stage->from].name));
  json_object_set_new(quality, "to", json_string(bake->shapes->shape[stage->to].name));
  json_object_set_new(quality, "m", json_integer(map->m));
  json_object_set_new(quality, "cached", json_boolean(stage->cached));
  json_array_append_new(list, quality);
  return EP_OK;
}

static ep_status command_align(const ep_cli *cli, ep_session *session, ep_bake *bake,
                               ep_error *err) {
  json_t *list = json_array();
  ep_status status = list ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for the report");
  int maps = 0;
  for (int i = 0; i < session->plan.count && status == EP_OK; i++) {
    ep_stage *stage = &session->plan.stage[i];
    if (stage->kind != EP_STAGE_MAP || !stage->runs) continue;
    status = align_one(cli, bake, stage, list, err);
    maps++;
  }
  if (status != EP_OK || !cli->json) {
    json_decref(list);
    if (status == EP_OK && !maps)
      printf("%s: no maps are needed (see eigenpose plan)\n", session->scene.name);
    return status;
  }
  return ep_report_print(json_pack("{s:s, s:o}", "scene", session->scene.name, "maps", list), err);
}

// ---- bake ------------------------------------------------------------------------------------

static json_t *examples_json(const ep_bake *bake) {
  json_t *list = json_array();
  for (int i = 0; list && bake->quality && i < bake->shapes->examples; i++) {
    json_t *pose = ep_pose_json(&bake->quality[i]);
    if (!pose) break;
    json_object_set_new(pose, "name",
                        json_string(bake->shapes->shape[bake->shapes->example[i].shape].name));
    json_array_append_new(list, pose);
  }
  return list;
}

static ep_status command_bake(const ep_cli *cli, ep_session *session, ep_bake *bake,
                              ep_error *err) {
  char path[EP_PATH_MAX];
  EP_TRY(ep_bake_model(bake, path, err));
  if (cli->json)
    return ep_report_print(json_pack("{s:s, s:s, s:o, s:o}", "scene", session->scene.name, "model",
                                     path, "stages", ep_report_stages(&session->plan), "examples",
                                     examples_json(bake)),
                           err);
  for (int i = 0; i < session->plan.count; i++) {
    const ep_stage *stage = &session->plan.stage[i];
    if (stage->runs && stage->kind != EP_STAGE_TARGET)
      printf("%-30s %8.3f s%s\n", stage->name, stage->seconds, stage->cached ? "  (cached)" : "");
  }
  printf("model: %s\n", path);
  return EP_OK;
}

static ep_status on_scene(const ep_cli *cli, ep_error *err) {
  ep_session session;
  ep_bake bake;
  EP_TRY(ep_session_open(cli, &session, err));
  ep_status status = ep_bake_open(&session.scene, &session.shapes, &session.plan, &session.cache,
                                  &session.log, &bake, err);
  if (status == EP_OK) {
    status = cli->command == EP_COMMAND_ALIGN ? command_align(cli, &session, &bake, err)
                                              : command_bake(cli, &session, &bake, err);
    ep_bake_close(&bake);
  }
  ep_session_close(&session);
  return status;
}

int main(int argc, char **argv) {
  ep_cli cli;
  ep_error err = {0};
  ep_blas_core_check(argv);
  ep_cli_parse(argc, argv, &cli);
  ep_status status;
  switch (cli.command) {
  case EP_COMMAND_EIGEN:
    status = command_eigen(&cli, &err);
    break;
  case EP_COMMAND_ALIGN:
  case EP_COMMAND_BAKE:
    status = on_scene(&cli, &err);
    break;
  default:
    status = ep_fail(&err, EP_ERR_ARGUMENT, "the baker bakes; use eigenpose for this command");
  }
  return status == EP_OK ? 0 : ep_cli_fail(&cli, &err);
}
