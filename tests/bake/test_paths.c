// The path from rest to an example, x(w) = argmin |E(x) - w E(P)|_D^2. Claims:
//   force and stiffness of the fit are its derivatives (Taylor remainders of order h^2);
//   x(1) has the strain of the pose and is the pose;
//   each sample is a stationary minimum, below its neighbours, and strain grows along the path;
//   half the strain of a bar bent by 90 degrees is the bar bent by 45 degrees, which half of the
//   displacement is far from.
#include "bar.h"

#include "reduced/bake/basis.h"
#include "reduced/bake/paths.h"
#include "tests/petsc_session.h"

static const ep_elastic RUBBER = {.density = 1100, .young = 2e5, .poisson = 0};
static const int CELLS[3] = {24, 3, 3};
static const double SIZE[3] = {6, 0.6, 0.6};

// The bar's middle line (y = z = size/2) becomes an arc of `angle`, sections stay flat: for
// thickness / radius small its Green strain is proportional to the angle.
static void bend(const bar *b, double angle, double *u) {
  const double length = SIZE[0];
  for (int v = 0; v < b->mesh.nv; v++) {
    const double *x = b->mesh.x + 3 * (size_t)v, y = x[1] - SIZE[1] / 2;
    const double radius = length / angle, phi = x[0] / radius;
    u[3 * v] = (radius - y) * sin(phi) - x[0];
    u[3 * v + 1] = radius - (radius - y) * cos(phi) - y;
    u[3 * v + 2] = 0;
    for (int a = 0; a < 3; a++)
      if (b->fem.held[3 * v]) u[3 * v + a] = 0; // sin(0) is exact, the rest is round-off
  }
}

static void make_bent(bar *b, double *(*strain), double **pose, double angle) {
  make_bar(b, CELLS, SIZE, EP_STVK, RUBBER, 1);
  *pose = vector_of(b->n3);
  *strain = vector_of(9 * (size_t)b->mesh.nt);
  bend(b, angle, *pose);
  ep_green_strains(&b->fem, *pose, *strain);
}

static void remainders(const ep_strain_fit *fit, const double *u, const double *d, double h,
                       size_t n3, double *energy, double *force) {
  double *v = vector_of(n3), *f = vector_of(n3), *g = vector_of(n3), *kd = vector_of(n3);
  double slope = 0;
  ep_csr k;
  const ep_mesh *mesh = fit->fem->mesh;
  ASSERT_OK(ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 3, &k, err));
  ep_strain_fit_stiffness(fit, u, 0, &k);
  ep_csr_multiply(&k, 1, d, kd);
  const double start = ep_strain_fit_energy(fit, u, f);
  for (size_t i = 0; i < n3; i++) v[i] = u[i] + h * d[i], slope += f[i] * d[i];
  *energy = fabs(ep_strain_fit_energy(fit, v, g) - start - h * slope);
  for (size_t i = 0; i < n3; i++) g[i] -= f[i] + h * kd[i];
  *force = norm_of(n3, g);
  ep_csr_free(&k);
  free(v), free(f), free(g), free(kd);
}

static void test_derivatives(void **state) {
  (void)state;
  bar b;
  double *strain, *pose, e[2], f[2];
  make_bent(&b, &strain, &pose, 1.0);
  double *u = vector_of(b.n3), *d = vector_of(b.n3);
  smooth_random(&b, 1, 0.3, u);
  smooth_random(&b, 2, 1, d);
  const ep_strain_fit fit = {.fem = &b.fem, .strain = strain, .w = 0.6};
  remainders(&fit, u, d, 2e-3, b.n3, &e[0], &f[0]);
  remainders(&fit, u, d, 1e-3, b.n3, &e[1], &f[1]);
  ASSERT_LESS(fabs(order_of(e[0], e[1]) - 2), 0.1);
  ASSERT_LESS(fabs(order_of(f[0], f[1]) - 2), 0.1);
  free(u), free(d), free(strain), free(pose);
  free_bar(&b);
}

