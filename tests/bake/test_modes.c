// Linear modes and modal derivatives. Claims:
//   K psi = omega^2 M psi, psi M-orthonormal, zero where held;
//   a slender cantilever tends to Euler-Bernoulli, omega_1 = 1.8751^2 sqrt(E I / (rho A L^4));
//   (H : a) b = (H : b) a is the derivative of the stiffness, for every law;
//   Psi_ij is the second derivative of the equilibrium under loads sum p_i K psi_i
//   (Barbic and James 2005, eq. 15-18).
#include "bar.h"

#include "reduced/bake/basis.h"
#include "reduced/bake/curvature.h"
#include "tests/petsc_session.h"

static const ep_elastic RUBBER = {.density = 1100, .young = 2e5, .poisson = 0.35};
static const int CELLS[3] = {6, 2, 2};
static const double SIZE[3] = {3, 0.8, 1.0};

static void test_eigenpairs(void **state) {
  (void)state;
  enum { COUNT = 6 };
  bar b;
  ep_modes modes;
  ep_csr k, m;
  make_bar(&b, CELLS, SIZE, EP_STVK, RUBBER, 1);
  ASSERT_OK(ep_modes_compute(&b.fem, COUNT, NULL, &modes, err));
  ASSERT_OK(ep_fem_rest_stiffness(&b.fem, &k, err));
  ASSERT_OK(ep_fem_mass(&b.fem, &m, err));
  double *kx = vector_of(b.n3), *mx = vector_of(b.n3);
  assert_int_equal(modes.derivatives, COUNT * (COUNT + 1) / 2);
  for (int i = 0; i < COUNT + modes.derivatives; i++)
    for (size_t t = 0; t < b.n3; t++)
      if (b.fem.held[t]) assert_true(modes.mode[(size_t)i * b.n3 + t] == 0);
  for (int i = 0; i < COUNT; i++) {
    const double *x = modes.mode + (size_t)i * b.n3;
    double residual = 0;
    ep_csr_multiply(&k, 1, x, kx);
    ep_csr_multiply(&m, 1, x, mx);
    for (size_t t = 0; t < b.n3; t++) // equations of held unknowns are reactions, not equations
      if (!b.fem.held[t]) residual += pow(kx[t] - modes.omega2[i] * mx[t], 2);
    ASSERT_LESS(sqrt(residual), 1e-7 * norm_of(b.n3, kx));
    if (i > 0) assert_true(modes.omega2[i] >= modes.omega2[i - 1]);
    for (int j = 0; j <= i; j++) {
      double sum = 0;
      for (size_t t = 0; t < b.n3; t++) sum += mx[t] * modes.mode[(size_t)j * b.n3 + t];
      ASSERT_LESS(fabs(sum - (i == j)), 1e-10);
    }
  }
  ep_csr_free(&k), ep_csr_free(&m);
  free(kx), free(mx);
  ep_modes_free(&modes);
  free_bar(&b);
}

static double cantilever(int refinement) {
  const int cells[3] = {10 * refinement, refinement, refinement};
  const double size[3] = {10, 1, 1};
  const ep_elastic wood = {.density = 700, .young = 1e6, .poisson = 0};
  bar b;
  ep_modes modes;
  make_bar(&b, cells, size, EP_STVK, wood, 1);
  ASSERT_OK(ep_modes_compute(&b.fem, 1, NULL, &modes, err));
  const double omega = sqrt(modes.omega2[0]);
  ep_modes_free(&modes);
  free_bar(&b);
  return omega;
}

// Linear tets bend too stiffly, with an error of order h^2: what is tested is the limit,
// extrapolated from h and h/2. Its tolerance: shear and rotary inertia lower omega_1 by 1-2 % at
// L / h = 10, and the next order of the extrapolation is (1/4)^2 of an error of 20 %.
static void test_euler_bernoulli(void **state) {
  (void)state;
  const double coarse = cantilever(2), fine = cantilever(4);
  const double limit = fine + (fine - coarse) / 3;
  const double exact = 1.8751040687 * 1.8751040687 * sqrt(1e6 / 12.0 / (700 * 1e4));
  ASSERT_LESS(exact, fine);
  ASSERT_LESS(fine, coarse);
  ASSERT_LESS(fabs(limit / exact - 1), 0.04);
}

