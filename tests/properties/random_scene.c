#include "random_scene.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "base/files.h"
#include "mesh/io.h"

static const double pi = 3.14159265358979323846;

// ---- draws -------------------------------------------------------------------------------------

static const char *one_of(ep_random *rng, int count, const char *const *from) {
  return from[ep_random_below(rng, count)];
}

static double thickness(const random_solid *s) {
  if (s->shape == SOLID_BRANCH) return 0.2;
  return fmin(s->size[1], s->size[2]);
}

static void some_vector(ep_random *rng, double length, double out[3]) {
  direction(rng, out);
  for (int i = 0; i < 3; i++) out[i] *= length;
}

// Sizes of loads that bend a bar of this thickness and length 1 by about `amount`.
static void draw_load(ep_random *rng, const random_scene *s, double amount, random_load *out) {
  const double t = thickness(&s->object);
  *out = (random_load){.kind = (load_kind)ep_random_below(rng, LOAD_KINDS),
                       .until = between(rng, 0.1, 0.6)};
  switch (out->kind) {
  case LOAD_GRAVITY:
    some_vector(rng, amount * s->young * t * t / (1.5 * s->density), out->vector);
    break;
  case LOAD_PUSH:
    some_vector(rng, amount * s->young * pow(t, 4) / 4, out->vector);
    break;
  case LOAD_PRESSURE:
    out->size = amount * s->young * 0.2 * (chance(rng, 0.5) ? 1 : -1);
    out->part = s->held && chance(rng, 0.5);
    break;
  default:
    some_vector(rng, amount, out->vector);
    out->size = s->young * pow(t, 4) / 4 * between_powers(rng, 0.1, 100);
    out->damping = out->size * between(rng, 0, 0.1);
  }
}

// Of the solid about the middle of its lattice's axis.
static double radius_of(const random_solid *solid) {
  ep_mesh mesh = solid_mesh(solid);
  double square = 0;
  for (int v = 0; v < mesh.nv; v++) {
    const double *x = mesh.x + 3 * v;
    square = fmax(square, pow(x[0] - 0.5, 2) + x[1] * x[1] + x[2] * x[2]);
  }
  ep_mesh_free(&mesh);
  return sqrt(square);
}

// Beside the object, however it is turned at the start; not tame ones may stand in it.
static void draw_obstacle(ep_random *rng, const random_scene *s, double speed,
                          random_obstacle *out) {
  *out = (random_obstacle){.kind = (solid_obstacle)ep_random_below(rng, 3),
                           .radius = between(rng, 0.1, 0.4),
                           .friction = chance(rng, 0.5) ? between(rng, 0, 1) : 0,
                           .moves = chance(rng, 0.4)};
  direction(rng, out->normal);
  static const double reach[] = {[IS_PLANE] = 0, [IS_SPHERE] = 1, [IS_BOX] = 1.8};
  const double gap = between(rng, s->tame ? 0.01 : -0.5, 0.1);
  const double away = radius_of(&s->object) + reach[out->kind] * out->radius + gap;
  for (int i = 0; i < 3; i++) out->point[i] = (i ? 0 : 0.5) - away * out->normal[i];
  for (int i = 0; i < 3; i++) out->move[i] = speed * 0.3 * out->normal[i];
}

static void draw_family(ep_random *rng, const random_scene *s, random_family *out) {
  *out = (random_family){.other = chance(rng, 0.4), .solid = s->object, .beside = at_home()};
  out->poses = from_to(rng, 1, POSES_MOST);
  for (int i = 0; i < out->poses; i++)
    out->pose[i] = draw_pose(rng, s->tame ? between(rng, 0.1, 0.6) : between(rng, 0.1, 3));
  out->local = chance(rng, 0.2);
  // landmarks stand at the ends of the axes: only straight solids have them there
  const bool straight = s->object.shape == SOLID_BOX || s->object.shape == SOLID_ELLIPSOID;
  out->landmarks = out->other && chance(rng, 0.5) && straight;
  if (!out->other) return;
  out->solid = other_lattice(&s->object, between(rng, 0.9, 1.4), ep_random_u32(rng));
  out->beside.unit = between_powers(rng, 0.5, 2);
  out->beside.numbering = 1 + ep_random_u32(rng);
  rotation(rng, between(rng, 0, 0.25), out->beside.R);
  for (int i = 0; i < 3; i++) out->beside.t[i] = between(rng, -1, 1);
}

