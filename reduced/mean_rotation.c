#include "reduced/mean_rotation.h"

#include <math.h>

#include "reduced/rigid.h"
#include "reduced/state.h"

enum { ITERATIONS_MAX = 200 };

// Half a turn in one step is no motion a step could resolve.
static const double largest_turn = 3;
// Furthest a step of Newton goes in looking for the turn: from nothing along the way there, or at
// more than 2 rad about an axis that is not a principal one it would jump past half a turn.
static const double largest_change = 0.25;

// x of m x = b, a 3 x 3 system, by Cramer's rule. 0 where it is singular.
static int solve3(const double m[9], const double b[3], double x[3]) {
  double c[3][3]; // cross products of rows: columns of the adjugate
  for (int i = 0; i < 3; i++) ep_cross(m + 3 * ((i + 1) % 3), m + 3 * ((i + 2) % 3), c[i]);
  const double det = ep_dot(3, m, c[0]);
  if (!(fabs(det) > 0) || !isfinite(det)) return 0;
  for (int i = 0; i < 3; i++) x[i] = (c[0][i] * b[0] + c[1][i] * b[1] + c[2][i] * b[2]) / det;
  return 1;
}

// Mean of L before and after the turn psi: with w = t psi, t = tan(|psi|/2) / |psi|, it is
// (L - w x L + w (w . L)) / (1 + |w|^2). slope (9): its derivative by psi.
static void mean_momentum(const double l[3], const double psi[3], double mean[3], double slope[9]) {
  const double angle2 = ep_dot(3, psi, psi), angle = sqrt(angle2), sine = sin(0.5 * angle);
  const double tangent = sine / sqrt(1 - sine * sine);
  const double t = angle > 1e-4 ? tangent / angle : 0.5 + angle2 / 24;
  const double dt = angle > 1e-4 ? (0.5 * (1 + tangent * tangent) - t) / angle2 : 1.0 / 12;
  double w[3], cross[3];
  for (int i = 0; i < 3; i++) w[i] = t * psi[i];
  ep_cross(w, l, cross);
  const double along = ep_dot(3, w, l), share = 1 / (1 + ep_dot(3, w, w));
  for (int i = 0; i < 3; i++) mean[i] = share * (l[i] - cross[i] + along * w[i]);
  for (int c = 0; c < 3; c++) {
    double e[3], turned[3];
    for (int i = 0; i < 3; i++) e[i] = (i == c ? t : 0) + dt * psi[i] * psi[c]; // dw / dpsi_c
    ep_cross(e, l, turned);
    const double el = ep_dot(3, e, l), ew = 2 * ep_dot(3, e, w);
    for (int i = 0; i < 3; i++)
      slope[3 * i + c] = share * (el * w[i] + along * e[i] - turned[i] - ew * mean[i]);
  }
}

// By Newton: where moments of inertia differ much a fixed point would need tiny steps.
int ep_mean_rotation(const double j[9], const double l[3], const double h[3], double dt,
                     double psi[3]) {
  double last = INFINITY;
  for (int n = 0; n < ITERATIONS_MAX; n++) {
    double mean[3], slope[9], residual[3], change[3];
    if (!(ep_dot(3, psi, psi) < largest_turn * largest_turn)) return 0;
    mean_momentum(l, psi, mean, slope);
    ep_rotate(j, psi, residual);
    for (int i = 0; i < 3; i++) residual[i] = mean[i] - h[i] - residual[i] / dt;
    for (int i = 0; i < 9; i++) slope[i] = j[i] / dt - slope[i];
    if (!solve3(slope, residual, change)) return 0;
    const double size = sqrt(ep_dot(3, change, change));
    const double share = size > largest_change ? largest_change / size : 1;
    for (int i = 0; i < 3; i++) psi[i] += share * change[i];
    const double angle = sqrt(ep_dot(3, psi, psi));
    // nothing left, or round-off goes round in circles
    if (size <= 4e-16 * angle || (size <= 1e-13 * angle && size >= last)) return 1;
    last = size;
  }
  return 0;
}
