// Choosing guards. Claims: they are found again for a seed, ascending, at most as many as asked
// for, and "full" says that more were wanted; an example keeps them out of its way: a guard's limit
// is at most half of what the example leaves of it, and what an example turns over is no guard. On
// a bar of few cubature elements, pushed with its weight in ways that were not drawn, no tet of the
// whole mesh is inverted at any time; pushed with five times its weight at most a tenth as many as
// without guards, and none once it was let go; without the guards many are. Stiffness and density
// do not matter: the pushes are measured in what they do, the time in periods.
#include "cubature/forces.h"
#include "cubature/guards.h"
#include "reduced/bake/model_build.h"
#include "tests/bake/bar.h"
#include "tests/petsc_session.h"

enum { R = 20, ELEMENTS = 16 };

typedef struct fixture {
  bar b;
  ep_modes modes;
  ep_basis basis;
  ep_elements elements;
  ep_cubature cubature;
} fixture;

// A bar; with an example that presses its far end flat (share: of its height that is left there).
static void make_fixture_of(fixture *f, ep_material model, ep_elastic elastic, int examples,
                            double share) {
  make_bar(&f->b, (int[3]){9, 3, 3}, (double[3]){4, 1, 1}, model, elastic, 1);
  double *pose = vector_of(f->b.n3);
  for (size_t v = 0; v < (size_t)f->b.mesh.nv; v++) {
    const double *x = f->b.mesh.x + 3 * v;
    pose[3 * v + 1] = -(1 - share) * x[1] * fmax(0, x[0] - 2) / 2;
  }
  ASSERT_OK(ep_modes_compute(&f->b.fem, 8, NULL, &f->modes, err));
  ASSERT_OK(ep_basis_build(&f->b.fem, &f->modes, examples, pose, 0, NULL, R, NULL, &f->basis, err));
  ASSERT_OK(ep_elements_create(&f->b.fem, &f->basis, &f->elements, err));
  ep_cubature_options o = ep_default_cubature_options();
  o.elements = ELEMENTS, o.poses = 40;
  ASSERT_OK(ep_cubature_train(&f->b.fem, &f->basis, &o, NULL, &f->cubature, err));
  free(pose);
}

static void make_fixture(fixture *f, int examples, double share) {
  make_fixture_of(f, EP_STVK_VOLUME, (ep_elastic){1000, 1e5, 0.4}, examples, share);
}

static void free_fixture(fixture *f) {
  ep_cubature_free(&f->cubature);
  ep_elements_free(&f->elements);
  ep_basis_free(&f->basis);
  ep_modes_free(&f->modes);
  free_bar(&f->b);
}

static ep_guards choose_within(const fixture *f, int most, uint64_t seed, long effort) {
  ep_guard_options o = ep_default_guard_options();
  ep_guards out;
  o.most = most, o.seed = seed, o.effort = effort;
  ASSERT_OK(ep_guards_choose(&f->b.fem, &f->basis, &f->cubature, &o, NULL, &out, err));
  return out;
}

static ep_guards choose(const fixture *f, int most, uint64_t seed) {
  return choose_within(f, most, seed, ep_default_guard_options().effort);
}

static void test_repeatable_and_bounded(void **state) {
  (void)state;
  fixture f;
  make_fixture(&f, 0, 1);
  ep_guards a = choose(&f, 200, 3), b = choose(&f, 200, 3), few = choose(&f, 5, 3);
  ep_guards brief = choose_within(&f, 200, 3, 30);
  assert_true(a.count > 5 && a.count <= 200);
  assert_int_equal(a.count, b.count);
  assert_memory_equal(a.tet, b.tet, (size_t)a.count * sizeof *a.tet);
  assert_memory_equal(a.weight, b.weight, (size_t)a.count * sizeof *a.weight);
  assert_memory_equal(a.limit, b.limit, (size_t)a.count * sizeof *a.limit);
  for (int i = 0; i < a.count; i++) {
    assert_true(a.tet[i] >= 0 && a.tet[i] < f.b.mesh.nt && (i == 0 || a.tet[i] > a.tet[i - 1]));
    assert_true(a.weight[i] > 0 && a.limit[i] > 0 && a.limit[i] < 0.5);
  }
  assert_int_equal(few.count, 5);
  assert_true(few.full);
  assert_int_equal(a.spared, 0);
  assert_true(brief.cut > a.cut && brief.count < a.count);
  ep_guards_free(&a);
  ep_guards_free(&b);
  ep_guards_free(&few);
  ep_guards_free(&brief);
  free_fixture(&f);
}

