// One case of a stress test, step by step.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/simulate.h"
#include "app/stress/stress.h"

// Steps with the scene's loads, and without; from a start state more, so that it can come to rest.
enum { LOADED = 60, FREE = 60, RECOVERY = 300, STEPS = LOADED + RECOVERY };
static const double growth_allowed = 1e-6;

typedef struct run {
  ep_stress_bench bench;
  ep_stress_result *result;
  double newton[STEPS], us[STEPS];
  bool driven;            // an example force acts in the first steps
  double energy, largest; // of the last step, and the most of any step
} run;

void ep_stress_result_free(ep_stress_result *result) {
  free(result->q);
  free(result->v);
  result->q = result->v = NULL;
}

// The state as it is before a step.
static ep_status remember(run *w, double t, bool loaded, ep_error *err) {
  ep_stress_result *out = w->result;
  ep_state *state = ep_stepper_state(w->bench.stepper);
  const size_t r = (size_t)w->bench.model.model.size.r;
  if (!out->q) out->q = malloc(r * sizeof *out->q);
  if (!out->v) out->v = malloc(r * sizeof *out->v);
  if (!out->q || !out->v) return ep_fail(err, EP_ERR_MEMORY, "no memory for a state");
  memcpy(out->q, ep_state_q(state), r * sizeof *out->q);
  memcpy(out->v, ep_state_velocity(state), r * sizeof *out->v);
  out->r = (int)r;
  out->t = t;
  out->loaded = loaded;
  if (w->bench.model.model.size.rigid) {
    out->frame = *ep_state_frame(state);
    ep_state_motion(state, out->velocity, out->spin);
  }
  return EP_OK;
}

static bool is_finite(const run *w) {
  ep_state *state = ep_stepper_state(w->bench.stepper);
  for (int a = 0; a < w->bench.model.model.size.r; a++)
    if (!isfinite(ep_state_q(state)[a]) || !isfinite(ep_state_velocity(state)[a])) return false;
  return true;
}

static void worse(ep_stress_result *result, ep_stress_outcome outcome, const char *why) {
  if (outcome <= result->outcome) return;
  result->outcome = outcome;
  snprintf(result->why, sizeof result->why, "%.199s", why);
}

// A step that fails must leave the state as it was: tried once more on the state at hand.
static void check_refusal(run *w) {
  ep_state *state = ep_stepper_state(w->bench.stepper);
  const size_t bytes = (size_t)w->bench.model.model.size.r * sizeof(double);
  double *before = malloc(2 * bytes + 1);
  if (!before) return;
  memcpy(before, ep_state_q(state), bytes);
  memcpy((char *)before + bytes, ep_state_velocity(state), bytes);
  const ep_frame frame = *ep_state_frame(state);
  if (ep_step(state, ep_stepper_def(w->bench.stepper), NULL) != EP_OK &&
      (memcmp(before, ep_state_q(state), bytes) != 0 ||
       memcmp((char *)before + bytes, ep_state_velocity(state), bytes) != 0 ||
       memcmp(&frame, ep_state_frame(state), sizeof frame) != 0))
    worse(w->result, EP_STRESS_BROKEN, "a failed step changed the state");
  free(before);
}

// Is the energy of the step before this one to be compared with? Neither loads nor example force
// acted in both, and implicit Euler takes energy away.
static bool is_left_alone(const run *w, int step) {
  const bool pushed = w->result->what.axis != EP_STRESS_START || w->driven;
  return step > (pushed ? LOADED : 0) && w->bench.scene.integrator == EP_IMPLICIT_EULER;
}

static void take(run *w, int step, const ep_advance *done) {
  ep_stress_result *out = w->result;
  w->newton[step] = done->newton_iterations;
  w->us[step] = 1e6 * done->seconds;
  out->newton_most = (int)fmax(out->newton_most, done->newton_iterations);
  out->line_search += done->line_search_steps;
  out->projections += done->projections;
  out->halvings += done->halvings;
  out->unfolded += done->unfolding > 0;
  const ep_step_report *last = &done->last;
  const double energy =
      last->elastic_energy + last->green_energy + last->kinetic_energy + last->contact.energy;
  w->largest = fmax(w->largest, fabs(energy));
  if (is_left_alone(w, step) && w->largest > 0)
    out->growth = fmax(out->growth, (energy - w->energy) / w->largest); // fmax passes NaN over
  w->energy = energy;
}

