// `eigenpose compare`. Claims:
//  - errors are what they are called: a run shifted by d everywhere has position error d over the
//    diagonal, a run with twice the speed velocity error 1;
//  - the recommendation is the fastest setting within an error budget, the most exact one within a
//    time budget, none where nothing fits; the crossover lies where two power laws meet;
//  - through the real program: the full space agrees with itself, errors fall with r, all elements
//    have no force error, cubature some; a second sweep takes every point from the cache, also
//    after one was lost; the table holds what the page shows; mistakes in the section are named;
//  - what is kept of a sweep is named by what it depends on, to the numbers in a list of vertices.
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
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/compare/compare.h"
#include "box.h"
#include "program.h"
#include "tests/near.h"

#define ASSERT_OK(call)                                                                            \
  do {                                                                                             \
    ep_error err_ = {0};                                                                           \
    ep_error *err = &err_;                                                                         \
    if ((call) != EP_OK) fail_msg("%s", err_.text);                                                \
  } while (0)

// ---- errors ------------------------------------------------------------------------------------

static void errors_are_what_they_say(void **state) {
  (void)state;
  ep_frames reference, run;
  ep_point point = {0};
  ASSERT_OK(ep_frames_make(3, 0.1, 6, 1, &reference, err));
  ASSERT_OK(ep_frames_make(3, 0.1, 6, 1, &run, err));
  for (int i = 0; i < 18; i++) {
    reference.x[i] = 0.1 * i;
    reference.v[i] = i % 6 < 3 ? 2 : 0; // speed 2 sqrt(3) of the first vertex
    run.x[i] = reference.x[i];
    run.v[i] = 2 * reference.v[i];
  }
  run.x[9] += 3, run.x[10] += 4; // second vertex of the second frame: 5 away
  for (int i = 0; i < 3; i++) reference.energy[i] = 10.0 * i, run.energy[i] = 10.0 * i - 1;
  ASSERT_OK(ep_compare_errors(&run, &reference, 50, &point, err));
  ASSERT_NEAR(point.position_error, 0.1, 1e-14);
  ASSERT_NEAR(point.error_at[0], 0, 0);
  ASSERT_NEAR(point.error_at[1], 0.1, 1e-14);
  ASSERT_NEAR(point.velocity_error, 1, 1e-14);
  ASSERT_NEAR(point.energy_error, 1.0 / 20, 1e-14);
  free(point.error_at);
  ep_frames_free(&reference);
  ep_frames_free(&run);
}

// ---- recommendation and crossover --------------------------------------------------------------

static const double R[3] = {10, 20, 40};

// Steps: cubature 2 r^2 [us], polynomials r^3 / 8: they meet at r = 16. Errors 1/r and 1.2/r.
static void make_comparison(ep_scene *scene, ep_point point[6], ep_comparison *c) {
  memset(scene, 0, sizeof *scene);
  scene->sweep.nmodes = 3;
  scene->sweep.nelements = 1;
  scene->sweep.elements[0] = 60;
  for (int i = 0; i < 3; i++) {
    scene->sweep.modes[i] = (int)R[i];
    point[2 * i] = (ep_point){.method = EP_METHOD_CUBATURE,
                              .r = (int)R[i],
                              .s = 60,
                              .solver = "",
                              .dt = 0.01,
                              .step_median_us = 2 * R[i] * R[i],
                              .position_error = 1.2 / R[i]};
    point[2 * i + 1] = (ep_point){.method = EP_METHOD_CUBIC,
                                  .r = (int)R[i],
                                  .solver = "",
                                  .dt = 0.01,
                                  .step_median_us = R[i] * R[i] * R[i] / 8,
                                  .position_error = 1 / R[i]};
  }
  *c = (ep_comparison){.scene = scene, .name = "power", .count = 6, .point = point};
}

