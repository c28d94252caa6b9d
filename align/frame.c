#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// Region centroids must reach this share of the rms radius in two directions to fix a rotation.
static const double FRAME_SPREAD = 0.1;
// Fewer points do not fix a frame reliably (6 always right, 3 in 27 of 30, 2 no help).
enum { FRAME_REGIONS = 4, FRAME_ROUNDS = 20 };

void ep_frame_identity(double r[9]) {
  memset(r, 0, 9 * sizeof *r);
  r[0] = r[4] = r[8] = 1;
}

double ep_frame_angle(const double r[9]) {
  // From the skew part and the trace: exact also near 0 and 180 degrees.
  const double sx = r[7] - r[5], sy = r[2] - r[6], sz = r[3] - r[1];
  const double sine = sqrt(sx * sx + sy * sy + sz * sz);
  return atan2(sine, r[0] + r[4] + r[8] - 1) * 180 / acos(-1);
}

void ep_frame_multiply(const double a[9], const double b[9], double out[9]) {
  double c[9];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
  memcpy(out, c, sizeof c);
}

void ep_frame_transpose(const double a[9], double out[9]) {
  double c[9];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) c[3 * i + j] = a[3 * j + i];
  memcpy(out, c, sizeof c);
}

void ep_frame_apply(int n, const double r[9], const double *x, double *y) {
  for (int i = 0; i < n; i++) {
    const double *p = x + 3 * (size_t)i;
    double *q = y + 3 * (size_t)i;
    for (int c = 0; c < 3; c++) q[c] = r[3 * c] * p[0] + r[3 * c + 1] * p[1] + r[3 * c + 2] * p[2];
  }
}

// Volume-weighted centroids of the regions in use, (returned number x 3).
static int region_centroids(const ep_side *side, const unsigned char *use, double *out) {
  int count = 0;
  for (int g = 0; g < side->regions; g++) {
    if (use && !use[g]) continue;
    double sum[3] = {0}, weight = 0;
    for (int i = 0; i < side->n; i++) {
      const double w = side->share[i] * side->indicator[(size_t)i * side->regions + g];
      weight += w;
      for (int c = 0; c < 3; c++) sum[c] += w * side->x[3 * i + c];
    }
    for (int c = 0; c < 3; c++) out[3 * count + c] = sum[c] / weight;
    count++;
  }
  return count;
}

static void second_moment(int count, const double *x, const double *weight, double s[9]) {
  double mean[3] = {0}, total = 0;
  memset(s, 0, 9 * sizeof *s);
  for (int i = 0; i < count; i++) {
    total += weight[i];
    for (int c = 0; c < 3; c++) mean[c] += weight[i] * x[3 * i + c];
  }
  for (int i = 0; i < count; i++)
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++)
        s[3 * a + b] +=
            weight[i] / total * (x[3 * i + a] - mean[a] / total) * (x[3 * i + b] - mean[b] / total);
}

static ep_status spread_enough(int count, const double *x, const double *weight, double radius,
                               bool *enough, ep_error *err) {
  double s[9], lambda[3], v[9];
  second_moment(count, x, weight, s);
  EP_TRY(ep_eigen_symmetric(3, s, lambda, v, err));
  const double least = FRAME_SPREAD * radius;
  *enough = lambda[1] > least * least;
  return EP_OK;
}

