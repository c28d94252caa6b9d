#include "app/simulate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/obstacles.h"
#include "app/select.h"
#include "reduced/bake/nlopt_target.h"

enum { HALVINGS_MAX = 6 };

// The scene's interpolation solver with a clock around it.
typedef struct timed_solver {
  ep_target_solver solve;
  void *user;
  double seconds;
  long evaluations;
} timed_solver;

typedef struct simulation {
  const ep_scene *scene;
  const ep_model *model;
  ep_state *state;
  ep_step_def def;
  timed_solver solver;
  double *load;            // (nloads x r) generalised force at full strength
  double *force;           // (r) of the step at hand
  ep_obstacle *obstacle;   // (nobstacles) where they are in the step at hand
  double elastic, kinetic; // of the last step
  ep_contact_report contact;
  ep_record *record;
} simulation;

static ep_status timed_solve(void *user, ep_state *state, const double *w, double *q,
                             double tolerance, ep_target_report *report) {
  timed_solver *timed = user;
  const double started = ep_seconds();
  const ep_status status = timed->solve(timed->user, state, w, q, tolerance, report);
  timed->seconds += ep_seconds() - started;
  timed->evaluations += report ? report->evaluations : 0;
  return status;
}

double ep_load_profile(const ep_load *load, double t) {
  if (load->gravity) return 1;
  if (t < load->from || t > load->until) return 0;
  if (load->ramp <= 0) return 1;
  return fmin(1, fmin((t - load->from) / load->ramp, (load->until - t) / load->ramp));
}

ep_status ep_load_forces(const ep_load *load, const ep_mesh *mesh, const double *mass, double *out,
                         ep_error *err) {
  const size_t n = (size_t)mesh->nv;
  unsigned char *chosen = calloc(n, 1);
  if (!chosen) return ep_fail(err, EP_ERR_MEMORY, "no memory for the loads");
  ep_status status = EP_OK;
  double total = 1; // gravity acts on each vertex with its own mass
  if (load->gravity) {
    memset(chosen, 1, n);
  } else {
    int count;
    status = ep_select_vertices(&load->where, mesh, chosen, &count, err);
    total = 0;
    for (size_t v = 0; v < n; v++) total += chosen[v] ? mass[v] : 0;
  }
  for (size_t i = 0; i < 3 * n; i++)
    out[i] = status == EP_OK && chosen[i / 3] ? mass[i / 3] / total * load->vector[i % 3] : 0;
  free(chosen);
  return status;
}

// U^T of a load's nodal forces into out (r).
static ep_status project_load(const ep_load *load, const ep_shapes *shapes, const ep_model *model,
                              const double *mass, double *out, ep_error *err) {
  const size_t n3 = 3 * (size_t)model->size.n;
  double *forces = malloc(n3 * sizeof *forces);
  if (!forces) return ep_fail(err, EP_ERR_MEMORY, "no memory for the loads");
  const ep_status status = ep_load_forces(load, &shapes->shape[0].mesh, mass, forces, err);
  for (int a = 0; a < model->size.r && status == EP_OK; a++) {
    out[a] = 0;
    for (size_t i = 0; i < n3; i++) out[a] += model->u[(size_t)a * n3 + i] * forces[i];
  }
  free(forces);
  return status;
}

static ep_status make_loads(simulation *s, const ep_shapes *shapes, ep_error *err) {
  const size_t r = (size_t)s->model->size.r, count = (size_t)s->scene->nloads;
  double *mass = malloc((size_t)s->model->size.n * sizeof *mass);
  s->load = calloc(count * r + 1, sizeof *s->load);
  s->force = calloc(r, sizeof *s->force);
  ep_status status = EP_OK;
  if (!mass || !s->load || !s->force)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for the loads");
  if (status == EP_OK) ep_shapes_vertex_mass(shapes, mass);
  for (size_t i = 0; i < count && status == EP_OK; i++)
    status = project_load(&s->scene->load[i], shapes, s->model, mass, s->load + i * r, err);
  free(mass);
  return status;
}

static void set_force(simulation *s, double t) {
  const int r = s->model->size.r;
  memset(s->force, 0, (size_t)r * sizeof *s->force);
  for (int i = 0; i < s->scene->nloads; i++) {
    const double strength = ep_load_profile(&s->scene->load[i], t);
    for (int a = 0; a < r; a++) s->force[a] += strength * s->load[i * r + a];
  }
}

