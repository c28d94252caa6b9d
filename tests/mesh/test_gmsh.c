// Gmsh as an oracle: it meshes the box 2 x 1 x 1 once and writes it in every format; all files must
// give the same vertices and tets, and the volume 2.
#include <math.h>

#include "mesh/io.h"
#include "tests/mesh/shapes.h"
#include "tests/near.h"

static const char box[] = "Mesh.MeshSizeMax = 0.5;\n"
                          "Point(1) = {0, 0, 0}; Point(2) = {2, 0, 0}; Line(1) = {1, 2};\n"
                          "s[] = Extrude {0, 1, 0} { Line{1}; };\n"
                          "v[] = Extrude {0, 0, 1} { Surface{s[1]}; };\n";

static void run(const char *output, const char *options) {
  char command[512];
  snprintf(command, sizeof command, "gmsh -v 1 -3 box.geo -o %s %s >/dev/null 2>&1", output,
           options);
  if (system(command) != 0) fail_msg("gmsh could not write %s", output);
}

static ep_mesh read_one(const char *path) {
  ep_mesh m;
  ep_mesh_findings f;
  ep_error err = {0};
  assert_ok(ep_mesh_read(path, &m, &f, NULL, &err), &err);
  assert_int_equal(f.degenerate_tets + f.duplicate_vertices + f.repeated_tets, 0);
  assert_true(f.dropped_cells > 100); // the faces of the box
  assert_int_equal(f.components, 1);
  return m;
}

static void every_format_gives_the_same_mesh(void **state) {
  (void)state;
  static const struct {
    const char *file, *options;
  } kinds[] = {
      {"a22.msh", "-setnumber Mesh.MshFileVersion 2.2"},
      {"b22.msh", "-setnumber Mesh.MshFileVersion 2.2 -bin"},
      {"a41.msh", "-setnumber Mesh.MshFileVersion 4.1"},
      {"b41.msh", "-setnumber Mesh.MshFileVersion 4.1 -bin"},
      {"p41.msh", "-setnumber Mesh.MshFileVersion 4.1 -setnumber Mesh.SaveParametric 1"},
      {"q41.msh", "-setnumber Mesh.MshFileVersion 4.1 -setnumber Mesh.SaveParametric 1 -bin"},
      {"a.vtk", ""},
      {"b.vtk", "-bin"},
      {"a.mesh", ""},
  };
  ep_mesh first = {0};
  for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
    run(kinds[i].file, kinds[i].options);
    ep_mesh m = read_one(kinds[i].file);
    ASSERT_NEAR(ep_mesh_volume(&m), 2, 1e-12); // coordinates have 16 digits
    if (i == 0) {
      first = m;
      continue;
    }
    assert_true(ep_mesh_same_connectivity(&first, &m));
    // Gmsh writes 16 digits, into .mesh 14: half of the last one, of coordinates from 1 to 10.
    const double digits = strcmp(kinds[i].file, "a.mesh") == 0 ? 5.1e-14 : 1e-14;
    for (int k = 0; k < 3 * m.nv; k++) ASSERT_NEAR(m.x[k], first.x[k], digits);
    ep_mesh_free(&m);
  }
  ep_mesh_free(&first);
}

static void quadratic_tets_are_refused_with_advice(void **state) {
  (void)state;
  const char *const files[] = {"order2.msh", "order2.vtk"};
  for (int i = 0; i < 2; i++) {
    ep_mesh m;
    ep_error err = {0};
    run(files[i], "-order 2");
    assert_int_equal(ep_mesh_read(files[i], &m, NULL, NULL, &err), EP_ERR_MESH);
    assert_says(&err, "linear");
  }
}

// A 4.0 file is said to be one, not misread.
static void other_versions_are_named(void **state) {
  (void)state;
  const char *const version[] = {"4.0", "1.0"};
  for (int i = 0; i < 2; i++) {
    char options[64];
    ep_mesh m;
    ep_error err = {0};
    snprintf(options, sizeof options, "-setnumber Mesh.MshFileVersion %s", version[i]);
    run("old.msh", options);
    assert_int_equal(ep_mesh_read("old.msh", &m, NULL, NULL, &err), EP_ERR_UNSUPPORTED);
    assert_says(&err, "4.1 or 2.2");
  }
}

int main(void) {
  if (system("gmsh --version >/dev/null 2>&1") != 0) {
    print_message("skipped: gmsh is not installed\n");
    return 0;
  }
  FILE *file = fopen("box.geo", "w");
  if (!file || fwrite(box, 1, sizeof box - 1, file) != sizeof box - 1 || fclose(file) != 0)
    return 1;
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_format_gives_the_same_mesh),
      cmocka_unit_test(quadratic_tets_are_refused_with_advice),
      cmocka_unit_test(other_versions_are_named),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
