#include "cubature/guards.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/forest.h"
#include "base/random.h"
#include "cubature/guard_model.h"

// Pushes that would move the object this many extents if it stayed linear, give or take a factor
// of 3; moderate ones come first and get their guards before the hardest ones do.
static const double severity[] = {1, 10, 100, 1000};
enum { SEVERITIES = sizeof severity / sizeof *severity };
// Steps of a push, and after it (of one that tests). Its force grows from step to step: what turns
// over does so one after another, and the first guards spare others.
enum { PUSHED = 8, FREE = 6, FREE_TESTED = 24 };
// No push takes more than this share of all guards, so that some are left for the others.
enum { SHARES = 10 };
enum { STREAM_PUSHES = 201, STREAM_HELD_OUT };

ep_guard_options ep_default_guard_options(void) {
  return (ep_guard_options){.most = 256, .pushes = 16, .effort = 1000, .seed = 1};
}

void ep_guards_free(ep_guards *guards) {
  free(guards->tet);
  free(guards->weight);
  free(guards->limit);
  *guards = (ep_guards){0};
}

typedef struct chooser {
  const ep_guard_options *options;
  ep_guard_model model;
  ep_random rng;
  double *mass;          // (nv) lumped volumes
  double *u;             // (3 nv) scratch
  double *force, *start; // (r) of the push at hand
  double *now;           // (r) its force in this step
  int *parent, *worst;   // (nv) clusters: forest over vertices, element with the least J
  bool full;
  long effort_end; // of the push at hand: evaluations and guards at which it ends
  int guards_end;
  int cut; // pushes that ended there
  ep_log *log;
  int done; // pushes
} chooser;

// ---- pushes ------------------------------------------------------------------------------------

static void random_unit(ep_random *rng, double d[3]) {
  double square = 0;
  for (int c = 0; c < 3; c++) d[c] = ep_random_normal(rng), square += d[c] * d[c];
  for (int c = 0; c < 3; c++) d[c] /= sqrt(fmax(square, 1e-30));
}

// A force spread over the mass within a ball about a vertex, added to u (nv x 3).
static void add_patch(chooser *c, double *u) {
  const ep_mesh *mesh = c->model.fem->mesh;
  const double extent = ep_mesh_extent(mesh);
  const double *centre = mesh->x + 3 * (size_t)ep_random_below(&c->rng, mesh->nv);
  const double radius = extent * (0.05 + 0.3 * ep_random_uniform(&c->rng));
  double direction[3], total = 0;
  random_unit(&c->rng, direction);
  for (int pass = 0; pass < 2; pass++)
    for (size_t v = 0; v < (size_t)mesh->nv; v++) {
      double square = 0;
      for (size_t i = 0; i < 3; i++) square += pow(mesh->x[3 * v + i] - centre[i], 2);
      if (square > radius * radius) continue;
      if (pass == 0) total += c->mass[v];
      for (size_t i = 0; i < 3 && pass == 1; i++) u[3 * v + i] += direction[i] * c->mass[v] / total;
    }
}

// One or two patches, scaled by what they would do to a linear object.
static void draw_push(chooser *c, double hard) {
  ep_guard_model *m = &c->model;
  const size_t r = (size_t)m->model.size.r, n3 = 3 * (size_t)m->fem->mesh->nv;
  memset(c->u, 0, n3 * sizeof *c->u);
  const int patches = 1 + ep_random_below(&c->rng, 2);
  for (int i = 0; i < patches; i++) add_patch(c, c->u);
  for (size_t a = 0; a < r; a++) {
    c->force[a] = 0;
    for (size_t i = 0; i < n3; i++) c->force[a] += m->basis->u[a * n3 + i] * c->u[i];
  }
  memcpy(c->start, c->force, r * sizeof *c->start);
  ep_state_solve_k0(m->state, c->start);
  const double reach = ep_guard_model_reach(m, c->start);
  const double wanted = hard * pow(10, ep_random_uniform(&c->rng) - 0.5);
  const double scale = reach > 0 ? wanted * ep_mesh_extent(m->fem->mesh) / reach : 0;
  for (size_t a = 0; a < r; a++) c->force[a] *= scale, c->start[a] = 0;
}

