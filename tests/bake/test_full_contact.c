// Contact with obstacles, in the full space and against it (reduced/bake/full_contact.h). Claims:
//  - in a complete basis the reduced step with contact is the full-space step: the same potential,
//    found by the tree and by a plain loop, for every kind of obstacle, moving, with friction;
//  - what rests carries its weight: force = m g, and sinks in by less than 1 % of its diagonal;
//  - Coulomb: on a slope a block sticks below atan mu (but for the creep of 1e-3 diagonals/s), and
//    slides with a = g (sin - mu cos) above; a belt takes it along up to its speed;
//  - without load a bounce adds no energy (elastic + kinetic + penalty): implicit Euler in no step,
//    the others not over the bounce; what Newmark gains within it falls with dt^3 a step;
//  - nothing tunnels: a block at 20 lengths a second stays in front of a thin wall and a sphere;
//  - force and torque on the block are what its momenta change by.
#include "reduced/bake/full_step.h"

#include "whole_model.h"

#include "tests/petsc_session.h"

static const ep_elastic SOFT = {.density = 1000, .young = 2e5, .poisson = 0.35};
static const ep_elastic STIFF = {.density = 1000, .young = 1e7, .poisson = 0.3};
static const ep_frame STILL = {{0, 0, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
static const double G = 9.81;

// A plane through `point`, normal turned from z towards x by `angle`.
static ep_obstacle plane_at(double x, double z, double angle, double friction) {
  const double c = cos(angle), s = sin(angle);
  const ep_frame pose = {{x, 0, z}, {c, 0, s, 0, 1, 0, -s, 0, c}};
  return (ep_obstacle){.kind = EP_OBSTACLE_PLANE, .friction = friction, .start = pose, .end = pose};
}

// ---- a complete basis --------------------------------------------------------------------------

typedef struct complete {
  bar b;
  ep_csr mass, k0;
  ep_basis basis;
  ep_contact_tree tree;
  whole_model whole;
  ep_state *state; // of it
} complete;

static void make_complete(complete *c) {
  *c = (complete){0};
  make_bar(&c->b, (const int[3]){3, 1, 1}, (const double[3]){1, 0.4, 0.4}, EP_STVK_VOLUME, SOFT, 1);
  ASSERT_OK(ep_fem_mass(&c->b.fem, &c->mass, err));
  ASSERT_OK(ep_fem_rest_stiffness(&c->b.fem, &c->k0, err));
  make_complete_basis(&c->b, &c->mass, &c->k0, &c->basis);
  ASSERT_OK(ep_contact_tree_build(&c->b.mesh, c->basis.r, c->basis.u, &c->tree, err));
  make_whole_model((ep_model_parts){.fem = &c->b.fem, .basis = &c->basis, .contact = &c->tree},
                   &c->whole);
  c->state = c->whole.state;
}

static void free_complete(complete *c) {
  free_whole_model(&c->whole);
  ep_contact_tree_free(&c->tree);
  ep_basis_free(&c->basis);
  ep_csr_free(&c->mass);
  ep_csr_free(&c->k0);
  free_bar(&c->b);
}

// An obstacle that comes from above onto the free end and moves along it.
static ep_obstacle coming(int kind, double t0, double t1) {
  ep_obstacle o = {
      .kind = (ep_obstacle_kind)kind, .friction = 0.4, .size = {0.15, 0.1, 0.12}, .rounding = 0.02};
  const double above = kind == EP_OBSTACLE_SPHERE ? 0.15 : kind == EP_OBSTACLE_BOX ? 0.12 : 0;
  o.start = o.end = STILL;
  if (kind == EP_OBSTACLE_PLANE) o = plane_at(0, 0, 3.38, 0.4); // faces down, tilted
  ep_frame *at[2] = {&o.start, &o.end};
  const double t[2] = {t0, t1};
  for (int i = 0; i < 2; i++) {
    at[i]->c[0] = 0.97 - 0.1 * t[i], at[i]->c[1] = 0.02 + 0.1 * t[i];
    at[i]->c[2] = 0.45 + above - 0.6 * t[i] * (1 - t[i] / 0.6);
  }
  return o;
}

static void complete_basis_is_full_space(void **unused) {
  (void)unused;
  for (int kind = 0; kind < 3; kind++)
    for (int integrator = 0; integrator < EP_INTEGRATORS; integrator++) {
      complete c;
      ep_full *full;
      double worst = 0, moved = 0, most = 0, apart = 0;
      int touched = 0;
      make_complete(&c);
      ASSERT_OK(ep_full_create(&c.b.fem, NULL, NULL, &full, err));
      ep_step_def def = ep_default_step();
      def.integrator = (ep_integrator)integrator;
      def.dt = 0.02, def.damping_stiffness = 0.004, def.tolerance = 1e-9;
      def.contact.damping = 0.001;
      for (int i = 0; i < 25; i++) {
        ep_step_report report;
        ep_full_report full_report;
        const ep_obstacle o = coming(kind, i * def.dt, (i + 1) * def.dt);
        def.obstacle = &o, def.obstacles = 1;
        assert_int_equal(ep_step(c.state, &def, &report), EP_OK);
        ASSERT_OK(ep_full_step(full, &def, &full_report, err));
        touched += report.contact.touching;
        for (int a = 0; a < 3; a++) {
          most = fmax(most, fabs(report.contact.force[a]));
          apart = fmax(apart, fabs(report.contact.force[a] - full_report.contact.force[a]));
        }
        for (size_t k = 0; k < c.b.n3; k++) {
          const double x = nodal_of(&c.basis, ep_state_q(c.state), k);
          worst = fmax(worst, fabs(x - ep_full_displacement(full)[k]));
          moved = fmax(moved, fabs(x));
        }
      }
      assert_true(touched > 5 && moved > 0.01);
      ASSERT_LESS(apart / most, 1e-4);
      ASSERT_LESS(worst / moved, 1e-5); // both solved to 1e-9 of the forces in play
      ep_full_free(full);
      free_complete(&c);
    }
}

// ---- a free block ------------------------------------------------------------------------------

typedef struct block {
  bar b;
  ep_csr mass;
  ep_full *full;
  ep_step_def def;
  ep_obstacle obstacle;
  ep_full_report report;
  double *force, total;
} block;

static void make_block(block *k, ep_elastic elastic, ep_integrator integrator, double dt) {
  *k = (block){.total = 0};
  make_bar(&k->b, (const int[3]){3, 2, 2}, (const double[3]){0.6, 0.4, 0.4}, EP_STVK_VOLUME,
           elastic, 0);
  ASSERT_OK(ep_fem_mass(&k->b.fem, &k->mass, err));
  ASSERT_OK(ep_full_create(&k->b.fem, NULL, NULL, &k->full, err));
  k->force = vector_of(k->b.n3);
  k->def = ep_default_step();
  k->def.integrator = integrator;
  k->def.dt = dt;
  k->def.obstacle = &k->obstacle;
  k->def.obstacles = 1;
  k->def.tolerance = 1e-9;
  k->total = 1000 * 0.6 * 0.4 * 0.4;
}

static void free_block(block *k) {
  ep_full_free(k->full);
  ep_csr_free(&k->mass);
  free(k->force);
  free_bar(&k->b);
}

// sum m x along an axis over the mass
static double mean(const block *k, const double *x, int axis) {
  double *unit = vector_of(k->b.n3);
  for (size_t i = (size_t)axis; i < k->b.n3; i += 3) unit[i] = 1;
  const double sum = product_of(&k->mass, unit, x);
  free(unit);
  return sum / k->total;
}

static void set_gravity(block *k, double gx, double gz) {
  double *a = vector_of(k->b.n3);
  for (size_t i = 0; i < k->b.n3; i++) a[i] = i % 3 == 0 ? gx : i % 3 == 2 ? gz : 0;
  ep_csr_multiply(&k->mass, 1, a, k->force);
  k->def.force = k->force;
  free(a);
}

static void set_velocity(block *k, double x, double y, double z) {
  const double v[3] = {x, y, z};
  for (size_t i = 0; i < k->b.n3; i++) ep_full_velocity(k->full)[i] = v[i % 3];
}

static void advance(block *k) {
  ASSERT_OK(ep_full_step(k->full, &k->def, &k->report, err));
}

static void rest_carries_the_weight(void **unused) {
  (void)unused;
  const ep_elastic soft = {.density = 1000, .young = 3e4, .poisson = 0.4};
  for (int i = 0; i < 2; i++) {
    block k;
    make_block(&k, i ? STIFF : soft, EP_IMPLICIT_EULER, 1.0 / 60);
    k.obstacle = plane_at(0, -0.3, 0, 0.3);
    k.def.damping_stiffness = 0.01;
    set_gravity(&k, 0, -G);
    double deepest = 0;
    for (int n = 0; n < 240; n++) {
      advance(&k);
      deepest = fmax(deepest, k.report.contact.deepest);
    }
    const double weight = k.total * G;
    ASSERT_LESS(fabs(k.report.contact.force[2] - weight), 1e-3 * weight);
    ASSERT_LESS(fabs(k.report.contact.force[0]), 1e-3 * weight);
    // It came down at 2.4 m/s and then rests: below 1 % always.
    ASSERT_LESS(deepest, 0.01 * ep_mesh_diagonal(&k.b.mesh));
    assert_true(k.report.contact.touching > 0);
    free_block(&k);
  }
}

// Slope: the world is turned, so the plane is z = 0 and gravity leans.
static double slide(double degrees, double mu, double seconds, double *speed) {
  const double angle = degrees * acos(-1) / 180, dt = 1.0 / 120;
  block k;
  make_block(&k, STIFF, EP_IMPLICIT_EULER, dt);
  k.obstacle = plane_at(0, -0.001, 0, mu);
  set_gravity(&k, G * sin(angle), -G * cos(angle));
  const int settle = 60, steps = (int)lround(seconds / dt);
  for (int n = 0; n < settle; n++) advance(&k);
  const double before = mean(&k, ep_full_velocity(k.full), 0);
  for (int n = 0; n < steps; n++) advance(&k);
  *speed = mean(&k, ep_full_velocity(k.full), 0);
  free_block(&k);
  return (*speed - before) / seconds;
}

static void coulomb_on_a_slope(void **unused) {
  (void)unused;
  const double mu = 0.4; // atan 0.4 = 21.8 degrees
  double speed;
  const double degrees[4] = {10, 20, 24, 35};
  for (int i = 0; i < 4; i++) {
    const double angle = degrees[i] * acos(-1) / 180;
    const double a = slide(degrees[i], mu, 0.5, &speed);
    if (degrees[i] < 21.8)
      ASSERT_LESS(fabs(speed), 1e-3 * 0.825); // the creep: 1e-3 diagonals a second
    else
      ASSERT_LESS(fabs(a / (G * (sin(angle) - mu * cos(angle))) - 1), 0.02);
  }
}

// A plane that moves under the block takes it along and no further.
static void belt_takes_it_along(void **unused) {
  (void)unused;
  const double dt = 1.0 / 120, belt = 1.0;
  block k;
  make_block(&k, STIFF, EP_IMPLICIT_EULER, dt);
  k.obstacle = plane_at(0, -0.001, 0, 0.5);
  set_gravity(&k, 0, -G);
  double most = 0;
  for (int n = 0; n < 120; n++) {
    k.obstacle.start = k.obstacle.end;
    k.obstacle.end.c[0] += belt * dt;
    advance(&k);
    most = fmax(most, mean(&k, ep_full_velocity(k.full), 0));
  }
  ASSERT_LESS(fabs(mean(&k, ep_full_velocity(k.full), 0) - belt), 0.01 * belt);
  ASSERT_LESS(most, 1.02 * belt);
  free_block(&k);
}

// What a bounce does to the energy, in units of the energy it came with.
typedef struct bounce {
  double most, left, grown; // largest, last, largest gain in one step
  int touched;
} bounce;

// Thrown at an inclined plane `below` it without gravity, for some time.
static bounce bounce_off(block *k, double below, double friction, double time) {
  k->obstacle = plane_at(0, -below, 0.3, friction);
  set_velocity(k, 0.5, 0.2, -4);
  const double unit = 0.5 * k->total * (0.25 + 0.04 + 16);
  bounce out = {.most = 1, .left = 1};
  for (int n = 0; n * k->def.dt < time; n++) {
    advance(k);
    const ep_full_report *r = &k->report;
    const double now = (r->elastic_energy + r->kinetic_energy + r->contact.energy) / unit;
    out.grown = fmax(out.grown, now - out.left);
    out.most = fmax(out.most, now);
    out.left = now;
    out.touched += r->contact.touching > 0;
  }
  return out;
}

// An impact of a vertex lasts 1 to 3 ms: at 1 ms it is not resolved. Newmark keeps the energy of
// what it resolves. BDF2 gives contact its whole impulse at once and goes on without it
// (ep_contact_share): it gains in no step.
static void bounce_adds_no_energy(void **unused) {
  (void)unused;
  for (int integrator = 0; integrator < EP_INTEGRATORS; integrator++)
    for (int i = 0; i < 2; i++) {
      block k;
      const double dt = integrator == EP_IMPLICIT_EULER ? 1.0 / 60 : 1e-3;
      make_block(&k, i ? STIFF : SOFT, (ep_integrator)integrator, dt);
      const bounce b = bounce_off(&k, 0.2, i ? 0.3 : 0, 0.5);
      print_message("%-15s %s: energy left %.3f, grown in a step %.1e\n",
                    ep_integrator_name((ep_integrator)integrator), i ? "stiff" : "soft ", b.left,
                    b.grown);
      assert_true(b.touched > 0);
      assert_int_equal(k.report.contact.touching, 0); // it came off again
      assert_true(cos(0.3) * mean(&k, ep_full_velocity(k.full), 2) +
                      sin(0.3) * mean(&k, ep_full_velocity(k.full), 0) >
                  0);
      const double bound[EP_INTEGRATORS] = {1e-9, 1e-3, 1e-9};
      ASSERT_LESS(b.grown, bound[integrator]);
      ASSERT_LESS(b.most, 1 + 1e-9); // the solver's tolerance
      ASSERT_LESS(b.left, 1.0);
      free_block(&k);
    }
}

// Once the impact is resolved a step gains of the third order (errors of the second a unit of
// time). The slack: the largest of some hundred steps is met at other moments in the two runs.
static void gain_falls_with_the_step(void **unused) {
  (void)unused;
  static const double dt[EP_INTEGRATORS] = {0, 1.0 / 4000, 1.0 / 32000};
  for (int integrator = EP_NEWMARK; integrator < EP_INTEGRATORS; integrator++) {
    double grown[2];
    for (int fine = 0; fine < 2; fine++) {
      block k;
      make_block(&k, SOFT, (ep_integrator)integrator, dt[integrator] / (1 + fine));
      const bounce b = bounce_off(&k, 0.004, 0, 0.01);
      assert_true(b.touched > 5);
      ASSERT_LESS(b.most, 1 + 1e-9);
      grown[fine] = b.grown;
      free_block(&k);
    }
    const double order = order_of(grown[0], grown[1]);
    print_message("%-15s: grown in a step %.1e, %.1e (order %.2f)\n",
                  ep_integrator_name((ep_integrator)integrator), grown[0], grown[1], order);
    ASSERT_LESS(fabs(order - 3), 0.7);
    ASSERT_LESS(grown[1], 1e-5);
  }
}

// 20 block lengths a second at dt 1/60: a fifth of a metre a step, four times the wall's thickness.
static void nothing_tunnels(void **unused) {
  (void)unused;
  for (int kind = 1; kind < 3; kind++) {
    block k;
    make_block(&k, SOFT, EP_IMPLICIT_EULER, 1.0 / 60);
    k.obstacle = (ep_obstacle){.kind = (ep_obstacle_kind)kind,
                               .size = {0.3, 1, 1},
                               .rounding = 0.008,
                               .start = STILL,
                               .end = STILL};
    k.obstacle.start.c[0] = kind == EP_OBSTACLE_BOX ? 1.1 : 1.4;
    k.obstacle.start.c[1] = k.obstacle.start.c[2] = 0.2;
    if (kind == EP_OBSTACLE_BOX) k.obstacle.size[0] = 0.025;
    k.obstacle.end = k.obstacle.start;
    set_velocity(&k, 12, 0, 0);
    double deepest = 0, front = 0;
    for (int n = 0; n < 60; n++) {
      advance(&k);
      deepest = fmax(deepest, k.report.contact.deepest);
      for (size_t i = 0; i < k.b.n3; i += 3)
        front = fmax(front, k.b.mesh.x[i] + ep_full_displacement(k.full)[i]);
    }
    print_message("kind %d: front %.4f, deepest %.4f of the diagonal\n", kind, front,
                  deepest / ep_mesh_diagonal(&k.b.mesh));
    assert_true(mean(&k, ep_full_velocity(k.full), 0) < 0); // thrown back
    if (kind == EP_OBSTACLE_BOX) ASSERT_LESS(front, 1.1);
    ASSERT_LESS(deepest, 0.01 * ep_mesh_diagonal(&k.b.mesh));
    free_block(&k);
  }
}

// Momentum: with implicit Euler m (v' - v) = dt F to the tolerance of the solver.
static void force_is_what_momentum_changes_by(void **unused) {
  (void)unused;
  block k;
  make_block(&k, SOFT, EP_IMPLICIT_EULER, 1.0 / 60);
  k.obstacle = plane_at(0, -0.1, 0.3, 0.5);
  set_velocity(&k, 0.5, 0.2, -4);
  double before[3] = {0.5, 0.2, -4}, most = 0;
  for (int n = 0; n < 30; n++) {
    advance(&k);
    for (int i = 0; i < 3; i++) {
      const double now = mean(&k, ep_full_velocity(k.full), i);
      const double change = k.total * (now - before[i]),
                   impulse = k.def.dt * k.report.contact.force[i];
      ASSERT_LESS(fabs(change - impulse), 1e-6 * k.total * 4);
      most = fmax(most, fabs(impulse));
      before[i] = now;
    }
  }
  assert_true(most > 0.5 * k.total);
  free_block(&k);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(complete_basis_is_full_space),
      cmocka_unit_test(rest_carries_the_weight),
      cmocka_unit_test(coulomb_on_a_slope),
      cmocka_unit_test(belt_takes_it_along),
      cmocka_unit_test(bounce_adds_no_energy),
      cmocka_unit_test(gain_falls_with_the_step),
      cmocka_unit_test(nothing_tunnels),
      cmocka_unit_test(force_is_what_momentum_changes_by),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
