#include "cubature/nnls.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/cubature.h"

ep_status ep_passive_create(int capacity, ep_passive *out, ep_error *err) {
  *out = (ep_passive){.capacity = capacity};
  EP_TRY(ep_cholesky_create(capacity, &out->factor, err));
  const size_t n = (size_t)(capacity > 0 ? capacity : 1);
  out->index = calloc(n, sizeof *out->index);
  out->x = calloc(3 * n, sizeof *out->x);
  if (!out->index || !out->x) {
    ep_passive_free(out);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a set of %d variables", capacity);
  }
  out->c = out->x + n;
  out->trial = out->c + n;
  return EP_OK;
}

void ep_passive_free(ep_passive *set) {
  ep_cholesky_free(&set->factor);
  free(set->index);
  free(set->x);
  *set = (ep_passive){0};
}

void ep_passive_copy(ep_passive *to, const ep_passive *from) {
  const size_t n = (size_t)from->count, width = (size_t)from->capacity;
  to->count = from->count;
  to->factor.n = from->factor.n;
  memcpy(to->index, from->index, n * sizeof(int));
  memcpy(to->x, from->x, n * sizeof(double));
  memcpy(to->c, from->c, n * sizeof(double));
  memcpy(to->factor.l, from->factor.l, n * width * sizeof(double));
}

bool ep_passive_add(ep_passive *set, int j, const double *column, double c) {
  if (set->count >= set->capacity) return false;
  for (int i = 0; i < set->count; i++) set->trial[i] = column[set->index[i]];
  if (!ep_cholesky_append(&set->factor, set->trial, column[j])) return false;
  set->index[set->count] = j;
  set->x[set->count] = 0;
  set->c[set->count++] = c;
  return true;
}

void ep_passive_remove(ep_passive *set, int position) {
  const size_t after = (size_t)(--set->count - position);
  memmove(set->index + position, set->index + position + 1, after * sizeof(int));
  memmove(set->x + position, set->x + position + 1, after * sizeof(double));
  memmove(set->c + position, set->c + position + 1, after * sizeof(double));
  ep_cholesky_remove(&set->factor, position);
}

// The largest step from x towards trial that keeps x >= 0; *first is the variable that stops it,
// -1 for a whole step.
static double feasible_step(const ep_passive *set, int *first) {
  double step = 1;
  *first = -1;
  for (int i = 0; i < set->count; i++) {
    if (set->trial[i] > 0) continue;
    const double reach = set->x[i] > 0 ? set->x[i] / (set->x[i] - set->trial[i]) : 0;
    if (*first < 0 || reach < step) {
      step = reach;
      *first = i;
    }
  }
  return step;
}

int ep_passive_solve(ep_passive *set) {
  for (int removed = 0;; removed++) {
    if (set->count == 0) return removed;
    ep_cholesky_solve(&set->factor, set->c, set->trial);
    int first;
    const double step = feasible_step(set, &first);
    for (int i = 0; i < set->count; i++)
      set->x[i] = first < 0 ? set->trial[i] : set->x[i] + step * (set->trial[i] - set->x[i]);
    if (first < 0) return removed;
    ep_passive_remove(set, first);
  }
}

double ep_passive_gain(const ep_passive *set) {
  double gain = 0;
  for (int i = 0; i < set->count; i++) gain += set->c[i] * set->x[i];
  return gain;
}

// w = c - G x, with each row divided by the norm of its column: cosine-like, comparable numbers.
static void descent(int n, const double *g, const double *c, const ep_passive *set, double *w) {
  memcpy(w, c, (size_t)n * sizeof *w);
  for (int i = 0; i < set->count; i++) {
    const double *column = g + (size_t)set->index[i] * (size_t)n;
    for (int j = 0; j < n; j++) w[j] -= column[j] * set->x[i];
  }
  for (int j = 0; j < n; j++) {
    const double diagonal = g[(size_t)j * (size_t)n + (size_t)j];
    w[j] = diagonal > 0 ? w[j] / sqrt(diagonal) : 0;
  }
}

// What w may be at the solution: round-off, and what a column so nearly dependent that it was
// refused could still give, sqrt(EP_DEPENDENT) |r|, in units of the fitted length |A x| or |A^T b|.
static const double enter_tolerance = 1e-12, kkt_tolerance = 4e-6;

