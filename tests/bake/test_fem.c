// Finite elements of the offline part. Claims, for every constitutive law:
//   f = dW/du and K = df/du: Taylor remainders fall as h^2;  W and |f| do not see rigid motions;
//   K is symmetric and maps translations to 0;  the projected K has no negative eigenvalue where
//   the plain one has;  the consistent mass integrates linear fields exactly.
#include "bar.h"

#include "linalg/dense.h"
#include "reduced/bake/fem_assembly.h"

static const ep_elastic RUBBER = {.density = 1100, .young = 2e5, .poisson = 0.35};
static const int CELLS[3] = {3, 2, 2};
static const double SIZE[3] = {1.5, 0.8, 1.0};

static double dot(size_t n, const double *x, const double *y) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

static void add(size_t n, const double *u, double h, const double *d, double *out) {
  for (size_t i = 0; i < n; i++) out[i] = u[i] + h * d[i];
}

static void stiffness_at(const bar *b, const double *u, int project, ep_csr *k) {
  ASSERT_OK(ep_csr_from_tets(b->mesh.nv, b->mesh.nt, b->mesh.tet, 3, k, err));
  ep_fem_stiffness(&b->fem, u, project, k);
}

// Remainders at h and h/2 of W(u + h d) = W + h f.d + O(h^2), f(u + h d) = f + h K d + O(h^2).
static void taylor_remainders(const bar *b, const double *u, const double *d, double h,
                              double *energy, double *force) {
  double *v = vector_of(b->n3), *f = vector_of(b->n3), *g = vector_of(b->n3);
  double *kd = vector_of(b->n3);
  ep_csr k;
  stiffness_at(b, u, 0, &k);
  ep_csr_multiply(&k, 1, d, kd);
  ep_fem_force(&b->fem, u, f);
  add(b->n3, u, h, d, v);
  ep_fem_force(&b->fem, v, g);
  *energy = fabs(ep_fem_energy(&b->fem, v) - ep_fem_energy(&b->fem, u) - h * dot(b->n3, f, d));
  for (size_t i = 0; i < b->n3; i++) g[i] -= f[i] + h * kd[i];
  *force = norm_of(b->n3, g);
  ep_csr_free(&k);
  free(v), free(f), free(g), free(kd);
}

static void test_derivatives(void **state) {
  (void)state;
  for (int law = 0; law < EP_MATERIALS; law++) {
    bar b;
    make_bar(&b, CELLS, SIZE, (ep_material)law, RUBBER, 0);
    double *u = vector_of(b.n3), *d = vector_of(b.n3), e[2], f[2];
    smooth_random(&b, 1, 0.15, u);
    smooth_random(&b, 2, 1, d);
    // h small enough for the h^2 term to lead, large enough to stay clear of round-off
    taylor_remainders(&b, u, d, 2e-3, &e[0], &f[0]);
    taylor_remainders(&b, u, d, 1e-3, &e[1], &f[1]);
    ASSERT_LESS(fabs(order_of(e[0], e[1]) - 2), 0.1);
    ASSERT_LESS(fabs(order_of(f[0], f[1]) - 2), 0.1);
    free(u), free(d);
    free_bar(&b);
  }
}

// u' = R (X + u) + t - X
static void move_rigidly(const bar *b, const double *u, double *out) {
  const double c = cos(1.1), s = sin(1.1), t[3] = {0.3, -2, 5};
  const double r[9] = {c, -s, 0, s * 0.6, c * 0.6, -0.8, s * 0.8, c * 0.8, 0.6};
  for (int v = 0; v < b->mesh.nv; v++)
    for (int a = 0; a < 3; a++) {
      double sum = t[a] - b->mesh.x[3 * v + a];
      for (int i = 0; i < 3; i++) sum += r[3 * a + i] * (b->mesh.x[3 * v + i] + u[3 * v + i]);
      out[3 * v + a] = sum;
    }
}

