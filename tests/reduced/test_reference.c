// What an element of a deformed shape is worth as undeformed material: for F = Q diag(s) P with
// rotations Q, P the weight is s0 s1 s2 min(1, min s / 0.7)^4, the inverse is exact, and flat or
// turned-over elements count for nothing.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "reduced/reference.h"

static void multiply(const double *a, const double *b, double *c) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

static void turn(double x, double y, double out[9]) {
  const double a[9] = {cos(x), -sin(x), 0, sin(x), cos(x), 0, 0, 0, 1};
  const double b[9] = {1, 0, 0, 0, cos(y), -sin(y), 0, sin(y), cos(y)};
  multiply(a, b, out);
}

static void make(const double s[3], double angle, double f[9]) {
  const double d[9] = {s[0], 0, 0, 0, s[1], 0, 0, 0, s[2]};
  double q[9], p[9], qd[9];
  turn(angle, 1.3 * angle, q);
  turn(2.1 - angle, 0.4 + angle, p);
  multiply(q, d, qd);
  multiply(qd, p, f);
}

static void weight_is_the_formula(void **unused) {
  (void)unused;
  const double stretches[][3] = {{1, 1, 1},     {1.4, 0.9, 0.75}, {0.71, 0.71, 0.71},
                                 {3, 0.5, 0.9}, {0.1, 2, 5},      {0.06, 0.06, 0.06}};
  for (size_t i = 0; i < sizeof stretches / sizeof *stretches; i++)
    for (int turns = 0; turns < 7; turns++) {
      const double *s = stretches[i];
      double f[9], inverse[9], product[9];
      make(s, turns, f);
      const double weight = ep_reference_element(f, inverse);
      const double share = fmin(1, fmin(s[0], fmin(s[1], s[2])) / 0.7);
      const double wanted = s[0] * s[1] * s[2] * pow(share, 4);
      // The eigenvalue of C carries round-off of (largest / smallest stretch)^2.
      assert_true(fabs(weight / wanted - 1) < 1e-11);
      multiply(f, inverse, product);
      for (int c = 0; c < 9; c++) assert_true(fabs(product[c] - (c % 4 == 0)) < 1e-12);
    }
}

static void useless_elements_count_for_nothing(void **unused) {
  (void)unused;
  const double stretches[][3] = {{1, 1, -1}, {1, 1, 0}, {0, 0, 0}, {1, 1, 0.049}, {-1, -1, -1}};
  for (size_t i = 0; i < sizeof stretches / sizeof *stretches; i++) {
    double f[9], inverse[9];
    make(stretches[i], 0.8, f);
    assert_true(ep_reference_element(f, inverse) == 0);
    for (int c = 0; c < 9; c++) assert_true(inverse[c] == (c % 4 == 0));
  }
  double f[9] = {NAN, 0, 0, 0, 1, 0, 0, 0, 1}, inverse[9];
  assert_true(ep_reference_element(f, inverse) == 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(weight_is_the_formula),
      cmocka_unit_test(useless_elements_count_for_nothing),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
