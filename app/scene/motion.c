#include "app/scene/motion.h"

#include <math.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

void ep_turn_matrix(const ep_turn *turn, double R[9]) {
  const double *a = turn->axis, length = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  const double angle = turn->degrees * pi / 180, c = cos(angle), s = sin(angle);
  for (int i = 0; i < 9; i++) R[i] = i % 4 == 0;
  if (turn->degrees == 0 || !(length > 0)) return;
  const double n[3] = {a[0] / length, a[1] / length, a[2] / length};
  const double k[9] = {0, -n[2], n[1], n[2], 0, -n[0], -n[1], n[0], 0};
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      R[3 * i + j] = c * (i == j) + s * k[3 * i + j] + (1 - c) * n[i] * n[j];
}

// Unit quaternion (w, x, y, z) of a turn.
static void quaternion(const ep_turn *turn, double q[4]) {
  const double *a = turn->axis, length = sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  const double half = length > 0 ? turn->degrees * pi / 360 : 0;
  q[0] = cos(half);
  for (int i = 0; i < 3; i++) q[i + 1] = length > 0 ? sin(half) * a[i] / length : 0;
}

static void matrix(const double q[4], double R[9]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double out[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
  memcpy(R, out, sizeof out);
}

static bool one_axis(const ep_turn *a, const ep_turn *b) {
  return a->degrees == 0 || b->degrees == 0 ||
         (a->axis[0] == b->axis[0] && a->axis[1] == b->axis[1] && a->axis[2] == b->axis[2]);
}

static void between(const ep_turn *a, const ep_turn *b, double s, double R[9]) {
  if (one_axis(a, b)) {
    ep_turn turn = b->degrees == 0 ? *a : *b;
    turn.degrees = (1 - s) * a->degrees + s * b->degrees;
    ep_turn_matrix(&turn, R);
    return;
  }
  double p[4], q[4], out[4], dot = 0, norm = 0;
  quaternion(a, p);
  quaternion(b, q);
  for (int i = 0; i < 4; i++) dot += p[i] * q[i];
  const double sign = dot < 0 ? -1 : 1, angle = acos(fmin(1, fabs(dot))), sine = sin(angle);
  const double wp = sine > 1e-6 ? sin((1 - s) * angle) / sine : 1 - s;
  const double wq = sign * (sine > 1e-6 ? sin(s * angle) / sine : s);
  for (int i = 0; i < 4; i++) {
    out[i] = wp * p[i] + wq * q[i];
    norm += out[i] * out[i];
  }
  for (int i = 0; i < 4; i++) out[i] /= sqrt(norm);
  matrix(out, R);
}

void ep_motion_at(const ep_motion_path *path, double t, double move[3], double R[9]) {
  const ep_turn none = {.degrees = 0};
  move[0] = move[1] = move[2] = 0;
  ep_turn_matrix(&none, R);
  if (path->keys == 0) return;
  int next = 0;
  while (next < path->keys && path->key[next].time <= t) next++;
  const ep_keyframe *a = &path->key[next > 0 ? next - 1 : 0];
  const ep_keyframe *b = &path->key[next < path->keys ? next : path->keys - 1];
  double s = b->time > a->time ? (t - a->time) / (b->time - a->time) : 0;
  if (path->smooth) s = s * s * (3 - 2 * s);
  for (int i = 0; i < 3; i++) move[i] = (1 - s) * a->move[i] + s * b->move[i];
  between(&a->turn, &b->turn, s, R);
}
