#include "pairs.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/random.h"

// Boxes in cells of the parameter grid: low, high.
typedef struct box {
  int low[3], high[3];
} box;

enum { BOXES = 8, GRID = 16 };

typedef struct boxes {
  int count;
  box box[BOXES];
} boxes;

static const boxes BODY[BODIES] = {
    [BODY_BAR] = {1, {{{0, 0, 0}, {6, 2, 2}}}},
    // fuselage, two wings, two tailplanes, fin; x nose, y up, z span
    [BODY_FLYER] = {6,
                    {{{0, 2, 6}, {12, 4, 8}},
                     {{5, 2, 0}, {8, 3, 6}},
                     {{5, 2, 8}, {8, 3, 14}},
                     {{0, 2, 4}, {2, 3, 6}},
                     {{0, 2, 8}, {2, 3, 10}},
                     {{0, 4, 6}, {2, 6, 8}}}},
    // trunk, four legs, neck, head, tail
    [BODY_BEAST] = {8,
                    {{{3, 3, 1}, {11, 5, 4}},
                     {{3, 0, 1}, {4, 3, 2}},
                     {{3, 0, 3}, {4, 3, 4}},
                     {{10, 0, 1}, {11, 3, 2}},
                     {{10, 0, 3}, {11, 3, 4}},
                     {{10, 5, 2}, {11, 7, 3}},
                     {{11, 6, 2}, {13, 7, 3}},
                     {{0, 4, 2}, {3, 5, 3}}}},
};

static bool filled(const boxes *b, int i, int j, int k) {
  for (int c = 0; c < b->count; c++) {
    const box *o = &b->box[c];
    if (i >= o->low[0] && i < o->high[0] && j >= o->low[1] && j < o->high[1] && k >= o->low[2] &&
        k < o->high[2])
      return true;
  }
  return false;
}

// Whether a vertex of the refined grid lies inside the body, with all its cubes filled.
static bool inner(const boxes *b, int refine, const int at[3]) {
  for (int c = 0; c < 8; c++) {
    int cell[3];
    for (int d = 0; d < 3; d++) {
      const int cube = at[d] - (c >> d & 1);
      if (cube < 0) return false;
      cell[d] = cube / refine;
    }
    if (!filled(b, cell[0], cell[1], cell[2])) return false;
  }
  return true;
}

typedef struct builder {
  const boxes *b;
  int refine, side; // vertices along each axis of the whole grid
  int *number;      // (side^3) vertex number, -1 where none
  double *u, *x;
  int *tet, nv, nt;
  ep_random rng;
} builder;

static int vertex(builder *w, placement place, const int at[3]) {
  int *number = &w->number[at[0] + w->side * (at[1] + w->side * at[2])];
  if (*number >= 0) return *number;
  double *u = w->u + 3 * w->nv;
  const bool moves = inner(w->b, w->refine, at);
  for (int d = 0; d < 3; d++) {
    const double jitter = 0.3 * (ep_random_uniform(&w->rng) - 0.5);
    u[d] = (at[d] + (moves ? jitter : 0)) / w->refine;
  }
  place(u, w->x + 3 * w->nv);
  return *number = w->nv++;
}

static void add_cube(builder *w, placement place, int i, int j, int k) {
  static const int corner[6][4] = {{0, 1, 3, 7}, {0, 3, 2, 7}, {0, 2, 6, 7},
                                   {0, 6, 4, 7}, {0, 4, 5, 7}, {0, 5, 1, 7}};
  for (int t = 0; t < 6; t++)
    for (int c = 0; c < 4; c++) {
      const int b = corner[t][c], at[3] = {i + (b & 1), j + (b >> 1 & 1), k + (b >> 2)};
      w->tet[4 * w->nt + c] = vertex(w, place, at);
      w->nt += c == 3;
    }
}

