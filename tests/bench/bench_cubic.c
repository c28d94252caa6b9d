// Benchmark of the cubic path: force + stiffness of one state and of batches against the classic
// evaluation of Barbic and James (2005) as matrix-vector products of OpenBLAS on unsymmetrised
// coefficients (force r x r(r+1)(r+2)/6, stiffness r(r+1)/2 squared, highest degrees only), the
// rates of this machine beside it; and the bake against the machine's rank-k update.
//   bench_cubic [cells]: elements of the bake are 6 * 4 * 4 * cells (default 90: 8,640)
// Least time of many; warm: the same call again; cold: caches flushed before each call.
#include <cblas.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/blas_core.h"
#include "base/log.h"
#include "reduced/bake/cubic_coefficients.h"
#include "reduced/cubic.h"
#include "tests/bake/bar.h"

enum { WARM = 60, COLD = 20, STATES = 64, FLUSH = 96 << 20 };

extern char *openblas_get_corename(void);
extern void openblas_set_num_threads(int);

static double *flush_memory;
static double checksum;

static void *block_of(size_t bytes) {
  void *block = aligned_alloc(64, (bytes + 63) / 64 * 64);
  if (!block) {
    fprintf(stderr, "bench_cubic: no memory for %zu bytes\n", bytes);
    exit(1);
  }
  memset(block, 0, bytes);
  return block;
}

static double uniform(void) {
  static uint32_t seed = 7;
  seed = seed * 1664525u + 1013904223u;
  return (double)seed / 2147483648.0 - 1;
}

static void flush(void) {
  for (size_t i = 0; i < FLUSH / sizeof *flush_memory; i += 8)
    checksum += flush_memory[i] += 1e-300;
}

typedef struct subject {
  int r, states;
  ep_precision precision;
  ep_cubic cubic;
  size_t reals; // of the stream
  void *stream, *scratch, *batch_scratch;
  double *q, *f, *k, *energy;
  // baseline
  void *stiffness, *force, *pairs, *triples, *k_out, *f_out, *q_real;
} subject;

typedef void (*work)(subject *s);

static double least(work run, subject *s, int cold) {
  double best = HUGE_VAL;
  for (int i = 0; i < (cold ? COLD : WARM); i++) {
    if (cold) flush();
    const double started = ep_seconds();
    run(s);
    best = fmin(best, ep_seconds() - started);
  }
  return best;
}

static void evaluate(subject *s) {
  checksum += ep_cubic_evaluate(&s->cubic, s->q, s->f, s->k, s->scratch) + s->f[0] + s->k[1];
}

static void batch(subject *s) {
  ep_cubic_batch(&s->cubic, s->states, s->q, s->energy, s->f, s->k, s->batch_scratch);
  checksum += s->energy[0];
}

// ---- baseline (a) ------------------------------------------------------------------------------

#define BASELINE(name, real, gemv)                                                                 \
  static void name(subject *s) {                                                                   \
    const int r = s->r, pairs = r * (r + 1) / 2, triples = r * (r + 1) * (r + 2) / 6;              \
    real *q = s->q_real, *qq = s->pairs, *qqq = s->triples, *k = s->k_out, *f = s->f_out;          \
    int at = 0, place = 0;                                                                         \
    for (int a = 0; a < r; a++)                                                                    \
      for (int b = 0; b <= a; b++) qq[at++] = q[a] * q[b];                                         \
    for (int a = 0; a < r; a++) {                                                                  \
      const int count = (a + 1) * (a + 2) / 2;                                                     \
      for (int i = 0; i < count; i++) qqq[place + i] = q[a] * qq[i];                               \
      place += count;                                                                              \
    }                                                                                              \
    gemv(CblasRowMajor, CblasNoTrans, pairs, pairs, 1, s->stiffness, pairs, qq, 1, 0, k, 1);       \
    gemv(CblasRowMajor, CblasNoTrans, r, triples, 1, s->force, triples, qqq, 1, 0, f, 1);          \
    checksum += (double)(k[0] + f[0]);                                                             \
  }
BASELINE(baseline_double, double, cblas_dgemv)
BASELINE(baseline_float, float, cblas_sgemv)

static void fill(void *out, size_t count, int wide) {
  double *d = out;
  float *f = out;
  for (size_t i = 0; i < count; i++)
    if (wide)
      d[i] = uniform();
    else
      f[i] = (float)uniform();
}

