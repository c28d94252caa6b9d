#include "cubature/guard_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/parallel.h"
#include "reduced/guard.h"

// A guard resists below this share of its volume; below this part of the share that an example or
// the pose itself leaves it, so that no guard stands between the object and an example.
static const double wall_begins = 0.15, of_example = 0.5;
static const double pi = 3.14159265358979323846;
enum { STEPS_A_PERIOD = 24, HALVINGS = 4, POWER_ITERATIONS = 30 };

// ---- set up ------------------------------------------------------------------------------------

static void *aligned(size_t bytes) {
  return aligned_alloc(64, (bytes + 64) / 64 * 64);
}

static ep_status allocate(ep_guard_model *m, ep_error *err) {
  const size_t most = (size_t)m->most, nt = (size_t)m->elements.nt;
  const size_t width = 8 * (size_t)m->model.size.blocks;
  m->tet = malloc((most + 1) * sizeof *m->tet);
  m->number = aligned(most * sizeof *m->number);
  m->w = aligned(most * sizeof(double));
  m->stiffness = aligned(most * sizeof(double));
  m->limit = aligned(most * sizeof(double));
  m->g = aligned(most * 9 * width * sizeof(double));
  m->growth = aligned((most + 7) / 8 * width * sizeof(double));
  m->around = malloc(nt * sizeof(double));
  m->allowed = malloc(nt * sizeof(double));
  m->ratio = malloc(nt * sizeof(double));
  ep_model largest = m->model;
  largest.size.guards = m->most;
  m->block = aligned(ep_state_bytes(&largest));
  if (m->tet && m->number && m->w && m->stiffness && m->limit && m->g && m->growth && m->around &&
      m->allowed && m->ratio && m->block)
    return EP_OK;
  return ep_fail(err, EP_ERR_MEMORY, "no memory for %d guards", m->most);
}

// Volume at the corners of each element: what it stands for while it is the only guard there.
static ep_status weigh(ep_guard_model *m, ep_error *err) {
  const ep_mesh *mesh = m->fem->mesh;
  double *vertex = malloc((size_t)mesh->nv * sizeof *vertex);
  if (!vertex) return ep_fail(err, EP_ERR_MEMORY, "no memory for the volumes of vertices");
  ep_mesh_vertex_volumes(mesh, vertex);
  for (int e = 0; e < mesh->nt; e++) {
    m->around[e] = 0;
    for (int i = 0; i < 4; i++) m->around[e] += vertex[mesh->tet[4 * e + i]];
  }
  free(vertex);
  return EP_OK;
}

static void allow(ep_guard_model *m) {
  const size_t r = (size_t)m->basis->r;
  double f[9];
  for (int e = 0; e < m->elements.nt; e++) {
    double least = 1;
    for (size_t i = 0; i < (size_t)m->basis->examples; i++)
      least = fmin(least, ep_element_gradient(&m->elements, e, m->basis->example_q + i * r, f));
    m->allowed[e] = least > 0 ? fmin(wall_begins, of_example * least) : 0;
  }
}

// A part of the longest period: the smallest eigenvalue of K0 by inverse iteration.
static void choose_step(ep_guard_model *m) {
  const size_t r = (size_t)m->model.size.r;
  const double *l = ep_state_k0_factor(m->state);
  double *x = ep_state_q(m->state), growth = 1;
  for (size_t a = 0; a < r; a++) x[a] = 1;
  for (int i = 0; i < POWER_ITERATIONS; i++) {
    double square = 0;
    for (size_t a = 0; a < r; a++) {
      for (size_t b = 0; b < a; b++) x[a] -= l[a * r + b] * x[b];
      x[a] /= l[a * r + a];
    }
    for (size_t a = r; a-- > 0;) {
      for (size_t b = a + 1; b < r; b++) x[a] -= l[b * r + a] * x[b];
      x[a] /= l[a * r + a];
      square += x[a] * x[a];
    }
    growth = sqrt(square);
    for (size_t a = 0; a < r; a++) x[a] /= growth;
  }
  m->dt = 2 * pi * sqrt(growth) / STEPS_A_PERIOD;
}

static ep_status create(ep_guard_model *m, const ep_cubature *cubature, ep_error *err) {
  ep_basis plain = *m->basis; // the examples' forces are not needed
  plain.examples = 0;
  const ep_model_parts parts = {.fem = m->fem,
                                .basis = &plain,
                                .s = cubature->count,
                                .tet = cubature->tet,
                                .weight = cubature->weight};
  EP_TRY(ep_elements_create(m->fem, m->basis, &m->elements, err));
  EP_TRY(ep_model_build(&parts, &m->memory, err));
  m->model = m->memory.model;
  m->model.size.rigid = 0; // what a free object does in its own frame is enough
  EP_TRY(allocate(m, err));
  EP_TRY(weigh(m, err));
  allow(m);
  m->model.guard_tet = m->number;
  m->model.guard_w = m->w;
  m->model.guard_stiffness = m->stiffness;
  m->model.guard_limit = m->limit;
  m->model.guard_g = m->g;
  m->model.guard_growth = m->growth;
  EP_TRY(ep_guard_model_begin(m, err));
  choose_step(m);
  return EP_OK;
}

