// Does the verdict of a map tell right from wrong? Pairs of known truth (bodies of boxes; meshes of
// data/) are mapped with nothing given, with sensible landmarks and regions, and with wrong ones:
// partners swapped, all in a wrong order, left and right exchanged, one far off; examples turned.
// Not a test: it prints every map with its error, what the record measured and the verdict, and at
// the end how often right and wrong maps were called good, doubtful and bad. bench_verdict [word]:
// only pairs whose name contains the word.
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
#include "data_pairs.h"
#include "linalg/petsc.h"
#include "map_families.h"
#include "tests/align/pairs.h"

// A map is wrong above this mean error over the diagonal; one told to exchange left and right from
// MIRRORED on: in thin shapes that moves points by little.
static const double WRONG = 0.1, MIRRORED = 0.03;
enum { M = 10, FUNCTIONS = 32, MARKS_MOST = 8, SEEDS = 7 };

typedef struct study {
  const truth_pair *pair;
  bool family;
  int *mirror; // (from's vertices) the vertex on the other side of z = 0
  int *home;   // (to's vertices) the vertex of `from` whose truth is nearest
} study;

// good, doubtful, bad of right maps, wrong ones, and wrong ones of shapes turned to nearly their
// own image, in a frame somebody vouched for: nothing in the shapes tells those
static int counts[3][3];

static int nearest_point(int n, const double *x, const double q[3]) {
  int best = 0;
  double least = HUGE_VAL;
  for (int i = 0; i < n; i++) {
    double d2 = 0;
    for (int c = 0; c < 3; c++) d2 += pow(x[3 * i + c] - q[c], 2);
    if (d2 >= least) continue;
    least = d2;
    best = i;
  }
  return best;
}

static void make_study(const truth_pair *pair, bool family, study *s) {
  const ep_mesh *from = &pair->from.mesh, *to = &pair->to.mesh;
  *s = (study){.pair = pair, .family = family};
  s->mirror = malloc((size_t)from->nv * sizeof *s->mirror);
  s->home = malloc((size_t)to->nv * sizeof *s->home);
  assert_true(s->mirror && s->home);
  for (int i = 0; i < from->nv; i++) {
    const double *x = from->x + 3 * i, there[3] = {x[0], x[1], -x[2]};
    s->mirror[i] = nearest_point(from->nv, from->x, there);
  }
  for (int i = 0; i < to->nv; i++) s->home[i] = nearest_point(from->nv, pair->truth, to->x + 3 * i);
}

// Farthest points of `from`, the first farthest from the middle (or the last vertex of all).
static void spread_points(const ep_mesh *mesh, int count, bool other, int *out) {
  double *away = malloc((size_t)mesh->nv * sizeof *away), centre[3];
  assert_non_null(away);
  ep_mesh_centroid(mesh, mesh->x, centre);
  for (int i = 0; i < mesh->nv; i++) away[i] = 0;
  for (int i = 0; i < mesh->nv && !other; i++)
    for (int c = 0; c < 3; c++) away[i] += pow(mesh->x[3 * i + c] - centre[c], 2);
  if (other) away[mesh->nv / 3] = 1;
  for (int m = 0; m < count; m++) {
    int next = 0;
    for (int i = 1; i < mesh->nv; i++)
      if (away[i] > away[next]) next = i;
    out[m] = next;
    for (int i = 0; i < mesh->nv; i++) {
      double d2 = 0;
      for (int c = 0; c < 3; c++) d2 += pow(mesh->x[3 * i + c] - mesh->x[3 * next + c], 2);
      away[i] = m ? fmin(away[i], d2) : d2;
    }
  }
  free(away);
}

// Whether a map is wrong: far from the truth, or left and right exchanged in a shape nearly
// symmetric.
static bool is_wrong(const char *how, double error) {
  return error > WRONG || (strstr(how, "mirrored") && error > MIRRORED);
}