static void draw_material(ep_random *rng, random_scene *s) {
  static const double poisson[] = {0, 0.3, 0.4, 0.45, 0.49, 0.4999};
  s->model = (ep_material)ep_random_below(rng, EP_MATERIALS);
  s->young = between_powers(rng, 1e3, 1e7);
  s->density = between_powers(rng, 100, 900);
  s->poisson = poisson[ep_random_below(rng, 6)];
}

static void draw_reduction(ep_random *rng, random_scene *s) {
  s->cubic = (s->model == EP_STVK || s->model == EP_STVK_VOLUME) && chance(rng, 0.5);
  s->narrow = chance(rng, 0.15);
  s->eigenfunctions = from_to(rng, 4, 8);
  s->modes = from_to(rng, 6, 16);
  s->linear_modes = from_to(rng, 3, 8);
  s->path_samples = from_to(rng, 0, 2);
  // linear modes and their derivatives: more cannot be had without examples
  const int most = s->linear_modes * (s->linear_modes + 3) / 2;
  if (s->tame && s->modes > most) s->modes = most;
  s->elements = from_to(rng, 15, 60);
  s->training = from_to(rng, 20, 50);
}

static void draw_simulation(ep_random *rng, random_scene *s) {
  static const double steps[] = {1.0 / 240, 1.0 / 60, 1.0 / 60, 1.0 / 30};
  s->integrator = (ep_integrator)ep_random_below(rng, 3);
  s->dt = s->tame ? steps[ep_random_below(rng, 4)] : between_powers(rng, 1e-4, 0.2);
  s->steps = from_to(rng, 5, 25);
  s->damping_mass = chance(rng, 0.5) ? between(rng, 0, 2) : 0;
  s->damping_stiffness = chance(rng, 0.7) ? between(rng, 0, 0.05) : 0;
}

static void draw_examples(ep_random *rng, random_scene *s) {
  static const char *const paths[] = {"lb", "lb", "green", "both"};
  static const char *const solvers[] = {"nlopt", "newton"}, *const forces[] = {"energy", "linear"};
  const bool extreme = !s->tame && chance(rng, 0.4);
  s->path = one_of(rng, 4, paths);
  s->solver = one_of(rng, 2, solvers);
  s->force = one_of(rng, 2, forces);
  s->alpha = between(rng, 0, s->tame ? 0.9 : 1);
  s->sum_to_one = chance(rng, 0.3) ? between_powers(rng, 0.01, 10) : 0;
  s->non_negative = chance(rng, 0.3) ? between_powers(rng, 0.01, 10) : 0;
  s->strength = chance(rng, 0.15) ? 0 : between_powers(rng, 0.1, extreme ? 1e4 : 10);
  s->relief = chance(rng, 0.3) ? between(rng, 0, 0.9) : 0;
  s->region_strength = between(rng, 0, 3);
  for (int i = 0; i < s->families && s->tame; i++) {
    if (!s->family[i].local) continue; // what local examples need
    s->force = "energy";
    if (s->cubic) s->relief = 0;
  }
}

random_scene draw_scene(uint64_t seed, double wild) {
  ep_random own = ep_random_seed(seed, 5), *rng = &own;
  random_scene s = {.seed = seed, .tame = !chance(rng, wild), .object = draw_solid(rng)};
  const double amount = s.tame ? between(rng, 0.01, 0.4) : between_powers(rng, 0.01, 1e3);
  s.held = chance(rng, 0.65);
  s.two_parts = !s.tame && chance(rng, 0.1);
  s.held_by = (selection_kind)ep_random_below(rng, 3);
  draw_material(rng, &s);
  draw_reduction(rng, &s);
  s.families = chance(rng, 0.3) ? 0 : from_to(rng, 1, FAMILIES_MOST);
  for (int i = 0; i < s.families; i++) draw_family(rng, &s, &s.family[i]);
  draw_simulation(rng, &s);
  draw_examples(rng, &s);
  s.loads = ep_random_below(rng, LOADS_MOST + 1);
  for (int i = 0; i < s.loads; i++) draw_load(rng, &s, amount, &s.load[i]);
  s.obstacles = chance(rng, 0.3) ? from_to(rng, 1, OBSTACLES_MOST) : 0;
  for (int i = 0; i < s.obstacles; i++) draw_obstacle(rng, &s, 1 + amount, &s.obstacle[i]);
  some_vector(rng, chance(rng, 0.5) ? 2 * amount : 0, s.velocity);
  some_vector(rng, chance(rng, 0.5) ? 5 * amount : 0, s.spin);
  direction(rng, s.axis);
  s.angle = chance(rng, 0.5) ? between(rng, -180, 180) : 0;
  s.formats = chance(rng, 0.2) ? ep_random_below(rng, 8) : 0;
  s.guards = chance(rng, 0.15); // most of a bake's time: few scenes look for them
  return s;
}

