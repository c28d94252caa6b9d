// Free motion against the full space (reduced/bake/full_step.h). Claims:
// (Without Rayleigh damping by stiffness: that of the full space is of the rest shape's axes, and
// drags at any rotation; the moving frame's turns with the body.)
//  - in a complete basis (r = 3n - 6) both solve the same equations, although one has a moving
//    frame and the other has not: a soft spinning body's difference falls with dt^2 (Newmark);
//  - over a bounce with spin and friction the centre of mass of a stiff body follows that of the
//    full space within 1 % of its way, its rotation within 1 % of the angle turned; for a soft one
//    the error is that of the subspace: printed, and falling with r;
//  - a soft body thrown hard at a floor lands without smaller steps;
//  - impacts far shorter than a step add no energy, wherever in the step they come, and change the
//    momentum by dt times the force of every step, with every integrator;
//  - at rest on a floor it stays at rest when another integrator goes on;
//  - a push on an object that hits a floor gives its impulse where the object then stands;
//  - something outside changes the momenta by its impulse, exactly; what does not act changes
//    nothing, to the last bit; with a spring to the world errors fall as the integrator's order.
#include "reduced/bake/full_step.h"

#include "free_body.h"

#include "linalg/dense.h"
#include "reduced/bake/contact_tree.h"
#include "tests/petsc_session.h"

static const ep_elastic SOFT = {.density = 1000, .young = 1e5, .poisson = 0.3};
static const ep_elastic STIFF = {.density = 1000, .young = 1e10, .poisson = 0.3};

static void reset(free_body *f, const double velocity[3], const double spin[3]) {
  assert_int_equal(ep_state_init(f->model, f->whole.block, ep_state_bytes(f->model), &f->state),
                   EP_OK);
  assert_int_equal(ep_state_set_motion(f->state, velocity, spin), EP_OK);
}

// The full-space twin of the state: displacement and velocity of every vertex.
static ep_full *twin_of(const free_body *f) {
  ep_full *full;
  double *x = vector_of(f->b.n3);
  ASSERT_OK(ep_full_create(&f->b.fem, NULL, NULL, &full, err));
  motion_of(f, x, ep_full_velocity(full));
  for (size_t i = 0; i < f->b.n3; i++) ep_full_displacement(full)[i] = x[i] - f->b.mesh.x[i];
  free(x);
  return full;
}

// ---- the same equations ------------------------------------------------------------------------

// Largest distance of a vertex after `time`, over the object's length.
static double apart(free_body *f, double dt, double time) {
  const double velocity[3] = {0.2, 0, 0.1}, spin[3] = {3, 6, -4};
  reset(f, velocity, spin);
  ep_state_velocity(f->state)[0] = 0.5;
  ep_state_velocity(f->state)[3] = 0.5;
  assert_int_equal(ep_state_set_motion(f->state, velocity, spin), EP_OK);
  ep_full *full = twin_of(f);
  ep_step_def def = ep_default_step();
  def.integrator = EP_NEWMARK;
  def.dt = dt;
  def.tolerance = 1e-10;
  double *x = vector_of(f->b.n3), worst = 0;
  for (int n = 0; n < (int)lround(time / dt); n++) {
    assert_int_equal(ep_step(f->state, &def, NULL), EP_OK);
    ASSERT_OK(ep_full_step(full, &def, NULL, err));
  }
  ep_state_positions(f->state, x);
  for (size_t i = 0; i < f->b.n3; i++)
    worst = fmax(worst, fabs(x[i] - f->b.mesh.x[i] - ep_full_displacement(full)[i]));
  free(x);
  ep_full_free(full);
  return worst;
}

