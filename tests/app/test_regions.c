// Claims: a region's weights are 1 on the selection and w(d) = 1 - 3 t^2 + 2 t^3, t = d / soft, at
// the distance d from it, whatever the selection; listed vertices measure along edges; equal
// regions of a scene are one; what a scene may not say about regions is refused with its place.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
// clang-format off
#include <cmocka.h>
// clang-format on
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/regions.h"
#include "box.h"
#include "mesh/io.h"

static ep_mesh mesh;

static int set_up(void **state) {
  (void)state;
  ep_error err = {0};
  ep_mesh_findings findings;
  ep_log log = {.quiet = true};
  write_box("region-box.veg", 10, 2, 2, 1, 0, 0); // 1 x .2 x .2, edges of .1
  return ep_mesh_read("region-box.veg", &mesh, &findings, &log, &err) != EP_OK;
}

static int tear_down(void **state) {
  (void)state;
  ep_mesh_free(&mesh);
  return 0;
}

static double falloff(double t) {
  return t >= 1 ? 0 : 1 - 3 * t * t + 2 * t * t * t;
}

static double *weights_of(const ep_scene_region *region) {
  ep_error err = {0};
  double *w = calloc((size_t)mesh.nv, sizeof *w);
  assert_non_null(w);
  if (ep_region_weights(region, &mesh, w, &err) != EP_OK) fail_msg("%s", err.text);
  return w;
}

// Box and half space x >= .6: all points x < .6 lie .6 - x away (the box is as wide as the bar).
static void edges_are_soft(void **state) {
  (void)state;
  const double softness[] = {0, 0.05, 0.35};
  for (int i = 0; i < 6; i++) {
    ep_scene_region region = {.soft = softness[i / 2]};
    if (i % 2)
      region.where = (ep_selection){.kind = EP_SELECT_PLANE, .a = {0.6, 0, 0}, .b = {-2, 0, 0}};
    else
      region.where = (ep_selection){.kind = EP_SELECT_BOX, .a = {0.6, -1, -1}, .b = {2, 1, 1}};
    double *w = weights_of(&region);
    for (int v = 0; v < mesh.nv; v++) {
      const double away = 0.6 - mesh.x[3 * v];
      const double wanted = away <= 1e-12 ? 1 : region.soft == 0 ? 0 : falloff(away / region.soft);
      assert_true(fabs(w[v] - wanted) < 1e-12);
    }
    free(w);
  }
}

// The corner of a box: the Euclidean distance, not that along an axis.
static void corners_are_round(void **state) {
  (void)state;
  const ep_scene_region region = {
      .where = {.kind = EP_SELECT_BOX, .a = {-1, -1, -1}, .b = {0.5, 0.1, 0.1}}, .soft = 0.4};
  double *w = weights_of(&region);
  int outside = 0;
  for (int v = 0; v < mesh.nv; v++) {
    double square = 0;
    const double *x = mesh.x + 3 * v, high[3] = {0.5, 0.1, 0.1};
    for (int a = 0; a < 3; a++) square += pow(fmax(0, x[a] - high[a]), 2);
    assert_true(fabs(w[v] - falloff(sqrt(square) / 0.4)) < 1e-9);
    outside += w[v] > 0 && x[0] > 0.55 && x[1] > 0.15 && x[2] > 0.15;
  }
  assert_true(outside > 0);
  free(w);
}

// One end listed: along the bar's own edges the distance is x, exactly.
static void listed_vertices_spread_along_edges(void **state) {
  (void)state;
  char text[4000] = "";
  for (int v = 0; v < mesh.nv; v++)
    if (mesh.x[3 * v] < 1e-9)
      snprintf(text + strlen(text), sizeof text - strlen(text), "%d,", mesh.file_vertex[v] + 1);
  write_text("region.list", text);
  ep_scene_region region = {.where = {.kind = EP_SELECT_FILE, .path = "region.list"}, .soft = 0.45};
  double *w = weights_of(&region);
  for (int v = 0; v < mesh.nv; v++) assert_true(fabs(w[v] - falloff(mesh.x[3 * v] / 0.45)) < 1e-9);
  free(w);
}

