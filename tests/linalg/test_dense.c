// Claims: products, factors and solves satisfy their defining equations to round-off;
// ep_rotation_of is the rotation that maximises tr(R^T F) for any F (polar factor where det F > 0,
// smallest singular direction turned where det F < 0); ep_kabsch recovers a known motion.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "linalg/dense.h"

static void fill(ep_random *rng, int n, double *a) {
  for (int i = 0; i < n; i++) a[i] = ep_random_normal(rng);
}

static void test_products(void **state) {
  (void)state;
  enum { M = 4, N = 5, K = 3 };
  ep_random rng = ep_random_seed(1, 0);
  double a[M * K], b[K * N], at[K * M], bt[N * K], c[3][M * N];
  fill(&rng, M * K, a);
  fill(&rng, K * N, b);
  for (int i = 0; i < M; i++)
    for (int l = 0; l < K; l++) at[l * M + i] = a[i * K + l];
  for (int l = 0; l < K; l++)
    for (int j = 0; j < N; j++) bt[j * K + l] = b[l * N + j];
  ep_gemm(M, N, K, a, b, c[0]);
  ep_gemm_tn(M, N, K, at, b, c[1]);
  ep_gemm_nt(M, N, K, a, bt, c[2]);
  for (int i = 0; i < M; i++)
    for (int j = 0; j < N; j++) {
      double sum = 0;
      for (int l = 0; l < K; l++) sum += a[i * K + l] * b[l * N + j];
      for (int v = 0; v < 3; v++) assert_true(fabs(c[v][i * N + j] - sum) < 1e-14);
    }
}

static void check_svd(int m, int n, const double *a) {
  const int p = m < n ? m : n;
  double copy[64], u[64], s[8], vt[64], back[64], gram[64];
  memcpy(copy, a, (size_t)(m * n) * sizeof *copy);
  ep_error err = {0};
  assert_int_equal(ep_svd(m, n, copy, u, s, vt, &err), EP_OK);
  ep_gemm_tn(p, p, m, u, u, gram);
  for (int i = 0; i < p * p; i++) assert_true(fabs(gram[i] - (i % (p + 1) == 0)) < 1e-13);
  ep_gemm_nt(p, p, n, vt, vt, gram);
  for (int i = 0; i < p * p; i++) assert_true(fabs(gram[i] - (i % (p + 1) == 0)) < 1e-13);
  for (int i = 1; i < p; i++) assert_true(s[i] <= s[i - 1]);
  for (int i = 0; i < m; i++)
    for (int j = 0; j < p; j++) u[i * p + j] *= s[j];
  ep_gemm(m, n, p, u, vt, back);
  for (int i = 0; i < m * n; i++) assert_true(fabs(back[i] - a[i]) < 1e-13);
}

static void test_svd(void **state) {
  (void)state;
  ep_random rng = ep_random_seed(2, 0);
  double a[48];
  fill(&rng, 48, a);
  check_svd(8, 6, a);
  check_svd(6, 8, a);
  check_svd(5, 5, a);
  a[3] = NAN;
  double u[64], s[8], vt[64];
  assert_int_equal(ep_svd(8, 6, a, u, s, vt, NULL), EP_ERR_NUMERIC);
}

// A = Q H with Q^T Q = I, H = Q^T A symmetric positive semi-definite; also in place.
static void test_polar(void **state) {
  (void)state;
  ep_random rng = ep_random_seed(3, 0);
  double a[24], q[24], h[16], gram[16], lambda[4], v[16];
  fill(&rng, 24, a);
  memcpy(q, a, sizeof q);
  assert_int_equal(ep_polar(6, 4, q, q, NULL), EP_OK);
  ep_gemm_tn(4, 4, 6, q, q, gram);
  for (int i = 0; i < 16; i++) assert_true(fabs(gram[i] - (i % 5 == 0)) < 1e-14);
  ep_gemm_tn(4, 4, 6, q, a, h);
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < i; j++) assert_true(fabs(h[4 * i + j] - h[4 * j + i]) < 1e-14);
  assert_int_equal(ep_eigen_symmetric(4, h, lambda, v, NULL), EP_OK);
  assert_true(lambda[0] > 0);
  assert_int_equal(ep_polar(4, 6, a, q, NULL), EP_ERR_ARGUMENT);
}

