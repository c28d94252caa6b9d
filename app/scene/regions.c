#include "app/scene/regions.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/select.h"

static double falloff(double t) {
  return t >= 1 ? 0 : 1 - t * t * (3 - 2 * t);
}

// ---- distance along edges: Dijkstra's algorithm with a binary heap -----------------------------

typedef struct heap {
  int count, *vertex, *place; // place (nv): in the heap, -1 before and after
  double *distance;           // (nv)
} heap;

static void put(heap *h, int at, int vertex) {
  h->vertex[at] = vertex;
  h->place[vertex] = at;
}

static void rise(heap *h, int at) {
  const int vertex = h->vertex[at];
  for (; at > 0; at = (at - 1) / 2) {
    const int above = h->vertex[(at - 1) / 2];
    if (h->distance[above] <= h->distance[vertex]) break;
    put(h, at, above);
  }
  put(h, at, vertex);
}

static void sink(heap *h, int at) {
  const int vertex = h->vertex[at];
  for (int child = 2 * at + 1; child < h->count; child = 2 * at + 1) {
    if (child + 1 < h->count && h->distance[h->vertex[child + 1]] < h->distance[h->vertex[child]])
      child++;
    if (h->distance[vertex] <= h->distance[h->vertex[child]]) break;
    put(h, at, h->vertex[child]);
    at = child;
  }
  put(h, at, vertex);
}

static int take_nearest(heap *h) {
  const int vertex = h->vertex[0], last = h->vertex[--h->count];
  h->place[vertex] = -1;
  if (h->count > 0) {
    put(h, 0, last);
    sink(h, 0);
  }
  return vertex;
}

static void reach(heap *h, int vertex, double distance) {
  if (distance >= h->distance[vertex]) return;
  h->distance[vertex] = distance;
  if (h->place[vertex] < 0) put(h, h->count++, vertex);
  rise(h, h->place[vertex]);
}

static double edge_length(const ep_mesh *mesh, int a, int b) {
  double square = 0;
  for (int i = 0; i < 3; i++) {
    const double d = mesh->x[3 * (size_t)a + (size_t)i] - mesh->x[3 * (size_t)b + (size_t)i];
    square += d * d;
  }
  return sqrt(square);
}

// The tets around each vertex: those of v are tet[start[v]] .. tet[start[v + 1] - 1].
static void tets_around(const ep_mesh *mesh, int *start, int *tet) {
  memset(start, 0, ((size_t)mesh->nv + 1) * sizeof *start);
  for (int i = 0; i < 4 * mesh->nt; i++) start[mesh->tet[i] + 1]++;
  for (int v = 0; v < mesh->nv; v++) start[v + 1] += start[v];
  for (int i = 0; i < 4 * mesh->nt; i++) tet[start[mesh->tet[i]]++] = i / 4;
  for (int v = mesh->nv; v > 0; v--) start[v] = start[v - 1];
  start[0] = 0;
}

static void reach_neighbours(const ep_mesh *mesh, heap *h, int v, int tet, double most) {
  for (int i = 0; i < 4; i++) {
    const int w = mesh->tet[4 * (size_t)tet + (size_t)i];
    const double next = h->distance[v] + edge_length(mesh, v, w);
    if (next < most) reach(h, w, next);
  }
}

// Distance of all vertices nearer than `most` from the chosen ones; HUGE_VAL beyond.
static ep_status spread(const ep_mesh *mesh, const unsigned char *chosen, double most,
                        double *distance, ep_error *err) {
  const size_t nv = (size_t)mesh->nv, nt = (size_t)mesh->nt;
  int *memory = malloc((3 * nv + 1 + 4 * nt) * sizeof *memory);
  if (!memory) return ep_fail(err, EP_ERR_MEMORY, "no memory for a region");
  heap h = {.vertex = memory, .place = memory + nv, .distance = distance};
  int *start = memory + 2 * nv, *around = start + nv + 1;
  tets_around(mesh, start, around);
  for (int v = 0; v < mesh->nv; v++) h.place[v] = -1, distance[v] = HUGE_VAL;
  for (int v = 0; v < mesh->nv; v++)
    if (chosen[v]) reach(&h, v, 0);
  while (h.count > 0) {
    const int v = take_nearest(&h);
    for (int i = start[v]; i < start[v + 1]; i++) reach_neighbours(mesh, &h, v, around[i], most);
  }
  free(memory);
  return EP_OK;
}

// ---- weights -----------------------------------------------------------------------------------

static ep_status distances(const ep_scene_region *region, const ep_mesh *mesh,
                           const unsigned char *chosen, double *out, ep_error *err) {
  if (region->where.path) return spread(mesh, chosen, region->soft, out, err);
  for (int v = 0; v < mesh->nv; v++)
    out[v] = ep_select_distance(&region->where, mesh->x + 3 * (size_t)v);
  return EP_OK;
}

ep_status ep_region_weights(const ep_scene_region *region, const ep_mesh *mesh, double *weight,
                            ep_error *err) {
  int count;
  unsigned char *chosen = calloc((size_t)mesh->nv, 1);
  if (!chosen) return ep_fail(err, EP_ERR_MEMORY, "no memory for a region");
  ep_status status = ep_select_vertices(&region->where, mesh, chosen, &count, err);
  if (status == EP_OK && region->soft > 0) status = distances(region, mesh, chosen, weight, err);
  for (int v = 0; status == EP_OK && v < mesh->nv; v++)
    weight[v] = chosen[v] ? 1 : region->soft > 0 ? falloff(weight[v] / region->soft) : 0;
  free(chosen);
  return status;
}

void ep_region_shares(const ep_mesh *mesh, const double *weight, double *out) {
  for (size_t e = 0; e < (size_t)mesh->nt; e++) {
    double sum = weight ? 0 : 4;
    for (int v = 0; weight && v < 4; v++) sum += weight[mesh->tet[4 * e + (size_t)v]];
    out[e] = 0.25 * sum;
  }
}
