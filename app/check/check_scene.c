// The meshes of a scene together: material, fixed vertices, examples against the object.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/check/check.h"
#include "app/plan/plan.h"
#include "app/scene/select.h"

// Linear tets lock towards incompressibility: bending is too stiff by tens of percent from here on.
#define LOCKING_POISSON 0.49
// A bar of StVK under compression has its largest force at this stretch and gets softer below
// (sqrt(1/3): d/ds of s (s^2 - 1) = 0).
#define STVK_STRETCH 0.577
// An example that is, but for this share, a combination of those before adds noise only.
#define DEPENDENT_SHARE 0.01

typedef struct checker {
  ep_check *check;
  const ep_scene *scene;
  int object; // place in check->mesh
  ep_error *err;
} checker;

#define ADD(severity, code, file, ...)                                                             \
  EP_TRY(ep_check_add(c->check, severity, code, file, false, c->err, __VA_ARGS__))

static const ep_checked_mesh *mesh_of(const checker *c, int number) {
  return &c->check->mesh[number];
}

// ---- material ----------------------------------------------------------------------------------

static ep_status check_constants(checker *c, const char *where, const ep_elastic *m) {
  if (m->poisson > LOCKING_POISSON)
    ADD(EP_FOUND_WARNING, "locking", where,
        "poisson %g: linear tets lock from about %g on and bend too stiffly; use a smaller one",
        m->poisson, LOCKING_POISSON);
  if (m->young < 100)
    ADD(EP_FOUND_WARNING, "young", where,
        "young %g Pa is softer than any solid; is it in MPa (times 1e6) or GPa (times 1e9)?",
        m->young);
  if (m->density < 1 || m->density > 25000)
    ADD(EP_FOUND_WARNING, "density", where,
        "density %g kg/m^3 is that of no solid; is it in g/cm^3 (times 1000)?", m->density);
  return EP_OK;
}

static ep_status check_material(checker *c) {
  const ep_scene *scene = c->scene;
  const ep_mesh *mesh = &mesh_of(c, c->object)->mesh;
  const ep_elastic *list = scene->has_material ? &scene->material : mesh->material;
  const int count = scene->has_material ? 1 : mesh->nmaterials;
  if (!count) {
    ADD(EP_FOUND_ERROR, "no-material", scene->path,
        "%s carries no material: give object.material density, young and poisson", mesh->name);
    return EP_OK;
  }
  for (int i = 0; i < count; i++)
    EP_TRY(check_constants(c, scene->has_material ? scene->path : mesh->name, &list[i]));
  double mass = 0, g[12];
  for (int e = 0; e < mesh->nt; e++)
    mass += ep_tet_gradients(mesh, e, g) * list[count > 1 ? mesh->tet_material[e] : 0].density;
  ADD(EP_FOUND_NOTE, "mass", scene->path,
      "the object has a mass of %.4g kg and a volume of %.4g m^3", mass, ep_mesh_volume(mesh));
  if (scene->model == EP_STVK)
    ADD(EP_FOUND_NOTE, "stvk", scene->path,
        "stvk gets softer below %.0f %% of a length and lets tets turn inside out; stvk-volume "
        "keeps "
        "their volume",
        100 * STVK_STRETCH);
  return EP_OK;
}

// ---- fixed vertices ----------------------------------------------------------------------------

// Square of the largest distance of the vertices from the line through the two that lie farthest
// apart (about), over the square of that distance.
static double off_line(const ep_mesh *mesh, int count, const int *vertex) {
  const double *a = mesh->x + 3 * (size_t)vertex[0], *b = a;
  double longest = 0, worst = 0;
  for (int i = 1; i < count; i++) {
    const double *x = mesh->x + 3 * (size_t)vertex[i];
    const double d = hypot(hypot(x[0] - a[0], x[1] - a[1]), x[2] - a[2]);
    if (d > longest) longest = d, b = x;
  }
  for (int i = 0; i < count && longest > 0; i++) {
    const double *x = mesh->x + 3 * (size_t)vertex[i];
    double along = 0, square = 0;
    for (int k = 0; k < 3; k++) {
      along += (x[k] - a[k]) * (b[k] - a[k]) / longest;
      square += (x[k] - a[k]) * (x[k] - a[k]);
    }
    worst = fmax(worst, square - along * along);
  }
  return longest > 0 ? worst / (longest * longest) : 0;
}

