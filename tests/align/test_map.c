// align/: maps with known truth. The same mesh with its vertices reordered, turned, scaled and
// shifted gives back the permutation; other resolutions and bent poses stay near the truth, which
// every vertex of the test shapes carries as its parameters; composition through a family's rest
// shape beats an independent map; mis-ordered regions are named and do no harm; repeats agree.
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
#include "linalg/dense.h"
#include "shapes.h"
#include "tests/petsc_session.h"

enum { M = 10, FUNCTIONS = 20 };

typedef struct club {
  test_shape s;
  double *u; // (nv x 3) parameters: the truth
} club;

static void make_club(club *c, int a, int b, int d, placement place) {
  const int cells[3] = {a, b, d};
  ep_mesh mesh;
  lattice(cells, place, &mesh, &c->u);
  shape_from_mesh(&c->s, &mesh, FUNCTIONS);
}

static void free_club(club *c) {
  shape_free(&c->s);
  free(c->u);
}

// Another build: thicker, shorter, less of a bow.
static void place_fat_club(const double u[3], double x[3]) {
  const double thick = 0.85 + 0.7 * u[0] * u[0];
  x[0] = 4.8 * u[0];
  x[1] = thick * (u[1] - 0.5) + 0.15 * sin(3 * u[0]);
  x[2] = 0.8 * thick * (u[2] - 0.5) + 0.1 * u[0] * u[0];
}

// Mean distance, in the rest shape `place`, between where a vertex belongs and where it is sent,
// over the bounding box's diagonal.
static double mean_error(const club *from, const club *to, const int *p, placement place) {
  double sum = 0, low[3] = {1e9, 1e9, 1e9}, high[3] = {-1e9, -1e9, -1e9};
  for (int i = 0; i < from->s.mesh.nv; i++) {
    double a[3], b[3], d2 = 0;
    place(from->u + 3 * i, a);
    place(to->u + 3 * p[i], b);
    for (int c = 0; c < 3; c++) {
      d2 += (a[c] - b[c]) * (a[c] - b[c]);
      low[c] = fmin(low[c], a[c]);
      high[c] = fmax(high[c], a[c]);
    }
    sum += sqrt(d2);
  }
  double diagonal = 0;
  for (int c = 0; c < 3; c++) diagonal += (high[c] - low[c]) * (high[c] - low[c]);
  return sum / from->s.mesh.nv / sqrt(diagonal);
}

static void match(const test_shape *from, const test_shape *to, const ep_map_options *options,
                  ep_map *map) {
  ep_error err = {0};
  if (ep_map_match(&from->shape, &to->shape, options, NULL, map, &err) != EP_OK)
    fail_msg("%s", err.text);
}

static int *random_order(int n, uint64_t seed) {
  ep_random rng = ep_random_seed(seed, 6);
  int *order = malloc((size_t)n * sizeof *order);
  assert_non_null(order);
  for (int i = 0; i < n; i++) order[i] = i;
  for (int i = n - 1; i > 0; i--) {
    const int j = ep_random_below(&rng, i + 1), t = order[i];
    order[i] = order[j];
    order[j] = t;
  }
  return order;
}

// `to` is `from` with vertices reordered and moved; order: its vertex i is from's order[i].
static void make_moved(const club *from, const double axis[3], double degrees, test_shape *to,
                       int **order) {
  ep_mesh mesh;
  *order = random_order(from->s.mesh.nv, 11);
  permute_mesh(&from->s.mesh, *order, &mesh);
  move_mesh(&mesh, axis, degrees, 0.37, 5.0);
  shape_from_mesh(to, &mesh, FUNCTIONS);
}

static int count_wrong(const ep_map *map, const int *order) {
  int wrong = 0;
  for (int i = 0; i < map->n; i++) wrong += order[map->p[i]] != i;
  return wrong;
}