static void a_complete_basis_moves_as_the_full_space(void **state) {
  (void)state;
  const int cells[3] = {2, 1, 1};
  const double size[3] = {1, 0.4, 0.3};
  free_body f;
  make_free_body(&f, cells, size, EP_STVK, SOFT, 20, 30, 0);
  assert_int_equal(f.model->size.r, 3 * f.b.mesh.nv - 6);
  const double coarse = apart(&f, 4e-3, 0.4), fine = apart(&f, 2e-3, 0.4);
  print_message("complete basis: %.2e, %.2e (order %.2f)\n", coarse, fine, order_of(coarse, fine));
  ASSERT_LESS(fine, 1e-2);
  ASSERT_LESS(fabs(order_of(coarse, fine) - 2), 0.25);
  drop_free_body(&f);
}

// ---- over a bounce -----------------------------------------------------------------------------

typedef struct bounce {
  double path, turn; // errors over way and angle
  double way, angle;
  int touched;
} bounce;

static double trace_angle(const double a[9], const double b[9]) { // of a^T b
  double trace = 0;
  for (int i = 0; i < 9; i++) trace += a[i] * b[i];
  return acos(fmin(1, fmax(-1, 0.5 * (trace - 1))));
}

static void full_frame(const free_body *f, ep_full *full, double center[3], double r[9]) {
  double *x = vector_of(f->b.n3), *y = vector_of(f->b.n3), from[3], linear[3], angular[3];
  for (size_t i = 0; i < f->b.n3; i++) x[i] = f->b.mesh.x[i] + ep_full_displacement(full)[i];
  sums_of(f, x, y, center, linear, angular);
  double lumped[3];
  ASSERT_OK(ep_kabsch(f->b.mesh.nv, f->b.mesh.x, x, NULL, r, from, lumped, err));
  free(x);
  free(y);
}

static bounce compare_bounce(free_body *f, double stiffness, double seconds) {
  const double velocity[3] = {1, 0, 0}, spin[3] = {0.5, 1, 6}, dt = 1e-3;
  const ep_frame plane = {{0, -0.35, 0}, {1, 0, 0, 0, 0, 1, 0, -1, 0}}; // third column up: y
  const ep_obstacle floor = {
      .kind = EP_OBSTACLE_PLANE, .friction = 0.3, .start = plane, .end = plane};
  bounce result = {0};
  reset(f, velocity, spin);
  ep_full *full = twin_of(f);
  ep_step_def def = ep_default_step(), whole;
  def.dt = dt;
  def.integrator = EP_NEWMARK;
  def.obstacle = &floor;
  def.obstacles = 1;
  def.contact.stiffness = stiffness;
  def.gravity[1] = -9.81;
  whole = def;
  double *weight = vector_of(f->b.n3), *ones = vector_of(f->b.n3), c0[3], r0[9];
  for (size_t i = 1; i < f->b.n3; i += 3) ones[i] = def.gravity[1];
  ep_csr_multiply(&f->mass, 3, ones, weight);
  whole.force = weight;
  whole.gravity[1] = 0;
  full_frame(f, full, c0, r0);
  double last[3], turned[9];
  memcpy(last, c0, sizeof last);
  memcpy(turned, r0, sizeof turned);
  for (int n = 0; n < (int)lround(seconds / dt); n++) {
    ep_step_report report;
    double c[3], r[9], step = 0, off = 0;
    assert_int_equal(ep_step(f->state, &def, &report), EP_OK);
    ASSERT_OK(ep_full_step(full, &whole, NULL, err));
    full_frame(f, full, c, r);
    for (int i = 0; i < 3; i++) {
      step += (c[i] - last[i]) * (c[i] - last[i]);
      off += pow(c[i] - ep_state_frame(f->state)->c[i], 2);
    }
    result.touched += report.contact.touching > 0;
    result.way += sqrt(step);
    result.angle += trace_angle(turned, r);
    result.path = fmax(result.path, sqrt(off));
    result.turn = fmax(result.turn, trace_angle(ep_state_frame(f->state)->R, r));
    memcpy(last, c, sizeof last);
    memcpy(turned, r, sizeof turned);
  }
  free(weight);
  free(ones);
  ep_full_free(full);
  result.path /= result.way;
  result.turn /= result.angle;
  return result;
}

