// Every reader gives the unit cube back, to the last bit, from each flavour of its format: index
// bases, comments, encodings, byte orders, and what else such files hold.
#include <locale.h>

#include "tests/mesh/bytes.h"
#include "tests/near.h"

static void expect_cube(ep_mesh_format format, const bytes *b, int dropped) {
  ep_mesh_findings f;
  ep_mesh m = parse_ok(format, b, &f);
  assert_cube(&m);
  assert_int_equal(f.dropped_cells, dropped);
  assert_int_equal(f.repaired_orientation, 0);
  ep_mesh_free(&m);
}

static void put_indexed_vertices(bytes *b, int base, const char *end) {
  for (int i = 0; i < 8; i++)
    put(b, "%d %g %g %g%s\n", i + base, cube_x[3 * i], cube_x[3 * i + 1], cube_x[3 * i + 2], end);
}

static void put_indexed_tets(bytes *b, int base, int element_base, const char *end) {
  for (int e = 0; e < 6; e++) {
    const int *t = cube_tet + 4 * e;
    put(b, "%d %d %d %d %d%s\n", e + element_base, t[0] + base, t[1] + base, t[2] + base,
        t[3] + base, end);
  }
}

static void put_veg(bytes *b, int base, int element_base) {
  put(b, "# a comment\n\n*VERTICES\n8 3 0 0\n");
  put_indexed_vertices(b, base, " # behind");
  put(b, "*ELEMENTS\nTET\n6 4 0\n");
  put_indexed_tets(b, base, element_base, "");
}

static void veg_in_both_bases(void **state) {
  (void)state;
  for (int base = 0; base < 2; base++)
    for (int element_base = 0; element_base < 2; element_base++) {
      bytes b = {0};
      put_veg(&b, base, element_base);
      expect_cube(EP_MESH_VEG, &b, 0);
    }
}

static void veg_materials_by_region(void **state) {
  (void)state;
  bytes b = {0};
  put_veg(&b, 1, 0);
  put(&b, "*MATERIAL soft\nENU, 1000, 1e5, 0.4\n*MATERIAL hard\nENU, 2000, 2e9, 0.3\n"
          "*SET tip\n0, 2,\n5\n*REGION\nallElements, soft\n*REGION\ntip, hard\n");
  ep_mesh m = parse_ok(EP_MESH_VEG, &b, NULL);
  const int expected[6] = {1, 0, 1, 0, 0, 1};
  assert_cube(&m);
  assert_int_equal(m.nmaterials, 2);
  assert_memory_equal(m.tet_material, expected, sizeof expected);
  ASSERT_NEAR(m.material[1].density, 2000, 0);
  ASSERT_NEAR(m.material[1].young, 2e9, 0);
  ASSERT_NEAR(m.material[1].poisson, 0.3, 0);
  ep_mesh_free(&m);
}

static void write_text(const char *path, const bytes *b) {
  FILE *file = fopen(path, "wb");
  assert_non_null(file);
  assert_int_equal(fwrite(b->data, 1, b->size, file), b->size);
  assert_int_equal(fclose(file), 0);
}

// As VegaFEM's own examples do: vertices and elements in TetGen files, materials in a third.
static void veg_includes_other_files(void **state) {
  (void)state;
  bytes b = {0}, node = {0}, ele = {0}, material = {0};
  put(&node, "8 3 0 0\n");
  put_indexed_vertices(&node, 1, "");
  put(&ele, "6 4 0\n");
  put_indexed_tets(&ele, 1, 1, "");
  put(&material, "*MATERIAL all\nENU, 1000, 1e5, 0.4\n*REGION\nallElements, all");
  put(&b, "*VERTICES\n*INCLUDE inc.node\n*ELEMENTS\nTET\n*INCLUDE inc.ele\n*INCLUDE inc.txt");
  write_text("inc.node", &node);
  write_text("inc.ele", &ele);
  write_text("inc.txt", &material);
  write_text("inc.veg", &b);
  ep_mesh m;
  ep_error err = {0};
  assert_ok(ep_mesh_read("inc.veg", &m, NULL, NULL, &err), &err);
  assert_cube(&m);
  assert_int_equal(m.nmaterials, 1);
  ep_mesh_free(&m);
}