void body_mesh(body which, int refine, unsigned seed, placement place, ep_mesh *mesh, double **u) {
  builder w = {.b = &BODY[which], .refine = refine, .side = GRID * refine + 1};
  const size_t most = (size_t)w.side * w.side * w.side;
  int cubes = 0;
  for (int c = 0; c < GRID * GRID * GRID; c++)
    cubes += filled(w.b, c % GRID, c / GRID % GRID, c / GRID / GRID) * refine * refine * refine;
  w.rng = ep_random_seed(seed, 21);
  w.number = malloc(most * sizeof *w.number);
  w.u = malloc(24 * (size_t)cubes * sizeof *w.u);
  w.x = malloc(24 * (size_t)cubes * sizeof *w.x);
  w.tet = malloc(24 * (size_t)cubes * sizeof *w.tet);
  assert_true(w.number && w.u && w.x && w.tet);
  for (size_t i = 0; i < most; i++) w.number[i] = -1;
  for (int k = 0; k < GRID * refine; k++)
    for (int j = 0; j < GRID * refine; j++)
      for (int i = 0; i < GRID * refine; i++)
        if (filled(w.b, i / refine, j / refine, k / refine)) add_cube(&w, place, i, j, k);
  ep_error err = {0};
  if (ep_mesh_make(w.nv, w.x, w.nt, w.tet, "body", mesh, NULL, &err) != EP_OK)
    fail_msg("%s", err.text);
  assert_int_equal(mesh->nv, w.nv);
  free(w.number);
  free(w.x);
  free(w.tet);
  *u = w.u;
}

// ---- placements ------------------------------------------------------------------------------

static double half_turn(void) {
  return acos(-1);
}

static double smooth(double t) {
  t = fmin(fmax(t, 0), 1);
  return t * t * (3 - 2 * t);
}

void place_bar(const double u[3], double x[3]) {
  x[0] = u[0] / 6 - 0.5;
  x[1] = 0.31 * (u[1] / 2 - 0.5);
  x[2] = 0.28 * (u[2] / 2 - 0.5);
}

void bend_point(const double in[3], double out[3]) {
  const double radius = 2 / half_turn(), a = in[0] / radius, r = radius - in[1];
  const double z = in[2];
  out[0] = r * sin(a);
  out[1] = radius - r * cos(a);
  out[2] = z;
}

void twist_point(const double in[3], double out[3]) {
  const double a = half_turn() / 2 * in[0], x = in[0], y = in[1], z = in[2];
  out[0] = x;
  out[1] = cos(a) * y - sin(a) * z;
  out[2] = sin(a) * y + cos(a) * z;
}

void place_bar_bent(const double u[3], double x[3]) {
  double p[3];
  place_bar(u, p);
  bend_point(p, x);
}

void place_bar_twisted(const double u[3], double x[3]) {
  double p[3];
  place_bar(u, p);
  twist_point(p, x);
}

void place_bar_curled(const double u[3], double x[3]) {
  double p[3];
  place_bar(u, p);
  twist_point(p, x);
  bend_point(x, p);
  memcpy(x, p, sizeof p);
}

// Square to disc: (a, b) in [-1, 1]^2, keeping area elements bounded (elliptical grid mapping).
void place_rod(const double u[3], double x[3]) {
  const double a = u[1] - 1, b = u[2] - 1;
  x[0] = 1.1 * (u[0] / 6 - 0.5);
  x[1] = 0.18 * a * sqrt(1 - b * b / 2);
  x[2] = 0.15 * b * sqrt(1 - a * a / 2);
}

// A flyer's proportions.
typedef struct flyer {
  double length, tall, wide;       // fuselage; half heights and widths at the thickest
  double taper;                    // of its ends
  double span, sweep, lift, thick; // wings: per cell of span; thickness over the fuselage's
  double tail_span, tail_sweep, fin, fin_sweep;
  double raise; // angle of the wings [rad], on an arc
} flyer;

static void place_flyer(const flyer *f, const double u[3], double x[3]) {
  const double t = u[0] / 12, y = u[1] - 3, z = u[2] - 7;
  const double profile = 1 - f->taper * pow(fabs(2 * t - 1), 3);
  const double side = z < 0 ? -1 : 1, out = fmax(fabs(z) - 1, 0), up = fmax(y - 1, 0);
  const bool wing = u[0] > 3.5;
  const double span = out * (wing ? f->span : f->tail_span);
  const double thin = wing ? 1 + (f->thick - 1) * smooth(out / 2) : 1;
  const double reach = wing ? span : 0;
  const double angle = f->raise * smooth(reach / 0.3);
  x[0] = f->length * (t - 0.5) + (wing ? f->sweep : f->tail_sweep) * out + f->fin_sweep * up;
  double h = f->tall * profile * (out > 0 ? -0.5 + (fmin(y, 1) + 0.5) * thin : fmin(y, 1));
  h += f->fin * up;
  const double w = f->wide * profile * fmin(fabs(z), 1);
  x[1] = h * cos(angle) + f->lift * reach + span * sin(angle);
  x[2] = side * (w + span * cos(angle) - (out > 0 ? h * sin(angle) : 0));
}

void place_plane(const double u[3], double x[3]) {
  const flyer f = {1.7, 0.13, 0.13, 0.5, 0.15, -0.02, 0.01, 0.7, 0.12, -0.03, 0.15, -0.05, 0};
  place_flyer(&f, u, x);
}

