#include "mesh/check.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/topology.h"

bool ep_tet_degenerate(const double *x, const int *v, double volume) {
  double longest = 0;
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < i; j++) {
      const double *a = x + 3 * (size_t)v[i], *b = x + 3 * (size_t)v[j];
      const double d = hypot(hypot(a[0] - b[0], a[1] - b[1]), a[2] - b[2]);
      if (v[i] == v[j]) return true;
      if (d > longest) longest = d;
    }
  // Negated so that volumes lost to underflow count as degenerate.
  return !(fabs(volume) > EP_DEGENERATE_VOLUME * longest * longest * longest);
}

static void swap_int(int *a, int *b) {
  const int kept = *a;
  *a = *b;
  *b = kept;
}

static ep_status check_tets(ep_mesh *mesh, ep_mesh_findings *f, ep_error *err) {
  double *volume = malloc((size_t)mesh->nt * sizeof *volume);
  if (!volume) return ep_fail(err, EP_ERR_MEMORY, "no memory to check the mesh %s", mesh->name);
  ep_tet_volumes(mesh, mesh->x, volume);
  for (int e = 0; e < mesh->nt; e++) {
    int *v = mesh->tet + 4 * e;
    const bool degenerate = ep_tet_degenerate(mesh->x, v, volume[e]);
    if (degenerate && f->degenerate_tets++ == 0) f->first_degenerate = e;
    if (!(volume[e] < 0)) continue;
    swap_int(v + 2, v + 3);
    if (!degenerate && f->repaired_orientation++ == 0) f->first_inverted = e;
  }
  free(volume);
  return EP_OK;
}

typedef struct sorted_tet {
  int v[4], e;
} sorted_tet;

static int compare_tets(const void *a, const void *b) {
  const sorted_tet *s = a, *t = b;
  for (int i = 0; i < 4; i++)
    if (s->v[i] != t->v[i]) return s->v[i] < t->v[i] ? -1 : 1;
  return (s->e > t->e) - (s->e < t->e);
}

static sorted_tet sort_vertices(const int *v, int e) {
  sorted_tet t = {{v[0], v[1], v[2], v[3]}, e};
  for (int i = 1; i < 4; i++)
    for (int j = i; j > 0 && t.v[j] < t.v[j - 1]; j--) swap_int(t.v + j, t.v + j - 1);
  return t;
}

static void leave_out(ep_mesh *mesh, const bool *repeated) {
  int kept = 0;
  for (int e = 0; e < mesh->nt; e++) {
    if (repeated[e]) continue;
    memmove(mesh->tet + 4 * kept, mesh->tet + 4 * e, 4 * sizeof(int));
    if (mesh->tet_material) mesh->tet_material[kept] = mesh->tet_material[e];
    kept++;
  }
  mesh->nt = kept;
}

// Gmsh 2.2 files list a tet once for each physical group it belongs to: keep the first.
static ep_status drop_repeated(ep_mesh *mesh, ep_mesh_findings *f, ep_error *err) {
  sorted_tet *sorted = malloc((size_t)mesh->nt * sizeof *sorted);
  bool *repeated = calloc((size_t)mesh->nt, sizeof *repeated);
  if (!sorted || !repeated) {
    free(sorted);
    free(repeated);
    return ep_fail(err, EP_ERR_MEMORY, "no memory to check the mesh %s", mesh->name);
  }
  for (int e = 0; e < mesh->nt; e++) sorted[e] = sort_vertices(mesh->tet + 4 * e, e);
  qsort(sorted, (size_t)mesh->nt, sizeof *sorted, compare_tets);
  for (int i = 1; i < mesh->nt; i++) {
    if (memcmp(sorted[i].v, sorted[i - 1].v, sizeof sorted[i].v) != 0) continue;
    const int e = sorted[i].e;
    repeated[e] = true;
    if (f->repeated_tets++ == 0 || e < f->first_repeated) f->first_repeated = e;
  }
  if (f->repeated_tets) leave_out(mesh, repeated);
  free(sorted);
  free(repeated);
  return EP_OK;
}

typedef struct sorted_point {
  double x[3];
  int i;
} sorted_point;

static int compare_points(const void *a, const void *b) {
  const sorted_point *s = a, *t = b;
  for (int k = 0; k < 3; k++)
    if (s->x[k] != t->x[k]) return s->x[k] < t->x[k] ? -1 : 1;
  return (s->i > t->i) - (s->i < t->i);
}

static bool same_point(const sorted_point *a, const sorted_point *b) {
  return a->x[0] == b->x[0] && a->x[1] == b->x[1] && a->x[2] == b->x[2];
}

static ep_status count_duplicates(const ep_mesh *mesh, ep_mesh_findings *f, ep_error *err) {
  sorted_point *p = malloc((size_t)mesh->nv * sizeof *p);
  if (!p) return ep_fail(err, EP_ERR_MEMORY, "no memory to check the mesh %s", mesh->name);
  for (int i = 0; i < mesh->nv; i++) {
    memcpy(p[i].x, mesh->x + 3 * i, sizeof p[i].x);
    p[i].i = i;
  }
  qsort(p, (size_t)mesh->nv, sizeof *p, compare_points);
  int first = mesh->nv;
  for (int i = 1; i < mesh->nv; i++) {
    if (!same_point(p + i, p + i - 1)) continue;
    f->duplicate_vertices++;
    if (p[i].i < first) first = p[i].i;
  }
  if (f->duplicate_vertices) f->first_duplicate = mesh->file_vertex[first];
  free(p);
  return EP_OK;
}

static ep_status count_components(const ep_mesh *mesh, ep_mesh_findings *f, ep_error *err) {
  int *parent = malloc((size_t)mesh->nv * sizeof *parent);
  if (!parent) return ep_fail(err, EP_ERR_MEMORY, "no memory to check the mesh %s", mesh->name);
  f->components = ep_mesh_join_tets(mesh, parent);
  free(parent);
  return EP_OK;
}

ep_status ep_check_mesh(ep_mesh *mesh, ep_mesh_findings *findings, ep_error *err) {
  EP_TRY(check_tets(mesh, findings, err));
  EP_TRY(drop_repeated(mesh, findings, err));
  EP_TRY(count_duplicates(mesh, findings, err));
  return count_components(mesh, findings, err);
}
