// Free motion, reduced/frame.h and free_step.h, on bodies of the bake. Claims:
//  - the basis is mass-orthogonal to the six rigid modes at rest, examples stay in its span, and a
//    free bar has the frequencies of one: (k pi c / L)^2 along it;
//  - the inertia sums are those over all vertices with the consistent mass;
//  - linear and angular momentum, summed over the vertices, are kept to 1e-10 over 10,000 steps
//    with strong example forces and spin, for every integrator; c moves on a straight line;
//  - a rigid body keeps its energy, and tumbles as Euler's equations say (order 2 in dt);
//  - implicit Euler and BDF2 are stable at 1/60 s however fast the spin, below half a turn a step;
//  - a spin of 1.9 rad a step about whatever axis is no reason to fail;
//  - with steps of 1e-5 to 0.1 s in any order they gain no more than with equal ones;
//  - a spinning bar is stretched as theory says and swings along itself with
//    w^2 = W'' - Omega^2 (J''/2 - J'^2 / J): the last term because it spins slower where it is
//    longer;
//  - pushes change both momenta by their impulse, gravity the linear one alone; q sees no gravity;
//  - damping by stiffness sees the deformation alone: nearly incompressible bodies that spin and
//    swing take as few Newton iterations as held ones; with Newmark it acts on the rate that the
//    next step goes on from, and holds it;
//  - a step that fails leaves the state as it was.
#include "reduced/frame.h"

#include "free_body.h"
#include "tests/petsc_session.h"

static const ep_elastic SOFT = {.density = 1000, .young = 2e5, .poisson = 0.3};
static const ep_elastic STIFF = {.density = 1000, .young = 1e11, .poisson = 0.3};
static const int CELLS[3] = {6, 2, 2};
static const double SIZE[3] = {1, 0.3, 0.2};
static const double PI = 3.14159265358979323846;

static double norm3(const double a[3]) {
  return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

static double distance3(const double a[3], const double b[3]) {
  const double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return norm3(d);
}

static void random_state(free_body *f, double size, double speed) {
  ep_random rng = ep_random_seed(3, 1);
  for (int a = 0; a < f->model->size.r; a++) {
    ep_state_q(f->state)[a] = size * ep_random_normal(&rng) / (1 + a);
    ep_state_velocity(f->state)[a] = speed * ep_random_normal(&rng) / (1 + a);
  }
}

// ---- bake ------------------------------------------------------------------------------------

static void the_basis_is_free_of_rigid_modes(void **state) {
  (void)state;
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK, SOFT, 8, 16, 2);
  const size_t n3 = f.b.n3;
  double *rigid = vector_of(12 * n3);
  ASSERT_OK(ep_rigid_modes(&f.b.mesh, &f.mass, rigid, rigid + 6 * n3, err));
  for (int a = 0; a < f.model->size.r; a++)
    for (int k = 0; k < 6; k++) {
      double along = 0;
      for (size_t i = 0; i < n3; i++)
        along += rigid[(size_t)(6 + k) * n3 + i] * f.model->u[(size_t)a * n3 + i];
      ASSERT_LESS(fabs(along), 1e-11); // both are unit vectors: round-off of n3 products
    }
  for (int i = 0; i < 2; i++) ASSERT_LESS(f.basis.example_residual[i], 1e-12);
  for (int i = 1; i < f.modes.linear; i++) assert_true(f.modes.omega2[i] >= f.modes.omega2[i - 1]);
  assert_true(f.modes.omega2[0] > 1);
  free(rigid);
  drop_free_body(&f);
}

// A thin bar without Poisson's effect: the frequencies along it are those of one dimension, with
// linear elements (1 + (k pi / N)^2 / 24) of theirs to leading order.
static void a_free_bar_rings_as_one(void **state) {
  (void)state;
  const int cells[3] = {20, 1, 1};
  const double size[3] = {1, 0.02, 0.02};
  const ep_elastic thin = {.density = 1000, .young = 1e6, .poisson = 0};
  free_body f;
  make_free_body(&f, cells, size, EP_STVK, thin, 30, 30, 0);
  const double expected = PI * sqrt(thin.young / thin.density) / size[0];
  double best = 1;
  for (int i = 0; i < f.modes.linear; i++)
    best = fmin(best, fabs(sqrt(f.modes.omega2[i]) / expected - 1));
  ASSERT_LESS(best, 2e-3); // (pi / 20)^2 / 24 = 1.03e-3
  drop_free_body(&f);
}