static const flyer BIRD = {1.4,  0.14, 0.15,  0.55, 0.19,  -0.035, 0.02,
                           0.55, 0.07, -0.05, 0.05, -0.02, 0};

void place_bird(const double u[3], double x[3]) {
  place_flyer(&BIRD, u, x);
}

void place_bird_raised(const double u[3], double x[3]) {
  flyer f = BIRD;
  f.raise = half_turn() / 4;
  place_flyer(&f, u, x);
}

// Points in front of `start` bend along x towards y by `angle`, reached `length` farther.
static void bow(double start, double length, double angle, double x[3]) {
  const double s = x[0] - start, a = angle * smooth(s / length), y = x[1];
  if (s <= 0) return;
  enum { STEPS = 200 };
  double along = 0, up = 0;
  for (int i = 0; i < STEPS; i++) {
    const double t = angle * smooth((i + 0.5) / STEPS * s / length);
    along += cos(t) * s / STEPS;
    up += sin(t) * s / STEPS;
  }
  x[0] = start + along - sin(a) * y;
  x[1] = up + cos(a) * y;
}

void place_bird_banked(const double u[3], double x[3]) {
  flyer f = BIRD;
  f.raise = (u[2] > 7 ? 1 : -1) * half_turn() * 50 / 180;
  place_flyer(&f, u, x);
}

void place_bird_diving(const double u[3], double x[3]) {
  flyer f = BIRD;
  f.raise = half_turn() / 6;
  place_flyer(&f, u, x);
  bow(0.1, 0.6, -half_turn() / 4, x);
}

void place_fish(const double u[3], double x[3]) {
  const flyer f = {1.6, 0.3, 0.14, 0.6, 0.05, -0.03, -0.03, 0.5, 0.03, -0.06, 0.2, -0.14, 0};
  place_flyer(&f, u, x);
}

// Legs swing about the hips by `angle` each (x-y plane), growing smoothly below the trunk.
static void swing(double angle, double hip_x, double hip_y, double x[3]) {
  const double a = angle * smooth((hip_y - x[1]) / 0.5 + 0.3), dx = x[0] - hip_x, dy = x[1] - hip_y;
  x[0] = hip_x + cos(a) * dx - sin(a) * dy;
  x[1] = hip_y + sin(a) * dx + cos(a) * dy;
}

void place_beast(const double u[3], double x[3]) {
  for (int d = 0; d < 3; d++) x[d] = 0.1 * u[d];
  x[2] = 0.09 * (u[2] - 2.5) * (1 + 0.02 * u[0]);
  if (u[0] < 3) x[1] -= 0.05 * (3 - u[0]);
}

void place_beast_walking(const double u[3], double x[3]) {
  place_beast(u, x);
  if (u[1] < 3) {
    const bool front = u[0] > 7, left = u[2] > 2.5;
    const double angle = (front == left ? 1 : -1) * half_turn() * 40 / 180;
    swing(angle, front ? 1.05 : 0.35, 0.3, x);
  }
  if (u[1] > 5) { // neck and head to the side
    const double a = half_turn() * 30 / 180 * smooth((u[1] - 5) / 1.5), dx = x[0] - 1.05, z = x[2];
    x[0] = 1.05 + cos(a) * dx - sin(a) * z;
    x[2] = sin(a) * dx + cos(a) * z;
  }
}

void place_beast_rearing(const double u[3], double x[3]) {
  place_beast(u, x);
  x[1] -= 0.4;
  bow(0.45, 0.5, half_turn() / 3, x);
}

void place_beast_curled(const double u[3], double x[3]) {
  place_beast(u, x);
  double turned[3] = {x[0], x[2], -x[1]};
  bow(0.25, 0.9, half_turn() * 100 / 180, turned);
  x[0] = turned[0];
  x[1] = -turned[2];
  x[2] = turned[1];
}

void place_beast_stretched(const double u[3], double x[3]) {
  place_beast(u, x);
  x[0] *= 1.15;
  x[1] = u[1] < 3 ? 0.3 + 0.8 * (x[1] - 0.3) : 0.3 + 1.2 * (x[1] - 0.3);
  x[2] *= 1.2;
}

// ---- pairs -----------------------------------------------------------------------------------

