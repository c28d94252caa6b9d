#include "reduced/obstacle.h"

#include <math.h>

static double dot3(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static int finite_frame(const ep_frame *f) {
  int good = 1;
  for (int i = 0; i < 3; i++) good = good && isfinite(f->c[i]);
  for (int i = 0; i < 9; i++) good = good && isfinite(f->R[i]);
  return good;
}

int ep_obstacle_valid(const ep_obstacle *o) {
  if (!finite_frame(&o->start) || !finite_frame(&o->end)) return 0;
  if (!(o->friction >= 0) || !isfinite(o->friction)) return 0;
  if (o->kind == EP_OBSTACLE_PLANE) return 1;
  const int sizes = o->kind == EP_OBSTACLE_SPHERE ? 1 : 3;
  for (int i = 0; i < sizes; i++)
    if (!(o->size[i] > 0) || !isfinite(o->size[i])) return 0;
  if (o->kind == EP_OBSTACLE_SPHERE) return 1;
  return o->kind == EP_OBSTACLE_BOX && o->rounding >= 0 && o->rounding <= o->size[0] &&
         o->rounding <= o->size[1] && o->rounding <= o->size[2];
}

void ep_obstacle_to_world(const ep_frame *pose, const double local[3], double world[3]) {
  for (int i = 0; i < 3; i++) world[i] = pose->c[i] + dot3(pose->R + 3 * i, local);
}

void ep_obstacle_to_local(const ep_frame *pose, const double world[3], double local[3]) {
  const double d[3] = {world[0] - pose->c[0], world[1] - pose->c[1], world[2] - pose->c[2]};
  for (int i = 0; i < 3; i++)
    local[i] = pose->R[i] * d[0] + pose->R[3 + i] * d[1] + pose->R[6 + i] * d[2];
}

// ---- distances ---------------------------------------------------------------------------------

static double sphere_distance(double radius, const double y[3], double normal[3]) {
  const double length = sqrt(dot3(y, y));
  for (int i = 0; i < 3; i++) normal[i] = length > 0 ? y[i] / length : i == 2;
  return length - radius;
}

// Along each axis how far y lies beyond the faces of the box shrunk by its rounding: outside the
// length of the positive parts, inside the largest (nearest face).
static double box_distance(const ep_obstacle *o, const double y[3], double normal[3]) {
  double beyond[3], square = 0;
  int nearest = 0;
  for (int i = 0; i < 3; i++) {
    beyond[i] = fabs(y[i]) - (o->size[i] - o->rounding);
    if (beyond[i] > 0) square += beyond[i] * beyond[i];
    if (beyond[i] > beyond[nearest]) nearest = i;
    normal[i] = 0;
  }
  const double outside = sqrt(square);
  if (!(outside > 0)) {
    normal[nearest] = y[nearest] < 0 ? -1 : 1;
    return beyond[nearest] - o->rounding;
  }
  for (int i = 0; i < 3; i++)
    if (beyond[i] > 0) normal[i] = (y[i] < 0 ? -beyond[i] : beyond[i]) / outside;
  return outside - o->rounding;
}

double ep_obstacle_distance(const ep_obstacle *o, const double local[3], double normal[3]) {
  if (o->kind == EP_OBSTACLE_SPHERE) return sphere_distance(o->size[0], local, normal);
  if (o->kind == EP_OBSTACLE_BOX) return box_distance(o, local, normal);
  normal[0] = normal[1] = 0;
  normal[2] = 1;
  return local[2];
}

double ep_obstacle_inner_radius(const ep_obstacle *o) {
  if (o->kind == EP_OBSTACLE_SPHERE) return o->size[0];
  if (o->kind == EP_OBSTACLE_BOX) return fmin(o->size[0], fmin(o->size[1], o->size[2]));
  return INFINITY;
}

// ---- paths -------------------------------------------------------------------------------------

// The half-space that touches the obstacle at a point on its surface (or at the nearest one).
static void touching_plane(const ep_obstacle *o, const double y[3], double normal[3],
                           double *offset) {
  const double distance = ep_obstacle_distance(o, y, normal);
  *offset = dot3(normal, y) - distance;
}

// First t in (0, 1] where |from + t d| = radius; above 1 where there is none.
static double sphere_entry(double radius, const double from[3], const double d[3]) {
  const double a = dot3(d, d), b = dot3(from, d), c = dot3(from, from) - radius * radius;
  const double root = b * b - a * c;
  if (!(a > 0) || root < 0 || b >= 0) return 2;
  return (-b - sqrt(root)) / a;
}

// First t in (0, 1] where the path is inside all three slabs, and the axis it entered last.
static double box_entry(const double half[3], const double from[3], const double d[3], int *axis) {
  double first = -INFINITY, last = 1;
  for (int i = 0; i < 3; i++) {
    if (d[i] == 0) {
      if (fabs(from[i]) > half[i]) return 2;
      continue;
    }
    const double in = (d[i] > 0 ? -half[i] - from[i] : half[i] - from[i]) / d[i];
    const double out = (d[i] > 0 ? half[i] - from[i] : -half[i] - from[i]) / d[i];
    if (in > first) first = in, *axis = i;
    last = fmin(last, out);
  }
  return first <= last && first > 0 ? first : 2;
}

int ep_obstacle_entry(const ep_obstacle *o, const double from[3], const double to[3],
                      double normal[3], double *offset) {
  const double d[3] = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
  if (ep_obstacle_distance(o, from, normal) <= 0) {
    touching_plane(o, from, normal, offset);
    return 1;
  }
  int axis = 0;
  const double t = o->kind == EP_OBSTACLE_SPHERE ? sphere_entry(o->size[0], from, d)
                   : o->kind == EP_OBSTACLE_BOX  ? box_entry(o->size, from, d, &axis)
                                                 : (d[2] < 0 ? -from[2] / d[2] : 2);
  if (!(t <= 1)) return 0;
  const double at[3] = {from[0] + t * d[0], from[1] + t * d[1], from[2] + t * d[2]};
  if (o->kind != EP_OBSTACLE_BOX) {
    touching_plane(o, at, normal, offset);
    return 1;
  }
  for (int i = 0; i < 3; i++) normal[i] = i != axis ? 0 : d[i] > 0 ? -1 : 1;
  *offset = o->size[axis];
  return 1;
}
