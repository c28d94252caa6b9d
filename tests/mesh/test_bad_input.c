// Files that are wrong: each gives an error of the right kind that names the line (or byte) and the
// cause, and never a mesh, a crash, or memory by the size a header claims.
#include <sys/resource.h>
#include <sys/stat.h>

#include "tests/mesh/bytes.h"

typedef struct bad_text {
  ep_mesh_format format;
  ep_status status;
  const char *says[2];
  const char *text;
} bad_text;

#define VEG_VERTICES "*VERTICES\n4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n"
#define VEG_MESH     VEG_VERTICES "*ELEMENTS\nTET\n1 4 0\n1 1 2 3 4\n"
#define MSH_FORMAT   "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"
#define MSH_NODES    "$Nodes\n4\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n$EndNodes\n"
#define VTK_HEAD     "# vtk DataFile Version 4.2\nt\nASCII\nDATASET UNSTRUCTURED_GRID\n"
#define VTK_POINTS   "POINTS 4 double\n0 0 0 1 0 0 0 1 0 0 0 1\n"
#define MEDIT_HEAD   "MeshVersionFormatted 2\nDimension 3\n"
#define MEDIT_POINTS "Vertices 4\n0 0 0 0\n1 0 0 0\n0 1 0 0\n0 0 1 0\n"
#define NODE         "4 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n"

