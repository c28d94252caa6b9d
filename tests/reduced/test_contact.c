// Contact of the reduced object (reduced/contact.h). Claims: the gradient of the contact energy is
// its derivative and the Hessian that of x linear in the unknowns, up to the obstacle's own
// curvature, which is left out (held: n = r; free: n = r + 6: dx = dc + dtheta x (x - c) + R U dq);
// the Hessian is positive semidefinite; the tree finds what a loop over all vertices finds, to the
// last bit of their sum's order; totals of force and torque are the gradient by translation and
// rotation.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "reduced/contact.h"
#include "reduced/contact_point.h"
#include "reduced/state.h"
#include "tests/reduced/bar_contact.h"
#include "tests/reduced/count_allocations.h"

enum { R = 8, N = R + 6 };

typedef struct world {
  bar *b;
  ep_contact_tree tree;
  void *block;
  ep_state *state;
  ep_step_def def;
  ep_obstacle obstacle;
  double q[R], q_start[R];
  ep_frame frame, start;
} world;

static const ep_frame still = {{0, 0, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};

// Rotation by the vector w (Rodrigues).
static void rotation(const double w[3], double R9[9]) {
  const double angle = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
  const double s = angle > 0 ? sin(angle) / angle : 1;
  const double c = angle > 1e-8 ? (1 - cos(angle)) / (angle * angle) : 0.5;
  const double k[9] = {0, -w[2], w[1], w[2], 0, -w[0], -w[1], w[0], 0};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      double kk = 0;
      for (int l = 0; l < 3; l++) kk += k[3 * i + l] * k[3 * l + j];
      R9[3 * i + j] = (i == j) + s * k[3 * i + j] + c * kk;
    }
}

static void turn(const double w[3], ep_frame *f) {
  double by[9], out[9];
  rotation(w, by);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) {
      out[3 * i + j] = 0;
      for (int l = 0; l < 3; l++) out[3 * i + j] += by[3 * i + l] * f->R[3 * l + j];
    }
  memcpy(f->R, out, sizeof out);
}

// Obstacles of each kind somewhere inside the bar (0 <= x <= 4, 0 <= y, z <= 1), moving.
static ep_obstacle obstacle_of(ep_obstacle_kind kind) {
  ep_obstacle o = {.kind = kind, .friction = 0.3, .start = still, .end = still};
  const double tilt[3] = {0.3, -0.5, 0.2}, more[3] = {0.01, 0.02, -0.015};
  const double at[3] = {3.1, 0.25, 0.2};
  memcpy(o.start.c, at, sizeof at);
  turn(tilt, &o.start);
  o.end = o.start;
  turn(more, &o.end);
  o.end.c[0] += 0.02, o.end.c[1] += 0.03;
  o.size[0] = 0.5, o.size[1] = 0.6, o.size[2] = 0.4, o.rounding = 0.08;
  return o;
}

static void create(world *w, ep_obstacle_kind kind) {
  memset(w, 0, sizeof *w);
  w->b = bar_create(12, 4, 4, R, 20, 0, 0, EP_STVK);
  bar_add_contact(w->b, 1e5, &w->tree);
  w->state = bar_state(w->b, &w->block);
  w->def = ep_default_step();
  w->obstacle = obstacle_of(kind);
  w->def.obstacle = &w->obstacle;
  w->def.obstacles = 1;
  w->def.contact.stiffness = 1e6;
  w->def.contact.thickness = 0.15;
  w->def.contact.damping = 0.003;
  bar_random_q(w->b, 0.1, w->q);
  for (int i = 0; i < R; i++) w->q_start[i] = 0.9 * w->q[i];
  w->start = w->frame = still;
  const double spin[3] = {0.02, -0.03, 0.01};
  w->frame.c[0] = 0.05, w->frame.c[1] = -0.04, w->frame.c[2] = 0.02;
  turn(spin, &w->frame);
}

static void destroy(world *w) {
  free(w->block);
  ep_contact_tree_free(&w->tree);
  bar_free(w->b);
}

static void begin(world *w, int framed) {
  const ep_frame *start = framed ? &w->start : NULL, *now = framed ? &w->frame : NULL;
  ep_contact_begin(w->state, &w->def, 0, start, now, w->q_start, w->q);
  // Friction by a configuration in between.
  ep_state *s = w->state;
  for (int i = 0; i < R; i++) s->contact_lag[i] = 0.97 * w->q[i];
  s->contact.lag = w->frame;
}

// The unknowns moved by step along direction d (n).
static void moved(const world *w, const double *d, double step, int framed, double *q,
                  ep_frame *frame) {
  for (int i = 0; i < R; i++) q[i] = w->q[i] + step * d[i];
  *frame = w->frame;
  if (!framed) return;
  double by[3];
  for (int i = 0; i < 3; i++) frame->c[i] += step * d[R + i], by[i] = step * d[R + 3 + i];
  turn(by, frame);
}