static void permutation_comes_back(void **state) {
  (void)state;
  club from;
  test_shape to;
  int *order;
  make_club(&from, 20, 5, 4, place_club);
  make_moved(&from, (double[3]){1, 0, 0}, 0, &to, &order);
  ep_map_options o = ep_default_map_options();
  for (int family = 0; family < 2; family++) {
    ep_map map;
    o.same_family = family;
    match(&from.s, &to, &o, &map);
    assert_int_equal(count_wrong(&map, order), 0);
    const ep_map_quality *q = &map.quality;
    assert_int_equal(q->verdict, EP_MAP_GOOD);
    assert_string_equal(q->reasons, "");
    // Points in tets: barycentric coordinates of vertices to round-off.
    assert_true(q->cycle < 1e-9 && q->coverage > 1 - 1e-9);
    // The same shape: energies agree to round-off, C is orthogonal to the eigensolver's accuracy.
    assert_true(fabs(q->dirichlet - 1) < 1e-9);
    assert_true(q->orthogonality < 1e-12 && fabs(fabs(q->determinant) - 1) < 1e-12);
    assert_true(fabs(map.scale - 1 / 0.37) < 1e-9);
    for (int a = 0; a < M; a++)
      for (int b = 0; b < M; b++) assert_true(fabs(map.c[a * M + b] - map.a[b * M + a]) < 1e-6);
    ep_map_free(&map);
  }
  free(order);
  shape_free(&to);
  free_club(&from);
}

// x_from = scale R (x_to - ct) + cf must hold for the true pairs.
static double frame_error(const club *from, const test_shape *to, const ep_map *map,
                          const int *order) {
  double worst = 0;
  for (int j = 0; j < to->mesh.nv; j++) {
    double d[3], y[3];
    for (int c = 0; c < 3; c++) d[c] = to->mesh.x[3 * j + c] - map->center_to[c];
    ep_frame_apply(1, map->rotation, d, y);
    for (int c = 0; c < 3; c++)
      worst = fmax(
          worst, fabs(map->scale * y[c] + map->center_from[c] - from->s.mesh.x[3 * order[j] + c]));
  }
  return worst;
}

static void tilts_are_repaired(void **state) {
  (void)state;
  club from;
  make_club(&from, 20, 5, 4, place_club);
  const double axes[3][3] = {{0, 0, 1}, {0, 1, 0.3}, {1, 1, 1}};
  for (int t = 0; t < 3; t++) {
    test_shape to;
    int *order;
    ep_map map;
    make_moved(&from, axes[t], 30, &to, &order);
    const ep_map_options o = ep_default_map_options();
    match(&from.s, &to, &o, &map);
    printf("tilt of 30 degrees: %d rounds, %d of %d vertices wrong, frame error %.3f\n",
           map.quality.reframe_rounds, count_wrong(&map, order), map.n,
           frame_error(&from, &to, &map, order));
    assert_int_equal(map.quality.verdict, EP_MAP_GOOD);
    assert_true(map.quality.reframe_rounds >= 1);
    // Reframing stops below 5 degrees: up to 5 degrees x half the length of 5 may remain.
    assert_true(frame_error(&from, &to, &map, order) < 0.25);
    ep_map_free(&map);
    free(order);
    shape_free(&to);
  }
  free_club(&from);
}

// Six boxes of parameters as regions of both shapes; swapped: the second shape's 1, 2, 3 go round.
static void box_regions(const club *from, const int *order, bool swapped, ep_regions *out) {
  static const double low[6][3] = {{0, 0, 0},     {0.8, 0, 0}, {0.3, 0, 0},
                                   {0, 0.5, 0.0}, {0, 0, 0.5}, {0.6, 0.4, 0}};
  static const double high[6][3] = {{0.2, 1, 1}, {1, 1, 1}, {0.5, 1, 1},
                                    {1, 1, 1},   {1, 1, 1}, {0.9, 1, 0.6}};
  const int n = from->s.mesh.nv;
  int used = 0;
  out->count = 6;
  out->shapes = 2;
  out->start = malloc(13 * sizeof *out->start);
  out->vertex = malloc(12 * (size_t)n * sizeof *out->vertex);
  assert_true(out->start && out->vertex);
  for (int g = 0; g < 6; g++)
    for (int s = 0; s < 2; s++) {
      const int box = swapped && s == 1 && g < 3 ? (g + 1) % 3 : g;
      out->start[2 * g + s] = used;
      for (int i = 0; i < n; i++) {
        const double *u = from->u + 3 * (s ? order[i] : i);
        bool inside = true;
        for (int c = 0; c < 3; c++) inside = inside && u[c] >= low[box][c] && u[c] <= high[box][c];
        if (inside) out->vertex[used++] = i;
      }
    }
  out->start[12] = used;
}