static void test_rigid_motions(void **state) {
  (void)state;
  for (int law = 0; law < EP_MATERIALS; law++) {
    bar b;
    make_bar(&b, CELLS, SIZE, (ep_material)law, RUBBER, 0);
    double *u = vector_of(b.n3), *v = vector_of(b.n3), *f = vector_of(b.n3), *g = vector_of(b.n3);
    move_rigidly(&b, u, v);
    ep_fem_force(&b.fem, v, f);
    // round-off: strains of 1e-15 times E V, squared in the energy
    ASSERT_LESS(ep_fem_energy(&b.fem, v), 1e-20 * RUBBER.young);
    ASSERT_LESS(norm_of(b.n3, f), 1e-11 * RUBBER.young);
    smooth_random(&b, 3, 0.2, u);
    move_rigidly(&b, u, v);
    const double w = ep_fem_energy(&b.fem, u);
    ep_fem_force(&b.fem, u, f);
    ep_fem_force(&b.fem, v, g);
    ASSERT_LESS(1e-4 * RUBBER.young, w); // not trivially equal
    ASSERT_LESS(fabs(ep_fem_energy(&b.fem, v) - w), 1e-12 * w);
    ASSERT_LESS(fabs(norm_of(b.n3, g) - norm_of(b.n3, f)), 1e-11 * norm_of(b.n3, f));
    free(u), free(v), free(f), free(g);
    free_bar(&b);
  }
}

static void test_symmetry(void **state) {
  (void)state;
  for (int law = 0; law < EP_MATERIALS; law++) {
    bar b;
    ep_csr k;
    make_bar(&b, CELLS, SIZE, (ep_material)law, RUBBER, 0);
    double *u = vector_of(b.n3), *one = vector_of(b.n3), *y = vector_of(b.n3), largest = 0;
    smooth_random(&b, 4, 0.2, u);
    stiffness_at(&b, u, 0, &k);
    for (int i = 0; i < k.start[k.n]; i++) largest = fmax(largest, fabs(k.value[i]));
    for (int i = 0; i < k.n; i++)
      for (int p = k.start[i]; p < k.start[i + 1]; p++)
        ASSERT_LESS(fabs(k.value[p] - k.value[ep_csr_find(&k, k.column[p], i)]), 1e-13 * largest);
    for (size_t i = 0; i < b.n3; i++) one[i] = i % 3 == 1;
    ep_csr_multiply(&k, 1, one, y);
    ASSERT_LESS(norm_of(b.n3, y), 1e-12 * largest * sqrt((double)b.n3));
    ep_csr_free(&k);
    free(u), free(one), free(y);
    free_bar(&b);
  }
}

static double lowest_eigenvalue(const bar *b, const double *u, int project, double *highest) {
  ep_csr k;
  double *a = vector_of(b->n3 * b->n3), *lambda = vector_of(b->n3);
  double *v = vector_of(b->n3 * b->n3);
  stiffness_at(b, u, project, &k);
  for (int i = 0; i < k.n; i++)
    for (int p = k.start[i]; p < k.start[i + 1]; p++)
      a[(size_t)i * b->n3 + (size_t)k.column[p]] = k.value[p];
  ASSERT_OK(ep_eigen_symmetric((int)b->n3, a, lambda, v, err));
  const double lowest = lambda[0];
  *highest = lambda[b->n3 - 1];
  ep_csr_free(&k);
  free(a), free(lambda), free(v);
  return lowest;
}

static void test_projection(void **state) {
  (void)state;
  const int cells[3] = {2, 1, 1};
  bar b;
  make_bar(&b, cells, SIZE, EP_STVK, RUBBER, 0);
  double *u = vector_of(b.n3), highest;
  for (int v = 0; v < b.mesh.nv; v++) u[3 * v] = -0.5 * b.mesh.x[3 * v]; // crushed to a half
  ASSERT_LESS(lowest_eigenvalue(&b, u, 0, &highest), -1e-3 * highest);
  ASSERT_LESS(-1e-12 * highest, lowest_eigenvalue(&b, u, 1, &highest));
  free(u);
  free_bar(&b);
}

// A uniform F: W = V psi(F). The element sum has no other way to get V and F right.
static void test_uniform_strain(void **state) {
  (void)state;
  const double f[9] = {1.1, 0.2, 0, -0.1, 0.9, 0.05, 0.3, 0, 1.05};
  bar b;
  make_bar(&b, CELLS, SIZE, EP_STABLE_NEOHOOKEAN, RUBBER, 0);
  double *u = vector_of(b.n3);
  for (int v = 0; v < b.mesh.nv; v++)
    for (int a = 0; a < 3; a++)
      for (int i = 0; i < 3; i++) u[3 * v + a] += (f[3 * a + i] - (a == i)) * b.mesh.x[3 * v + i];
  const double nu = RUBBER.poisson, young = RUBBER.young;
  const double lambda = young * nu / ((1 + nu) * (1 - 2 * nu)), mu = young / (2 * (1 + nu));
  const double expected =
      SIZE[0] * SIZE[1] * SIZE[2] * ep_material_energy(EP_STABLE_NEOHOOKEAN, lambda, mu, f);
  ASSERT_LESS(fabs(ep_fem_energy(&b.fem, u) - expected), 1e-12 * expected);
  free(u);
  free_bar(&b);
}

