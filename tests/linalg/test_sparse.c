// Claims: the pattern of a mesh holds exactly the pairs that share a tet, ascending and symmetric,
// and products with it equal dense ones.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "linalg/sparse.h"
#include "tests/linalg/grid.h"

static int share_tet(const grid *g, int i, int j) {
  for (int t = 0; t < g->nt; t++) {
    int has_i = 0, has_j = 0;
    for (int c = 0; c < 4; c++) {
      has_i |= g->tet[4 * t + c] == i;
      has_j |= g->tet[4 * t + c] == j;
    }
    if (has_i && has_j) return 1;
  }
  return 0;
}

static void test_pattern(void **state) {
  (void)state;
  grid g = grid_make(3, 2, 2, 1, 1, 1);
  for (int block = 1; block <= 3; block += 2) {
    ep_csr a;
    ep_error err = {0};
    assert_int_equal(ep_csr_from_tets(g.nv, g.nt, g.tet, block, &a, &err), EP_OK);
    assert_int_equal(a.n, block * g.nv);
    for (int i = 0; i < a.n; i++) {
      for (int p = a.start[i] + 1; p < a.start[i + 1]; p++)
        assert_true(a.column[p - 1] < a.column[p]);
      for (int j = 0; j < a.n; j++) {
        const int at = ep_csr_find(&a, i, j);
        assert_int_equal(at >= 0, share_tet(&g, i / block, j / block));
        if (at >= 0) {
          assert_int_equal(a.column[at], j);
          assert_true(a.value[at] == 0);
        }
      }
    }
    ep_csr_free(&a);
    assert_null(a.value);
  }
  grid_free(&g);
}

static void test_multiply(void **state) {
  (void)state;
  grid g = grid_make(2, 2, 2, 1, 1, 1);
  ep_csr a;
  ep_error err = {0};
  assert_int_equal(ep_csr_from_tets(g.nv, g.nt, g.tet, 1, &a, &err), EP_OK);
  for (int p = 0; p < a.start[a.n]; p++) a.value[p] = cos(1.0 + p);
  for (int width = 1; width <= 5; width++) {
    double x[27 * 5], y[27 * 5];
    for (int i = 0; i < 27 * width; i++) x[i] = sin(2.0 * i);
    ep_csr_multiply(&a, width, x, y);
    for (int i = 0; i < 27; i++)
      for (int c = 0; c < width; c++) {
        double sum = 0;
        for (int j = 0; j < 27; j++) {
          const int at = ep_csr_find(&a, i, j);
          if (at >= 0) sum += a.value[at] * x[j * width + c];
        }
        assert_true(fabs(sum - y[i * width + c]) < 1e-14);
      }
  }
  ep_csr_free(&a);
  grid_free(&g);
}

static void test_bad_input(void **state) {
  (void)state;
  const int outside[4] = {0, 1, 2, 4}, below[4] = {0, 1, -1, 3};
  ep_csr a;
  ep_error err = {0};
  assert_int_equal(ep_csr_from_tets(4, 1, outside, 1, &a, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "vertex 4"));
  assert_int_equal(ep_csr_from_tets(4, 1, below, 1, &a, NULL), EP_ERR_ARGUMENT);
  assert_int_equal(ep_csr_from_tets(0, 0, outside, 1, &a, NULL), EP_ERR_ARGUMENT);
  assert_null(a.start);
  // A vertex no tet has leaves an empty row, not an error.
  const int apart[4] = {0, 1, 2, 4};
  assert_int_equal(ep_csr_from_tets(5, 1, apart, 1, &a, NULL), EP_OK);
  assert_int_equal(a.start[4] - a.start[3], 0);
  assert_int_equal(a.start[5], 16);
  ep_csr_free(&a);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_pattern),
      cmocka_unit_test(test_multiply),
      cmocka_unit_test(test_bad_input),
  };
  return cmocka_run_group_tests_name("sparse", tests, NULL, NULL);
}
