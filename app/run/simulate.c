#include "app/run/simulate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/stepper.h"

typedef struct simulation {
  const ep_scene *scene;
  const ep_model *model;
  ep_stepper *stepper;
  ep_state *state;    // the stepper's
  ep_advance done;    // the last step
  double *x;          // (n x 3) positions of the state
  double *descriptor; // (3m) of the state, NULL where no weights are noted
  ep_record *record;
} simulation;

static ep_status make_record(const ep_scene *scene, const ep_model *model, ep_record *out,
                             ep_error *err) {
  const size_t rows = (size_t)scene->steps + 1, r = (size_t)model->size.r;
  const size_t shapes = (size_t)(model->size.k + ep_model_regions(model));
  memset(out, 0, sizeof *out);
  out->time = calloc(rows, sizeof *out->time);
  out->q = calloc(rows * r, sizeof *out->q);
  out->velocity = calloc(rows * r, sizeof *out->velocity);
  out->energy = calloc(rows, sizeof *out->energy);
  out->step_ms = calloc(rows, sizeof *out->step_ms);
  out->target_ms = calloc(rows, sizeof *out->target_ms);
  const bool rigid = model->size.rigid;
  if (rigid) {
    out->frame = calloc(rows, sizeof *out->frame);
    out->momentum = calloc(6 * rows, sizeof *out->momentum);
  }
  const bool lb = model->size.k && model->size.m, green = model->size.greens > 0;
  if (lb) out->weights = calloc(rows * shapes, sizeof *out->weights);
  if (green) out->green_weights = calloc(rows * (size_t)model->size.k, sizeof *out->green_weights);
  if (scene->nobstacles) out->contact = calloc(rows * EP_CONTACT_COLUMNS, sizeof *out->contact);
  const bool good = (out->contact || !scene->nobstacles) && out->time && out->q && out->velocity &&
                    out->energy && out->step_ms && out->target_ms && (out->weights || !lb) &&
                    (out->green_weights || !green) && ((out->frame && out->momentum) || !rigid);
  if (good) return EP_OK;
  ep_record_free(out);
  return ep_fail(err, EP_ERR_MEMORY, "no memory for %d steps of %d modes", scene->steps,
                 model->size.r);
}

// Weights of the shape at hand, also where the examples have no force (strength 0).
static ep_status note_weights(simulation *s, double *out, ep_error *err) {
  ep_descriptor(s->model, ep_state_q(s->state), s->descriptor);
  const ep_status status = ep_example_weights(s->state, s->descriptor, out);
  if (status == EP_OK) return EP_OK;
  return ep_fail(
      err, status,
      "step %d (t = %.4g s) is done, but its shape has no weights of the examples: it is "
      "deformed too far; weaken the loads or take a smaller simulation.dt. What was "
      "simulated before it is kept",
      s->record->rows, s->record->rows * s->scene->dt);
}

// Note the state after a step: trajectory, weights, inverted tets.
static ep_status note(simulation *s, const ep_mesh *mesh, ep_error *err) {
  ep_record *record = s->record;
  const size_t row = (size_t)record->rows, r = (size_t)s->model->size.r;
  memcpy(record->q + row * r, ep_state_q(s->state), r * sizeof *record->q);
  memcpy(record->velocity + row * r, ep_state_velocity(s->state), r * sizeof *record->velocity);
  record->energy[row] = s->done.last.elastic_energy + s->done.last.kinetic_energy;
  if (record->frame) {
    record->frame[row] = *ep_state_frame(s->state);
    ep_state_momentum(s->state, record->momentum + 6 * row, record->momentum + 6 * row + 3);
  }
  if (record->contact) {
    double *to = record->contact + row * EP_CONTACT_COLUMNS;
    const ep_contact_report *contact = &s->done.last.contact;
    to[EP_CONTACT_TOUCHING] = contact->touching;
    to[EP_CONTACT_DEEPEST] = contact->deepest;
    memcpy(to + EP_CONTACT_FORCE, contact->force, sizeof contact->force);
  }
  if (record->weights) {
    const size_t shapes = (size_t)(s->model->size.k + ep_model_regions(s->model));
    EP_TRY(note_weights(s, record->weights + row * shapes, err));
  }
  if (record->green_weights) {
    const size_t k = (size_t)s->model->size.k;
    ep_green_energy(s->state, &s->scene->green, ep_state_q(s->state), NULL, NULL);
    memcpy(record->green_weights + row * k, ep_state_green_weights(s->state),
           k * sizeof *record->green_weights);
  }
  ep_positions(s->model, ep_state_q(s->state), s->x);
  const int inverted = ep_mesh_inverted(mesh, s->x, NULL);
  if (inverted > record->max_inverted) record->max_inverted = inverted;
  record->rows++;
  return EP_OK;
}

static void add_up(ep_record *record, const ep_advance *done) {
  record->newton_iterations += done->newton_iterations;
  record->halvings += done->halvings;
  record->unfolded += done->unfolding > 0;
  record->target_evaluations += (int)done->evaluations;
  record->deepest = fmax(record->deepest, done->deepest);
  if (done->touching > record->most_touching) record->most_touching = done->touching;
}

