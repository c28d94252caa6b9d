// Coupled bases (Kovnatsky et al. 2013) with the object's basis fixed: minimise over A (k x m),
// A^T A = I,
//   |A^T Lt A - Lf|_F^2 / |Lf|_F^2  (or plain off-diagonal)  +  mu / q sum_g rho(|f_g - A^T t_g|^2)
// with rho(s) = s, or sigma^2 log(1 + s / sigma^2) (Cauchy), by Riemannian gradient descent with
// Barzilai-Borwein steps (Wen & Yin 2013; Iannazzo & Porcelli 2018) and polar retraction.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// The gradient's norm counts as zero relative to the objective at the start.
static const double GRADIENT_ZERO = 1e-9;
enum { MEMORY = 8, SCALE_ROUNDS = 3 };

ep_coupling ep_default_coupling(int m) {
  return (ep_coupling){
      .k = 2 * m, .m = m, .ordered = true, .mu_data = 1, .robust = true, .iterations = 2000};
}

size_t ep_couple_work(const ep_couple_problem *p) {
  return 2 * (size_t)p->k * p->m + 2 * (size_t)p->m * p->m + 3 * (size_t)p->q * p->m + (size_t)p->q;
}

// Value of the off-diagonal part; s (m x m): in A^T Lt A, out its derivative.
static double off_diagonal(const ep_couple_problem *p, double *s) {
  double value = 0, norm = 0;
  for (int i = 0; i < p->m; i++) norm += p->lambda_from[i] * p->lambda_from[i];
  for (int i = 0; i < p->m; i++) {
    const double wanted = p->ordered ? p->lambda_from[i] : s[i * p->m + i];
    s[i * p->m + i] -= wanted;
  }
  for (int i = 0; i < p->m * p->m; i++) {
    value += s[i] * s[i];
    s[i] *= 4 / norm;
  }
  return value / norm;
}

double ep_couple_objective(const ep_couple_problem *p, const double *a, double *gradient,
                           double *weight, double *work) {
  const int k = p->k, m = p->m, q = p->q;
  double *la = work, *s = la + 2 * (size_t)k * m, *r = s + 2 * (size_t)m * m;
  for (int i = 0; i < k; i++)
    for (int j = 0; j < m; j++) la[i * m + j] = p->lambda_to[i] * a[i * m + j];
  ep_gemm_tn(m, m, k, a, la, s);
  double value = off_diagonal(p, s);
  if (gradient) ep_gemm(k, m, m, la, s, gradient);
  if (!q) return value;
  ep_gemm(q, m, k, p->f_to, a, r);
  double data = 0;
  const double sigma2 = p->scale * p->scale;
  for (int g = 0; g < q; g++) {
    double r2 = 0;
    for (int j = 0; j < m; j++) {
      r[g * m + j] -= p->f_from[g * m + j];
      r2 += r[g * m + j] * r[g * m + j];
    }
    const double w = sigma2 > 0 ? 1 / (1 + r2 / sigma2) : 1;
    data += sigma2 > 0 ? sigma2 * log1p(r2 / sigma2) : r2;
    if (weight) weight[g] = w;
    for (int j = 0; j < m; j++) r[g * m + j] *= 2 * w * p->mu_data / q;
  }
  if (gradient) {
    ep_gemm_tn(k, m, q, p->f_to, r, la);
    for (int i = 0; i < k * m; i++) gradient[i] += la[i];
  }
  return value + p->mu_data / q * data;
}

// Tangent part in the embedded metric: G - A sym(A^T G). s: m x m.
static void to_tangent(int k, int m, const double *a, double *g, double *s, double *t) {
  ep_gemm_tn(m, m, k, a, g, s);
  for (int i = 0; i < m; i++)
    for (int j = i; j < m; j++) s[i * m + j] = s[j * m + i] = (s[i * m + j] + s[j * m + i]) / 2;
  ep_gemm(k, m, m, a, s, t);
  for (int i = 0; i < k * m; i++) g[i] -= t[i];
}

