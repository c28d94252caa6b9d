// .vtu files: the unit cube and its point data come back to the last bit from every encoding VTK
// writes (text; base64 and raw, inline and appended; zlib in one or several blocks; lengths of 32
// and 64 bits; both byte orders; all number types), and from our own writer. What is wrong is
// refused with its place.
#include <math.h>
#include <zlib.h>

#include "tests/mesh/bytes.h"

typedef enum place { TEXT, INLINE, APPENDED_RAW, APPENDED_BASE64, PLACES } place;

typedef struct vtu {
  bytes head, tail; // tags; appended data
  place place;
  bool wide, zlib, wide_numbers; // wide: UInt64 lengths
  int block;                     // bytes of a zlib block
} vtu;

static void put_base64(bytes *b, const unsigned char *data, size_t size) {
  static const char digit[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  for (size_t i = 0; i < size; i += 3) {
    unsigned bits = 0;
    for (size_t k = 0; k < 3; k++) bits = bits << 8 | (i + k < size ? data[i + k] : 0);
    char out[4];
    for (size_t k = 0; k < 4; k++) out[k] = i + k <= size ? digit[bits >> (18 - 6 * k) & 63] : '=';
    put_raw(b, out, 4);
  }
}

static void put_length(bytes *b, const vtu *v, size_t length) {
  put_bits(b, length, v->wide ? 8 : 4);
}

// Encodes the bytes of an array as VTK does: header and data in one run of base64, with zlib in
// two.
static void put_encoded(bytes *to, const vtu *v, const bytes *data, bool base64) {
  bytes header = {.big_endian = data->big_endian}, packed = {0};
  if (!v->zlib) {
    put_length(&header, v, data->size);
    put_raw(&header, data->data, data->size);
  } else {
    const size_t block = (size_t)v->block, count = (data->size + block - 1) / block;
    put_length(&header, v, count);
    put_length(&header, v, block);
    put_length(&header, v, data->size % block);
    for (size_t i = 0; i < count; i++) {
      unsigned char room[2048];
      uLongf length = sizeof room;
      const size_t left = data->size - i * block;
      assert_int_equal(compress(room, &length, (const Bytef *)data->data + i * block,
                                left < block ? left : block),
                       Z_OK);
      put_length(&header, v, length);
      put_raw(&packed, room, length);
    }
  }
  if (!base64) put_raw(&header, packed.data, packed.size);
  if (!base64) put_raw(to, header.data, header.size);
  if (base64) put_base64(to, (unsigned char *)header.data, header.size);
  if (base64) put_base64(to, (unsigned char *)packed.data, packed.size);
}

static void put_array(vtu *v, const char *type, const char *name, int components, const bytes *data,
                      const char *text) {
  bytes *h = &v->head;
  put(h, "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" ", type, name, components);
  if (v->place == TEXT) {
    put(h, "format=\"ascii\">\n%s\n</DataArray>\n", text);
  } else if (v->place == INLINE) {
    put(h, "format=\"binary\" RangeMin=\"0\">\n<InformationKey name=\"a>b\" location=\"c\">"
           "<Value index=\"0\">1</Value></InformationKey>\n");
    put_encoded(h, v, data, true);
    put(h, "\n</DataArray>\n");
  } else {
    put(h, "format=\"appended\" offset=\"%zu\"/>\n", v->tail.size);
    put_encoded(&v->tail, v, data, v->place == APPENDED_BASE64);
  }
}

static void put_integers(vtu *v, const char *name, int count, const int *value) {
  bytes data = {.big_endian = v->tail.big_endian}, text = {0};
  for (int i = 0; i < count; i++) {
    put_bits(&data, (uint64_t)(int64_t)value[i], v->wide_numbers ? 8 : 4);
    put(&text, "%d ", value[i]);
  }
  put_array(v, v->wide_numbers ? "Int64" : "Int32", name, 1, &data, text.data);
}

static void put_reals(vtu *v, const char *name, int components, int count, const double *value) {
  bytes data = {.big_endian = v->tail.big_endian}, text = {0};
  for (int i = 0; i < count; i++) {
    if (v->wide_numbers)
      put_f64(&data, value[i]);
    else
      put_f32(&data, (float)value[i]);
    put(&text, isnan(value[i]) ? "nan " : "%.17g ", value[i]);
  }
  put_array(v, v->wide_numbers ? "Float64" : "Float32", name, components, &data, text.data);
}

static void put_small(vtu *v, const char *type, const char *name, int count, int from) {
  bytes data = {.big_endian = v->tail.big_endian}, text = {0};
  for (int i = 0; i < count; i++) {
    put_bits(&data, (uint64_t)(from + i), 1);
    put(&text, "%d ", type[0] == 'U' ? (from + i) & 255 : from + i);
  }
  put_array(v, type, name, 1, &data, text.data);
}

static const double paint[8] = {0, 0.25, 0.5, 0.75, 1, -2, 1e30, NAN};
static const int label[8] = {0, 1, 1, 2, 2, 2, -7, 123456};

static bytes cube_file(vtu *v) {
  const bool big = v->tail.big_endian;
  bytes *h = &v->head;
  put(h,
      "\xEF\xBB\xBF<?xml version=\"1.0\"?>\n<!-- a <comment> -->\n<VTKFile type='UnstructuredGrid' "
      "version=\"1.0\" byte_order=\"%sEndian\" header_type=\"%s\"%s>\n<UnstructuredGrid>\n",
      big ? "Big" : "Little", v->wide ? "UInt64" : "UInt32",
      v->zlib ? " compressor=\"vtkZLibDataCompressor\"" : "");
  put(h, "<FieldData><DataArray type=\"String\" Name=\"x\" NumberOfTuples=\"1\" "
         "format=\"ascii\">65 0</DataArray></FieldData>\n"
         "<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"></Piece>\n"
         "<Piece NumberOfPoints=\"8\" NumberOfCells=\"6\">\n<PointData Scalars=\"part\">\n");
  put_integers(v, "part", 8, label);
  put_reals(v, "a&lt;b", 1, 8, paint);
  put_reals(v, "force", 3, 24, cube_x);
  put_small(v, "Int8", "tiny", 8, -4);
  put_small(v, "UInt8", "byte", 8, 250 - 256);
  put(h, "</PointData>\n<CellData/>\n<Points>\n");
  put_reals(v, "Points", 3, 24, cube_x);
  put(h, "</Points>\n<Cells>\n");
  put_integers(v, "connectivity", 24, cube_tet);
  const int offset[6] = {4, 8, 12, 16, 20, 24};
  put_integers(v, "offsets", 6, offset);
  bytes types = {.big_endian = big};
  for (int i = 0; i < 6; i++) put_bits(&types, 10, 1);
  put_array(v, "UInt8", "types", 1, &types, "10 10 10 10 10 10");
  put(h, "</Cells>\n</Piece>\n</UnstructuredGrid>\n");
  if (v->place >= APPENDED_RAW) {
    put(h, "<AppendedData encoding=\"%s\">\n _", v->place == APPENDED_RAW ? "raw" : "base64");
    put_raw(h, v->tail.data, v->tail.size);
    put(h, "\n</AppendedData>\n");
  }
  put(h, "</VTKFile>\n");
  return *h;
}

static const double *scalar(const ep_mesh *m, const char *name) {
  const ep_point_data *data = ep_mesh_data(m, name);
  if (!data || data->components != 1 || !data->value) fail_msg("no scalar '%s'", name);
  return data->value;
}

static void check_cube(const ep_mesh *m, bool wide_numbers) {
  assert_cube(m);
  assert_int_equal(m->ndata, 5);
  const double *part = scalar(m, "part"), *painted = scalar(m, "a<b");
  for (int i = 0; i < 8; i++) {
    assert_true(part[i] == label[i]);
    assert_true(scalar(m, "tiny")[i] == i - 4);
    assert_true(scalar(m, "byte")[i] == (250 + i) % 256);
    const double expected = wide_numbers ? paint[i] : (double)(float)paint[i];
    assert_true(isnan(paint[i]) ? isnan(painted[i]) : painted[i] == expected);
  }
  assert_null(ep_mesh_data(m, "force")->value);
  assert_int_equal(ep_mesh_data(m, "force")->components, 3);
}

static void every_encoding_gives_the_cube(void **state) {
  (void)state;
  int files = 0;
  for (int kind = 0; kind < 64; kind++) {
    vtu v = {.place = (place)(kind % 4), .block = kind & 4 ? 64 : 1000};
    v.zlib = kind & 8;
    v.wide = kind & 16;
    v.wide_numbers = kind & 32;
    v.tail.big_endian = kind & 4;
    if (v.place == TEXT && !v.wide_numbers) v.wide_numbers = true; // text keeps all digits
    const bytes b = cube_file(&v);
    ep_mesh m = parse_ok(EP_MESH_VTU, &b, NULL);
    check_cube(&m, v.wide_numbers);
    ep_mesh_free(&m);
    files++;
  }
  assert_int_equal(files, 64);
}

// Some writers encode the length and the data each on its own, so that padding stands between.
static void length_encoded_apart(void **state) {
  (void)state;
  const char *text =
      "<VTKFile type=\"UnstructuredGrid\" byte_order=\"LittleEndian\"><UnstructuredGrid>"
      "<Piece NumberOfPoints=\"4\" NumberOfCells=\"1\"><PointData>"
      "<DataArray type=\"UInt8\" Name=\"p\" format=\"binary\">BAAAAA== AQIDBA==</DataArray>"
      "</PointData><Points><DataArray type=\"UInt8\" NumberOfComponents=\"3\" format=\"ascii\">"
      "0 0 0 1 0 0 0 1 0 0 0 1</DataArray></Points><Cells>"
      "<DataArray type=\"Int32\" Name=\"connectivity\">0 1 2 3</DataArray>"
      "<DataArray type=\"Int32\" Name=\"offsets\">4</DataArray>"
      "<DataArray type=\"UInt8\" Name=\"types\">10</DataArray></Cells></Piece></UnstructuredGrid>"
      "</VTKFile>";
  bytes b = {0};
  put_raw(&b, text, strlen(text));
  ep_mesh m = parse_ok(EP_MESH_VTU, &b, NULL);
  for (int i = 0; i < 4; i++) assert_true(scalar(&m, "p")[i] == i + 1);
  ep_mesh_free(&m);
}

static void what_we_write_is_read(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL), back;
  ep_error err = {0};
  double x[24];
  for (int i = 0; i < 24; i++) x[i] = m.x[i] * M_PI + sin(i) * 1e-9;
  memcpy(m.x, x, sizeof x);
  const ep_field point[] = {{"weight & <more>", 1, x + 3}, {"push", 3, x}};
  const ep_field cell[] = {{"stress", 1, x}};
  assert_ok(ep_mesh_write_vtu("own.vtu", &m, NULL, 2, point, 1, cell, &err), &err);
  assert_ok(ep_mesh_read("own.vtu", &back, NULL, NULL, &err), &err);
  assert_memory_equal(back.x, x, sizeof x);
  assert_memory_equal(back.tet, m.tet, 24 * sizeof(int));
  assert_int_equal(back.ndata, 2);
  assert_memory_equal(scalar(&back, "weight & <more>"), x + 3, 8 * sizeof *x);
  ep_mesh_free(&m);
  ep_mesh_free(&back);
}

// Values follow their vertices when unused ones are left out; a copy has its own.
static void data_follow_the_vertices(void **state) {
  (void)state;
  bytes b = {0};
  put(&b, "# vtk DataFile Version 4.2\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 6 float\n"
          "9 9 9 0 0 0 1 0 0 8 8 8 0 1 0 0 0 1\nCELLS 1 5\n4 1 2 4 5\nCELL_TYPES 1\n10\n"
          "CELL_DATA 1\nVECTORS flow float\n1 2 3\nFIELD more 1\ntag 2 1 int\n4 5\n"
          "POINT_DATA 6\nSCALARS my%%20part int 1\nLOOKUP_TABLE colors\n10 11 12 13 14 15\n"
          "LOOKUP_TABLE colors 2\n0 0 0 1 1 1 1 1\nSCALARS pair float 2\n"
          "1 2 1 2 1 2 1 2 1 2 1 2\nCOLOR_SCALARS c 3\n0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n"
          "NORMALS n float\n0 0 1 0 0 1 0 0 1 0 0 1 0 0 1 0 0 1\n"
          "FIELD FieldData 2\nweight 1 6 double\n0 .1 .2 nan .4 .5\nMETADATA\nINFORMATION 0\n\n"
          "triple 3 6 int\n0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0 0\n"
          "FIELD text 1\nnames 1 6 string\na\nb\n\nd\ne\nf\n");
  ep_mesh_findings f;
  ep_mesh m = parse_ok(EP_MESH_VTK, &b, &f), copy;
  ep_error err = {0};
  assert_ok(ep_mesh_copy(&m, &copy, &err), &err);
  ep_mesh_free(&m);
  const double part[] = {11, 12, 14, 15}, weight[] = {.1, .2, .4, .5};
  assert_memory_equal(scalar(&copy, "my part"), part, sizeof part);
  assert_memory_equal(scalar(&copy, "weight"), weight, sizeof weight);
  assert_int_equal(ep_mesh_data(&copy, "pair")->components, 2);
  assert_null(ep_mesh_data(&copy, "flow"));
  assert_null(ep_mesh_data(&copy, "names"));
  assert_int_equal(f.unread_arrays, 1);
  assert_string_equal(f.first_unread_array, "names");
  ep_mesh_free(&copy);
}

// Binary numbers of legacy files are big-endian.
static void binary_legacy_data(void **state) {
  (void)state;
  bytes b = {.big_endian = true};
  put(&b, "# vtk DataFile Version 5.1\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 double\n");
  for (int i = 0; i < 12; i++) put_f64(&b, i / 3 == 1 + i % 3);
  put(&b, "\nCELLS 2 4\nOFFSETS vtktypeint64\n");
  put_i64(&b, 0), put_i64(&b, 4);
  put(&b, "\nCONNECTIVITY vtktypeint64\n");
  for (int i = 0; i < 4; i++) put_i64(&b, i);
  put(&b, "\nCELL_TYPES 1\n");
  put_i32(&b, 10);
  put(&b, "\nPOINT_DATA 4\nSCALARS part unsigned_short\nLOOKUP_TABLE default\n");
  for (int i = 0; i < 4; i++) put_bits(&b, 65530u + (unsigned)i, 2);
  put(&b, "\nFIELD FieldData 1\nweight 1 4 float\n");
  for (int i = 0; i < 4; i++) put_f32(&b, 0.25f * (float)i);
  put(&b, "\n");
  ep_mesh m = parse_ok(EP_MESH_VTK, &b, NULL);
  for (int i = 0; i < 4; i++) {
    assert_true(scalar(&m, "part")[i] == 65530 + i);
    assert_true(scalar(&m, "weight")[i] == 0.25 * i);
  }
  ep_mesh_free(&m);
}

// ---- what is wrong

typedef struct damage {
  const char *from, *to; // replaced in the text of the cube
  ep_status status;
  const char *says;
} damage;

static const damage damages[] = {
    {"VTKFile type", "File type", EP_ERR_FORMAT, "VTKFile"},
    {"'UnstructuredGrid'", "'ImageData'", EP_ERR_UNSUPPORTED, "UnstructuredGrid"},
    {"header_type=\"UInt32\"", "compressor=\"vtkLZ4DataCompressor\"", EP_ERR_UNSUPPORTED, "zlib"},
    {"NumberOfPoints=\"0\"", "NumberOfPoints=\"1\"", EP_ERR_UNSUPPORTED, "second Piece"},
    {"NumberOfPoints=\"8\"", "NumberOfPoints=\"9\"", EP_ERR_FORMAT, "27 numbers"},
    {"NumberOfPoints=\"8\"", "NumberOfPoints=\"7\"", EP_ERR_FORMAT, "too much"},
    {"NumberOfPoints=\"8\"", "NumberOfPoints=\"99999999\"", EP_ERR_FORMAT, "fewer"},
    {"NumberOfPoints=\"8\"", "NumberOfPoints=\"-8\"", EP_ERR_FORMAT, "NumberOfPoints"},
    {"NumberOfCells=\"6\"", "NumberOfCells=\"7\"", EP_ERR_FORMAT, "missing"},
    {"Name=\"offsets\"", "Name=\"Offset\"", EP_ERR_FORMAT, "offsets"},
    {"Name=\"types\"", "Name=\"kinds\"", EP_ERR_FORMAT, "types"},
    {"Int64\" Name=\"connectivity\"", "Float64\" Name=\"connectivity\"", EP_ERR_FORMAT, "whole"},
    {"4 8 12 16 20 24", "4 8 12 11 20 24", EP_ERR_FORMAT, "cell 4"},
    {"4 8 12 16 20 24", "4 9 12 16 20 24", EP_ERR_FORMAT, "5 vertices"},
    {"10 10 10", "10 300 10", EP_ERR_FORMAT, "300"},
    {"format=\"ascii\"", "format=\"packed\"", EP_ERR_FORMAT, "packed"},
    {"format=\"ascii\"", "format=\"appended\" offset=\"0\"", EP_ERR_FORMAT, "AppendedData"},
    {"</VTKFile>", "<", EP_ERR_FORMAT, "tag"},
    {"-4 -3", "-4 x", EP_ERR_FORMAT, "'x'"},
    {"-4 -3", "-4", EP_ERR_FORMAT, "missing"},
    {"</DataArray>\n</Cells>", "", EP_ERR_FORMAT, "does not end"},
};

static void replace(bytes *b, const char *from, const char *to) {
  b->data[b->size] = '\0';
  char *found = strstr(b->data, from);
  // The first array of the points is the second DataArray; the format of FieldData is not looked
  // at.
  if (found && strncmp(from, "format", 6) == 0) found = strstr(found + 1, from);
  if (!found) fail_msg("no '%s'", from);
  const size_t tail = strlen(found + strlen(from)) + 1;
  memmove(found + strlen(to), found + strlen(from), tail);
  memcpy(found, to, strlen(to));
  b->size = strlen(b->data);
}

static void wrong_text_is_refused(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof damages / sizeof *damages; i++) {
    const damage *d = &damages[i];
    vtu v = {.place = TEXT, .wide_numbers = true};
    bytes b = cube_file(&v);
    ep_mesh m;
    ep_error err = {0};
    replace(&b, d->from, d->to);
    const ep_status status = parse(EP_MESH_VTU, &b, &m, NULL, &err);
    if (status != d->status || !strstr(err.text, d->says) || !strstr(err.text, "memory:"))
      fail_msg("%s -> %s: status %d, '%s'", d->from, d->to, (int)status, err.text);
  }
}

