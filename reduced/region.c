#include "reduced/region.h"

#include <math.h>

#include "reduced/jacobi.h"

int ep_model_regions(const ep_model *model) {
  return model->size.regions > 0 ? model->size.regions : 1;
}

// The rotation that takes rest nearest to now, A = sum_v b_v x_v (X_v - Xc)^T row-major: the
// largest eigenvector of a symmetric 4 x 4 matrix as quaternion (Horn 1987), never a reflection.
static void nearest_rotation(const double a[9], double r[9]) {
  double n[16] = {a[0] + a[4] + a[8], a[7] - a[5],        a[2] - a[6],        a[3] - a[1],
                  a[7] - a[5],        a[0] - a[4] - a[8], a[3] + a[1],        a[2] + a[6],
                  a[2] - a[6],        a[3] + a[1],        a[4] - a[0] - a[8], a[7] + a[5],
                  a[3] - a[1],        a[2] + a[6],        a[7] + a[5],        a[8] - a[0] - a[4]};
  double v[16];
  ep_jacobi(4, n, v);
  int best = 0;
  for (int i = 1; i < 4; i++)
    if (n[5 * i] > n[5 * best]) best = i;
  const double w = v[best], x = v[4 + best], y = v[8 + best], z = v[12 + best];
  r[0] = w * w + x * x - y * y - z * z, r[1] = 2 * (x * y - w * z), r[2] = 2 * (x * z + w * y);
  r[3] = 2 * (x * y + w * z), r[4] = w * w - x * x + y * y - z * z, r[5] = 2 * (y * z - w * x);
  r[6] = 2 * (x * z - w * y), r[7] = 2 * (y * z + w * x), r[8] = w * w - x * x - y * y + z * z;
}

// Take the motion of the region as a whole out of its descriptor: the rest of the object may carry
// it anywhere, which says nothing about its own shape. y = R^T (x - xc) + Xc, so that each
// coefficient sum_v a_v x_v becomes R^T (c - mu xc) + mu Xc, mu = sum_v a_v.
static void take_out_motion(const ep_model *m, int region, const double *q, double *c) {
  const int r = m->size.r;
  const double *map = m->region_motion + (size_t)region * 12 * (size_t)r;
  const double *rest = m->region_motion_rest + 12 * (size_t)region;
  double now[12], turn[9];
  for (int i = 0; i < 12; i++) {
    now[i] = rest[i];
    for (int a = 0; a < r; a++) now[i] += map[(size_t)i * (size_t)r + (size_t)a] * q[a];
  }
  nearest_rotation(now, turn);
  for (int f = ep_region_first(m, region); f < ep_region_first(m, region + 1); f++) {
    const double mean = m->region_mean[f];
    double d[3];
    for (int i = 0; i < 3; i++) d[i] = c[3 * f + i] - mean * now[9 + i];
    for (int i = 0; i < 3; i++)
      c[3 * f + i] = turn[i] * d[0] + turn[3 + i] * d[1] + turn[6 + i] * d[2] + mean * rest[9 + i];
  }
}

void ep_region_descriptor(const ep_model *model, int region, const double *q, double *c) {
  const int from = 3 * ep_region_first(model, region), r = model->size.r;
  for (int i = from; i < from + ep_region_length(model, region); i++) {
    double sum = model->c0[i];
    for (int a = 0; a < r; a++) sum += model->t[(size_t)i * (size_t)r + (size_t)a] * q[a];
    c[i] = sum;
  }
  if (model->region_carried && model->region_carried[region]) take_out_motion(model, region, q, c);
}

void ep_descriptor(const ep_model *model, const double *q, double *c) {
  for (int g = 0; g < ep_model_regions(model); g++) ep_region_descriptor(model, g, q, c);
}
