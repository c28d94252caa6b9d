#include "reduced/contact_law.h"

#include <math.h>

// A hundred times as stiff as the object over its own extent, begun at 0.2 % of it: what rests on
// a plane then sinks in by less than the thickness. It gets stiffer below 0.25 % (to four times of
// which impacts may go).
static const double stiffness_ratio = 100, thickness_share = 0.002, depth_share = 0.0025;
static const double creep_share = 1e-3; // extents per second that count as sticking

static int at_least_zero(double x) {
  return x >= 0 && isfinite(x);
}

int ep_contact_def_valid(const ep_step_def *def) {
  const ep_contact_def *c = &def->contact;
  if (!at_least_zero(c->stiffness) || !at_least_zero(c->thickness) || !at_least_zero(c->depth) ||
      !at_least_zero(c->damping) || def->obstacles < 0 || (def->obstacles > 0 && !def->obstacle))
    return 0;
  for (int i = 0; i < def->obstacles; i++)
    if (!ep_obstacle_valid(&def->obstacle[i])) return 0;
  return 1;
}

ep_contact_law ep_contact_choose(const ep_step_def *def, double unit, double extent, int hessian,
                                 ep_contact_memory *memory) {
  const ep_contact_def *c = &def->contact;
  return (ep_contact_law){.stiffness = c->stiffness > 0 ? c->stiffness : stiffness_ratio * unit,
                          .thickness = c->thickness > 0 ? c->thickness : thickness_share * extent,
                          .depth = c->depth > 0 ? 0.25 * c->depth : depth_share * extent,
                          .damping = c->damping,
                          .creep = creep_share * extent,
                          .dt = def->dt,
                          .careful = hessian && memory->hessians++ % 2 == 1};
}

double ep_contact_share(const ep_step_def *def, double dt_before) {
  if (def->integrator == EP_NEWMARK) return 2;
  if (def->integrator != EP_BDF2 || !(dt_before > 0)) return 1;
  const double w = def->dt / dt_before;
  return (1 + 2 * w) / (1 + w);
}

int ep_contact_split(const ep_step_def *def) {
  return def->integrator != EP_IMPLICIT_EULER;
}

void ep_contact_memory_begin(const ep_step_def *def, double dt_before, ep_contact_memory *m) {
  m->passes = m->hessians = 0;
  m->share = ep_contact_share(def, dt_before);
}

int ep_contact_retry(double change, double pressing, ep_contact_memory *m) {
  if (change <= EP_FRICTION_TOLERANCE * pressing || m->passes == EP_FRICTION_PASSES) return 0;
  m->passes++;
  return 1;
}

void ep_contact_report_add(const ep_contact_law *law, const ep_contact_action *action,
                           const double arm[3], ep_contact_report *out) {
  const double f[3] = {-action->gradient[0], -action->gradient[1], -action->gradient[2]};
  out->touching += action->distance < law->thickness;
  out->deepest = fmax(out->deepest, -action->distance);
  out->energy += action->normal_energy;
  out->pressing += action->pressing;
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    out->force[i] += f[i];
    out->torque[i] += arm[j] * f[k] - arm[k] * f[j];
  }
}
