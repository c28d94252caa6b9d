// The full-space reference, reduced/bake/full_step.h. Claims:
//  - in a complete basis (r = free unknowns) with all elements the reduced step is the full-space
//    step, for every material, integrator and example force: the same equations, so equal to the
//    tolerance of the two Newtons; also with the Green-strain path, alone and beside the
//    interpolation, in its mixed form and with weak constraints;
//  - errors fall with dt as order 1 (implicit Euler), 2 (Newmark), 2 (BDF2), full and reduced;
//  - implicit Euler never adds energy: E(n+1) <= E(n) without load;
//  - a body that nothing holds keeps its linear momentum, sum m v;
//  - gravity by the model alone is the force of the vertices' lumped masses, to round-off, and sags
//    as in the full space; it adds to def.force;
//  - a failed step leaves the motion as it was.
#include "reduced/bake/full_step.h"

#include "whole_model.h"

#include "tests/petsc_session.h"

static const ep_elastic SOFT = {.density = 1000, .young = 2e5, .poisson = 0.35};
static const int CELLS[3] = {2, 1, 1};
static const double SIZE[3] = {1, 0.5, 0.4};

// ---- a complete basis --------------------------------------------------------------------------

enum { FUNCTIONS = 4, EXAMPLES = 2 };

typedef struct complete {
  bar b;
  ep_csr mass, lb_mass, k0;
  ep_basis basis;
  double *phi, *pose; // (FUNCTIONS x n), (EXAMPLES x 3n)
  ep_green_full green;
  whole_model whole;
  ep_state *state; // of it
} complete;

static void make_examples(complete *c) {
  const size_t n3 = c->b.n3, r = (size_t)c->basis.r;
  c->basis.examples = EXAMPLES;
  c->basis.example_q = vector_of(EXAMPLES * r);
  c->basis.example_residual = vector_of(EXAMPLES);
  c->pose = vector_of(EXAMPLES * n3);
  for (size_t i = 0; i < EXAMPLES; i++) {
    smooth_random(&c->b, 100 + i, 0.08, c->pose + i * n3);
    for (size_t a = 0; a < r; a++)
      c->basis.example_q[i * r + a] = product_of(&c->mass, c->basis.u + a * n3, c->pose + i * n3);
  }
  c->phi = vector_of(FUNCTIONS * (size_t)c->b.mesh.nv);
  for (int f = 0; f < FUNCTIONS; f++)
    for (int v = 0; v < c->b.mesh.nv; v++)
      c->phi[f * c->b.mesh.nv + v] = cos((f + 1) * (c->b.mesh.x[3 * v] + 0.3 * f));
}

// paths: EP bits of the examples' paths, LB = 1, GREEN = 2; 0: no examples.
enum { LB = 1, GREEN = 2 };
static void make_complete(complete *c, ep_material law, int paths) {
  *c = (complete){0};
  ep_green_coefficients green = {0};
  make_bar(&c->b, CELLS, SIZE, law, SOFT, 1);
  ASSERT_OK(ep_fem_mass(&c->b.fem, &c->mass, err));
  ASSERT_OK(ep_fem_scalar_mass(&c->b.fem, &c->lb_mass, err));
  ASSERT_OK(ep_fem_rest_stiffness(&c->b.fem, &c->k0, err));
  make_complete_basis(&c->b, &c->mass, &c->k0, &c->basis);
  if (paths) make_examples(c);
  if (paths & GREEN) {
    ASSERT_OK(ep_green_coefficients_compute(&c->b.fem, &c->basis, NULL, c->b.fem.volume, NULL, NULL,
                                            &green, err));
    ASSERT_OK(ep_green_full_create(&c->b.fem, c->b.fem.volume, EXAMPLES, c->pose, NULL, NULL,
                                   &c->green, err));
  }
  const ep_lb lb = {.n = c->b.mesh.nv, .m = FUNCTIONS, .volume = 0.2, .phi = c->phi};
  make_whole_model((ep_model_parts){.fem = &c->b.fem,
                                    .basis = &c->basis,
                                    .m = paths & LB ? FUNCTIONS : 0,
                                    .green = paths & GREEN ? &green : NULL,
                                    .lb = &lb,
                                    .lb_mass = &c->lb_mass},
                   &c->whole);
  c->state = c->whole.state;
  ep_green_coefficients_free(&green);
}

static void free_complete(complete *c) {
  free_whole_model(&c->whole);
  ep_green_full_free(&c->green);
  ep_basis_free(&c->basis);
  ep_csr_free(&c->mass);
  ep_csr_free(&c->lb_mass);
  ep_csr_free(&c->k0);
  free(c->phi);
  free(c->pose);
  free_bar(&c->b);
}

