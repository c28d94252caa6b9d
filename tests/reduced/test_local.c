// Local examples. Claims: one region that is everywhere steps as the model without regions does,
// bit for bit; weights of a region depend on its own descriptor alone and are those of a model that
// has nothing else; the energy of a region's target and force is the plain sum over its elements,
//   E_g = sum_i w_i sum_j s_gj w_j |det F_ij| psi(F_j F_ij^-1) + outside / 100,
// and its gradient is the force; no step allocates; the descriptor of a region nothing holds does
// not see a motion of the whole, c(R x + t) = c(x).
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "tests/reduced/bar.h"
#include "tests/reduced/count_allocations.h"

enum { R = 16, M = 6, K = 3, S = 40 };

typedef struct local {
  bar *b;
  ep_model whole, model; // without and with regions; arrays shared
  int32_t example_region[K], first[3], carried[2];
  double inside[2 * S], outside[2 * S], example_w[K * S];
  double motion[2 * 12 * R], rest[2 * 12], mean[M];
  void *block, *whole_block;
  ep_state *state, *whole_state;
} local;

static ep_state *state_of(const ep_model *model, void **block) {
  const size_t bytes = (ep_state_bytes(model) + 63) / 64 * 64;
  ep_state *state;
  *block = aligned_alloc(64, bytes);
  assert_int_equal(ep_state_init(model, *block, bytes, &state), EP_OK);
  return state;
}

// regions 1: everywhere. 2: shares 1 on the first elements, then falling, 0 on the last; examples
// 0 and 2 belong to the first region, 1 to the second.
static void create(local *l, int regions, ep_material material) {
  memset(l, 0, sizeof *l);
  l->b = bar_create(5, 2, 1, R, S, M, K, material);
  l->whole = l->model = l->b->model;
  l->model.size.regions = regions;
  for (int i = 0; i < K; i++) l->example_region[i] = regions > 1 ? i % 2 : 0;
  l->first[1] = regions > 1 ? 4 : M, l->first[2] = M;
  for (int j = 0; j < S; j++) {
    const double ramp = fmin(1, fmax(0, (25.0 - j) / 10)), w = l->b->model.cubature_w[j];
    const double share[2] = {regions > 1 ? ramp : 1, 1 - ramp};
    for (int g = 0; g < regions; g++) {
      l->inside[g * S + j] = share[g] * w;
      l->outside[g * S + j] = (1 - share[g]) * w;
    }
    for (int i = 0; i < K; i++)
      l->example_w[i * S + j] = l->whole.example_w[i * S + j] * share[l->example_region[i]];
  }
  l->model.example_region = l->example_region, l->model.region_first = l->first;
  l->model.region_inside = l->inside, l->model.region_outside = l->outside;
  l->model.region_carried = l->carried, l->model.example_w = l->example_w;
  l->model.region_motion = l->motion, l->model.region_motion_rest = l->rest;
  l->model.region_mean = l->mean;
  l->state = state_of(&l->model, &l->block);
  l->whole_state = state_of(&l->whole, &l->whole_block);
}

static void destroy(local *l) {
  free(l->block);
  free(l->whole_block);
  bar_free(l->b);
}

static void everywhere_is_without_regions(void **unused) {
  (void)unused;
  local l;
  create(&l, 1, EP_STVK_VOLUME);
  double q[R], load[R], moved = 0;
  bar_random_q(l.b, 0.3, q);
  ep_elastic_energy(l.state, q, load, NULL, 0);
  ep_step_def def = ep_default_step();
  def.force = load, def.strength = 2, def.damping_stiffness = 0.01;
  const double factor = 1;
  for (int step = 0; step < 20; step++) {
    ep_step_report a, b;
    def.relief = step < 10 ? 0 : 0.5; // w - relief w and (1 - relief) w: the same for 1/2
    def.region_strength = step % 2 ? &factor : NULL;
    const int before = allocations;
    assert_int_equal(ep_step(l.state, &def, &a), EP_OK);
    assert_int_equal(allocations, before);
    assert_int_equal(ep_step(l.whole_state, &def, &b), EP_OK);
    assert_memory_equal(ep_state_q(l.state), ep_state_q(l.whole_state), R * sizeof *q);
    assert_memory_equal(ep_state_weights(l.state), ep_state_weights(l.whole_state), K * sizeof *q);
    assert_memory_equal(ep_state_target(l.state), ep_state_target(l.whole_state), R * sizeof *q);
    assert_true(a.example_energy == b.example_energy);
    for (int i = 0; i < K; i++) moved = fmax(moved, ep_state_weights(l.state)[i]);
  }
  assert_true(moved > 1e-3); // the examples did act
  destroy(&l);
}

