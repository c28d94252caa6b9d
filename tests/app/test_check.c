// Claims of `eigenpose check`: each of sixteen meshes broken on purpose gets the right diagnosis at
// the right place and the right exit code; repairs leave a mesh without that finding and without
// another change of shape; scenes are checked with their meshes. Angles and ratios against closed
// forms.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "box.h"
#include "mesh/io.h"
#include "mesh/quality.h"
#include "mesh/repair.h"
#include "program.h"

static void has_text(const char *path, const char *part) {
  char *text = text_of(path);
  if (!strstr(text, part)) fail_msg("%s lacks '%s': %s", path, part, text);
  free(text);
}

// ---- angles ------------------------------------------------------------------------------------

static void shapes_of_known_tets(void **state) {
  (void)state;
  const double regular[12] = {1, 1, 1, 1, -1, -1, -1, 1, -1, -1, -1, 1};
  ep_tet_shape s = ep_shape_of_tet(regular);
  assert_true(fabs(s.low - 180 / M_PI * acos(1.0 / 3)) < 1e-12);
  assert_true(fabs(s.high - s.low) < 1e-12 && fabs(s.radius_ratio - 1) < 1e-14);
  // Corner of a cube: three right angles, three of atan(sqrt 2); r = (3 - sqrt 3) / 6, R = sqrt 3
  // / 2.
  const double corner[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  s = ep_shape_of_tet(corner);
  assert_true(fabs(s.low - 180 / M_PI * atan(sqrt(2))) < 1e-12 && fabs(s.high - 90) < 1e-12);
  assert_true(fabs(s.radius_ratio - 3 * (3 - sqrt(3)) / 6 / (sqrt(3) / 2)) < 1e-14);
  // Two opposite edges of length 2, crossed at the distance h: the angles at them are
  // 180 - 2 atan(h), the four others acos(1 / (1 + h^2)); in any size.
  for (double h = 1; h > 1e-10; h *= 0.1)
    for (double scale = 1e-6; scale < 1e7; scale *= 1e6) {
      double x[12] = {-1, 0, 0, 1, 0, 0, 0, -1, h, 0, 1, h};
      for (int i = 0; i < 12; i++) x[i] *= scale;
      s = ep_shape_of_tet(x);
      const double high = 180 - 2 * 180 / M_PI * atan(h), low = 180 / M_PI * acos(1 / (1 + h * h));
      if (h < 0.5) assert_true(fabs(s.high - high) < 1e-6 * (180 - high) + 1e-12);
      if (h < 0.5 && h > 1e-4) assert_true(fabs(s.low - low) < 1e-6 * low);
    }
  const double flat[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  s = ep_shape_of_tet(flat);
  assert_true(s.low == 0 && s.high == 180 && s.radius_ratio == 0);
  const double point[12] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
  s = ep_shape_of_tet(point);
  assert_true(s.low == 0 && s.high == 180 && s.radius_ratio == 0);
}

// ---- broken meshes -----------------------------------------------------------------------------

typedef struct broken {
  const char *file;
  const char *code;   // of a finding
  const char *says;   // in its message: the place
  int exit;           // of check
  int repaired;       // exit of check --repair: 0, 10, or -1 where it is not tried
  const char *vertex; // lines of an ASCII .veg
  int vertices;
  const char *tet;
  int tets;
} broken;

#define CORNER "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n"

static const broken meshes[] = {
    {"inverted.veg", "inverted-tets", "first: tet 2", 0, 0, CORNER "5 1 1 1\n", 5,
     "1 1 2 3 4\n2 2 3 5 4\n", 2},
    {"degenerate.veg", "degenerate-tets", "first: tet 2", 10, 0, CORNER "5 1 1 0\n", 5,
     "1 1 2 3 4\n2 1 2 5 3\n", 2},
    {"repeated.veg", "repeated-tets", "first: tet 3", 0, 0, CORNER "5 1 1 1\n", 5,
     "1 1 2 3 4\n2 2 5 3 4\n3 3 1 2 4\n", 3},
    {"unused.veg", "unused-vertices", "first: vertex 3", 0, 0,
     "1 0 0 0\n2 1 0 0\n3 9 9 9\n4 0 1 0\n5 0 0 1\n", 5, "1 1 2 4 5\n", 1},
    {"duplicate.veg", "duplicate-vertices", "vertex 5, where 2 is", 10, 0,
     CORNER "5 1 0 0\n6 0 1 0\n7 0 0 1\n8 1 1 1\n", 8, "1 1 2 3 4\n2 5 8 6 7\n", 2},
    {"nearly-duplicate.veg", "duplicate-vertices", "vertex 5, where 2 is", 10, 0,
     CORNER "5 1.0000000001 0 0\n6 0 1 0\n7 0 1e-10 1\n8 1 1 1\n", 8, "1 1 2 3 4\n2 5 8 6 7\n", 2},
    {"islands.veg", "islands", "2 separate parts: the largest has 2 of 3 tets", 10, 10,
     CORNER "5 1 1 1\n6 5 5 5\n7 6 5 5\n8 5 6 5\n9 5 5 6\n", 9, "1 1 2 3 4\n2 6 7 8 9\n3 2 5 3 4\n",
     3},
    {"overlapping.veg", "overlapping-tets", "first: tets 1 and 2", 10, 10, CORNER "5 0.2 0.2 2\n",
     5, "1 1 2 3 4\n2 1 2 3 5\n", 2},
    {"three-on-a-face.veg", "overlapping-tets", "first: tets 1 and 2", 10, -1,
     CORNER "5 0 0 2\n6 0 0 -1\n", 6, "1 1 2 3 4\n2 1 2 3 5\n3 1 3 2 6\n", 3},
    {"hinge.veg", "surface-edges", "first: vertices 1 and 2", 0, 0, CORNER "5 0 -1 0\n6 0 0 -1\n",
     6, "1 1 2 3 4\n2 1 2 5 6\n", 2},
    {"joint.veg", "surface-vertices", "first: vertex 1", 0, 0,
     CORNER "5 -1 0 0\n6 0 -1 0\n7 0 0 -1\n", 7, "1 1 2 3 4\n2 1 5 7 6\n", 2},
    {"sliver.veg", "slivers", "tet 2 (", 0, 0, CORNER "5 0.5 0.5 -0.001\n", 5,
     "1 1 2 3 4\n2 1 3 2 5\n", 2},
    {"millimeters.veg", "scale", "scale the mesh by 0.001", 0, 0,
     "1 0 0 0\n2 900 0 0\n3 0 900 0\n4 0 0 900\n", 4, "1 1 2 3 4\n", 1},
    {"not-a-number.veg", "unreadable", "line 3: ", 10, -1, "1 nan 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n",
     4, "1 1 2 3 4\n", 1},
    {"no-such-vertex.veg", "unreadable", "line 11: ", 10, -1, CORNER, 4, "1 1 2 3 9\n", 1},
    {"only-flat.veg", "degenerate-tets", "first: tet 1", 10, 4,
     "1 0 0 0\n2 1 0 0\n3 0 1 0\n4 1 1 0\n", 4, "1 1 2 3 4\n", 1},
};

static void write_veg(const broken *b) {
  char text[2000];
  snprintf(text, sizeof text, "*VERTICES\n%d 3 0 0\n%s\n*ELEMENTS\nTET\n%d 4 0\n%s", b->vertices,
           b->vertex, b->tets, b->tet);
  write_text(b->file, text);
}

// The finding with that code in out.txt; counts all of the file that are not notes.
static const char *finding(const json_t *root, const char *code) {
  size_t i;
  const json_t *f;
  json_array_foreach(json_object_get(root, "findings"), i, f) {
    if (strcmp(json_string_value(json_object_get(f, "code")), code) == 0)
      return json_string_value(json_object_get(f, "message"));
  }
  return NULL;
}

static void broken_meshes_are_diagnosed(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
    const broken *b = &meshes[i];
    write_veg(b);
    const int code = program("", "check %s --json", b->file);
    json_t *root = report();
    const char *message = finding(root, b->code);
    if (code != b->exit) fail_msg("%s: exit code %d, expected %d", b->file, code, b->exit);
    if (!message || !strstr(message, b->says))
      fail_msg("%s: %s: '%s', expected '%s'", b->file, b->code, message ? message : "nothing",
               b->says);
    assert_int_equal(number(root, "errors") > 0, b->exit == 10);
    json_decref(root);
    assert_int_equal(program("", "check %s", b->file), b->exit);
    has_text("out.txt", b->file);
    has_text("out.txt", b->code);
  }
}

// What was repairable is gone afterwards; the volume is that of the sound tets.
static void repairs_repair(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++) {
    const broken *b = &meshes[i];
    if (b->repaired < 0) continue;
    for (int kind = 0; kind < 2; kind++) {
      const char *out = kind ? "repaired.vtu" : "repaired.veg";
      unlink(out);
      write_veg(b);
      const int code = program("", "check %s --repair %s --json", b->file, out);
      if (code != b->repaired)
        fail_msg("%s: exit code %d, expected %d", b->file, code, b->repaired);
      if (code == 4) continue; // nothing was left
      assert_int_equal(program("", "check %s --json", out), b->repaired);
      json_t *root = report();
      const bool repairable = strcmp(b->code, "islands") && strncmp(b->code, "surface", 7) &&
                              strcmp(b->code, "slivers") && strcmp(b->code, "scale") &&
                              strcmp(b->code, "overlapping-tets");
      if (repairable && finding(root, b->code)) fail_msg("%s: %s is left", b->file, b->code);
      json_decref(root);
    }
  }
  // Joined at three vertices the two tets are one part of volume 1/6 + 1/3.
  ep_mesh m;
  ep_error err = {0};
  write_veg(&meshes[4]);
  assert_int_equal(program("", "check duplicate.veg --repair joined.veg"), 0);
  has_text("err.txt", "3 vertices joined");
  assert_int_equal(ep_mesh_read("joined.veg", &m, NULL, NULL, &err), EP_OK);
  assert_int_equal(m.nv, 5);
  assert_true(fabs(ep_mesh_volume(&m) - 0.5) < 1e-15);
  ep_mesh_free(&m);
  // The largest part only where asked.
  assert_int_equal(program("", "check islands.veg --repair largest.veg --largest"), 0);
  assert_int_equal(ep_mesh_read("largest.veg", &m, NULL, NULL, &err), EP_OK);
  assert_int_equal(m.nt, 2);
  ep_mesh_free(&m);
}

