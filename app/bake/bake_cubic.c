// The stage of the exact polynomials: coefficients of the reduced StVK energy over all elements.
#include <stdlib.h>

#include "app/bake/bake.h"
#include "reduced/bake/cubic_coefficients.h"

static ep_status compute(ep_bake *bake, ep_bake_step *step, ep_error *err) {
  const size_t count = ep_cubic_count(bake->scene->modes);
  EP_TRY(ep_bake_basis(bake, err));
  EP_TRY(ep_bake_fem(bake, err));
  EP_TRY(ep_bake_compute(bake, step, err));
  double *cubic = malloc(count * sizeof *cubic);
  if (!cubic) return ep_fail(err, EP_ERR_MEMORY, "no memory for %zu cubic coefficients", count);
  const ep_status status =
      ep_cubic_coefficients(&bake->fem, bake->basis.r, bake->basis.u, bake->log, cubic, NULL, err);
  if (status != EP_OK) {
    free(cubic);
    return status;
  }
  bake->cubic = cubic;
  const ep_tensor tensor = ep_tensor_of("w", EP_F64, cubic, (int64_t)count, 0, 0);
  return ep_cache_store(bake->cache, step->stage->name, &step->stage->key, 1, &tensor, 0, NULL,
                        err);
}

static bool take(ep_bake *bake, const ep_bake_step *step) {
  return ep_bake_take(step, "w", ep_cubic_count(bake->scene->modes), &bake->cubic);
}

ep_status ep_bake_cubic(ep_bake *bake, ep_error *err) {
  ep_stage *stage = ep_plan_find(bake->plan, EP_STAGE_CUBIC);
  if (bake->cubic || !stage->runs) return EP_OK;
  return ep_bake_stage(bake, stage, take, compute, err);
}
