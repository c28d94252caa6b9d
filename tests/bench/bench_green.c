// The tables of Zhang et al. 2015 beside ours (theirs: one core of an i7-2600K, MKL). Usage:
//   bench_green [largest number of vertices of table 1, default 12000; 0: table 2 alone]
// Table 2: one Newton iteration of a reduced step on the exact path: quartic form with force and
// stiffness, Green-strain potential, Cholesky and solve. Table 1: one unreduced iteration on boxes
// of the paper's sizes (assembly, MUMPS Cholesky, Woodbury), projection of the external force and
// reconstruction. Minimum of at least 20 timings (unreduced: of 2).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "linalg/petsc.h"
#include "reduced/bake/green_full.h"
#include "reduced/cubic.h"
#include "reduced/state.h"
// the fixture of the bake tests and that of the run time have one name
#define bar reduced_bar
#include "tests/reduced/bar.h"
#undef bar
#include "tests/bake/bar.h"

enum { TIMINGS = 30, LARGEST = 70 };

// ---- reduced iteration -------------------------------------------------------------------------

typedef struct reduced {
  reduced_bar *b;
  void *block, *scratch, *stream;
  ep_state *state;
  ep_cubic cubic;
  double q[LARGEST], f[LARGEST], h[LARGEST * LARGEST], l[LARGEST * LARGEST], sum;
} reduced;

static void *need(size_t bytes) {
  void *p = aligned_alloc(64, (bytes + 63) / 64 * 64);
  if (!p) abort();
  memset(p, 0, bytes);
  return p;
}

// Coefficients of random size: the time does not depend on them.
static void set_up(reduced *x, int r, int k) {
  memset(x, 0, sizeof *x);
  x->b = bar_create(6, 3, 2, r, 30, 0, k, EP_STVK);
  x->state = bar_state(x->b, &x->block);
  const size_t count = ep_cubic_count(r);
  double *packed = need(count * sizeof *packed);
  for (size_t i = 0; i < count; i++) packed[i] = 1e-3 * bar_uniform(x->b);
  x->stream = need(ep_cubic_stream_size(r, EP_DOUBLE) * sizeof(double));
  if (ep_cubic_pack(r, packed, x->stream) != EP_OK ||
      ep_cubic_open(r, EP_DOUBLE, x->stream, &x->cubic) != EP_OK)
    abort();
  x->scratch = need(ep_cubic_scratch(r, EP_DOUBLE));
  bar_random_q(x->b, 0.3, x->q);
  free(packed);
}

static void clear(reduced *x) {
  free(x->block);
  free(x->scratch);
  free(x->stream);
  bar_free(x->b);
}

static void elastic_only(reduced *x) {
  x->sum += ep_cubic_evaluate(&x->cubic, x->q, x->f, x->h, x->scratch);
}

static void green_only(reduced *x) {
  const ep_green green = {.alpha = 0.9};
  x->sum += ep_green_add(x->state, &green, 0.9, x->q, x->f, x->h);
}

static void iteration(reduced *x) {
  const int r = x->b->model.size.r;
  elastic_only(x);
  if (x->b->model.size.greens) green_only(x);
  for (int a = 0; a < r; a++) x->h[(r + 1) * a] += 1e7; // inertia: positive definite
  if (!ep_cholesky(r, x->h, x->l)) abort();
  ep_solve_lower(r, x->l, x->f);
  ep_solve_lower_transposed(r, x->l, x->f);
  x->sum += x->f[0];
}

// Milliseconds: the best of TIMINGS, each of as many runs as make 2 ms.
static double best_of(reduced *x, void (*run)(reduced *)) {
  int runs = 1;
  double best = 1e9;
  for (int i = 0; i < TIMINGS;) {
    const double started = ep_seconds();
    for (int j = 0; j < runs; j++) run(x);
    const double seconds = ep_seconds() - started;
    if (seconds < 2e-3 && runs < 100000) {
      runs *= 2;
      continue;
    }
    best = fmin(best, 1e3 * seconds / runs);
    i++;
  }
  return best;
}

