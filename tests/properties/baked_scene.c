#include "baked_scene.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/bake/bake.h"

static void take_all_elements(ep_bake *bake) {
  const ep_mesh *mesh = &bake->shapes->shape[0].mesh;
  const size_t nt = (size_t)mesh->nt;
  ep_cubature *c = &bake->cubature;
  *c = (ep_cubature){.count = mesh->nt,
                     .tet = malloc(nt * sizeof *c->tet),
                     .weight = malloc(nt * sizeof *c->weight)};
  assert_true(c->tet && c->weight);
  for (int t = 0; t < mesh->nt; t++) c->tet[t] = t;
  ep_tet_volumes(mesh, mesh->x, c->weight);
}

static ep_status bake_model(baked_scene *b, bool all, ep_error *err) {
  ep_bake bake;
  char path[EP_PATH_MAX];
  ep_session *s = &b->session;
  EP_TRY(ep_bake_open(&s->scene, &s->shapes, &s->plan, &s->cache, &s->log, &bake, err));
  bake.petsc = true; // runs already, and goes on
  if (all) take_all_elements(&bake);
  ep_status status = ep_bake_model(&bake, path, err);
  bake.petsc = false;
  ep_bake_close(&bake);
  if (status == EP_OK) status = ep_model_file_open(path, &b->file, err);
  return status;
}

bool bake_scene(const random_scene *s, const placement *at, const char *folder, bool all,
                baked_scene *out, char *why) {
  char command[200], cache[120], input[120];
  ep_error err = {0};
  *out = (baked_scene){.from = s, .at = *at};
  snprintf(command, sizeof command, "rm -rf %s", folder);
  if (system(command) != 0) return breaks(why, "%s cannot be removed", folder);
  ep_mesh home = solid_mesh(&s->object);
  out->to = malloc((size_t)home.nv * sizeof *out->to);
  ep_mesh_free(&home);
  assert_non_null(out->to);
  write_scene(s, at, folder, out->to);
  snprintf(cache, sizeof cache, "%s/cache", folder);
  snprintf(input, sizeof input, "%s/scene.yaml", folder);
  const ep_cli cli = {.input = input, .cache = cache, .quiet = true, .served = true};
  ep_status status = ep_session_open(&cli, &out->session, &err);
  if (status == EP_OK) status = bake_model(out, all, &err);
  if (status == EP_OK)
    status = ep_stepper_open(&out->session.scene, &out->session.shapes, &out->file.model,
                             &out->stepper, &err);
  return status == EP_OK || breaks(why, "%s", err.text);
}

void close_scene(baked_scene *b) {
  ep_stepper_close(b->stepper);
  ep_model_file_close(&b->file);
  ep_session_close(&b->session);
  free(b->to);
}

ep_stepper *open_stepper(const baked_scene *b) {
  ep_stepper *out;
  ep_error err = {0};
  if (ep_stepper_open(&b->session.scene, &b->session.shapes, &b->file.model, &out, &err) != EP_OK)
    fail_msg("%s", err.text);
  return out;
}

double largest_move(const baked_scene *b, const double *q) {
  const ep_model *m = &b->file.model;
  double largest = 0;
  for (size_t v = 0; v < 3 * (size_t)m->size.n; v++) {
    double u = 0;
    for (size_t a = 0; a < (size_t)m->size.r; a++) u += m->u[a * 3 * (size_t)m->size.n + v] * q[a];
    largest = fmax(largest, fabs(u));
  }
  return largest / m->rest_scale;
}

void draw_state(const baked_scene *b, ep_random *rng, double reach, double *q) {
  const int r = b->file.model.size.r;
  for (int a = 0; a < r; a++) q[a] = ep_random_normal(rng);
  const double scale = reach / largest_move(b, q);
  for (int a = 0; a < r; a++) q[a] *= scale;
}