static void note_contact(simulation *s, const ep_contact_report *contact) {
  ep_record *record = s->record;
  s->contact = *contact;
  record->deepest = fmax(record->deepest, contact->deepest);
  record->most_raised = fmax(record->most_raised, contact->raised);
  record->injected += contact->injected;
  if (contact->touching > record->most_touching) record->most_touching = contact->touching;
}

// Advance by dt from time t; a failed step is done in two halves, down to 2^-6 of the step.
static ep_status advance(simulation *s, double t, double dt, int level) {
  ep_step_report report = {0};
  s->def.dt = dt;
  set_force(s, t + dt);
  ep_obstacles_move(s->scene, t, t + dt, s->obstacle);
  const ep_status status = ep_step(s->state, &s->def, &report);
  s->record->newton_iterations += report.newton_iterations;
  s->elastic = report.elastic_energy;
  s->kinetic = report.kinetic_energy;
  if (status == EP_OK) note_contact(s, &report.contact);
  if (status != EP_ERR_NUMERIC || level == HALVINGS_MAX) return status;
  s->record->halvings++;
  const ep_status first = advance(s, t, dt / 2, level + 1);
  return first != EP_OK ? first : advance(s, t + dt / 2, dt / 2, level + 1);
}

static ep_status make_record(const ep_scene *scene, const ep_model *model, ep_record *out,
                             ep_error *err) {
  const size_t rows = (size_t)scene->steps + 1, r = (size_t)model->size.r;
  const size_t shapes = (size_t)model->size.k + 1;
  memset(out, 0, sizeof *out);
  out->time = calloc(rows, sizeof *out->time);
  out->q = calloc(rows * r, sizeof *out->q);
  out->velocity = calloc(rows * r, sizeof *out->velocity);
  out->energy = calloc(rows, sizeof *out->energy);
  out->step_ms = calloc(rows, sizeof *out->step_ms);
  out->target_ms = calloc(rows, sizeof *out->target_ms);
  const bool lb = model->size.k && model->size.m, green = model->size.greens > 0;
  if (lb) out->weights = calloc(rows * shapes, sizeof *out->weights);
  if (green) out->green_weights = calloc(rows * shapes, sizeof *out->green_weights);
  if (scene->nobstacles) out->contact = calloc(rows * EP_CONTACT_COLUMNS, sizeof *out->contact);
  const bool good = (out->contact || !scene->nobstacles) && out->time && out->q && out->velocity &&
                    out->energy && out->step_ms && out->target_ms && (out->weights || !lb) &&
                    (out->green_weights || !green);
  if (good) return EP_OK;
  ep_record_free(out);
  return ep_fail(err, EP_ERR_MEMORY, "no memory for %d steps of %d modes", scene->steps,
                 model->size.r);
}

// Weights of the shape at hand, also where the examples have no force (strength 0).
static ep_status note_weights(simulation *s, double *out) {
  const ep_model *model = s->model;
  double *c = malloc(3 * (size_t)model->size.m * sizeof *c);
  if (!c) return EP_ERR_MEMORY;
  ep_descriptor(model, ep_state_q(s->state), c);
  const ep_status status = ep_example_weights(s->state, c, out);
  free(c);
  return status;
}

// Note the state after a step: trajectory, weights, inverted tets.
static ep_status note(simulation *s, const ep_mesh *mesh, double *x) {
  ep_record *record = s->record;
  const size_t row = (size_t)record->rows, r = (size_t)s->model->size.r;
  memcpy(record->q + row * r, ep_state_q(s->state), r * sizeof *record->q);
  memcpy(record->velocity + row * r, ep_state_velocity(s->state), r * sizeof *record->velocity);
  record->energy[row] = s->elastic + s->kinetic;
  if (record->contact) {
    double *to = record->contact + row * EP_CONTACT_COLUMNS;
    to[EP_CONTACT_TOUCHING] = s->contact.touching;
    to[EP_CONTACT_DEEPEST] = s->contact.deepest;
    memcpy(to + EP_CONTACT_FORCE, s->contact.force, sizeof s->contact.force);
  }
  if (record->weights) {
    const ep_status status =
        note_weights(s, record->weights + row * (size_t)(s->model->size.k + 1));
    if (status != EP_OK) return status;
  }
  if (record->green_weights) {
    const size_t k = (size_t)s->model->size.k;
    ep_green_energy(s->state, &s->scene->green, ep_state_q(s->state), NULL, NULL);
    memcpy(record->green_weights + row * k, ep_state_green_weights(s->state),
           k * sizeof *record->green_weights);
  }
  ep_positions(s->model, ep_state_q(s->state), x);
  const int inverted = ep_mesh_inverted(mesh, x, NULL);
  if (inverted > record->max_inverted) record->max_inverted = inverted;
  record->rows++;
  return EP_OK;
}

