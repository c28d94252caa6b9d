// A side seen through a few hundred of its vertices: frames are tried there, and large meshes are
// matched there first. Samples are farthest points (Gonzalez 1985), each with the volume nearest
// to it; mphi is made anew so that projections on the functions stay exact on the samples.
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

static double distance2(const double *a, const double *b) {
  const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  return x * x + y * y + z * z;
}

// sample (count) and owner (n): the sample nearest to each vertex. Starts farthest from the
// centroid.
static ep_status farthest_points(const ep_side *side, int count, int *sample, int *owner,
                                 ep_error *err) {
  double *away = malloc((size_t)side->n * sizeof *away);
  if (!away) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d samples", count);
  const double centre[3] = {0};
  for (int i = 0; i < side->n; i++) away[i] = distance2(side->x + 3 * (size_t)i, centre);
  for (int s = 0; s < count; s++) {
    int next = 0;
    for (int i = 1; i < side->n; i++)
      if (away[i] > away[next]) next = i;
    sample[s] = next;
    for (int i = 0; i < side->n; i++) {
      const double d2 = distance2(side->x + 3 * (size_t)i, side->x + 3 * (size_t)next);
      if (s > 0 && d2 >= away[i]) continue;
      away[i] = d2;
      owner[i] = s;
    }
  }
  free(away);
  return EP_OK;
}

static void take_rows(int count, const int *row, int width, const double *in, double *out) {
  for (int s = 0; s < count; s++)
    memcpy(out + (size_t)s * width, in + (size_t)row[s] * width, (size_t)width * sizeof *out);
}

static double *rows_of(int count, const int *row, int width, const double *in) {
  double *out = malloc((size_t)count * width * sizeof *out);
  if (out) take_rows(count, row, width, in, out);
  return out;
}

static double *square_of(int count, const double *in) {
  double *out = malloc((size_t)count * count * sizeof *out);
  if (out) memcpy(out, in, (size_t)count * count * sizeof *out);
  return out;
}

// mphi = W Phi G^-1 with the constant among the functions, G their Gram matrix on the samples:
// mphi^T phi = I and mphi^T 1 = 0.
static ep_status dual_functions(ep_side *c, ep_error *err) {
  const int n = c->n, k = c->k, w = k + 1;
  double *f = malloc((size_t)n * w * sizeof *f), *wf = malloc((size_t)n * w * sizeof *wf);
  double *gram = malloc((size_t)w * w * sizeof *gram), *inverse = calloc((size_t)w * w, sizeof *f);
  double *dual = malloc((size_t)n * w * sizeof *dual);
  ep_status status = f && wf && gram && inverse && dual
                         ? EP_OK
                         : ep_fail(err, EP_ERR_MEMORY, "no memory for %d samples", n);
  for (int i = 0; i < n && status == EP_OK; i++)
    for (int a = 0; a < w; a++) {
      f[(size_t)i * w + a] = a < k ? c->phi[(size_t)i * k + a] : 1;
      wf[(size_t)i * w + a] = c->share[i] * f[(size_t)i * w + a];
    }
  if (status == EP_OK) {
    ep_gemm_tn(w, w, n, f, wf, gram);
    for (int a = 0; a < w; a++) inverse[a * w + a] = 1;
    status = ep_solve_spd(w, gram, w, inverse, err);
  }
  if (status == EP_OK) {
    ep_gemm(n, w, w, wf, inverse, dual);
    for (int i = 0; i < n; i++)
      memcpy(c->mphi + (size_t)i * k, dual + (size_t)i * w, (size_t)k * sizeof *dual);
  }
  free(f);
  free(wf);
  free(gram);
  free(inverse);
  free(dual);
  return status;
}

static ep_status fill(const ep_side *side, const int *sample, const int *owner, ep_side *out,
                      ep_error *err) {
  const int n = out->n, k = side->k;
  out->x = rows_of(n, sample, 3, side->x);
  out->phi = rows_of(n, sample, k, side->phi);
  out->mphi = malloc((size_t)n * k * sizeof *out->mphi);
  out->share = calloc((size_t)n, sizeof *out->share);
  out->skin = rows_of(n, sample, 1, side->skin);
  bool good = out->x && out->phi && out->mphi && out->share && out->skin;
  if (side->regions) {
    out->indicator = rows_of(n, sample, side->regions, side->indicator);
    out->region = rows_of(n, sample, side->regions, side->region);
    good = good && out->indicator && out->region;
  }
  if (side->marks) {
    out->mark = rows_of(n, sample, side->marks, side->mark);
    out->mark_x = malloc(3 * (size_t)side->marks * sizeof(double));
    out->mark_near = malloc((size_t)side->marks * sizeof(int));
    good = good && out->mark && out->mark_x && out->mark_near;
    if (side->mark_gram) {
      out->mark_gram = square_of(side->marks, side->mark_gram);
      good = good && out->mark_gram;
    }
  }
  if (!good) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d samples", n);
  for (int i = 0; i < side->n; i++) out->share[owner[i]] += side->share[i];
  for (int m = 0; m < side->marks; m++) out->mark_near[m] = owner[side->mark_near[m]];
  if (side->marks) memcpy(out->mark_x, side->mark_x, 3 * (size_t)side->marks * sizeof(double));
  return dual_functions(out, err);
}

ep_status ep_side_coarsen(const ep_side *side, int count, ep_side *out, int *sample, int *owner,
                          ep_error *err) {
  *out = *side;
  out->x = out->phi = out->mphi = out->share = out->indicator = out->region = NULL;
  out->mark = out->mark_x = out->mark_gram = out->skin = NULL;
  out->mark_near = NULL;
  memset(&out->stiffness, 0, sizeof out->stiffness);
  out->n = count;
  ep_status status = farthest_points(side, count, sample, owner, err);
  if (status == EP_OK) status = fill(side, sample, owner, out, err);
  if (status != EP_OK) ep_side_free(out);
  return status;
}