placement draw_scene_placement(const random_scene *s, ep_random *rng) {
  placement at = draw_placement(rng);
  bool drags = false;
  for (int i = 0; i < s->loads; i++) drags = drags || s->load[i].kind == LOAD_DRAG;
  if (drags) at.unit = pow(2, from_to(rng, -10, 5));
  return at;
}

// ---- text --------------------------------------------------------------------------------------

typedef struct writer {
  const random_scene *s;
  const placement *at;
  FILE *file;
  int piece;  // the next one
  int within; // pieces written of the section at hand
  const char *section;
} writer;

typedef struct three {
  char text[96];
} three;

static three numbers(const double v[3]) {
  three out;
  snprintf(out.text, sizeof out.text, "[%.17g, %.17g, %.17g]", v[0], v[1], v[2]);
  return out;
}

// A point, a direction, a vector with unit u^power.
static three at_point(const writer *w, const double x[3]) {
  double out[3];
  place_point(w->at, x, out);
  return numbers(out);
}

static three along(const writer *w, const double x[3], double scale) {
  double out[3];
  place_vector(w->at, x, out);
  for (int i = 0; i < 3; i++) out[i] *= scale;
  return numbers(out);
}

static void section(writer *w, const char *name) {
  w->section = name;
  w->within = 0;
}

// One piece of the section, unless it is left out.
static void put(writer *w, char opening, const char *format, ...) {
  const bool off = w->s->off >> w->piece++ & 1;
  if (off) return;
  if (w->within++ == 0)
    fprintf(w->file, "%s: %c", w->section, opening);
  else
    fputs(",\n  ", w->file);
  va_list args;
  va_start(args, format);
  vfprintf(w->file, format, args);
  va_end(args);
}

static void end(writer *w, char closing) {
  if (w->within) fprintf(w->file, "%c\n", closing);
}

// What lies beyond a share of the length from what is held.
static void write_plane(const writer *w, double share, char *text, size_t size) {
  const double point[3] = {share * solid_length(&w->s->object), 0, 0}, normal[3] = {-1, 0, 0};
  snprintf(text, size, "plane: {point: %s, normal: %s}", at_point(w, point).text,
           along(w, normal, 1).text);
}

// ---- meshes ------------------------------------------------------------------------------------

static void save(const char *folder, const char *name, const ep_mesh *mesh, const ep_field *field) {
  char path[EP_PATH_MAX];
  ep_error err = {0};
  snprintf(path, sizeof path, "%s/%s.%s", folder, name, field ? "vtu" : "veg");
  const ep_status status = field ? ep_mesh_write_vtu(path, mesh, NULL, 1, field, 0, NULL, &err)
                                 : ep_mesh_write_veg(path, mesh, &err);
  if (status != EP_OK) fail_msg("%s", err.text);
}

// `at` after `first`.
static placement after(const placement *first, const placement *at) {
  placement out = {.unit = first->unit * at->unit, .numbering = first->numbering + at->numbering};
  double moved[3];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      for (int k = 0; k < 3; k++) out.R[3 * i + j] += at->R[3 * i + k] * first->R[3 * k + j];
  place_vector(at, first->t, moved);
  for (int i = 0; i < 3; i++) out.t[i] = moved[i] + at->t[i] / first->unit;
  return out;
}

static void save_pose(const char *folder, const char *name, const random_solid *solid,
                      const random_pose *pose, const placement *at) {
  ep_mesh mesh = solid_mesh(solid);
  if (pose) pose_points(solid, pose, mesh.nv, mesh.x);
  ep_mesh placed = placed_mesh(&mesh, at, 0, NULL, NULL, NULL);
  save(folder, name, &placed, NULL);
  ep_mesh_free(&placed);
  ep_mesh_free(&mesh);
}

