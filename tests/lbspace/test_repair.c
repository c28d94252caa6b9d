// Claims for the repair of poses, min |grad(u - u0)|^2 under det F >= target with low coefficients
// kept: a sound pose is left bit by bit; tets turned over by misplaced vertices get volume, the low
// coefficients stay (exactly when free), held vertices do not move, far away hardly anything moves;
// turning everything turns the result; flat tets are opened the right way round; steps are limited;
// what is hopeless is reported as it is.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"
#include "tests/lbspace/shapes.h"
#include "tests/petsc_session.h"

enum { M = 8, NX = 12, NY = 4 };

typedef struct bench {
  ep_mesh mesh;
  ep_lb lb;
  ep_csr mass;
  double *u, *given; // (n x 3)
} bench;

static bench bench_make(void) {
  bench b = {.mesh = shape_box(NX, NY, NY, 4, 1, 1)};
  ep_error err = {0};
  if (ep_lb_eigen(&b.mesh, M, NULL, &b.lb, &err) != EP_OK) fail_msg("%s", err.text);
  assert_int_equal(ep_lb_mass(&b.mesh, &b.mass, &err), EP_OK);
  b.u = malloc(6 * (size_t)b.mesh.nv * sizeof *b.u);
  b.given = b.u + 3 * b.mesh.nv;
  return b;
}

static void bench_free(bench *b) {
  ep_mesh_free(&b->mesh);
  ep_lb_free(&b->lb);
  ep_csr_free(&b->mass);
  free(b->u);
}

// Bend the bar by 1 rad about z; its end x = 0 stays as it is.
static void bend(bench *b) {
  for (int i = 0; i < b->mesh.nv; i++) {
    const double *x = b->mesh.x + 3 * i, radius = 4, y = x[1] - 0.5;
    b->given[3 * i] = (radius - y) * sin(x[0] / radius) - x[0];
    b->given[3 * i + 1] = radius - (radius - y) * cos(x[0] / radius) - y;
    b->given[3 * i + 2] = 0;
  }
}

static int nearest(const bench *b, double x, double y, double z) {
  int best = 0;
  double least = INFINITY;
  for (int i = 0; i < b->mesh.nv; i++) {
    const double *p = b->mesh.x + 3 * i;
    const double d = hypot(hypot(p[0] - x, p[1] - y), p[2] - z);
    if (d < least) best = i, least = d;
  }
  return best;
}

// Two vertices in the middle of the bar pushed right through their neighbours.
static void push_through(bench *b) {
  b->given[3 * nearest(b, 2, 0.5, 0.5)] += 0.5;
  b->given[3 * nearest(b, 2, 1, 1) + 2] -= 0.4;
}

static int inverted(const bench *b, const double *u, double *worst) {
  double *x = malloc(3 * (size_t)b->mesh.nv * sizeof *x);
  for (int i = 0; i < 3 * b->mesh.nv; i++) x[i] = b->mesh.x[i] + u[i];
  const int count = ep_mesh_inverted(&b->mesh, x, worst);
  free(x);
  return count;
}

static ep_repair_report repair_within(bench *b, int m, const unsigned char *held, int iterations) {
  ep_repair_options options = ep_default_repair_options();
  ep_repair_report report;
  ep_error err = {0};
  options.m = m;
  options.held = held;
  options.iterations = iterations;
  memcpy(b->u, b->given, 3 * (size_t)b->mesh.nv * sizeof *b->u);
  if (ep_lb_repair(&b->mesh, m ? &b->lb : NULL, &options, b->u, &report, &err) != EP_OK)
    fail_msg("%s", err.text);
  double worst;
  assert_int_equal(report.inverted_before, inverted(b, b->given, &worst));
  assert_true(fabs(report.worst_before - worst) < 1e-12);
  // the report counts what was found, whatever it is
  assert_int_equal(report.inverted_after, inverted(b, b->u, &worst));
  assert_true(fabs(report.worst_after - worst) < 1e-9);
  assert_true(report.iterations <= iterations);
  return report;
}

