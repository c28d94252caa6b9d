// Cubic coefficients against the full-space sums they stand for: W(q), f = dW/dq and K = U^T K(Uq)
// U of all elements to 1e-12 (twice a chunk of elements, two materials); K at rest is U^T K(0) U; a
// rigid rotation in the subspace costs nothing; wrong materials are refused.
#include "reduced/bake/cubic_coefficients.h"
#include "reduced/cubic.h"
#include "tests/bake/bar.h"

enum { MODES = 17, PAIRS = MODES * MODES };

typedef struct subject {
  bar b;
  double *u, *packed, *stream, *full, *force;
  void *scratch;
  ep_cubic cubic;
  ep_csr k;
} subject;

static void set_up(subject *s, int modes) {
  const int cells[3] = {7, 4, 4}; // 672 elements: three chunks, the last one a part
  const double size[3] = {2, 1, 0.8};
  const ep_elastic elastic = {.density = 900, .young = 3e4, .poisson = 0.4};
  ep_log log = {.quiet = true};
  make_bar(&s->b, cells, size, EP_STVK, elastic, 1);
  for (int e = 0; e < s->b.mesh.nt; e++) // a material that varies
    s->b.fem.mu[e] *= 1 + 0.5 * (e % 7), s->b.fem.lambda[e] *= 2 - 0.1 * (e % 11);
  s->u = vector_of((size_t)modes * s->b.n3);
  for (int a = 0; a < modes; a++)
    smooth_random(&s->b, 100 + (uint64_t)a, 1, s->u + (size_t)a * s->b.n3);
  s->packed = vector_of(ep_cubic_count(modes));
  ep_cubic_report report;
  ASSERT_OK(ep_cubic_coefficients(&s->b.fem, modes, s->u, &log, s->packed, &report, err));
  const size_t p = (size_t)modes * (size_t)(modes + 3) / 2;
  assert_int_equal(report.bytes, 8 * (6 * EP_CUBIC_CHUNK * p + p * p + 9 * (size_t)modes));
  s->stream = aligned_alloc(64, (8 * ep_cubic_stream_size(modes, EP_DOUBLE) + 63) / 64 * 64);
  s->scratch = aligned_alloc(64, (ep_cubic_scratch(modes, EP_DOUBLE) + 63) / 64 * 64);
  assert_true(s->stream && s->scratch);
  assert_int_equal(ep_cubic_pack(modes, s->packed, s->stream), EP_OK);
  assert_int_equal(ep_cubic_open(modes, EP_DOUBLE, s->stream, &s->cubic), EP_OK);
  s->full = vector_of(s->b.n3), s->force = vector_of(s->b.n3);
  ASSERT_OK(ep_fem_rest_stiffness(&s->b.fem, &s->k, err));
}

static void tear_down(subject *s) {
  ep_csr_free(&s->k);
  free(s->u), free(s->packed), free(s->stream), free(s->scratch), free(s->full), free(s->force);
  free_bar(&s->b);
}

static double dot_of(size_t n, const double *x, const double *y) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

// U^T f and U^T K U at U q in full space.
static double full_space(subject *s, int modes, const double *q, double *f, double *k) {
  const size_t n3 = s->b.n3;
  memset(s->full, 0, n3 * sizeof *s->full);
  for (int a = 0; a < modes; a++)
    for (size_t i = 0; i < n3; i++) s->full[i] += q[a] * s->u[(size_t)a * n3 + i];
  ep_fem_force(&s->b.fem, s->full, s->force);
  for (int a = 0; a < modes; a++) f[a] = dot_of(n3, s->u + (size_t)a * n3, s->force);
  ep_fem_stiffness(&s->b.fem, s->full, 0, &s->k);
  for (int a = 0; a < modes; a++) {
    ep_csr_multiply(&s->k, 1, s->u + (size_t)a * n3, s->force);
    for (int c = 0; c < modes; c++) k[a * modes + c] = dot_of(n3, s->u + (size_t)c * n3, s->force);
  }
  return ep_fem_energy(&s->b.fem, s->full);
}

