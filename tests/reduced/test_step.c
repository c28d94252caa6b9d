// The time step: interpolation reaches a minimum; a step is the minimum of the incremental
// potential (its gradient, rebuilt here from public parts, vanishes); energy without load never
// grows; rest stays at rest; a failed step leaves the state as it was; an energy that is no number
// is no minimum; no allocation in a step; two threads agree; without examples nothing of them is
// stored.
#include <math.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/state.h"
#include "tests/reduced/bar.h"
#include "tests/reduced/count_allocations.h"
#include "tests/reduced/vectors.h"

enum { R = 20, K = 2 };

typedef struct scene {
  bar *b;
  void *block;
  ep_state *state;
  double load[R];
} scene;

static void create(scene *s, ep_material material, int k) {
  s->b = bar_create(5, 2, 1, R, 40, k ? 6 : 0, k, material);
  s->state = bar_state(s->b, &s->block);
  double q[R];
  bar_random_q(s->b, 0.3, q);
  ep_elastic_energy(s->state, q, s->load, NULL, 0); // a load that bends it about so far
}

static void destroy(scene *s) {
  free(s->block);
  bar_free(s->b);
}

// With the load of an example's own force the object goes there: weights change, both kinds of
// example force, all materials. The residual is computed afresh from the public functions.
static void step_is_a_minimum(void **unused) {
  (void)unused;
  for (int material = 0; material < EP_MATERIALS; material++) {
    for (int kind = 0; kind < 2; kind++) {
      scene s;
      create(&s, material, K);
      ep_step_def def = ep_default_step();
      def.force = s.load, def.damping_mass = 0.2, def.damping_stiffness = 0.003;
      def.example_force = kind ? EP_EXAMPLE_LINEAR : EP_EXAMPLE_ENERGY;
      def.relief = 0.25;
      double q[R], v[R], f[R], moved = 0;
      for (int i = 0; i < 30; i++) {
        ep_step_report report;
        memcpy(q, ep_state_q(s.state), sizeof q);
        memcpy(v, ep_state_velocity(s.state), sizeof v);
        assert_int_equal(ep_step(s.state, &def, &report), EP_OK);
        assert_true(report.residual <= def.tolerance);
        assert_true(report.target.relative_gradient <= def.target_tolerance);
        if (kind == 0) continue;
        // linear kind: (x - q - h v)/h^2 + D (x - q)/h + (1 - relief) f(x) + K0 (x - t) - load = 0
        const double *x = ep_state_q(s.state), h = def.dt, *k0 = s.b->model.k0;
        double largest = 0;
        ep_elastic_energy(s.state, x, f, NULL, 0);
        for (int a = 0; a < R; a++) {
          largest = fmax(largest, fabs(f[a]) + fabs(s.load[a]));
          f[a] = (1 - def.relief) * f[a] + (x[a] - q[a] - h * v[a]) / (h * h) - s.load[a] +
                 def.damping_mass * (x[a] - q[a]) / h;
          for (int c = 0; c < R; c++)
            f[a] += k0[a * R + c] * (def.damping_stiffness * (x[c] - q[c]) / h + x[c] -
                                     ep_state_target(s.state)[c]);
        }
        for (int a = 0; a < R; a++) moved += fabs(x[a] - q[a]);
        assert_true(norm_of(R, f) < 1e-4 * largest); // 1e-6 of forces that include the inertia
      }
      if (kind) assert_true(moved > 0);
      assert_true(ep_state_weights(s.state)[0] + ep_state_weights(s.state)[1] > 1e-3);
      destroy(&s);
    }
  }
}

