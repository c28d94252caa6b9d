// Guards. Claims: their energy is sum_e w_e k_e b(J_e / limit_e) with b(x) = -(x - 1)^2 log x below
// 1 and its parabola below the floor, C2; gradient and Hessian are its derivatives (central
// differences, error ~ h^2), projected Hessians are positive semidefinite; no F within the reach of
// a group brings a guard to its limit, and no mode moves F further than what is gone; both in the
// same bits on every instruction set; what the state remembers of where it looked changes no bit;
// an inverted object is driven back, a collapsed one too; of a hard push on a bar of few cubature
// elements no tet of the whole mesh is inverted at any time (of the hardest none once it ended),
// and without guards some are; nothing happens near rest.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/state.h"
#include "tests/near.h"
#include "tests/reduced/bar.h"

enum { R = 11, GUARDS = 21 };

static double wall(double x) {
  const double y = EP_GUARD_FLOOR, l = log(y), g = y - 1;
  if (x >= 1) return 0;
  if (x >= y) return -(x - 1) * (x - 1) * log(x);
  const double slope = -(2 * g * l + g * g / y);
  const double curvature = -2 * l - 4 * g / y + g * g / (y * y);
  return -g * g * l + slope * (x - y) + 0.5 * curvature * (x - y) * (x - y);
}

static double jacobian(const bar *b, int guard, const double *q) {
  const double *g = b->g + 9 * (size_t)b->model.guard_tet[guard] * R;
  double f[9];
  for (int c = 0; c < 9; c++) {
    f[c] = c % 4 == 0;
    for (int a = 0; a < R; a++) f[c] += g[c * R + a] * q[a];
  }
  return f[0] * (f[4] * f[8] - f[5] * f[7]) - f[1] * (f[3] * f[8] - f[5] * f[6]) +
         f[2] * (f[3] * f[7] - f[4] * f[6]);
}

static double plain(const bar *b, const double *q) {
  double sum = 0;
  for (int i = 0; i < b->model.size.guards; i++)
    sum += b->model.guard_w[i] * b->model.guard_stiffness[i] *
           wall(jacobian(b, i, q) / b->model.guard_limit[i]);
  return sum;
}

static double energy_of(ep_state *s, const double *q, double *f, double *h, int project) {
  if (f) memset(f, 0, R * sizeof *f);
  if (h) memset(h, 0, R * R * sizeof *h);
  return ep_guard_add(s, q, f, h, project);
}

static bar *make(double limit) {
  bar *b = bar_create(5, 2, 2, R, 9, 0, 0, EP_STVK_VOLUME);
  bar_add_guards(b, GUARDS, limit);
  return b;
}

// All three parts of the wall are met: above the limit, between, below the floor.
static void is_the_sum_of_the_walls(void **state) {
  (void)state;
  bar *b = make(0.6);
  void *block;
  ep_state *s = bar_state(b, &block);
  int above = 0, between = 0, below = 0;
  for (int i = 0; i < 200; i++) {
    double q[R];
    bar_random_q(b, 0.02 * i, q);
    const double expected = plain(b, q), found = energy_of(s, q, NULL, NULL, 0);
    assert_true(fabs(found - expected) <= 1e-12 * expected); // sums of 21 positive numbers
    for (int g = 0; g < GUARDS; g++) {
      const double x = jacobian(b, g, q) / b->model.guard_limit[g];
      above += x >= 1, below += x < EP_GUARD_FLOOR, between += x < 1 && x >= EP_GUARD_FLOOR;
    }
  }
  assert_true(above > 100 && between > 100 && below > 100);
  free(block);
  bar_free(b);
}

static double error_of_gradient(ep_state *s, const double *q, const double *d, double h) {
  double plus[R], minus[R], f[R], along = 0;
  for (int a = 0; a < R; a++) plus[a] = q[a] + h * d[a], minus[a] = q[a] - h * d[a];
  energy_of(s, q, f, NULL, 0);
  for (int a = 0; a < R; a++) along += f[a] * d[a];
  const double difference =
      (energy_of(s, plus, NULL, NULL, 0) - energy_of(s, minus, NULL, NULL, 0)) / (2 * h);
  return fabs(difference - along) / fabs(along);
}

