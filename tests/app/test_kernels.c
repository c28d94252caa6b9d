// Claim: a whole `eigenpose run` leaves the same bytes on every instruction set its kernels are
// compiled for - the trajectory to its last digit, every frame's positions - whatever evaluates
// the energy: cubature in doubles and floats with examples on the LB path, exact polynomials in
// doubles and floats, the Green-strain path, free objects on an obstacle. (Kernel by kernel:
// tests/reduced/test_same_bits.c. Promised for one build and one C library; the bake is done once,
// as a cached model is what travels between machines.)
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

#include "box.h"
#include "program.h"
#include "reduced/eigenpose.h"

static const char *const levels[] = {"baseline", "avx2", "avx512"};
enum { LEVELS = 3 };

static const char held[] = "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
                           "families: [{poses: [bent.veg, down.veg]}]\n";
static const char free_fall[] =
    "families: [{poses: [bent.veg, down.veg]}]\n"
    "start: {spin: [1, 2, 3]}\n"
    "obstacles: [{plane: {point: [0, 0.4, 0], normal: [0, -1, 0.2]}, friction: 0.3}]\n";

static const struct {
  const char *name, *motion, *reduction, *simulation, *examples;
} scenes[] = {
    {"cubature", held, "", "", "path: lb, solver: newton"},
    {"cubature-nlopt", held, "", "", "path: lb"},
    {"cubature-float", held, "", ", precision: float", "path: lb, solver: newton"},
    {"cubic", held, ", evaluator: cubic", "", "path: lb, solver: newton"},
    {"cubic-float", held, ", evaluator: cubic", ", precision: float", "path: lb, solver: newton"},
    {"green", held, ", evaluator: cubic", "", "path: green, constraints: {non_negative: 1}"},
    {"both", held, "", "", "path: both, solver: newton"},
    {"free", free_fall, "", "", "path: lb, solver: newton"},
};

static void write_scene(size_t i) {
  char path[80], text[2000];
  snprintf(path, sizeof path, "%s.yaml", scenes[i].name);
  snprintf(text, sizeof text,
           "schema: 1\nobject: {mesh: bar.veg, material: {density: 1000, young: 2.0e4, poisson: "
           "0.4}}\n%s"
           "reduction: {modes: 13, linear_modes: 6, elements: 30, training_poses: 40%s}\n"
           "simulation: {steps: 30%s}\nexamples: {%s}\n"
           "loads: [{gravity: [0, 9.81, 0]}]\noutput: {formats: [vtu], every: 10}\n",
           scenes[i].motion, scenes[i].reduction, scenes[i].simulation, scenes[i].examples);
  write_text(path, text);
}

static int setup(void **state) {
  (void)state;
  write_box("bar.veg", 8, 2, 2, 1, 0, 0);
  write_box("bent.veg", 8, 2, 2, 1, 0.3, 0);
  write_box("down.veg", 8, 2, 2, 1, -0.3, 0);
  return shell("rm -rf cache out");
}

// The hash its summary tells.
static void run_at(const char *scene, const char *level, char hash[64]) {
  if (program("", "run %s.yaml --json --cache cache --out out/%s-%s --kernels %s", scene, scene,
              level, level) != 0)
    fail_msg("%s at %s: %s", scene, level, text_of("err.txt"));
  json_t *root = report();
  assert_string_equal(json_string_value(json_object_get(root, "kernels")), level);
  snprintf(hash, 64, "%s", json_string_value(json_object_get(root, "trajectory_hash")));
  assert_int_equal(strlen(hash), 32);
  json_decref(root);
}

static void same_bytes(const char *scene, const char *level) {
  char one[128], two[128];
  int count;
  snprintf(one, sizeof one, "out/%s-baseline", scene);
  snprintf(two, sizeof two, "out/%s-%s", scene, level);
  assert_true(same_files(one, two, ".csv", &count));
  assert_int_equal(count, 1);
  snprintf(one, sizeof one, "out/%s-baseline/frames", scene);
  snprintf(two, sizeof two, "out/%s-%s/frames", scene, level);
  assert_true(same_files(one, two, ".vtu", &count));
  assert_true(count >= 4);
}

static void runs_leave_the_same_bytes(void **state) {
  (void)state;
  char all[sizeof scenes / sizeof *scenes][64];
  for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++) {
    int count = 1;
    write_scene(i);
    run_at(scenes[i].name, levels[0], all[i]);
    for (int l = 1; l < LEVELS; l++) {
      char hash[64];
      if (ep_isa_check(levels[l]) != EP_OK) continue;
      run_at(scenes[i].name, levels[l], hash);
      assert_string_equal(hash, all[i]);
      same_bytes(scenes[i].name, levels[l]);
      count++;
    }
    print_message("%-15s %s on %d levels\n", scenes[i].name, all[i], count);
  }
  // Hashes tell scenes apart: each of these moves in a way of its own.
  for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++)
    for (size_t j = 0; j < i; j++) assert_string_not_equal(all[i], all[j]);
}

static void unknown_kernels_are_refused_before_the_bake(void **state) {
  (void)state;
  write_scene(0);
  assert_int_equal(program("", "run cubature.yaml --cache never --kernels sse9"), EP_ERR_ARGUMENT);
  char *said = text_of("err.txt");
  assert_non_null(strstr(said, "--kernels sse9: there are baseline, avx2 and avx512"));
  free(said);
  assert_int_not_equal(shell("test -e never"), 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(runs_leave_the_same_bytes),
      cmocka_unit_test(unknown_kernels_are_refused_before_the_bake),
  };
  return cmocka_run_group_tests(tests, setup, NULL);
}
