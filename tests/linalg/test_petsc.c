// Claims: a factor solves A x = b to round-off, holds unknowns at zero and refuses matrices that
// are not positive definite; eigenpairs satisfy K x = lambda M x, X M X^T = I, all copies of
// multiple eigenvalues are found, and two runs agree to the last bit.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/linalg/grid.h"
#include "tests/petsc_session.h"

// Graph Laplacian of the grid plus `diagonal`: eigenvalues >= diagonal.
static ep_csr laplacian(const grid *g, int block, double diagonal) {
  ep_csr a;
  ep_error err = {0};
  assert_int_equal(ep_csr_from_tets(g->nv, g->nt, g->tet, block, &a, &err), EP_OK);
  for (int i = 0; i < a.n; i++)
    for (int p = a.start[i]; p < a.start[i + 1]; p++)
      a.value[p] = a.column[p] == i ? a.start[i + 1] - a.start[i] - 1 + diagonal : -1;
  return a;
}

// The seven-point Laplacian and the identity on a grid's vertices (other entries zero): natural
// boundary, eigenvalues sum of 2 - 2 cos(pi i / count) over the axes, i < count points.
static ep_csr seven_points(const grid *g) {
  ep_csr a = laplacian(g, 1, 0);
  for (int i = 0; i < a.n; i++) {
    int neighbours = 0, own = 0;
    for (int p = a.start[i]; p < a.start[i + 1]; p++) {
      const int j = a.column[p];
      int axes = 0;
      for (int k = 0; k < 3; k++) axes += fabs(g->x[3 * i + k] - g->x[3 * j + k]) > 1e-12;
      if (j == i) own = p;
      a.value[p] = axes == 1 ? -1 : 0;
      neighbours += axes == 1;
    }
    a.value[own] = neighbours;
  }
  return a;
}

static ep_csr identity(const grid *g) {
  ep_csr a = laplacian(g, 1, 0);
  for (int i = 0; i < a.n; i++)
    for (int p = a.start[i]; p < a.start[i + 1]; p++) a.value[p] = a.column[p] == i;
  return a;
}

static double wave(int i) {
  return sin(0.7 * i) + 0.1 * cos(13.0 * i);
}

static void test_solve_and_update(void **state) {
  (void)state;
  grid g = grid_make(6, 5, 4, 1, 1, 1);
  for (int block = 1; block <= 3; block += 2) {
    ep_csr a = laplacian(&g, block, 0.3);
    const size_t n = (size_t)a.n;
    double *x = malloc(9 * n * sizeof *x), *b = x + 3 * n, *y = b + 3 * n;
    ep_factor *f;
    ep_error err = {0};
    assert_int_equal(ep_factor_create(&a, NULL, 1, &f, &err), EP_OK);
    for (int round = 0; round < 2; round++) {
      for (int width = 1; width <= 3; width++) {
        for (int i = 0; i < width * a.n; i++) x[i] = wave(i + round);
        ep_csr_multiply(&a, width, x, b);
        memcpy(y, b, (size_t)width * n * sizeof *y);
        // In place on purpose. Condition number < 100, so 1e-12 is ample for round-off.
        assert_int_equal(ep_factor_solve(f, width, y, y, &err), EP_OK);
        for (int i = 0; i < width * a.n; i++) assert_true(fabs(y[i] - x[i]) < 1e-12);
      }
      for (int p = 0; p < a.start[a.n]; p++) a.value[p] *= 1.5;
      for (int i = 0; i < a.n; i++) a.value[ep_csr_find(&a, i, i)] += 0.01 * i;
      assert_int_equal(ep_factor_update(f, &a, &err), EP_OK);
    }
    ep_factor_free(f);
    ep_csr_free(&a);
    free(x);
  }
  grid_free(&g);
}

// Held unknowns: 0 there, and the free rows of A x = b hold with them.
static void test_held_unknowns(void **state) {
  (void)state;
  grid g = grid_make(4, 4, 4, 1, 1, 1);
  ep_csr a = laplacian(&g, 1, 0); // singular unless something is held
  unsigned char *held = calloc((size_t)a.n, 1);
  for (int i = 0; i < a.n; i++) held[i] = g.x[3 * i] == 0;
  double *x = malloc(3 * (size_t)a.n * sizeof *x), *b = x + a.n, *ax = b + a.n;
  for (int i = 0; i < a.n; i++) b[i] = wave(i);
  ep_factor *f;
  ep_error err = {0};
  assert_int_equal(ep_factor_create(&a, held, 1, &f, &err), EP_OK);
  assert_int_equal(ep_factor_solve(f, 1, b, x, &err), EP_OK);
  ep_csr_multiply(&a, 1, x, ax);
  for (int i = 0; i < a.n; i++) {
    if (held[i])
      assert_true(x[i] == 0);
    else
      assert_true(fabs(ax[i] - b[i]) < 1e-11);
  }
  ep_factor_free(f);
  memset(held, 1, (size_t)a.n);
  assert_int_equal(ep_factor_create(&a, held, 1, &f, &err), EP_ERR_ARGUMENT);
  assert_null(f);
  ep_csr_free(&a);
  free(held);
  free(x);
  grid_free(&g);
}

