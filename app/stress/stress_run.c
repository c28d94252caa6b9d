// One case of a stress test, step by step.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/report.h"
#include "app/run/simulate.h"
#include "app/stress/stress.h"
#include "base/files.h"

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
  free(result->history);
  result->history = NULL;
}

// The state as it is before a step.
static ep_status remember(run *w, double t, bool loaded, ep_error *err) {
  ep_stress_result *out = w->result;
  ep_state *state = ep_stepper_state(w->bench.stepper);
  out->numbers = ep_state_history_size(state);
  if (!out->history) out->history = malloc(out->numbers * sizeof *out->history);
  if (!out->history) return ep_fail(err, EP_ERR_MEMORY, "no memory for a state");
  ep_state_get_history(state, out->history);
  out->t = t;
  out->loaded = loaded;
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
static ep_status check_refusal(run *w, ep_error *err) {
  ep_state *state = ep_stepper_state(w->bench.stepper);
  const size_t count = ep_state_history_size(state), bytes = count * sizeof(double);
  double *before = malloc(2 * bytes);
  if (!before) return ep_fail(err, EP_ERR_MEMORY, "no memory for a state");
  ep_state_get_history(state, before);
  const ep_status status = ep_step(state, ep_stepper_def(w->bench.stepper), NULL);
  ep_state_get_history(state, before + count);
  if (status != EP_OK && memcmp(before, before + count, bytes) != 0)
    worse(w->result, EP_STRESS_BROKEN, "a failed step changed the state");
  free(before);
  return EP_OK;
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
    return check_refusal(w, err);
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

static json_t *told(const ep_stress_bench *b, const ep_advance *done, int before, int after) {
  return json_pack(
      "{s:s, s:i, s:i, s:i, s:i, s:i, s:o, s:i, s:i}", "scene", b->scene.name, "newton_iterations",
      done->newton_iterations, "line_search_steps", done->line_search_steps, "projections",
      done->projections, "halvings", done->halvings, "unfolded_steps", done->unfolding, "residual",
      ep_json_number(done->last.residual), "inverted_start", before, "inverted_end", after);
}

static ep_status step_again(ep_stress_bench *b, const json_t *root, const char *path, bool json,
                            ep_error *err) {
  if (json_is_true(json_object_get(root, "coasting"))) ep_stepper_def(b->stepper)->strength = 0;
  const int before = ep_stress_inverted(b);
  const double t = json_number_value(json_object_get(root, "t"));
  const bool loaded = json_is_true(json_object_get(root, "loaded"));
  ep_advance done;
  const ep_status status = ep_stepper_advance(b->stepper, t, b->scene.dt, loaded, &done);
  const int after = ep_stress_inverted(b);
  if (status != EP_OK)
    return ep_fail(err, status,
                   "%s: the step fails again, even at 1/%d of the time step: %d Newton iterations, "
                   "%d line-search steps, %d projections in all",
                   path, 1 << EP_HALVINGS_MAX, done.newton_iterations, done.line_search_steps,
                   done.projections);
  if (json) return ep_report_print(told(b, &done, before, after), err);
  printf("step done: %d Newton iterations, %d line-search steps, %d projections, %d halvings, last "
         "residual %.3g, inverted tets %d -> %d%s\n",
         done.newton_iterations, done.line_search_steps, done.projections, done.halvings,
         done.last.residual, before, after, done.unfolding ? ", unfolding" : "");
  return EP_OK;
}

// The state of the file; where the very first step failed it may be left out, and is the case's
// start.
static ep_status put_state(ep_stress_bench *b, const ep_stress_case *c, const json_t *root,
                           const char *path, ep_error *err) {
  const json_t *list = json_object_get(root, "history");
  ep_state *state = ep_stepper_state(b->stepper);
  const size_t needed = ep_state_history_size(state), count = json_array_size(list);
  if (!list && json_integer_value(json_object_get(root, "step")) == 0)
    return ep_stress_begin(b, c, err);
  if (!json_is_array(list) || count != needed)
    return ep_fail(err, EP_ERR_FORMAT,
                   "%s: \"history\" holds %zu numbers, a state of this scene's model has %zu: the "
                   "scene was changed since",
                   path, count, needed);
  double *history = malloc(needed * sizeof *history);
  if (!history) return ep_fail(err, EP_ERR_MEMORY, "no memory for a state");
  for (size_t i = 0; i < needed; i++) {
    const json_t *value = json_array_get(list, i);
    history[i] = json_is_number(value) ? json_number_value(value) : NAN;
  }
  const ep_status status = ep_state_set_history(state, needed, history);
  free(history);
  return status == EP_OK
             ? EP_OK
             : ep_fail(err, EP_ERR_FORMAT,
                       "%s: \"history\" is not the state of a model of this version", path);
}

// Of this version, and whole?
static ep_status check_file(const json_t *root, const char *path, ep_error *err) {
  const json_t *format = json_object_get(root, "format");
  if (!json_is_number(json_object_get(root, "value")) ||
      !json_is_string(json_object_get(root, "axis")))
    return ep_fail(err, EP_ERR_FORMAT, "%s: no failure of a stress test", path);
  if (json_integer_value(format) != EP_STRESS_FORMAT)
    return ep_fail(
        err, EP_ERR_FORMAT,
        "%s: of another version (\"format\" is not %d); run `eigenpose stress` once more", path,
        (int)EP_STRESS_FORMAT);
  static const char *const flags[] = {"loaded", "coasting"};
  for (int i = 0; i < 2; i++)
    if (!json_is_boolean(json_object_get(root, flags[i])))
      return ep_fail(err, EP_ERR_FORMAT, "%s: lacks \"%s\"", path, flags[i]);
  if (!json_is_number(json_object_get(root, "t")) ||
      !json_is_integer(json_object_get(root, "step")))
    return ep_fail(err, EP_ERR_FORMAT, "%s: lacks \"t\" or \"step\"", path);
  return EP_OK;
}

static ep_status replay(const ep_session *base, const json_t *root, const char *path, bool json,
                        ep_error *err) {
  ep_stress_case c = {0};
  EP_TRY(check_file(root, path, err));
  if (!take_case(root, &c))
    return ep_fail(err, EP_ERR_FORMAT, "%s: no case of this version's stress test", path);
  ep_stress_bench bench = {0};
  ep_status status = ep_stress_open(base, &c, &bench, err);
  if (status == EP_OK) status = put_state(&bench, &c, root, path, err);
  if (status == EP_OK) status = step_again(&bench, root, path, json, err);
  ep_stress_close(&bench);
  return status;
}

ep_status ep_stress_replay(const ep_session *base, const char *path, bool json, ep_error *err) {
  json_error_t trouble;
  char *text;
  size_t size;
  EP_TRY(ep_file_read(path, &text, &size, err));
  json_t *root = json_loadb(text, size, 0, &trouble);
  free(text);
  if (!root)
    return ep_fail(err, EP_ERR_FORMAT,
                   "%s:%d: %s; a failure as `eigenpose stress` leaves it is wanted", path,
                   trouble.line, trouble.text);
  const ep_status status = replay(base, root, path, json, err);
  json_decref(root);
  return status;
}