static void the_inertia_is_that_of_the_vertices(void **state) {
  (void)state;
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK, SOFT, 8, 16, 0);
  random_state(&f, 0.3, 2);
  const double velocity[3] = {0.3, -2, 1}, spin[3] = {3, -4, 5}, at[3] = {1, 2, 3};
  ep_frame frame = *ep_state_frame(f.state);
  const double c = cos(0.7), s = sin(0.7);
  const double turn[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
  memcpy(frame.c, at, sizeof at);
  memcpy(frame.R, turn, sizeof turn);
  assert_int_equal(ep_state_set_frame(f.state, &frame), EP_OK);
  assert_int_equal(ep_state_set_motion(f.state, velocity, spin), EP_OK);
  double *x = vector_of(2 * f.b.n3), *v = x + f.b.n3;
  double center[3], linear[3], angular[3], p[3], l[3], back[3], spin_back[3];
  motion_of(&f, x, v);
  sums_of(&f, x, v, center, linear, angular);
  ep_state_momentum(f.state, p, l);
  ep_state_motion(f.state, back, spin_back);
  for (int i = 0; i < 3; i++)
    l[i] += at[(i + 1) % 3] * p[(i + 2) % 3] - at[(i + 2) % 3] * p[(i + 1) % 3];
  ASSERT_LESS(distance3(center, at), 1e-12);
  ASSERT_LESS(distance3(linear, p), 1e-12 * norm3(p));
  ASSERT_LESS(distance3(angular, l), 1e-12 * norm3(l));
  ASSERT_LESS(distance3(back, velocity), 1e-13);
  ASSERT_LESS(distance3(spin_back, spin), 1e-12);
  frame.R[0] += 1e-3;
  assert_int_equal(ep_state_set_frame(f.state, &frame), EP_ERR_ARGUMENT);
  free(x);
  drop_free_body(&f);
}

// ---- free flight -----------------------------------------------------------------------------

static void momenta_are_kept(void **state) {
  (void)state;
  static const double dt[EP_INTEGRATORS] = {1.0 / 60, 1e-3, 1e-3};
  free_body f;
  const int cells[3] = {4, 1, 1};
  make_free_body(&f, cells, SIZE, EP_STVK_VOLUME, SOFT, 4, 8, 2);
  double *x = vector_of(2 * f.b.n3), *v = x + f.b.n3;
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    const double velocity[3] = {0.5, -0.2, 0.1}, spin[3] = {2, 9, 4};
    double center[3], linear[3], angular[3], c[3], p[3], l[3];
    assert_int_equal(ep_state_init(f.model, f.whole.block, ep_state_bytes(f.model), &f.state),
                     EP_OK);
    memcpy(ep_state_q(f.state), f.model->example_q, (size_t)f.model->size.r * sizeof(double));
    assert_int_equal(ep_state_set_motion(f.state, velocity, spin), EP_OK);
    motion_of(&f, x, v);
    sums_of(&f, x, v, center, linear, angular);
    ep_step_def def = ep_default_step();
    def.integrator = (ep_integrator)kind;
    def.dt = dt[kind];
    def.strength = 20;
    // the target, frozen within a step, feeds energy into a motion that nothing damps
    def.damping_stiffness = kind == EP_IMPLICIT_EULER ? 0 : 1e-3;
    double worst_linear = 0, worst_angular = 0, worst_path = 0;
    for (int n = 1; n <= 10000; n++) {
      assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
      if (n % 500) continue;
      motion_of(&f, x, v);
      sums_of(&f, x, v, c, p, l);
      for (int i = 0; i < 3; i++) c[i] -= n * def.dt * velocity[i];
      worst_linear = fmax(worst_linear, distance3(p, linear) / norm3(linear));
      worst_angular = fmax(worst_angular, distance3(l, angular) / norm3(angular));
      worst_path = fmax(worst_path, distance3(c, center));
    }
    print_message("%s: linear %.1e, angular %.1e, path %.1e\n",
                  ep_integrator_name((ep_integrator)kind), worst_linear, worst_angular, worst_path);
    ASSERT_LESS(worst_linear, 1e-10);
    ASSERT_LESS(worst_angular, 1e-10);
    ASSERT_LESS(worst_path, 1e-9); // 10,000 additions to positions of up to 100 m
  }
  free(x);
  drop_free_body(&f);
}

