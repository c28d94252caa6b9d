#include "cubature/guard_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/forces.h"
#include "cubature/parallel.h"
#include "reduced/guard.h"
#include "reduced/unfold.h"

// A guard resists below this share of its volume; below this part of the share that an example or
// the pose itself leaves it, so that no guard stands between the object and an example.
static const double wall_begins = 0.15, of_example = 0.5;
static const double pi = 3.14159265358979323846;
enum { STEPS_A_PERIOD = 24, HALVINGS = 1, POWER_ITERATIONS = 30 };
enum { WORTH_THREADS = 20000 }; // tets

// It matters what turns over, not where exactly the object is.
static const double tolerance = 1e-2;

// Instead of the corotational law, which takes four times as long: as soft when far extended (an
// StVK object would not get there), the same at small strains.
static const ep_material stand_in = EP_STABLE_NEOHOOKEAN;

// ---- set up ------------------------------------------------------------------------------------

static void *aligned(size_t bytes) {
  return aligned_alloc(64, (bytes + 64) / 64 * 64);
}

static ep_status allocate(ep_guard_model *m, ep_error *err) {
  const size_t most = (size_t)m->most, nt = (size_t)m->nt;
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
  m->rest = malloc(nt * sizeof(double));
  m->x = malloc(3 * (size_t)m->fem->mesh->nv * sizeof(double));
  m->before = malloc(2 * (size_t)m->basis->r * sizeof(double));
  m->rows = malloc(9 * (size_t)m->basis->r * sizeof(double));
  ep_model largest = m->model;
  largest.size.guards = m->most;
  m->block = aligned(ep_state_bytes(&largest));
  if (m->tet && m->number && m->w && m->stiffness && m->limit && m->g && m->growth && m->around &&
      m->allowed && m->ratio && m->rest && m->x && m->before && m->rows && m->block)
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

typedef struct look_work {
  ep_guard_model *model;
  const double *q;
  bool moved; // positions, not displacements
} look_work;

static void place(void *context, int piece, int from, int to) {
  (void)piece;
  const look_work *w = context;
  const ep_guard_model *m = w->model;
  const size_t n3 = 3 * (size_t)m->fem->mesh->nv, first = 3 * (size_t)from, end = 3 * (size_t)to;
  for (size_t i = first; i < end; i++) m->x[i] = w->moved ? m->fem->mesh->x[i] : 0;
  for (size_t a = 0; a < (size_t)m->basis->r; a++)
    for (size_t i = first; i < end; i++) m->x[i] += w->q[a] * m->basis->u[a * n3 + i];
}

static void measure(void *context, int piece, int from, int to) {
  (void)piece;
  const look_work *w = context;
  for (int e = from; e < to; e++)
    w->model->ratio[e] = ep_tet_volume(w->model->fem->mesh, e, w->model->x) * w->model->rest[e];
}

static void over_cores(const ep_guard_model *m, int count, ep_range_work *work, look_work *w) {
  if (m->nt < WORTH_THREADS)
    work(w, 0, 0, count);
  else
    ep_parallel_ranges(count, work, w);
}

// J of all elements at q.
static void look(ep_guard_model *m, const double *q) {
  look_work w = {m, q, true};
  over_cores(m, m->fem->mesh->nv, place, &w);
  over_cores(m, m->nt, measure, &w);
}

static void allow(ep_guard_model *m) {
  const size_t r = (size_t)m->basis->r;
  for (int e = 0; e < m->nt; e++) {
    m->rest[e] = 1 / ep_tet_volume(m->fem->mesh, e, m->fem->mesh->x);
    m->allowed[e] = wall_begins;
  }
  for (size_t i = 0; i < (size_t)m->basis->examples; i++) {
    look(m, m->basis->example_q + i * r);
    for (int e = 0; e < m->nt; e++)
      m->allowed[e] = fmax(0, fmin(m->allowed[e], of_example * m->ratio[e]));
  }
}

// A part of the longest period: the smallest eigenvalue of K0 by inverse iteration.
static void choose_step(ep_guard_model *m) {
  const size_t r = (size_t)m->model.size.r;
  double *x = ep_state_q(m->state), growth = 1;
  for (size_t a = 0; a < r; a++) x[a] = 1;
  for (int i = 0; i < POWER_ITERATIONS; i++) {
    double square = 0;
    ep_state_solve_k0(m->state, x);
    for (size_t a = 0; a < r; a++) square += x[a] * x[a];
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
  EP_TRY(ep_model_build(&parts, &m->memory, err));
  m->model = m->memory.model;
  if (m->model.material == EP_COROTATIONAL) m->model.material = stand_in;
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
  *out = (ep_guard_model){.fem = fem, .basis = basis, .nt = fem->mesh->nt, .most = most};
  const ep_status status = create(out, cubature, err);
  if (status != EP_OK) ep_guard_model_free(out);
  return status;
}

void ep_guard_model_free(ep_guard_model *m) {
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
  free(m->rest);
  free(m->x);
  free(m->before);
  free(m->rows);
  free(m->block);
  *m = (ep_guard_model){0};
}

// ---- guards ------------------------------------------------------------------------------------

bool ep_guard_model_add(ep_guard_model *m, int tet) {
  const int at = m->model.size.guards;
  const size_t r = (size_t)m->model.size.r, width = 8 * (size_t)m->model.size.blocks;
  double *growth = m->growth + (size_t)(at / 8) * width;
  if (at == m->most || m->allowed[tet] == 0) return false;
  ep_element_rows(m->fem, m->basis, tet, m->rows);
  m->tet[at] = m->number[at] = tet;
  m->w[at] = m->around[tet];
  m->stiffness[at] = ep_guard_stiffness(m->fem->lambda[tet], m->fem->mu[tet]);
  m->limit[at] = m->allowed[tet];
  ep_pack_cubature((int)r, 1, m->rows, m->g + (size_t)at * 9 * width);
  if (at % 8 == 0) memset(growth, 0, width * sizeof *growth);
  ep_guard_add_growth((int)r, m->rows, growth);
  m->model.size.guards++;
  return true;
}

// ---- motion ------------------------------------------------------------------------------------

ep_status ep_guard_model_begin(ep_guard_model *m, ep_error *err) {
  if (ep_state_init(&m->model, m->block, ep_state_bytes(&m->model), &m->state) != EP_OK)
    return ep_fail(err, EP_ERR_NUMERIC,
                   "guards: the stiffness of the basis is not positive definite; is enough of the "
                   "object fixed?");
  ep_unfold_never(m->state); // what guards leave turned over is to be seen
  return EP_OK;
}

static bool step(ep_guard_model *m, ep_step_def *def, double dt, int level) {
  def->dt = dt;
  ep_step_report report;
  const ep_status status = ep_step(m->state, def, &report);
  m->evaluations += report.newton_iterations + report.line_search_steps;
  if (status == EP_OK) return true;
  return level < HALVINGS && step(m, def, dt / 2, level + 1) && step(m, def, dt / 2, level + 1);
}

ep_status ep_guard_model_back(ep_guard_model *m, ep_error *err) {
  const size_t r = (size_t)m->model.size.r;
  EP_TRY(ep_guard_model_begin(m, err));
  memcpy(ep_state_q(m->state), m->before, r * sizeof *m->before);
  memcpy(ep_state_velocity(m->state), m->before + r, r * sizeof *m->before);
  return EP_OK;
}

bool ep_guard_model_step(ep_guard_model *m, const double *force) {
  const size_t r = (size_t)m->model.size.r;
  memcpy(m->before, ep_state_q(m->state), r * sizeof *m->before);
  memcpy(m->before + r, ep_state_velocity(m->state), r * sizeof *m->before);
  ep_step_def def = ep_default_step();
  def.force = force;
  def.strength = 0;
  def.tolerance = tolerance;
  return step(m, &def, m->dt, 0);
}

int ep_guard_model_inverted(ep_guard_model *m) {
  int count = 0;
  look(m, ep_state_q(m->state));
  for (int e = 0; e < m->nt; e++) {
    if (!isfinite(m->ratio[e])) return -1;
    count += m->ratio[e] <= 0 && m->allowed[e] > 0;
  }
  return count;
}

double ep_guard_model_reach(ep_guard_model *m, const double *q) {
  look_work w = {m, q, false};
  double largest = 0;
  over_cores(m, m->fem->mesh->nv, place, &w);
  for (size_t i = 0; i < 3 * (size_t)m->fem->mesh->nv; i += 3)
    largest =
        fmax(largest, m->x[i] * m->x[i] + m->x[i + 1] * m->x[i + 1] + m->x[i + 2] * m->x[i + 2]);
  return sqrt(largest);
}