static void weights_are_independent(void **unused) {
  (void)unused;
  local l;
  create(&l, 2, EP_STVK);
  for (int round = 0; round < 50; round++) {
    double q[R], other[R], c[3 * M], d[3 * M], w[2 + K], v[2 + K];
    bar_random_q(l.b, 0.6, q);
    bar_random_q(l.b, 0.6, other);
    ep_descriptor(&l.model, q, c);
    assert_int_equal(ep_example_weights(l.state, c, w), EP_OK);
    assert_true(fabs(w[0] + w[2] + w[4] - 1) < 1e-12 && fabs(w[1] + w[3] - 1) < 1e-12);
    // another descriptor of the second region only
    ep_descriptor(&l.model, other, d);
    memcpy(c + 3 * 4, d + 3 * 4, 3 * 2 * sizeof *c);
    assert_int_equal(ep_example_weights(l.state, c, v), EP_OK);
    assert_true(v[0] == w[0] && v[2] == w[2] && v[4] == w[4]);
    // the second region has one example: its weight is the clamped projection
    double along = 0, length = 0;
    for (int i = 12; i < 18; i++) {
      const double e = l.whole.example_c[18 + i] - l.whole.c0[i];
      along += e * (c[i] - l.whole.c0[i]);
      length += e * e;
    }
    assert_true(fabs(v[3] - fmin(1, fmax(0, along / length))) < 1e-9);
  }
  destroy(&l);
}

// A step pulls each region to its own target: the weights of one do not enter the target of the
// other, so a region at rest keeps the rest shape as target.
static void a_region_at_rest_stays_its_own_target(void **unused) {
  (void)unused;
  local l;
  create(&l, 2, EP_STVK);
  // descriptors of the second region that do not see the motion at all
  double *t = malloc(3 * M * R * sizeof *t);
  assert_non_null(t);
  memcpy(t, l.whole.t, 3 * M * R * sizeof *t);
  memset(t + 12 * R, 0, 6 * R * sizeof *t);
  l.model.t = t;
  double q[R];
  memcpy(q, l.whole.example_q, sizeof q);
  for (int a = 0; a < R; a++) q[a] *= 0.5;
  memcpy(ep_state_q(l.state), q, sizeof q);
  ep_step_def def = ep_default_step();
  assert_int_equal(ep_interpolate(l.state, &def, NULL), EP_OK);
  const double *w = ep_state_weights(l.state), *target = ep_state_target(l.state);
  assert_true(w[0] + w[2] > 0.1 && w[1] == 0);
  double size = 0;
  for (int a = 0; a < R; a++) {
    size += target[a] * target[a];
    assert_true(target[R + a] == 0);
  }
  assert_true(size > 0);
  free(t);
  destroy(&l);
}

// w of the first region only.
static void target_energy_is_the_sum_over_the_region(void **unused) {
  (void)unused;
  local l;
  create(&l, 2, EP_STABLE_NEOHOOKEAN);
  const double w[2 + K] = {0.3, 0, 0.5, 0, 0.2};
  double q[R], f[R], h[R * R], sum_f[R] = {0}, part[R];
  bar_random_q(l.b, 0.3, q);
  const double energy = ep_target_energy(l.state, w, q, f, h, 0);
  double sum = w[0] * bar_reference(l.b, NULL, l.inside, q, part, NULL, 0);
  for (int a = 0; a < R; a++) sum_f[a] += w[0] * part[a];
  sum += 0.01 * bar_reference(l.b, NULL, l.outside, q, part, NULL, 0);
  for (int a = 0; a < R; a++) sum_f[a] += 0.01 * part[a];
  for (int i = 0; i < K; i += 2) {
    sum += w[2 + i] * bar_reference(l.b, l.whole.example_finv + 9 * i * S, l.example_w + i * S, q,
                                    part, NULL, 0);
    for (int a = 0; a < R; a++) sum_f[a] += w[2 + i] * part[a];
  }
  double scale = 0;
  for (int a = 0; a < R; a++) scale = fmax(scale, fabs(f[a]));
  assert_true(fabs(energy - sum) < 1e-12 * fabs(sum)); // another order of summation
  for (int a = 0; a < R; a++) assert_true(fabs(f[a] - sum_f[a]) < 1e-11 * scale);
  destroy(&l);
}

