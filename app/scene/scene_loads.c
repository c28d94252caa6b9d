// The loads of a scene: gravity, pushes, pressure, drags along a path.
#include <stdio.h>
#include <stdlib.h>

#include "app/scene/scene_reader.h"

// When a load acts, and its linear rise and fall; ramp may be NULL for one that has none.
static ep_status read_span(const ep_scene_reader *r, const char *key, const double *given_from,
                           const double *given_until, const double *given_ramp, double *from,
                           double *until, double *ramp) {
  char part[112];
  snprintf(part, sizeof part, "%.80s.from", key);
  EP_TRY(ep_read_number(r, part, given_from, 0, 0, 1e9, from));
  snprintf(part, sizeof part, "%.80s.until", key);
  EP_TRY(ep_read_number(r, part, given_until, 1e9, 0, 1e9, until));
  if (*until <= *from)
    return ep_read_refuse(r, part, "it ends at %g s, not after it begins at %g s", *until, *from);
  if (!ramp) return EP_OK;
  snprintf(part, sizeof part, "%.80s.ramp", key);
  EP_TRY(ep_read_number(r, part, given_ramp, 0, 0, 1e9, ramp));
  if (2 * *ramp > *until - *from)
    return ep_read_refuse(r, part, "rise and fall of %g s each do not fit between %g and %g s",
                          *ramp, *from, *until);
  return EP_OK;
}

static ep_status read_push(const ep_scene_reader *r, const char *key, const raw_push *raw,
                           ep_load *out) {
  char part[112];
  const raw_selection where = {raw->box,   raw->plane, raw->file,
                               raw->field, raw->above, raw->equals};
  EP_TRY(ep_read_selection(r, key, &where, &out->where));
  snprintf(part, sizeof part, "%.80s.force", key);
  EP_TRY(ep_read_vector(r, part, raw->force, out->vector));
  return read_span(r, key, raw->from, raw->until, raw->ramp, &out->from, &out->until, &out->ramp);
}

static ep_status read_drag(const ep_scene_reader *r, const char *key, const raw_drag *raw,
                           ep_scene_drag *out) {
  char part[112];
  const raw_selection where = {raw->box,   raw->plane, raw->file,
                               raw->field, raw->above, raw->equals};
  EP_TRY(ep_read_selection(r, key, &where, &out->where));
  out->path.smooth = raw->smooth && *raw->smooth;
  out->path.key = calloc(raw->path_count, sizeof *out->path.key);
  if (!out->path.key) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->path_count; i++) {
    ep_keyframe *k = &out->path.key[out->path.keys++];
    snprintf(part, sizeof part, "%.80s.path.%u.time", key, i);
    EP_TRY(ep_read_number(r, part, &raw->path[i].time, 0, 0, 1e9, &k->time));
    if (i > 0 && k->time <= k[-1].time)
      return ep_read_refuse(r, part, "%g s does not come after %g s; order the path by time",
                            k->time, k[-1].time);
    snprintf(part, sizeof part, "%.80s.path.%u.at", key, i);
    EP_TRY(ep_read_bounded(r, part, raw->path[i].at, EP_PLACE_MOST, k->move));
  }
  snprintf(part, sizeof part, "%.80s.stiffness", key);
  EP_TRY(ep_read_number(r, part, &raw->stiffness, 0, 1e-9, 1e12, &out->stiffness));
  snprintf(part, sizeof part, "%.80s.damping", key);
  EP_TRY(ep_read_number(r, part, raw->damping, 0, 0, 1e12, &out->damping));
  return read_span(r, key, raw->from, raw->until, NULL, &out->from, &out->until, NULL);
}

static ep_status read_pressure(const ep_scene_reader *r, const char *key, const raw_pressure *raw,
                               ep_scene_pressure *out) {
  char part[112];
  const raw_selection where = {raw->box,   raw->plane, raw->file,
                               raw->field, raw->above, raw->equals};
  out->selected = raw->box || raw->plane || raw->file || raw->field || raw->above || raw->equals;
  if (out->selected) EP_TRY(ep_read_selection(r, key, &where, &out->where));
  snprintf(part, sizeof part, "%.80s.pascal", key);
  EP_TRY(ep_read_number(r, part, &raw->pascal, 0, -1e12, 1e12, &out->pascal));
  return read_span(r, key, raw->from, raw->until, raw->ramp, &out->from, &out->until, &out->ramp);
}

static ep_status read_load(const ep_scene_reader *r, unsigned index, const raw_load *given,
                           ep_scene *out) {
  char key[64];
  snprintf(key, sizeof key, "loads.%u", index);
  if (!!given->gravity + !!given->push + !!given->drag + !!given->pressure != 1)
    return ep_read_refuse(r, key, "give one of gravity, push, drag, pressure");
  snprintf(key, sizeof key, "loads.%u.%s", index,
           given->gravity ? "gravity"
           : given->push  ? "push"
           : given->drag  ? "drag"
                          : "pressure");
  if (given->pressure)
    return read_pressure(r, key, given->pressure, &out->pressure[out->npressures++]);
  if (given->drag) return read_drag(r, key, given->drag, &out->drag[out->ndrags++]);
  ep_load *load = &out->load[out->nloads++];
  load->gravity = given->gravity != NULL;
  return load->gravity ? ep_read_vector(r, key, given->gravity, load->vector)
                       : read_push(r, key, given->push, load);
}

ep_status ep_read_loads(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out) {
  if (!raw->loads_count) return EP_OK;
  out->load = calloc(raw->loads_count, sizeof *out->load);
  out->drag = calloc(raw->loads_count, sizeof *out->drag);
  out->pressure = calloc(raw->loads_count, sizeof *out->pressure);
  if (!out->load || !out->drag || !out->pressure) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->loads_count; i++) EP_TRY(read_load(r, i, &raw->loads[i], out));
  return EP_OK;
}