static void equals_full_space(void **state) {
  (void)state;
  const int sizes[] = {4, 17};
  for (int i = 0; i < 2; i++) {
    const int r = sizes[i];
    double q[MODES], f[MODES], fr[MODES], k[PAIRS], kr[PAIRS];
    subject s;
    set_up(&s, r);
    for (int pose = 0; pose < 3; pose++) {
      const double amplitude = pose == 0 ? 0 : pose == 1 ? 0.01 : 0.2; // rest, small, strains of 1
      for (int a = 0; a < r; a++) q[a] = amplitude * sin(1 + 2 * a + pose);
      const double e = ep_cubic_evaluate(&s.cubic, q, f, k, s.scratch);
      const double er = full_space(&s, r, q, fr, kr);
      ASSERT_LESS(distance_of((size_t)(r * r), k, kr), 1e-12 * norm_of((size_t)(r * r), kr));
      if (pose == 0) {
        assert_true(e == 0 && norm_of((size_t)r, f) == 0);
        continue;
      }
      ASSERT_LESS(fabs(e - er), 1e-12 * er);
      ASSERT_LESS(distance_of((size_t)r, f, fr), 1e-12 * norm_of((size_t)r, fr));
    }
    tear_down(&s);
  }
}

// u = (R - I) x is in the span of two fields: cos - 1 and sin times constant matrices.
static void rotations_cost_nothing(void **state) {
  (void)state;
  const int cells[3] = {3, 2, 2};
  const double size[3] = {1, 1, 1};
  const ep_elastic elastic = {.density = 900, .young = 3e4, .poisson = 0.3};
  ep_log log = {.quiet = true};
  bar b;
  make_bar(&b, cells, size, EP_STVK_VOLUME, elastic, 0);
  double *u = vector_of(2 * b.n3), packed[15], f[2];
  for (int v = 0; v < b.mesh.nv; v++) {
    const double x = b.mesh.x[3 * v], y = b.mesh.x[3 * v + 1];
    u[3 * v] = x, u[3 * v + 1] = y;
    u[b.n3 + 3 * (size_t)v] = -y, u[b.n3 + 3 * (size_t)v + 1] = x;
  }
  ASSERT_OK(ep_cubic_coefficients(&b.fem, 2, u, &log, packed, NULL, err));
  _Alignas(64) double stream[64];
  assert_true(ep_cubic_stream_size(2, EP_DOUBLE) <= 64);
  assert_int_equal(ep_cubic_pack(2, packed, stream), EP_OK);
  ep_cubic cubic;
  assert_int_equal(ep_cubic_open(2, EP_DOUBLE, stream, &cubic), EP_OK);
  void *scratch = aligned_alloc(64, (ep_cubic_scratch(2, EP_DOUBLE) + 63) / 64 * 64);
  assert_non_null(scratch);
  for (double turn = 0.2; turn < 6; turn += 0.9) {
    const double q[2] = {cos(turn) - 1, sin(turn)}, stretch[2] = {0.1, 0};
    const double scale = ep_cubic_evaluate(&cubic, stretch, NULL, NULL, scratch);
    assert_true(scale > 1);
    // terms of the size of the energy at strain 1 cancel
    ASSERT_LESS(fabs(ep_cubic_evaluate(&cubic, q, f, NULL, scratch)), 1e-11 * scale);
    ASSERT_LESS(norm_of(2, f), 1e-10 * scale);
  }
  free(scratch);
  free(u);
  free_bar(&b);
}

static void other_materials_are_refused(void **state) {
  (void)state;
  const int cells[3] = {1, 1, 1};
  const double size[3] = {1, 1, 1};
  const ep_elastic elastic = {.density = 900, .young = 3e4, .poisson = 0.3};
  ep_log log = {.quiet = true};
  bar b;
  ep_error err = {0};
  make_bar(&b, cells, size, EP_STABLE_NEOHOOKEAN, elastic, 0);
  double *u = vector_of(b.n3), packed[5];
  assert_int_equal(ep_cubic_coefficients(&b.fem, 1, u, &log, packed, NULL, &err),
                   EP_ERR_UNSUPPORTED);
  assert_non_null(strstr(err.text, "neohookean"));
  b.fem.model = EP_STVK, err = (ep_error){0};
  assert_int_equal(ep_cubic_coefficients(&b.fem, 0, u, &log, packed, NULL, &err), EP_ERR_ARGUMENT);
  free(u);
  free_bar(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(equals_full_space),
      cmocka_unit_test(rotations_cost_nothing),
      cmocka_unit_test(other_materials_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
