// The constitutive laws of material.c over 8 elements at once, the same formulas (see there).
// Private to the kernels.
#ifndef EP_REDUCED_LANE_MATERIAL_H
#define EP_REDUCED_LANE_MATERIAL_H

#include "reduced/guard.h"
#include "reduced/lanes.h"
#include "reduced/material.h"

// Index of (i, j) in a symmetric 3 x 3 kept as xx, yy, zz, yz, xz, xy.
static const int sym_index[9] = {0, 5, 4, 5, 1, 3, 4, 3, 2};

LANE_INLINE void lane_green_strain(const lane f[9], lane e[6]) {
  const lane one = lane_all(1), half = lane_all(0.5);
  lane a[9];
  for (int i = 0; i < 9; i++) a[i] = i % 4 == 0 ? f[i] - one : f[i];
  for (int i = 0; i < 3; i++)
    for (int j = i; j < 3; j++)
      e[sym_index[3 * i + j]] = half * (a[3 * i + j] + a[3 * j + i] +
                                        (a[i] * a[j] + a[3 + i] * a[3 + j] + a[6 + i] * a[6 + j]));
}

LANE_INLINE lane lane_determinant(const lane f[9]) {
  return f[0] * (f[4] * f[8] - f[5] * f[7]) + f[1] * (f[5] * f[6] - f[3] * f[8]) +
         f[2] * (f[3] * f[7] - f[4] * f[6]);
}

LANE_INLINE void lane_cofactor(const lane f[9], lane c[9]) {
  for (int i = 0; i < 3; i++) {
    const int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; j++) {
      const int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      c[3 * i + j] = f[3 * i1 + j1] * f[3 * i2 + j2] - f[3 * i1 + j2] * f[3 * i2 + j1];
    }
  }
}

// h += scale d2J/dF2.
LANE_INLINE void lane_add_cofactor_derivative(lane scale, const lane f[9], lane h[81]) {
  for (int b = 0; b < 9; b++) { // each entry of F stands in four places of the block matrix
    const int i1 = (b / 3 + 1) % 3, i2 = (b / 3 + 2) % 3, j1 = (b % 3 + 1) % 3,
              j2 = (b % 3 + 2) % 3;
    const lane v = scale * f[b];
    h[9 * (3 * i1 + j1) + 3 * i2 + j2] += v;
    h[9 * (3 * i2 + j2) + 3 * i1 + j1] += v;
    h[9 * (3 * i1 + j2) + 3 * i2 + j1] -= v;
    h[9 * (3 * i2 + j1) + 3 * i1 + j2] -= v;
  }
}

LANE_INLINE void lane_add_outer(lane scale, const lane v[9], lane h[81]) {
  for (int i = 0; i < 9; i++) {
    const lane x = scale * v[i];
    for (int j = 0; j < 9; j++) h[9 * i + j] += x * v[j];
  }
}

// ---- St. Venant-Kirchhoff: returns psi; p (9) and h (81) unless NULL ---------------------------

LANE_INLINE void lane_stvk_tangent(lane lambda, lane mu, const lane f[9], const lane s[6],
                                   lane h[81]) {
  for (int i = 0; i < 3; i++) {
    for (int k = 0; k < 3; k++) {
      const lane b =
          mu * (f[3 * i] * f[3 * k] + f[3 * i + 1] * f[3 * k + 1] + f[3 * i + 2] * f[3 * k + 2]);
      for (int j = 0; j < 3; j++) {
        const lane x = lambda * f[3 * i + j], y = mu * f[3 * k + j];
        for (int l = 0; l < 3; l++) {
          lane v = x * f[3 * k + l] + y * f[3 * i + l];
          if (j == l) v += b;
          if (i == k) v += s[sym_index[3 * j + l]];
          h[9 * (3 * i + j) + 3 * k + l] = v;
        }
      }
    }
  }
}

LANE_INLINE lane_mask lane_crushed(const lane f[9]) {
  return lane_determinant(f) < lane_all(0.5);
}

