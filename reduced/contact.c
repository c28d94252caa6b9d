#include "reduced/contact.h"

#include <math.h>
#include <string.h>

#include "reduced/contact_law.h"
#include "reduced/state.h"

int ep_contact_acts(const ep_state *state, const ep_step_def *def) {
  return state->model->size.contacts > 0 && def->obstacles > 0;
}

// ---- geometry ----------------------------------------------------------------------------------

// One configuration of the object: coordinates and frame (NULL: model space is the world).
typedef struct pose {
  const double *q;
  const ep_frame *frame;
  const double *origin; // the rest shape's centre of mass, (3); NULL for a held object
} pose;

static pose pose_of(const ep_model *model, const double *q, const ep_frame *frame) {
  return (pose){q, frame, frame ? model->rigid_origin : NULL};
}

static void place(const pose *p, const double model_space[3], double world[3]) {
  double body[3];
  for (int i = 0; i < 3; i++) body[i] = model_space[i] - (p->origin ? p->origin[i] : 0);
  if (p->frame)
    ep_obstacle_to_world(p->frame, body, world);
  else
    memcpy(world, body, sizeof body);
}

// x = c + R (rest - X_0 + rows q); rows (3 x r)
static void position(int r, const double rest[3], const double *rows, const pose *p,
                     double world[3]) {
  double body[3];
  for (int i = 0; i < 3; i++) body[i] = rest[i] + ep_dot(r, rows + (size_t)i * (size_t)r, p->q);
  place(p, body, world);
}

// Bounding ball of a node of the tree; returns its radius R0 + sum_k growth_k |q_k|.
static double ball(const ep_model *model, int node, const pose *p, double center[3]) {
  const int r = model->size.r;
  const double *growth = model->tree_growth + (size_t)node * (size_t)r;
  double radius = model->tree_radius[node];
  for (int k = 0; k < r; k++) radius += growth[k] * fabs(p->q[k]);
  position(r, model->tree_center + 3 * (size_t)node, model->tree_u + 3 * (size_t)node * (size_t)r,
           p, center);
  return radius;
}

// ---- one pass over what is near ----------------------------------------------------------------

typedef struct pass {
  ep_state *state;
  const ep_model *model;
  const ep_obstacle *obstacle; // at hand
  ep_contact_law law;
  pose now, start, lag, ahead;
  int lagged, fast; // the obstacle at hand: friction or damping; objects may jump over it
  void (*visit)(struct pass *pass, int vertex, const ep_contact_path *path);
  double scale, energy; // ep_contact_energy
  double *g, *h;
  int n;
  ep_contact_report *report; // ep_contact_measure
  double change, pressing;   // of the normal forces friction goes by: ep_contact_again
} pass;

static double distance_of(const pass *p, const ep_frame *of, const double x[3], double local[3]) {
  double normal[3];
  ep_obstacle_to_local(of, x, local);
  return ep_obstacle_distance(p->obstacle, local, normal);
}

static int near_now(const pass *p, int node, const pose *at) {
  double center[3], local[3];
  const double radius = ball(p->model, node, at, center);
  return distance_of(p, &p->obstacle->end, center, local) <= radius + p->law.thickness;
}

// Distances change by at most the way: no point of a path of length l between distances a and b is
// nearer than (a + b - l) / 2.
static int near_path(const pass *p, int node) {
  double x[3], from[3], to[3], square = 0;
  double radius = ball(p->model, node, &p->start, x);
  const double a = distance_of(p, &p->obstacle->start, x, from);
  radius = fmax(radius, ball(p->model, node, &p->ahead, x));
  const double b = distance_of(p, &p->obstacle->end, x, to);
  for (int i = 0; i < 3; i++) square += (to[i] - from[i]) * (to[i] - from[i]);
  return 0.5 * (a + b - sqrt(square)) <= radius + p->law.thickness;
}