// Error of a central difference of the energy in a direction against the force; it must fall with
// the square of the step.
static void forces_are_gradients(void **unused) {
  (void)unused;
  local l;
  create(&l, 2, EP_STVK_VOLUME);
  const double factors[2] = {0.5, 3};
  ep_step_def def = ep_default_step();
  def.strength = 1.5, def.region_strength = factors;
  double q[R], direction[R], f[R], x[R], error[2];
  for (int a = 0; a < R; a++) q[a] = 0.4 * l.whole.example_q[a] + 0.5 * l.whole.example_q[R + a];
  memcpy(ep_state_q(l.state), q, sizeof q);
  assert_int_equal(ep_interpolate(l.state, &def, NULL), EP_OK);
  bar_random_q(l.b, 0.2, q);
  bar_random_q(l.b, 1, direction);
  ep_example_force_energy(l.state, &def, q, f, NULL, 0);
  double slope = 0;
  for (int a = 0; a < R; a++) slope += f[a] * direction[a];
  assert_true(fabs(slope) > 0);
  for (int i = 0; i < 2; i++) {
    const double step = i ? 1e-3 : 2e-3;
    double side[2];
    for (int s = 0; s < 2; s++) {
      for (int a = 0; a < R; a++) x[a] = q[a] + (s ? step : -step) * direction[a];
      side[s] = ep_example_force_energy(l.state, &def, x, NULL, NULL, 0);
    }
    error[i] = fabs((side[1] - side[0]) / (2 * step) - slope);
  }
  assert_true(error[1] < 1e-3 * fabs(slope));
  assert_true(fabs(log2(error[0] / error[1]) - 2) < 0.1);
  // a region without strength does not pull at all
  const double first_only[2] = {1, 0}, none[2] = {0, 0};
  def.region_strength = none;
  assert_true(ep_example_force_energy(l.state, &def, q, NULL, NULL, 0) == 0);
  def.region_strength = first_only;
  assert_true(ep_example_force_energy(l.state, &def, q, NULL, NULL, 0) > 0);
  destroy(&l);
}

static void what_regions_cannot_do_is_refused(void **unused) {
  (void)unused;
  local l;
  create(&l, 2, EP_STVK);
  const double bad[2] = {1, -1};
  double before[R];
  memcpy(before, ep_state_q(l.state), sizeof before);
  ep_step_def def = ep_default_step();
  def.region_strength = bad;
  assert_int_equal(ep_step(l.state, &def, NULL), EP_ERR_ARGUMENT);
  def.region_strength = NULL;
  def.example_force = EP_EXAMPLE_LINEAR;
  assert_int_equal(ep_step(l.state, &def, NULL), EP_ERR_ARGUMENT);
  assert_memory_equal(before, ep_state_q(l.state), sizeof before);
  destroy(&l);
}

// ---- a region that is carried -------------------------------------------------------------------

enum { POINTS = 12, AFFINE = 12 };

// All affine motions as modes: x_v = X_v + sum_ij q_(3i+j) X_v,j e_i + sum_i q_(9+i) e_i.
typedef struct cloud {
  double x[3 * POINTS], weight[POINTS], row[2 * POINTS]; // rows of two functions
  double c0[6], t[6 * AFFINE], motion[12 * AFFINE], rest[12], mean[2];
  int32_t region[1], first[2], carried[1];
  ep_model model;
} cloud;

static double uniform(uint32_t *seed) {
  *seed = *seed * 1664525u + 1013904223u;
  return (double)*seed / 2147483648.0 - 1;
}

static double moved(const cloud *c, int v, int i, int mode) {
  return mode < 9 ? (mode / 3 == i ? c->x[3 * v + mode % 3] : 0) : mode - 9 == i;
}