// One negative eigenvalue among many (min -0.01), many, and all: each is refused by name; the same
// matrices factor as LDL^T and solve.
static void test_indefinite_is_refused(void **state) {
  (void)state;
  grid g = grid_make(6, 6, 6, 1, 1, 1);
  const double diagonals[] = {-0.01, -3.3, -40};
  for (int c = 0; c < 3; c++) {
    ep_csr a = laplacian(&g, 1, diagonals[c]);
    ep_factor *f;
    ep_error err = {0};
    assert_int_equal(ep_factor_create(&a, NULL, 1, &f, &err), EP_ERR_NUMERIC);
    assert_non_null(strstr(err.text, "not positive definite"));
    assert_null(f);
    memset(&err, 0, sizeof err);
    assert_int_equal(ep_factor_create(&a, NULL, 0, &f, &err), EP_OK);
    double *x = malloc(3 * (size_t)a.n * sizeof *x), *b = x + a.n, *y = b + a.n;
    for (int i = 0; i < a.n; i++) x[i] = wave(i);
    ep_csr_multiply(&a, 1, x, b);
    assert_int_equal(ep_factor_solve(f, 1, b, y, &err), EP_OK);
    for (int i = 0; i < a.n; i++) assert_true(fabs(y[i] - x[i]) < 1e-9);
    ep_factor_free(f);
    free(x);
    ep_csr_free(&a);
  }
  grid_free(&g);
}

// A Laplacian with nothing held: constants are its null space. Neither kind of factor takes it.
static void test_singular_is_refused(void **state) {
  (void)state;
  for (int cells = 2; cells <= 6; cells += 2) {
    grid g = grid_make(cells, cells, cells, 1, 1, 1);
    ep_csr a = laplacian(&g, 1, 0);
    for (int definite = 0; definite < 2; definite++) {
      ep_factor *f;
      ep_error err = {0};
      assert_int_equal(ep_factor_create(&a, NULL, definite, &f, &err), EP_ERR_NUMERIC);
      assert_null(f);
    }
    ep_csr_free(&a);
    grid_free(&g);
  }
}

// A failed update makes the factor unusable; the next good one mends it.
static void test_update_recovers(void **state) {
  (void)state;
  grid g = grid_make(4, 4, 4, 1, 1, 1);
  ep_csr good = laplacian(&g, 1, 1), bad = laplacian(&g, 1, -1);
  double *x = calloc((size_t)good.n, sizeof *x);
  ep_factor *f;
  ep_error err = {0};
  assert_int_equal(ep_factor_create(&good, NULL, 1, &f, &err), EP_OK);
  assert_int_equal(ep_factor_update(f, &bad, &err), EP_ERR_NUMERIC);
  memset(&err, 0, sizeof err);
  assert_int_equal(ep_factor_solve(f, 1, x, x, &err), EP_ERR_ARGUMENT);
  memset(&err, 0, sizeof err);
  assert_int_equal(ep_factor_update(f, &good, &err), EP_OK);
  for (int i = 0; i < good.n; i++) x[i] = 1; // A 1 = 1 for this matrix
  assert_int_equal(ep_factor_solve(f, 1, x, x, &err), EP_OK);
  for (int i = 0; i < good.n; i++) assert_true(fabs(x[i] - 1) < 1e-13);
  ep_factor_free(f);
  ep_csr_free(&good);
  ep_csr_free(&bad);
  free(x);
  grid_free(&g);
}

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// The seven-point Laplacian of a cube of 6^3 points: eigenvalues come three- and sixfold.
static void test_multiple_eigenvalues(void **state) {
  (void)state;
  enum { POINTS = 6, COUNT = 25 };
  grid g = grid_make(POINTS - 1, POINTS - 1, POINTS - 1, 1, 1, 1);
  ep_csr k = seven_points(&g), m = identity(&g);
  double exact[POINTS * POINTS * POINTS], lambda[2][COUNT];
  for (int i = 0; i < g.nv; i++) {
    exact[i] = 6;
    for (int axis = 0, r = i; axis < 3; axis++, r /= POINTS)
      exact[i] -= 2 * cos(3.14159265358979323846 * (r % POINTS) / POINTS);
  }
  qsort(exact, (size_t)g.nv, sizeof *exact, ascending);
  double *x = malloc(2 * COUNT * (size_t)g.nv * sizeof *x), *again = x + COUNT * g.nv;
  ep_error err = {0};
  assert_int_equal(ep_eigenpairs(&k, &m, NULL, -0.01, COUNT, lambda[0], x, NULL, &err), EP_OK);
  assert_int_equal(ep_eigenpairs(&k, &m, NULL, -0.01, COUNT, lambda[1], again, NULL, &err), EP_OK);
  for (int j = 0; j < COUNT; j++) assert_true(fabs(lambda[0][j] - exact[j]) < 1e-10);
  assert_memory_equal(lambda[0], lambda[1], sizeof lambda[0]);
  assert_memory_equal(x, again, COUNT * (size_t)g.nv * sizeof *x);
  free(x);
  ep_csr_free(&k);
  ep_csr_free(&m);
  grid_free(&g);
}