static void repair_keeps_materials_and_data(void **state) {
  (void)state;
  write_text("data.vtk",
             "# vtk DataFile Version 4.2\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 double\n"
             "0 0 0 9 9 9 1 0 0 0 1 0 0 0 1 1 0 0\nCELLS 2 10\n4 0 2 3 4\n4 0 2 5 3\n"
             "CELL_TYPES 2\n10 10\nPOINT_DATA 6\nSCALARS part int\nLOOKUP_TABLE default\n"
             "1 2 3 4 5 6\n");
  assert_int_equal(program("", "check data.vtk --repair data.vtu"), 0);
  ep_mesh m;
  ep_error err = {0};
  assert_int_equal(ep_mesh_read("data.vtu", &m, NULL, NULL, &err), EP_OK);
  const double expected[4] = {1, 3, 4, 5};
  assert_int_equal(m.nv, 4);
  assert_int_equal(m.nt, 1);
  assert_memory_equal(ep_mesh_data(&m, "part")->value, expected, sizeof expected);
  ep_mesh_free(&m);
  write_text("two.veg", "*VERTICES\n5 3 0 0\n" CORNER "5 1 1 1\n*ELEMENTS\nTET\n3 4 0\n1 1 2 3 4\n"
                        "2 1 1 2 3\n3 2 5 3 4\n*MATERIAL a\nENU, 1000, 1e5, 0.4\n*MATERIAL b\nENU, "
                        "2000, 1e5, 0.4\n*SET s\n3\n*REGION\nallElements, a\n*REGION\ns, b\n");
  assert_int_equal(program("", "check two.veg --repair one.veg"), 0);
  assert_int_equal(ep_mesh_read("one.veg", &m, NULL, NULL, &err), EP_OK);
  assert_int_equal(m.nt, 2);
  assert_true(m.material[m.tet_material[0]].density == 1000);
  assert_true(m.material[m.tet_material[1]].density == 2000);
  ep_mesh_free(&m);
}

