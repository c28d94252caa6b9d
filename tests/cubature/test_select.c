// Claims. Columns of G computed when needed are A^T A. Greedy growth finds a planted sparse set in
// the noiseless case; its weights meet the KKT conditions of the set; the residual falls with every
// size; exchange never raises it and finds sets greedy alone does not; pruning removes what is
// missed least (compared with trying every removal).
#include "cubature/cubature.h"
#include "cubature/select.h"
#include "tests/bake/bar.h"

enum { N = 300, ROWS = 203 };

static const ep_growth all = {.shortlist = 64};

// Non-negative target: sum of `planted` columns with positive weights, plus noise.
static void make_system(ep_gram *gram, int planted, double noise, double common, uint64_t seed) {
  ep_random rng = ep_random_seed(seed, 1);
  ASSERT_OK(ep_gram_create(N, ROWS, gram, err));
  for (int e = 0; e < N; e++)
    for (int i = 0; i < ROWS; i++)
      gram->a[(size_t)e * (size_t)gram->stride + (size_t)i] =
          (1 + e % 5) * (ep_random_normal(&rng) + common * cos(0.1 * i));
  for (int i = 0; i < ROWS; i++) gram->b[i] = noise * ep_random_normal(&rng);
  for (int k = 0; k < planted; k++) {
    const int e = (7 * k + 3) % N;
    for (int i = 0; i < ROWS; i++)
      gram->b[i] +=
          (1 + k % 3) * gram->a[(size_t)e * (size_t)gram->stride + (size_t)i] / (1 + e % 5);
  }
  ASSERT_OK(ep_gram_prepare(gram, err));
}

static double product(const ep_gram *gram, int e, int f) {
  double sum = 0;
  for (int i = 0; i < gram->rows; i++)
    sum += gram->a[(size_t)e * (size_t)gram->stride + (size_t)i] *
           gram->a[(size_t)f * (size_t)gram->stride + (size_t)i];
  return sum;
}

static double true_residual(const ep_gram *gram, const ep_passive *set) {
  double squared = 0;
  for (int i = 0; i < gram->rows; i++) {
    double left = gram->b[i];
    for (int k = 0; k < set->count; k++)
      left -= set->x[k] * gram->a[(size_t)set->index[k] * (size_t)gram->stride + (size_t)i];
    squared += left * left;
  }
  return squared / gram->squared;
}

static void test_gram_columns(void **state) {
  (void)state;
  ep_gram gram;
  make_system(&gram, 5, 0.1, 0.3, 1);
  const int wanted[11] = {5, 17, 3, 299, 0, 1, 2, 50, 60, 70, 80};
  ASSERT_OK(ep_gram_need(&gram, 11, wanted, err));
  for (int k = 0; k < 11; k++)
    for (int e = 0; e < N; e++)
      ASSERT_NEAR(gram.column[wanted[k]][e], product(&gram, e, wanted[k]), 1e-13);
  assert_null(gram.column[4]);
  ep_gram_free(&gram);
}

static void test_planted(void **state) {
  (void)state;
  ep_gram gram;
  ep_passive set;
  make_system(&gram, 20, 0, 0.3, 2);
  ASSERT_OK(ep_passive_create(60, &set, err));
  ep_growth growth = all;
  growth.residual = 1e-20; // the planted set itself leaves round-off only
  ASSERT_OK(ep_select_grow(&gram, &growth, 40, &set, err));
  assert_in_range(set.count, 20, 30); // a few strangers may have come in on the way ..
  ASSERT_OK(ep_select_prune(&gram, 20, &set, err)); // .. and go again
  assert_int_equal(set.count, 20);
  for (int k = 0; k < set.count; k++) {
    const int e = set.index[k];
    assert_int_equal(e % 7, 3);
    const double weight = set.x[k] / gram.norm[e] * (1 + e % 5);
    ASSERT_NEAR(weight, 1 + (e / 7) % 3, 1e-9);
  }
  ep_passive_free(&set);
  ep_gram_free(&gram);
}

static void test_growth(void **state) {
  (void)state;
  ep_gram gram;
  ep_passive set;
  make_system(&gram, 100, 0.5, 0.3, 3);
  ASSERT_OK(ep_passive_create(80, &set, err));
  double before = 1;
  for (int size = 5; size <= 80; size += 15) {
    ASSERT_OK(ep_select_grow(&gram, &all, size, &set, err));
    assert_int_equal(set.count, size);
    const double residual = ep_selection_residual(&gram, &set);
    ASSERT_NEAR(residual, true_residual(&gram, &set), 1e-12);
    ASSERT_LESS(residual, before);
    before = residual;
    for (int k = 0; k < set.count; k++) { // stationary, and inside the bounds
      double w = gram.c[set.index[k]];
      for (int m = 0; m < set.count; m++)
        w -= product(&gram, set.index[k], set.index[m]) * set.x[m];
      ASSERT_NEAR(w / sqrt(gram.squared), 0, 1e-12);
      assert_true(set.x[k] > 0);
    }
  }
  ep_passive_free(&set);
  ep_gram_free(&gram);
}