// No push, but a random state: vertices up to half an extent away.
static void draw_start(chooser *c) {
  ep_guard_model *m = &c->model;
  const size_t r = (size_t)m->model.size.r;
  for (size_t a = 0; a < r; a++) c->start[a] = ep_random_normal(&c->rng), c->force[a] = 0;
  const double reach = ep_guard_model_reach(m, c->start);
  const double wanted = (0.1 + 0.4 * ep_random_uniform(&c->rng)) * ep_mesh_extent(m->fem->mesh);
  for (size_t a = 0; a < r && reach > 0; a++) c->start[a] *= wanted / reach;
}

// ---- one push ----------------------------------------------------------------------------------

typedef struct outcome {
  int during, left; // inverted tets: the most at any time, at the end
  bool failed;      // a step did not converge, or left what is no number: it ended there
} outcome;

// The worst element of every cluster of inverted ones (they hang together by vertices) becomes a
// guard. Returns how many were added.
static int add_worst(chooser *c) {
  ep_guard_model *m = &c->model;
  const ep_mesh *mesh = m->fem->mesh;
  int added = 0;
  ep_forest_start(c->parent, mesh->nv);
  for (int v = 0; v < mesh->nv; v++) c->worst[v] = -1;
  for (int e = 0; e < mesh->nt; e++)
    for (int i = 1; i < 4 && m->ratio[e] <= 0; i++)
      ep_forest_join(c->parent, mesh->tet[4 * e], mesh->tet[4 * e + i]);
  for (int e = 0; e < mesh->nt; e++) {
    if (m->ratio[e] > 0 || m->allowed[e] == 0) continue;
    int known = 0;
    for (int i = 0; i < m->model.size.guards; i++) known |= m->tet[i] == e;
    int *worst = &c->worst[ep_forest_root(c->parent, mesh->tet[4 * e])];
    if (!known && (*worst < 0 || m->ratio[e] < m->ratio[*worst])) *worst = e;
  }
  for (int v = 0; v < mesh->nv; v++) {
    if (c->worst[v] < 0) continue;
    if (m->model.size.guards == m->most) c->full = true;
    added += ep_guard_model_add(m, c->worst[v]);
  }
  return added;
}

static bool spent(const chooser *c) {
  return c->model.evaluations >= c->effort_end || c->model.model.size.guards >= c->guards_end;
}

// One step. With `stop`, while it turns tets over: again from where it began, with more guards.
// Returns whether the push goes on.
static ep_status advance(chooser *c, bool stop, const double *force, outcome *out, bool *go_on,
                         ep_error *err) {
  ep_guard_model *m = &c->model;
  for (;;) {
    out->failed = !ep_guard_model_step(m, force);
    *go_on = !out->failed;
    if (out->failed) return EP_OK;
    out->left = ep_guard_model_inverted(m);
    out->failed = out->left < 0;
    *go_on = !out->failed && !(stop && spent(c));
    if (!*go_on) return EP_OK;
    if (!stop || out->left == 0 || add_worst(c) == 0) break;
    EP_TRY(ep_guard_model_back(m, err));
  }
  out->during = out->during > out->left ? out->during : out->left;
  return EP_OK;
}

// Push and let go, or let go from a start. With `stop` nothing that a guard can keep from it turns
// over while it is pushed and after it.
static ep_status run(chooser *c, bool stop, int free, outcome *out, ep_error *err) {
  ep_guard_model *m = &c->model;
  *out = (outcome){0};
  EP_TRY(ep_guard_model_begin(m, err));
  const size_t r = (size_t)m->model.size.r;
  bool started = false, go_on = true;
  memcpy(ep_state_q(m->state), c->start, r * sizeof *c->start);
  for (size_t a = 0; a < r; a++) started |= c->start[a] != 0;
  for (int step = 0; step < PUSHED + free && go_on; step++) {
    const bool pushed = step < PUSHED && !started;
    for (size_t a = 0; a < r; a++) c->now[a] = c->force[a] * (step + 1) / PUSHED;
    EP_TRY(advance(c, stop && !started, pushed ? c->now : NULL, out, &go_on, err));
  }
  return EP_OK;
}

// The push at hand until it leaves nothing turned over, or has had its share.
static ep_status secure(chooser *c, ep_error *err) {
  outcome now;
  c->effort_end = c->model.evaluations + c->options->effort;
  c->guards_end = c->model.model.size.guards + (c->options->most + SHARES - 1) / SHARES;
  do {
    EP_TRY(run(c, true, FREE, &now, err));
  } while (!spent(c) && now.left > 0 && add_worst(c) > 0);
  c->cut += spent(c);
  return EP_OK;
}