// Error of (K(h b) - K(-h b)) a / 2h against (H : b) a, relative; *swapped: of (H : a) b.
static double curvature_error(ep_material law, double h, double *swapped) {
  bar b;
  ep_csr k;
  make_bar(&b, CELLS, SIZE, law, RUBBER, 0);
  const size_t n3 = b.n3;
  double *ab = vector_of(2 * n3), *ba = vector_of(2 * n3), *f = vector_of(3 * n3);
  double *g = vector_of(3 * n3), *hb = vector_of(n3), *y = vector_of(n3), *z = vector_of(n3);
  smooth_random(&b, 5, 1, ab);
  smooth_random(&b, 6, 1, ab + n3);
  memcpy(ba, ab + n3, n3 * sizeof *ba), memcpy(ba + n3, ab, n3 * sizeof *ba);
  ASSERT_OK(ep_fem_rest_curvature_forces(&b.fem, 2, ab, f, err));
  ASSERT_OK(ep_fem_rest_curvature_forces(&b.fem, 2, ba, g, err));
  ASSERT_OK(ep_csr_from_tets(b.mesh.nv, b.mesh.nt, b.mesh.tet, 3, &k, err));
  for (size_t i = 0; i < n3; i++) hb[i] = h * ab[n3 + i];
  ep_fem_stiffness(&b.fem, hb, 0, &k);
  ep_csr_multiply(&k, 1, ab, y);
  for (size_t i = 0; i < n3; i++) hb[i] = -hb[i];
  ep_fem_stiffness(&b.fem, hb, 0, &k);
  ep_csr_multiply(&k, 1, ab, z);
  double error = 0, asymmetry = 0, size = 0;
  for (size_t i = 0; i < n3; i++) { // pair (1, 0) is at place 1 of 3
    error += pow((y[i] - z[i]) / (2 * h) - f[3 * i + 1], 2);
    asymmetry += pow(g[3 * i + 1] - f[3 * i + 1], 2);
    size += pow(f[3 * i + 1], 2);
  }
  *swapped = sqrt(asymmetry / size);
  ep_csr_free(&k);
  free(ab), free(ba), free(f), free(g), free(hb), free(y), free(z);
  free_bar(&b);
  return sqrt(error / size);
}

static void test_curvature(void **state) {
  (void)state;
  for (int law = 0; law < EP_MATERIALS; law++) {
    double swapped;
    const double coarse = curvature_error((ep_material)law, 4e-3, &swapped);
    const double fine = curvature_error((ep_material)law, 2e-3, &swapped);
    // extrapolated differences: 1e-13 of the tangent, which is 1-10 times the curvature
    ASSERT_LESS(swapped, 1e-11);
    if (law == EP_STVK || law == EP_STVK_VOLUME)
      ASSERT_LESS(fine, 1e-11); // K is quadratic in u: a central difference is exact
    else
      ASSERT_LESS(fabs(order_of(coarse, fine) - 2), 0.1);
  }
}

// Equilibrium f(u) = load by Newton, from zero.
static void equilibrium(const bar *b, const double *load, double *u) {
  ep_csr k;
  ep_factor *factor = NULL;
  double *f = vector_of(b->n3);
  memset(u, 0, b->n3 * sizeof *u);
  ASSERT_OK(ep_fem_rest_stiffness(&b->fem, &k, err));
  ASSERT_OK(ep_factor_create(&k, b->fem.held, 1, &factor, err));
  for (int i = 0; i < 8; i++) { // quadratic convergence from 1 %: 5 would do
    ep_fem_force(&b->fem, u, f);
    for (size_t t = 0; t < b->n3; t++) f[t] = load[t] - f[t];
    ep_fem_stiffness(&b->fem, u, 0, &k);
    ASSERT_OK(ep_factor_update(factor, &k, err));
    ASSERT_OK(ep_factor_solve(factor, 1, f, f, err));
    for (size_t t = 0; t < b->n3; t++) u[t] += f[t];
  }
  ep_factor_free(factor);
  ep_csr_free(&k);
  free(f);
}

