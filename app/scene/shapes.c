#include "app/scene/shapes.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/hash_text.h"
#include "app/scene/regions.h"
#include "app/scene/select.h"
#include "mesh/io.h"
#include "mesh/quality.h"
#include "mesh/topology.h"

// They are no error: everything is computed with them, but stiffly and with less accuracy.
static void warn_of_slivers(const ep_mesh *mesh, ep_log *log) {
  ep_mesh_quality quality;
  char worst[300];
  ep_mesh_measure(mesh, &quality);
  if (!quality.slivers) return;
  ep_mesh_worst_text(&quality, worst, sizeof worst);
  ep_warn(
      log,
      "%s: %d tets are slivers (dihedral angles within %g degree of 0 or 180); worst: %s; let the "
      "mesher optimise its quality",
      mesh->name, quality.slivers, EP_SLIVER_DEGREES, worst);
}

// Nor are these: what lies in each other moves together, but its mass and stiffness count twice.
static ep_status warn_of_overlaps(const ep_mesh *mesh, ep_log *log, ep_error *err) {
  ep_mesh_topology t;
  if (!log) return EP_OK;
  EP_TRY(ep_mesh_examine(mesh, &t, err));
  if (t.overlapping_faces)
    ep_warn(log,
            "%s: %d faces have two tets on the same side (first: tets %d and %d): the tets lie in "
            "each other; mesh anew, see 'eigenpose check'",
            mesh->name, t.overlapping_faces, t.overlap_first + 1, t.overlap_second + 1);
  return EP_OK;
}

static ep_status read_shape(const char *path, const char *family, bool whole, ep_log *log,
                            ep_shapes *out, int *number, ep_error *err) {
  ep_shape_file *shape = &out->shape[out->count];
  ep_mesh_findings findings;
  EP_TRY(ep_mesh_read(path, &shape->mesh, &findings, log, err));
  *number = out->count++;
  char stem[EP_PATH_MAX];
  EP_TRY(ep_path_stem(path, stem, err));
  if (family)
    snprintf(shape->name, sizeof shape->name, "%s/%.50s", family, stem);
  else
    snprintf(shape->name, sizeof shape->name, "object");
  EP_TRY(ep_mesh_require_sound(&shape->mesh, &findings, whole, err));
  warn_of_slivers(&shape->mesh, log);
  if (whole) EP_TRY(warn_of_overlaps(&shape->mesh, log, err));
  const ep_mesh *mesh = &shape->mesh;
  ep_hash_text text = {0};
  ep_hash_add_bytes(&text, "x", mesh->x, 3 * (size_t)mesh->nv * sizeof *mesh->x);
  ep_hash_add_bytes(&text, "tet", mesh->tet, 4 * (size_t)mesh->nt * sizeof *mesh->tet);
  ep_hash_add_bytes(&text, "file", mesh->file_vertex, (size_t)mesh->nv * sizeof *mesh->tet);
  shape->geometry = ep_hash_done(&text);
  return EP_OK;
}

// Poses of a family may appear twice in a scene (or a pose be its own rest): each file is read as
// often as it is named; content hashes make their stages one.
static ep_status read_family(const ep_scene *scene, int index, ep_log *log, ep_shapes *out,
                             ep_error *err) {
  const ep_family *family = &scene->family[index];
  out->rest[index] = 0;
  if (family->rest)
    EP_TRY(read_shape(family->rest, family->name, false, log, out, &out->rest[index], err));
  for (int i = 0; i < family->poses; i++) {
    ep_pose_source *example = &out->example[out->examples];
    EP_TRY(read_shape(family->pose[i], family->name, false, log, out, &example->shape, err));
    out->examples++;
    example->family = index;
    example->index = i;
    example->rest = out->rest[index];
    const ep_mesh *object = &out->shape[0].mesh, *rest = &out->shape[example->rest].mesh;
    const ep_mesh *pose = &out->shape[example->shape].mesh;
    example->rest_same = ep_mesh_same_connectivity(object, rest);
    example->pose_same = ep_mesh_same_connectivity(rest, pose);
    // The same connectivity throughout: vertex i of the pose is vertex i of the object.
    example->route = example->rest_same && example->pose_same ? EP_ROUTE_SAME : EP_ROUTE_MAP;
  }
  return EP_OK;
}

static ep_elastic changed(ep_elastic m, const ep_elastic_change *change) {
  if (change->density > 0) m.density *= change->density;
  if (change->young > 0) m.young *= change->young;
  if (change->sets_poisson) m.poisson = change->poisson;
  return m;
}

static ep_status choose_material(const ep_scene *scene, ep_shapes *out, ep_error *err) {
  const ep_mesh *mesh = &out->shape[0].mesh;
  const ep_elastic *given = scene->has_material ? &scene->material : mesh->material;
  out->nmaterials = scene->has_material ? 1 : mesh->nmaterials;
  if (out->nmaterials == 0)
    return ep_fail(err, EP_ERR_SCENE,
                   "%s: no material: %s carries none, so object.material must give density, "
                   "young and poisson",
                   scene->path, mesh->name);
  out->material = malloc((size_t)out->nmaterials * sizeof *out->material);
  if (!out->material) return ep_fail(err, EP_ERR_MEMORY, "no memory for material constants");
  for (int i = 0; i < out->nmaterials; i++) out->material[i] = changed(given[i], &scene->change);
  ep_hash_text text = {0};
  ep_hash_add(&text, "model=%d n=%d", (int)scene->model, out->nmaterials);
  for (int i = 0; i < out->nmaterials; i++)
    ep_hash_add(&text, "%.17g %.17g %.17g", out->material[i].density, out->material[i].young,
                out->material[i].poisson);
  if (out->nmaterials > 1)
    ep_hash_add_bytes(&text, "place", mesh->tet_material, (size_t)mesh->nt * sizeof(int));
  out->physics = ep_hash_done(&text);
  return EP_OK;
}

