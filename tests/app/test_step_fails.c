// What is said where a simulation ends early (app/run/simulate.c). Claims: a step that does not
// converge, one that finds no memory, one the run time refuses and a step that is done but whose
// shape has no weights are told apart, with the step's number, and what to report is only what is
// a mistake of the program; the rows before are kept. The stepper is replaced by one that fails
// when it is told to.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/run/simulate.h"
#include "app/run/stepper.h"

static int steps_done, weights_found;        // so far
static ep_status step_status, weight_status; // of the third one

static ep_status told_open(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                           ep_stepper **out, ep_error *err) {
  (void)scene, (void)shapes, (void)model, (void)out, (void)err;
  steps_done = weights_found = 0;
  return EP_OK;
}

static void told_close(ep_stepper *s) {
  (void)s;
}

static ep_status told_advance(ep_stepper *s, double t, double dt, bool loads, ep_advance *out) {
  (void)s, (void)t, (void)dt, (void)loads;
  *out = (ep_advance){0};
  return ++steps_done == 3 ? step_status : EP_OK;
}

// The first call is for the state before the steps.
static ep_status told_weights(ep_state *state, const double *c, double *w) {
  (void)state, (void)c;
  w[0] = 1, w[1] = 0;
  return ++weights_found == 4 ? weight_status : EP_OK;
}

static ep_state *told_state(ep_stepper *s) {
  (void)s;
  return NULL;
}

static const double *told_numbers(const ep_state *state) {
  static const double zero = 0;
  (void)state;
  return &zero;
}

static const char *told_isa(const ep_state *state) {
  (void)state;
  return "none";
}

static void told_descriptor(const ep_model *model, const double *q, double *c) {
  (void)model, (void)q;
  c[0] = c[1] = c[2] = 0;
}

static void told_positions(const ep_model *model, const double *q, double *x) {
  (void)q;
  memcpy(x, model->rest_x, 12 * sizeof *x);
}

#define ep_stepper_open    told_open
#define ep_stepper_close   told_close
#define ep_stepper_advance told_advance
#define ep_stepper_state   told_state
#define ep_example_weights told_weights
#define ep_state_q         told_numbers
#define ep_state_velocity  told_numbers
#define ep_state_isa       told_isa
#define ep_descriptor      told_descriptor
#define ep_positions       told_positions
#include "app/run/simulate.c"

static ep_status simulate(ep_status of_step, ep_status of_weights, int *rows, ep_error *err) {
  double x[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
  int tet[4] = {0, 1, 2, 3};
  const ep_model model = {.size = {.n = 4, .r = 1, .k = 1, .m = 1}, .rest_x = x};
  const ep_scene scene = {.steps = 5, .dt = 0.5};
  ep_shape_file file = {.mesh = {.nv = 4, .nt = 1, .x = x, .tet = tet}};
  const ep_shapes shapes = {.shape = &file};
  ep_record record;
  *err = (ep_error){0};
  step_status = of_step;
  weight_status = of_weights;
  const ep_status status = ep_simulate(&scene, &shapes, &model, NULL, NULL, &record, err);
  *rows = record.rows;
  ep_record_free(&record);
  return status;
}

static void fails_with(ep_status of_step, ep_status of_weights, const char *first,
                       const char *second, bool reported) {
  ep_error err;
  int rows;
  const ep_status expected = of_step != EP_OK ? of_step : of_weights;
  assert_int_equal(simulate(of_step, of_weights, &rows, &err), expected);
  assert_int_equal(rows, 3); // the start and two steps
  if (!strstr(err.text, first) || !strstr(err.text, second) ||
      (strstr(err.text, "please report") != NULL) != reported)
    fail_msg("%s", err.text);
}

static void causes_are_told_apart(void **state) {
  (void)state;
  ep_error err;
  int rows;
  assert_int_equal(simulate(EP_OK, EP_OK, &rows, &err), EP_OK);
  assert_int_equal(rows, 6);
  fails_with(EP_ERR_NUMERIC, EP_OK, "step 3 (t = 1.5 s)", "smaller simulation.dt", false);
  fails_with(EP_ERR_MEMORY, EP_OK, "step 3", "no memory", false);
  fails_with(EP_ERR_ARGUMENT, EP_OK, "step 3", "cannot do what the scene asks for", true);
  fails_with(EP_OK, EP_ERR_NUMERIC, "step 3 (t = 1.5 s) is done", "weights", false);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(causes_are_told_apart),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
