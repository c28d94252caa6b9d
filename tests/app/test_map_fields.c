// Claims: labels and painted weights on the vertices of .vtu files mark the same regions as a
// regions file with the same vertices; selections by a field hold the vertices its values say; the
// key of a map follows the values; what is wrong is refused with key, file and what to do.
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

#include "app/plan/plan.h"
#include "app/scene/map_fields.h"
#include "app/scene/select.h"
#include "box.h"
#include "mesh/io.h"

#define HEAD                                                                                       \
  "schema: 1\nobject: {mesh: object.vtu, material: {density: 1, young: 1e3, poisson: 0.3}}\n"      \
  "fixed: [{field: left, above: 0.5}]\n"                                                           \
  "reduction: {eigenfunctions: 4, modes: 8, linear_modes: 5}\n"

typedef struct world {
  ep_scene scene;
  ep_shapes shapes;
  ep_plan plan;
} world;

static ep_status make(const char *text, world *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  memset(err, 0, sizeof *err);
  EP_TRY(ep_scene_parse("s.yaml", ".", text, strlen(text), 0, NULL, &out->scene, err));
  EP_TRY(ep_shapes_read(&out->scene, NULL, &out->shapes, err));
  return ep_plan_make(&out->scene, &out->shapes, &out->plan, err);
}

static void drop(world *w) {
  ep_plan_free(&w->plan);
  ep_shapes_free(&w->shapes);
  ep_scene_free(&w->scene);
}

static world world_of(const char *text) {
  world w;
  ep_error err;
  if (make(text, &w, &err) != EP_OK) fail_msg("%s", err.text);
  return w;
}

static void refused(const char *text, const char *says, const char *also) {
  world w;
  ep_error err;
  const ep_status status = make(text, &w, &err);
  if (status != EP_ERR_SCENE || !strstr(err.text, says) || !strstr(err.text, also))
    fail_msg("status %d, '%s', expected '%s' and '%s'", (int)status, err.text, says, also);
  drop(&w);
}

// A box as .vtu with: part (0 in the middle, `shift` + 1 and + 2 at the ends), left (0 to 1,
// painted towards the lower end), hole (NaN at vertex 5), number (of the vertex), odd (-0.5
// to 1.5), and the vector push. `tag` is named as asked, so that shapes can differ.
static void write_fields(const char *path, int nx, double shift, const char *tag) {
  ep_mesh m;
  ep_error err = {0};
  write_box("plain.veg", nx, 1, 1, 1, 0, 0);
  assert_int_equal(ep_mesh_read("plain.veg", &m, NULL, NULL, &err), EP_OK);
  const size_t nv = (size_t)m.nv;
  double *data = calloc(6 * nv, sizeof *data);
  assert_non_null(data);
  double *part = data, *left = data + nv, *hole = left + nv, *count = hole + nv, *odd = count + nv;
  for (size_t v = 0; v < nv; v++) {
    const double x = m.x[3 * v];
    part[v] = x < 0.3 ? 1 : x > 0.7 ? 2 + shift : 0;
    left[v] = fmax(0, 1 - x / 0.5);
    hole[v] = v == 4 ? NAN : 1;
    count[v] = (double)v;
    odd[v] = 2 * x - 0.5;
  }
  const ep_field field[] = {{"part", 1, part}, {"left", 1, left},         {"hole", 1, hole},
                            {"odd", 1, odd},   {"number", 1, count},      {"push", 3, m.x},
                            {tag, 1, part},    {"none", 1, data + 5 * nv}};
  assert_int_equal(ep_mesh_write_vtu(path, &m, NULL, 8, field, 0, NULL, &err), EP_OK);
  free(data);
  ep_mesh_free(&m);
}

static int setup(void **state) {
  (void)state;
  write_fields("object.vtu", 6, 0, "mine");
  write_fields("rest.vtu", 9, 0, "theirs");
  write_fields("pose.vtu", 12, 0, "last");
  write_fields("other-label.vtu", 9, 1, "theirs");
  write_fields("many.vtu", 90, 0, "theirs");
  write_box("bare.veg", 9, 1, 1, 1, 0, 0);
  return 0;
}

#define FAMILY(poses, fields)                                                                      \
  HEAD "families: [{rest: rest.vtu, poses: [" poses "], map: {fields: [" fields "]}}]\n"