static void crossover_of_power_laws(void **state) {
  (void)state;
  ep_scene scene;
  ep_point point[6];
  ep_comparison c;
  make_comparison(&scene, point, &c);
  ep_crossover x[EP_CROSSOVERS];
  char text[EP_CROSSOVER_TEXT];
  assert_int_equal(ep_compare_crossovers(&c, 60, x), 1);
  ASSERT_NEAR(x[0].r, 16, 1e-9);
  ep_compare_crossover_text(&c, 60, &x[0], text);
  assert_non_null(strstr(text, "overtakes the cubic polynomials at r = 16"));
  assert_int_equal(ep_compare_crossovers(&c, 30, x), 0); // not compared
  point[4].step_median_us = 16000;                       // slower again at the most modes
  assert_int_equal(ep_compare_crossovers(&c, 60, x), 1);
  assert_true(isnan(x[0].r));
  ep_compare_crossover_text(&c, 60, &x[0], text);
  assert_non_null(strstr(text, "not overtake"));
  assert_non_null(strstr(text, "at r = 40 its step takes 2 times"));
  for (int i = 0; i < 6; i += 2) point[i].step_median_us = 1; // faster everywhere
  assert_int_equal(ep_compare_crossovers(&c, 60, x), 1);
  ASSERT_NEAR(x[0].r, 10, 0);
  ep_compare_crossover_text(&c, 60, &x[0], text);
  assert_non_null(strstr(text, "the crossover lies below"));
}

// Floats are measured against floats: with polynomials twice as fast, 2 r^2 = r^3 / 16 at r = 32.
static void crossover_of_floats_is_their_own(void **state) {
  (void)state;
  ep_scene scene;
  ep_point point[12];
  ep_comparison c;
  make_comparison(&scene, point, &c);
  for (int i = 0; i < 6; i++) {
    point[6 + i] = point[i];
    point[6 + i].precision = EP_FLOAT;
    if (point[i].method == EP_METHOD_CUBIC) point[6 + i].step_median_us /= 2;
  }
  c.count = 12;
  ep_crossover x[EP_CROSSOVERS];
  assert_int_equal(ep_compare_crossovers(&c, 60, x), 2);
  assert_int_equal(x[0].precision, EP_DOUBLE);
  ASSERT_NEAR(x[0].r, 16, 1e-9);
  assert_int_equal(x[1].precision, EP_FLOAT);
  ASSERT_NEAR(x[1].r, 32, 1e-9);
}

static void budgets_decide(void **state) {
  (void)state;
  ep_scene scene;
  ep_point point[6];
  ep_comparison c;
  char why[256];
  make_comparison(&scene, point, &c);
  assert_int_equal(ep_compare_recommend(&c, why), -1);
  assert_string_equal(why, "");
  scene.sweep.budget_error = 0.07; // cubature 20: .06, 800 us; polynomials 20: .05, 1000 us
  assert_int_equal(ep_compare_recommend(&c, why), 2);
  assert_non_null(strstr(why, "fastest"));
  scene.sweep.budget_error = 0;
  scene.sweep.budget_seconds = 1.1e-3;
  assert_int_equal(ep_compare_recommend(&c, why), 3);
  assert_non_null(strstr(why, "most exact"));
  scene.sweep.budget_seconds = 1e-6;
  assert_int_equal(ep_compare_recommend(&c, why), -1);
  assert_non_null(strstr(why, "fewer modes"));
  point[1].failed = true; // never recommended
  scene.sweep.budget_seconds = 150e-6;
  assert_int_equal(ep_compare_recommend(&c, why), -1);
}

// ---- the program -------------------------------------------------------------------------------

static const char scene_text[] =
    "schema: 1\nname: beam\nobject: {mesh: beam.veg}\n"
    "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
    "families: [{poses: [beam-bent.veg]}]\n"
    "reduction: {eigenfunctions: 5, modes: 8, linear_modes: 5, path_samples: 2, elements: 12,\n"
    "  training_poses: 20, amplitude: 0.1}\n"
    "simulation: {dt: 0.02, steps: 20, damping: {mass: 0.5, stiffness: 0.05}}\n"
    "loads: [{push: {box: {low: [0.9, -1, -1], high: [2, 2, 2]}, force: [0, 6, 2], ramp: 0.1}}]\n"
    "compare: {modes: [4, 12], elements: [12], solvers: [newton, LD_SLSQP], budget: \"50 %\"}\n";

static int command(const char *rest) {
  return program("", "compare %s", rest);
}

static const json_t *point_with(const json_t *root, const char *method, int r, const char *solver,
                                const char *precision) {
  size_t i;
  json_t *p;
  json_array_foreach(json_object_get(root, "points"), i, p) {
    if (strcmp(json_string_value(json_object_get(p, "method")), method) == 0 &&
        (int)number(p, "r") == r &&
        strcmp(json_string_value(json_object_get(p, "solver")), solver) == 0 &&
        strcmp(json_string_value(json_object_get(p, "precision")), precision) == 0)
      return p;
  }
  fail_msg("no point %s r = %d %s", method, r, solver);
  return NULL;
}

