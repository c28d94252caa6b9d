#include "mesh/raw.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/check.h"

// Cubes of coordinates, and sums of them over a mesh, must stay finite.
static const double coordinate_limit = 1e90;

ep_status ep_grow(void **array, int *room, int needed, size_t size, const char *name,
                  ep_error *err) {
  if (needed <= *room) return EP_OK;
  if (needed > EP_MESH_LIMIT)
    return ep_fail(err, EP_ERR_UNSUPPORTED, "%s: more than %d vertices or cells", name,
                   EP_MESH_LIMIT);
  int larger = *room < 64 ? 64 : 2 * *room;
  if (larger < needed) larger = needed;
  void *moved = realloc(*array, (size_t)larger * size);
  if (!moved) return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", name);
  *array = moved;
  *room = larger;
  return EP_OK;
}

ep_status ep_raw_vertex(ep_raw_mesh *raw, const double x[3], ep_error *err) {
  void *array = raw->x;
  const ep_status status =
      ep_grow(&array, &raw->room_v, raw->nv + 1, 3 * sizeof(double), raw->name, err);
  raw->x = array;
  if (status != EP_OK) return status;
  memcpy(raw->x + 3 * (size_t)raw->nv++, x, 3 * sizeof(double));
  return EP_OK;
}

ep_status ep_raw_tet(ep_raw_mesh *raw, const int vertex[4], ep_error *err) {
  void *array = raw->tet;
  const ep_status status =
      ep_grow(&array, &raw->room_t, raw->nt + 1, 4 * sizeof(int), raw->name, err);
  raw->tet = array;
  if (status != EP_OK) return status;
  memcpy(raw->tet + 4 * (size_t)raw->nt++, vertex, 4 * sizeof(int));
  return EP_OK;
}

void ep_raw_drop(ep_raw_mesh *raw, bool higher_order_tet) {
  if (raw->dropped < INT_MAX) raw->dropped++;
  if (higher_order_tet && raw->quadratic < INT_MAX) raw->quadratic++;
}

ep_status ep_raw_data(ep_raw_mesh *raw, ep_token name, int components, double **value,
                      ep_error *err) {
  void *array = raw->data;
  ep_status status =
      ep_grow(&array, &raw->room_data, raw->ndata + 1, sizeof *raw->data, raw->name, err);
  raw->data = array;
  *value = NULL;
  if (status != EP_OK) return status;
  ep_point_data *data = &raw->data[raw->ndata];
  *data = (ep_point_data){.components = components};
  data->name = strndup(name.text, (size_t)(name.length < EP_NAME_MAX ? name.length : EP_NAME_MAX));
  if (components == 1) data->value = calloc((size_t)raw->nv + 1, sizeof *data->value);
  raw->ndata++;
  *value = data->value;
  if (data->name && (data->value || components != 1)) return EP_OK;
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", raw->name);
}

void ep_raw_unread(ep_raw_mesh *raw, ep_token name) {
  if (raw->unread++) return;
  const int most = EP_UNREAD_MAX - 1, length = name.length < most ? name.length : most;
  memcpy(raw->first_unread, name.text, (size_t)length);
  raw->first_unread[length] = '\0';
}

void ep_raw_free(ep_raw_mesh *raw) {
  free(raw->x);
  free(raw->number);
  free(raw->tet);
  free(raw->material);
  free(raw->tet_material);
  ep_point_data_free(raw->data, raw->ndata);
  *raw = (ep_raw_mesh){.name = raw->name};
}

