// The Green-strain potential in full space and its reduced coefficients (Zhang et al. 2015):
//   <A, B> = A^T D B with the paper's D (V/2, engineering shear), w = (Ep^T D Ep)^-1 Ep^T D E,
//   W_a = -w'^T Q^-1 w'
// against a dense solve with explicit 6-vectors; derivatives against differences; invariance under
// rigid motions; zero at the examples; dependent examples; Woodbury against the operator; reduced =
// full on U q; regions that do not touch are independent.
#include "tests/bake/bar.h"

#include "linalg/dense.h"
#include "reduced/bake/green_coefficients.h"
#include "reduced/bake/green_full.h"
#include "tests/petsc_session.h"

enum { K = 3, R = 12, MANY = 32 };

static const ep_elastic rubber = {.density = 1000, .young = 2e5, .poisson = 0.35};

typedef struct scene {
  bar b;
  double *poses; // (k x 3n)
  ep_green_full full;
} scene;

// k smooth random poses of strains up to about one half.
static void create(scene *s, int k, int fixed) {
  const int cells[3] = {5, 2, 2};
  const double size[3] = {1, 0.4, 0.4};
  memset(s, 0, sizeof *s);
  make_bar(&s->b, cells, size, EP_STVK, rubber, fixed);
  s->poses = vector_of((size_t)k * s->b.n3);
  for (int j = 0; j < k; j++)
    smooth_random(&s->b, 100 + (uint64_t)j, 0.3, s->poses + (size_t)j * s->b.n3);
}

static void build(scene *s, int k, const double *share, ep_log *log) {
  ASSERT_OK(
      ep_green_full_create(&s->b.fem, s->b.fem.volume, k, s->poses, share, log, &s->full, err));
}

static void drop(scene *s) {
  ep_green_full_free(&s->full);
  free(s->poses);
  free_bar(&s->b);
}

// ---- oracle: explicit vectors ------------------------------------------------------------------

// E (6 nt) with engineering shear, and D E with the paper's D.
static void explicit_strain(const bar *b, const double *u, double *strain, double *image) {
  for (int e = 0; e < b->mesh.nt; e++) {
    double t[6], *v = strain + 6 * e, *d = image + 6 * e;
    ep_green_strain6(&b->fem, e, u, t);
    for (int c = 0; c < 6; c++) v[c] = c < 3 ? t[c] : 2 * t[c];
    const double lambda = b->fem.lambda[e], mu = b->fem.mu[e], half = b->fem.volume[e] / 2;
    for (int c = 0; c < 6; c++)
      d[c] = half * (c < 3 ? lambda * (v[0] + v[1] + v[2]) + 2 * mu * v[c] : mu * v[c]);
  }
}

static void weights_equal_a_dense_solve(void **state) {
  (void)state;
  scene s;
  create(&s, K, 0);
  build(&s, K, NULL, NULL);
  const size_t numbers = 6 * (size_t)s.b.mesh.nt;
  double *strain = vector_of((K + 1) * numbers), *image = vector_of((K + 1) * numbers);
  double *u = vector_of(s.b.n3), gram[K * K], w[K], y[K], got[K];
  for (int j = 0; j < K; j++)
    explicit_strain(&s.b, s.poses + (size_t)j * s.b.n3, strain + (size_t)j * numbers,
                    image + (size_t)j * numbers);
  for (uint64_t trial = 0; trial < 5; trial++) {
    smooth_random(&s.b, trial, 0.4, u);
    explicit_strain(&s.b, u, strain + K * numbers, image + K * numbers);
    double minus = 0, dot;
    for (int i = 0; i < K; i++) {
      for (int j = 0; j < K; j++) {
        dot = 0;
        for (size_t c = 0; c < numbers; c++)
          dot += strain[(size_t)i * numbers + c] * image[(size_t)j * numbers + c];
        gram[i * K + j] = dot;
      }
      w[i] = 0;
      for (size_t c = 0; c < numbers; c++)
        w[i] += strain[(size_t)i * numbers + c] * image[K * numbers + c];
    }
    double right[K];
    memcpy(right, w, sizeof w);
    ASSERT_OK(ep_solve_spd(K, gram, 1, w, err));
    for (int i = 0; i < K; i++) minus -= w[i] * right[i];
    const double energy = ep_green_full_energy(&s.full, u, y, NULL, got);
    // round-off times the condition of Q (below 1e3 here)
    ASSERT_LESS(fabs(energy - minus), 1e-11 * fabs(minus));
    for (int i = 0; i < K; i++) ASSERT_LESS(fabs(got[i] - w[i]), 1e-11 * (1 + fabs(w[i])));
    // and <E, E> is the elastic energy: the two terms share D
    dot = 0;
    for (size_t c = 0; c < numbers; c++) dot += strain[K * numbers + c] * image[K * numbers + c];
    ASSERT_LESS(fabs(dot - ep_fem_energy(&s.b.fem, u)), 1e-11 * dot);
  }
  free(strain);
  free(image);
  free(u);
  drop(&s);
}

