// What is written reads back: .veg to the last bit, .vtu by the rules of VTK's XML format (offsets
// into the appended bytes, each array behind its length as UInt64), the same bytes each time.
#include <math.h>

#include "base/files.h"
#include "mesh/io.h"
#include "tests/mesh/shapes.h"

static void veg_round_trip_keeps_every_bit(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL), back;
  ep_error err = {0};
  for (int i = 0; i < 24; i++) m.x[i] = m.x[i] * M_PI * 1e-7 + sin(i) * 1e-9;
  m.nmaterials = 2;
  m.material = calloc(2, sizeof *m.material);
  m.tet_material = calloc(6, sizeof *m.tet_material);
  m.material[0] = (ep_elastic){1000.1, 1e5 / 3, 0.4};
  m.material[1] = (ep_elastic){2000, 1e9, 0.49};
  m.tet_material[2] = m.tet_material[5] = 1;
  assert_ok(ep_mesh_write_veg("trip.veg", &m, &err), &err);
  assert_ok(ep_mesh_read("trip.veg", &back, NULL, NULL, &err), &err);
  assert_memory_equal(back.x, m.x, 24 * sizeof(double));
  assert_memory_equal(back.tet, m.tet, 24 * sizeof(int));
  assert_int_equal(back.nmaterials, 2);
  assert_memory_equal(back.material, m.material, 2 * sizeof *m.material);
  assert_memory_equal(back.tet_material, m.tet_material, 6 * sizeof(int));
  ep_mesh_free(&m);
  ep_mesh_free(&back);
}

// --- .vtu

typedef struct vtu_file {
  char *text;
  size_t size;
  const char *appended; // behind the underscore
} vtu_file;

static vtu_file open_vtu(const char *path) {
  static const char begin[] = "<AppendedData encoding=\"raw\">\n_";
  vtu_file f;
  ep_error err = {0};
  assert_ok(ep_file_read(path, &f.text, &f.size, &err), &err);
  const char *found = strstr(f.text, begin);
  assert_non_null(found);
  f.appended = found + sizeof begin - 1;
  return f;
}

// The array's bytes; checks its declaration and its length.
static const char *find_array(const vtu_file *f, const char *type, const char *name, int components,
                              uint64_t bytes) {
  char tag[256];
  snprintf(tag, sizeof tag,
           "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%d\" format=\"appended\" "
           "offset=\"",
           type, name, components);
  const char *found = strstr(f->text, tag);
  if (!found) fail_msg("no %s", tag);
  const uint64_t offset = strtoull(found + strlen(tag), NULL, 10);
  uint64_t length;
  memcpy(&length, f->appended + offset, sizeof length);
  assert_int_equal(length, bytes);
  assert_true(f->appended + offset + 8 + bytes < f->text + f->size);
  return f->appended + offset + 8;
}

static void vtu_holds_what_was_given(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL);
  ep_error err = {0};
  double x[24], scalar[8], cell[6];
  for (int i = 0; i < 24; i++) x[i] = m.x[i] + i;
  for (int i = 0; i < 8; i++) scalar[i] = -i;
  for (int i = 0; i < 6; i++) cell[i] = 0.5 * i;
  const ep_field point[] = {{"displacement", 3, x}, {"a<b & \"c\"", 1, scalar}};
  const ep_field on_cell[] = {{"stress", 1, cell}};
  assert_ok(ep_mesh_write_vtu("a.vtu", &m, x, 2, point, 1, on_cell, &err), &err);
  vtu_file f = open_vtu("a.vtu");
  assert_non_null(strstr(f.text, "header_type=\"UInt64\""));
  assert_non_null(strstr(f.text, "NumberOfPoints=\"8\" NumberOfCells=\"6\""));
  assert_memory_equal(find_array(&f, "Float64", "displacement", 3, sizeof x), x, sizeof x);
  assert_memory_equal(find_array(&f, "Float64", "a&lt;b &amp; &quot;c&quot;", 1, sizeof scalar),
                      scalar, sizeof scalar);
  assert_memory_equal(find_array(&f, "Float64", "stress", 1, sizeof cell), cell, sizeof cell);
  assert_memory_equal(find_array(&f, "Float64", "Points", 3, sizeof x), x, sizeof x);
  assert_memory_equal(find_array(&f, "Int32", "connectivity", 1, sizeof cube_tet), cube_tet,
                      sizeof cube_tet);
  const int32_t offsets[] = {4, 8, 12, 16, 20, 24};
  assert_memory_equal(find_array(&f, "Int32", "offsets", 1, sizeof offsets), offsets,
                      sizeof offsets);
  const char *types = find_array(&f, "UInt8", "types", 1, 6);
  for (int e = 0; e < 6; e++) assert_int_equal(types[e], 10);
  // Nothing but the end tags follows the last array.
  assert_string_equal(types + 6, "\n  </AppendedData>\n</VTKFile>\n");
  free(f.text);
  ep_mesh_free(&m);
}

