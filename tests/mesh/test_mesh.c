// Geometry and checks of a mesh: sum V_e and the divergence theorem give the same volume, shape
// gradients reproduce linear functions, and each defect of a mesh is found, counted and located.
#include <math.h>

#include "mesh/io.h"
#include "tests/mesh/shapes.h"
#include "tests/near.h"

static const double round_off = 1e-14; // a few operations on numbers of size 1

static void volumes_and_centroid_of_the_cube(void **state) {
  (void)state;
  ep_mesh_findings f;
  ep_mesh m = make_cube(&f);
  double low[3], high[3], c[3], v[6], lumped[8], sum = 0;
  ASSERT_NEAR(ep_mesh_volume(&m), 1, round_off);
  ep_tet_volumes(&m, m.x, v);
  for (int e = 0; e < 6; e++) ASSERT_NEAR(v[e], 1.0 / 6, round_off);
  ep_mesh_vertex_volumes(&m, lumped);
  for (int i = 0; i < 8; i++) sum += lumped[i];
  ASSERT_NEAR(sum, 1, round_off);
  ASSERT_NEAR(lumped[0], 0.25, round_off); // in all six tets
  ep_mesh_centroid(&m, m.x, c);
  ep_mesh_bounds(&m, low, high);
  for (int k = 0; k < 3; k++) {
    ASSERT_NEAR(c[k], 0.5, round_off);
    ASSERT_NEAR(low[k], 0, 0);
    ASSERT_NEAR(high[k], 1, 0);
  }
  ASSERT_NEAR(ep_mesh_diagonal(&m), sqrt(3), round_off);
  ASSERT_NEAR(ep_mesh_extent(&m), sqrt(3), round_off);
  assert_int_equal(f.components, 1);
  assert_int_equal(f.duplicate_vertices + f.degenerate_tets + f.unused_vertices, 0);
  assert_int_equal(f.first_duplicate, -1);
  ep_mesh_free(&m);
}

// extent(u R x + t) = u extent(x), where the diagonal is not.
static void the_extent_does_not_turn(void **state) {
  (void)state;
  const double R[9] = {0.36, 0.48, -0.8, -0.8, 0.6, 0, 0.48, 0.64, 0.6}, unit = 1e3;
  ep_mesh m = make_cube(NULL);
  for (int v = 0; v < m.nv; v++) m.x[3 * v] *= 4; // a bar
  const double before = ep_mesh_extent(&m), diagonal = ep_mesh_diagonal(&m);
  ASSERT_NEAR(before, sqrt(18), round_off);
  for (int v = 0; v < m.nv; v++) {
    double *x = m.x + 3 * v;
    const double y[3] = {x[0], x[1], x[2]};
    for (int i = 0; i < 3; i++)
      x[i] = 5 + unit * (R[3 * i] * y[0] + R[3 * i + 1] * y[1] + R[3 * i + 2] * y[2]);
  }
  ASSERT_NEAR(ep_mesh_extent(&m) / unit, before, round_off);
  assert_true(ep_mesh_diagonal(&m) / unit > 1.1 * diagonal);
  ep_mesh_free(&m);
}

// sum_i f(x_i) g_i = grad f for linear f, and the four gradients sum to zero.
static void gradients_reproduce_linear_functions(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL);
  const double slope[3] = {0.3, -1.7, 2.2};
  for (int e = 0; e < m.nt; e++) {
    double g[12], sum[3] = {0}, grad[3] = {0};
    ASSERT_NEAR(ep_tet_gradients(&m, e, g), 1.0 / 6, round_off);
    for (int i = 0; i < 4; i++)
      for (int k = 0; k < 3; k++) {
        const double *x = m.x + 3 * m.tet[4 * e + i];
        sum[k] += g[3 * i + k];
        grad[k] += g[3 * i + k] * (5 + slope[0] * x[0] + slope[1] * x[1] + slope[2] * x[2]);
      }
    for (int k = 0; k < 3; k++) {
      ASSERT_NEAR(sum[k], 0, round_off);
      ASSERT_NEAR(grad[k], slope[k], 100 * round_off);
    }
  }
  ep_mesh_free(&m);
}

