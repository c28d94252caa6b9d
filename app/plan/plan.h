// The planner: which stages a scene needs, why, and under which name each result is cached. Keys
// follow from the meshes, the values of the scene and the keys of what a stage builds on, so they
// are known before anything is computed.
#ifndef EP_APP_PLAN_PLAN_H
#define EP_APP_PLAN_PLAN_H

#include "app/plan/cache.h"
#include "app/scene/shapes.h"

typedef enum ep_stage_kind {
  EP_STAGE_EIGEN,    // LB space of a shape
  EP_STAGE_MAP,      // shape `from` -> shape `to`
  EP_STAGE_POSES,    // example poses on the object's mesh
  EP_STAGE_MODES,    // linear modes and derivatives
  EP_STAGE_PATHS,    // samples from rest to each pose
  EP_STAGE_BASIS,    // U
  EP_STAGE_CUBATURE, // elements and weights
  EP_STAGE_GUARDS,   // elements that only keep themselves from turning over
  EP_STAGE_GREEN,    // coefficients of the Green-strain path
  EP_STAGE_CUBIC,    // coefficients of the exact polynomials
  EP_STAGE_MODEL,    // the .epm file
  EP_STAGE_TARGET,   // run time: interpolation of the examples in every step
  EP_STAGE_FRAME,    // run time: the moving frame of a free object, in every step
  EP_STAGE_CONTACT,  // run time: contact with obstacles in every step
} ep_stage_kind;

typedef struct ep_stage {
  ep_stage_kind kind;
  char name[100]; // unique; "map:cylinder/cylinder-twist"
  bool runs;      // false: left out
  char reason[240];
  int shape, from, to; // shape numbers, -1 where they do not apply
  int family;
  bool same_family; // MAP between rest and pose of one family
  int functions;    // EIGEN: eigenfunctions to compute; MAP: functions of the map
  ep_digest key;    // of stages that are cached
  bool cached;      // by the process at hand: taken from the cache
  double seconds;
} ep_stage;

typedef struct ep_plan {
  int count;
  ep_stage *stage;
} ep_plan;

// Errors: EP_ERR_SCENE where a value does not fit the meshes (more modes than unknowns); EP_ERR_IO
// for a regions file.
ep_status ep_plan_make(const ep_scene *scene, const ep_shapes *shapes, ep_plan *out, ep_error *err);
void ep_plan_free(ep_plan *plan);

// First stage of a kind, NULL where there is none. Stages that are left out count.
ep_stage *ep_plan_find(const ep_plan *plan, ep_stage_kind kind);
// The LB space of a shape; the map between two shapes. NULL where there is none.
ep_stage *ep_plan_eigen(const ep_plan *plan, int shape);
ep_stage *ep_plan_map(const ep_plan *plan, int from, int to);
// 0 for what only happens in the steps of a run.
bool ep_stage_is_baked(ep_stage_kind kind);
// What a kind is called ("eigen", "map", ...).
const char *ep_stage_kind_name(ep_stage_kind kind);

#endif
