#include "mesh/repair.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/forest.h"
#include "mesh/check.h"
#include "mesh/raw.h"
#include "mesh/topology.h"

// ---- places ------------------------------------------------------------------------------------

typedef struct point {
  double x[3];
  int v;
} point;

static int compare(double a, double b, int v, int w) {
  return a < b ? -1 : a > b ? 1 : (v > w) - (v < w);
}
static int by_x(const void *a, const void *b) {
  const point *s = a, *t = b;
  return compare(s->x[0], t->x[0], s->v, t->v);
}
static int by_y(const void *a, const void *b) {
  const point *s = a, *t = b;
  return compare(s->x[1], t->x[1], s->v, t->v);
}
static int by_z(const void *a, const void *b) {
  const point *s = a, *t = b;
  return compare(s->x[2], t->x[2], s->v, t->v);
}

// Runs of points whose coordinates follow each other within `near`, one axis after the other; what
// is still together behind the last is one place.
static void join_runs(point *p, int count, int axis, double near, int *first) {
  static int (*const order[3])(const void *, const void *) = {by_x, by_y, by_z};
  for (int i = 1; i < count && axis == 3; i++) ep_forest_join(first, p[0].v, p[i].v);
  if (axis == 3 || count < 2) return;
  qsort(p, (size_t)count, sizeof *p, order[axis]);
  for (int i = 0, n; i < count; i += n) {
    for (n = 1; i + n < count && p[i + n].x[axis] - p[i + n - 1].x[axis] <= near;) n++;
    join_runs(p + i, n, axis + 1, near, first);
  }
}

ep_status ep_mesh_same_places(const ep_mesh *mesh, int *first, int *count, ep_error *err) {
  point *p = malloc((size_t)mesh->nv * sizeof *p);
  if (!p) return ep_fail(err, EP_ERR_MEMORY, "no memory to check the mesh %s", mesh->name);
  for (int v = 0; v < mesh->nv; v++) {
    memcpy(p[v].x, mesh->x + 3 * (size_t)v, sizeof p[v].x);
    p[v].v = v;
  }
  ep_forest_start(first, mesh->nv);
  join_runs(p, mesh->nv, 0, EP_SAME_PLACE * ep_mesh_diagonal(mesh), first);
  *count = 0;
  for (int v = 0; v < mesh->nv; v++) {
    first[v] = ep_forest_root(first, v);
    *count += first[v] != v;
  }
  free(p);
  return EP_OK;
}

// ---- repair ------------------------------------------------------------------------------------

static bool degenerate(const ep_mesh *mesh, const int *v) {
  double g[12];
  const ep_mesh one = {.nt = 1, .x = mesh->x, .tet = (int *)v};
  return ep_tet_degenerate(mesh->x, v, ep_tet_gradients(&one, 0, g));
}

static bool copy_double(const double *from, size_t count, double **to) {
  *to = malloc((count + 1) * sizeof **to);
  if (*to) memcpy(*to, from, count * sizeof **to);
  return *to != NULL;
}

// Everything but the tets.
static ep_status copy_rest(const ep_mesh *mesh, ep_raw_mesh *raw, ep_error *err) {
  const size_t nv = (size_t)mesh->nv, nmaterials = (size_t)mesh->nmaterials;
  raw->nv = mesh->nv;
  bool good = copy_double(mesh->x, 3 * nv, &raw->x);
  raw->tet_material = mesh->tet_material ? malloc((size_t)mesh->nt * sizeof(int)) : NULL;
  raw->material = nmaterials ? malloc(nmaterials * sizeof *raw->material) : NULL;
  good &= raw->tet_material || !mesh->tet_material;
  good &= raw->material || !nmaterials;
  if (raw->material) memcpy(raw->material, mesh->material, nmaterials * sizeof *raw->material);
  raw->nmaterials = mesh->nmaterials;
  if (!good) return ep_fail(err, EP_ERR_MEMORY, "no memory to repair %s", mesh->name);
  for (int i = 0; i < mesh->ndata; i++) {
    const ep_point_data *data = &mesh->data[i];
    double *value;
    const ep_token name = {data->name, (int)strlen(data->name)};
    EP_TRY(ep_raw_data(raw, name, data->components, &value, err));
    if (value) memcpy(value, data->value, nv * sizeof *value);
  }
  return EP_OK;
}