static ep_repair_report repair(bench *b, int m, const unsigned char *held) {
  return repair_within(b, m, held, ep_default_repair_options().iterations);
}

static void test_sound_poses_are_left(void **state) {
  (void)state;
  bench b = bench_make();
  bend(&b);
  const ep_repair_report report = repair(&b, M, NULL);
  assert_int_equal(report.crushed_before, 0);
  assert_int_equal(report.iterations, 0);
  assert_memory_equal(b.u, b.given, 3 * (size_t)b.mesh.nv * sizeof *b.u);
  bench_free(&b);
}

static void test_free_pose(void **state) {
  (void)state;
  bench b = bench_make();
  double before[3 * M], after[3 * M];
  bend(&b);
  push_through(&b);
  const ep_repair_report report = repair(&b, M, NULL);
  print_message("free: %d inverted, worst %.3f -> %.3f; moved %.5f, most %.4f of the diagonal; %d "
                "steps\n",
                report.inverted_before, report.worst_before, report.worst_after, report.moved,
                report.moved_most, report.iterations);
  assert_true(report.inverted_before >= 4);
  assert_int_equal(report.inverted_after, 0);
  assert_int_equal(report.crushed_after, 0);
  assert_true(report.worst_after >= 0.05);
  ep_lb_project(&b.lb, &b.mass, b.given, before);
  ep_lb_project(&b.lb, &b.mass, b.u, after);
  for (int i = 0; i < 3 * M; i++) assert_true(fabs(after[i] - before[i]) < 1e-9); // round-off
  assert_true(report.coefficient_shift < 1e-9);
  // Four cells and more away from the damage there is left what keeping the low coefficients moves
  // back: the damage was pushed by half the bar's width, so it has a share in them.
  const double most = report.moved_most * ep_mesh_diagonal(&b.mesh);
  double away = 0;
  for (int i = 0; i < 3 * b.mesh.nv; i++)
    if (fabs(b.mesh.x[i / 3 * 3] - 2) > 1.6) away = fmax(away, fabs(b.u[i] - b.given[i]));
  print_message("far away %.3f of the largest move\n", away / most);
  assert_true(away < 0.15 * most);
  bench_free(&b);
}

static void test_held_pose(void **state) {
  (void)state;
  bench b = bench_make();
  unsigned char *held = calloc((size_t)b.mesh.nv, 1);
  for (int i = 0; i < b.mesh.nv; i++) held[i] = b.mesh.x[3 * i] == 0;
  for (int m = 0; m <= M; m += M) {
    bend(&b);
    push_through(&b);
    // and one of the neighbours of the held end
    b.given[3 * nearest(&b, 4.0 / NX, 0.5, 0.5)] -= 0.5;
    const ep_repair_report report = repair(&b, m, held);
    print_message("held, m = %d: %d inverted, worst %.3f -> %.3f; moved %.5f, coefficients by "
                  "%.1e; %d steps\n",
                  m, report.inverted_before, report.worst_before, report.worst_after, report.moved,
                  report.coefficient_shift, report.iterations);
    assert_true(report.inverted_before >= 6);
    assert_int_equal(report.crushed_after, 0);
    for (int i = 0; i < b.mesh.nv; i++)
      for (int k = 0; k < 3 && held[i]; k++) assert_true(b.u[3 * i + k] == b.given[3 * i + k]);
    // springs of lambda / 0.01: a hundredth of what the repair would move them by itself
    if (m) assert_true(report.coefficient_shift < 1e-3);
  }
  free(held);
  bench_free(&b);
}

