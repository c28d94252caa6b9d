// A case of a stress test: its scene baked, its state put where it starts.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/bake/bake.h"
#include "app/stress/stress.h"
#include "base/random.h"

// Largest speed an impulse of 1 gives [extents a second]; amplitude of a random start and
// distance of a far one [extents].
static const double kick = 0.1, random_amplitude = 0.5, far_away = 3;

static ep_status bake(const ep_session *base, ep_stress_bench *b, ep_error *err) {
  ep_bake bake;
  ep_log quiet = base->log;
  char path[EP_PATH_MAX];
  quiet.quiet = true;
  EP_TRY(ep_bake_open(&b->scene, &b->shapes, &b->plan, &base->cache, &quiet, &bake, err));
  bake.petsc = true; // started by the command
  ep_status status = ep_bake_model(&bake, path, err);
  bake.petsc = false;
  ep_bake_close(&bake);
  return status == EP_OK ? ep_model_file_open(path, &b->model, err) : status;
}

ep_status ep_stress_open(const ep_session *base, const ep_stress_case *c, ep_stress_bench *out,
                         ep_error *err) {
  *out = (ep_stress_bench){.scene = base->scene};
  const size_t loads = (size_t)base->scene.nloads;
  out->load = malloc((loads + 1) * sizeof *out->load);
  if (!out->load) return ep_fail(err, EP_ERR_MEMORY, "no memory for loads");
  if (loads) memcpy(out->load, base->scene.load, loads * sizeof *out->load);
  out->scene.load = out->load;
  ep_stress_apply(c, &out->scene);
  EP_TRY(ep_shapes_read(&out->scene, NULL, &out->shapes, err));
  EP_TRY(ep_plan_make(&out->scene, &out->shapes, &out->plan, err));
  EP_TRY(bake(base, out, err));
  out->x = malloc(3 * (size_t)out->model.model.size.n * sizeof *out->x);
  if (!out->x) return ep_fail(err, EP_ERR_MEMORY, "no memory for positions");
  return ep_stepper_open(&out->scene, &out->shapes, &out->model.model, &out->stepper, err);
}

void ep_stress_close(ep_stress_bench *b) {
  ep_stepper_close(b->stepper);
  free(b->x);
  ep_model_file_close(&b->model);
  ep_plan_free(&b->plan);
  ep_shapes_free(&b->shapes);
  free(b->load);
}

int ep_stress_inverted(ep_stress_bench *b) {
  ep_positions(&b->model.model, ep_state_q(ep_stepper_state(b->stepper)), b->x);
  for (size_t i = 0; i < 3 * (size_t)b->model.model.size.n; i++)
    if (!isfinite(b->x[i])) return -1;
  return ep_mesh_inverted(&b->shapes.shape[0].mesh, b->x, NULL);
}

// ---- starts ------------------------------------------------------------------------------------

// q = U^T M u with lumped masses: the displacement u (n x 3) as far as the modes can show it.
static ep_status project(const ep_stress_bench *b, const double *u, double *q, ep_error *err) {
  const ep_model *model = &b->model.model;
  const size_t n = (size_t)model->size.n;
  double *mass = malloc(n * sizeof *mass);
  if (!mass) return ep_fail(err, EP_ERR_MEMORY, "no memory for masses");
  ep_shapes_vertex_mass(&b->shapes, mass);
  for (int a = 0; a < model->size.r; a++) {
    const double *mode = model->u + (size_t)a * 3 * n;
    q[a] = 0;
    for (size_t i = 0; i < 3 * n; i++) q[a] += mass[i / 3] * mode[i] * u[i];
  }
  free(mass);
  return EP_OK;
}

// Displacements that carry the object into a mirror image, a point or a plane.
static void collapse(ep_stress_start start, const ep_mesh *mesh, double *u) {
  double low[3], high[3], centre[3];
  int longest = 0;
  ep_mesh_bounds(mesh, low, high);
  for (int c = 0; c < 3; c++) {
    centre[c] = 0.5 * (low[c] + high[c]);
    if (high[c] - low[c] > high[longest] - low[longest]) longest = c;
  }
  for (int v = 0; v < mesh->nv; v++)
    for (int c = 0; c < 3; c++) {
      const double d = mesh->x[3 * v + c] - centre[c];
      const bool moves = start == EP_START_POINT || c == longest;
      u[3 * v + c] = moves ? -(start == EP_START_INVERTED ? 2 : 1) * d : 0;
    }
}

// Largest move of a vertex for q [length].
static double reach(const ep_stress_bench *b, const double *q) {
  const ep_model *model = &b->model.model;
  double largest = 0;
  ep_positions(model, q, b->x);
  const double *rest = b->shapes.shape[0].mesh.x;
  for (size_t v = 0; v < (size_t)model->size.n; v++) {
    double square = 0;
    for (size_t c = 0; c < 3; c++) square += pow(b->x[3 * v + c] - rest[3 * v + c], 2);
    largest = fmax(largest, square);
  }
  return sqrt(largest);
}

static void scale_to(const ep_stress_bench *b, double length, double *q) {
  const double now = reach(b, q);
  for (int a = 0; a < b->model.model.size.r && now > 0; a++) q[a] *= length / now;
}

static void draw(const ep_stress_bench *b, double *q) {
  ep_random random = ep_random_seed(b->scene.seed, 17);
  for (int a = 0; a < b->model.model.size.r; a++) q[a] = ep_random_normal(&random);
}

static ep_status put_far(ep_stress_bench *b, double *q, ep_error *err) {
  ep_state *state = ep_stepper_state(b->stepper);
  const double distance = far_away * b->model.model.rest_scale;
  if (b->model.model.size.rigid) {
    ep_frame frame = *ep_state_frame(state);
    frame.c[0] += distance;
    return ep_state_set_frame(state, &frame) == EP_OK
               ? EP_OK
               : ep_fail(err, EP_ERR_NUMERIC, "the object cannot be put elsewhere");
  }
  q[0] = 1;
  scale_to(b, distance, q);
  return EP_OK;
}

static ep_status start_at(ep_stress_bench *b, ep_stress_start start, double *q, ep_error *err) {
  if (start == EP_START_FAR) return put_far(b, q, err);
  if (start == EP_START_RANDOM) {
    draw(b, q);
    scale_to(b, random_amplitude * b->model.model.rest_scale, q);
    return EP_OK;
  }
  double *u = malloc(3 * (size_t)b->model.model.size.n * sizeof *u);
  if (!u) return ep_fail(err, EP_ERR_MEMORY, "no memory for displacements");
  collapse(start, &b->shapes.shape[0].mesh, u);
  const ep_status status = project(b, u, q, err);
  free(u);
  return status;
}

ep_status ep_stress_begin(ep_stress_bench *b, const ep_stress_case *c, ep_error *err) {
  ep_state *state = ep_stepper_state(b->stepper);
  double *q = ep_state_q(state), *v = ep_state_velocity(state);
  if (c->axis == EP_STRESS_START) return start_at(b, (ep_stress_start)c->value, q, err);
  if (c->axis == EP_STRESS_IMPULSE) {
    draw(b, v);
    scale_to(b, kick * c->value * b->model.model.rest_scale, v);
  }
  return EP_OK;
}