// The gradient at the target vanishes, and no point near or far has less energy.
static void target_is_a_minimum(void **unused) {
  (void)unused;
  for (int material = 0; material < EP_MATERIALS; material++) {
    scene s;
    create(&s, material, K);
    const double w[K + 1] = {0.3, 0.4, 0.3};
    double q[R] = {0}, g[R], other[R];
    ep_target_report report;
    assert_int_equal(ep_target_newton(NULL, s.state, w, q, 1e-6, &report), EP_OK);
    assert_true(report.iterations > 1 && report.iterations < 30);
    double least = ep_target_energy(s.state, w, q, g, NULL, 0);
    assert_true(ep_target_residual(s.state, w, g) <= 1e-6);
    for (int trial = 0; trial < 100; trial++) {
      bar_random_q(s.b, trial % 2 ? 0.02 : 0.3, other);
      for (int a = 0; a < R; a++) other[a] += q[a];
      assert_true(ep_target_energy(s.state, w, other, NULL, NULL, 0) > least);
    }
    ep_target_report warm;
    assert_int_equal(ep_target_newton(NULL, s.state, w, q, 1e-6, &warm), EP_OK);
    assert_int_equal(warm.iterations, 0); // a warm start on the minimum costs one evaluation
    destroy(&s);
  }
}

static void single_shapes_are_returned_exactly(void **unused) {
  (void)unused;
  scene s;
  create(&s, EP_STVK_VOLUME, K);
  ep_step_def def = ep_default_step();
  for (int i = 0; i < K; i++) {
    const double *q = s.b->model.example_q + i * R;
    memcpy(ep_state_q(s.state), q, R * sizeof *q);
    assert_int_equal(ep_interpolate(s.state, &def, NULL), EP_OK);
    assert_memory_equal(ep_state_target(s.state), q, R * sizeof *q);
    assert_true(ep_state_weights(s.state)[i] == 1);
  }
  destroy(&s);
}

// An object at rest, and one at an example with its own force as load, stays there.
static void rest_stays_at_rest(void **unused) {
  (void)unused;
  scene s;
  create(&s, EP_STVK_VOLUME, K);
  ep_step_def def = ep_default_step();
  for (int i = 0; i < 20; i++) assert_int_equal(ep_step(s.state, &def, NULL), EP_OK);
  assert_true(norm_of(R, ep_state_q(s.state)) == 0 && norm_of(R, ep_state_velocity(s.state)) == 0);
  const double *q = s.b->model.example_q;
  double load[R];
  ep_elastic_energy(s.state, q, load, NULL, 0);
  memcpy(ep_state_q(s.state), q, R * sizeof *q);
  def.force = load; // the target is the example: the example force vanishes
  for (int i = 0; i < 20; i++) assert_int_equal(ep_step(s.state, &def, NULL), EP_OK);
  for (int a = 0; a < R; a++)
    assert_true(fabs(ep_state_q(s.state)[a] - q[a]) < 1e-6 * norm_of(R, q));
  destroy(&s);
}

static void energy_without_load_never_grows(void **unused) {
  (void)unused;
  for (int material = 0; material < EP_MATERIALS; material++) {
    scene s;
    create(&s, material, 0);
    bar_random_q(s.b, 0.6, ep_state_q(s.state));
    ep_step_def def = ep_default_step();
    double last = ep_elastic_energy(s.state, ep_state_q(s.state), NULL, NULL, 0), first = last;
    for (int i = 0; i < 200; i++) {
      ep_step_report r;
      assert_int_equal(ep_step(s.state, &def, &r), EP_OK);
      double now = r.elastic_energy + r.kinetic_energy;
      assert_true(now <= last * (1 + 1e-6)); // the step's own tolerance
      last = now;
    }
    assert_true(last < 0.5 * first); // implicit Euler damps
    destroy(&s);
  }
}

// Falls with the order of the method: halving dt halves the error (implicit Euler).
static double fall(double dt) {
  scene s;
  create(&s, EP_STVK, 0);
  ep_step_def def = ep_default_step();
  def.dt = dt, def.force = s.load, def.tolerance = 1e-10;
  for (int i = 0; i < (int)lround(0.02 / dt); i++)
    assert_int_equal(ep_step(s.state, &def, NULL), EP_OK);
  double q = ep_state_q(s.state)[0];
  destroy(&s);
  return q;
}