static int near(const pass *p, int node) {
  return near_now(p, node, &p->now) || (p->lagged && near_now(p, node, &p->lag)) ||
         (p->fast && near_path(p, node));
}

static void at_vertex(pass *p, int vertex) {
  const int r = p->model->size.r;
  const double *rest = p->model->contact_x + 3 * (size_t)vertex;
  const double *rows = p->model->contact_u + 3 * (size_t)vertex * (size_t)r;
  double x[4][3];
  ep_contact_path path = {.now = x[0], .fast = p->fast};
  position(r, rest, rows, &p->now, x[0]);
  if (p->lagged || p->fast) {
    position(r, rest, rows, &p->start, x[1]);
    path.start = x[1];
  }
  if (p->lagged) {
    position(r, rest, rows, &p->lag, x[2]);
    path.lag = x[2];
  }
  if (p->fast) {
    position(r, rest, rows, &p->ahead, x[3]);
    path.ahead = x[3];
  }
  p->visit(p, vertex, &path);
}

static void traverse(pass *p) {
  const int32_t *range = p->model->tree_range;
  for (int node = 0; node < p->model->size.nodes;) {
    const int next = range[3 * node + 2];
    if (!near(p, node)) {
      node = next;
      continue;
    }
    for (int v = range[3 * node]; next == node + 1 && v < range[3 * node + 1]; v++) at_vertex(p, v);
    node++;
  }
}

// Longest way any point of the object may go in free flight.
static double longest_way(const ep_model *model, const pose *start, const pose *ahead) {
  const int r = model->size.r;
  double a[3], way = 0, turn = 0;
  for (int k = 0; k < r; k++) {
    double most = model->tree_growth[k];
    for (int i = 0; i < 3; i++) most += fabs(model->tree_u[i * r + k]);
    way += most * fabs(ahead->q[k] - start->q[k]);
  }
  if (!start->frame || !ahead->frame) return way;
  double reach = ball(model, 0, start, a), moved = 0;
  for (int i = 0; i < 9; i++)
    turn += (ahead->frame->R[i] - start->frame->R[i]) * (ahead->frame->R[i] - start->frame->R[i]);
  for (int i = 0; i < 3; i++) {
    reach += fabs(a[i] - start->frame->c[i]);
    moved += fabs(ahead->frame->c[i] - start->frame->c[i]);
  }
  return way + moved + sqrt(turn) * reach;
}

// The same for the obstacle's motion, at the object.
static double obstacle_way(const pass *p) {
  const ep_frame *s = &p->obstacle->start, *e = &p->obstacle->end;
  double x[3], reach = ball(p->model, 0, &p->start, x), turn = 0, moved = 0;
  for (int i = 0; i < 9; i++) turn += (e->R[i] - s->R[i]) * (e->R[i] - s->R[i]);
  for (int i = 0; i < 3; i++) {
    reach += fabs(x[i] - s->c[i]);
    moved += fabs(e->c[i] - s->c[i]);
  }
  return moved + sqrt(turn) * reach;
}

static void over_obstacles(pass *p, const ep_step_def *def) {
  for (int i = 0; i < def->obstacles; i++) {
    p->obstacle = &def->obstacle[i];
    p->lagged = p->obstacle->friction > 0 || p->law.damping > 0;
    // Half-spaces cannot be jumped over; slow points stay on the side they come from.
    p->fast =
        p->obstacle->kind != EP_OBSTACLE_PLANE &&
        p->state->contact.way + obstacle_way(p) > 0.25 * ep_obstacle_inner_radius(p->obstacle);
    traverse(p);
  }
}

static pass make_pass(ep_state *state, const ep_step_def *def, const ep_frame *frame,
                      const double *q, int hessian) {
  ep_contact *c = &state->contact;
  return (pass){.state = state,
                .model = state->model,
                .law = ep_contact_choose(def, state->model->contact_scale[0],
                                         state->model->rest_scale, hessian, &c->memory),
                .now = pose_of(state->model, q, frame),
                .start = pose_of(state->model, state->contact_start, frame ? &c->start : NULL),
                .lag = pose_of(state->model, state->contact_lag, frame ? &c->lag : NULL),
                .ahead = pose_of(state->model, state->contact_ahead, frame ? &c->ahead : NULL)};
}

