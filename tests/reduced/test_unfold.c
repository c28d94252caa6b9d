// The way out of a jam (reduced/unfold.h). Claims: V(q) = 2 a (sqrt(1 + y / a) - 1) has the
// gradient and Hessian of its formula (central differences, error ~ h^2), is convex; where
// unfolding begins V = W, or V = y < W, and V falls with y; what is nowhere near turned over never
// unfolds, nor does what a load holds pressed flat; a bar whose guards are mostly turned over
// unfolds, comes to rest with nothing inverted and back to its own material, and its energy grows
// in no step (implicit Euler without loads: only round-off), not with an example force either while
// it unfolds and where it begins and ends; it ends whatever the integrator, undamped too, and under
// a load; a step that fails leaves the unfolding as it was; a caller who writes another shape gets
// that shape's own material, one who writes a velocity does not stop it; of few guards one flipped
// tet is no collapsed object.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/state.h"
#include "tests/reduced/bar.h"

enum { R = 20 };

static bar *make(void) {
  bar *b = bar_create(8, 3, 3, R, 12, 0, 0, EP_STVK_VOLUME);
  bar_add_guards(b, b->model.size.nt, 0.3);
  return b;
}

static double linear(const bar *b, const double *q) {
  double sum = 0;
  for (int i = 0; i < R; i++)
    for (int j = 0; j < R; j++) sum += 0.5 * q[i] * b->model.k0[R * i + j] * q[j];
  return sum;
}

static double error_of(ep_state *s, const double *q, const double *d, double h, int second) {
  double plus[R], minus[R], up[R], down[R], g[R], hessian[R * R], wrong = 0, whole = 0, along = 0;
  for (int a = 0; a < R; a++) plus[a] = q[a] + h * d[a], minus[a] = q[a] - h * d[a];
  const double difference =
      ep_unfold_energy(s, plus, up, NULL) - ep_unfold_energy(s, minus, down, NULL);
  ep_unfold_energy(s, q, g, hessian);
  for (int a = 0; a < R; a++) {
    double row = 0;
    for (int c = 0; c < R; c++) row += hessian[R * a + c] * d[c];
    wrong += pow((up[a] - down[a]) / (2 * h) - row, 2), whole += row * row;
    along += g[a] * d[a];
  }
  return second ? sqrt(wrong / whole) : fabs(difference / (2 * h) - along) / fabs(along);
}

static void derivatives_are_right(void **state) {
  (void)state;
  bar *b = make();
  void *block;
  ep_state *s = bar_state(b, &block);
  for (int i = 1; i <= 20; i++) {
    double q[R], d[R], h[R * R], l[R * R], largest = 0;
    bar_random_q(b, 0.2 * i, q);
    bar_random_q(b, 1, d);
    s->unfold = (ep_unfold){.on = 1, .bend = linear(b, q) / (i * i)};
    for (int second = 0; second < 2; second++) {
      const double e = 1e-2 * i; // a twentieth of q: V is no polynomial of the third degree
      const double order = log2(error_of(s, q, d, e, second) / error_of(s, q, d, e / 2, second));
      assert_true(fabs(order - 2) < 0.1);
    }
    ep_unfold_energy(s, q, NULL, h);
    for (int a = 0; a < R; a++) largest = fmax(largest, h[(R + 1) * a]);
    for (int a = 0; a < R; a++) h[(R + 1) * a] += 1e-12 * largest; // round-off of the sums
    assert_true(ep_cholesky(R, h, l));
  }
  free(block);
  bar_free(b);
}

