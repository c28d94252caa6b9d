// Run-time benchmarks: {name, setup, run, bytes, flops}; warm, minimum of at least 20 timings, each
// long enough to be resolved. `bytes` is what a run must read from the model, `flops` the
// multiplies and adds of the sums over modes (the laws not counted).
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "reduced/bake/nlopt_target.h"
#include "reduced/kernel.h"
#include "tests/reduced/bar.h"

enum { TIMINGS = 30, LARGEST = 80 };

typedef struct bench {
  bar *b;
  void *block;
  ep_state *state;
  ep_nlopt_target *nlopt;
  int solver;        // 1: NLopt
  float *g, *packed; // for floats: (s x 9 x r) plain, and as the kernels read it
  double gradient;   // largest relative gradient an interpolation ended with
  double q[LARGEST], load[LARGEST], target[LARGEST], f[LARGEST], k[LARGEST * LARGEST];
  double *start; // warm state, restored before each timing of steps
  size_t bytes;
  double sum;
  long evaluations, count;
} bench;

// ---- what is measured --------------------------------------------------------------------------

static void force_and_stiffness(bench *x) {
  x->sum += ep_elastic_energy(x->state, x->q, x->f, x->k, 0) + x->f[0] + x->k[1];
}

static void energy_and_force(bench *x) {
  x->sum += ep_elastic_energy(x->state, x->q, x->f, NULL, 0) + x->f[0];
}

// Rest and two examples in one evaluation.
static void target_terms(bench *x) {
  const double w[3] = {0.3, 0.4, 0.3};
  x->sum += ep_target_energy(x->state, w, x->q, x->f, x->k, 0) + x->f[0] + x->k[1];
}

// The naive baseline: element by element, plain loops over G (9 x r).
static void naive(bench *x) {
  const int r = x->b->model.size.r;
  const ep_model *m = &x->b->model;
  memset(x->f, 0, sizeof x->f);
  memset(x->k, 0, sizeof x->k);
  double energy = 0, f[9], p[9], h[81], hg[9 * LARGEST];
  for (int e = 0; e < m->size.s; e++) {
    const double *g = x->b->g + 9 * (size_t)m->cubature_tet[e] * (size_t)r, w = m->cubature_w[e];
    for (int c = 0; c < 9; c++) {
      f[c] = c % 4 == 0;
      for (int a = 0; a < r; a++) f[c] += g[c * r + a] * x->q[a];
    }
    energy += w * ep_material_energy(m->material, m->cubature_lambda[e], m->cubature_mu[e], f);
    ep_material_stress(m->material, m->cubature_lambda[e], m->cubature_mu[e], f, p);
    ep_material_tangent(m->material, m->cubature_lambda[e], m->cubature_mu[e], f, h);
    memset(hg, 0, sizeof hg);
    for (int c = 0; c < 9; c++) {
      for (int a = 0; a < r; a++) x->f[a] += w * p[c] * g[c * r + a];
      for (int d = 0; d < 9; d++)
        for (int a = 0; a < r; a++) hg[c * r + a] += w * h[9 * c + d] * g[d * r + a];
    }
    for (int c = 0; c < 9; c++)
      for (int a = 0; a < r; a++)
        for (int o = 0; o < r; o++) x->k[a * r + o] += g[c * r + a] * hg[c * r + o];
  }
  x->sum += energy + x->f[0] + x->k[1];
}

// The same in floats; the laws are scalar functions of doubles in both.
static void naive_float(bench *x) {
  const int r = x->b->model.size.r;
  const ep_model *m = &x->b->model;
  float force[LARGEST], k[LARGEST * LARGEST];
  memset(force, 0, sizeof force);
  memset(k, 0, sizeof k);
  double energy = 0, f[9], p[9], h[81];
  float q[LARGEST], hg[9 * LARGEST];
  for (int a = 0; a < r; a++) q[a] = (float)x->q[a];
  for (int e = 0; e < m->size.s; e++) {
    const float *g = x->g + 9 * (size_t)e * (size_t)r;
    const double w = m->cubature_w[e];
    for (int c = 0; c < 9; c++) {
      float sum = c % 4 == 0;
      for (int a = 0; a < r; a++) sum += g[c * r + a] * q[a];
      f[c] = (double)sum;
    }
    energy += w * ep_material_energy(m->material, m->cubature_lambda[e], m->cubature_mu[e], f);
    ep_material_stress(m->material, m->cubature_lambda[e], m->cubature_mu[e], f, p);
    ep_material_tangent(m->material, m->cubature_lambda[e], m->cubature_mu[e], f, h);
    memset(hg, 0, sizeof hg);
    for (int c = 0; c < 9; c++) {
      const float wp = (float)(w * p[c]);
      for (int a = 0; a < r; a++) force[a] += wp * g[c * r + a];
      for (int d = 0; d < 9; d++) {
        const float wh = (float)(w * h[9 * c + d]);
        for (int a = 0; a < r; a++) hg[c * r + a] += wh * g[d * r + a];
      }
    }
    for (int c = 0; c < 9; c++)
      for (int a = 0; a < r; a++)
        for (int o = 0; o < r; o++) k[a * r + o] += g[c * r + a] * hg[c * r + o];
  }
  x->f[0] = (double)force[0], x->k[1] = (double)k[1];
  x->sum += energy + x->f[0] + x->k[1];
}