// ---- derivatives -------------------------------------------------------------------------------

// (sparse part - 2 alpha columns^T C^-1 columns) d
static void apply(const scene *s, double alpha, const ep_csr *k, const double *columns,
                  const double *d, double *out) {
  ep_csr_multiply(k, 1, d, out);
  ASSERT_OK(ep_green_full_subtract(&s->full, alpha, columns, d, out, err));
}

// W_a is quartic while the set of negative weights stays: central differences have order 2.
static void check_derivatives(ep_green weak, int negative) {
  scene s;
  create(&s, K, 0);
  build(&s, K, NULL, NULL);
  s.full.weak = weak;
  const size_t n3 = s.b.n3;
  double *v = vector_of(8 * n3), *u = v, *d = v + n3, *f = v + 2 * n3, *hd = v + 3 * n3;
  double *plus = v + 4 * n3, *fp = v + 5 * n3, *minus = v + 6 * n3, *fm = v + 7 * n3, y[K];
  double *columns = vector_of(K * n3), error[2][2], w[K], wd[K];
  ep_csr k;
  ASSERT_OK(ep_csr_from_tets(s.b.mesh.nv, s.b.mesh.nt, s.b.mesh.tet, 3, &k, err));
  smooth_random(&s.b, 1, 0.3, u);
  smooth_random(&s.b, 2, negative ? 0.06 : 0.3, d);
  ep_green_full_energy(&s.full, u, y, f, w);
  ep_green_full_stiffness(&s.full, 1, u, y, &k, columns);
  apply(&s, 1, &k, columns, d, hd);
  double slope = 0;
  int below = 0;
  for (size_t a = 0; a < n3; a++) slope += f[a] * d[a];
  for (int j = 0; j < K; j++) below += w[j] < 0;
  if (negative) assert_true(below > 0); // else the penalty is not tested
  for (int level = 0; level < 2; level++) {
    const double t = level ? 0.05 : 0.1;
    for (size_t a = 0; a < n3; a++) plus[a] = u[a] + t * d[a], minus[a] = u[a] - t * d[a];
    const double wp = ep_green_full_energy(&s.full, plus, y, fp, wd);
    for (int j = 0; negative && j < K; j++) assert_int_equal(wd[j] < 0, w[j] < 0);
    const double wm = ep_green_full_energy(&s.full, minus, y, fm, wd);
    for (int j = 0; negative && j < K; j++) assert_int_equal(wd[j] < 0, w[j] < 0);
    error[level][0] = fabs((wp - wm) / (2 * t) - slope);
    for (size_t a = 0; a < n3; a++) fp[a] = (fp[a] - fm[a]) / (2 * t);
    error[level][1] = distance_of(n3, fp, hd);
  }
  for (int i = 0; i < 2; i++) ASSERT_LESS(fabs(order_of(error[0][i], error[1][i]) - 2), 0.1);
  free(v);
  free(columns);
  ep_csr_free(&k);
  drop(&s);
}

static void derivatives_match_differences(void **state) {
  (void)state;
  check_derivatives((ep_green){0}, 0);
  check_derivatives((ep_green){.sum_to_one = 0.7, .non_negative = 5}, 1);
}

// ---- invariance --------------------------------------------------------------------------------