static void test_eigen_symmetric(void **state) {
  (void)state;
  enum { N = 7 };
  ep_random rng = ep_random_seed(4, 0);
  double a[N * N], copy[N * N], v[N * N], lambda[N];
  for (int i = 0; i < N; i++)
    for (int j = 0; j <= i; j++) a[N * i + j] = a[N * j + i] = ep_random_normal(&rng);
  memcpy(copy, a, sizeof a);
  assert_int_equal(ep_eigen_symmetric(N, copy, lambda, v, NULL), EP_OK);
  for (int e = 0; e < N; e++) {
    assert_true(e == 0 || lambda[e] >= lambda[e - 1]);
    for (int i = 0; i < N; i++) {
      double sum = 0;
      for (int j = 0; j < N; j++) sum += a[N * i + j] * v[N * e + j];
      assert_true(fabs(sum - lambda[e] * v[N * e + i]) < 1e-13);
    }
  }
}

static void test_solve_spd(void **state) {
  (void)state;
  enum { N = 6, RHS = 3 };
  ep_random rng = ep_random_seed(5, 0);
  double half[N * N], a[N * N], copy[N * N], x[N * RHS], b[N * RHS];
  fill(&rng, N * N, half);
  fill(&rng, N * RHS, x);
  ep_gemm_nt(N, N, N, half, half, a);
  for (int i = 0; i < N; i++) a[N * i + i] += 1; // condition below 100
  ep_gemm(N, RHS, N, a, x, b);
  memcpy(copy, a, sizeof a);
  assert_int_equal(ep_solve_spd(N, copy, RHS, b, NULL), EP_OK);
  for (int i = 0; i < N * RHS; i++) assert_true(fabs(b[i] - x[i]) < 1e-12);
  memcpy(copy, a, sizeof a);
  copy[N * 3 + 3] = -1;
  ep_error err = {0};
  assert_int_equal(ep_solve_spd(N, copy, RHS, b, &err), EP_ERR_NUMERIC);
  assert_non_null(strstr(err.text, "not positive definite"));
}

static double det3(const double r[9]) {
  return r[0] * (r[4] * r[8] - r[5] * r[7]) - r[1] * (r[3] * r[8] - r[5] * r[6]) +
         r[2] * (r[3] * r[7] - r[4] * r[6]);
}

static double trace_product(const double r[9], const double f[9]) {
  double sum = 0;
  for (int i = 0; i < 9; i++) sum += r[i] * f[i];
  return sum;
}

// R is a rotation to round-off, and reaches s1 + s2 + sign(det F) s3, the maximum of tr(R^T F)
// over rotations (by the SVD); a maximiser is what the projection onto rotations means, also where
// it is not unique.
static void check_rotation(const double f[9]) {
  double r[9], gram[9], copy[9], u[9], s[3], vt[9];
  ep_rotation_of(f, r);
  ep_gemm_tn(3, 3, 3, r, r, gram);
  for (int i = 0; i < 9; i++) assert_true(fabs(gram[i] - (i % 4 == 0)) < 1e-14);
  assert_true(fabs(det3(r) - 1) < 1e-14);
  memcpy(copy, f, sizeof copy);
  assert_int_equal(ep_svd(3, 3, copy, u, s, vt, NULL), EP_OK);
  const double best = s[0] + s[1] + (det3(u) * det3(vt) > 0 ? s[2] : -s[2]);
  assert_true(fabs(trace_product(r, f) - best) <= 4e-15 * s[0]);
  // Where the maximiser is unique and well-conditioned, the matrix itself must agree.
  const double gap = best - s[0];
  if (gap < 0.05 * s[0]) return;
  double d[9] = {1, 0, 0, 0, 1, 0, 0, 0, det3(u) * det3(vt) > 0 ? 1 : -1}, ud[9], expected[9];
  ep_gemm(3, 3, 3, u, d, ud);
  ep_gemm(3, 3, 3, ud, vt, expected);
  for (int i = 0; i < 9; i++) assert_true(fabs(r[i] - expected[i]) < 1e-13);
}

static void test_rotation_random(void **state) {
  (void)state;
  ep_random rng = ep_random_seed(6, 0);
  double f[9];
  for (int trial = 0; trial < 3000; trial++) {
    fill(&rng, 9, f);
    check_rotation(f); // half of these are inverted
  }
}