static const bad_text bad[] = {
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory", "empty"}, " \n\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:1:", "no section"}, "*VERTEX\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:4:", "too early"},
     "*VERTICES\n3 3 0 0\n1 0 0 0\n2 1 0 0\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:4:", "missing"}, "*VERTICES\n2 3\n1 0 0 0\n*ELEMENTS\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "no section"}, "*VERTICES\n0 3\n1 0 0 0\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "'nan'"}, "*VERTICES\n1 3 0 0\n1 0 nan 0\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "'inf'"}, "*VERTICES\n1 3 0 0\n1 0 0 inf\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "1e999"}, "*VERTICES\n1 3 0 0\n1 0 0 1e999\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "0x10"}, "*VERTICES\n1 3 0 0\n1 0 0 0x10\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "1.5abc"}, "*VERTICES\n1 3 0 0\n1 0 0 1.5abc\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "coordinate"}, "*VERTICES\n1 3 0 0\n1 0 0\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "too much"}, "*VERTICES\n1 3 0 0\n1 0 0 0 0\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:2:", "-5"}, "*VERTICES\n-5 3 0 0\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:2:", "99999999999999999999"},
     "*VERTICES\n99999999999999999999 3\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:3:", "begin at 0 or 1"}, "*VERTICES\n1 3\n2 0 0 0\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:4:", "2 comes next"},
     "*VERTICES\n2 3\n1 0 0 0\n1 1 0 0\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:10:", "1 to 4"},
     VEG_VERTICES "*ELEMENTS\nTET\n1 4 0\n1 1 2 3 5\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:10:", "1 to 4"},
     VEG_VERTICES "*ELEMENTS\nTET\n1 4 0\n1 0 1 2 3\n"},
    {EP_MESH_VEG,
     EP_ERR_UNSUPPORTED,
     {"memory:8:", "CUBIC"},
     VEG_VERTICES "*ELEMENTS\nCUBIC\n1 8 0\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory", "*ELEMENTS"}, VEG_VERTICES},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:1:", "before"}, "*ELEMENTS\nTET\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:7:", "second"}, VEG_VERTICES VEG_VERTICES},
    {EP_MESH_VEG, EP_ERR_MESH, {"memory", "no tets"}, VEG_VERTICES "*ELEMENTS\nTET\n0 4 0\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:12:", "no material"},
     VEG_MESH "*REGION\nallElements, M\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:14:", "no set"},
     VEG_MESH "*MATERIAL M\nENU, 1, 1, 0\n*REGION\nS, M\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:11:", "element 2"},
     VEG_MESH "*SET S\n2\n*MATERIAL M\nENU, 1, 1, 0\n*REGION\nS, M\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory", "element 1 has no material"},
     VEG_MESH "*SET S\n*MATERIAL M\nENU, 1, 1, 0\n*REGION\nS, M\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:12:", "[0, 0.5)"},
     VEG_MESH "*MATERIAL M\nENU, 1, 1, 0.5\n"},
    {EP_MESH_VEG,
     EP_ERR_FORMAT,
     {"memory:12:", "above 0"},
     VEG_MESH "*MATERIAL M\nENU, 0, 1, 0.4\n"},
    {EP_MESH_VEG,
     EP_ERR_UNSUPPORTED,
     {"memory:12:", "MOONEY"},
     VEG_MESH "*MATERIAL M\nMOONEYRIVLIN, 1\n"},
    {EP_MESH_VEG, EP_ERR_FORMAT, {"memory:11:", "*INCLUDE"}, VEG_MESH "*INCLUDE m.txt\n"},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory", "empty"}, ""},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory:1:", "$MeshFormat"}, "hello\n"},
    {EP_MESH_MSH, EP_ERR_UNSUPPORTED, {"memory:1:", "version 1"}, "$NOD\n1\n"},
    {EP_MESH_MSH, EP_ERR_UNSUPPORTED, {"memory:2:", "4.1 or 2.2"}, "$MeshFormat\n4 0 8\n"},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory:2:", "size"}, "$MeshFormat\n2.2 0 4\n"},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory", "$Nodes"}, MSH_FORMAT},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory:4:", "before"}, MSH_FORMAT "$Elements\n1\n"},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory:4:", "does not end"}, MSH_FORMAT "$Strange\n1 2 3\n"},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory:4:", "expected"}, MSH_FORMAT "junk\n"},
    {EP_MESH_MSH, EP_ERR_FORMAT, {"memory:6:", "missing"}, MSH_FORMAT "$Nodes\n4\n1 0 0 0\n"},
    {EP_MESH_MSH,
     EP_ERR_FORMAT,
     {"memory:7:", "expected"},
     MSH_FORMAT "$Nodes\n1\n1 0 0 0\n2 0 0 0\n$EndNodes\n"},
    {EP_MESH_MSH,
     EP_ERR_FORMAT,
     {"memory", "number 1"},
     MSH_FORMAT "$Nodes\n2\n1 0 0 0\n1 0 0 0\n$EndNodes\n"},
    {EP_MESH_MSH,
     EP_ERR_FORMAT,
     {"memory:6:", "NaN"},
     MSH_FORMAT "$Nodes\n1\n1 0 NaN 0\n$EndNodes\n"},
    {EP_MESH_MSH,
     EP_ERR_FORMAT,
     {"memory:13:", "(1, 9)"},
     MSH_FORMAT MSH_NODES "$Elements\n1\n1 4 0 1 2 3 9\n"},
    {EP_MESH_MSH,
     EP_ERR_UNSUPPORTED,
     {"memory:13:", "type 777"},
     MSH_FORMAT MSH_NODES "$Elements\n1\n1 777 0 1\n"},
    {EP_MESH_MSH,
     EP_ERR_MESH,
     {"memory", "no tets"},
     MSH_FORMAT MSH_NODES "$Elements\n1\n1 2 0 1 2 3\n$EndElements\n"},
    {EP_MESH_VTK, EP_ERR_FORMAT, {"memory", "empty"}, "\n"},
    {EP_MESH_VTK, EP_ERR_FORMAT, {"memory:1:", "legacy VTK"}, "<?xml version=\"1.0\"?>\n"},
    {EP_MESH_VTK,
     EP_ERR_UNSUPPORTED,
     {"memory:1:", "version 7"},
     "# vtk DataFile Version 7.0\nt\nASCII\n"},
    {EP_MESH_VTK,
     EP_ERR_FORMAT,
     {"memory:3:", "ASCII or BINARY"},
     "# vtk DataFile Version 4.2\nt\nTEXT\n"},
    {EP_MESH_VTK,
     EP_ERR_UNSUPPORTED,
     {"memory:4:", "POLYDATA"},
     "# vtk DataFile Version 4.2\nt\nASCII\nDATASET POLYDATA\n"},
    {EP_MESH_VTK, EP_ERR_FORMAT, {"memory:5:", "expected"}, VTK_HEAD "NONSENSE 4\n"},
    {EP_MESH_VTK, EP_ERR_FORMAT, {"memory:5:", "missing"}, VTK_HEAD "POINTS 4 double 0 0 0"},
    {EP_MESH_VTK, EP_ERR_FORMAT, {"memory:5:", "number type"}, VTK_HEAD "POINTS 4 quaternion\n"},
    {EP_MESH_VTK,
     EP_ERR_FORMAT,
     {"memory:8:", "0 to 3"},
     VTK_HEAD VTK_POINTS "CELLS 1 5\n4 0 1 2 4\n"},
    {EP_MESH_VTK,
     EP_ERR_FORMAT,
     {"memory:8:", "more"},
     VTK_HEAD VTK_POINTS "CELLS 1 4\n4 0 1 2 3\n"},
    {EP_MESH_VTK,
     EP_ERR_FORMAT,
     {"memory:8:", "fewer"},
     VTK_HEAD VTK_POINTS "CELLS 1 6\n4 0 1 2 3\n"},
    {EP_MESH_VTK,
     EP_ERR_FORMAT,
     {"memory:9:", "2 cell types"},
     VTK_HEAD VTK_POINTS "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 2\n10\n10\n"},
    {EP_MESH_VTK,
     EP_ERR_FORMAT,
     {"memory:10:", "4 vertices"},
     VTK_HEAD VTK_POINTS "CELLS 1 4\n3 0 1 2\nCELL_TYPES 1\n10\n"},
    {EP_MESH_VTK,
     EP_ERR_FORMAT,
     {"memory:8:", "CELL_TYPES"},
     VTK_HEAD VTK_POINTS "CELLS 1 5\n4 0 1 2 3\n"},
    {EP_MESH_VTK,
     EP_ERR_MESH,
     {"memory", "linear"},
     VTK_HEAD VTK_POINTS "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n24\n"},
    {EP_MESH_MEDIT, EP_ERR_FORMAT, {"memory", "empty"}, ""},
    {EP_MESH_MEDIT, EP_ERR_FORMAT, {"memory:1:", "MeshVersionFormatted"}, "solid x\n"},
    {EP_MESH_MEDIT,
     EP_ERR_FORMAT,
     {"memory:2:", "Dimension"},
     "MeshVersionFormatted 2\nDimension 2\n"},
    {EP_MESH_MEDIT, EP_ERR_FORMAT, {"memory:2:", "Vertices"}, MEDIT_HEAD},
    {EP_MESH_MEDIT, EP_ERR_FORMAT, {"memory:4:", "missing"}, MEDIT_HEAD "Vertices 2\n0 0 0 0\n"},
    {EP_MESH_MEDIT,
     EP_ERR_FORMAT,
     {"memory:5:", "keyword"},
     MEDIT_HEAD "Vertices 1\n0 0 0 0\n1 1 1 0\n"},
    {EP_MESH_MEDIT,
     EP_ERR_FORMAT,
     {"memory:9:", "vertex 5"},
     MEDIT_HEAD MEDIT_POINTS "Tetrahedra 1\n1 2 3 5 0\n"},
    {EP_MESH_MEDIT,
     EP_ERR_FORMAT,
     {"memory:9:", "0 to 3"},
     MEDIT_HEAD MEDIT_POINTS "Tetrahedra 1\n0 2 3 4 0\n"},
    {EP_MESH_MEDIT,
     EP_ERR_MESH,
     {"memory", "linear"},
     MEDIT_HEAD MEDIT_POINTS "TetrahedraP2 1\n1 2 3 4 1 2 3 4 1 2 0\nEnd\n"},
    {EP_MESH_TETGEN, EP_ERR_FORMAT, {"memory", "empty"}, ""},
    {EP_MESH_TETGEN, EP_ERR_FORMAT, {"memory:1:", "dimension"}, "4 2 0 0\n"},
    {EP_MESH_TETGEN, EP_ERR_FORMAT, {"memory:2:", "too early"}, "4 3 0 0\n1 0 0 0\n"},
    {EP_MESH_TETGEN, EP_ERR_FORMAT, {"memory:2:", "begin at 0 or 1"}, "4 3 0 0\n5 0 0 0\n"},
    {EP_MESH_TETGEN, EP_ERR_FORMAT, {"memory:5:", "number of tets"}, NODE},
    {EP_MESH_TETGEN, EP_ERR_MESH, {"memory:6:", "-o2"}, NODE "1 10 0\n"},
    {EP_MESH_TETGEN, EP_ERR_FORMAT, {"memory:7:", "1 to 4"}, NODE "1 4 0\n1 1 2 3 0\n"},
    {EP_MESH_TETGEN,
     EP_ERR_FORMAT,
     {"memory:8:", "more lines"},
     NODE "1 4 0\n1 1 2 3 4\n2 1 2 3 4\n"},
};

