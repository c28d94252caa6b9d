#include "reduced/bake/cubic_coefficients.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/dense.h"

typedef struct workspace {
  int r, p;
  double *y;    // (6 EP_CUBIC_CHUNK x p) rows C^T Y
  double *gram; // (p x p) lower triangle of sum Y^T V D Y
  double *g;    // (9 x r) dF/dq of one element
} workspace;

// Column of the pair (a, b) of (1, q), a >= b, a >= 1.
static size_t column(int a, int b) {
  return (size_t)a * (size_t)(a + 1) / 2 + (size_t)b - 1;
}

static void gather(const ep_fem *fem, int r, const double *u, int e, double *g) {
  const int *tet = fem->mesh->tet + 4 * (size_t)e;
  const double *shape = fem->gradient + 12 * (size_t)e;
  const size_t n3 = 3 * (size_t)fem->mesh->nv;
  memset(g, 0, 9 * (size_t)r * sizeof *g);
  for (int v = 0; v < 4; v++)
    for (int a = 0; a < r; a++) {
      const double *at = u + (size_t)a * n3 + 3 * (size_t)tet[v];
      for (int i = 0; i < 9; i++) g[i * r + a] += at[i / 3] * shape[3 * v + i % 3];
    }
}

// Rows of one element for the columns (a, 0 .. a): strains, then C^T over them. c: the Cholesky
// factor of the normal part (c11 c21 c22 c31 c32 c33) and of the shears.
static void strain_rows(int r, int p, const double *g, int a, const double c[7], double *y) {
  const size_t first = column(a, 0), width = (size_t)p;
  double *row[6];
  for (int i = 0; i < 6; i++) row[i] = y + (size_t)i * width + first;
  double ga[9];
  for (int i = 0; i < 9; i++) ga[i] = g[i * r + a - 1];
  // E_xx, E_yy, E_zz, 2 E_xy, 2 E_yz, 2 E_zx: linear parts
  const double linear[6] = {ga[0], ga[4], ga[8], ga[1] + ga[3], ga[5] + ga[7], ga[6] + ga[2]};
  row[0][0] = c[0] * linear[0] + c[1] * linear[1] + c[3] * linear[2];
  row[1][0] = c[2] * linear[1] + c[4] * linear[2];
  row[2][0] = c[5] * linear[2];
  for (int i = 3; i < 6; i++) row[i][0] = c[6] * linear[i];
  const double *restrict g0 = g, *restrict g1 = g + r, *restrict g2 = g + 2 * r;
  const double *restrict g3 = g + 3 * r, *restrict g4 = g + 4 * r, *restrict g5 = g + 5 * r;
  const double *restrict g6 = g + 6 * r, *restrict g7 = g + 7 * r, *restrict g8 = g + 8 * r;
  double *restrict y0 = row[0] + 1, *restrict y1 = row[1] + 1, *restrict y2 = row[2] + 1;
  double *restrict y3 = row[3] + 1, *restrict y4 = row[4] + 1, *restrict y5 = row[5] + 1;
  for (int b = 0; b < a; b++) { // A^T A, columns x and y of A
    const double xx = ga[0] * g0[b] + ga[3] * g3[b] + ga[6] * g6[b];
    const double yy = ga[1] * g1[b] + ga[4] * g4[b] + ga[7] * g7[b];
    const double zz = ga[2] * g2[b] + ga[5] * g5[b] + ga[8] * g8[b];
    const double xy = ga[0] * g1[b] + ga[3] * g4[b] + ga[6] * g7[b] + ga[1] * g0[b] +
                      ga[4] * g3[b] + ga[7] * g6[b];
    const double yz = ga[1] * g2[b] + ga[4] * g5[b] + ga[7] * g8[b] + ga[2] * g1[b] +
                      ga[5] * g4[b] + ga[8] * g7[b];
    const double zx = ga[2] * g0[b] + ga[5] * g3[b] + ga[8] * g6[b] + ga[0] * g2[b] +
                      ga[3] * g5[b] + ga[6] * g8[b];
    y0[b] = c[0] * xx + c[1] * yy + c[3] * zz;
    y1[b] = c[2] * yy + c[4] * zz;
    y2[b] = c[5] * zz;
    y3[b] = c[6] * xy;
    y4[b] = c[6] * yz;
    y5[b] = c[6] * zx;
  }
  for (int i = 0; i < 6; i++) row[i][a] *= 0.5; // b = a: each product once
}

// Lower Cholesky factor of V times D = lambda 1 1^T + 2 mu I (normal), mu (shear).
static void factor_material(double volume, double lambda, double mu, double c[7]) {
  const double diagonal = volume * (lambda + 2 * mu), off = volume * lambda;
  c[0] = sqrt(diagonal);
  c[1] = off / c[0];
  c[2] = sqrt(diagonal - c[1] * c[1]);
  c[3] = off / c[0];
  c[4] = (off - c[3] * c[1]) / c[2];
  c[5] = sqrt(diagonal - c[3] * c[3] - c[4] * c[4]);
  c[6] = sqrt(volume * mu);
}