static void regions_give_the_frame(void **state) {
  (void)state;
  club from;
  test_shape to;
  int *order;
  ep_regions regions;
  ep_map map;
  make_club(&from, 20, 5, 4, place_club);
  make_moved(&from, (double[3]){1, -2, 0.5}, 140, &to, &order);
  box_regions(&from, order, false, &regions);
  ep_map_options o = ep_default_map_options();
  o.regions = &regions;
  match(&from.s, &to, &o, &map);
  assert_int_equal(count_wrong(&map, order), 0);
  assert_true(frame_error(&from, &to, &map, order) < 1e-9);
  assert_true(fabs(map.quality.frame_angle - 140) < 1e-6);
  assert_int_equal(map.quality.verdict, EP_MAP_GOOD);
  assert_int_equal(map.quality.regions, 6);
  for (int g = 0; g < 6; g++) {
    assert_true(fabs(map.quality.region[g].jaccard - 1) < 1e-12);
    assert_int_equal(map.quality.region[g].best_match, g);
    assert_false(map.quality.region[g].suspect);
  }
  assert_true(map.quality.residual_after < 1e-3);
  ep_map_free(&map);
  ep_regions_free(&regions);
  free(order);
  shape_free(&to);
  free_club(&from);
}

static void misplaced_regions_are_named(void **state) {
  (void)state;
  club from;
  test_shape to;
  int *order;
  ep_regions regions;
  ep_map map;
  make_club(&from, 20, 5, 4, place_club);
  make_moved(&from, (double[3]){1, 0, 0}, 0, &to, &order);
  box_regions(&from, order, true, &regions);
  // Seven and eight: more right regions than wrong ones are needed to tell.
  ep_map_options o = ep_default_map_options();
  o.regions = &regions;
  match(&from.s, &to, &o, &map);
  for (int g = 0; g < 6; g++)
    printf("region %d: Jaccard %.2f, best %d%s\n", g, map.quality.region[g].jaccard,
           map.quality.region[g].best_match, map.quality.region[g].suspect ? ", suspect" : "");
  for (int g = 0; g < 6; g++) {
    assert_int_equal(map.quality.region[g].suspect, g < 3);
    assert_int_equal(map.quality.region[g].best_match, g < 3 ? (g + 2) % 3 : g);
  }
  ep_map_free(&map);
  ep_regions_free(&regions);
  free(order);
  shape_free(&to);
  free_club(&from);
}

