#include "app/run/stepper.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/run/drags.h"
#include "app/run/free_object.h"
#include "app/run/pressures.h"
#include "app/scene/obstacles.h"
#include "reduced/bake/nlopt_target.h"

// The scene's interpolation solver with a clock around it.
typedef struct timed_solver {
  ep_target_solver solve;
  void *user;
  double seconds;
  long evaluations;
} timed_solver;

struct ep_stepper {
  const ep_scene *scene;
  const ep_model *model;
  void *memory; // of the state
  ep_state *state;
  ep_step_def def;
  ep_nlopt_target *nlopt; // NULL: Newton
  timed_solver solver;
  double gravity[3]; // of all the scene's loads
  double *load;      // (nloads x r) generalised force at full strength; of gravity 0: def has it
  double *region_strength; // (regions) of a model with regions; NULL
  double *force;           // (r) of the step at hand
  ep_free_loads free;      // loads of a free object, instead of `load` and `force`
  ep_pressures pressures;  // forces that follow the surface
  ep_springs drags;        // of the step at hand
  ep_obstacle *obstacle;   // (nobstacles) where they are in the step at hand
};

static ep_status timed_solve(void *user, ep_state *state, const double *w, double *q,
                             double tolerance, ep_target_report *report) {
  timed_solver *timed = user;
  const double started = ep_seconds();
  const ep_status status = timed->solve(timed->user, state, w, q, tolerance, report);
  timed->seconds += ep_seconds() - started;
  timed->evaluations += report ? report->evaluations : 0;
  return status;
}

static ep_status make_loads(ep_stepper *s, const ep_shapes *shapes, ep_error *err) {
  const size_t r = (size_t)s->model->size.r, count = (size_t)s->scene->nloads;
  for (size_t i = 0; i < 3 * count; i++)
    if (s->scene->load[i / 3].gravity) s->gravity[i % 3] += s->scene->load[i / 3].vector[i % 3];
  if (s->model->size.rigid) return ep_free_loads_make(s->scene, shapes, s->model, &s->free, err);
  double *mass = malloc((size_t)s->model->size.n * sizeof *mass);
  s->load = calloc(count * r + 1, sizeof *s->load);
  s->force = calloc(r, sizeof *s->force);
  ep_status status = EP_OK;
  if (!mass || !s->load || !s->force)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for the loads");
  if (status == EP_OK) ep_shapes_vertex_mass(shapes, mass);
  for (size_t i = 0; i < count && status == EP_OK; i++)
    if (!s->scene->load[i].gravity)
      status = ep_load_project(&s->scene->load[i], shapes, s->model, mass, s->load + i * r, err);
  free(mass);
  return status;
}

static void set_force(ep_stepper *s, double t, bool loads) {
  const int r = s->model->size.r;
  if (s->force) memset(s->force, 0, (size_t)r * sizeof *s->force);
  for (int i = 0; i < 3; i++) s->def.gravity[i] = loads ? s->gravity[i] : 0;
  if (loads) ep_pressures_add(s->scene, &s->pressures, t, ep_state_q(s->state), s->force);
  if (s->model->size.rigid) {
    ep_free_loads_set(s->scene, &s->free, t, loads, &s->def);
    return;
  }
  for (int i = 0; i < s->scene->nloads && loads; i++) {
    const double strength = ep_load_profile(&s->scene->load[i], t);
    for (int a = 0; a < r; a++) s->force[a] += strength * s->load[i * r + a];
  }
}

static ep_status make_obstacles(ep_stepper *s, ep_error *err) {
  const ep_scene *scene = s->scene;
  s->obstacle = calloc((size_t)scene->nobstacles + 1, sizeof *s->obstacle);
  if (!s->obstacle) return ep_fail(err, EP_ERR_MEMORY, "no memory for the obstacles");
  ep_obstacles_make(scene, s->model->rest_scale, s->obstacle);
  s->def.obstacle = s->obstacle;
  s->def.obstacles = scene->nobstacles;
  s->def.contact = scene->contact;
  return EP_OK;
}

static ep_status read_strengths(ep_stepper *s, const ep_shapes *shapes, ep_error *err) {
  if (!s->model->size.regions) return EP_OK;
  s->region_strength = malloc((size_t)shapes->sets * sizeof *s->region_strength);
  if (!s->region_strength) return ep_fail(err, EP_ERR_MEMORY, "no memory for the regions");
  for (int i = 0; i < shapes->sets; i++)
    s->region_strength[i] = shapes->set[i] < 0 ? 1 : s->scene->region[shapes->set[i]].strength;
  return EP_OK;
}

static void set_up_step(ep_stepper *s) {
  const ep_scene *scene = s->scene;
  s->def = ep_default_step();
  s->def.integrator = scene->integrator;
  s->def.force = s->force; // NULL for a free object
  s->def.damping_mass = scene->damping_mass;
  s->def.damping_stiffness = scene->damping_stiffness;
  s->def.relief = scene->relief;
  s->def.strength = s->model->size.k && (scene->methods & EP_METHOD_LB) ? scene->strength : 0;
  s->def.green = scene->green;
  s->def.region_strength = s->region_strength;
  s->def.example_force = scene->force;
  s->solver.solve = s->nlopt ? ep_nlopt_target_solve : ep_target_newton;
  s->solver.user = s->nlopt;
  s->def.target_solver = timed_solve;
  s->def.target_user = &s->solver;
}

