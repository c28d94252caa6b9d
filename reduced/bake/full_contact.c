#include "reduced/bake/full_contact.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "reduced/bake/contact_tree.h"

ep_status ep_full_contact_create(const ep_fem *fem, ep_full_contact **out, ep_error *err) {
  const size_t n = (size_t)fem->mesh->nv;
  ep_full_contact *c = *out = calloc(1, sizeof *c);
  if (!c) return ep_fail(err, EP_ERR_MEMORY, "no memory for contact in the full space");
  c->mesh = fem->mesh;
  c->extent = ep_mesh_extent(fem->mesh);
  c->unit = ep_fem_contact_unit(fem);
  c->vertex = malloc(n * sizeof *c->vertex);
  c->area = malloc(n * sizeof *c->area);
  c->start = calloc(9 * n, sizeof *c->start);
  ep_status status = EP_OK;
  if (!c->vertex || !c->area || !c->start)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for contact in the full space");
  if (status == EP_OK) status = ep_surface_areas(fem->mesh, c->area, err);
  if (status != EP_OK) {
    ep_full_contact_free(c);
    *out = NULL;
    return status;
  }
  c->lag = c->start + 3 * n;
  c->ahead = c->lag + 3 * n;
  for (size_t v = 0; v < n; v++) {
    if (!(c->area[v] > 0) || fem->held[3 * v]) continue;
    c->area[c->count] = c->area[v];
    c->vertex[c->count++] = (int)v;
  }
  return EP_OK;
}

void ep_full_contact_free(ep_full_contact *contact) {
  if (!contact) return;
  free(contact->vertex);
  free(contact->area);
  free(contact->start);
  free(contact);
}

void ep_full_contact_begin(ep_full_contact *c, const ep_step_def *def, double dt_before,
                           const double *start, const double *ahead) {
  const size_t bytes = 3 * (size_t)c->mesh->nv * sizeof(double);
  memcpy(c->start, start, bytes);
  memcpy(c->lag, start, bytes);
  memcpy(c->ahead, ahead, bytes);
  ep_contact_memory_begin(def, dt_before, &c->memory);
}

typedef struct positions {
  double now[3], start[3], lag[3], ahead[3];
} positions;

// Every point minds its path: the law itself leaves slow ones alone.
static ep_contact_path path_of(const ep_full_contact *c, const ep_obstacle *o, int vertex,
                               const double *u, positions *at) {
  for (size_t i = 0; i < 3; i++) {
    const size_t j = 3 * (size_t)vertex + i;
    at->now[i] = c->mesh->x[j] + u[j];
    at->start[i] = c->mesh->x[j] + c->start[j];
    at->lag[i] = c->mesh->x[j] + c->lag[j];
    at->ahead[i] = c->mesh->x[j] + c->ahead[j];
  }
  return (ep_contact_path){.now = at->now,
                           .start = at->start,
                           .lag = at->lag,
                           .ahead = at->ahead,
                           .fast = o->kind != EP_OBSTACLE_PLANE};
}

static ep_contact_law law_of(ep_full_contact *c, const ep_step_def *def, bool hessian) {
  return ep_contact_choose(def, c->unit, c->extent, hessian, &c->memory);
}

double ep_full_contact_energy(ep_full_contact *c, const ep_step_def *def, const double *u,
                              double *g, ep_csr *k) {
  const ep_contact_law law = law_of(c, def, k != NULL);
  const double share = c->memory.share;
  double sum = 0;
  positions at;
  for (int o = 0; o < def->obstacles; o++)
    for (int i = 0; i < c->count; i++) {
      ep_contact_action act = {0};
      const int v = 3 * c->vertex[i];
      const ep_contact_path path = path_of(c, &def->obstacle[o], c->vertex[i], u, &at);
      if (!ep_contact_point(&law, &def->obstacle[o], &path, c->area[i], &act)) continue;
      sum += act.energy;
      for (int a = 0; g && a < 3; a++) g[v + a] += share * act.gradient[a];
      for (int a = 0; k && a < 9; a++)
        k->value[ep_csr_find(k, v + a / 3, v + a % 3)] += share * act.hessian[a];
    }
  return share * sum;
}

void ep_full_contact_measure(ep_full_contact *c, const ep_step_def *def, const double *u,
                             ep_contact_report *report) {
  const ep_contact_law law = law_of(c, def, false);
  positions at;
  *report = (ep_contact_report){.stiffness = law.stiffness, .passes = c->memory.passes};
  for (int o = 0; o < def->obstacles; o++)
    for (int i = 0; i < c->count; i++) {
      ep_contact_action act = {0};
      const ep_contact_path path = path_of(c, &def->obstacle[o], c->vertex[i], u, &at);
      if (!ep_contact_point(&law, &def->obstacle[o], &path, c->area[i], &act)) continue;
      ep_contact_report_add(&law, &act, at.now, report);
    }
}

int ep_full_contact_again(ep_full_contact *c, const ep_step_def *def, const double *u) {
  const ep_contact_law law = law_of(c, def, false);
  positions at;
  double change = 0, pressing = 0;
  for (int o = 0; o < def->obstacles; o++)
    for (int i = 0; i < c->count; i++) {
      ep_contact_path path = path_of(c, &def->obstacle[o], c->vertex[i], u, &at);
      if (def->obstacle[o].friction == 0 && law.damping == 0) path.lag = NULL;
      ep_contact_change(&law, &def->obstacle[o], &path, c->area[i], &change, &pressing);
    }
  if (!ep_contact_retry(change, pressing, &c->memory)) return 0;
  memcpy(c->lag, u, 3 * (size_t)c->mesh->nv * sizeof *u);
  return 1;
}
