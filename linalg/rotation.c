// Rotations nearest to 3 x 3 matrices, and between point clouds.
#include <float.h>
#include <math.h>
#include <string.h>

#include "linalg/dense.h"

// Below this value of det F / |F|^3 the Newton iteration is left for the eigenvector method, which
// needs no inverse. The polar factor of such a matrix is ill-conditioned anyway.
static const double newton_determinant = 1e-8;
// Scaled Newton reaches round-off in at most nine iterations for any condition number a double can
// hold (Higham 1986); more says that something is not finite.
enum { NEWTON_ITERATIONS = 20, JACOBI_SWEEPS = 30 };
// Kabsch: the best rotation must beat the next stationary one by this share of the largest
// singular value, else the points do not determine it.
static const double kabsch_gap = 1e-9;

static double frobenius(const double f[9]) {
  double sum = 0;
  for (int i = 0; i < 9; i++) sum += f[i] * f[i];
  return sqrt(sum);
}

// C = cofactor matrix (det F) F^-T; returns det F.
static double cofactors(const double f[9], double c[9]) {
  c[0] = f[4] * f[8] - f[5] * f[7];
  c[1] = f[5] * f[6] - f[3] * f[8];
  c[2] = f[3] * f[7] - f[4] * f[6];
  c[3] = f[2] * f[7] - f[1] * f[8];
  c[4] = f[0] * f[8] - f[2] * f[6];
  c[5] = f[1] * f[6] - f[0] * f[7];
  c[6] = f[1] * f[5] - f[2] * f[4];
  c[7] = f[2] * f[3] - f[0] * f[5];
  c[8] = f[0] * f[4] - f[1] * f[3];
  return f[0] * c[0] + f[1] * c[1] + f[2] * c[2];
}

// Scaled Newton iteration R <- (g R + R^-T / g) / 2, g^2 = |R^-1| / |R| (Higham 1986, "Computing
// the polar decomposition", eq. 3.10). Returns 0 where F is too close to singular or inverted.
static int polar_newton(const double f[9], double r[9]) {
  double c[9];
  const double size = frobenius(f);
  if (!(size > 0) || !isfinite(size)) return 0;
  for (int i = 0; i < 9; i++) r[i] = f[i] / size;
  for (int iteration = 0; iteration < NEWTON_ITERATIONS; iteration++) {
    const double det = cofactors(r, c);
    if (!(det > (iteration == 0 ? newton_determinant : 0))) return 0;
    const double g = sqrt(frobenius(c) / (det * frobenius(r))), h = 1 / (g * det);
    double change = 0;
    for (int i = 0; i < 9; i++) {
      const double next = 0.5 * (g * r[i] + h * c[i]);
      change += (next - r[i]) * (next - r[i]);
      r[i] = next;
    }
    // Quadratic convergence: the step after one of 1e-8 is below round-off, and it was taken when
    // the change was measured.
    if (change < 1e-17) return 1;
  }
  return 0;
}

// Davenport's matrix of F: q^T N q = tr(R(q)^T F) for a unit quaternion q = (w, x, y, z).
// (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions", sec. 4.)
static void davenport(const double f[9], double n[4][4]) {
  n[0][0] = f[0] + f[4] + f[8];
  n[1][1] = f[0] - f[4] - f[8];
  n[2][2] = f[4] - f[0] - f[8];
  n[3][3] = f[8] - f[0] - f[4];
  n[0][1] = n[1][0] = f[7] - f[5];
  n[0][2] = n[2][0] = f[2] - f[6];
  n[0][3] = n[3][0] = f[3] - f[1];
  n[1][2] = n[2][1] = f[1] + f[3];
  n[1][3] = n[3][1] = f[2] + f[6];
  n[2][3] = n[3][2] = f[5] + f[7];
}

// One Jacobi rotation that zeroes a[p][q]; v collects the eigenvectors in its columns.
static void jacobi_rotate(double a[4][4], double v[4][4], int p, int q) {
  if (a[p][q] == 0) return;
  const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
  const double t = (theta >= 0 ? 1 : -1) / (fabs(theta) + sqrt(theta * theta + 1));
  const double c = 1 / sqrt(t * t + 1), s = t * c;
  for (int k = 0; k < 4; k++) {
    const double x = a[k][p], y = a[k][q];
    a[k][p] = c * x - s * y;
    a[k][q] = s * x + c * y;
  }
  for (int k = 0; k < 4; k++) {
    const double x = a[p][k], y = a[q][k];
    a[p][k] = c * x - s * y;
    a[q][k] = s * x + c * y;
  }
  for (int k = 0; k < 4; k++) {
    const double x = v[k][p], y = v[k][q];
    v[k][p] = c * x - s * y;
    v[k][q] = s * x + c * y;
  }
}

