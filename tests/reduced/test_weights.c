// Example weights minimise 1/2 |sum w_i e_i - c|^2 over the simplex: feasible, and the KKT
// conditions hold: with g_i = e_i . (sum w e - c), g_i = w . g where w_i > 0, g_i >= w . g
// elsewhere. Also for many, equal and nearly dependent examples.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/reduced/bar.h"

enum { M = 6, K = 32, LENGTH = 3 * M };

typedef struct problem {
  bar *b;
  void *block;
  ep_state *state;
  double examples[K * LENGTH], c[LENGTH], w[K + 1];
} problem;

static void create(problem *p, int k) {
  p->b = bar_create(2, 1, 1, 6, 5, M, k, EP_STVK);
  for (int i = 0; i < k * LENGTH; i++) p->examples[i] = bar_uniform(p->b);
  p->b->model.example_c = p->examples;
  p->state = bar_state(p->b, &p->block);
}

static void destroy(problem *p) {
  free(p->block);
  bar_free(p->b);
}

static const double *shape(const problem *p, int i) {
  return i == 0 ? p->b->model.c0 : p->examples + (i - 1) * LENGTH;
}

// Largest violation of the KKT conditions, relative to the largest |e_i - c|^2.
static double violation(const problem *p) {
  const int count = p->b->model.size.k + 1;
  double x[LENGTH], g[K + 1], mean = 0, scale = 0, worst = 0, sum = 0;
  for (int d = 0; d < LENGTH; d++) {
    x[d] = -p->c[d];
    for (int i = 0; i < count; i++) x[d] += p->w[i] * shape(p, i)[d];
  }
  for (int i = 0; i < count; i++) {
    double square = 0;
    g[i] = 0;
    for (int d = 0; d < LENGTH; d++) {
      g[i] += (shape(p, i)[d] - p->c[d]) * x[d];
      square += pow(shape(p, i)[d] - p->c[d], 2);
    }
    scale = fmax(scale, square);
    mean += p->w[i] * g[i];
    sum += p->w[i];
    worst = fmax(worst, -p->w[i]);
  }
  worst = fmax(worst, fabs(sum - 1));
  for (int i = 0; i < count; i++)
    worst = fmax(worst, (p->w[i] > 0 ? fabs(g[i] - mean) : mean - g[i]) / scale);
  return worst;
}

// Gram entries carry 1e-16 of the scale, and the affine solves lose what their condition says.
static void random_problems_meet_kkt(void **state) {
  (void)state;
  int interior = 0, faces = 0;
  for (int k = 1; k <= K; k += k < 4 ? 1 : 7) {
    problem p;
    create(&p, k);
    for (int trial = 0; trial < 100; trial++) {
      const double reach = trial % 2 ? 1 : 0.2;
      for (int d = 0; d < LENGTH; d++) {
        p.c[d] = reach * bar_uniform(p.b);
        if (trial % 4 == 3) p.c[d] += 0.4 * shape(&p, k)[d] + 0.6 * shape(&p, 0)[d];
      }
      assert_int_equal(ep_example_weights(p.state, p.c, p.w), EP_OK);
      assert_true(violation(&p) < 1e-12);
      for (int i = 0; i <= k; i++) *(p.w[i] > 0 ? &interior : &faces) += 1;
    }
    destroy(&p);
  }
  assert_true(interior > 500 && faces > 500); // both kinds of constraints were met
}

static void a_shape_gets_all_weight_exactly(void **state) {
  (void)state;
  problem p;
  create(&p, 5);
  for (int i = 0; i <= 5; i++) {
    memcpy(p.c, shape(&p, i), sizeof p.c);
    assert_int_equal(ep_example_weights(p.state, p.c, p.w), EP_OK);
    for (int j = 0; j <= 5; j++) assert_true(p.w[j] == (i == j));
  }
  destroy(&p);
}

// A convex combination is found again: independent shapes, so the weights are unique.
static void combination_is_recovered(void **state) {
  (void)state;
  problem p;
  create(&p, 4);
  const double w[5] = {0.1, 0.4, 0, 0.3, 0.2};
  for (int d = 0; d < LENGTH; d++) {
    p.c[d] = 0;
    for (int i = 0; i < 5; i++) p.c[d] += w[i] * shape(&p, i)[d];
  }
  assert_int_equal(ep_example_weights(p.state, p.c, p.w), EP_OK);
  for (int i = 0; i < 5; i++) assert_true(fabs(p.w[i] - w[i]) < 1e-12);
  destroy(&p);
}

// Equal examples, examples on a line, examples 1e-9 apart (a pivot of 1e-18 of the scale, below
// round-off: the second one then counts as dependent, and the violation is at most its distance).
static void dependent_examples_do_no_harm(void **state) {
  (void)state;
  const double apart[4] = {0, 1e-12, 1e-9, 1e-6};
  for (int variant = 0; variant < 4; variant++) {
    problem p;
    create(&p, 32);
    for (int i = 8; i < 32; i++) { // pairs and midpoints of the first eight, nearly
      const double mix = i % 3 * 0.5;
      for (int d = 0; d < LENGTH; d++)
        p.examples[i * LENGTH + d] = mix * p.examples[i % 8 * LENGTH + d] +
                                     (1 - mix) * p.examples[(i + 3) % 8 * LENGTH + d] +
                                     apart[variant] * bar_uniform(p.b);
    }
    for (int trial = 0; trial < 50; trial++) {
      for (int d = 0; d < LENGTH; d++) p.c[d] = 0.5 * bar_uniform(p.b);
      assert_int_equal(ep_example_weights(p.state, p.c, p.w), EP_OK);
      assert_true(violation(&p) < 1e-8);
    }
    destroy(&p);
  }
}

static void no_examples_mean_rest(void **state) {
  (void)state;
  bar *b = bar_create(2, 1, 1, 6, 5, 0, 0, EP_STVK);
  void *block;
  ep_state *s = bar_state(b, &block);
  double w = 0;
  assert_int_equal(ep_example_weights(s, NULL, &w), EP_OK);
  assert_true(w == 1);
  free(block);
  bar_free(b);
}

static void not_finite_is_refused(void **state) {
  (void)state;
  problem p;
  create(&p, 2);
  memset(p.c, 0, sizeof p.c);
  p.c[3] = NAN;
  assert_int_equal(ep_example_weights(p.state, p.c, p.w), EP_ERR_NUMERIC);
  destroy(&p);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(random_problems_meet_kkt), cmocka_unit_test(a_shape_gets_all_weight_exactly),
      cmocka_unit_test(combination_is_recovered), cmocka_unit_test(dependent_examples_do_no_harm),
      cmocka_unit_test(no_examples_mean_rest),    cmocka_unit_test(not_finite_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
