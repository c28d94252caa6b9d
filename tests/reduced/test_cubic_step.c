// Cubic polynomials as a model's evaluator: the elastic energy and whole motions equal those by
// cubature over all elements, with and without the volume penalty (StVK crushes to J < 0.5); models
// without cubature elements run; the model file keeps the streams; wrong models are refused.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/reduced/bar.h"
#include "tests/reduced/quartic.h"
#include "tests/reduced/vectors.h"

enum { R = 20, STEPS = 1000 };

typedef struct subject {
  bar *b;         // all elements, evaluator cubature
  ep_model cubic; // the same model with the streams
  double *packed, *stream, scales[3];
  float *narrow;
} subject;

// squeeze: Lame's lambda times this.
static void set_up_stiff(subject *x, ep_material material, int examples, double squeeze) {
  x->b = bar_create(6, 2, 1, R, 0, examples ? 6 : 0, examples, material);
  for (int e = 0; e < x->b->model.size.s; e++)
    ((double *)x->b->model.cubature_lambda)[e] *= squeeze; // the bar's own memory
  if (squeeze != 1) {                                      // stiffness at rest goes along
    void *block;
    const double rest[R] = {0};
    ep_elastic_energy(bar_state(x->b, &block), rest, NULL, (double *)x->b->model.k0, 0);
    free(block);
  }
  x->packed = quartic_coefficients(x->b);
  const size_t wide = ep_cubic_stream_size(R, EP_DOUBLE),
               narrow = ep_cubic_stream_size(R, EP_FLOAT);
  x->stream = block_of(wide * sizeof *x->stream);
  x->narrow = block_of(narrow * sizeof *x->narrow);
  assert_int_equal(ep_cubic_pack(R, x->packed, x->stream), EP_OK);
  assert_int_equal(ep_cubic_pack_float(R, x->packed, x->narrow), EP_OK);
  x->cubic = x->b->model;
  x->cubic.size.cubic = (int)wide, x->cubic.size.cubic_float = (int)narrow;
  x->cubic.cubic_stream = x->stream, x->cubic.cubic_stream_float = x->narrow;
  x->cubic.evaluator = EP_EVALUATE_CUBIC;
  memset(x->scales, 0, sizeof x->scales);
  for (int e = 0; e < x->b->model.size.s; e++) {
    const double norm_g =
        norm_of(9 * R, x->b->g + 9 * (size_t)x->b->model.cubature_tet[e] * (size_t)R);
    const double stiff = x->b->model.cubature_w[e] *
                         (x->b->model.cubature_lambda[e] + 2 * x->b->model.cubature_mu[e]);
    x->scales[0] = fmax(x->scales[0], norm_g);
    x->scales[1] += stiff, x->scales[2] += stiff * norm_g;
  }
  x->cubic.cubic_scales = x->scales;
}

static void set_up(subject *x, ep_material material, int examples) {
  set_up_stiff(x, material, examples, 1);
}

static void tear_down(subject *x) {
  bar_free(x->b);
  free(x->packed), free(x->stream), free(x->narrow);
}

static ep_state *state_of(const ep_model *model, void **block) {
  ep_state *state = NULL;
  const size_t bytes = ep_state_bytes(model);
  *block = block_of(bytes);
  assert_int_equal(ep_state_init(model, *block, bytes, &state), EP_OK);
  return state;
}