// A block that knows its surface; the tree is to be freed after it.
static void make_block(ep_material law, ep_elastic elastic, int linear, int r,
                       ep_contact_tree *tree, free_body *f) {
  const int cells[3] = {4, 2, 2};
  const double size[3] = {0.5, 0.25, 0.2};
  begin_free_body(f, cells, size, law, elastic, linear);
  ASSERT_OK(ep_basis_build(&f->b.fem, &f->modes, 0, NULL, 0, NULL, r, NULL, &f->basis, err));
  ASSERT_OK(ep_contact_tree_build(&f->b.mesh, r, f->basis.u, tree, err));
  f->contact = tree;
  finish_free_body(f);
}

static bounce bounce_of(ep_elastic elastic, double stiffness, int linear, int r) {
  free_body f;
  ep_contact_tree tree;
  make_block(EP_STVK_VOLUME, elastic, linear, r, &tree, &f);
  const bounce result = compare_bounce(&f, stiffness, 0.5);
  ep_contact_tree_free(&tree);
  drop_free_body(&f);
  return result;
}

static void say(const char *what, const bounce *b) {
  print_message("%s: path %.2e of %.2f m, rotation %.2e of %.2f rad, %d steps touching\n", what,
                b->path, b->way, b->turn, b->angle, b->touched);
}

static void a_bounce_is_that_of_the_full_space(void **state) {
  (void)state;
  // the contact given, and softer than the body's corners: these are not in a small basis
  const bounce stiff = bounce_of(STIFF, 3e8, 15, 30);
  const bounce coarse = bounce_of(SOFT, 0, 15, 30), soft = bounce_of(SOFT, 0, 25, 60);
  say("stiff, r = 30", &stiff);
  say("soft, r = 30", &coarse);
  say("soft, r = 60", &soft);
  assert_true(stiff.touched > 0 && soft.touched > 0);
  ASSERT_LESS(stiff.path, 0.01);
  ASSERT_LESS(stiff.turn, 0.01);
  // landing on a corner: measured 7.8 and 27 % at r = 30, 2.7 and 6.6 % at r = 60, 0.6 and 2.5 % at
  // r = 90; it is the subspace
  ASSERT_LESS(soft.path, 0.05);
  ASSERT_LESS(soft.turn, 0.12);
  ASSERT_LESS(soft.path, 0.6 * coarse.path);
}

// Thrown at a floor with the speed of a fall from 3 and 13 m: free flight of a step of 1/60 s ends
// up to 0.27 m deep, more than half of the block. Newmark and BDF2 want a quarter of it.
static void hard_landings_need_no_smaller_steps(void **state) {
  (void)state;
  static const ep_material law[] = {EP_STVK_VOLUME, EP_STABLE_NEOHOOKEAN, EP_COROTATIONAL};
  static const double speed[] = {8, 16};
  const ep_frame plane = {{0, -0.6, 0}, {1, 0, 0, 0, 0, 1, 0, -1, 0}}; // third column up: y
  const ep_obstacle floor = {
      .kind = EP_OBSTACLE_PLANE, .friction = 0.3, .start = plane, .end = plane};
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 5e-3;
  def.obstacle = &floor;
  def.obstacles = 1;
  def.gravity[1] = -9.81;
  for (int i = 0; i < 3; i++) {
    free_body f;
    ep_contact_tree tree;
    make_block(law[i], SOFT, 15, 30, &tree, &f);
    for (int j = 0; j < 2 * EP_INTEGRATORS; j++) {
      const double velocity[3] = {1, -speed[j % 2], 0}, spin[3] = {2, 3, 6};
      def.integrator = (ep_integrator)(j / 2);
      def.dt = def.integrator == EP_IMPLICIT_EULER ? 1. / 60 : 1. / 240;
      ep_step_report report;
      int touched = 0;
      reset(&f, velocity, spin);
      for (int n = 0; n < 120; n++) {
        assert_int_equal(ep_step(f.state, &def, &report), EP_OK);
        touched += report.contact.touching > 0;
      }
      assert_true(touched > 0);
      ASSERT_LESS(report.contact.deepest, 0.02); // on the floor or above
    }
    ep_contact_tree_free(&tree);
    drop_free_body(&f);
  }
}

