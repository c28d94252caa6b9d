// Constitutive laws: P = dpsi/dF and H = dP/dF (central differences, error of order h^2: slope
// 2), symmetric tangents, psi(Q F) = psi(F) for rotations Q, Hooke's law at small strain, and no
// cancellation: psi at strains of 1e-9 is right to many digits.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/material.h"
#include "tests/reduced/vectors.h"

static uint32_t seed = 1;
static double uniform(void) { // [-1, 1), a fixed sequence
  seed = seed * 1664525u + 1013904223u;
  return (double)seed / 2147483648.0 - 1;
}

static void random_gradient(double amplitude, double f[9]) {
  for (int i = 0; i < 9; i++) f[i] = (i % 4 == 0) + amplitude * uniform();
}

static void multiply(const double a[9], const double b[9], double c[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

static const double lambda = 1.7, mu = 0.6;

// Error of the central difference of energy against stress in direction d, step h.
static double stress_error(ep_material model, const double f[9], const double d[9], double h) {
  double a[9], b[9], p[9], exact = 0;
  for (int i = 0; i < 9; i++) a[i] = f[i] + h * d[i], b[i] = f[i] - h * d[i];
  ep_material_stress(model, lambda, mu, f, p);
  for (int i = 0; i < 9; i++) exact += p[i] * d[i];
  double difference =
      ep_material_energy(model, lambda, mu, a) - ep_material_energy(model, lambda, mu, b);
  return fabs(difference / (2 * h) - exact);
}

static double tangent_error(ep_material model, const double f[9], const double d[9], double h) {
  double a[9], b[9], pa[9], pb[9], t[81];
  for (int i = 0; i < 9; i++) a[i] = f[i] + h * d[i], b[i] = f[i] - h * d[i];
  ep_material_tangent(model, lambda, mu, f, t);
  ep_material_stress(model, lambda, mu, a, pa);
  ep_material_stress(model, lambda, mu, b, pb);
  for (int i = 0; i < 9; i++) {
    pa[i] = (pa[i] - pb[i]) / (2 * h);
    for (int j = 0; j < 9; j++) pa[i] -= t[9 * i + j] * d[j];
  }
  return norm_of(9, pa);
}

typedef double (*error_function)(ep_material, const double *, const double *, double);

// Slope of log(error) over log(h) between 2e-2 and 2e-3 (round-off is 1e-13 there, the error
// 1e-5 and more), errors summed over poses.
static double slope(error_function error, ep_material model) {
  double coarse = 0, fine = 0, f[9], d[9];
  for (int pose = 0; pose < 40; pose++) {
    random_gradient(0.25, f);
    for (int i = 0; i < 9; i++) d[i] = uniform();
    coarse += error(model, f, d, 2e-2);
    fine += error(model, f, d, 2e-3);
  }
  assert_true(coarse > 1e-5); // not trivially equal
  return log10(coarse / fine);
}

static void derivatives_have_slope_two(void **state) {
  (void)state;
  for (int model = 0; model < EP_MATERIALS; model++) {
    assert_true(fabs(slope(stress_error, model) - 2) < 0.1);
    assert_true(fabs(slope(tangent_error, model) - 2) < 0.1);
  }
}

// Crushed and inverted elements (J < 0.2): the plain branch of neo-Hookean, the volume penalty.
// The error of a wrong derivative does not fall with the step, of a right one it falls 100-fold per
// decade until round-off; inverted corotational elements curve sharply (two singular values nearly
// cancel), so a bound at one step alone would say little.
static void derivatives_hold_when_crushed(void **state) {
  (void)state;
  const double poses[4][9] = {{0.4, 0.1, 0, -0.1, 0.7, 0.1, 0.05, 0, 0.5},
                              {-0.6, 0.1, 0.2, 0, 0.9, 0.1, 0.1, 0.2, 1.1},
                              {0.3, 0.2, 0, 0.1, -0.4, 0, 0.1, 0, 0.9},
                              {1.5, 0.1, 0, 0, 0.2, 0.05, 0.1, 0, 0.3}};
  for (int model = 0; model < EP_MATERIALS; model++) {
    for (int i = 0; i < 4; i++) {
      double d[9];
      for (int c = 0; c < 9; c++) d[c] = uniform();
      assert_true(stress_error(model, poses[i], d, 1e-4) < 1e-6);
      double coarse = tangent_error(model, poses[i], d, 1e-3);
      double fine = tangent_error(model, poses[i], d, 1e-4);
      assert_true(fine < 1e-9 || (fine < 1e-2 && fabs(log10(coarse / fine) - 2) < 0.1));
    }
  }
}

static void penalty_acts_below_half_the_volume(void **state) {
  (void)state;
  const double flat[9] = {1, 0, 0, 0, 1, 0, 0, 0, 0.4}, mild[9] = {1, 0, 0, 0, 1, 0, 0, 0, 0.6};
  double plain = ep_material_energy(EP_STVK, lambda, mu, flat);
  double with = ep_material_energy(EP_STVK_VOLUME, lambda, mu, flat);
  assert_true(fabs(with - plain - 5 * lambda * 0.01) < 1e-14);
  assert_true(ep_material_energy(EP_STVK_VOLUME, lambda, mu, mild) ==
              ep_material_energy(EP_STVK, lambda, mu, mild));
  // Poisson's ratio 0: the penalty must not vanish with lambda
  assert_true(ep_material_energy(EP_STVK_VOLUME, 0, mu, flat) >
              ep_material_energy(EP_STVK, 0, mu, flat));
}

static void tangent_is_symmetric(void **state) {
  (void)state;
  double f[9], h[81];
  for (int model = 0; model < EP_MATERIALS; model++) {
    random_gradient(0.6, f);
    ep_material_tangent(model, lambda, mu, f, h);
    for (int i = 0; i < 9; i++)
      for (int j = 0; j < i; j++) assert_true(fabs(h[9 * i + j] - h[9 * j + i]) < 1e-13);
  }
}

static void rotation_changes_nothing(void **state) {
  (void)state;
  double f[9], q[9], g[9], p[9], qp[9], pg[9];
  for (int model = 0; model < EP_MATERIALS; model++) {
    for (int pose = 0; pose < 50; pose++) {
      random_gradient(1, q);
      ep_material_rotation(q, q);
      random_gradient(0.4, f);
      multiply(q, f, g);
      double a = ep_material_energy(model, lambda, mu, f);
      double b = ep_material_energy(model, lambda, mu, g);
      assert_true(fabs(a - b) < 1e-13 * (1 + a)); // products of three factors of order 1
      ep_material_stress(model, lambda, mu, f, p);
      ep_material_stress(model, lambda, mu, g, pg);
      multiply(q, p, qp);
      for (int i = 0; i < 9; i++) assert_true(fabs(qp[i] - pg[i]) < 1e-12);
      assert_true(fabs(ep_material_energy(model, lambda, mu, q)) < 1e-25); // a rotation: no energy
    }
  }
}

// psi -> lambda/2 tr(e)^2 + mu e:e as the strain e -> 0, with relative error of order |e|: at 1e-9
// the plain form of neo-Hookean would be wrong in every digit.
static void small_strain_is_hooke(void **state) {
  (void)state;
  double f[9], a[9];
  for (int model = 0; model < EP_MATERIALS; model++) {
    for (int i = 0; i < 9; i++) a[i] = 1e-9 * uniform(), f[i] = (i % 4 == 0) + a[i];
    for (int i = 0; i < 9; i++) a[i] = f[i] - (i % 4 == 0); // what F really holds
    double t = a[0] + a[4] + a[8], square = 0;
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) square += pow(0.5 * (a[3 * i + j] + a[3 * j + i]), 2);
    double hooke = 0.5 * lambda * t * t + mu * square;
    double psi = ep_material_energy(model, lambda, mu, f);
    // R of the corotational law is known to 1e-16, a strain of 1e-9 to 1e-7
    assert_true(fabs(psi / hooke - 1) < (model == EP_COROTATIONAL ? 1e-6 : 1e-7));
  }
}

static void rotation_is_nearest(void **state) {
  (void)state;
  double f[9], r[9], turn[9], other[9];
  for (int pose = 0; pose < 200; pose++) {
    random_gradient(1.5, f); // many inverted
    ep_material_rotation(f, r);
    double gram[9], best = 0;
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++)
        gram[3 * i + j] = r[i] * r[j] + r[3 + i] * r[3 + j] + r[6 + i] * r[6 + j] - (i == j);
    assert_true(norm_of(9, gram) < 1e-13);
    double det = r[0] * (r[4] * r[8] - r[5] * r[7]) + r[1] * (r[5] * r[6] - r[3] * r[8]) +
                 r[2] * (r[3] * r[7] - r[4] * r[6]);
    assert_true(fabs(det - 1) < 1e-13);
    for (int i = 0; i < 9; i++) best += r[i] * f[i];
    for (int trial = 0; trial < 20; trial++) { // no rotation nearby or far is better
      random_gradient(trial < 10 ? 0.1 : 1, turn);
      ep_material_rotation(turn, turn);
      multiply(turn, r, other);
      double value = 0;
      for (int i = 0; i < 9; i++) value += other[i] * f[i];
      assert_true(value <= best + 1e-12);
    }
  }
}

