#include "app/scene/obstacle_start.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/obstacles.h"

typedef struct overlap {
  int obstacle, vertices, vertex; // how many stand in it; the deepest one
  double depth;
} overlap;

// Where contact acts: 1 for vertices of the surface that are not fixed, acts (nv).
static ep_status find_acting(const ep_shapes *shapes, unsigned char *acts, ep_error *err) {
  int count, *triangle;
  EP_TRY(ep_mesh_surface(&shapes->shape[0].mesh, &count, &triangle, err));
  for (int i = 0; i < 3 * count; i++) acts[triangle[i]] = 1;
  for (int i = 0; i < shapes->nfixed; i++) acts[shapes->fixed[i]] = 0;
  free(triangle);
  return EP_OK;
}

// Positions at time 0, x (3 nv), as ep_free_start places a free object: c + R (X - X_0), X_0 its
// centre of mass. mass (nv): scratch.
static void place_at_start(const ep_scene *scene, const ep_shapes *shapes, double *mass,
                           double *x) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  const size_t nv = (size_t)mesh->nv;
  memcpy(x, mesh->x, 3 * nv * sizeof *x);
  if (shapes->nfixed) return;
  double middle[3] = {0, 0, 0}, all = 0, R[9];
  ep_shapes_vertex_mass(shapes, mass);
  for (size_t v = 0; v < nv; v++) all += mass[v];
  for (size_t i = 0; i < 3 * nv; i++) middle[i % 3] += mass[i / 3] / all * x[i];
  const double *c = scene->start.placed ? scene->start.position : middle;
  ep_turn_matrix(&scene->start.rotation, R);
  for (size_t v = 0; v < nv; v++) {
    const double *X = mesh->x + 3 * v;
    const double d[3] = {X[0] - middle[0], X[1] - middle[1], X[2] - middle[2]};
    for (size_t i = 0; i < 3; i++)
      x[3 * v + i] = c[i] + R[3 * i] * d[0] + R[3 * i + 1] * d[1] + R[3 * i + 2] * d[2];
  }
}

static overlap measure(const ep_obstacle *obstacle, int number, int nv, const unsigned char *acts,
                       const double *x) {
  overlap out = {.obstacle = number, .vertex = -1};
  for (int v = 0; v < nv; v++) {
    double local[3], normal[3];
    if (!acts[v]) continue;
    ep_obstacle_to_local(&obstacle->start, x + 3 * (size_t)v, local);
    const double depth = -ep_obstacle_distance(obstacle, local, normal);
    if (!(depth > 0)) continue;
    out.vertices++;
    if (depth > out.depth) out.depth = depth, out.vertex = v;
  }
  return out;
}

static ep_status refuse(const ep_scene *scene, const ep_mesh *mesh, const overlap *worst,
                        const double *x, double most, ep_error *err) {
  static const char *const names[] = {
      [EP_OBSTACLE_PLANE] = "plane", [EP_OBSTACLE_SPHERE] = "sphere", [EP_OBSTACLE_BOX] = "box"};
  const ep_scene_obstacle *o = &scene->obstacle[worst->obstacle];
  const double *at = x + 3 * (size_t)worst->vertex;
  return ep_fail(
      err, EP_ERR_SCENE,
      "%s%s: the object starts %.3g m deep in this %s: %d vert%s of its surface, the "
      "deepest vertex %d at (%.4g, %.4g, %.4g). Contact pushes out at most %.3g m (%g %% "
      "of the object's extent): move the obstacle away%s, or bring it in by `motion`",
      scene->path, o->place, worst->depth, names[o->kind], worst->vertices,
      worst->vertices > 1 ? "ices" : "ex", mesh->file_vertex[worst->vertex] + 1, at[0], at[1],
      at[2], most, 100 * EP_OVERLAP_MOST,
      scene->nfixed ? "" : " or the object by `start.position`");
}

static ep_status check(const ep_scene *scene, const ep_shapes *shapes, ep_obstacle *obstacle,
                       unsigned char *acts, double *x, ep_error *err) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  const double extent = ep_mesh_extent(mesh), most = EP_OVERLAP_MOST * extent;
  overlap worst = {.vertex = -1};
  EP_TRY(find_acting(shapes, acts, err));
  place_at_start(scene, shapes, x + 3 * (size_t)mesh->nv, x);
  ep_obstacles_make(scene, extent, obstacle);
  for (int i = 0; i < scene->nobstacles; i++) {
    const overlap here = measure(&obstacle[i], i, mesh->nv, acts, x);
    if (here.depth > worst.depth) worst = here;
  }
  return worst.depth > most ? refuse(scene, mesh, &worst, x, most, err) : EP_OK;
}

ep_status ep_obstacles_check_start(const ep_scene *scene, const ep_shapes *shapes, ep_error *err) {
  const size_t nv = (size_t)shapes->shape[0].mesh.nv;
  if (!scene->nobstacles) return EP_OK;
  ep_obstacle *obstacle = calloc((size_t)scene->nobstacles, sizeof *obstacle);
  unsigned char *acts = calloc(nv, 1);
  double *x = malloc(4 * nv * sizeof *x);
  const ep_status status = obstacle && acts && x
                               ? check(scene, shapes, obstacle, acts, x, err)
                               : ep_fail(err, EP_ERR_MEMORY, "no memory for the obstacles");
  free(obstacle);
  free(acts);
  free(x);
  return status;
}
