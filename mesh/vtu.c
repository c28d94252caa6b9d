// VTK's XML files with one unstructured grid (.vtu): arrays as text, inline base64, or appended raw
// or base64, packed by zlib or not; scalars of the points are kept.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/vtk.h"
#include "mesh/vtu_data.h"
#include "mesh/xml.h"

typedef enum section { ELSEWHERE, POINT_DATA, POINTS, CELLS } section;

typedef struct vtu {
  ep_raw_mesh *raw;
  ep_scan scan;
  ep_vtu_header header;
  bool have_piece, in_piece, have_appended; // in_piece: in the one that holds something
  int points, cells;
  section section;
  ep_vtu_array point, connectivity, offsets, types;
  ep_vtu_array *data; // arrays of the points
  int ndata, room_data;
  int *offset, *type; // (cells)
} vtu;

static int shown(ep_token token) {
  return token.length < 40 ? token.length : 40;
}

// --- tags

static ep_status read_number(vtu *f, const ep_xml_tag *tag, const char *name, long long most,
                             bool required, long long fallback, long long *out, ep_error *err) {
  ep_token text;
  *out = fallback;
  if (!ep_xml_attribute(tag, name, &text)) {
    if (!required) return EP_OK;
    return ep_scan_fail(&f->scan, err, "%.*s without %s", shown(tag->name), tag->name.text, name);
  }
  ep_scan s = f->scan;
  s.at = s.mark = text.text;
  s.end = text.text + text.length;
  return ep_scan_long(&s, name, 0, most, out, err);
}

static ep_status read_file_tag(vtu *f, const ep_xml_tag *tag, ep_error *err) {
  ep_token text;
  if (!ep_xml_attribute(tag, "type", &text) || !ep_token_is(text, "UnstructuredGrid"))
    return ep_scan_fail_as(
        &f->scan, EP_ERR_UNSUPPORTED, err,
        "not a file of type UnstructuredGrid; of a parallel .pvtu name its .vtu");
  f->header.big_endian =
      ep_xml_attribute(tag, "byte_order", &text) && ep_token_is(text, "BigEndian");
  f->header.wide = ep_xml_attribute(tag, "header_type", &text) && ep_token_is(text, "UInt64");
  if (!ep_xml_attribute(tag, "compressor", &text) || text.length == 0) return EP_OK;
  f->header.zlib = ep_token_is(text, "vtkZLibDataCompressor");
  if (f->header.zlib) return EP_OK;
  return ep_scan_fail_as(&f->scan, EP_ERR_UNSUPPORTED, err,
                         "compressor %.*s; save it with zlib or without compression", shown(text),
                         text.text);
}

static ep_status read_piece(vtu *f, const ep_xml_tag *tag, ep_error *err) {
  long long points, cells;
  EP_TRY(read_number(f, tag, "NumberOfPoints", EP_MESH_LIMIT, true, 0, &points, err));
  EP_TRY(read_number(f, tag, "NumberOfCells", EP_MESH_LIMIT, true, 0, &cells, err));
  f->in_piece = points > 0;
  if (!f->in_piece) return EP_OK;
  if (f->have_piece)
    return ep_scan_fail_as(&f->scan, EP_ERR_UNSUPPORTED, err,
                           "a second Piece; merge the pieces to one");
  f->have_piece = true;
  f->points = (int)points;
  f->cells = (int)cells;
  return EP_OK;
}

// The text of a DataArray: up to the next tag. Elements inside, which hold information only, may
// stand before it.
static ep_status take_text(vtu *f, ep_vtu_array *a, ep_error *err) {
  ep_xml_tag tag;
  bool found;
  for (int depth = 1; depth > 0;) {
    ep_scan text = f->scan;
    EP_TRY(ep_xml_next(&f->scan, &tag, &found, err));
    if (!found || (depth == 1 && tag.closing && !ep_token_is(tag.name, "DataArray")))
      return ep_scan_fail(&a->place, err, "a DataArray that does not end");
    text.end = f->scan.mark;
    text.mark = text.at;
    if (depth == 1 && ep_scan_peek(&text).length) a->place = text;
    if (tag.closing)
      depth--;
    else if (!tag.empty)
      depth++;
  }
  return EP_OK;
}

static bool number_type(ep_token text, ep_number *type) {
  static const char *const words[EP_NUMBERS] = {"Int8",   "Int16",  "Int32",  "Int64",   "UInt8",
                                                "UInt16", "UInt32", "UInt64", "Float32", "Float64"};
  for (int i = 0; i < EP_NUMBERS; i++)
    if (ep_token_is(text, words[i])) {
      *type = (ep_number)i;
      return true;
    }
  return false;
}