// W given, unfolding begins after enough calm steps, with V = min(W, y).
static void goes_on_from_the_energy(void **state) {
  (void)state;
  bar *b = make();
  void *block;
  ep_state *s = bar_state(b, &block);
  const double none[R] = {0};
  for (int i = 1; i <= 20; i++) {
    bar_random_q(b, 1, s->q);
    const double y = linear(b, s->q), w = 0.1 * i * y;
    s->unfold = (ep_unfold){.calm = EP_UNFOLD_CALM};
    s->guards_soft = 1;
    assert_true(ep_unfold_begin(s, w, none, 0));
    assert_true(s->unfold.on);
    double q[R], before = ep_unfold_energy(s, s->q, NULL, NULL);
    assert_true(fabs(before - fmin(w, y)) <= 1e-12 * y); // sums of 400 terms
    for (int k = 9; k >= 0; k--) {
      for (int a = 0; a < R; a++) q[a] = 0.1 * k * s->q[a];
      const double now = ep_unfold_energy(s, q, NULL, NULL);
      assert_true(now < before);
      before = now;
    }
    assert_true(before == 0);
  }
  free(block);
  bar_free(b);
}

// ---- in steps ----------------------------------------------------------------------------------

typedef struct story {
  int inverted, unfolded, left; // at the start; steps that unfolded; at the end
  int soft;                     // steps that had parabolas
  int began, ended, unfolds;    // how often; does it still, at the end
  double growth; // the most of a step, relative to the most energy; with an example force only of
                 // steps that unfold, begin or end it
} story;

static double total(const ep_step_report *report, const double *load, const double *q) {
  const double sum = report->elastic_energy + report->example_energy + report->green_energy;
  return sum + report->kinetic_energy - (load ? ep_dot(R, load, q) : 0);
}

static story follow(const bar *b, const double *start, const ep_step_def *def, int steps) {
  void *block;
  ep_state *s = bar_state(b, &block);
  ep_step_report report;
  story told = {0};
  double before = INFINITY, most = 0;
  int was = 0;
  if (start) memcpy(ep_state_q(s), start, R * sizeof *start);
  told.inverted = bar_inverted(b, ep_state_q(s));
  for (int i = 0; i < steps; i++) {
    assert_int_equal(ep_step(s, def, &report), EP_OK);
    const double energy = total(&report, def->force, ep_state_q(s));
    const int counts = b->model.size.k == 0 || def->strength == 0 || was || report.unfolding;
    most = fmax(most, energy);
    if (counts) told.growth = fmax(told.growth, (energy - before) / most);
    before = energy;
    told.unfolded += report.unfolding;
    told.soft += s->guards_soft;
    told.began += !was && report.unfolding, told.ended += was && !report.unfolding;
    was = report.unfolding;
  }
  told.left = bar_inverted(b, ep_state_q(s));
  told.unfolds = s->unfold.on;
  free(block);
  return told;
}

static ep_step_def damped(void) {
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.02;
  def.damping_mass = 0.5;
  return def;
}

// Mirrored as a whole, as far as the modes can: all guards are turned over.
static void mirrored(const bar *b, double *q) {
  const size_t n = (size_t)b->model.size.n;
  memset(q, 0, R * sizeof *q);
  for (int t = 0; t < b->model.size.nt; t++)
    for (int i = 0; i < 4; i++) {
      const size_t v = (size_t)b->model.tets[4 * t + i];
      for (size_t a = 0; a < R; a++)
        q[a] += 1000 * b->volume[t] / 4 * b->model.u[(a * n + v) * 3] * -2 * b->model.rest_x[3 * v];
    }
}

static void unfolds_and_returns(void **state) {
  (void)state;
  bar *b = make();
  double q[R];
  mirrored(b, q);
  const ep_step_def def = damped();
  const story told = follow(b, q, &def, 1200);
  assert_true(told.inverted > b->model.size.nt / 2);
  assert_true(told.unfolded > 0 && told.unfolds == 0);
  assert_int_equal(told.left, 0);
  assert_true(told.growth <= 1e-8); // what a change may add
  bar_free(b);
}