// Euler's equations in body axes and R' = R omega, by RK4 with small steps.
static void euler_rate(const double j[3], const double y[12], double rate[12]) {
  const double w[3] = {y[9], y[10], y[11]};
  for (int i = 0; i < 3; i++) {
    for (int k = 0; k < 3; k++)
      rate[3 * i + k] =
          y[3 * i + (k + 1) % 3] * w[(k + 2) % 3] - y[3 * i + (k + 2) % 3] * w[(k + 1) % 3];
    rate[9 + i] = (j[(i + 1) % 3] - j[(i + 2) % 3]) * w[(i + 1) % 3] * w[(i + 2) % 3] / j[i];
  }
}

static void euler_solution(const double j[3], double time, int steps, double y[12]) {
  const double h = time / steps;
  for (int n = 0; n < steps; n++) {
    double k[4][12], z[12];
    euler_rate(j, y, k[0]);
    for (int s = 1; s < 4; s++) {
      for (int i = 0; i < 12; i++) z[i] = y[i] + (s == 3 ? h : 0.5 * h) * k[s - 1][i];
      euler_rate(j, z, k[s]);
    }
    for (int i = 0; i < 12; i++) y[i] += h / 6 * (k[0][i] + 2 * k[1][i] + 2 * k[2][i] + k[3][i]);
  }
}

// Largest difference of the axes over the tumbling time; a stiff body spun about its middle axis.
static double tumble(free_body *f, double dt, double *energy_drift) {
  const double time = 6, spin[3] = {0.05, 6, 0.02}, velocity[3] = {0}; // turns over three times
  assert_int_equal(ep_state_init(f->model, f->whole.block, ep_state_bytes(f->model), &f->state),
                   EP_OK);
  assert_int_equal(ep_state_set_motion(f->state, velocity, spin), EP_OK);
  const double *s0 = f->model->rigid_s0;
  const double j[3] = {s0[1] + s0[2], s0[2] + s0[0], s0[0] + s0[1]};
  double y[12] = {1, 0, 0, 0, 1, 0, 0, 0, 1, spin[0], spin[1], spin[2]}, worst = 0;
  ep_step_def def = ep_default_step();
  def.dt = dt;
  ep_step_report report;
  const double energy =
      0.5 * (j[0] * spin[0] * spin[0] + j[1] * spin[1] * spin[1] + j[2] * spin[2] * spin[2]);
  *energy_drift = 0;
  int flips = 0;
  double side = 1;
  for (int n = 0; n < (int)lround(time / dt); n++) {
    assert_int_equal(ep_step(f->state, &def, &report), EP_OK);
    euler_solution(j, dt, 8, y);
    worst = fmax(worst, distance_of(9, ep_state_frame(f->state)->R, y));
    *energy_drift = fmax(*energy_drift, fabs(report.kinetic_energy / energy - 1));
    if (y[10] * side < -3) side = -side, flips++;
  }
  assert_true(flips >= 2);
  return worst;
}

static void a_stiff_body_tumbles_as_euler_says(void **state) {
  (void)state;
  free_body f;
  const int cells[3] = {2, 2, 2};
  const double size[3] = {1, 0.6, 0.25};
  make_free_body(&f, cells, size, EP_STVK, STIFF, 4, 4, 0);
  ASSERT_LESS(fabs(f.model->rigid_s0[3]) + fabs(f.model->rigid_s0[4]) + fabs(f.model->rigid_s0[5]),
              1e-2 * f.model->rigid_s0[0]); // the box's axes are nearly principal (Kuhn's tets)
  double drift, coarse = tumble(&f, 4e-3, &drift), fine = tumble(&f, 2e-3, &drift);
  print_message("tumbling: %.2e, %.2e (order %.2f), energy %.1e\n", coarse, fine,
                order_of(coarse, fine), drift);
  ASSERT_LESS(fabs(order_of(coarse, fine) - 2), 0.1);
  ASSERT_LESS(fine, 0.02);
  ASSERT_LESS(drift, 1e-6); // the body gives by Omega^2 rho L^2 / E = 4e-7
  drop_free_body(&f);
}

