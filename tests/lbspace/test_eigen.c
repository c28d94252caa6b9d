// Claims, for K phi = lambda M phi with natural boundary:
//   box a x b x c: lambda -> pi^2 (i^2/a^2 + j^2/b^2 + k^2/c^2), error of order h^2;
//   Phi^T M Phi = I, K Phi = M Phi Lambda, constants of every component left out;
//   scaled by s: lambda / s^2, phi / s^(3/2);
//   renumbered: the same functions, signs and rotations included;
//   car.veg: the eigenvalues of Zhao et al. 2018 (their file, sorted) to 1e-5.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/files.h"
#include "tests/lbspace/shapes.h"
#include "tests/petsc_session.h"

static const double pi = 3.14159265358979323846;

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// The box's own spectrum without zero, ascending; exact (215).
static void box_spectrum(double a, double b, double c, double *exact) {
  for (int i = 1; i < 216; i++) {
    const double ka = i % 6 / a, kb = i / 6 % 6 / b, kc = i / 36 / c;
    exact[i - 1] = pi * pi * (ka * ka + kb * kb + kc * kc);
  }
  qsort(exact, 215, sizeof *exact, ascending);
}

static ep_lb solve(const ep_mesh *mesh, int count) {
  ep_lb lb;
  ep_error err = {0};
  if (ep_lb_eigen(mesh, count, NULL, &lb, &err) != EP_OK) fail_msg("%s", err.text);
  assert_int_equal(lb.m, count);
  assert_int_equal(lb.n, mesh->nv);
  return lb;
}

// Errors at h, h/2: their ratio is 4 for order h^2; 3.4 leaves room for the h^4 term at h = 1/6.
static void check_box(const double size[3]) {
  enum { COUNT = 9 };
  double exact[215], error[2][COUNT];
  box_spectrum(size[0], size[1], size[2], exact);
  for (int level = 0; level < 2; level++) {
    const int cells = 6 << level;
    ep_mesh mesh = shape_box(cells, cells, cells, size[0], size[1], size[2]);
    ep_lb lb = solve(&mesh, COUNT);
    for (int j = 0; j < COUNT; j++) error[level][j] = lb.lambda[j] / exact[j] - 1;
    assert_true(fabs(lb.volume - size[0] * size[1] * size[2]) < 1e-12);
    ep_lb_free(&lb);
    ep_mesh_free(&mesh);
  }
  for (int j = 0; j < COUNT; j++) {
    // A Ritz value lies above the exact one.
    assert_true(error[1][j] > 0 && error[1][j] < 0.06);
    assert_true(error[0][j] / error[1][j] > 3.4 && error[0][j] / error[1][j] < 4.6);
  }
}

static void test_box_spectra(void **state) {
  (void)state;
  check_box((const double[3]){1, 1, 1});
  check_box((const double[3]){1, 1.3, 0.8});
}

// K phi = lambda M phi, Phi^T M Phi = I and <phi, 1>_M = 0.
static void check_equations(const ep_mesh *mesh, const ep_lb *lb) {
  const size_t n = (size_t)lb->n;
  ep_csr k, m;
  ep_error err = {0};
  assert_int_equal(ep_lb_stiffness(mesh, &k, &err), EP_OK);
  assert_int_equal(ep_lb_mass(mesh, &m, &err), EP_OK);
  double *kx = malloc(2 * n * sizeof *kx), *mx = kx + n;
  for (int j = 0; j < lb->m; j++) {
    const double *phi = lb->phi + (size_t)j * n;
    ep_csr_multiply(&k, 1, phi, kx);
    ep_csr_multiply(&m, 1, phi, mx);
    double residual = 0, size = 0, mean = 0;
    for (size_t i = 0; i < n; i++) {
      residual += pow(kx[i] - lb->lambda[j] * mx[i], 2);
      size += pow(lb->lambda[j] * mx[i], 2);
      mean += mx[i];
    }
    // Rotating within groups of relative width 1e-6 may leave that much.
    assert_true(sqrt(residual / size) < 2e-6);
    assert_true(fabs(mean) < 1e-8 * sqrt(lb->volume));
    for (int l = 0; l < lb->m; l++) {
      double sum = 0;
      for (size_t i = 0; i < n; i++) sum += mx[i] * lb->phi[(size_t)l * n + i];
      assert_true(fabs(sum - (l == j)) < 1e-9);
    }
  }
  free(kx);
  ep_csr_free(&k);
  ep_csr_free(&m);
}