// ---- energy ------------------------------------------------------------------------------------

// Into body axes: f := R^T f, h := R^T h R.
static void to_body(const ep_frame *frame, double f[3], double h[9]) {
  double t[9], a[3];
  if (!frame) return;
  const double *R = frame->R;
  for (int i = 0; i < 3; i++) a[i] = R[i] * f[0] + R[3 + i] * f[1] + R[6 + i] * f[2];
  memcpy(f, a, sizeof a);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      t[3 * i + j] = h[3 * i] * R[j] + h[3 * i + 1] * R[3 + j] + h[3 * i + 2] * R[6 + j];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      h[3 * i + j] = R[i] * t[j] + R[3 + i] * t[3 + j] + R[6 + i] * t[6 + j];
}

// R^T dx/d(unknowns) (3 x n): U_i, R^T, -R^T [x - c].
static const double *jacobian(const pass *p, int vertex, const double x[3], double *out) {
  const int r = p->model->size.r, n = p->n;
  const double *rows = p->model->contact_u + 3 * (size_t)vertex * (size_t)r;
  const ep_frame *f = p->now.frame;
  if (!f) return rows;
  const double d[3] = {x[0] - f->c[0], x[1] - f->c[1], x[2] - f->c[2]};
  for (int i = 0; i < 3; i++) {
    double *row = out + i * n;
    const double a[3] = {f->R[i], f->R[3 + i], f->R[6 + i]}; // body axis i in the world
    memcpy(row, rows + (size_t)i * (size_t)r, (size_t)r * sizeof *row);
    for (int j = 0; j < 3; j++) row[r + j] = a[j];
    row[r + 3] = d[1] * a[2] - d[2] * a[1]; // a . (theta x d) = theta . (d x a)
    row[r + 4] = d[2] * a[0] - d[0] * a[2];
    row[r + 5] = d[0] * a[1] - d[1] * a[0];
  }
  return out;
}

// h += A^T H A, lower triangle alone; w (3 x n) scratch.
static void add_hessian(int n, const double *restrict a, const double b[9], double *restrict w,
                        double *restrict h) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < n; j++)
      w[i * n + j] = b[3 * i] * a[j] + b[3 * i + 1] * a[n + j] + b[3 * i + 2] * a[2 * n + j];
  for (int i = 0; i < n; i++) {
    const double a0 = a[i], a1 = a[n + i], a2 = a[2 * n + i];
    double *restrict row = h + (size_t)i * (size_t)n;
    for (int j = 0; j <= i; j++) row[j] += a0 * w[j] + a1 * w[n + j] + a2 * w[2 * n + j];
  }
}

static void add_energy(pass *p, int vertex, const ep_contact_path *path) {
  ep_contact_action act = {0};
  const int n = p->n;
  if (!ep_contact_point(&p->law, p->obstacle, path, p->model->contact_area[vertex], &act)) return;
  p->energy += act.energy;
  if (!p->g && !p->h) return;
  double *out = p->state->contact_rows;
  const double *a = jacobian(p, vertex, path->now, out);
  to_body(p->now.frame, act.gradient, act.hessian);
  for (int i = 0; p->g && i < 3; i++)
    for (int j = 0; j < n; j++) p->g[j] += p->scale * act.gradient[i] * a[i * n + j];
  for (int i = 0; i < 9; i++) act.hessian[i] *= p->scale;
  if (p->h) add_hessian(n, a, act.hessian, out + 3 * n, p->h);
}

