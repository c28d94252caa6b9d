// The scalar forms: written for clarity, checked by finite differences, oracle of the lanes.
#include "reduced/material.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

#include "reduced/jacobi.h"

// ---- pieces ----------------------------------------------------------------------------------

// Green strain E = (A + A^T + A^T A)/2 with A = F - I: no cancellation near the identity.
static void green_strain(const double f[9], double e[9]) {
  double a[9];
  for (int i = 0; i < 9; i++) a[i] = f[i] - (i % 4 == 0);
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      double square = a[i] * a[j] + a[3 + i] * a[3 + j] + a[6 + i] * a[6 + j];
      e[3 * i + j] = 0.5 * (a[3 * i + j] + a[3 * j + i] + square);
    }
  }
}

static double determinant(const double f[9]) {
  return f[0] * (f[4] * f[8] - f[5] * f[7]) + f[1] * (f[5] * f[6] - f[3] * f[8]) +
         f[2] * (f[3] * f[7] - f[4] * f[6]);
}

// Cofactor matrix = dJ/dF.
static void cofactor(const double f[9], double c[9]) {
  for (int i = 0; i < 3; i++) {
    int i1 = (i + 1) % 3, i2 = (i + 2) % 3;
    for (int j = 0; j < 3; j++) {
      int j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      c[3 * i + j] = f[3 * i1 + j1] * f[3 * i2 + j2] - f[3 * i1 + j2] * f[3 * i2 + j1];
    }
  }
}

// h += scale d2J/dF2: entry (ij, kl) = eps_ika eps_jlb F_ab.
static void add_cofactor_derivative(double scale, const double f[9], double h[81]) {
  for (int i = 0; i < 3; i++) {
    for (int k = 0; k < 3; k++) {
      if (i == k) continue;
      int a = 3 - i - k;
      double si = (k == (i + 1) % 3) ? scale : -scale;
      for (int j = 0; j < 3; j++) {
        for (int l = 0; l < 3; l++) {
          if (j == l) continue;
          int b = 3 - j - l;
          double sj = (l == (j + 1) % 3) ? si : -si;
          h[9 * (3 * i + j) + 3 * k + l] += sj * f[3 * a + b];
        }
      }
    }
  }
}

static void add_outer(double scale, const double v[9], double h[81]) {
  for (int i = 0; i < 9; i++)
    for (int j = 0; j < 9; j++) h[9 * i + j] += scale * (v[i] * v[j]);
}

static double trace(const double a[9]) {
  return a[0] + a[4] + a[8];
}

static double dot9(const double a[9], const double b[9]) {
  double sum = 0;
  for (int i = 0; i < 9; i++) sum += a[i] * b[i];
  return sum;
}

// ---- St. Venant-Kirchhoff, with or without the volume penalty ----------------------------------

static double penalty_stiffness(double lambda, double mu) {
  return 10 * fmax(lambda, mu);
}

static double stvk_energy(double lambda, double mu, const double f[9], int volume) {
  double e[9];
  green_strain(f, e);
  double t = trace(e), psi = 0.5 * lambda * t * t + mu * dot9(e, e);
  double gap = determinant(f) - 0.5;
  if (volume && gap < 0) psi += 0.5 * penalty_stiffness(lambda, mu) * gap * gap;
  return psi;
}

// Second Piola-Kirchhoff stress S = lambda tr(E) I + 2 mu E.
static void stvk_second_stress(double lambda, double mu, const double f[9], double s[9]) {
  double e[9];
  green_strain(f, e);
  double t = lambda * trace(e);
  for (int i = 0; i < 9; i++) s[i] = 2 * mu * e[i] + (i % 4 == 0 ? t : 0);
}

static void stvk_stress(double lambda, double mu, const double f[9], int volume, double p[9]) {
  double s[9], c[9];
  stvk_second_stress(lambda, mu, f, s);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      p[3 * i + j] = f[3 * i] * s[j] + f[3 * i + 1] * s[3 + j] + f[3 * i + 2] * s[6 + j];
  double gap = determinant(f) - 0.5;
  if (!volume || gap >= 0) return;
  cofactor(f, c);
  for (int i = 0; i < 9; i++) p[i] += penalty_stiffness(lambda, mu) * gap * c[i];
}

// dP_ij/dF_kl = d_ik S_jl + lambda F_ij F_kl + mu (F_il F_kj + d_jl (F F^T)_ik).
static void stvk_tangent(double lambda, double mu, const double f[9], int volume, double h[81]) {
  double s[9], c[9];
  stvk_second_stress(lambda, mu, f, s);
  for (int i = 0; i < 3; i++) {
    for (int k = 0; k < 3; k++) {
      double b = f[3 * i] * f[3 * k] + f[3 * i + 1] * f[3 * k + 1] + f[3 * i + 2] * f[3 * k + 2];
      for (int j = 0; j < 3; j++) {
        for (int l = 0; l < 3; l++) {
          double v = lambda * f[3 * i + j] * f[3 * k + l] + mu * f[3 * i + l] * f[3 * k + j];
          if (j == l) v += mu * b;
          if (i == k) v += s[3 * j + l];
          h[9 * (3 * i + j) + 3 * k + l] = v;
        }
      }
    }
  }
  double gap = determinant(f) - 0.5, stiffness = penalty_stiffness(lambda, mu);
  if (!volume || gap >= 0) return;
  cofactor(f, c);
  add_outer(stiffness, c, h);
  add_cofactor_derivative(stiffness * gap, f, h);
}

