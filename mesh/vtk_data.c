// Arrays of legacy VTK files: FIELD, SCALARS, VECTORS and the rest of the attributes. Scalars of
// the points are kept, everything else is passed over.
#include <limits.h>
#include <string.h>

#include "mesh/vtk.h"

// Names are written with %20 for a blank.
static ep_token decode_name(ep_token name, char out[EP_NAME_MAX]) {
  int used = 0;
  for (int i = 0; i < name.length && used + 1 < EP_NAME_MAX; i++) {
    char digits[3] = "";
    char c = name.text[i];
    if (c == '%' && i + 2 < name.length) {
      memcpy(digits, name.text + i + 1, 2);
      if (strspn(digits, "0123456789abcdefABCDEF") == 2) {
        const char *hex = "0123456789abcdef0123456789ABCDEF";
        c = (char)(16 * ((strchr(hex, digits[0]) - hex) % 16) +
                   (strchr(hex, digits[1]) - hex) % 16);
        i += 2;
      }
    }
    out[used++] = c;
  }
  return (ep_token){out, used};
}

static ep_status skip_values(ep_vtk *f, ep_number type, uint64_t count, ep_error *err) {
  if (!f->binary)
    return ep_scan_skip_numbers(&f->scan, (long long)count, "a number of an array", err);
  EP_TRY(ep_scan_need(&f->scan, count, "an array", err)); // so that the product fits
  EP_TRY(ep_scan_need(&f->scan, count * ep_number_size(type), "an array", err));
  f->scan.at += count * ep_number_size(type);
  return EP_OK;
}

static ep_status keep_values(ep_vtk *f, ep_number type, double *value, ep_error *err) {
  const size_t size = ep_number_size(type);
  if (f->binary)
    EP_TRY(ep_scan_need(&f->scan, (uint64_t)f->tuples * size, "an array of the points", err));
  for (int i = 0; i < f->tuples; i++) {
    if (f->binary) {
      value[i] = ep_number_real(type, f->scan.at, !ep_machine_big_endian());
      f->scan.at += size;
    } else {
      EP_TRY(ep_scan_any_double(&f->scan, "a number of an array", &value[i], err));
    }
  }
  return EP_OK;
}

// The numbers of one array, whose announcement has been read.
static ep_status read_values(ep_vtk *f, ep_token name, ep_number type, int components, int tuples,
                             ep_error *err) {
  char decoded[EP_NAME_MAX];
  double *value;
  ep_vtk_begin_data(f);
  if (!f->in_points) return skip_values(f, type, (uint64_t)components * (uint64_t)tuples, err);
  EP_TRY(ep_raw_data(f->raw, decode_name(name, decoded), components, &value, err));
  return value ? keep_values(f, type, value, err)
               : skip_values(f, type, (uint64_t)components * (uint64_t)tuples, err);
}

// An array of strings, bits or the like: how long it is cannot be told, so the reading ends.
static bool unreadable(ep_vtk *f, ep_token name, bool *stop) {
  static const char *const words[] = {"string", "bit", "utf8_string", "variant"};
  const ep_token type = ep_scan_peek(&f->scan);
  for (size_t i = 0; i < sizeof words / sizeof *words; i++) *stop |= ep_token_is(type, words[i]);
  if (*stop) ep_raw_unread(f->raw, name);
  return *stop;
}

// "FIELD name n", then n times "name components tuples type" and the numbers.
static ep_status read_field(ep_vtk *f, bool *stop, ep_error *err) {
  int arrays, components, tuples;
  ep_token name;
  ep_number type = EP_INT64;
  ep_scan_token(&f->scan, &name);
  EP_TRY(ep_scan_int(&f->scan, "the number of arrays", 0, EP_MESH_LIMIT, &arrays, err));
  for (int i = 0; i < arrays; i++) {
    if (ep_token_is(ep_scan_peek(&f->scan), "METADATA")) ep_vtk_skip_metadata(f);
    ep_scan_token(&f->scan, &name);
    EP_TRY(ep_scan_int(&f->scan, "the components of an array", 0, INT_MAX, &components, err));
    EP_TRY(ep_scan_int(&f->scan, "the tuples of an array", 0, INT_MAX, &tuples, err));
    if (f->in_points && tuples != f->tuples)
      return ep_scan_fail(&f->scan, err, "array '%.*s' has %d tuples for %d points",
                          name.length < 40 ? name.length : 40, name.text, tuples, f->tuples);
    if (unreadable(f, name, stop)) return EP_OK;
    EP_TRY(ep_vtk_read_type(f, &type, err));
    EP_TRY(read_values(f, name, type, components, tuples, err));
  }
  return EP_OK;
}