static void test_equations(void **state) {
  (void)state;
  ep_mesh mesh = shape_box(7, 7, 7, 2, 2, 2);
  ep_lb lb = solve(&mesh, 20);
  check_equations(&mesh, &lb);
  ep_lb_free(&lb);
  ep_mesh_free(&mesh);
}

// sum_ij K_ij = 0 and x^T K x = V for a coordinate (|grad x| = 1); 1^T M 1 = V, and the second
// moment of a box about its corner, a^2 V / 3, exactly: the mass is exact for products of linears.
static void test_operators(void **state) {
  (void)state;
  ep_mesh mesh = shape_box(3, 4, 2, 1.5, 1, 0.7);
  const double volume = 1.5 * 1 * 0.7;
  ep_csr k, m;
  ep_error err = {0};
  assert_int_equal(ep_lb_stiffness(&mesh, &k, &err), EP_OK);
  assert_int_equal(ep_lb_mass(&mesh, &m, &err), EP_OK);
  for (int axis = 0; axis < 4; axis++) {
    double *x = malloc(3 * (size_t)mesh.nv * sizeof *x), *kx = x + mesh.nv, *mx = kx + mesh.nv;
    for (int i = 0; i < mesh.nv; i++) x[i] = axis < 3 ? mesh.x[3 * i + axis] : 1;
    ep_csr_multiply(&k, 1, x, kx);
    ep_csr_multiply(&m, 1, x, mx);
    double stiff = 0, moment = 0;
    for (int i = 0; i < mesh.nv; i++) {
      stiff += x[i] * kx[i];
      moment += x[i] * mx[i];
      if (axis == 3) assert_true(fabs(kx[i]) < 1e-14);
    }
    const double length[4] = {1.5, 1, 0.7, 0};
    assert_true(fabs(stiff - (axis < 3 ? volume : 0)) < 1e-13);
    assert_true(fabs(moment - volume * (axis < 3 ? pow(length[axis], 2) / 3 : 1)) < 1e-13);
    free(x);
  }
  ep_csr_free(&k);
  ep_csr_free(&m);
  ep_mesh_free(&mesh);
}

static void test_scale_laws(void **state) {
  (void)state;
  const double s = 37;
  ep_mesh small = shape_box(5, 4, 3, 1, 0.9, 0.6), large = shape_box(5, 4, 3, s, s * 0.9, s * 0.6);
  ep_lb a = solve(&small, 10), b = solve(&large, 10);
  for (int j = 0; j < 10; j++) assert_true(fabs(b.lambda[j] * s * s / a.lambda[j] - 1) < 1e-9);
  for (int i = 0; i < 10 * a.n; i++) assert_true(fabs(b.phi[i] * pow(s, 1.5) - a.phi[i]) < 1e-6);
  ep_lb_free(&a);
  ep_lb_free(&b);
  ep_mesh_free(&small);
  ep_mesh_free(&large);
}

