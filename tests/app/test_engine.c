// The run time in an engine (examples/drag.c, docs/engine.md). Claims: the model `bake --out`
// leaves is the cache's to the byte, and where it cannot go is said before anything is baked; the
// example takes it, in C and as C++ with the same output, and drags the picked vertex where its
// spring pulls; what is no model is refused with the reason.
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
#include "tests/near.h"

static const char scene_text[] =
    "schema: 1\nname: beam\nobject: {mesh: beam.veg}\n"
    "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
    "families: [{poses: [beam-bent.veg]}]\n"
    "reduction: {eigenfunctions: 5, modes: 8, linear_modes: 5, path_samples: 2, elements: 12,\n"
    "  training_poses: 20, amplitude: 0.1}\n";

static void bake(void) {
  write_box("beam.veg", 6, 2, 2, 1.2, 0, 2e4);
  write_box("beam-bent.veg", 6, 2, 2, 1.2, 0.2, 0);
  write_text("beam.yaml", scene_text);
  if (program("", "bake beam.yaml -q --cache baked --out beam.epm") != 0)
    fail_msg("%s", text_of("err.txt"));
}

static void the_model_is_copied(void **state) {
  (void)state;
  assert_int_equal(shell("rm -rf baked"), 0); // one model only: that of an earlier version is none
  bake();
  assert_int_equal(shell("cmp baked/model-*.epm beam.epm"), 0);
}

static void the_place_is_looked_at_before_the_bake(void **state) {
  (void)state;
  write_box("beam.veg", 6, 2, 2, 1.2, 0, 2e4);
  write_box("beam-bent.veg", 6, 2, 2, 1.2, 0.2, 0);
  write_text("beam.yaml", scene_text);
  static const char *const bad[] = {"nowhere/beam.epm", "folder", "beam.yaml/beam.epm"};
  assert_int_equal(shell("rm -rf early nowhere; mkdir -p folder"), 0);
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    assert_int_equal(program("", "bake beam.yaml -q --cache early --out %s", bad[i]), 2);
    char *said = text_of("err.txt");
    if (!strstr(said, i == 1 ? "folder is a folder" : i ? "beam.yaml is no folder" : "nowhere"))
      fail_msg("%s", said);
    free(said);
  }
  // nothing was baked, not even a first stage
  assert_int_equal(shell("test -z \"$(find early -type f 2>/dev/null)\""), 0);
}

// Two seconds: the mouse has gone 0.4 diagonals up, the beam (bent against its stiffness) follows.
static void the_example_drags(void **state) {
  (void)state;
  double rest[3], end[3], seconds;
  int vertex;
  bake();
  assert_int_equal(shell("%s beam.epm 2", EP_DRAG), 0);
  char *in_c = text_of("out.txt");
  assert_int_equal(sscanf(in_c, "vertex %d: at rest %lg %lg %lg, after %lg s %lg %lg %lg", &vertex,
                          &rest[0], &rest[1], &rest[2], &seconds, &end[0], &end[1], &end[2]),
                   8);
  ASSERT_NEAR(rest[0], 1.2, 1e-12); // the farthest along x
  const double way = 0.4 * sqrt(1.2 * 1.2 + 0.4 * 0.4 + 0.4 * 0.4);
  assert_true(end[1] - rest[1] > 0.5 * way && end[1] - rest[1] < 1.05 * way);
#ifdef EP_DRAG_CPP
  assert_int_equal(shell("%s beam.epm 2", EP_DRAG_CPP), 0);
  char *in_cpp = text_of("out.txt");
  assert_string_equal(in_c, in_cpp);
  free(in_cpp);
#endif
  free(in_c);
}

static void what_is_no_model_is_refused(void **state) {
  (void)state;
  bake();
  assert_int_equal(shell("%s beam.yaml", EP_DRAG), 1);
  char *said = text_of("err.txt");
  assert_non_null(strstr(said, "beam.yaml: "));
  free(said);
  assert_int_equal(shell("head -c 5000 beam.epm >cut.epm; %s cut.epm", EP_DRAG), 1);
  said = text_of("err.txt");
  assert_non_null(strstr(said, "cut.epm: "));
  free(said);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_model_is_copied),
      cmocka_unit_test(the_place_is_looked_at_before_the_bake),
      cmocka_unit_test(the_example_drags),
      cmocka_unit_test(what_is_no_model_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
