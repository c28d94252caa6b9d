// The interpolation by NLopt reaches the same minimum as the built-in Newton: relative gradient
// 1e-6 for every algorithm offered, and equal points to what that gradient allows.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/bake/nlopt_target.h"
#include "tests/reduced/bar.h"

enum { R = 20, K = 2 };

static double difference(const double *a, const double *b) {
  double sum = 0, size = 0;
  for (int i = 0; i < R; i++) sum += (a[i] - b[i]) * (a[i] - b[i]), size += b[i] * b[i];
  return sqrt(sum / size);
}

static void same_minimum_as_newton(void **unused) {
  (void)unused;
  static const char *const algorithms[] = {NULL, "LD_LBFGS", "LD_SLSQP", "LD_VAR2",
                                           "LD_TNEWTON_PRECOND_RESTART"};
  const double w[K + 1] = {0.3, 0.4, 0.3};
  for (int material = 0; material < EP_MATERIALS; material++) {
    bar *b = bar_create(5, 2, 1, R, 40, 6, K, material);
    void *block;
    ep_state *s = bar_state(b, &block);
    double newton[R] = {0}, g[R];
    assert_int_equal(ep_target_newton(NULL, s, w, newton, 1e-9, NULL), EP_OK);
    for (size_t i = 0; i < sizeof algorithms / sizeof *algorithms; i++) {
      ep_nlopt_target *target;
      ep_error err = {0};
      ep_target_report report;
      double q[R] = {0};
      assert_int_equal(ep_nlopt_target_create(s, algorithms[i], 0, &target, &err), EP_OK);
      assert_int_equal(ep_nlopt_target_solve(target, s, w, q, 1e-6, &report), EP_OK);
      ep_target_energy(s, w, q, g, NULL, 0); // checked by an evaluation of our own
      assert_true(ep_target_residual(s, w, g) <= 1e-6);
      assert_true(report.evaluations > 2 && report.evaluations < 1000);
      // Hessian ~ identity in the scaled unknowns, softest direction not below 1e-2
      assert_true(difference(q, newton) < 1e-4);
      assert_int_equal(ep_nlopt_target_solve(target, s, w, q, 1e-6, &report), EP_OK);
      assert_int_equal(report.evaluations, 1); // warm on the minimum
      ep_nlopt_target_free(target);
    }
    free(block);
    bar_free(b);
  }
}

static void steps_agree(void **unused) {
  (void)unused;
  bar *b = bar_create(5, 2, 1, R, 40, 6, K, EP_STVK_VOLUME);
  void *block[2];
  ep_state *s[2] = {bar_state(b, &block[0]), bar_state(b, &block[1])};
  ep_nlopt_target *target;
  ep_error err = {0};
  double load[R], q[R];
  int evaluations = 0;
  bar_random_q(b, 0.3, q);
  ep_elastic_energy(s[0], q, load, NULL, 0);
  assert_int_equal(ep_nlopt_target_create(s[1], NULL, 0, &target, &err), EP_OK);
  for (int i = 0; i < 60; i++) {
    for (int j = 0; j < 2; j++) {
      ep_step_def def = ep_default_step();
      ep_step_report report;
      def.force = load, def.damping_stiffness = 0.005;
      if (j) def.target_solver = ep_nlopt_target_solve, def.target_user = target;
      assert_int_equal(ep_step(s[j], &def, &report), EP_OK);
      evaluations += report.target.evaluations;
    }
  }
  assert_true(evaluations > 100);
  assert_true(difference(ep_state_q(s[1]), ep_state_q(s[0])) < 1e-4); // 60 steps of 1e-6 each
  ep_nlopt_target_free(target);
  free(block[0]), free(block[1]);
  bar_free(b);
}

static void giving_up_is_said(void **unused) {
  (void)unused;
  bar *b = bar_create(5, 2, 1, R, 40, 6, K, EP_STVK_VOLUME);
  void *block;
  ep_state *s = bar_state(b, &block);
  const double w[K + 1] = {0.3, 0.4, 0.3};
  double q[R] = {0}, zero[R] = {0};
  ep_nlopt_target *target;
  ep_error err = {0};
  assert_int_equal(ep_nlopt_target_create(s, NULL, 3, &target, &err), EP_OK);
  assert_int_equal(ep_nlopt_target_solve(target, s, w, q, 1e-6, NULL), EP_ERR_NUMERIC);
  assert_memory_equal(q, zero, sizeof q);
  ep_nlopt_target_free(target);
  static const char *const bad[] = {"LN_COBYLA", "GN_DIRECT",    "nonsense",        "",
                                    "LD_AUGLAG", "LD_AUGLAG_EQ", "LD_LBFGS_NOCEDAL"};
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    err = (ep_error){0};
    assert_int_equal(ep_nlopt_target_create(s, bad[i], 0, &target, &err), EP_ERR_ARGUMENT);
    assert_null(target);
  }
  free(block);
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(same_minimum_as_newton),
      cmocka_unit_test(steps_agree),
      cmocka_unit_test(giving_up_is_said),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