// Cut anywhere before its last tags, or with any byte of its data changed, a packed file is refused
// or gives a mesh that holds together.
static void cut_and_changed_binary(void **state) {
  (void)state;
  int refused = 0, checked = 0;
  for (int kind = 0; kind < 4; kind++) {
    vtu v = {.place = kind & 1 ? INLINE : APPENDED_RAW, .zlib = kind & 2, .block = 64};
    const bytes whole = cube_file(&v);
    for (size_t at = 3; at + 40 < whole.size; at += 7) {
      bytes b = whole;
      ep_mesh m;
      ep_error err = {0};
      b.size = at;
      assert_int_not_equal(parse(EP_MESH_VTU, &b, &m, NULL, &err), EP_OK);
      b = whole;
      b.data[at] = (char)(b.data[at] ^ 0x55);
      memset(&err, 0, sizeof err);
      checked++;
      if (parse(EP_MESH_VTU, &b, &m, NULL, &err) == EP_OK) {
        for (int i = 0; i < 4 * m.nt; i++) assert_in_range(m.tet[i], 0, m.nv - 1);
        ep_mesh_free(&m);
      } else {
        assert_true(err.text[0] != '\0');
        refused++;
      }
    }
  }
  assert_true(refused > checked / 4);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_encoding_gives_the_cube),
      cmocka_unit_test(length_encoded_apart),
      cmocka_unit_test(what_we_write_is_read),
      cmocka_unit_test(data_follow_the_vertices),
      cmocka_unit_test(binary_legacy_data),
      cmocka_unit_test(wrong_text_is_refused),
      cmocka_unit_test(cut_and_changed_binary),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
