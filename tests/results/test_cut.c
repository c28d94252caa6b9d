// Claims: cutting loses nothing. The cut surface is closed, so the divergence theorem gives the
// volume of the kept part, and both sides' volumes add up to the mesh's; the section has the
// area geometry says; a linear field is carried over exactly.
#include "tests/results/harness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/io.h"
#include "results/cut.h"

enum { SIDE = 5 };

// A unit cube of SIDE^3 cells, six tets each (Kuhn).
static void make_cube(ep_mesh *mesh) {
  static double x[(SIDE + 1) * (SIDE + 1) * (SIDE + 1) * 3];
  static int tet[SIDE * SIDE * SIDE * 6 * 4];
  const int order[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  const int step[3] = {1, SIDE + 1, (SIDE + 1) * (SIDE + 1)};
  int nv = 0, nt = 0;
  for (int k = 0; k <= SIDE; k++)
    for (int j = 0; j <= SIDE; j++)
      for (int i = 0; i <= SIDE; i++, nv++) {
        x[3 * nv] = i / (double)SIDE, x[3 * nv + 1] = j / (double)SIDE;
        x[3 * nv + 2] = k / (double)SIDE;
      }
  for (int k = 0; k < SIDE; k++)
    for (int j = 0; j < SIDE; j++)
      for (int i = 0; i < SIDE; i++)
        for (int p = 0; p < 6; p++, nt++) {
          tet[4 * nt] = i * step[0] + j * step[1] + k * step[2];
          for (int c = 0; c < 3; c++) tet[4 * nt + c + 1] = tet[4 * nt + c] + step[order[p][c]];
        }
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(nv, x, nt, tet, "cube", mesh, NULL, &err), EP_OK);
}

// Volume inside the triangles from first on (divergence theorem), area into *area.
static double enclosed(const ep_cut *cut, int first, double *area) {
  double volume = 0;
  *area = 0;
  for (int t = first; t < cut->nt; t++) {
    const double *p[3];
    for (int c = 0; c < 3; c++) p[c] = cut->x + 3 * cut->triangle[3 * t + c];
    double n[3], length = 0;
    for (int k = 0; k < 3; k++) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      n[k] = (p[1][i] - p[0][i]) * (p[2][j] - p[0][j]) - (p[1][j] - p[0][j]) * (p[2][i] - p[0][i]);
      volume += p[0][k] * n[k] / 6;
      length += n[k] * n[k];
    }
    *area += sqrt(length) / 2;
  }
  return volume;
}

static void test_volumes(void **state) {
  (void)state;
  ep_mesh mesh;
  make_cube(&mesh);
  // plane x + y + z = 1 cuts off the corner of volume 1/6 and side sqrt(2)
  const double point[3] = {1, 0, 0}, normal[3] = {2, 2, 2}, other[3] = {-1, -1, -1};
  ep_cut low, high;
  assert_int_equal(ep_cut_mesh(&mesh, NULL, point, normal, &low, NULL), EP_OK);
  assert_int_equal(ep_cut_mesh(&mesh, NULL, point, other, &high, NULL), EP_OK);
  double area;
  assert_true(fabs(enclosed(&low, 0, &area) - 1.0 / 6) < 1e-12); // round-off of some 500 terms
  assert_true(fabs(enclosed(&high, 0, &area) - 5.0 / 6) < 1e-12);
  enclosed(&low, low.outer, &area);
  assert_true(fabs(area - sqrt(3) / 2) < 1e-12);
  ep_cut_free(&low);
  ep_cut_free(&high);
  ep_mesh_free(&mesh);
}

static void test_oblique(void **state) {
  (void)state;
  ep_mesh mesh;
  make_cube(&mesh);
  const double point[3] = {0.51, 0.47, 0.5}, normal[3] = {0.3, -0.8, 0.45};
  const double other[3] = {-0.3, 0.8, -0.45};
  ep_cut low, high;
  assert_int_equal(ep_cut_mesh(&mesh, NULL, point, normal, &low, NULL), EP_OK);
  assert_int_equal(ep_cut_mesh(&mesh, NULL, point, other, &high, NULL), EP_OK);
  double area[2];
  const double both = enclosed(&low, 0, &area[0]) + enclosed(&high, 0, &area[1]);
  assert_true(fabs(both - 1) < 1e-12);
  for (int v = 0; v < low.nv; v++) {
    double h = 0;
    for (int k = 0; k < 3; k++) h += (low.x[3 * v + k] - point[k]) * normal[k];
    assert_true(h <= 1e-12);
  }
  double *carried = malloc((size_t)low.nv * 3 * sizeof *carried); // positions are a linear field
  assert_non_null(carried);
  ep_cut_field(&low, 3, mesh.x, carried);
  for (int i = 0; i < 3 * low.nv; i++) assert_true(fabs(carried[i] - low.x[i]) < 1e-15);
  free(carried);
  ep_cut_free(&low);
  ep_cut_free(&high);
  ep_mesh_free(&mesh);
}

static void test_hidden_edges(void **state) {
  (void)state;
  ep_mesh mesh;
  make_cube(&mesh);
  const double point[3] = {0.5, 0.5, 0.5}, normal[3] = {0, 0.1, 1};
  ep_cut cut;
  assert_int_equal(ep_cut_mesh(&mesh, NULL, point, normal, &cut, NULL), EP_OK);
  int hidden = 0; // each diagonal of a four-sided section hides one edge of two triangles
  for (int t = 0; t < cut.nt; t++) hidden += (cut.hidden[t] & 2) / 2 + (cut.hidden[t] & 4) / 4;
  assert_true(hidden > 0 && hidden % 2 == 0);
  ep_cut_free(&cut);
  ep_mesh_free(&mesh);
}

static void test_refuses(void **state) {
  (void)state;
  ep_mesh mesh;
  make_cube(&mesh);
  const double point[3] = {-1, 0, 0}, normal[3] = {1, 0, 0}, zero[3] = {0, 0, 0};
  ep_cut cut;
  ep_error err = {0};
  assert_int_equal(ep_cut_mesh(&mesh, NULL, point, normal, &cut, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "nothing of cube"));
  assert_int_equal(ep_cut_mesh(&mesh, NULL, point, zero, &cut, NULL), EP_ERR_ARGUMENT);
  assert_null(cut.x);
  ep_mesh_free(&mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_volumes), cmocka_unit_test(test_oblique),
                                     cmocka_unit_test(test_hidden_edges),
                                     cmocka_unit_test(test_refuses)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
