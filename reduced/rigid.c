#include "reduced/rigid.h"

#include <math.h>
#include <string.h>

#include "reduced/state.h"

// y = A x for a symmetric matrix in packed lower rows.
static void symmetric_times(int r, const double *a, const double *x, double *y) {
  for (int i = 0; i < r; a += ++i) {
    y[i] = ep_dot(i + 1, a, x);
    for (int j = 0; j < i; j++) y[j] += a[j] * x[i];
  }
}

// y = A^T x for an antisymmetric matrix in packed lower rows.
static void antisymmetric_times(int r, const double *a, const double *x, double *y) {
  for (int i = 0; i < r; a += ++i) {
    y[i] = -ep_dot(i, a, x);
    for (int j = 0; j < i; j++) y[j] += a[j] * x[i];
  }
}

static size_t pairs(const ep_model *model) {
  return (size_t)model->size.r * ((size_t)model->size.r + 1) / 2;
}

void ep_rigid_sums(const ep_model *model, const double *q, double s[6], double *ds, double *h) {
  const int r = model->size.r;
  for (int k = 0; k < 6; k++) {
    const double *s1 = model->rigid_s1 + (size_t)k * (size_t)r;
    const double *s2 = model->rigid_s2 + (size_t)k * pairs(model);
    s[k] = model->rigid_s0[k] + ep_dot(r, s1, q);
    if (ds) {
      double *d = ds + (size_t)k * (size_t)r;
      symmetric_times(r, s2, q, d);
      s[k] += ep_dot(r, d, q);
      for (int a = 0; a < r; a++) d[a] = s1[a] + 2 * d[a];
    } else {
      for (int i = 0; i < r; s2 += ++i) s[k] += q[i] * (2 * ep_dot(i, s2, q) + s2[i] * q[i]);
    }
  }
  for (int k = 0; h && k < 3; k++)
    antisymmetric_times(r, model->rigid_h + (size_t)k * pairs(model), q, h + (size_t)k * (size_t)r);
}

void ep_rigid_tensor(const double s[6], double j[9]) {
  const double trace = s[0] + s[1] + s[2];
  j[0] = trace - s[0], j[4] = trace - s[1], j[8] = trace - s[2];
  j[5] = j[7] = -s[3], j[2] = j[6] = -s[4], j[1] = j[3] = -s[5];
}

void ep_rigid_internal(const ep_model *model, const double *q, const double *v, double out[3]) {
  const int r = model->size.r;
  for (int k = 0; k < 3; k++) {
    const double *h = model->rigid_h + (size_t)k * pairs(model);
    out[k] = 0;
    for (int i = 0; i < r; h += ++i) out[k] += q[i] * ep_dot(i, h, v) - v[i] * ep_dot(i, h, q);
  }
}

void ep_cross(const double a[3], const double b[3], double out[3]) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

void ep_rotate(const double r[9], const double x[3], double out[3]) {
  for (int i = 0; i < 3; i++) out[i] = r[3 * i] * x[0] + r[3 * i + 1] * x[1] + r[3 * i + 2] * x[2];
}

void ep_rotate_back(const double r[9], const double x[3], double out[3]) {
  for (int i = 0; i < 3; i++) out[i] = r[i] * x[0] + r[3 + i] * x[1] + r[6 + i] * x[2];
}

void ep_multiply3(const double a[9], const double b[9], double out[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      out[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

// Rodrigues: I + sin(t)/t V + (1 - cos t)/t^2 V^2.
void ep_rotation_exp(const double v[3], double r[9]) {
  const double t2 = v[0] * v[0] + v[1] * v[1] + v[2] * v[2], t = sqrt(t2);
  const double a = t2 < 1e-8 ? 1 - t2 / 6 : sin(t) / t;
  const double half = t2 < 1e-8 ? 0.5 - t2 / 48 : sin(0.5 * t) / t; // b = 2 half^2
  const double b = 2 * half * half;
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) r[3 * i + j] = b * (v[i] * v[j] - (i == j ? t2 : 0)) + (i == j);
  r[1] -= a * v[2], r[2] += a * v[1], r[3] += a * v[2];
  r[5] -= a * v[0], r[6] -= a * v[1], r[7] += a * v[0];
}

// By the quaternion of R: its largest component is found first, so that no angle is special.
void ep_rotation_log(const double r[9], double v[3]) {
  const double d[4] = {r[0] + r[4] + r[8], r[0] - r[4] - r[8], r[4] - r[0] - r[8],
                       r[8] - r[0] - r[4]};
  double q[4];
  int best = 0;
  for (int i = 1; i < 4; i++)
    if (d[i] > d[best]) best = i;
  const double p = 0.5 * sqrt(1 + d[best]), scale = 0.25 / p;
  const double vee[3] = {r[7] - r[5], r[2] - r[6], r[3] - r[1]};
  const double sum[3] = {r[5] + r[7], r[2] + r[6], r[1] + r[3]}; // yz zx xy
  q[best] = p;
  if (best == 0) {
    for (int i = 0; i < 3; i++) q[i + 1] = scale * vee[i];
  } else {
    const int k = best - 1, l = (k + 1) % 3, m = (k + 2) % 3;
    q[0] = scale * vee[k];
    q[l + 1] = scale * sum[m];
    q[m + 1] = scale * sum[l];
  }
  const double sine = sqrt(q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  const double turn = q[0] < 0 ? -2 * atan2(sine, -q[0]) : 2 * atan2(sine, q[0]);
  const double factor = sine > 1e-12 ? turn / sine : (q[0] < 0 ? -2 : 2);
  for (int i = 0; i < 3; i++) v[i] = factor * q[i + 1];
}

void ep_rotation_clean(double r[9]) {
  const double first = 1 / sqrt(ep_dot(3, r, r));
  for (int i = 0; i < 3; i++) r[i] *= first;
  const double along = ep_dot(3, r, r + 3);
  for (int i = 0; i < 3; i++) r[3 + i] -= along * r[i];
  const double second = 1 / sqrt(ep_dot(3, r + 3, r + 3));
  for (int i = 0; i < 3; i++) r[3 + i] *= second;
  ep_cross(r, r + 3, r + 6);
}

int ep_inverse3(const double a[9], double out[9]) {
  double l[9];
  if (!ep_cholesky(3, a, l)) return 0;
  for (int c = 0; c < 3; c++) {
    double x[3] = {c == 0, c == 1, c == 2};
    ep_solve_lower(3, l, x);
    ep_solve_lower_transposed(3, l, x);
    for (int i = 0; i < 3; i++) out[3 * i + c] = x[i];
  }
  return 1;
}
