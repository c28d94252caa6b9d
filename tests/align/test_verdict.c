// align/: the verdict tells right maps from wrong ones. On these pairs right landmarks and regions
// make good maps, also between shapes of very different build; exchanged and mirrored ones and one
// far off do not (docs/maps.md counts pairs on which some do), and two that were exchanged are
// named; a pose of a family turned by half a turn is found, one the user calls authored is doubted.
// It judges the map that is kept, and its reasons never contradict themselves. Wrong: mean distance
// to the truth above a tenth of the diagonal, or left and right exchanged. The study behind the
// thresholds: tests/bench/bench_verdict.c.
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
#include "pairs.h"
#include "tests/petsc_session.h"

enum { FUNCTIONS = 24, MARKS = 6 };
static const double WRONG = 0.1;

// Parameters of the flyer's nose, wing tips, tail tips and fin; of the beast's head, tail and feet.
static const double FLYER[MARKS][3] = {{12, 3, 7},   {6.5, 2.5, 14}, {6.5, 2.5, 0},
                                       {1, 2.5, 10}, {1, 2.5, 4},    {0, 6, 7}};
static const double BEAST[MARKS][3] = {{13, 6, 2}, {0, 4, 2},  {3, 0, 1},
                                       {3, 0, 4},  {10, 0, 1}, {10, 0, 4}};
// Whose partner each landmark gets.
static const int RIGHT[MARKS] = {0, 1, 2, 3, 4, 5}, SWAPPED[MARKS] = {1, 0, 2, 3, 4, 5},
                 FLYER_MIRROR[MARKS] = {0, 2, 1, 4, 3, 5}, BEAST_MIRROR[MARKS] = {0, 1, 3, 2, 5, 4};

static double match(const truth_pair *pair, const ep_map_options *o, const char *how, ep_map *map) {
  ep_error err = {0};
  if (ep_map_match(&pair->from.shape, &pair->to.shape, o, NULL, map, &err) != EP_OK)
    fail_msg("%s", err.text);
  const double error = pair_error(pair, map->tet, map->weight);
  printf("%s, %s: error %.3f, verdict %d, cycle %.3f, handed %.3f %s\n", pair->name, how, error,
         (int)map->quality.verdict, map->quality.cycle, map->quality.handed, map->quality.reasons);
  return error;
}

static double with_marks(const truth_pair *pair, const double at[MARKS][3], const int order[MARKS],
                         const char *how, ep_map *map) {
  ep_landmark mark[MARKS];
  ep_map_options o = ep_default_map_options();
  for (int m = 0; m < MARKS; m++) {
    mark[m] = pair_landmark_of(pair, at[m]);
    memcpy(mark[m].to, pair_landmark_of(pair, at[order[m]]).to, sizeof mark[m].to);
  }
  o.landmarks = MARKS;
  o.landmark = mark;
  return match(pair, &o, how, map);
}

static void right_marks_are_good(const truth_pair *pair, const double at[MARKS][3]) {
  ep_map map;
  assert_true(with_marks(pair, at, RIGHT, "right", &map) < WRONG);
  assert_int_equal(map.quality.verdict, EP_MAP_GOOD);
  assert_string_equal(map.quality.reasons, "");
  for (int m = 0; m < MARKS; m++) assert_int_equal(map.quality.landmark[m].best_match, m);
  ep_map_free(&map);
}

static void swapped_marks_are_named(const truth_pair *pair, const double at[MARKS][3]) {
  ep_map map;
  assert_true(with_marks(pair, at, SWAPPED, "two swapped", &map) > WRONG);
  assert_int_not_equal(map.quality.verdict, EP_MAP_GOOD);
  bool named = false;
  for (int m = 0; m < 2; m++) named = named || map.quality.landmark[m].best_match == 1 - m;
  assert_true(named);
  assert_non_null(strstr(map.quality.reasons, "belongs to the partner of landmark"));
  ep_map_free(&map);
}

static void mirrored_marks_are_doubted(const truth_pair *pair, const double at[MARKS][3],
                                       const int order[MARKS]) {
  ep_map map;
  with_marks(pair, at, order, "left and right exchanged", &map);
  assert_int_not_equal(map.quality.verdict, EP_MAP_GOOD);
  ep_map_free(&map);
}