// V = 1/3 int x.n dA and int n dA = 0 hold only if every triangle points outward.
static void expect_outward_surface(const ep_mesh *m, int triangles) {
  ep_error err = {0};
  int count, *t;
  assert_ok(ep_mesh_surface(m, &count, &t, &err), &err);
  assert_int_equal(count, triangles);
  double volume = 0, area[3] = {0};
  for (int i = 0; i < count; i++) {
    const double *a = m->x + 3 * t[3 * i], *b = m->x + 3 * t[3 * i + 1];
    const double *c = m->x + 3 * t[3 * i + 2];
    for (int k = 0; k < 3; k++) {
      const int p = (k + 1) % 3, q = (k + 2) % 3;
      const double n = ((b[p] - a[p]) * (c[q] - a[q]) - (b[q] - a[q]) * (c[p] - a[p])) / 2;
      area[k] += n;
      volume += n * (a[k] + b[k] + c[k]) / 9;
    }
  }
  ASSERT_NEAR(volume, ep_mesh_volume(m), round_off);
  for (int k = 0; k < 3; k++) ASSERT_NEAR(area[k], 0, round_off);
  free(t);
}

static void surface_points_outward_and_is_closed(void **state) {
  (void)state;
  ep_mesh cube = make_cube(NULL), one;
  expect_outward_surface(&cube, 12);
  ep_mesh_free(&cube);
  // All four faces of a tet lie on the surface; in the cube only two kinds of them do.
  const double x[] = {0.1, 0, 0, 1, 0.2, 0, 0, 1.3, 0, 0.2, 0.1, 0.7};
  const int tet[] = {0, 1, 2, 3};
  ep_error err = {0};
  assert_ok(ep_mesh_make(4, x, 1, tet, "one", &one, NULL, &err), &err);
  expect_outward_surface(&one, 4);
  ep_mesh_free(&one);
}

static void inverted_tets_are_turned_round(void **state) {
  (void)state;
  int tet[24];
  memcpy(tet, cube_tet, sizeof tet);
  for (int e = 0; e < 6; e += 2) {
    tet[4 * e] = cube_tet[4 * e + 1];
    tet[4 * e + 1] = cube_tet[4 * e];
  }
  ep_mesh m;
  ep_mesh_findings f;
  ep_error err = {0};
  assert_ok(ep_mesh_make(8, cube_x, 6, tet, "cube", &m, &f, &err), &err);
  assert_int_equal(f.repaired_orientation, 3);
  double v[6];
  ep_tet_volumes(&m, m.x, v);
  for (int e = 0; e < 6; e++) assert_true(v[e] > 0);
  ep_mesh_free(&m);
}

static void mirrored_positions_invert_every_tet(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL);
  double x[24], worst;
  memcpy(x, cube_x, sizeof x);
  for (int i = 0; i < 24; i += 3) x[i] *= -0.5;
  assert_int_equal(ep_mesh_inverted(&m, m.x, &worst), 0);
  ASSERT_NEAR(worst, 1, round_off);
  assert_int_equal(ep_mesh_inverted(&m, x, &worst), 6);
  ASSERT_NEAR(worst, -0.5, round_off);
  ep_mesh_free(&m);
}

