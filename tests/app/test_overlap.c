// Claims: a scene whose object starts deeper in an obstacle than contact can push out is refused
// before anything is baked, in the same words by check, plan and run: which obstacle, where it
// stands in the file, how deep, how many vertices. Up to that depth it runs and comes out. Fixed
// vertices may stand in walls. Where a free object starts counts, not its mesh.
// The bar: 1 x 0.2 x 0.2 m from the origin; extent sqrt(1.08) = 1.039 m, 5 % of it 0.052 m.
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

#include "box.h"
#include "program.h"

static const char rest_of_scene[] =
    "schema: 1\nname: overlap\n"
    "object: {mesh: bar.veg, material: {model: stvk-volume, density: 1000, young: 2.0e5, poisson: "
    "0.4}}\n"
    "reduction: {modes: 10, linear_modes: 6, elements: 30, training_poses: 20, guards: 0}\n"
    "simulation: {dt: 0.0166666667, steps: 60, damping: {stiffness: 0.02}}\n"
    "output: {formats: []}\n";

static void write_scene(const char *obstacles, const char *more) {
  char text[2000];
  snprintf(text, sizeof text, "%sobstacles:\n%s%s", rest_of_scene, obstacles, more);
  write_box("bar.veg", 10, 2, 2, 1, 0, 0);
  write_text("overlap.yaml", text);
}

// Of both streams.
static bool is_said(const char *words) {
  char *out = text_of("out.txt"), *err = text_of("err.txt");
  const bool found = strstr(out, words) || strstr(err, words);
  free(out);
  free(err);
  return found;
}

static const char held[] = "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n";

// y low of the bar is 0: the top of the second obstacle stands at `top`.
static void write_two(double top, const char *more) {
  char obstacles[300];
  snprintf(obstacles, sizeof obstacles,
           "  - sphere: {center: [0.5, -3, 0], radius: 1}\n"
           "  - box: {low: [0.6, -1, -1], high: [0.8, %.4f, 1]}\n",
           top);
  write_scene(obstacles, more);
}

static void deep_starts_are_refused_alike(void **state) {
  (void)state;
  static const char *const commands[] = {"run overlap.yaml --cache cache --out out",
                                         "plan overlap.yaml --cache cache", "check overlap.yaml"};
  static const char *const free_or_held[] = {held, ""};
  for (size_t f = 0; f < 2; f++) {
    write_two(0.07, free_or_held[f]);
    for (size_t i = 0; i < 3; i++) {
      shell("rm -rf out");
      assert_int_equal(program("", "%s", commands[i]), i == 2 ? 10 : 5);
      assert_true(
          is_said("overlap.yaml:9:5: obstacles.1: the object starts 0.07 m deep in this box"));
      assert_true(is_said("vertices of its surface"));
      assert_true(is_said("at most 0.052 m (5 % of the object's extent)"));
      assert_true(is_said("`start.position`") == (f == 1));
      assert_false(is_said("step 1"));
    }
  }
}

// From where nothing touches to the limit, held and free: every step is done, nothing is left
// inside out, and contact's own depth remains (3 % covers the impact it begins with).
static void slight_ones_come_out(void **state) {
  (void)state;
  static const char *const free_or_held[] = {held, ""};
  for (size_t f = 0; f < 2; f++)
    for (int k = 0; k < 3; k++) {
      write_two(0.025 * k, free_or_held[f]);
      assert_int_equal(program("", "run overlap.yaml --json --cache cache --out out"), 0);
      json_t *root = report();
      assert_true(number(root, "steps_done") == 60 && number(root, "inverted_tets") == 0);
      assert_true(number(json_object_get(root, "contact"), "penetration_share") < 0.03);
      json_decref(root);
    }
}

static void walls_may_hold(void **state) {
  (void)state;
  write_scene("  - box: {low: [-1, -1, -1], high: [0.005, 1, 1]}\n", held);
  assert_int_equal(program("", "plan overlap.yaml --cache cache"), 0);
}

static void the_start_counts(void **state) {
  (void)state;
  // at home in the floor, but placed above it; at home above it, but placed into it; turned into it
  write_scene("  - plane: {point: [0, 0.15, 0], normal: [0, 1, 0]}\n",
              "start: {position: [0, 0.3, 0]}\n");
  assert_int_equal(program("", "plan overlap.yaml --cache cache"), 0);
  write_scene("  - plane: {point: [0, -0.05, 0], normal: [0, 1, 0]}\n",
              "start: {position: [0, -0.05, 0]}\n");
  assert_int_equal(program("", "plan overlap.yaml --cache cache"), 5);
  assert_true(is_said("0.1 m deep in this plane"));
  write_scene("  - plane: {point: [0, -0.05, 0], normal: [0, 1, 0]}\n",
              "start: {rotation: {axis: [0, 0, 1], degrees: 90}}\n");
  assert_int_equal(program("", "plan overlap.yaml --cache cache"), 5);
  assert_true(is_said("0.35 m deep in this plane"));
  // out by the command line, in by it
  assert_int_equal(program("", "plan overlap.yaml --cache cache --set "
                               "'obstacles.0.plane.point=[0, -0.5, 0]'"),
                   0);
  assert_int_equal(program("",
                           "plan overlap.yaml --cache cache --set 'obstacles.0={sphere: {center: "
                           "[0.5, 0.1, 0.1], radius: 0.3}}'"),
                   5);
  assert_true(is_said("--set obstacles.0: the object starts"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(deep_starts_are_refused_alike),
      cmocka_unit_test(slight_ones_come_out),
      cmocka_unit_test(walls_may_hold),
      cmocka_unit_test(the_start_counts),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
