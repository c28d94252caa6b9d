// Claims, through the real program: a scene runs end to end and takes its example's shape; the
// second run takes every stage from the cache; a changed value bakes only what depends on it; two
// bakes are byte-identical; what is read is never written over; damaged caches and models are baked
// again; mistakes end with the documented exit code and one message; stdout carries one JSON
// object.
#include <jansson.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "base/files.h"
#include "box.h"
#include "program.h"

static const char scene_text[] =
    "schema: 1\nname: beam\nobject: {mesh: beam.veg}\n"
    "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
    "families: [{poses: [beam-bent.veg]}]\n"
    "reduction: {eigenfunctions: 5, modes: 8, linear_modes: 5, path_samples: 2, elements: 15,\n"
    "  training_poses: 20, amplitude: 0.1}\n"
    "simulation: {dt: 0.02, steps: 60, damping: {mass: 0.5, stiffness: 0.05}}\n"
    "examples: {relief: 0.8}\n"
    "loads: [{push: {box: {low: [0.9, -1, -1], high: [2, 2, 2]}, force: [0, 6, 0], ramp: 0.2}}]\n"
    "output: {every: 10}\n";

static json_t *run_scene(const char *cache, const char *more) {
  const int code = program("", "run beam.yaml --json --out results --cache %s %s", cache, more);
  if (code != 0) fail_msg("exit code %d: %s", code, text_of("err.txt"));
  return report();
}

// Is this stage cached, in a report?
static bool cached(const json_t *root, const char *stage) {
  size_t index;
  json_t *entry;
  json_array_foreach(json_object_get(root, "stages"), index, entry) {
    if (strcmp(json_string_value(json_object_get(entry, "name")), stage) == 0)
      return json_is_true(json_object_get(entry, "cached"));
  }
  fail_msg("no stage %s", stage);
  return false;
}

static void a_scene_runs_end_to_end(void **state) {
  (void)state;
  json_t *root = run_scene("cache-a", "");
  assert_true(number(root, "vertices") == 81 && number(root, "tets") == 192);
  assert_true(number(root, "examples") == 1 && number(root, "m") == 5 && number(root, "r") == 8);
  assert_true(number(root, "steps_done") == 60 && number(root, "inverted_tets") == 0);
  assert_true(number(root, "t_step_ms") > 0 && number(root, "t_step_ms") < 1000);
  assert_int_equal(json_array_size(json_object_get(root, "weights")), 2);
  const double held_out = number(json_object_get(root, "cubature_error"), "held_out");
  assert_true(held_out > 0 && held_out < 0.5);
  const double with = number(root, "example_fraction");
  assert_false(cached(root, "modes"));
  json_decref(root);
  static const char *const left[] = {
      "results/animation.pvd",  "results/animation.glb",         "results/strip.png",
      "results/trajectory.csv", "results/frames/frame-0006.vtu", "results/summary.txt",
      "results/summary.json"};
  for (size_t i = 0; i < sizeof left / sizeof *left; i++)
    if (!ep_path_exists(left[i])) fail_msg("%s is missing", left[i]);
  assert_false(ep_path_exists("results/frames/frame-0007.vtu"));
  root = run_scene("cache-a", "--set examples.strength=0"); // the same bake, measured only
  assert_true(cached(root, "model"));
  const double without = number(root, "example_fraction");
  json_decref(root);
  json_decref(run_scene("cache-a", "--set simulation.steps=40")); // takes the later frames away
  assert_true(ep_path_exists("results/frames/frame-0004.vtu"));
  assert_false(ep_path_exists("results/frames/frame-0005.vtu"));
  if (!(with > 1.5 * without && without > 0)) fail_msg("with %g, without %g", with, without);
}