static ep_step_def step_def(bench *x) {
  ep_step_def def = ep_default_step();
  def.force = x->load, def.damping_stiffness = 0.005;
  if (x->solver) def.target_solver = ep_nlopt_target_solve, def.target_user = x->nlopt;
  return def;
}

static void interpolate(bench *x) {
  ep_step_def def = step_def(x);
  ep_target_report report;
  if (ep_interpolate(x->state, &def, &report) != EP_OK) abort();
  x->evaluations += report.evaluations, x->count++;
  x->gradient = fmax(x->gradient, report.relative_gradient);
}

static void step(bench *x) {
  ep_step_def def = step_def(x);
  ep_step_report report;
  if (ep_step(x->state, &def, &report) != EP_OK) abort();
  x->evaluations += report.newton_iterations, x->count++;
  x->gradient = fmax(x->gradient, report.target.relative_gradient);
  x->sum += report.elastic_energy;
}

// ---- table -------------------------------------------------------------------------------------

typedef struct bench_row {
  const char *name;
  void (*run)(bench *);
  int r, s, k, solver, stateful; // stateful: state restored before every run, one run a timing
  int floats;
  const char *algorithm; // of NLopt
  int guards;            // (reduced/guard.h)
} bench_row;

static const bench_row rows[] = {
    {"naive force+stiffness", naive, 30, 60, 0, 0, 0, 0, NULL, 0},
    {"force+stiffness", force_and_stiffness, 30, 60, 0, 0, 0, 0, NULL, 0},
    {"naive, float", naive_float, 30, 60, 0, 0, 0, 1, NULL, 0},
    {"force+stiffness, float", force_and_stiffness, 30, 60, 0, 0, 0, 1, NULL, 0},
    {"energy+force", energy_and_force, 30, 60, 0, 0, 0, 0, NULL, 0},
    {"target (3 shapes)", target_terms, 30, 60, 2, 0, 0, 0, NULL, 0},
    {"naive force+stiffness", naive, 60, 200, 0, 0, 0, 0, NULL, 0},
    {"force+stiffness", force_and_stiffness, 60, 200, 0, 0, 0, 0, NULL, 0},
    {"naive, float", naive_float, 60, 200, 0, 0, 0, 1, NULL, 0},
    {"force+stiffness, float", force_and_stiffness, 60, 200, 0, 0, 0, 1, NULL, 0},
    {"interpolation, Newton", interpolate, 30, 60, 2, 0, 1, 0, NULL, 0},
    {"interpolation, NLopt", interpolate, 30, 60, 2, 1, 1, 0, NULL, 0},
    {"step without examples", step, 30, 60, 0, 0, 1, 0, NULL, 0},
    {"step w/o ex., guards", step, 30, 60, 0, 0, 1, 0, NULL, 256},
    {"step, Newton", step, 30, 60, 2, 0, 1, 0, NULL, 0},
    {"step, Newton, guards", step, 30, 60, 2, 0, 1, 0, NULL, 256},
    {"step, Newton, float", step, 30, 60, 2, 0, 1, 1, NULL, 0},
    {"step, LD_LBFGS", step, 30, 60, 2, 1, 1, 0, "LD_LBFGS", 0},
    {"step, LD_SLSQP", step, 30, 60, 2, 1, 1, 0, "LD_SLSQP", 0},
    {"step, LD_TNEWTON_P..", step, 30, 60, 2, 1, 1, 0, "LD_TNEWTON_PRECOND_RESTART", 0},
    {"step, LD_VAR1", step, 30, 60, 2, 1, 1, 0, "LD_VAR1", 0},
    {"step, LD_VAR2", step, 30, 60, 2, 1, 1, 0, "LD_VAR2", 0},
    {"step, LD_MMA", step, 30, 60, 2, 1, 1, 0, "LD_MMA", 0},
};

