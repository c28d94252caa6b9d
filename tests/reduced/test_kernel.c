// Cubature sums: lanes equal the scalar sum over elements; all instruction-set levels give the same
// bits; f = dW/dq and K = df/dq (slope 2); no force at rest; E(example, example) = 0; K +
// projection is positive semidefinite. Shapes include r and s that fill no lane.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/kernel.h"
#include "tests/reduced/bar.h"
#include "tests/reduced/vectors.h"

enum { R = 32 }; // room for the largest r used here

// Sums of up to 540 terms in another order: a few 1e-15 relative to the norm; 1e-12 leaves room for
// the cancellation in neo-Hookean stress near rest.
static void compare(const bar *b, double amplitude, int project) {
  const int r = b->model.size.r;
  double q[R], f[R], k[R * R], fr[R], kr[R * R], w[1] = {1};
  void *block;
  ep_state *state = bar_state(b, &block);
  bar_random_q((bar *)b, amplitude, q);
  double e = ep_elastic_energy(state, q, f, k, project);
  double er = bar_reference(b, NULL, b->model.cubature_w, q, fr, kr, project);
  assert_true(er > 0 && fabs(e - er) < 1e-12 * er);
  assert_true(distance_of(r, f, fr) < 1e-12 * norm_of(r, fr));
  assert_true(distance_of(r * r, k, kr) < 1e-12 * norm_of(r * r, kr));
  e = ep_example_energy(state, w, q, f, k, project);
  er = bar_reference(b, b->model.example_finv, b->model.example_w, q, fr, kr, project);
  assert_true(fabs(e - er) < 1e-12 * er);
  assert_true(distance_of(r, f, fr) < 1e-12 * norm_of(r, fr));
  assert_true(distance_of(r * r, k, kr) < 1e-12 * norm_of(r * r, kr));
  for (int i = 0; i < r; i++)
    for (int j = 0; j < i; j++) assert_true(k[i * r + j] == k[j * r + i]);
  free(block);
}

static void lanes_equal_the_scalar_sum(void **state) {
  (void)state;
  const int shape[4][2] = {{30, 60}, {5, 13}, {9, 3}, {24, 0}};
  for (int material = 0; material < EP_MATERIALS; material++) {
    for (int i = 0; i < 4; i++) {
      bar *b = bar_create(4, 2, 1, shape[i][0] > 24 ? 30 : shape[i][0],
                          shape[i][1] > 48 ? 48 : shape[i][1], 4, 1, material);
      compare(b, 0.3, 0);
      compare(b, 1.8, 0); // crushed and inverted elements
      compare(b, 1.8, 1);
      bar_free(b);
    }
  }
}

// One task, all kernels this processor runs.
static void levels_give_the_same_bits(void **state) {
  (void)state;
  const int count = ep_isa_here() + 1;
  if (count == 1) {
    print_message("only the baseline kernel runs on this processor: nothing to compare\n");
    skip();
  }
  for (int material = 0; material < EP_MATERIALS; material++) {
    bar *b = bar_create(4, 2, 1, 30, 45, 4, 2, material);
    const size_t words = 32 + 32 * 32 + 32;
    double *memory =
        aligned_alloc(64, sizeof(double) * ((size_t)ep_kernel_scratch(4, 0) + 4 * words));
    assert_non_null(memory);
    double *q = memory, *scratch = memory + 4 * words;
    for (int a = 0; a < 32; a++) q[a] = 0;
    bar_random_q(b, 1.5, q);
    double energy[3][2];
    for (int i = 0; i < count; i++) {
      ep_kernel_term term[2] = {
          {.scale = 1, .weight = b->model.cubature_w},
          {.scale = 0.7, .inverse = b->model.example_finv, .weight = b->model.example_w}};
      double *f = memory + (size_t)(i + 1) * words;
      ep_kernel_task task = {30,
                             45,
                             4,
                             material,
                             b->model.cubature_g,
                             b->model.cubature_lambda,
                             b->model.cubature_mu,
                             2,
                             term,
                             q,
                             f,
                             f + 32,
                             0,
                             scratch,
                             NULL};
      ep_kernel_of((ep_isa)i)(&task);
      energy[i][0] = term[0].energy, energy[i][1] = term[1].energy;
      assert_memory_equal(f, memory + words, (32 + 32 * 32) * sizeof(double));
      assert_memory_equal(energy[i], energy[0], sizeof energy[0]);
    }
    free(memory);
    bar_free(b);
  }
}

static void rest_has_no_force(void **state) {
  (void)state;
  for (int material = 0; material < EP_MATERIALS; material++) {
    bar *b = bar_create(4, 2, 2, 20, 0, 4, 1, material);
    void *block;
    ep_state *s = bar_state(b, &block);
    double q[R] = {0}, f[R], k[R * R];
    assert_true(ep_elastic_energy(s, q, f, k, 0) == 0);
    assert_true(norm_of(20, f) == 0); // F = I exactly: no round-off either
    // lambda varies over the cubature, K0 has one: compare norms only roughly, and definiteness
    assert_true(k[0] > 0.5 * b->model.k0[0] && k[0] < 2 * b->model.k0[0]);
    free(block);
    bar_free(b);
  }
}