// The same bake up to the cubature, then explicit weights; no Laplace-Beltrami space. The larger
// alpha, the further the same push carries the beam along its example.
static void the_green_strain_path_runs(void **state) {
  (void)state;
  double last = 0;
  static const char *const alpha[] = {"0", "0.8", "1"};
  for (size_t i = 0; i < 3; i++) {
    char set[96];
    snprintf(set, sizeof set, "--set examples.path=green --set examples.alpha=%s", alpha[i]);
    json_t *root = run_scene("cache-a", set);
    const json_t *weights = json_object_get(root, "green_weights");
    assert_int_equal(json_array_size(weights), 1);
    assert_int_equal(json_array_size(json_object_get(root, "weights")), 0);
    assert_true(number(root, "m") == 0 && number(root, "t_interp_ms") == 0);
    assert_true(number(root, "inverted_tets") == 0 && cached(root, "cubature"));
    const double w = json_number_value(json_array_get(weights, 0));
    if (!(w > last)) fail_msg("alpha %s: weight %g, before %g", alpha[i], w, last);
    last = w;
    json_decref(root);
  }
}

static void the_second_run_bakes_nothing(void **state) {
  (void)state;
  static const char *const stages[] = {"eigen:object", "poses",    "modes",  "paths",
                                       "basis",        "cubature", "guards", "model"};
  json_t *root = run_scene("cache-a", "");
  for (size_t i = 0; i < 8; i++) assert_true(cached(root, stages[i]));
  json_decref(root);
  root = run_scene("cache-a", "--set reduction.elements=12");
  for (size_t i = 0; i < 8; i++) assert_int_equal(cached(root, stages[i]), i < 5);
  assert_true(number(root, "s") == 12);
  json_decref(root);
}

static void two_bakes_are_byte_identical(void **state) {
  (void)state;
  assert_int_equal(program("", "bake beam.yaml --cache cache-b --json"), 0);
  assert_int_equal(program("", "bake beam.yaml --cache cache-c --json"), 0);
  assert_int_equal(system("diff -r cache-b cache-c"), 0);
  assert_int_equal(system("test $(ls cache-b | wc -l) -eq 8"), 0);
}

static void damaged_results_are_baked_again(void **state) {
  (void)state;
  // a model cut short, and a basis with a byte changed
  assert_int_equal(system("for f in cache-b/model-*.epm; do truncate -s 1000 $f; done"), 0);
  assert_int_equal(system("for f in cache-b/basis-*.ept; do printf x | dd of=$f bs=1 seek=5000 "
                          "conv=notrunc 2>/dev/null; done; rm cache-b/cubature-*"),
                   0);
  json_t *root = run_scene("cache-b", "");
  assert_false(cached(root, "model"));
  assert_false(cached(root, "basis"));
  assert_true(cached(root, "modes"));
  json_decref(root);
  assert_non_null(strstr(text_of("err.txt"), "broken"));
  assert_int_equal(system("diff -r cache-b cache-c"), 0);
}

static void expect_failure(int code, const char *part, const char *arguments) {
  const int got = program("", "%s", arguments);
  char *err = text_of("err.txt");
  if (got != code || !strstr(err, part))
    fail_msg("%s: exit code %d (expected %d), '%s' (expected '%s')", arguments, got, code, err,
             part);
  free(err);
}

static void mistakes_have_documented_exit_codes(void **state) {
  (void)state;
  expect_failure(1, "no command 'walk'", "walk beam.yaml");
  expect_failure(1, "no file given", "run");
  expect_failure(1, "count", "eigen beam.veg --count none");
  expect_failure(2, "nowhere.yaml", "run nowhere.yaml");
  expect_failure(2, "nowhere.veg", "eigen nowhere.veg");
  expect_failure(3, "cut.veg", "eigen cut.veg");
  expect_failure(5, "out of range", "plan beam.yaml --set reduction.modes=0");
  expect_failure(5, "unknown key 'x'", "bake wrong.yaml");
  expect_failure(9, "free objects", "compare free.yaml");
  expect_failure(2, "cache-file", "bake beam.yaml --cache cache-file");
  expect_failure(2, "is a file", "run beam.yaml --cache cache-c --out beam.yaml/results");
}

