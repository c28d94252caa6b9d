#include "reduced/contact_law.h"

#include <math.h>

// A hundred times as stiff as the object over its own diagonal, begun at 0.2 % of it: what rests on
// a plane then sinks in by less than the thickness; impacts raise it
// (tests/reduced/test_contact.c).
static const double stiffness_ratio = 100, thickness_share = 0.002;
static const double depth_share = 0.005;  // raise the stiffness when deeper than this
static const double touching_share = 1.5; // where something touched before: later
static const double creep_share = 1e-3;   // diagonals per second that count as sticking
static const double largest_raise = 1e6;
enum { RAISES = 8 };

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

ep_contact_law ep_contact_choose(const ep_step_def *def, double unit, double diagonal, int hessian,
                                 ep_contact_memory *memory) {
  const ep_contact_def *c = &def->contact;
  return (ep_contact_law){
      .stiffness = c->stiffness > 0 ? c->stiffness : stiffness_ratio * unit * memory->trial_raise,
      .thickness = c->thickness > 0 ? c->thickness : thickness_share * diagonal,
      .damping = c->damping,
      .creep = creep_share * diagonal,
      .dt = def->dt,
      .careful = hessian && memory->hessians++ % 2 == 1};
}

double ep_contact_share(const ep_step_def *def) {
  return def->integrator == EP_NEWMARK ? 2 : 1;
}

void ep_contact_memory_begin(ep_contact_memory *m) {
  m->trial_raise = m->raise;
  m->passes = m->raises = m->hessians = 0;
}

static int raise_stiffness(const ep_step_def *def, double diagonal, double deepest,
                           ep_contact_memory *m) {
  const double depth = def->contact.depth > 0 ? def->contact.depth : depth_share * diagonal;
  const double limit = depth * (m->touching > 0 ? touching_share : 1);
  if (def->contact.stiffness > 0 || !(deepest > limit) || m->raises == RAISES ||
      m->trial_raise >= largest_raise)
    return 0;
  m->raises++;
  m->trial_raise = fmin(largest_raise, m->trial_raise * fmin(16, fmax(2, 1.5 * deepest / limit)));
  return 1;
}

int ep_contact_retry(const ep_step_def *def, double diagonal, double deepest, double change,
                     double pressing, ep_contact_memory *m) {
  int again = raise_stiffness(def, diagonal, deepest, m);
  if (change > EP_FRICTION_TOLERANCE * pressing && m->passes < EP_FRICTION_PASSES) {
    m->passes++;
    again = 1;
  }
  return again;
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

double ep_contact_injected(const ep_contact_memory *m) {
  return m->touching > 0 ? m->stored * (m->trial_raise / m->raise - 1) : 0;
}

void ep_contact_memory_commit(const ep_contact_report *report, ep_contact_memory *m) {
  m->touching = report->touching;
  m->stored = report->energy;
  m->raise = report->touching ? m->trial_raise : 1;
}