// ---- stable neo-Hookean (Smith, de Goes, Kim 2018) ---------------------------------------------
// psi = mu/2 sg - 3mu/4 j + lam/2 j^2 - mu/2 log1p(sg/4), sg = tr(F^T F) - 3, j = J - 1,
// mu = 4/3 mu_L, lam = lambda_L + 5/6 mu_L so that small strains follow Hooke's law.

static double neohookean_energy(double lambda, double mu_lame, const double f[9]) {
  double mu = 4.0 / 3 * mu_lame, lam = lambda + 5.0 / 6 * mu_lame, e[9];
  green_strain(f, e);
  double t = trace(e), jac = determinant(f), sg = 2 * t, j, rest;
  if (jac > 0.2) { // both terms from invariants of E: nothing cancels at small strain
    double e2 = e[0] * e[4] + e[4] * e[8] + e[8] * e[0] - e[1] * e[1] - e[2] * e[2] - e[5] * e[5];
    double e3 = determinant(e);
    j = (sg + 4 * e2 + 8 * e3) / (jac + 1);
    rest = (t * (jac - 1) - 4 * e2 - 8 * e3) / (jac + 1);
  } else {
    j = jac - 1;
    rest = t - j;
  }
  double x = 0.25 * sg;
  return 0.5 * lam * j * j + 0.75 * mu * rest + 0.5 * mu * (x - log1p(x));
}

// P = mu (3/4 (F - cof F) + F sg/(4 (4 + sg))) + lam j cof F.
static void neohookean_stress(double lambda, double mu_lame, const double f[9], double p[9]) {
  double mu = 4.0 / 3 * mu_lame, lam = lambda + 5.0 / 6 * mu_lame, e[9], c[9];
  green_strain(f, e);
  cofactor(f, c);
  double sg = 2 * trace(e), j = determinant(f) - 1, softening = sg / (4 * (4 + sg));
  for (int i = 0; i < 9; i++)
    p[i] = mu * (0.75 * (f[i] - c[i]) + softening * f[i]) + lam * j * c[i];
}

static void neohookean_tangent(double lambda, double mu_lame, const double f[9], double h[81]) {
  double mu = 4.0 / 3 * mu_lame, lam = lambda + 5.0 / 6 * mu_lame, e[9], c[9];
  green_strain(f, e);
  cofactor(f, c);
  double i1 = 4 + 2 * trace(e), j = determinant(f) - 1; // i1 = tr(F^T F) + 1
  memset(h, 0, 81 * sizeof *h);
  for (int i = 0; i < 9; i++) h[10 * i] = mu * (1 - 1 / i1);
  add_outer(2 * mu / (i1 * i1), f, h);
  add_outer(lam, c, h);
  add_cofactor_derivative(lam * j - 0.75 * mu, f, h);
}

// ---- corotational ------------------------------------------------------------------------------

