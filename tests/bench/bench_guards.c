// What guards cost a step (reduced/guard.h): the same bar with 256 of them and without, in turn, on
// every instruction set; at rest almost, in motion, and pushed until guards are at their limits.
//   build/bench_guards
// Each of 10 consecutive steps from a warm state is timed alone; sums of the least of many. Where
// no guard acts both end in the same bits ("same").
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "reduced/state.h"
#include "tests/reduced/bar.h"

enum { R = 30, S = 60, GUARDS = 256, WARM = 20, STEPS = 10, TIMINGS = 100 };

typedef struct rig {
  bar *b;
  void *block, *start;
  size_t bytes;
  ep_state *state;
  double load[R], least[STEPS];
} rig;

static void step(rig *x) {
  ep_step_def def = ep_default_step();
  def.force = x->load, def.damping_stiffness = 0.005;
  if (ep_step(x->state, &def, NULL) != EP_OK) abort();
}

static void set_up(rig *x, ep_isa isa, int k, double load, int guards) {
  double q[R];
  memset(x, 0, sizeof *x);
  x->b = bar_create(8, 3, 3, R, S, k ? 10 : 0, k, EP_STVK_VOLUME);
  if (guards) bar_add_guards(x->b, guards, 0.3);
  x->state = bar_state(x->b, &x->block);
  if (ep_state_use_isa(x->state, ep_isa_name(isa)) != EP_OK) abort();
  bar_random_q(x->b, 0.3 * load, q);
  ep_elastic_energy(x->state, q, x->load, NULL, 0);
  x->bytes = ep_state_bytes(&x->b->model);
  x->start = malloc(x->bytes);
  if (!x->start) abort();
  for (int i = 0; i < WARM; i++) step(x);
  memcpy(x->start, x->block, x->bytes);
  for (int i = 0; i < STEPS; i++) x->least[i] = HUGE_VAL;
}

static void tear_down(rig *x) {
  free(x->block), free(x->start);
  bar_free(x->b);
}

static void time_steps(rig *x) {
  memcpy(x->block, x->start, x->bytes);
  for (int i = 0; i < STEPS; i++) {
    const double begin = ep_seconds();
    step(x);
    x->least[i] = fmin(x->least[i], ep_seconds() - begin);
  }
}

static double mean(const rig *x) {
  double sum = 0;
  for (int i = 0; i < STEPS; i++) sum += x->least[i];
  return sum / STEPS;
}

static void compare(ep_isa isa, int k, double load) {
  rig without, with;
  set_up(&without, isa, k, load, 0);
  set_up(&with, isa, k, load, GUARDS);
  for (int i = 0; i < TIMINGS; i++) time_steps(&without), time_steps(&with);
  const double before = mean(&without) * 1e6, after = mean(&with) * 1e6;
  const int same =
      memcmp(ep_state_q(without.state), ep_state_q(with.state), R * sizeof(double)) == 0;
  printf("%-9s %2d %5.1f %9.2f %9.2f %8.2f %6.1f  %s\n", ep_isa_name(isa), k, load, before, after,
         after - before, 100 * (after / before - 1), same ? "same" : "guards act");
  tear_down(&without), tear_down(&with);
}

int main(void) {
  static const double loads[] = {0.3, 1, 3};
  printf("r = %d, s = %d, %d guards; us a step\n%-9s %2s %5s %9s %9s %8s %6s\n", R, S, GUARDS,
         "kernels", "k", "load", "without", "with", "more", "%");
  for (int isa = (int)ep_isa_here(); isa >= 0; isa--)
    for (size_t i = 0; i < sizeof loads / sizeof *loads; i++)
      for (int k = 0; k <= 2; k += 2) compare((ep_isa)isa, k, loads[i]);
  return 0;
}