static void print_map(const char *name, const char *how, double error, const ep_map_quality *q) {
  double jaccard = 0, best = HUGE_VAL, alone = 0;
  int kept = 0;
  for (int g = 0; g < q->regions; g++) {
    if (q->region[g].suspect) continue;
    jaccard += q->region[g].jaccard;
    kept++;
  }
  for (int i = 0; i < q->candidates; i++) {
    const ep_frame_candidate *f = &q->candidate[i];
    if (!f->alone) continue;
    if (alone == 0) alone = f->score;
    best = fmin(best, f->score);
  }
  const bool wrong = is_wrong(how, error);
  double held = 0;
  int misplaced = 0;
  for (int m = 0; q->landmark && m < q->landmarks; m++) {
    held = fmax(held, q->landmark[m].held_out);
    misplaced += q->landmark[m].best_match != m;
  }
  const bool own_image = strstr(how, "turned") && alone > 0 && alone < EP_FRAME_CLEARLY * best;
  counts[wrong ? 1 + own_image : 0][q->verdict]++;
  printf("%-24s %-30s %6.2f %-5s %-8s %.3f %.3f  %.3f  %5.2f %2d %2d  %.3f %.2f %d  %d/%d %.2f "
         "%.2f  %s\n",
         name, how, 100 * error,
         !wrong      ? "right"
         : own_image ? "image"
                     : "wrong",
         BENCH_VERDICTS[q->verdict], q->cycle, q->coverage, q->handed, alone > 0 ? alone / best : 0,
         q->against, q->rivals, q->landmark_residual, held, misplaced, kept, q->regions,
         kept ? jaccard / kept : 0, q->held_out, q->reasons);
  fflush(stdout);
}

static void show(const study *s, const char *how, const ep_map_options *o) {
  ep_map map;
  ep_error err = {0};
  if (ep_map_match(&s->pair->from.shape, &s->pair->to.shape, o, NULL, &map, &err) != EP_OK)
    fail_msg("%s", err.text);
  print_map(s->pair->name, how, pair_error(s->pair, map.tet, map.weight), &map.quality);
  ep_map_free(&map);
}

static ep_map_options wishes(const study *s) {
  ep_map_options o = ep_default_map_options();
  o.m = M;
  o.same_family = s->family;
  return o;
}

// ---- landmarks ---------------------------------------------------------------------------------

// Landmarks at vertices v; the partner of the i-th is the truth of the order[i]-th (its mirror
// image).
static void with_landmarks(const study *s, const char *how, int count, const int *v,
                           const int *order, bool mirrored, double noise) {
  ep_landmark mark[MARKS_MOST];
  ep_map_options o = wishes(s);
  ep_random rng = ep_random_seed(5, 5);
  const double size = ep_mesh_diagonal(&s->pair->to.mesh);
  for (int i = 0; i < count; i++) {
    const int partner = order ? v[order[i]] : v[i];
    mark[i] = (ep_landmark){.from_vertex = v[i], .to_vertex = -1};
    double x[3];
    for (int c = 0; c < 3; c++)
      x[c] = s->pair->truth[3 * (mirrored ? s->mirror[partner] : partner) + c] +
             noise * size * ep_random_normal(&rng);
    mark[i].to_vertex = nearest_point(s->pair->to.mesh.nv, s->pair->to.mesh.x, x);
    memcpy(mark[i].to, s->pair->to.mesh.x + 3 * mark[i].to_vertex, sizeof mark[i].to);
  }
  o.landmarks = count;
  o.landmark = mark;
  show(s, how, &o);
}

static void try_landmarks(const study *s, int count, const int *v) {
  static const int swapped[MARKS_MOST] = {1, 0, 2, 3, 4, 5, 6, 7};
  static const int round[MARKS_MOST] = {1, 2, 3, 4, 5, 0, 6, 7};
  static const int far_off[MARKS_MOST] = {1, 1, 2, 3, 4, 5, 6, 7};
  with_landmarks(s, "landmarks 6", count, v, NULL, false, 0);
  with_landmarks(s, "landmarks 6 imprecise", count, v, NULL, false, 0.02);
  with_landmarks(s, "WRONG 6 two swapped", count, v, swapped, false, 0);
  with_landmarks(s, "WRONG 6 in a round", count, v, round, false, 0);
  with_landmarks(s, "WRONG 6 mirrored", count, v, NULL, true, 0);
  with_landmarks(s, "WRONG 6 one far off", count, v, far_off, false, 0);
}

// ---- regions -----------------------------------------------------------------------------------