static ep_status check_contents(const ep_raw_mesh *raw, ep_error *err) {
  if (raw->quadratic)
    return ep_fail(err, EP_ERR_MESH,
                   "%s: %d tets are quadratic or of higher order; export the mesh with linear "
                   "(4-node) tets, in Gmsh with element order 1",
                   raw->name, raw->quadratic);
  if (raw->nt == 0)
    return ep_fail(err, EP_ERR_MESH,
                   "%s: no tets (%d vertices, %d other cells); a volume mesh of tets is needed",
                   raw->name, raw->nv, raw->dropped);
  for (int i = 0; i < 3 * raw->nv; i++)
    if (!(fabs(raw->x[i]) <= coordinate_limit))
      return ep_fail(err, EP_ERR_MESH, "%s: vertex %d (counted from 1): coordinate %g is %s",
                     raw->name, i / 3 + 1, raw->x[i],
                     isfinite(raw->x[i]) ? "too large" : "not a finite number");
  for (int i = 0; i < 4 * raw->nt; i++)
    if (raw->tet[i] < 0 || raw->tet[i] >= raw->nv)
      return ep_fail(err, EP_ERR_MESH,
                     "%s: tet %d (counted from 1) has a vertex outside the %d vertices of the file",
                     raw->name, i / 4 + 1, raw->nv);
  return EP_OK;
}

// Leave out vertices no tet uses; fills file_vertex.
static ep_status compress_vertices(ep_raw_mesh *raw, ep_mesh *out, ep_mesh_findings *f,
                                   ep_error *err) {
  int *place = malloc((size_t)raw->nv * sizeof *place);
  out->file_vertex = malloc((size_t)raw->nv * sizeof *out->file_vertex);
  if (!place || !out->file_vertex) {
    free(place);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the mesh %s", raw->name);
  }
  for (int i = 0; i < raw->nv; i++) place[i] = -1;
  for (int i = 0; i < 4 * raw->nt; i++) place[raw->tet[i]] = 0;
  int kept = 0;
  for (int i = 0; i < raw->nv; i++) {
    const int number = raw->number ? raw->number[i] : i;
    if (place[i] < 0) {
      if (f->unused_vertices++ == 0) f->first_unused = number;
      continue;
    }
    memmove(raw->x + 3 * kept, raw->x + 3 * i, 3 * sizeof(double));
    for (int k = 0; k < raw->ndata; k++)
      if (raw->data[k].value) raw->data[k].value[kept] = raw->data[k].value[i];
    out->file_vertex[kept] = number;
    place[i] = kept++;
  }
  for (int i = 0; i < 4 * raw->nt; i++) raw->tet[i] = place[raw->tet[i]];
  free(place);
  out->file_vertices = raw->number ? raw->number[raw->nv - 1] + 1 : raw->nv;
  out->nv = raw->nv = kept;
  return EP_OK;
}

static void move_arrays(ep_raw_mesh *raw, ep_mesh *out) {
  out->nt = raw->nt;
  out->x = raw->x;
  out->tet = raw->tet;
  out->nmaterials = raw->nmaterials;
  out->material = raw->material;
  out->tet_material = raw->tet_material;
  out->ndata = raw->ndata;
  out->data = raw->data;
  raw->x = NULL;
  raw->tet = NULL;
  raw->material = NULL;
  raw->tet_material = NULL;
  raw->data = NULL;
  raw->ndata = 0;
}

// The end of a long path says more than its beginning.
static void set_name(ep_mesh *mesh, const char *name) {
  const size_t length = strlen(name), room = sizeof mesh->name - 1;
  strcpy(mesh->name, length <= room ? name : name + length - room);
  if (length > room) memcpy(mesh->name, "...", 3);
}

ep_status ep_raw_finish(ep_raw_mesh *raw, ep_mesh *out, ep_mesh_findings *findings, ep_error *err) {
  ep_mesh_findings f = {.dropped_cells = raw->dropped,
                        .first_duplicate = -1,
                        .first_degenerate = -1,
                        .first_unused = -1,
                        .first_inverted = -1,
                        .first_repeated = -1,
                        .unread_arrays = raw->unread};
  memcpy(f.first_unread_array, raw->first_unread, sizeof f.first_unread_array);
  memset(out, 0, sizeof *out);
  ep_status status;
  EP_TRY_GOTO(status, check_contents(raw, err), done);
  set_name(out, raw->name);
  EP_TRY_GOTO(status, compress_vertices(raw, out, &f, err), done);
  move_arrays(raw, out);
  EP_TRY_GOTO(status, ep_check_mesh(out, &f, err), done);
  if (findings) *findings = f;
done:
  ep_raw_free(raw);
  if (status != EP_OK) ep_mesh_free(out);
  return status;
}