// Unit quaternion that maximises q^T N q; returns how far its eigenvalue is above the next.
static double top_eigenvector(double a[4][4], double q[4]) {
  double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  for (int sweep = 0; sweep < JACOBI_SWEEPS; sweep++) {
    double off = 0, size = 0;
    for (int i = 0; i < 4; i++)
      for (int j = 0; j < 4; j++) *(i == j ? &size : &off) += a[i][j] * a[i][j];
    if (off <= 1e-34 * size) break;
    for (int p = 0; p < 3; p++)
      for (int r = p + 1; r < 4; r++) jacobi_rotate(a, v, p, r);
  }
  int best = 0;
  for (int i = 1; i < 4; i++)
    if (a[i][i] > a[best][best]) best = i;
  double gap = HUGE_VAL;
  for (int i = 0; i < 4; i++)
    if (i != best) gap = fmin(gap, a[best][best] - a[i][i]);
  for (int i = 0; i < 4; i++) q[i] = v[i][best];
  return gap;
}

static void rotation_from_quaternion(const double q[4], double r[9]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double s = 2 / (w * w + x * x + y * y + z * z);
  r[0] = 1 - s * (y * y + z * z);
  r[1] = s * (x * y - w * z);
  r[2] = s * (x * z + w * y);
  r[3] = s * (x * y + w * z);
  r[4] = 1 - s * (x * x + z * z);
  r[5] = s * (y * z - w * x);
  r[6] = s * (x * z - w * y);
  r[7] = s * (y * z + w * x);
  r[8] = 1 - s * (x * x + y * y);
}

// The rotation that maximises tr(R^T F); returns the gap to the next stationary value, which is
// 2 (s2 + s3), s3 negative for an inverted F.
static double rotation_by_quaternion(const double f[9], double r[9]) {
  double n[4][4], q[4], scaled[9];
  double size = 0;
  for (int i = 0; i < 9; i++) size = fmax(size, fabs(f[i]));
  for (int i = 0; i < 9; i++) scaled[i] = size > 0 ? f[i] / size : 0;
  davenport(scaled, n);
  const double gap = top_eigenvector(n, q);
  rotation_from_quaternion(q, r);
  return gap * size;
}

void ep_rotation_of(const double f[9], double r[9]) {
  double result[9]; // r may be f
  if (!polar_newton(f, result)) rotation_by_quaternion(f, result);
  memcpy(r, result, sizeof result);
}

static ep_status centroids(int count, const double *x, const double *y, const double *weight,
                           double *cx, double *cy, ep_error *err) {
  double total = 0;
  for (int k = 0; k < 3; k++) cx[k] = cy[k] = 0;
  for (int i = 0; i < count; i++) {
    const double w = weight ? weight[i] : 1;
    if (!(w >= 0) || !isfinite(w))
      return ep_fail(err, EP_ERR_ARGUMENT, "weight %d of a point is %g; weights must be >= 0", i,
                     w);
    total += w;
    for (int k = 0; k < 3; k++) {
      cx[k] += w * x[3 * i + k];
      cy[k] += w * y[3 * i + k];
    }
  }
  for (int k = 0; k < 3 && total > 0; k++) {
    cx[k] /= total;
    cy[k] /= total;
  }
  return EP_OK;
}

ep_status ep_kabsch(int count, const double *x, const double *y, const double *weight, double *r,
                    double *cx, double *cy, ep_error *err) {
  static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  memcpy(r, identity, sizeof identity);
  EP_TRY(centroids(count, x, y, weight, cx, cy, err));
  double h[9] = {0}, xx = 0, yy = 0;
  for (int i = 0; i < count; i++) {
    const double w = weight ? weight[i] : 1;
    double a[3], b[3];
    for (int k = 0; k < 3; k++) {
      a[k] = x[3 * i + k] - cx[k];
      b[k] = y[3 * i + k] - cy[k];
      xx += w * a[k] * a[k];
      yy += w * b[k] * b[k];
    }
    for (int k = 0; k < 9; k++) h[k] += w * b[k / 3] * a[k % 3];
  }
  double best[9];
  const double gap = rotation_by_quaternion(h, best);
  // |H| <= sqrt(xx yy): measured against the clouds' size, so that uncorrelated ones are seen too.
  if (!(gap > kabsch_gap * sqrt(xx * yy)))
    return ep_fail(err, EP_ERR_NUMERIC,
                   "%d points do not determine a rotation; give at least three that are not on one "
                   "line",
                   count);
  memcpy(r, best, sizeof best);
  return EP_OK;
}
