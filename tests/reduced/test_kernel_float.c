// Cubature in floats. Energy and force are those of the double kernel on gradients G rounded to
// floats, to round-off of doubles (so f = dW/dq exactly: slope 2 as with doubles), and its
// stiffness to round-off of floats; all instruction-set levels give the same bits; steps converge
// to 1e-10 and stay near those in doubles; a model without the array is refused. Shapes include r
// and s that fill no lane.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/kernel.h"
#include "reduced/state.h"
#include "tests/reduced/bar.h"
#include "tests/reduced/vectors.h"

enum { R = 40 };

typedef struct subject {
  bar *b;
  ep_model floats, rounded; // evaluator in floats; in doubles with the same G
  float *narrow;
  double *wide;
  void *blocks[3];
  ep_state *in_floats, *in_doubles, *exact;
} subject;

static ep_state *state_of(const ep_model *model, void **block) {
  ep_state *state = NULL;
  *block = block_of(ep_state_bytes(model));
  assert_int_equal(ep_state_init(model, *block, ep_state_bytes(model), &state), EP_OK);
  return state;
}

static void set_up(subject *x, int r, int s, int k, ep_material material) {
  x->b = bar_create(4, 2, 1, r, s, k ? 4 : 0, k, material);
  const ep_model *m = &x->b->model;
  s = m->size.s;
  const size_t each = 9 * (size_t)r;
  double *g = block_of((size_t)s * each * sizeof *g);
  for (int e = 0; e < s; e++)
    memcpy(g + (size_t)e * each, x->b->g + (size_t)m->cubature_tet[e] * each, each * sizeof *g);
  x->narrow = block_of(ep_packed_cubature_float_size(r, s) * sizeof *x->narrow);
  assert_int_equal(ep_pack_cubature_float(r, s, g, x->narrow), EP_OK);
  for (size_t i = 0; i < (size_t)s * each; i++) g[i] = (double)(float)g[i];
  x->wide = block_of(ep_packed_cubature_size(r, s) * sizeof *x->wide);
  ep_pack_cubature(r, s, g, x->wide);
  free(g);
  x->floats = x->rounded = *m;
  x->floats.size.cubature_float = s, x->floats.cubature_g_float = x->narrow;
  x->floats.evaluator = EP_EVALUATE_CUBATURE_FLOAT;
  x->rounded.cubature_g = x->wide;
  x->in_floats = state_of(&x->floats, &x->blocks[0]);
  x->in_doubles = state_of(&x->rounded, &x->blocks[1]);
  x->exact = state_of(m, &x->blocks[2]);
}

static void tear_down(subject *x) {
  bar_free(x->b);
  free(x->narrow), free(x->wide);
  for (int i = 0; i < 3; i++) free(x->blocks[i]);
}

// Doubles: sums in another order. Stiffness: products rounded to 6e-8 in sums of up to 9 s terms.
// Against the unrounded G: errors of 6e-8 in F, stress near rest relative to the strain.
static void compare(subject *x, double amplitude, int project) {
  const int r = x->floats.size.r;
  double q[R], f[R], k[R * R], fr[R], kr[R * R];
  bar_random_q(x->b, amplitude, q);
  const double e = ep_elastic_energy(x->in_floats, q, f, k, project);
  const double er = ep_elastic_energy(x->in_doubles, q, fr, kr, project);
  assert_true(er > 0 && fabs(e - er) < 1e-12 * er);
  assert_true(distance_of(r, f, fr) < 1e-12 * norm_of(r, fr));
  assert_true(distance_of(r * r, k, kr) < 1e-6 * norm_of(r * r, kr));
  assert_true(distance_of(r * r, k, kr) > 0); // floats were at work
  for (int i = 0; i < r; i++)
    for (int j = 0; j < i; j++) assert_true(k[i * r + j] == k[j * r + i]);
  assert_true(fabs(ep_elastic_energy(x->exact, q, fr, kr, project) - e) < 1e-6 * e);
  assert_true(distance_of(r, f, fr) < 1e-6 * norm_of(r, fr));
  const double same = ep_elastic_energy(x->in_floats, q, NULL, NULL, project);
  assert_true(same == e);
}

static void equals_doubles_on_rounded_gradients(void **state) {
  (void)state;
  const int shape[][2] = {{30, 45}, {5, 13}, {17, 3}, {24, 0}, {37, 45}};
  for (int material = 0; material < EP_MATERIALS; material++) {
    for (int i = 0; i < 5; i++) {
      subject x;
      set_up(&x, shape[i][0], shape[i][1], 0, material);
      compare(&x, 0.3, 0);
      compare(&x, 1.8, 0); // crushed and inverted elements
      compare(&x, 1e-4, 0);
      tear_down(&x);
    }
  }
}

