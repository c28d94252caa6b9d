// Maps of a family composed through its rest shape, against maps of each pose made on their own.
// Three errors, in per cent of the diagonal: of the points; of the motion, pose minus rest as the
// object's vertices see it; of the pose on the object's mesh, which the bake makes of that motion
// (low coefficients and LB-ARAP), against the same made of the true motion, both laid upon each
// other by the best rigid motion.
#include "map_families.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "linalg/dense.h"

const char *const BENCH_VERDICTS[3] = {"good", "doubtful", "bad"};

// Corners of the bar; the flyer's nose, wing tips, tail tips and fin; the beast's head, tail and
// feet.
const double BENCH_MARKS[BODIES][BENCH_MARK_COUNT][3] = {
    [BODY_BAR] = {{0, 0, 0}, {6, 2, 2}, {0, 2, 2}, {6, 0, 0}, {3, 2, 1}, {3, 1, 2}},
    [BODY_FLYER] =
        {{12, 3, 7}, {6.5, 2.5, 14}, {6.5, 2.5, 0}, {1, 2.5, 10}, {1, 2.5, 4}, {0, 6, 7}},
    [BODY_BEAST] = {{13, 6, 2}, {0, 4, 2}, {3, 0, 1}, {3, 0, 4}, {10, 0, 1}, {10, 0, 4}}};

void bench_match(const truth_pair *pair, int landmarks, const ep_landmark *mark, ep_map *map) {
  ep_map_options o = ep_default_map_options();
  ep_error err = {0};
  o.m = BENCH_M;
  if (o.m > pair->from.lb.m) o.m = pair->from.lb.m;
  o.landmarks = landmarks;
  o.landmark = mark;
  if (ep_map_match(&pair->from.shape, &pair->to.shape, &o, NULL, map, &err) != EP_OK)
    fail_msg("%s", err.text);
}

enum { POSES = 3 };
typedef struct family {
  const char *name;
  body which;
  placement object, rest, pose[POSES];
} family;

static const family FAMILIES[] = {
    {"plane <- bird",
     BODY_FLYER,
     place_plane,
     place_bird,
     {place_bird_raised, place_bird_banked, place_bird_diving}},
    {"beast <- other beast",
     BODY_BEAST,
     place_beast_stretched,
     place_beast,
     {place_beast_walking, place_beast_rearing, place_beast_curled}},
    {"rod <- bar",
     BODY_BAR,
     place_rod,
     place_bar,
     {place_bar_bent, place_bar_twisted, place_bar_curled}},
};

typedef struct errors {
  double points, motion, pose;
} errors;

static double *numbers(const ep_mesh *mesh) {
  double *x = malloc(3 * (size_t)mesh->nv * sizeof *x);
  assert_non_null(x);
  return x;
}

// Mean distance of rows a and b over the diagonal of `mesh`, in per cent.
static double distance(int n, const double *a, const double *b, const ep_mesh *mesh) {
  double sum = 0;
  for (int i = 0; i < n; i++)
    sum += sqrt(pow(a[3 * i] - b[3 * i], 2) + pow(a[3 * i + 1] - b[3 * i + 1], 2) +
                pow(a[3 * i + 2] - b[3 * i + 2], 2));
  return 100 * sum / n / ep_mesh_diagonal(mesh);
}

// Lay y (n x 3) upon x by the best rigid motion.
static void lay_upon(const ep_mesh *mesh, const double *x, double *y) {
  ep_error err = {0};
  double *weight = numbers(mesh), r[9], cy[3], cx[3];
  ep_mesh_vertex_volumes(mesh, weight);
  if (ep_kabsch(mesh->nv, y, x, weight, r, cy, cx, &err) != EP_OK) fail_msg("%s", err.text);
  for (int i = 0; i < mesh->nv; i++) {
    const double d[3] = {y[3 * i] - cy[0], y[3 * i + 1] - cy[1], y[3 * i + 2] - cy[2]};
    for (int a = 0; a < 3; a++)
      y[3 * i + a] = cx[a] + r[3 * a] * d[0] + r[3 * a + 1] * d[1] + r[3 * a + 2] * d[2];
  }
  free(weight);
}

// The pose on the object's mesh (positions, caller's to free), of where the object's vertices are
// in the family's rest shape and in its pose: as in the bake, turned by the best rotation, scaled
// by the cube root of volumes.
static double *pose_of(const truth_pair *rest, const double *here, const double *there) {
  const ep_mesh *mesh = &rest->from.mesh;
  const double scale = cbrt(ep_mesh_volume(mesh) / ep_mesh_volume(&rest->to.mesh));
  double *u = numbers(mesh), d[3 * BENCH_M];
  ep_lb low = rest->from.lb;
  ep_pose_options o = ep_default_pose_options();
  ep_error err = {0};
  memcpy(u, there, 3 * (size_t)mesh->nv * sizeof *u);
  lay_upon(mesh, here, u);
  for (int i = 0; i < 3 * mesh->nv; i++) u[i] = scale * (u[i] - here[i]);
  o.m = low.m = BENCH_M;
  ep_lb_project(&low, &rest->from.mass, u, d);
  if (ep_lb_pose(mesh, &low, d, &o, u, NULL, &err) != EP_OK) fail_msg("%s", err.text);
  for (int i = 0; i < 3 * mesh->nv; i++) u[i] += mesh->x[i];
  return u;
}