static double dot(int n, const double *a, const double *b) {
  double sum = 0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

typedef struct descent {
  double *g, *trial, *g_trial, *s, *t, *work;
} descent;

static ep_status descend(const ep_couple_problem *p, int iterations, double *a, const descent *d,
                         double *objective, ep_error *err) {
  const int k = p->k, m = p->m, size = k * m;
  double value = ep_couple_objective(p, a, d->g, NULL, d->work), recent[MEMORY];
  to_tangent(k, m, a, d->g, d->s, d->t);
  const double start = fmax(fabs(value), 1e-300);
  double g2 = dot(size, d->g, d->g), step = 1 / fmax(sqrt(g2), 1e-300) * 0.1;
  for (int i = 0; i < MEMORY; i++) recent[i] = value;
  for (int it = 0; it < iterations && sqrt(g2) > GRADIENT_ZERO * start; it++) {
    double reference = recent[0], next = 0;
    for (int i = 1; i < MEMORY; i++) reference = fmax(reference, recent[i]);
    bool found = false;
    for (int half = 0; half < 60 && !found; half++, step *= found ? 1 : 0.5) {
      for (int i = 0; i < size; i++) d->trial[i] = a[i] - step * d->g[i];
      EP_TRY(ep_polar(k, m, d->trial, d->trial, err));
      next = ep_couple_objective(p, d->trial, d->g_trial, NULL, d->work);
      found = next <= reference - 1e-4 * step * g2;
    }
    if (!found) break; // round-off: no lower point along the gradient
    to_tangent(k, m, d->trial, d->g_trial, d->s, d->t);
    double ss = 0, sy = 0, yy = 0;
    for (int i = 0; i < size; i++) {
      const double s = d->trial[i] - a[i], y = d->g_trial[i] - d->g[i];
      ss += s * s;
      sy += s * y;
      yy += y * y;
    }
    memcpy(a, d->trial, (size_t)size * sizeof *a);
    memcpy(d->g, d->g_trial, (size_t)size * sizeof *a);
    g2 = dot(size, d->g, d->g);
    recent[it % MEMORY] = value = next;
    sy = fabs(sy);
    if (sy > 0 && yy > 0) step = it % 2 ? ss / sy : sy / yy;
    step = fmin(fmax(step, 1e-10), 1e6);
  }
  *objective = value;
  return isfinite(value) ? EP_OK
                         : ep_fail(err, EP_ERR_NUMERIC, "the coupling's objective is not finite");
}

ep_status ep_couple_descend(const ep_couple_problem *p, int iterations, double *a,
                            double *objective, ep_error *err) {
  const size_t size = (size_t)p->k * p->m, square = (size_t)p->m * p->m;
  double *memory = malloc((4 * size + square + ep_couple_work(p)) * sizeof *memory);
  if (!memory) return ep_fail(err, EP_ERR_MEMORY, "no memory to couple %d functions", p->k);
  const descent d = {memory,
                     memory + size,
                     memory + 2 * size,
                     memory + 4 * size,
                     memory + 3 * size,
                     memory + 4 * size + square};
  const ep_status status = descend(p, iterations, a, &d, objective, err);
  free(memory);
  return status;
}

// Procrustes: polar factor of F_to^T F_from. Where the regions do not determine it (fewer than m
// functions), a little of the identity says which: function i with function i.
static ep_status procrustes(const ep_couple_problem *p, double *a, ep_error *err) {
  const int k = p->k, m = p->m;
  if (p->q)
    ep_gemm_tn(k, m, p->q, p->f_to, p->f_from, a);
  else
    memset(a, 0, (size_t)k * m * sizeof *a);
  const double size = sqrt(dot(k * m, a, a));
  for (int i = 0; i < m; i++) a[i * m + i] += 1e-3 * (size > 0 ? size : 1);
  return ep_polar(k, m, a, a, err);
}

static int compare_doubles(const void *x, const void *y) {
  const double a = *(const double *)x, b = *(const double *)y;
  return (a > b) - (a < b);
}

// Cauchy scale: 1.5 medians of the residuals, never below a tenth of a typical function: a perfect
// fit of most rows must not make the objective infinitely sharp.
static double residual_scale(const ep_couple_problem *p, const double *a, double *r,
                             double *sorted) {
  ep_gemm(p->q, p->m, p->k, p->f_to, a, r);
  double size = 0;
  for (int g = 0; g < p->q; g++) {
    double r2 = 0;
    for (int j = 0; j < p->m; j++) {
      const double f = p->f_from[g * p->m + j], d = r[g * p->m + j] - f;
      r2 += d * d;
      size += f * f / p->q;
    }
    sorted[g] = sqrt(r2);
  }
  qsort(sorted, (size_t)p->q, sizeof *sorted, compare_doubles);
  return fmax(1.5 * sorted[p->q / 2], 0.1 * sqrt(size));
}

static ep_status check(const ep_coupling *def, int q, const double *lambda_from, ep_error *err) {
  if (def->m < 1 || def->k < def->m || q < 0 || def->iterations < 1 || !(def->mu_data >= 0))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "coupling %d functions out of %d with %d regions: wanted 1 <= m <= k", def->m,
                   def->k, q);
  double norm = 0;
  for (int i = 0; i < def->m; i++) norm += lambda_from[i] * lambda_from[i];
  if (!(norm > 0) || !isfinite(norm))
    return ep_fail(err, EP_ERR_ARGUMENT, "coupling needs positive, finite eigenvalues");
  return EP_OK;
}

static ep_status solve(const ep_coupling *def, ep_couple_problem *p, double *a, double *weight,
                       double *objective, double *work, ep_error *err) {
  const size_t rm = (size_t)p->q * p->m;
  if (dot(p->k * p->m, a, a) == 0)
    EP_TRY(procrustes(p, a, err));
  else
    EP_TRY(ep_polar(p->k, p->m, a, a, err));
  const int rounds = def->robust && p->q ? SCALE_ROUNDS : 1;
  for (int round = 0; round < rounds; round++) {
    if (def->robust && p->q) p->scale = residual_scale(p, a, work, work + rm);
    EP_TRY(ep_couple_descend(p, def->iterations, a, objective, err));
  }
  *objective = ep_couple_objective(p, a, NULL, weight, work);
  return EP_OK;
}

ep_status ep_couple(const ep_coupling *def, int q, const double *lambda_from,
                    const double *lambda_to, const double *f_from, const double *f_to, double *a,
                    double *weight, double *objective, ep_error *err) {
  EP_TRY(check(def, q, lambda_from, err));
  ep_couple_problem p = {def->k, def->m,      q,         def->ordered, def->mu_data,
                         0,      lambda_from, lambda_to, f_from,       f_to};
  double *work = malloc((ep_couple_work(&p) + 1) * sizeof *work);
  if (!work) return ep_fail(err, EP_ERR_MEMORY, "no memory to couple %d functions", def->k);
  const ep_status status = solve(def, &p, a, weight, objective, work, err);
  free(work);
  return status;
}