static void set_up(subject *s, int r, ep_precision precision) {
  const int wide = precision == EP_DOUBLE;
  const size_t n = (size_t)r, pairs = n * (n + 1) / 2, triples = n * (n + 1) * (n + 2) / 6;
  const size_t size = wide ? sizeof(double) : sizeof(float), count = ep_cubic_count(r);
  *s = (subject){.r = r, .precision = precision, .reals = ep_cubic_stream_size(r, precision)};
  double *packed = block_of(count * sizeof *packed);
  fill(packed, count, 1);
  s->stream = block_of(s->reals * size);
  const ep_status status =
      wide ? ep_cubic_pack(r, packed, s->stream) : ep_cubic_pack_float(r, packed, s->stream);
  if (status != EP_OK || ep_cubic_open(r, precision, s->stream, &s->cubic) != EP_OK) exit(1);
  free(packed);
  s->scratch = block_of(ep_cubic_scratch(r, precision));
  s->batch_scratch = block_of(ep_cubic_batch_scratch(r, precision));
  s->q = block_of(STATES * n * sizeof(double)), s->f = block_of(STATES * n * sizeof(double));
  s->k = block_of(STATES * n * n * sizeof(double)), s->energy = block_of(STATES * sizeof(double));
  fill(s->q, STATES * n, 1);
  s->stiffness = block_of(pairs * pairs * size), s->force = block_of(n * triples * size);
  s->pairs = block_of(pairs * size), s->triples = block_of(triples * size);
  s->k_out = block_of(pairs * size), s->f_out = block_of(n * size), s->q_real = block_of(n * size);
  fill(s->stiffness, pairs * pairs, wide), fill(s->force, n * triples, wide);
  fill(s->q_real, n, wide);
}

static void tear_down(subject *s) {
  void *all[] = {s->stream,  s->scratch, s->batch_scratch, s->q,     s->f,
                 s->k,       s->energy,  s->stiffness,     s->force, s->pairs,
                 s->triples, s->k_out,   s->f_out,         s->q_real};
  for (size_t i = 0; i < sizeof all / sizeof *all; i++) free(all[i]);
}

// ---- the machine -------------------------------------------------------------------------------

// Bytes a second of reading `bytes` again and again (one dot product with itself).
static double read_rate(size_t bytes) {
  const int n = (int)(bytes / sizeof(double));
  double *x = block_of(bytes), best = HUGE_VAL;
  fill(x, (size_t)n, 1);
  for (int i = 0; i < WARM; i++) {
    const double started = ep_seconds();
    checksum += cblas_ddot(n, x, 1, x, 1);
    best = fmin(best, ep_seconds() - started);
  }
  free(x);
  return (double)bytes / best;
}

static double gemm_rate(int wide) {
  enum { N = 512 };
  void *a = block_of(N * N * 8), *b = block_of(N * N * 8), *c = block_of(N * N * 8);
  double best = HUGE_VAL;
  fill(a, N * N, wide), fill(b, N * N, wide);
  for (int i = 0; i < 20; i++) {
    const double started = ep_seconds();
    if (wide)
      cblas_dgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, N, N, N, 1, a, N, b, N, 0, c, N);
    else
      cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, N, N, N, 1, a, N, b, N, 0, c, N);
    best = fmin(best, ep_seconds() - started);
  }
  free(a), free(b), free(c);
  return 2.0 * N * N * N / best;
}

// ---- the bake ----------------------------------------------------------------------------------

static double syrk_rate(int n, int k) {
  double *a = block_of((size_t)n * (size_t)k * sizeof *a), *c = block_of((size_t)n * (size_t)n * 8);
  double best = HUGE_VAL;
  fill(a, (size_t)n * (size_t)k, 1);
  for (int i = 0; i < 3; i++) {
    const double started = ep_seconds();
    cblas_dsyrk(CblasRowMajor, CblasLower, CblasTrans, n, k, 1, a, n, 0, c, n);
    best = fmin(best, ep_seconds() - started);
  }
  free(a), free(c);
  return (double)n * (n + 1) * k / best;
}