static void energy_equals_all_elements(void **state) {
  (void)state;
  for (int material = EP_STVK; material <= EP_STVK_VOLUME; material++) {
    subject x;
    void *blocks[2];
    set_up(&x, material, 0);
    ep_state *all = bar_state(x.b, &blocks[0]), *cubic = state_of(&x.cubic, &blocks[1]);
    int penalised = 0;
    for (int pose = 0; pose < 8; pose++) {
      double q[R], f[R], fr[R], k[R * R], kr[R * R];
      bar_random_q(x.b, pose % 2 ? 1.8 : 0.2, q);
      const double er = ep_elastic_energy(all, q, fr, kr, 0);
      double e = ep_elastic_energy(cubic, q, f, NULL, 0);
      assert_true(fabs(e - er) < 1e-12 * er);
      assert_true(e == ep_elastic_energy(cubic, q, NULL, k, 0)); // the kept result
      assert_true(distance_of(R, f, fr) < 1e-12 * norm_of(R, fr));
      assert_true(distance_of(R * R, k, kr) < 1e-12 * norm_of(R * R, kr));
      x.b->model.material = EP_STVK;
      penalised += fabs(ep_elastic_energy(all, q, NULL, NULL, 0) - er) > 1e-6 * er;
      x.b->model.material = material;
    }
    assert_int_equal(penalised > 0, material == EP_STVK_VOLUME); // the penalty was at work
    free(blocks[0]), free(blocks[1]);
    tear_down(&x);
  }
}

// Newton stops anywhere below its tolerance; 1e-10 keeps both runs within round-off of one motion,
// which damped vibration does not amplify.
static void motions_agree_over_a_thousand_steps(void **state) {
  (void)state;
  subject x;
  void *blocks[3];
  set_up(&x, EP_STVK_VOLUME, 0);
  ep_model narrow = x.cubic;
  narrow.evaluator = EP_EVALUATE_CUBIC_FLOAT;
  ep_state *run[3] = {bar_state(x.b, &blocks[0]), state_of(&x.cubic, &blocks[1]),
                      state_of(&narrow, &blocks[2])};
  double load[R], q[R], largest = 0, worst[2] = {0};
  bar_random_q(x.b, 0.3, q);
  ep_elastic_energy(run[0], q, load, NULL, 0);
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.002, def.tolerance = 1e-10;
  for (int step = 0; step < STEPS; step++) {
    def.force = step % 200 < 60 ? load : NULL;
    for (int i = 0; i < 3; i++) assert_int_equal(ep_step(run[i], &def, NULL), EP_OK);
    largest = fmax(largest, norm_of(R, ep_state_q(run[0])));
    for (int i = 0; i < 2; i++)
      worst[i] = fmax(worst[i], distance_of(R, ep_state_q(run[0]), ep_state_q(run[i + 1])));
  }
  assert_true(worst[0] < 1e-8 * largest);
  assert_true(worst[1] > 0 && worst[1] < 1e-3 * largest); // floats: residuals of 1e-5
  for (int i = 0; i < 3; i++) free(blocks[i]);
  tear_down(&x);
}

// Nearly incompressible (lambda a thousand mu): the polynomial's terms cancel, forces in floats are
// round-off above the tolerance and energies above what a step gains. Steps end all the same, where
// doubles do up to a thousandth.
static void floats_step_on_where_terms_cancel(void **state) {
  (void)state;
  subject x;
  void *blocks[2];
  set_up_stiff(&x, EP_STVK, 0, 1000);
  ep_model narrow = x.cubic;
  narrow.evaluator = EP_EVALUATE_CUBIC_FLOAT;
  ep_state *wide = state_of(&x.cubic, &blocks[0]), *floats = state_of(&narrow, &blocks[1]);
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.002;
  double largest = 0, worst = 0;
  int iterations = 0;
  for (int start = 0; start < 10; start++) {
    double q[R];
    bar_random_q(x.b, 0.05, q);
    memcpy(ep_state_q(wide), q, sizeof q), memcpy(ep_state_q(floats), q, sizeof q);
    memset(ep_state_velocity(wide), 0, sizeof q), memset(ep_state_velocity(floats), 0, sizeof q);
    largest = fmax(largest, norm_of(R, q));
    for (int step = 0; step < 40; step++) {
      ep_step_report report;
      assert_int_equal(ep_step(wide, &def, NULL), EP_OK);
      assert_int_equal(ep_step(floats, &def, &report), EP_OK);
      iterations = report.newton_iterations > iterations ? report.newton_iterations : iterations;
      worst = fmax(worst, distance_of(R, ep_state_q(wide), ep_state_q(floats)));
    }
  }
  assert_true(worst < 1e-3 * largest);
  assert_true(iterations <= 10);
  for (int i = 0; i < 2; i++) free(blocks[i]);
  tear_down(&x);
}

