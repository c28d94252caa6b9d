#include "app/run/drags.h"

#include <stdlib.h>
#include <string.h>

#include "app/scene/select.h"

// Mean of positions and modes over the chosen vertices, by mass. rows (3 x r).
static void average(const ep_model *model, const double *mass, const unsigned char *chosen,
                    ep_spring *spring, double *rows) {
  const size_t n = (size_t)model->size.n, r = (size_t)model->size.r;
  double total = 0;
  for (size_t v = 0; v < n; v++) total += chosen[v] ? mass[v] : 0;
  for (size_t v = 0; v < n; v++)
    for (size_t i = 0; chosen[v] && i < 3; i++) {
      const double share = mass[v] / total;
      spring->rest[i] += share * model->rest_x[3 * v + i];
      for (size_t a = 0; a < r; a++) rows[i * r + a] += share * model->u[(a * n + v) * 3 + i];
    }
  spring->rows = rows;
}

static ep_status make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                      double *mass, unsigned char *chosen, ep_springs *out, ep_error *err) {
  const size_t r = (size_t)model->size.r, n = (size_t)model->size.n;
  double *rows = calloc(3 * r * (size_t)scene->ndrags, sizeof *rows);
  if (!rows) return ep_fail(err, EP_ERR_MEMORY, "no memory for the drags");
  out->spring[0].rows = rows; // what ep_drags_free frees
  ep_shapes_vertex_mass(shapes, mass);
  for (int i = 0; i < scene->ndrags; i++) {
    int count;
    memset(chosen, 0, n);
    EP_TRY(ep_select_vertices(&scene->drag[i].where, &shapes->shape[0].mesh, chosen, &count, err));
    average(model, mass, chosen, &out->spring[i], rows + 3 * r * (size_t)i);
    out->count++;
  }
  return EP_OK;
}

ep_status ep_drags_make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                        ep_springs *out, ep_error *err) {
  *out = (ep_springs){.count = 0};
  if (!scene->ndrags) return EP_OK;
  const size_t n = (size_t)model->size.n;
  double *mass = malloc(n * sizeof *mass);
  unsigned char *chosen = malloc(n);
  out->spring = calloc((size_t)scene->ndrags, sizeof *out->spring);
  const ep_status status = mass && chosen && out->spring
                               ? make(scene, shapes, model, mass, chosen, out, err)
                               : ep_fail(err, EP_ERR_MEMORY, "no memory for the drags");
  free(mass);
  free(chosen);
  if (status != EP_OK) ep_drags_free(out);
  return status;
}

void ep_drags_free(ep_springs *springs) {
  if (springs->spring) free((void *)springs->spring[0].rows);
  free(springs->spring);
  *springs = (ep_springs){.count = 0};
}

void ep_drags_set(const ep_scene *scene, const ep_state *state, double t, double dt, bool act,
                  ep_springs *springs) {
  for (int i = 0; i < springs->count; i++) {
    const ep_scene_drag *drag = &scene->drag[i];
    ep_spring *spring = &springs->spring[i];
    double rotation[9];
    const bool holds = act && t + dt >= drag->from && t + dt <= drag->until;
    spring->stiffness = holds ? drag->stiffness : 0;
    spring->damping = holds ? drag->damping : 0;
    ep_motion_at(&drag->path, t, spring->from, rotation);
    ep_motion_at(&drag->path, t + dt, spring->to, rotation);
  }
  ep_springs_begin(state, dt, springs);
}