// Nothing but the unfolding takes energy away (Newmark), or little (implicit Euler, BDF2).
static void ends_without_damping(void **state) {
  (void)state;
  static const ep_integrator integrator[] = {EP_IMPLICIT_EULER, EP_NEWMARK, EP_BDF2};
  bar *b = make();
  for (int i = 0; i < 3; i++) {
    void *block;
    ep_state *s = bar_state(b, &block);
    ep_step_def def = ep_default_step();
    ep_step_report report;
    int steps = 0;
    def.integrator = integrator[i];
    mirrored(b, ep_state_q(s));
    do { // 5 s at most
      assert_int_equal(ep_step(s, &def, &report), EP_OK);
    } while (report.unfolding && ++steps < 300);
    assert_in_range(steps, 1, 299);
    assert_int_equal(bar_inverted(b, ep_state_q(s)), 0);
    free(block);
  }
  bar_free(b);
}

// Pulled down at its free end.
static void end_load(const bar *b, double newton, double *load) {
  const size_t n = (size_t)b->model.size.n;
  memset(load, 0, R * sizeof *load);
  for (size_t a = 0; a < R; a++)
    for (size_t v = 0; v < n; v++)
      if (b->model.rest_x[3 * v] > 3.9)
        load[a] -= newton / 16 * b->model.u[(a * n + v) * 3 + 1]; // 4 x 4 vertices
}

// The example force's potential goes with the material, and comes back with it: with what it adds
// counted, neither change nor any step between adds energy. Under a load it ends too; the change
// that ends it then is the one that may add some.
static void examples_add_nothing(void **state) {
  (void)state;
  bar *b = bar_create(8, 3, 3, R, 12, 4, 2, EP_STVK_VOLUME);
  bar_add_guards(b, b->model.size.nt, 0.3);
  double q[R], load[R];
  mirrored(b, q);
  end_load(b, 1e3, load);
  for (int i = 0; i < 6; i++) {
    ep_step_def def = damped();
    def.strength = i % 3 == 0 ? 0.2 : i % 3 == 1 ? 1 : 5;
    def.relief = i % 3 == 2 ? 0.75 : 0;
    def.force = i < 3 ? NULL : load;
    const story told = follow(b, q, &def, 900);
    assert_true(told.began > 0 && told.ended == told.began);
    assert_int_equal(told.left, 0);
    if (!def.force) assert_true(told.growth <= 1e-8);
  }
  bar_free(b);
}

static void writing_starts_anew(void **state) {
  (void)state;
  bar *b = make();
  void *block;
  ep_state *s = bar_state(b, &block);
  const ep_step_def def = damped();
  ep_step_report report = {0};
  mirrored(b, ep_state_q(s));
  for (int i = 0; i < 20 && !report.unfolding; i++)
    assert_int_equal(ep_step(s, &def, &report), EP_OK);
  assert_true(report.unfolding);
  for (int a = 0; a < R; a++) ep_state_velocity(s)[a] += 1e-3;
  assert_int_equal(ep_step(s, &def, &report), EP_OK);
  assert_true(report.unfolding);
  bar_random_q(b, 0.1, ep_state_q(s));
  memset(ep_state_velocity(s), 0, R * sizeof(double));
  ep_state *fresh;
  void *fresh_block;
  fresh = bar_state(b, &fresh_block);
  memcpy(ep_state_q(fresh), ep_state_q(s), R * sizeof(double));
  assert_int_equal(ep_step(s, &def, &report), EP_OK);
  assert_true(!report.unfolding);
  assert_int_equal(ep_step(fresh, &def, NULL), EP_OK);
  assert_memory_equal(ep_state_q(s), ep_state_q(fresh), R * sizeof(double));
  free(fresh_block);
  free(block);
  bar_free(b);
}

static void few_guards_are_no_crowd(void **state) {
  (void)state;
  int few = 0, many = 0;
  for (int guards = 1; guards <= 24; guards++) {
    bar *b = bar_create(8, 3, 3, R, 12, 0, 0, EP_STVK_VOLUME);
    bar_add_guards(b, guards, 0.3);
    void *block;
    ep_state *s = bar_state(b, &block);
    const double none[R] = {0};
    mirrored(b, s->q);
    ep_guard_begin(s);
    const int most = 2 * s->guards_over > guards;
    few += most && s->guards_over < 8, many += most && s->guards_over >= 8;
    ep_unfold_begin(s, 1e9, none, 0);
    assert_int_equal(s->unfold.on, most && s->guards_over >= 8);
    ep_unfold_never(s);
    s->unfold = (ep_unfold){.calm = EP_UNFOLD_CALM};
    ep_unfold_begin(s, 1e9, none, 0);
    assert_int_equal(s->unfold.on, 0);
    free(block);
    bar_free(b);
  }
  assert_true(few > 0 && many > 0);
}