// F = U diag(s) V^T with chosen s: near-singular, flat, needle, huge, tiny, inverted.
static void test_rotation_hard(void **state) {
  (void)state;
  static const double cases[][3] = {
      {1, 1, 1},      {1, 1, 1e-3},   {1, 1, 1e-9},          {1, 1e-5, 1e-10},
      {1, 1, 0},      {1, 0, 0},      {1, 1e-8, -1e-8},      {1, 1, -1},
      {1, 1, -0.999}, {3, 2, -1e-6},  {1e150, 1e149, 1e148}, {1e-150, 1e-150, -1e-151},
      {1e8, 1, 1e-8}, {5, 5, -1e-12},
  };
  ep_random rng = ep_random_seed(7, 0);
  for (size_t c = 0; c < sizeof cases / sizeof *cases; c++)
    for (int trial = 0; trial < 50; trial++) {
      double a[9], u[9], v[9], us[9], f[9];
      fill(&rng, 9, a);
      ep_rotation_of(a, u);
      fill(&rng, 9, a);
      ep_rotation_of(a, v);
      for (int i = 0; i < 9; i++) us[i] = u[i] * cases[c][i % 3];
      ep_gemm_nt(3, 3, 3, us, v, f);
      check_rotation(f);
    }
  const double zero[9] = {0};
  double r[9];
  ep_rotation_of(zero, r);
  for (int i = 0; i < 9; i++) assert_true(r[i] == (i % 4 == 0));
}

// y = R x + t with a few clouds; weights zero out outliers.
static void test_kabsch(void **state) {
  (void)state;
  ep_random rng = ep_random_seed(8, 0);
  for (int trial = 0; trial < 100; trial++) {
    enum { COUNT = 12 };
    double a[9], r[9], found[9], x[3 * COUNT], y[3 * COUNT], w[COUNT], cx[3], cy[3], t[3];
    fill(&rng, 9, a);
    fill(&rng, 3, t);
    fill(&rng, 3 * COUNT, x);
    ep_rotation_of(a, r);
    for (int i = 0; i < COUNT; i++) {
      if (trial % 2) x[3 * i + 2] = 0; // a flat cloud determines a rotation too
      for (int k = 0; k < 3; k++) {
        y[3 * i + k] = t[k];
        for (int l = 0; l < 3; l++) y[3 * i + k] += r[3 * k + l] * x[3 * i + l];
      }
      w[i] = ep_random_uniform(&rng) + 0.1;
    }
    w[5] = 0;
    y[15] += 100;
    assert_int_equal(ep_kabsch(COUNT, x, y, w, found, cx, cy, NULL), EP_OK);
    for (int i = 0; i < 9; i++) assert_true(fabs(found[i] - r[i]) < 1e-12);
    for (int k = 0; k < 3; k++) {
      double moved = t[k];
      for (int l = 0; l < 3; l++) moved += r[3 * k + l] * cx[l];
      assert_true(fabs(moved - cy[k]) < 1e-13);
    }
  }
}

// A mirrored cloud still gives a rotation, the best one; a line, a point, or nothing gives none.
static void test_kabsch_degenerate(void **state) {
  (void)state;
  const double x[15] = {3, 0, 0, -3, 0, 0, 0, 2, 0, 0, -2, 0, 0, 0, 1};
  double y[15], r[9], cx[3], cy[3];
  for (int i = 0; i < 15; i++) y[i] = i % 3 == 2 ? -x[i] : x[i];
  assert_int_equal(ep_kabsch(5, x, y, NULL, r, cx, cy, NULL), EP_OK);
  for (int i = 0; i < 9; i++) assert_true(fabs(r[i] - (i % 4 == 0)) < 1e-14);
  const double line[9] = {0, 0, 0, 1, 2, 3, -2, -4, -6};
  ep_error err = {0};
  assert_int_equal(ep_kabsch(3, line, line, NULL, r, cx, cy, &err), EP_ERR_NUMERIC);
  for (int i = 0; i < 9; i++) assert_true(r[i] == (i % 4 == 0));
  assert_int_equal(ep_kabsch(1, line, line, NULL, r, cx, cy, NULL), EP_ERR_NUMERIC);
  assert_int_equal(ep_kabsch(0, line, line, NULL, r, cx, cy, NULL), EP_ERR_NUMERIC);
  const double bad[3] = {1, -1, 1};
  assert_int_equal(ep_kabsch(3, x, y, bad, r, cx, cy, NULL), EP_ERR_ARGUMENT);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_products),
      cmocka_unit_test(test_svd),
      cmocka_unit_test(test_polar),
      cmocka_unit_test(test_eigen_symmetric),
      cmocka_unit_test(test_solve_spd),
      cmocka_unit_test(test_rotation_random),
      cmocka_unit_test(test_rotation_hard),
      cmocka_unit_test(test_kabsch),
      cmocka_unit_test(test_kabsch_degenerate),
  };
  return cmocka_run_group_tests_name("dense", tests, NULL, NULL);
}