// rest, pose: the object's vertices in the family's rest shape and in its pose.
static errors errors_of(const truth_pair *rest, const ep_map *to_rest, const truth_pair *pose,
                        const ep_mesh *pose_mesh, const ep_map *to_pose) {
  const ep_mesh *object = &rest->from.mesh;
  const int n = object->nv;
  double *there = numbers(object), *here = numbers(object), *back = numbers(object);
  errors e;
  ep_map_pull(to_pose, pose_mesh, 3, pose_mesh->x, there);
  ep_map_pull(to_rest, &rest->to.mesh, 3, rest->to.mesh.x, here);
  for (int i = 0; i < 3 * n; i++) back[i] = there[i] - here[i] + rest->truth[i];
  e.points = distance(n, there, pose->truth, pose_mesh);
  e.motion = distance(n, back, pose->truth, pose_mesh);
  double *made = pose_of(rest, here, there), *best = pose_of(rest, rest->truth, pose->truth);
  lay_upon(object, best, made);
  e.pose = distance(n, made, best, object);
  free(made);
  free(best);
  free(there);
  free(here);
  free(back);
  return e;
}

static void print_errors(const char *name, const errors *c, const errors *i, const char *rest) {
  printf("%-22s %6.2f %6.2f %5.2f  %6.2f %6.2f %5.2f  %6.2f %6.2f %5.2f  %s\n", name, c->points,
         i->points, c->points / i->points, c->motion, i->motion, c->motion / i->motion, c->pose,
         i->pose, c->pose / i->pose, rest);
}

static void add(const errors *e, errors *mean) {
  mean->points += e->points / POSES;
  mean->motion += e->motion / POSES;
  mean->pose += e->pose / POSES;
}

// One pose of a family, whose rest shape is mapped by `first` already.
static void compose(const family *f, int which, int marks, const truth_pair *rest,
                    const ep_map *first, errors sum[2]) {
  truth_pair pose, direct;
  ep_map second, composed, independent;
  ep_error err = {0};
  ep_landmark mark[BENCH_MARK_COUNT];
  ep_map_options o = ep_default_map_options();
  char name[32], rest_of_line[32];
  o.m = BENCH_M;
  o.same_family = true;
  pair_of_bodies(f->name, f->which, 3, f->rest, 3, f->pose[which], BENCH_FUNCTIONS, &pose);
  pair_of_bodies(f->name, f->which, 2, f->object, 3, f->pose[which], BENCH_FUNCTIONS, &direct);
  for (int m = 0; m < marks; m++) mark[m] = pair_landmark_of(&direct, BENCH_MARKS[f->which][m]);
  bench_match(&direct, marks, mark, &independent);
  if (ep_map_match(&rest->to.shape, &pose.to.shape, &o, NULL, &second, &err) != EP_OK ||
      ep_map_compose(first, &rest->to.mesh, &second, &pose.to.mesh, &composed, &err) != EP_OK)
    fail_msg("%s", err.text);
  const errors both[2] = {errors_of(rest, first, &direct, &pose.to.mesh, &composed),
                          errors_of(rest, first, &direct, &direct.to.mesh, &independent)};
  snprintf(name, sizeof name, "  pose %d", which + 1);
  snprintf(rest_of_line, sizeof rest_of_line, "%s, %s", BENCH_VERDICTS[composed.quality.verdict],
           BENCH_VERDICTS[independent.quality.verdict]);
  print_errors(name, &both[0], &both[1], rest_of_line);
  for (int i = 0; i < 2; i++) add(&both[i], &sum[i]);
  ep_map_free(&second);
  ep_map_free(&composed);
  ep_map_free(&independent);
  pair_free(&pose);
  pair_free(&direct);
}

static void run_family(const family *f, int marks) {
  truth_pair rest;
  ep_map first;
  ep_landmark mark[BENCH_MARK_COUNT];
  errors sum[2] = {{0}};
  pair_of_bodies(f->name, f->which, 2, f->object, 3, f->rest, BENCH_FUNCTIONS, &rest);
  for (int m = 0; m < marks; m++) mark[m] = pair_landmark_of(&rest, BENCH_MARKS[f->which][m]);
  bench_match(&rest, marks, mark, &first);
  printf("%s, %d landmarks: object <- rest %.2f\n", f->name, marks,
         100 * pair_error(&rest, first.tet, first.weight));
  for (int i = 0; i < POSES; i++) compose(f, i, marks, &rest, &first, sum);
  print_errors("  mean", &sum[0], &sum[1], "");
  ep_map_free(&first);
  pair_free(&rest);
}

void run_families(void) {
  printf("%-22s %-20s  %-20s  %-20s\n%-22s", "family (% of diagonal)", "points", "motion",
         "pose on the object", "");
  for (int i = 0; i < 3; i++) printf(" %6s %6s %5s ", "compo.", "indep.", "ratio");
  printf("\n");
  for (size_t i = 0; i < sizeof FAMILIES / sizeof *FAMILIES; i++)
    for (int marks = 0; marks <= BENCH_MARK_COUNT; marks += BENCH_MARK_COUNT)
      run_family(&FAMILIES[i], marks);
}
