#include "mesh/mesh.h"

#include <stdlib.h>
#include <string.h>

#include "mesh/raw.h"

ep_status ep_mesh_make(int nv, const double *x, int nt, const int *tet, const char *name,
                       ep_mesh *out, ep_mesh_findings *findings, ep_error *err) {
  memset(out, 0, sizeof *out);
  if (nv < 0 || nt < 0 || nv > EP_MESH_LIMIT || nt > EP_MESH_LIMIT)
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: %d vertices and %d tets are out of range", name, nv,
                   nt);
  ep_raw_mesh raw = {.name = name, .nv = nv, .nt = nt};
  raw.x = malloc(3 * ((size_t)nv + 1) * sizeof(double));
  raw.tet = malloc(4 * ((size_t)nt + 1) * sizeof(int));
  if (!raw.x || !raw.tet) {
    ep_raw_free(&raw);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", name);
  }
  if (nv) memcpy(raw.x, x, 3 * (size_t)nv * sizeof(double));
  if (nt) memcpy(raw.tet, tet, 4 * (size_t)nt * sizeof(int));
  return ep_raw_finish(&raw, out, findings, err);
}

// A copy of count elements in *to; true where there was nothing to copy or it worked.
static bool copy_array(const void *from, size_t count, size_t size, void **to) {
  *to = NULL;
  if (!from || !count) return true;
  *to = malloc(count * size);
  if (*to) memcpy(*to, from, count * size);
  return *to != NULL;
}

static bool copy_data(const ep_mesh *from, ep_point_data **to) {
  const size_t nv = (size_t)from->nv;
  *to = calloc((size_t)from->ndata + 1, sizeof **to);
  bool good = *to != NULL;
  for (int i = 0; good && i < from->ndata; i++) {
    const ep_point_data *data = &from->data[i];
    void *value;
    good = copy_array(data->value, nv, sizeof(double), &value);
    (*to)[i] = (ep_point_data){strdup(data->name), data->components, value};
    good &= (*to)[i].name != NULL;
  }
  return good;
}

ep_status ep_mesh_copy(const ep_mesh *mesh, ep_mesh *out, ep_error *err) {
  const size_t nv = (size_t)mesh->nv, nt = (size_t)mesh->nt;
  void *x, *tet, *file_vertex, *material, *tet_material;
  bool good = copy_array(mesh->x, 3 * nv, sizeof(double), &x);
  good &= copy_array(mesh->tet, 4 * nt, sizeof(int), &tet);
  good &= copy_array(mesh->file_vertex, nv, sizeof(int), &file_vertex);
  good &= copy_array(mesh->material, (size_t)mesh->nmaterials, sizeof(ep_elastic), &material);
  good &= copy_array(mesh->tet_material, nt, sizeof(int), &tet_material);
  ep_point_data *data;
  good &= copy_data(mesh, &data);
  *out = *mesh;
  out->data = data;
  out->ndata = data ? mesh->ndata : 0;
  out->x = x;
  out->tet = tet;
  out->file_vertex = file_vertex;
  out->material = material;
  out->tet_material = tet_material;
  if (good) return EP_OK;
  ep_mesh_free(out);
  return ep_fail(err, EP_ERR_MEMORY, "no memory for a copy of the mesh %s", mesh->name);
}

void ep_point_data_free(ep_point_data *data, int count) {
  for (int i = 0; i < count; i++) {
    free(data[i].name);
    free(data[i].value);
  }
  free(data);
}

const ep_point_data *ep_mesh_data(const ep_mesh *mesh, const char *name) {
  for (int i = 0; i < mesh->ndata; i++)
    if (strcmp(mesh->data[i].name, name) == 0) return &mesh->data[i];
  return NULL;
}

void ep_mesh_free(ep_mesh *mesh) {
  free(mesh->x);
  free(mesh->tet);
  free(mesh->file_vertex);
  free(mesh->material);
  free(mesh->tet_material);
  ep_point_data_free(mesh->data, mesh->ndata);
  memset(mesh, 0, sizeof *mesh);
}

void ep_mesh_report(const ep_mesh *mesh, const ep_mesh_findings *f, ep_log *log) {
  const char *name = mesh->name;
  if (f->dropped_cells)
    ep_notice(log, "%s: %d cells that are not linear tets were left out", name, f->dropped_cells);
  if (f->unread_arrays)
    ep_notice(log,
              "%s: array '%s' of the points is no numbers: it was not read, in .vtk neither "
              "what follows it",
              name, f->first_unread_array);
  if (f->repaired_orientation)
    ep_notice(log, "%s: %d inverted tets were turned round", name, f->repaired_orientation);
  if (f->repeated_tets)
    ep_notice(log, "%s: %d tets occur more than once and were counted once (first: tet %d)", name,
              f->repeated_tets, f->first_repeated + 1);
  if (f->unused_vertices)
    ep_notice(log, "%s: %d vertices belong to no tet and were left out (first: vertex %d)", name,
              f->unused_vertices, f->first_unused + 1);
  if (f->duplicate_vertices)
    ep_warn(log,
            "%s: %d vertices stand where an earlier one does (first: vertex %d); parts that "
            "only touch there are not joined",
            name, f->duplicate_vertices, f->first_duplicate + 1);
  if (f->components > 1) ep_warn(log, "%s: the mesh has %d separate parts", name, f->components);
  if (f->degenerate_tets)
    ep_warn(log, "%s: %d tets have no volume (first: tet %d)", name, f->degenerate_tets,
            f->first_degenerate + 1);
}

ep_status ep_mesh_require_sound(const ep_mesh *mesh, const ep_mesh_findings *f, bool whole,
                                ep_error *err) {
  if (f->degenerate_tets)
    return ep_fail(err, EP_ERR_MESH,
                   "%s: tet %d (counted from 1) has no volume, %d such tets in all; remesh the "
                   "object, or let the mesher optimise its quality",
                   mesh->name, f->first_degenerate + 1, f->degenerate_tets);
  if (whole && f->components > 1)
    return ep_fail(
        err, EP_ERR_MESH, "%s: the mesh has %d separate parts%s; join them to one, or keep one",
        mesh->name, f->components, f->duplicate_vertices ? " (merge its duplicate vertices)" : "");
  return EP_OK;
}

// A pose may hold inverted tets, whose last two vertices were exchanged on reading.
bool ep_mesh_same_connectivity(const ep_mesh *a, const ep_mesh *b) {
  if (a->nv != b->nv || a->nt != b->nt) return false;
  for (int e = 0; e < a->nt; e++) {
    const int *s = a->tet + 4 * e, *t = b->tet + 4 * e;
    const bool same = s[2] == t[2] && s[3] == t[3], turned = s[2] == t[3] && s[3] == t[2];
    if (s[0] != t[0] || s[1] != t[1] || !(same || turned)) return false;
  }
  return true;
}

static int compare_ints(const void *a, const void *b) {
  const int s = *(const int *)a, t = *(const int *)b;
  return (s > t) - (s < t);
}

int ep_mesh_from_file_vertex(const ep_mesh *mesh, int file_vertex) {
  const int *found = bsearch(&file_vertex, mesh->file_vertex, (size_t)mesh->nv,
                             sizeof *mesh->file_vertex, compare_ints);
  return found ? (int)(found - mesh->file_vertex) : -1;
}