// *numbers false: an array of strings or bits, passed over.
static ep_status read_array(vtu *f, const ep_xml_tag *tag, ep_vtu_array *a, bool *numbers,
                            ep_error *err) {
  long long components, offset;
  ep_token text;
  *a = (ep_vtu_array){.present = true, .place = f->scan};
  a->place.end = a->place.at; // an empty text until one is found
  if (!ep_xml_attribute(tag, "Name", &a->name)) a->name = (ep_token){"", 0};
  *numbers = ep_xml_attribute(tag, "type", &text) && number_type(text, &a->type);
  EP_TRY(read_number(f, tag, "NumberOfComponents", 1 << 20, false, 1, &components, err));
  a->components = (int)components;
  if (!ep_xml_attribute(tag, "format", &text)) text = (ep_token){"ascii", 5};
  a->appended = ep_token_is(text, "appended");
  a->encoding = ep_token_is(text, "ascii") ? EP_VTU_ASCII : EP_VTU_BASE64;
  if (!a->appended && !ep_token_is(text, "ascii") && !ep_token_is(text, "binary"))
    return ep_scan_fail(&f->scan, err, "format '%.*s'; ascii, binary or appended are known",
                        shown(text), text.text);
  EP_TRY(read_number(f, tag, "offset", INT64_MAX, a->appended, 0, &offset, err));
  a->offset = (uint64_t)offset;
  return tag->empty ? EP_OK : take_text(f, a, err);
}

static ep_status keep_data(vtu *f, const ep_vtu_array *a, ep_error *err) {
  void *list = f->data;
  const ep_status status =
      ep_grow(&list, &f->room_data, f->ndata + 1, sizeof *a, f->raw->name, err);
  f->data = list;
  if (status == EP_OK) f->data[f->ndata++] = *a;
  return status;
}

static ep_status take_array(vtu *f, const ep_xml_tag *tag, ep_error *err) {
  ep_vtu_array a;
  bool numbers;
  EP_TRY(read_array(f, tag, &a, &numbers, err));
  if (!f->in_piece || f->section == ELSEWHERE) return EP_OK;
  if (!numbers) {
    if (f->section == POINT_DATA) {
      ep_raw_unread(f->raw, a.name);
      return EP_OK;
    }
    return ep_scan_fail(&a.place, err, "DataArray '%.*s' is of no number type", shown(a.name),
                        a.name.text);
  }
  if (f->section == POINT_DATA) return keep_data(f, &a, err);
  if (f->section == POINTS) f->point = a;
  if (f->section == CELLS && ep_token_is(a.name, "connectivity")) f->connectivity = a;
  if (f->section == CELLS && ep_token_is(a.name, "offsets")) f->offsets = a;
  if (f->section == CELLS && ep_token_is(a.name, "types")) f->types = a;
  return EP_OK;
}

static ep_status read_tag(vtu *f, const ep_xml_tag *tag, ep_error *err) {
  static const struct {
    const char *name;
    section section;
  } sections[] = {{"PointData", POINT_DATA}, {"Points", POINTS}, {"Cells", CELLS}};
  for (size_t i = 0; i < sizeof sections / sizeof *sections; i++)
    if (ep_token_is(tag->name, sections[i].name)) {
      f->section = tag->closing || tag->empty ? ELSEWHERE : sections[i].section;
      return EP_OK;
    }
  if (tag->closing) {
    if (ep_token_is(tag->name, "Piece")) f->in_piece = false;
    return EP_OK;
  }
  if (ep_token_is(tag->name, "DataArray")) return take_array(f, tag, err);
  if (ep_token_is(tag->name, "Piece")) return read_piece(f, tag, err);
  return EP_OK;
}

// --- appended data: everything behind the underscore

static ep_status find_appended(vtu *f, const ep_xml_tag *tag, ep_error *err) {
  ep_token text;
  const bool raw = ep_xml_attribute(tag, "encoding", &text) && ep_token_is(text, "raw");
  ep_scan place = f->scan;
  while (place.at < place.end && strchr(" \t\r\n", *place.at) && *place.at) place.at++;
  if (place.at == place.end || *place.at != '_')
    return ep_scan_fail(&f->scan, err, "AppendedData must begin with '_'");
  place.mark = place.at++;
  f->have_appended = true;
  ep_vtu_array *const fixed[] = {&f->point, &f->connectivity, &f->offsets, &f->types};
  for (int i = 0; i < 4 + f->ndata; i++) {
    ep_vtu_array *a = i < 4 ? fixed[i] : &f->data[i - 4];
    if (!a->appended) continue;
    a->place = place;
    a->encoding = raw ? EP_VTU_RAW : EP_VTU_BASE64;
  }
  return EP_OK;
}

