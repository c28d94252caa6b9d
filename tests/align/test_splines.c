// align/spline.c: the spline s_m of landmark m is 1 there and 0 at the others; landmarks that are
// where their partners are move nothing, W(x) = x; shifted partners are followed; fewer than four
// landmarks make no splines.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/private.h"
#include "shapes.h"
#include "tests/petsc_session.h"

enum { MARKS = 5, FUNCTIONS = 20, CELLS_X = 16, CELLS_Y = 4, CELLS_Z = 3 };

static int vertex_at(int i, int j, int k) {
  return i + (CELLS_X + 1) * (j + (CELLS_Y + 1) * k);
}

static void make_marked_side(int marks, test_shape *s, ep_side *side) {
  const int at[MARKS] = {vertex_at(0, 0, 0), vertex_at(CELLS_X, 0, 3), vertex_at(CELLS_X, 4, 0),
                         vertex_at(8, 4, 3), vertex_at(4, 0, 3)};
  ep_landmark mark[MARKS];
  double *u;
  ep_mesh mesh;
  ep_error err = {0};
  lattice((const int[3]){CELLS_X, CELLS_Y, CELLS_Z}, place_club, &mesh, &u);
  free(u);
  shape_from_mesh(s, &mesh, FUNCTIONS);
  for (int m = 0; m < MARKS; m++) mark[m] = (ep_landmark){.from_vertex = at[m], .to_vertex = at[m]};
  if (ep_side_make(&s->shape, FUNCTIONS, side, &err) != EP_OK ||
      ep_side_landmarks(side, marks, mark, true, &err) != EP_OK)
    fail_msg("%s", err.text);
}

static void splines_are_one_at_home_and_zero_elsewhere(void **state) {
  (void)state;
  test_shape s;
  ep_side side;
  make_marked_side(MARKS, &s, &side);
  assert_true(side.splines);
  double worst = 0;
  for (int m = 0; m < MARKS; m++)
    for (int k = 0; k < MARKS; k++)
      worst = fmax(worst, fabs(side.mark[side.mark_near[m] * MARKS + k] - (m == k)));
  printf("splines at their landmarks: off by at most %.1e\n", worst);
  // The softness is 1e-3 of the kernel's mean diagonal; its smallest eigenvalue here is above .05.
  assert_true(worst < 0.02);
  // Smooth: of no energy beyond that of the eigenfunctions they are made of.
  const double highest = s.lb.lambda[FUNCTIONS - 1] * side.length * side.length;
  double *kf = malloc((size_t)side.n * MARKS * sizeof *kf), energy = 0, square = 0;
  assert_non_null(kf);
  ep_csr_multiply(&side.stiffness, MARKS, side.mark, kf);
  for (int i = 0; i < side.n * MARKS; i++) energy += side.mark[i] * kf[i];
  ep_csr_multiply(side.shape->mass, MARKS, side.mark, kf);
  for (int i = 0; i < side.n * MARKS; i++) square += side.mark[i] * kf[i];
  assert_true(energy * side.length * side.length < highest * square);
  free(kf);
  ep_side_free(&side);
  shape_free(&s);
}

static void warps_follow_the_partners(void **state) {
  (void)state;
  test_shape s;
  ep_side side;
  ep_error err = {0};
  make_marked_side(MARKS, &s, &side);
  double *y = malloc(3 * (size_t)side.n * sizeof *y), partner[3 * MARKS];
  assert_non_null(y);
  if (ep_side_warp(&side, side.mark_x, y, &err) != EP_OK) fail_msg("%s", err.text);
  for (int i = 0; i < 3 * side.n; i++) assert_true(fabs(y[i] - side.x[i]) < 1e-12);
  // One landmark moves; the others stay.
  memcpy(partner, side.mark_x, sizeof partner);
  partner[3] += 0.3;
  if (ep_side_warp(&side, partner, y, &err) != EP_OK) fail_msg("%s", err.text);
  for (int i = 0; i < 3 * MARKS; i++)
    assert_true(fabs(y[3 * side.mark_near[i / 3] + i % 3] - partner[i]) < 0.02 * 0.3);
  free(y);
  ep_side_free(&side);
  shape_free(&s);
}

static void few_landmarks_make_bumps(void **state) {
  (void)state;
  test_shape s;
  ep_side side;
  make_marked_side(3, &s, &side);
  assert_false(side.splines);
  ep_side_free(&side);
  shape_free(&s);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(splines_are_one_at_home_and_zero_elsewhere),
      cmocka_unit_test(warps_follow_the_partners),
      cmocka_unit_test(few_landmarks_make_bumps),
  };
  return cmocka_run_group_tests_name("align/splines", tests, session_start, session_stop);
}
