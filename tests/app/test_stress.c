// `eigenpose stress`, through the real program. Claims: the list has every axis the scene has
// something for; nothing breaks, and what starts inverted or collapsed ends without inverted tets;
// without loads the energy does not grow (implicit Euler: W + T falls by at least |v' - v|^2 / 2 in
// every step where W is convex along it); the record, the table and the page tell of the same
// cases; a stored state is done again; a file that is no failure, cut or of another version is
// refused; no variant asks the run time for what a scene file may not.
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

#include "base/files.h"
#include "box.h"
#include "program.h"

// 12 modes: fewer cannot shorten the beam, and its collapse, projected on them, inverts nothing.
static const char scene_text[] =
    "schema: 1\nname: beam\nobject: {mesh: beam.veg}\n"
    "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
    "families: [{poses: [beam-bent.veg]}]\n"
    "reduction: {eigenfunctions: 4, modes: 12, linear_modes: 5, path_samples: 1, elements: 24,\n"
    "  training_poses: 20, amplitude: 0.1}\n"
    "simulation: {damping: {mass: 0.5, stiffness: 0.05}}\n"
    "loads: [{push: {box: {low: [0.9, -1, -1], high: [2, 2, 2]}, force: [0, 2, 0]}}]\n";

static const char local_text[] =
    "schema: 1\nname: local\nobject: {mesh: beam.veg, material: {model: stvk}}\n"
    "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
    "regions: [{name: tip, box: {low: [0.5, -1, -1], high: [2, 2, 2]}, soft: 0.1}]\n"
    "families: [{poses: [beam-bent.veg], region: {name: tip}}]\n"
    "reduction: {eigenfunctions: 4, modes: 8, linear_modes: 5, path_samples: 1, elements: 24,\n"
    "  training_poses: 20, amplitude: 0.1}\n"
    "examples: {relief: 0.5}\n"
    "loads: [{push: {box: {low: [0.9, -1, -1], high: [2, 2, 2]}, force: [0, 2, 0]}}]\n";

static const json_t *find(const json_t *root, const char *axis, const char *text) {
  size_t index;
  json_t *entry;
  json_array_foreach(json_object_get(root, "cases"), index, entry) {
    if (strcmp(json_string_value(json_object_get(entry, "axis")), axis) == 0 &&
        strcmp(json_string_value(json_object_get(entry, "text")), text) == 0)
      return entry;
  }
  fail_msg("no case %s %s", axis, text);
  return NULL;
}

static void nothing_breaks(void **state) {
  (void)state;
  // of an earlier run in the same folder
  assert_int_equal(ep_make_folders("report/failures", NULL), EP_OK);
  write_text("report/failures/case-0007.json", "{}");
  const int code = program("", "stress beam.yaml --quick --json --cache cache --out report");
  if (code != 0) fail_msg("exit code %d: %s", code, text_of("err.txt"));
  json_t *root = report();
  assert_true(number(json_object_get(root, "outcomes"), "broken") == 0);
  assert_true(json_array_size(json_object_get(root, "cases")) == 2 + 2 + 1 + 2 * 5 + 5);
  size_t index;
  json_t *entry;
  json_array_foreach(json_object_get(root, "cases"), index, entry) {
    assert_true(number(entry, "steps") >= 120 && number(entry, "newton_median") <= 10);
    assert_true(number(entry, "energy_growth") <= 1e-6);
  }
  static const char *const starts[] = {"inverted", "point", "plane", "random", "far"};
  for (size_t i = 0; i < sizeof starts / sizeof *starts; i++) {
    const json_t *start = find(root, "start", starts[i]);
    if (i != 4) assert_true(number(start, "inverted_start") > 0); // a far one is only moved
    assert_true(number(start, "inverted_end") == 0);
  }
  assert_true(number(find(root, "stiff", "1e+06"), "newton_median") <= 10);
  json_decref(root);
}

static void all_tell_of_the_same_cases(void **state) {
  (void)state;
  char *page = text_of("report/index.html"), *table = text_of("report/results.csv");
  char *record = text_of("report/results.json");
  int rows = -1;
  for (const char *c = table; *c; c++) rows += *c == '\n';
  assert_int_equal(rows, 20);
  assert_non_null(strstr(page, "<h2>Start inverted"));
  assert_non_null(strstr(record, "\"axis\": \"strength\""));
  assert_false(ep_path_exists("report/failures")); // there was none, and none is left
  free(page);
  free(table);
  free(record);
}

static void refused(const char *text, const char *why) {
  write_text("failure.json", text);
  assert_int_equal(program("", "stress beam.yaml --replay failure.json --cache cache"), 3);
  char *said = text_of("err.txt");
  if (!strstr(said, why)) fail_msg("%s: %s", why, said);
  free(said);
}

// The first line of a failure's file; the first step of a case needs no more.
#define CASE(variant)                                                                              \
  "{\"format\": 2, \"variant\": \"" variant                                                        \
  "\", \"axis\": \"load\", \"value\": 10, \"second\": 0, \"t\": 0, \"loaded\": true, "             \
  "\"coasting\": false, \"step\": "

static void a_state_is_done_again(void **state) {
  (void)state;
  write_text("failure.json", CASE("scene") "0}");
  assert_int_equal(program("", "stress beam.yaml --replay failure.json --cache cache"), 0);
  char *said = text_of("out.txt");
  if (!strstr(said, "step done: ")) fail_msg("%s", said);
  free(said);
  assert_int_equal(program("", "stress beam.yaml --replay failure.json --json --cache cache"), 0);
  json_t *root = report(); // one object
  assert_true(number(root, "newton_iterations") > 0 && number(root, "inverted_end") == 0);
  json_decref(root);
  refused("{\"variant\": \"scene\"}", "no failure of a stress test");
  refused("{\"variant\": \"scene\", \"axis\": \"load\", \"value\": 10, \"second\": 0, \"t\": 0,"
          "\"loaded\": true, \"q\": [0,0,0,0,0,0,0,0], \"v\": [0,0,0,0,0,0,0,0]}",
          "of another version");
  refused(CASE("scene") "3, \"history\": [0, 0]}", "holds 2 numbers");
  refused(CASE("scene") "3}", "holds 0 numbers");
  refused(CASE("scene"), "failure.json:1: ");
}

// What a scene file would refuse - relief in a region, by exact polynomials - no variant asks for.
static void variants_suit_local_examples(void **state) {
  (void)state;
  write_text("local.yaml", local_text);
  static const char *const variants[] = {"scene", "stvk", "neohookean", "cubic", "green"};
  for (size_t i = 0; i < sizeof variants / sizeof *variants; i++) {
    char text[256];
    snprintf(text, sizeof text, CASE("%s") "0}", variants[i]);
    write_text("local.json", text);
    const int code = program("", "stress local.yaml --replay local.json --cache cache");
    if (code != 0) fail_msg("%s: exit code %d: %s", variants[i], code, text_of("err.txt"));
    char *said = text_of("out.txt");
    if (!strstr(said, "step done: ")) fail_msg("%s: %s", variants[i], said);
    free(said);
  }
}

static int prepare(void **state) {
  (void)state;
  write_box("beam.veg", 8, 2, 2, 1, 0, 3e4);
  write_box("beam-bent.veg", 8, 2, 2, 1, 0.3, 3e4);
  write_text("beam.yaml", scene_text);
  return 0;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(nothing_breaks),
      cmocka_unit_test(all_tell_of_the_same_cases),
      cmocka_unit_test(a_state_is_done_again),
      cmocka_unit_test(variants_suit_local_examples),
  };
  return cmocka_run_group_tests(tests, prepare, NULL);
}