static void other_resolutions_and_poses_stay_near_the_truth(void **state) {
  (void)state;
  club object, same, rest, pose;
  make_club(&object, 22, 5, 4, place_fat_club);
  make_club(&rest, 26, 6, 5, place_club);
  make_club(&same, 19, 4, 4, place_club);
  make_club(&pose, 24, 5, 5, place_bent_club);
  ep_map_options o = ep_default_map_options();
  ep_map remeshed, first, second, composed, independent;
  match(&same.s, &rest.s, &o, &remeshed);
  o.keep_frame = true; // clubs have nearly a half turn's symmetry
  match(&object.s, &rest.s, &o, &first);
  match(&object.s, &pose.s, &o, &independent);
  o.keep_frame = false;
  o.same_family = true;
  match(&rest.s, &pose.s, &o, &second);
  ep_error err = {0};
  assert_int_equal(ep_map_compose(&first, &rest.s.mesh, &second, &pose.s.mesh, &composed, &err),
                   EP_OK);
  const double e_remeshed = mean_error(&same, &rest, remeshed.p, place_club);
  const double e_first = mean_error(&object, &rest, first.p, place_fat_club);
  const double e_second = mean_error(&rest, &pose, second.p, place_club);
  const double e_composed = mean_error(&object, &pose, composed.p, place_fat_club);
  const double e_independent = mean_error(&object, &pose, independent.p, place_fat_club);
  printf("mean error over the diagonal: remeshed %.4f, other build %.4f, bent pose %.4f, composed "
         "%.4f, independent %.4f\n",
         e_remeshed, e_first, e_second, e_composed, e_independent);
  printf("round trips %.3f %.3f %.3f, independent %.3f\n", remeshed.quality.cycle,
         first.quality.cycle, second.quality.cycle, independent.quality.cycle);
  // Half a cell of the target is .02 of the diagonal: no vertex map can be better than about that.
  assert_true(e_remeshed < 0.025);
  assert_true(e_first < 0.06);
  assert_true(e_second < 0.05);
  assert_true(e_composed < e_independent);
  printf("%s%s\n", first.quality.reasons, second.quality.reasons);
  // Right or not, a frame turned this far is called doubtful, and composition keeps the worse word.
  assert_int_equal(first.quality.verdict, EP_MAP_GOOD);
  assert_int_equal(second.quality.verdict, EP_MAP_DOUBTFUL);
  assert_int_equal(composed.quality.verdict, EP_MAP_DOUBTFUL);
  ep_map *all[5] = {&remeshed, &first, &second, &composed, &independent};
  for (int i = 0; i < 5; i++) ep_map_free(all[i]);
  free_club(&object);
  free_club(&same);
  free_club(&rest);
  free_club(&pose);
}

// p o p^-1 and the frames, exactly, on the same mesh.
static void composition_multiplies(void **state) {
  (void)state;
  club a;
  test_shape b, c;
  int *to_b, *to_c;
  make_club(&a, 12, 4, 3, place_club);
  make_moved(&a, (double[3]){0, 0, 1}, 0, &b, &to_b);
  ep_mesh mesh;
  to_c = random_order(b.mesh.nv, 12);
  permute_mesh(&b.mesh, to_c, &mesh);
  move_mesh(&mesh, (double[3]){0, 0, 1}, 0, 3.0, -1);
  shape_from_mesh(&c, &mesh, FUNCTIONS);
  ep_map_options o = ep_default_map_options();
  ep_map ab, bc, ac;
  ep_error err = {0};
  match(&a.s, &b, &o, &ab);
  match(&b, &c, &o, &bc);
  assert_int_equal(ep_map_compose(&ab, &b.mesh, &bc, &c.mesh, &ac, &err), EP_OK);
  int wrong = 0;
  for (int i = 0; i < ac.n; i++) wrong += to_b[to_c[ac.p[i]]] != i;
  assert_int_equal(wrong, 0);
  assert_true(fabs(ac.scale - 1 / (0.37 * 3)) < 1e-9);
  for (int i = 0; i < M; i++)
    for (int j = 0; j < M; j++) {
      double product = 0; // C of the composed map, where maps are exact: C1 C2 and A = C^T
      for (int l = 0; l < M; l++) product += ab.c[i * M + l] * bc.c[l * M + j];
      assert_true(fabs(product - ac.c[i * M + j]) < 1e-12);
      assert_true(fabs(product - ac.a[j * M + i]) < 1e-6);
    }
  bc.m--;
  ep_map_free(&ac);
  assert_int_equal(ep_map_compose(&ab, &b.mesh, &bc, &c.mesh, &ac, &err), EP_ERR_ARGUMENT);
  assert_null(ac.p);
  bc.m++;
  ep_map_free(&ab);
  ep_map_free(&bc);
  free(to_b);
  free(to_c);
  shape_free(&b);
  shape_free(&c);
  free_club(&a);
}

