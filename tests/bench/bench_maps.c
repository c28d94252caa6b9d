// Maps with known truth against two baselines: nearest neighbours in space and ZoomOut (Melzi et
// al. 2019). Errors: mean distance of the mapped points to the truth over the bounding box's
// diagonal, in per cent; all three end with the same projection into tets. Not a test: it prints a
// table. bench_maps [word]: only pairs whose name contains the word; "composed": maps through a
// family's rest shape; "8K", "70K": time and memory of large pairs.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>

#include <cmocka.h>

#include "align/private.h"
#include "data_pairs.h"
#include "linalg/dense.h"
#include "linalg/petsc.h"
#include "map_families.h"
#include "tests/align/pairs.h"

// ZoomOut from the nearest neighbours' functional map of ZOOM_FIRST functions.
enum { ZOOM_FIRST = 4, ZOOM_LAST = 20 };

static double zoomout(const truth_pair *pair, int *tet, double *weight) {
  ep_side from, to;
  ep_error err = {0};
  const int k = ZOOM_LAST;
  ep_status status = ep_side_make(&pair->from.shape, k, &from, &err);
  if (status == EP_OK) status = ep_side_make(&pair->to.shape, k, &to, &err);
  if (status != EP_OK) fail_msg("%s", err.text);
  int *p = malloc((size_t)from.n * sizeof *p);
  double *c = malloc((size_t)k * k * sizeof *c), *q = malloc((size_t)from.n * k * sizeof *q);
  double *t = malloc((size_t)to.n * k * sizeof *t);
  assert_true(p && c && q && t);
  const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  status = ep_match_plain(&from, &to, identity, p, NULL, NULL, &err);
  for (int kk = ZOOM_FIRST; kk <= ZOOM_LAST && status == EP_OK; kk++) {
    status = ep_match_functional(&from, &to, p, c, &err);
    if (status != EP_OK) break;
    for (int i = 0; i < from.n; i++)
      memcpy(q + (size_t)i * kk, from.phi + (size_t)i * k, (size_t)kk * sizeof *q);
    for (int i = 0; i < to.n; i++)
      for (int a = 0; a < kk; a++) {
        double sum = 0;
        for (int b = 0; b < kk; b++) sum += c[a * k + b] * to.phi[(size_t)i * k + b];
        t[(size_t)i * kk + a] = sum;
      }
    ep_tree *tree;
    status = ep_tree_make(to.n, kk, t, &tree, &err);
    if (status != EP_OK) break;
    ep_tree_nearest(tree, from.n, q, p);
    ep_tree_free(tree);
  }
  if (status == EP_OK)
    status = ep_points_project(&pair->to.mesh, k, t, from.n, q, p, tet, weight, &err);
  if (status != EP_OK) fail_msg("%s", err.text);
  free(p);
  free(c);
  free(q);
  free(t);
  ep_side_free(&from);
  ep_side_free(&to);
  return pair_error(pair, tet, weight);
}

static double nearest(const truth_pair *pair, int *tet, double *weight) {
  ep_side from, to;
  ep_error err = {0};
  int *p = malloc((size_t)pair->from.mesh.nv * sizeof *p);
  assert_non_null(p);
  const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  ep_status status = ep_side_make(&pair->from.shape, 1, &from, &err);
  if (status == EP_OK) status = ep_side_make(&pair->to.shape, 1, &to, &err);
  if (status == EP_OK) status = ep_match_plain(&from, &to, identity, p, tet, weight, &err);
  if (status != EP_OK) fail_msg("%s", err.text);
  free(p);
  ep_side_free(&from);
  ep_side_free(&to);
  return pair_error(pair, tet, weight);
}

static void print_guided(const truth_pair *pair, const char *how, ep_map *map) {
  printf("%-24s %5s %5s  %8s %8s %8.2f  %-8s %5.3f  %s\n", how, "", "", "", "",
         100 * pair_error(pair, map->tet, map->weight), BENCH_VERDICTS[map->quality.verdict],
         map->quality.cycle, map->quality.reasons);
  ep_map_free(map);
}

// Boxes of the body as regions of both meshes.
static void match_regions(const truth_pair *pair, body which) {
  ep_regions regions;
  ep_map map;
  ep_error err = {0};
  ep_map_options o = ep_default_map_options();
  pair_regions(pair, which, &regions);
  o.m = BENCH_M;
  o.regions = &regions;
  if (ep_map_match(&pair->from.shape, &pair->to.shape, &o, NULL, &map, &err) != EP_OK)
    fail_msg("%s", err.text);
  print_guided(pair, "  with regions", &map);
  ep_regions_free(&regions);
}

static void run(truth_pair *pair) {
  const size_t n = (size_t)pair->from.mesh.nv;
  int *tet = malloc(n * sizeof *tet);
  double *weight = malloc(4 * n * sizeof *weight);
  assert_true(tet && weight);
  const double e_near = nearest(pair, tet, weight), e_zoom = zoomout(pair, tet, weight);
  ep_map map;
  const double start = ep_seconds();
  bench_match(pair, 0, NULL, &map);
  const double seconds = ep_seconds() - start;
  printf("%-24s %5d %5d  %8.2f %8.2f %8.2f  %-8s %5.3f  %6.2f\n", pair->name, pair->from.mesh.nv,
         pair->to.mesh.nv, 100 * e_near, 100 * e_zoom, 100 * pair_error(pair, map.tet, map.weight),
         BENCH_VERDICTS[map.quality.verdict], map.quality.cycle, seconds);
  ep_map_free(&map);
  free(tet);
  free(weight);
}

