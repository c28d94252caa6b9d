// Maps with known truth against two baselines: nearest neighbours in space and ZoomOut (Melzi et
// al. 2019). Errors: mean distance of the mapped points to the truth over the bounding box's
// diagonal, in per cent; all three end with the same projection into tets. Not a test: it prints a
// table. bench_maps [word]: only pairs whose name contains the word; "composed": maps through a
// family's rest shape; "70K": time of a large pair.
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
#include "linalg/dense.h"
#include "linalg/petsc.h"
#include "tests/align/pairs.h"

enum { M = 20, FUNCTIONS = 40 };

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

// Six landmarks of each body, in its parameters: corners of the bar; the flyer's nose, wing tips,
// tail tips and fin; the beast's head, tail and feet.
enum { MARKS = 6 };
static const double BODY_MARKS[BODIES][MARKS][3] = {
    [BODY_BAR] = {{0, 0, 0}, {6, 2, 2}, {0, 2, 2}, {6, 0, 0}, {3, 2, 1}, {3, 1, 2}},
    [BODY_FLYER] =
        {{12, 3, 7}, {6.5, 2.5, 14}, {6.5, 2.5, 0}, {1, 2.5, 10}, {1, 2.5, 4}, {0, 6, 7}},
    [BODY_BEAST] = {{13, 6, 2}, {0, 4, 2}, {3, 0, 1}, {3, 0, 4}, {10, 0, 1}, {10, 0, 4}}};

static void match(const truth_pair *pair, int landmarks, const ep_landmark *mark, ep_map *map) {
  ep_map_options o = ep_default_map_options();
  ep_error err = {0};
  o.m = M;
  if (o.m > pair->from.lb.m) o.m = pair->from.lb.m;
  o.landmarks = landmarks;
  o.landmark = mark;
  if (ep_map_match(&pair->from.shape, &pair->to.shape, &o, NULL, map, &err) != EP_OK)
    fail_msg("%s", err.text);
}

static const char *const VERDICTS[3] = {"good", "doubtful", "bad"};

static void run(truth_pair *pair, body which) {
  const size_t n = (size_t)pair->from.mesh.nv;
  int *tet = malloc(n * sizeof *tet);
  double *weight = malloc(4 * n * sizeof *weight);
  assert_true(tet && weight);
  const double e_near = nearest(pair, tet, weight), e_zoom = zoomout(pair, tet, weight);
  ep_map map;
  const double start = ep_seconds();
  match(pair, 0, NULL, &map);
  const double seconds = ep_seconds() - start;
  printf("%-24s %5d %5d  %8.2f %8.2f %8.2f  %-8s %5.3f  %6.2f\n", pair->name, pair->from.mesh.nv,
         pair->to.mesh.nv, 100 * e_near, 100 * e_zoom, 100 * pair_error(pair, map.tet, map.weight),
         VERDICTS[map.quality.verdict], map.quality.cycle, seconds);
  ep_map_free(&map);
  {
    ep_landmark mark[6];
    for (int m = 0; m < 6; m++) mark[m] = pair_landmark_of(pair, BODY_MARKS[which][m]);
    match(pair, 6, mark, &map);
    printf("%-24s %5s %5s  %8s %8s %8.2f  %-8s %5.3f  %s\n", "  with six landmarks", "", "", "", "",
           100 * pair_error(pair, map.tet, map.weight), VERDICTS[map.quality.verdict],
           map.quality.cycle, map.quality.reasons);
    ep_map_free(&map);
  }
  free(tet);
  free(weight);
}

