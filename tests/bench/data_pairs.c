#include "data_pairs.h"

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
#include "mesh/io.h"

// The cuboid 1 x .31 x .28 onto data's cylinder of half axes .182 and .164, square to disc by the
// elliptical grid mapping.
static void cuboid_to_cylinder(const double x[3], double y[3]) {
  const double a = fmin(fmax(x[1] / 0.155, -1), 1), b = fmin(fmax(x[2] / 0.14, -1), 1);
  y[0] = x[0];
  y[1] = 0.182 * a * sqrt(1 - b * b / 2);
  y[2] = 0.164 * b * sqrt(1 - a * a / 2);
}

#define ROUND "-setnumber round 1"
const data_recipe DATA_RECIPES[] = {
    {"data bird, remeshed", NULL, "bird", 0.058, "", NULL, NULL, "bird.veg", NULL},
    {"data fish, remeshed", NULL, "fish", 0.07, "", NULL, NULL, "fish.veg", NULL},
    {"data cross, remeshed", NULL, "cross", 0.07, ROUND, NULL, NULL, "round.veg", NULL},
    {"data dog, remeshed", NULL, "dog", 0.075, "", NULL, NULL, "dog.msh", NULL},
    {"data bird -> raised", NULL, "bird", 0.058, "", "bird.veg", "bird-raised.veg",
     "bird-raised-own.veg", NULL},
    {"data fish -> swimming", NULL, "fish", 0.058, "", "fish.veg", "fish-swim.veg",
     "fish-swim-own.veg", NULL},
    {"data cylinder -> S", NULL, "cylinder", 0.05, "", "cylinder.veg", "cylinder-s-own.veg",
     "cylinder-s.veg", NULL},
    {"data cylinder -> arc 100", NULL, "cylinder", 0.05, "", "cylinder.veg", "cylinder-arc.veg",
     "cylinder-arc.veg", NULL},
    {"data dog -> wagging", NULL, "dog", 0.075, "", "dog.msh", "dog-wag.veg", "dog-wag.veg", NULL},
    {"data dog -> howling", NULL, "dog", 0.075, "", "dog.msh", "dog-howl.veg", "dog-howl.veg",
     NULL},
    {"data bar -> cylinder", "bar.msh", NULL, 0, "", NULL, NULL, "cylinder.veg",
     cuboid_to_cylinder},
};
const int DATA_RECIPE_COUNT = sizeof DATA_RECIPES / sizeof *DATA_RECIPES;

static void stored(const char *name, ep_mesh *mesh) {
  char path[1024];
  ep_error err = {0};
  snprintf(path, sizeof path, "%s/data/meshes/%s", EP_SOURCE_DIR, name);
  if (ep_mesh_read(path, mesh, NULL, NULL, &err) != EP_OK) fail_msg("%s", err.text);
}

static bool made(const data_recipe *r, ep_mesh *mesh) {
  char command[2048];
  ep_error err = {0};
  const char *file = "bench-maps-remeshed.msh";
  snprintf(command, sizeof command,
           "OMP_NUM_THREADS=1 gmsh -3 -v 0 -nt 1 -format msh22 -setnumber size %g %s "
           "%s/data/generate/%s.geo -o %s",
           r->size, r->options, EP_SOURCE_DIR, r->geo, file);
  if (system(command) != 0) {
    printf("%-24s left out: gmsh did not mesh %s.geo\n", r->name, r->geo);
    return false;
  }
  if (ep_mesh_read(file, mesh, NULL, NULL, &err) != EP_OK) fail_msg("%s", err.text);
  remove(file);
  return true;
}

// truth (points x 3): where the points of the rest shape are in its pose, by the tets they lie in.
static void carry(const data_recipe *r, int count, const double *points, double *truth) {
  ep_mesh rest, pose;
  ep_error err = {0};
  ep_tree *tree;
  stored(r->rest, &rest);
  stored(r->pose, &pose);
  assert_true(ep_mesh_same_connectivity(&rest, &pose));
  int *near = malloc((size_t)count * sizeof *near), *tet = malloc((size_t)count * sizeof *tet);
  double *weight = malloc(4 * (size_t)count * sizeof *weight);
  assert_true(near && tet && weight);
  for (int i = 0; i < count; i++) near[i] = -1;
  if (ep_tree_make(rest.nv, 3, rest.x, &tree, &err) != EP_OK) fail_msg("%s", err.text);
  ep_tree_nearest(tree, count, points, near);
  ep_tree_free(tree);
  if (ep_points_project(&rest, 3, rest.x, count, points, near, tet, weight, &err) != EP_OK)
    fail_msg("%s", err.text);
  // The surface of one mesh cuts the corners of the other's: what is left over turns along.
  for (int i = 0; i < count; i++)
    for (int c = 0; c < 3; c++) {
      double moved = 0;
      for (int k = 0; k < 4; k++) {
        const int v = rest.tet[4 * (size_t)tet[i] + k];
        moved +=
            weight[4 * (size_t)i + k] * (pose.x[3 * (size_t)v + c] - rest.x[3 * (size_t)v + c]);
      }
      truth[3 * i + c] = points[3 * i + c] + moved;
    }
  free(near);
  free(tet);
  free(weight);
  ep_mesh_free(&rest);
  ep_mesh_free(&pose);
}

bool pair_of_data(const data_recipe *r, int functions, truth_pair *out) {
  ep_mesh from, to;
  memset(out, 0, sizeof *out);
  out->name = r->name;
  if (r->from)
    stored(r->from, &from);
  else if (!made(r, &from))
    return false;
  stored(r->to, &to);
  const size_t bytes = 3 * (size_t)from.nv * sizeof(double);
  out->truth = malloc(bytes);
  assert_non_null(out->truth);
  memcpy(out->truth, from.x, bytes);
  if (r->pose) carry(r, from.nv, from.x, out->truth);
  for (int i = 0; i < from.nv && r->place; i++) r->place(from.x + 3 * i, out->truth + 3 * i);
  shape_from_mesh(&out->from, &from, functions);
  shape_from_mesh(&out->to, &to, functions);
  return true;
}