// A second piece beside the first.
static void double_mesh(ep_mesh *mesh) {
  const size_t nv = (size_t)mesh->nv, nt = (size_t)mesh->nt;
  double *x = malloc(6 * nv * sizeof *x);
  int *tet = malloc(8 * nt * sizeof *tet);
  ep_mesh both;
  ep_error err = {0};
  assert_true(x && tet);
  for (size_t i = 0; i < 6 * nv; i++)
    x[i] = mesh->x[i % (3 * nv)] + (i >= 3 * nv && i % 3 == 0 ? 2 : 0);
  for (size_t i = 0; i < 8 * nt; i++) tet[i] = mesh->tet[i % (4 * nt)] + (i < 4 * nt ? 0 : (int)nv);
  if (ep_mesh_make(2 * mesh->nv, x, 2 * mesh->nt, tet, "two", &both, NULL, &err) != EP_OK)
    fail_msg("%s", err.text);
  ep_mesh_free(mesh);
  *mesh = both;
  free(x);
  free(tet);
}

static void save_held(const char *folder, const ep_mesh *home, const int *to, double until) {
  char path[EP_PATH_MAX];
  snprintf(path, sizeof path, "%s/held.txt", folder);
  FILE *f = fopen(path, "w");
  assert_non_null(f);
  for (int v = 0; v < home->nv; v++)
    if (home->x[3 * v] <= until) fprintf(f, "%d\n", to[v] + 1);
  fclose(f);
}

static const double held_share = 0.12;

static void save_object(const random_scene *s, const placement *at, const char *folder, int *to) {
  ep_mesh home = solid_mesh(&s->object);
  if (s->two_parts) double_mesh(&home);
  const size_t nv = (size_t)home.nv;
  int *numbers_of = malloc(nv * sizeof *numbers_of);
  double *paint = calloc(nv, sizeof *paint);
  assert_true(numbers_of && paint);
  ep_mesh placed = placed_mesh(&home, at, 0, numbers_of, NULL, NULL);
  const double until = held_share * solid_length(&s->object);
  for (size_t v = 0; v < nv; v++) paint[numbers_of[v]] = home.x[3 * v] <= until;
  const ep_field field = {"paint", 1, paint};
  save(folder, "object", &placed, s->held_by == BY_FIELD ? &field : NULL);
  save_held(folder, &home, numbers_of, until);
  if (to) memcpy(to, numbers_of, nv * sizeof *to);
  free(paint);
  free(numbers_of);
  ep_mesh_free(&placed);
  ep_mesh_free(&home);
}

static void save_families(const random_scene *s, const placement *at, const char *folder) {
  for (int i = 0; i < s->families; i++) {
    const random_family *f = &s->family[i];
    const placement where = f->other ? after(&f->beside, at) : *at;
    char name[40];
    snprintf(name, sizeof name, "rest%d", i);
    if (f->other) save_pose(folder, name, &f->solid, NULL, &where);
    for (int p = 0; p < f->poses; p++) {
      snprintf(name, sizeof name, "pose%d-%d", i, p);
      save_pose(folder, name, &f->solid, &f->pose[p], &where);
    }
  }
}

// ---- sections ----------------------------------------------------------------------------------

static void write_object(writer *w) {
  static const char *const laws[] = {"stvk", "stvk-volume", "neohookean", "corotational"};
  const random_scene *s = w->s;
  const double u = w->at->unit;
  fprintf(w->file,
          "schema: 1\nname: random\nobject:\n  mesh: object.%s\n  material: {model: %s, "
          "density: %.17g, young: %.17g, poisson: %.17g}\n",
          s->held_by == BY_FIELD ? "vtu" : "veg", laws[s->model], s->density / u, s->young * u,
          s->poisson);
}

static void write_fixed(writer *w) {
  const double point[3] = {held_share * solid_length(&w->s->object), 0, 0}, normal[3] = {1, 0, 0};
  section(w, "fixed");
  if (!w->s->held) return;
  if (w->s->held_by == BY_FILE) fprintf(w->file, "fixed: [{file: held.txt}]\n");
  if (w->s->held_by == BY_FIELD) fprintf(w->file, "fixed: [{field: paint, above: 0.5}]\n");
  if (w->s->held_by == BY_PLANE)
    fprintf(w->file, "fixed: [{plane: {point: %s, normal: %s}}]\n", at_point(w, point).text,
            along(w, normal, 1).text);
}