// psi, p and h with k/2 min(0, J - 0.5)^2 and its derivatives added.
LANE_INLINE lane lane_add_penalty(lane psi, lane lambda, lane mu, const lane f[9], lane *p,
                                  lane *h) {
  const lane half = lane_all(0.5);
  const lane_mask crushed = lane_crushed(f);
  if (!lane_any(crushed)) return psi; // one comparison while nothing collapses
  const lane stiff = lane_select(lambda > mu, lambda, mu) * lane_all(10), zero = lane_all(0);
  const lane gap = lane_select(crushed, lane_determinant(f) - half, zero);
  psi += half * stiff * gap * gap;
  if (!p) return psi;
  lane c[9];
  lane_cofactor(f, c);
  for (int i = 0; i < 9; i++) p[i] += stiff * gap * c[i];
  if (!h) return psi;
  lane_add_outer(lane_select(crushed, stiff, zero), c, h);
  lane_add_cofactor_derivative(stiff * gap, f, h);
  return psi;
}

LANE_INLINE lane lane_stvk(int volume, lane lambda, lane mu, const lane f[9], lane *p, lane *h) {
  lane e[6], s[6];
  lane_green_strain(f, e);
  const lane t = e[0] + e[1] + e[2], two = lane_all(2), half = lane_all(0.5);
  lane psi = half * lambda * t * t + mu * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] +
                                           two * (e[3] * e[3] + e[4] * e[4] + e[5] * e[5]));
  if (p) {
    for (int i = 0; i < 6; i++) s[i] = i < 3 ? two * mu * e[i] + lambda * t : two * mu * e[i];
    for (int i = 0; i < 3; i++)
      for (int j = 0; j < 3; j++)
        p[3 * i + j] = f[3 * i] * s[sym_index[j]] + f[3 * i + 1] * s[sym_index[3 + j]] +
                       f[3 * i + 2] * s[sym_index[6 + j]];
  }
  if (p && h) lane_stvk_tangent(lambda, mu, f, s, h);
  return volume ? lane_add_penalty(psi, lambda, mu, f, p, h) : psi;
}

// The volume penalty alone, beside a polynomial that holds the rest.
LANE_INLINE lane lane_penalty(lane lambda, lane mu, const lane f[9], lane *p, lane *h) {
  for (int i = 0; p && i < 9; i++) p[i] = lane_all(0);
  for (int i = 0; h && i < 81; i++) h[i] = lane_all(0);
  return lane_add_penalty(lane_all(0), lambda, mu, f, p, h);
}

// ---- the guards' wall (reduced/guard.h) ---------------------------------------------------------

LANE_INLINE lane lane_log1p(lane x) {
  lane y;
  for (int i = 0; i < 8; i++) y[i] = log1p(x[i]);
  return y;
}

// b(x) = -(x - 1)^2 log x below 1, with its derivatives; below the floor its parabola there.
LANE_INLINE lane lane_wall(lane x, lane *slope, lane *curvature) {
  const lane one = lane_all(1), two = lane_all(2), floor = lane_all(EP_GUARD_FLOOR);
  const lane y = lane_select(x < one, lane_select(x < floor, floor, x), one);
  const lane past = lane_select(x < floor, x - floor, lane_all(0));
  const lane gap = y - one, ratio = gap / y, l = lane_log1p(gap);
  *curvature = ratio * ratio - two * l - lane_all(4) * ratio;
  const lane first = -(two * gap * l + gap * ratio);
  *slope = first + *curvature * past;
  return (first + lane_all(0.5) * *curvature * past) * past - gap * gap * l;
}

// s (limit (x - 1))^2 / 2 = s (J - limit)^2 / 2 below 1.
LANE_INLINE lane lane_parabola(lane x, lane limit, lane *slope, lane *curvature) {
  const lane one = lane_all(1), zero = lane_all(0);
  const lane square = lane_all(EP_GUARD_SOFTNESS) * limit * limit;
  const lane gap = lane_select(x < one, x - one, zero);
  *curvature = lane_select(x < one, square, zero);
  *slope = square * gap;
  return lane_all(0.5) * square * gap * gap;
}

LANE_INLINE lane lane_guard(int soft, lane stiffness, lane limit, const lane f[9], lane *p,
                            lane *h) {
  const lane one = lane_all(1), safe = lane_select(limit > lane_all(0), limit, one);
  lane slope, curvature, c[9];
  const lane x = lane_determinant(f) / safe;
  const lane psi = stiffness * (soft ? lane_parabola(x, safe, &slope, &curvature)
                                     : lane_wall(x, &slope, &curvature));
  if (!p) return psi;
  lane_cofactor(f, c);
  slope *= stiffness / safe;
  for (int i = 0; i < 9; i++) p[i] = slope * c[i];
  if (!h) return psi;
  for (int i = 0; i < 81; i++) h[i] = lane_all(0);
  lane_add_outer(curvature * stiffness / (safe * safe), c, h);
  lane_add_cofactor_derivative(slope, f, h);
  return psi;
}

