// What the files plan*.c share; everyone else includes app/plan/plan.h.
#ifndef EP_APP_PLAN_PLANNER_H
#define EP_APP_PLAN_PLANNER_H

#include "app/plan/plan.h"
#include "app/scene/hash_text.h"

typedef struct ep_planner {
  const ep_scene *scene;
  const ep_shapes *shapes;
  ep_plan *plan;
  ep_error *err;
} ep_planner;

// Add a stage; its name is the kind, with ":detail" where detail is given. There is room for all
// that a scene can have.
ep_stage *ep_plan_add(ep_planner *p, ep_stage_kind kind, const char *detail, bool runs,
                      const char *format, ...) __attribute__((format(printf, 5, 6)));
// The beginning of a stage's key: its kind and version.
ep_hash_text ep_plan_key_of(ep_stage_kind kind);

// Parts of keys: fixed vertices; a set of examples; which examples act where; another stage's key.
void ep_plan_key_add_fixed(const ep_planner *p, ep_hash_text *text);
void ep_plan_key_add_set(const ep_planner *p, ep_hash_text *text, int set);
void ep_plan_key_add_sets(const ep_planner *p, ep_hash_text *text);
void ep_plan_key_add_stage(const ep_planner *p, ep_hash_text *text, ep_stage_kind kind);

// Whether a run compares descriptors with those of examples.
bool ep_plan_uses_descriptors(const ep_planner *p);

// The stages, in this order. Errors: those of ep_plan_make.
ep_status ep_plan_shapes(ep_planner *p);
ep_status ep_plan_subspace(ep_planner *p);
void ep_plan_steps(ep_planner *p);

#endif