static void shares_are_means(void **state) {
  (void)state;
  double *w = calloc((size_t)mesh.nv, sizeof *w), *share = calloc((size_t)mesh.nt, sizeof *share);
  assert_true(w && share);
  for (int v = 0; v < mesh.nv; v++) w[v] = mesh.x[3 * v];
  ep_region_shares(&mesh, w, share);
  for (int e = 0; e < mesh.nt; e++) {
    double centre = 0;
    for (int i = 0; i < 4; i++) centre += 0.25 * mesh.x[3 * mesh.tet[4 * e + i]];
    assert_true(fabs(share[e] - centre) < 1e-12);
  }
  ep_region_shares(&mesh, NULL, share);
  for (int e = 0; e < mesh.nt; e++) assert_true(share[e] == 1);
  free(w);
  free(share);
}

#define HEAD "schema: 1\nobject: {mesh: region-box.veg}\n"
#define BOX  "box: {low: [0, 0, 0], high: [1, 1, 1]}"

static ep_status parse(const char *text, ep_scene *scene, ep_error *err) {
  memset(err, 0, sizeof *err);
  return ep_scene_parse("s.yaml", ".", text, strlen(text), 0, NULL, scene, err);
}

static void equal_regions_are_one(void **state) {
  (void)state;
  ep_scene s;
  ep_error err;
  if (parse(HEAD "regions: [{name: a, " BOX ", soft: 0.1, eigenfunctions: 7, strength: 2}]\n"
                 "reduction: {eigenfunctions: 12}\n"
                 "examples: {path: green}\n"
                 "families:\n  - {name: f, poses: [region-box.veg], region: {name: a}}\n"
                 "  - {name: g, poses: [region-box.veg], region: {" BOX "}}\n"
                 "  - {name: h, poses: [region-box.veg], region: {" BOX "}}\n"
                 "  - {name: i, poses: [region-box.veg], region: {" BOX ", soft: 0.2}}\n"
                 "  - {name: j, poses: [region-box.veg]}\n",
            &s, &err) != EP_OK)
    fail_msg("%s", err.text);
  assert_int_equal(s.nregions, 3);
  const int wanted[] = {0, 1, 1, 2, -1};
  for (int i = 0; i < 5; i++) assert_int_equal(s.family[i].region, wanted[i]);
  assert_true(s.region[0].soft == 0.1 && s.region[0].eigenfunctions == 7 &&
              s.region[0].strength == 2);
  assert_true(s.region[1].soft == 0 && s.region[1].eigenfunctions == 12 &&
              s.region[1].strength == 1);
  assert_string_equal(s.region[1].name, "g");
  assert_true(ep_scene_local(&s));
  ep_scene_free(&s);
}

static void refused(const char *text, const char *place, const char *what) {
  ep_scene scene;
  ep_error err;
  const ep_status status = parse(text, &scene, &err);
  if (status != EP_ERR_SCENE || !strstr(err.text, place) || !strstr(err.text, what))
    fail_msg("<<%s>>\nstatus %d, message '%s'", text, (int)status, err.text);
}

static void nonsense_is_refused(void **state) {
  (void)state;
#define FAMILY(region) "families: [{poses: [region-box.veg], region: {" region "}}]\n"
  refused(HEAD FAMILY("name: arm"), "s.yaml:3:", "no 'arm'");
  refused(HEAD FAMILY("name: arm, " BOX), "s.yaml:3:", "not both");
  refused(HEAD FAMILY("soft: 0.1"), "s.yaml:3:", "give one of box, plane, file");
  refused(HEAD FAMILY(BOX ", soft: -1"), "s.yaml:3:", "region.soft");
  refused(HEAD "regions: [{" BOX "}]\n", "s.yaml:3:", "name");
  refused(HEAD "regions: [{name: a, " BOX "}, {name: a, " BOX "}]\n", "s.yaml:3:", "'a' too");
}

// A region no vertex lies in says where the mesh is.
static void an_empty_region_is_refused(void **state) {
  (void)state;
  ep_error err = {0};
  double w[1000];
  const ep_scene_region region = {
      .where = {.kind = EP_SELECT_BOX, .a = {5, 5, 5}, .b = {6, 6, 6}, .key = "regions.0"},
      .soft = 9};
  assert_true(mesh.nv < 1000);
  assert_int_equal(ep_region_weights(&region, &mesh, w, &err), EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "regions.0"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(edges_are_soft),
      cmocka_unit_test(corners_are_round),
      cmocka_unit_test(listed_vertices_spread_along_edges),
      cmocka_unit_test(shares_are_means),
      cmocka_unit_test(equal_regions_are_one),
      cmocka_unit_test(nonsense_is_refused),
      cmocka_unit_test(an_empty_region_is_refused),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
