// The stage of the guards: elements that only keep themselves from turning over.
#include <stdlib.h>

#include "app/bake/bake.h"

static void tell(const ep_bake *bake) {
  const ep_guards *g = &bake->guards;
  if (g->spared > 0)
    ep_notice(bake->log, "guards: an example turns over %d tets; nothing keeps these from it",
              g->spared);
  if (g->full)
    ep_notice(bake->log,
              "guards: all %d are used, and pushes far beyond the object's stiffness still turned "
              "tets over; raise reduction.guards where loads are as hard",
              g->count);
  if (g->cut)
    ep_notice(bake->log,
              "guards: %d of the pushes would have taken more than their share of the guards or of "
              "the effort and ended there",
              g->cut);
  if (g->left > 0)
    ep_warn(bake->log,
            "guards: %d of %d pushes kept for a test left tets inverted once they ended; raise "
            "reduction.guards or reduction.elements",
            g->left, g->tried);
  if (g->failed > 0)
    ep_notice(bake->log,
              "guards: %d of %d pushes kept for a test are too hard for its steps; what they would "
              "turn over is not known",
              g->failed, g->tried);
}

static ep_status compute(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  ep_guards *g = &bake->guards;
  EP_TRY(ep_bake_basis(bake, err));
  EP_TRY(ep_bake_cubature(bake, err));
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  ep_guard_options options = ep_default_guard_options();
  options.most = bake->scene->guards;
  options.seed = bake->scene->seed;
  EP_TRY(ep_guards_choose(&bake->fem, &bake->basis, &bake->cubature, &options, bake->log, g, err));
  tell(bake);
  const ep_tensor tensors[] = {
      ep_tensor_of("count", EP_I32, &g->count, 1, 0, 0),
      ep_tensor_of("tet", EP_I32, g->tet, g->count, 0, 0),
      ep_tensor_of("weight", EP_F64, g->weight, g->count, 0, 0),
      ep_tensor_of("limit", EP_F64, g->limit, g->count, 0, 0),
  };
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, g->count ? 4 : 1,
                        tensors, 0, NULL, err);
}

static bool take(ep_bake *bake, const ep_bake_step *step) {
  ep_guards *g = &bake->guards;
  const int *count = ep_artifact_array(&step->artifact, "count", EP_I32, 1);
  if (!count || *count < 0 || *count > bake->scene->guards) return false;
  g->count = *count;
  const size_t guards = (size_t)g->count;
  if (guards == 0 || (ep_bake_take_int(step, "tet", guards, &g->tet) &&
                      ep_bake_take(step, "weight", guards, &g->weight) &&
                      ep_bake_take(step, "limit", guards, &g->limit)))
    return true;
  ep_guards_free(g);
  return false;
}

ep_status ep_bake_guards(ep_bake *bake, ep_error *err) {
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_GUARDS);
  if (bake->guards.tet || !stage->runs) return EP_OK;
  return ep_bake_stage(bake, stage, take, compute, err);
}