static void reduce(const complete *c, const double *x, double *q) {
  for (int a = 0; a < c->basis.r; a++) {
    q[a] = 0;
    for (size_t i = 0; i < c->b.n3; i++) q[a] += c->basis.u[(size_t)a * c->b.n3 + i] * x[i];
  }
}

// A nodal force that turns about the bar's axis, on the free end.
static void load_at(const bar *b, double t, double *f) {
  memset(f, 0, b->n3 * sizeof *f);
  for (int v = 0; v < b->mesh.nv; v++) {
    const double *x = b->mesh.x + 3 * v;
    if (x[0] < 0.9) continue;
    f[3 * v + 1] = 300 * sin(6 * t) * sin(6 * t);
    f[3 * v + 2] = -200 * (1 - cos(9 * t)) * (x[1] - 0.1);
  }
}

static ep_step_def exact_step(ep_integrator integrator, double dt) {
  ep_step_def def = ep_default_step();
  def.integrator = integrator;
  def.dt = dt;
  def.damping_mass = 0.3;
  def.damping_stiffness = 0.004;
  def.tolerance = 1e-12;
  def.target_tolerance = 1e-12;
  return def;
}

// Both runs side by side; the largest difference over the largest displacement.
static double difference_of_runs(complete *c, complete *guide, const ep_step_def *given, int steps,
                                 double *moved) {
  const size_t n3 = c->b.n3, r = (size_t)c->basis.r;
  double *f = vector_of(n3), *fr = vector_of(r), worst = 0;
  ep_full *full;
  ASSERT_OK(ep_full_create(&c->b.fem, guide ? guide->state : NULL,
                           c->green.stress ? &c->green : NULL, &full, err));
  ep_step_def def = *given;
  *moved = 0;
  for (int i = 0; i < steps; i++) {
    ep_step_report report;
    ep_full_report full_report;
    // steps of two sizes: BDF2 with variable steps
    def.dt = given->dt * (i % 5 == 3 ? 0.5 : 1);
    load_at(&c->b, (i + 1) * def.dt, f);
    reduce(c, f, fr);
    def.force = fr;
    assert_int_equal(ep_step(c->state, &def, &report), EP_OK);
    def.force = f;
    ASSERT_OK(ep_full_step(full, &def, &full_report, err));
    double square = 0, size = 0;
    for (size_t k = 0; k < n3; k++) {
      const double x = nodal_of(&c->basis, ep_state_q(c->state), k);
      square = fmax(square, fabs(x - ep_full_displacement(full)[k]));
      size = fmax(size, fabs(x));
    }
    worst = fmax(worst, square);
    *moved = fmax(*moved, size);
    ASSERT_LESS(fabs(report.elastic_energy - full_report.elastic_energy),
                1e-7 * (1 + full_report.elastic_energy));
    ASSERT_LESS(fabs(report.kinetic_energy - full_report.kinetic_energy),
                1e-7 * (1 + full_report.kinetic_energy));
    ASSERT_LESS(fabs(report.example_energy - full_report.example_energy),
                1e-7 * (1 + full_report.example_energy));
    ASSERT_LESS(fabs(report.green_energy - full_report.green_energy),
                1e-7 * (1 + fabs(full_report.green_energy)));
  }
  ep_full_free(full);
  free(f), free(fr);
  return worst;
}

// Tolerance: relative residuals of 1e-12 over a stiffness of condition 1e4, over 30 steps.
static void complete_basis_is_full_space(void **state) {
  (void)state;
  for (int law = 0; law < EP_MATERIALS; law++)
    for (int integrator = 0; integrator < EP_INTEGRATORS; integrator++) {
      complete c;
      double moved;
      make_complete(&c, (ep_material)law, 0);
      const ep_step_def def = exact_step((ep_integrator)integrator, 0.01);
      ASSERT_LESS(difference_of_runs(&c, NULL, &def, 30, &moved), 1e-9);
      ASSERT_LESS(0.05, moved); // a tenth of the bar's height: not trivially equal
      free_complete(&c);
    }
}