// Places nearer than 1e-9 of the diagonal are one, whatever the size of the mesh; farther ones not.
static void places_by_distance(void **state) {
  (void)state;
  for (double scale = 1e-6; scale < 1e7; scale *= 1e3) {
    double x[3 * 9];
    for (int v = 0; v < 8; v++)
      for (int k = 0; k < 3; k++) x[3 * v + k] = scale * ((v >> k) & 1);
    const double d = scale * sqrt(3);
    const int tet[8] = {0, 1, 2, 4, 7, 3, 5, 8};
    for (int near = 0; near < 2; near++) {
      memcpy(x + 24, x, 3 * sizeof *x);
      x[25] += (near ? 0.5e-9 : 2e-9) * d;
      ep_mesh m;
      ep_error err = {0};
      int first[9], count;
      assert_int_equal(ep_mesh_make(9, x, 2, tet, "m", &m, NULL, &err), EP_OK);
      assert_int_equal(ep_mesh_same_places(&m, first, &count, &err), EP_OK);
      assert_int_equal(count, near);
      if (near) assert_int_equal(first[m.nv - 1], 0);
      ep_mesh_free(&m);
    }
  }
}

// ---- usage and scenes --------------------------------------------------------------------------

static void usage(void **state) {
  (void)state;
  write_box("sound.veg", 2, 1, 1, 1, 0, 1e5);
  write_veg(&meshes[6]);
  assert_int_equal(program("", "check sound.veg"), 0);
  assert_int_equal(program("", "check sound.veg islands.veg"), 10);
  has_text("out.txt", "islands.veg: islands:");
  // a scene that cannot be read is a finding as well, and the next file has its turn
  write_text("bad.yaml", "schema: 1\nobject: {mesh: sound.veg}\nreduction: {mods: 3}\n");
  assert_int_equal(program("", "check bad.yaml islands.veg"), 10);
  has_text("out.txt", "bad.yaml:3:13: unknown key");
  has_text("out.txt", "islands.veg: islands:");
  assert_int_equal(program("", "check absent.yaml islands.veg"), 2);
  assert_int_equal(program("", "check sound.veg absent.veg"), 2);
  // what a bake takes all the same, it warns of
  for (size_t i = 0; i < sizeof meshes / sizeof *meshes; i++)
    if (strcmp(meshes[i].file, "overlapping.veg") == 0) write_veg(&meshes[i]);
  write_text("double.yaml", "schema: 1\nobject: {mesh: overlapping.veg, material: {density: 1000, "
                            "young: 1e5, poisson: 0.4}}\nreduction: {modes: 1, linear_modes: 1}\n");
  assert_int_equal(program("", "plan double.yaml --quiet"), 0);
  has_text("err.txt", "warning: ./overlapping.veg: ");
  has_text("err.txt", "first: tets 1 and 2");
  assert_int_equal(program("", "check"), 1);
  assert_int_equal(program("", "check sound.veg islands.veg --repair x.veg"), 1);
  assert_int_equal(program("", "check sound.veg --repair x.msh"), 1);
  assert_int_equal(program("", "check sound.veg --largest"), 1);
  write_veg(&meshes[3]);
  assert_int_equal(program("", "check unused.veg --quiet"), 0); // notes are not said
  char *out = text_of("out.txt");
  assert_string_equal(out, "");
  free(out);
}