static void repeats_agree(void **state) {
  (void)state;
  club a, b;
  make_club(&a, 14, 4, 3, place_club);
  make_club(&b, 12, 4, 4, place_bent_club);
  ep_map_options o = ep_default_map_options();
  o.same_family = true;
  ep_map first, second;
  match(&a.s, &b.s, &o, &first);
  match(&a.s, &b.s, &o, &second);
  assert_memory_equal(first.p, second.p, (size_t)first.n * sizeof *first.p);
  assert_memory_equal(first.a, second.a, M * M * sizeof *first.a);
  assert_memory_equal(&first.quality.cycle, &second.quality.cycle, sizeof first.quality.cycle);
  ep_map_free(&first);
  ep_map_free(&second);
  free_club(&a);
  free_club(&b);
}

// Two bars side by side as one mesh.
static void make_pair(test_shape *s) {
  const int cells[3] = {6, 3, 3};
  ep_mesh one, two;
  double *u;
  lattice(cells, place_club, &one, &u);
  double *x = malloc(6 * (size_t)one.nv * sizeof *x);
  int *tet = malloc(8 * (size_t)one.nt * sizeof *tet);
  assert_true(x && tet);
  for (int i = 0; i < 6 * one.nv; i++) x[i] = one.x[i % (3 * one.nv)] + (i < 3 * one.nv ? 0 : 9);
  for (int i = 0; i < 8 * one.nt; i++)
    tet[i] = one.tet[i % (4 * one.nt)] + (i < 4 * one.nt ? 0 : one.nv);
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(2 * one.nv, x, 2 * one.nt, tet, "pair", &two, NULL, &err), EP_OK);
  shape_from_mesh(s, &two, FUNCTIONS);
  ep_mesh_free(&one);
  free(x);
  free(tet);
  free(u);
}

static void impossible_maps_are_refused(void **state) {
  (void)state;
  club a;
  test_shape pair;
  make_club(&a, 8, 4, 3, place_club);
  make_pair(&pair);
  ep_map map;
  ep_error err = {0};
  ep_map_options o = ep_default_map_options();
  assert_int_equal(ep_map_match(&a.s.shape, &pair.shape, &o, NULL, &map, &err), EP_ERR_MATCH);
  assert_non_null(strstr(err.text, "connected part"));
  assert_null(map.p);
  err = (ep_error){0};
  o.m = FUNCTIONS + 1;
  assert_int_equal(ep_map_match(&a.s.shape, &a.s.shape, &o, NULL, &map, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "at most 20"));
  shape_free(&pair);
  free_club(&a);
}

static void refused(const club *a, const ep_landmark *mark, const char *word) {
  ep_map_options o = ep_default_map_options();
  ep_map map;
  ep_error err = {0};
  o.landmarks = 1;
  o.landmark = mark;
  assert_int_equal(ep_map_match(&a->s.shape, &a->s.shape, &o, NULL, &map, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, word));
  assert_non_null(strstr(err.text, "landmark 1"));
  assert_null(map.p);
}

static void impossible_landmarks_are_refused(void **state) {
  (void)state;
  club a;
  make_club(&a, 8, 4, 3, place_club);
  refused(&a, &(ep_landmark){.from_vertex = a.s.mesh.nv}, "which has");
  refused(&a, &(ep_landmark){.to_vertex = 100000}, "which has");
  refused(&a, &(ep_landmark){.from_vertex = -1, .from = {0, 9, 0}}, "outside");
  refused(&a, &(ep_landmark){.to_vertex = -1, .to = {NAN, 0, 0}}, "finite");
  // The same point, given as a vertex and as a point in space, is the same landmark.
  ep_landmark by_vertex = {0}, by_point = {.from_vertex = -1, .to_vertex = -1};
  memcpy(by_point.from, a.s.mesh.x, sizeof by_point.from);
  memcpy(by_point.to, a.s.mesh.x, sizeof by_point.to);
  ep_map one, other;
  ep_map_options o = ep_default_map_options();
  o.landmarks = 1;
  o.landmark = &by_vertex;
  match(&a.s, &a.s, &o, &one);
  o.landmark = &by_point;
  match(&a.s, &a.s, &o, &other);
  assert_memory_equal(one.p, other.p, (size_t)one.n * sizeof *one.p);
  for (int i = 0; i < one.n; i++) assert_int_equal(one.p[i], i);
  assert_int_equal(one.quality.landmarks, 1);
  assert_true(one.quality.landmark_residual < 1e-9); // the map is the identity
  ep_map_free(&one);
  ep_map_free(&other);
  free_club(&a);
}

