// What the readers of legacy .vtk files share, and cells for .vtu too (private to mesh/).
#ifndef EP_MESH_VTK_H
#define EP_MESH_VTK_H

#include "mesh/numbers.h"
#include "mesh/readers.h"

typedef struct ep_int_list {
  int *data;
  int count, room;
} ep_int_list;

typedef struct ep_vtk {
  ep_raw_mesh *raw;
  ep_scan scan;
  bool binary, offsets; // offsets: cells as in version 5
  bool have_points, have_cells, have_types;
  ep_int_list offset, vertex, type; // offset: (cells + 1) into vertex
  bool in_points; // the arrays that come belong to the points, else to cells or to the whole
  int tuples;     // of each array there, -1 outside of POINT_DATA and CELL_DATA
} ep_vtk;

ep_status ep_vtk_fail(ep_vtk *f, ep_error *err, const char *what);
// A word for a number type. EP_ERR_FORMAT where it is none.
ep_status ep_vtk_read_type(ep_vtk *f, ep_number *type, ep_error *err);
// Binary data begin behind the line that announces them.
void ep_vtk_begin_data(ep_vtk *f);
// Key and value pairs of an array up to an empty line.
void ep_vtk_skip_metadata(ep_vtk *f);

// FIELD, SCALARS, VECTORS, ..: scalars of the points are kept. *taken false where the word begins
// no array. *stop where an array of no number type ends what can be read.
ep_status ep_vtk_read_data(ep_vtk *f, ep_token word, bool *taken, bool *stop, ep_error *err);

// A cell of VTK's type with its vertices (places in the file); tets must have 4.
ep_status ep_vtk_take_cell(ep_raw_mesh *raw, int type, const int *vertex, ep_error *err);
enum { EP_VTK_TETRA = 10 };

#endif