static void bad_texts_are_refused_with_line_and_cause(void **state) {
  (void)state;
  for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
    bytes b = {0};
    put_raw(&b, bad[i].text, strlen(bad[i].text));
    ep_mesh m;
    ep_error err = {0};
    const ep_status status = parse(bad[i].format, &b, &m, NULL, &err);
    if (status != bad[i].status)
      fail_msg("case %zu: status %s: '%s'\n%s", i, ep_status_name(status), err.text, bad[i].text);
    for (int k = 0; k < 2; k++)
      if (!strstr(err.text, bad[i].says[k]))
        fail_msg("case %zu: '%s' does not say '%s'", i, err.text, bad[i].says[k]);
    assert_null(m.x);
  }
}

static void put_msh_head(bytes *b, const char *version) {
  put(b, "$MeshFormat\n%s 1 8\n", version);
  put_i32(b, 1);
  put(b, "\n$EndMeshFormat\n$Nodes\n");
}

static void expect_bytes_refused(ep_mesh_format format, const bytes *b, const char *says) {
  ep_mesh m;
  ep_error err = {0};
  assert_int_equal(parse(format, b, &m, NULL, &err), EP_ERR_FORMAT);
  assert_says(&err, says);
  assert_says(&err, "memory: byte ");
}

static void bad_binary_files_are_refused_with_offset(void **state) {
  (void)state;
  bytes b = {0};
  put(&b, "$MeshFormat\n2.2 1 8\n");
  put_i32(&b, 77);
  expect_bytes_refused(EP_MESH_MSH, &b, "byte 20: not a Gmsh byte order");
  b.size = 0;
  put_msh_head(&b, "2.2");
  put(&b, "100000000\n");
  put_i32(&b, 1);
  expect_bytes_refused(EP_MESH_MSH, &b, "too early");
  b.size = 0;
  put_msh_head(&b, "4.1");
  put_i64(&b, -1);
  expect_bytes_refused(EP_MESH_MSH, &b, "number of blocks is -1");
  b = (bytes){.big_endian = true};
  put(&b, "# vtk DataFile Version 4.2\nt\nBINARY\nDATASET UNSTRUCTURED_GRID\nPOINTS 9 float\n");
  put_i32(&b, 0x7fc00000); // NaN
  expect_bytes_refused(EP_MESH_VTK, &b, "not a finite number");
  b.size -= 4;
  put_f32(&b, 1);
  expect_bytes_refused(EP_MESH_VTK, &b, "too early");
}

