// Legacy VTK files with an unstructured grid: version 2 to 4.2 (cells as "count i j k l") and 5.x
// (OFFSETS and CONNECTIVITY), ASCII and binary (big-endian).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/vtk.h"

enum { VTK_QUADRATIC_TETRA = 24, VTK_LAGRANGE_TETRA = 71, VTK_BEZIER_TETRA = 78 };

ep_status ep_vtk_fail(ep_vtk *f, ep_error *err, const char *what) {
  if (!f->binary) return ep_scan_fail(&f->scan, err, "%s", what);
  f->scan.at = f->scan.mark;
  return ep_scan_fail_byte(&f->scan, err, "%s", what);
}

static ep_status append_int(ep_vtk *f, ep_int_list *list, int value, ep_error *err) {
  void *data = list->data;
  const ep_status status =
      ep_grow(&data, &list->room, list->count + 1, sizeof value, f->raw->name, err);
  list->data = data;
  if (status == EP_OK) list->data[list->count++] = value;
  return status;
}

// --- numbers: VTK's binary numbers are big-endian

ep_status ep_vtk_read_type(ep_vtk *f, ep_number *type, ep_error *err) {
  static const struct {
    const char *word;
    ep_number type;
  } known[] = {{"float", EP_FLOAT32},
               {"double", EP_FLOAT64},
               {"int", EP_INT32},
               {"unsigned_int", EP_UINT32},
               {"long", EP_INT64},
               {"unsigned_long", EP_UINT64},
               {"vtktypeint64", EP_INT64},
               {"vtktypeint32", EP_INT32},
               {"vtkIdType", EP_INT32},
               {"short", EP_INT16},
               {"unsigned_short", EP_UINT16},
               {"char", EP_INT8},
               {"unsigned_char", EP_UINT8},
               {"signed_char", EP_INT8},
               {"vtktypeuint64", EP_UINT64},
               {"vtktypeuint32", EP_UINT32},
               {"vtktypeuint8", EP_UINT8},
               {"vtktypeint8", EP_INT8},
               {"vtktypeint16", EP_INT16},
               {"vtktypeuint16", EP_UINT16}};
  ep_token word;
  ep_scan_token(&f->scan, &word);
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (ep_token_is(word, known[i].word)) {
      *type = known[i].type;
      return EP_OK;
    }
  return ep_scan_fail(&f->scan, err, "'%.*s' is no known number type",
                      word.length < 40 ? word.length : 40, word.text);
}

static ep_status read_integer(ep_vtk *f, ep_number type, const char *what, int low, int high,
                              int *out, ep_error *err) {
  if (!f->binary) return ep_scan_int(&f->scan, what, low, high, out, err);
  EP_TRY(ep_scan_need(&f->scan, ep_number_size(type), what, err));
  const int64_t value = ep_number_integer(type, f->scan.at, !ep_machine_big_endian());
  f->scan.mark = f->scan.at;
  f->scan.at += ep_number_size(type);
  if (value >= low && value <= high) {
    *out = (int)value;
    return EP_OK;
  }
  f->scan.at = f->scan.mark;
  return ep_scan_fail_byte(&f->scan, err, "%s is %lld, but must lie in %d to %d", what,
                           (long long)value, low, high);
}

static ep_status read_real(ep_vtk *f, ep_number type, double *out, ep_error *err) {
  if (!f->binary) return ep_scan_double(&f->scan, "a coordinate", out, err);
  EP_TRY(ep_scan_need(&f->scan, ep_number_size(type), "a coordinate", err));
  *out = ep_number_real(type, f->scan.at, !ep_machine_big_endian());
  f->scan.mark = f->scan.at;
  f->scan.at += ep_number_size(type);
  return isfinite(*out) ? EP_OK : ep_vtk_fail(f, err, "a coordinate is not a finite number");
}

void ep_vtk_begin_data(ep_vtk *f) {
  if (f->binary) ep_scan_skip_line(&f->scan);
}

// --- sections

static ep_status read_points(ep_vtk *f, ep_error *err) {
  int count;
  ep_number type = EP_INT64;
  if (f->have_points) return ep_scan_fail(&f->scan, err, "a second section POINTS");
  f->have_points = true;
  EP_TRY(ep_scan_int(&f->scan, "the number of points", 0, EP_MESH_LIMIT, &count, err));
  EP_TRY(ep_vtk_read_type(f, &type, err));
  if (f->binary && type != EP_FLOAT32 && type != EP_FLOAT64)
    return ep_scan_fail_as(&f->scan, EP_ERR_UNSUPPORTED, err,
                           "points must be of type float or double");
  ep_vtk_begin_data(f);
  for (int i = 0; i < count; i++) {
    double x[3];
    for (int k = 0; k < 3; k++) EP_TRY(read_real(f, type, x + k, err));
    EP_TRY(ep_raw_vertex(f->raw, x, err));
  }
  return EP_OK;
}