// Vertices 0 and 3 are unused, 5 stands on 4; one flat tet, one repeated, two parts.
static void defects_are_counted_and_located(void **state) {
  (void)state;
  const double x[] = {9, 9, 9, 0, 0, 0, 1, 0, 0, 8, 8, 8, 0, 1, 0, 0, 1, 0,
                      0, 0, 1, 1, 1, 0, 5, 5, 5, 6, 5, 5, 5, 6, 5, 5, 5, 6};
  const int tet[] = {1, 2, 4, 6, 2, 4, 1, 6, 1, 2, 5, 7, 8, 9, 10, 11};
  ep_mesh m;
  ep_mesh_findings f;
  ep_error err = {0};
  assert_ok(ep_mesh_make(12, x, 4, tet, "bad", &m, &f, &err), &err);
  assert_int_equal(m.nv, 10);
  assert_int_equal(m.nt, 3);
  assert_int_equal(m.file_vertices, 12);
  assert_int_equal(f.unused_vertices, 2);
  assert_int_equal(f.first_unused, 0);
  assert_int_equal(f.duplicate_vertices, 1);
  assert_int_equal(f.first_duplicate, 5);
  assert_int_equal(f.repeated_tets, 1);
  assert_int_equal(f.first_repeated, 1);
  assert_int_equal(f.degenerate_tets, 1);
  assert_int_equal(f.first_degenerate, 2);
  assert_int_equal(f.components, 2);
  assert_int_equal(ep_mesh_from_file_vertex(&m, 0), -1);
  assert_int_equal(ep_mesh_from_file_vertex(&m, 1), 0);
  assert_int_equal(ep_mesh_from_file_vertex(&m, 4), 2);
  assert_int_equal(ep_mesh_from_file_vertex(&m, 12), -1);
  assert_int_equal(ep_mesh_from_file_vertex(&m, -1), -1);
  assert_int_equal(ep_mesh_require_sound(&m, &f, true, &err), EP_ERR_MESH);
  assert_says(&err, "tet 3 ");
  ep_mesh_free(&m);
}

static void parts_are_refused_only_where_a_whole_is_needed(void **state) {
  (void)state;
  const double x[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 5, 5, 5, 6, 5, 5, 5, 6, 5, 5, 5, 6};
  const int tet[] = {0, 1, 2, 3, 4, 5, 6, 7};
  ep_mesh m;
  ep_mesh_findings f;
  ep_error err = {0};
  assert_ok(ep_mesh_make(8, x, 2, tet, "two", &m, &f, &err), &err);
  assert_ok(ep_mesh_require_sound(&m, &f, false, &err), &err);
  assert_int_equal(ep_mesh_require_sound(&m, &f, true, &err), EP_ERR_MESH);
  assert_says(&err, "2 separate parts");
  ep_mesh_free(&m);
}

// The criterion |V| < 1e-12 L^3 does not depend on the unit of length.
static void degeneracy_is_free_of_scale(void **state) {
  (void)state;
  for (double scale = 1e-30; scale < 1e31; scale *= 1e10)
    for (int flat = 0; flat < 2; flat++) {
      const double h = flat ? 1e-13 : 1e-10;
      double x[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0.3, 0.3, h};
      for (int i = 0; i < 12; i++) x[i] *= scale;
      const int tet[] = {0, 1, 2, 3};
      ep_mesh m;
      ep_mesh_findings f;
      ep_error err = {0};
      assert_ok(ep_mesh_make(4, x, 1, tet, "flat", &m, &f, &err), &err);
      assert_int_equal(f.degenerate_tets, flat);
      ep_mesh_free(&m);
    }
}

static void expect_make_fails(int nv, const double *x, int nt, const int *tet, const char *says) {
  ep_mesh m;
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(nv, x, nt, tet, "bad", &m, NULL, &err), EP_ERR_MESH);
  assert_says(&err, says);
  assert_null(m.x);
}

static void unusable_arrays_are_refused(void **state) {
  (void)state;
  double x[24];
  int tet[24];
  expect_make_fails(8, cube_x, 0, cube_tet, "no tets");
  memcpy(tet, cube_tet, sizeof tet);
  tet[9] = 8;
  expect_make_fails(8, cube_x, 6, tet, "tet 3 ");
  tet[9] = -1;
  expect_make_fails(8, cube_x, 6, tet, "tet 3 ");
  const double bad[] = {NAN, INFINITY, 1e200};
  for (int i = 0; i < 3; i++) {
    memcpy(x, cube_x, sizeof x);
    x[7] = bad[i];
    expect_make_fails(8, x, 6, cube_tet, "vertex 3 ");
  }
}