static void test_reaches_the_pose(void **state) {
  (void)state;
  bar b;
  double *strain, *pose;
  make_bent(&b, &strain, &pose, 1.5);
  double *samples = vector_of(4 * b.n3);
  ASSERT_OK(ep_path_samples(&b.fem, pose, 4, NULL, samples, err));
  assert_memory_equal(samples + 3 * b.n3, pose, b.n3 * sizeof *pose);
  // and by Newton from the sample before it
  double *u = samples + 2 * b.n3;
  ep_csr k0, k;
  ep_factor *factor;
  ASSERT_OK(ep_fem_rest_stiffness(&b.fem, &k0, err));
  ASSERT_OK(ep_csr_from_tets(b.mesh.nv, b.mesh.nt, b.mesh.tet, 3, &k, err));
  ASSERT_OK(ep_factor_create(&k0, b.fem.held, 1, &factor, err));
  const ep_strain_fit fit = {.fem = &b.fem, .strain = strain, .w = 1};
  ep_strain_fit_report report;
  const double far = distance_of(b.n3, u, pose);
  ASSERT_OK(ep_strain_fit_minimise(&fit, factor, &k0, &k, u, &report, err));
  ASSERT_LESS(0.05 * norm_of(b.n3, pose), far); // there was a way to go
  // decrement 1e-4 before the last quadratic step
  ASSERT_LESS(distance_of(b.n3, u, pose), 1e-5 * norm_of(b.n3, pose));
  double *reached = vector_of(9 * (size_t)b.mesh.nt);
  ep_green_strains(&b.fem, u, reached);
  ASSERT_LESS(distance_of(9 * (size_t)b.mesh.nt, reached, strain),
              1e-5 * norm_of(9 * (size_t)b.mesh.nt, strain));
  ep_factor_free(factor);
  ep_csr_free(&k0), ep_csr_free(&k);
  free(reached), free(samples), free(strain), free(pose);
  free_bar(&b);
}

static double free_norm(const bar *b, const double *g) {
  double sum = 0;
  for (size_t i = 0; i < b->n3; i++) sum += b->fem.held[i] ? 0 : g[i] * g[i];
  return sqrt(sum);
}

static void test_samples_are_minima(void **state) {
  (void)state;
  bar b;
  double *strain, *pose;
  make_bent(&b, &strain, &pose, 1.5);
  const size_t n3 = b.n3;
  double *samples = vector_of(5 * n3), *g = vector_of(n3); // sample 0: rest
  ASSERT_OK(ep_path_samples(&b.fem, pose, 4, NULL, samples + n3, err));
  for (int i = 1; i <= 3; i++) {
    const ep_strain_fit fit = {.fem = &b.fem, .strain = strain, .w = i / 4.0};
    const double *x = samples + (size_t)i * n3;
    const double least = ep_strain_fit_energy(&fit, x, g), slope = free_norm(&b, g);
    double *linear = vector_of(n3);
    for (size_t t = 0; t < n3; t++) linear[t] = i / 4.0 * pose[t];
    assert_true(least >= 0);
    ASSERT_LESS(least, 0.01 * ep_strain_fit_energy(&fit, linear, g)); // linear blending stretches
    ASSERT_LESS(slope, 1e-4 * free_norm(&b, g));
    for (int other = 0; other <= 4; other++)
      if (other != i)
        ASSERT_LESS(least, ep_strain_fit_energy(&fit, samples + (size_t)other * n3, NULL));
    ASSERT_LESS(ep_fem_energy(&b.fem, x - n3), ep_fem_energy(&b.fem, x));
    free(linear);
  }
  free(samples), free(g), free(strain), free(pose);
  free_bar(&b);
}

static void test_half_of_a_bend(void **state) {
  (void)state;
  bar b;
  double *strain, *pose;
  const double right_angle = acos(0.0);
  make_bent(&b, &strain, &pose, right_angle);
  double *samples = vector_of(2 * b.n3), *half = vector_of(b.n3), *blend = vector_of(b.n3);
  ASSERT_OK(ep_path_samples(&b.fem, pose, 2, NULL, samples, err));
  bend(&b, right_angle / 2, half);
  for (size_t i = 0; i < b.n3; i++) blend[i] = 0.5 * pose[i];
  const double size = norm_of(b.n3, half);
  // the strain kappa^2 y^2 / 2 is not proportional to the angle: thickness / radius = 0.16
  ASSERT_LESS(distance_of(b.n3, samples, half), 0.03 * size);
  ASSERT_LESS(0.15 * size, distance_of(b.n3, blend, half));
  free(samples), free(half), free(blend), free(strain), free(pose);
  free_bar(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_derivatives),
      cmocka_unit_test(test_reaches_the_pose),
      cmocka_unit_test(test_samples_are_minima),
      cmocka_unit_test(test_half_of_a_bend),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