static void tetgen_in_both_bases(void **state) {
  (void)state;
  for (int base = 0; base < 2; base++) {
    bytes node = {0}, ele = {0}, both = {0};
    put(&node, "# node\n8 3 1 1\n");
    put_indexed_vertices(&node, base, " 0.5 -1");
    put(&ele, "6 4 1 # ele\n");
    put_indexed_tets(&ele, base, base, " 7");
    put_raw(&both, node.data, node.size);
    put_raw(&both, ele.data, ele.size);
    expect_cube(EP_MESH_TETGEN, &both, 0);
    write_text("cube.1.node", &node);
    write_text("cube.1.ele", &ele);
    const char *const names[] = {"cube.1.node", "cube.1.ele"};
    for (int i = 0; i < 2; i++) {
      ep_mesh m;
      ep_error err = {0};
      assert_ok(ep_mesh_read(names[i], &m, NULL, NULL, &err), &err);
      assert_cube(&m);
      ep_mesh_free(&m);
    }
  }
}

static void medit_in_both_bases(void **state) {
  (void)state;
  for (int base = 0; base < 2; base++) {
    bytes b = {0};
    put(&b, "MeshVersionFormatted 2\n# comment\nDimension\n3\nVertices\n8\n");
    for (int i = 0; i < 8; i++)
      put(&b, "%g %g %g 0\n", cube_x[3 * i], cube_x[3 * i + 1], cube_x[3 * i + 2]);
    put(&b, "Triangles 1\n1 2 3 0\nCorners 2\n1\n2\nMyOwnThings\n2 1 2 3\nTetrahedra\n6\n");
    for (int i = 0; i < 24; i++) put(&b, "%d%s", cube_tet[i] + base, i % 4 == 3 ? " 1\n" : " ");
    put(&b, "End\n");
    expect_cube(EP_MESH_MEDIT, &b, 1);
  }
}

// --- Gmsh: node numbers 2 i + 7, so with gaps, and listed backwards in version 2

static int gmsh_number(int i) {
  return 2 * i + 7;
}

static void put_gmsh_2(bytes *b, bool binary) {
  put(b, "$MeshFormat\n2.2 %d 8\n", binary);
  if (binary) put_i32(b, 1), put(b, "\n");
  put(b, "$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"all\"\n$EndPhysicalNames\n$Nodes\n8\n");
  for (int i = 7; i >= 0; i--) {
    const double *x = cube_x + 3 * i;
    if (!binary) put(b, "%d %g %g %g\n", gmsh_number(i), x[0], x[1], x[2]);
    if (binary) put_i32(b, gmsh_number(i));
    for (int k = 0; binary && k < 3; k++) put_f64(b, x[k]);
  }
  put(b, "%s$EndNodes\n$Elements\n7\n", binary ? "\n" : "");
  if (binary) {
    const int32_t triangle[] = {2, 1, 2, 1, 0, 0, gmsh_number(0), gmsh_number(1), gmsh_number(2)};
    for (int i = 0; i < 9; i++) put_i32(b, triangle[i]);
    put_i32(b, 4), put_i32(b, 6), put_i32(b, 2);
  } else {
    put(b, "1 2 2 0 0 7 9 11\n");
  }
  for (int e = 0; e < 6; e++) {
    const int *t = cube_tet + 4 * e;
    const int line[] = {e + 2, 4, 2, 1, 1};
    for (int i = 0; i < 5; i++)
      if (!binary)
        put(b, "%d ", line[i]);
      else if (i == 0 || i > 2)
        put_i32(b, line[i]);
    for (int i = 0; i < 4; i++)
      if (binary)
        put_i32(b, gmsh_number(t[i]));
      else
        put(b, "%d%s", gmsh_number(t[i]), i == 3 ? "\n" : " ");
  }
  put(b, "%s$EndElements\n", binary ? "\n" : "");
}

static void put_size(bytes *b, bool binary, long value) {
  if (binary)
    put_i64(b, value);
  else
    put(b, "%ld ", value);
}

static void put_block(bytes *b, bool binary, int dimension, int kind, long count) {
  const int head[] = {dimension, 1, kind};
  for (int i = 0; i < 3; i++)
    if (binary)
      put_i32(b, head[i]);
    else
      put(b, "%d ", head[i]);
  put_size(b, binary, count);
}

