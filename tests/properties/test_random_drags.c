// Claim, on random free objects in random units and frames: a stiff drag takes its vertices where
// its path ends, and holds them there.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/run/simulate.h"
#include "tests/petsc_session.h"
#include "tests/properties/baked_scene.h"

static bool run_through(baked_scene *b, char *why) {
  for (int step = 0; step < b->from->steps; step++) {
    ep_advance done;
    const double dt = b->from->dt;
    if (ep_stepper_advance(b->stepper, step * dt, dt, true, &done) != EP_OK)
      return breaks(why, "step %d fails", step);
  }
  return true;
}

static void tip_of(const baked_scene *b, double from, double out[3]) {
  const ep_model *m = &b->file.model;
  ep_mesh home = solid_mesh(&b->from->object);
  double *x = malloc(3 * (size_t)m->size.n * sizeof *x), sum = 0;
  double *mass = malloc((size_t)m->size.n * sizeof *mass);
  assert_true(x && mass);
  ep_shapes_vertex_mass(&b->session.shapes, mass);
  ep_state_positions(ep_stepper_state(b->stepper), x);
  memset(out, 0, 3 * sizeof *out);
  for (int v = 0; v < home.nv; v++) {
    const int w = b->to[v];
    if (home.x[3 * v] < from) continue;
    sum += mass[w];
    for (int i = 0; i < 3; i++) out[i] += mass[w] * x[3 * w + i];
  }
  for (int i = 0; i < 3; i++) out[i] /= sum;
  free(x);
  free(mass);
  ep_mesh_free(&home);
}

// A free object, so that its modes need not reach the place by themselves.
static random_scene draw_dragged(uint64_t seed) {
  random_scene s = draw_scene(seed, 0);
  s.held = false;
  s.families = s.obstacles = 0;
  s.loads = 1;
  s.young = fmin(s.young, 1e5);
  s.integrator = EP_IMPLICIT_EULER;
  s.dt = 1.0 / 60;
  s.steps = 40;
  s.damping_stiffness = 0.05;
  s.angle = 0; // the path begins where the vertices are: such a spring allows no other way
  ep_random rng = ep_random_seed(seed, 9);
  s.load[0] = (random_load){.kind = LOAD_DRAG, .size = 1e3 * s.young, .until = 0.2};
  direction(&rng, s.load[0].vector);
  for (int i = 0; i < 3; i++) s.load[0].vector[i] *= 0.3;
  return s;
}

static bool arrives(const random_scene *s, char *why) {
  ep_random rng = ep_random_seed(s->seed, 8);
  const placement at = draw_scene_placement(s, &rng);
  baked_scene b;
  double tip[3], end[3], target[3];
  bool good = bake_scene(s, &at, "dragged", false, &b, why);
  if (good) {
    for (int i = 0; i < 3; i++) tip[i] = (i ? 0 : solid_length(&s->object)) + s->load[0].vector[i];
    place_point(&at, tip, target);
    good = run_through(&b, why);
  }
  if (good) tip_of(&b, TIP_SHARE * solid_length(&s->object), end);
  close_scene(&b);
  double square = 0;
  for (int i = 0; i < 3 && good; i++) square += pow((end[i] - target[i]) / at.unit, 2);
  // 1 %: the spring is a thousand times as stiff as the object; the rest of it still swings
  return good && (sqrt(square) < 0.01 || breaks(why, "%g off the end of its path", sqrt(square)));
}

static void drags_arrive(void **state) {
  (void)state;
  seeds all = seeds_begin(8);
  while (seeds_next(&all)) {
    const random_scene s = draw_dragged(all.now);
    char why[WHY] = "";
    if (!arrives(&s, why)) seed_fails("test_random_drags", all.now, why);
  }
  print_message("%d drags\n", all.done);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(drags_arrive),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
