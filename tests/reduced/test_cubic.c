// The cubic path: energy, force and stiffness of the packed quartic form equal the sums over all
// elements with the scalar law (W = sum_e V_e psi(I + G_e q)) to 1e-12; derivatives have slope 2;
// no force at rest, no cancellation near it in float; all instruction-set levels give the same
// bits; batches equal single states. Sizes cover every remainder of the blocks of four.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/cubic_kernel.h"
#include "tests/reduced/bar.h"
#include "tests/reduced/quartic.h"
#include "tests/reduced/vectors.h"

enum { R = 32, STATES = 37 };

typedef struct form {
  bar *b;
  double *packed;
  void *stream, *scratch, *batch_scratch;
  ep_cubic cubic;
} form;

static void make_form(int r, ep_precision precision, form *out) {
  const size_t size = precision == EP_DOUBLE ? sizeof(double) : sizeof(float);
  out->b = bar_create(4, 2, 1, r, 0, 0, 0, EP_STVK);
  out->packed = quartic_coefficients(out->b);
  out->stream = block_of(ep_cubic_stream_size(r, precision) * size);
  const ep_status status = precision == EP_DOUBLE
                               ? ep_cubic_pack(r, out->packed, out->stream)
                               : ep_cubic_pack_float(r, out->packed, out->stream);
  assert_int_equal(status, EP_OK);
  assert_int_equal(ep_cubic_open(r, precision, out->stream, &out->cubic), EP_OK);
  out->scratch = block_of(ep_cubic_scratch(r, precision));
  out->batch_scratch = block_of(ep_cubic_batch_scratch(r, precision));
}

static void free_form(form *x) {
  bar_free(x->b);
  free(x->packed), free(x->stream), free(x->scratch), free(x->batch_scratch);
}

// ---- tests -------------------------------------------------------------------------------------

static void storage_is_fully_symmetric(void **state) {
  (void)state;
  assert_int_equal(ep_cubic_quartic_count(50), 292825);
  assert_int_equal(ep_cubic_count(50), 292825 + 22100 + 1275 + 50 + 1);
  for (int r = 1; r < 12; r++) {
    size_t place = 0;
    for (int a = 0; a <= r; a++)
      for (int b = 0; b <= a; b++)
        for (int c = 0; c <= b; c++)
          for (int d = 0; d <= c; d++, place++) assert_int_equal(ep_cubic_index(a, b, c, d), place);
    assert_int_equal(ep_cubic_count(r), place);
  }
  // padding stays small where it matters
  assert_true(ep_cubic_stream_size(50, EP_DOUBLE) < 1.06 * 316251);
  assert_true(ep_cubic_stream_size(50, EP_FLOAT) < 1.08 * 316251);
}

// Doubles: sums in another order, 1e-12 of the norms. Floats: coefficients and z rounded (6e-8
// each) in up to 48 x 7 terms of mixed sign; 2e-6 leaves a decade of room.
static void equals_the_sum_over_elements(void **state) {
  (void)state;
  const int sizes[] = {1, 2, 5, 11, 15, 16, 17, 18, 19, 20, 30};
  for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
    for (int precision = EP_DOUBLE; precision <= EP_FLOAT; precision++) {
      const int r = sizes[i];
      const double tolerance = precision == EP_DOUBLE ? 1e-12 : 2e-6;
      double q[R], f[R], k[R * R], fr[R], kr[R * R];
      form x;
      make_form(r, precision, &x);
      for (int pose = 0; pose < 4; pose++) {
        bar_random_q(x.b, pose % 2 ? 1.8 : 0.2, q);
        const double e = ep_cubic_evaluate(&x.cubic, q, f, k, x.scratch);
        const double er = bar_reference(x.b, NULL, x.b->model.cubature_w, q, fr, kr, 0);
        assert_true(er > 0 && fabs(e - er) < tolerance * er);
        assert_true(distance_of(r, f, fr) < tolerance * norm_of(r, fr));
        assert_true(distance_of(r * r, k, kr) < tolerance * norm_of(r * r, kr));
        for (int a = 0; a < r; a++)
          for (int c = 0; c < a; c++) assert_true(k[a * r + c] == k[c * r + a]);
        assert_true(ep_cubic_evaluate(&x.cubic, q, NULL, NULL, x.scratch) == e);
      }
      free_form(&x);
    }
  }
}