// The projection P of a symmetric A: x^T P x >= 0, unchanged when A is semidefinite, and
// idempotent; P - A positive semidefinite and orthogonal to P (nearest point of the cone).
static void projection_is_nearest(void **state) {
  (void)state;
  double a[81], p[81], twice[81], product[81] = {0};
  for (int i = 0; i < 9; i++)
    for (int j = 0; j <= i; j++) a[9 * i + j] = a[9 * j + i] = uniform();
  memcpy(p, a, sizeof a);
  ep_material_project(p);
  memcpy(twice, p, sizeof p);
  ep_material_project(twice);
  double moved = 0;
  for (int i = 0; i < 81; i++) {
    moved += fabs(p[i] - a[i]);
    assert_true(fabs(twice[i] - p[i]) < 1e-13);
    for (int k = 0; k < 9; k++)
      product[i] += p[9 * (i / 9) + k] * (p[9 * k + i % 9] - a[9 * k + i % 9]);
  }
  assert_true(moved > 0.1);
  assert_true(norm_of(81, product) < 1e-12);
  for (int trial = 0; trial < 100; trial++) {
    double x[9], value = 0, gap = 0;
    for (int i = 0; i < 9; i++) x[i] = uniform();
    for (int i = 0; i < 81; i++) {
      value += x[i / 9] * p[i] * x[i % 9];
      gap += x[i / 9] * (p[i] - a[i]) * x[i % 9];
    }
    assert_true(value > -1e-12 && gap > -1e-12);
  }
}

static void names_are_complete(void **state) {
  (void)state;
  assert_string_equal(ep_material_name(EP_STVK_VOLUME), "stvk-volume");
  assert_null(ep_material_name(EP_MATERIALS));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(derivatives_have_slope_two),
      cmocka_unit_test(derivatives_hold_when_crushed),
      cmocka_unit_test(penalty_acts_below_half_the_volume),
      cmocka_unit_test(tangent_is_symmetric),
      cmocka_unit_test(rotation_changes_nothing),
      cmocka_unit_test(small_strain_is_hooke),
      cmocka_unit_test(rotation_is_nearest),
      cmocka_unit_test(projection_is_nearest),
      cmocka_unit_test(names_are_complete),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
