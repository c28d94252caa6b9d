// Cost of contact against the size of the mesh: one bar and its modes, with surfaces of meshes from
// 2K to 70K vertices (modes interpolated), a sphere pressed into its top. Two patches: the same
// area (touching vertices grow with the surface), and about the same number of vertices (the sphere
// shrinks). Baseline: the same evaluation without the tree, every vertex looked at.
//   build/bench_contact
// Times are the minimum of many, in microseconds; ratios are to the smallest mesh.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/log.h"
#include "reduced/bake/contact_tree.h"
#include "reduced/contact.h"
#include "reduced/state.h"
#include "tests/reduced/bar.h"

enum { R = 30, TIMINGS = 40, NX = 16, NY = 4, NZ = 4 };
static const ep_frame still = {{0, 0, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};

// The bar [0, 4] x [0, 1] x [0, 1] in cubes of six tets (Kuhn).
static void fine_mesh(int cells, ep_mesh *out) {
  static const int corner[6][4] = {{0, 1, 3, 7}, {0, 1, 5, 7}, {0, 2, 3, 7},
                                   {0, 2, 6, 7}, {0, 4, 5, 7}, {0, 4, 6, 7}};
  const int count[3] = {4 * cells, cells, cells}, nx = count[0] + 1, ny = cells + 1;
  const int nv = nx * ny * ny;
  double *x = malloc(3 * (size_t)nv * sizeof *x);
  int *tet = malloc(24 * (size_t)count[0] * (size_t)cells * (size_t)cells * sizeof *tet), nt = 0;
  if (!x || !tet) abort();
  for (int v = 0; v < nv; v++) {
    x[3 * v] = 4.0 * (v % nx) / count[0];
    x[3 * v + 1] = (double)(v / nx % ny) / cells;
    x[3 * v + 2] = (double)(v / nx / ny) / cells;
  }
  for (int c = 0; c < count[0] * cells * cells; c++) {
    const int i = c % count[0], j = c / count[0] % cells, k = c / count[0] / cells;
    for (int t = 0; t < 6; t++, nt++)
      for (int v = 0; v < 4; v++) {
        const int b = corner[t][v];
        tet[4 * nt + v] = (i + (b & 1)) + nx * ((j + (b >> 1 & 1)) + ny * (k + (b >> 2)));
      }
  }
  ep_error err = {0};
  if (ep_mesh_make(nv, x, nt, tet, "bar", out, NULL, &err) != EP_OK) abort();
  free(x);
  free(tet);
}

// Mode a of the coarse bar at x, trilinear in its cells.
static void mode_at(const bar *b, int a, const double *x, double *out) {
  const int count[3] = {NX, NY, NZ};
  int cell[3];
  double s[3];
  for (int i = 0; i < 3; i++) {
    const double at = x[i] / (i ? 1.0 : 4.0) * count[i];
    cell[i] = (int)fmin(count[i] - 1, floor(at));
    s[i] = at - cell[i];
  }
  out[0] = out[1] = out[2] = 0;
  for (int c = 0; c < 8; c++) {
    const int at[3] = {cell[0] + (c & 1), cell[1] + (c >> 1 & 1), cell[2] + (c >> 2)};
    const double w =
        (c & 1 ? s[0] : 1 - s[0]) * (c & 2 ? s[1] : 1 - s[1]) * (c & 4 ? s[2] : 1 - s[2]);
    const size_t v = (size_t)(at[0] + (NX + 1) * (at[1] + (NY + 1) * at[2]));
    const double *u = b->model.u + ((size_t)a * (size_t)b->model.size.n + v) * 3;
    for (int i = 0; i < 3; i++) out[i] += w * u[i];
  }
}

typedef struct bench {
  bar *b;
  ep_contact_tree tree;
  ep_model model, plain; // with the tree; with one node that holds all
  void *block, *plain_block;
  ep_state *state, *plain_state;
  ep_obstacle sphere;
  ep_step_def def;
  double scale, q[R], g[R], h[R * R], sum;
  int32_t all[3];
} bench;

static void use_tree(bench *x) {
  ep_model *m = &x->model;
  *m = x->b->model;
  m->size.contacts = x->tree.contacts;
  m->size.nodes = x->tree.nodes;
  m->contact_vertex = x->tree.vertex;
  m->contact_x = x->tree.x;
  m->contact_area = x->tree.area;
  m->contact_u = x->tree.u;
  m->tree_range = x->tree.range;
  m->tree_center = x->tree.center;
  m->tree_u = x->tree.node_u;
  m->tree_radius = x->tree.radius;
  m->tree_growth = x->tree.growth;
  x->scale = 1e5 / m->rest_scale;
  m->contact_scale = &x->scale;
  x->plain = *m;
  x->plain.size.nodes = 1;
  x->all[0] = 0, x->all[1] = x->tree.contacts, x->all[2] = 1;
  x->plain.tree_range = x->all;
}

static ep_state *make_state(const ep_model *model, void **block) {
  const size_t bytes = (ep_state_bytes(model) + 63) / 64 * 64;
  ep_state *state = NULL;
  *block = aligned_alloc(64, bytes);
  if (!*block || ep_state_init(model, *block, bytes, &state) != EP_OK) abort();
  return state;
}

static void make_bench(bench *x, bar *b, const ep_mesh *mesh) {
  memset(x, 0, sizeof *x);
  const size_t n = (size_t)mesh->nv;
  double *u = malloc(R * 3 * n * sizeof *u);
  ep_error err = {0};
  if (!u) abort();
  for (int a = 0; a < R; a++)
    for (size_t v = 0; v < n; v++) mode_at(b, a, mesh->x + 3 * v, u + ((size_t)a * n + v) * 3);
  x->b = b;
  if (ep_contact_tree_build(mesh, R, u, &x->tree, &err) != EP_OK) abort();
  free(u);
  use_tree(x);
  x->state = make_state(&x->model, &x->block);
  x->plain_state = make_state(&x->plain, &x->plain_block);
  x->def = ep_default_step();
  x->def.strength = 0;
  x->def.damping_stiffness = 0.01;
  x->def.obstacle = &x->sphere;
  x->def.obstacles = 1;
}

static void free_bench(bench *x) {
  free(x->block);
  free(x->plain_block);
  ep_contact_tree_free(&x->tree);
}

// Pressed into the top so that vertices within `patch` of x = 3 touch.
static void place_sphere(bench *x, double patch, double friction) {
  const double radius = 0.6, deep = patch * patch / (2 * radius);
  x->sphere = (ep_obstacle){.kind = EP_OBSTACLE_SPHERE,
                            .size = {radius, 0, 0},
                            .friction = friction,
                            .start = still,
                            .end = still};
  x->sphere.start.c[0] = 3, x->sphere.start.c[1] = 0.5, x->sphere.start.c[2] = 1 + radius - deep;
  x->sphere.end = x->sphere.start;
  x->def.contact.thickness = 1e-4;
}

// ---- what is measured --------------------------------------------------------------------------

static void evaluate(bench *x, ep_state *state) {
  memset(x->g, 0, sizeof x->g);
  memset(x->h, 0, sizeof x->h);
  x->sum += ep_contact_energy(state, &x->def, NULL, x->q, x->g, x->h, R) + x->g[0] + x->h[1];
}

static void with_tree(bench *x) {
  evaluate(x, x->state);
}
static void without_tree(bench *x) {
  evaluate(x, x->plain_state);
}
static void energy_alone(bench *x) {
  x->sum += ep_contact_energy(x->state, &x->def, NULL, x->q, NULL, NULL, R);
}
static void step(bench *x) {
  memset(ep_state_q(x->state), 0, R * sizeof(double));
  memset(ep_state_velocity(x->state), 0, R * sizeof(double));
  if (ep_step(x->state, &x->def, NULL) != EP_OK) x->sum = NAN;
}

static double fastest(bench *x, void (*run)(bench *)) {
  double best = INFINITY;
  long repeats = 1;
  for (int i = 0; i < TIMINGS; i++) {
    const double started = ep_seconds();
    for (long n = 0; n < repeats; n++) run(x);
    const double each = (ep_seconds() - started) / (double)repeats;
    if (each < best) best = each;
    if (i == 0) repeats = (long)fmin(1e5, 1 + 2e-3 / fmax(each, 1e-9));
  }
  return 1e6 * best;
}

static void measure(bench *x, const char *patch, int vertices, double first[3]) {
  ep_contact_report report;
  ep_contact_begin(x->state, &x->def, 0, NULL, NULL, x->q, x->q);
  ep_contact_begin(x->plain_state, &x->def, 0, NULL, NULL, x->q, x->q);
  ep_contact_measure(x->state, &x->def, NULL, x->q, &report);
  const double now[3] = {fastest(x, with_tree), fastest(x, energy_alone), fastest(x, step)};
  const double all = fastest(x, without_tree);
  for (int i = 0; i < 3; i++)
    if (first[i] == 0) first[i] = now[i];
  printf("%-9s %8d %8d %7d %6d  %9.1f %5.2f %9.1f %5.2f %10.1f  %9.1f %5.2f\n", patch, vertices,
         x->tree.contacts, x->tree.nodes, report.touching, now[0], now[0] / first[0], now[1],
         now[1] / first[1], all, now[2], now[2] / first[2]);
}

int main(void) {
  static bench x;
  bar *b = bar_create(NX, NY, NZ, R, 200, 0, 0, EP_STVK);
  const int cells[4] = {8, 13, 18, 26};
  double same_area[3] = {0}, same_count[3] = {0};
  printf("contact of a bar of %d modes with a sphere, friction 0.3; times in us\n", R);
  printf("%-9s %8s %8s %7s %6s  %9s %5s %9s %5s %10s  %9s %5s\n", "patch", "vertices", "surface",
         "nodes", "touch", "E+g+H", "ratio", "E", "ratio", "no tree", "step", "ratio");
  for (int i = 0; i < 4; i++) {
    ep_mesh mesh;
    fine_mesh(cells[i], &mesh);
    make_bench(&x, b, &mesh);
    place_sphere(&x, 0.2, 0.3);
    measure(&x, "area", mesh.nv, same_area);
    place_sphere(&x, 0.2 * cells[0] / cells[i], 0.3);
    measure(&x, "vertices", mesh.nv, same_count);
    free_bench(&x);
    ep_mesh_free(&mesh);
  }
  bar_free(b);
  if (!isfinite(x.sum)) fprintf(stderr, "a step failed\n");
  return isfinite(x.sum) ? 0 : 1;
}