// The first landmark's partner at another place of `to`, which is no landmark.
static void one_far_off_is_doubted(const truth_pair *pair, const double at[MARKS][3],
                                   const double elsewhere[3]) {
  ep_landmark mark[MARKS];
  ep_map_options o = ep_default_map_options();
  ep_map map;
  for (int m = 0; m < MARKS; m++) mark[m] = pair_landmark_of(pair, at[m]);
  memcpy(mark[0].to, pair_landmark_of(pair, elsewhere).to, sizeof mark[0].to);
  o.landmarks = MARKS;
  o.landmark = mark;
  match(pair, &o, "one far off", &map);
  assert_int_not_equal(map.quality.verdict, EP_MAP_GOOD);
  ep_map_free(&map);
}

// Handedness of plain nearest neighbours in the frame of a map.
static void judge_plain(const truth_pair *pair, const ep_map *map, double *handed) {
  enum { K = 12 };
  ep_side from, to;
  ep_point_map plain;
  ep_error err = {0};
  assert_int_equal(ep_side_make(&pair->from.shape, K, &from, &err), EP_OK);
  assert_int_equal(ep_side_make(&pair->to.shape, K, &to, &err), EP_OK);
  assert_int_equal(ep_point_map_make(from.n, &plain, &err), EP_OK);
  assert_int_equal(
      ep_match_plain(&from, &to, map->rotation, plain.p, plain.tet, plain.weight, &err), EP_OK);
  assert_int_equal(ep_map_handedness(&from, &to, map->rotation, &plain, handed, &err), EP_OK);
  ep_point_map_free(&plain);
  ep_side_free(&from);
  ep_side_free(&to);
}

// Where the round trip is long plain neighbours are refined too, and the lower energy is kept: the
// record tells of that one. (The other's share would be the same number to the bit.)
static void the_kept_map_is_judged(const truth_pair *pair, const ep_map *map) {
  double plain;
  assert_true(map->quality.energy_other >= map->quality.energy); // both were tried
  judge_plain(pair, map, &plain);
  print_message("nearest kept: %d; keeps left and right %.4f, nearest alone %.4f\n",
                map->quality.from_nearest, map->quality.handed, plain);
  if (map->quality.from_nearest)
    assert_true(fabs(map->quality.handed - plain) < 1e-12);
  else
    assert_true(fabs(map->quality.handed - plain) > 1e-12);
}

static void plane_and_fish(void **state) {
  (void)state;
  truth_pair pair;
  ep_map map;
  pair_of_bodies("plane -> fish", BODY_FLYER, 2, place_plane, 2, place_fish, FUNCTIONS, &pair);
  ep_map_options o = ep_default_map_options();
  match(&pair, &o, "automatic", &map);
  assert_int_equal(map.quality.verdict, EP_MAP_DOUBTFUL);
  the_kept_map_is_judged(&pair, &map);
  ep_map_free(&map);
  right_marks_are_good(&pair, FLYER);
  mirrored_marks_are_doubted(&pair, FLYER, FLYER_MIRROR);
  swapped_marks_are_named(&pair, FLYER);
  one_far_off_is_doubted(&pair, FLYER, (const double[3]){4, 2.5, 7}); // the nose: in the tail
  pair_free(&pair);
}

static void beasts(void **state) {
  (void)state;
  truth_pair pair;
  pair_of_bodies("beast -> walking", BODY_BEAST, 1, place_beast, 2, place_beast_walking, FUNCTIONS,
                 &pair);
  right_marks_are_good(&pair, BEAST);
  mirrored_marks_are_doubted(&pair, BEAST, BEAST_MIRROR);
  swapped_marks_are_named(&pair, BEAST);
  one_far_off_is_doubted(&pair, BEAST, (const double[3]){3, 4, 2}); // the head: in the hind body
  pair_free(&pair);
}

// A pose exported in another frame: half a turn about any axis.
static void turned_poses_are_found(void **state) {
  (void)state;
  truth_pair pair;
  pair_of_bodies("beast -> walking, family", BODY_BEAST, 1, place_beast, 2, place_beast_walking,
                 FUNCTIONS, &pair);
  int right = 0, doubted = 0;
  for (int axis = 0; axis < 3; axis++) {
    const double about[3] = {axis == 0, axis == 1, axis == 2};
    ep_map_options o = ep_default_map_options();
    ep_map map;
    o.same_family = true;
    pair_move(&pair, about, 180, 1, 0);
    const bool found = match(&pair, &o, "turned", &map) < 0.03;
    assert_int_equal(map.quality.verdict, EP_MAP_DOUBTFUL);
    assert_true(found ? map.quality.frame_angle > 120 : map.quality.against > 0);
    right += found;
    ep_map_free(&map);
    o.keep_frame = true;
    assert_true(match(&pair, &o, "turned, called authored", &map) > WRONG);
    if (map.quality.energy_other >= 0) the_kept_map_is_judged(&pair, &map);
    doubted += map.quality.verdict != EP_MAP_GOOD;
    ep_map_free(&map);
    pair_move(&pair, about, -180, 1, 0);
  }
  // This coarse, one of the three is too near to be overruled: what nobody gave is doubted always.
  assert_true(right >= 2 && doubted >= 2);
  pair_free(&pair);
}

