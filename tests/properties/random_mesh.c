#include "random_mesh.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

// ---- draws -------------------------------------------------------------------------------------

const char *solid_name(solid_shape shape) {
  static const char *const names[SOLID_SHAPES] = {"box", "bent", "hollow", "branch", "ellipsoid"};
  return names[shape];
}

random_solid draw_solid(ep_random *rng) {
  random_solid s = {.shape = (solid_shape)ep_random_below(rng, SOLID_SHAPES),
                    .cells = {from_to(rng, 5, 8), from_to(rng, 2, 3), from_to(rng, 2, 3)},
                    .size = {1, between(rng, 0.15, 0.4), between(rng, 0.15, 0.4)},
                    .grading = {1, 1, 1},
                    .jitter = chance(rng, 0.7) ? between(rng, 0.02, 0.2) : 0,
                    .arms = from_to(rng, 2, 5),
                    .seed = ep_random_u32(rng)};
  const bool bar = s.shape == SOLID_BOX || s.shape == SOLID_BENT;
  for (int i = 0; i < 3 && bar; i++)
    if (chance(rng, 0.25)) s.grading[i] = between_powers(rng, 0.05, 20);
  const double arc = between(rng, 0.5, 1.6);
  if (s.shape == SOLID_BENT || s.shape == SOLID_HOLLOW) s.arc = arc;
  if (s.shape == SOLID_HOLLOW) s.cells[1] = s.cells[2] = 3;
  const int branch_cells = 5 * from_to(rng, 1, 2);
  for (int i = 0; i < 3; i++) {
    if (s.shape == SOLID_BRANCH) s.cells[i] = branch_cells, s.size[i] = 1;
    if (s.shape == SOLID_ELLIPSOID) s.cells[i] = from_to(rng, 4, 5);
    if (s.shape == SOLID_ELLIPSOID) s.size[i] = i ? between(rng, 0.4, 1) : 1;
  }
  return s;
}

random_solid other_lattice(const random_solid *solid, double finer, uint64_t seed) {
  random_solid s = *solid;
  s.seed = seed;
  for (int i = 0; i < 3; i++) {
    s.cells[i] = (int)lround(finer * s.cells[i]);
    // an odd number: arms and cores keep their place
    if (s.shape == SOLID_BRANCH) s.cells[i] = 5 * (int)fmax(1, lround(finer));
    if (s.shape == SOLID_HOLLOW && i) s.cells[i] = 3 * (int)fmax(1, lround(finer));
    if (s.cells[i] < 2) s.cells[i] = 2;
    s.grading[i] = 1;
  }
  return s;
}

random_pose draw_pose(ep_random *rng, double amount) {
  return (random_pose){.bend = {amount * between(rng, -0.5, 0.5), amount * between(rng, -0.5, 0.5)},
                       .twist = amount * between(rng, -0.8, 0.8),
                       .stretch = amount * between(rng, -0.1, 0.2)};
}