static ep_status one_step(simulation *s, const ep_mesh *mesh, double *x) {
  const int step = s->record->rows - 1;
  const double dt = s->scene->dt, started = ep_seconds();
  s->solver.seconds = 0;
  EP_TRY(advance(s, step * dt, dt, 0));
  s->record->step_ms[step] = 1e3 * (ep_seconds() - started);
  s->record->target_ms[step] = 1e3 * s->solver.seconds;
  s->record->time[step + 1] = (step + 1) * dt;
  return note(s, mesh, x);
}

static ep_status run_steps(simulation *s, const ep_mesh *mesh, ep_log *log, ep_error *err) {
  double *x = malloc(3 * (size_t)mesh->nv * sizeof *x);
  if (!x) return ep_fail(err, EP_ERR_MEMORY, "no memory for positions");
  ep_progress_begin(log, "simulation", s->scene->steps);
  ep_status status = note(s, mesh, x);
  while (status == EP_OK && s->record->rows <= s->scene->steps) {
    status = one_step(s, mesh, x);
    ep_progress(log, s->record->rows - 1);
  }
  ep_progress_end(log);
  free(x);
  if (status == EP_OK) return EP_OK;
  return ep_fail(err, status,
                 "step %d (t = %.4g s) failed even at 1/%d of the time step; weaken the loads, "
                 "take a smaller simulation.dt or more damping. What was simulated is kept",
                 s->record->rows, s->record->rows * s->scene->dt, 1 << HALVINGS_MAX);
}

static ep_status make_obstacles(simulation *s, ep_error *err) {
  const ep_scene *scene = s->scene;
  s->obstacle = calloc((size_t)scene->nobstacles + 1, sizeof *s->obstacle);
  if (!s->obstacle) return ep_fail(err, EP_ERR_MEMORY, "no memory for the obstacles");
  ep_obstacles_make(scene, s->model->rest_scale, s->obstacle);
  s->def.obstacle = s->obstacle;
  s->def.obstacles = scene->nobstacles;
  s->def.contact = scene->contact;
  return EP_OK;
}

static void set_up_step(simulation *s, ep_nlopt_target *nlopt) {
  const ep_scene *scene = s->scene;
  s->def = ep_default_step();
  s->def.integrator = scene->integrator;
  s->def.force = s->force;
  s->def.damping_mass = scene->damping_mass;
  s->def.damping_stiffness = scene->damping_stiffness;
  s->def.relief = scene->relief;
  s->def.strength = s->model->size.k && (scene->methods & EP_METHOD_LB) ? scene->strength : 0;
  s->def.green = scene->green;
  s->def.example_force = scene->force;
  s->solver.solve = nlopt ? ep_nlopt_target_solve : ep_target_newton;
  s->solver.user = nlopt;
  s->def.target_solver = timed_solve;
  s->def.target_user = &s->solver;
}

ep_status ep_simulate(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                      ep_log *log, ep_record *out, ep_error *err) {
  simulation s = {.scene = scene, .model = model, .record = out};
  ep_nlopt_target *nlopt = NULL;
  EP_TRY(make_record(scene, model, out, err));
  const size_t bytes = (ep_state_bytes(model) + 63) / 64 * 64;
  void *memory = aligned_alloc(64, bytes);
  ep_status status =
      memory ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for a state (%zu bytes)", bytes);
  if (status == EP_OK) {
    status = ep_state_init(model, memory, bytes, &s.state);
    if (status != EP_OK) ep_fail(err, status, "cannot set up a state of the model");
  }
  if (status == EP_OK) status = make_loads(&s, shapes, err);
  if (status == EP_OK && model->size.k && model->size.m && scene->solver == EP_SOLVER_NLOPT)
    status = ep_nlopt_target_create(s.state, scene->algorithm, 0, &nlopt, err);
  if (status == EP_OK) {
    set_up_step(&s, nlopt);
    status = make_obstacles(&s, err);
  }
  if (status == EP_OK) {
    status = run_steps(&s, &shapes->shape[0].mesh, log, err);
  }
  out->target_evaluations = (int)s.solver.evaluations;
  ep_nlopt_target_free(nlopt);
  free(s.load);
  free(s.force);
  free(s.obstacle);
  free(memory);
  return status;
}

void ep_record_free(ep_record *record) {
  free(record->time);
  free(record->q);
  free(record->velocity);
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
  double *sorted = count > 0 ? malloc((size_t)count * sizeof *sorted) : NULL;
  if (!sorted) return 0;
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