// A rigid block meets a floor at 20 m/s, `share` of a step after a step's start; dt changes from
// step to step. Returns the energy left over that before; impulse: how far the momentum is from
// what the forces reported gave it, over what it was.
static double land(free_body *f, ep_integrator kind, double share, double *impulse) {
  const double velocity[3] = {0, -20, 0}, spin[3] = {0, 0, 0.5};
  ep_step_def def = ep_default_step();
  const double base = f->model->rigid_origin[1] - 0.125 - 20 * def.dt * (3 + share);
  const ep_frame plane = {{0, base, 0}, {1, 0, 0, 0, 0, 1, 0, -1, 0}};
  const ep_obstacle floor = {
      .kind = EP_OBSTACLE_PLANE, .friction = 0.3, .start = plane, .end = plane};
  double p[3], p0[3], l[3], given = 0, before = 0, after = 0;
  def.integrator = kind;
  def.damping_stiffness = 5e-3;
  def.obstacle = &floor;
  def.obstacles = 1;
  reset(f, velocity, spin);
  ep_state_momentum(f->state, p0, l);
  int touched = 0;
  for (int n = 0; n < 40; n++) {
    ep_step_report report;
    def.dt = (n > 3 && n % 3 == 2 ? 0.5 : 1) / 60.0;
    assert_int_equal(ep_step(f->state, &def, &report), EP_OK);
    after = report.elastic_energy + report.kinetic_energy + report.contact.energy;
    if (n == 0) before = after;
    given += def.dt * report.contact.force[1];
    touched += report.contact.touching;
  }
  assert_true(touched > 0);
  ep_state_momentum(f->state, p, l);
  *impulse = fabs(p[1] - p0[1] - given) / fabs(p0[1]);
  return after / before;
}

static void impacts_add_no_energy(void **state) {
  (void)state;
  enum { SHARES = 4 };
  free_body f;
  ep_contact_tree tree;
  make_block(EP_STVK_VOLUME, STIFF, 15, 30, &tree, &f);
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    double most = 0, worst = 0;
    for (int i = 0; i < SHARES; i++) {
      double impulse;
      most = fmax(most, land(&f, (ep_integrator)kind, (double)i / SHARES, &impulse));
      worst = fmax(worst, impulse);
    }
    print_message("impacts, %s: at most %.3f of the energy left, impulses to %.1e\n",
                  ep_integrator_name((ep_integrator)kind), most, worst);
    ASSERT_LESS(most, 1);
    ASSERT_LESS(worst, 1e-12); // round-off
  }
  ep_contact_tree_free(&tree);
  drop_free_body(&f);
}

