// align/couple: the gradient is the objective's (differences of order h^2); a hidden rotation with
// signs comes back; wrong region rows lose their weight; the minimum is the one NLopt's augmented
// Lagrangian finds from the same start; first-order conditions on the Stiefel manifold hold.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <nlopt.h>

#include "align/private.h"
#include "base/random.h"
#include "linalg/dense.h"

enum { K = 8, M = 4, Q = 12 };

typedef struct problem {
  double lambda_from[M], lambda_to[K], f_from[Q * M], f_to[Q * K], hidden[K * M];
} problem;

static void random_fill(ep_random *rng, int n, double *x) {
  for (int i = 0; i < n; i++) x[i] = ep_random_normal(rng);
}

static void random_basis(ep_random *rng, double *a) {
  ep_error err = {0};
  random_fill(rng, K * M, a);
  assert_int_equal(ep_polar(K, M, a, a, &err), EP_OK);
}

// Example functions = object functions with signs, two neighbours rotated, and noise.
static void make_problem(problem *p, uint64_t seed, double noise) {
  ep_random rng = ep_random_seed(seed, 3);
  for (int i = 0; i < K; i++) p->lambda_to[i] = 1 + 1.5 * i;
  for (int i = 0; i < M; i++) p->lambda_from[i] = p->lambda_to[i];
  memset(p->hidden, 0, sizeof p->hidden);
  const double c = cos(0.1), s = sin(0.1);
  p->hidden[0] = -1;
  p->hidden[1 * M + 1] = c;
  p->hidden[2 * M + 1] = s;
  p->hidden[1 * M + 2] = s;
  p->hidden[2 * M + 2] = -c;
  p->hidden[3 * M + 3] = 1;
  random_fill(&rng, Q * K, p->f_to);
  ep_gemm(Q, M, K, p->f_to, p->hidden, p->f_from);
  for (int i = 0; i < Q * M; i++) p->f_from[i] += noise * ep_random_normal(&rng);
}

static ep_couple_problem view(const problem *p, bool ordered, double scale) {
  return (ep_couple_problem){
      K, M, Q, ordered, 2.0, scale, p->lambda_from, p->lambda_to, p->f_from, p->f_to};
}

static double value_of(const ep_couple_problem *p, const double *a, double *gradient) {
  double *work = malloc(ep_couple_work(p) * sizeof *work);
  assert_non_null(work);
  const double value = ep_couple_objective(p, a, gradient, NULL, work);
  free(work);
  return value;
}

// (E(A + h B) - E(A - h B)) / 2h - <G, B> falls as h^2: slope 2 +- 0.1.
static void check_gradient(const ep_couple_problem *p, uint64_t seed) {
  ep_random rng = ep_random_seed(seed, 4);
  double a[K * M], b[K * M], g[K * M], moved[K * M], errors[2];
  random_basis(&rng, a);
  random_fill(&rng, K * M, b);
  value_of(p, a, g);
  double slope = 0;
  for (int i = 0; i < K * M; i++) slope += g[i] * b[i];
  for (int level = 0; level < 2; level++) {
    const double h = level ? 1e-3 : 2e-3;
    double e[2];
    for (int side = 0; side < 2; side++) {
      for (int i = 0; i < K * M; i++) moved[i] = a[i] + (side ? -h : h) * b[i];
      e[side] = value_of(p, moved, NULL);
    }
    errors[level] = fabs((e[0] - e[1]) / (2 * h) - slope);
  }
  assert_true(fabs(slope) > 1e-3); // not trivially right
  const double order = log2(errors[0] / errors[1]);
  if (fabs(order - 2) > 0.1)
    fail_msg("gradient order %.3f, errors %g %g", order, errors[0], errors[1]);
}

static void gradient_matches_differences(void **state) {
  (void)state;
  problem p;
  make_problem(&p, 1, 0.3);
  for (int ordered = 0; ordered < 2; ordered++)
    for (int robust = 0; robust < 2; robust++) {
      const ep_couple_problem v = view(&p, ordered, robust ? 0.7 : 0);
      check_gradient(&v, 5 + ordered);
    }
}

static void hidden_rotation_comes_back(void **state) {
  (void)state;
  problem p;
  make_problem(&p, 2, 0);
  ep_coupling def = ep_default_coupling(M);
  def.mu_data = 1e4; // the hidden basis is no minimum of the off-diagonal part
  double a[K * M] = {0}, weight[Q], objective;
  ep_error err = {0};
  assert_int_equal(
      ep_couple(&def, Q, p.lambda_from, p.lambda_to, p.f_from, p.f_to, a, weight, &objective, &err),
      EP_OK);
  // Off-diagonal part of order 0.1, data part 1e4 |dA|^2: the basis moves by less than 1e-3.
  for (int i = 0; i < K * M; i++) assert_true(fabs(a[i] - p.hidden[i]) < 1e-3);
  for (int g = 0; g < Q; g++) assert_true(weight[g] > 0.99);
}