static void examples_act_beside_the_polynomial(void **state) {
  (void)state;
  subject x;
  void *blocks[2];
  set_up(&x, EP_STVK, 2);
  ep_state *all = bar_state(x.b, &blocks[0]), *cubic = state_of(&x.cubic, &blocks[1]);
  double load[R], q[R];
  bar_random_q(x.b, 0.3, q);
  ep_elastic_energy(all, q, load, NULL, 0);
  ep_step_def def = ep_default_step();
  def.force = load, def.damping_stiffness = 0.002, def.tolerance = 1e-10;
  ep_step_report one, other;
  for (int step = 0; step < 30; step++) {
    assert_int_equal(ep_step(all, &def, &one), EP_OK);
    assert_int_equal(ep_step(cubic, &def, &other), EP_OK);
  }
  assert_true(distance_of(R, ep_state_q(all), ep_state_q(cubic)) <
              1e-6 * norm_of(R, ep_state_q(all)));
  assert_true(fabs(one.elastic_energy - other.elastic_energy) < 1e-6 * one.elastic_energy);
  assert_true(fabs(one.example_energy - other.example_energy) <= 1e-6 * one.elastic_energy);
  free(blocks[0]), free(blocks[1]);
  tear_down(&x);
}

static void no_cubature_is_needed(void **state) {
  (void)state;
  subject x;
  void *blocks[2];
  set_up(&x, EP_STVK, 0);
  ep_model bare = x.cubic;
  bare.size.s = 0;
  bare.cubature_tet = NULL;
  bare.cubature_w = bare.cubature_lambda = bare.cubature_mu = bare.cubature_g = NULL;
  ep_state *with = state_of(&x.cubic, &blocks[0]), *without = state_of(&bare, &blocks[1]);
  double load[R] = {0};
  load[0] = 50, load[3] = -20;
  ep_step_def def = ep_default_step();
  def.force = load;
  for (int step = 0; step < 20; step++) {
    assert_int_equal(ep_step(with, &def, NULL), EP_OK);
    assert_int_equal(ep_step(without, &def, NULL), EP_OK);
  }
  assert_true(norm_of(R, ep_state_q(with)) > 0);
  assert_memory_equal(ep_state_q(with), ep_state_q(without), R * sizeof(double));
  free(blocks[0]), free(blocks[1]);
  tear_down(&x);
}

static void wrong_models_are_refused(void **state) {
  (void)state;
  subject x;
  set_up(&x, EP_STVK_VOLUME, 0);
  void *block = block_of(ep_state_bytes(&x.cubic));
  ep_state *out;
  ep_model bad = x.cubic;
  bad.size.s = 0; // the penalty has nowhere to live
  assert_int_equal(ep_state_init(&bad, block, ep_state_bytes(&x.cubic), &out), EP_ERR_ARGUMENT);
  bad = x.cubic, bad.material = EP_COROTATIONAL;
  assert_int_equal(ep_state_init(&bad, block, ep_state_bytes(&x.cubic), &out), EP_ERR_ARGUMENT);
  bad = x.cubic, bad.size.cubic = 0;
  assert_int_equal(ep_state_init(&bad, block, ep_state_bytes(&x.cubic), &out), EP_ERR_ARGUMENT);
  bad = x.cubic, bad.size.cubic_float = 0, bad.evaluator = EP_EVALUATE_CUBIC_FLOAT;
  assert_int_equal(ep_state_init(&bad, block, ep_state_bytes(&x.cubic), &out), EP_ERR_ARGUMENT);
  free(block);
  tear_down(&x);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(energy_equals_all_elements),
      cmocka_unit_test(motions_agree_over_a_thousand_steps),
      cmocka_unit_test(floats_step_on_where_terms_cancel),
      cmocka_unit_test(examples_act_beside_the_polynomial),
      cmocka_unit_test(no_cubature_is_needed),
      cmocka_unit_test(wrong_models_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