// A report that is cut short is none; and what is printed never lands in a file of results.
static void reports_arrive_or_it_is_said(void **state) {
  (void)state;
  static const char *const commands[] = {"plan beam.yaml", "bake beam.yaml", "eigen beam.veg",
                                         "check beam.veg",
                                         "run beam.yaml --set simulation.steps=5"};
  static const char *const ways[] = {">/dev/full", "--json >/dev/full", ">&-", "--json >&-"};
  setenv("EIGENPOSE_CACHE", "cache-a", 1);
  for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
    for (size_t j = 0; j < sizeof ways / sizeof *ways; j++) {
      char line[512];
      snprintf(line, sizeof line, EP_COMMAND " %s %s 2>err.txt", commands[i], ways[j]);
      const int status = system(line);
      char *err = text_of("err.txt");
      if (WEXITSTATUS(status) != 2 || !strstr(err, "to stdout"))
        fail_msg("%s: exit code %d, '%s'", line, WEXITSTATUS(status), err);
      free(err);
    }
  unsetenv("EIGENPOSE_CACHE");
  int count;
  assert_int_equal(
      program("", "run beam.yaml --cache cache-a --out open --set output.formats=[vtu]"), 0);
  assert_int_equal(system(EP_COMMAND " run beam.yaml --cache cache-closed --out closed --set "
                                     "output.formats=[vtu] <&- 2>&- >/dev/null"),
                   0);
  assert_true(same_files("open", "closed", "trajectory.csv", &count) && count == 1);
  assert_true(same_files("open/frames", "closed/frames", ".vtu", &count) && count == 7);
}

static void failures_are_json_too(void **state) {
  (void)state;
  assert_int_equal(program("", "compare free.yaml --json"), 9);
  json_t *root = report();
  const json_t *failure = json_object_get(root, "error");
  assert_string_equal(json_string_value(json_object_get(failure, "status")), "unsupported");
  json_decref(root);
}

// A bake or a picture of a mesh never replaces what it is made of.
static void inputs_are_not_written_over(void **state) {
  (void)state;
  assert_int_equal(system("rm -rf over && mkdir over && cp beam.veg beam-bent.veg beam.yaml over &&"
                          "cp -r over kept && ln -s beam.veg over/link.veg"),
                   0);
  expect_failure(2, "over/beam.yaml", "bake over/beam.yaml --out over/beam.yaml");
  expect_failure(2, "over/beam-bent.veg", "bake over/beam.yaml --out over/beam-bent.veg");
  expect_failure(2, "over/beam.veg", "eigen over/beam.veg --out over/beam.veg");
  expect_failure(2, "over/link.veg", "check over/beam.veg --repair over/link.veg");
  expect_failure(2, "device", "eigen over/beam.veg --out /dev/null");
  assert_int_equal(system("for f in kept/*; do cmp $f over/${f#kept/} || exit 1; done; rm -r kept"),
                   0);
  // a frame of an earlier run as a pose
  assert_int_equal(program("", "run beam.yaml --cache cache-a --out over/run "
                               "--set output.formats=[vtu]"),
                   0);
  expect_failure(2, "frame-0003.vtu",
                 "run beam.yaml --cache cache-a --out over/run "
                 "--set families.0.poses.0=over/run/frames/frame-0003.vtu");
  assert_true(ep_path_exists("over/run/summary.json"));
}