// Newmark's acceleration is one without contact (ep_contact_share); that of another integrator is
// not. Taken for it, it would throw the block about by the share of its weight.
static void rest_is_rest_for_every_integrator(void **state) {
  (void)state;
  const ep_frame plane = {{0, -0.13, 0}, {1, 0, 0, 0, 0, 1, 0, -1, 0}};
  const ep_obstacle floor = {.kind = EP_OBSTACLE_PLANE, .start = plane, .end = plane};
  const double still[3] = {0};
  free_body f;
  ep_contact_tree tree;
  make_block(EP_STVK_VOLUME, SOFT, 15, 30, &tree, &f);
  const int r = f.model->size.r;
  for (int kind = EP_NEWMARK; kind < EP_INTEGRATORS; kind++) {
    double speed[2];
    ep_step_def def = ep_default_step();
    def.damping_stiffness = 0.02;
    def.tolerance = 1e-9;
    def.obstacle = &floor;
    def.obstacles = 1;
    def.gravity[1] = -9.81;
    reset(&f, still, still);
    for (int n = 0; n < 240; n++) assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    for (int i = 0; i < 2; i++) { // of the deformation, before and after
      speed[i] = 0;
      for (int a = 0; a < r; a++) speed[i] = hypot(speed[i], ep_state_velocity(f.state)[a]);
      def.integrator = (ep_integrator)kind;
      if (i == 0) assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    }
    print_message("rest, %s: %.1e, then %.1e\n", ep_integrator_name(def.integrator), speed[0],
                  speed[1]);
    ASSERT_LESS(speed[1], 1e-6); // Newton's tolerance; its weight moves it by .1 in a step
  }
  ep_contact_tree_free(&tree);
  drop_free_body(&f);
}

static void pushes_in_contact_give_their_impulse(void **state) {
  (void)state;
  const ep_frame plane = {{0, -0.3, 0}, {1, 0, 0, 0, 0, 1, 0, -1, 0}};
  const ep_obstacle floor = {
      .kind = EP_OBSTACLE_PLANE, .friction = 0.5, .start = plane, .end = plane};
  const double velocity[3] = {0, -6, 0}, spin[3] = {3, 0, 9};
  free_body f;
  ep_contact_tree tree;
  make_block(EP_STVK_VOLUME, SOFT, 15, 30, &tree, &f);
  const int r = f.model->size.r;
  const size_t last = (size_t)f.b.mesh.nv - 1;
  double modes[90], *x = vector_of(f.b.n3), p[3], l[3], before[3];
  ep_pull pull = {.force = {60, 40, -30}, .modes = modes};
  for (size_t k = 0; k < 3; k++) {
    pull.at[k] = f.b.mesh.x[3 * last + k] - f.model->rigid_origin[k];
    for (int i = 0; i < r; i++)
      modes[3 * i + (int)k] = f.model->u[(size_t)i * f.b.n3 + 3 * last + k];
  }
  ep_step_def def = ep_default_step();
  def.tolerance = 1e-8;
  def.damping_stiffness = 5e-3;
  def.obstacle = &floor;
  def.obstacles = 1;
  def.pulls = 1;
  def.gravity[1] = -9.81;
  def.pull = &pull;
  reset(&f, velocity, spin);
  double worst = 0, largest = 0;
  int touched = 0, iterations = 0;
  for (int n = 0; n < 60; n++) {
    ep_step_report report;
    ep_state_momentum(f.state, p, before);
    assert_int_equal(ep_step(f.state, &def, &report), EP_OK);
    ep_state_momentum(f.state, p, l);
    ep_state_positions(f.state, x);
    touched += report.contact.touching > 0;
    iterations += report.newton_iterations;
    double arm[3];
    for (size_t k = 0; k < 3; k++) arm[k] = x[3 * last + k] - ep_state_frame(f.state)->c[k];
    for (int k = 0; k < 3; k++) {
      const int i = (k + 1) % 3, j = (k + 2) % 3;
      const double torque =
          report.contact.torque[k] + arm[i] * pull.force[j] - arm[j] * pull.force[i];
      worst = fmax(worst, fabs(l[k] - before[k] - def.dt * torque));
      largest = fmax(largest, fabs(l[k]));
    }
  }
  print_message("push in contact: %.1e of the angular momentum, %d iterations\n", worst / largest,
                iterations);
  assert_true(touched > 5);
  ASSERT_LESS(worst, 1e-6 * largest); // Newton's tolerance
  free(x);
  ep_contact_tree_free(&tree);
  drop_free_body(&f);
}

// ---- something outside -------------------------------------------------------------------------

