#include "reduced/bake/contact_tree.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

ep_status ep_surface_areas(const ep_mesh *mesh, double *area, ep_error *err) {
  int count, *triangle;
  EP_TRY(ep_mesh_surface(mesh, &count, &triangle, err));
  memset(area, 0, (size_t)mesh->nv * sizeof *area);
  for (int t = 0; t < count; t++) {
    const int *v = triangle + 3 * (size_t)t;
    double a[3], b[3], square = 0;
    for (int i = 0; i < 3; i++) {
      a[i] = mesh->x[3 * (size_t)v[1] + (size_t)i] - mesh->x[3 * (size_t)v[0] + (size_t)i];
      b[i] = mesh->x[3 * (size_t)v[2] + (size_t)i] - mesh->x[3 * (size_t)v[0] + (size_t)i];
    }
    for (int i = 0; i < 3; i++) {
      const double c = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
      square += c * c;
    }
    for (int i = 0; i < 3; i++) area[v[i]] += sqrt(square) / 6;
  }
  free(triangle);
  return EP_OK;
}

// ---- the order of the vertices -----------------------------------------------------------------

typedef struct sorted {
  double key;
  int vertex;
} sorted;

static int by_key(const void *a, const void *b) {
  const sorted *s = a, *t = b;
  if (s->key != t->key) return s->key < t->key ? -1 : 1;
  return (s->vertex > t->vertex) - (s->vertex < t->vertex);
}

typedef struct builder {
  const ep_mesh *mesh;
  ep_contact_tree *tree;
  sorted *work; // (contacts)
} builder;

static int longest_axis(const builder *b, int first, int end) {
  double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  int axis = 0;
  for (int i = first; i < end; i++)
    for (int a = 0; a < 3; a++) {
      const double x = b->mesh->x[3 * (size_t)b->tree->vertex[i] + (size_t)a];
      low[a] = fmin(low[a], x);
      high[a] = fmax(high[a], x);
    }
  for (int a = 1; a < 3; a++)
    if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
  return axis;
}

// Nodes in depth-first order; the depth is log2 of the vertices.
static void split(builder *b, int first, int end) {
  int *vertex = b->tree->vertex, *range = b->tree->range + 3 * (size_t)b->tree->nodes++;
  range[0] = first;
  range[1] = end;
  if (end - first > EP_CONTACT_LEAF) {
    const int axis = longest_axis(b, first, end), middle = first + (end - first) / 2;
    for (int i = first; i < end; i++)
      b->work[i] = (sorted){b->mesh->x[3 * (size_t)vertex[i] + (size_t)axis], vertex[i]};
    qsort(b->work + first, (size_t)(end - first), sizeof *b->work, by_key);
    for (int i = first; i < end; i++) vertex[i] = b->work[i].vertex;
    split(b, first, middle);
    split(b, middle, end);
  }
  range[2] = b->tree->nodes;
}

// ---- balls -------------------------------------------------------------------------------------

static void bound(ep_contact_tree *t, int node) {
  const int first = t->range[3 * node], end = t->range[3 * node + 1];
  const size_t r = (size_t)t->r, width = 3 * r;
  double *center = t->center + 3 * (size_t)node, *rows = t->node_u + (size_t)node * width;
  double *growth = t->growth + (size_t)node * r;
  for (int v = first; v < end; v++) {
    for (size_t i = 0; i < 3; i++) center[i] += t->x[3 * (size_t)v + i] / (end - first);
    for (size_t i = 0; i < width; i++) rows[i] += t->u[(size_t)v * width + i] / (end - first);
  }
  double most = 0;
  for (int v = first; v < end; v++) {
    double square = 0;
    for (size_t i = 0; i < 3; i++) {
      const double d = t->x[3 * (size_t)v + i] - center[i];
      square += d * d;
    }
    most = fmax(most, square);
    for (size_t k = 0; k < r; k++) {
      square = 0;
      for (size_t i = 0; i < 3; i++) {
        const double d = t->u[(size_t)v * width + i * r + k] - rows[i * r + k];
        square += d * d;
      }
      growth[k] = fmax(growth[k], sqrt(square));
    }
  }
  t->radius[node] = sqrt(most);
}