// At 1/60 s and up to 2.7 rad a step: the body stretches and slows down, and its energy never
// grows.
static void fast_spin_is_stable(void **state) {
  (void)state;
  static const double speeds[] = {20, 80, 160};
  const ep_elastic rubber = {.density = 1000, .young = 1e7, .poisson = 0.3};
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK_VOLUME, rubber, 8, 12, 0);
  for (int kind = 0; kind < EP_INTEGRATORS; kind++)
    for (int i = 0; i < 3 && kind != EP_NEWMARK; i++) { // Newmark damps nothing: small steps
      const double still[3] = {0}, spin[3] = {0.1 * speeds[i], 0.2 * speeds[i], speeds[i]};
      assert_int_equal(ep_state_init(f.model, f.whole.block, ep_state_bytes(f.model), &f.state),
                       EP_OK);
      assert_int_equal(ep_state_set_motion(f.state, still, spin), EP_OK);
      ep_step_def def = ep_default_step();
      ep_step_report report;
      def.integrator = (ep_integrator)kind;
      double energy = 0;
      for (int n = 0; n < 300; n++) {
        assert_int_equal(ep_step(f.state, &def, &report), EP_OK);
        if (n == 0) energy = report.elastic_energy + report.kinetic_energy;
        ASSERT_LESS(report.elastic_energy + report.kinetic_energy, 1.002 * energy);
      }
      double velocity[3], end[3];
      ep_state_motion(f.state, velocity, end);
      ASSERT_LESS(norm3(end), 1.01 * norm3(spin));
    }
  drop_free_body(&f);
}

// Far from the principal axes the turn of a step is a hard equation: its solution lies less than
// half a turn away, on a way that Newton at full length leaves.
static void no_axis_is_special(void **state) {
  (void)state;
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK_VOLUME, STIFF, 4, 6, 0);
  ep_random rng = ep_random_seed(11, 1);
  for (int n = 0; n < 60; n++) {
    const double still[3] = {0};
    double axis[3], spin[3];
    for (int i = 0; i < 3; i++) axis[i] = ep_random_normal(&rng);
    ep_step_def def = ep_default_step();
    for (int i = 0; i < 3; i++) spin[i] = 1.9 / def.dt * axis[i] / norm3(axis);
    assert_int_equal(ep_state_init(f.model, f.whole.block, ep_state_bytes(f.model), &f.state),
                     EP_OK);
    assert_int_equal(ep_state_set_motion(f.state, still, spin), EP_OK);
    assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
  }
  drop_free_body(&f);
}

// ---- a spinning bar --------------------------------------------------------------------------

// A bar whose basis are the `wanted` lowest modes along it.
static void make_stretcher(free_body *f, int wanted) {
  static const int cells[3] = {24, 1, 1};
  static const double size[3] = {1, 0.08, 0.08};
  const ep_elastic rubber = {.density = 1000, .young = 1e6, .poisson = 0};
  begin_free_body(f, cells, size, EP_STVK, rubber, 36);
  const size_t n3 = f->b.n3;
  f->basis = (ep_basis){.n = f->b.mesh.nv, .u = vector_of((size_t)wanted * n3)};
  f->basis.stiffness = vector_of((size_t)(wanted * wanted));
  for (int i = 0; i < f->modes.linear && f->basis.r < wanted; i++) {
    const double *u = f->modes.mode + (size_t)i * n3;
    double along = 0, whole = 0;
    for (size_t j = 0; j < n3; j++) {
      whole += u[j] * u[j];
      along += j % 3 == 0 ? u[j] * u[j] : 0;
    }
    if (along < 0.9 * whole) continue;
    memcpy(f->basis.u + (size_t)f->basis.r * n3, u, n3 * sizeof *u);
    f->basis.stiffness[f->basis.r * (wanted + 1)] = f->modes.omega2[i];
    f->basis.r++;
  }
  assert_int_equal(f->basis.r, wanted);
  finish_free_body(f);
}