// A spring of stiffness k from one vertex to a point of the world; acts within `reach`.
typedef struct spring {
  const free_body *f;
  int vertex;
  double stiffness, to[3], reach;
  double force[3], torque[3]; // at the last evaluation with a gradient
} spring;

static double spring_energy(void *user, const ep_state *state, const ep_frame *frame,
                            const double *q, double *g, double *h, int n) {
  spring *s = user;
  const ep_model *m = ep_state_model(state);
  const int r = m->size.r;
  const size_t n3 = 3 * (size_t)m->size.n, at = 3 * (size_t)s->vertex;
  double y[3], arm[3], d[3], rows[3][64] = {{0}}, square = 0;
  for (size_t i = 0; i < 3; i++) {
    y[i] = m->rest_x[at + i] - m->rigid_origin[i];
    for (int a = 0; a < r; a++) y[i] += m->u[(size_t)a * n3 + at + i] * q[a];
  }
  for (int i = 0; i < 3; i++) {
    arm[i] = dot_rows(frame->R + 3 * i, y);
    d[i] = frame->c[i] + arm[i] - s->to[i];
    square += d[i] * d[i];
  }
  if (g) memset(s->force, 0, sizeof s->force), memset(s->torque, 0, sizeof s->torque);
  if (square > s->reach * s->reach) return 0;
  for (int i = 0; i < 3; i++) {
    for (int a = 0; a < r; a++)
      for (size_t k = 0; k < 3; k++)
        rows[i][a] += frame->R[3 * i + (int)k] * m->u[(size_t)a * n3 + at + k];
    rows[i][r + i] = 1;
    rows[i][r + 3 + (i + 1) % 3] = arm[(i + 2) % 3]; // theta x arm
    rows[i][r + 3 + (i + 2) % 3] = -arm[(i + 1) % 3];
  }
  for (int i = 0; i < 3; i++)
    for (int a = 0; a < n; a++) {
      if (g) g[a] += s->stiffness * d[i] * rows[i][a];
      for (int b = 0; h && b < n; b++) h[a * n + b] += s->stiffness * rows[i][a] * rows[i][b];
    }
  for (int i = 0; g && i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    s->force[i] = -s->stiffness * d[i];
    s->torque[i] = -s->stiffness * (arm[j] * d[k] - arm[k] * d[j]);
  }
  return 0.5 * s->stiffness * square;
}

static void make_sprung(free_body *f, spring *s) {
  const int cells[3] = {3, 1, 1};
  const double size[3] = {0.6, 0.2, 0.15};
  make_free_body(f, cells, size, EP_STVK, SOFT, 6, 10, 0);
  *s = (spring){
      .f = f, .vertex = f->b.mesh.nv - 1, .stiffness = 200, .to = {0.7, 0.4, 0.3}, .reach = 1e9};
}

static void what_acts_gives_its_impulse(void **state) {
  (void)state;
  free_body f;
  spring s;
  make_sprung(&f, &s);
  const double velocity[3] = {0, 1, 0}, spin[3] = {1, -2, 4};
  reset(&f, velocity, spin);
  ep_step_def def = ep_default_step();
  def.outer = spring_energy;
  def.outer_user = &s;
  double p[3], l[3], p0[3], l0[3], *x = vector_of(2 * f.b.n3), impulse[6] = {0};
  ep_state_momentum(f.state, p0, l0);
  int iterations = 0;
  for (int n = 0; n < 120; n++) {
    ep_step_report report;
    assert_int_equal(ep_step(f.state, &def, &report), EP_OK);
    iterations += report.newton_iterations;
    double g[16] = {0};
    spring_energy(&s, f.state, ep_state_frame(f.state), ep_state_q(f.state), g, NULL, 16);
    for (int i = 0; i < 3; i++) {
      impulse[i] += def.dt * s.force[i];
      impulse[3 + i] += def.dt * s.torque[i];
    }
  }
  ep_state_momentum(f.state, p, l);
  for (int i = 0; i < 3; i++) {
    ASSERT_LESS(fabs(p[i] - p0[i] - impulse[i]), 1e-11 * 100);
    ASSERT_LESS(fabs(l[i] - l0[i] - impulse[3 + i]), 1e-11 * 100);
  }
  print_message("spring: %.1f Newton steps a step\n", iterations / 120.0);
  ASSERT_LESS(iterations, 120 * 6); // the coupling is in the Hessian: few steps
  free(x);
  drop_free_body(&f);
}