static ep_status make_state(ep_stepper *s, ep_error *err) {
  const size_t bytes = (ep_state_bytes(s->model) + 63) / 64 * 64;
  s->memory = aligned_alloc(64, bytes);
  if (!s->memory) return ep_fail(err, EP_ERR_MEMORY, "no memory for a state (%zu bytes)", bytes);
  const ep_status status = ep_state_init(s->model, s->memory, bytes, &s->state);
  return status == EP_OK ? EP_OK : ep_fail(err, status, "cannot set up a state of the model");
}

static ep_status set_up(ep_stepper *s, const ep_shapes *shapes, ep_error *err) {
  EP_TRY(make_state(s, err));
  if (s->model->size.rigid) EP_TRY(ep_free_start(s->scene, s->state, err));
  EP_TRY(make_loads(s, shapes, err));
  if (s->model->size.k && s->model->size.m && s->scene->solver == EP_SOLVER_NLOPT)
    EP_TRY(ep_nlopt_target_create(s->state, s->scene->algorithm, 0, &s->nlopt, err));
  EP_TRY(read_strengths(s, shapes, err));
  set_up_step(s);
  EP_TRY(ep_pressures_make(s->scene, shapes, s->model, &s->pressures, err));
  if (s->pressures.count && !s->force) { // of a free object: it turns with it
    s->force = calloc((size_t)s->model->size.r, sizeof *s->force);
    if (!s->force) return ep_fail(err, EP_ERR_MEMORY, "no memory for the pressure");
    s->def.force = s->force;
  }
  EP_TRY(ep_drags_make(s->scene, shapes, s->model, &s->drags, err));
  if (s->drags.count) {
    s->def.outer = ep_springs_energy;
    s->def.outer_user = &s->drags;
  }
  return make_obstacles(s, err);
}

ep_status ep_stepper_open(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                          ep_stepper **out, ep_error *err) {
  ep_stepper *s = *out = calloc(1, sizeof *s);
  if (!s) return ep_fail(err, EP_ERR_MEMORY, "no memory for a simulation");
  s->scene = scene;
  s->model = model;
  const ep_status status = set_up(s, shapes, err);
  if (status == EP_OK) return EP_OK;
  ep_stepper_close(s);
  *out = NULL;
  return status;
}

void ep_stepper_close(ep_stepper *s) {
  if (!s) return;
  ep_nlopt_target_free(s->nlopt);
  ep_free_loads_free(&s->free);
  ep_drags_free(&s->drags);
  ep_pressures_free(&s->pressures);
  free(s->load);
  free(s->force);
  free(s->region_strength);
  free(s->obstacle);
  free(s->memory);
  free(s);
}

ep_state *ep_stepper_state(ep_stepper *s) {
  return s->state;
}

ep_step_def *ep_stepper_def(ep_stepper *s) {
  return &s->def;
}

// ---- steps -------------------------------------------------------------------------------------

static void add_step(const ep_step_report *report, ep_status status, ep_advance *out) {
  out->newton_iterations += report->newton_iterations;
  out->line_search_steps += report->line_search_steps;
  out->projections += report->projections;
  if (status != EP_OK) return;
  const ep_contact_report *contact = &report->contact;
  out->last = *report;
  out->unfolding += report->unfolding;
  out->deepest = fmax(out->deepest, contact->deepest);
  if (contact->touching > out->touching) out->touching = contact->touching;
}

static ep_status advance(ep_stepper *s, double t, double dt, bool loads, int level,
                         ep_advance *out) {
  ep_step_report report = {0};
  s->def.dt = dt;
  set_force(s, t + dt, loads);
  ep_obstacles_move(s->scene, t, t + dt, s->obstacle);
  ep_drags_set(s->scene, s->state, t, dt, loads, &s->drags);
  const ep_status status = ep_step(s->state, &s->def, &report);
  add_step(&report, status, out);
  if (status != EP_ERR_NUMERIC || level == EP_HALVINGS_MAX) return status;
  out->halvings++;
  const ep_status first = advance(s, t, dt / 2, loads, level + 1, out);
  return first != EP_OK ? first : advance(s, t + dt / 2, dt / 2, loads, level + 1, out);
}

ep_status ep_stepper_advance(ep_stepper *s, double t, double dt, bool loads, ep_advance *out) {
  const double started = ep_seconds();
  *out = (ep_advance){0};
  s->solver.seconds = 0;
  s->solver.evaluations = 0;
  const ep_status status = advance(s, t, dt, loads, 0, out);
  out->seconds = ep_seconds() - started;
  out->target_seconds = s->solver.seconds;
  out->evaluations = s->solver.evaluations;
  return status;
}