// Boxes of the body as regions; left and right legs exchanged on one side.
static void exchanged_regions_are_named(void **state) {
  (void)state;
  truth_pair pair;
  ep_regions regions;
  ep_map map;
  pair_of_bodies("beast -> other build", BODY_BEAST, 1, place_beast, 2, place_beast_stretched,
                 FUNCTIONS, &pair);
  pair_regions(&pair, BODY_BEAST, &regions);
  ep_map_options o = ep_default_map_options();
  o.regions = &regions;
  assert_true(match(&pair, &o, "regions", &map) < WRONG);
  assert_int_equal(map.quality.verdict, EP_MAP_GOOD);
  ep_map_free(&map);
  // boxes 1 to 4 are the legs: left ones of `from` get right ones of `to`
  ep_regions crossed = regions;
  crossed.start = malloc((2 * (size_t)regions.count + 1) * sizeof *crossed.start);
  crossed.vertex = malloc((size_t)regions.start[2 * regions.count] * sizeof *crossed.vertex);
  assert_true(crossed.start && crossed.vertex);
  int used = 0;
  for (int g = 0; g < regions.count; g++)
    for (int s = 0; s < 2; s++) {
      const int other = s && g >= 1 && g <= 4 ? (g % 2 ? g + 1 : g - 1) : g;
      const int *start = regions.start + 2 * other + s;
      crossed.start[2 * g + s] = used;
      for (int i = start[0]; i < start[1]; i++) crossed.vertex[used++] = regions.vertex[i];
    }
  crossed.start[2 * regions.count] = used;
  o.regions = &crossed;
  match(&pair, &o, "legs exchanged", &map);
  assert_int_equal(map.quality.verdict, EP_MAP_DOUBTFUL);
  assert_non_null(strstr(map.quality.reasons, "seem exchanged"));
  assert_true(map.quality.exchanged >= 1 && map.quality.exchanged_with <= 4);
  ep_map_free(&map);
  ep_regions_free(&crossed);
  ep_regions_free(&regions);
  pair_free(&pair);
}

// The verdict on a record without a map.
static void judged(ep_map *map, double cycle, double coverage, double handed) {
  map->quality.cycle = cycle;
  map->quality.coverage = coverage;
  map->quality.handed = handed;
  map->quality.exchanged = map->quality.inverted_left = -1;
  ep_map_verdict(NULL, NULL, false, map);
}

static void reasons_do_not_contradict_themselves(void **state) {
  (void)state;
  ep_map map = {0};
  judged(&map, 0.3, 0.65, 0.72); // at the thresholds
  assert_string_equal(map.quality.reasons, "");
  judged(&map, 0.304, 0.64996, 0.5);
  assert_non_null(strstr(map.quality.reasons, "round trip 0.304 (at most 0.300 wanted)"));
  assert_non_null(strstr(map.quality.reasons, "covered share 0.64996 (at least 0.65000 wanted)"));
  assert_non_null(strstr(map.quality.reasons, "left and right 0.50 (at least 0.72 wanted)"));
  ep_region_quality region[4] = {
      {.jaccard = 0.9}, {.jaccard = 0.9}, {.suspect = true}, {.suspect = true}};
  map.quality.regions = 4;
  map.quality.region = region;
  judged(&map, 0.1, 1, 1);
  assert_int_equal(map.quality.verdict, EP_MAP_DOUBTFUL);
  assert_non_null(
      strstr(map.quality.reasons, "2 of 4 regions agree with the map (more than half wanted)"));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(plane_and_fish),
      cmocka_unit_test(beasts),
      cmocka_unit_test(turned_poses_are_found),
      cmocka_unit_test(exchanged_regions_are_named),
      cmocka_unit_test(reasons_do_not_contradict_themselves),
  };
  return cmocka_run_group_tests_name("align/verdict", tests, session_start, session_stop);
}