static ep_status check_fixed(checker *c) {
  const ep_scene *scene = c->scene;
  const ep_mesh *mesh = &mesh_of(c, c->object)->mesh;
  int count, *vertex;
  ep_error bad = {0};
  const ep_status status = ep_select_fixed(scene, mesh, &count, &vertex, &bad);
  if (status == EP_ERR_MEMORY || status == EP_ERR_IO)
    return ep_fail(c->err, status, "%s", bad.text);
  if (status != EP_OK) {
    ADD(EP_FOUND_ERROR, "fixed", scene->path, "%s", bad.text);
    return EP_OK;
  }
  const bool line = count > 0 && (count < 3 || off_line(mesh, count, vertex) < 1e-12);
  const int first = count ? mesh->file_vertex[vertex[0]] + 1 : 0;
  free(vertex);
  if (line)
    ADD(EP_FOUND_ERROR, "fixed-turns", scene->path,
        "fixed holds %d vert%s (first: vertex %d) %s: the object still turns about %s; hold at "
        "least "
        "three that are not in a line",
        count, count > 1 ? "ices" : "ex", first, count > 2 ? "in one line" : "only",
        count > 1 ? "the line through them" : "it");
  return EP_OK;
}

// ---- examples ----------------------------------------------------------------------------------

// Smallest eigenvalue of a symmetric 3 x 3 matrix (trigonometric form).
static double smallest_eigenvalue(const double a[9]) {
  const double mean = (a[0] + a[4] + a[8]) / 3;
  const double off = a[1] * a[1] + a[2] * a[2] + a[5] * a[5];
  const double x = a[0] - mean, y = a[4] - mean, z = a[8] - mean;
  const double p = sqrt((x * x + y * y + z * z + 2 * off) / 6);
  if (!(p > 0)) return mean;
  const double det =
      x * (y * z - a[5] * a[5]) - a[1] * (a[1] * z - a[5] * a[2]) + a[2] * (a[1] * a[5] - y * a[2]);
  const double r = fmax(-1, fmin(1, det / (2 * p * p * p)));
  return mean + 2 * p * cos(acos(r) / 3 + 2 * M_PI / 3);
}

// Smallest principal stretch of tet e taken to positions x.
static double stretch_of(const ep_mesh *rest, const double *x, int e) {
  double g[12], f[9] = {0}, cg[9];
  ep_tet_gradients(rest, e, g);
  for (int v = 0; v < 4; v++)
    for (int i = 0; i < 9; i++)
      f[i] +=
          x[3 * (size_t)rest->tet[4 * (size_t)e + (size_t)v] + (size_t)(i / 3)] * g[3 * v + i % 3];
  for (int i = 0; i < 9; i++) {
    cg[i] = 0;
    for (int k = 0; k < 3; k++) cg[i] += f[3 * k + i / 3] * f[3 * k + i % 3];
  }
  return sqrt(fmax(0, smallest_eigenvalue(cg)));
}

static ep_status check_compression(checker *c, const ep_mesh *rest, const ep_mesh *pose) {
  if (c->scene->model != EP_STVK && c->scene->model != EP_STVK_VOLUME) return EP_OK;
  int count = 0, worst = 0;
  double lowest = INFINITY;
  for (int e = 0; e < rest->nt; e++) {
    const double stretch = stretch_of(rest, pose->x, e);
    count += stretch < STVK_STRETCH;
    if (stretch < lowest) lowest = stretch, worst = e;
  }
  if (count)
    ADD(EP_FOUND_WARNING, "stvk-range", pose->name,
        "%d tets are pressed below %.0f %% of a length (worst: tet %d, %.0f %%), where stvk gets "
        "softer; use neohookean or a milder pose",
        count, 100 * STVK_STRETCH, worst + 1, 100 * lowest);
  return EP_OK;
}