// The text of a regions file with the vertices of two meshes that a test picks.
typedef bool pick(double x, int region);
static bool by_label(double x, int region) {
  return region == 0 ? x < 0.3 : x > 0.7;
}
static bool painted(double x, int region) {
  (void)region;
  return fmax(0, 1 - x / 0.5) > 0.5;
}

static ep_regions listed(const world *w, int regions, pick *which) {
  char text[16384];
  int used = sprintf(text, "%d\n", regions);
  for (int g = 0; g < regions; g++)
    for (int s = 0; s < 2; s++) {
      const ep_mesh *m = &w->shapes.shape[s].mesh;
      for (int v = 0; v < m->nv; v++)
        if (which(m->x[3 * v], g)) used += sprintf(text + used, "%d;", v + 1);
      used += sprintf(text + used, "\n");
    }
  const ep_mesh *meshes[2] = {&w->shapes.shape[0].mesh, &w->shapes.shape[1].mesh};
  ep_regions out;
  ep_error err = {0};
  if (ep_regions_parse("r.ini", text, 2, meshes, &out, &err) != EP_OK) fail_msg("%s", err.text);
  return out;
}

static void same_as_listed(const char *text, int regions, pick *which) {
  world w = world_of(text);
  ep_regions found, expected = listed(&w, regions, which);
  ep_error err = {0};
  assert_int_equal(ep_map_fields(&w.scene, &w.shapes, 0, 0, 1, &found, &err), EP_OK);
  assert_int_equal(found.count, regions);
  assert_int_equal(found.shapes, 2);
  assert_memory_equal(found.start, expected.start, (size_t)(2 * regions + 1) * sizeof(int));
  assert_memory_equal(found.vertex, expected.vertex,
                      (size_t)expected.start[2 * regions] * sizeof(int));
  ep_map_fields_free(&found);
  ep_regions_free(&expected);
  drop(&w);
}

static void fields_are_regions(void **state) {
  (void)state;
  same_as_listed(FAMILY("rest.vtu", "{name: part}"), 2, by_label);
  same_as_listed(FAMILY("rest.vtu", "{object: mine, rest: theirs}"), 2, by_label);
  same_as_listed(FAMILY("rest.vtu", "{name: left}"), 1, painted);
}

static const ep_stage *map_to(const world *w, int shape) {
  for (int i = 0; i < w->plan.count; i++)
    if (w->plan.stage[i].kind == EP_STAGE_MAP && w->plan.stage[i].to == shape)
      return &w->plan.stage[i];
  fail_msg("no map");
  return NULL;
}

// The plan says which maps go by fields; poses need not carry them where the scene does not name
// them there; a map's key follows the regions.
static void the_plan_follows_the_fields(void **state) {
  (void)state;
  world a = world_of(FAMILY("pose.vtu", "{name: part}")),
        b = world_of(FAMILY("pose.vtu", "{name: left}")),
        c = world_of(FAMILY("bare.veg", "{object: mine, rest: theirs}")),
        d = world_of(FAMILY("pose.vtu", "{object: mine, rest: theirs, poses: last}")),
        e = world_of(HEAD "families: [{rest: rest.vtu, poses: [pose.vtu]}]\n");
  assert_non_null(strstr(map_to(&a, 1)->reason, "by fields"));
  assert_non_null(strstr(map_to(&a, 2)->reason, "by fields"));
  assert_null(strstr(map_to(&e, 1)->reason, "by fields"));
  assert_string_not_equal(map_to(&a, 1)->key.hex, map_to(&b, 1)->key.hex);
  assert_string_not_equal(map_to(&a, 1)->key.hex, map_to(&e, 1)->key.hex);
  assert_string_equal(map_to(&a, 1)->key.hex, map_to(&d, 1)->key.hex); // the same values
  assert_string_equal(map_to(&a, 2)->key.hex, map_to(&d, 2)->key.hex);
  for (int i = 0; i < c.plan.count; i++)
    if (c.plan.stage[i].kind == EP_STAGE_MAP && c.plan.stage[i].to == 2)
      assert_null(strstr(c.plan.stage[i].reason, "by fields"));
  drop(&a), drop(&b), drop(&c), drop(&d), drop(&e);
}

