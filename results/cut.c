#include "results/cut.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct cutter {
  const ep_mesh *mesh;
  const double *x, *height; // height (nv): signed distance to the plane, kept where <= 0
  ep_cut *cut;
  int vertices, triangles; // capacities
  int *slot, slots;        // open hash from an edge to the vertex cut out of it, -1 free
  ep_error *err;
} cutter;

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory to cut a mesh open");
}

static ep_status grow_vertices(cutter *c) {
  ep_cut *cut = c->cut;
  if (cut->nv < c->vertices) return EP_OK;
  const size_t n = c->vertices ? 2 * (size_t)c->vertices : 1024;
  double *x = realloc(cut->x, n * 3 * sizeof *x);
  if (x) cut->x = x;
  int *end = realloc(cut->end, n * 2 * sizeof *end);
  if (end) cut->end = end;
  double *share = realloc(cut->share, n * sizeof *share);
  if (share) cut->share = share;
  if (!x || !end || !share) return no_memory(c->err);
  c->vertices = (int)n;
  return EP_OK;
}

static ep_status grow_triangles(cutter *c) {
  ep_cut *cut = c->cut;
  if (cut->nt < c->triangles) return EP_OK;
  const size_t n = c->triangles ? 2 * (size_t)c->triangles : 1024;
  int *triangle = realloc(cut->triangle, n * 3 * sizeof *triangle);
  if (triangle) cut->triangle = triangle;
  unsigned char *hidden = realloc(cut->hidden, n);
  if (hidden) cut->hidden = hidden;
  if (!triangle || !hidden) return no_memory(c->err);
  c->triangles = (int)n;
  return EP_OK;
}

// The hash keeps its size at more than twice the number of entries.
static size_t slot_of(const cutter *c, int a, int b) {
  uint64_t key = ((uint64_t)(uint32_t)a << 32 | (uint32_t)b) * 0x9E3779B97F4A7C15u;
  size_t i = (size_t)(key >> 32) % (size_t)c->slots;
  while (c->slot[i] >= 0 &&
         (c->cut->end[2 * (size_t)c->slot[i]] != a || c->cut->end[2 * (size_t)c->slot[i] + 1] != b))
    i = i + 1 == (size_t)c->slots ? 0 : i + 1;
  return i;
}

static ep_status rehash(cutter *c) {
  if (2 * (c->cut->nv + 1) < c->slots) return EP_OK;
  const int slots = c->slots ? 4 * c->slots : 4096;
  free(c->slot);
  c->slot = malloc((size_t)slots * sizeof *c->slot);
  if (!c->slot) return no_memory(c->err);
  c->slots = slots;
  for (int i = 0; i < slots; i++) c->slot[i] = -1;
  for (int v = 0; v < c->cut->nv; v++)
    c->slot[slot_of(c, c->cut->end[2 * v], c->cut->end[2 * v + 1])] = v;
  return EP_OK;
}

// Vertex of the cut on edge a-b where it meets the plane, or the mesh vertex itself (a == b).
static ep_status vertex_on(cutter *c, int a, int b, int *vertex) {
  if (a > b) {
    const int swap = a;
    a = b;
    b = swap;
  }
  EP_TRY(rehash(c));
  const size_t at = slot_of(c, a, b);
  if (c->slot[at] >= 0) {
    *vertex = c->slot[at];
    return EP_OK;
  }
  EP_TRY(grow_vertices(c));
  ep_cut *cut = c->cut;
  const int v = cut->nv++;
  cut->end[2 * (size_t)v] = a;
  cut->end[2 * (size_t)v + 1] = b;
  cut->share[v] = a == b ? 0 : c->height[a] / (c->height[a] - c->height[b]);
  for (size_t k = 0; k < 3; k++)
    cut->x[3 * (size_t)v + k] =
        (1 - cut->share[v]) * c->x[3 * (size_t)a + k] + cut->share[v] * c->x[3 * (size_t)b + k];
  c->slot[at] = v;
  *vertex = v;
  return EP_OK;
}

// A convex polygon as a fan; edges inside the fan are hidden.
static ep_status add_polygon(cutter *c, int corners, const int *corner) {
  for (int i = 1; i + 1 < corners; i++) {
    EP_TRY(grow_triangles(c));
    int *t = c->cut->triangle + 3 * (size_t)c->cut->nt;
    t[0] = corner[0], t[1] = corner[i], t[2] = corner[i + 1];
    unsigned char hidden = 0;
    if (i > 1) hidden |= 4;           // edge 0-i, opposite corner 2
    if (i + 2 < corners) hidden |= 2; // edge 0-(i+1), opposite corner 1
    c->cut->hidden[c->cut->nt++] = hidden;
  }
  return EP_OK;
}