// The tets with joined vertices and volume; of one part only where part is given.
static ep_status copy_tets(const ep_mesh *mesh, const int *first, const int *part, ep_raw_mesh *raw,
                           ep_mesh_repairs *repairs, ep_error *err) {
  for (int e = 0; e < mesh->nt; e++) {
    int v[4];
    for (int i = 0; i < 4; i++) v[i] = first[mesh->tet[4 * (size_t)e + (size_t)i]];
    if (part && part[e] > 0) continue;
    if (degenerate(mesh, v)) {
      repairs->degenerate_tets++;
      continue;
    }
    if (raw->tet_material) raw->tet_material[raw->nt] = mesh->tet_material[e];
    EP_TRY(ep_raw_tet(raw, v, err));
  }
  return EP_OK;
}

static ep_status join_and_drop(const ep_mesh *mesh, ep_mesh_repairs *repairs, ep_mesh *out,
                               ep_mesh_findings *f, ep_error *err) {
  ep_raw_mesh raw = {.name = mesh->name};
  int *first = malloc((size_t)mesh->nv * sizeof *first);
  ep_status status =
      first ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory to repair %s", mesh->name);
  if (status == EP_OK) status = ep_mesh_same_places(mesh, first, &repairs->merged_vertices, err);
  if (status == EP_OK) status = copy_rest(mesh, &raw, err);
  if (status == EP_OK) status = copy_tets(mesh, first, NULL, &raw, repairs, err);
  free(first);
  if (status == EP_OK) return ep_raw_finish(&raw, out, f, err);
  ep_raw_free(&raw);
  return status;
}

// Replaces *mesh by its largest part.
static ep_status keep_largest(ep_mesh *mesh, ep_mesh_repairs *repairs, ep_mesh_findings *f,
                              ep_error *err) {
  ep_raw_mesh raw = {.name = mesh->name};
  ep_mesh kept;
  int parts;
  int *part = malloc(2 * (size_t)mesh->nt * sizeof *part);
  int *same = malloc((size_t)mesh->nv * sizeof *same);
  ep_status status =
      part && same ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory to repair %s", mesh->name);
  if (status == EP_OK) ep_forest_start(same, mesh->nv);
  if (status == EP_OK) status = ep_mesh_parts(mesh, part, part + mesh->nt, &parts, err);
  if (status == EP_OK) status = copy_rest(mesh, &raw, err);
  if (status == EP_OK) status = copy_tets(mesh, same, part, &raw, repairs, err);
  if (status == EP_OK) {
    repairs->left_out_parts = parts - 1;
    repairs->left_out_tets = mesh->nt - raw.nt;
    status = ep_raw_finish(&raw, &kept, f, err);
  } else {
    ep_raw_free(&raw);
  }
  free(part);
  free(same);
  if (status != EP_OK) return status;
  ep_mesh_free(mesh);
  *mesh = kept;
  return EP_OK;
}

ep_status ep_mesh_repair(const ep_mesh *mesh, ep_mesh_repairs *repairs, ep_mesh *out,
                         ep_mesh_findings *findings, ep_error *err) {
  ep_mesh_findings f;
  *repairs = (ep_mesh_repairs){.largest_only = repairs->largest_only};
  EP_TRY(join_and_drop(mesh, repairs, out, &f, err));
  repairs->repeated_tets = f.repeated_tets;
  if (repairs->largest_only && f.components > 1) {
    const ep_status status = keep_largest(out, repairs, &f, err);
    if (status != EP_OK) {
      ep_mesh_free(out);
      return status;
    }
  }
  if (findings) *findings = f;
  return EP_OK;
}
