// align/ on other people's meshes (skipped where the data folder is absent): region transfer of
// automatic maps and of maps with regions, composition through the family's rest example, the three
// mis-ordered regions of gorilla.ini, an identical mesh, and the time of the largest pair. Prints
// the table of figures. Jaccard: mean over the regions in right order, by volume.
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
#include "base/files.h"
#include "shapes.h"
#include "tests/petsc_session.h"

enum { SHAPES = 3, FUNCTIONS = 40 };

typedef struct data_set {
  test_shape s[SHAPES];
  ep_regions regions;
  const unsigned char *wrong; // (regions) mis-ordered in the file between object and examples
} data_set;

static bool load(data_set *d, const char *name, const char *object, const char *ini) {
  char folder[EP_PATH_MAX], path[EP_PATH_MAX];
  memset(d, 0, sizeof *d);
  if (!data_folder(name, folder, sizeof folder)) {
    printf("skipped: no folder %s\n", folder);
    return false;
  }
  const char *files[SHAPES] = {object, "ex0.veg", "ex1.veg"};
  const ep_mesh *meshes[SHAPES];
  for (int i = 0; i < SHAPES; i++) {
    shape_from_file(&d->s[i], folder, files[i], FUNCTIONS);
    meshes[i] = &d->s[i].mesh;
  }
  ep_error err = {0};
  if (ep_path_join(folder, ini, path, &err) != EP_OK ||
      ep_regions_read(path, SHAPES, meshes, &d->regions, &err) != EP_OK)
    fail_msg("%s", err.text);
  return true;
}

static void unload(data_set *d) {
  for (int i = 0; i < SHAPES; i++) shape_free(&d->s[i]);
  ep_regions_free(&d->regions);
}

static double jaccard(const data_set *d, int from, int to, const int *p) {
  ep_side a, b;
  ep_error err = {0};
  const int count = d->regions.count;
  double *overlap = malloc((size_t)count * count * sizeof *overlap), sum = 0;
  assert_non_null(overlap);
  if (ep_side_make(&d->s[from].shape, 1, &a, &err) != EP_OK ||
      ep_side_make(&d->s[to].shape, 1, &b, &err) != EP_OK ||
      ep_side_regions(&a, &d->regions, from, &err) != EP_OK ||
      ep_side_regions(&b, &d->regions, to, &err) != EP_OK ||
      ep_region_overlap(&a, &b, p, overlap, &err) != EP_OK)
    fail_msg("%s", err.text);
  int right = 0;
  for (int g = 0; g < count; g++) {
    if (from == 0 && d->wrong && d->wrong[g]) continue;
    sum += overlap[g * count + g];
    right++;
  }
  ep_side_free(&a);
  ep_side_free(&b);
  free(overlap);
  return sum / right;
}

typedef struct table {
  // object <- rest, rest <- pose, object <- pose; automatic, with regions. Left out: empty
  ep_map map[3][2];
  double jaccard[3][2], composed[2], seconds[3][2];
} table;

// identical: the object is the rest shape. Its own map by regions (the same; test_map has regions
// on one shape) and the direct automatic map to the pose claim nothing and are left out.
static void measure(const data_set *d, const char *name, int m, bool identical, table *t) {
  static const int pairs[3][2] = {{0, 1}, {1, 2}, {0, 2}};
  ep_error err = {0};
  memset(t, 0, sizeof *t);
  printf("%-9s m %2d  %-16s %-8s  Jaccard  cycle  covered  Dirichlet  turn  seconds  verdict\n",
         name, m, "map", "from");
  for (int i = 0; i < 3; i++)
    for (int regions = 0; regions < 2; regions++) {
      if (identical && ((i == 0 && regions) || (i == 2 && !regions))) continue;
      ep_map_options o = ep_default_map_options();
      o.m = m;
      o.same_family = i == 1;
      o.from_column = pairs[i][0];
      o.to_column = pairs[i][1];
      o.regions = regions ? &d->regions : NULL;
      o.keep_frame = !regions; // the authors' meshes all stand alike
      ep_map *map = &t->map[i][regions];
      const double start = ep_seconds();
      if (ep_map_match(&d->s[pairs[i][0]].shape, &d->s[pairs[i][1]].shape, &o, NULL, map, &err))
        fail_msg("%s", err.text);
      t->seconds[i][regions] = ep_seconds() - start;
      t->jaccard[i][regions] = jaccard(d, pairs[i][0], pairs[i][1], map->p);
      const char *names[3] = {"object <- rest", "rest <- pose", "object <- pose"};
      printf("%14s %-16s %-8s   %.3f   %.3f   %.3f     %.2f     %4.1f   %5.2f    %d %s\n", "",
             names[i], regions ? "regions" : "nothing", t->jaccard[i][regions], map->quality.cycle,
             map->quality.coverage, map->quality.dirichlet, map->quality.frame_angle,
             t->seconds[i][regions], (int)map->quality.verdict, map->quality.reasons);
    }
  for (int regions = 0; regions < 2; regions++) {
    ep_map composed;
    if (ep_map_compose(&t->map[0][identical ? 0 : regions], &d->s[1].mesh, &t->map[1][regions],
                       &d->s[2].mesh, &composed, &err) != EP_OK)
      fail_msg("%s", err.text);
    t->composed[regions] = jaccard(d, 0, 2, composed.p);
    printf("%14s %-16s %-8s   %.3f\n", "", "composed", regions ? "regions" : "nothing",
           t->composed[regions]);
    ep_map_free(&composed);
  }
}