// More tets than the writer's buffer holds.
static void offsets_of_many_tets(void **state) {
  (void)state;
  enum { COUNT = 4096 * 2 + 5 };
  double *x = malloc(12 * COUNT * sizeof *x);
  int *tet = malloc(4 * COUNT * sizeof *tet);
  assert_true(x && tet);
  const double corner[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  for (int i = 0; i < 12 * COUNT; i++) x[i] = corner[i % 12] + 2 * (i / 12);
  for (int i = 0; i < 4 * COUNT; i++) tet[i] = i;
  ep_mesh m;
  ep_error err = {0};
  assert_ok(ep_mesh_make(4 * COUNT, x, COUNT, tet, "many", &m, NULL, &err), &err);
  assert_ok(ep_mesh_write_vtu("many.vtu", &m, NULL, 0, NULL, 0, NULL, &err), &err);
  vtu_file f = open_vtu("many.vtu");
  const char *offsets = find_array(&f, "Int32", "offsets", 1, 4 * COUNT);
  for (int e = 0; e < COUNT; e++) {
    int32_t offset;
    memcpy(&offset, offsets + 4 * e, 4);
    assert_int_equal(offset, 4 * (e + 1));
  }
  free(f.text);
  free(x);
  free(tet);
  ep_mesh_free(&m);
}

static void the_same_mesh_gives_the_same_bytes(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL);
  ep_error err = {0};
  ep_digest a, b;
  assert_ok(ep_mesh_write_vtu("one.vtu", &m, NULL, 0, NULL, 0, NULL, &err), &err);
  assert_ok(ep_mesh_write_vtu("two.vtu", &m, NULL, 0, NULL, 0, NULL, &err), &err);
  assert_ok(ep_hash_file("one.vtu", &a, &err), &err);
  assert_ok(ep_hash_file("two.vtu", &b, &err), &err);
  assert_string_equal(a.hex, b.hex);
  ep_mesh_free(&m);
}

static void pvd_lists_the_steps(void **state) {
  (void)state;
  const double time[] = {0, 1.0 / 60};
  const char *const files[] = {"a_0.vtu", "b&_1.vtu"};
  ep_error err = {0};
  char *text;
  size_t size;
  assert_ok(ep_mesh_write_pvd("a.pvd", 2, time, files, &err), &err);
  assert_ok(ep_file_read("a.pvd", &text, &size, &err), &err);
  assert_non_null(strstr(text, "timestep=\"0\" group=\"\" part=\"0\" file=\"a_0.vtu\"/>"));
  assert_non_null(strstr(text, "timestep=\"0.0166666666667\" "));
  assert_non_null(strstr(text, "file=\"b&amp;_1.vtu\"/>"));
  free(text);
}

static void wrong_fields_and_places_are_refused(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL);
  ep_error err = {0};
  const ep_field two = {"two", 2, m.x};
  assert_int_equal(ep_mesh_write_vtu("x.vtu", &m, NULL, 1, &two, 0, NULL, &err), EP_ERR_ARGUMENT);
  assert_false(ep_path_exists("x.vtu"));
  memset(&err, 0, sizeof err);
  assert_int_equal(ep_mesh_write_veg("absent/x.veg", &m, &err), EP_ERR_IO);
  assert_says(&err, "absent/x.veg");
  ep_mesh_free(&m);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(veg_round_trip_keeps_every_bit),
      cmocka_unit_test(vtu_holds_what_was_given),
      cmocka_unit_test(offsets_of_many_tets),
      cmocka_unit_test(the_same_mesh_gives_the_same_bytes),
      cmocka_unit_test(pvd_lists_the_steps),
      cmocka_unit_test(wrong_fields_and_places_are_refused),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