static ep_status weigh_regions(const ep_scene *scene, ep_shapes *out, ep_error *err) {
  const ep_mesh *mesh = &out->shape[0].mesh;
  for (int i = 0; i < scene->nfamilies; i++) {
    const int at = scene->family[i].region;
    if (at < 0 || out->region[at]) continue;
    out->region[at] = calloc((size_t)mesh->nv, sizeof **out->region);
    if (!out->region[at]) return ep_fail(err, EP_ERR_MEMORY, "no memory for a region");
    EP_TRY(ep_region_weights(&scene->region[at], mesh, out->region[at], err));
  }
  return EP_OK;
}

static int set_of(const ep_shapes *shapes, int region) {
  for (int i = 0; i < shapes->sets; i++)
    if (shapes->set[i] == region) return i;
  return -1;
}

static ep_status divide_examples(const ep_scene *scene, ep_shapes *out, ep_error *err) {
  if (!ep_scene_local(scene) || !(scene->methods & EP_METHOD_LB)) return EP_OK;
  out->set = calloc((size_t)scene->nregions + 1, sizeof *out->set);
  if (!out->set) return ep_fail(err, EP_ERR_MEMORY, "no memory for the examples' regions");
  for (int region = -1; region < scene->nregions; region++)
    for (int i = 0; i < scene->nfamilies; i++)
      if (scene->family[i].region == region && set_of(out, region) < 0)
        out->set[out->sets++] = region;
  for (int i = 0; i < out->examples; i++)
    out->example[i].set = set_of(out, scene->family[out->example[i].family].region);
  return EP_OK;
}

const double *ep_shapes_set_weight(const ep_shapes *shapes, int set) {
  return shapes->set[set] < 0 ? NULL : shapes->region[shapes->set[set]];
}

int ep_shapes_set_functions(const ep_scene *scene, const ep_shapes *shapes, int set) {
  return shapes->set[set] < 0 ? scene->eigenfunctions
                              : scene->region[shapes->set[set]].eigenfunctions;
}

const double *ep_shapes_local(const ep_shapes *shapes, const ep_pose_source *example) {
  return shapes->sets ? ep_shapes_set_weight(shapes, example->set) : NULL;
}

static void mark_lb(const ep_scene *scene, ep_shapes *out) {
  for (int i = 0; i < out->examples; i++) {
    const ep_pose_source *example = &out->example[i];
    if (scene->methods & EP_METHOD_LB) out->shape[0].needs_lb = true; // descriptors c(q) = c0 + T q
    if (example->route == EP_ROUTE_SAME) continue;
    out->shape[0].needs_lb = true; // the pose's coefficients
    if (!example->rest_same) out->shape[example->rest].needs_lb = true;
    if (!example->pose_same)
      out->shape[example->rest].needs_lb = out->shape[example->shape].needs_lb = true;
  }
}

ep_status ep_shapes_read(const ep_scene *scene, ep_log *log, ep_shapes *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  const int examples = ep_scene_examples(scene);
  const size_t most = 1 + (size_t)scene->nfamilies + (size_t)examples;
  out->shape = calloc(most, sizeof *out->shape);
  out->rest = calloc((size_t)scene->nfamilies + 1, sizeof *out->rest);
  out->region = calloc((size_t)scene->nregions + 1, sizeof *out->region);
  out->regions = scene->nregions;
  out->example = calloc((size_t)examples + 1, sizeof *out->example);
  ep_status status = EP_OK;
  int object;
  if (!out->shape || !out->rest || !out->example || !out->region)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for %zu meshes", most);
  if (status == EP_OK) status = read_shape(scene->mesh, NULL, true, log, out, &object, err);
  for (int i = 0; i < scene->nfamilies && status == EP_OK; i++)
    status = read_family(scene, i, log, out, err);
  if (status == EP_OK) status = choose_material(scene, out, err);
  if (status == EP_OK)
    status = ep_select_fixed(scene, &out->shape[0].mesh, &out->nfixed, &out->fixed, err);
  if (status == EP_OK) status = weigh_regions(scene, out, err);
  if (status == EP_OK) status = divide_examples(scene, out, err);
  if (status == EP_OK) mark_lb(scene, out);
  if (status != EP_OK) ep_shapes_free(out);
  return status;
}

void ep_shapes_free(ep_shapes *shapes) {
  for (int i = 0; i < shapes->count; i++) ep_mesh_free(&shapes->shape[i].mesh);
  free(shapes->shape);
  free(shapes->rest);
  free(shapes->example);
  free(shapes->fixed);
  for (int i = 0; shapes->region && i < shapes->regions; i++) free(shapes->region[i]);
  free(shapes->region);
  free(shapes->set);
  free(shapes->material);
  memset(shapes, 0, sizeof *shapes);
}

void ep_shapes_vertex_mass(const ep_shapes *shapes, double *mass) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  memset(mass, 0, (size_t)mesh->nv * sizeof *mass);
  for (int e = 0; e < mesh->nt; e++) {
    double gradients[12];
    const int which = shapes->nmaterials > 1 ? mesh->tet_material[e] : 0;
    const double quarter =
        0.25 * ep_tet_gradients(mesh, e, gradients) * shapes->material[which].density;
    for (int i = 0; i < 4; i++) mass[mesh->tet[4 * e + i]] += quarter;
  }
}