// Residual and M-orthonormality recomputed here, with a mass that is not the identity and with
// held unknowns.
static void test_pairs_with_held(void **state) {
  (void)state;
  enum { COUNT = 12 };
  grid g = grid_make(7, 4, 3, 2, 1, 1);
  ep_csr k = laplacian(&g, 3, 0), m = laplacian(&g, 3, 20);
  for (int p = 0; p < m.start[m.n]; p++) m.value[p] = fabs(m.value[p]);
  const size_t n = (size_t)k.n;
  unsigned char *held = calloc(n, 1);
  for (int i = 0; i < k.n; i++) held[i] = g.x[3 * (i / 3)] == 0;
  double lambda[COUNT], *x = malloc((COUNT + 2) * n * sizeof *x);
  double *kx = x + COUNT * n, *mx = kx + n;
  ep_error err = {0};
  assert_int_equal(ep_eigenpairs(&k, &m, held, -1e-3, COUNT, lambda, x, NULL, &err), EP_OK);
  for (int j = 0; j < COUNT; j++) {
    ep_csr_multiply(&k, 1, x + (size_t)j * n, kx);
    ep_csr_multiply(&m, 1, x + (size_t)j * n, mx);
    assert_true(j == 0 || lambda[j] >= lambda[j - 1]);
    double norm = 0;
    for (size_t i = 0; i < n; i++) norm = fmax(norm, fabs(lambda[j] * mx[i]));
    for (size_t i = 0; i < n; i++) {
      if (held[i])
        assert_true(x[(size_t)j * n + i] == 0);
      else
        assert_true(fabs(kx[i] - lambda[j] * mx[i]) < 1e-7 * norm);
    }
    for (int l = 0; l < COUNT; l++) {
      double sum = 0;
      for (size_t i = 0; i < n; i++) sum += mx[i] * x[(size_t)l * n + i];
      assert_true(fabs(sum - (l == j)) < 1e-10);
    }
  }
  assert_true(lambda[0] > 0);
  free(x);
  free(held);
  ep_csr_free(&k);
  ep_csr_free(&m);
  grid_free(&g);
}

static void test_too_many_pairs(void **state) {
  (void)state;
  grid g = grid_make(1, 1, 1, 1, 1, 1);
  ep_csr k = laplacian(&g, 1, 0), m = identity(&g);
  double lambda[8], x[64];
  ep_error err = {0};
  assert_int_equal(ep_eigenpairs(&k, &m, NULL, -0.01, 8, lambda, x, NULL, &err), EP_ERR_ARGUMENT);
  memset(&err, 0, sizeof err);
  assert_int_equal(ep_eigenpairs(&k, &m, NULL, -0.01, 7, lambda, x, NULL, &err), EP_OK);
  ep_csr_free(&k);
  ep_csr_free(&m);
  grid_free(&g);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_solve_and_update),      cmocka_unit_test(test_held_unknowns),
      cmocka_unit_test(test_indefinite_is_refused), cmocka_unit_test(test_singular_is_refused),
      cmocka_unit_test(test_update_recovers),       cmocka_unit_test(test_multiple_eigenvalues),
      cmocka_unit_test(test_pairs_with_held),       cmocka_unit_test(test_too_many_pairs),
  };
  return cmocka_run_group_tests_name("petsc", tests, session_start, session_stop);
}
