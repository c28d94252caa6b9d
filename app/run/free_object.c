#include "app/run/free_object.h"

#include <stdlib.h>
#include <string.h>

#include "app/run/loads.h"

ep_status ep_free_start(const ep_scene *scene, ep_state *state, ep_error *err) {
  ep_frame frame = *ep_state_frame(state);
  if (scene->start.placed) memcpy(frame.c, scene->start.position, sizeof frame.c);
  ep_turn_matrix(&scene->start.rotation, frame.R);
  ep_status status = ep_state_set_frame(state, &frame);
  if (status == EP_OK)
    status = ep_state_set_motion(state, scene->start.velocity, scene->start.spin);
  if (status == EP_OK) return EP_OK;
  return ep_fail(err, EP_ERR_SCENE, "%s: start: the object cannot start like this", scene->path);
}

// Forces (3n) of a unit push along one axis are the vertices' shares of it.
static ep_status mean_of_push(const ep_load *load, const ep_mesh *mesh, const double *mass,
                              const ep_model *model, double at[3], double *modes, ep_error *err) {
  const size_t n = (size_t)mesh->nv, r = (size_t)model->size.r;
  double *share = malloc(3 * n * sizeof *share);
  if (!share) return ep_fail(err, EP_ERR_MEMORY, "no memory for the loads");
  ep_load unit = *load;
  for (int i = 0; i < 3; i++) unit.vector[i] = 1;
  const ep_status status = ep_load_forces(&unit, mesh, mass, share, err);
  at[0] = at[1] = at[2] = 0;
  memset(modes, 0, 3 * r * sizeof *modes);
  for (size_t v = 0; v < 3 * n && status == EP_OK; v++) {
    at[v % 3] += share[v] * (model->rest_x[v] - model->rigid_origin[v % 3]);
    for (size_t a = 0; a < r; a++) modes[3 * a + v % 3] += share[v] * model->u[a * 3 * n + v];
  }
  free(share);
  return status;
}

ep_status ep_free_loads_make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                             ep_free_loads *out, ep_error *err) {
  const size_t count = (size_t)scene->nloads, r = (size_t)model->size.r;
  *out = (ep_free_loads){.pull = calloc(count + 1, sizeof *out->pull),
                         .modes = calloc(3 * r * count + 1, sizeof *out->modes)};
  double *mass = malloc((size_t)model->size.n * sizeof *mass);
  ep_status status = out->pull && out->modes && mass
                         ? EP_OK
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for the loads");
  if (status == EP_OK) ep_shapes_vertex_mass(shapes, mass);
  for (int i = 0; i < scene->nloads && status == EP_OK; i++) {
    const ep_load *load = &scene->load[i];
    if (load->gravity) continue;
    ep_pull *pull = &out->pull[out->pulls];
    double *modes = out->modes + 3 * r * (size_t)out->pulls++;
    status = mean_of_push(load, &shapes->shape[0].mesh, mass, model, pull->at, modes, err);
    pull->modes = modes;
  }
  free(mass);
  return status;
}

void ep_free_loads_free(ep_free_loads *loads) {
  free(loads->pull);
  free(loads->modes);
  *loads = (ep_free_loads){.pulls = 0};
}

void ep_free_loads_set(const ep_scene *scene, ep_free_loads *loads, double t, bool act,
                       ep_step_def *def) {
  int next = 0;
  for (int i = 0; i < scene->nloads; i++) {
    if (scene->load[i].gravity) continue;
    const double strength = act ? ep_load_profile(&scene->load[i], t) : 0;
    for (int a = 0; a < 3; a++) loads->pull[next].force[a] = strength * scene->load[i].vector[a];
    next++;
  }
  def->pull = loads->pull;
  def->pulls = loads->pulls;
}