#define SCENE(rest)                                                                                \
  "schema: 1\nobject: {mesh: sound.veg}\nreduction: {modes: 4, linear_modes: 3, eigenfunctions: "  \
  "2}\n" rest
#define HELD "fixed: [{box: {low: [-1, -9, -9], high: [0.01, 9, 9]}}]\n"

static void expect_scene(const char *text, int exit_code, const char *code, const char *says) {
  write_text("s.yaml", text);
  const int got = program("", "check s.yaml --json");
  if (got != exit_code) fail_msg("exit code %d, expected %d, for %s", got, exit_code, text);
  if (!code) return;
  json_t *root = report();
  const char *message = finding(root, code);
  if (!message || !strstr(message, says))
    fail_msg("%s: '%s', expected '%s'", code, message ? message : "nothing", says);
  json_decref(root);
}

static void scenes_are_checked(void **state) {
  (void)state;
  write_box("sound.veg", 2, 1, 1, 1, 0, 1e5);
  write_box("bent.veg", 2, 1, 1, 1, 0.3, 0);
  write_box("bent-more.veg", 2, 1, 1, 1, 0.6, 0);
  write_box("long.veg", 2, 1, 1, 3, 0, 0);
  write_box("flat.veg", 2, 1, 1, 0.3, 0, 0);
  write_box("other.veg", 3, 1, 1, 1, 0, 0);
  write_text("line.bou", "1, 4\n");
  write_text("inf.bou", "1");
  expect_scene(SCENE(HELD), 0, "mass", "kg");
  expect_scene(SCENE("fixed: [{file: line.bou}]\n"), 10, "fixed-turns",
               "2 vertices (first: vertex");
  expect_scene(SCENE("fixed: [{file: inf.bou}]\n"), 10, "fixed-turns",
               "1 vertex (first: vertex 1)");
  expect_scene(SCENE("fixed: [{box: {low: [-1, -1, -1], high: [9, 0.01, 0.01]}}]\n"), 10,
               "fixed-turns", "3 vertices (first: vertex 1) in one line");
  expect_scene(SCENE("fixed: [{box: {low: [7, 7, 7], high: [9, 9, 9]}}]\n"), 10, "fixed",
               "fixed.0");
  expect_scene(SCENE(HELD "families: [{poses: [bent.veg, bent-more.veg]}]\n"), 0,
               "dependent-examples", "1 different examples so far");
  expect_scene(SCENE(HELD "families: [{poses: [sound.veg]}]\n"), 0, "pose-is-rest", "sound.veg");
  expect_scene(SCENE(HELD "families: [{poses: [long.veg]}]\n"), 0, "volume-differs", "27 times");
  expect_scene(SCENE(HELD "families: [{poses: [flat.veg]}]\n"), 0, "stvk-range", "30 %");
  expect_scene(SCENE(HELD "families: [{rest: islands.veg, poses: [other.veg]}]\n"), 10,
               "parts-differ", "2 parts");
  expect_scene("schema: 1\nobject: {mesh: other.veg}\n", 10, "no-material", "object.material");
  expect_scene("schema: 1\nobject: {mesh: other.veg, material: {density: 1, young: 3, poisson: "
               "0.499}}\nreduction: {modes: 4, linear_modes: 3}\n" HELD,
               0, "locking", "0.499");
  expect_scene(SCENE(HELD), 0, NULL, NULL);
  expect_scene("schema: 1\nobject: {mesh: sound.veg}\nreduction: {modes: 150}\n" HELD, 10, "scene",
               "unknowns");
  expect_scene("schema: 1\nobject: {mesh: sound.veg, oops: 1}\n", 10, "scene",
               "unknown key 'oops'");
}

