// Obstacles of a scene, their motion, how contact works.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/scene_reader.h"

ep_status ep_read_turn(const ep_scene_reader *r, const char *key, const raw_turn *raw,
                       ep_turn *out) {
  char part[112];
  *out = (ep_turn){.degrees = 0};
  if (!raw) return EP_OK;
  snprintf(part, sizeof part, "%.90s.axis", key);
  EP_TRY(ep_read_direction(r, part, "the axis", raw->axis, out->axis));
  snprintf(part, sizeof part, "%.90s.degrees", key);
  return ep_read_number(r, part, &raw->degrees, 0, -1e6, 1e6, &out->degrees);
}

ep_status ep_read_motion(const ep_scene_reader *r, const char *key, unsigned count,
                         const raw_keyframe *raw, const bool *smooth, ep_motion_path *out) {
  char part[112];
  out->smooth = smooth && *smooth;
  if (!count) return EP_OK;
  out->key = calloc(count, sizeof *out->key);
  if (!out->key) return ep_read_no_memory(r);
  out->keys = (int)count;
  for (unsigned i = 0; i < count; i++) {
    ep_keyframe *k = &out->key[i];
    snprintf(part, sizeof part, "%.80s.%u.time", key, i);
    EP_TRY(ep_read_number(r, part, &raw[i].time, 0, 0, 1e9, &k->time));
    if (i > 0 && k->time <= out->key[i - 1].time)
      return ep_read_refuse(r, part, "%g s does not come after %g s; order keyframes by time",
                            k->time, out->key[i - 1].time);
    snprintf(part, sizeof part, "%.80s.%u.move", key, i);
    if (raw[i].move) EP_TRY(ep_read_bounded(r, part, raw[i].move, EP_PLACE_MOST, k->move));
    snprintf(part, sizeof part, "%.80s.%u.turn", key, i);
    EP_TRY(ep_read_turn(r, part, raw[i].turn, &k->turn));
  }
  return EP_OK;
}

// Rotation whose third column is the unit normal; the others do not matter.
static void face(const double normal[3], double R[9]) {
  const double length = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
  const double n[3] = {normal[0] / length, normal[1] / length, normal[2] / length};
  int small = 0;
  for (int i = 1; i < 3; i++)
    if (fabs(n[i]) < fabs(n[small])) small = i;
  double a[3] = {-n[small] * n[0], -n[small] * n[1], -n[small] * n[2]};
  a[small] += 1;
  const double across = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  for (int i = 0; i < 3; i++) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    R[3 * i] = a[i] / across;
    R[3 * i + 1] = (n[j] * a[k] - n[k] * a[j]) / across;
    R[3 * i + 2] = n[i];
  }
}

static ep_status read_plane(const ep_scene_reader *r, const char *key, const raw_plane *raw,
                            ep_scene_obstacle *out) {
  double normal[3];
  char part[96];
  out->kind = EP_OBSTACLE_PLANE;
  snprintf(part, sizeof part, "%.60s.plane.point", key);
  EP_TRY(ep_read_bounded(r, part, raw->point, EP_PLACE_MOST, out->at.c));
  snprintf(part, sizeof part, "%.60s.plane.normal", key);
  EP_TRY(ep_read_direction(r, part, "the normal", raw->normal, normal));
  face(normal, out->at.R);
  return EP_OK;
}

static ep_status read_sphere(const ep_scene_reader *r, const char *key, const raw_sphere *raw,
                             ep_scene_obstacle *out) {
  char part[96];
  out->kind = EP_OBSTACLE_SPHERE;
  snprintf(part, sizeof part, "%.60s.sphere.center", key);
  EP_TRY(ep_read_bounded(r, part, raw->center, EP_PLACE_MOST, out->at.c));
  snprintf(part, sizeof part, "%.60s.sphere.radius", key);
  return ep_read_number(r, part, &raw->radius, 0, 1e-9, 1e9, &out->size[0]);
}