// How an example's mesh compares with the one it is a pose of.
static ep_status check_pair(checker *c, int rest_number, int pose_number) {
  const ep_checked_mesh *rest = mesh_of(c, rest_number), *pose = mesh_of(c, pose_number);
  if (!rest->read || !pose->read) return EP_OK;
  if (pose->findings.components != rest->findings.components)
    ADD(EP_FOUND_ERROR, "parts-differ", pose->file, "%d parts, but %s has %d: no map can join them",
        pose->findings.components, rest->file, rest->findings.components);
  const double ratio = ep_mesh_volume(&pose->mesh) / ep_mesh_volume(&rest->mesh);
  if (ratio < 0.5 || ratio > 2)
    ADD(EP_FOUND_WARNING, "volume-differs", pose->file,
        "the volume is %.3g times that of %s; is it a pose of it, at the same scale?", ratio,
        rest->file);
  if (ep_mesh_same_connectivity(&rest->mesh, &pose->mesh))
    EP_TRY(check_compression(c, &rest->mesh, &pose->mesh));
  return EP_OK;
}

// Displacements that can be compared vertex by vertex, made orthogonal as they come.
typedef struct group {
  const ep_mesh *rest;
  int count, room;
  double **q; // (count) of length 3 nv, |q| = 1
} group;

static void free_group(group *g) {
  for (int i = 0; i < g->count; i++) free(g->q[i]);
  free(g->q);
  memset(g, 0, sizeof *g);
}

// Displacement of the pose without its mean; returns its norm.
static double displacement(const ep_mesh *rest, const ep_mesh *pose, double *d) {
  double mean[3] = {0, 0, 0}, square = 0;
  const size_t n = 3 * (size_t)rest->nv;
  for (size_t i = 0; i < n; i++) mean[i % 3] += (pose->x[i] - rest->x[i]) / rest->nv;
  for (size_t i = 0; i < n; i++) {
    d[i] = pose->x[i] - rest->x[i] - mean[i % 3];
    square += d[i] * d[i];
  }
  return sqrt(square);
}

// What is left of d (of norm 1) beside the group's; d becomes that, of norm 1.
static double remainder_of(const group *g, double *d, size_t n) {
  double left = 0;
  for (int pass = 0; pass < 2; pass++) // twice is enough
    for (int i = 0; i < g->count; i++) {
      double dot = 0;
      for (size_t k = 0; k < n; k++) dot += d[k] * g->q[i][k];
      for (size_t k = 0; k < n; k++) d[k] -= dot * g->q[i][k];
    }
  for (size_t k = 0; k < n; k++) left += d[k] * d[k];
  left = sqrt(left);
  for (size_t k = 0; k < n && left > 0; k++) d[k] /= left;
  return left;
}