static double energy(const world *w, const double *d, double step, int framed, double *g,
                     double *h) {
  double q[R];
  ep_frame frame;
  const int n = framed ? N : R;
  moved(w, d, step, framed, q, &frame);
  if (g) memset(g, 0, (size_t)n * sizeof *g);
  if (h) memset(h, 0, (size_t)(n * n) * sizeof *h);
  return ep_contact_energy(w->state, &w->def, framed ? &frame : NULL, q, g, h, n);
}

static double dot(int n, const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// Central differences: at a step of 3e-5 their own error is below 1e-9 of the gradient.
static void gradient_is_derivative(void **unused) {
  (void)unused;
  for (int kind = 0; kind < 3; kind++)
    for (int framed = 0; framed < 2; framed++) {
      world w;
      double g[N], d[N], error[2];
      create(&w, (ep_obstacle_kind)kind);
      begin(&w, framed);
      const double e0 = energy(&w, w.q, 0, framed, g, NULL);
      assert_true(e0 > 0);
      const int n = framed ? N : R;
      for (int i = 0; i < n; i++) d[i] = (i < R ? 1 : 0.02) * bar_uniform(w.b);
      for (int i = 0; i < 2; i++) {
        const double step = i ? 3e-5 : 3e-4;
        const double slope =
            (energy(&w, d, step, framed, NULL, NULL) - energy(&w, d, -step, framed, NULL, NULL)) /
            (2 * step);
        error[i] = fabs(slope - dot(n, g, d)) / sqrt(dot(n, g, g) * dot(n, d, d));
      }
      assert_true(error[1] < 1e-7);
      destroy(&w);
    }
}

// Along q and the translation x is linear: there the Hessian is the gradient's derivative but for
// the obstacle's own curvature (none for a plane). Rotation adds the force times the curvature of
// exp(theta), left out too, so it is checked with the force's share taken off: the derivative of
// the gradient with positions frozen to first order.
static void hessian_is_derivative_for_a_plane(void **unused) {
  (void)unused;
  for (int framed = 0; framed < 2; framed++) {
    world w;
    double g[2][N], h[N * N], g0[N], d[N] = {0}, worst = 0, size = 0;
    create(&w, EP_OBSTACLE_PLANE);
    begin(&w, framed);
    const int n = framed ? N : R;
    energy(&w, d, 0, framed, g0, h);
    for (int i = 0; i < (framed ? R + 3 : R); i++) d[i] = bar_uniform(w.b);
    const double step = 1e-5;
    energy(&w, d, step, framed, g[0], NULL);
    energy(&w, d, -step, framed, g[1], NULL);
    for (int i = 0; i < R + (framed ? 3 : 0); i++) {
      const double slope = (g[0][i] - g[1][i]) / (2 * step);
      worst = fmax(worst, fabs(slope - dot(n, h + i * n, d)));
      size = fmax(size, fabs(slope));
    }
    assert_true(worst < 1e-4 * size); // friction's |s| bends fast: its third derivative is 1/creep
    destroy(&w);
  }
}

// x^T H x >= 0 for random x and for the gradient, every kind; symmetric.
static void hessian_is_positive(void **unused) {
  (void)unused;
  for (int kind = 0; kind < 3; kind++)
    for (int framed = 0; framed < 2; framed++) {
      world w;
      double h[N * N], d[N], zero[N] = {0}, largest = 0;
      create(&w, (ep_obstacle_kind)kind);
      begin(&w, framed);
      const int n = framed ? N : R;
      energy(&w, zero, 0, framed, NULL, h);
      for (int i = 0; i < n; i++) largest = fmax(largest, h[(n + 1) * i]);
      for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) assert_true(h[i * n + j] == h[j * n + i]);
      for (int trial = 0; trial < 50; trial++) {
        double image[N];
        for (int i = 0; i < n; i++) d[i] = bar_uniform(w.b);
        for (int i = 0; i < n; i++) image[i] = dot(n, h + i * n, d);
        assert_true(dot(n, d, image) > -1e-12 * largest * dot(n, d, d));
      }
      destroy(&w);
    }
}