// Six landmarks, regions, and two landmarks on the example in a random rotation.
static void run_guided(truth_pair *pair, body which) {
  ep_landmark mark[BENCH_MARK_COUNT];
  ep_map map;
  for (int m = 0; m < BENCH_MARK_COUNT; m++)
    mark[m] = pair_landmark_of(pair, BENCH_MARKS[which][m]);
  bench_match(pair, BENCH_MARK_COUNT, mark, &map);
  print_guided(pair, "  with six landmarks", &map);
  if (which != BODY_BAR) match_regions(pair, which);
  pair_move(pair, (double[3]){0.3, -0.8, 0.52}, 137, 2.5, 1);
  for (int m = 0; m < 2; m++) mark[m] = pair_landmark_of(pair, BENCH_MARKS[which][m]);
  bench_match(pair, 2, mark, &map);
  print_guided(pair, "  turned, two landmarks", &map);
}

typedef struct recipe {
  const char *name;
  body which;
  int refine_from, refine_to;
  placement from, to;
} recipe;

static const recipe RECIPES[] = {
    {"bar, remeshed", BODY_BAR, 4, 5, place_bar, place_bar},
    {"flyer, remeshed", BODY_FLYER, 2, 3, place_plane, place_plane},
    {"beast, remeshed", BODY_BEAST, 3, 4, place_beast, place_beast},
    {"bar -> bend 90", BODY_BAR, 4, 5, place_bar, place_bar_bent},
    {"bar -> twist 90", BODY_BAR, 4, 5, place_bar, place_bar_twisted},
    {"bird -> wings raised 45", BODY_FLYER, 2, 3, place_bird, place_bird_raised},
    {"beast -> walking", BODY_BEAST, 3, 4, place_beast, place_beast_walking},
    {"bar -> rod", BODY_BAR, 4, 5, place_bar, place_rod},
    {"beast -> other build", BODY_BEAST, 3, 4, place_beast, place_beast_stretched},
    {"plane -> bird", BODY_FLYER, 2, 3, place_plane, place_bird},
    {"plane -> fish", BODY_FLYER, 2, 3, place_plane, place_fish},
};

static double processor_seconds(const struct rusage *r) {
  return (double)(r->ru_utime.tv_sec + r->ru_stime.tv_sec) +
         1e-6 * (double)(r->ru_utime.tv_usec + r->ru_stime.tv_usec);
}

// Seconds and memory of a map between large meshes; their spaces are not counted in the seconds.
static void large(const char *name, int refine_from, int refine_to) {
  truth_pair pair;
  ep_map map;
  struct rusage before, after;
  pair_of_bodies(name, BODY_BEAST, refine_from, place_beast, refine_to, place_beast_walking,
                 BENCH_FUNCTIONS, &pair);
  getrusage(RUSAGE_SELF, &before);
  const double start = ep_seconds();
  bench_match(&pair, 0, NULL, &map);
  const double seconds = ep_seconds() - start;
  getrusage(RUSAGE_SELF, &after);
  printf("%d -> %d vertices at m = %d: %.1f s (%.1f s of processors), error %.2f per cent, %s; "
         "peak memory %ld MB, %ld MB "
         "before the map\n",
         pair.from.mesh.nv, pair.to.mesh.nv, map.m, seconds,
         processor_seconds(&after) - processor_seconds(&before),
         100 * pair_error(&pair, map.tet, map.weight), BENCH_VERDICTS[map.quality.verdict],
         after.ru_maxrss / 1024, before.ru_maxrss / 1024);
  ep_map_free(&map);
  pair_free(&pair);
}

int main(int argc, char **argv) {
  ep_error err = {0};
  const char *word = argc > 1 ? argv[1] : "";
  if (ep_petsc_start(&err) != EP_OK) {
    fprintf(stderr, "%s\n", err.text);
    return 1;
  }
  if (strcmp(word, "70K") == 0 || strcmp(word, "8K") == 0) {
    if (word[0] == '7')
      large(word, 10, 10);
    else
      large(word, 5, 5);
    ep_petsc_stop();
    return 0;
  }
  printf("%-24s %5s %5s  %8s %8s %8s  %-8s %5s  %s\n", "pair (% of diagonal)", "from", "to",
         "nearest", "ZoomOut", "product", "verdict", "cycle", "seconds");
  for (size_t i = 0; i < sizeof RECIPES / sizeof *RECIPES; i++) {
    const recipe *r = &RECIPES[i];
    truth_pair pair;
    if (!strstr(r->name, word)) continue;
    pair_of_bodies(r->name, r->which, r->refine_from, r->from, r->refine_to, r->to, BENCH_FUNCTIONS,
                   &pair);
    run(&pair);
    run_guided(&pair, r->which);
    pair_free(&pair);
  }
  for (int i = 0; i < DATA_RECIPE_COUNT; i++) {
    truth_pair pair;
    if (!strstr(DATA_RECIPES[i].name, word) ||
        !pair_of_data(&DATA_RECIPES[i], BENCH_FUNCTIONS, &pair))
      continue;
    run(&pair);
    pair_free(&pair);
  }
  if (strstr("composed", word)) run_families();
  ep_petsc_stop();
  return 0;
}
