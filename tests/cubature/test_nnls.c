// Claims. The updated factor equals a fresh one: L L^T = G after any sequence of appends and
// removals. ep_nnls_gram solves min |A x - b|, x >= 0: the KKT conditions
//   x >= 0,  A^T (b - A x) <= 0,  x . A^T (b - A x) = 0
// hold, planted solutions come back, and for few variables it equals the best of all 2^n supports.
#include <stdio.h>

#include "cubature/cubature.h"
#include "cubature/nnls.h"
#include "tests/bake/bar.h"

enum { MAX_N = 60, MAX_ROWS = 120 };

typedef struct problem {
  int n, rows;
  double a[MAX_N * MAX_ROWS]; // column j at a + j * rows
  double b[MAX_ROWS], g[MAX_N * MAX_N], c[MAX_N];
} problem;

static void make_gram(problem *p) {
  for (int i = 0; i < p->n; i++) {
    p->c[i] = 0;
    for (int k = 0; k < p->rows; k++) p->c[i] += p->a[i * p->rows + k] * p->b[k];
    for (int j = 0; j < p->n; j++) {
      double sum = 0;
      for (int k = 0; k < p->rows; k++) sum += p->a[i * p->rows + k] * p->a[j * p->rows + k];
      p->g[i * p->n + j] = sum;
    }
  }
}

// Random columns with a common part (as element forces have), lengths over two decades.
static void random_problem(problem *p, int n, int rows, uint64_t seed) {
  ep_random rng = ep_random_seed(seed, 7);
  p->n = n;
  p->rows = rows;
  for (int j = 0; j < n; j++) {
    const double length = pow(10, 2 * ep_random_uniform(&rng) - 1);
    for (int k = 0; k < rows; k++)
      p->a[j * rows + k] = length * (ep_random_normal(&rng) + 0.3 * cos(k));
  }
  for (int k = 0; k < rows; k++) p->b[k] = ep_random_normal(&rng) + 0.5 * cos(k);
  make_gram(p);
}

static double objective(const problem *p, const double *x) {
  double sum = 0;
  for (int k = 0; k < p->rows; k++) {
    double left = p->b[k];
    for (int j = 0; j < p->n; j++) left -= p->a[j * p->rows + k] * x[j];
    sum += left * left;
  }
  return sum;
}

// Largest violation of the KKT conditions, gradient in units of |a_j| |b|.
static double kkt_violation(const problem *p, const double *x) {
  double worst = 0, length = 0;
  for (int k = 0; k < p->rows; k++) length += p->b[k] * p->b[k];
  for (int i = 0; i < p->n; i++) {
    double w = p->c[i];
    for (int j = 0; j < p->n; j++) w -= p->g[i * p->n + j] * x[j];
    if (p->g[i * p->n + i] > 0) w /= sqrt(p->g[i * p->n + i] * length);
    worst = fmax(worst, fmax(-x[i], x[i] > 0 ? fabs(w) : w));
  }
  return worst;
}

static void test_kkt(void **state) {
  (void)state;
  problem p;
  double x[MAX_N];
  int zeros = 0, positive = 0;
  for (uint64_t seed = 1; seed <= 30; seed++) {
    random_problem(&p, 10 + (int)seed, 80, seed);
    ASSERT_OK(ep_nnls_gram(p.n, p.g, p.c, x, err));
    ASSERT_LESS(kkt_violation(&p, x), 1e-10); // round-off 1e-16 times a condition up to 1e4
    for (int j = 0; j < p.n; j++) {
      zeros += x[j] == 0;
      positive += x[j] > 0;
    }
  }
  assert_true(zeros > 100 && positive > 100); // the bounds mattered, and not alone
}