// u'' = -Omega^2 x / c^2 with free ends: the tips move out by Omega^2 L^3 / (24 c^2) each.
static void a_spinning_bar_is_stretched(void **state) {
  (void)state;
  free_body f;
  make_stretcher(&f, 3);
  const double speed = sqrt(1e6 / 1000), spin = 0.01 * PI * speed;
  const double around[3] = {0, 0, spin}, still[3] = {0};
  assert_int_equal(ep_state_set_motion(f.state, still, around), EP_OK);
  ep_step_def def = ep_default_step();
  for (int n = 0; n < 2000; n++) assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
  double tip = 0, rate = 0;
  int faces = 0;
  for (int v = 0; v < f.b.mesh.nv; v++) {
    const double x = f.b.mesh.x[3 * v];
    if (x > 1e-9 && x < 1 - 1e-9) continue;
    for (int a = 0; a < 3; a++)
      tip += (x > 0.5 ? 1 : -1) * ep_state_q(f.state)[a] *
             f.model->u[(size_t)a * f.b.n3 + 3 * (size_t)v];
    faces++;
  }
  tip /= faces;
  for (int a = 0; a < 3; a++) rate = fmax(rate, fabs(ep_state_velocity(f.state)[a]));
  const double expected = spin * spin / (24 * speed * speed);
  print_message("stretch %.6e, theory %.6e (%.2e)\n", tip, expected, tip / expected - 1);
  ASSERT_LESS(rate, 1e-9); // at rest, by the damping of implicit Euler
  // the modes left out hold 2e-3 of it (1 / 5^4 ..), the elements are too stiff by 2e-3 (w / w_0 is
  // 1.0009), and 3e-3 of the modes' motion goes across the bar
  ASSERT_LESS(fabs(tip / expected - 1), 1e-2);
  drop_free_body(&f);
}

// One mode: q'' = -W'(q) - d/dq L^2 / (2 J(q)), all of it known.
static void a_spinning_bar_swings(void **state) {
  (void)state;
  free_body f;
  make_stretcher(&f, 1);
  const double w0 = sqrt(f.modes.omega2[0] > 0 ? f.basis.stiffness[0] : 0), spin = 0.1 * w0;
  const double *s0 = f.model->rigid_s0, *s1 = f.model->rigid_s1, *s2 = f.model->rigid_s2;
  const double j0 = s0[0] + s0[1], j1 = s1[0] + s1[1], j2 = s2[0] + s2[1];
  const double momentum = j0 * spin;
  double q = 0, force = 0, stiffness = 0, j = 0;
  for (int n = 0; n < 50; n++) { // Newton for the equilibrium
    ep_elastic_energy(f.state, &q, &force, &stiffness, 0);
    j = j0 + j1 * q + j2 * q * q;
    const double slope = j1 + 2 * j2 * q, w = momentum / j;
    const double g = force - 0.5 * w * w * slope;
    const double h = stiffness - w * w * (j2 - slope * slope / j);
    q -= g / h;
  }
  const double slope = j1 + 2 * j2 * q, w = momentum / j;
  const double expected = sqrt(stiffness - w * w * (j2 - slope * slope / j));
  const double around[3] = {0, 0, spin}, still[3] = {0};
  const double kick = 1e-3 * q * w0;
  assert_int_equal(ep_state_set_motion(f.state, still, around), EP_OK);
  ep_state_q(f.state)[0] = q;
  ep_state_velocity(f.state)[0] = kick;
  ep_step_def def = ep_default_step();
  def.integrator = EP_NEWMARK;
  def.tolerance = 1e-12;
  def.dt = 2 * PI / expected / 200;
  double first = -1, last = 0, before = 0;
  int crossings = -1;
  for (int n = 1; crossings < 20; n++) {
    assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    const double at = ep_state_q(f.state)[0] - q;
    if (before < 0 && at >= 0) { // upwards, between two steps
      last = (n - at / (at - before)) * def.dt;
      if (++crossings == 0) first = last;
    }
    before = at;
  }
  const double measured = 2 * PI * 20 / (last - first);
  print_message("spin %.3g w0: w / w0 = %.6f, theory %.6f (%.1e)\n", spin / w0, measured / w0,
                expected / w0, measured / expected - 1);
  // Newmark: 1 - (w dt)^2 / 12 = 1 - 8.2e-5 at 200 steps a period
  ASSERT_LESS(fabs(measured / expected - 1 + 8.2e-5), 2e-5);
  ASSERT_LESS(2e-3, fabs(expected / w0 - 1)); // and it is not simply that of the bar at rest
  drop_free_body(&f);
}