static ep_status step_failed(const simulation *s, ep_status status, ep_error *err) {
  const int step = s->record->rows;
  if (status == EP_ERR_NUMERIC)
    return ep_fail(err, status,
                   "step %d (t = %.4g s) failed even at 1/%d of the time step; weaken the loads, "
                   "take a smaller simulation.dt or more damping. What was simulated is kept",
                   step, step * s->scene->dt, 1 << EP_HALVINGS_MAX);
  if (status == EP_ERR_MEMORY)
    return ep_fail(err, status, "step %d: no memory. What was simulated is kept", step);
  return ep_fail(err, status,
                 "step %d: the run time cannot do what the scene asks for; this should have been "
                 "refused before: please report it with the scene",
                 step);
}

static ep_status one_step(simulation *s, const ep_mesh *mesh, ep_error *err) {
  const int step = s->record->rows - 1;
  const double dt = s->scene->dt;
  const ep_status status = ep_stepper_advance(s->stepper, step * dt, dt, true, &s->done);
  add_up(s->record, &s->done);
  if (status != EP_OK) return step_failed(s, status, err);
  s->record->step_ms[step] = 1e3 * s->done.seconds;
  s->record->target_ms[step] = 1e3 * s->done.target_seconds;
  s->record->time[step + 1] = (step + 1) * dt;
  return note(s, mesh, err);
}

static ep_status run_steps(simulation *s, const ep_mesh *mesh, ep_log *log, ep_error *err) {
  s->x = malloc(3 * (size_t)mesh->nv * sizeof *s->x);
  if (s->record->weights) s->descriptor = malloc(3 * (size_t)s->model->size.m * sizeof *s->x);
  ep_status status = s->x && (s->descriptor || !s->record->weights)
                         ? EP_OK
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for positions");
  ep_progress_begin(log, "simulation", s->scene->steps);
  if (status == EP_OK) status = note(s, mesh, err);
  while (status == EP_OK && s->record->rows <= s->scene->steps) {
    status = one_step(s, mesh, err);
    ep_progress(log, s->record->rows - 1);
  }
  ep_progress_end(log);
  free(s->x);
  free(s->descriptor);
  return status;
}

ep_status ep_simulate(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                      const char *kernels, ep_log *log, ep_record *out, ep_error *err) {
  simulation s = {.scene = scene, .model = model, .record = out};
  EP_TRY(make_record(scene, model, out, err));
  EP_TRY(ep_stepper_open(scene, shapes, model, &s.stepper, err));
  s.state = ep_stepper_state(s.stepper);
  ep_status status = kernels ? ep_state_use_isa(s.state, kernels) : EP_OK;
  if (status != EP_OK) ep_fail(err, status, "there are no kernels '%s' here", kernels);
  out->isa = ep_state_isa(s.state);
  if (status == EP_OK) status = run_steps(&s, &shapes->shape[0].mesh, log, err);
  ep_stepper_close(s.stepper);
  return status;
}

void ep_place(const ep_model *model, const ep_frame *frame, double *x) {
  const double *c = frame->c, *R = frame->R;
  for (size_t v = 0; v < (size_t)model->size.n; v++) {
    double y[3];
    for (size_t i = 0; i < 3; i++) y[i] = x[3 * v + i] - model->rigid_origin[i];
    for (size_t i = 0; i < 3; i++)
      x[3 * v + i] = c[i] + R[3 * i] * y[0] + R[3 * i + 1] * y[1] + R[3 * i + 2] * y[2];
  }
}

void ep_record_positions(const ep_model *model, const ep_record *record, int row, double *x) {
  ep_positions(model, record->q + (size_t)row * (size_t)model->size.r, x);
  if (record->frame) ep_place(model, &record->frame[row], x);
}

void ep_record_free(ep_record *record) {
  free(record->time);
  free(record->q);
  free(record->velocity);
  free(record->frame);
  free(record->momentum);
  free(record->energy);
  free(record->weights);
  free(record->green_weights);
  free(record->contact);
  free(record->step_ms);
  free(record->target_ms);
  memset(record, 0, sizeof *record);
}

static int ascending(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

double ep_median(int count, const double *value) {
  if (count <= 0) return 0;
  double *sorted = malloc((size_t)count * sizeof *sorted);
  if (!sorted) return NAN;
  memcpy(sorted, value, (size_t)count * sizeof *sorted);
  qsort(sorted, (size_t)count, sizeof *sorted, ascending);
  const double median = 0.5 * (sorted[(count - 1) / 2] + sorted[count / 2]);
  free(sorted);
  return median;
}

double ep_example_fraction(const ep_model *model, const double *q, int example) {
  const double *e = model->example_q + (size_t)example * (size_t)model->size.r;
  double along = 0, whole = 0;
  for (int a = 0; a < model->size.r; a++) {
    along += q[a] * e[a];
    whole += e[a] * e[a];
  }
  return whole > 0 ? along / whole : NAN;
}