// W_a(R (x + u) + t) = W_a(u), and its forces have neither resultant nor moment: linear and angular
// momentum are untouched.
static void rigid_motions_change_nothing(void **state) {
  (void)state;
  scene s;
  create(&s, K, 0);
  build(&s, K, NULL, NULL);
  const size_t n3 = s.b.n3;
  double *u = vector_of(3 * n3), *moved = u + n3, *f = u + 2 * n3, y[K];
  const double c = cos(2.1), sn = sin(2.1),
               r[9] = {c, -sn, 0, sn * 0.6, c * 0.6, -0.8, sn * 0.8, c * 0.8, 0.6};
  smooth_random(&s.b, 5, 0.4, u);
  for (int v = 0; v < s.b.mesh.nv; v++)
    for (int a = 0; a < 3; a++) {
      double sum = a + 1.5;
      for (int b = 0; b < 3; b++) sum += r[3 * a + b] * (s.b.mesh.x[3 * v + b] + u[3 * v + b]);
      moved[3 * v + a] = sum - s.b.mesh.x[3 * v + a];
    }
  const double w = ep_green_full_energy(&s.full, u, y, f, NULL);
  ASSERT_LESS(fabs(ep_green_full_energy(&s.full, moved, y, NULL, NULL) - w), 1e-12 * fabs(w));
  double force[3] = {0}, moment[3] = {0}, size = 0, arm = 0;
  for (int v = 0; v < s.b.mesh.nv; v++) {
    double x[3];
    for (int a = 0; a < 3; a++) {
      x[a] = s.b.mesh.x[3 * v + a] + u[3 * v + a];
      force[a] += f[3 * v + a];
      size += fabs(f[3 * v + a]);
      arm = fmax(arm, fabs(x[a]));
    }
    for (int a = 0; a < 3; a++) {
      const int p = (a + 1) % 3, q = (a + 2) % 3;
      moment[a] += x[p] * f[3 * v + q] - x[q] * f[3 * v + p];
    }
  }
  ASSERT_LESS(norm_of(3, force), 1e-13 * size);
  ASSERT_LESS(norm_of(3, moment), 1e-13 * size * arm);
  assert_true(size > 0);
  free(u);
  drop(&s);
}

static void vanishes_at_the_examples(void **state) {
  (void)state;
  scene s;
  create(&s, K, 0);
  build(&s, K, NULL, NULL);
  double *f = vector_of(2 * s.b.n3), *elastic = f + s.b.n3, y[K];
  for (int j = 0; j < K; j++) {
    const double *p = s.poses + (size_t)j * s.b.n3, w = ep_fem_energy(&s.b.fem, p);
    ASSERT_LESS(fabs(w + ep_green_full_energy(&s.full, p, y, f, NULL)), 1e-13 * w);
    ep_fem_force(&s.b.fem, p, elastic);
    for (size_t a = 0; a < s.b.n3; a++) f[a] += elastic[a];
    ASSERT_LESS(norm_of(s.b.n3, f), 1e-12 * norm_of(s.b.n3, elastic));
  }
  free(f);
  drop(&s);
}

// ---- many examples -----------------------------------------------------------------------------

// 32 examples from a handful: copies, pairs apart by 1e-7. The rank is found, the warnings name the
// examples concerned, weights and energy stay bounded, and the examples themselves are reproduced.
static void dependent_examples_do_no_harm(void **state) {
  (void)state;
  scene s;
  create(&s, MANY, 0);
  const size_t n3 = s.b.n3;
  for (size_t j = 10; j < 20; j++) memcpy(s.poses + j * n3, s.poses + (j - 10) * n3, n3 * 8);
  for (size_t j = 20; j < 26; j++)
    for (size_t a = 0; a < n3; a++)
      s.poses[j * n3 + a] = s.poses[(j - 20) * n3 + a] + 1e-7 * s.poses[28 * n3 + a];
  ep_log log = ep_log_default(true);
  build(&s, MANY, NULL, &log);
  assert_int_equal(s.full.space.count, 16); // 10 + 6 that are apart
  assert_int_equal(log.warnings, 26);       // 10 with a copy each, of which 6 also have a neighbour
  double y[MANY], w[MANY], *u = vector_of(n3);
  for (uint64_t trial = 0; trial < 50; trial++) {
    if (trial < MANY)
      memcpy(u, s.poses + trial * n3, n3 * 8);
    else
      smooth_random(&s.b, 1000 + trial, 0.4, u);
    const double elastic = ep_fem_energy(&s.b.fem, u);
    const double left = elastic + ep_green_full_energy(&s.full, u, y, NULL, w);
    ASSERT_LESS(-1e-12 * elastic, left);
    if (trial < MANY) ASSERT_LESS(left, 1e-8 * elastic); // what was dropped, at most
    for (int j = 0; j < MANY; j++) ASSERT_LESS(fabs(w[j]), 100);
  }
  free(u);
  drop(&s);
}

static void a_rigid_example_is_refused(void **state) {
  (void)state;
  scene s;
  create(&s, K, 0);
  for (size_t a = 0; a < s.b.n3; a++) s.poses[s.b.n3 + a] = 0.25;
  ep_error err = {0};
  assert_int_equal(
      ep_green_full_create(&s.b.fem, s.b.fem.volume, K, s.poses, NULL, NULL, &s.full, &err),
      EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "example 2"));
  drop(&s);
}

