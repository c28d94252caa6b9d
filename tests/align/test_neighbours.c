// align/neighbours: the nearest point is the one all distances give, ties go to the lowest index,
// whatever the guess; also for points on a thin body in many dimensions.
#include <float.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/private.h"
#include "base/random.h"

// Points near a curved three-dimensional body in d dimensions.
static double *points_near_body(int n, int d, uint64_t seed) {
  ep_random rng = ep_random_seed(seed, 1);
  double *x = malloc((size_t)n * d * sizeof *x);
  assert_non_null(x);
  for (int i = 0; i < n; i++) {
    double u[3];
    for (int c = 0; c < 3; c++) u[c] = ep_random_uniform(&rng);
    for (int c = 0; c < d; c++)
      x[i * d + c] = cos((c + 1) * u[c % 3]) + 0.01 * ep_random_normal(&rng);
  }
  return x;
}

static double distance2(int d, const double *a, const double *b) {
  double sum = 0;
  for (int c = 0; c < d; c++) sum += (a[c] - b[c]) * (a[c] - b[c]);
  return sum;
}

static void compare_with_all_distances(int n, int count, int d) {
  double *points = points_near_body(n, d, 1), *queries = points_near_body(count, d, 2);
  int *nearest = malloc((size_t)count * sizeof *nearest),
      *guess = malloc((size_t)count * sizeof *guess);
  ep_error err = {0};
  ep_tree *tree;
  assert_int_equal(ep_tree_make(n, d, points, &tree, &err), EP_OK);
  for (int i = 0; i < count; i++) {
    nearest[i] = -1;
    guess[i] = (i * 7) % n;
  }
  ep_tree_nearest(tree, count, queries, nearest);
  ep_tree_nearest(tree, count, queries, guess);
  for (int i = 0; i < count; i++) {
    double best = DBL_MAX;
    for (int j = 0; j < n; j++) best = fmin(best, distance2(d, queries + i * d, points + j * d));
    // The same point up to the order of summation.
    assert_true(distance2(d, queries + i * d, points + nearest[i] * d) <= best * (1 + 1e-12));
    assert_int_equal(guess[i], nearest[i]);
  }
  ep_tree_free(tree);
  free(points);
  free(queries);
  free(nearest);
  free(guess);
}

static void agrees_with_all_distances(void **state) {
  (void)state;
  compare_with_all_distances(1, 3, 1);
  compare_with_all_distances(9, 20, 2);
  compare_with_all_distances(700, 300, 3);
  compare_with_all_distances(700, 300, 23);
  compare_with_all_distances(400, 200, 80);
}

static void ties_go_to_the_lowest_index(void **state) {
  (void)state;
  enum { N = 512 };
  double points[N * 3];
  int nearest[2] = {400, -1};
  ep_error err = {0};
  ep_tree *tree;
  for (int i = 0; i < N; i++) // every point eight times
    for (int c = 0; c < 3; c++) points[3 * i + c] = (i % 64) >> (2 * c) & 3;
  assert_int_equal(ep_tree_make(N, 3, points, &tree, &err), EP_OK);
  const double queries[6] = {0, 0, 0, 0.5, 0.5, 0.5}; // the second: eight corners at equal distance
  ep_tree_nearest(tree, 2, queries, nearest);
  assert_int_equal(nearest[0], 0);
  assert_int_equal(nearest[1], 0);
  ep_tree_free(tree);
}

static void refuses_nonsense(void **state) {
  (void)state;
  ep_error err = {0};
  ep_tree *tree;
  const double x = 0;
  assert_int_equal(ep_tree_make(0, 3, &x, &tree, &err), EP_ERR_ARGUMENT);
  err = (ep_error){0};
  assert_int_equal(ep_tree_make(1, 5000, &x, &tree, &err), EP_ERR_ARGUMENT);
  assert_null(tree);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(agrees_with_all_distances),
      cmocka_unit_test(ties_go_to_the_lowest_index),
      cmocka_unit_test(refuses_nonsense),
  };
  return cmocka_run_group_tests_name("align/neighbours", tests, NULL, NULL);
}