static void derivatives_have_slope_two(void **state) {
  (void)state;
  const int sizes[] = {9, 22};
  for (int i = 0; i < 2; i++) {
    const int r = sizes[i];
    double q[R], d[R], a[R], c[R], f[R], fa[R], fc[R], k[R * R], error[2][2] = {{0}};
    form x;
    make_form(r, EP_DOUBLE, &x);
    for (int pose = 0; pose < 10; pose++) {
      bar_random_q(x.b, 0.4, q);
      bar_random_q(x.b, 1, d);
      ep_cubic_evaluate(&x.cubic, q, f, k, x.scratch);
      for (int fine = 0; fine < 2; fine++) {
        const double h = fine ? 1e-3 : 1e-2;
        for (int j = 0; j < r; j++) a[j] = q[j] + h * d[j], c[j] = q[j] - h * d[j];
        double slope = (ep_cubic_evaluate(&x.cubic, a, fa, NULL, x.scratch) -
                        ep_cubic_evaluate(&x.cubic, c, fc, NULL, x.scratch)) /
                       (2 * h);
        for (int j = 0; j < r; j++) {
          slope -= f[j] * d[j];
          fa[j] = (fa[j] - fc[j]) / (2 * h);
          for (int l = 0; l < r; l++) fa[j] -= k[j * r + l] * d[l];
        }
        error[0][fine] += fabs(slope);
        error[1][fine] += norm_of(r, fa);
      }
    }
    for (int j = 0; j < 2; j++) assert_true(fabs(log10(error[j][0] / error[j][1]) - 2) < 0.1);
    free_form(&x);
  }
}

// f = K z / 3 adds the degrees 2, 3, 4 with one sign: float errors near rest stay relative to the
// force, however small the displacement.
static void float_is_as_good_near_rest(void **state) {
  (void)state;
  const int sizes[] = {10, 30};
  for (int i = 0; i < 2; i++) {
    const int r = sizes[i];
    double q[R] = {0}, f[R], fr[R];
    form x;
    make_form(r, EP_FLOAT, &x);
    assert_true(ep_cubic_evaluate(&x.cubic, q, f, NULL, x.scratch) == 0);
    assert_true(norm_of(r, f) == 0);
    for (double size = 1; size > 1e-9; size *= 0.1) {
      bar_random_q(x.b, size, q);
      const double e = ep_cubic_evaluate(&x.cubic, q, f, NULL, x.scratch);
      const double er = bar_reference(x.b, NULL, x.b->model.cubature_w, q, fr, NULL, 0);
      assert_true(fabs(e - er) < 2e-6 * er);
      assert_true(distance_of(r, f, fr) < 2e-6 * norm_of(r, fr));
    }
    free_form(&x);
  }
}

static void levels_give_the_same_bits(void **state) {
  (void)state;
  const int sizes[] = {9, 18, 30};
  const int count = ep_isa_here() + 1;
  for (int i = 0; i < 6; i++) {
    const int r = sizes[i / 2];
    const ep_precision precision = i % 2 ? EP_FLOAT : EP_DOUBLE;
    double q[3 * R], f[3 * R], k[3 * R * R], e[3], f0[3 * R], k0[3 * R * R], e0[3], one = 0;
    form x;
    make_form(r, precision, &x);
    for (int s = 0; s < 3; s++) bar_random_q(x.b, 0.7, q + s * r);
    for (int level = 0; level < count; level++) {
      x.cubic.kernel = ep_cubic_kernel_of((ep_isa)level, precision);
      const double energy = ep_cubic_evaluate(&x.cubic, q, f, k, x.scratch);
      if (level == 0) one = energy, memcpy(f0, f, sizeof f), memcpy(k0, k, sizeof k);
      assert_true(energy == one);
      assert_memory_equal(f, f0, (size_t)r * sizeof *f);
      assert_memory_equal(k, k0, (size_t)(r * r) * sizeof *k);
    }
    for (int level = 0; level < count; level++) {
      x.cubic.kernel = ep_cubic_kernel_of((ep_isa)level, precision);
      ep_cubic_batch(&x.cubic, 3, q, e, f, k, x.batch_scratch);
      if (level == 0) memcpy(e0, e, sizeof e), memcpy(f0, f, sizeof f), memcpy(k0, k, sizeof k);
      assert_memory_equal(e, e0, sizeof e);
      assert_memory_equal(f, f0, 3 * (size_t)r * sizeof *f);
      assert_memory_equal(k, k0, 3 * (size_t)(r * r) * sizeof *k);
    }
    free_form(&x);
  }
  if (count == 1) {
    print_message("only the baseline kernel runs on this processor: nothing to compare\n");
    skip();
  }
}

