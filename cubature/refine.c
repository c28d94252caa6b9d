#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/select.h"

// H = G_PP^-1 (n x n) from the factor, by columns.
static void invert(const ep_cholesky *factor, double *h) {
  const size_t n = (size_t)factor->n;
  memset(h, 0, n * n * sizeof *h);
  for (size_t i = 0; i < n; i++) {
    h[i * n + i] = 1;
    ep_cholesky_solve(factor, h + i * n, h + i * n);
  }
}

// The element whose removal raises the squared residual least: by x^2 / H_ee (Hassibi and Stork).
// One whose weight has become negative on the way goes first.
static int least_missed(int n, const double *h, const double *x, const unsigned char *gone) {
  int best = -1;
  double lowest = 0;
  for (int i = 0; i < n; i++) {
    if (gone[i]) continue;
    const double diagonal = h[(size_t)i * (size_t)n + (size_t)i];
    const double cost = x[i] * fabs(x[i]) / diagonal;
    if (best < 0 || cost < lowest) {
      best = i;
      lowest = cost;
    }
  }
  return best;
}

// Take variable k out: weights move to the least squares solution without it, H likewise.
static void take_out(int n, int k, double *h, double *x, double *column) {
  const size_t width = (size_t)n;
  memcpy(column, h + (size_t)k * width, width * sizeof *column);
  const double pivot = column[k], share = x[k] / pivot;
  for (int i = 0; i < n; i++) {
    x[i] -= share * column[i];
    const double factor = column[i] / pivot;
    if (factor == 0) continue;
    double *row = h + (size_t)i * width;
    for (int j = 0; j < n; j++) row[j] -= factor * column[j];
  }
  h[(size_t)k * width + (size_t)k] = 1;
  x[k] = 0;
}

// Make the set anew from its elements that are not gone: a fresh factor without the round-off of
// many updates.
static void rebuild(const ep_gram *gram, const unsigned char *gone, ep_passive *set) {
  const int n = set->count;
  set->count = set->factor.n = 0;
  // In place: element i is read before position count <= i is written.
  for (int i = 0; i < n; i++) {
    const int e = set->index[i];
    if (!gone[i]) ep_passive_add(set, e, gram->column[e], gram->c[e]);
  }
  ep_passive_solve(set);
}

ep_status ep_select_prune(ep_gram *gram, int size, ep_passive *set, ep_error *err) {
  const int n = set->count;
  if (n <= size) return EP_OK;
  const size_t width = (size_t)n;
  double *h = malloc((width * width + 2 * width) * sizeof *h);
  unsigned char *gone = calloc(width, 1);
  if (!h || !gone) {
    free(h);
    free(gone);
    return ep_fail(err, EP_ERR_MEMORY, "no memory to prune %d elements", n);
  }
  double *x = h + width * width, *column = x + width;
  invert(&set->factor, h);
  memcpy(x, set->x, width * sizeof *x);
  for (int left = n; left > size; left--) {
    const int k = least_missed(n, h, x, gone);
    take_out(n, k, h, x, column);
    gone[k] = 1;
  }
  rebuild(gram, gone, set);
  free(h);
  free(gone);
  return EP_OK;
}

// Grow by `extra`, prune back, keep the result where it is better by more than round-off.
static ep_status swap(ep_gram *gram, const ep_growth *growth, int extra, ep_passive *set,
                      ep_passive *trial, bool *better, ep_error *err) {
  const int size = set->count;
  ep_passive_copy(trial, set);
  EP_TRY(ep_select_grow(gram, growth, size + extra, trial, err));
  EP_TRY(ep_select_prune(gram, size, trial, err));
  EP_TRY(ep_select_grow(gram, growth, size, trial, err));
  const double before = ep_selection_residual(gram, set);
  *better = ep_selection_residual(gram, trial) < before * (1 - 1e-4);
  if (*better) ep_passive_copy(set, trial);
  return EP_OK;
}

ep_status ep_select_exchange(ep_gram *gram, const ep_growth *growth, int rounds, ep_passive *set,
                             ep_error *err) {
  ep_passive trial;
  EP_TRY(ep_passive_create(set->capacity, &trial, err));
  ep_status status = EP_OK;
  int extra = set->count / 2;
  for (int round = 0; round < rounds && extra > 0 && set->count > 0; round++) {
    const int room = set->capacity - set->count;
    bool better = false;
    if (extra > room) extra = room;
    EP_TRY_GOTO(status, swap(gram, growth, extra, set, &trial, &better, err), done);
    if (!better) extra /= 2;
  }
done:
  ep_passive_free(&trial);
  return status;
}