// With 1 GB of address space left, headers that promise 10^8 entries must fail for what the file
// lacks, not for memory.
static void huge_counts_cost_nothing(void **state) {
  (void)state;
#ifndef __SANITIZE_ADDRESS__ // its shadow memory exceeds any such limit
  struct rlimit before;
  assert_int_equal(getrlimit(RLIMIT_AS, &before), 0);
  struct rlimit tight = {.rlim_cur = 1UL << 30, .rlim_max = before.rlim_max};
  assert_int_equal(setrlimit(RLIMIT_AS, &tight), 0);
#endif
  static const struct {
    ep_mesh_format format;
    const char *text;
  } huge[] = {{EP_MESH_VEG, "*VERTICES\n134217728 3\n1 0 0 0\n"},
              {EP_MESH_MSH, MSH_FORMAT "$Nodes\n134217728\n1 0 0 0\n"},
              {EP_MESH_MSH, "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 134217728 1 1\n"
                            "3 1 0 134217728\n1\n"},
              {EP_MESH_VTK, VTK_HEAD "POINTS 134217728 double\n0 0 0\n"},
              {EP_MESH_VTK, VTK_HEAD "FIELD f 1\na 2147483647 2147483647 double\n0\n"},
              {EP_MESH_MEDIT, MEDIT_HEAD "Vertices 134217728\n0 0 0 0\n"},
              {EP_MESH_TETGEN, "134217728 3 0 0\n1 0 0 0\n"}};
  for (size_t i = 0; i < sizeof huge / sizeof *huge; i++) {
    bytes b = {0};
    put_raw(&b, huge[i].text, strlen(huge[i].text));
    ep_mesh m;
    ep_error err = {0};
    assert_int_equal(parse(huge[i].format, &b, &m, NULL, &err), EP_ERR_FORMAT);
  }
#ifndef __SANITIZE_ADDRESS__
  assert_int_equal(setrlimit(RLIMIT_AS, &before), 0);
#endif
}