ep_status ep_guard_model_create(const ep_fem *fem, const ep_basis *basis,
                                const ep_cubature *cubature, int most, ep_guard_model *out,
                                ep_error *err) {
  *out = (ep_guard_model){.fem = fem, .basis = basis, .most = most};
  const ep_status status = create(out, cubature, err);
  if (status != EP_OK) ep_guard_model_free(out);
  return status;
}

void ep_guard_model_free(ep_guard_model *m) {
  ep_elements_free(&m->elements);
  ep_model_memory_free(&m->memory);
  free(m->tet);
  free(m->number);
  free(m->w);
  free(m->stiffness);
  free(m->limit);
  free(m->g);
  free(m->growth);
  free(m->around);
  free(m->allowed);
  free(m->ratio);
  free(m->block);
  *m = (ep_guard_model){0};
}

// ---- guards ------------------------------------------------------------------------------------

bool ep_guard_model_add(ep_guard_model *m, int tet) {
  const int at = m->model.size.guards;
  const size_t r = (size_t)m->model.size.r, width = 8 * (size_t)m->model.size.blocks;
  const double *g = m->elements.g + (size_t)tet * 9 * r;
  double *growth = m->growth + (size_t)(at / 8) * width;
  if (at == m->most || m->allowed[tet] == 0) return false;
  m->tet[at] = m->number[at] = tet;
  m->w[at] = m->around[tet];
  m->stiffness[at] = EP_GUARD_STIFFNESS * fmax(m->fem->lambda[tet], m->fem->mu[tet]);
  m->limit[at] = m->allowed[tet];
  ep_pack_cubature((int)r, 1, g, m->g + (size_t)at * 9 * width);
  if (at % 8 == 0) memset(growth, 0, width * sizeof *growth);
  for (size_t a = 0; a < r; a++) {
    double square = 0;
    for (size_t c = 0; c < 9; c++) square += g[c * r + a] * g[c * r + a];
    growth[a] = fmax(growth[a], sqrt(square));
  }
  m->model.size.guards++;
  return true;
}

// ---- motion ------------------------------------------------------------------------------------

ep_status ep_guard_model_begin(ep_guard_model *m, ep_error *err) {
  if (ep_state_init(&m->model, m->block, ep_state_bytes(&m->model), &m->state) == EP_OK)
    return EP_OK;
  return ep_fail(err, EP_ERR_NUMERIC,
                 "guards: the stiffness of the basis is not positive definite; is enough of the "
                 "object fixed?");
}

static bool step(ep_guard_model *m, ep_step_def *def, double dt, int level) {
  def->dt = dt;
  ep_step_report report;
  const ep_status status = ep_step(m->state, def, &report);
  m->evaluations += report.newton_iterations + report.line_search_steps;
  if (status == EP_OK) return true;
  return level < HALVINGS && step(m, def, dt / 2, level + 1) && step(m, def, dt / 2, level + 1);
}

bool ep_guard_model_step(ep_guard_model *m, const double *force) {
  ep_step_def def = ep_default_step();
  def.force = force;
  def.strength = 0;
  def.tolerance = 1e-4;
  return step(m, &def, m->dt, 0);
}

static void look(void *context, int piece, int from, int to) {
  (void)piece;
  ep_guard_model *m = context;
  double f[9];
  for (int e = from; e < to; e++)
    m->ratio[e] = ep_element_gradient(&m->elements, e, ep_state_q(m->state), f);
}

int ep_guard_model_inverted(ep_guard_model *m) {
  int count = 0;
  ep_parallel_ranges(m->elements.nt, look, m);
  for (int e = 0; e < m->elements.nt; e++) {
    if (!isfinite(m->ratio[e])) return -1;
    count += m->ratio[e] <= 0 && m->allowed[e] > 0;
  }
  return count;
}

double ep_guard_model_reach(const ep_guard_model *m, const double *q, double *u) {
  const size_t n3 = 3 * (size_t)m->fem->mesh->nv;
  double largest = 0;
  memset(u, 0, n3 * sizeof *u);
  for (size_t a = 0; a < (size_t)m->basis->r; a++)
    for (size_t i = 0; i < n3; i++) u[i] += q[a] * m->basis->u[a * n3 + i];
  for (size_t i = 0; i < n3; i += 3)
    largest = fmax(largest, u[i] * u[i] + u[i + 1] * u[i + 1] + u[i + 2] * u[i + 2]);
  return sqrt(largest);
}