static void use_floats(bench *x) {
  ep_model *m = &x->b->model;
  const int r = m->size.r, s = m->size.s;
  const size_t each = 9 * (size_t)r, bytes = ep_packed_cubature_float_size(r, s) * sizeof(float);
  double *g = malloc((size_t)s * each * sizeof *g);
  x->g = malloc((size_t)s * each * sizeof *x->g);
  x->packed = aligned_alloc(64, (bytes + 63) / 64 * 64);
  if (!g || !x->g || !x->packed) abort();
  for (int e = 0; e < s; e++)
    memcpy(g + (size_t)e * each, x->b->g + (size_t)m->cubature_tet[e] * each, each * sizeof *g);
  for (size_t i = 0; i < (size_t)s * each; i++) x->g[i] = (float)g[i];
  if (ep_pack_cubature_float(r, s, g, x->packed) != EP_OK) abort();
  m->size.cubature_float = s, m->cubature_g_float = x->packed;
  m->evaluator = EP_EVALUATE_CUBATURE_FLOAT;
  free(g);
}

static void set_up(bench *x, const bench_row *row) {
  memset(x, 0, sizeof *x);
  x->b = bar_create(8, 3, 3, row->r, row->s, row->k ? 10 : 0, row->k, EP_STVK_VOLUME);
  if (row->floats) use_floats(x);
  if (row->guards) bar_add_guards(x->b, row->guards, 0.3);
  x->state = bar_state(x->b, &x->block);
  x->solver = row->solver;
  ep_error err = {0};
  if (row->solver && ep_nlopt_target_create(x->state, row->algorithm, 0, &x->nlopt, &err) != EP_OK)
    abort();
  bar_random_q(x->b, 0.3, x->q);
  ep_elastic_energy(x->state, x->q, x->load, NULL, 0);
  x->bytes = ep_state_bytes(&x->b->model);
  x->start = malloc(x->bytes);
  if (!x->start) abort();
  for (int i = 0; row->stateful && i < 20; i++) step(x); // a state in motion
  x->evaluations = x->count = 0, x->gradient = 0;
  memcpy(x->start, x->block, x->bytes);
}

static void tear_down(bench *x) {
  ep_nlopt_target_free(x->nlopt);
  free(x->block), free(x->start), free(x->g), free(x->packed);
  bar_free(x->b);
}

// Seconds of one run: repetitions doubled until 2 ms are reached, then the least of many.
static double least_time(bench *x, const bench_row *row) {
  double least = HUGE_VAL;
  long repeat = 1;
  for (int timing = 0; timing < TIMINGS; timing++) {
    if (row->stateful) memcpy(x->block, x->start, x->bytes);
    double begin = ep_seconds();
    for (long i = 0; i < repeat; i++) row->run(x); // states: a run of consecutive steps
    double seconds = ep_seconds() - begin;
    if (!row->stateful && timing == 0 && seconds < 2e-3) {
      repeat *= 2, timing = -1;
      continue;
    }
    if (row->stateful && timing == 0) repeat = 10;
    if (timing > 0) least = fmin(least, seconds / (double)repeat);
  }
  return least;
}

int main(void) {
  printf("compiler %s\n", __VERSION__);
  printf("%-24s %4s %4s %2s %9s %8s %7s %7s %6s %s\n", "name", "r", "s", "k", "us", "GFLOP/s",
         "GB/s", "KiB", "iter", "checksum (steps: largest relative gradient in place of KiB)");
  for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
    const bench_row *row = &rows[i];
    bench x;
    set_up(&x, row);
    if (i == 0) printf("kernels %s\n", ep_state_isa(x.state));
    double t = least_time(&x, row), r = row->r, s = row->s;
    double flops = s * (2 * 9 * r + 2 * 9 * r);
    double bytes = row->floats ? s * 9 * 16 * ceil(r / 16) * 4 : s * 9 * 8 * ceil(r / 8) * 8;
    if (row->run != energy_and_force) flops += s * (2 * 81 * r + 9 * r * (r + 1));
    printf("%-24s %4d %4d %2d %9.2f ", row->name, row->r, row->s, row->k, t * 1e6);
    if (row->stateful)
      printf("%8s %7s %7.0e %6.1f", "", "", x.gradient, (double)x.evaluations / (double)x.count);
    else
      printf("%8.1f %7.1f %7.1f %6s", flops / t * 1e-9, bytes / t * 1e-9, bytes / 1024, "");
    printf(" %.17g\n", x.k[1] + x.f[0]);
    tear_down(&x);
  }
  return 0;
}
