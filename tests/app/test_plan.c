// Claims: what a scene does not need is left out, with a reason; the key of a stage changes exactly
// where something it depends on changes; without fixed vertices there is an error, not a result.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/plan/plan.h"
#include "box.h"

typedef struct planned {
  ep_scene scene;
  ep_shapes shapes;
  ep_plan plan;
} planned;

#define OBJECT "schema: 1\nobject: {mesh: object.veg}\n"
#define FIXED  "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
#define SMALL  "reduction: {eigenfunctions: 4, modes: 8, linear_modes: 5}\n"

static ep_status make(const char *text, const char *set, planned *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  memset(err, 0, sizeof *err);
  EP_TRY(ep_scene_parse("s.yaml", ".", text, strlen(text), set ? 1 : 0, &set, &out->scene, err));
  EP_TRY(ep_shapes_read(&out->scene, NULL, &out->shapes, err));
  return ep_plan_make(&out->scene, &out->shapes, &out->plan, err);
}

static void drop(planned *p) {
  ep_plan_free(&p->plan);
  ep_shapes_free(&p->shapes);
  ep_scene_free(&p->scene);
}

static planned plan_of(const char *text, const char *set) {
  planned p;
  ep_error err;
  if (make(text, set, &p, &err) != EP_OK) fail_msg("%s", err.text);
  return p;
}

// Number of stages of a kind that run.
static int running(const planned *p, ep_stage_kind kind) {
  int count = 0;
  for (int i = 0; i < p->plan.count; i++) {
    const ep_stage *stage = &p->plan.stage[i];
    assert_true(strlen(stage->reason) > 3);
    count += stage->kind == kind && stage->runs;
  }
  return count;
}

static void expect(const char *text, int eigen, int maps, int poses, int paths, int target) {
  planned p = plan_of(text, NULL);
  assert_int_equal(running(&p, EP_STAGE_EIGEN), eigen);
  assert_int_equal(running(&p, EP_STAGE_MAP), maps);
  assert_int_equal(running(&p, EP_STAGE_POSES), poses);
  assert_int_equal(running(&p, EP_STAGE_PATHS), paths);
  assert_int_equal(running(&p, EP_STAGE_TARGET), target);
  assert_int_equal(running(&p, EP_STAGE_MODES), 1);
  assert_int_equal(running(&p, EP_STAGE_BASIS), 1);
  assert_int_equal(running(&p, EP_STAGE_CUBATURE), 1);
  assert_int_equal(running(&p, EP_STAGE_MODEL), 1);
  drop(&p);
}

static void what_is_not_needed_is_left_out(void **state) {
  (void)state;
  // no examples: no LB space, maps, poses, paths, interpolation
  expect(OBJECT FIXED SMALL, 0, 0, 0, 0, 0);
  // the object's own connectivity: its LB space for descriptors, no map
  expect(OBJECT FIXED SMALL "families: [{poses: [bent.veg]}]\n", 1, 0, 1, 1, 1);
  expect(OBJECT FIXED SMALL "families: [{rest: copy.veg, poses: [bent.veg]}]\n", 1, 0, 1, 1, 1);
  // another rest mesh, its pose on the same: one map
  expect(OBJECT FIXED SMALL "families: [{rest: other.veg, poses: [other-bent.veg]}]\n", 2, 1, 1, 1,
         1);
  // three meshes: two maps; a second family of the object's own poses adds none
  expect(OBJECT FIXED SMALL "families: [{rest: other.veg, poses: [third.veg]},"
                            " {name: own, poses: [bent.veg]}]\n",
         3, 2, 1, 1, 1);
  // a pose of another mesh against the object's own rest shape
  expect(OBJECT FIXED SMALL "families: [{poses: [third.veg]}]\n", 2, 1, 1, 1, 1);
}

static void choices_of_the_scene_leave_stages_out(void **state) {
  (void)state;
  static const char text[] = OBJECT FIXED SMALL "families: [{poses: [bent.veg]}]\n";
  planned p = plan_of(text, "examples.strength=0");
  assert_int_equal(running(&p, EP_STAGE_TARGET), 0);
  assert_int_equal(running(&p, EP_STAGE_POSES), 1);
  drop(&p);
  p = plan_of(text, "reduction.path_samples=0");
  assert_int_equal(running(&p, EP_STAGE_PATHS), 0);
  drop(&p);
}

// Guards: wherever the material keeps elements from turning over and the scene does not say 0.
static void guards_where_there_is_a_penalty(void **state) {
  (void)state;
  static const struct {
    const char *set;
    int guards;
  } cases[] = {{NULL, 1},
               {"reduction.evaluator=cubic", 1},
               {"object.material={model: neohookean}", 1},
               {"object.material={model: stvk}", 0},
               {"reduction.guards=0", 0}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    planned p = plan_of(OBJECT FIXED SMALL, cases[i].set);
    assert_int_equal(running(&p, EP_STAGE_GUARDS), cases[i].guards);
    drop(&p);
  }
}