static ep_status one_step(run *w, int step, bool *go_on, ep_error *err) {
  ep_stress_result *out = w->result;
  const double dt = w->bench.scene.dt, t = step * dt;
  const bool loaded = step < LOADED && out->what.axis != EP_STRESS_START;
  ep_advance done;
  if (step == LOADED) ep_stepper_def(w->bench.stepper)->strength = 0;
  out->coasting = step >= LOADED;
  EP_TRY(remember(w, t, loaded, err));
  const ep_status status = ep_stepper_advance(w->bench.stepper, t, dt, loaded, &done);
  *go_on = status == EP_OK;
  if (status != EP_OK && status != EP_ERR_NUMERIC)
    return ep_fail(err, status, "step %d: the run time cannot do what this case asks for", step);
  if (status != EP_OK) {
    char why[128];
    out->failed_step = step;
    snprintf(why, sizeof why, "step %d failed even at 1/%d of the time step", step,
             1 << EP_HALVINGS_MAX);
    worse(out, EP_STRESS_REFUSED, why);
    check_refusal(w);
    return EP_OK;
  }
  take(w, step, &done);
  out->steps = step + 1;
  const int inverted = is_finite(w) ? ep_stress_inverted(&w->bench) : -1;
  if (inverted < 0) {
    worse(out, EP_STRESS_BROKEN, "a step left numbers that are not finite");
    out->failed_step = step;
    *go_on = false;
  }
  out->inverted_end = inverted;
  if (inverted > out->inverted_most) out->inverted_most = inverted;
  return EP_OK;
}

static void judge(run *w) {
  ep_stress_result *out = w->result;
  char why[96];
  out->newton_median = ep_median(out->steps, w->newton);
  out->step_us = ep_median(out->steps, w->us);
  if (out->halvings > 0) worse(out, EP_STRESS_SUBDIVIDED, "");
  if (out->inverted_end > 0 && out->failed_step < 0) worse(out, EP_STRESS_INVERTED, "");
  if (out->growth > growth_allowed) {
    snprintf(why, sizeof why, "energy without load grew by %.2g of its largest in a step",
             out->growth);
    worse(out, EP_STRESS_GROWTH, why);
  }
  if (out->failed_step < 0) ep_stress_result_free(out);
}

static ep_status steps(run *w, ep_error *err) {
  EP_TRY(ep_stress_begin(&w->bench, &w->result->what, err));
  w->result->inverted_start = ep_stress_inverted(&w->bench);
  w->driven = ep_stepper_def(w->bench.stepper)->strength > 0;
  bool go_on = true;
  const int count = LOADED + (w->result->what.axis == EP_STRESS_START ? RECOVERY : FREE);
  for (int step = 0; step < count && go_on; step++) EP_TRY(one_step(w, step, &go_on, err));
  judge(w);
  return EP_OK;
}

ep_status ep_stress_run(const ep_session *base, const ep_stress_case *c, ep_stress_result *out,
                        ep_error *err) {
  *out = (ep_stress_result){.what = *c, .failed_step = -1, .growth = NAN};
  run *w = calloc(1, sizeof *w);
  if (!w) return ep_fail(err, EP_ERR_MEMORY, "no memory for a case");
  w->result = out;
  ep_error here = {0};
  ep_status status = ep_stress_open(base, c, &w->bench, &here);
  if (status == EP_OK) status = steps(w, &here);
  ep_stress_close(&w->bench);
  free(w);
  if (status == EP_OK) return EP_OK;
  if (status == EP_ERR_MEMORY || status == EP_ERR_IO) return ep_fail(err, status, "%s", here.text);
  // what the run time takes for a wrong use of it is ours to mend, not the case's to be refused
  worse(out, status == EP_ERR_ARGUMENT ? EP_STRESS_BROKEN : EP_STRESS_REFUSED, here.text);
  return EP_OK;
}