static double error_of_hessian(ep_state *s, const double *q, const double *d, double h) {
  double plus[R], minus[R], up[R], down[R], hessian[R * R], wrong = 0, whole = 0;
  for (int a = 0; a < R; a++) plus[a] = q[a] + h * d[a], minus[a] = q[a] - h * d[a];
  energy_of(s, q, up, hessian, 0);
  energy_of(s, plus, up, NULL, 0);
  energy_of(s, minus, down, NULL, 0);
  for (int a = 0; a < R; a++) {
    double along = 0;
    for (int c = 0; c < R; c++) along += hessian[R * a + c] * d[c];
    wrong += pow((up[a] - down[a]) / (2 * h) - along, 2), whole += along * along;
  }
  return sqrt(wrong / whole);
}

static void derivatives_at(ep_state *s, const double *q, const double *d, double h) {
  const double order = log2(error_of_gradient(s, q, d, h) / error_of_gradient(s, q, d, h / 2));
  const double second = log2(error_of_hessian(s, q, d, h) / error_of_hessian(s, q, d, h / 2));
  ASSERT_NEAR(order, 2, 0.1);
  ASSERT_NEAR(second, 2, 0.1);
}

// One guard alone, within one part of the wall (its third derivative jumps between them), or within
// the parabola of an object that is turned over.
static void derivatives_are_right(void **state) {
  (void)state;
  bar *b = bar_create(5, 2, 2, R, 9, 0, 0, EP_STVK_VOLUME);
  bar_add_guards(b, 1, 0.6);
  void *block;
  ep_state *s = bar_state(b, &block);
  enum { WALL, ITS_PARABOLA, TURNED_OVER, PARTS };
  int tried[PARTS] = {0};
  for (int i = 0; i < 400; i++) {
    double q[R], d[R];
    bar_random_q(b, 0.03 * i, q);
    bar_random_q(b, 1, d);
    const double x = jacobian(b, 0, q) / b->model.guard_limit[0];
    for (int part = 0; part < PARTS; part++) {
      const int within = part == WALL ? x > 0.1 && x < 0.9 : part == ITS_PARABOLA ? x < 0 : x < 0.9;
      if (!within || tried[part] == 10) continue;
      s->guards_soft = part == TURNED_OVER;
      derivatives_at(s, q, d, part == WALL ? 1e-3 : 2e-3);
      tried[part]++;
    }
  }
  for (int part = 0; part < PARTS; part++) assert_true(tried[part] >= 5);
  free(block);
  bar_free(b);
}

// The parabolas of an object that is turned over.
static void parabolas_are_right(void **state) {
  (void)state;
  bar *b = make(0.6);
  void *block;
  ep_state *s = bar_state(b, &block);
  int below = 0;
  s->guards_soft = 1;
  for (int i = 0; i < 40; i++) {
    double q[R], expected = 0;
    bar_random_q(b, 0.1 * i, q);
    for (int g = 0; g < GUARDS; g++) {
      const double gap = fmin(0, jacobian(b, g, q) - b->model.guard_limit[g]);
      expected +=
          b->model.guard_w[g] * b->model.guard_stiffness[g] * 0.5 * EP_GUARD_SOFTNESS * gap * gap;
    }
    ASSERT_NEAR(energy_of(s, q, NULL, NULL, 0), expected, 1e-12 * expected);
    below += expected > 0;
  }
  assert_true(below > 20);
  free(block);
  bar_free(b);
}

// A step that begins turned over has parabolas, until every guard is above its limit; a step that
// begins with a guard merely pressed flat keeps its walls.
static void parabolas_come_and_go(void **state) {
  (void)state;
  bar *b = make(0.6);
  void *block;
  ep_state *s = bar_state(b, &block);
  int turned = 0, flat = 0;
  for (int i = 0; i < 100; i++) {
    double least = 1;
    bar_random_q(b, 0.03 * i, s->q);
    for (int g = 0; g < GUARDS; g++)
      least = fmin(least, jacobian(b, g, s->q) / b->model.guard_limit[g]);
    for (int before = 0; before < 2; before++) {
      s->guards_soft = before;
      ep_guard_begin(s);
      assert_int_equal(s->guards_soft, least < 0 || (before && least < 1));
    }
    turned += least<0, flat += least> 0 && least < 1;
  }
  assert_true(turned > 10 && flat > 10);
  free(block);
  bar_free(b);
}