placement at_home(void) {
  return (placement){.unit = 1, .R = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

placement draw_placement(ep_random *rng) {
  placement p = {.unit = pow(2, from_to(rng, -20, 20)), .numbering = 1 + ep_random_u32(rng)};
  rotation(rng, between(rng, 0, 3.1), p.R);
  for (int i = 0; i < 3; i++) p.t[i] = between(rng, -3, 3);
  return p;
}

void place_vector(const placement *at, const double x[3], double out[3]) {
  const double in[3] = {x[0], x[1], x[2]};
  for (int i = 0; i < 3; i++)
    out[i] = at->R[3 * i] * in[0] + at->R[3 * i + 1] * in[1] + at->R[3 * i + 2] * in[2];
}

void place_point(const placement *at, const double x[3], double out[3]) {
  place_vector(at, x, out);
  for (int i = 0; i < 3; i++) out[i] = at->unit * (out[i] + at->t[i]);
}

// ---- the lattice -------------------------------------------------------------------------------

typedef struct lattice {
  const random_solid *solid;
  int corners[3]; // cells + 1
  int nv, nt;
  int *vertex;  // (corners) number, -1 where no cell uses it
  double *home; // (nv x 3) lattice coordinates in [0, 1]
  bool *inner;  // (nv) not on the surface
  int *tet;     // (nt x 4)
} lattice;

static void *taken(size_t bytes) {
  void *p = calloc(bytes + 1, 1);
  assert_non_null(p);
  return p;
}

// Middle third of the cells along an axis.
static bool in_middle(int at, int cells) {
  return 3 * at >= cells - 1 && 3 * at < 2 * cells && (cells != 5 || at == 2);
}

static bool has_cell(const random_solid *s, const int c[3]) {
  bool middle[3];
  double square = 0;
  for (int i = 0; i < 3; i++) {
    if (c[i] < 0 || c[i] >= s->cells[i]) return false;
    middle[i] =
        s->shape == SOLID_BRANCH ? (5 * c[i] / s->cells[i]) == 2 : in_middle(c[i], s->cells[i]);
    const double x = (2.0 * c[i] + 1) / s->cells[i] - 1;
    square += x * x;
  }
  if (s->shape == SOLID_ELLIPSOID) return square < 1;
  if (s->shape == SOLID_HOLLOW) return 3 * c[1] / s->cells[1] != 1 || 3 * c[2] / s->cells[2] != 1;
  if (s->shape != SOLID_BRANCH) return true;
  for (int axis = 0, arm = 0; axis < 3; axis++)
    for (int side = 0; side < 2; side++, arm++) {
      const bool way = side ? 2 * c[axis] + 1 >= s->cells[axis] : 2 * c[axis] < s->cells[axis];
      if (arm < s->arms && way && middle[(axis + 1) % 3] && middle[(axis + 2) % 3]) return true;
    }
  return false;
}

static int corner(const lattice *l, const int at[3]) {
  return at[0] + l->corners[0] * (at[1] + l->corners[1] * at[2]);
}

static int number_vertex(lattice *l, const int at[3]) {
  int *v = &l->vertex[corner(l, at)];
  if (*v >= 0) return *v;
  int cells = 0;
  for (int k = 0; k < 8; k++) {
    const int c[3] = {at[0] - (k & 1), at[1] - (k >> 1 & 1), at[2] - (k >> 2)};
    cells += has_cell(l->solid, c);
  }
  l->inner[l->nv] = cells == 8;
  for (int i = 0; i < 3; i++) l->home[3 * l->nv + i] = (double)at[i] / l->solid->cells[i];
  return *v = l->nv++;
}

// Kuhn: the six orders in which the axes of a cell can be walked.
static void add_cell(lattice *l, const int c[3]) {
  static const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1},
                                   {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  for (int t = 0; t < 6; t++) {
    int at[3] = {c[0], c[1], c[2]}, *tet = l->tet + 4 * l->nt++;
    tet[0] = number_vertex(l, at);
    for (int s = 0; s < 3; s++) {
      at[orders[t][s]]++;
      tet[s + 1] = number_vertex(l, at);
    }
    if (t < 3) continue; // odd orders turn the other way round
    const int kept = tet[2];
    tet[2] = tet[3], tet[3] = kept;
  }
}

static lattice make_lattice(const random_solid *s) {
  lattice l = {.solid = s, .corners = {s->cells[0] + 1, s->cells[1] + 1, s->cells[2] + 1}};
  const size_t corners = (size_t)l.corners[0] * (size_t)l.corners[1] * (size_t)l.corners[2];
  l.vertex = taken(corners * sizeof *l.vertex);
  for (size_t i = 0; i < corners; i++) l.vertex[i] = -1;
  l.home = taken(3 * corners * sizeof *l.home);
  l.inner = taken(corners * sizeof *l.inner);
  l.tet = taken(24 * corners * sizeof *l.tet);
  int c[3];
  for (c[2] = 0; c[2] < s->cells[2]; c[2]++)
    for (c[1] = 0; c[1] < s->cells[1]; c[1]++)
      for (c[0] = 0; c[0] < s->cells[0]; c[0]++)
        if (has_cell(s, c)) add_cell(&l, c);
  return l;
}

static void free_lattice(lattice *l) {
  free(l->vertex);
  free(l->home);
  free(l->inner);
  free(l->tet);
}

// ---- from the lattice to the solid -------------------------------------------------------------

// Cells grow by a constant factor from one end to the other; t in [0, 1].
static double graded(double t, double grading, int cells) {
  if (grading == 1 || cells < 2) return t;
  const double q = pow(grading, 1.0 / (cells - 1));
  return (pow(q, cells * t) - 1) / (pow(q, cells) - 1);
}

static void form(const random_solid *s, double x[3]) {
  for (int i = 0; i < 3; i++)
    x[i] = s->size[i] * (graded(x[i], s->grading[i], s->cells[i]) - (i ? 0.5 : 0));
  if (s->arc == 0) return;
  const double radius = s->size[0] / s->arc, angle = x[0] / radius, out = radius - x[1];
  x[0] = out * sin(angle);
  x[1] = radius - out * cos(angle);
}

// Vertices of the surface go most of the way to the ellipsoid.
static void round_off(const lattice *l, int v, double share, double x[3]) {
  double radius = 0;
  for (int i = 0; i < 3; i++) radius += pow(2 * x[i] - 1, 2);
  radius = sqrt(radius);
  if (l->inner[v] || radius == 0) return;
  const double scale = 1 + share * (1 / radius - 1);
  for (int i = 0; i < 3; i++) x[i] = 0.5 + scale * (x[i] - 0.5);
}

static void positions(const lattice *l, double strength, double *x) {
  const random_solid *s = l->solid;
  ep_random rng = ep_random_seed(s->seed, 1);
  for (int v = 0; v < l->nv; v++) {
    double *p = x + 3 * v;
    const double share = l->inner[v] ? 1 : 0.5;
    for (int i = 0; i < 3; i++)
      p[i] = l->home[3 * v + i] + strength * share * s->jitter * between(&rng, -1, 1) / s->cells[i];
    if (s->shape == SOLID_ELLIPSOID) round_off(l, v, 0.8 * strength, p);
    form(s, p);
  }
}

static double volume_of(const double *x, const int *t) {
  double e[3][3];
  for (int k = 0; k < 3; k++)
    for (int i = 0; i < 3; i++) e[k][i] = x[3 * t[k + 1] + i] - x[3 * t[0] + i];
  return (e[0][0] * (e[1][1] * e[2][2] - e[1][2] * e[2][1]) -
          e[0][1] * (e[1][0] * e[2][2] - e[1][2] * e[2][0]) +
          e[0][2] * (e[1][0] * e[2][1] - e[1][1] * e[2][0])) /
         6;
}

// Smallest volume of a tet over what it has without jitter, or 0.
static double worst_tet(const lattice *l, const double *x, const double *plain) {
  double worst = 1;
  for (int t = 0; t < l->nt; t++)
    worst = fmin(worst, volume_of(x, l->tet + 4 * t) / volume_of(plain, l->tet + 4 * t));
  return worst;
}

ep_mesh solid_mesh(const random_solid *s) {
  lattice l = make_lattice(s);
  const size_t bytes = 3 * (size_t)l.nv * sizeof(double);
  double *x = taken(bytes), *plain = taken(bytes);
  positions(&l, 0, plain);
  double strength = 1;
  positions(&l, strength, x);
  while (worst_tet(&l, x, plain) < 0.1 && strength > 1e-3) positions(&l, strength /= 2, x);
  ep_mesh mesh;
  ep_mesh_findings findings;
  ep_error err = {0};
  if (ep_mesh_make(l.nv, x, l.nt, l.tet, solid_name(s->shape), &mesh, &findings, &err) != EP_OK)
    fail_msg("%s", err.text);
  assert_int_equal(findings.repaired_orientation, 0);
  free(x);
  free(plain);
  free_lattice(&l);
  return mesh;
}

double solid_length(const random_solid *s) {
  return s->arc == 0 ? s->size[0] : s->size[0] / s->arc * sin(fmin(s->arc, 1.57));
}

void pose_points(const random_solid *s, const random_pose *pose, int n, double *x) {
  const double length = solid_length(s);
  for (int v = 0; v < n; v++) {
    double *p = x + 3 * v;
    const double t = fmax(0, p[0] / length - 0.15), angle = pose->twist * t;
    const double y = p[1] * cos(angle) - p[2] * sin(angle);
    const double z = p[1] * sin(angle) + p[2] * cos(angle);
    p[0] += pose->stretch * t * length;
    p[1] = y + pose->bend[0] * t * t;
    p[2] = z + pose->bend[1] * t * t;
  }
}

// ---- placed ------------------------------------------------------------------------------------

static void turn_inside_out(int *tet) {
  const int kept = tet[0];
  tet[0] = tet[1], tet[1] = kept;
}

ep_mesh placed_mesh(const ep_mesh *mesh, const placement *at, double share, int *to,
                    ep_mesh_findings *findings, int *inverted) {
  int turned = 0;
  const size_t nv = (size_t)mesh->nv, nt = (size_t)mesh->nt;
  ep_random rng = ep_random_seed(at->numbering, 2);
  int *vertex = taken(nv * sizeof *vertex), *order = taken(nt * sizeof *order);
  int *tet = taken(4 * nt * sizeof *tet);
  double *x = taken(3 * nv * sizeof *x);
  for (int v = 0; v < mesh->nv; v++) vertex[v] = v;
  for (int t = 0; t < mesh->nt; t++) order[t] = t;
  if (at->numbering) permutation(&rng, mesh->nv, vertex);
  if (at->numbering) permutation(&rng, mesh->nt, order);
  for (size_t v = 0; v < nv; v++) place_point(at, mesh->x + 3 * v, x + 3 * vertex[v]);
  for (size_t t = 0; t < nt; t++) {
    // turned about its first corner, which keeps the volume's sign
    const int *from = mesh->tet + 4 * t, turn = at->numbering ? ep_random_below(&rng, 3) : 0;
    int *out = tet + 4 * order[t];
    out[0] = vertex[from[0]];
    for (int i = 0; i < 3; i++) out[1 + i] = vertex[from[1 + (i + turn) % 3]];
    if (!chance(&rng, share)) continue;
    turn_inside_out(out);
    turned++;
  }
  if (inverted) *inverted = turned;
  ep_mesh out;
  ep_error err = {0};
  if (ep_mesh_make(mesh->nv, x, mesh->nt, tet, mesh->name, &out, findings, &err) != EP_OK)
    fail_msg("%s", err.text);
  if (to) memcpy(to, vertex, nv * sizeof *to);
  free(vertex);
  free(order);
  free(tet);
  free(x);
  return out;
}