// Two states of one model: one guided by the step, one by the full-space run.
static void complete_basis_with_examples(void **state) {
  (void)state;
  for (int force = 0; force < 2; force++) {
    complete c, guide;
    double moved;
    make_complete(&c, EP_STABLE_NEOHOOKEAN, LB);
    make_complete(&guide, EP_STABLE_NEOHOOKEAN, LB);
    ep_step_def def = exact_step(EP_BDF2, 0.01);
    def.example_force = (ep_example_force)force;
    def.strength = 0.7, def.relief = 0.3;
    ASSERT_LESS(difference_of_runs(&c, &guide, &def, 25, &moved), 1e-8);
    ASSERT_LESS(0.02, moved);
    ASSERT_LESS(1e-3, ep_state_weights(c.state)[0] + ep_state_weights(c.state)[1]);
    free_complete(&c);
    free_complete(&guide);
  }
}

// StVK, StVK with volume penalty, and the mixed form; without and with weak constraints.
static void complete_basis_with_strains(void **state) {
  (void)state;
  static const ep_material laws[] = {EP_STVK, EP_STVK_VOLUME, EP_STABLE_NEOHOOKEAN};
  static const ep_green greens[] = {{0.9, 0, 0}, {0.8, 0.5, 4}};
  for (int i = 0; i < 6; i++) {
    complete c;
    double moved;
    make_complete(&c, laws[i / 2], GREEN);
    ep_step_def def = exact_step((ep_integrator)(i % EP_INTEGRATORS), 0.01);
    def.green = greens[i % 2];
    ASSERT_LESS(difference_of_runs(&c, NULL, &def, 25, &moved), 1e-8);
    ASSERT_LESS(0.02, moved);
    ASSERT_LESS(1e-3, fabs(ep_state_green_weights(c.state)[0]));
    free_complete(&c);
  }
}

static void complete_basis_with_both_paths(void **state) {
  (void)state;
  for (int law = 0; law < 2; law++) {
    complete c, guide;
    double moved;
    make_complete(&c, law ? EP_STABLE_NEOHOOKEAN : EP_STVK, LB | GREEN);
    make_complete(&guide, law ? EP_STABLE_NEOHOOKEAN : EP_STVK, LB);
    ep_step_def def = exact_step(EP_IMPLICIT_EULER, 0.01);
    def.strength = 0.7, def.relief = 0.3, def.green = (ep_green){0.9, 0.2, 2};
    ASSERT_LESS(difference_of_runs(&c, &guide, &def, 25, &moved), 1e-8);
    ASSERT_LESS(0.02, moved);
    free_complete(&c);
    free_complete(&guide);
  }
}

// ---- order -------------------------------------------------------------------------------------

// Displacement at t = 0.4 s with steps of dt.
static void run_to_end(const bar *b, ep_integrator integrator, double dt, double *u) {
  ep_full *full;
  double *f = vector_of(b->n3);
  ep_step_def def = exact_step(integrator, dt);
  def.tolerance = 1e-8; // round-off of the first steps' small forces; far below the errors in dt
  def.force = f;
  ASSERT_OK(ep_full_create(&b->fem, NULL, NULL, &full, err));
  for (int i = 0; i < (int)lround(0.4 / dt); i++) {
    load_at(b, (i + 1) * dt, f);
    ASSERT_OK(ep_full_step(full, &def, NULL, err));
  }
  memcpy(u, ep_full_displacement(full), b->n3 * sizeof *u);
  ep_full_free(full);
  free(f);
}

static void reduced_to_end(complete *c, ep_integrator integrator, double dt, double *q) {
  const size_t r = (size_t)c->basis.r;
  double *f = vector_of(c->b.n3), *fr = vector_of(r);
  ep_step_def def = exact_step(integrator, dt);
  def.tolerance = 1e-8; // round-off of the first steps' small forces; far below the errors in dt
  def.force = fr;
  memset(ep_state_q(c->state), 0, r * sizeof *q);
  memset(ep_state_velocity(c->state), 0, r * sizeof *q);
  for (int i = 0; i < (int)lround(0.4 / dt); i++) {
    load_at(&c->b, (i + 1) * dt, f);
    reduce(c, f, fr);
    assert_int_equal(ep_step(c->state, &def, NULL), EP_OK);
  }
  memcpy(q, ep_state_q(c->state), r * sizeof *q);
  free(f), free(fr);
}

static const double ORDER[EP_INTEGRATORS] = {1, 2, 2};

// The order from three steps, |u_h - u_h/2| / |u_h/2 - u_h/4|; 0.25 of slack: h is finite.
static void full_orders_in_time(void **state) {
  (void)state;
  bar b;
  make_bar(&b, CELLS, SIZE, EP_STABLE_NEOHOOKEAN, SOFT, 1);
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    double *u[3];
    for (int i = 0; i < 3; i++)
      run_to_end(&b, (ep_integrator)kind, 0.004 / (1 << i), u[i] = vector_of(b.n3));
    const double order = order_of(distance_of(b.n3, u[0], u[1]), distance_of(b.n3, u[1], u[2]));
    ASSERT_LESS(fabs(order - ORDER[kind]), 0.25);
    for (int i = 0; i < 3; i++) free(u[i]);
  }
  free_bar(&b);
}