// A cube has two- and threefold eigenvalues: signs alone would not do.
static void check_renumbering(int count, int cells) {
  ep_mesh mesh = shape_box(cells, cells, cells, 1, 1, 1);
  int *to = malloc((size_t)mesh.nv * sizeof *to);
  ep_mesh other = shape_permuted(&mesh, to);
  ep_lb a = solve(&mesh, count), b = solve(&other, count);
  for (int j = 0; j < count; j++)
    for (int i = 0; i < mesh.nv; i++) {
      const size_t row = (size_t)j * (size_t)mesh.nv;
      assert_true(fabs(a.phi[row + (size_t)i] - b.phi[row + (size_t)to[i]]) < 1e-5);
    }
  free(to);
  ep_lb_free(&a);
  ep_lb_free(&b);
  ep_mesh_free(&mesh);
  ep_mesh_free(&other);
}

static void test_renumbering(void **state) {
  (void)state;
  // Counts that cut the groups of 3 in every way, and one of many functions.
  for (int count = 1; count <= 4; count++) check_renumbering(count, 4);
  check_renumbering(30, 5);
}

static void test_same_bytes(void **state) {
  (void)state;
  ep_mesh mesh = shape_box(5, 5, 5, 1, 1, 1);
  ep_lb a = solve(&mesh, 12), b = solve(&mesh, 12);
  assert_memory_equal(a.phi, b.phi, 12 * (size_t)a.n * sizeof *a.phi);
  assert_memory_equal(a.lambda, b.lambda, 12 * sizeof *a.lambda);
  ep_lb_free(&a);
  ep_lb_free(&b);
  ep_mesh_free(&mesh);
}

// Two equal cubes apart: two constants are left out, everything else comes twice.
static void test_two_components(void **state) {
  (void)state;
  ep_mesh one = shape_box(4, 4, 4, 1, 1, 1), two;
  const size_t nv = (size_t)one.nv, nt = (size_t)one.nt;
  double *x = malloc(6 * nv * sizeof *x);
  int *tet = malloc(8 * nt * sizeof *tet);
  for (size_t i = 0; i < 3 * nv; i++) {
    x[i] = one.x[i];
    x[3 * nv + i] = one.x[i] + (i % 3 == 0 ? 1.7 : 0);
  }
  for (size_t i = 0; i < 4 * nt; i++) {
    tet[i] = one.tet[i];
    tet[4 * nt + i] = one.tet[i] + one.nv;
  }
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(2 * one.nv, x, 2 * one.nt, tet, "two", &two, NULL, &err), EP_OK);
  ep_lb a = solve(&one, 8), b = solve(&two, 16);
  for (int j = 0; j < 16; j++) assert_true(fabs(b.lambda[j] / a.lambda[j / 2] - 1) < 1e-9);
  check_equations(&two, &b);
  free(x);
  free(tet);
  ep_lb_free(&a);
  ep_lb_free(&b);
  ep_mesh_free(&one);
  ep_mesh_free(&two);
}

// d = Phi^T M (Phi d) for any d, and the constant field has no coefficients.
static void test_project_reconstruct(void **state) {
  (void)state;
  ep_mesh mesh = shape_box(4, 3, 3, 1, 1, 1);
  ep_lb lb = solve(&mesh, 9);
  ep_csr mass;
  ep_error err = {0};
  assert_int_equal(ep_lb_mass(&mesh, &mass, &err), EP_OK);
  double d[27], back[27], *u = malloc(3 * (size_t)mesh.nv * sizeof *u);
  for (int i = 0; i < 27; i++) d[i] = cos(3.0 * i);
  ep_lb_reconstruct(&lb, d, u);
  ep_lb_project(&lb, &mass, u, back);
  for (int i = 0; i < 27; i++) assert_true(fabs(back[i] - d[i]) < 1e-10);
  for (int i = 0; i < 3 * mesh.nv; i++) u[i] = i % 3 + 1;
  ep_lb_project(&lb, &mass, u, back);
  for (int i = 0; i < 27; i++) assert_true(fabs(back[i]) < 1e-8);
  free(u);
  ep_csr_free(&mass);
  ep_lb_free(&lb);
  ep_mesh_free(&mesh);
}