static void show_residuals(const ep_map *map) {
  printf("coupling residual %.3f -> %.3f; per region:", map->quality.residual_before,
         map->quality.residual_after);
  for (int g = 0; g < map->quality.regions; g++)
    printf(" %.2f>%.2f%s", map->quality.region[g].residual_before,
           map->quality.region[g].residual_after, map->quality.region[g].suspect ? "!" : "");
  printf("\n");
}

static void free_table(table *t) {
  for (int i = 0; i < 6; i++) ep_map_free(&t->map[i / 2][i % 2]);
}

// Nothing tells a box-like car from itself turned round: said, not guessed.
static void frames_in_doubt_are_said(const data_set *d) {
  ep_map_options o = ep_default_map_options();
  ep_map map;
  ep_error err = {0};
  if (ep_map_match(&d->s[0].shape, &d->s[1].shape, &o, NULL, &map, &err) != EP_OK)
    fail_msg("%s", err.text);
  printf("%s\n", map.quality.reasons);
  assert_int_equal(map.quality.verdict, EP_MAP_DOUBTFUL);
  assert_true(map.quality.rivals > 0 && map.quality.candidates > map.quality.rivals);
  assert_true(map.quality.candidate[0].chosen); // the authored frame comes first
  assert_non_null(strstr(map.quality.reasons, "'authored'"));
  assert_true(map.quality.settle_from >= 0 && map.quality.settle_from < map.n);
  ep_map_free(&map);
}

static void car_maps_itself(void **state) {
  (void)state;
  data_set d;
  if (!load(&d, "car", "car.veg", "car.ini")) skip();
  table t;
  measure(&d, "car", 10, false, &t);
  show_residuals(&t.map[0][1]);
  // Thresholds stand a few hundredths below the first measurement.
  // Automatic object <- rest, now .925, was a little better before maps were refined elastically;
  // the five others gained, those with regions the most (.95 to .98).
  assert_true(t.jaccard[0][0] > 0.9 && t.jaccard[0][1] > 0.96);
  assert_true(t.jaccard[1][0] > 0.89 && t.jaccard[1][1] > 0.96);
  assert_true(t.composed[0] > t.jaccard[2][0]); // composed better than independent
  for (int i = 0; i < 6; i++) assert_int_equal(t.map[i / 2][i % 2].quality.verdict, EP_MAP_GOOD);
  const ep_map_quality *q = &t.map[0][1].quality;
  assert_true(q->residual_after < 0.1 && q->residual_after < 0.25 * q->residual_before);
  for (int g = 0; g < q->regions; g++) assert_false(q->region[g].suspect);
  frames_in_doubt_are_said(&d);
  free_table(&t);
  unload(&d);
}

static void gorillas_swapped_regions_are_named(void **state) {
  (void)state;
  static const unsigned char wrong[16] = {[12] = 1, [13] = 1, [14] = 1};
  data_set d;
  if (!load(&d, "gorilla", "gorilla.veg", "gorilla.ini")) skip();
  d.wrong = wrong;
  table t;
  measure(&d, "gorilla", 10, false, &t);
  show_residuals(&t.map[0][1]);
  // Example regions 12, 13, 14 match object regions 14, 12, 13.
  for (int i = 0; i < 3; i += 2) {
    const ep_region_quality *r = t.map[i][1].quality.region;
    for (int g = 0; g < 16; g++) assert_int_equal(r[g].suspect, wrong[g]);
    assert_int_equal(r[14].best_match, 12);
    assert_int_equal(r[12].best_match, 13);
    assert_int_equal(r[13].best_match, 14);
  }
  // Between the two examples all regions are in order.
  for (int g = 0; g < 16; g++) assert_false(t.map[1][1].quality.region[g].suspect);
  assert_true(t.jaccard[0][0] > 0.75 && t.jaccard[0][1] > 0.88);
  assert_true(t.jaccard[1][0] > 0.72 && t.jaccard[1][1] > 0.82);
  // Regions are coarse: that composed maps beat independent ones shows where the truth is known.
  assert_true(t.composed[0] > t.jaccard[2][0] - 0.01);
  assert_int_equal(t.map[0][0].quality.verdict, EP_MAP_GOOD);
  assert_int_equal(t.map[0][1].quality.verdict, EP_MAP_GOOD);
  free_table(&t);
  unload(&d);
}

static void letter_is_itself_and_bends(void **state) {
  (void)state;
  data_set d;
  if (!load(&d, "letter-c", "C.veg", "C.ini")) skip();
  table t;
  measure(&d, "letter-c", 20, true, &t);
  show_residuals(&t.map[2][1]);
  for (int i = 0; i < d.s[0].mesh.nv; i++) {
    assert_int_equal(t.map[0][0].p[i], i);
  }
  assert_true(t.jaccard[1][0] > 0.7 && t.jaccard[1][1] > 0.92);
  assert_true(t.composed[1] > t.jaccard[2][1] - 0.01);
  free_table(&t);
  unload(&d);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(car_maps_itself),
      cmocka_unit_test(gorillas_swapped_regions_are_named),
      cmocka_unit_test(letter_is_itself_and_bends),
  };
  return cmocka_run_group_tests_name("align/data", tests, session_start, session_stop);
}
