// What the points of one material and one r share: meshes, plan, basis; keys and models.
#include <stdlib.h>
#include <string.h>

#include "app/compare/compare.h"
#include "app/scene/hash_text.h"

// Raised whenever a comparison measures something else.
enum { COMPARE_VERSION = 4 };

int ep_weight_sets(int path) {
  return (path & EP_METHOD_LB ? 1 : 0) + (path & EP_METHOD_GREEN ? 1 : 0);
}

ep_status ep_frames_make(int count, double interval, size_t n3, int nweights, ep_frames *out,
                         ep_error *err) {
  *out = (ep_frames){.count = count, .interval = interval, .n3 = n3, .nweights = nweights};
  out->x = calloc((size_t)count * n3, sizeof *out->x);
  out->v = calloc((size_t)count * n3, sizeof *out->v);
  out->energy = calloc((size_t)count, sizeof *out->energy);
  out->weight = calloc((size_t)count * (size_t)nweights + 1, sizeof *out->weight);
  if (out->x && out->v && out->energy && out->weight) return EP_OK;
  ep_frames_free(out);
  return ep_fail(err, EP_ERR_MEMORY, "no memory for %d frames of a comparison", count);
}

void ep_frames_free(ep_frames *frames) {
  free(frames->x);
  free(frames->v);
  free(frames->energy);
  free(frames->weight);
  *frames = (ep_frames){0};
}

ep_status ep_bench_open(const ep_scene *scene, const ep_point *point, const ep_cache *cache,
                        ep_log *log, ep_bench *out, ep_error *err) {
  *out = (ep_bench){.scene = *scene, .cache = cache, .log = log};
  out->scene.model = point->material;
  out->scene.modes = point->r;
  out->scene.methods = point->path;
  out->scene.green = point->path & EP_METHOD_GREEN ? scene->sweep.green : (ep_green){0};
  ep_status status = ep_shapes_read(&out->scene, log, &out->shapes, err);
  if (status == EP_OK) status = ep_plan_make(&out->scene, &out->shapes, &out->plan, err);
  if (status != EP_OK) ep_bench_close(out);
  return status;
}

void ep_bench_close(ep_bench *bench) {
  if (bench->bake.scene) {
    bench->bake.petsc = false; // started and stopped by the command
    ep_bake_close(&bench->bake);
  }
  ep_plan_free(&bench->plan);
  ep_shapes_free(&bench->shapes);
  bench->open = false;
}

// The basis is built here and not taken from the cache: its time belongs to the result.
static ep_status build_basis(ep_bench *bench, ep_error *err) {
  ep_bake *bake = &bench->bake;
  const int k = bench->shapes.examples;
  const double started = ep_seconds();
  EP_TRY(ep_basis_build(&bake->fem, &bake->modes, k, bake->poses,
                        bake->paths ? k * bench->scene.path_samples : 0, bake->paths,
                        bench->scene.modes, bench->log, &bake->basis, err));
  bench->basis_seconds = ep_seconds() - started;
  return EP_OK;
}

ep_status ep_bench_prepare(ep_bench *bench, ep_error *err) {
  if (bench->open) return EP_OK;
  ep_bake *bake = &bench->bake;
  EP_TRY(ep_bake_open(&bench->scene, &bench->shapes, &bench->plan, bench->cache, bench->log, bake,
                      err));
  bake->petsc = true;
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_modes(bake, err));
  if (bench->shapes.examples) {
    EP_TRY(ep_bake_poses(bake, err));
    EP_TRY(ep_bake_paths(bake, err));
    if (bench->scene.methods & EP_METHOD_LB) EP_TRY(ep_bake_lb(bake, 0, err));
  }
  EP_TRY(build_basis(bench, err));
  bench->open = true;
  return EP_OK;
}

// Lists and arrays count by what they hold: the name stays when they are edited. One that cannot be
// read is an error of the run.
static void hash_selection(ep_hash_text *text, const ep_selection *s, const ep_mesh *mesh) {
  ep_digest digest;
  const ep_point_data *data = s->kind == EP_SELECT_FIELD ? ep_mesh_data(mesh, s->path) : NULL;
  ep_hash_add(text, "where %d %.17g %d", (int)s->kind, s->value, s->equals);
  ep_hash_add_bytes(text, "a", s->a, sizeof s->a);
  ep_hash_add_bytes(text, "b", s->b, sizeof s->b);
  if (s->kind == EP_SELECT_FILE && ep_hash_file(s->path, &digest, NULL) == EP_OK)
    ep_hash_add(text, "list %s", digest.hex);
  if (data && data->value)
    ep_hash_add_bytes(text, "array", data->value, (size_t)mesh->nv * sizeof *data->value);
}