static void error_is_of_first_order(void **unused) {
  (void)unused;
  double a = fall(5e-4), b = fall(2.5e-4), c = fall(1.25e-4);
  assert_true(fabs(a - b) > 1e-9);
  assert_true(fabs(log2((a - b) / (b - c)) - 1) < 0.2);
}

static void failure_leaves_the_state(void **unused) {
  (void)unused;
  scene s;
  create(&s, EP_STVK_VOLUME, K);
  ep_step_def def = ep_default_step();
  def.force = s.load;
  for (int i = 0; i < 5; i++) assert_int_equal(ep_step(s.state, &def, NULL), EP_OK);
  double q[R], v[R], w[K], t[R], bad[R];
  memcpy(q, ep_state_q(s.state), sizeof q), memcpy(v, ep_state_velocity(s.state), sizeof v);
  memcpy(w, ep_state_weights(s.state), sizeof w), memcpy(t, ep_state_target(s.state), sizeof t);
  memcpy(bad, s.load, sizeof bad);
  bad[3] = NAN;
  for (int kind = 0; kind < 3; kind++) {
    def.force = kind == 0 ? bad : s.load;
    def.max_iterations = kind == 1 ? 1 : 50;
    def.tolerance = kind == 1 ? 1e-12 : 1e-6;
    def.dt = kind == 2 ? -1 : 1.0 / 60;
    assert_int_equal(ep_step(s.state, &def, NULL), kind == 2 ? EP_ERR_ARGUMENT : EP_ERR_NUMERIC);
    assert_memory_equal(q, ep_state_q(s.state), sizeof q);
    assert_memory_equal(v, ep_state_velocity(s.state), sizeof v);
    assert_memory_equal(w, ep_state_weights(s.state), sizeof w);
    assert_memory_equal(t, ep_state_target(s.state), sizeof t);
  }
  def = ep_default_step();
  def.cookie = 0;
  assert_int_equal(ep_step(s.state, &def, NULL), EP_ERR_ARGUMENT);
  destroy(&s);
}

// Pushed flat and turned inside out, with the hardest force that the test can think of.
// |x|^2 / 2. What follows the iterate may turn out to be impossible there: a refresh that says so
// leaves a gradient that may well be small.
static double bowl(void *user, const double *x, double *g, double *h, int project) {
  (void)user, (void)project;
  for (int i = 0; g && i < R; i++) g[i] = x[i];
  for (int i = 0; h && i < R * R; i++) h[i] = i % (R + 1) == 0;
  return 0.5 * ep_dot(R, x, x);
}

static double steepness(void *user, const double *x, const double *g) {
  (void)user, (void)x;
  return sqrt(ep_dot(R, g, g));
}

static double impossible(void *user, double *x, double *g) {
  (void)user, (void)x;
  memset(g, 0, R * sizeof *g);
  return NAN;
}

static void no_number_is_no_minimum(void **unused) {
  (void)unused;
  scene s;
  create(&s, EP_STVK, 0);
  for (int i = 0; i < 2; i++) {
    // the second is there already but for round-off, as far as the strains say
    const double tolerance[] = {1e-6, 1e-30}, from[] = {1, 1e-20};
    ep_newton newton = {.energy = bowl,
                        .residual = steepness,
                        .refresh = impossible,
                        .n = R,
                        .tolerance = tolerance[i],
                        .max_iterations = 10};
    for (int a = 0; a < R; a++) s.state->x[a] = from[i];
    assert_int_equal(ep_newton_minimise(s.state, &newton), EP_ERR_NUMERIC);
    newton.refresh = NULL, newton.iterations = 0;
    for (int a = 0; a < R; a++) s.state->x[a] = from[i];
    assert_int_equal(ep_newton_minimise(s.state, &newton), EP_OK);
  }
  destroy(&s);
}

static void survives_a_hard_push(void **unused) {
  (void)unused;
  for (int material = 0; material < EP_MATERIALS; material++) {
    scene s;
    create(&s, material, K);
    ep_step_def def = ep_default_step();
    for (int a = 0; a < R; a++) s.load[a] *= 30;
    def.force = s.load, def.damping_stiffness = 0.01;
    for (int i = 0; i < 60; i++) {
      if (i == 30) def.force = NULL; // released
      assert_int_equal(ep_step(s.state, &def, NULL), EP_OK);
      assert_true(isfinite(norm_of(R, ep_state_q(s.state))));
    }
    destroy(&s);
  }
}

