// Legacy VTK files with an unstructured grid: version 2 to 4.2 (cells as "count i j k l") and 5.x
// (OFFSETS and CONNECTIVITY), ASCII and binary (big-endian). Point and cell data are not read.
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/readers.h"

enum { VTK_TETRA = 10, VTK_QUADRATIC_TETRA = 24, VTK_LAGRANGE_TETRA = 71, VTK_BEZIER_TETRA = 78 };

typedef enum number_type { INT8, INT16, INT32, INT64, FLOAT32, FLOAT64 } number_type;

typedef struct int_list {
  int *data;
  int count, room;
} int_list;

typedef struct vtk {
  ep_raw_mesh *raw;
  ep_scan scan;
  bool binary, offsets; // offsets: cells as in version 5
  bool have_points, have_cells, have_types;
  int_list offset, vertex, type; // offset: (cells + 1) into vertex
} vtk;

static ep_status fail_here(vtk *f, ep_error *err, const char *what) {
  if (!f->binary) return ep_scan_fail(&f->scan, err, "%s", what);
  f->scan.at = f->scan.mark;
  return ep_scan_fail_byte(&f->scan, err, "%s", what);
}

static ep_status append_int(vtk *f, int_list *list, int value, ep_error *err) {
  void *data = list->data;
  const ep_status status =
      ep_grow(&data, &list->room, list->count + 1, sizeof value, f->raw->name, err);
  list->data = data;
  if (status == EP_OK) list->data[list->count++] = value;
  return status;
}

// --- numbers: VTK's binary numbers are big-endian

static size_t size_of(number_type type) {
  static const size_t sizes[] = {1, 2, 4, 8, 4, 8};
  return sizes[type];
}

