// What stands under the picture of a map. Claims: why a map is not good, or what the colours mean;
// a dot is said to be the landmark the reasons ask for only where that one is shown, which it is
// not beside landmarks given.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/maps/quality_json.h"

static const char *note(const char *reasons, int landmarks, int settle, int dots) {
  static char text[sizeof((ep_map_quality){0}.reasons) + 32];
  ep_map_quality q = {.landmarks = landmarks, .settle_from = settle, .settle_to = settle};
  snprintf(q.reasons, sizeof q.reasons, "%s", reasons);
  ep_map_note(&q, dots, text, sizeof text);
  return text;
}

static void dots_are_what_is_said(void **state) {
  (void)state;
  const char *asks = "frames fit; one landmark settles it: vertex 7";
  assert_string_equal(note("", 0, -1, 0), "same colour where mapped");
  assert_string_equal(note("", 6, -1, 6), "same colour where mapped; dots: landmarks");
  assert_string_equal(note("round trip 0.5", 0, -1, 0), "round trip 0.5");
  assert_string_equal(note(asks, 0, 6, 1),
                      "frames fit; one landmark settles it: vertex 7; dot: this landmark");
  assert_string_equal(note(asks, 2, 6, 2),
                      "frames fit; one landmark settles it: vertex 7; dots: landmarks");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(dots_are_what_is_said),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