static void reduced_orders_in_time(void **state) {
  (void)state;
  complete c;
  make_complete(&c, EP_STABLE_NEOHOOKEAN, 0);
  const size_t r = (size_t)c.basis.r;
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    double *q[3];
    for (int i = 0; i < 3; i++)
      reduced_to_end(&c, (ep_integrator)kind, 0.004 / (1 << i), q[i] = vector_of(r));
    const double order = order_of(distance_of(r, q[0], q[1]), distance_of(r, q[1], q[2]));
    ASSERT_LESS(fabs(order - ORDER[kind]), 0.25);
    for (int i = 0; i < 3; i++) free(q[i]);
  }
  free_complete(&c);
}

// ---- energy, momentum, failure -----------------------------------------------------------------

// From a deformed start at rest; also where elements start crushed, so that the projection of the
// tangents is used. Round-off of the energy: 1e-10.
static void euler_never_adds_energy(void **state) {
  (void)state;
  for (int law = 0; law < EP_MATERIALS; law++) {
    bar b;
    ep_full *full;
    make_bar(&b, CELLS, SIZE, (ep_material)law, SOFT, 1);
    ASSERT_OK(ep_full_create(&b.fem, NULL, NULL, &full, err));
    double *u = ep_full_displacement(full);
    for (int v = 0; v < b.mesh.nv; v++) { // squeezed to .45 of its length and sheared
      u[3 * v] = -0.55 * b.mesh.x[3 * v];
      u[3 * v + 1] = 0.3 * b.mesh.x[3 * v];
    }
    ep_step_def def = ep_default_step();
    double energy = ep_fem_energy(&b.fem, u), first = energy;
    int projections = 0;
    for (int i = 0; i < 60; i++) {
      ep_full_report report;
      ASSERT_OK(ep_full_step(full, &def, &report, err));
      const double now = report.elastic_energy + report.kinetic_energy;
      ASSERT_LESS(now, energy + 1e-10 * first);
      energy = now;
      projections += report.projections;
    }
    ASSERT_LESS(energy, 0.5 * first);
    if (law == EP_STVK) ASSERT_LESS(0, projections); // softens under pressure: indefinite
    ep_full_free(full);
    free_bar(&b);
  }
}

static void momentum(const bar *b, const ep_csr *mass, const double *v, double p[3]) {
  double *mv = vector_of(b->n3);
  ep_csr_multiply(mass, 1, v, mv);
  memset(p, 0, 3 * sizeof *p);
  for (size_t i = 0; i < b->n3; i++) p[i % 3] += mv[i];
  free(mv);
}

// Tolerance: the residual of a step, 1e-12, times its forces, 1e5 N at most here, times 0.3 s.
static void free_body_keeps_momentum(void **state) {
  (void)state;
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    bar b;
    ep_full *full;
    ep_csr mass = {0};
    double before[3], after[3];
    make_bar(&b, CELLS, SIZE, EP_COROTATIONAL, SOFT, 0);
    ASSERT_OK(ep_fem_mass(&b.fem, &mass, err));
    ASSERT_OK(ep_full_create(&b.fem, NULL, NULL, &full, err));
    smooth_random(&b, 5, 0.8, ep_full_velocity(full));
    momentum(&b, &mass, ep_full_velocity(full), before);
    ep_step_def def = exact_step((ep_integrator)kind, 0.01);
    def.damping_mass = 0; // drag takes momentum
    for (int i = 0; i < 30; i++) ASSERT_OK(ep_full_step(full, &def, NULL, err));
    momentum(&b, &mass, ep_full_velocity(full), after);
    ASSERT_LESS(distance_of(3, before, after), 1e-6);
    ASSERT_LESS(1, norm_of(3, before));
    ep_full_free(full);
    ep_csr_free(&mass);
    free_bar(&b);
  }
}

// Weight of the lumped masses, as the loads of a scene have it.
static void weight_of(const bar *b, const double g[3], double *f) {
  for (int e = 0; e < b->mesh.nt; e++)
    for (int i = 0; i < 12; i++)
      f[3 * b->mesh.tet[4 * e + i / 3] + i % 3] +=
          0.25 * b->fem.volume[e] * SOFT.density * g[i % 3];
}