// Cells around `count` spread points; partner[g]: whose cell the user gives for g on `to`.
static void with_regions(const study *s, const char *how, int count, const int *partner,
                         bool mirrored) {
  const ep_mesh *from = &s->pair->from.mesh, *to = &s->pair->to.mesh;
  int seed[MARKS_MOST], used = 0;
  ep_regions r = {.count = count, .shapes = 2};
  ep_map_options o = wishes(s);
  double *x = malloc(3 * (size_t)count * sizeof *x);
  int *label = malloc((size_t)from->nv * sizeof *label);
  r.start = malloc((2 * (size_t)count + 1) * sizeof *r.start);
  r.vertex = malloc((size_t)(from->nv + to->nv) * sizeof *r.vertex);
  assert_true(x && label && r.start && r.vertex);
  spread_points(from, count, true, seed);
  for (int g = 0; g < count; g++) memcpy(x + 3 * g, from->x + 3 * seed[g], 3 * sizeof *x);
  for (int i = 0; i < from->nv; i++) label[i] = nearest_point(count, x, from->x + 3 * i);
  for (int g = 0; g < count; g++) {
    r.start[2 * g] = used;
    for (int i = 0; i < from->nv; i++)
      if (label[i] == g) r.vertex[used++] = i;
    r.start[2 * g + 1] = used;
    for (int i = 0; i < to->nv; i++) {
      const int home = mirrored ? s->mirror[s->home[i]] : s->home[i];
      if (label[home] == (partner ? partner[g] : g)) r.vertex[used++] = i;
    }
    if (used == r.start[2 * g + 1]) r.vertex[used++] = 0;
  }
  r.start[2 * count] = used;
  o.regions = &r;
  show(s, how, &o);
  free(x);
  free(label);
  ep_regions_free(&r);
}

static void try_regions(const study *s) {
  static const int swapped[MARKS_MOST] = {1, 0, 2, 3, 4, 5, 6, 7};
  static const int round[MARKS_MOST] = {1, 2, 3, 4, 5, 6, 0, 7};
  with_regions(s, "regions 5", 5, NULL, false);
  with_regions(s, "regions 7", SEEDS, NULL, false);
  with_regions(s, "WRONG regions two swapped", SEEDS, swapped, false);
  with_regions(s, "WRONG regions in a round", SEEDS, round, false);
  with_regions(s, "WRONG regions mirrored", SEEDS, NULL, true);
}

// ---- one pair ----------------------------------------------------------------------------------

static void turned(truth_pair *pair, const study *s, const char *how, const double axis[3]) {
  ep_map_options o = wishes(s);
  pair_move(pair, axis, 180, 1, 0);
  show(s, how, &o);
  pair_move(pair, axis, -180, 1, 0);
}

static void run(truth_pair *pair, const int *marks, bool family) {
  study s;
  int v[MARKS_MOST];
  make_study(pair, family, &s);
  ep_map_options o = wishes(&s);
  show(&s, "automatic", &o);
  o.keep_frame = true;
  show(&s, "authored", &o);
  turned(pair, &s, "turned about x", (const double[3]){1, 0, 0});
  turned(pair, &s, "turned about y", (const double[3]){0, 1, 0});
  turned(pair, &s, "turned about z", (const double[3]){0, 0, 1});
  pair_move(pair, (const double[3]){0, 1, 0}, 180, 1, 0);
  show(&s, "turned, called authored", &o);
  pair_move(pair, (const double[3]){0, 1, 0}, -180, 1, 0);
  spread_points(&pair->from.mesh, 6, false, v);
  try_landmarks(&s, 6, marks ? marks : v);
  if (marks) with_landmarks(&s, "landmarks 6 spread", 6, v, NULL, false, 0);
  with_landmarks(&s, "landmarks 4", 4, v, NULL, false, 0);
  with_landmarks(&s, "WRONG 4 mirrored", 4, v, NULL, true, 0);
  spread_points(&pair->from.mesh, 8, true, v);
  with_landmarks(&s, "landmarks 6 others", 6, v, NULL, false, 0);
  with_landmarks(&s, "landmarks 8 others", 8, v, NULL, false, 0);
  try_regions(&s);
  free(s.mirror);
  free(s.home);
}

// ---- the toy plane and the toy fish of data/ ---------------------------------------------------