// ---- all of them -------------------------------------------------------------------------------

// Pushes of every severity that only test.
static int held_out(const ep_guard_options *options) {
  return (options->pushes + 7) / 8;
}

static ep_status push_all(chooser *c, ep_error *err) {
  c->rng = ep_random_seed(c->options->seed, STREAM_PUSHES);
  for (int hard = 0; hard < SEVERITIES; hard++)
    for (int i = 0; i < c->options->pushes && !c->full; i++) {
      if (i % 6 == 5)
        draw_start(c);
      else
        draw_push(c, severity[hard]);
      EP_TRY(secure(c, err));
      ep_progress(c->log, ++c->done);
    }
  return EP_OK;
}

static ep_status hold_out(chooser *c, ep_guards *out, ep_error *err) {
  outcome now;
  c->rng = ep_random_seed(c->options->seed, STREAM_HELD_OUT);
  for (int hard = 0; hard < SEVERITIES; hard++)
    for (int i = 0; i < held_out(c->options); i++) {
      draw_push(c, severity[hard]);
      EP_TRY(run(c, false, FREE_TESTED, &now, err));
      ep_progress(c->log, ++c->done);
      out->tried++;
      out->left += now.left > 0;
      out->failed += now.failed;
      out->most = out->most > now.during ? out->most : now.during;
    }
  return EP_OK;
}

static int by_number(const void *a, const void *b) {
  const int x = *(const int *)a, y = *(const int *)b;
  return (x > y) - (x < y);
}

static ep_status keep(chooser *c, ep_guards *out, ep_error *err) {
  const ep_guard_model *m = &c->model;
  const size_t count = (size_t)m->model.size.guards;
  out->tet = malloc((count + 1) * sizeof *out->tet);
  out->weight = malloc((count + 1) * sizeof *out->weight);
  out->limit = malloc((count + 1) * sizeof *out->limit);
  if (!out->tet || !out->weight || !out->limit)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %zu guards", count);
  out->count = (int)count;
  out->full = c->full;
  out->cut = c->cut;
  memcpy(out->tet, m->tet, count * sizeof *out->tet);
  qsort(out->tet, count, sizeof *out->tet, by_number); // neighbours share a group in a step
  for (size_t i = 0; i < count; i++) {
    out->weight[i] = m->around[out->tet[i]];
    out->limit[i] = m->allowed[out->tet[i]];
  }
  for (int e = 0; e < m->nt; e++) out->spared += m->allowed[e] == 0;
  return EP_OK;
}

static ep_status prepare(chooser *c, const ep_mesh *mesh, int r, ep_error *err) {
  const size_t nv = (size_t)mesh->nv;
  c->mass = malloc(nv * sizeof *c->mass);
  c->u = malloc(3 * nv * sizeof *c->u);
  c->force = malloc(3 * (size_t)r * sizeof *c->force);
  c->parent = malloc(2 * nv * sizeof *c->parent);
  if (!c->mass || !c->u || !c->force || !c->parent)
    return ep_fail(err, EP_ERR_MEMORY, "no memory to choose guards");
  c->start = c->force + r;
  c->now = c->start + r;
  c->worst = c->parent + nv;
  ep_mesh_vertex_volumes(mesh, c->mass);
  return EP_OK;
}

static ep_status choose(chooser *c, ep_guards *out, ep_error *err) {
  EP_TRY(prepare(c, c->model.fem->mesh, c->model.basis->r, err));
  EP_TRY(push_all(c, err));
  EP_TRY(hold_out(c, out, err));
  return keep(c, out, err);
}

ep_status ep_guards_choose(const ep_fem *fem, const ep_basis *basis, const ep_cubature *cubature,
                           const ep_guard_options *options, ep_log *log, ep_guards *out,
                           ep_error *err) {
  *out = (ep_guards){0};
  chooser c = {.options = options, .log = log};
  EP_TRY(ep_guard_model_create(fem, basis, cubature, options->most, &c.model, err));
  ep_progress_begin(log, "guards", SEVERITIES * (options->pushes + held_out(options)));
  const ep_status status = choose(&c, out, err);
  ep_progress_end(log);
  ep_guard_model_free(&c.model);
  free(c.mass);
  free(c.u);
  free(c.force);
  free(c.parent);
  if (status != EP_OK) ep_guards_free(out);
  return status;
}