// Steps until it hangs still; damping by mass and long steps. The reduced object under gravity and
// another force, the reference with both in its force.
static void gravity_of_a_held_object(void **state) {
  (void)state;
  static const double g[3] = {2, -9.81, 1};
  complete c;
  ep_full *full;
  make_complete(&c, EP_STABLE_NEOHOOKEAN, 0);
  const size_t n3 = c.b.n3, r = (size_t)c.basis.r;
  const double *modes = c.whole.memory.model.gravity_modes;
  double *f = vector_of(n3), *fr = vector_of(r), *other = vector_of(n3), *other_r = vector_of(r);
  weight_of(&c.b, g, f);
  reduce(&c, f, fr);
  for (size_t a = 0; a < r; a++) {
    const double by_model = g[0] * modes[a] + g[1] * modes[r + a] + g[2] * modes[2 * r + a];
    ASSERT_LESS(fabs(by_model - fr[a]), 1e-13 * norm_of(r, fr));
  }
  load_at(&c.b, 0.2, other);
  reduce(&c, other, other_r);
  for (size_t i = 0; i < n3; i++) f[i] += other[i];
  ASSERT_OK(ep_full_create(&c.b.fem, NULL, NULL, &full, err));
  ep_step_def def = exact_step(EP_IMPLICIT_EULER, 1), whole = def;
  def.force = other_r, whole.force = f;
  memcpy(def.gravity, g, sizeof def.gravity);
  for (int i = 0; i < 30; i++) {
    assert_int_equal(ep_step(c.state, &def, NULL), EP_OK);
    ASSERT_OK(ep_full_step(full, &whole, NULL, err));
  }
  double *sag = ep_full_displacement(full), apart = 0;
  for (size_t i = 0; i < n3; i++)
    apart = fmax(apart, fabs(nodal_of(&c.basis, ep_state_q(c.state), i) - sag[i]));
  ASSERT_LESS(0.01, norm_of(n3, sag)); // it does hang: a per cent of its length
  ASSERT_LESS(norm_of(n3, ep_full_velocity(full)), 1e-6);
  ASSERT_LESS(apart, 1e-9 * norm_of(n3, sag)); // two Newtons to 1e-12
  def.gravity[1] = NAN;
  assert_int_equal(ep_step(c.state, &def, NULL), EP_ERR_ARGUMENT);
  ep_full_free(full);
  free(f), free(fr), free(other), free(other_r);
  free_complete(&c);
}

static void failure_changes_nothing(void **state) {
  (void)state;
  bar b;
  ep_full *full;
  make_bar(&b, CELLS, SIZE, EP_STABLE_NEOHOOKEAN, SOFT, 1);
  double *f = vector_of(b.n3), *u = vector_of(b.n3), *v = vector_of(b.n3);
  ASSERT_OK(ep_full_create(&b.fem, NULL, NULL, &full, err));
  ep_step_def def = exact_step(EP_NEWMARK, 0.01);
  def.force = f;
  load_at(&b, 0.2, f);
  for (int i = 0; i < 3; i++) ASSERT_OK(ep_full_step(full, &def, NULL, err));
  memcpy(u, ep_full_displacement(full), b.n3 * sizeof *u);
  memcpy(v, ep_full_velocity(full), b.n3 * sizeof *v);
  def.max_iterations = 1;
  for (size_t i = 0; i < b.n3; i++) f[i] *= 50;
  ep_error err = {0};
  assert_int_equal(ep_full_step(full, &def, NULL, &err), EP_ERR_NUMERIC);
  assert_non_null(strstr(err.text, "smaller time step"));
  assert_memory_equal(u, ep_full_displacement(full), b.n3 * sizeof *u);
  assert_memory_equal(v, ep_full_velocity(full), b.n3 * sizeof *v);
  def.dt = -1;
  ep_error wrong = {0};
  assert_int_equal(ep_full_step(full, &def, NULL, &wrong), EP_ERR_ARGUMENT);
  assert_true(ep_full_bytes(full) > b.n3 * sizeof *u);
  ep_full_free(full);
  free(f), free(u), free(v);
  free_bar(&b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(complete_basis_is_full_space),
      cmocka_unit_test(complete_basis_with_examples),
      cmocka_unit_test(complete_basis_with_strains),
      cmocka_unit_test(complete_basis_with_both_paths),
      cmocka_unit_test(full_orders_in_time),
      cmocka_unit_test(reduced_orders_in_time),
      cmocka_unit_test(euler_never_adds_energy),
      cmocka_unit_test(free_body_keeps_momentum),
      cmocka_unit_test(gravity_of_a_held_object),
      cmocka_unit_test(failure_changes_nothing),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