// Places that belong together; what is between is known roughly, by these.
enum { PLACES = 12 };
static const double PLACE[PLACES][2][3] = {
    {{0.9, 0, 0}, {0.76, -0.02, 0}},        // 0 nose
    {{0.05, 0.01, 1}, {0.13, -0.17, 0.43}}, // 1, 2 wing tips, side fins
    {{0.05, 0.01, -1}, {0.13, -0.17, -0.43}},
    {{-0.8, 0, 0}, {-0.72, 0.02, 0}},    // 3 end of the tail
    {{0.1, -0.14, 0}, {0.14, -0.26, 0}}, // 4 belly
    {{0.1, 0.14, 0}, {0.3, 0.25, 0}},    // 5 back
    {{0.5, 0, 0.1}, {0.5, 0, 0.11}},     // 6, 7 cheeks
    {{0.5, 0, -0.1}, {0.5, 0, -0.11}},
    {{-0.4, 0, 0}, {-0.38, 0, 0}},           // 8 root of the tail
    {{-0.63, 0.36, 0}, {-0.91, 0.42, 0}},    // 9 fin, upper lobe of the tail
    {{0.1, -0.02, 0.15}, {0.2, -0.1, 0.14}}, // 10, 11 roots of wings and side fins
    {{0.1, -0.02, -0.15}, {0.2, -0.1, -0.14}},
};
static const struct {
  const char *name;
  bool right;
  int count, from[MARKS_MOST], to[MARKS_MOST];
} TOY_MARKS[] = {
    {"nose, wings, tail, fin, belly", true, 6, {0, 1, 2, 3, 9, 4}, {0, 1, 2, 3, 9, 4}},
    {"nose, wings, tail, fin, back", true, 6, {0, 1, 2, 3, 9, 5}, {0, 1, 2, 3, 9, 5}},
    {"nose, wings, tail, fin", true, 5, {0, 1, 2, 3, 9}, {0, 1, 2, 3, 9}},
    {"nose, wings, tail, back, belly", true, 6, {0, 1, 2, 3, 4, 5}, {0, 1, 2, 3, 4, 5}},
    {"nose, wings, roots, tail", true, 6, {0, 1, 2, 10, 11, 3}, {0, 1, 2, 10, 11, 3}},
    {"nose, wings, cheeks, tail", true, 6, {0, 1, 2, 6, 7, 3}, {0, 1, 2, 6, 7, 3}},
    {"nose, wings, tail and root", true, 5, {0, 1, 2, 3, 8}, {0, 1, 2, 3, 8}},
    {"nose, wings, tail", true, 4, {0, 1, 2, 3}, {0, 1, 2, 3}},
    {"WRONG wings exchanged", false, 6, {0, 1, 2, 3, 9, 4}, {0, 2, 1, 3, 9, 4}},
    {"WRONG nose and tail exchanged", false, 6, {0, 1, 2, 3, 9, 4}, {3, 1, 2, 0, 9, 4}},
    {"WRONG wing and fin exchanged", false, 6, {0, 1, 2, 3, 9, 4}, {0, 9, 2, 3, 1, 4}},
    {"WRONG back and belly exchanged", false, 6, {0, 1, 2, 3, 4, 5}, {0, 1, 2, 3, 5, 4}},
    {"WRONG wings exchanged, only 4", false, 4, {0, 1, 2, 3}, {0, 2, 1, 3}},
    {"WRONG in a round", false, 6, {0, 1, 2, 3, 9, 4}, {1, 2, 3, 9, 4, 0}},
};

// Mean distance of the places' images to their partners over the diagonal.
static double toy_error(const test_shape *from, const test_shape *to, const ep_map *map) {
  double sum = 0;
  for (int p = 0; p < PLACES; p++) {
    const int v = nearest_point(from->mesh.nv, from->mesh.x, PLACE[p][0]);
    const double *partner = to->mesh.x + 3 * nearest_point(to->mesh.nv, to->mesh.x, PLACE[p][1]);
    double d2 = 0;
    for (int c = 0; c < 3; c++) {
      double x = -partner[c];
      for (int k = 0; k < 4; k++)
        x += map->weight[4 * v + k] * to->mesh.x[3 * to->mesh.tet[4 * map->tet[v] + k] + c];
      d2 += x * x;
    }
    sum += sqrt(d2) / PLACES;
  }
  return sum / ep_mesh_diagonal(&to->mesh);
}

static void show_toys(const test_shape *from, const test_shape *to, const char *how,
                      const ep_map_options *o) {
  ep_map map;
  ep_error err = {0};
  if (ep_map_match(&from->shape, &to->shape, o, NULL, &map, &err) != EP_OK)
    fail_msg("%s", err.text);
  print_map("toy plane -> toy fish", how, toy_error(from, to, &map), &map.quality);
  ep_map_free(&map);
}

