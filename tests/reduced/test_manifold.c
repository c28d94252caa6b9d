// The target is the shape of the example manifold nearest to the object (Zhao et al. 2018, eq. 1):
// a shape t(w) on the manifold is its own target, with its own weights, once the shift between the
// nonlinear interpolation (eq. 4) and the blend that eq. 5 measures is known.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/reduced/bar.h"
#include "tests/reduced/vectors.h"

enum { R = 12, EXAMPLES = 2 };

static void shape_on_manifold_is_its_own_target(void **unused) {
  (void)unused;
  bar *b = bar_create(6, 2, 2, R, 0, 4, EXAMPLES, EP_STVK_VOLUME);
  void *block;
  ep_state *state = bar_state(b, &block);
  const double wanted[EXAMPLES + 1] = {0.5, 0.3, 0.2};
  double shape[R] = {0};
  ep_target_report report;
  assert_int_equal(ep_target_newton(NULL, state, wanted, shape, 1e-10, &report), EP_OK);
  memcpy(ep_state_q(state), shape, sizeof shape);

  ep_step_def def = ep_default_step();
  def.target_tolerance = 1e-10;
  assert_int_equal(ep_interpolate(state, &def, NULL), EP_OK);
  const double first = distance_of(EXAMPLES, ep_state_weights(state), wanted + 1);
  assert_true(first > 0.005); // eq. 5 alone misses: else this test says nothing
  // Halving the error of the shift a round: 60 rounds leave round-off and the tolerance above.
  for (int i = 0; i < 60; i++) assert_int_equal(ep_interpolate(state, &def, NULL), EP_OK);
  assert_true(distance_of(EXAMPLES, ep_state_weights(state), wanted + 1) < 1e-6);
  assert_true(distance_of(R, ep_state_target(state), shape) < 1e-6 * norm_of(R, shape));
  free(block);
  bar_free(b);
}

// The rest shape and the examples are on the manifold as they are: no shift, at once.
static void corners_need_no_shift(void **unused) {
  (void)unused;
  bar *b = bar_create(6, 2, 2, R, 0, 4, EXAMPLES, EP_STVK_VOLUME);
  void *block;
  ep_state *state = bar_state(b, &block);
  ep_step_def def = ep_default_step();
  for (int i = 0; i <= EXAMPLES; i++) {
    double corner[R] = {0};
    if (i > 0) memcpy(corner, b->model.example_q + (i - 1) * R, sizeof corner);
    memcpy(ep_state_q(state), corner, sizeof corner);
    for (int round = 0; round < 3; round++) {
      assert_int_equal(ep_interpolate(state, &def, NULL), EP_OK);
      for (int e = 0; e < EXAMPLES; e++)
        assert_true(fabs(ep_state_weights(state)[e] - (e + 1 == i)) < 1e-7);
      assert_true(distance_of(R, ep_state_target(state), corner) < 1e-7);
    }
  }
  free(block);
  bar_free(b);
}

// The target of an object in motion is that of the place it will have reached by the step's end.
static void aimed_ahead(void **unused) {
  (void)unused;
  bar *b = bar_create(6, 2, 2, R, 0, 4, EXAMPLES, EP_STVK_VOLUME);
  void *moving_block, *still_block;
  ep_state *moving = bar_state(b, &moving_block), *still = bar_state(b, &still_block);
  ep_step_def def = ep_default_step();
  double direction[R];
  bar_random_q(b, 0.3, direction);
  for (int a = 0; a < R; a++) {
    const double begin = 0.4 * b->model.example_q[a], velocity = direction[a] / def.dt;
    ep_state_q(moving)[a] = begin;
    ep_state_velocity(moving)[a] = velocity;
    ep_state_q(still)[a] = begin + def.dt * velocity;
  }
  assert_int_equal(ep_interpolate(moving, &def, NULL), EP_OK);
  assert_int_equal(ep_interpolate(still, &def, NULL), EP_OK);
  assert_true(distance_of(R, ep_state_target(moving), ep_state_target(still)) == 0);
  // Not the target of where it is now.
  const double here[R] = {0};
  memcpy(ep_state_velocity(moving), here, sizeof here);
  assert_int_equal(ep_interpolate(moving, &def, NULL), EP_OK);
  assert_true(distance_of(R, ep_state_target(moving), ep_state_target(still)) > 0);
  free(moving_block);
  free(still_block);
  bar_free(b);
}

// A target that is found at the step's start and kept in it must not feed motion: an object that
// yields along its examples, let go on the way to one, swings less and less (by the damping of
// implicit Euler alone).
static void swinging_dies_out(void **unused) {
  (void)unused;
  bar *b = bar_create(6, 2, 2, R, 0, 4, EXAMPLES, EP_STVK_VOLUME);
  void *block;
  ep_state *state = bar_state(b, &block);
  ep_step_def def = ep_default_step();
  def.strength = 5;
  def.relief = 0.9;
  double swing[4] = {0}; // largest speed
  for (int a = 0; a < R; a++) ep_state_q(state)[a] = 0.6 * b->model.example_q[a];
  for (int i = 0; i < 1200; i++) {
    assert_int_equal(ep_step(state, &def, NULL), EP_OK);
    swing[i / 300] = fmax(swing[i / 300], norm_of(R, ep_state_velocity(state)));
  }
  if (!(swing[1] < 0.01 * swing[0] && swing[3] < 1e-6 * swing[0]))
    fail_msg("%g, %g, %g, %g", swing[0], swing[1], swing[2], swing[3]);
  free(block);
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(shape_on_manifold_is_its_own_target),
      cmocka_unit_test(corners_need_no_shift),
      cmocka_unit_test(aimed_ahead),
      cmocka_unit_test(swinging_dies_out),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