static void test_examples_are_left_free(void **state) {
  (void)state;
  static const double shares[2] = {0.2, -0.1}; // pressed flat; turned over
  for (int i = 0; i < 2; i++) {
    fixture f;
    make_fixture(&f, 1, shares[i]);
    ep_guards g = choose(&f, 200, 1);
    int lowered = 0, turned = 0;
    double gradient[9];
    for (int j = 0; j < g.count; j++) {
      const double left = ep_element_gradient(&f.elements, g.tet[j], f.basis.example_q, gradient);
      // the stage has J from positions: round-off of 4 / (edge 0.4)
      assert_true(left > 0 && g.limit[j] <= 0.5 * left + 1e-13);
      lowered += g.limit[j] < 0.15;
    }
    for (int e = 0; e < f.b.mesh.nt; e++)
      turned += ep_element_gradient(&f.elements, e, f.basis.example_q, gradient) <= 0;
    assert_int_equal(g.spared, turned);
    assert_true(lowered > 0 && (turned > 0) == (i == 1));
    ep_guards_free(&g);
    free_fixture(&f);
  }
}

// 1,024 times as stiff or dense is the same push in other units of force and time; powers of 4, so
// that in binary numbers it is so to the last bit.
static void test_units_do_not_matter(void **state) {
  (void)state;
  static const ep_elastic elastic[3] = {
      {1000, 1e5, 0.4}, {1000, 1024 * 1e5, 0.4}, {1024 * 1000, 1e5, 0.4}};
  ep_guards first = {0};
  for (int i = 0; i < 3; i++) {
    fixture f;
    make_fixture_of(&f, EP_STVK_VOLUME, elastic[i], 0, 1);
    ep_guards g = choose(&f, 200, 1);
    if (i > 0) {
      assert_int_equal(g.count, first.count);
      assert_memory_equal(g.tet, first.tet, (size_t)g.count * sizeof *g.tet);
      ep_guards_free(&g);
    } else {
      first = g;
    }
    free_fixture(&f);
  }
  ep_guards_free(&first);
}

// ---- pushes ------------------------------------------------------------------------------------

enum { PUSHED = 40, FREE = 120 };

static int inverted(const fixture *f, const double *q) {
  double gradient[9];
  int count = 0;
  for (int e = 0; e < f->b.mesh.nt; e++)
    count += !(ep_element_gradient(&f->elements, e, q, gradient) > 0);
  return count;
}

// Largest number of inverted tets of the whole mesh while the far end is pushed, and at the end.
static void push(const fixture *f, const ep_guards *g, const double newton[3], int *most,
                 int *left) {
  ep_model_memory memory;
  const ep_model_parts parts = {.fem = &f->b.fem,
                                .basis = &f->basis,
                                .s = f->cubature.count,
                                .tet = f->cubature.tet,
                                .weight = f->cubature.weight,
                                .guards = g ? g->count : 0,
                                .guard_tet = g ? g->tet : NULL,
                                .guard_w = g ? g->weight : NULL,
                                .guard_limit = g ? g->limit : NULL};
  ASSERT_OK(ep_model_build(&parts, &memory, err));
  const size_t bytes = (ep_state_bytes(&memory.model) + 63) / 64 * 64;
  void *block = aligned_alloc(64, bytes);
  ep_state *s;
  assert_non_null(block);
  assert_int_equal(ep_state_init(&memory.model, block, bytes, &s), EP_OK);
  double load[R] = {0};
  for (size_t a = 0; a < R; a++)
    for (size_t v = 0; v < (size_t)f->b.mesh.nv; v++)
      for (size_t c = 0; c < 3 && f->b.mesh.x[3 * v] > 3.9; c++)
        load[a] += newton[c] / 16 * f->basis.u[a * f->b.n3 + 3 * v + c]; // 16 vertices
  ep_step_def def = ep_default_step();
  def.damping_stiffness = 0.02;
  *most = 0;
  for (int step = 0; step < PUSHED + FREE; step++) {
    def.force = step < PUSHED ? load : NULL;
    assert_int_equal(ep_step(s, &def, NULL), EP_OK);
    *left = inverted(f, ep_state_q(s));
    *most = *left > *most ? *left : *most;
  }
  free(block);
  ep_model_memory_free(&memory);
}

static void test_hard_pushes_invert_nothing(void **state) {
  (void)state;
  static const double directions[4][3] = {
      {-1, 0, 0}, {-0.6, 0.8, 0}, {0, 0.1, -1}, {-0.7, -0.5, 0.5}};
  fixture f;
  make_fixture(&f, 0, 1);
  ep_guards g = choose(&f, 256, 1);
  int without = 0, with = 0, most, left;
  for (int i = 0; i < 8; i++) {
    double newton[3]; // the bar weighs 40 kN
    for (int c = 0; c < 3; c++) newton[c] = (i < 4 ? 4e4 : 2e5) * directions[i % 4][c];
    push(&f, NULL, newton, &most, &left);
    without += most;
    push(&f, &g, newton, &most, &left);
    with += most;
    if (i < 4) assert_int_equal(most, 0);
    assert_int_equal(left, 0);
  }
  assert_true(without > 100 && 10 * with <= without);
  ep_guards_free(&g);
  free_fixture(&f);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_repeatable_and_bounded),
      cmocka_unit_test(test_examples_are_left_free),
      cmocka_unit_test(test_units_do_not_matter),
      cmocka_unit_test(test_hard_pushes_invert_nothing),
  };
  return cmocka_run_group_tests(tests, session_start, session_stop);
}