static void bake(int cells_x) {
  enum { R = 50 };
  const int cells[3] = {cells_x, 4, 4};
  const double size[3] = {4, 1, 1};
  const ep_elastic elastic = {.density = 1000, .young = 1e5, .poisson = 0.4};
  ep_log log = {.quiet = true};
  ep_error err = {0};
  ep_cubic_report report;
  bar b;
  make_bar(&b, cells, size, EP_STVK, elastic, 1);
  double *u = block_of(R * b.n3 * sizeof *u),
         *packed = block_of(ep_cubic_count(R) * sizeof *packed);
  for (int a = 0; a < R; a++) smooth_random(&b, (uint64_t)a + 1, 1, u + (size_t)a * b.n3);
  const double started = ep_seconds();
  if (ep_cubic_coefficients(&b.fem, R, u, &log, packed, &report, &err) != EP_OK) {
    fprintf(stderr, "bench_cubic: %s\n", err.text);
    exit(1);
  }
  const double seconds = ep_seconds() - started, rate = report.update_flops / seconds;
  const double machine = syrk_rate(R * (R + 3) / 2, 6144);
  printf(
      "bake: %d tets, r = %d: %.2f s (strains %.2f, updates %.2f), %.1f GFLOP/s in all, %.0f %% of "
      "dsyrk's %.1f; %.0f MB; 52,000 tets %.1f s, 364,000 tets %.0f s\n",
      b.mesh.nt, R, seconds, report.strain_seconds, report.update_seconds, rate * 1e-9,
      100 * rate / machine, machine * 1e-9, (double)report.bytes / 1048576,
      seconds / b.mesh.nt * 52000, seconds / b.mesh.nt * 364000);
  checksum += packed[100];
  free(u), free(packed);
  free_bar(&b);
}

// ---- table -------------------------------------------------------------------------------------

static void row(int r, ep_precision precision, double gemm) {
  const int wide = precision == EP_DOUBLE;
  subject s;
  set_up(&s, r, precision);
  const double bytes = (double)s.reals * (wide ? 8 : 4);
  const double flops = 6.0 * (double)ep_cubic_count(r) + 1.0 * pow(r + 1, 3);
  const work baseline = wide ? baseline_double : baseline_float;
  const double base = least(baseline, &s, 0), warm = least(evaluate, &s, 0);
  const double base_cold = least(baseline, &s, 1), cold = least(evaluate, &s, 1);
  const double read = read_rate((size_t)bytes > 4096 ? (size_t)bytes : 4096);
  double each[3];
  const int states[3] = {8, 16, STATES};
  for (int i = 0; i < 3; i++) {
    s.states = states[i];
    each[i] = least(batch, &s, 0) / states[i];
  }
  printf(
      "%-6s %3d %9.2f %8.2f %6.1f %9.2f %8.2f %6.1f %7.1f %4.0f%% %7.1f %4.0f%% %8.2f %8.2f %8.2f "
      "%5.2f\n",
      wide ? "double" : "float", r, base * 1e6, warm * 1e6, base / warm, base_cold * 1e6,
      cold * 1e6, base_cold / cold, bytes / warm * 1e-9, 100 * bytes / warm / read,
      flops / warm * 1e-9, 100 * flops / warm / gemm, each[0] * 1e6, each[1] * 1e6, each[2] * 1e6,
      each[wide ? 0 : 1] / warm);
  tear_down(&s);
}

int main(int argc, char **argv) {
  ep_blas_core_check(argv);
  openblas_set_num_threads(1);
  flush_memory = block_of(FLUSH);
  const int cells = argc > 1 ? atoi(argv[1]) : 90, sizes[] = {10, 20, 30, 50, 70};
  const double gemm[2] = {gemm_rate(0), gemm_rate(1)};
  subject any;
  set_up(&any, 4, EP_DOUBLE);
  printf("compiler %s; kernels %s; OpenBLAS %s: dgemm %.1f, sgemm %.1f GFLOP/s\n", __VERSION__,
         any.cubic.isa, openblas_get_corename(), gemm[1] * 1e-9, gemm[0] * 1e-9);
  tear_down(&any);
  printf("reading %.0f GB/s from 256 KiB, %.0f from 2.5 MiB, %.0f from 96 MiB\n",
         read_rate(256 << 10) * 1e-9, read_rate(5 << 19) * 1e-9, read_rate(96 << 20) * 1e-9);
  printf(
      "us of force + stiffness; shares: of reading the coefficients alone (warm), of gemm; batches "
      "us a state\n");
  printf("%-6s %3s %9s %8s %6s %9s %8s %6s %7s %5s %7s %5s %8s %8s %8s %5s\n", "", "r", "baseline",
         "warm", "ratio", "baseline", "cold", "ratio", "GB/s", "", "GFLOP/s", "", "8", "16", "64",
         "ratio");
  for (int precision = EP_DOUBLE; precision <= EP_FLOAT; precision++)
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
      row(sizes[i], precision, gemm[precision == EP_DOUBLE]);
  if (cells > 0) bake(cells);
  printf("checksum %.17g\n", checksum);
  free(flush_memory);
  return 0;
}