// Boxes along both shapes, with their fins apart: the first `count` as regions. order: whose box is
// given on the fish.
static void toy_regions(const test_shape *from, const test_shape *to, const char *how, int count,
                        const int *order) {
  static const double BOX[8][2][6] = {
      {{0.5, -1, -2, 2, 1, 2}, {0.45, -1, -1, 1, 1, 1}},    // head
      {{-2, -0.2, 0.2, 2, 0.2, 2}, {0, -1, 0.17, 1, 0, 1}}, // wings, side fins
      {{-2, -0.2, -2, 2, 0.2, -0.2}, {0, -1, -1, 1, 0, -0.17}},
      {{-2, -0.2, -2, -0.55, 0.12, 2}, {-2, -0.1, -1, -0.45, 0.12, 1}},       // tail
      {{-0.1, -1, -0.2, 0.4, 1, 0.2}, {-0.1, -1, -0.17, 0.3, 0.2, 0.17}},     // trunk
      {{-2, 0.15, -2, -0.3, 2, 2}, {-2, 0.14, -1, -0.5, 2, 1}},               // fin, upper lobe
      {{-0.5, -1, -0.2, -0.2, 0.15, 0.2}, {-0.45, -1, -1, -0.2, 0.12, 1}},    // root of the tail
      {{-0.2, 0.08, -0.2, 0.4, 1, 0.2}, {-0.2, 0.1, -0.15, 0.4, 0.26, 0.15}}, // back
  };
  ep_regions r = {.count = count, .shapes = 2};
  ep_map_options o = ep_default_map_options();
  int used = 0;
  r.start = malloc((2 * (size_t)count + 1) * sizeof *r.start);
  r.vertex = malloc((size_t)count * (size_t)(from->mesh.nv + to->mesh.nv) * sizeof *r.vertex);
  assert_true(r.start && r.vertex);
  for (int g = 0; g < count; g++)
    for (int s = 0; s < 2; s++) {
      const ep_mesh *mesh = s ? &to->mesh : &from->mesh;
      const double *box = BOX[s && order ? order[g] : g][s];
      r.start[2 * g + s] = used;
      for (int v = 0; v < mesh->nv; v++) {
        bool inside = true;
        for (int c = 0; c < 3; c++)
          inside = inside && mesh->x[3 * v + c] >= box[c] && mesh->x[3 * v + c] <= box[3 + c];
        if (inside) r.vertex[used++] = v;
      }
      assert_true(used > r.start[2 * g + s]);
    }
  r.start[2 * count] = used;
  o.regions = &r;
  show_toys(from, to, how, &o);
  ep_regions_free(&r);
}

static void run_toys(void) {
  static const int exchanged[8] = {0, 2, 1, 3, 4, 5, 6, 7}, round[8] = {1, 2, 3, 4, 5, 6, 0, 7};
  test_shape from, to;
  shape_from_file(&from, EP_SOURCE_DIR "/data/meshes", "plane.msh", FUNCTIONS);
  shape_from_file(&to, EP_SOURCE_DIR "/data/meshes", "fish.veg", FUNCTIONS);
  ep_map_options o = ep_default_map_options();
  show_toys(&from, &to, "automatic", &o);
  o.keep_frame = true;
  show_toys(&from, &to, "authored", &o);
  o.keep_frame = false;
  for (size_t i = 0; i < sizeof TOY_MARKS / sizeof *TOY_MARKS; i++) {
    ep_landmark mark[MARKS_MOST];
    for (int m = 0; m < TOY_MARKS[i].count; m++) {
      mark[m] = (ep_landmark){.from_vertex = -1, .to_vertex = -1};
      memcpy(mark[m].from, PLACE[TOY_MARKS[i].from[m]][0], sizeof mark[m].from);
      memcpy(mark[m].to, PLACE[TOY_MARKS[i].to[m]][1], sizeof mark[m].to);
    }
    o.landmarks = TOY_MARKS[i].count;
    o.landmark = mark;
    show_toys(&from, &to, TOY_MARKS[i].name, &o);
  }
  for (int count = 5; count <= 8; count++) {
    char how[32];
    snprintf(how, sizeof how, "regions %d", count);
    toy_regions(&from, &to, how, count, NULL);
  }
  toy_regions(&from, &to, "WRONG regions, wings exchanged", 7, exchanged);
  toy_regions(&from, &to, "WRONG regions in a round", 7, round);
  shape_free(&from);
  shape_free(&to);
}

