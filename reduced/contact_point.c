#include "reduced/contact_point.h"

#include <math.h>

static double dot3(const double a[3], const double b[3]) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void rotate(const double R[9], const double a[3], double out[3]) {
  for (int i = 0; i < 3; i++) out[i] = dot3(R + 3 * i, a);
}

// 1 + growth y^3 up to deepest, then constant.
static const double growth = 20, deepest = 4;

double ep_contact_penalty(const ep_contact_law *law, double p, double *slope, double *curvature) {
  const double h = law->thickness, delta = law->depth;
  *slope = *curvature = 0;
  if (!(p > 0)) return 0;
  if (p < h) {
    *curvature = p / h;
    *slope = p * p / (2 * h);
    return p * p * p / (6 * h);
  }
  const double all = (p - h) / delta, y = fmin(all, deepest), y3 = growth * y * y * y;
  *curvature = 1 + y3;
  *slope = 0.5 * h + delta * y * (1 + y3 / 4);
  const double energy = h * h / 6 + delta * y * (0.5 * h + delta * y * (0.5 + y3 / 20));
  if (all <= deepest) return energy;
  const double rest = delta * (all - deepest), before = *slope;
  *slope += *curvature * rest;
  return energy + rest * (before + 0.5 * *curvature * rest);
}

// The half-space a fast point meets in this step, in the obstacle's coordinates; 0: none.
static int entered(const ep_obstacle *o, const ep_contact_path *path, double normal[3],
                   double *offset) {
  double from[3], to[3], far = 0.25 * ep_obstacle_inner_radius(o), square = 0;
  ep_obstacle_to_local(&o->start, path->start, from);
  ep_obstacle_to_local(&o->end, path->ahead, to);
  for (int i = 0; i < 3; i++) square += (to[i] - from[i]) * (to[i] - from[i]);
  return square > far * far && ep_obstacle_entry(o, from, to, normal, offset);
}

// Distance and normal (world) at x: to the obstacle, or to the half-space it is in this step.
typedef struct facing {
  const ep_obstacle *obstacle;
  int half_space;
  double normal[3], offset;
} facing;

static double distance_at(const facing *f, const double x[3], double normal[3]) {
  double y[3], n[3], distance;
  ep_obstacle_to_local(&f->obstacle->end, x, y);
  if (f->half_space) {
    for (int i = 0; i < 3; i++) n[i] = f->normal[i];
    distance = dot3(n, y) - f->offset;
  } else {
    distance = ep_obstacle_distance(f->obstacle, y, n);
  }
  rotate(f->obstacle->end.R, n, normal);
  return distance;
}

static void add_outer(double scale, const double a[3], double h[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) h[3 * i + j] += scale * (a[i] * a[j]);
}

// Friction force N mu f1(|s|)/|s| s with f1 = 2 y/e - (y/e)^2 below e, else 1.
static void add_friction(double limit, double creep, int careful, const double n[3],
                         const double s[3], ep_contact_action *out) {
  const double y = sqrt(dot3(s, s)), t = y / creep;
  double ratio, bend; // f1(y)/y and f1'(y)
  if (y < creep) {
    out->energy += limit * (creep / 3 + y * t - y * t * t / 3);
    ratio = (2 - t) / creep;
    bend = (2 - 2 * t) / creep;
  } else {
    out->energy += limit * y;
    ratio = 1 / y;
    bend = careful ? ratio : 0;
  }
  for (int i = 0; i < 3; i++) out->gradient[i] += limit * ratio * s[i];
  // ratio (I - n n^T - d d^T) + bend d d^T, d = s/|s|: both factors >= 0.
  for (int i = 0; i < 3; i++) out->hessian[4 * i] += limit * ratio;
  add_outer(-limit * ratio, n, out->hessian);
  if (y > 0) {
    const double d[3] = {s[0] / y, s[1] / y, s[2] / y};
    add_outer(limit * (bend - ratio), d, out->hessian);
  }
}

// Damping and friction by the normal force at x_lag.
static int add_lagged(const ep_contact_law *law, const facing *face, const ep_contact_path *path,
                      double area, ep_contact_action *out) {
  const ep_obstacle *o = face->obstacle;
  double n[3], slope, curvature, local[3], carried[3], s[3];
  const double p = law->thickness - distance_at(face, path->lag, n);
  if (!(p > 0)) return 0;
  ep_contact_penalty(law, p, &slope, &curvature);
  ep_obstacle_to_local(&o->start, path->start, local);
  ep_obstacle_to_world(&o->end, local, carried);
  for (int i = 0; i < 3; i++) s[i] = path->now[i] - carried[i];
  const double along = dot3(n, s), viscous = law->damping * law->stiffness * area * curvature;
  if (viscous > 0) {
    out->energy += 0.5 * viscous / law->dt * along * along;
    for (int i = 0; i < 3; i++) out->gradient[i] += viscous / law->dt * along * n[i];
    add_outer(viscous / law->dt, n, out->hessian);
  }
  const double limit = o->friction * law->stiffness * area * slope;
  for (int i = 0; i < 3; i++) s[i] -= along * n[i];
  if (limit > 0) add_friction(limit, law->creep * law->dt, law->careful, n, s, out);
  return 1;
}

int ep_contact_point(const ep_contact_law *law, const ep_obstacle *obstacle,
                     const ep_contact_path *path, double area, ep_contact_action *out) {
  facing face = {.obstacle = obstacle};
  if (path->fast) face.half_space = entered(obstacle, path, face.normal, &face.offset);
  double n[3], slope, curvature;
  out->distance = distance_at(&face, path->now, n);
  const double energy = law->stiffness * area *
                        ep_contact_penalty(law, law->thickness - out->distance, &slope, &curvature);
  out->pressing = law->stiffness * area * slope;
  int acts = out->distance < law->thickness;
  out->energy += energy;
  out->normal_energy += energy;
  for (int i = 0; i < 3 && acts; i++) out->gradient[i] -= out->pressing * n[i];
  if (acts) add_outer(law->stiffness * area * curvature, n, out->hessian);
  if (path->lag && (obstacle->friction > 0 || law->damping > 0))
    acts |= add_lagged(law, &face, path, area, out);
  return acts;
}

void ep_contact_change(const ep_contact_law *law, const ep_obstacle *obstacle,
                       const ep_contact_path *path, double area, double *change, double *pressing) {
  facing face = {.obstacle = obstacle};
  double n[3], now, lag, unused;
  if (!path->lag) return;
  if (path->fast) face.half_space = entered(obstacle, path, face.normal, &face.offset);
  ep_contact_penalty(law, law->thickness - distance_at(&face, path->now, n), &now, &unused);
  ep_contact_penalty(law, law->thickness - distance_at(&face, path->lag, n), &lag, &unused);
  *change += law->stiffness * area * fabs(now - lag);
  *pressing += law->stiffness * area * now;
}