// Sutherland-Hodgman against the one plane.
static ep_status clip_triangle(cutter *c, const int *t) {
  int corner[4], corners = 0;
  for (int i = 0; i < 3; i++) {
    const int a = t[i], b = t[(i + 1) % 3];
    const bool in_a = c->height[a] <= 0, in_b = c->height[b] <= 0;
    if (in_a) EP_TRY(vertex_on(c, a, a, &corner[corners++]));
    if (in_a != in_b) EP_TRY(vertex_on(c, a, b, &corner[corners++]));
  }
  return corners >= 3 ? add_polygon(c, corners, corner) : EP_OK;
}

// The plane's section of a tet: three edges meet it, or four, taken in order round the section.
static ep_status cut_tet(cutter *c, const int *t, const double *normal) {
  int in[4], out[4], ins = 0, outs = 0, corner[4], corners = 0;
  for (int i = 0; i < 4; i++)
    if (c->height[t[i]] <= 0)
      in[ins++] = t[i];
    else
      out[outs++] = t[i];
  if (ins == 0 || outs == 0) return EP_OK;
  if (ins == 2) {
    const int order[4][2] = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
    for (int i = 0; i < 4; i++)
      EP_TRY(vertex_on(c, in[order[i][0]], out[order[i][1]], &corner[corners++]));
  } else {
    for (int i = 0; i < 3; i++)
      EP_TRY(vertex_on(c, in[ins == 1 ? 0 : i], out[outs == 1 ? 0 : i], &corner[corners++]));
  }
  double area = 0;
  for (int i = 1; i + 1 < corners; i++) {
    const double *p = c->cut->x + 3 * (size_t)corner[0], *q = c->cut->x + 3 * (size_t)corner[i];
    const double *r = c->cut->x + 3 * (size_t)corner[i + 1];
    for (int k = 0; k < 3; k++) {
      const int m = (k + 1) % 3, n = (k + 2) % 3;
      area += normal[k] * ((q[m] - p[m]) * (r[n] - p[n]) - (q[n] - p[n]) * (r[m] - p[m]));
    }
  }
  for (int i = 0; i < corners / 2 && area < 0; i++) { // turn it towards the normal
    const int swap = corner[i];
    corner[i] = corner[corners - 1 - i];
    corner[corners - 1 - i] = swap;
  }
  return add_polygon(c, corners, corner);
}

static ep_status cut_all(cutter *c, const double *normal) {
  int count, *triangle;
  EP_TRY(ep_mesh_surface(c->mesh, &count, &triangle, c->err));
  ep_status status = EP_OK;
  for (int t = 0; t < count && status == EP_OK; t++)
    status = clip_triangle(c, triangle + 3 * (size_t)t);
  free(triangle);
  c->cut->outer = c->cut->nt;
  for (int e = 0; e < c->mesh->nt && status == EP_OK; e++)
    status = cut_tet(c, c->mesh->tet + 4 * (size_t)e, normal);
  if (status == EP_OK && c->cut->nt == 0)
    status =
        ep_fail(c->err, EP_ERR_ARGUMENT, "the cutting plane leaves nothing of %s", c->mesh->name);
  return status;
}

ep_status ep_cut_mesh(const ep_mesh *mesh, const double *x, const double point[3],
                      const double normal[3], ep_cut *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  if (!x) x = mesh->x;
  const double length = hypot(hypot(normal[0], normal[1]), normal[2]);
  if (!(length > 0)) return ep_fail(err, EP_ERR_ARGUMENT, "the cutting plane's normal is zero");
  double *height = malloc((size_t)mesh->nv * sizeof *height);
  if (!height) return no_memory(err);
  for (size_t v = 0; v < (size_t)mesh->nv; v++) {
    height[v] = 0;
    for (size_t k = 0; k < 3; k++) height[v] += (x[3 * v + k] - point[k]) * normal[k] / length;
  }
  cutter c = {.mesh = mesh, .x = x, .height = height, .cut = out, .err = err};
  const ep_status status = cut_all(&c, normal);
  free(height);
  free(c.slot);
  if (status != EP_OK) ep_cut_free(out);
  return status;
}

void ep_cut_free(ep_cut *cut) {
  free(cut->x);
  free(cut->end);
  free(cut->share);
  free(cut->triangle);
  free(cut->hidden);
  memset(cut, 0, sizeof *cut);
}

void ep_cut_field(const ep_cut *cut, int components, const double *field, double *out) {
  const size_t width = (size_t)components;
  for (size_t v = 0; v < (size_t)cut->nv; v++)
    for (size_t k = 0; k < width; k++)
      out[v * width + k] = (1 - cut->share[v]) * field[(size_t)cut->end[2 * v] * width + k] +
                           cut->share[v] * field[(size_t)cut->end[2 * v + 1] * width + k];
}