// The repair knows no directions: turning the pose by R (x + u -> R (x + u)) turns the result.
static void test_turned_pose(void **state) {
  (void)state;
  bench b = bench_make();
  const size_t n3 = 3 * (size_t)b.mesh.nv;
  double *plain = malloc(n3 * sizeof *plain), worst = 0;
  bend(&b);
  push_through(&b);
  repair(&b, 0, NULL);
  memcpy(plain, b.u, n3 * sizeof *plain);
  static const double r[9] = {0, -1, 0, 0, 0, -1, 1, 0, 0}; // proper, no axis kept
  for (int pass = 0; pass < 2; pass++) { // turn what was given; then what was found
    double *u = pass ? plain : b.given;
    for (int i = 0; i < b.mesh.nv; i++) {
      double y[3];
      for (int k = 0; k < 3; k++) y[k] = b.mesh.x[3 * i + k] + u[3 * i + k];
      for (int k = 0; k < 3; k++)
        u[3 * i + k] =
            r[3 * k] * y[0] + r[3 * k + 1] * y[1] + r[3 * k + 2] * y[2] - b.mesh.x[3 * i + k];
    }
  }
  repair(&b, 0, NULL);
  for (size_t i = 0; i < n3; i++) worst = fmax(worst, fabs(b.u[i] - plain[i]));
  assert_true(worst < 1e-6); // Gauss-Newton stops as soon as all is whole: the same steps, rounded
  free(plain);
  bench_free(&b);
}

// The whole bar turned inside out (mirrored along x): nothing to mend. Whatever comes back, the
// report tells it: tets still inverted, or a move as large as the pose itself.
static void test_hopeless_pose(void **state) {
  (void)state;
  bench b = bench_make();
  for (int i = 0; i < 3 * b.mesh.nv; i++) b.given[i] = i % 3 ? 0 : -2 * b.mesh.x[i];
  const ep_repair_report report = repair(&b, M, NULL);
  print_message("inside out: %d inverted left, moved by %.2f of the pose\n", report.inverted_after,
                report.moved_share);
  assert_int_equal(report.inverted_before, b.mesh.nt);
  assert_true(report.inverted_after > 0 || report.moved_share > 0.5);
  bench_free(&b);
}

// One tet with F = A diag(s) B^T, A and B random rotations. On a line (s2 = s3 = 0) the volume has
// no derivative to go by and the factors of the singular value decomposition any handedness: the
// tet must be opened the right way round, and alike whatever A and B are.
static void random_rotation(ep_random *rng, double r[9]) {
  double q[4], n = 0;
  for (int i = 0; i < 4; i++) {
    q[i] = ep_random_normal(rng);
    n += q[i] * q[i];
  }
  for (int i = 0; i < 4; i++) q[i] /= sqrt(n);
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                       2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                       2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  memcpy(r, m, sizeof m);
}

static void flatten(const ep_mesh *tet, const double s[3], ep_random *rng, double *u) {
  double a[9], b[9];
  random_rotation(rng, a);
  random_rotation(rng, b);
  for (int v = 0; v < 4; v++)
    for (int i = 0; i < 3; i++) {
      u[3 * v + i] = -tet->x[3 * v + i];
      for (int k = 0; k < 3; k++)
        for (int j = 0; j < 3; j++)
          u[3 * v + i] += a[3 * i + k] * s[k] * b[3 * j + k] * tet->x[3 * v + j];
    }
}