// ---- damping ---------------------------------------------------------------------------------

static int ascending(const void *a, const void *b) {
  return *(const int *)a - *(const int *)b;
}

// A bulk modulus of 2,500 times the shear modulus, and damping by all of it. While its swinging
// lasts a step takes 3 to 8 iterations: those of any neo-Hookean body.
static void nearly_incompressible_bodies_fly_easily(void **state) {
  (void)state;
  enum { STEPS = 120 };
  const ep_elastic rubber = {.density = 1000, .young = 2e5, .poisson = 0.4999};
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STABLE_NEOHOOKEAN, rubber, 12, 24, 0);
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    if (kind == EP_NEWMARK) continue; // wants small steps
    const double still[3] = {0}, spin[3] = {1, 2, 3};
    int iterations[STEPS];
    assert_int_equal(ep_state_init(f.model, f.whole.block, ep_state_bytes(f.model), &f.state),
                     EP_OK);
    random_state(&f, 0.1, 1);
    assert_int_equal(ep_state_set_motion(f.state, still, spin), EP_OK);
    ep_step_def def = ep_default_step();
    ep_step_report report;
    def.integrator = (ep_integrator)kind;
    def.damping_stiffness = 5e-3;
    for (int n = 0; n < STEPS; n++) {
      assert_int_equal(ep_step(f.state, &def, &report), EP_OK);
      iterations[n] = report.newton_iterations;
    }
    qsort(iterations, STEPS, sizeof *iterations, ascending);
    print_message("%s: median %d, most %d iterations\n", ep_integrator_name(def.integrator),
                  iterations[STEPS / 2], iterations[STEPS - 1]);
    ASSERT_LESS(iterations[STEPS / 2], 6);
    ASSERT_LESS(iterations[STEPS - 1], 25);
  }
  drop_free_body(&f);
}

// Steps that grow a thousand times would draw out what the two steps before differ in: BDF2 begins
// anew there (ep_integrator_before). What is gained is of the order of the largest steps, 2 rad of
// spin in one.
static void steps_may_be_of_any_length(void **state) {
  (void)state;
  const ep_elastic rubber = {.density = 1000, .young = 2e5, .poisson = 0.4999};
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STABLE_NEOHOOKEAN, rubber, 12, 24, 0);
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    if (kind == EP_NEWMARK) continue; // wants small steps
    const double still[3] = {0}, spin[3] = {6, 15, 9};
    double before = 0, most = 0;
    ep_random rng = ep_random_seed(5, 1);
    assert_int_equal(ep_state_init(f.model, f.whole.block, ep_state_bytes(f.model), &f.state),
                     EP_OK);
    random_state(&f, 0.1, 1);
    assert_int_equal(ep_state_set_motion(f.state, still, spin), EP_OK);
    for (int n = 0; n < 150; n++) {
      ep_step_def def = ep_default_step();
      ep_step_report report;
      def.integrator = (ep_integrator)kind;
      def.dt = 1e-5 * pow(1e4, ep_random_uniform(&rng));
      assert_int_equal(ep_step(f.state, &def, &report), EP_OK);
      const double now = report.elastic_energy + report.kinetic_energy;
      if (n > 0) most = fmax(most, now / before - 1);
      before = now;
    }
    print_message("%s, steps of any length: gains %.1e at most\n",
                  ep_integrator_name((ep_integrator)kind), most);
    ASSERT_LESS(most, 1e-3); // 3e-4; drawn out: 0.4
  }
  drop_free_body(&f);
}

// Two steps a period, a third of a radian a step: without damping the energy grows ninefold, by a
// damping of another rate than the state's own it more than doubles before a step fails.
static void newmark_damps_what_it_goes_on_from(void **state) {
  (void)state;
  const ep_elastic rubber = {.density = 1000, .young = 1e7, .poisson = 0.3};
  const double still[3] = {0}, spin[3] = {2, 4, 20};
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK_VOLUME, rubber, 8, 12, 0);
  assert_int_equal(ep_state_set_motion(f.state, still, spin), EP_OK);
  ep_step_def def = ep_default_step();
  ep_step_report report;
  def.integrator = EP_NEWMARK;
  def.damping_stiffness = 1e-3;
  double first = 0;
  for (int n = 0; n < 180; n++) {
    assert_int_equal(ep_step(f.state, &def, &report), EP_OK);
    const double energy = report.elastic_energy + report.kinetic_energy;
    if (n == 0) first = energy;
    ASSERT_LESS(energy, 1.05 * first);
  }
  drop_free_body(&f);
}