static void wrong_rows_lose_their_weight(void **state) {
  (void)state;
  problem p;
  make_problem(&p, 3, 0.01);
  for (int j = 0; j < M; j++) p.f_from[2 * M + j] *= -1;
  ep_coupling def = ep_default_coupling(M);
  def.mu_data = 100;
  double a[K * M] = {0}, plain[K * M] = {0}, weight[Q], objective;
  ep_error err = {0};
  assert_int_equal(
      ep_couple(&def, Q, p.lambda_from, p.lambda_to, p.f_from, p.f_to, a, weight, &objective, &err),
      EP_OK);
  def.robust = false;
  assert_int_equal(ep_couple(&def, Q, p.lambda_from, p.lambda_to, p.f_from, p.f_to, plain, NULL,
                             &objective, &err),
                   EP_OK);
  double error = 0, error_plain = 0;
  for (int i = 0; i < K * M; i++) {
    error = fmax(error, fabs(a[i] - p.hidden[i]));
    error_plain = fmax(error_plain, fabs(plain[i] - p.hidden[i]));
  }
  assert_true(weight[2] < 0.1);
  for (int g = 0; g < Q; g++) assert_true(g == 2 || weight[g] > 0.5);
  assert_true(error < 0.1);
  assert_true(error < 0.5 * error_plain);
}

static double nlopt_value(unsigned n, const double *a, double *gradient, void *data) {
  (void)n;
  return value_of(data, a, gradient);
}

// Upper triangle of A^T A - I.
static void nlopt_orthonormal(unsigned count, double *result, unsigned n, const double *a,
                              double *gradient, void *data) {
  (void)data;
  unsigned at = 0;
  if (gradient) memset(gradient, 0, (size_t)count * n * sizeof *gradient);
  for (int i = 0; i < M; i++)
    for (int j = i; j < M; j++, at++) {
      result[at] = i == j ? -1 : 0;
      for (int r = 0; r < K; r++) {
        result[at] += a[r * M + i] * a[r * M + j];
        if (!gradient) continue;
        gradient[at * n + (unsigned)(r * M + i)] += a[r * M + j];
        gradient[at * n + (unsigned)(r * M + j)] += a[r * M + i];
      }
    }
}

static double oracle(ep_couple_problem *p, double *a) {
  const double tolerance[M * (M + 1) / 2] = {0};
  nlopt_opt opt = nlopt_create(NLOPT_AUGLAG_EQ, K * M), local = nlopt_create(NLOPT_LD_MMA, K * M);
  nlopt_set_xtol_rel(local, 1e-10);
  nlopt_set_maxeval(local, 4000);
  nlopt_set_local_optimizer(opt, local);
  nlopt_set_min_objective(opt, nlopt_value, p);
  nlopt_add_equality_mconstraint(opt, M * (M + 1) / 2, nlopt_orthonormal, NULL, tolerance);
  nlopt_set_maxeval(opt, 200000);
  nlopt_set_xtol_rel(opt, 1e-12);
  double value = 0;
  const nlopt_result result = nlopt_optimize(opt, a, &value);
  // Running out of precision is no failure: the objective and the constraints are checked below.
  if (result <= 0 && result != NLOPT_ROUNDOFF_LIMITED)
    fail_msg("NLopt: %s", nlopt_result_to_string(result));
  nlopt_destroy(opt);
  nlopt_destroy(local);
  double violation[M * (M + 1) / 2], worst = 0;
  nlopt_orthonormal(M * (M + 1) / 2, violation, K * M, a, NULL, NULL);
  for (int i = 0; i < M * (M + 1) / 2; i++) worst = fmax(worst, fabs(violation[i]));
  assert_true(worst < 1e-6);
  return value_of(p, a, NULL);
}

// A stationary point on the manifold: G - A sym(A^T G) = 0.
static double stationarity(const ep_couple_problem *p, const double *a) {
  double g[K * M], s[M * M], worst = 0;
  value_of(p, a, g);
  ep_gemm_tn(M, M, K, a, g, s);
  for (int r = 0; r < K; r++)
    for (int j = 0; j < M; j++) {
      double v = g[r * M + j];
      for (int i = 0; i < M; i++) v -= a[r * M + i] * (s[i * M + j] + s[j * M + i]) / 2;
      worst = fmax(worst, fabs(v));
    }
  return worst;
}