// A mirrored example: only on request is the mirrored frame a candidate, and then it is found.
static void reflections_are_found_on_request(void **state) {
  (void)state;
  club from;
  test_shape to;
  ep_mesh mesh;
  make_club(&from, 20, 5, 4, place_club);
  int *order = random_order(from.s.mesh.nv, 15);
  permute_mesh(&from.s.mesh, order, &mesh);
  for (int i = 0; i < mesh.nv; i++) mesh.x[3 * i + 2] *= -1;
  for (int e = 0; e < mesh.nt; e++) {
    const int t = mesh.tet[4 * e];
    mesh.tet[4 * e] = mesh.tet[4 * e + 1];
    mesh.tet[4 * e + 1] = t;
  }
  shape_from_mesh(&to, &mesh, FUNCTIONS);
  ep_map map;
  ep_map_options o = ep_default_map_options();
  match(&from.s, &to, &o, &map);
  for (int i = 0; i < map.quality.candidates; i++) assert_false(map.quality.candidate[i].reflected);
  assert_true(ep_determinant3(map.rotation) > 0);
  ep_map_free(&map);
  o.reflections = true;
  match(&from.s, &to, &o, &map);
  int mirrored = 0;
  double least = HUGE_VAL, proper = HUGE_VAL;
  for (int i = 0; i < map.quality.candidates; i++) {
    const ep_frame_candidate *f = &map.quality.candidate[i];
    mirrored += f->reflected;
    if (f->reflected)
      least = fmin(least, f->score);
    else
      proper = fmin(proper, f->score);
  }
  printf("mirrored frames: best score %.3f, proper ones %.3f; chosen det %.0f, %d wrong\n", least,
         proper, ep_determinant3(map.rotation), count_wrong(&map, order));
  assert_int_equal(mirrored, 4);
  assert_true(least < proper); // the mirrored frame is exact
  assert_true(map.quality.verdict != EP_MAP_GOOD || ep_determinant3(map.rotation) < 0);
  ep_map_free(&map);
  free(order);
  shape_free(&to);
  free_club(&from);
}

// An example lying across the object and nothing given: the record must not call that good unless
// the map is right all the same.
static void wrong_frames_are_not_silent(void **state) {
  (void)state;
  club from;
  make_club(&from, 20, 5, 4, place_club);
  for (int degrees = 90; degrees <= 120; degrees += 30) {
    test_shape to;
    int *order;
    ep_map map;
    make_moved(&from, (double[3]){0, 0, 1}, degrees, &to, &order);
    const ep_map_options o = ep_default_map_options();
    match(&from.s, &to, &o, &map);
    printf("turned by %d degrees: verdict %d, frame angle %.0f, cycle %.2f, error %.2f: %s\n",
           degrees, (int)map.quality.verdict, map.quality.frame_angle, map.quality.cycle,
           frame_error(&from, &to, &map, order), map.quality.reasons);
    assert_true(map.quality.verdict != EP_MAP_GOOD || frame_error(&from, &to, &map, order) < 0.5);
    ep_map_free(&map);
    free(order);
    shape_free(&to);
  }
  free_club(&from);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(permutation_comes_back),
      cmocka_unit_test(tilts_are_repaired),
      cmocka_unit_test(regions_give_the_frame),
      cmocka_unit_test(misplaced_regions_are_named),
      cmocka_unit_test(other_resolutions_and_poses_stay_near_the_truth),
      cmocka_unit_test(composition_multiplies),
      cmocka_unit_test(repeats_agree),
      cmocka_unit_test(impossible_maps_are_refused),
      cmocka_unit_test(impossible_landmarks_are_refused),
      cmocka_unit_test(reflections_are_found_on_request),
      cmocka_unit_test(wrong_frames_are_not_silent),
  };
  return cmocka_run_group_tests_name("align/map", tests, session_start, session_stop);
}
