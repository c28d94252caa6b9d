// The bake: every stage is taken from the cache or computed and stored, and only when something
// later needs it. Runs in the baker process (PETSc).
#ifndef EP_APP_BAKE_BAKE_H
#define EP_APP_BAKE_BAKE_H

#include "align/align.h"
#include "app/plan/plan.h"
#include "cubature/cubature.h"
#include "cubature/guards.h"
#include "lbspace/lbspace.h"
#include "reduced/bake/basis.h"
#include "reduced/bake/green_coefficients.h"
#include "reduced/bake/model_regions.h"

// What an example's pose on the object's mesh is worth.
typedef struct ep_pose_quality {
  double iterations, coefficient_error; // of LB-ARAP
  double fixed_shift; // how far the fixed vertices had to be brought back / diagonal (rms)
  // before and after repair; crushed: less volume than 5 % of rest, inverted ones counted too
  double inverted_before, inverted_tets, crushed_before, crushed_tets;
  double worst_before, worst_volume_ratio; // smallest volume of a tet over that at rest
  double repair_moved, repair_moved_most;  // rms and largest move by the repair / diagonal
  double repair_share;                     // rms move by the repair / rms displacement of the pose
  double repair_shift;                     // of the low coefficients by the repair, relative
} ep_pose_quality;

typedef struct ep_bake {
  const ep_scene *scene;
  const ep_shapes *shapes;
  ep_plan *plan; // cached and seconds of its stages are filled in
  const ep_cache *cache;
  ep_log *log;
  bool look;  // only to be looked at: bad maps and poses do not stop; poses are not stored
  bool petsc; // started by the first stage that is computed
  // results so far; zero until needed
  ep_lb *lb;                // (shapes->count)
  ep_csr *mass;             // (shapes->count) LB mass matrices
  ep_map *map;              // (plan->count), by stage number
  double *poses;            // (examples x 3n) displacements
  ep_pose_quality *quality; // (examples)
  ep_fem fem;
  ep_modes modes;
  double *paths; // (examples * samples x 3n)
  ep_basis basis;
  ep_cubature cubature;
  ep_guards guards;
  // local examples, in the sets of shapes; NULL without
  ep_region_part *region;
  int *example_region; // (examples)
  ep_green_coefficients green;
  double *cubic; // (ep_cubic_count(modes)) exact coefficients
} ep_bake;

// scene, shapes, plan, cache, log are borrowed.
ep_status ep_bake_open(const ep_scene *scene, const ep_shapes *shapes, ep_plan *plan,
                       const ep_cache *cache, ep_log *log, ep_bake *out, ep_error *err);
void ep_bake_close(ep_bake *bake);

// Make sure a result is there. Each asks for what it needs itself.
ep_status ep_bake_lb(ep_bake *bake, int shape, ep_error *err);
// *out is borrowed. A bad map is no error here.
ep_status ep_bake_map(ep_bake *bake, ep_stage *stage, const ep_map **out, ep_error *err);
// EP_ERR_MATCH where a map is bad, or a pose keeps inverted tets or moves what is fixed, and the
// family does not accept it.
ep_status ep_bake_poses(ep_bake *bake, ep_error *err);
ep_status ep_bake_fem(ep_bake *bake, ep_error *err);
ep_status ep_bake_modes(ep_bake *bake, ep_error *err);
ep_status ep_bake_paths(ep_bake *bake, ep_error *err);
ep_status ep_bake_basis(ep_bake *bake, ep_error *err);
ep_status ep_bake_cubature(ep_bake *bake, ep_error *err);
ep_status ep_bake_guards(ep_bake *bake, ep_error *err);
// Share of each tet in the region of each example (examples x nt), malloc'd; NULL in *out where
// every example acts everywhere.
ep_status ep_bake_shares(const ep_bake *bake, double **out, ep_error *err);
// Fills region and example_region where examples act in regions.
ep_status ep_bake_regions(ep_bake *bake, ep_error *err);
ep_status ep_bake_green(ep_bake *bake, ep_error *err);
ep_status ep_bake_cubic(ep_bake *bake, ep_error *err);
// The whole bake; path (EP_PATH_MAX) receives the model file in the cache. Stages that were not
// even looked at, because a later result was there, count as cached.
ep_status ep_bake_model(ep_bake *bake, char *path, ep_error *err);

// ---- shared by the stage files ---------------------------------------------------------------
// A stage under way: either found (artifact open) or to be computed; ep_bake_end takes the time.
typedef struct ep_bake_step {
  ep_stage *stage;
  ep_artifact artifact;
  bool found;
  double started;
} ep_bake_step;
// Looks the stage up in the cache.
void ep_bake_begin(ep_bake *bake, ep_stage *stage, ep_bake_step *step);
// What was found does not have the arrays it should: it will be computed after all.
void ep_bake_reject(ep_bake *bake, ep_bake_step *step);
// To be called before computing, after what the stage builds on is there: starts PETSc once.
ep_status ep_bake_compute(ep_bake *bake, ep_bake_step *step, ep_error *err);
void ep_bake_end(ep_bake_step *step);
// A whole stage: what take finds in the cache, else what compute makes and stores.
typedef bool ep_bake_taker(ep_bake *bake, const ep_bake_step *step);
typedef ep_status ep_bake_maker(ep_bake *bake, ep_bake_step *step, ep_error *err);
ep_status ep_bake_stage(ep_bake *bake, ep_stage *stage, ep_bake_taker *take, ep_bake_maker *compute,
                        ep_error *err);
// The status of a stage as it goes up: a failure names the stage it happened in, and only that one.
ep_status ep_bake_status(const ep_stage *stage, ep_status status, ep_error *err);
// Copy count doubles or ints out of the artifact into new memory; false where they are not there.
bool ep_bake_take(const ep_bake_step *step, const char *name, size_t count, double **out);
bool ep_bake_take_int(const ep_bake_step *step, const char *name, size_t count, int **out);

#endif