double ep_contact_energy(ep_state *state, const ep_step_def *def, const ep_frame *frame,
                         const double *q, double *g, double *h, int n) {
  if (!ep_contact_acts(state, def)) return 0;
  pass p = make_pass(state, def, frame, q, h != NULL);
  p.visit = add_energy;
  p.scale = state->contact.memory.share;
  p.g = g, p.h = h, p.n = n;
  over_obstacles(&p, def);
  for (int i = 0; h && i < n; i++)
    for (int j = 0; j < i; j++) h[j * n + i] = h[i * n + j];
  return p.scale * p.energy;
}

// ---- the step ----------------------------------------------------------------------------------

static void keep(ep_state *state, const ep_frame *frame, const double *q, double *q_out,
                 ep_frame *out) {
  memcpy(q_out, q, (size_t)state->model->size.r * sizeof *q);
  if (frame) *out = *frame;
}

void ep_contact_begin(ep_state *state, const ep_step_def *def, double dt_before,
                      const ep_frame *start, const ep_frame *ahead, const double *q_start,
                      const double *q_ahead) {
  ep_contact *c = &state->contact;
  if (!ep_contact_acts(state, def)) return;
  keep(state, start, q_start, state->contact_start, &c->start);
  keep(state, start, q_start, state->contact_lag, &c->lag);
  keep(state, ahead, q_ahead, state->contact_ahead, &c->ahead);
  const pose from = pose_of(state->model, q_start, start);
  const pose to = pose_of(state->model, q_ahead, ahead);
  c->way = longest_way(state->model, &from, &to);
  ep_contact_memory_begin(def, dt_before, &c->memory);
}

static void add_report(pass *p, int vertex, const ep_contact_path *path) {
  ep_contact_action act = {0};
  if (!ep_contact_point(&p->law, p->obstacle, path, p->model->contact_area[vertex], &act)) return;
  const double *x = path->now, *c = p->now.frame ? p->now.frame->c : (const double[3]){0, 0, 0};
  const double arm[3] = {x[0] - c[0], x[1] - c[1], x[2] - c[2]};
  ep_contact_report_add(&p->law, &act, arm, p->report);
}

static void measure(ep_state *state, const ep_step_def *def, const ep_frame *frame, const double *q,
                    ep_contact_report *report) {
  pass p = make_pass(state, def, frame, q, 0);
  const ep_contact_memory *m = &state->contact.memory;
  *report = (ep_contact_report){.stiffness = p.law.stiffness, .passes = m->passes};
  p.visit = add_report;
  p.report = report;
  over_obstacles(&p, def);
}

void ep_contact_measure(ep_state *state, const ep_step_def *def, const ep_frame *frame,
                        const double *q, ep_contact_report *report) {
  *report = (ep_contact_report){0};
  if (ep_contact_acts(state, def)) measure(state, def, frame, q, report);
}

// Normal forces at x and where friction took them from.
static void add_change(pass *p, int vertex, const ep_contact_path *path) {
  ep_contact_change(&p->law, p->obstacle, path, p->model->contact_area[vertex], &p->change,
                    &p->pressing);
}

int ep_contact_again(ep_state *state, const ep_step_def *def, const ep_frame *frame,
                     const double *q) {
  ep_contact *c = &state->contact;
  if (!ep_contact_acts(state, def)) return 0;
  pass p = make_pass(state, def, frame, q, 0);
  p.visit = add_change;
  over_obstacles(&p, def);
  if (!ep_contact_retry(p.change, p.pressing, &c->memory)) return 0;
  keep(state, frame, q, state->contact_lag, &c->lag);
  return 1;
}

int ep_contact_tree_sound(const ep_model *model) {
  const int nodes = model->size.nodes, contacts = model->size.contacts;
  for (int i = 0; i < nodes; i++) {
    const int32_t *range = model->tree_range + 3 * (size_t)i;
    if (range[0] < 0 || range[1] < range[0] || range[1] > contacts) return 0;
    if (range[2] <= i || range[2] > nodes) return 0;
  }
  return 1;
}