static ep_status read_type(vtk *f, number_type *type, ep_error *err) {
  static const struct {
    const char *word;
    number_type type;
  } known[] = {{"float", FLOAT32},       {"double", FLOAT64},       {"int", INT32},
               {"unsigned_int", INT32},  {"long", INT64},           {"unsigned_long", INT64},
               {"vtktypeint64", INT64},  {"vtktypeint32", INT32},   {"vtkIdType", INT32},
               {"short", INT16},         {"unsigned_short", INT16}, {"char", INT8},
               {"unsigned_char", INT8},  {"signed_char", INT8},     {"vtktypeuint64", INT64},
               {"vtktypeuint32", INT32}, {"vtktypeuint8", INT8},    {"vtktypeint8", INT8},
               {"vtktypeint16", INT16},  {"vtktypeuint16", INT16}};
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

static ep_status read_integer(vtk *f, number_type type, const char *what, int low, int high,
                              int *out, ep_error *err) {
  if (!f->binary) return ep_scan_int(&f->scan, what, low, high, out, err);
  const bool swap = !ep_machine_big_endian();
  int32_t narrow = 0;
  int64_t value;
  if (type == INT64) {
    EP_TRY(ep_scan_i64(&f->scan, swap, what, &value, err));
  } else {
    EP_TRY(ep_scan_i32(&f->scan, swap, what, &narrow, err));
    value = narrow;
  }
  if (value >= low && value <= high) {
    *out = (int)value;
    return EP_OK;
  }
  f->scan.at = f->scan.mark;
  return ep_scan_fail_byte(&f->scan, err, "%s is %lld, but must lie in %d to %d", what,
                           (long long)value, low, high);
}

static ep_status read_real(vtk *f, number_type type, double *out, ep_error *err) {
  if (!f->binary) return ep_scan_double(&f->scan, "a coordinate", out, err);
  const bool swap = !ep_machine_big_endian();
  float narrow;
  if (type == FLOAT64) {
    EP_TRY(ep_scan_f64(&f->scan, swap, "a coordinate", out, err));
  } else {
    EP_TRY(ep_scan_f32(&f->scan, swap, "a coordinate", &narrow, err));
    *out = (double)narrow;
  }
  return isfinite(*out) ? EP_OK : fail_here(f, err, "a coordinate is not a finite number");
}

// Binary data begin behind the line that announces them.
static void begin_data(vtk *f) {
  if (f->binary) ep_scan_skip_line(&f->scan);
}

// --- sections

static ep_status read_points(vtk *f, ep_error *err) {
  int count;
  number_type type = INT64;
  if (f->have_points) return ep_scan_fail(&f->scan, err, "a second section POINTS");
  f->have_points = true;
  EP_TRY(ep_scan_int(&f->scan, "the number of points", 0, EP_MESH_LIMIT, &count, err));
  EP_TRY(read_type(f, &type, err));
  if (f->binary && type != FLOAT32 && type != FLOAT64)
    return ep_scan_fail_as(&f->scan, EP_ERR_UNSUPPORTED, err,
                           "points must be of type float or double");
  begin_data(f);
  for (int i = 0; i < count; i++) {
    double x[3];
    for (int k = 0; k < 3; k++) EP_TRY(read_real(f, type, x + k, err));
    EP_TRY(ep_raw_vertex(f->raw, x, err));
  }
  return EP_OK;
}

static ep_status read_cell_vertex(vtk *f, number_type type, ep_error *err) {
  int vertex;
  EP_TRY(read_integer(f, type, "a vertex of a cell", 0, f->raw->nv - 1, &vertex, err));
  return append_int(f, &f->vertex, vertex, err);
}

// "CELLS n size", then for each cell its number of vertices and these; size counts all numbers.
static ep_status read_cells_4(vtk *f, int cells, int size, ep_error *err) {
  begin_data(f);
  EP_TRY(append_int(f, &f->offset, 0, err));
  for (int c = 0; c < cells; c++) {
    int count;
    EP_TRY(read_integer(f, INT32, "the number of vertices of a cell", 0, size, &count, err));
    if (count >= size) return fail_here(f, err, "the cells hold more numbers than CELLS announces");
    size -= count + 1;
    for (int i = 0; i < count; i++) EP_TRY(read_cell_vertex(f, INT32, err));
    EP_TRY(append_int(f, &f->offset, f->vertex.count, err));
  }
  return size == 0 ? EP_OK : fail_here(f, err, "the cells hold fewer numbers than CELLS announces");
}

static ep_status expect_word(vtk *f, const char *word, ep_error *err) {
  ep_token token;
  ep_scan_token(&f->scan, &token);
  if (ep_token_is(token, word)) return EP_OK;
  return ep_scan_fail(&f->scan, err, "%s is expected here", word);
}

// "CELLS n size", "OFFSETS type" and n numbers, "CONNECTIVITY type" and size numbers.
static ep_status read_cells_5(vtk *f, int count, int size, ep_error *err) {
  number_type type = INT64;
  EP_TRY(expect_word(f, "OFFSETS", err));
  EP_TRY(read_type(f, &type, err));
  if (type != INT32 && type != INT64) return fail_here(f, err, "OFFSETS must be whole numbers");
  begin_data(f);
  for (int i = 0, last = 0; i < count; i++) {
    int offset;
    EP_TRY(read_integer(f, type, "an offset", i ? last : 0, i ? size : 0, &offset, err));
    EP_TRY(append_int(f, &f->offset, last = offset, err));
  }
  if (f->offset.count == 0) EP_TRY(append_int(f, &f->offset, 0, err));
  if (f->offset.data[f->offset.count - 1] != size)
    return fail_here(f, err, "the last offset is not the number of entries CELLS announces");
  EP_TRY(expect_word(f, "CONNECTIVITY", err));
  EP_TRY(read_type(f, &type, err));
  if (type != INT32 && type != INT64)
    return fail_here(f, err, "CONNECTIVITY must be whole numbers");
  begin_data(f);
  for (int i = 0; i < size; i++) EP_TRY(read_cell_vertex(f, type, err));
  return EP_OK;
}

static ep_status read_cells(vtk *f, ep_error *err) {
  int count, size;
  if (f->have_cells) return ep_scan_fail(&f->scan, err, "a second section CELLS");
  if (!f->have_points) return ep_scan_fail(&f->scan, err, "CELLS before POINTS");
  f->have_cells = true;
  EP_TRY(ep_scan_int(&f->scan, "the number of cells", 0, EP_MESH_LIMIT, &count, err));
  EP_TRY(ep_scan_int(&f->scan, "the size of CELLS", 0, EP_MESH_LIMIT, &size, err));
  return f->offsets ? read_cells_5(f, count, size, err) : read_cells_4(f, count, size, err);
}

static ep_status read_types(vtk *f, ep_error *err) {
  int count;
  if (f->have_types) return ep_scan_fail(&f->scan, err, "a second section CELL_TYPES");
  if (!f->have_cells) return ep_scan_fail(&f->scan, err, "CELL_TYPES before CELLS");
  f->have_types = true;
  EP_TRY(ep_scan_int(&f->scan, "the number of cell types", 0, EP_MESH_LIMIT, &count, err));
  if (count != f->offset.count - 1)
    return ep_scan_fail(&f->scan, err, "%d cell types for %d cells", count, f->offset.count - 1);
  begin_data(f);
  for (int c = 0; c < count; c++) {
    int type;
    EP_TRY(read_integer(f, INT32, "a cell type", 0, 255, &type, err));
    EP_TRY(append_int(f, &f->type, type, err));
    const int vertices = f->offset.data[c + 1] - f->offset.data[c];
    if (type == VTK_TETRA && vertices != 4)
      return fail_here(f, err, "a tet that does not have 4 vertices");
  }
  return EP_OK;
}

// Key and value pairs of an array up to an empty line.
static void skip_metadata(vtk *f) {
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

// "FIELD name n", then n times "name components tuples type" and the numbers.
static ep_status skip_field(vtk *f, ep_error *err) {
  int arrays, components, tuples;
  ep_token name;
  number_type type = INT64;
  ep_scan_token(&f->scan, &name);
  EP_TRY(ep_scan_int(&f->scan, "the number of arrays", 0, EP_MESH_LIMIT, &arrays, err));
  for (int i = 0; i < arrays; i++) {
    if (ep_token_is(ep_scan_peek(&f->scan), "METADATA")) skip_metadata(f);
    ep_scan_token(&f->scan, &name);
    EP_TRY(ep_scan_int(&f->scan, "the components of an array", 0, INT_MAX, &components, err));
    EP_TRY(ep_scan_int(&f->scan, "the tuples of an array", 0, INT_MAX, &tuples, err));
    EP_TRY(read_type(f, &type, err));
    const uint64_t count = (uint64_t)components * (uint64_t)tuples;
    begin_data(f);
    if (!f->binary) {
      EP_TRY(ep_scan_skip_numbers(&f->scan, (long long)count, "a number of an array", err));
      continue;
    }
    EP_TRY(ep_scan_need(&f->scan, count, "an array", err)); // so that the product fits
    EP_TRY(ep_scan_need(&f->scan, count * size_of(type), "an array", err));
    f->scan.at += count * size_of(type);
  }
  return EP_OK;
}

static ep_status read_section(vtk *f, ep_token word, ep_error *err) {
  if (ep_token_is(word, "POINTS")) return read_points(f, err);
  if (ep_token_is(word, "CELLS")) return read_cells(f, err);
  if (ep_token_is(word, "CELL_TYPES")) return read_types(f, err);
  if (ep_token_is(word, "FIELD")) return skip_field(f, err);
  if (ep_token_is(word, "METADATA")) {
    skip_metadata(f);
    return EP_OK;
  }
  const char *text = "POINTS, CELLS or CELL_TYPES is expected here; does the section before hold "
                     "more than it says?";
  return fail_here(f, err, text);
}

// --- the file

static ep_status read_header(vtk *f, ep_error *err) {
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

static ep_status take_tets(vtk *f, ep_error *err) {
  for (int c = 0; c < f->type.count; c++) {
    const int type = f->type.data[c];
    if (type == VTK_TETRA)
      EP_TRY(ep_raw_tet(f->raw, f->vertex.data + f->offset.data[c], err));
    else
      ep_raw_drop(f->raw, type == VTK_QUADRATIC_TETRA || type == VTK_LAGRANGE_TETRA ||
                              type == VTK_BEZIER_TETRA);
  }
  return EP_OK;
}

static ep_status read_all(vtk *f, ep_error *err) {
  ep_token word;
  EP_TRY(read_header(f, err));
  while (ep_scan_token(&f->scan, &word)) {
    const bool data = ep_token_is(word, "POINT_DATA") || ep_token_is(word, "CELL_DATA");
    if (data && f->have_types) break;
    EP_TRY(read_section(f, word, err));
  }
  if (!f->have_types)
    return ep_scan_fail(&f->scan, err, "there is no section %s",
                        !f->have_points  ? "POINTS"
                        : !f->have_cells ? "CELLS"
                                         : "CELL_TYPES");
  return take_tets(f, err);
}

ep_status ep_read_vtk(ep_raw_mesh *raw, ep_scan scan, ep_error *err) {
  vtk f = {.raw = raw, .scan = scan};
  const ep_status status = read_all(&f, err);
  free(f.offset.data);
  free(f.vertex.data);
  free(f.type.data);
  return status;
}
