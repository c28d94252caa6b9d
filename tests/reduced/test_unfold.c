// The way out of a jam (reduced/unfold.h). Claims: V(q) = slope y + (1 - slope) well y / (well + y)
// has the gradient and Hessian of its formula (central differences, error ~ h^2), a projected
// Hessian is positive semidefinite; where unfolding begins V = W, or V = y < W, and V falls with y;
// what is nowhere near turned over never unfolds, nor does what a load holds pressed flat; a bar
// whose guards are mostly turned over unfolds, comes to rest with nothing inverted and back to its
// own material, and its energy grows in no step (implicit Euler without loads: only round-off); a
// step that fails leaves the unfolding as it was.
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
      ep_unfold_energy(s, plus, up, NULL, 0) - ep_unfold_energy(s, minus, down, NULL, 0);
  ep_unfold_energy(s, q, g, hessian, 0);
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
    s->unfold = (ep_unfold){.on = 1, .well = linear(b, q) / i, .slope = 0.02 * i};
    for (int second = 0; second < 2; second++) {
      const double e = 1e-2 * i; // a twentieth of q: V is no polynomial of the third degree
      const double order = log2(error_of(s, q, d, e, second) / error_of(s, q, d, e / 2, second));
      assert_true(fabs(order - 2) < 0.1);
    }
    ep_unfold_energy(s, q, NULL, h, 1);
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
    double q[R], before = ep_unfold_energy(s, s->q, NULL, NULL, 0);
    assert_true(fabs(before - fmin(w, y)) <= 1e-12 * y); // sums of 400 terms
    for (int k = 9; k >= 0; k--) {
      for (int a = 0; a < R; a++) q[a] = 0.1 * k * s->q[a];
      const double now = ep_unfold_energy(s, q, NULL, NULL, 0);
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
  int unfolds;                  // still, at the end
  double growth;                // the most of a step, relative to the most energy
} story;

static story follow(const bar *b, const double *start, const double *load, int steps) {
  void *block;
  ep_state *s = bar_state(b, &block);
  ep_step_def def = ep_default_step();
  ep_step_report report;
  story told = {0};
  double before = INFINITY, most = 0;
  def.damping_stiffness = 0.02;
  def.damping_mass = 0.5;
  def.force = load;
  if (start) memcpy(ep_state_q(s), start, R * sizeof *start);
  told.inverted = bar_inverted(b, ep_state_q(s));
  for (int i = 0; i < steps; i++) {
    assert_int_equal(ep_step(s, &def, &report), EP_OK);
    const double energy = report.elastic_energy + report.kinetic_energy;
    most = fmax(most, energy);
    told.growth = fmax(told.growth, (energy - before) / most);
    before = energy;
    told.unfolded += report.unfolding;
  }
  told.left = bar_inverted(b, ep_state_q(s));
  told.unfolds = s->unfold.on;
  free(block);
  return told;
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
  const story told = follow(b, q, NULL, 1200);
  assert_true(told.inverted > b->model.size.nt / 2);
  assert_true(told.unfolded > 0 && told.unfolds == 0);
  assert_int_equal(told.left, 0);
  assert_true(told.growth <= 1e-8); // what a change may add
  bar_free(b);
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
    assert_true(before.well == s->unfold.well && before.slope == s->unfold.slope);
    failed[before.on]++;
    assert_int_equal(ep_step(s, &whole, &report), EP_OK);
    assert_int_equal(report.unfolding, s->unfold.on);
  }
  assert_true(failed[0] > 0 && failed[1] > 0);
  free(block);
  bar_free(b);
}

static void others_never_unfold(void **state) {
  (void)state;
  bar *b = make();
  const size_t n = (size_t)b->model.size.n;
  for (int k = 0; k < 3; k++) {
    double load[R] = {0};
    for (size_t a = 0; a < R; a++)
      for (size_t v = 0; v < n; v++)
        if (b->model.rest_x[3 * v] > 3.9) load[a] -= 1e3 * pow(10, k) * b->model.u[(a * n + v) * 3];
    assert_int_equal(follow(b, NULL, load, 200).unfolded, 0);
  }
  for (int i = 1; i <= 5; i++) {
    double q[R];
    bar_random_q(b, 0.2 * i, q);
    assert_int_equal(follow(b, q, NULL, 100).unfolded, 0);
  }
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(derivatives_are_right), cmocka_unit_test(goes_on_from_the_energy),
      cmocka_unit_test(unfolds_and_returns),   cmocka_unit_test(a_failed_step_changes_nothing),
      cmocka_unit_test(others_never_unfold),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