static void test_exchange(void **state) {
  (void)state;
  double greedy = 0, exchanged = 0;
  for (uint64_t seed = 10; seed < 16; seed++) {
    ep_gram gram;
    ep_passive set;
    make_system(&gram, 100, 0.2, 0.5, seed);
    ASSERT_OK(ep_passive_create(60, &set, err));
    ASSERT_OK(ep_select_grow(&gram, &all, 30, &set, err));
    const double before = true_residual(&gram, &set);
    ASSERT_OK(ep_select_exchange(&gram, &all, 12, &set, err));
    assert_true(set.count <= 30);
    const double after = true_residual(&gram, &set);
    assert_true(after <= before);
    greedy += before;
    exchanged += after;
    ep_passive_free(&set);
    ep_gram_free(&gram);
  }
  ASSERT_LESS(exchanged, greedy);
}

// One removal by pruning against the best of all removals with a fresh fit.
static void test_prune(void **state) {
  (void)state;
  ep_gram gram;
  ep_passive set, trial;
  make_system(&gram, 60, 0.3, 0.3, 20);
  ASSERT_OK(ep_passive_create(40, &set, err));
  ASSERT_OK(ep_passive_create(40, &trial, err));
  ASSERT_OK(ep_select_grow(&gram, &all, 25, &set, err));
  double best = 1;
  for (int k = 0; k < set.count; k++) {
    ep_passive_copy(&trial, &set);
    ep_passive_remove(&trial, k);
    ep_passive_solve(&trial);
    best = fmin(best, true_residual(&gram, &trial));
  }
  ASSERT_OK(ep_select_prune(&gram, 24, &set, err));
  assert_int_equal(set.count, 24);
  ASSERT_NEAR(true_residual(&gram, &set), best, 1e-12);
  ep_passive_free(&set);
  ep_passive_free(&trial);
  ep_gram_free(&gram);
}

// 100 random candidates a round: repeatable for a seed, worse than looking at all.
static void test_pool(void **state) {
  (void)state;
  double residual[3];
  for (int run = 0; run < 3; run++) {
    ep_gram gram;
    ep_passive set;
    ep_random rng = ep_random_seed(run < 2 ? 5 : 6, 1);
    const ep_growth pool = {.pool = 20, .shortlist = 1, .random = &rng};
    make_system(&gram, 100, 0.2, 0.5, 30);
    ASSERT_OK(ep_passive_create(30, &set, err));
    ASSERT_OK(ep_select_grow(&gram, &pool, 30, &set, err));
    residual[run] = true_residual(&gram, &set);
    set.count = set.factor.n = 0;
    ASSERT_OK(ep_select_grow(&gram, &all, 30, &set, err));
    ASSERT_LESS(true_residual(&gram, &set), residual[run]);
    ep_passive_free(&set);
    ep_gram_free(&gram);
  }
  assert_true(residual[0] == residual[1] && residual[0] != residual[2]);
}

static void test_bad_input(void **state) {
  (void)state;
  ep_gram gram;
  ep_passive set;
  make_system(&gram, 10, 0, 0.3, 40);
  ASSERT_OK(ep_gram_prepare(&gram, err));
  ASSERT_OK(ep_passive_create(30, &set, err));
  ASSERT_OK(ep_select_grow(&gram, &all, 30, &set, err));
  ep_error failure = {0};
  assert_int_equal(ep_select_grow(&gram, &all, 31, &set, &failure), EP_ERR_ARGUMENT);
  gram.a[8 * (size_t)gram.stride] = NAN;
  failure = (ep_error){0};
  assert_int_equal(ep_gram_prepare(&gram, &failure), EP_ERR_NUMERIC);
  assert_non_null(strstr(failure.text, "element 8"));
  ep_passive_free(&set);
  ep_gram_free(&gram);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_gram_columns), cmocka_unit_test(test_planted),
      cmocka_unit_test(test_growth),       cmocka_unit_test(test_exchange),
      cmocka_unit_test(test_prune),        cmocka_unit_test(test_pool),
      cmocka_unit_test(test_bad_input),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