static void formats_of_an_earlier_run_are_taken_away(void **state) {
  (void)state;
  static const char *const others[] = {"animation.pvd", "frames/frame-0000.vtu",
                                       "obstacles.pvd", "frames/obstacles-0000.vtu",
                                       "animation.glb", "strip.png",
                                       "final.png"};
  assert_int_equal(program("", "run beam.yaml --cache cache-a --out fewer "
                               "--set simulation.steps=20 --set "
                               "'obstacles=[{plane: {point: [0, -5, 0], normal: [0, 1, 0]}}]'"),
                   0);
  for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
    char path[64];
    snprintf(path, sizeof path, "fewer/%s", others[i]);
    if (!ep_path_exists(path)) fail_msg("%s is missing", path);
  }
  assert_int_equal(
      program("", "run beam.yaml --cache cache-a --out fewer --set simulation.steps=5"), 0);
  assert_true(ep_path_exists("fewer/animation.pvd") && !ep_path_exists("fewer/obstacles.pvd"));
  assert_false(ep_path_exists("fewer/frames/obstacles-0000.vtu"));
  assert_int_equal(program("", "run beam.yaml --cache cache-a --out fewer --set output.formats=[]"),
                   0);
  for (size_t i = 0; i < sizeof others / sizeof *others; i++) {
    char path[64];
    snprintf(path, sizeof path, "fewer/%s", others[i]);
    if (ep_path_exists(path)) fail_msg("%s is of an earlier run", path);
  }
  assert_true(ep_path_exists("fewer/trajectory.csv") && ep_path_exists("fewer/summary.json"));
}

// JSON holds no Latin-1; names of files do.
static void names_of_files_may_be_any_bytes(void **state) {
  (void)state;
  assert_int_equal(
      system("rm -rf caf* && mkdir caf\xe9 && cp beam.veg beam-bent.veg cut.veg beam.yaml "
             "wrong.yaml caf\xe9"),
      0);
  static const char replaced[] = "caf\xef\xbf\xbd";
  assert_int_equal(program("", "run caf\xe9/beam.yaml --json --cache caf\xe9/cache --out "
                               "caf\xe9/out --set simulation.steps=2"),
                   0);
  json_t *root = report();
  assert_non_null(strstr(json_string_value(json_object_get(root, "results")), replaced));
  json_decref(root);
  assert_int_equal(program("", "check caf\xe9/cut.veg --json"), 10);
  root = report();
  const json_t *found = json_array_get(json_object_get(root, "findings"), 0);
  assert_non_null(strstr(json_string_value(json_object_get(found, "file")), replaced));
  json_decref(root);
  assert_int_equal(program("", "plan caf\xe9/wrong.yaml --json"), 5);
  root = report();
  const json_t *failure = json_object_get(root, "error");
  assert_non_null(strstr(json_string_value(json_object_get(failure, "message")), replaced));
  json_decref(root);
  assert_int_equal(program("", "eigen caf\xe9/beam.veg --count 3 --json"), 0);
  json_decref(report());
}

// In single precision a beam at 1e7 m is a point: its node stands there, its vertices about it.
static void animations_keep_their_shape_far_from_the_origin(void **state) {
  (void)state;
  assert_int_equal(system("awk '/^\\*/ {s = $1} s == \"*VERTICES\" && NF == 4 && $2 != 3 {$2 = "
                          "sprintf(\"%.9f\", $2 + 1e7)} {print}' beam.veg > far.veg"),
                   0);
  assert_int_equal(program("",
                           "run beam.yaml --cache cache-far --out far --set object.mesh=far.veg "
                           "--set families=[] --set simulation.steps=2 --set fixed.0.box.high="
                           "[10000000.01,1,1] --set loads=[] --set output.formats=[glb]"),
                   0);
  char *bytes;
  size_t size;
  assert_int_equal(ep_file_read("far/animation.glb", &bytes, &size, NULL), EP_OK);
  json_t *root = json_loadb(bytes + 20, size - 20, JSON_DISABLE_EOF_CHECK, NULL);
  const json_t *primitive = json_array_get(
      json_object_get(json_array_get(json_object_get(root, "meshes"), 0), "primitives"), 0);
  const json_int_t at =
      json_integer_value(json_object_get(json_object_get(primitive, "attributes"), "POSITION"));
  const json_t *position = json_array_get(json_object_get(root, "accessors"), (size_t)at);
  const json_t *low = json_object_get(position, "min"), *high = json_object_get(position, "max");
  const double width =
      json_number_value(json_array_get(high, 0)) - json_number_value(json_array_get(low, 0));
  if (fabs(width - 1) > 1e-3) fail_msg("%g m instead of 1 m", width);
  json_decref(root);
  free(bytes);
}