static void test_errors(void **state) {
  (void)state;
  ep_mesh mesh = shape_box(1, 1, 1, 1, 1, 1);
  ep_lb lb;
  const int bad[] = {0, -1, 7, 8};
  for (int i = 0; i < 4; i++)
    assert_int_equal(ep_lb_eigen(&mesh, bad[i], NULL, &lb, NULL), EP_ERR_ARGUMENT);
  assert_null(lb.phi);
  lb = solve(&mesh, 6);
  ep_lb_free(&lb);
  for (int k = 0; k < 3; k++) mesh.x[3 * mesh.tet[1] + k] = mesh.x[3 * mesh.tet[0] + k];
  ep_error err = {0};
  assert_int_equal(ep_lb_eigen(&mesh, 3, NULL, &lb, &err), EP_ERR_MESH);
  assert_non_null(strstr(err.text, "no volume"));
  ep_mesh_free(&mesh);
}

// The numbers after "*eigenValues <count>", ascending. Returns how many.
static int authors_values(const char *file, int most, double *values) {
  char path[EP_PATH_MAX], *text;
  size_t size;
  ep_error err = {0};
  snprintf(path, sizeof path, "%s/../shared/data/%s", EP_SOURCE_DIR, file);
  if (ep_file_read(path, &text, &size, &err) != EP_OK) fail_msg("%s", err.text);
  char *at = strstr(text, "*eigenValues");
  assert_non_null(at);
  at += strlen("*eigenValues");
  int count = (int)strtol(at, &at, 10);
  assert_true(count > 0 && count <= most);
  for (int i = 0; i < count; i++) values[i] = strtod(at, &at);
  free(text);
  qsort(values, (size_t)count, sizeof *values, ascending);
  return count;
}

static void test_car_as_the_authors(void **state) {
  (void)state;
  ep_mesh mesh;
  if (!shape_from_data("car/car.veg", &mesh)) skip();
  double theirs[200];
  const int count = authors_values("car/car.eigen", 200, theirs);
  assert_true(count >= 40);
  const double started = ep_seconds();
  ep_lb lb = solve(&mesh, 20);
  print_message("car: 20 eigenpairs in %.3f s\n", ep_seconds() - started);
  ep_lb_free(&lb);
  lb = solve(&mesh, 40);
  double worst = 0;
  // Their file prints six decimals: half a unit of the last is 1e-5 of the first value (0.05).
  for (int j = 0; j < 40; j++) {
    const double difference = fabs(lb.lambda[j] - theirs[j]) - 0.5e-6;
    worst = fmax(worst, fabs(lb.lambda[j] / theirs[j] - 1));
    assert_true(difference <= 1e-5 * theirs[j]);
  }
  print_message("car: 40 eigenvalues agree to %.1e\n", worst);
  check_equations(&mesh, &lb);
  ep_lb_free(&lb);
  ep_mesh_free(&mesh);
}

static void test_letter(void **state) {
  (void)state;
  ep_mesh mesh;
  if (!shape_from_data("letter-c/C.veg", &mesh)) skip();
  const double started = ep_seconds();
  ep_lb lb = solve(&mesh, 20);
  print_message("letter-c: 20 eigenpairs of %d vertices in %.3f s\n", mesh.nv,
                ep_seconds() - started);
  check_equations(&mesh, &lb);
  ep_lb_free(&lb);
  ep_mesh_free(&mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_operators),      cmocka_unit_test(test_box_spectra),
      cmocka_unit_test(test_equations),      cmocka_unit_test(test_scale_laws),
      cmocka_unit_test(test_renumbering),    cmocka_unit_test(test_same_bytes),
      cmocka_unit_test(test_two_components), cmocka_unit_test(test_project_reconstruct),
      cmocka_unit_test(test_errors),         cmocka_unit_test(test_car_as_the_authors),
      cmocka_unit_test(test_letter),
  };
  return cmocka_run_group_tests_name("lb eigen", tests, session_start, session_stop);
}