// ---- replay ------------------------------------------------------------------------------------

static bool take_numbers(const json_t *list, int count, double *out) {
  if (!json_is_array(list) || json_array_size(list) != (size_t)count) return false;
  for (int i = 0; i < count; i++) {
    const json_t *value = json_array_get(list, (size_t)i);
    if (!json_is_number(value)) return false;
    out[i] = json_number_value(value);
  }
  return true;
}

static bool take_case(const json_t *root, ep_stress_case *c) {
  const char *variant, *axis;
  if (json_unpack((json_t *)root, "{s:s, s:s, s:F, s:F}", "variant", &variant, "axis", &axis,
                  "value", &c->value, "second", &c->second) != 0)
    return false;
  int v = 0, a = 0;
  while (v < EP_VARIANTS && strcmp(variant, ep_stress_variant_name((ep_stress_variant)v)) != 0) v++;
  while (a < EP_STRESS_AXES && strcmp(axis, ep_stress_axis_name((ep_stress_axis)a)) != 0) a++;
  c->variant = (ep_stress_variant)v;
  c->axis = (ep_stress_axis)a;
  return v < EP_VARIANTS && a < EP_STRESS_AXES;
}

static bool take_state(const json_t *root, const ep_model *model, ep_state *state) {
  ep_frame frame;
  double velocity[3], spin[3];
  if (!take_numbers(json_object_get(root, "q"), model->size.r, ep_state_q(state)) ||
      !take_numbers(json_object_get(root, "v"), model->size.r, ep_state_velocity(state)))
    return false;
  if (!model->size.rigid) return true;
  return take_numbers(json_object_get(root, "position"), 3, frame.c) &&
         take_numbers(json_object_get(root, "rotation"), 9, frame.R) &&
         take_numbers(json_object_get(root, "velocity"), 3, velocity) &&
         take_numbers(json_object_get(root, "spin"), 3, spin) &&
         ep_state_set_frame(state, &frame) == EP_OK &&
         ep_state_set_motion(state, velocity, spin) == EP_OK;
}

static ep_status replay(ep_stress_bench *b, const json_t *root, const char *path, ep_error *err) {
  ep_state *state = ep_stepper_state(b->stepper);
  if (!take_state(root, &b->model.model, state))
    return ep_fail(err, EP_ERR_FORMAT, "%s: no state of this scene's model (%d modes)", path,
                   b->model.model.size.r);
  const int before = ep_stress_inverted(b);
  if (json_is_true(json_object_get(root, "coasting"))) ep_stepper_def(b->stepper)->strength = 0;
  ep_advance done;
  const ep_status status =
      ep_stepper_advance(b->stepper, json_number_value(json_object_get(root, "t")), b->scene.dt,
                         json_is_true(json_object_get(root, "loaded")), &done);
  printf("step %s: %d Newton iterations, %d line-search steps, %d projections, %d halvings, last "
         "residual %.3g, inverted tets %d -> %d\n",
         status == EP_OK ? "done" : "failed", done.newton_iterations, done.line_search_steps,
         done.projections, done.halvings, done.last.residual, before, ep_stress_inverted(b));
  return EP_OK;
}

ep_status ep_stress_replay(const ep_session *base, const char *path, ep_error *err) {
  ep_stress_case c = {0};
  json_error_t trouble;
  json_t *root = json_load_file(path, 0, &trouble);
  if (!root) return ep_fail(err, EP_ERR_FORMAT, "%s:%d: %s", path, trouble.line, trouble.text);
  ep_stress_bench bench = {0};
  ep_status status = EP_OK;
  if (!take_case(root, &c))
    status = ep_fail(err, EP_ERR_FORMAT, "%s: no failure of a stress test", path);
  if (status == EP_OK) status = ep_stress_open(base, &c, &bench, err);
  if (status == EP_OK) status = replay(&bench, root, path, err);
  ep_stress_close(&bench);
  json_decref(root);
  return status;
}