static double length_scale(int n, const double *g, const double *c) {
  double scale = 0;
  for (int j = 0; j < n; j++) {
    const double diagonal = g[(size_t)j * (size_t)n + (size_t)j];
    if (diagonal > 0) scale = fmax(scale, fabs(c[j]) / sqrt(diagonal));
  }
  return scale;
}

// The variable outside the set (and not refused) that w says should enter, or -1.
static int entering(int n, const double *w, const unsigned char *closed, double tolerance) {
  int best = -1;
  for (int j = 0; j < n; j++)
    if (!closed[j] && w[j] > tolerance && (best < 0 || w[j] > w[best])) best = j;
  return best;
}

enum { CLOSED_PASSIVE = 1, CLOSED_REFUSED = 2 };

static void mark(int n, const ep_passive *set, bool forget, unsigned char *closed) {
  for (int j = 0; j < n; j++) closed[j] = forget ? 0 : closed[j] & CLOSED_REFUSED;
  for (int i = 0; i < set->count; i++) closed[set->index[i]] |= CLOSED_PASSIVE;
}

static ep_status check_kkt(int n, const double *w, const ep_passive *set, double scale,
                           ep_error *err) {
  for (int j = 0; j < n; j++)
    if (!(w[j] <= kkt_tolerance * scale))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "non-negative least squares: variable %d still wants to grow (%g of %g); the "
                     "columns are too nearly dependent",
                     j, w[j], scale);
  for (int i = 0; i < set->count; i++)
    if (!(fabs(w[set->index[i]]) <= kkt_tolerance * scale) || !(set->x[i] > 0))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "non-negative least squares: variable %d not stationary (%g of %g)",
                     set->index[i], w[set->index[i]], scale);
  return EP_OK;
}

static ep_status lawson_hanson(int n, const double *g, const double *c, ep_passive *set, double *w,
                               unsigned char *closed, ep_error *err) {
  const double scale = length_scale(n, g, c);
  const long limit = 30L * n + 100;
  for (long round = 0; round < limit; round++) {
    descent(n, g, c, set, w);
    const int j = entering(n, w, closed, enter_tolerance * scale);
    if (j < 0) return check_kkt(n, w, set, scale, err);
    const double before = ep_passive_gain(set);
    bool entered = ep_passive_add(set, j, g + (size_t)j * (size_t)n, c[j]);
    if (entered) ep_passive_solve(set);
    // A column that does not lower the objective (round-off) must wait, or it could enter forever.
    entered = entered && ep_passive_gain(set) > before;
    if (!entered) closed[j] |= CLOSED_REFUSED;
    mark(n, set, entered, closed);
  }
  return ep_fail(err, EP_ERR_NUMERIC,
                 "non-negative least squares: no end after %ld rounds (%d variables)", limit, n);
}

static ep_status check_input(int n, const double *g, const double *c, ep_error *err) {
  for (int j = 0; j < n; j++) {
    const double diagonal = g[(size_t)j * (size_t)n + (size_t)j];
    if (!isfinite(c[j]) || !isfinite(diagonal) || diagonal < 0)
      return ep_fail(err, EP_ERR_ARGUMENT,
                     "non-negative least squares: column %d has squared norm %g, product %g", j,
                     diagonal, c[j]);
  }
  return EP_OK;
}

ep_status ep_nnls_gram(int n, const double *g, const double *c, double *x, ep_error *err) {
  if (n < 0) return ep_fail(err, EP_ERR_ARGUMENT, "non-negative least squares: %d variables", n);
  EP_TRY(check_input(n, g, c, err));
  ep_passive set = {0};
  double *w = calloc((size_t)n + 1, sizeof *w);
  unsigned char *closed = calloc((size_t)n + 1, 1);
  ep_status status = EP_OK;
  if (!w || !closed)
    EP_TRY_GOTO(status, ep_fail(err, EP_ERR_MEMORY, "no memory for %d variables", n), done);
  EP_TRY_GOTO(status, ep_passive_create(n, &set, err), done);
  EP_TRY_GOTO(status, lawson_hanson(n, g, c, &set, w, closed, err), done);
  memset(x, 0, (size_t)n * sizeof *x);
  for (int i = 0; i < set.count; i++) x[set.index[i]] = set.x[i];
done:
  ep_passive_free(&set);
  free(w);
  free(closed);
  return status;
}
