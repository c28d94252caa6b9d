#include "mesh/quality.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static void cross(const double *a, const double *b, double *c) {
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double length(const double *a) {
  return hypot(hypot(a[0], a[1]), a[2]);
}

// Area vectors (twice the area) of the faces opposite to each corner, outward where V > 0.
static void face_normals(const double d[9], double n[4][3]) {
  cross(d + 6, d + 3, n[1]);
  cross(d, d + 6, n[2]);
  cross(d + 3, d, n[3]);
  for (int k = 0; k < 3; k++) n[0][k] = -(n[1][k] + n[2][k] + n[3][k]);
}

// Both from sine and cosine: an arc cosine alone loses angles below 1e-6.
static double angle_between(const double *a, const double *b) {
  double c[3];
  cross(a, b, c);
  return 180 / M_PI * atan2(length(c), -dot(a, b));
}

// 24 V R = sqrt of Heron's product of the three products of opposite edges.
static double circumradius(const double d[9], double volume) {
  double e[6][3], p[3];
  for (int k = 0; k < 3; k++) {
    for (int i = 0; i < 3; i++) e[i][k] = d[3 * i + k];
    e[3][k] = d[6 + k] - d[3 + k];
    e[4][k] = d[6 + k] - d[k];
    e[5][k] = d[3 + k] - d[k];
  }
  for (int i = 0; i < 3; i++) p[i] = length(e[i]) * length(e[3 + i]);
  const double product =
      (p[0] + p[1] + p[2]) * (-p[0] + p[1] + p[2]) * (p[0] - p[1] + p[2]) * (p[0] + p[1] - p[2]);
  return sqrt(fmax(0, product)) / (24 * volume);
}

ep_tet_shape ep_shape_of_tet(const double *x) {
  double d[9], n[4][3], c[3], scale = 0;
  ep_tet_shape out = {0, 180, 0};
  for (int i = 0; i < 9; i++) d[i] = x[3 + i] - x[i % 3];
  for (int i = 0; i < 9; i++) scale = fmax(scale, fabs(d[i]));
  if (!(scale > 0)) return out;
  for (int i = 0; i < 9; i++) d[i] /= scale; // so that nothing under- or overflows
  face_normals(d, n);
  cross(d + 3, d + 6, c);
  const double volume = fabs(dot(d, c)) / 6;
  double area = 0;
  for (int i = 0; i < 4; i++) area += 0.5 * length(n[i]);
  if (!(volume > 0)) return out;
  out.low = 180, out.high = 0;
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < i; j++) {
      const double angle = angle_between(n[i], n[j]);
      out.low = fmin(out.low, angle);
      out.high = fmax(out.high, angle);
    }
  const double radius = circumradius(d, volume);
  out.radius_ratio = radius > 0 ? fmin(1, 3 * (3 * volume / area) / radius) : 0;
  return out;
}

static double badness(const ep_tet_shape *s) {
  return fmin(s->low, 180 - s->high);
}

static void note_worst(ep_mesh_quality *q, int e, const ep_tet_shape *shape) {
  int at = q->worst_count;
  while (at > 0 && badness(&q->worst_shape[at - 1]) > badness(shape)) at--;
  if (at == EP_WORST_TETS) return;
  if (q->worst_count < EP_WORST_TETS) q->worst_count++;
  const size_t behind = (size_t)(q->worst_count - 1 - at);
  memmove(q->worst + at + 1, q->worst + at, behind * sizeof *q->worst);
  memmove(q->worst_shape + at + 1, q->worst_shape + at, behind * sizeof *q->worst_shape);
  q->worst[at] = e;
  q->worst_shape[at] = *shape;
}

void ep_mesh_measure(const ep_mesh *mesh, ep_mesh_quality *out) {
  *out = (ep_mesh_quality){.low = 180, .radius_ratio = 1};
  for (int e = 0; e < mesh->nt; e++) {
    double x[12];
    for (int i = 0; i < 4; i++)
      memcpy(x + 3 * i, mesh->x + 3 * (size_t)mesh->tet[4 * (size_t)e + (size_t)i], 3 * sizeof *x);
    const ep_tet_shape shape = ep_shape_of_tet(x);
    out->low = fmin(out->low, shape.low);
    out->high = fmax(out->high, shape.high);
    out->radius_ratio = fmin(out->radius_ratio, shape.radius_ratio);
    out->mean_ratio += shape.radius_ratio / mesh->nt;
    if (!(badness(&shape) < EP_SLIVER_DEGREES)) continue;
    out->slivers++;
    note_worst(out, e, &shape);
  }
}

void ep_mesh_worst_text(const ep_mesh_quality *q, char *text, size_t size) {
  size_t used = 0;
  text[0] = '\0';
  for (int i = 0; i < q->worst_count && used + 60 < size; i++)
    used +=
        (size_t)snprintf(text + used, size - used, "%stet %d (%.3g to %.4g degrees)", i ? ", " : "",
                         q->worst[i] + 1, q->worst_shape[i].low, q->worst_shape[i].high);
}