// Batches: to round-off the single states, and no state depends on its neighbours.
static void batches_equal_single_states(void **state) {
  (void)state;
  const int sizes[] = {6, 15, 16, 17, 18, 19, 30};
  for (int i = 0; i < 14; i++) {
    const int r = sizes[i / 2];
    const ep_precision precision = i % 2 ? EP_FLOAT : EP_DOUBLE;
    const double tolerance = precision == EP_DOUBLE ? 1e-13 : 2e-6;
    form x;
    make_form(r, precision, &x);
    const size_t n = (size_t)r;
    double *q = calloc(STATES * n * (2 + 2 * n), sizeof *q), *f = q + STATES * n;
    double *k = f + STATES * n, *again = k + STATES * n * n, e[STATES], e2[STATES], f1[R],
           k1[R * R];
    assert_non_null(q);
    for (int s = 0; s < STATES; s++) bar_random_q(x.b, 0.7, q + (size_t)s * n);
    ep_cubic_batch(&x.cubic, STATES, q, e, f, k, x.batch_scratch);
    for (int s = 0; s < STATES; s++) {
      const double *fs = f + (size_t)s * n, *ks = k + (size_t)s * n * n;
      const double one = ep_cubic_evaluate(&x.cubic, q + (size_t)s * n, f1, k1, x.scratch);
      assert_true(fabs(e[s] - one) < tolerance * one);
      assert_true(distance_of(r, fs, f1) < tolerance * norm_of(r, f1));
      assert_true(distance_of(r * r, ks, k1) < tolerance * norm_of(r * r, k1));
    }
    ep_cubic_batch(&x.cubic, 5, q + 9 * n, e2, NULL, again, x.batch_scratch);
    assert_memory_equal(e2, e + 9, 5 * sizeof *e);
    assert_memory_equal(again, k + 9 * n * n, 5 * n * n * sizeof *k);
    ep_cubic_batch(&x.cubic, 1, q + 2 * n, NULL, f1, NULL, x.batch_scratch);
    assert_memory_equal(f1, f + 2 * n, n * sizeof *f);
    free(q);
    free_form(&x);
  }
}

static void wrong_input_is_refused(void **state) {
  (void)state;
  form x;
  ep_cubic cubic;
  make_form(3, EP_DOUBLE, &x);
  float *narrow = block_of(ep_cubic_stream_size(3, EP_FLOAT) * sizeof *narrow);
  assert_int_equal(ep_cubic_open(3, EP_DOUBLE, (char *)x.stream + 8, &cubic), EP_ERR_ARGUMENT);
  assert_int_equal(ep_cubic_open(0, EP_DOUBLE, x.stream, &cubic), EP_ERR_ARGUMENT);
  assert_int_equal(ep_cubic_open(EP_CUBIC_MAX_MODES + 1, EP_DOUBLE, x.stream, &cubic),
                   EP_ERR_ARGUMENT);
  assert_int_equal(ep_cubic_open(3, EP_DOUBLE, NULL, &cubic), EP_ERR_ARGUMENT);
  x.packed[7] = 1e39; // a double, no float
  assert_int_equal(ep_cubic_pack(3, x.packed, x.stream), EP_OK);
  assert_int_equal(ep_cubic_pack_float(3, x.packed, narrow), EP_ERR_NUMERIC);
  x.packed[7] = NAN;
  assert_int_equal(ep_cubic_pack(3, x.packed, x.stream), EP_ERR_NUMERIC);
  free(narrow);
  free_form(&x);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(storage_is_fully_symmetric), cmocka_unit_test(equals_the_sum_over_elements),
      cmocka_unit_test(derivatives_have_slope_two), cmocka_unit_test(float_is_as_good_near_rest),
      cmocka_unit_test(levels_give_the_same_bits),  cmocka_unit_test(batches_equal_single_states),
      cmocka_unit_test(wrong_input_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