// Two blocks of nodes, the second one with parameters of a surface.
static void put_gmsh_4(bytes *b, bool binary) {
  put(b, "$MeshFormat\n4.1 %d 8\n", binary);
  if (binary) put_i32(b, 1), put(b, "\n");
  put(b, "$EndMeshFormat\n$Entities\nwhatever $ 1 $EndNot\n$EndEntities\n$Nodes\n");
  const long counts[] = {2, 8, 7, 21}, elements[] = {2, 7, 1, 7};
  for (int i = 0; i < 4; i++) put_size(b, binary, counts[i]);
  for (int half = 0; half < 2; half++) {
    put_block(b, binary, 2, half, 4);
    for (int i = 4 * half; i < 4 * half + 4; i++) put_size(b, binary, gmsh_number(i));
    for (int i = 4 * half; i < 4 * half + 4; i++)
      for (int k = 0; k < 3 + 2 * half; k++)
        if (binary)
          put_f64(b, k < 3 ? cube_x[3 * i + k] : 0.25);
        else
          put(b, "%g ", k < 3 ? cube_x[3 * i + k] : 0.25);
  }
  put(b, "\n$EndNodes\n$Elements\n");
  for (int i = 0; i < 4; i++) put_size(b, binary, elements[i]);
  put_block(b, binary, 2, 2, 1);
  for (int i = 0; i < 4; i++) put_size(b, binary, i ? gmsh_number(i) : 1);
  put_block(b, binary, 3, 4, 6);
  for (int e = 0; e < 6; e++) {
    put_size(b, binary, e + 2);
    for (int i = 0; i < 4; i++) put_size(b, binary, gmsh_number(cube_tet[4 * e + i]));
  }
  put(b, "\n$EndElements\n");
}

static void gmsh_in_all_encodings(void **state) {
  (void)state;
  for (int kind = 0; kind < 6; kind++) {
    const bool binary = kind % 3 > 0;
    bytes b = {.big_endian = kind % 3 == 2};
    if (kind < 3)
      put_gmsh_2(&b, binary);
    else
      put_gmsh_4(&b, binary);
    expect_cube(EP_MESH_MSH, &b, 1);
    ep_mesh m = parse_ok(EP_MESH_MSH, &b, NULL);
    assert_int_equal(m.file_vertex[0], 6); // number 7 counts from 1
    assert_int_equal(m.file_vertices, 21);
    assert_int_equal(ep_mesh_from_file_vertex(&m, 20), 7);
    assert_int_equal(ep_mesh_from_file_vertex(&m, 7), -1);
    ep_mesh_free(&m);
  }
}

// --- VTK

static void put_integer(bytes *b, bool binary, bool wide, int value) {
  if (!binary)
    put(b, "%d ", value);
  else if (wide)
    put_i64(b, value);
  else
    put_i32(b, value);
}

static void put_points(bytes *b, bool binary, bool narrow) {
  put(b, "POINTS 8 %s\n", narrow ? "float" : "double");
  for (int i = 0; i < 24; i++)
    if (!binary)
      put(b, "%g ", cube_x[i]);
    else if (narrow)
      put_f32(b, (float)cube_x[i]);
    else
      put_f64(b, cube_x[i]);
  put(b, "\nMETADATA\nINFORMATION 0\n\n");
}

static void put_types(bytes *b, bool binary) {
  put(b, "\nCELL_TYPES 7\n");
  put_integer(b, binary, false, 5);
  for (int e = 0; e < 6; e++) put_integer(b, binary, false, 10);
  put(b, "\nCELL_DATA 7\nSCALARS id int\nLOOKUP_TABLE default\n");
  for (int e = 0; e < 7; e++) put_integer(b, binary, false, e);
  put(b, "\n");
}

static void put_vtk_4(bytes *b, bool binary, bool narrow) {
  put(b, "# vtk DataFile Version 4.2\n\n%s\nDATASET UNSTRUCTURED_GRID\n",
      binary ? "BINARY" : "ASCII");
  put(b, "FIELD FieldData 1\nTIME 1 2 double\n");
  for (int i = 0; i < 2; i++)
    if (binary)
      put_f64(b, 0.5);
    else
      put(b, "0.5 ");
  put(b, "\n");
  put_points(b, binary, narrow);
  put(b, "CELLS 7 34\n");
  for (int i = 0; i < 4; i++) put_integer(b, binary, false, i ? i : 3);
  for (int i = 0; i < 24; i++) {
    if (i % 4 == 0) put_integer(b, binary, false, 4);
    put_integer(b, binary, false, cube_tet[i]);
  }
  put_types(b, binary);
}