// t on the way 0 .. d where J of guard 0 is x times its limit; 0 where it does not get there.
static double way_until(const bar *b, double x, const double *d) {
  double low = 0, high = 1, q[R];
  for (int i = 0; i < 60; i++) {
    const double t = i == 0 ? high : 0.5 * (low + high);
    for (int a = 0; a < R; a++) q[a] = t * d[a];
    const int above = jacobian(b, 0, q) > x * b->model.guard_limit[0];
    if (i == 0 && above) return 0;
    if (above)
      low = t;
    else
      high = t;
  }
  return high;
}

static double slope_at(ep_state *s, const double *d, double t) {
  double q[R], f[R];
  for (int a = 0; a < R; a++) q[a] = t * d[a];
  energy_of(s, q, f, NULL, 0);
  return ep_dot(R, f, d);
}

// Where the parts of the wall meet, slope and curvature go on: from both sides the same. (Its third
// derivative jumps, so one-sided differences over h differ by O(h).)
static void parts_meet_smoothly(void **state) {
  (void)state;
  bar *b = bar_create(5, 2, 2, R, 9, 0, 0, EP_STVK_VOLUME);
  bar_add_guards(b, 1, 0.6);
  void *block;
  ep_state *s = bar_state(b, &block);
  const double limit = b->model.guard_limit[0];
  const double unit = b->model.guard_w[0] * b->model.guard_stiffness[0];
  int tried[2] = {0};
  for (int i = 0; i < 200; i++) {
    double d[R], q[R];
    bar_random_q(b, 20, d);
    for (int part = 0; part < 2; part++) {
      const double t = way_until(b, part ? EP_GUARD_FLOOR : 1, d);
      if (t == 0) continue;
      double x[2];
      for (int side = 0; side < 2; side++) {
        for (int a = 0; a < R; a++) q[a] = (t + 1e-4 * (side - 0.5)) * d[a];
        x[side] = jacobian(b, 0, q) / limit;
      }
      const double rate = (x[1] - x[0]) / 1e-4, h = 1e-6 / fabs(rate);
      const double before = slope_at(s, d, t - h), here = slope_at(s, d, t);
      const double after = slope_at(s, d, t + h);
      const double left = (here - before) / h, right = (after - here) / h;
      assert_true(fabs(left - right) <= 1e-3 * fmax(unit * rate * rate, fabs(right)));
      assert_true(fabs(after - here) <= 2 * h * fmax(unit * rate * rate, fabs(right)));
      tried[part]++;
    }
  }
  assert_true(tried[0] > 20 && tried[1] > 20);
  free(block);
  bar_free(b);
}

static void projection_is_semidefinite(void **state) {
  (void)state;
  bar *b = make(0.6);
  void *block;
  ep_state *s = bar_state(b, &block);
  int indefinite = 0;
  for (int i = 0; i < 50; i++) {
    double q[R], h[R * R], l[R * R], size = 0;
    bar_random_q(b, 0.05 * i, q);
    if (energy_of(s, q, NULL, h, 0) == 0) continue;
    for (int a = 0; a < R; a++) size = fmax(size, fabs(h[(R + 1) * a]));
    for (int a = 0; a < R; a++) h[(R + 1) * a] += 1e-9 * size;
    indefinite += !ep_cholesky(R, h, l);
    energy_of(s, q, NULL, h, 1);
    for (int a = 0; a < R; a++) h[(R + 1) * a] += 1e-9 * size; // round-off of the sums
    assert_true(ep_cholesky(R, h, l));
  }
  assert_true(indefinite > 10); // the projection had something to do
  free(block);
  bar_free(b);
}