// ---- stable neo-Hookean ------------------------------------------------------------------------

LANE_INLINE lane lane_neohookean_energy(lane lambda, lane mu, lane jac, const lane e[6]) {
  const lane one = lane_all(1), t = e[0] + e[1] + e[2];
  const lane e2 = e[0] * e[1] + e[1] * e[2] + e[2] * e[0] - e[5] * e[5] - e[4] * e[4] - e[3] * e[3];
  const lane e3 = e[0] * (e[1] * e[2] - e[3] * e[3]) + e[5] * (e[3] * e[4] - e[5] * e[2]) +
                  e[4] * (e[5] * e[3] - e[1] * e[4]);
  const lane_mask strain = jac > lane_all(0.2);
  const lane safe = lane_select(strain, jac + one, one); // no division by zero in unused lanes
  const lane q = lane_all(4) * e2 + lane_all(8) * e3;
  const lane j = lane_select(strain, (t + t + q) / safe, jac - one);
  const lane rest = lane_select(strain, (t * (jac - one) - q) / safe, t - j);
  const lane x = lane_all(0.5) * t;
  return lane_all(0.5) * lambda * j * j + lane_all(0.75) * mu * rest +
         lane_all(0.5) * mu * (x - lane_log1p(x));
}

LANE_INLINE lane lane_neohookean(lane lambda_lame, lane mu_lame, const lane f[9], lane *p,
                                 lane *h) {
  const lane mu = lane_all(4.0 / 3) * mu_lame, one = lane_all(1);
  const lane lambda = lambda_lame + lane_all(5.0 / 6) * mu_lame;
  lane e[6], c[9];
  lane_green_strain(f, e);
  const lane jac = lane_determinant(f), t = e[0] + e[1] + e[2], i1 = lane_all(4) + t + t;
  const lane psi = lane_neohookean_energy(lambda, mu, jac, e);
  if (!p) return psi;
  lane_cofactor(f, c);
  const lane soft = (t + t) / (lane_all(4) * i1), j = jac - one;
  for (int i = 0; i < 9; i++)
    p[i] = mu * (lane_all(0.75) * (f[i] - c[i]) + soft * f[i]) + lambda * j * c[i];
  if (!h) return psi;
  const lane diagonal = mu * (one - one / i1);
  for (int i = 0; i < 81; i++) h[i] = i % 10 == 0 ? diagonal : lane_all(0);
  lane_add_outer(lane_all(2) * mu / (i1 * i1), f, h);
  lane_add_outer(lambda, c, h);
  lane_add_cofactor_derivative(lambda * j - lane_all(0.75) * mu, f, h);
  return psi;
}

// ---- corotational: through the scalar form, lane by lane (the rotation is an iteration)
// ----------

LANE_INLINE lane lane_corotational(lane lambda, lane mu, const lane f[9], lane *p, lane *h) {
  lane psi;
  double g[9], stress[9], tangent[81];
  for (int i = 0; i < 8; i++) {
    for (int c = 0; c < 9; c++) g[c] = f[c][i];
    psi[i] = ep_material_energy(EP_COROTATIONAL, lambda[i], mu[i], g);
    if (!p) continue;
    ep_material_stress(EP_COROTATIONAL, lambda[i], mu[i], g, stress);
    for (int c = 0; c < 9; c++) p[c][i] = stress[c];
    if (!h) continue;
    ep_material_tangent(EP_COROTATIONAL, lambda[i], mu[i], g, tangent);
    for (int c = 0; c < 81; c++) h[c][i] = tangent[c];
  }
  return psi;
}

LANE_INLINE lane lane_material(ep_material model, lane lambda, lane mu, const lane f[9], lane *p,
                               lane *h) {
  if (model == EP_GUARD_WALL) return lane_guard(0, lambda, mu, f, p, h);
  if (model == EP_GUARD_SOFT) return lane_guard(1, lambda, mu, f, p, h);
  if (model == EP_VOLUME_PENALTY) return lane_penalty(lambda, mu, f, p, h);
  if (model == EP_STABLE_NEOHOOKEAN) return lane_neohookean(lambda, mu, f, p, h);
  if (model == EP_COROTATIONAL) return lane_corotational(lambda, mu, f, p, h);
  return lane_stvk(model == EP_STVK_VOLUME, lambda, mu, f, p, h);
}

#endif
