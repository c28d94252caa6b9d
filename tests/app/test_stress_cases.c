// The cases of `eigenpose stress`. Claims: a change of the material meets every part of an object
// of several materials, and what it does not change stays what it was; where nothing is changed the
// physics are those of the scene; a scene in floats gets the variants of one in doubles, in floats.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/stress/stress.h"
#include "tests/app/box.h"

static const char two_tets[] =
    "*VERTICES\n5 3 0 0\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n"
    "*ELEMENTS\nTET\n2 4 0\n1 1 2 3 4\n2 2 3 4 5\n"
    "*MATERIAL soft\nENU, 1000, 1e5, 0.4\n*MATERIAL hard\nENU, 2000, 2e9, 0.3\n"
    "*SET tip\n2\n*REGION\nallElements, soft\n*REGION\ntip, hard\n";

static void read_scene(const char *more, ep_scene *scene, ep_shapes *shapes) {
  char text[256];
  ep_error err = {0};
  snprintf(text, sizeof text, "schema: 1\nname: two\nobject: {mesh: two.veg}\n%s", more);
  write_text("two.veg", two_tets);
  if (ep_scene_parse("two.yaml", ".", text, strlen(text), 0, NULL, scene, &err) != EP_OK ||
      ep_shapes_read(scene, NULL, shapes, &err) != EP_OK)
    fail_msg("%s", err.text);
}

static void every_material_changes(void **state) {
  (void)state;
  static const ep_stress_case cases[] = {{.axis = EP_STRESS_LOAD, .value = 1},
                                         {.axis = EP_STRESS_STIFFNESS, .value = 100},
                                         {.axis = EP_STRESS_STIFF, .value = 10},
                                         {.axis = EP_STRESS_POISSON, .value = 0},
                                         {.axis = EP_STRESS_DENSITY, .value = 0.5}};
  static const double young[] = {1, 100, 10, 1, 1}, density[] = {1, 1, 1, 1, 0.5};
  static const double poisson[] = {NAN, NAN, 0.4999, 0, NAN};
  ep_scene scene;
  ep_shapes plain, shapes;
  ep_error err = {0};
  read_scene("", &scene, &plain);
  assert_int_equal(plain.nmaterials, 2);
  for (int i = 0; i < 5; i++) {
    ep_scene changed = scene;
    ep_stress_apply(&cases[i], &changed);
    assert_int_equal(ep_shapes_read(&changed, NULL, &shapes, &err), EP_OK);
    assert_int_equal(shapes.nmaterials, 2);
    for (int m = 0; m < 2; m++) {
      const ep_elastic *was = &plain.material[m], *is = &shapes.material[m];
      assert_true(is->young == young[i] * was->young && is->density == density[i] * was->density);
      assert_true(is->poisson == (isnan(poisson[i]) ? was->poisson : poisson[i]));
    }
    const int same = memcmp(&shapes.physics, &plain.physics, sizeof plain.physics) == 0;
    assert_int_equal(same, i == 0);
    ep_shapes_free(&shapes);
  }
  ep_shapes_free(&plain);
  ep_scene_free(&scene);
}

static void floats_have_the_same_cases(void **state) {
  (void)state;
  static const char *const evaluators[] = {"cubature", "cubic"};
  for (int e = 0; e < 2; e++) {
    ep_stress_case *list[2];
    int count[2];
    ep_error err = {0};
    for (int narrow = 0; narrow < 2; narrow++) {
      ep_session session = {0};
      char more[128];
      snprintf(more, sizeof more, "simulation: {precision: %s}\nreduction: {evaluator: %s}\n",
               narrow ? "float" : "double", evaluators[e]);
      read_scene(more, &session.scene, &session.shapes);
      assert_int_equal(ep_stress_list(&session, false, &count[narrow], &list[narrow], &err), EP_OK);
      for (int i = 0; i < count[narrow]; i++) {
        ep_scene changed = session.scene;
        ep_stress_apply(&list[narrow][i], &changed);
        const int in_floats = changed.evaluator == EP_EVALUATE_CUBATURE_FLOAT ||
                              changed.evaluator == EP_EVALUATE_CUBIC_FLOAT;
        assert_int_equal(in_floats, narrow);
      }
      ep_shapes_free(&session.shapes);
      ep_scene_free(&session.scene);
    }
    assert_int_equal(count[0], count[1]);
    assert_memory_equal(list[0], list[1], (size_t)count[0] * sizeof *list[0]);
    free(list[0]);
    free(list[1]);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(every_material_changes),
      cmocka_unit_test(floats_have_the_same_cases),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