// Poses of one family, mapped through its rest shape and independently.
static void compose(const char *name, body which, placement object, placement rest,
                    placement pose) {
  truth_pair a, b, direct;
  ep_map first, second, composed, independent;
  ep_error err = {0};
  pair_of_bodies(name, which, 2, object, 3, rest, FUNCTIONS, &a);
  pair_of_bodies(name, which, 3, rest, 3, pose, FUNCTIONS, &b);
  pair_of_bodies(name, which, 2, object, 3, pose, FUNCTIONS, &direct);
  // The middle meshes must be one: both are `to` of a and `from` of b but for the jitter.
  shape_free(&b.from);
  b.from = a.to;
  b.from.shape = (ep_shape){&b.from.mesh, &b.from.lb, &b.from.mass};
  match(&a, 0, NULL, &first);
  match(&direct, 0, NULL, &independent);
  ep_map_options o = ep_default_map_options();
  o.m = M;
  o.same_family = true;
  if (ep_map_match(&b.from.shape, &b.to.shape, &o, NULL, &second, &err) != EP_OK)
    fail_msg("%s", err.text);
  if (ep_map_compose(&first, &b.from.mesh, &second, &b.to.mesh, &composed, &err) != EP_OK)
    fail_msg("%s", err.text);
  // Where composed and independent points lie, against the truth in the pose: `direct`'s truth.
  // The motion is what examples are used for: compare displacements too.
  const int n = direct.from.mesh.nv;
  double *pose_c = malloc(3 * (size_t)n * sizeof *pose_c), *rest_c = malloc(3 * (size_t)n * 8);
  double *pose_i = malloc(3 * (size_t)n * sizeof *pose_i), sum_c = 0, sum_i = 0;
  assert_true(pose_c && rest_c && pose_i);
  ep_map_pull(&composed, &b.to.mesh, 3, b.to.mesh.x, pose_c);
  ep_map_pull(&independent, &direct.to.mesh, 3, direct.to.mesh.x, pose_i);
  ep_map_pull(&first, &b.from.mesh, 3, b.from.mesh.x, rest_c);
  for (int i = 0; i < n; i++) {
    double c2 = 0, i2 = 0;
    for (int c = 0; c < 3; c++) {
      const double truth = direct.truth[3 * i + c] - a.truth[3 * i + c];
      c2 += pow(pose_c[3 * i + c] - rest_c[3 * i + c] - truth, 2);
      i2 += pow(pose_i[3 * i + c] - rest_c[3 * i + c] - truth, 2);
    }
    sum_c += sqrt(c2);
    sum_i += sqrt(i2);
  }
  const double unit = 100 / (n * ep_mesh_diagonal(&direct.to.mesh));
  printf("%-24s points: composed %.2f, independent %.2f; motion: composed %.2f, independent %.2f\n",
         name, 100 * pair_error(&direct, composed.tet, composed.weight),
         100 * pair_error(&direct, independent.tet, independent.weight), unit * sum_c,
         unit * sum_i);
  free(pose_c);
  free(pose_i);
  free(rest_c);
  ep_map *all[4] = {&first, &second, &composed, &independent};
  for (int i = 0; i < 4; i++) ep_map_free(all[i]);
  memset(&a.to, 0, sizeof a.to); // b owns it now
  pair_free(&a);
  pair_free(&b);
  pair_free(&direct);
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

// Seconds of a map between large meshes; their spaces are not counted.
static void large(void) {
  truth_pair pair;
  ep_map map;
  pair_of_bodies("70K", BODY_BEAST, 9, place_beast, 10, place_beast_walking, 20, &pair);
  const double start = ep_seconds();
  match(&pair, 0, NULL, &map);
  printf("%d -> %d vertices at m = %d: %.1f s, error %.2f per cent, %s\n", pair.from.mesh.nv,
         pair.to.mesh.nv, map.m, ep_seconds() - start, 100 * pair_error(&pair, map.tet, map.weight),
         VERDICTS[map.quality.verdict]);
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
  if (strcmp(word, "70K") == 0) {
    large();
    ep_petsc_stop();
    return 0;
  }
  printf("%-24s %5s %5s  %8s %8s %8s  %-8s %5s  %s\n", "pair (% of diagonal)", "from", "to",
         "nearest", "ZoomOut", "product", "verdict", "cycle", "seconds");
  for (size_t i = 0; i < sizeof RECIPES / sizeof *RECIPES; i++) {
    const recipe *r = &RECIPES[i];
    truth_pair pair;
    if (!strstr(r->name, word)) continue;
    pair_of_bodies(r->name, r->which, r->refine_from, r->from, r->refine_to, r->to, FUNCTIONS,
                   &pair);
    run(&pair, r->which);
    pair_free(&pair);
  }
  if (strstr("composed", word)) {
    compose("bird family", BODY_FLYER, place_plane, place_bird, place_bird_raised);
    compose("fish <- bird family", BODY_FLYER, place_fish, place_bird, place_bird_raised);
    compose("beast family", BODY_BEAST, place_beast_stretched, place_beast, place_beast_walking);
  }
  ep_petsc_stop();
  return 0;
}
