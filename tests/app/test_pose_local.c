// Claims: a pose limited to a region is the pose where the region's weight is 1, rest on parts with
// fixed vertices, and a rigid motion of rest on every other part beyond; a rigid motion of the
// whole pose changes nothing; the soft edge blends by the weight.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
// clang-format off
#include <cmocka.h>
// clang-format on
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/bake/pose_local.h"
#include "box.h"
#include "mesh/io.h"

enum { NV = 21 * 3 * 3 };
static ep_shape_file shape;
static int fixed[9];

// A bar 2 long, cells of .1, held at x = 0.
static int set_up(void **state) {
  (void)state;
  ep_error err = {0};
  ep_mesh_findings findings;
  ep_log log = {.quiet = true};
  int n = 0;
  write_box("local-bar.veg", 20, 2, 2, 2, 0, 0);
  if (ep_mesh_read("local-bar.veg", &shape.mesh, &findings, &log, &err) != EP_OK) return 1;
  if (shape.mesh.nv != NV) return 1;
  for (int v = 0; v < NV; v++)
    if (shape.mesh.x[3 * v] < 1e-9) fixed[n++] = v;
  return n != 9;
}

static int tear_down(void **state) {
  (void)state;
  ep_mesh_free(&shape.mesh);
  return 0;
}

// The region .6 <= x <= 1.2, weight 1 inside, falling to 0 over `soft` on both sides.
static void region_weights(double soft, double *w) {
  for (int v = 0; v < NV; v++) {
    const double x = shape.mesh.x[3 * v], away = fmax(0, fmax(0.6 - x, x - 1.2));
    w[v] = away < 1e-9 ? 1 : soft > 0 ? fmax(0, 1 - away / soft) : 0;
  }
}

// Bends between x = .7 and 1.1, straight on both sides, turned and shifted as a whole by `turn`.
static void bent(double turn, double *u) {
  for (int v = 0; v < NV; v++) {
    const double *x = shape.mesh.x + 3 * v, radius = 0.8;
    const double s = fmin(0.4, fmax(0, x[0] - 0.7)), a = s / radius, past = fmax(0, x[0] - 1.1);
    const double before = fmin(x[0], 0.7), y = x[1] - 0.1;
    const double p[3] = {before + radius * sin(a) - y * sin(a) + past * cos(a),
                         0.1 + radius * (1 - cos(a)) + y * cos(a) + past * sin(a), x[2]};
    const double c = cos(turn), d = sin(turn);
    const double q[3] = {c * p[0] - d * p[1] + turn, d * p[0] + c * p[1], p[2] - 2 * turn};
    for (int i = 0; i < 3; i++) u[3 * v + i] = q[i] - x[i];
  }
}

static ep_shapes shapes_of(int held) {
  return (ep_shapes){.count = 1, .shape = &shape, .nfixed = held ? 9 : 0, .fixed = fixed};
}

static void limit(const ep_shapes *shapes, const double *w, double *u, double *shift) {
  ep_pose_limits limits;
  ep_error err = {0};
  if (ep_pose_limits_make(shapes, w, &limits, &err) != EP_OK) fail_msg("%s", err.text);
  assert_int_equal(limits.parts, 2);
  assert_int_equal(limits.stays[0] + limits.stays[1], 1);
  for (int v = 0; v < NV; v++) {
    const double x = shape.mesh.x[3 * v];
    if (shapes->nfixed) assert_int_equal(limits.held[v], w[v] == 0 && x < 0.6);
  }
  if (ep_pose_limit(&limits, u, shift, &err) != EP_OK) fail_msg("%s", err.text);
  ep_pose_limits_free(&limits);
}

// The pose bends inside the region alone, and its left end is at rest: limiting gives it back,
// however it was turned.
static void a_pose_of_the_region_is_kept(void **state) {
  (void)state;
  const ep_shapes shapes = shapes_of(1);
  for (int i = 0; i < 4; i++) {
    double w[NV], u[3 * NV], wanted[3 * NV], shift;
    region_weights(i % 2 ? 0.25 : 0, w);
    bent(0, wanted);
    bent(i < 2 ? 0 : 0.7, u);
    limit(&shapes, w, u, &shift);
    assert_true(shift < 1e-9);
    for (int k = 0; k < 3 * NV; k++) assert_true(fabs(u[k] - wanted[k]) < 1e-9);
  }
}

// A pose that moves everything: only the region follows it.
static void outside_is_at_rest_or_rigid(void **state) {
  (void)state;
  const ep_shapes shapes = shapes_of(1);
  double w[NV], u[3 * NV], shift, moved = 0, worst = 0;
  region_weights(0, w);
  for (int v = 0; v < NV; v++) { // a sheared wave along the whole bar
    const double x = shape.mesh.x[3 * v];
    u[3 * v] = 0;
    u[3 * v + 1] = 0.1 * (1 - cos(4 * x));
    u[3 * v + 2] = 0;
  }
  limit(&shapes, w, u, &shift);
  assert_true(shift > 0);
  for (int v = 0; v < NV; v++)
    for (int i = 0; i < 3; i++) {
      const double x = shape.mesh.x[3 * v];
      if (x < 0.55) assert_true(u[3 * v + i] == 0);
      if (x > 1.25) moved = fmax(moved, fabs(u[3 * v + i]));
    }
  assert_true(moved > 0.01);
  for (int a = 0; a < NV; a++) // distances beyond the region are those at rest
    for (int b = 0; b < a; b++) {
      const double *x = shape.mesh.x;
      if (x[3 * a] < 1.25 || x[3 * b] < 1.25) continue;
      double rest = 0, now = 0;
      for (int i = 0; i < 3; i++) {
        const double d = x[3 * a + i] - x[3 * b + i], e = d + u[3 * a + i] - u[3 * b + i];
        rest += d * d, now += e * e;
      }
      worst = fmax(worst, fabs(sqrt(rest) - sqrt(now)));
    }
  assert_true(worst < 1e-12);
}

// Where nothing is fixed, the larger part (x > 1.2) stays.
static void without_fixed_vertices_the_largest_part_stays(void **state) {
  (void)state;
  const ep_shapes shapes = shapes_of(0);
  double w[NV], u[3 * NV], shift;
  region_weights(0, w);
  bent(0.3, u);
  limit(&shapes, w, u, &shift);
  assert_true(shift < 1e-9);
  double other = 0;
  for (int v = 0; v < NV; v++)
    for (int i = 0; i < 3; i++) {
      if (shape.mesh.x[3 * v] > 1.25) assert_true(u[3 * v + i] == 0);
      if (shape.mesh.x[3 * v] < 0.55) other = fmax(other, fabs(u[3 * v + i]));
    }
  assert_true(other > 0.05);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_pose_of_the_region_is_kept),
      cmocka_unit_test(outside_is_at_rest_or_rigid),
      cmocka_unit_test(without_fixed_vertices_the_largest_part_stays),
  };
  return cmocka_run_group_tests(tests, set_up, tear_down);
}