static ep_status add_to_group(checker *c, group *g, const ep_checked_mesh *pose) {
  const size_t n = 3 * (size_t)g->rest->nv;
  void *list = g->q;
  double *d = malloc(n * sizeof *d);
  if (!d) return ep_fail(c->err, EP_ERR_MEMORY, "no memory to compare the examples");
  if (g->count == g->room) list = realloc(g->q, (size_t)(g->room += 16) * sizeof *g->q);
  if (!list) {
    free(d);
    return ep_fail(c->err, EP_ERR_MEMORY, "no memory to compare the examples");
  }
  g->q = list;
  const double norm = displacement(g->rest, &pose->mesh, d);
  const double smallest = 1e-6 * ep_mesh_diagonal(g->rest) * sqrt(g->rest->nv);
  for (size_t k = 0; k < n && norm > 0; k++) d[k] /= norm;
  const double left = norm > smallest ? remainder_of(g, d, n) : 0;
  const bool keeps = norm > smallest && left > 0;
  if (keeps)
    g->q[g->count++] = d;
  else
    free(d);
  if (!(norm > smallest))
    ADD(EP_FOUND_WARNING, "pose-is-rest", pose->file,
        "the same shape as %s: it says nothing; leave it out", g->rest->name);
  else if (left < DEPENDENT_SHARE)
    ADD(EP_FOUND_WARNING, "dependent-examples", pose->file,
        "but for %.2g %% a combination of the poses before it: %d different examples so far; leave "
        "it out",
        100 * left, g->count - keeps);
  return EP_OK;
}

static ep_status check_family(checker *c, const ep_family *family, group *own) {
  int rest = c->object;
  if (family->rest) EP_TRY(ep_check_mesh_file(c->check, family->rest, &rest, c->err));
  if (rest != c->object && mesh_of(c, rest)->read && mesh_of(c, c->object)->read &&
      mesh_of(c, rest)->findings.components != mesh_of(c, c->object)->findings.components)
    ADD(EP_FOUND_ERROR, "parts-differ", mesh_of(c, rest)->file,
        "%d parts, but the object has %d: no map can join them",
        mesh_of(c, rest)->findings.components, mesh_of(c, c->object)->findings.components);
  group other = {0};
  ep_status status = EP_OK;
  for (int i = 0; i < family->poses && status == EP_OK; i++) {
    int pose;
    status = ep_check_mesh_file(c->check, family->pose[i], &pose, c->err);
    if (status == EP_OK) status = check_pair(c, rest, pose);
    const ep_mesh *r = &mesh_of(c, rest)->mesh, *o = &mesh_of(c, c->object)->mesh;
    if (status != EP_OK || !mesh_of(c, pose)->read || !mesh_of(c, rest)->read ||
        !ep_mesh_same_connectivity(r, &mesh_of(c, pose)->mesh))
      continue;
    group *g = mesh_of(c, c->object)->read && ep_mesh_same_connectivity(o, r) ? own : &other;
    g->rest = r;
    status = add_to_group(c, g, mesh_of(c, pose));
  }
  free_group(&other);
  return status;
}

// What planning finds beyond this: numbers of modes, landmarks, regions, fields.
static ep_status check_plan(checker *c) {
  ep_shapes shapes;
  ep_plan plan = {0};
  ep_error bad = {0};
  ep_status status = ep_shapes_read(c->scene, NULL, &shapes, &bad);
  if (status == EP_OK) {
    status = ep_plan_make(c->scene, &shapes, &plan, &bad);
    if (status == EP_OK) ep_plan_free(&plan);
    ep_shapes_free(&shapes);
  }
  if (status == EP_ERR_MEMORY || status == EP_ERR_IO)
    return ep_fail(c->err, status, "%s", bad.text);
  if (status != EP_OK) ADD(EP_FOUND_ERROR, "scene", c->scene->path, "%s", bad.text);
  return EP_OK;
}

ep_status ep_check_scene(ep_check *check, const ep_scene *scene, ep_error *err) {
  checker here = {.check = check, .scene = scene, .err = err}, *c = &here;
  group own = {0};
  EP_TRY(ep_check_mesh_file(check, scene->mesh, &c->object, err));
  if (mesh_of(c, c->object)->read) {
    EP_TRY(check_material(c));
    EP_TRY(check_fixed(c));
  }
  ep_status status = EP_OK;
  for (int i = 0; i < scene->nfamilies && status == EP_OK; i++)
    status = check_family(c, &scene->family[i], &own);
  free_group(&own);
  if (status == EP_OK && !ep_check_count(check, EP_FOUND_ERROR)) status = check_plan(c);
  return status;
}