static ep_status read_cell_vertex(ep_vtk *f, ep_number type, ep_error *err) {
  int vertex;
  EP_TRY(read_integer(f, type, "a vertex of a cell", 0, f->raw->nv - 1, &vertex, err));
  return append_int(f, &f->vertex, vertex, err);
}

// "CELLS n size", then for each cell its number of vertices and these; size counts all numbers.
static ep_status read_cells_4(ep_vtk *f, int cells, int size, ep_error *err) {
  ep_vtk_begin_data(f);
  EP_TRY(append_int(f, &f->offset, 0, err));
  for (int c = 0; c < cells; c++) {
    int count;
    EP_TRY(read_integer(f, EP_INT32, "the number of vertices of a cell", 0, size, &count, err));
    if (count >= size)
      return ep_vtk_fail(f, err, "the cells hold more numbers than CELLS announces");
    size -= count + 1;
    for (int i = 0; i < count; i++) EP_TRY(read_cell_vertex(f, EP_INT32, err));
    EP_TRY(append_int(f, &f->offset, f->vertex.count, err));
  }
  return size == 0 ? EP_OK
                   : ep_vtk_fail(f, err, "the cells hold fewer numbers than CELLS announces");
}

static ep_status expect_word(ep_vtk *f, const char *word, ep_error *err) {
  ep_token token;
  ep_scan_token(&f->scan, &token);
  if (ep_token_is(token, word)) return EP_OK;
  return ep_scan_fail(&f->scan, err, "%s is expected here", word);
}

// "CELLS n size", "OFFSETS type" and n numbers, "CONNECTIVITY type" and size numbers.
static ep_status read_cells_5(ep_vtk *f, int count, int size, ep_error *err) {
  ep_number type = EP_INT64;
  EP_TRY(expect_word(f, "OFFSETS", err));
  EP_TRY(ep_vtk_read_type(f, &type, err));
  if (type != EP_INT32 && type != EP_INT64)
    return ep_vtk_fail(f, err, "OFFSETS must be whole numbers");
  ep_vtk_begin_data(f);
  for (int i = 0, last = 0; i < count; i++) {
    int offset;
    EP_TRY(read_integer(f, type, "an offset", i ? last : 0, i ? size : 0, &offset, err));
    EP_TRY(append_int(f, &f->offset, last = offset, err));
  }
  if (f->offset.count == 0) EP_TRY(append_int(f, &f->offset, 0, err));
  if (f->offset.data[f->offset.count - 1] != size)
    return ep_vtk_fail(f, err, "the last offset is not the number of entries CELLS announces");
  EP_TRY(expect_word(f, "CONNECTIVITY", err));
  EP_TRY(ep_vtk_read_type(f, &type, err));
  if (type != EP_INT32 && type != EP_INT64)
    return ep_vtk_fail(f, err, "CONNECTIVITY must be whole numbers");
  ep_vtk_begin_data(f);
  for (int i = 0; i < size; i++) EP_TRY(read_cell_vertex(f, type, err));
  return EP_OK;
}

static ep_status read_cells(ep_vtk *f, ep_error *err) {
  int count, size;
  if (f->have_cells) return ep_scan_fail(&f->scan, err, "a second section CELLS");
  if (!f->have_points) return ep_scan_fail(&f->scan, err, "CELLS before POINTS");
  f->have_cells = true;
  EP_TRY(ep_scan_int(&f->scan, "the number of cells", 0, EP_MESH_LIMIT, &count, err));
  EP_TRY(ep_scan_int(&f->scan, "the size of CELLS", 0, EP_MESH_LIMIT, &size, err));
  return f->offsets ? read_cells_5(f, count, size, err) : read_cells_4(f, count, size, err);
}

static ep_status read_types(ep_vtk *f, ep_error *err) {
  int count;
  if (f->have_types) return ep_scan_fail(&f->scan, err, "a second section CELL_TYPES");
  if (!f->have_cells) return ep_scan_fail(&f->scan, err, "CELL_TYPES before CELLS");
  f->have_types = true;
  EP_TRY(ep_scan_int(&f->scan, "the number of cell types", 0, EP_MESH_LIMIT, &count, err));
  if (count != f->offset.count - 1)
    return ep_scan_fail(&f->scan, err, "%d cell types for %d cells", count, f->offset.count - 1);
  ep_vtk_begin_data(f);
  for (int c = 0; c < count; c++) {
    int type;
    EP_TRY(read_integer(f, EP_INT32, "a cell type", 0, 255, &type, err));
    EP_TRY(append_int(f, &f->type, type, err));
    const int vertices = f->offset.data[c + 1] - f->offset.data[c];
    if (type == EP_VTK_TETRA && vertices != 4)
      return ep_vtk_fail(f, err, "a tet that does not have 4 vertices");
  }
  return EP_OK;
}

void ep_vtk_skip_metadata(ep_vtk *f) {
  ep_scan *s = &f->scan;
  ep_scan_skip_line(s);
  while (s->at < s->end) {
    const char *from = s->at;
    ep_scan_skip_line(s);
    bool blank = true;
    for (; from < s->at; from++) blank &= strchr(" \t\r\n", *from) != NULL && *from;
    if (blank) return;
  }
}