// A step that fails leaves the unfolding as it was, begun or not.
static void a_failed_step_changes_nothing(void **state) {
  (void)state;
  bar *b = make();
  void *block;
  ep_state *s = bar_state(b, &block);
  ep_step_def whole = ep_default_step(), cut = whole;
  ep_step_report report;
  int failed[2] = {0, 0};
  const double no_number[R] = {NAN};
  cut.force = no_number;
  mirrored(b, ep_state_q(s));
  for (int i = 0; i < 20; i++) {
    const ep_unfold before = s->unfold;
    assert_int_equal(ep_step(s, &cut, &report), EP_ERR_NUMERIC);
    assert_true(before.on == s->unfold.on && before.calm == s->unfold.calm);
    assert_true(before.bend == s->unfold.bend && before.from == s->unfold.from);
    failed[before.on]++;
    assert_int_equal(ep_step(s, &whole, &report), EP_OK);
    assert_int_equal(report.unfolding, s->unfold.on);
  }
  assert_true(failed[0] > 0 && failed[1] > 0);
  free(block);
  bar_free(b);
}

// Pressed flat by a load, or started at random, with guards turned over at times.
static void others_never_unfold(void **state) {
  (void)state;
  bar *b = make();
  const size_t n = (size_t)b->model.size.n;
  int soft = 0, inverted = 0;
  for (int k = 0; k < 4; k++) {
    double load[R] = {0};
    for (size_t a = 0; a < R; a++)
      for (size_t v = 0; v < n; v++)
        if (b->model.rest_x[3 * v] > 3.9) load[a] -= 1e3 * pow(10, k) * b->model.u[(a * n + v) * 3];
    ep_step_def def = damped();
    def.force = load;
    const story told = follow(b, NULL, &def, 200);
    assert_int_equal(told.unfolded, 0);
    soft += told.soft;
  }
  for (int i = 1; i <= 8; i++) {
    double q[R];
    const ep_step_def def = damped();
    bar_random_q(b, 0.2 * i, q);
    const story told = follow(b, q, &def, 100);
    assert_int_equal(told.unfolded, 0);
    soft += told.soft;
    inverted += told.inverted;
  }
  assert_true(soft > 0 && inverted > 0);
  bar_free(b);
}

// Calm and turned over, but held there: the force of the load is as large as that of K0 q.
static void a_load_keeps_it_folded(void **state) {
  (void)state;
  bar *b = make();
  void *block;
  ep_state *s = bar_state(b, &block);
  const double none[R] = {0};
  double force[R];
  bar_random_q(b, 1, s->q);
  const double y = linear(b, s->q);
  for (int a = 0; a < R; a++) force[a] = ep_dot(R, b->model.k0 + R * a, s->q);
  for (int held = 1; held >= 0; held--) {
    s->unfold = (ep_unfold){.calm = EP_UNFOLD_CALM};
    s->guards_soft = 1;
    const int calm = ep_unfold_begin(s, y, held ? force : none, 1);
    assert_int_equal(calm, !held);
    assert_int_equal(s->unfold.on, !held);
  }
  free(block);
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(derivatives_are_right),         cmocka_unit_test(goes_on_from_the_energy),
      cmocka_unit_test(unfolds_and_returns),           cmocka_unit_test(ends_without_damping),
      cmocka_unit_test(examples_add_nothing),          cmocka_unit_test(writing_starts_anew),
      cmocka_unit_test(few_guards_are_no_crowd),       cmocka_unit_test(a_load_keeps_it_folded),
      cmocka_unit_test(a_failed_step_changes_nothing), cmocka_unit_test(others_never_unfold),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