// Something fixed: no rigid frame, and its reason; nothing fixed: the frame, no other stage changes
// its mind, and the results of the two are kept apart.
static void only_free_objects_have_a_frame(void **state) {
  (void)state;
  planned held = plan_of(OBJECT FIXED SMALL, NULL), loose = plan_of(OBJECT SMALL, NULL);
  assert_false(ep_plan_find(&held.plan, EP_STAGE_FRAME)->runs);
  assert_non_null(strstr(ep_plan_find(&held.plan, EP_STAGE_FRAME)->reason, "something is fixed"));
  assert_true(ep_plan_find(&loose.plan, EP_STAGE_FRAME)->runs);
  for (int i = 0; i < held.plan.count; i++) {
    const ep_stage *x = &held.plan.stage[i], *y = &loose.plan.stage[i];
    if (x->kind != EP_STAGE_FRAME) assert_int_equal(x->runs, y->runs);
    if (x->runs && ep_stage_is_baked(x->kind)) assert_string_not_equal(x->key.hex, y->key.hex);
  }
  drop(&held);
  drop(&loose);
}

// The Green-strain path: explicit weights, so no interpolation; the object's own connectivity needs
// no LB space at all, another one the spaces of the transfer.
static void green_path_leaves_descriptors_out(void **state) {
  (void)state;
  static const char own[] = OBJECT FIXED SMALL "families: [{poses: [bent.veg]}]\n";
  static const char other[] = OBJECT FIXED SMALL "families: [{rest: other.veg, poses: "
                                                 "[other-bent.veg]}]\n";
  static const struct {
    const char *text, *set;
    int eigen, maps, green, target;
  } cases[] = {{own, "examples.path=green", 0, 0, 1, 0},
               {own, "examples.path=both", 1, 0, 1, 1},
               {own, "examples.path=lb", 1, 0, 0, 1},
               {other, "examples.path=green", 2, 1, 1, 0},
               {other, "examples.path=both", 2, 1, 1, 1}};
  for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
    planned p = plan_of(cases[i].text, cases[i].set);
    assert_int_equal(running(&p, EP_STAGE_EIGEN), cases[i].eigen);
    assert_int_equal(running(&p, EP_STAGE_MAP), cases[i].maps);
    assert_int_equal(running(&p, EP_STAGE_GREEN), cases[i].green);
    assert_int_equal(running(&p, EP_STAGE_TARGET), cases[i].target);
    assert_int_equal(running(&p, EP_STAGE_PATHS), 1);
    drop(&p);
  }
}

// A region changes the coefficients and the model made of them, and nothing else.
static void a_region_changes_the_coefficients_only(void **state) {
  (void)state;
  planned a =
      plan_of(OBJECT FIXED SMALL "families: [{poses: [bent.veg]}]\n", "examples.path=green");
  planned b = plan_of(OBJECT FIXED SMALL "families: [{poses: [bent.veg], region: {box: {low: [0.3, "
                                         "-9, -9], high: [9, 9, 9]}}}]\n",
                      "examples.path=green");
  for (int i = 0; i < a.plan.count; i++) {
    const ep_stage *x = &a.plan.stage[i], *y = &b.plan.stage[i];
    const int expected = x->kind == EP_STAGE_GREEN || x->kind == EP_STAGE_MODEL;
    assert_int_equal(strcmp(x->key.hex, y->key.hex) != 0, expected);
  }
  drop(&a);
  drop(&b);
}

static void impossible_scenes_are_refused(void **state) {
  (void)state;
  planned p;
  ep_error err;
  assert_int_equal(make(OBJECT FIXED, "reduction.modes=190", &p, &err), EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "unknowns"));
  drop(&p);
  assert_int_equal(make(OBJECT FIXED SMALL "families: [{poses: [bent.veg]}]\n",
                        "reduction.eigenfunctions=100", &p, &err),
                   EP_ERR_SCENE);
  drop(&p);
  assert_int_equal(make("schema: 1\nobject: {mesh: bare.veg}\n" FIXED SMALL, NULL, &p, &err),
                   EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "material"));
  drop(&p);
  assert_int_equal(
      make(OBJECT "fixed: [{box: {low: [-9, -9, -9], high: [9, 9, 9]}}]\n", NULL, &p, &err),
      EP_ERR_SCENE);
  assert_non_null(strstr(err.text, "every vertex"));
  drop(&p);
}

// Which kinds of stage have another key under an override; bit = kind.
static unsigned changed_by(const char *text, const char *set) {
  planned a = plan_of(text, NULL), b = plan_of(text, set);
  unsigned changed = 0;
  assert_int_equal(a.plan.count, b.plan.count);
  for (int i = 0; i < a.plan.count; i++)
    if (strcmp(a.plan.stage[i].key.hex, b.plan.stage[i].key.hex) != 0)
      changed |= 1u << a.plan.stage[i].kind;
  drop(&a);
  drop(&b);
  return changed;
}