static void example_is_its_own_minimum(void **state) {
  (void)state;
  for (int material = 0; material < EP_MATERIALS; material++) {
    bar *b = bar_create(4, 2, 1, 20, 30, 4, 2, material);
    void *block;
    ep_state *s = bar_state(b, &block);
    double f[R], other[R], w[2] = {0, 1}, q[R] = {0};
    ep_elastic_energy(s, b->model.example_q + 20, other, NULL, 0); // a force of usual size
    // F F^-1 = I to a few 1e-16: forces of that strain, energies of its square
    assert_true(ep_example_energy(s, w, b->model.example_q + 20, f, NULL, 0) < 1e-20);
    assert_true(norm_of(20, f) < 1e-12 * norm_of(20, other));
    assert_true(ep_example_energy(s, w, q, f, NULL, 0) > 1); // and it costs to leave it
    free(block);
    bar_free(b);
  }
}

typedef double (*energy_function)(ep_state *, const double *, double *, double *);
static double elastic(ep_state *s, const double *q, double *f, double *k) {
  return ep_elastic_energy(s, q, f, k, 0);
}
static double target(ep_state *s, const double *q, double *f, double *k) {
  const double w[3] = {0.2, 0.5, 0.3};
  return ep_target_energy(s, w, q, f, k, 0);
}

// Errors of central differences along a random direction, summed over poses, at two steps.
static void derivative_errors(bar *b, ep_state *s, energy_function energy, double h,
                              double error[2]) {
  const int r = b->model.size.r;
  double q[R], d[R], a[R], c[R], f[R], fa[R], fc[R], k[R * R];
  bar_random_q(b, 0.4, q);
  bar_random_q(b, 1, d);
  for (int i = 0; i < r; i++) a[i] = q[i] + h * d[i], c[i] = q[i] - h * d[i];
  energy(s, q, f, k);
  double slope = (energy(s, a, fa, NULL) - energy(s, c, fc, NULL)) / (2 * h);
  for (int i = 0; i < r; i++) {
    slope -= f[i] * d[i];
    fa[i] = (fa[i] - fc[i]) / (2 * h);
    for (int j = 0; j < r; j++) fa[i] -= k[i * r + j] * d[j];
  }
  error[0] += fabs(slope);
  error[1] += norm_of(r, fa);
}

static void derivatives_have_slope_two(void **state) {
  (void)state;
  const energy_function energies[2] = {elastic, target};
  for (int material = 0; material < EP_MATERIALS; material++) {
    bar *b = bar_create(4, 2, 1, 12, 30, 4, 2, material);
    void *block;
    ep_state *s = bar_state(b, &block);
    for (int e = 0; e < 2; e++) {
      double coarse[2] = {0}, fine[2] = {0};
      for (int pose = 0; pose < 10; pose++) {
        const uint32_t seed = b->seed;
        derivative_errors(b, s, energies[e], 1e-2, coarse);
        b->seed = seed; // the same pose again
        derivative_errors(b, s, energies[e], 1e-3, fine);
      }
      for (int i = 0; i < 2; i++) assert_true(fabs(log10(coarse[i] / fine[i]) - 2) < 0.1);
    }
    free(block);
    bar_free(b);
  }
}

// Lowest eigenvalue over |K| by power iteration on |K| I - K (an upper bound of it).
static double lowest_eigenvalue(int n, const double *k) {
  const double shift = norm_of(n * n, k);
  double x[R], y[R], value = 0;
  for (int i = 0; i < n; i++) x[i] = 1 + 0.1 * i;
  for (int round = 0; round < 5000; round++) {
    value = 0;
    for (int i = 0; i < n; i++) {
      y[i] = shift * x[i];
      for (int j = 0; j < n; j++) y[i] -= k[i * n + j] * x[j];
    }
    const double length = norm_of(n, y);
    for (int i = 0; i < n; i++) x[i] = y[i] / length;
    value = shift - length;
  }
  return value / shift;
}

// Compressed StVK is indefinite; with projected elements K never is.
static void projection_makes_stiffness_semidefinite(void **state) {
  (void)state;
  bar *b = bar_create(4, 2, 1, 12, 30, 4, 0, EP_STVK);
  void *block;
  ep_state *s = bar_state(b, &block);
  double q[R], k[R * R], lowest = 0;
  for (int pose = 0; pose < 20; pose++) {
    bar_random_q(b, 1.5, q);
    ep_elastic_energy(s, q, NULL, k, 0);
    lowest = fmin(lowest, lowest_eigenvalue(12, k));
    ep_elastic_energy(s, q, NULL, k, 1);
    assert_true(lowest_eigenvalue(12, k) > -1e-13);
  }
  assert_true(lowest < -1e-5); // the projection had something to do
  free(block);
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(lanes_equal_the_scalar_sum),
      cmocka_unit_test(levels_give_the_same_bits),
      cmocka_unit_test(rest_has_no_force),
      cmocka_unit_test(example_is_its_own_minimum),
      cmocka_unit_test(derivatives_have_slope_two),
      cmocka_unit_test(projection_makes_stiffness_semidefinite),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