// More columns than rows: no unique solution, many dependent columns, but the residual is unique.
static void test_wide(void **state) {
  (void)state;
  problem p;
  double x[MAX_N];
  for (uint64_t seed = 1; seed <= 20; seed++) {
    random_problem(&p, 60, 25, 100 + seed);
    ASSERT_OK(ep_nnls_gram(p.n, p.g, p.c, x, err));
    ASSERT_LESS(kkt_violation(&p, x), 1e-6); // sqrt of EP_DEPENDENT
  }
}

static void test_planted(void **state) {
  (void)state;
  problem p;
  double x[MAX_N], planted[MAX_N];
  random_problem(&p, 40, 100, 5);
  for (int j = 0; j < p.n; j++) planted[j] = j % 3 == 0 ? 1.0 + j : 0;
  for (int k = 0; k < p.rows; k++) {
    p.b[k] = 0;
    for (int j = 0; j < p.n; j++) p.b[k] += p.a[j * p.rows + k] * planted[j];
  }
  make_gram(&p);
  ASSERT_OK(ep_nnls_gram(p.n, p.g, p.c, x, err));
  // cond(A) ~ 1e2 from the lengths times ~ 10, squared in the Gram form: 1e-16 * 1e6.
  for (int j = 0; j < p.n; j++) ASSERT_NEAR(x[j], planted[j], 1e-8);
}

// Least squares over one support by the same factor; infinity where it leaves x >= 0.
static double support_objective(const problem *p, unsigned support) {
  double column[MAX_N], x[MAX_N] = {0};
  ep_passive set;
  ASSERT_OK(ep_passive_create(p->n, &set, err));
  for (int j = 0; j < p->n; j++)
    if (support >> j & 1) {
      for (int i = 0; i < p->n; i++) column[i] = p->g[j * p->n + i];
      assert_true(ep_passive_add(&set, j, column, p->c[j]));
    }
  ep_cholesky_solve(&set.factor, set.c, set.trial);
  double value = 0;
  for (int i = 0; i < set.count; i++) {
    x[set.index[i]] = set.trial[i];
    if (set.trial[i] < 0) value = INFINITY;
  }
  ep_passive_free(&set);
  return value > 0 ? value : objective(p, x);
}

static void test_brute_force(void **state) {
  (void)state;
  problem p;
  double x[MAX_N];
  for (uint64_t seed = 1; seed <= 12; seed++) {
    random_problem(&p, 9, 14, 200 + seed);
    double best = INFINITY;
    for (unsigned support = 0; support < 1u << p.n; support++)
      best = fmin(best, support_objective(&p, support));
    ASSERT_OK(ep_nnls_gram(p.n, p.g, p.c, x, err));
    ASSERT_NEAR(objective(&p, x), best, 1e-11 * best);
  }
}

// Zero, repeated, opposite and nearly equal columns; a right-hand side nothing can reach.
static void test_degenerate(void **state) {
  (void)state;
  problem p;
  double x[MAX_N];
  random_problem(&p, 20, 40, 9);
  for (int k = 0; k < p.rows; k++) {
    p.a[3 * p.rows + k] = 0;
    p.a[5 * p.rows + k] = p.a[4 * p.rows + k];
    p.a[6 * p.rows + k] = -2 * p.a[4 * p.rows + k];
    p.a[8 * p.rows + k] = p.a[7 * p.rows + k] * (1 + 1e-9 * sin(k));
  }
  make_gram(&p);
  ASSERT_OK(ep_nnls_gram(p.n, p.g, p.c, x, err));
  ASSERT_LESS(kkt_violation(&p, x), 1e-6);
  assert_true(x[3] == 0);
  for (int j = 0; j < p.n; j++) p.c[j] = -fabs(p.c[j]) - 1e-3;
  ASSERT_OK(ep_nnls_gram(p.n, p.g, p.c, x, err));
  for (int j = 0; j < p.n; j++) assert_true(x[j] == 0);
}