static void write_landmarks(const writer *w, const random_family *f, char *text, size_t size) {
  static const double ends[4][3] = {{0, 0, 0}, {1, 0, 0}, {0.5, 0.5, 0}, {0.5, 0, 0.5}};
  const placement where = after(&f->beside, w->at);
  const writer other = {.at = &where};
  size_t used = (size_t)snprintf(text, size, "landmarks: [");
  for (int i = 0; i < 4; i++) {
    double x[3];
    for (int k = 0; k < 3; k++)
      x[k] = ends[i][k] * (k ? w->s->object.size[k] : solid_length(&w->s->object));
    used += (size_t)snprintf(text + used, size - used, "%s{object_at: %s, rest_at: %s}",
                             i ? ", " : "", at_point(w, x).text, at_point(&other, x).text);
  }
  snprintf(text + used, size - used, "], ");
}

static void write_families(writer *w) {
  const random_scene *s = w->s;
  section(w, "families");
  for (int i = 0; i < s->families; i++) {
    const random_family *f = &s->family[i];
    char rest[300] = "", region[400] = "", plane[240], marks[1600] = "", second[40] = "";
    write_plane(w, 0.5, plane, sizeof plane);
    if (f->landmarks) write_landmarks(w, f, marks, sizeof marks);
    if (f->other) snprintf(rest, sizeof rest, "rest: rest%d.veg, ", i);
    if (f->local)
      snprintf(region, sizeof region,
               ", region: {%s, soft: %.17g, eigenfunctions: 4, strength: %.17g}", plane,
               0.1 * w->at->unit, s->region_strength);
    if (f->poses > 1) snprintf(second, sizeof second, ", pose%d-1.veg", i);
    put(w, '[', "{name: f%d, %sposes: [pose%d-0.veg%s], map: {%saccept: true}%s}", i, rest, i,
        second, marks, region);
  }
  end(w, ']');
}

static void write_reduction(writer *w) {
  const random_scene *s = w->s;
  section(w, "reduction");
  w->within = 1; // modes stand whatever is left out: examples need them
  fprintf(w->file, "reduction: {modes: %d, training_poses: %d", s->modes, s->training);
  put(w, '{', "eigenfunctions: %d", s->eigenfunctions);
  put(w, '{', "linear_modes: %d", s->linear_modes);
  put(w, '{', "path_samples: %d", s->path_samples);
  put(w, '{', "elements: %d", s->elements);
  if (s->cubic) put(w, '{', "evaluator: cubic");
  if (!s->guards) fputs(", guards: 0", w->file);
  end(w, '}');
}

static void write_simulation(writer *w) {
  static const char *const integrators[] = {"implicit-euler", "newmark", "bdf2"};
  const random_scene *s = w->s;
  section(w, "simulation");
  put(w, '{', "dt: %.17g", s->dt);
  put(w, '{', "steps: %d", s->steps);
  put(w, '{', "integrator: %s", integrators[s->integrator]);
  if (s->narrow) put(w, '{', "precision: float");
  put(w, '{', "damping: {mass: %.17g, stiffness: %.17g}", s->damping_mass, s->damping_stiffness);
  end(w, '}');
}

static void write_examples(writer *w) {
  const random_scene *s = w->s;
  section(w, "examples");
  if (!s->families) return;
  put(w, '{', "path: %s", s->path);
  put(w, '{', "solver: %s", s->solver);
  put(w, '{', "force: %s", s->force);
  put(w, '{', "alpha: %.17g", s->alpha);
  if (s->sum_to_one > 0 || s->non_negative > 0)
    put(w, '{', "constraints: {sum_to_one: %.17g, non_negative: %.17g}", s->sum_to_one,
        s->non_negative);
  put(w, '{', "strength: %.17g", s->strength);
  if (s->relief > 0) put(w, '{', "relief: %.17g", s->relief);
  end(w, '}');
}

static void write_load(writer *w, const random_load *l) {
  const double u = w->at->unit, tip[3] = {solid_length(&w->s->object), 0, 0};
  char plane[240];
  double to[3];
  write_plane(w, TIP_SHARE, plane, sizeof plane);
  for (int i = 0; i < 3; i++) to[i] = tip[i] + l->vector[i];
  switch (l->kind) {
  case LOAD_GRAVITY:
    put(w, '[', "{gravity: %s}", along(w, l->vector, u).text);
    break;
  case LOAD_PUSH:
    put(w, '[', "{push: {%s, force: %s, until: %.17g, ramp: 0.03}}", plane,
        along(w, l->vector, u * u * u).text, l->until);
    break;
  case LOAD_PRESSURE:
    put(w, '[', "{pressure: {%s%spascal: %.17g, until: %.17g}}", l->part ? plane : "",
        l->part ? ", " : "", l->size * u, l->until);
    break;
  default:
    put(w, '[',
        "{drag: {%s, path: [{time: 0, at: %s}, {time: %.17g, at: %s}], stiffness: %.17g, "
        "damping: %.17g}}",
        plane, at_point(w, tip).text, l->until, at_point(w, to).text, l->size * u * u,
        l->damping * u * u);
  }
}