static ep_status walk(vtu *f, ep_error *err) {
  ep_xml_tag tag;
  bool found, head = false;
  for (;;) {
    EP_TRY(ep_xml_next(&f->scan, &tag, &found, err));
    if (!found) break;
    if (!head) {
      if (!ep_token_is(tag.name, "VTKFile"))
        return ep_scan_fail(&f->scan, err, "not a VTK XML file: VTKFile is expected here");
      EP_TRY(read_file_tag(f, &tag, err));
      head = true;
      continue;
    }
    if (!tag.closing && ep_token_is(tag.name, "AppendedData")) return find_appended(f, &tag, err);
    EP_TRY(read_tag(f, &tag, err));
  }
  return head ? EP_OK : ep_scan_fail(&f->scan, err, "not a VTK XML file: there is no VTKFile");
}

// --- contents

static ep_status require(const vtu *f, const ep_vtu_array *a, int components, const char *what,
                         ep_error *err) {
  if (!a->present) return ep_scan_fail(&f->scan, err, "there is no array of the %s", what);
  if (a->components != components)
    return ep_scan_fail(&a->place, err, "the array of the %s has %d components instead of %d", what,
                        a->components, components);
  if (a->appended && !f->have_appended)
    return ep_scan_fail(&f->scan, err,
                        "the array of the %s is appended, but there is no "
                        "AppendedData",
                        what);
  return EP_OK;
}

static ep_status take_points(vtu *f, ep_error *err) {
  double *x = NULL;
  EP_TRY(require(f, &f->point, 3, "points", err));
  EP_TRY(ep_vtu_doubles(&f->header, &f->point, 3 * (uint64_t)f->points, "a coordinate", &x, err));
  ep_status status = EP_OK;
  for (int i = 0; i < f->points && status == EP_OK; i++)
    status = ep_raw_vertex(f->raw, x + 3 * (size_t)i, err);
  free(x);
  return status;
}

static ep_status take_cell(vtu *f, int c, const int *vertex, ep_error *err) {
  const int first = c ? f->offset[c - 1] : 0, count = f->offset[c] - first;
  if (f->type[c] == EP_VTK_TETRA && count != 4)
    return ep_scan_fail(&f->types.place, err, "cell %d (from 1) is a tet with %d vertices", c + 1,
                        count);
  return ep_vtk_take_cell(f->raw, f->type[c], vertex + first, err);
}

static ep_status take_cells(vtu *f, ep_error *err) {
  const uint64_t cells = (uint64_t)f->cells;
  EP_TRY(require(f, &f->offsets, 1, "cells' offsets", err));
  EP_TRY(require(f, &f->types, 1, "cells' types", err));
  EP_TRY(require(f, &f->connectivity, 1, "cells' connectivity", err));
  EP_TRY(ep_vtu_ints(&f->header, &f->offsets, cells, 0, 8 * EP_MESH_LIMIT - 1, "an offset",
                     &f->offset, err));
  EP_TRY(ep_vtu_ints(&f->header, &f->types, cells, 0, 255, "a cell type", &f->type, err));
  for (int c = 1; c < f->cells; c++)
    if (f->offset[c] < f->offset[c - 1])
      return ep_scan_fail(&f->offsets.place, err,
                          "the offset of cell %d (from 1) is below the one "
                          "before",
                          c + 1);
  int *vertex;
  EP_TRY(ep_vtu_ints(&f->header, &f->connectivity, f->cells ? (uint64_t)f->offset[f->cells - 1] : 0,
                     0, f->points - 1, "a vertex of a cell", &vertex, err));
  ep_status status = EP_OK;
  for (int c = 0; c < f->cells && status == EP_OK; c++) status = take_cell(f, c, vertex, err);
  free(vertex);
  return status;
}

static ep_status take_data(vtu *f, const ep_vtu_array *a, ep_error *err) {
  char name[EP_NAME_MAX], what[EP_NAME_MAX + 32];
  double *value, *read;
  ep_xml_decode(a->name, name, sizeof name);
  snprintf(what, sizeof what, "array '%s' of the points", name);
  const ep_token decoded = {name, (int)strlen(name)};
  EP_TRY(require(f, a, a->components, what, err));
  EP_TRY(ep_raw_data(f->raw, decoded, a->components, &value, err));
  if (!value) return EP_OK;
  EP_TRY(ep_vtu_doubles(&f->header, a, (uint64_t)f->points, what, &read, err));
  memcpy(value, read, (size_t)f->points * sizeof *value);
  free(read);
  return EP_OK;
}

static ep_status read_all(vtu *f, ep_error *err) {
  EP_TRY(walk(f, err));
  if (!f->have_piece) return ep_scan_fail(&f->scan, err, "there is no Piece with points");
  EP_TRY(take_points(f, err));
  EP_TRY(take_cells(f, err));
  for (int i = 0; i < f->ndata; i++) EP_TRY(take_data(f, &f->data[i], err));
  return EP_OK;
}

ep_status ep_read_vtu(ep_raw_mesh *raw, ep_scan scan, ep_error *err) {
  vtu f = {.raw = raw, .scan = scan};
  const ep_status status = read_all(&f, err);
  free(f.data);
  free(f.offset);
  free(f.type);
  return status;
}