// Wander in small steps and far jumps: each time the same bits as a state that never looked.
static void memory_changes_nothing(void **state) {
  (void)state;
  bar *b = make(0.5);
  void *block, *fresh_block;
  ep_state *s = bar_state(b, &block);
  double q[R] = {0}, step[R], f[R], h[R * R], fresh_f[R], fresh_h[R * R];
  int acted = 0, passed = 0;
  for (int i = 0; i < 600; i++) {
    bar_random_q(b, i % 97 == 96 ? 1.5 : 0.05, step);
    for (int a = 0; a < R; a++) q[a] = (i % 97 == 0 ? 0 : q[a]) + step[a];
    const double energy = energy_of(s, q, f, h, 0);
    ep_state *fresh = bar_state(b, &fresh_block);
    assert_true(energy_of(fresh, q, fresh_f, fresh_h, 0) == energy);
    assert_memory_equal(f, fresh_f, sizeof f);
    assert_memory_equal(h, fresh_h, sizeof h);
    for (int g = 0; g < (GUARDS + 7) / 8; g++) // looked at before, not now
      passed += memcmp(s->guard_at + g * 8 * ((R + 7) / 8), q, sizeof q) != 0;
    acted += energy > 0;
    free(fresh_block);
  }
  assert_true(acted > 50 && passed > 200);
  free(block);
  bar_free(b);
}

// |G_e d| of a guard.
static double change(const bar *b, int guard, const double *d) {
  const double *g = b->g + 9 * (size_t)b->model.guard_tet[guard] * R;
  double square = 0;
  for (int c = 0; c < 9; c++) {
    double sum = 0;
    for (int a = 0; a < R; a++) sum += g[c * R + a] * d[a];
    square += sum * sum;
  }
  return sqrt(square);
}

// Reach of the first group from q, on every instruction set the same.
static double reach_of(const bar *b, const double *padded, double *jacobians) {
  const ep_model *m = &b->model;
  double first = 0, same[8];
  for (int isa = 0; isa <= (int)ep_isa_here(); isa++) {
    const double reach =
        ep_guard_of((ep_isa)isa)
            .reach(8, m->size.blocks, m->guard_g, m->guard_limit, padded, jacobians);
    if (isa == 0) first = reach, memcpy(same, jacobians, sizeof same);
    assert_true(reach == first);
    assert_memory_equal(jacobians, same, sizeof same);
  }
  return first;
}

static void reach_is_safe(void **state) {
  (void)state;
  bar *b = make(0.5);
  _Alignas(64) double q[16] = {0}, jacobians[8];
  int far = 0, at = 0;
  for (int i = 0; i < 200; i++) {
    bar_random_q(b, 0.01 * i, q);
    const double reach = reach_of(b, q, jacobians);
    double room = 1;
    for (int e = 0; e < 8; e++) {
      assert_true(fabs(jacobians[e] - jacobian(b, e, q)) <= 1e-12 * (1 + fabs(jacobians[e])));
      room = fmin(room, jacobians[e] - b->model.guard_limit[e]);
    }
    assert_true(room > 1e-8 ? reach > 0 : room > 0 || reach == 0);
    for (int j = 0; reach > 0 && j < 50; j++) {
      double d[R], there[R], most = 0;
      bar_random_q(b, 1, d);
      for (int e = 0; e < 8; e++) most = fmax(most, change(b, e, d));
      for (int a = 0; a < R; a++) there[a] = q[a] + reach / most * d[a];
      for (int e = 0; e < 8; e++)
        assert_true(jacobian(b, e, there) >= b->model.guard_limit[e] - 1e-12);
    }
    far += reach > 0, at += reach == 0;
  }
  assert_true(far > 50 && at > 50);
  // At rest the nearest F with det = limit is (1 - d / sqrt 3) I: the bound gives half of d.
  memset(q, 0, sizeof q);
  const double d = sqrt(3) * (1 - cbrt(0.5)), reach = reach_of(b, q, jacobians);
  assert_true(reach < d && reach > 0.5 * d);
  bar_free(b);
}

static double cofactor(const double f[9], double c[9]) {
  for (int i = 0; i < 9; i++) {
    const int i1 = (i / 3 + 1) % 3 * 3, i2 = (i / 3 + 2) % 3 * 3, j1 = (i + 1) % 3,
              j2 = (i + 2) % 3;
    c[i] = f[i1 + j1] * f[i2 + j2] - f[i1 + j2] * f[i2 + j1];
  }
  return f[0] * c[0] + f[1] * c[1] + f[2] * c[2];
}