static void table_2(void) {
  static const int modes[] = {20, 30, 50, 70}, examples[] = {0, 1, 2, 4, 8, 16, 32};
  static const double paper[4][6] = {{0.0317, 0.0319, 0.0326, 0.0338, 0.0356, 0.0394},
                                     {0.0829, 0.0834, 0.0841, 0.0854, 0.0873, 0.0909},
                                     {1.44, 1.4415, 1.4431, 1.4457, 1.4501, 1.4564},
                                     {4.875, 4.880, 4.886, 4.896, 4.913, 4.945}};
  printf("table 2: one reduced iteration [ms], double, one core\n");
  printf("%4s %4s %10s %10s %10s %10s %12s\n", "r", "k", "iteration", "elastic", "green", "paper",
         "green bytes");
  double sum = 0;
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 7; j++) {
      static reduced x;
      set_up(&x, modes[i], examples[j]);
      const double whole = best_of(&x, iteration), elastic = best_of(&x, elastic_only);
      const double green = examples[j] ? best_of(&x, green_only) : 0;
      printf("%4d %4d %10.4f %10.4f %10.4f ", modes[i], examples[j], whole, elastic, green);
      if (j)
        printf("%10.4f", paper[i][j - 1]);
      else
        printf("%10s", "-");
      printf(" %12zu\n", (size_t)examples[j] * ep_packed_green_size(modes[i]) * 8);
      sum += x.sum;
      if (i == 3 && j == 6) printf("isa %s, checksum %.6g\n", ep_state_isa(x.state), sum);
      clear(&x);
    }
}

// ---- unreduced ---------------------------------------------------------------------------------

typedef struct model {
  const char *name;
  int cells[3], k;
  double paper[3]; // unreduced, reduced, projection + reconstruction [ms]
} model;

// Projection U^T f and reconstruction X + U z with r = 50.
static double move_time(size_t n3) {
  enum { R50 = 50 };
  double *u = need(R50 * n3 * sizeof *u), *x = need(2 * n3 * sizeof *x), *f = x + n3, best = 1e9;
  for (size_t i = 0; i < R50 * n3; i++) u[i] = (double)(i % 17) - 8;
  for (size_t i = 0; i < n3; i++) f[i] = (double)(i % 5);
  for (int t = 0; t < 20; t++) {
    double z[R50];
    const double started = ep_seconds();
    for (size_t a = 0; a < R50; a++) z[a] = 1e-3 * ep_dot((int)n3, u + a * n3, f);
    memset(x, 0, n3 * sizeof *x);
    for (size_t a = 0; a < R50; a++)
      for (size_t i = 0; i < n3; i++) x[i] += z[a] * u[a * n3 + i];
    best = fmin(best, 1e3 * (ep_seconds() - started));
  }
  free(u);
  free(x);
  return best;
}

