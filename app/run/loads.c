#include "app/run/loads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/select.h"

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

ep_status ep_load_project(const ep_load *load, const ep_shapes *shapes, const ep_model *model,
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
