#include "mesh/topology.h"

#include <stdlib.h>

#include "base/forest.h"
#include "mesh/faces.h"

// ---- faces -------------------------------------------------------------------------------------

static void note_overlap(ep_mesh_topology *out, const ep_face *f) {
  const int tet = f[0].id / 4;
  if (out->overlapping_faces++ && tet >= out->overlap_first) return;
  out->overlap_first = tet;
  out->overlap_second = f[1].id / 4;
}

static void find_overlaps(const ep_face *f, int count, ep_mesh_topology *out) {
  for (int i = 0, n; i < count; i += n) {
    n = ep_faces_alike(f, count, i);
    if (n > 2 || (n == 2 && f[i].even == f[i + 1].even)) note_overlap(out, f + i);
  }
}

// ---- the surface -------------------------------------------------------------------------------

typedef struct edge {
  int a, b;      // ascending vertices
  int corner[2]; // 3 triangle + corner of each
} edge;

static int compare_edges(const void *x, const void *y) {
  const edge *s = x, *t = y;
  if (s->a != t->a) return s->a < t->a ? -1 : 1;
  if (s->b != t->b) return s->b < t->b ? -1 : 1;
  return (s->corner[0] > t->corner[0]) - (s->corner[0] < t->corner[0]);
}

// Corners around a vertex are joined across the edges they share; a vertex with more than one group
// of corners is pinched. seen (nv) is -1, or -2 where a vertex is not to be counted, and receives
// the first group.
static void find_pinches(const int *triangle, int corners, int *parent, int *seen,
                         ep_mesh_topology *out) {
  for (int i = 0; i < corners; i++) {
    const int v = triangle[i], group = ep_forest_root(parent, i);
    if (seen[v] == -1) seen[v] = group;
    if (seen[v] < 0 || seen[v] == group) continue;
    seen[v] = -2; // counted once
    if (out->pinched_vertices++ == 0 || v < out->first_pinched) out->first_pinched = v;
  }
}

static void walk_surface(const int *triangle, int triangles, edge *e, int *parent, int *seen,
                         int nv, ep_mesh_topology *out) {
  const int corners = 3 * triangles;
  for (int i = 0; i < corners; i++) {
    const int next = i % 3 == 2 ? i - 2 : i + 1, a = triangle[i], b = triangle[next];
    e[i] = a < b ? (edge){a, b, {i, next}} : (edge){b, a, {next, i}};
  }
  ep_forest_start(parent, corners);
  for (int v = 0; v < nv; v++) seen[v] = -1;
  qsort(e, (size_t)corners, sizeof *e, compare_edges);
  for (int i = 0, n; i < corners; i += n) {
    for (n = 1; i + n < corners && e[i + n].a == e[i].a && e[i + n].b == e[i].b;) n++;
    if (n == 2) {
      ep_forest_join(parent, e[i].corner[0], e[i + 1].corner[0]);
      ep_forest_join(parent, e[i].corner[1], e[i + 1].corner[1]);
      continue;
    }
    seen[e[i].a] = seen[e[i].b] = -2; // told with the edge
    if (out->open_edges++) continue;
    out->open_edge[0] = e[i].a;
    out->open_edge[1] = e[i].b;
  }
  find_pinches(triangle, corners, parent, seen, out);
}

static ep_status examine_surface(const ep_mesh *mesh, ep_mesh_topology *out, ep_error *err) {
  int triangles, *triangle;
  EP_TRY(ep_mesh_surface(mesh, &triangles, &triangle, err));
  const size_t corners = 3 * (size_t)triangles + 1;
  edge *e = malloc(corners * sizeof *e);
  int *parent = malloc(corners * sizeof *parent), *seen = malloc((size_t)mesh->nv * sizeof *seen);
  ep_status status = EP_OK;
  if (e && parent && seen)
    walk_surface(triangle, triangles, e, parent, seen, mesh->nv, out);
  else
    status = ep_fail(err, EP_ERR_MEMORY, "no memory to check the surface of %s", mesh->name);
  free(e);
  free(parent);
  free(seen);
  free(triangle);
  return status;
}

ep_status ep_mesh_examine(const ep_mesh *mesh, ep_mesh_topology *out, ep_error *err) {
  *out = (ep_mesh_topology){
      .overlap_first = -1, .overlap_second = -1, .open_edge = {-1, -1}, .first_pinched = -1};
  ep_face *f = ep_mesh_faces(mesh);
  if (!f) return ep_fail(err, EP_ERR_MEMORY, "no memory to check the faces of %s", mesh->name);
  find_overlaps(f, 4 * mesh->nt, out);
  free(f);
  return examine_surface(mesh, out, err);
}

// ---- parts -------------------------------------------------------------------------------------

int ep_mesh_join_tets(const ep_mesh *mesh, int *parent) {
  int parts = mesh->nv;
  ep_forest_start(parent, mesh->nv);
  for (int i = 0; i < 4 * mesh->nt; i++)
    parts -= ep_forest_join(parent, mesh->tet[i], mesh->tet[i - i % 4]);
  return parts;
}

typedef struct counted {
  int root, tets;
} counted;

static int compare_counted(const void *a, const void *b) {
  const counted *s = a, *t = b;
  if (s->tets != t->tets) return s->tets > t->tets ? -1 : 1;
  return (s->root > t->root) - (s->root < t->root);
}

// Numbers the parts by size; place (nv) is scratch.
static void number_parts(const ep_mesh *mesh, int *parent, int *place, counted *list, int *part,
                         int *size, int *parts) {
  for (int v = 0; v < mesh->nv; v++) place[v] = -1;
  *parts = 0;
  for (int e = 0; e < mesh->nt; e++) {
    const int root = ep_forest_root(parent, mesh->tet[4 * e]);
    if (place[root] < 0) {
      place[root] = *parts;
      list[(*parts)++] = (counted){.root = root};
    }
    list[place[root]].tets++;
  }
  qsort(list, (size_t)*parts, sizeof *list, compare_counted);
  for (int i = 0; i < *parts; i++) {
    place[list[i].root] = i;
    size[i] = list[i].tets;
  }
  for (int e = 0; e < mesh->nt; e++) part[e] = place[ep_forest_root(parent, mesh->tet[4 * e])];
}

ep_status ep_mesh_parts(const ep_mesh *mesh, int *part, int *size, int *parts, ep_error *err) {
  int *parent = malloc((size_t)mesh->nv * sizeof *parent);
  int *place = malloc((size_t)mesh->nv * sizeof *place);
  counted *list = malloc((size_t)mesh->nt * sizeof *list);
  ep_status status = EP_OK;
  if (parent && place && list) {
    ep_mesh_join_tets(mesh, parent);
    number_parts(mesh, parent, place, list, part, size, parts);
  } else {
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for the parts of %s", mesh->name);
  }
  free(parent);
  free(place);
  free(list);
  return status;
}
