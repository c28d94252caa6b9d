// What a state carries from step to step. Claim: a state that takes the history of another goes on
// with the same bits, with every integrator, with examples, while it unfolds and under contact-free
// loads, whatever it did before; q and velocity alone would not do (the claim is not trivial); a
// list that is too short, foreign or not finite is refused and changes nothing.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/state.h"
#include "tests/reduced/bar.h"

enum { R = 20 };

static double *history_of(const ep_state *s, size_t *count) {
  *count = ep_state_history_size(s);
  double *list = malloc(*count * sizeof *list);
  if (!list) abort();
  ep_state_get_history(s, list);
  return list;
}

typedef enum start { CALM, FOLDED } start;

static void put(bar *b, start how, ep_state *s) {
  if (how == CALM) {
    bar_random_q(b, 0.3, ep_state_q(s));
    bar_random_q(b, 5, ep_state_velocity(s));
    return;
  }
  // far along random modes: most guards are turned over
  for (int i = 0; i < 50 && 4 * bar_inverted(b, ep_state_q(s)) < 3 * b->model.size.nt; i++)
    bar_random_q(b, 40, ep_state_q(s));
}

// Whether q and velocity alone would have gone on the same.
static int goes_on(const bar *b, ep_state *s, const ep_step_def *def, int steps) {
  void *block, *plain_block;
  ep_state *copy = bar_state(b, &block), *plain = bar_state(b, &plain_block);
  size_t count, end;
  double *list = history_of(s, &count);
  assert_int_equal(ep_state_set_history(copy, count, list), EP_OK);
  memcpy(ep_state_q(plain), ep_state_q(s), R * sizeof(double));
  memcpy(ep_state_velocity(plain), ep_state_velocity(s), R * sizeof(double));
  for (int i = 0; i < steps; i++) {
    ep_step_report one, two;
    assert_int_equal(ep_step(s, def, &one), EP_OK);
    assert_int_equal(ep_step(copy, def, &two), EP_OK);
    assert_int_equal(one.newton_iterations, two.newton_iterations);
    if (ep_step(plain, def, NULL) != EP_OK) break;
  }
  double *first = history_of(s, &end), *second = history_of(copy, &end);
  assert_int_equal(end, count);
  assert_memory_equal(first, second, end * sizeof *first);
  const int same = memcmp(ep_state_q(plain), ep_state_q(s), R * sizeof(double)) == 0;
  free(list);
  free(first);
  free(second);
  free(block);
  free(plain_block);
  return same;
}

static void the_copy_goes_on_the_same(void **state) {
  (void)state;
  static const ep_integrator integrator[] = {EP_IMPLICIT_EULER, EP_NEWMARK, EP_BDF2};
  for (int how = CALM; how <= FOLDED; how++)
    for (int i = 0; i < 3; i++) {
      bar *b = bar_create(8, 3, 3, R, 12, 4, 2, EP_STVK_VOLUME);
      bar_add_guards(b, b->model.size.nt, 0.3);
      void *block;
      ep_state *s = bar_state(b, &block);
      ep_step_def def = ep_default_step();
      ep_step_report report = {0};
      def.integrator = integrator[i];
      def.damping_stiffness = 0.02;
      put(b, (start)how, s);
      for (int n = 0; n < 3; n++) assert_int_equal(ep_step(s, &def, &report), EP_OK);
      assert_int_equal(report.unfolding, how == FOLDED);
      assert_int_equal(goes_on(b, s, &def, 10), 0);
      free(block);
      bar_free(b);
    }
}

// Nothing is left of what the state did before: one that unfolds takes the history of a calm one.
static void nothing_is_left_of_before(void **state) {
  (void)state;
  bar *b = bar_create(8, 3, 3, R, 12, 4, 2, EP_STVK_VOLUME);
  bar_add_guards(b, b->model.size.nt, 0.3);
  void *block, *other;
  ep_state *s = bar_state(b, &block), *calm = bar_state(b, &other);
  ep_step_def def = ep_default_step();
  ep_step_report report;
  put(b, FOLDED, s);
  bar_random_q(b, 0.1, ep_state_q(calm));
  for (int n = 0; n < 3; n++) assert_int_equal(ep_step(s, &def, &report), EP_OK);
  assert_int_equal(report.unfolding, 1);
  assert_int_equal(ep_step(calm, &def, NULL), EP_OK);
  size_t count;
  double *list = history_of(calm, &count);
  assert_int_equal(ep_state_set_history(s, count, list), EP_OK);
  for (int n = 0; n < 3; n++) {
    assert_int_equal(ep_step(s, &def, &report), EP_OK);
    assert_int_equal(ep_step(calm, &def, NULL), EP_OK);
  }
  assert_int_equal(report.unfolding, 0);
  assert_memory_equal(ep_state_q(s), ep_state_q(calm), R * sizeof(double));
  free(list);
  free(block);
  free(other);
  bar_free(b);
}

static void other_lists_are_refused(void **state) {
  (void)state;
  bar *b = bar_create(8, 3, 3, R, 12, 4, 2, EP_STVK_VOLUME);
  void *block;
  ep_state *s = bar_state(b, &block);
  size_t count;
  double *list = history_of(s, &count), *now;
  for (size_t i = 1; i <= R; i++) list[i] = 1; // q
  assert_int_equal(ep_state_set_history(s, count - 1, list), EP_ERR_ARGUMENT);
  list[count / 2] = NAN;
  assert_int_equal(ep_state_set_history(s, count, list), EP_ERR_ARGUMENT);
  list[count / 2] = 0, list[0] += 1;
  assert_int_equal(ep_state_set_history(s, count, list), EP_ERR_ARGUMENT);
  now = history_of(s, &count);
  for (size_t i = 1; i <= R; i++) assert_true(now[i] == 0);
  free(now);
  free(list);
  free(block);
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_copy_goes_on_the_same),
      cmocka_unit_test(nothing_is_left_of_before),
      cmocka_unit_test(other_lists_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