static ep_status read_box(const ep_scene_reader *r, const char *key, const raw_solid_box *raw,
                          ep_scene_obstacle *out) {
  double low[3], high[3];
  ep_turn turn;
  char part[96];
  out->kind = EP_OBSTACLE_BOX;
  snprintf(part, sizeof part, "%.60s.box.low", key);
  EP_TRY(ep_read_bounded(r, part, raw->low, EP_PLACE_MOST, low));
  snprintf(part, sizeof part, "%.60s.box.high", key);
  EP_TRY(ep_read_bounded(r, part, raw->high, EP_PLACE_MOST, high));
  for (int i = 0; i < 3; i++) {
    if (!(low[i] < high[i]))
      return ep_read_refuse(r, key, "box: low %g is not below high %g on axis %d", low[i], high[i],
                            i);
    out->at.c[i] = 0.5 * (low[i] + high[i]);
    out->size[i] = 0.5 * (high[i] - low[i]);
  }
  EP_TRY(ep_read_turn(r, key, raw->rotation, &turn));
  ep_turn_matrix(&turn, out->at.R);
  return EP_OK;
}

static ep_status read_obstacle(const ep_scene_reader *r, unsigned index, const raw_obstacle *raw,
                               double friction, ep_scene_obstacle *out) {
  char key[64];
  const ep_turn none = {.degrees = 0};
  ep_turn_matrix(&none, out->at.R);
  snprintf(key, sizeof key, "obstacles.%u", index);
  ep_read_place(r, key, out->place, sizeof out->place);
  if ((raw->plane != NULL) + (raw->sphere != NULL) + (raw->box != NULL) != 1)
    return ep_read_refuse(r, key, "give one of plane, sphere, box");
  if (raw->plane) EP_TRY(read_plane(r, key, raw->plane, out));
  if (raw->sphere) EP_TRY(read_sphere(r, key, raw->sphere, out));
  if (raw->box) EP_TRY(read_box(r, key, raw->box, out));
  snprintf(key, sizeof key, "obstacles.%u.friction", index);
  EP_TRY(ep_read_number(r, key, raw->friction, friction, 0, 100, &out->friction));
  snprintf(key, sizeof key, "obstacles.%u.motion", index);
  return ep_read_motion(r, key, raw->motion_count, raw->motion, raw->smooth, &out->motion);
}

static const double stiffest = 1e20; // Pa/m; far above diamond over a micrometre

// "auto" (or nothing) or a number.
static ep_status read_stiffness(const ep_scene_reader *r, const char *text, double *out) {
  char *end;
  *out = 0;
  if (!text || strcmp(text, "auto") == 0) return EP_OK;
  *out = strtod(text, &end);
  if (end == text || *end || !(*out > 0) || !(*out <= stiffest))
    return ep_read_refuse(r, "contact.stiffness",
                          "'%.40s': use auto or a positive number up to %g [Pa/m]", text, stiffest);
  return EP_OK;
}

ep_status ep_read_contact(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out) {
  const raw_contact none = {0}, *c = raw->contact ? raw->contact : &none;
  double friction;
  EP_TRY(read_stiffness(r, c->stiffness, &out->contact.stiffness));
  EP_TRY(ep_read_number(r, "contact.thickness", c->thickness, 0, 0, 1e9, &out->contact.thickness));
  EP_TRY(ep_read_number(r, "contact.depth", c->depth, 0, 0, 1e9, &out->contact.depth));
  EP_TRY(ep_read_number(r, "contact.damping", c->damping, 0, 0, 1e3, &out->contact.damping));
  EP_TRY(ep_read_number(r, "contact.friction", c->friction, 0, 0, 100, &friction));
  if (!raw->obstacles_count) return EP_OK;
  out->obstacle = calloc(raw->obstacles_count, sizeof *out->obstacle);
  if (!out->obstacle) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->obstacles_count; i++) {
    out->nobstacles++;
    EP_TRY(read_obstacle(r, i, &raw->obstacles[i], friction, &out->obstacle[i]));
  }
  return EP_OK;
}