// Axis and angle of a rotation matrix.
static double turn_of(const double R[9], double axis[3]) {
  double sine = 0;
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    axis[i] = R[3 * k + j] - R[3 * j + k];
    sine += axis[i] * axis[i];
  }
  if (sine == 0) axis[0] = 1;
  return atan2(sqrt(sine), R[0] + R[4] + R[8] - 1) * 180 / pi;
}

static void write_obstacle(writer *w, const random_obstacle *o) {
  const double u = w->at->unit;
  char solid[500], motion[200] = "";
  double centre[3], low[3], high[3], axis[3];
  place_point(w->at, o->point, centre);
  for (int i = 0; i < 3; i++)
    low[i] = centre[i] - u * o->radius, high[i] = centre[i] + u * o->radius;
  if (o->kind == IS_PLANE)
    snprintf(solid, sizeof solid, "plane: {point: %s, normal: %s}", numbers(centre).text,
             along(w, o->normal, 1).text);
  if (o->kind == IS_SPHERE)
    snprintf(solid, sizeof solid, "sphere: {center: %s, radius: %.17g}", numbers(centre).text,
             u * o->radius);
  const double degrees = turn_of(w->at->R, axis);
  if (o->kind == IS_BOX)
    snprintf(solid, sizeof solid, "box: {low: %s, high: %s, rotation: {axis: %s, degrees: %.17g}}",
             numbers(low).text, numbers(high).text, numbers(axis).text, degrees);
  if (o->moves)
    snprintf(motion, sizeof motion, ", motion: [{time: 0}, {time: 0.2, move: %s}], smooth: true",
             along(w, o->move, u).text);
  put(w, '[', "{%s, friction: %.17g%s}", solid, o->friction, motion);
}

static void write_start(writer *w) {
  const random_scene *s = w->s;
  section(w, "start");
  if (s->held) return;
  put(w, '{', "velocity: %s", along(w, s->velocity, w->at->unit).text);
  put(w, '{', "spin: %s", along(w, s->spin, 1).text);
  put(w, '{', "rotation: {axis: %s, degrees: %.17g}", along(w, s->axis, 1).text, s->angle);
  end(w, '}');
}

static void write_output(writer *w) {
  static const char *const formats[] = {"vtu", "glb", "png"};
  const char *between_them = "";
  fputs("output: {formats: [", w->file);
  for (int i = 0; i < 3; i++) {
    if (!(w->s->formats >> i & 1)) continue;
    fprintf(w->file, "%s%s", between_them, formats[i]);
    between_them = ", ";
  }
  fputs("]}\n", w->file);
}

int write_scene(const random_scene *s, const placement *at, const char *folder, int *to) {
  char path[EP_PATH_MAX];
  ep_error err = {0};
  if (ep_make_folders(folder, &err) != EP_OK) fail_msg("%s", err.text);
  save_object(s, at, folder, to);
  save_families(s, at, folder);
  snprintf(path, sizeof path, "%s/scene.yaml", folder);
  writer w = {.s = s, .at = at, .file = fopen(path, "w")};
  assert_non_null(w.file);
  write_object(&w);
  write_fixed(&w);
  write_families(&w);
  write_reduction(&w);
  write_simulation(&w);
  write_examples(&w);
  section(&w, "loads");
  for (int i = 0; i < s->loads; i++) write_load(&w, &s->load[i]);
  end(&w, ']');
  section(&w, "obstacles");
  for (int i = 0; i < s->obstacles; i++) write_obstacle(&w, &s->obstacle[i]);
  end(&w, ']');
  write_start(&w);
  write_output(&w);
  fclose(w.file);
  return w.piece;
}

void make_scene_smaller(random_scene *s, const char *folder,
                        bool (*fails)(const random_scene *s, const char *folder, char *why),
                        char *why) {
  const placement home = at_home();
  const int pieces = write_scene(s, &home, folder, NULL);
  for (int i = 0; i < pieces && i < 64; i++) {
    random_scene smaller = *s;
    char other[WHY];
    smaller.off |= (uint64_t)1 << i;
    if (!fails(&smaller, folder, other)) continue;
    *s = smaller;
    memcpy(why, other, WHY);
  }
  fails(s, folder, why);
}