void pair_of_bodies(const char *name, body which, int refine_from, placement place_from,
                    int refine_to, placement place_to, int functions, truth_pair *out) {
  ep_mesh from, to;
  double *u, *other;
  memset(out, 0, sizeof *out);
  out->name = name;
  body_mesh(which, refine_from, 1, place_from, &from, &u);
  body_mesh(which, refine_to, 2, place_to, &to, &other);
  out->truth = malloc(3 * (size_t)from.nv * sizeof *out->truth);
  assert_non_null(out->truth);
  for (int i = 0; i < from.nv; i++) place_to(u + 3 * i, out->truth + 3 * i);
  shape_from_mesh(&out->from, &from, functions);
  shape_from_mesh(&out->to, &to, functions);
  out->u = u;
  out->u_to = other;
}

void pair_free(truth_pair *pair) {
  shape_free(&pair->from);
  shape_free(&pair->to);
  free(pair->truth);
  free(pair->u);
  free(pair->u_to);
  memset(pair, 0, sizeof *pair);
}

static void move_points(int n, double *x, const double axis[3], double degrees, double scale,
                        double shift) {
  ep_mesh points = {.nv = n, .x = x};
  move_mesh(&points, axis, degrees, scale, shift);
}

void pair_move(truth_pair *pair, const double axis[3], double degrees, double scale, double shift) {
  test_shape *to = &pair->to;
  move_points(to->mesh.nv, to->mesh.x, axis, degrees, scale, shift);
  move_points(pair->from.mesh.nv, pair->truth, axis, degrees, scale, shift);
  const double volume = scale * scale * scale;
  to->lb.volume *= volume;
  for (int i = 0; i < to->lb.m; i++) to->lb.lambda[i] /= scale * scale;
  for (size_t i = 0; i < (size_t)to->lb.m * to->lb.n; i++) to->lb.phi[i] /= sqrt(volume);
  for (int i = 0; i < to->mass.start[to->mass.n]; i++) to->mass.value[i] *= volume;
}

double pair_error(const truth_pair *pair, const int *tet, const double *weight) {
  const ep_mesh *to = &pair->to.mesh;
  double sum = 0;
  for (int i = 0; i < pair->from.mesh.nv; i++) {
    double d2 = 0;
    for (int c = 0; c < 3; c++) {
      double x = -pair->truth[3 * i + c];
      for (int j = 0; j < 4; j++) x += weight[4 * i + j] * to->x[3 * to->tet[4 * tet[i] + j] + c];
      d2 += x * x;
    }
    sum += sqrt(d2);
  }
  return sum / pair->from.mesh.nv / ep_mesh_diagonal(to);
}

static ep_landmark pair_landmark_at(const truth_pair *pair, const double *points,
                                    const double x[3]) {
  ep_landmark mark = {.from_vertex = 0, .to_vertex = -1};
  double least = HUGE_VAL;
  for (int i = 0; i < pair->from.mesh.nv; i++) {
    double d2 = 0;
    for (int c = 0; c < 3; c++) d2 += pow(points[3 * i + c] - x[c], 2);
    if (d2 >= least) continue;
    least = d2;
    mark.from_vertex = i;
  }
  memcpy(mark.to, pair->truth + 3 * mark.from_vertex, sizeof mark.to);
  return mark;
}

ep_landmark pair_landmark(const truth_pair *pair, const double x[3]) {
  return pair_landmark_at(pair, pair->from.mesh.x, x);
}

ep_landmark pair_landmark_of(const truth_pair *pair, const double u[3]) {
  return pair_landmark_at(pair, pair->u, u);
}

static bool in_box(const box *b, const double u[3]) {
  for (int d = 0; d < 3; d++)
    if (u[d] < b->low[d] - 1e-9 || u[d] > b->high[d] + 1e-9) return false;
  return true;
}

void pair_regions(const truth_pair *pair, body which, ep_regions *out) {
  const boxes *b = &BODY[which];
  const ep_mesh *mesh[2] = {&pair->from.mesh, &pair->to.mesh};
  const double *u[2] = {pair->u, pair->u_to};
  *out = (ep_regions){.count = b->count, .shapes = 2};
  out->start = calloc(2 * (size_t)b->count + 1, sizeof *out->start);
  out->vertex = malloc((size_t)b->count * (size_t)(mesh[0]->nv + mesh[1]->nv) * sizeof(int));
  assert_true(out->start && out->vertex);
  int used = 0;
  for (int g = 0; g < b->count; g++)
    for (int s = 0; s < 2; s++) {
      out->start[2 * g + s] = used;
      for (int v = 0; v < mesh[s]->nv; v++)
        if (in_box(&b->box[g], u[s] + 3 * v)) out->vertex[used++] = v;
    }
  out->start[2 * b->count] = used;
}