static void make_cloud(cloud *c) {
  uint32_t seed = 5;
  double total = 0, centre[3] = {0};
  memset(c, 0, sizeof *c);
  for (int v = 0; v < POINTS; v++) {
    for (int i = 0; i < 3; i++) c->x[3 * v + i] = 2 + (1 + i) * uniform(&seed);
    for (int f = 0; f < 2; f++) c->row[f * POINTS + v] = uniform(&seed);
    total += c->weight[v] = 1.2 + uniform(&seed);
  }
  for (int v = 0; v < POINTS; v++)
    for (int i = 0; i < 3; i++) centre[i] += (c->weight[v] /= i ? 1 : total) * c->x[3 * v + i];
  for (int v = 0; v < POINTS; v++)
    for (int i = 0; i < 3; i++)
      for (int mode = -1; mode < AFFINE; mode++) {
        const double x = mode < 0 ? c->x[3 * v + i] : moved(c, v, i, mode);
        for (int f = 0; f < 2; f++)
          *(mode < 0 ? &c->c0[3 * f + i] : &c->t[(3 * f + i) * AFFINE + mode]) +=
              c->row[f * POINTS + v] * x;
        for (int j = 0; j < 4; j++) {
          const int row = j < 3 ? 3 * i + j : 9 + i;
          const double arm = j < 3 ? c->x[3 * v + j] - centre[j] : 1;
          *(mode < 0 ? &c->rest[row] : &c->motion[row * AFFINE + mode]) += c->weight[v] * x * arm;
        }
      }
  for (int f = 0; f < 2; f++)
    for (int v = 0; v < POINTS; v++) c->mean[f] += c->row[f * POINTS + v];
  c->first[1] = 2, c->carried[0] = 1;
  c->model = (ep_model){.size = {.r = AFFINE, .m = 2, .k = 1, .regions = 1},
                        .c0 = c->c0,
                        .t = c->t,
                        .example_region = c->region,
                        .region_first = c->first,
                        .region_carried = c->carried,
                        .region_motion = c->motion,
                        .region_motion_rest = c->rest,
                        .region_mean = c->mean};
}

// q of x = A X + b.
static void affine(const double a[9], const double b[3], double q[AFFINE]) {
  for (int i = 0; i < 9; i++) q[i] = a[i] - (i % 4 == 0);
  for (int i = 0; i < 3; i++) q[9 + i] = b[i];
}

static void a_carried_region_sees_only_its_shape(void **unused) {
  (void)unused;
  cloud c;
  make_cloud(&c);
  uint32_t seed = 9;
  for (int round = 0; round < 40; round++) {
    double f[9], turn[9], both[9], b[3], q[AFFINE], still[6], carried[6], axis[3], length = 0;
    for (int i = 0; i < 9; i++) f[i] = (i % 4 == 0) + (round % 2 ? 0.2 * uniform(&seed) : 0);
    for (int i = 0; i < 3; i++) axis[i] = uniform(&seed);
    for (int i = 0; i < 3; i++) length += axis[i] * axis[i];
    const double angle = 3 * uniform(&seed), co = cos(angle), si = sin(angle);
    for (int i = 0; i < 3; i++) axis[i] /= sqrt(length), b[i] = 5 * uniform(&seed);
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++) // Rodrigues
        turn[3 * i + j] = (1 - co) * axis[i] * axis[j] + (i == j ? co : 0) +
                          ((j - i + 3) % 3 == 1 ? -si
                           : i == j             ? 0
                                                : si) *
                              (i == j ? 0 : axis[3 - i - j]);
    for (int i = 0; i < 9; i++)
      both[i] = turn[i / 3 * 3] * f[i % 3] + turn[i / 3 * 3 + 1] * f[3 + i % 3] +
                turn[i / 3 * 3 + 2] * f[6 + i % 3];
    affine(f, (const double[3]){0, 0, 0}, q);
    ep_descriptor(&c.model, q, still);
    affine(both, b, q);
    ep_descriptor(&c.model, q, carried);
    double shape = 0;
    for (int i = 0; i < 6; i++) {
      assert_true(fabs(carried[i] - still[i]) < 1e-11); // coefficients of size 10
      shape = fmax(shape, fabs(still[i] - c.c0[i]));
    }
    if (round % 2)
      assert_true(shape > 1e-2); // it does see the shape
    else
      assert_true(shape < 1e-12); // and nothing else
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(everywhere_is_without_regions),
      cmocka_unit_test(weights_are_independent),
      cmocka_unit_test(a_region_at_rest_stays_its_own_target),
      cmocka_unit_test(target_energy_is_the_sum_over_the_region),
      cmocka_unit_test(forces_are_gradients),
      cmocka_unit_test(what_regions_cannot_do_is_refused),
      cmocka_unit_test(a_carried_region_sees_only_its_shape),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
