// Example weights: the point of the simplex of rest and examples nearest to c (Zhao et al. 2018
// eq. 5), by Wolfe's exact active-set method for the nearest point of a polytope (Wolfe 1976,
// "Finding the nearest point in a polytope"): finite, and duplicate or dependent examples never
// enter together.
#include <math.h>
#include <string.h>

#include "reduced/state.h"

typedef struct polytope {
  int count;         // shapes: rest and the examples of one region
  const int *shape;  // (count) 0 or the number of the example, from 1
  double *gram;      // (count x count) p_i . p_j, p_i = e_i - c
  double scale;      // max |p_i|^2
  double *w;         // (count) weights, zero outside the corral
  int *corral, size; // active shapes
  double *factor;    // (size x size)
  double *v;         // (size) affine minimiser
  double *gradient;  // (count) Gram w
} polytope;

static const double *descriptor_of(const ep_model *m, int i) {
  return i == 0 ? m->c0 : m->example_c + (size_t)(i - 1) * 3 * (size_t)m->size.m;
}

// 0 where a descriptor is not finite.
static int fill_gram(const ep_model *m, int region, const double *c, polytope *p) {
  const int length = ep_region_length(m, region), first = 3 * ep_region_first(m, region);
  double trace = 0;
  p->scale = 0;
  for (int i = 0; i < p->count; i++) {
    const double *a = descriptor_of(m, p->shape[i]) + first;
    for (int j = 0; j <= i; j++) {
      const double *b = descriptor_of(m, p->shape[j]) + first;
      double sum = 0;
      for (int d = 0; d < length; d++) sum += (a[d] - c[first + d]) * (b[d] - c[first + d]);
      p->gram[i * p->count + j] = p->gram[j * p->count + i] = sum;
    }
    p->scale = fmax(p->scale, p->gram[i * p->count + i]);
    trace += p->gram[i * p->count + i]; // fmax would pass over a NaN
  }
  return isfinite(trace);
}

// Minimiser over the affine hull of the corral: (G + scale 1 1^T) u = 1, v = u / sum u (the added
// rank one leaves v as it is and makes the matrix definite). 0: numerically dependent.
static int affine_minimiser(polytope *p) {
  const int n = p->size;
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++)
      p->factor[n * i + j] = p->gram[p->corral[i] * p->count + p->corral[j]] + p->scale;
  if (!ep_cholesky(n, p->factor, p->factor)) return 0;
  for (int i = 0; i < n; i++) p->v[i] = 1;
  ep_solve_lower(n, p->factor, p->v);
  ep_solve_lower_transposed(n, p->factor, p->v);
  double sum = 0;
  for (int i = 0; i < n; i++) sum += p->v[i];
  for (int i = 0; i < n; i++) p->v[i] /= sum;
  return isfinite(sum) && sum > 0;
}

static void drop(polytope *p, int at) {
  p->w[p->corral[at]] = 0;
  p->size--;
  for (int i = at; i < p->size; i++) p->corral[i] = p->corral[i + 1];
}

// From w towards v until a weight vanishes; that shape leaves. 1: v itself was reached.
static int move(polytope *p) {
  double step = 1;
  int leaving = -1;
  for (int i = 0; i < p->size; i++) {
    double w = p->w[p->corral[i]];
    if (p->v[i] > 0) continue;
    double limit = w / (w - p->v[i]);
    if (leaving < 0 || limit < step) step = limit, leaving = i;
  }
  for (int i = 0; i < p->size; i++) {
    double *w = &p->w[p->corral[i]];
    *w = leaving < 0 ? p->v[i] : fmax(0, *w + step * (p->v[i] - *w));
  }
  if (leaving >= 0) drop(p, leaving);
  return leaving < 0;
}

// The shape furthest on the near side of the plane through the current point; -1: none, optimal.
static int entering(polytope *p) {
  double square = 0;
  int best = 0;
  for (int i = 0; i < p->count; i++) {
    p->gradient[i] = ep_dot(p->count, p->gram + i * p->count, p->w);
    square += p->w[i] * p->gradient[i];
    if (p->gradient[i] < p->gradient[best]) best = i;
  }
  if (!(p->gradient[best] < square - 1e-14 * p->scale)) return -1;
  for (int i = 0; i < p->size; i++)
    if (p->corral[i] == best) return -1; // round-off: it is in already
  return best;
}

static ep_status nearest_point(polytope *p) {
  int start = 0;
  memset(p->w, 0, (size_t)p->count * sizeof *p->w);
  for (int i = 1; i < p->count; i++)
    if (p->gram[i * (p->count + 1)] < p->gram[start * (p->count + 1)]) start = i;
  p->corral[0] = start, p->size = 1, p->w[start] = 1;
  for (int round = 0; round < 100 * p->count; round++) {
    int next = entering(p);
    if (next < 0) return EP_OK;
    p->corral[p->size++] = next;
    do {
      if (!affine_minimiser(p)) { // dependent to round-off: it could not improve anything
        drop(p, p->size - 1);
        return EP_OK;
      }
    } while (!move(p));
  }
  return EP_ERR_NUMERIC;
}

// Weights of one region, by the numbers of its shapes into w (regions + k).
static ep_status region_weights(ep_state *state, int region, const double *c, double *w) {
  const ep_model *m = state->model;
  const int most = m->size.k + 1, regions = ep_model_regions(m);
  int *shape = (int *)(void *)(state->small + 3 * most), count = 0;
  shape[count++] = 0;
  for (int i = 0; i < m->size.k; i++)
    if (ep_region_of(m, i) == region) shape[count++] = i + 1;
  polytope p = {.count = count,
                .shape = shape,
                .gram = state->gram,
                .w = state->small + 4 * most,
                .corral = (int *)(void *)(state->small + 2 * most),
                .factor = state->corral,
                .v = state->small,
                .gradient = state->small + most};
  if (!fill_gram(m, region, c, &p)) return EP_ERR_NUMERIC;
  const ep_status status = nearest_point(&p);
  w[region] = p.w[0];
  for (int i = 1; i < count; i++) w[regions + shape[i] - 1] = p.w[i];
  return status;
}

ep_status ep_example_weights(ep_state *state, const double *c, double *w) {
  const int regions = ep_model_regions(state->model);
  if (state->model->size.k == 0) {
    w[0] = 1;
    return EP_OK;
  }
  for (int g = 0; g < regions; g++) {
    const ep_status status = region_weights(state, g, c, w);
    if (status != EP_OK) return status;
  }
  return EP_OK;
}