static void copies_are_equal_and_independent(void **state) {
  (void)state;
  ep_mesh m = make_cube(NULL), copy;
  ep_error err = {0};
  assert_ok(ep_mesh_copy(&m, &copy, &err), &err);
  assert_true(ep_mesh_same_connectivity(&m, &copy));
  assert_memory_equal(m.x, copy.x, sizeof cube_x);
  ep_mesh_free(&m);
  ASSERT_NEAR(ep_mesh_volume(&copy), 1, round_off);
  ep_mesh_free(&copy);
}

// A pose of the same mesh may hold inverted tets: it is the same connectivity all the same.
static void inverted_poses_keep_the_connectivity(void **state) {
  (void)state;
  double x[24];
  memcpy(x, cube_x, sizeof x);
  x[0] = x[1] = x[2] = 2; // the vertex of all tets, through the opposite corner
  ep_mesh m = make_cube(NULL), pose;
  ep_mesh_findings f;
  ep_error err = {0};
  assert_ok(ep_mesh_make(8, x, 6, cube_tet, "pose", &pose, &f, &err), &err);
  assert_true(f.repaired_orientation > 0);
  assert_true(ep_mesh_same_connectivity(&m, &pose));
  pose.tet[0] = 1;
  assert_false(ep_mesh_same_connectivity(&m, &pose));
  ep_mesh_free(&m);
  ep_mesh_free(&pose);
}

static void real_meshes_have_the_counts_their_authors_give(void **state) {
  (void)state;
  static const struct {
    const char *file;
    int nv, nt;
    double young;
  } known[] = {{"car/car.veg", 727, 2369, 3e5},
               {"car/ex0.veg", 1019, 3554, 3e5},
               {"gorilla/gorilla.veg", 1553, 4342, 5e5},
               {"letter-c/C.veg", 7070, 30481, 1e6},
               {"letter-c/ex1.veg", 8402, 35439, 1e6}};
  for (size_t i = 0; i < sizeof known / sizeof *known; i++) {
    char path[1024];
    snprintf(path, sizeof path, EP_SOURCE_DIR "/../shared/data/%s", known[i].file);
    FILE *file = fopen(path, "rb");
    if (!file) {
      print_message("skipped: %s is not there\n", known[i].file);
      skip();
    }
    fclose(file);
    ep_mesh m;
    ep_mesh_findings f;
    ep_error err = {0};
    assert_ok(ep_mesh_read(path, &m, &f, NULL, &err), &err);
    assert_int_equal(m.nv, known[i].nv);
    assert_int_equal(m.nt, known[i].nt);
    assert_int_equal(m.nmaterials, 1);
    ASSERT_NEAR(m.material[0].young, known[i].young, 0);
    assert_int_equal(f.degenerate_tets, 0);
    assert_int_equal(f.components, 1);
    ep_mesh_free(&m);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(volumes_and_centroid_of_the_cube),
      cmocka_unit_test(the_extent_does_not_turn),
      cmocka_unit_test(gradients_reproduce_linear_functions),
      cmocka_unit_test(surface_points_outward_and_is_closed),
      cmocka_unit_test(inverted_tets_are_turned_round),
      cmocka_unit_test(mirrored_positions_invert_every_tet),
      cmocka_unit_test(defects_are_counted_and_located),
      cmocka_unit_test(parts_are_refused_only_where_a_whole_is_needed),
      cmocka_unit_test(degeneracy_is_free_of_scale),
      cmocka_unit_test(unusable_arrays_are_refused),
      cmocka_unit_test(copies_are_equal_and_independent),
      cmocka_unit_test(inverted_poses_keep_the_connectivity),
      cmocka_unit_test(real_meshes_have_the_counts_their_authors_give),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