static void what_does_not_act_changes_nothing(void **state) {
  (void)state;
  free_body f;
  spring s;
  make_sprung(&f, &s);
  s.reach = 0.01;
  const double velocity[3] = {0, -1, 0}, spin[3] = {1, -2, 4};
  ep_frame alone = {0};
  double q[10] = {0};
  for (int with = 0; with < 2; with++) {
    reset(&f, velocity, spin);
    ep_step_def def = ep_default_step();
    def.outer = with ? spring_energy : NULL;
    def.outer_user = &s;
    for (int n = 0; n < 30; n++) assert_int_equal(ep_step(f.state, &def, NULL), EP_OK);
    if (with) {
      assert_memory_equal(&alone, ep_state_frame(f.state), sizeof alone);
      assert_memory_equal(q, ep_state_q(f.state), sizeof q);
    }
    alone = *ep_state_frame(f.state);
    memcpy(q, ep_state_q(f.state), sizeof q);
  }
  drop_free_body(&f);
}

// Positions of all vertices after 0.32 s with a spring.
static void swing(free_body *f, spring *s, ep_integrator kind, double dt, double *x) {
  const double velocity[3] = {0, 1, 0}, spin[3] = {1, -2, 4};
  reset(f, velocity, spin);
  ep_step_def def = ep_default_step();
  def.integrator = kind;
  def.dt = dt;
  def.tolerance = 1e-11;
  def.damping_stiffness = 2e-3;
  def.outer = spring_energy;
  def.outer_user = s;
  for (int n = 0; n < (int)lround(0.32 / dt); n++)
    assert_int_equal(ep_step(f->state, &def, NULL), EP_OK);
  ep_state_positions(f->state, x);
}

static void errors_fall_with_the_integrators_order(void **state) {
  (void)state;
  static const double order[EP_INTEGRATORS] = {1, 2, 2};
  free_body f;
  spring s;
  make_sprung(&f, &s);
  double *exact = vector_of(f.b.n3), *x = vector_of(f.b.n3);
  swing(&f, &s, EP_NEWMARK, 1.25e-4, exact);
  for (int kind = 0; kind < EP_INTEGRATORS; kind++) {
    double error[2];
    for (int i = 0; i < 2; i++) {
      swing(&f, &s, (ep_integrator)kind, i ? 1e-3 : 2e-3, x);
      error[i] = distance_of(f.b.n3, x, exact);
    }
    print_message("%s: %.2e, %.2e, order %.2f\n", ep_integrator_name((ep_integrator)kind), error[0],
                  error[1], order_of(error[0], error[1]));
    ASSERT_LESS(fabs(order_of(error[0], error[1]) - order[kind]), 0.3);
  }
  free(exact);
  free(x);
  drop_free_body(&f);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(a_complete_basis_moves_as_the_full_space),
      cmocka_unit_test(a_bounce_is_that_of_the_full_space),
      cmocka_unit_test(hard_landings_need_no_smaller_steps),
      cmocka_unit_test(impacts_add_no_energy),
      cmocka_unit_test(rest_is_rest_for_every_integrator),
      cmocka_unit_test(pushes_in_contact_give_their_impulse),
      cmocka_unit_test(what_acts_gives_its_impulse),
      cmocka_unit_test(what_does_not_act_changes_nothing),
      cmocka_unit_test(errors_fall_with_the_integrators_order),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