// Every prefix of a good file is either refused or, where only the end of the text is missing,
// the same mesh.
static void truncation_is_noticed_everywhere(void **state) {
  (void)state;
  static const struct {
    ep_mesh_format format;
    const char *text;
  } good[] = {{EP_MESH_VEG, VEG_MESH},
              {EP_MESH_MSH, MSH_FORMAT MSH_NODES "$Elements\n1\n1 4 0 1 2 3 4\n$EndElements\n"},
              {EP_MESH_VTK, VTK_HEAD VTK_POINTS "CELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\n"},
              {EP_MESH_MEDIT, MEDIT_HEAD MEDIT_POINTS "Tetrahedra 1\n1 2 3 4 0\nEnd\n"},
              {EP_MESH_TETGEN, NODE "1 4 0\n1 1 2 3 4\n"}};
  for (size_t i = 0; i < sizeof good / sizeof *good; i++)
    for (size_t size = 0; size <= strlen(good[i].text); size++) {
      bytes b = {0};
      put_raw(&b, good[i].text, size);
      ep_mesh m;
      ep_error err = {0};
      if (parse(good[i].format, &b, &m, NULL, &err) == EP_OK) {
        assert_true(strlen(good[i].text) - size <= strlen("\nEnd\n"));
        assert_int_equal(m.nt, 1);
        assert_int_equal(m.nv, 4);
      } else {
        assert_true(size < strlen(good[i].text));
        assert_says(&err, "memory");
      }
      ep_mesh_free(&m);
    }
}

static void expect_read_fails(const char *path, ep_status status, const char *says) {
  ep_mesh m;
  ep_error err = {0};
  assert_int_equal(ep_mesh_read(path, &m, NULL, NULL, &err), status);
  assert_says(&err, says);
  assert_says(&err, path);
}

static void write_line(const char *path, const char *text) {
  FILE *file = fopen(path, "w");
  assert_non_null(file);
  fputs(text, file);
  assert_int_equal(fclose(file), 0);
}

static void paths_that_are_no_meshes(void **state) {
  (void)state;
  mkdir("folder.veg", 0777);
  expect_read_fails("folder.veg", EP_ERR_IO, "is a folder");
  expect_read_fails("absent.msh", EP_ERR_IO, "cannot open");
  expect_read_fails("picture.png", EP_ERR_FORMAT, ".veg");
  expect_read_fails("noextension", EP_ERR_FORMAT, ".veg");
  write_line("alone.ele", "1 4 0\n1 1 2 3 4\n");
  expect_read_fails("alone.ele", EP_ERR_IO, ".node");
  write_line("self.veg", "*INCLUDE self.veg\n");
  expect_read_fails("self.veg", EP_ERR_FORMAT, "include itself");
  write_line("lost.veg", "*INCLUDE absent.txt\n");
  expect_read_fails("lost.veg", EP_ERR_IO, "absent.txt");
  write_line("broken.txt", "*MATERIAL a\nENU, x\n");
  write_line("broken.veg", VEG_MESH "*INCLUDE broken.txt\n");
  ep_mesh m;
  ep_error err = {0};
  assert_int_equal(ep_mesh_read("broken.veg", &m, NULL, NULL, &err), EP_ERR_FORMAT);
  assert_says(&err, "broken.txt:2:");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(bad_texts_are_refused_with_line_and_cause),
      cmocka_unit_test(bad_binary_files_are_refused_with_offset),
      cmocka_unit_test(huge_counts_cost_nothing),
      cmocka_unit_test(truncation_is_noticed_everywhere),
      cmocka_unit_test(paths_that_are_no_meshes),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
