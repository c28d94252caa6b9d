// align/regions: the authors' layout is read as written; whatever is wrong is told with its line.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "align/align.h"
#include "base/files.h"

// Two tets sharing a face; the first mesh's file has an unused vertex 2 (counted from 1).
typedef struct fixture {
  ep_mesh a, b;
  const ep_mesh *meshes[2];
} fixture;

static int make(void **state) {
  static fixture f;
  const double x[18] = {0, 0, 0, 9, 9, 9, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
  const int tet[8] = {0, 2, 3, 4, 2, 3, 4, 5};
  const double y[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
  const int tet_b[8] = {0, 1, 2, 3, 1, 2, 3, 4};
  ep_error err = {0};
  if (ep_mesh_make(6, x, 2, tet, "a.veg", &f.a, NULL, &err) != EP_OK) return -1;
  if (ep_mesh_make(5, y, 2, tet_b, "b.veg", &f.b, NULL, &err) != EP_OK) return -1;
  f.meshes[0] = &f.a;
  f.meshes[1] = &f.b;
  *state = &f;
  return 0;
}

static int release(void **state) {
  fixture *f = *state;
  ep_mesh_free(&f->a);
  ep_mesh_free(&f->b);
  return 0;
}

static void reads_the_layout(void **state) {
  const fixture *f = *state;
  ep_regions r;
  ep_error err = {0};
  const char *text = "2\r\n1;3;2;3;\r\n1;2;\n\n 6 ; 5\n5,4;";
  assert_int_equal(ep_regions_parse("r.ini", text, 2, f->meshes, &r, &err), EP_OK);
  assert_int_equal(r.count, 2);
  assert_int_equal(r.shapes, 2);
  // File vertex 2 of a is used by no tet, so file vertices 3.. are mesh vertices 1..; 3 came twice.
  const int start[5] = {0, 2, 4, 6, 8}, vertex[8] = {0, 1, 0, 1, 4, 3, 4, 3};
  assert_memory_equal(r.start, start, sizeof start);
  assert_memory_equal(r.vertex, vertex, sizeof vertex);
  ep_regions_free(&r);
  assert_null(r.start);
}

static void refused(const fixture *f, const char *text, const char *where) {
  ep_regions r;
  ep_error err = {0};
  assert_int_equal(ep_regions_parse("r.ini", text, 2, f->meshes, &r, &err), EP_ERR_FORMAT);
  if (!strstr(err.text, where)) fail_msg("'%s' does not say '%s'", err.text, where);
  assert_null(r.start);
  assert_null(r.vertex);
}

static void tells_what_is_wrong_and_where(void **state) {
  const fixture *f = *state;
  refused(f, "", "r.ini:1: the file ends");
  refused(f, "x", "r.ini:1: 'x'");
  refused(f, "0\n", "r.ini:1: the number of regions is 0");
  refused(f, "99999999999999999999\n1;\n", "r.ini:1: the number of regions");
  refused(f, "2000000\n1;\n", "of 4000000 lines");
  refused(f, "1 2\n1;\n1;\n", "r.ini:1: '2'");
  refused(f, "1\n1;\n", "after 1 of 2 lines");
  refused(f, "1\n1;7;\n1;\n", "r.ini:2: region 1 names vertex 7, but a.veg has vertices 1 to 6");
  refused(f, "1\n1;\n\n6;\n", "r.ini:4: region 1 names vertex 6, but b.veg");
  refused(f, "1\n0;\n1;\n", "r.ini:2: region 1 names vertex 0");
  refused(f, "1\n1;-3;\n1;\n", "r.ini:2: '-'");
  refused(f, "1\n1;99999999999999999999;\n1;\n", "r.ini:2: region 1 names vertex");
  refused(f, "1\n;\n1;\n", "r.ini:2: region 1 has no vertices on a.veg");
  refused(f, "1\n2;\n1;\n", "r.ini:2: region 1 has no vertices on a.veg"); // unused vertex only
  refused(f, "1\n1;\n1;\n3;\n", "r.ini:4: more lines than 1 regions for 2 shapes");
}

static void reads_files(void **state) {
  const fixture *f = *state;
  ep_regions r;
  ep_error err = {0};
  assert_int_equal(ep_file_write("good.ini", "1\n1;\n2;\n", 8, &err), EP_OK);
  assert_int_equal(ep_regions_read("good.ini", 2, f->meshes, &r, &err), EP_OK);
  ep_regions_free(&r);
  assert_int_equal(ep_file_write("zero.ini", "1\n1;\0002;\n", 8, &err), EP_OK);
  assert_int_equal(ep_regions_read("zero.ini", 2, f->meshes, &r, &err), EP_ERR_FORMAT);
  err = (ep_error){0};
  assert_int_equal(ep_regions_read("absent.ini", 2, f->meshes, &r, &err), EP_ERR_IO);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(reads_the_layout),
      cmocka_unit_test(tells_what_is_wrong_and_where),
      cmocka_unit_test(reads_files),
  };
  return cmocka_run_group_tests_name("align/regions", tests, make, release);
}