// A guard whose modes are the entries of F: the worst D of the length of the reach, by
// D = -reach cof(F + D) / |cof(F + D)|, stationary where det is least on that sphere.
static void no_way_within_reach_is_worse(void **state) {
  (void)state;
  bar *b = make(0.5);
  _Alignas(64) double q[16], packed[2 * 72], jacobians[8];
  double modes[81] = {0}, random[R], least = 1;
  for (int c = 0; c < 9; c++) modes[10 * c] = 1;
  ep_pack_cubature(9, 1, modes, packed);
  for (int i = 0; i < 2000; i++) {
    double f[9], d[9], cof[9], det = 0;
    const double limit = i % 2 ? 0.15 : 0.01 + 0.0003 * i;
    memset(q, 0, sizeof q);
    bar_random_q(b, 1, random);
    for (int c = 0; c < 9; c++) q[c] = 0.0004 * i * random[c] / fabs(random[i % 9]);
    const double reach = ep_guard_of(ep_isa_here()).reach(1, 2, packed, &limit, q, jacobians);
    for (int c = 0; c < 9; c++) f[c] = (c % 4 == 0) + q[c], d[c] = i % 3 ? 0 : 0.3 * random[c];
    if (reach == 0) continue;
    for (int k = 0; k < 40; k++) {
      double at[9], square = 0;
      for (int c = 0; c < 9; c++) at[c] = f[c] + d[c];
      cofactor(at, cof);
      for (int c = 0; c < 9; c++) square += cof[c] * cof[c];
      for (int c = 0; c < 9; c++) d[c] = -reach * cof[c] / sqrt(square);
      for (int c = 0; c < 9; c++) at[c] = f[c] + d[c];
      det = cofactor(at, cof);
      assert_true(det >= limit - 1e-12);
    }
    least = fmin(least, det - limit);
  }
  assert_true(least < 0.01); // the bound is nearly met by some
  bar_free(b);
}

static void gone_is_no_less_than_the_change(void **state) {
  (void)state;
  bar *b = make(0.5);
  const ep_model *m = &b->model;
  enum { GROUPS = (GUARDS + 7) / 8 };
  _Alignas(64) double q[16] = {0}, at[16 * GROUPS] = {0};
  double gone[GROUPS], same[GROUPS], d[R];
  for (int i = 0; i < 100; i++) {
    bar_random_q(b, 1, q);
    for (int g = 0; g < GROUPS; g++) bar_random_q(b, 1, at + 16 * g);
    for (int isa = 0; isa <= (int)ep_isa_here(); isa++) {
      ep_guard_of((ep_isa)isa).gone(GROUPS, m->size.blocks, m->guard_growth, at, q, gone);
      if (isa == 0) memcpy(same, gone, sizeof same);
      assert_memory_equal(gone, same, sizeof same);
    }
    for (int e = 0; e < GUARDS; e++) {
      for (int a = 0; a < R; a++) d[a] = q[a] - at[e / 8 * 16 + a];
      assert_true(change(b, e, d) <= gone[e / 8] * (1 + 1e-12));
    }
  }
  bar_free(b);
}

static void rest_is_untouched(void **state) {
  (void)state;
  bar *b = make(0.3);
  void *block;
  ep_state *s = bar_state(b, &block);
  double q[R], f[R], h[R * R];
  const double nothing[R * R] = {0};
  bar_random_q(b, 0.1, q);
  assert_true(energy_of(s, q, f, h, 0) == 0);
  assert_memory_equal(f, nothing, sizeof f);
  assert_memory_equal(h, nothing, sizeof h);
  free(block);
  bar_free(b);
}

// ---- in steps ----------------------------------------------------------------------------------

enum { PUSHED = 30, FREE = 90 };

// Largest number of inverted tets while pushed, and that at the end.
static void push(const bar *b, const double *start, const double *load, int *most, int *left) {
  void *block;
  ep_state *s = bar_state(b, &block);
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.02;
  *most = 0;
  if (start) memcpy(ep_state_q(s), start, (size_t)b->model.size.r * sizeof *start);
  for (int step = 0; step < PUSHED + FREE; step++) {
    def.force = step < PUSHED ? load : NULL;
    assert_int_equal(ep_step(s, &def, NULL), EP_OK);
    *left = bar_inverted(b, ep_state_q(s));
    if (step<PUSHED && * left> * most) *most = *left;
  }
  free(block);
}

