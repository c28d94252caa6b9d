#include "app/scene/obstacle_mesh.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

// Circles of a sphere, and points on each.
enum { RINGS = 15, AROUND = 32, SPHERE_VERTICES = RINGS * AROUND + 3 };
static const double pi = 3.14159265358979323846;

// A body under construction: its centre is the first vertex, every surface triangle makes a tet
// with it.
typedef struct body {
  int nv, nt; // of all bodies so far
  double *x;  // (nv x 3)
  int *tet;   // (nt x 4)
  int center; // first vertex of this body
} body;

static int vertex(body *b, double x, double y, double z) {
  double *to = b->x + 3 * (size_t)b->nv;
  to[0] = x, to[1] = y, to[2] = z;
  return b->nv++;
}

static void face(body *b, int i, int j, int k) {
  int *to = b->tet + 4 * (size_t)b->nt++;
  to[0] = b->center, to[1] = i, to[2] = j, to[3] = k;
}

static void add_box(body *b, const double low[3], const double high[3]) {
  static const int quad[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                 {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
  b->center = vertex(b, (low[0] + high[0]) / 2, (low[1] + high[1]) / 2, (low[2] + high[2]) / 2);
  const int first = b->nv;
  for (int c = 0; c < 8; c++)
    vertex(b, c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]);
  for (int q = 0; q < 6; q++) {
    face(b, first + quad[q][0], first + quad[q][1], first + quad[q][2]);
    face(b, first + quad[q][0], first + quad[q][2], first + quad[q][3]);
  }
}

static void add_sphere(body *b, double radius) {
  b->center = vertex(b, 0, 0, 0);
  const int south = vertex(b, 0, 0, -radius), north = vertex(b, 0, 0, radius), first = b->nv;
  for (int i = 0; i < RINGS; i++)
    for (int j = 0; j < AROUND; j++) {
      const double up = pi * ((i + 1.0) / (RINGS + 1) - 0.5), along = 2 * pi * j / AROUND;
      vertex(b, radius * cos(up) * cos(along), radius * cos(up) * sin(along), radius * sin(up));
    }
  for (int j = 0; j < AROUND; j++) {
    const int next = (j + 1) % AROUND, last = first + (RINGS - 1) * AROUND;
    face(b, south, first + next, first + j);
    face(b, north, last + j, last + next);
    for (int i = 0; i + 1 < RINGS; i++) {
      const int at = first + i * AROUND;
      face(b, at + j, at + next, at + AROUND + next);
      face(b, at + j, at + AROUND + next, at + AROUND + j);
    }
  }
}

// A slab under the plane, as wide as what is shown.
static void add_plane(body *b, const ep_scene_obstacle *o, const double low[3],
                      const double high[3]) {
  double from[3] = {INFINITY, INFINITY, 0}, to[3] = {-INFINITY, -INFINITY, 0}, square = 0;
  for (int i = 0; i < 3; i++) square += (high[i] - low[i]) * (high[i] - low[i]);
  for (int corner = 0; corner < 8; corner++) {
    const double x[3] = {corner & 1 ? high[0] : low[0], corner & 2 ? high[1] : low[1],
                         corner & 4 ? high[2] : low[2]};
    double local[3];
    ep_obstacle_to_local(&o->at, x, local);
    for (int i = 0; i < 2; i++) {
      from[i] = fmin(from[i], local[i]);
      to[i] = fmax(to[i], local[i]);
    }
  }
  const double margin = 0.06 * sqrt(square);
  for (int i = 0; i < 2; i++) {
    from[i] -= margin;
    to[i] += margin;
  }
  from[2] = -0.02 * sqrt(square);
  add_box(b, from, to);
}

static void add(body *b, const ep_scene_obstacle *o, const double low[3], const double high[3]) {
  const double negative[3] = {-o->size[0], -o->size[1], -o->size[2]};
  if (o->kind == EP_OBSTACLE_PLANE) add_plane(b, o, low, high);
  if (o->kind == EP_OBSTACLE_SPHERE) add_sphere(b, o->size[0]);
  if (o->kind == EP_OBSTACLE_BOX) add_box(b, negative, o->size);
}

static ep_status make_surface(const ep_scene *scene, ep_solids *out, ep_error *err) {
  EP_TRY(ep_mesh_surface(&out->mesh, &out->triangles, &out->triangle, err));
  int at = 0; // triangles come in the order of the tets, hence of the obstacles
  for (int i = 0; i < scene->nobstacles; i++) {
    out->first_triangle[i] = at;
    while (at < out->triangles && out->triangle[3 * (size_t)at] < out->first[i + 1]) at++;
  }
  out->first_triangle[scene->nobstacles] = at;
  return EP_OK;
}

ep_status ep_solids_make(const ep_scene *scene, const double low[3], const double high[3],
                         ep_solids *out, ep_error *err) {
  const size_t count = (size_t)scene->nobstacles;
  memset(out, 0, sizeof *out);
  if (!count) return EP_OK;
  body b = {.x = malloc(count * 3 * SPHERE_VERTICES * sizeof(double)),
            .tet = malloc(count * 8 * SPHERE_VERTICES * sizeof(int))};
  out->first = calloc(count + 1, sizeof *out->first);
  out->first_triangle = calloc(count + 1, sizeof *out->first_triangle);
  ep_status status = EP_OK;
  if (!b.x || !b.tet || !out->first || !out->first_triangle)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory to draw the obstacles");
  for (size_t i = 0; i < count && status == EP_OK; i++) {
    out->first[i] = b.nv;
    add(&b, &scene->obstacle[i], low, high);
    out->first[i + 1] = b.nv;
  }
  if (status == EP_OK)
    status = ep_mesh_make(b.nv, b.x, b.nt, b.tet, "obstacles", &out->mesh, NULL, err);
  if (status == EP_OK) status = make_surface(scene, out, err);
  free(b.x);
  free(b.tet);
  if (status != EP_OK) ep_solids_free(out);
  return status;
}

void ep_solids_free(ep_solids *solids) {
  ep_mesh_free(&solids->mesh);
  free(solids->first);
  free(solids->first_triangle);
  free(solids->triangle);
  memset(solids, 0, sizeof *solids);
}

void ep_solids_place(const ep_scene *scene, const ep_solids *solids, double t, double *x) {
  for (int i = 0; i < scene->nobstacles; i++) {
    ep_frame pose;
    ep_obstacle_pose(&scene->obstacle[i], t, &pose);
    for (int v = solids->first[i]; v < solids->first[i + 1]; v++)
      ep_obstacle_to_world(&pose, solids->mesh.x + 3 * (size_t)v, x + 3 * (size_t)v);
  }
}
