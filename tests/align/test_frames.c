// align/: frames. An example given in 20 random rotations and scales (1e-3 .. 1e3): with one to
// three landmarks the map is always right; without, it is right or called doubtful: never silently
// mirrored. Right: mean distance to the truth below a fifteenth of the diagonal (a flip costs a
// quarter and more). Landmarks are vertices, or points in space.
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
#include "base/random.h"
#include "pairs.h"
#include "tests/petsc_session.h"

// EP_TURNS in the environment: how many (the claim was measured with 20; the default keeps CI
// short)
enum { TURNS = 2, FUNCTIONS = 20, MARKS = 3 };
static const double RIGHT = 1.0 / 15;

typedef struct tally {
  int right, good, wrong_and_good;
  double worst, mean; // error of the right ones
} tally;

static void turn_randomly(truth_pair *pair, ep_random *rng) {
  double axis[3], scale = pow(10, 6 * ep_random_uniform(rng) - 3);
  for (int c = 0; c < 3; c++) axis[c] = ep_random_normal(rng);
  pair_move(pair, axis, 30 + 300 * ep_random_uniform(rng), scale, 2 * scale);
}

static void match(const truth_pair *pair, int landmarks, const ep_landmark *mark, tally *t) {
  ep_map_options o = ep_default_map_options();
  ep_map map;
  ep_error err = {0};
  o.landmarks = landmarks;
  o.landmark = mark;
  if (ep_map_match(&pair->from.shape, &pair->to.shape, &o, NULL, &map, &err) != EP_OK)
    fail_msg("%s", err.text);
  const double error = pair_error(pair, map.tet, map.weight);
  const bool right = error < RIGHT, good = map.quality.verdict == EP_MAP_GOOD;
  if (landmarks && !right)
    for (int i = 0; i < map.quality.candidates; i++) {
      const ep_frame_candidate *f = &map.quality.candidate[i];
      printf("   %s%s%s: score %.3f, cycle %.3f, distance %.3f, landmark %.3f\n", f->name,
             f->chosen ? " (chosen)" : "", f->rival ? " (rival)" : "", f->score, f->cycle,
             f->distance, f->landmark);
    }
  // On another mesh a landmark's image is never exactly its partner, but near it in a right map.
  if (landmarks && right)
    assert_true(map.quality.landmark_residual > 0 && map.quality.landmark_residual < 0.2);
  t->right += right;
  t->good += good;
  t->wrong_and_good += good && !right;
  t->mean += right ? error : 0;
  t->worst = fmax(t->worst, right ? error : 0);
  ep_map_free(&map);
}

// landmarks: positions on `from`.
static void check(const char *name, body which, int refine, placement from, placement to,
                  const double landmark[MARKS][3]) {
  truth_pair pair;
  ep_random rng = ep_random_seed(7, 77);
  tally t[MARKS + 1] = {0};
  pair_of_bodies(name, which, refine, from, refine + 1, to, FUNCTIONS, &pair);
  const int turns = getenv("EP_TURNS") ? atoi(getenv("EP_TURNS")) : TURNS;
  for (int turn = 0; turn < turns; turn++) {
    ep_landmark mark[MARKS];
    turn_randomly(&pair, &rng);
    for (int m = 0; m < MARKS; m++) mark[m] = pair_landmark(&pair, landmark[m]);
    for (int count = 0; count <= MARKS; count++) match(&pair, count, mark, &t[count]);
  }
  for (int count = 0; count <= MARKS; count++)
    printf("%-20s %d landmarks: right %2d of %d, called good %2d, wrong and called good %d; error "
           "mean %.4f, worst %.4f\n",
           name, count, t[count].right, turns, t[count].good, t[count].wrong_and_good,
           t[count].mean / fmax(t[count].right, 1), t[count].worst);
  pair_free(&pair);
  for (int count = 0; count <= MARKS; count++) {
    assert_int_equal(t[count].wrong_and_good, 0);
    if (count) assert_int_equal(t[count].right, turns);
  }
}

static void beasts(void **state) {
  (void)state;
  const double marks[MARKS][3] = {{1.3, 0.65, 0}, {0.35, 0, -0.14}, {1.05, 0, 0.14}};
  check("beast, walking", BODY_BEAST, 1, place_beast, place_beast_walking, marks);
}

static void flyers(void **state) {
  (void)state;
  const double marks[MARKS][3] = {{0.1, 0, 1.0}, {0.85, 0, 0}, {0.1, 0, -1.0}};
  check("plane, bird", BODY_FLYER, 1, place_plane, place_bird, marks);
}

// Corners: one of them tells all four half turns apart.
static void bars(void **state) {
  (void)state;
  const double marks[MARKS][3] = {{0.5, 0.155, 0.14}, {-0.5, 0.155, -0.14}, {-0.5, -0.155, 0.14}};
  check("bar, bent", BODY_BAR, 2, place_bar, place_bar_bent, marks);
  check("bar, twisted", BODY_BAR, 2, place_bar, place_bar_twisted, marks);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(beasts),
      cmocka_unit_test(flyers),
      cmocka_unit_test(bars),
  };
  return cmocka_run_group_tests_name("align/frames", tests, session_start, session_stop);
}