static void gradient_has_slope_two(void **state) {
  (void)state;
  for (int material = 0; material < EP_MATERIALS; material++) {
    subject x;
    double q[R], d[R], f[R], a[R], error[2] = {0};
    set_up(&x, 20, 30, 2, material);
    const double w[3] = {0.2, 0.5, 0.3};
    for (int pose = 0; pose < 10; pose++) {
      bar_random_q(x.b, 0.4, q);
      bar_random_q(x.b, 1, d);
      ep_target_energy(x.in_floats, w, q, f, NULL, 0);
      for (int fine = 0; fine < 2; fine++) {
        const double h = fine ? 1e-3 : 1e-2;
        double slope = 0;
        for (int side = -1; side <= 1; side += 2) {
          for (int i = 0; i < 20; i++) a[i] = q[i] + side * h * d[i];
          slope += side * ep_target_energy(x.in_floats, w, a, NULL, NULL, 0) / (2 * h);
        }
        for (int i = 0; i < 20; i++) slope -= f[i] * d[i];
        error[fine] += fabs(slope);
      }
    }
    assert_true(fabs(log10(error[0] / error[1]) - 2) < 0.1);
    tear_down(&x);
  }
}

static void rest_has_no_force(void **state) {
  (void)state;
  subject x;
  double q[R] = {0}, f[R];
  set_up(&x, 20, 0, 0, EP_STABLE_NEOHOOKEAN);
  assert_true(ep_elastic_energy(x.in_floats, q, f, NULL, 0) == 0);
  assert_true(norm_of(20, f) == 0);
  tear_down(&x);
}

static void levels_give_the_same_bits(void **state) {
  (void)state;
  const int count = ep_isa_here() + 1;
  if (count == 1) {
    print_message("only the baseline kernel runs on this processor: nothing to compare\n");
    skip();
  }
  for (int material = 0; material < EP_MATERIALS; material++) {
    subject x;
    double q[R], f[3][R], k[3][R * R], e[3];
    set_up(&x, 22, 45, 0, material);
    bar_random_q(x.b, 1.5, q);
    for (int i = 0; i < count; i++) {
      x.in_floats->kernel = ep_kernel_of((ep_isa)i);
      e[i] = ep_elastic_energy(x.in_floats, q, f[i], k[i], i == 0);
      e[i] = ep_elastic_energy(x.in_floats, q, f[i], k[i], 0);
      assert_true(e[i] == e[0]);
      assert_memory_equal(f[i], f[0], 22 * sizeof(double));
      assert_memory_equal(k[i], k[0], 22 * 22 * sizeof(double));
    }
    tear_down(&x);
  }
}

// G differs by 6e-8, damped motion does not amplify it: 1e-5 of the motion leaves two decades.
static void steps_converge_as_with_doubles(void **state) {
  (void)state;
  subject x;
  double load[R], q[R], largest = 0, worst = 0;
  set_up(&x, 20, 40, 2, EP_STVK_VOLUME);
  bar_random_q(x.b, 0.3, q);
  ep_elastic_energy(x.exact, q, load, NULL, 0);
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.002, def.tolerance = 1e-10, def.target_tolerance = 1e-8;
  int iterations[2] = {0};
  for (int step = 0; step < 200; step++) {
    ep_step_report report[2];
    def.force = step < 60 ? load : NULL;
    assert_int_equal(ep_step(x.in_floats, &def, &report[0]), EP_OK);
    assert_int_equal(ep_step(x.exact, &def, &report[1]), EP_OK);
    assert_true(report[0].residual <= 1e-10);
    for (int i = 0; i < 2; i++) iterations[i] += report[i].newton_iterations;
    largest = fmax(largest, norm_of(20, ep_state_q(x.exact)));
    worst = fmax(worst, distance_of(20, ep_state_q(x.exact), ep_state_q(x.in_floats)));
  }
  assert_true(worst > 0 && worst < 1e-5 * largest);
  assert_true(iterations[0] < 1.1 * iterations[1]); // the rounded Hessian costs no iterations
  tear_down(&x);
}

static void wrong_input_is_refused(void **state) {
  (void)state;
  subject x;
  set_up(&x, 5, 8, 0, EP_STVK);
  void *block = block_of(ep_state_bytes(&x.floats));
  ep_state *out;
  ep_model bad = x.floats;
  bad.size.cubature_float = 0, bad.cubature_g_float = NULL;
  assert_int_equal(ep_state_init(&bad, block, ep_state_bytes(&x.floats), &out), EP_ERR_ARGUMENT);
  double g[9 * 5] = {0};
  g[7] = 1e39; // a double, no float
  assert_int_equal(ep_pack_cubature_float(5, 1, g, x.narrow), EP_ERR_NUMERIC);
  free(block);
  tear_down(&x);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(equals_doubles_on_rounded_gradients),
      cmocka_unit_test(gradient_has_slope_two),
      cmocka_unit_test(rest_has_no_force),
      cmocka_unit_test(levels_give_the_same_bits),
      cmocka_unit_test(steps_converge_as_with_doubles),
      cmocka_unit_test(wrong_input_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