static void sort_four(int x[4]) {
  for (int i = 1; i < 4; i++)
    for (int j = i; j > 0 && x[j] > x[j - 1]; j--) {
      const int swap = x[j];
      x[j] = x[j - 1], x[j - 1] = swap;
    }
}

// W = 1/2 y^T gram y over y_ab = z_a z_b into coefficients of sorted products.
static void symmetrise(const workspace *w, double *packed) {
  memset(packed, 0, ep_cubic_count(w->r) * sizeof *packed);
  for (int a = 1; a <= w->r; a++)
    for (int b = 0; b <= a; b++) {
      const size_t row = column(a, b);
      const double *gram = w->gram + row * (size_t)w->p;
      for (int c = 1; c <= a; c++)
        for (int d = 0; d <= c && column(c, d) <= row; d++) {
          int index[4] = {a, b, c, d};
          sort_four(index);
          const double value = gram[column(c, d)];
          packed[ep_cubic_index(index[0], index[1], index[2], index[3])] +=
              column(c, d) == row ? 0.5 * value : value;
        }
    }
}

static ep_status accumulate(const ep_fem *fem, const double *u, workspace *w, ep_log *log,
                            ep_cubic_report *report) {
  const int nt = fem->mesh->nt, r = w->r, p = w->p;
  ep_progress_begin(log, "cubic coefficients", nt);
  for (int first = 0; first < nt; first += EP_CUBIC_CHUNK) {
    const int count = nt - first < EP_CUBIC_CHUNK ? nt - first : EP_CUBIC_CHUNK;
    const double started = ep_seconds();
    for (int e = first; e < first + count; e++) {
      double c[7], *y = w->y + 6 * (size_t)(e - first) * (size_t)p;
      gather(fem, r, u, e, w->g);
      factor_material(fem->volume[e], fem->lambda[e], fem->mu[e], c);
      for (int a = 1; a <= r; a++) strain_rows(r, p, w->g, a, c, y);
    }
    const double built = ep_seconds();
    ep_syrk_tn(p, 6 * count, w->y, first > 0, w->gram);
    report->strain_seconds += built - started;
    report->update_seconds += ep_seconds() - built;
    ep_progress(log, first + count);
  }
  ep_progress_end(log);
  report->update_flops = 6.0 * nt * (double)p * (double)(p + 1);
  return EP_OK;
}

static ep_status check(const ep_fem *fem, int r, ep_error *err) {
  if (fem->model != EP_STVK && fem->model != EP_STVK_VOLUME)
    return ep_fail(err, EP_ERR_UNSUPPORTED,
                   "the energy of the material %s is no polynomial: cubic evaluation needs stvk or "
                   "stvk-volume; use cubature",
                   ep_material_name(fem->model));
  if (r < 1 || r > EP_CUBIC_MAX_MODES)
    return ep_fail(err, EP_ERR_ARGUMENT, "cubic evaluation of %d modes: 1 to %d are possible", r,
                   EP_CUBIC_MAX_MODES);
  return EP_OK;
}

static ep_status check_finite(int r, const double *packed, ep_error *err) {
  for (size_t i = 0; i < ep_cubic_count(r); i++)
    if (!isfinite(packed[i]))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "cubic coefficient %zu is not finite: check the units of the mesh", i);
  return EP_OK;
}

ep_status ep_cubic_coefficients(const ep_fem *fem, int r, const double *u, ep_log *log,
                                double *packed, ep_cubic_report *report, ep_error *err) {
  ep_cubic_report unused;
  if (!report) report = &unused;
  *report = (ep_cubic_report){0};
  EP_TRY(check(fem, r, err));
  workspace w = {.r = r, .p = r * (r + 3) / 2};
  const size_t p = (size_t)w.p;
  const size_t rows = 6 * (size_t)(fem->mesh->nt < EP_CUBIC_CHUNK ? fem->mesh->nt : EP_CUBIC_CHUNK);
  w.y = malloc(rows * p * sizeof *w.y);
  w.gram = malloc(p * p * sizeof *w.gram);
  w.g = malloc(9 * (size_t)r * sizeof *w.g);
  report->bytes = (rows * p + p * p + 9 * (size_t)r) * sizeof(double);
  ep_status status = EP_OK;
  if (!w.y || !w.gram || !w.g)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for cubic coefficients of %d modes (%zu MB)", r,
                     report->bytes >> 20);
  if (status == EP_OK) status = accumulate(fem, u, &w, log, report);
  if (status == EP_OK) {
    symmetrise(&w, packed);
    status = check_finite(r, packed, err);
  }
  free(w.y), free(w.gram), free(w.g);
  return status;
}