// BDF2 after a step of another integrator begins as it begins from rest: by a step of Euler.
static void bdf2_begins_anew_after_others(void **state) {
  (void)state;
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK, SOFT, 8, 12, 0);
  const double velocity[3] = {1, 2, 3}, spin[3] = {3, 1, 2};
  double q[2][12];
  for (int kind = 0; kind < 2; kind++) {
    assert_int_equal(ep_state_init(f.model, f.whole.block, ep_state_bytes(f.model), &f.state),
                     EP_OK);
    random_state(&f, 0.2, 1);
    assert_int_equal(ep_state_set_motion(f.state, velocity, spin), EP_OK);
    ep_step_def def = ep_default_step();
    for (int n = 0; n < 3; n++) assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    if (kind) def.integrator = EP_BDF2;
    assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    memcpy(q[kind], ep_state_q(f.state), sizeof q[kind]);
  }
  assert_memory_equal(q[0], q[1], sizeof q[0]);
  drop_free_body(&f);
}

// ---- loads -----------------------------------------------------------------------------------

static void gravity_and_pushes_give_their_impulse(void **state) {
  (void)state;
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK, SOFT, 8, 12, 0);
  const int r = f.model->size.r, nv = f.b.mesh.nv;
  ep_step_def def = ep_default_step();
  def.gravity[1] = -9.81;
  for (int n = 0; n < 50; n++) assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
  // q sees nothing of it: sum m U = 0. Implicit Euler falls by g dt^2 n (n + 1) / 2.
  for (int i = 0; i < r; i++) ASSERT_LESS(fabs(ep_state_q(f.state)[i]), 1e-12);
  const double fallen = ep_state_frame(f.state)->c[1] - f.model->rigid_origin[1];
  ASSERT_LESS(fabs(fallen + 9.81 * def.dt * def.dt * 50 * 51 / 2), 1e-10);
  // a push on the last vertex, which the object drags round
  double *modes = vector_of(3 * (size_t)r);
  ep_pull pull = {.force = {0, 3, 1}, .modes = modes};
  for (size_t k = 0; k < 3; k++) {
    pull.at[k] = f.b.mesh.x[3 * (size_t)(nv - 1) + k] - f.model->rigid_origin[k];
    for (size_t i = 0; i < (size_t)r; i++)
      modes[3 * i + k] = f.model->u[i * f.b.n3 + 3 * (size_t)(nv - 1) + k];
  }
  def.gravity[1] = 0;
  def.pulls = 1; // without any, then one without its modes: refused
  assert_int_equal(ep_step(f.state, &def, NULL), EP_ERR_ARGUMENT);
  def.pull = &pull;
  pull.modes = NULL;
  assert_int_equal(ep_step(f.state, &def, NULL), EP_ERR_ARGUMENT);
  pull.modes = modes;
  double p[3], l[3], p0[3], l0[3], *x = vector_of(f.b.n3), impulse[3] = {0};
  ep_state_momentum(f.state, p0, l0);
  for (int n = 0; n < 60; n++) {
    assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    ep_state_positions(f.state, x);
    double arm[3];
    for (size_t k = 0; k < 3; k++)
      arm[k] = x[3 * (size_t)(nv - 1) + k] - ep_state_frame(f.state)->c[k];
    for (int k = 0; k < 3; k++)
      impulse[k] += def.dt * (arm[(k + 1) % 3] * pull.force[(k + 2) % 3] -
                              arm[(k + 2) % 3] * pull.force[(k + 1) % 3]);
  }
  ep_state_momentum(f.state, p, l);
  for (int k = 0; k < 3; k++) {
    ASSERT_LESS(fabs(p[k] - p0[k] - 60 * def.dt * pull.force[k]), 1e-11);
    ASSERT_LESS(fabs(l[k] - l0[k] - impulse[k]), 1e-9);
  }
  free(modes);
  free(x);
  drop_free_body(&f);
}

