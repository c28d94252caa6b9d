// Claims: a push is 0 outside from..until, 1 inside, linear over the ramps; the median is the
// middle value; the fraction of an example is the projection q . q_ex / |q_ex|^2.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/run/loads.h"
#include "app/run/simulate.h"

static void profile_is_a_trapezoid(void **state) {
  (void)state;
  const ep_load push = {.from = 1, .until = 3, .ramp = 0.5};
  const double t[] = {0, 0.999, 1, 1.25, 1.5, 2, 2.5, 2.75, 3, 3.001};
  const double expected[] = {0, 0, 0, 0.5, 1, 1, 1, 0.5, 0, 0};
  for (int i = 0; i < 10; i++)
    assert_true(fabs(ep_load_profile(&push, t[i]) - expected[i]) < 1e-12);
  const ep_load step = {.from = 1, .until = 3};
  assert_true(ep_load_profile(&step, 1) == 1 && ep_load_profile(&step, 0.5) == 0);
  const ep_load gravity = {.gravity = true};
  assert_true(ep_load_profile(&gravity, 1e6) == 1);
}

static void median_is_the_middle(void **state) {
  (void)state;
  const double odd[] = {5, 1, 3}, even[] = {4, 1, 3, 2};
  assert_true(ep_median(3, odd) == 3);
  assert_true(ep_median(4, even) == 2.5);
  assert_true(ep_median(0, odd) == 0);
  assert_true(odd[0] == 5);
}

static void fraction_is_the_projection(void **state) {
  (void)state;
  const double examples[] = {2, 0, 0, /**/ 1, 1, 0}, q[] = {1, 3, 7};
  const ep_model model = {.size = {.r = 3, .k = 2}, .example_q = examples};
  assert_true(ep_example_fraction(&model, q, 0) == 0.5);
  assert_true(ep_example_fraction(&model, q, 1) == 2);
  assert_true(ep_example_fraction(&model, examples, 0) == 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(profile_is_a_trapezoid),
      cmocka_unit_test(median_is_the_middle),
      cmocka_unit_test(fraction_is_the_projection),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