static void real_meshes(void **state) {
  (void)state;
  static const struct {
    const char *file, *code;
  } real[] = {{"car/car.veg", NULL},
              {"car/ex0.veg", NULL},
              {"car/ex1.veg", NULL},
              {"gorilla/gorilla.veg", "surface-edges"},
              {"gorilla/ex0.veg", "surface-edges"},
              {"gorilla/ex1.veg", "surface-edges"},
              {"letter-c/C.veg", NULL},
              {"letter-c/ex1.veg", NULL},
              {"turtle/turtle-volumetric-homogeneous.veg", NULL}};
  if (access(EP_SOURCE_DIR "/../shared/data", R_OK) != 0) {
    print_message("skipped: there is no folder ../shared/data\n");
    skip();
  }
  for (size_t i = 0; i < sizeof real / sizeof *real; i++) {
    assert_int_equal(program("", "check %s/../shared/data/%s --json", EP_SOURCE_DIR, real[i].file),
                     0);
    json_t *root = report();
    const size_t count = json_array_size(json_object_get(root, "findings"));
    if (!real[i].code && count) fail_msg("%s has findings", real[i].file);
    if (real[i].code) assert_non_null(finding(root, real[i].code));
    json_decref(root);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(shapes_of_known_tets), cmocka_unit_test(broken_meshes_are_diagnosed),
      cmocka_unit_test(repairs_repair),       cmocka_unit_test(repair_keeps_materials_and_data),
      cmocka_unit_test(places_by_distance),   cmocka_unit_test(usage),
      cmocka_unit_test(scenes_are_checked),   cmocka_unit_test(real_meshes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