// ---- regions -----------------------------------------------------------------------------------

// Examples that act on the left and on the right third. A pose that is example 1 on the left and
// example 2 on the right gets weight 1 for both; one of them alone leaves the other's weight at 0.
static void regions_act_alone_and_together(void **state) {
  (void)state;
  scene s;
  create(&s, 2, 0);
  const size_t n3 = s.b.n3, nt = (size_t)s.b.mesh.nt;
  double *share = vector_of(2 * nt), *u = vector_of(n3);
  for (size_t e = 0; e < nt; e++) {
    double x = 0;
    for (int v = 0; v < 4; v++) x += s.b.mesh.x[3 * s.b.mesh.tet[4 * e + (size_t)v]] / 4;
    share[e] = x < 0.4;
    share[nt + e] = x > 0.6;
  }
  build(&s, 2, share, NULL);
  for (int which = 1; which <= 3; which++) {
    for (int v = 0; v < s.b.mesh.nv; v++)
      for (int a = 0; a < 3; a++) {
        const int right = s.b.mesh.x[3 * v] > 0.5;
        const size_t at = (size_t)(3 * v + a);
        u[at] = which >> right & 1 ? s.poses[(size_t)right * n3 + at] : 0;
      }
    double y[2], w[2];
    const double elastic = ep_fem_energy(&s.b.fem, u);
    const double energy = ep_green_full_energy(&s.full, u, y, NULL, w);
    for (int j = 0; j < 2; j++) ASSERT_LESS(fabs(w[j] - (which >> j & 1)), 1e-12);
    ASSERT_LESS(-1e-12 * elastic, elastic + energy);
  }
  free(share);
  free(u);
  drop(&s);
}

// ---- solve and equilibrium ---------------------------------------------------------------------

static void woodbury_solves_the_operator(void **state) {
  (void)state;
  scene s;
  create(&s, K, 1);
  build(&s, K, NULL, NULL);
  // C is not the identity; little of sum_to_one, or its pull makes K indefinite
  s.full.weak = (ep_green){.sum_to_one = 0.01, .non_negative = 3};
  const size_t n3 = s.b.n3;
  const double alpha = 0.8;
  double *v = vector_of(4 * n3), *u = v, *b = v + n3, *x = v + 2 * n3, *back = v + 3 * n3, y[K];
  double *columns = vector_of(K * n3), *work = vector_of((K + 1) * n3);
  ep_csr k;
  ep_factor *factor;
  smooth_random(&s.b, 3, 0.02, u);
  smooth_random(&s.b, 4, 1, b);
  ASSERT_OK(ep_fem_rest_stiffness(&s.b.fem, &k, err));
  ep_fem_stiffness(&s.b.fem, u, 0, &k);
  ep_green_full_energy(&s.full, u, y, NULL, NULL);
  ep_green_full_stiffness(&s.full, alpha, u, y, &k, columns);
  ASSERT_OK(ep_factor_create(&k, s.b.fem.held, 1, &factor, err));
  ASSERT_OK(ep_green_full_woodbury(&s.full, alpha, factor, columns, work, err));
  ASSERT_OK(ep_green_full_solve(&s.full, factor, columns, work, b, x, err));
  apply(&s, alpha, &k, columns, x, back);
  for (size_t a = 0; a < n3; a++)
    if (s.b.fem.held[a]) back[a] = b[a] = 0;
  ASSERT_LESS(distance_of(n3, back, b), 1e-9 * norm_of(n3, b)); // condition of K: below 1e5
  ep_factor_free(factor);
  ep_csr_free(&k);
  free(v);
  free(columns);
  free(work);
  drop(&s);
}

// The load that holds a small multiple of pose 1; with examples the same load carries further, and
// the more so the larger alpha: no resistance along the examples is left at alpha = 1 but that of
// the drift.
static void equilibrium_is_softer_along_examples(void **state) {
  (void)state;
  scene s;
  create(&s, 1, 1);
  build(&s, 1, NULL, NULL);
  const size_t n3 = s.b.n3;
  double *v = vector_of(3 * n3), *load = v, *u = v + n3, *at = v + 2 * n3, before = 0;
  for (size_t a = 0; a < n3; a++) at[a] = 0.2 * s.poses[a];
  ep_fem_force(&s.b.fem, at, load);
  for (size_t a = 0; a < n3; a++)
    if (s.b.fem.held[a]) load[a] = 0;
  for (int i = 0; i <= 2; i++) {
    ep_green_full_report report;
    ASSERT_OK(ep_green_full_equilibrium(&s.full, 0.4 * i, load, u, &report, err));
    ASSERT_LESS(report.residual, 1e-8);
    double y[1], w;
    ep_green_full_energy(&s.full, u, y, NULL, &w);
    ASSERT_LESS(before, w);
    before = w;
  }
  free(v);
  drop(&s);
}