static void put_vtk_5(bytes *b, bool binary, bool wide) {
  put(b, "# vtk DataFile Version 5.1\nvtk output\n%s\nDATASET UNSTRUCTURED_GRID\n",
      binary ? "BINARY" : "ASCII");
  put_points(b, binary, false);
  const char *type = wide ? "vtktypeint64" : "int";
  put(b, "CELLS 8 27\nOFFSETS %s\n", type);
  for (int c = 0; c < 8; c++) put_integer(b, binary, wide, c ? 4 * c - 1 : 0);
  put(b, "\nCONNECTIVITY %s\n", type);
  for (int i = 0; i < 3; i++) put_integer(b, binary, wide, i);
  for (int i = 0; i < 24; i++) put_integer(b, binary, wide, cube_tet[i]);
  put_types(b, binary);
}

static void vtk_in_all_encodings(void **state) {
  (void)state;
  for (int kind = 0; kind < 8; kind++) {
    bytes b = {.big_endian = true};
    if (kind < 4)
      put_vtk_4(&b, kind % 2, kind / 2 % 2);
    else
      put_vtk_5(&b, kind % 2, kind / 2 % 2);
    expect_cube(EP_MESH_VTK, &b, 1);
  }
}

// Text files from Windows: a byte order mark and \r\n.
static void windows_texts_are_read(void **state) {
  (void)state;
  const ep_mesh_format formats[] = {EP_MESH_VEG, EP_MESH_MSH, EP_MESH_MSH, EP_MESH_VTK,
                                    EP_MESH_VTK};
  for (int i = 0; i < 5; i++) {
    bytes plain = {0}, b = {0};
    if (i == 0) put_veg(&plain, 1, 1);
    if (i == 1) put_gmsh_2(&plain, false);
    if (i == 2) put_gmsh_4(&plain, false);
    if (i == 3) put_vtk_4(&plain, false, false);
    if (i == 4) put_vtk_5(&plain, false, true);
    put(&b, "\xEF\xBB\xBF");
    for (size_t k = 0; k < plain.size; k++) {
      if (plain.data[k] == '\n') put(&b, "\r");
      put_raw(&b, plain.data + k, 1);
    }
    expect_cube(formats[i], &b, i > 0);
  }
}

// A locale with a decimal comma: an installed one, or one made here where its sources are.
static bool enter_comma_locale(void) {
  static const char make[] = "mkdir -p locale && test -d locale/de_DE.UTF-8 || localedef -i de_DE "
                             "-f UTF-8 ./locale/de_DE.UTF-8 >/dev/null 2>&1";
  if (setlocale(LC_ALL, "de_DE.UTF-8")) return true;
  if (system(make) != 0) return false;
  setenv("LOCPATH", "locale", 1);
  return setlocale(LC_ALL, "de_DE.UTF-8") != NULL;
}

// Numbers are read and written with a point, also where the user's language has a comma.
static void locale_does_not_matter(void **state) {
  (void)state;
  if (!enter_comma_locale()) {
    print_message("skipped: no locale with a decimal comma can be had\n");
    skip();
  }
  bytes b = {0};
  put(&b, "*VERTICES\n4 3 0 0\n0 0 0 0\n1 1.5 0 0\n2 0 1 0\n3 0 0 1\n*ELEMENTS\nTET\n1 4 0\n"
          "0 0 1 2 3\n");
  ep_mesh m = parse_ok(EP_MESH_VEG, &b, NULL);
  ASSERT_NEAR(m.x[3], 1.5, 0);
  ep_error err = {0};
  assert_ok(ep_mesh_write_veg("locale.veg", &m, &err), &err);
  ep_mesh_free(&m);
  assert_ok(ep_mesh_read("locale.veg", &m, NULL, NULL, &err), &err);
  ASSERT_NEAR(m.x[3], 1.5, 0);
  ep_mesh_free(&m);
  assert_int_equal(localeconv()->decimal_point[0], ',');
  setlocale(LC_ALL, "C");
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(veg_in_both_bases),        cmocka_unit_test(veg_materials_by_region),
      cmocka_unit_test(veg_includes_other_files), cmocka_unit_test(tetgen_in_both_bases),
      cmocka_unit_test(medit_in_both_bases),      cmocka_unit_test(gmsh_in_all_encodings),
      cmocka_unit_test(vtk_in_all_encodings),     cmocka_unit_test(windows_texts_are_read),
      cmocka_unit_test(locale_does_not_matter),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