static void reaches_the_oracles_minimum(void **state) {
  (void)state;
  for (int ordered = 0; ordered < 2; ordered++)
    for (int robust = 0; robust < 2; robust++) {
      problem data;
      make_problem(&data, 7 + (uint64_t)robust, 0.2);
      ep_couple_problem p = view(&data, ordered, robust ? 0.7 : 0);
      double a[K * M], b[K * M], objective;
      ep_error err = {0};
      ep_random rng = ep_random_seed(9, 5);
      for (int i = 0; i < K * M; i++) a[i] = data.hidden[i] + 0.1 * ep_random_normal(&rng);
      assert_int_equal(ep_polar(K, M, a, a, &err), EP_OK);
      memcpy(b, a, sizeof a);
      const double start = value_of(&p, a, NULL);
      assert_int_equal(ep_couple_descend(&p, 5000, a, &objective, &err), EP_OK);
      const double reference = oracle(&p, b);
      printf("coupling %s %s: start %.6f, ours %.10f, oracle %.10f\n",
             ordered ? "ordered" : "plain", robust ? "robust" : "squares", start, objective,
             reference);
      assert_true(objective < 0.9 * start);
      // The oracle's constraints hold to 1e-6, its objective is as near.
      assert_true(fabs(objective - reference) < 1e-5 * (1 + fabs(reference)));
      assert_true(stationarity(&p, a) < 1e-6);
    }
}

static void few_regions_fall_back_on_order(void **state) {
  (void)state;
  problem p;
  make_problem(&p, 4, 0);
  const ep_coupling def = ep_default_coupling(M);
  double a[K * M] = {0}, objective;
  ep_error err = {0};
  // Nothing given: the ordered penalty alone, zero at function i with function i.
  assert_int_equal(
      ep_couple(&def, 0, p.lambda_from, p.lambda_to, NULL, NULL, a, NULL, &objective, &err), EP_OK);
  for (int i = 0; i < K; i++)
    for (int j = 0; j < M; j++) assert_true(fabs(a[i * M + j] - (i == j)) < 1e-6);
  assert_true(objective < 1e-12);
}

static void refuses_nonsense(void **state) {
  (void)state;
  problem p;
  make_problem(&p, 5, 0);
  ep_coupling def = ep_default_coupling(M);
  def.k = M - 1;
  double a[K * M] = {0}, objective;
  ep_error err = {0};
  assert_int_equal(
      ep_couple(&def, 0, p.lambda_from, p.lambda_to, NULL, NULL, a, NULL, &objective, &err),
      EP_ERR_ARGUMENT);
  def.k = K;
  p.lambda_from[0] = NAN;
  err = (ep_error){0};
  assert_int_equal(
      ep_couple(&def, 0, p.lambda_from, p.lambda_to, NULL, NULL, a, NULL, &objective, &err),
      EP_ERR_ARGUMENT);
}

// Region rows related by an exact rotation: nothing is left on held-out rows, and as many functions
// are determined as rows, or columns, or independent rows there are.
static void held_out_rows_choose(void **state) {
  (void)state;
  enum { ROWS = 24, WIDE = 8, COLUMNS = 4 };
  double from[ROWS * COLUMNS], to[ROWS * WIDE], lf[COLUMNS], lt[WIDE], residual;
  ep_random rng = ep_random_seed(3, 1);
  for (int i = 0; i < WIDE; i++) lt[i] = 1 + i;
  for (int i = 0; i < COLUMNS; i++) lf[i] = 1 + i;
  for (int g = 0; g < ROWS; g++)
    for (int j = 0; j < WIDE; j++) {
      to[g * WIDE + j] = ep_random_normal(&rng);
      // signs flipped: function j of one is -function j of the other
      if (j < COLUMNS) from[g * COLUMNS + j] = -to[g * WIDE + j];
    }
  ep_coupling def = ep_default_coupling(COLUMNS);
  ep_error err = {0};
  assert_int_equal(ep_couple_choose(&def, WIDE, ROWS, lf, lt, from, to, &residual, &err), EP_OK);
  printf("chosen k %d, mu %g, held out %.2e\n", def.k, def.mu_data, residual);
  assert_true(residual < 1e-3); // 200 iterations of descent
  assert_int_equal(ep_couple_determined(ROWS, COLUMNS, from), COLUMNS);
  assert_int_equal(ep_couple_determined(2, COLUMNS, from), 2);
  memcpy(from + COLUMNS, from, sizeof(double) * COLUMNS);
  assert_int_equal(ep_couple_determined(2, COLUMNS, from), 1);
  // Too few rows to leave any out: nothing is chosen, and that is said.
  def = ep_default_coupling(COLUMNS);
  assert_int_equal(ep_couple_choose(&def, WIDE, 5, lf, lt, from, to, &residual, &err), EP_OK);
  assert_int_equal(def.k, 2 * COLUMNS);
  assert_true(residual == 0);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(held_out_rows_choose),
      cmocka_unit_test(gradient_matches_differences),
      cmocka_unit_test(hidden_rotation_comes_back),
      cmocka_unit_test(wrong_rows_lose_their_weight),
      cmocka_unit_test(reaches_the_oracles_minimum),
      cmocka_unit_test(few_regions_fall_back_on_order),
      cmocka_unit_test(refuses_nonsense),
  };
  return cmocka_run_group_tests_name("align/couple", tests, NULL, NULL);
}