// One iteration at a bent pose: assembly, factor, Woodbury. parts: assembly, factor, solves [ms].
static double full_iteration(const model *m, int k, int *nv, int *nt, double parts[3]) {
  const double size[3] = {0.1 * m->cells[0], 0.1 * m->cells[1], 0.1 * m->cells[2]};
  const ep_elastic rubber = {.density = 1000, .young = 2e5, .poisson = 0.35};
  bar b;
  ep_green_full full = {0};
  ep_csr stiffness;
  ep_factor *factor;
  make_bar(&b, m->cells, size, EP_STVK, rubber, 1);
  *nv = b.mesh.nv, *nt = b.mesh.nt;
  const size_t n3 = b.n3, most = (size_t)(k ? k : 1);
  double *poses = vector_of(most * n3), *u = vector_of(3 * n3), *f = u + n3, *x = u + 2 * n3, y[8];
  double *columns = vector_of(most * n3), *work = vector_of((most + 1) * n3), best = 1e18;
  for (int j = 0; j < k; j++) smooth_random(&b, (uint64_t)j, 0.05, poses + (size_t)j * n3);
  smooth_random(&b, 9, 0.005, u);
  if (k) ASSERT_OK(ep_green_full_create(&b.fem, b.fem.volume, k, poses, NULL, NULL, &full, err));
  ASSERT_OK(ep_fem_rest_stiffness(&b.fem, &stiffness, err));
  ASSERT_OK(ep_factor_create(&stiffness, b.fem.held, 1, &factor, err));
  for (int t = 0; t < 2; t++) {
    const double started = ep_seconds();
    ep_fem_force(&b.fem, u, f);
    ep_fem_stiffness(&b.fem, u, 0, &stiffness);
    if (k) {
      ep_green_full_energy(&full, u, y, x, NULL);
      ep_green_full_stiffness(&full, 0.5, u, y, &stiffness, columns);
    }
    for (size_t i = 0; i < n3; i++) // inertia of 1/50 s
      stiffness.value[ep_csr_find(&stiffness, (int)i, (int)i)] += 1000 * 1e-3 / 6 * 2500;
    const double assembled = ep_seconds();
    ASSERT_OK(ep_factor_update(factor, &stiffness, err));
    const double factored = ep_seconds();
    if (k) {
      ASSERT_OK(ep_green_full_woodbury(&full, 0.5, factor, columns, work, err));
      ASSERT_OK(ep_green_full_solve(&full, factor, columns, work, f, x, err));
    } else {
      ASSERT_OK(ep_factor_solve(factor, 1, f, x, err));
    }
    const double whole = 1e3 * (ep_seconds() - started);
    if (whole >= best) continue;
    best = whole;
    parts[0] = 1e3 * (assembled - started);
    parts[1] = 1e3 * (factored - assembled);
    parts[2] = whole - parts[0] - parts[1];
  }
  ep_factor_free(factor);
  ep_csr_free(&stiffness);
  ep_green_full_free(&full);
  free(poses), free(u), free(columns), free(work);
  free_bar(&b);
  return best;
}

static void table_1(int largest) {
  static const model list[] = {
      {"cup", {24, 24, 2}, 0, {85.19, 1.439, 0.381}},
      {"cup", {24, 24, 2}, 1, {86.87, 1.44, 0.381}},
      {"dog", {20, 15, 5}, 2, {54.92, 1.441, 0.394}},
      {"teddy", {24, 20, 20}, 0, {1109.12, 1.439, 2.19}},
      {"teddy", {24, 20, 20}, 1, {1115.2, 1.44, 2.19}},
      {"shoe", {40, 32, 30}, 0, {8025.09, 1.439, 9.05}},
      {"shoe", {40, 32, 30}, 2, {8049.16, 1.441, 9.05}},
      {"car", {60, 33, 33}, 0, {15961.3, 1.439, 15.895}},
      {"car", {60, 33, 33}, 1, {16012.1, 1.44, 15.895}},
  };
  printf("table 1: boxes of the paper's sizes, r = 50 [ms]\n");
  printf("%-6s %7s %7s %2s %11s %9s %9s %9s %9s %11s %9s %9s\n", "size", "n", "m", "k", "unreduced",
         "assembly", "factor", "solves", "reduced", "U^Tf, X+Uz", "paper", "paper red.");
  for (size_t i = 0; i < sizeof list / sizeof *list; i++) {
    const model *m = &list[i];
    static reduced x;
    int nv = (m->cells[0] + 1) * (m->cells[1] + 1) * (m->cells[2] + 1), nt;
    double parts[3] = {0};
    if (nv > largest) continue;
    const double full = full_iteration(m, m->k, &nv, &nt, parts);
    set_up(&x, 50, m->k);
    printf("%-6s %7d %7d %2d %11.1f %9.1f %9.1f %9.1f %9.4f %11.3f %9.1f %9.3f\n", m->name, nv, nt,
           m->k, full, parts[0], parts[1], parts[2], best_of(&x, iteration),
           move_time(3 * (size_t)nv), m->paper[0], m->paper[1]);
    fflush(stdout);
    clear(&x);
  }
}

int main(int argc, char **argv) {
  ep_error err = {0};
  const int largest = argc > 1 ? atoi(argv[1]) : 12000;
  printf("compiler %s\n", __VERSION__);
  table_2();
  if (largest == 0) return 0;
  if (ep_petsc_start(&err) != EP_OK) return fprintf(stderr, "%s\n", err.text), 1;
  table_1(largest);
  ep_petsc_stop();
  return 0;
}