static const json_t *point_of(const json_t *root, const char *method, int r, const char *solver) {
  return point_with(root, method, r, solver, "double");
}

static int lines_of(const char *text) {
  int lines = 0;
  for (; *text; text++) lines += *text == '\n';
  return lines;
}

static void check_sweep(const json_t *root) {
  const json_t *full = point_of(root, "full", 12, "newton");
  assert_true(number(full, "position_error") == 0 && number(full, "energy_error") == 0);
  const json_t *few = point_of(root, "all", 4, "newton");
  const json_t *many = point_of(root, "all", 12, "newton");
  assert_true(number(many, "position_error") < 0.8 * number(few, "position_error"));
  assert_true(number(few, "position_error") < 0.2);
  assert_true(number(many, "force_error") < 1e-12); // the same sums in another order
  const json_t *trained = point_of(root, "cubature", 12, "newton");
  assert_true(number(trained, "force_error") > 1e-6 && number(trained, "force_error") < 0.5);
  // floats store the gradients to 6e-8 of their size
  const json_t *floats = point_with(root, "cubature", 12, "newton", "float");
  assert_true(fabs(number(floats, "force_error") - number(trained, "force_error")) < 1e-5);
  assert_true(fabs(number(floats, "position_error") - number(trained, "position_error")) < 1e-5);
  // both solvers meet at the same minimum (relative gradient 1e-6)
  const json_t *slsqp = point_of(root, "all", 12, "LD_SLSQP");
  assert_true(fabs(number(slsqp, "position_error") - number(many, "position_error")) < 1e-5);
  // exact polynomials and all elements are one potential while nothing collapses
  const json_t *cubic = point_of(root, "cubic", 12, "newton");
  assert_true(number(cubic, "force_error") < 1e-10);
  assert_true(number(trained, "memory_bytes") < number(many, "memory_bytes"));
  assert_true(number(trained, "step_min_us") <= number(trained, "step_median_us"));
}

static int cached_points(const json_t *root) {
  size_t i;
  int cached = 0;
  json_t *p;
  json_array_foreach(json_object_get(root, "points"), i, p) cached +=
      json_is_true(json_object_get(p, "cached"));
  return cached;
}

static void the_program_compares(void **state) {
  (void)state;
  write_box("beam.veg", 6, 2, 2, 1.2, 0, 2e4);
  write_box("beam-bent.veg", 6, 2, 2, 1.2, 0.2, 0);
  write_text("beam.yaml", scene_text);
  if (system("rm -rf sweep-cache page")) fail_msg("cannot clean up");
  const char *call = "beam.yaml --json -q --cache sweep-cache --out page";
  if (command(call) != 0) fail_msg("%s", text_of("err.txt"));
  json_t *first = report();
  const int points = (int)json_array_size(json_object_get(first, "points"));
  assert_int_equal(points, 2 * 2 * 5 + 1); // r, solvers; cubature and cubic twice, all; full
  assert_int_equal(cached_points(first), 0);
  check_sweep(first);
  char *csv = text_of("page/results.csv"), *page = text_of("page/index.html");
  assert_int_equal(lines_of(csv), points + 1);
  assert_non_null(strstr(page, "<svg"));
  assert_non_null(strstr(page, "Recommended"));
  assert_null(strstr(page, "src=")); // nothing is fetched
  assert_null(strstr(page, "@import"));
  assert_true(ep_path_exists("page/chart.svg") && ep_path_exists("page/chart.png"));
  // resume: one point lost, the others stay
  if (system("rm $(ls sweep-cache/compare-*.ept | grep -v compare-run | head -1)"))
    fail_msg("no point in the cache");
  if (command(call) != 0) fail_msg("%s", text_of("err.txt"));
  json_t *second = report();
  assert_int_equal(cached_points(second), points - 1);
  ASSERT_NEAR(number(point_of(second, "all", 12, "newton"), "position_error"),
              number(point_of(first, "all", 12, "newton"), "position_error"), 1e-15);
  json_decref(first);
  json_decref(second);
  free(csv);
  free(page);
}