typedef struct recipe {
  const char *name;
  body which;
  int refine_from, refine_to;
  placement from, to;
  bool family;
} recipe;

static const recipe RECIPES[] = {
    {"bar -> bend", BODY_BAR, 3, 4, place_bar, place_bar_bent, false},
    {"bar -> rod", BODY_BAR, 3, 4, place_bar, place_rod, false},
    {"bar -> twist, family", BODY_BAR, 3, 4, place_bar, place_bar_twisted, true},
    {"beast -> walking", BODY_BEAST, 2, 3, place_beast, place_beast_walking, false},
    {"beast -> walking, family", BODY_BEAST, 2, 3, place_beast, place_beast_walking, true},
    {"beast -> curled, family", BODY_BEAST, 2, 3, place_beast, place_beast_curled, true},
    {"beast -> other build", BODY_BEAST, 2, 3, place_beast, place_beast_stretched, false},
    {"bird -> raised, family", BODY_FLYER, 2, 2, place_bird, place_bird_raised, true},
    {"plane -> bird", BODY_FLYER, 2, 2, place_plane, place_bird, false},
    {"plane -> bird raised", BODY_FLYER, 2, 2, place_plane, place_bird_raised, false},
    {"plane -> fish", BODY_FLYER, 2, 2, place_plane, place_fish, false},
    {"fish -> plane", BODY_FLYER, 2, 2, place_fish, place_plane, false},
    {"bird -> fish", BODY_FLYER, 2, 2, place_bird, place_fish, false},
};

static const data_recipe DATA[] = {
    {"data bird, raised", "bird.veg", NULL, 0, "", "bird.veg", "bird-raised.veg",
     "bird-raised-own.veg", NULL},
    {"data fish, swimming", "fish.veg", NULL, 0, "", "fish.veg", "fish-swim.veg",
     "fish-swim-own.veg", NULL},
    {"data estate, S", "estate.veg", NULL, 0, "", "estate.veg", "estate-arc.veg", "estate-arc.veg",
     NULL},
    {"data dog, howling", "dog.msh", NULL, 0, "", "dog.msh", "dog-howl.veg", "dog-howl.veg", NULL},
    {"data slim, waving", "slim.veg", NULL, 0, "", "slim.veg", "slim-wave.veg", "slim-wave.veg",
     NULL},
};

int main(int argc, char **argv) {
  ep_error err = {0};
  const char *word = argc > 1 ? argv[1] : "";
  if (ep_petsc_start(&err) != EP_OK) {
    fprintf(stderr, "%s\n", err.text);
    return 1;
  }
  printf("%-24s %-30s %6s %-5s %-8s %5s %5s  %5s  %5s %2s %2s  %5s  %s\n", "pair", "given", "error",
         "", "verdict", "cycle", "cover", "hand", "alone", "ag", "ri", "marks",
         "regions, Jaccard, held");
  for (size_t i = 0; i < sizeof RECIPES / sizeof *RECIPES; i++) {
    const recipe *r = &RECIPES[i];
    truth_pair pair;
    int marks[BENCH_MARK_COUNT];
    if (!strstr(r->name, word)) continue;
    pair_of_bodies(r->name, r->which, r->refine_from, r->from, r->refine_to, r->to, FUNCTIONS,
                   &pair);
    for (int m = 0; m < BENCH_MARK_COUNT; m++)
      marks[m] = pair_landmark_of(&pair, BENCH_MARKS[r->which][m]).from_vertex;
    run(&pair, marks, r->family);
    pair_free(&pair);
  }
  if (strstr("toy plane -> toy fish", word)) run_toys();
  for (size_t i = 0; i < sizeof DATA / sizeof *DATA; i++) {
    truth_pair pair;
    if (!strstr(DATA[i].name, word) || !pair_of_data(&DATA[i], FUNCTIONS, &pair)) continue;
    run(&pair, NULL, true);
    pair_free(&pair);
  }
  static const char *const rows[3] = {"right", "wrong", "wrong, turned to its own image"};
  printf("\n%-32s %6s %8s %6s\n", "", "good", "doubtful", "bad");
  for (int r = 0; r < 3; r++)
    printf("%-32s %6d %8d %6d\n", rows[r], counts[r][0], counts[r][1], counts[r][2]);
  ep_petsc_stop();
  return 0;
}