// RLIMIT_FSIZE stands for a full disk: the run fails with a message, and leaves no half result.
// (A run from a warm cache: MPI, which the baker starts, does not bear the limit.)
static void a_full_disk_is_said(void **state) {
  (void)state;
  const int status = system("trap '' XFSZ; ulimit -f 4; " EP_COMMAND
                            " run beam.yaml --cache cache-c --out full >out.txt 2>err.txt");
  char *err = text_of("err.txt");
  if (WEXITSTATUS(status) != 2 || !strstr(err, "cannot write all of"))
    fail_msg("exit code %d, '%s'", WEXITSTATUS(status), err);
  free(err);
  assert_int_equal(system("! find full -name '*.tmp' | grep -q ."), 0);
}

static void eigenvalues_and_plans_are_printed(void **state) {
  (void)state;
  assert_int_equal(program("", "eigen beam.veg --count 5 --json --out phi.vtu"), 0);
  json_t *root = report();
  const json_t *list = json_object_get(root, "eigenvalues");
  assert_int_equal(json_array_size(list), 5);
  double before = 0;
  for (size_t i = 0; i < 5; i++) {
    const double value = json_number_value(json_array_get(list, i));
    assert_true(value > 0 && value >= before);
    before = value;
  }
  // a beam of length 1: the first is pi^2 up to the mesh's coarseness (error ~ h^2)
  const double first = json_number_value(json_array_get(list, 0));
  assert_true(first > 9.8 && first < 10.2);
  json_decref(root);
  assert_true(ep_path_exists("phi.vtu"));
  assert_int_equal(program("", "plan beam.yaml --json --cache cache-c"), 0);
  root = report();
  assert_true(json_array_size(json_object_get(root, "stages")) >= 8);
  json_decref(root);
  assert_int_equal(program("", "align beam.yaml --json --cache cache-c"), 0);
  root = report();
  assert_int_equal(json_array_size(json_object_get(root, "maps")), 0);
  json_decref(root);
  assert_int_equal(program("", "--help"), 0);
  assert_int_equal(program("", "run --help"), 0);
  assert_int_equal(program("", "--version"), 0);
}

static int set_up(void **state) {
  (void)state;
  if (system("rm -rf cache-* results full") != 0) return 1;
  unsetenv("EIGENPOSE_CACHE");
  setenv("XDG_CACHE_HOME", "cache-default", 1);
  write_box("beam.veg", 8, 2, 2, 1, 0, 1e5);
  write_box("beam-bent.veg", 8, 2, 2, 1, 0.35, 0);
  write_text("beam.yaml", scene_text);
  write_text("cut.veg", "*VERTICES\n4 3 0 0\n1 0 0 0\n2 1 0\n");
  write_text("wrong.yaml", "schema: 1\nx: 1\nobject: {mesh: beam.veg}\n");
  write_text("free.yaml", "schema: 1\nobject: {mesh: beam.veg}\n");
  write_text("cache-file", "");
  return 0;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_scene_runs_end_to_end),
      cmocka_unit_test(the_green_strain_path_runs),
      cmocka_unit_test(the_second_run_bakes_nothing),
      cmocka_unit_test(two_bakes_are_byte_identical),
      cmocka_unit_test(damaged_results_are_baked_again),
      cmocka_unit_test(mistakes_have_documented_exit_codes),
      cmocka_unit_test(reports_arrive_or_it_is_said),
      cmocka_unit_test(failures_are_json_too),
      cmocka_unit_test(inputs_are_not_written_over),
      cmocka_unit_test(formats_of_an_earlier_run_are_taken_away),
      cmocka_unit_test(names_of_files_may_be_any_bytes),
      cmocka_unit_test(animations_keep_their_shape_far_from_the_origin),
      cmocka_unit_test(a_full_disk_is_said),
      cmocka_unit_test(eigenvalues_and_plans_are_printed),
  };
  return cmocka_run_group_tests(tests, set_up, NULL);
}