static void test_flat_tets_are_opened(void **state) {
  (void)state;
  enum { TRIES = 100 };
  static const double x[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1},
                      flat[3][3] = {{1, 0.8, 0}, {1, 0, 0}, {1, 1e-9, -1e-9}};
  static const int corner[4] = {0, 1, 2, 3};
  ep_mesh tet;
  ep_error err = {0};
  ep_random rng = ep_random_seed(5, 0);
  ep_repair_options options = ep_default_repair_options();
  options.m = 0;
  assert_int_equal(ep_mesh_make(4, x, 1, corner, "tet", &tet, NULL, &err), EP_OK);
  for (int kind = 0; kind < 3; kind++) {
    ep_repair_report first = {0}, report;
    for (int i = 0; i < TRIES; i++) {
      double u[12];
      flatten(&tet, flat[kind], &rng, u);
      if (ep_lb_repair(&tet, NULL, &options, u, &report, &err) != EP_OK) fail_msg("%s", err.text);
      if (i == 0) first = report;
      // an inverted tet would be turned round by further steps, to another shape; 1e-6: the
      // singular values of 1e-9 and what they leave to directions
      if (report.crushed_after || report.iterations != first.iterations ||
          !(fabs(report.worst_after - first.worst_after) < 1e-6))
        fail_msg("flat tet %d, try %d: volume %g after %d steps, where the first has %g after %d",
                 kind, i, report.worst_after, report.iterations, first.worst_after,
                 first.iterations);
    }
    print_message("flat tet %d: volume %.3f after %d steps\n", kind, first.worst_after,
                  first.iterations);
  }
  ep_mesh_free(&tet);
}

// A vertex in the middle drawn to a far point and its neighbours strewn about: more than a few
// steps mend.
static void crumple(bench *b) {
  ep_random rng = ep_random_seed(2, 0);
  for (int i = 0; i < b->mesh.nv; i++)
    for (int k = 0; k < 3; k++)
      b->given[3 * i + k] = 0.4 * ep_random_normal(&rng) * (fabs(b->mesh.x[3 * i] - 2) < 0.8);
}

// Steps are spent once, on descents and unfoldings together; none: nothing moves. More steps never
// leave more crushed tets than fewer did.
static void test_steps_are_limited(void **state) {
  (void)state;
  bench b = bench_make();
  int crushed = 0, spent = 0;
  crumple(&b);
  for (int most = 0; most <= 40; most += most < 20 ? 2 : 20) {
    const ep_repair_report report = repair_within(&b, 0, NULL, most);
    print_message("%d steps at most: %d of %d crushed tets left after %d\n", most,
                  report.crushed_after, report.crushed_before, report.iterations);
    if (most == 0) {
      assert_memory_equal(b.u, b.given, 3 * (size_t)b.mesh.nv * sizeof *b.u);
      crushed = report.crushed_before;
    }
    assert_true(report.crushed_after <= crushed);
    crushed = report.crushed_after;
    spent = report.iterations;
  }
  assert_true(spent > 10); // else nothing was limited
  bench_free(&b);
}

static void test_bad_options(void **state) {
  (void)state;
  bench b = bench_make();
  bend(&b);
  memcpy(b.u, b.given, 3 * (size_t)b.mesh.nv * sizeof *b.u);
  const ep_repair_options good = ep_default_repair_options();
  ep_repair_options bad[4] = {good, good, good, good};
  bad[0].m = M + 1;
  bad[1].m = -1;
  bad[2].target = bad[2].floor;
  bad[3].target = 1;
  for (int i = 0; i < 4; i++)
    assert_int_equal(ep_lb_repair(&b.mesh, &b.lb, &bad[i], b.u, NULL, NULL), EP_ERR_ARGUMENT);
  ep_repair_options none = good; // coefficients asked for without a space
  none.m = 1;
  assert_int_equal(ep_lb_repair(&b.mesh, NULL, &none, b.u, NULL, NULL), EP_ERR_ARGUMENT);
  ep_error err = {0};
  none.m = 0;
  b.u[3 * 7 + 1] = NAN;
  assert_int_equal(ep_lb_repair(&b.mesh, NULL, &none, b.u, NULL, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "vertex 7"));
  bench_free(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_sound_poses_are_left),
      cmocka_unit_test(test_free_pose),
      cmocka_unit_test(test_held_pose),
      cmocka_unit_test(test_turned_pose),
      cmocka_unit_test(test_hopeless_pose),
      cmocka_unit_test(test_flat_tets_are_opened),
      cmocka_unit_test(test_steps_are_limited),
      cmocka_unit_test(test_bad_options),
  };
  return cmocka_run_group_tests_name("pose repair", tests, session_start, session_stop);
}