// ---- set-up ------------------------------------------------------------------------------------

static bool moves(int n, int r, const double *u, int v) {
  for (size_t k = 0; k < (size_t)r; k++)
    for (size_t i = 0; i < 3; i++)
      if (u[k * 3 * (size_t)n + 3 * (size_t)v + i] != 0) return true;
  return false;
}

static ep_status allocate(ep_contact_tree *t, ep_error *err) {
  const size_t n = (size_t)t->contacts, r = (size_t)t->r, nodes = 2 * n; // at most 2 n - 1
  t->x = calloc(3 * n, sizeof *t->x);
  t->area = calloc(n, sizeof *t->area);
  t->u = calloc(3 * n * r, sizeof *t->u);
  t->range = calloc(3 * nodes, sizeof *t->range);
  if (t->x && t->area && t->u && t->range) return EP_OK;
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the contact of %d vertices", t->contacts);
}

static ep_status allocate_balls(ep_contact_tree *t, ep_error *err) {
  const size_t nodes = (size_t)t->nodes, r = (size_t)t->r;
  t->center = calloc(3 * nodes, sizeof *t->center);
  t->node_u = calloc(3 * nodes * r, sizeof *t->node_u);
  t->radius = calloc(nodes, sizeof *t->radius);
  t->growth = calloc(nodes * r, sizeof *t->growth);
  if (t->center && t->node_u && t->radius && t->growth) return EP_OK;
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the contact tree of %d nodes", t->nodes);
}

static void gather(const ep_mesh *mesh, const double *u, const double *area, ep_contact_tree *t) {
  const size_t r = (size_t)t->r, n3 = 3 * (size_t)mesh->nv;
  for (int c = 0; c < t->contacts; c++) {
    const size_t v = (size_t)t->vertex[c];
    t->area[c] = area[v];
    for (size_t i = 0; i < 3; i++) {
      t->x[3 * (size_t)c + i] = mesh->x[3 * v + i];
      for (size_t k = 0; k < r; k++) t->u[(3 * (size_t)c + i) * r + k] = u[k * n3 + 3 * v + i];
    }
  }
}

static ep_status build(const ep_mesh *mesh, const double *u, double *area, ep_contact_tree *t,
                       ep_error *err) {
  EP_TRY(ep_surface_areas(mesh, area, err));
  t->vertex = malloc((size_t)mesh->nv * sizeof *t->vertex);
  if (!t->vertex) return ep_fail(err, EP_ERR_MEMORY, "no memory for the surface of %s", mesh->name);
  for (int v = 0; v < mesh->nv; v++)
    if (area[v] > 0 && moves(mesh->nv, t->r, u, v)) t->vertex[t->contacts++] = v;
  if (t->contacts == 0)
    return ep_fail(err, EP_ERR_ARGUMENT, "contact: no surface vertex of %s can move", mesh->name);
  EP_TRY(allocate(t, err));
  builder b = {.mesh = mesh, .tree = t, .work = malloc((size_t)t->contacts * sizeof(sorted))};
  if (!b.work) return ep_fail(err, EP_ERR_MEMORY, "no memory for the contact tree");
  split(&b, 0, t->contacts);
  free(b.work);
  gather(mesh, u, area, t);
  EP_TRY(allocate_balls(t, err));
  for (int i = 0; i < t->nodes; i++) bound(t, i);
  return EP_OK;
}

ep_status ep_contact_tree_build(const ep_mesh *mesh, int r, const double *u, ep_contact_tree *out,
                                ep_error *err) {
  *out = (ep_contact_tree){.r = r};
  double *area = calloc((size_t)mesh->nv, sizeof *area);
  ep_status status = area ? build(mesh, u, area, out, err)
                          : ep_fail(err, EP_ERR_MEMORY, "no memory for surface areas");
  free(area);
  if (status != EP_OK) ep_contact_tree_free(out);
  return status;
}

void ep_contact_tree_free(ep_contact_tree *t) {
  free(t->vertex);
  free(t->x);
  free(t->area);
  free(t->u);
  free(t->range);
  free(t->center);
  free(t->node_u);
  free(t->radius);
  free(t->growth);
  memset(t, 0, sizeof *t);
}