static void nothing_is_allocated(void **unused) {
  (void)unused;
  scene s;
  create(&s, EP_STVK_VOLUME, K);
  ep_step_def def = ep_default_step();
  def.force = s.load;
  allocations = 0;
  void *volatile block = malloc(1);
  free(block);
  assert_int_equal(allocations, 1); // the counter works
  int before = allocations;
  for (int i = 0; i < 10; i++) {
    ep_status status = ep_step(s.state, &def, NULL); // asserts may allocate: not in here
    if (status != EP_OK) allocations++;
  }
  assert_int_equal(allocations, before);
  destroy(&s);
}

static void *run(void *argument) {
  scene *s = argument;
  ep_step_def def = ep_default_step();
  def.force = s->load;
  for (int i = 0; i < 100; i++)
    if (ep_step(s->state, &def, NULL) != EP_OK) return NULL;
  return s;
}

static void threads_agree(void **unused) {
  (void)unused;
  scene a, b;
  create(&a, EP_STABLE_NEOHOOKEAN, K);
  b = a;
  b.state = bar_state(a.b, &b.block);
  pthread_t other;
  assert_int_equal(pthread_create(&other, NULL, run, &b), 0);
  void *result;
  assert_non_null(run(&a));
  pthread_join(other, &result);
  assert_non_null(result);
  assert_true(norm_of(R, ep_state_q(a.state)) > 0);
  assert_memory_equal(ep_state_q(a.state), ep_state_q(b.state), R * sizeof(double));
  free(b.block);
  destroy(&a);
}

static void no_examples_cost_nothing(void **unused) {
  (void)unused;
  scene with, without;
  create(&with, EP_STVK_VOLUME, K);
  create(&without, EP_STVK_VOLUME, 0);
  assert_true(ep_state_bytes(&without.b->model) + 40 * 10 * sizeof(double) <
              ep_state_bytes(&with.b->model));
  ep_step_def def = ep_default_step();
  ep_step_report report;
  def.force = without.load;
  assert_int_equal(ep_step(without.state, &def, &report), EP_OK);
  assert_int_equal(report.target.evaluations, 0);
  destroy(&with);
  destroy(&without);
}

static void bad_memory_is_refused(void **unused) {
  (void)unused;
  scene s;
  create(&s, EP_STVK, 0);
  ep_state *state;
  const size_t bytes = ep_state_bytes(&s.b->model);
  assert_int_equal(ep_state_init(&s.b->model, s.block, bytes - 1, &state), EP_ERR_ARGUMENT);
  assert_int_equal(ep_state_init(&s.b->model, (char *)s.block + 8, bytes, &state), EP_ERR_ARGUMENT);
  assert_int_equal(ep_state_init(&s.b->model, NULL, bytes, &state), EP_ERR_ARGUMENT);
  assert_null(state);
  double k0[R * R] = {0};
  s.b->model.k0 = k0;
  assert_int_equal(ep_state_init(&s.b->model, s.block, bytes, &state), EP_ERR_NUMERIC);
  destroy(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(step_is_a_minimum),
      cmocka_unit_test(target_is_a_minimum),
      cmocka_unit_test(single_shapes_are_returned_exactly),
      cmocka_unit_test(rest_stays_at_rest),
      cmocka_unit_test(energy_without_load_never_grows),
      cmocka_unit_test(error_is_of_first_order),
      cmocka_unit_test(failure_leaves_the_state),
      cmocka_unit_test(no_number_is_no_minimum),
      cmocka_unit_test(survives_a_hard_push),
      cmocka_unit_test(nothing_is_allocated),
      cmocka_unit_test(threads_agree),
      cmocka_unit_test(no_examples_cost_nothing),
      cmocka_unit_test(bad_memory_is_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
