// The coupling's k and mu, chosen by regions held out: couple with the others, measure the
// residual on those left out (cross-validation; Kovnatsky et al. 2013 leave both to the user).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

enum { FOLDS = 3, ITERATIONS = 200 };

int ep_couple_determined(int q, int m, const double *f_from) {
  // A singular value below this share of the largest is noise of the regions' borders: own choice.
  static const double NOISE = 0.02;
  const int p = q < m ? q : m;
  double *a = malloc(((size_t)q * m + (size_t)q * p + p + (size_t)p * m) * sizeof *a);
  if (!a) return -1;
  double *u = a + (size_t)q * m, *s = u + (size_t)q * p, *vt = s + p;
  int rank = 0;
  memcpy(a, f_from, (size_t)q * m * sizeof *a);
  if (ep_svd(q, m, a, u, s, vt, NULL) != EP_OK) rank = -1;
  for (int i = 0; i < p && rank >= 0; i++) rank += s[i] > NOISE * s[0];
  free(a);
  return rank;
}

typedef struct split_rows {
  double *f_from, *f_to, *a, *weight; // rows that stay; (k x m); (q)
} split_rows;

// Sum of squared residuals of the rows g with g % FOLDS == fold under a (k x m), f_to (q x stride).
static double held_out(int q, int m, int k, int stride, int fold, const double *f_from,
                       const double *f_to, const double *a) {
  double sum = 0;
  for (int g = fold; g < q; g += FOLDS)
    for (int j = 0; j < m; j++) {
      double v = -f_from[g * m + j];
      for (int i = 0; i < k; i++) v += f_to[(size_t)g * stride + i] * a[i * m + j];
      sum += v * v;
    }
  return sum;
}

static ep_status run_fold(const ep_coupling *def, int q, int stride, int fold,
                          const double *lambda_from, const double *lambda_to, const double *f_from,
                          const double *f_to, const split_rows *w, double *sum, ep_error *err) {
  const int m = def->m, k = def->k;
  int rows = 0;
  double objective;
  for (int g = 0; g < q; g++) {
    if (g % FOLDS == fold) continue;
    memcpy(w->f_from + (size_t)rows * m, f_from + (size_t)g * m, (size_t)m * sizeof(double));
    memcpy(w->f_to + (size_t)rows * k, f_to + (size_t)g * stride, (size_t)k * sizeof(double));
    rows++;
  }
  memset(w->a, 0, (size_t)k * m * sizeof(double));
  EP_TRY(ep_couple(def, rows, lambda_from, lambda_to, w->f_from, w->f_to, w->a, w->weight,
                   &objective, err));
  *sum += held_out(q, m, k, stride, fold, f_from, f_to, w->a);
  return EP_OK;
}

ep_status ep_couple_choose(ep_coupling *def, int most, int q, const double *lambda_from,
                           const double *lambda_to, const double *f_from, const double *f_to,
                           double *residual, ep_error *err) {
  static const double MU[] = {0.3, 1, 3};
  const int m = def->m;
  double size = 0, least = HUGE_VAL;
  *residual = 0;
  if (q < 2 * FOLDS) return EP_OK; // too few to leave any out: the defaults stay
  const size_t room = (size_t)q * (m + most) + (size_t)most * m + q;
  double *memory = malloc(room * sizeof *memory);
  if (!memory) return ep_fail(err, EP_ERR_MEMORY, "no memory to choose a coupling");
  split_rows w = {.f_from = memory, .f_to = memory + (size_t)q * m};
  w.a = w.f_to + (size_t)q * most;
  w.weight = w.a + (size_t)most * m;
  for (int i = 0; i < q * m; i++) size += f_from[i] * f_from[i];
  ep_status status = EP_OK;
  ep_coupling best = *def;
  for (int wide = 0; wide < (most > m ? 2 : 1); wide++)
    for (size_t c = 0; c < sizeof MU / sizeof *MU && status == EP_OK; c++) {
      ep_coupling trial = *def;
      double sum = 0;
      trial.k = wide ? most : m;
      trial.mu_data = MU[c];
      trial.iterations = ITERATIONS;
      for (int fold = 0; fold < FOLDS && status == EP_OK; fold++)
        status =
            run_fold(&trial, q, most, fold, lambda_from, lambda_to, f_from, f_to, &w, &sum, err);
      if (status != EP_OK || sum >= least) continue;
      least = sum;
      best.k = trial.k;
      best.mu_data = trial.mu_data;
    }
  free(memory);
  EP_TRY(status);
  *def = best;
  *residual = size > 0 ? sqrt(least / size) : 0;
  return EP_OK;
}