void ep_material_rotation(const double f[9], double r[9]) {
  // Horn's matrix: q^T N q = tr(R(q)^T F) for unit quaternions q = (w, x, y, z).
  double xy = f[3] + f[1], xz = f[6] + f[2], yz = f[7] + f[5];
  double n[16] = {f[0] + f[4] + f[8],  f[7] - f[5], f[2] - f[6], f[3] - f[1], f[7] - f[5],
                  f[0] - f[4] - f[8],  xy,          xz,          f[2] - f[6], xy,
                  -f[0] + f[4] - f[8], yz,          f[3] - f[1], xz,          yz,
                  -f[0] - f[4] + f[8]};
  double v[16], q[4];
  ep_jacobi(4, n, v);
  int best = 0;
  for (int i = 1; i < 4; i++)
    if (n[5 * i] > n[5 * best]) best = i;
  for (int i = 0; i < 4; i++) q[i] = v[4 * i + best];
  double scale = 2 / (q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  double w = q[0], x = q[1], y = q[2], z = q[3];
  r[0] = 1 - scale * (y * y + z * z), r[1] = scale * (x * y - w * z);
  r[2] = scale * (x * z + w * y), r[3] = scale * (x * y + w * z);
  r[4] = 1 - scale * (x * x + z * z), r[5] = scale * (y * z - w * x);
  r[6] = scale * (x * z - w * y), r[7] = scale * (y * z + w * x);
  r[8] = 1 - scale * (x * x + y * y);
}

static double corotational_energy(double lambda, double mu, const double f[9]) {
  double r[9], d[9];
  ep_material_rotation(f, r);
  for (int i = 0; i < 9; i++) d[i] = f[i] - r[i];
  double t = dot9(r, d); // tr(R^T F - I)
  return mu * dot9(d, d) + 0.5 * lambda * t * t;
}

static void corotational_stress(double lambda, double mu, const double f[9], double p[9]) {
  double r[9], d[9];
  ep_material_rotation(f, r);
  for (int i = 0; i < 9; i++) d[i] = f[i] - r[i];
  double t = lambda * dot9(r, d);
  for (int i = 0; i < 9; i++) p[i] = 2 * mu * d[i] + t * r[i];
}

// Columns T_a = R [e_a]x (9 x 3, as three rows of nine) and B = (tr(S) I - S)^-1, S = R^T F:
// dR = sum_ab T_a B_ab (T_b : dF).
static void rotation_derivative(const double f[9], const double r[9], double twist[27],
                                double b[9]) {
  double s[9], g[9], c[9];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      s[3 * i + j] = r[i] * f[j] + r[3 + i] * f[3 + j] + r[6 + i] * f[6 + j];
  for (int i = 0; i < 9; i++) g[i] = (i % 4 == 0 ? trace(s) : 0) - s[i];
  cofactor(g, c);
  double det = fmax(determinant(g), 1e-9); // the cap: (s1+s2)(s2+s3)(s3+s1), 8 at rest
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) b[3 * i + j] = 0.5 * (c[3 * i + j] + c[3 * j + i]) / det;
  for (int a = 0; a < 3; a++) {
    int a1 = (a + 1) % 3, a2 = (a + 2) % 3; // [e_a]x: +1 at (a2, a1), -1 at (a1, a2)
    for (int i = 0; i < 3; i++) {
      twist[9 * a + 3 * i + a] = 0;
      twist[9 * a + 3 * i + a1] = r[3 * i + a2];
      twist[9 * a + 3 * i + a2] = -r[3 * i + a1];
    }
  }
}

// dP/dF = 2 mu I + lambda R R^T + (lambda tr(S - I) - 2 mu) dR/dF.
static void corotational_tangent(double lambda, double mu, const double f[9], double h[81]) {
  double r[9], twist[27], b[9];
  ep_material_rotation(f, r);
  rotation_derivative(f, r, twist, b);
  double factor = lambda * (dot9(r, f) - 3) - 2 * mu;
  memset(h, 0, 81 * sizeof *h);
  for (int i = 0; i < 9; i++) h[10 * i] = 2 * mu;
  add_outer(lambda, r, h);
  for (int i = 0; i < 9; i++) {
    for (int j = 0; j < 9; j++) {
      double sum = 0;
      for (int k = 0; k < 9; k++) sum += twist[9 * (k / 3) + i] * b[k] * twist[9 * (k % 3) + j];
      h[9 * i + j] += factor * sum;
    }
  }
}

// ---- public ------------------------------------------------------------------------------------

double ep_material_energy(ep_material model, double lambda, double mu, const double f[9]) {
  switch (model) {
  case EP_STABLE_NEOHOOKEAN:
    return neohookean_energy(lambda, mu, f);
  case EP_COROTATIONAL:
    return corotational_energy(lambda, mu, f);
  default:
    return stvk_energy(lambda, mu, f, model == EP_STVK_VOLUME);
  }
}

void ep_material_stress(ep_material model, double lambda, double mu, const double f[9],
                        double p[9]) {
  switch (model) {
  case EP_STABLE_NEOHOOKEAN:
    neohookean_stress(lambda, mu, f, p);
    break;
  case EP_COROTATIONAL:
    corotational_stress(lambda, mu, f, p);
    break;
  default:
    stvk_stress(lambda, mu, f, model == EP_STVK_VOLUME, p);
  }
}

void ep_material_tangent(ep_material model, double lambda, double mu, const double f[9],
                         double h[81]) {
  switch (model) {
  case EP_STABLE_NEOHOOKEAN:
    neohookean_tangent(lambda, mu, f, h);
    break;
  case EP_COROTATIONAL:
    corotational_tangent(lambda, mu, f, h);
    break;
  default:
    stvk_tangent(lambda, mu, f, model == EP_STVK_VOLUME, h);
  }
}

void ep_material_project(double h[81]) {
  double a[81], v[81];
  memcpy(a, h, sizeof a);
  ep_jacobi(9, a, v);
  int negative = 0;
  for (int i = 0; i < 9; i++) negative += a[10 * i] < 0;
  if (!negative) return;
  memset(h, 0, sizeof a);
  for (int m = 0; m < 9; m++) {
    if (a[10 * m] <= 0) continue;
    for (int i = 0; i < 9; i++)
      for (int j = 0; j < 9; j++) h[9 * i + j] += a[10 * m] * (v[9 * i + m] * v[9 * j + m]);
  }
}

const char *ep_material_name(ep_material model) {
  static const char name[EP_MATERIALS][16] = {"stvk", "stvk-volume", "neohookean", "corotational"};
  return (int)model >= 0 && (int)model < EP_MATERIALS ? name[model] : NULL;
}