static void test_refuses(void **state) {
  (void)state;
  ep_error failure = {0};
  double g[4] = {1, 0, 0, NAN}, c[2] = {1, 1}, x[2] = {7, 7};
  assert_int_equal(ep_nnls_gram(2, g, c, x, &failure), EP_ERR_ARGUMENT);
  assert_non_null(strstr(failure.text, "column 1"));
  assert_true(x[0] == 7 && x[1] == 7); // outputs unchanged
  g[3] = 1;
  c[0] = INFINITY;
  failure = (ep_error){0};
  assert_int_equal(ep_nnls_gram(2, g, c, x, &failure), EP_ERR_ARGUMENT);
  ASSERT_OK(ep_nnls_gram(0, g, c, x, err));
}

// L L^T = G of the columns present, after random appends and removals.
static void test_updated_factor(void **state) {
  (void)state;
  problem p;
  random_problem(&p, 30, 80, 11);
  ep_passive set;
  ASSERT_OK(ep_passive_create(p.n, &set, err));
  ep_random rng = ep_random_seed(3, 3);
  unsigned char in[MAX_N] = {0};
  int removals = 0;
  for (int step = 0; step < 400; step++) {
    const int j = ep_random_below(&rng, p.n);
    if (!in[j]) {
      assert_true(ep_passive_add(&set, j, p.g + j * p.n, p.c[j]));
    } else {
      int at = 0;
      while (set.index[at] != j) at++;
      ep_passive_remove(&set, at);
      removals++;
    }
    in[j] ^= 1;
  }
  assert_true(removals > 100 && set.count > 5);
  const double *l = set.factor.l;
  for (int i = 0; i < set.count; i++)
    for (int j = 0; j <= i; j++) {
      double sum = 0;
      for (int k = 0; k <= j; k++) sum += l[i * p.n + k] * l[j * p.n + k];
      const double exact = p.g[set.index[i] * p.n + set.index[j]];
      const double size = sqrt(p.g[set.index[i] * (p.n + 1)] * p.g[set.index[j] * (p.n + 1)]);
      ASSERT_NEAR(sum / size, exact / size, 1e-12); // 400 rotations of round-off
    }
  ep_passive_free(&set);
}

static void write_numbers(const char *path, int count, const double *x) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  for (int i = 0; i < count; i++) fprintf(file, "%.17g\n", x[i]);
  fclose(file);
}

// The R package nnls (the authors' Fortran) as oracle, where it is installed.
static void test_r_oracle(void **state) {
  (void)state;
  if (system("Rscript -e 'library(nnls)' >/dev/null 2>&1") != 0) {
    print_message("skipped: Rscript with the package nnls (r-cran-nnls) is not here\n");
    skip();
  }
  problem p;
  double x[MAX_N];
  random_problem(&p, 40, 90, 21);
  write_numbers("a.txt", p.n * p.rows, p.a);
  write_numbers("b.txt", p.rows, p.b);
  assert_int_equal(system("Rscript -e 'library(nnls); b <- scan(\"b.txt\", quiet=TRUE); "
                          "a <- matrix(scan(\"a.txt\", quiet=TRUE), nrow=length(b)); "
                          "writeLines(sprintf(\"%.17g\", nnls(a, b)$x), \"x.txt\")'"),
                   0);
  ASSERT_OK(ep_nnls_gram(p.n, p.g, p.c, x, err));
  FILE *file = fopen("x.txt", "r");
  assert_non_null(file);
  for (int j = 0; j < p.n; j++) {
    double theirs;
    assert_int_equal(fscanf(file, "%lf", &theirs), 1);
    ASSERT_NEAR(x[j], theirs, 1e-9 * (1 + fabs(theirs)));
  }
  fclose(file);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_kkt),
      cmocka_unit_test(test_wide),
      cmocka_unit_test(test_planted),
      cmocka_unit_test(test_brute_force),
      cmocka_unit_test(test_degenerate),
      cmocka_unit_test(test_refuses),
      cmocka_unit_test(test_updated_factor),
      cmocka_unit_test(test_r_oracle),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