// ---- reduced -----------------------------------------------------------------------------------

// y(q) = linear . q + 1/2 q^T B q equals the projection of the strains of U q, for the exact sum
// and for a few weighted elements. Round-off of sums over elements.
static void coefficients_equal_full_space(void **state) {
  (void)state;
  scene s;
  create(&s, R, 1); // the poses serve as modes
  const size_t n3 = s.b.n3, nt = (size_t)s.b.mesh.nt;
  double example_q[K * R] = {0}, *weight = vector_of(nt), *poses = vector_of(K * n3);
  double *u = vector_of(2 * n3), *f = u + n3;
  ep_random rng = ep_random_seed(9, 9);
  for (int i = 0; i < K * R; i++) example_q[i] = 0.3 * ep_random_normal(&rng);
  for (size_t i = 0; i < K * R; i++)
    for (size_t a = 0; a < n3; a++) poses[i / R * n3 + a] += example_q[i] * s.poses[i % R * n3 + a];
  const ep_basis basis = {
      .n = s.b.mesh.nv, .r = R, .examples = K, .u = s.poses, .example_q = example_q};
  for (int few = 0; few < 2; few++) {
    for (size_t e = 0; e < nt; e++) weight[e] = !few ? s.b.fem.volume[e] : e % 7 ? 0 : 0.01;
    ep_green_coefficients c;
    ep_green_full full;
    ASSERT_OK(ep_green_coefficients_compute(&s.b.fem, &basis, NULL, weight, NULL, NULL, &c, err));
    ASSERT_OK(ep_green_full_create(&s.b.fem, weight, K, poses, NULL, NULL, &full, err));
    assert_int_equal(c.count, K);
    double q[R], y[K], w[K], reduced[K], gradient[R] = {0}, along, size = 0;
    memset(u, 0, n3 * sizeof *u);
    for (int a = 0; a < R; a++) {
      q[a] = 0.3 * ep_random_normal(&rng);
      for (size_t i = 0; i < n3; i++) u[i] += q[a] * s.poses[(size_t)a * n3 + i];
    }
    ep_green_full_energy(&full, u, y, f, w);
    for (int i = 0; i < K; i++) {
      reduced[i] = 0;
      for (int a = 0; a < R; a++) {
        double bq = 0;
        for (int b = 0; b < R; b++) bq += c.b[(i * R + a) * R + b] * q[b];
        reduced[i] += q[a] * (c.linear[i * R + a] + 0.5 * bq);
        gradient[a] -= 2 * y[i] * (c.linear[i * R + a] + bq);
      }
      size += fabs(y[i]);
    }
    for (int i = 0; i < K; i++) {
      double rw = 0;
      for (int j = 0; j < K; j++) rw += c.weights[i * K + j] * reduced[j];
      ASSERT_LESS(fabs(rw - w[i]), 1e-9 * (1 + fabs(w[i])));
      ASSERT_LESS(fabs(fabs(reduced[i]) - fabs(y[i])), 1e-10 * size);
    }
    for (int a = 0; a < R; a++) {
      along = 0;
      for (size_t i = 0; i < n3; i++) along += f[i] * s.poses[(size_t)a * n3 + i];
      ASSERT_LESS(fabs(along - gradient[a]), 1e-10 * norm_of(n3, f) * norm_of(n3, s.poses));
    }
    ep_green_coefficients_free(&c);
    ep_green_full_free(&full);
  }
  free(weight);
  free(poses);
  free(u);
  drop(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(weights_equal_a_dense_solve),
      cmocka_unit_test(derivatives_match_differences),
      cmocka_unit_test(rigid_motions_change_nothing),
      cmocka_unit_test(vanishes_at_the_examples),
      cmocka_unit_test(dependent_examples_do_no_harm),
      cmocka_unit_test(a_rigid_example_is_refused),
      cmocka_unit_test(regions_act_alone_and_together),
      cmocka_unit_test(woodbury_solves_the_operator),
      cmocka_unit_test(equilibrium_is_softer_along_examples),
      cmocka_unit_test(coefficients_equal_full_space),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