// A force on each of the 16 vertices of the far end, against the axis and aside.
static void end_load(const bar *b, double newton, double *load) {
  const size_t r = (size_t)b->model.size.r, n = (size_t)b->model.size.n;
  memset(load, 0, r * sizeof *load);
  for (size_t a = 0; a < r; a++)
    for (size_t v = 0; v < n; v++)
      if (b->model.rest_x[3 * v] > 3.9)
        load[a] -= newton * (b->model.u[(a * n + v) * 3] + 0.3 * b->model.u[(a * n + v) * 3 + 1]);
}

static void a_hard_push_inverts_nothing(void **state) {
  (void)state;
  for (int k = 0; k < 3; k++) {
    bar *b = bar_create(8, 3, 3, 20, 12, 0, 0, EP_STVK_VOLUME);
    double load[20];
    int most, left;
    end_load(b, 1e4 * pow(10, k), load); // 4 t of bar: 4, 40 and 400 times its weight in all
    push(b, NULL, load, &most, &left);
    assert_true(most > 10); // without guards
    if (k == 2) assert_true(left > 0);
    bar_add_guards(b, b->model.size.nt, 0.3);
    push(b, NULL, load, &most, &left);
    if (k < 2) assert_int_equal(most, 0);
    assert_int_equal(left, 0);
    bar_free(b);
  }
}

// U q nearest to the mirror image (factor -2), to a plane (-1) across the bar's axis.
static void nearest(const bar *b, double factor, double *q) {
  const size_t r = (size_t)b->model.size.r, n = (size_t)b->model.size.n;
  for (size_t a = 0; a < r; a++) {
    q[a] = 0;
    for (size_t v = 0; v < n; v++)
      for (int t = 0; t < b->model.size.nt; t++) // lumped mass
        for (int i = 0; i < 4; i++)
          if ((size_t)b->model.tets[4 * t + i] == v)
            q[a] += 1000 * b->volume[t] / 4 * b->model.u[(a * n + v) * 3] * factor *
                    b->model.rest_x[3 * v];
  }
}

// Random states too: with walls only, some of these stay jammed for ever.
static void random_starts_recover(void **state) {
  (void)state;
  bar *b = bar_create(8, 3, 3, 20, 12, 0, 0, EP_STVK_VOLUME);
  bar_add_guards(b, b->model.size.nt, 0.3);
  int most, left, inverted = 0;
  for (int i = 0; i < 10; i++) {
    double q[20];
    bar_random_q(b, 1 + 0.4 * i, q);
    inverted += bar_inverted(b, q);
    push(b, q, NULL, &most, &left);
    assert_int_equal(left, 0);
  }
  assert_true(inverted > 100);
  bar_free(b);
}

static void inverted_starts_recover(void **state) {
  (void)state;
  for (int factor = 1; factor <= 2; factor++) {
    bar *b = bar_create(8, 3, 3, 20, 12, 0, 0, EP_STVK_VOLUME);
    double q[20];
    int most, left;
    bar_add_guards(b, b->model.size.nt, 0.3);
    nearest(b, -factor, q);
    assert_true(bar_inverted(b, q) > b->model.size.nt / 10);
    push(b, q, NULL, &most, &left);
    assert_int_equal(left, 0);
    bar_free(b);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(is_the_sum_of_the_walls),
      cmocka_unit_test(derivatives_are_right),
      cmocka_unit_test(parabolas_are_right),
      cmocka_unit_test(parabolas_come_and_go),
      cmocka_unit_test(parts_meet_smoothly),
      cmocka_unit_test(projection_is_semidefinite),
      cmocka_unit_test(reach_is_safe),
      cmocka_unit_test(no_way_within_reach_is_worse),
      cmocka_unit_test(gone_is_no_less_than_the_change),
      cmocka_unit_test(memory_changes_nothing),
      cmocka_unit_test(rest_is_untouched),
      cmocka_unit_test(a_hard_push_inverts_nothing),
      cmocka_unit_test(inverted_starts_recover),
      cmocka_unit_test(random_starts_recover),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