// "SCALARS name type [components]", and mostly "LOOKUP_TABLE name" before the numbers.
static ep_status read_scalars(ep_vtk *f, bool *stop, ep_error *err) {
  int components = 1;
  ep_scan line;
  ep_token name;
  ep_number type = EP_INT64;
  ep_vtk on_line = *f;
  if (!ep_scan_line(&f->scan, &line)) return ep_vtk_fail(f, err, "the name of an array is missing");
  on_line.scan = line;
  ep_scan_token(&on_line.scan, &name);
  if (unreadable(&on_line, name, stop)) return EP_OK;
  EP_TRY(ep_vtk_read_type(&on_line, &type, err));
  if (ep_scan_peek(&on_line.scan).length)
    EP_TRY(ep_scan_int(&on_line.scan, "the components of an array", 1, 4, &components, err));
  if (ep_token_is(ep_scan_peek(&f->scan), "LOOKUP_TABLE")) {
    ep_token word;
    ep_scan_token(&f->scan, &word);
    ep_scan_token(&f->scan, &word);
  }
  return read_values(f, name, type, components, f->tuples, err);
}

// "COLOR_SCALARS name n" for each tuple, "LOOKUP_TABLE name size" with four numbers an entry:
// bytes in binary files, numbers up to 1 in others.
static ep_status skip_colors(ep_vtk *f, bool table, ep_error *err) {
  ep_token name;
  int count;
  ep_scan_token(&f->scan, &name);
  EP_TRY(ep_scan_int(&f->scan, table ? "the size of a table" : "the numbers of a color", 0, 1 << 20,
                     &count, err));
  ep_vtk_begin_data(f);
  return skip_values(f, EP_UINT8, (uint64_t)count * (uint64_t)(table ? 4 : f->tuples), err);
}

// "WORD name type" with a given number of components; texture coordinates say theirs.
static ep_status read_attribute(ep_vtk *f, int components, bool *stop, ep_error *err) {
  ep_token name;
  ep_number type = EP_INT64;
  ep_scan_token(&f->scan, &name);
  if (components == 0)
    EP_TRY(ep_scan_int(&f->scan, "the components of an array", 1, 3, &components, err));
  if (unreadable(f, name, stop)) return EP_OK;
  EP_TRY(ep_vtk_read_type(f, &type, err));
  return read_values(f, name, type, components, f->tuples, err);
}

ep_status ep_vtk_read_data(ep_vtk *f, ep_token word, bool *taken, bool *stop, ep_error *err) {
  static const struct {
    const char *word;
    int components;
  } known[] = {
      {"VECTORS", 3},    {"NORMALS", 3},      {"TENSORS", 9},    {"TENSORS6", 6},
      {"GLOBAL_IDS", 1}, {"PEDIGREE_IDS", 1}, {"EDGE_FLAGS", 1}, {"TEXTURE_COORDINATES", 0}};
  *taken = true;
  if (ep_token_is(word, "FIELD")) return read_field(f, stop, err);
  if (f->tuples >= 0) {
    if (ep_token_is(word, "SCALARS")) return read_scalars(f, stop, err);
    if (ep_token_is(word, "COLOR_SCALARS")) return skip_colors(f, false, err);
    if (ep_token_is(word, "LOOKUP_TABLE")) return skip_colors(f, true, err);
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
      if (ep_token_is(word, known[i].word))
        return read_attribute(f, known[i].components, stop, err);
  }
  *taken = false;
  return EP_OK;
}