// integral of rho x^2 over the box = rho a^3 b c / 3, exact because x lies in the element space
static void test_mass(void **state) {
  (void)state;
  bar b;
  ep_csr scalar, full;
  make_bar(&b, CELLS, SIZE, EP_STVK, RUBBER, 0);
  ASSERT_OK(ep_fem_scalar_mass(&b.fem, &scalar, err));
  ASSERT_OK(ep_fem_mass(&b.fem, &full, err));
  double *x = vector_of(b.n3), *y = vector_of(b.n3), *z = vector_of(b.n3);
  memcpy(x, b.mesh.x, b.n3 * sizeof *x);
  ep_csr_multiply(&full, 1, x, y);
  ep_csr_multiply(&scalar, 3, x, z);
  const double moment = SIZE[0] * SIZE[0] + SIZE[1] * SIZE[1] + SIZE[2] * SIZE[2];
  const double expected = RUBBER.density * SIZE[0] * SIZE[1] * SIZE[2] * moment / 3;
  ASSERT_LESS(fabs(dot(b.n3, x, y) - expected), 1e-12 * expected);
  ASSERT_LESS(distance_of(b.n3, y, z), 1e-13 * norm_of(b.n3, y));
  ep_csr_free(&scalar), ep_csr_free(&full);
  free(x), free(y), free(z);
  free_bar(&b);
}

static void expect_refusal(const ep_mesh *mesh, ep_elastic m, int nfixed, const int *fixed,
                           ep_status expected, const char *word) {
  ep_fem fem;
  ep_error err = {0};
  assert_int_equal(ep_fem_create(mesh, EP_STVK, 1, &m, nfixed, fixed, &fem, &err), expected);
  if (!strstr(err.text, word)) fail_msg("'%s' does not name '%s'", err.text, word);
  assert_null(fem.gradient);
}

static void test_refusals(void **state) {
  (void)state;
  ep_mesh mesh;
  ep_elastic m = RUBBER;
  const int beyond = 100000;
  box_mesh(CELLS, SIZE, &mesh);
  m.poisson = 0.5, expect_refusal(&mesh, m, 0, NULL, EP_ERR_ARGUMENT, "0.5");
  m.poisson = -0.1, expect_refusal(&mesh, m, 0, NULL, EP_ERR_ARGUMENT, "-0.1");
  m.poisson = NAN, expect_refusal(&mesh, m, 0, NULL, EP_ERR_ARGUMENT, "Poisson");
  m = RUBBER, m.density = 0, expect_refusal(&mesh, m, 0, NULL, EP_ERR_ARGUMENT, "density");
  m = RUBBER, m.young = -1, expect_refusal(&mesh, m, 0, NULL, EP_ERR_ARGUMENT, "Young");
  expect_refusal(&mesh, RUBBER, 1, &beyond, EP_ERR_ARGUMENT, "100000");
  // tet 5 made flat: its fourth vertex onto the centre of the face of the other three
  const int *t = mesh.tet + 4 * 5;
  for (int a = 0; a < 3; a++)
    mesh.x[3 * t[3] + a] = (mesh.x[3 * t[0] + a] + mesh.x[3 * t[1] + a] + mesh.x[3 * t[2] + a]) / 3;
  ep_fem fem;
  ep_error err = {0};
  assert_int_equal(ep_fem_create(&mesh, EP_STVK, 1, &RUBBER, 0, NULL, &fem, &err), EP_ERR_MESH);
  assert_non_null(strstr(err.text, "tet "));
  ep_mesh_free(&mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_derivatives),    cmocka_unit_test(test_rigid_motions),
      cmocka_unit_test(test_symmetry),       cmocka_unit_test(test_projection),
      cmocka_unit_test(test_uniform_strain), cmocka_unit_test(test_mass),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