static void a_failed_step_changes_nothing(void **state) {
  (void)state;
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK, SOFT, 8, 12, 0);
  random_state(&f, 0.2, 1);
  const double velocity[3] = {1, 2, 3}, mild[3] = {1, 2, 3}, wild[3] = {0, 0, 400};
  const size_t count = ep_state_history_size(f.state);
  double *before = vector_of(2 * count), *after = before + count;
  // no convergence allowed; more than half a turn in a step; each with a motion before that counts,
  // and where the caller has just written one
  for (int kind = 0; kind < 4 * EP_INTEGRATORS; kind++) {
    const int wildly = kind & 1, wrote = kind & 2;
    ep_step_def def = ep_default_step();
    def.integrator = (ep_integrator)(kind / 4);
    assert_int_equal(ep_state_set_motion(f.state, velocity, mild), EP_OK);
    assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    if (wildly) assert_int_equal(ep_state_set_motion(f.state, velocity, wild), EP_OK);
    if (wrote) ep_state_velocity(f.state)[1] += 0.1;
    def.max_iterations = wildly ? 50 : 1;
    def.tolerance = wildly ? 1e-6 : 1e-15;
    ep_state_get_history(f.state, before);
    assert_int_equal(ep_step(f.state, &def, NULL), EP_ERR_NUMERIC);
    ep_state_get_history(f.state, after);
    assert_memory_equal(before, after, count * sizeof *before);
  }
  free(before);
  drop_free_body(&f);
}

// A state that takes the history of a flying one flies on with the same bits.
static void a_history_goes_on_the_same(void **state) {
  (void)state;
  static const ep_integrator integrator[] = {EP_IMPLICIT_EULER, EP_NEWMARK, EP_BDF2};
  free_body f;
  make_free_body(&f, CELLS, SIZE, EP_STVK, SOFT, 8, 16, 2);
  const size_t bytes = (ep_state_bytes(f.model) + 63) / 64 * 64;
  for (int i = 0; i < 3; i++) {
    void *block = aligned_alloc(64, bytes);
    ep_state *copy;
    assert_non_null(block);
    assert_int_equal(ep_state_init(f.model, block, bytes, &copy), EP_OK);
    const size_t count = ep_state_history_size(copy);
    double *one = vector_of(count), *two = vector_of(count);
    const double velocity[3] = {1, 2, 3}, spin[3] = {3, 1, 2};
    ep_step_def def = ep_default_step();
    def.integrator = integrator[i];
    def.damping_stiffness = 1e-3;
    random_state(&f, 0.2, 1);
    assert_int_equal(ep_state_set_motion(f.state, velocity, spin), EP_OK);
    for (int n = 0; n < 5; n++) assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    ep_state_get_history(f.state, one);
    assert_int_equal(ep_state_set_history(copy, count, one), EP_OK);
    for (int n = 0; n < 10; n++) {
      assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
      assert_int_equal(ep_step(copy, &def, NULL), EP_OK);
    }
    ep_state_get_history(f.state, one);
    ep_state_get_history(copy, two);
    assert_memory_equal(one, two, count * sizeof *one);
    assert_memory_equal(ep_state_frame(f.state), ep_state_frame(copy), sizeof(ep_frame));
    free(one);
    free(two);
    free(block);
  }
  drop_free_body(&f);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_history_goes_on_the_same),
      cmocka_unit_test(the_basis_is_free_of_rigid_modes),
      cmocka_unit_test(a_free_bar_rings_as_one),
      cmocka_unit_test(the_inertia_is_that_of_the_vertices),
      cmocka_unit_test(momenta_are_kept),
      cmocka_unit_test(a_stiff_body_tumbles_as_euler_says),
      cmocka_unit_test(fast_spin_is_stable),
      cmocka_unit_test(no_axis_is_special),
      cmocka_unit_test(a_spinning_bar_is_stretched),
      cmocka_unit_test(a_spinning_bar_swings),
      cmocka_unit_test(nearly_incompressible_bodies_fly_easily),
      cmocka_unit_test(steps_may_be_of_any_length),
      cmocka_unit_test(newmark_damps_what_it_goes_on_from),
      cmocka_unit_test(bdf2_begins_anew_after_others),
      cmocka_unit_test(gravity_and_pushes_give_their_impulse),
      cmocka_unit_test(a_failed_step_changes_nothing),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