// Relative error of (u(p) + u(-p)) / p^2 against Psi_ii + 2 Psi_ij + Psi_jj under the load
// p K (psi_i + psi_j), i = 1, j = 0.
static double derivative_error(const bar *b, const ep_modes *modes, double p) {
  const size_t n3 = b->n3;
  ep_csr k;
  double *load = vector_of(n3), *sum = vector_of(n3), *plus = vector_of(n3);
  double *minus = vector_of(n3), *psi = vector_of(n3), *expected = vector_of(n3);
  const double *d = modes->mode + (size_t)modes->linear * n3;
  for (size_t t = 0; t < n3; t++) {
    psi[t] = p * (modes->mode[t] + modes->mode[n3 + t]);
    expected[t] = d[t] + 2 * d[n3 + t] + d[2 * n3 + t]; // pairs 00, 10, 11
  }
  ASSERT_OK(ep_fem_rest_stiffness(&b->fem, &k, err));
  ep_csr_multiply(&k, 1, psi, load);
  equilibrium(b, load, plus);
  for (size_t t = 0; t < n3; t++) load[t] = -load[t];
  equilibrium(b, load, minus);
  for (size_t t = 0; t < n3; t++) sum[t] = (plus[t] + minus[t]) / (p * p);
  const double error = distance_of(n3, sum, expected) / norm_of(n3, expected);
  ep_csr_free(&k);
  free(load), free(sum), free(plus), free(minus), free(psi), free(expected);
  return error;
}

static void test_modal_derivatives(void **state) {
  (void)state;
  const ep_material laws[2] = {EP_STVK, EP_STABLE_NEOHOOKEAN};
  for (int i = 0; i < 2; i++) {
    bar b;
    ep_modes modes;
    make_bar(&b, CELLS, SIZE, laws[i], RUBBER, 1);
    ASSERT_OK(ep_modes_compute(&b.fem, 2, NULL, &modes, err));
    double peak = 0;
    for (size_t t = 0; t < b.n3; t++) peak = fmax(peak, fabs(modes.mode[t]));
    const double p = 0.02 / peak; // displacements of under 1 % of the length
    const double coarse = derivative_error(&b, &modes, p);
    const double fine = derivative_error(&b, &modes, p / 2);
    ASSERT_LESS(fine, 1e-2);
    ASSERT_LESS(fabs(order_of(coarse, fine) - 2), 0.1);
    ep_modes_free(&modes);
    free_bar(&b);
  }
}

static void expect_unsupported(const ep_mesh *mesh, int nfixed, const int *fixed) {
  ep_fem fem;
  ep_modes modes;
  ep_error refusal = {0};
  ASSERT_OK(ep_fem_create(mesh, EP_STVK, 1, &RUBBER, nfixed, fixed, &fem, err));
  assert_int_equal(ep_modes_compute(&fem, 2, NULL, &modes, &refusal), EP_ERR_UNSUPPORTED);
  assert_non_null(strstr(refusal.text, "fixed"));
  ep_fem_free(&fem);
}

static void test_refusals(void **state) {
  (void)state;
  const int line[4] = {0, 1, 2, 3}; // along the x edge
  ep_mesh mesh;
  box_mesh(CELLS, SIZE, &mesh);
  expect_unsupported(&mesh, 2, line);
  expect_unsupported(&mesh, 4, line);
  ep_mesh_free(&mesh);
  bar b;
  ep_modes modes;
  ep_error refusal = {0};
  make_bar(&b, CELLS, SIZE, EP_STVK, RUBBER, 1);
  assert_int_equal(ep_modes_compute(&b.fem, 3 * b.mesh.nv, NULL, &modes, &refusal),
                   EP_ERR_ARGUMENT);
  free_bar(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_eigenpairs), cmocka_unit_test(test_euler_bernoulli),
      cmocka_unit_test(test_curvature),  cmocka_unit_test(test_modal_derivatives),
      cmocka_unit_test(test_refusals),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