// One node that holds every vertex is a plain loop over them.
static void tree_finds_what_a_loop_finds(void **unused) {
  (void)unused;
  for (int kind = 0; kind < 3; kind++) {
    world w;
    create(&w, (ep_obstacle_kind)kind);
    const int32_t all[3] = {0, w.b->model.size.contacts, 1};
    ep_model plain = w.b->model;
    plain.size.nodes = 1;
    plain.tree_range = all;
    const size_t bytes = (ep_state_bytes(&plain) + 63) / 64 * 64;
    void *block = aligned_alloc(64, bytes);
    ep_state *loop;
    assert_int_equal(ep_state_init(&plain, block, bytes, &loop), EP_OK);
    int touched = 0;
    for (int trial = 0; trial < 40; trial++) {
      // Poses up to 0.4, thin contact, paths that jump through the obstacle at times.
      w.def.contact.thickness = 0.004;
      bar_random_q(w.b, 0.01 * trial, w.q);
      bar_random_q(w.b, 0.2, w.q_start);
      ep_contact_begin(w.state, &w.def, 0, NULL, NULL, w.q_start, w.q);
      ep_contact_begin(loop, &w.def, 0, NULL, NULL, w.q_start, w.q);
      double g[2][R] = {{0}}, size = 0, apart = 0;
      ep_contact_report report;
      const double e = ep_contact_energy(w.state, &w.def, NULL, w.q, g[0], NULL, R);
      const double f = ep_contact_energy(loop, &w.def, NULL, w.q, g[1], NULL, R);
      ep_contact_measure(loop, &w.def, NULL, w.q, &report);
      touched += report.touching;
      for (int i = 0; i < R; i++) {
        size = fmax(size, fabs(g[1][i]));
        apart = fmax(apart, fabs(g[0][i] - g[1][i]));
      }
      assert_true(fabs(e - f) <= 1e-12 * f && apart <= 1e-12 * size); // order of one sum
    }
    assert_true(touched > 40);
    free(block);
    destroy(&w);
  }
}

// Force and torque on the object against the gradient by translation and rotation.
static void totals_are_the_gradient(void **unused) {
  (void)unused;
  for (int kind = 0; kind < 3; kind++) {
    world w;
    double g[N], zero[N] = {0}, size = 0;
    ep_contact_report report;
    create(&w, (ep_obstacle_kind)kind);
    begin(&w, 1);
    energy(&w, zero, 0, 1, g, NULL);
    ep_contact_measure(w.state, &w.def, &w.frame, w.q, &report);
    for (int i = 0; i < 6; i++) size = fmax(size, fabs(g[R + i]));
    assert_true(size > 0);
    for (int i = 0; i < 3; i++) {
      assert_true(fabs(report.force[i] + g[R + i]) < 1e-12 * size);
      assert_true(fabs(report.torque[i] + g[R + 3 + i]) < 1e-12 * size);
    }
    destroy(&w);
  }
}

// phi is C2 and convex: slope and curvature are its derivatives across every change of form.
static void penalty_is_smooth(void **unused) {
  (void)unused;
  const ep_contact_law law = {.thickness = 0.002, .depth = 0.0025};
  double before = 0;
  for (int i = 1; i < 400; i++) {
    const double p = i * 4e-5, step = 1e-7;
    double slope[3], bend[3], e[3];
    for (int j = 0; j < 3; j++)
      e[j] = ep_contact_penalty(&law, p + (j - 1) * step, &slope[j], &bend[j]);
    assert_true(fabs((e[2] - e[0]) / (2 * step) - slope[1]) < 1e-6 * slope[1] + 1e-12);
    assert_true(fabs((slope[2] - slope[0]) / (2 * step) - bend[1]) < 2e-4 * bend[1] + 1e-4);
    assert_true(bend[1] >= before - 1e-12);
    before = bend[1];
  }
  double slope, bend;
  assert_true(ep_contact_penalty(&law, 0, &slope, &bend) == 0 && slope == 0 && bend == 0);
}

static void steps_take_no_memory(void **unused) {
  (void)unused;
  world w;
  create(&w, EP_OBSTACLE_SPHERE);
  w.def.contact = (ep_contact_def){.damping = 0.001};
  w.def.damping_stiffness = 0.01;
  int touched = 0;
  ep_obstacle from = w.obstacle;
  for (int i = 0; i < 20; i++) {
    ep_step_report report;
    w.obstacle = from; // comes down on the bar's top from 0.1 above
    w.obstacle.start.c[1] = w.obstacle.end.c[1] = 0.5;
    w.obstacle.start.c[2] = 1.6 - 0.02 * i, w.obstacle.end.c[2] = 1.6 - 0.02 * (i + 1);
    const int count = allocations;
    assert_int_equal(ep_step(w.state, &w.def, &report), EP_OK);
    assert_int_equal(allocations, count);
    touched += report.contact.touching;
  }
  assert_true(touched > 0);
  destroy(&w);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(gradient_is_derivative),
      cmocka_unit_test(hessian_is_derivative_for_a_plane),
      cmocka_unit_test(hessian_is_positive),
      cmocka_unit_test(tree_finds_what_a_loop_finds),
      cmocka_unit_test(totals_are_the_gradient),
      cmocka_unit_test(penalty_is_smooth),
      cmocka_unit_test(steps_take_no_memory),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