static int held(const char *selection, ep_status expected, ep_error *err) {
  world w;
  char text[600];
  snprintf(text, sizeof text,
           "schema: 1\nobject: {mesh: object.vtu, material: {density: 1, young: 1e3, poisson: "
           "0.3}}\nfixed: [%s]\nreduction: {modes: 8, linear_modes: 5}\n",
           selection);
  const ep_status status = make(text, &w, err);
  if (status != expected) fail_msg("%s: %s", selection, err->text);
  const int count = w.shapes.nfixed;
  drop(&w);
  return count;
}

static void selections_by_field(void **state) {
  (void)state;
  ep_error err;
  // left = 1 - x / 0.5 above 0.5 is x < 0.25; the box closes below the next layer at x = 1/3
  const int box = held("{box: {low: [-1, -1, -1], high: [0.2, 1, 1]}}", EP_OK, &err);
  assert_int_equal(box, 8);
  assert_int_equal(held("{field: left, above: 0.5}", EP_OK, &err), box);
  assert_int_equal(held("{field: left}", EP_OK, &err), box);
  assert_int_equal(held("{field: left, above: 0}", EP_OK, &err), 12);
  assert_int_equal(held("{field: part, equals: 2}", EP_OK, &err), 8);
  assert_int_equal(held("{field: part, equals: 1}, {field: part, equals: 2}", EP_OK, &err), 16);
  held("{field: left, above: 2}", EP_ERR_SCENE, &err);
  assert_non_null(strstr(err.text, "0 to 1"));
  held("{field: left, above: 0.5, equals: 1}", EP_ERR_SCENE, &err);
  held("{above: 0.5}", EP_ERR_SCENE, &err);
  held("{field: left, file: s.txt}", EP_ERR_SCENE, &err);
  held("{field: lft}", EP_ERR_SCENE, &err);
  assert_non_null(strstr(err.text, "fixed.0: ./object.vtu has no array 'lft'"));
  assert_non_null(strstr(err.text, "part, left, hole, odd, number, push (3 components)"));
  held("{field: push}", EP_ERR_SCENE, &err);
  assert_non_null(strstr(err.text, "3 components"));
  held("{field: hole}", EP_ERR_SCENE, &err);
  assert_non_null(strstr(err.text, "vertex 5"));
}

static void bad_fields_are_refused(void **state) {
  (void)state;
  refused(FAMILY("rest.vtu", "{name: prt}"), "families.0.map.fields.0", "part, left");
  refused(FAMILY("rest.vtu", "{object: part, rest: mine}"), "rest.vtu has no array 'mine'",
          "it has");
  refused(FAMILY("pose.vtu", "{name: part, poses: mine}"), "pose.vtu has no array 'mine'",
          "it has");
  refused(FAMILY("rest.vtu", "{name: hole}"), "not a finite number at vertex 5", "object.vtu");
  refused(FAMILY("rest.vtu", "{name: odd}"), "-0.5 to 1.5", "neither labels");
  refused(FAMILY("rest.vtu", "{name: push}"), "3 components", "scalar");
  refused(FAMILY("rest.vtu", "{name: none}"), "0 everywhere", "'none'");
  refused(FAMILY("rest.vtu", "{rest: part}"), "families.0.map.fields.0", "object");
  refused(FAMILY("rest.vtu", "{name: number}"), "label", "not on ./object.vtu");
  refused(HEAD "families: [{rest: other-label.vtu, poses: [rest.vtu], map: {fields: [{name: "
               "part}]}}]\n",
          "label 2 is on ./object.vtu", "not on ./other-label.vtu");
  refused(HEAD "families: [{rest: many.vtu, poses: [rest.vtu], map: {fields: [{object: part, rest: "
               "number}]}}]\n",
          "more than 256", "'number'");
  refused(HEAD "families: [{rest: bare.veg, poses: [rest.vtu], map: {fields: [{name: part}]}}]\n",
          "bare.veg has no arrays", ".vtu");
  refused(HEAD "families: [{rest: rest.vtu, poses: [rest.vtu], map: {regions: object.vtu, fields: "
               "[{name: part}]}}]\n",
          "regions or fields", "families.0.map.fields");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(fields_are_regions),
      cmocka_unit_test(the_plan_follows_the_fields),
      cmocka_unit_test(selections_by_field),
      cmocka_unit_test(bad_fields_are_refused),
  };
  return cmocka_run_group_tests(tests, setup, NULL);
}