// "POINT_DATA n" or "CELL_DATA n": the arrays that follow have n tuples.
static ep_status begin_arrays(ep_vtk *f, bool of_points, ep_error *err) {
  const int expected = of_points ? f->raw->nv : f->offset.count - 1;
  if (!f->have_types) return ep_scan_fail(&f->scan, err, "point or cell data before CELL_TYPES");
  EP_TRY(ep_scan_int(&f->scan, "the number of tuples", 0, EP_MESH_LIMIT, &f->tuples, err));
  f->in_points = of_points;
  if (f->tuples == expected) return EP_OK;
  return ep_scan_fail(&f->scan, err, "data for %d %s, but there are %d", f->tuples,
                      of_points ? "points" : "cells", expected);
}

static ep_status read_section(ep_vtk *f, ep_token word, bool *stop, ep_error *err) {
  bool taken;
  if (ep_token_is(word, "POINTS")) return read_points(f, err);
  if (ep_token_is(word, "CELLS")) return read_cells(f, err);
  if (ep_token_is(word, "CELL_TYPES")) return read_types(f, err);
  if (ep_token_is(word, "POINT_DATA")) return begin_arrays(f, true, err);
  if (ep_token_is(word, "CELL_DATA")) return begin_arrays(f, false, err);
  if (ep_token_is(word, "METADATA")) {
    ep_vtk_skip_metadata(f);
    return EP_OK;
  }
  EP_TRY(ep_vtk_read_data(f, word, &taken, stop, err));
  if (taken) return EP_OK;
  const char *text = "POINTS, CELLS, CELL_TYPES or an array is expected here; does the section "
                     "before hold more than it says?";
  return ep_vtk_fail(f, err, text);
}

// --- the file

static ep_status read_header(ep_vtk *f, ep_error *err) {
  static const char magic[] = "# vtk DataFile Version";
  ep_scan *s = &f->scan;
  ep_token word;
  double version;
  if ((size_t)(s->end - s->at) < sizeof magic || memcmp(s->at, magic, sizeof magic - 1) != 0)
    return ep_scan_fail(s, err, "not a legacy VTK file: it must begin with '%s'", magic);
  s->at += sizeof magic - 1;
  EP_TRY(ep_scan_double(s, "the version", &version, err));
  if (!(version >= 1 && version < 6))
    return ep_scan_fail_as(s, EP_ERR_UNSUPPORTED, err, "VTK file version %g", version);
  f->offsets = version >= 5;
  ep_scan_skip_line(s);
  ep_scan_skip_line(s); // the title, whatever it holds
  ep_scan_token(s, &word);
  f->binary = ep_token_is(word, "BINARY");
  if (!f->binary && !ep_token_is(word, "ASCII"))
    return ep_scan_fail(s, err, "ASCII or BINARY is expected here");
  EP_TRY(expect_word(f, "DATASET", err));
  ep_scan_token(s, &word);
  if (ep_token_is(word, "UNSTRUCTURED_GRID")) return EP_OK;
  return ep_scan_fail_as(s, EP_ERR_UNSUPPORTED, err,
                         "the data set is '%.*s'; an UNSTRUCTURED_GRID of tets is needed",
                         word.length < 40 ? word.length : 40, word.text);
}

ep_status ep_vtk_take_cell(ep_raw_mesh *raw, int type, const int *vertex, ep_error *err) {
  if (type == EP_VTK_TETRA) return ep_raw_tet(raw, vertex, err);
  ep_raw_drop(raw, type == VTK_QUADRATIC_TETRA || type == VTK_LAGRANGE_TETRA ||
                       type == VTK_BEZIER_TETRA);
  return EP_OK;
}

static ep_status take_cells(ep_vtk *f, ep_error *err) {
  for (int c = 0; c < f->type.count; c++)
    EP_TRY(ep_vtk_take_cell(f->raw, f->type.data[c], f->vertex.data + f->offset.data[c], err));
  return EP_OK;
}

static ep_status read_all(ep_vtk *f, ep_error *err) {
  ep_token word;
  EP_TRY(read_header(f, err));
  bool stop = false;
  while (!stop && ep_scan_token(&f->scan, &word)) EP_TRY(read_section(f, word, &stop, err));
  if (!f->have_types)
    return ep_scan_fail(&f->scan, err, "there is no section %s",
                        !f->have_points  ? "POINTS"
                        : !f->have_cells ? "CELLS"
                                         : "CELL_TYPES");
  return take_cells(f, err);
}

ep_status ep_read_vtk(ep_raw_mesh *raw, ep_scan scan, ep_error *err) {
  ep_vtk f = {.raw = raw, .scan = scan, .tuples = -1};
  const ep_status status = read_all(&f, err);
  free(f.offset.data);
  free(f.vertex.data);
  free(f.type.data);
  return status;
}
