// What a reader gathers before it becomes an ep_mesh (private to mesh/). The arrays grow with what
// was really read, so a huge count in a header costs nothing.
#ifndef EP_MESH_RAW_H
#define EP_MESH_RAW_H

#include <stddef.h>

#include "mesh/mesh.h"
#include "mesh/scan.h"

// 12 numbers a tet still fit an int.
enum { EP_MESH_LIMIT = 1 << 27 };
// Names of arrays are cut to fit.
enum { EP_NAME_MAX = 128 };

typedef struct ep_raw_mesh {
  const char *name; // not owned
  int nv, nt, room_v, room_t;
  double *x;     // (nv x 3)
  int *number;   // (nv) ascending, file number of each vertex from 0; NULL where it is its place
  int *tet;      // (nt x 4) places of vertices, checked by ep_raw_finish
  int dropped;   // cells that are not linear tets
  int quadratic; // of these, tets of higher order
  int nmaterials;
  ep_elastic *material;
  int *tet_material; // (nt)
  int ndata, room_data;
  ep_point_data *data; // values (nv)
  int unread;          // arrays of the points that are no numbers
  char first_unread[EP_UNREAD_MAX];
} ep_raw_mesh;

ep_status ep_raw_vertex(ep_raw_mesh *raw, const double x[3], ep_error *err);
ep_status ep_raw_tet(ep_raw_mesh *raw, const int vertex[4], ep_error *err);
// A further array of the points, of which nv must have been read. *value (nv, owned by raw) is to
// be filled in; NULL where the array is no scalar, which is remembered by name only.
ep_status ep_raw_data(ep_raw_mesh *raw, ep_token name, int components, double **value,
                      ep_error *err);
// Remember an array that is no numbers.
void ep_raw_unread(ep_raw_mesh *raw, ep_token name);
// Count a cell that is no linear tet.
void ep_raw_drop(ep_raw_mesh *raw, bool higher_order_tet);
// Checks and repairs as ep_mesh_make says, moves everything into out. raw is empty afterwards,
// also on failure.
ep_status ep_raw_finish(ep_raw_mesh *raw, ep_mesh *out, ep_mesh_findings *findings, ep_error *err);
void ep_raw_free(ep_raw_mesh *raw);

// Grow *array (elements of `size` bytes) to hold at least `needed`; *room is its capacity.
ep_status ep_grow(void **array, int *room, int needed, size_t size, const char *name,
                  ep_error *err);

#endif
