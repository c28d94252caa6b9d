// The frame of examples/drag.c, which engines copy. Claims: where a step does not converge the
// frame is done in two halves, dt and the mouse's way halved alike, the second half from where the
// first one ends; what is returned is how far the state has gone, also where a half fails. The run
// time's step is replaced by one that fails when it is told to.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "reduced/eigenpose.h"
#include "reduced/spring.h"
#include "tests/near.h"

enum { CALLS = 8 };
static int calls;
static ep_status answer[CALLS];
static double dt_of[CALLS], from_of[CALLS], to_of[CALLS]; // the mouse along y

static ep_status told_step(ep_state *state, const ep_step_def *def, ep_step_report *report) {
  (void)state;
  (void)report;
  assert_true(calls < CALLS);
  const ep_springs *springs = def->outer_user;
  assert_true(springs->dt == def->dt);
  dt_of[calls] = def->dt;
  from_of[calls] = springs->spring[0].from[1];
  to_of[calls] = springs->spring[0].to[1];
  return answer[calls++];
}

static void told_begin(const ep_state *state, double dt, ep_springs *springs) {
  (void)state;
  springs->dt = dt;
}

int drag_main(int argc, char **argv);
#define ep_step          told_step
#define ep_springs_begin told_begin
#define main             drag_main
#include "examples/drag.c"
#undef main

static double run(ep_status first, ep_status second, ep_status third) {
  static const double from[3] = {0, 1, 0}, to[3] = {0, 3, 0};
  ep_spring spring = {.stiffness = 1};
  ep_springs springs = {1, &spring, 0};
  ep_step_def def = {.outer_user = &springs};
  calls = 0;
  answer[0] = first;
  answer[1] = second;
  answer[2] = third;
  return advance(NULL, &def, &springs, from, to, 0.5);
}

static void check(int call, double dt, double from, double to) {
  ASSERT_NEAR(dt_of[call], dt, 1e-15); // halves and sums of small integers: exact
  ASSERT_NEAR(from_of[call], from, 1e-15);
  ASSERT_NEAR(to_of[call], to, 1e-15);
}

static void a_frame_is_one_step(void **state) {
  (void)state;
  ASSERT_NEAR(run(EP_OK, EP_OK, EP_OK), 0.5, 1e-15);
  assert_int_equal(calls, 1);
  check(0, 0.5, 1, 3);
}

static void halves_share_the_way(void **state) {
  (void)state;
  ASSERT_NEAR(run(EP_ERR_NUMERIC, EP_OK, EP_OK), 0.5, 1e-15);
  assert_int_equal(calls, 3);
  check(1, 0.25, 1, 2);
  check(2, 0.25, 2, 3);
}

static void failures_say_where_the_state_is(void **state) {
  (void)state;
  ASSERT_NEAR(run(EP_ERR_NUMERIC, EP_ERR_NUMERIC, EP_OK), 0, 1e-15);
  assert_int_equal(calls, 2);
  ASSERT_NEAR(run(EP_ERR_NUMERIC, EP_OK, EP_ERR_NUMERIC), 0.25, 1e-15);
  assert_int_equal(calls, 3);
  ASSERT_NEAR(run(EP_ERR_ARGUMENT, EP_OK, EP_OK), 0, 1e-15); // halves would not help
  assert_int_equal(calls, 1);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_frame_is_one_step),
      cmocka_unit_test(halves_share_the_way),
      cmocka_unit_test(failures_say_where_the_state_is),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