static int compare_doubles(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// Iteratively reweighted Kabsch. x: centroids of `to`, y: of `from`; weight, sorted: scratch.
static ep_status robust_kabsch(int count, const double *x, const double *y, double radius,
                               double *weight, double *sorted, double r[9], bool *found,
                               ep_error *err) {
  for (int i = 0; i < count; i++) weight[i] = 1;
  for (int round = 0; round < FRAME_ROUNDS; round++) {
    EP_TRY(spread_enough(count, x, weight, radius, found, err));
    if (*found) EP_TRY(spread_enough(count, y, weight, radius, found, err));
    if (!*found) return EP_OK;
    double cx[3], cy[3];
    EP_TRY(ep_kabsch(count, x, y, weight, r, cx, cy, err));
    for (int i = 0; i < count; i++) {
      double d[3], turned[3], e2 = 0;
      for (int c = 0; c < 3; c++) d[c] = x[3 * i + c] - cx[c];
      ep_frame_apply(1, r, d, turned);
      for (int c = 0; c < 3; c++) e2 += pow(turned[c] - (y[3 * i + c] - cy[c]), 2);
      weight[i] = sorted[i] = sqrt(e2);
    }
    qsort(sorted, (size_t)count, sizeof *sorted, compare_doubles);
    // Not below a few per cent of the size: centroids of right regions differ by that much.
    const double scale = fmax(2 * sorted[count / 2], 0.05 * radius);
    for (int i = 0; i < count; i++) weight[i] = 1 / (1 + pow(weight[i] / scale, 2));
  }
  return EP_OK;
}

ep_status ep_frame_from_regions(const ep_side *from, const ep_side *to, const unsigned char *use,
                                double r[9], bool *found, ep_error *err) {
  ep_frame_identity(r);
  *found = false;
  if (from->regions < FRAME_REGIONS) return EP_OK;
  const size_t most = (size_t)from->regions;
  double *work = malloc(8 * most * sizeof *work);
  if (!work) return ep_fail(err, EP_ERR_MEMORY, "no memory for %zu regions", most);
  double *y = work, *x = work + 3 * most, *weight = work + 6 * most, *sorted = work + 7 * most;
  const int count = region_centroids(from, use, y);
  region_centroids(to, use, x);
  ep_status status = EP_OK;
  if (count >= FRAME_REGIONS)
    status = robust_kabsch(count, x, y, from->radius, weight, sorted, r, found, err);
  if (!*found) ep_frame_identity(r);
  free(work);
  return status;
}

ep_status ep_frame_from_map(const ep_side *from, const ep_side *to, const int *p, bool mirrored,
                            double r[9], ep_error *err) {
  double *image = malloc(3 * (size_t)from->n * sizeof *image);
  if (!image) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d points", from->n);
  const double side = mirrored ? -1 : 1;
  for (int i = 0; i < from->n; i++)
    for (int c = 0; c < 3; c++) image[3 * (size_t)i + c] = side * to->x[3 * (size_t)p[i] + c];
  double cx[3], cy[3];
  const ep_status status = ep_kabsch(from->n, image, from->x, from->share, r, cx, cy, err);
  for (int c = 0; c < 9; c++) r[c] *= side;
  free(image);
  return status;
}

ep_status ep_frame_axes(const ep_side *side, double v[9], double variance[3], ep_error *err) {
  double s[9];
  second_moment(side->n, side->x, side->share, s);
  EP_TRY(ep_eigen_symmetric(3, s, variance, v, err));
  if (ep_determinant3(v) < 0)
    for (int c = 0; c < 3; c++) v[6 + c] = -v[6 + c];
  return EP_OK;
}

ep_status ep_frame_from_axes(const ep_side *from, const ep_side *to, double r[9], ep_error *err) {
  double vf[9], vt[9], back[9], variance[3], least = 1000;
  EP_TRY(ep_frame_axes(from, vf, variance, err));
  EP_TRY(ep_frame_axes(to, vt, variance, err));
  ep_frame_transpose(vf, back);
  for (int flip = 0; flip < 4; flip++) {
    const double sign[3] = {flip & 1 ? -1 : 1, flip & 2 ? -1 : 1,
                            ((flip & 1) != 0) != ((flip & 2) != 0) ? -1 : 1};
    double flipped[9], candidate[9];
    for (int i = 0; i < 9; i++) flipped[i] = sign[i / 3] * vt[i];
    ep_frame_multiply(back, flipped, candidate);
    if (ep_frame_angle(candidate) >= least) continue;
    least = ep_frame_angle(candidate);
    memcpy(r, candidate, sizeof candidate);
  }
  return EP_OK;
}