// The key of a point of beam.yaml with overrides.
static ep_digest key_of(int nsets, const char *const *sets) {
  ep_scene scene;
  ep_cache cache;
  ep_bench bench;
  const ep_frames frames = {.count = 10, .interval = 0.02};
  ASSERT_OK(ep_scene_read("beam.yaml", nsets, sets, &scene, err));
  ASSERT_OK(ep_cache_open("sweep-cache", &cache, err));
  const ep_point point = {.r = 8, .path = scene.methods, .material = scene.model, .solver = ""};
  ASSERT_OK(ep_bench_open(&scene, &point, &cache, NULL, &bench, err));
  const ep_digest key = ep_bench_key(&bench, "point", &frames);
  ep_bench_close(&bench);
  ep_scene_free(&scene);
  return key;
}

// A result kept under the name of a list is none of the list that was edited; strains of the
// Green-strain path count in their region, wherever that goes.
static void keys_follow_lists_and_regions(void **state) {
  (void)state;
  write_box("beam.veg", 6, 2, 2, 1.2, 0, 2e4);
  write_box("beam-bent.veg", 6, 2, 2, 1.2, 0.2, 0);
  write_text("beam.yaml", scene_text);
  const char *list[] = {"loads=[{push: {file: end.txt, force: [0, 6, 2]}}]"};
  write_text("end.txt", "60, 61\n");
  const ep_digest before = key_of(1, list);
  write_text("end.txt", "60, 62\n");
  const ep_digest edited = key_of(1, list);
  write_text("end.txt", "60, 61\n");
  const ep_digest again = key_of(1, list);
  assert_string_not_equal(before.hex, edited.hex);
  assert_string_equal(before.hex, again.hex);
  const char *region[] = {
      "examples.path=green",
      "families=[{poses: [beam-bent.veg], region: {box: {low: [0, -1, -1], high: [1, 1, 1]}}}]"};
  const ep_digest half = key_of(2, region);
  region[1] =
      "families=[{poses: [beam-bent.veg], region: {box: {low: [0, -1, -1], high: [0.5, 1, 1]}}}]";
  assert_string_not_equal(half.hex, key_of(2, region).hex);
}

static void mistakes_are_named(void **state) {
  (void)state;
  static const struct {
    const char *set, *expected;
  } cases[] = {
      {"compare.budget=fast", "compare.budget"},
      {"compare.budget=3 kg", "2 ms"},
      {"compare.dt=[0.02, 0.015]", "whole number of times"},
      {"compare.solvers=[GN_DIRECT]", "LD_LBFGS"},
      {"compare.modes=[4.5]", "whole number"},
      {"compare.methods=[magic]", "methods"},
      {"compare.reference=cubature", "full"},
      {"compare={materials: [corotational], methods: [cubic]}", "nothing to measure"},
  };
  write_box("beam.veg", 6, 2, 2, 1.2, 0, 2e4);
  write_box("beam-bent.veg", 6, 2, 2, 1.2, 0.2, 0);
  write_text("beam.yaml", scene_text);
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    char call[256];
    snprintf(call, sizeof call, "beam.yaml -q --cache sweep-cache --set '%s'", cases[i].set);
    assert_int_equal(command(call), EP_ERR_SCENE);
    char *said = text_of("err.txt");
    if (!strstr(said, cases[i].expected)) fail_msg("%s: %s", cases[i].set, said);
    free(said);
  }
}

// What a comparison does not measure is refused, not left out.
static void unknown_parts_are_refused(void **state) {
  (void)state;
  static const struct {
    const char *set, *expected;
  } cases[] = {
      {"obstacles=[{plane: {point: [0, -1, 0], normal: [0, 1, 0]}}]", "obstacles"},
      {"fixed=[]", "free objects"},
  };
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    char call[256];
    snprintf(call, sizeof call, "beam.yaml -q --cache sweep-cache --set families=[] --set '%s'",
             cases[i].set);
    assert_int_equal(command(call), EP_ERR_UNSUPPORTED);
    char *said = text_of("err.txt");
    if (!strstr(said, cases[i].expected)) fail_msg("%s: %s", cases[i].set, said);
    free(said);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(errors_are_what_they_say),
      cmocka_unit_test(crossover_of_power_laws),
      cmocka_unit_test(crossover_of_floats_is_their_own),
      cmocka_unit_test(keys_follow_lists_and_regions),
      cmocka_unit_test(budgets_decide),
      cmocka_unit_test(the_program_compares),
      cmocka_unit_test(mistakes_are_named),
      cmocka_unit_test(unknown_parts_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
