// What happens in every step of a run.
#include <stdio.h>

#include "app/plan/planner.h"

// "2 examples in 2 sets, each with weights and a target of its own: left, right"
static void plan_local_target(ep_planner *p, int k) {
  const ep_shapes *shapes = p->shapes;
  char list[120] = "";
  size_t used = 0;
  for (int i = 0; i < shapes->sets && used + 30 < sizeof list; i++)
    used +=
        (size_t)snprintf(list + used, sizeof list - used, "%s%.24s", i ? ", " : "",
                         shapes->set[i] < 0 ? "everywhere" : p->scene->region[shapes->set[i]].name);
  ep_plan_add(p, EP_STAGE_TARGET, NULL, true,
              "%d example%s in %d region%s, each with weights and a target of its own: %s", k,
              k > 1 ? "s" : "", shapes->sets, shapes->sets > 1 ? "s" : "", list);
}

static void plan_target(ep_planner *p) {
  const int k = p->shapes->examples;
  if (!k)
    ep_plan_add(p, EP_STAGE_TARGET, NULL, false, "no examples: nothing to interpolate in a step");
  else if (!ep_plan_uses_descriptors(p))
    ep_plan_add(p, EP_STAGE_TARGET, NULL, false,
                "examples.path is green: weights are explicit, nothing is interpolated in a step");
  else if (p->scene->strength == 0)
    ep_plan_add(p, EP_STAGE_TARGET, NULL, false,
                "examples.strength is 0: examples are only measured");
  else if (p->shapes->sets)
    plan_local_target(p, k);
  else
    ep_plan_add(p, EP_STAGE_TARGET, NULL, true, "%d example%s and the rest shape, in every step", k,
                k > 1 ? "s" : "");
}

static void plan_frame(ep_planner *p) {
  if (p->shapes->nfixed)
    ep_plan_add(p, EP_STAGE_FRAME, NULL, false,
                "something is fixed: the object does not move as a whole");
  else
    ep_plan_add(p, EP_STAGE_FRAME, NULL, true,
                "nothing is fixed: momenta, rotation and inertial forces in every step");
}

static void plan_contact(ep_planner *p) {
  const int count = p->scene->nobstacles;
  if (!count)
    ep_plan_add(p, EP_STAGE_CONTACT, NULL, false,
                "no obstacles: surface rows and their tree are not kept");
  else
    ep_plan_add(p, EP_STAGE_CONTACT, NULL, true, "%d obstacle%s, in every step", count,
                count > 1 ? "s" : "");
}

void ep_plan_steps(ep_planner *p) {
  plan_target(p);
  plan_frame(p);
  plan_contact(p);
}