static void hash_loads(ep_hash_text *text, const ep_bench *bench) {
  const ep_scene *scene = &bench->scene;
  for (int i = 0; i < scene->nloads; i++) {
    const ep_load *l = &scene->load[i];
    ep_hash_add(text, "load %d %.17g %.17g %.17g %.17g %.17g %.17g", l->gravity, l->vector[0],
                l->vector[1], l->vector[2], l->from, l->until, l->ramp);
    hash_selection(text, &l->where, &bench->shapes.shape[0].mesh);
  }
}

// Where the strains of the examples count on the Green-strain path: no stage before it depends on
// that.
static void hash_regions(ep_hash_text *text, const ep_bench *bench) {
  const ep_shapes *shapes = &bench->shapes;
  for (int i = 0; i < bench->scene.nfamilies; i++) {
    const int region = bench->scene.family[i].region;
    ep_hash_add(text, "family %d", region);
    if (region >= 0)
      ep_hash_add_bytes(text, "region", shapes->region[region],
                        (size_t)shapes->shape[0].mesh.nv * sizeof **shapes->region);
  }
}

ep_digest ep_bench_key(const ep_bench *bench, const char *kind, const ep_frames *frames) {
  const ep_scene *s = &bench->scene;
  ep_hash_text text = {0};
  ep_hash_add(&text, "compare %d %s", COMPARE_VERSION, kind);
  ep_hash_add(&text, "%s", ep_plan_find(&bench->plan, EP_STAGE_BASIS)->key.hex);
  ep_hash_add(&text, "%d %d %d %.17g %llu", s->eigenfunctions, (int)s->model, s->training_poses,
              s->amplitude, (unsigned long long)s->seed);
  ep_hash_add(&text, "%d %.17g %.17g %.17g %.17g %d %.17g %d %.17g", (int)s->integrator,
              s->damping_mass, s->damping_stiffness, s->strength, s->relief, (int)s->force,
              frames->interval, frames->count, s->dt * s->steps);
  ep_hash_add(&text, "path %d %.17g %.17g %.17g", s->methods, s->green.alpha, s->green.sum_to_one,
              s->green.non_negative);
  hash_loads(&text, bench);
  hash_regions(&text, bench);
  return ep_hash_done(&text);
}

static ep_status all_elements(const ep_mesh *mesh, int **out, ep_error *err) {
  *out = malloc((size_t)mesh->nt * sizeof **out);
  if (!*out) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d elements", mesh->nt);
  for (int e = 0; e < mesh->nt; e++) (*out)[e] = e;
  return EP_OK;
}

// Coefficients of the Green-strain path with the quadrature of the elastic term: all elements
// (weight: volumes), or the elements of `c`.
static ep_status green_coefficients(ep_bench *bench, const ep_cubature *c,
                                    ep_green_coefficients *out, ep_error *err) {
  const ep_bake *bake = &bench->bake;
  const size_t nt = (size_t)bench->shapes.shape[0].mesh.nt;
  double *weight = calloc(nt, sizeof *weight), *share = NULL;
  if (!weight) return ep_fail(err, EP_ERR_MEMORY, "no memory for element weights");
  if (!c) memcpy(weight, bake->fem.volume, nt * sizeof *weight);
  for (int i = 0; c && i < c->count; i++) weight[c->tet[i]] += c->weight[i];
  ep_status status = ep_bake_shares(bake, &share, err);
  if (status == EP_OK)
    status = ep_green_coefficients_compute(&bake->fem, &bake->basis, NULL, weight, share,
                                           bench->log, out, err);
  free(weight);
  free(share);
  return status;
}

ep_status ep_bench_model(ep_bench *bench, const ep_cubature *c, const double *cubic,
                         ep_precision precision, ep_model_memory *out, ep_error *err) {
  const ep_bake *bake = &bench->bake;
  const ep_mesh *mesh = &bench->shapes.shape[0].mesh;
  const bool lb = bench->scene.methods & EP_METHOD_LB,
             green = bench->scene.methods & EP_METHOD_GREEN;
  ep_green_coefficients coefficients = {0};
  int *all = NULL;
  if (green) EP_TRY(green_coefficients(bench, cubic ? NULL : c, &coefficients, err));
  ep_status status = c ? EP_OK : all_elements(mesh, &all, err);
  const ep_model_parts parts = {
      .fem = &bake->fem,
      .basis = &bake->basis,
      .m = lb ? bench->scene.eigenfunctions : 0,
      .lb = lb ? &bake->lb[0] : NULL,
      .lb_mass = lb ? &bake->mass[0] : NULL,
      .s = c ? c->count : mesh->nt,
      .tet = c ? c->tet : all,
      .weight = c ? c->weight : bake->fem.volume,
      .green = green ? &coefficients : NULL,
      .cubic = cubic,
      .precision = precision,
  };
  if (status == EP_OK) status = ep_model_build(&parts, out, err);
  ep_green_coefficients_free(&coefficients);
  free(all);
  return status;
}