enum {
  EIGEN = 1 << EP_STAGE_EIGEN,
  MAP = 1 << EP_STAGE_MAP,
  POSES = 1 << EP_STAGE_POSES,
  MODES = 1 << EP_STAGE_MODES,
  PATHS = 1 << EP_STAGE_PATHS,
  BASIS = 1 << EP_STAGE_BASIS,
  CUBATURE = 1 << EP_STAGE_CUBATURE,
  GUARDS = 1 << EP_STAGE_GUARDS,
  MODEL = 1 << EP_STAGE_MODEL
};

static void a_change_reaches_only_what_depends_on_it(void **state) {
  (void)state;
  static const char text[] =
      OBJECT FIXED SMALL "families: [{rest: other.veg, poses: [third.veg]}]\n"
                         "loads: [{gravity: [0, 0, 1]}]\n";
  const unsigned late = BASIS | CUBATURE | GUARDS | MODEL;
  assert_int_equal(changed_by(text, "reduction.elements=20"), CUBATURE | GUARDS | MODEL);
  assert_int_equal(changed_by(text, "reduction.amplitude=0.1"), CUBATURE | GUARDS | MODEL);
  assert_int_equal(changed_by(text, "seed=5"), CUBATURE | GUARDS | MODEL);
  assert_int_equal(changed_by(text, "reduction.guards=100"), GUARDS | MODEL);
  assert_int_equal(changed_by(text, "reduction.modes=7"), late);
  assert_int_equal(changed_by(text, "reduction.path_samples=2"), PATHS | late);
  assert_int_equal(changed_by(text, "reduction.linear_modes=4"), MODES | late);
  assert_int_equal(changed_by(text, "reduction.eigenfunctions=5"), MAP | POSES | PATHS | late);
  assert_int_equal(changed_by(text, "object.material={density: 900, young: 1e5, poisson: 0.4}"),
                   MODES | PATHS | late);
  assert_int_equal(changed_by(text, "object.material={model: stvk}"), MODES | PATHS | late);
  assert_int_equal(changed_by(text, "fixed.0.box.high=[0.26, 1, 1]"), POSES | MODES | PATHS | late);
  // another description of the same vertices
  assert_int_equal(changed_by(text, "fixed.0.box.high=[0.02, 1, 1]"), 0);
  // what only the run uses
  const char *run_only[] = {
      "simulation.dt=0.01",        "examples.strength=0.5", "name=x",
      "loads.0.gravity=[0, 1, 0]", "output.every=5",        "examples.solver=newton"};
  for (size_t i = 0; i < sizeof run_only / sizeof *run_only; i++)
    assert_int_equal(changed_by(text, run_only[i]), 0);
  // what was baked by accepting a bad map must not be found once it is not accepted
  assert_int_equal(changed_by(text, "families.0.map.accept=true"), POSES | PATHS | late);
  assert_int_equal(changed_by(text, "families.0.map.regions=regions.ini"),
                   MAP | POSES | PATHS | late);
  assert_int_equal(changed_by(text, "families.0.map.landmarks=[{object: 1, rest: 1}]"),
                   MAP | POSES | PATHS | late);
  assert_int_equal(changed_by(text, "families.0.map.frame=authored"), MAP | POSES | PATHS | late);
  assert_int_equal(changed_by(text, "families.0.map.eigenfunctions=3"), MAP | POSES | PATHS | late);
  assert_int_equal(changed_by(text, "object.mesh=finer.veg"),
                   EIGEN | MAP | POSES | MODES | PATHS | late);
}

static int set_up(void **state) {
  (void)state;
  write_box("object.veg", 4, 2, 2, 1, 0, 1e5);
  write_box("copy.veg", 4, 2, 2, 1, 0, 0);
  write_box("bare.veg", 4, 2, 2, 1, 0, 0);
  write_box("bent.veg", 4, 2, 2, 1, 0.3, 0);
  write_box("other.veg", 5, 2, 2, 1, 0, 0);
  write_box("other-bent.veg", 5, 2, 2, 1, 0.3, 0);
  write_box("third.veg", 6, 2, 2, 1, 0.3, 0);
  write_box("finer.veg", 8, 4, 4, 1, 0, 1e5);
  write_text("regions.ini", "0\n");
  return 0;
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(what_is_not_needed_is_left_out),
      cmocka_unit_test(only_free_objects_have_a_frame),
      cmocka_unit_test(choices_of_the_scene_leave_stages_out),
      cmocka_unit_test(guards_where_there_is_a_penalty),
      cmocka_unit_test(green_path_leaves_descriptors_out),
      cmocka_unit_test(a_region_changes_the_coefficients_only),
      cmocka_unit_test(impossible_scenes_are_refused),
      cmocka_unit_test(a_change_reaches_only_what_depends_on_it),
  };
  return cmocka_run_group_tests(tests, set_up, NULL);
}
