// The stage of the Green-strain path: coefficients of the examples' strains.
#include <stdlib.h>
#include <string.h>

#include "app/bake/bake.h"
#include "app/scene/regions.h"

ep_status ep_bake_shares(const ep_bake *bake, double **out, ep_error *err) {
  const ep_shapes *shapes = bake->shapes;
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  *out = NULL;
  if (!ep_scene_local(bake->scene)) return EP_OK;
  const size_t nt = (size_t)mesh->nt;
  *out = malloc((size_t)shapes->examples * nt * sizeof **out);
  if (!*out) return ep_fail(err, EP_ERR_MEMORY, "no memory for the examples' regions");
  for (int i = 0; i < shapes->examples; i++) {
    const int region = bake->scene->family[shapes->example[i].family].region;
    ep_region_shares(mesh, region < 0 ? NULL : shapes->region[region], *out + (size_t)i * nt);
  }
  return EP_OK;
}

// The same quadrature as the elastic term, or W_StVK + alpha W_a could become negative.
static ep_status quadrature(const ep_bake *bake, double **out, ep_error *err) {
  const ep_cubature *c = &bake->cubature;
  *out = calloc((size_t)bake->shapes->shape[0].mesh.nt, sizeof **out);
  if (!*out) return ep_fail(err, EP_ERR_MEMORY, "no memory for element weights");
  const bool exact = !ep_is_cubature(bake->scene->evaluator);
  if (exact) memcpy(*out, bake->fem.volume, (size_t)bake->fem.mesh->nt * sizeof **out);
  for (int i = 0; i < c->count && !exact; i++) (*out)[c->tet[i]] += c->weight[i];
  return EP_OK;
}

static ep_status compute(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  ep_green_coefficients *g = &bake->green;
  double *weight = NULL, *share = NULL;
  EP_TRY(ep_bake_basis(bake, err));
  EP_TRY(ep_bake_cubature(bake, err));
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  ep_status status = quadrature(bake, &weight, err);
  if (status == EP_OK) status = ep_bake_shares(bake, &share, err);
  if (status == EP_OK)
    status = ep_green_coefficients_compute(&bake->fem, &bake->basis, NULL, weight, share, bake->log,
                                           g, err);
  free(weight);
  free(share);
  if (status != EP_OK) return status;
  const int64_t r = g->r, k = g->k, count = g->count;
  const ep_tensor tensors[] = {
      ep_tensor_of("count", EP_I32, &g->count, 1, 0, 0),
      ep_tensor_of("b", EP_F64, g->b, count, r * r, 0),
      ep_tensor_of("linear", EP_F64, g->linear, count, r, 0),
      ep_tensor_of("weights", EP_F64, g->weights, k, count, 0),
      ep_tensor_of("energy", EP_F64, g->energy, k, 0, 0),
  };
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, 5, tensors, 0, NULL,
                        err);
}

static bool take(ep_bake *bake, const ep_bake_step *step) {
  ep_green_coefficients *g = &bake->green;
  const size_t r = (size_t)bake->scene->modes, k = (size_t)bake->shapes->examples;
  const int *count = ep_artifact_array(&step->artifact, "count", EP_I32, 1);
  if (!count || *count < 1 || (size_t)*count > k) return false;
  const size_t p = (size_t)*count;
  if (!ep_bake_take(step, "b", p * r * r, &g->b) ||
      !ep_bake_take(step, "linear", p * r, &g->linear) ||
      !ep_bake_take(step, "weights", k * p, &g->weights) ||
      !ep_bake_take(step, "energy", k, &g->energy)) {
    ep_green_coefficients_free(g);
    return false;
  }
  g->r = (int)r;
  g->k = (int)k;
  g->count = (int)p;
  return true;
}

ep_status ep_bake_green(ep_bake *bake, ep_error *err) {
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_GREEN);
  if (bake->green.b || !stage->runs) return EP_OK;
  return ep_bake_stage(bake, stage, take, compute, err);
}
