#include "cubature/select.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/parallel.h"

enum { SHORTLIST = 64 };

double ep_selection_residual(const ep_gram *gram, const ep_passive *set) {
  if (!(gram->squared > 0)) return 0;
  return fmax(0, 1 - ep_passive_gain(set) / gram->squared);
}

typedef struct correlation_work {
  const ep_gram *gram;
  const ep_passive *set;
  double *w; // (n)
} correlation_work;

static void correlation_range(void *context, int piece, int from, int to) {
  (void)piece;
  const correlation_work *k = context;
  memcpy(k->w + from, k->gram->c + from, (size_t)(to - from) * sizeof(double));
  for (int i = 0; i < k->set->count; i++) {
    const double *column = k->gram->column[k->set->index[i]], x = k->set->x[i];
    for (int e = from; e < to; e++) k->w[e] -= column[e] * x;
  }
}

// Work of a growth: one per call.
typedef struct grower {
  ep_gram *gram;
  const ep_growth *growth;
  ep_passive *set;
  double *w;             // (n) residual correlation
  unsigned char *closed; // (n) in the set, or refused since the set last changed
  int *pool;             // (n) permutation for random pools
  int count;             // of the shortlist
  int candidate[SHORTLIST];
  double score[SHORTLIST]; // squared residual the candidate takes away
} grower;

static void insert(grower *g, int limit, int e, double score) {
  if (g->count == limit && score <= g->score[limit - 1]) return;
  int at = g->count < limit ? g->count++ : limit - 1;
  for (; at > 0 && g->score[at - 1] < score; at--) {
    g->score[at] = g->score[at - 1];
    g->candidate[at] = g->candidate[at - 1];
  }
  g->score[at] = score;
  g->candidate[at] = e;
}

static bool open_candidate(const grower *g, int e) {
  return !g->closed[e] && g->gram->norm[e] > 0 && g->w[e] > 0;
}

// The best candidates by correlation, of all or of a random pool (partial Fisher-Yates).
static void make_shortlist(grower *g) {
  const int n = g->gram->n, wanted = g->growth->shortlist;
  const int limit = wanted > SHORTLIST ? SHORTLIST : wanted < 1 ? 1 : wanted;
  g->count = 0;
  if (g->growth->pool <= 0) {
    for (int e = 0; e < n; e++)
      if (open_candidate(g, e)) insert(g, limit, e, g->w[e]);
    return;
  }
  for (int i = 0, met = 0; i < n && met < g->growth->pool; i++) {
    const int j = i + ep_random_below(g->growth->random, n - i), e = g->pool[j];
    g->pool[j] = g->pool[i];
    g->pool[i] = e;
    if (!open_candidate(g, e)) continue;
    insert(g, limit, e, g->w[e]);
    met++;
  }
}

// Replace correlation w by the gain w^2 / |part of the column orthogonal to the set|^2, reorder.
static void rescore(grower *g) {
  const ep_cholesky *l = &g->set->factor;
  const int count = g->count;
  int candidate[SHORTLIST];
  memcpy(candidate, g->candidate, sizeof candidate);
  g->count = 0;
  for (int q = 0; q < count; q++) {
    double *v = g->set->trial, left = 1;
    for (int i = 0; i < l->n; i++) {
      const double *row = l->l + (size_t)i * (size_t)l->capacity;
      double sum = g->gram->column[g->set->index[i]][candidate[q]];
      for (int j = 0; j < i; j++) sum -= row[j] * v[j];
      v[i] = sum / row[i];
      left -= v[i] * v[i];
    }
    const double w = g->w[candidate[q]];
    insert(g, count, candidate[q], left > EP_DEPENDENT ? w * w / left : 0);
  }
}

// Add the first of the shortlist that lowers the residual. false where none does.
static bool add_best(grower *g, ep_error *err) {
  const double before = ep_passive_gain(g->set);
  for (int q = 0; q < g->count; q++) {
    const int e = g->candidate[q], ahead = g->count - q;
    // Fetch its column of G together with those of the next best, which are likely to follow.
    const int batch = ahead < EP_GRAM_BATCH ? ahead : EP_GRAM_BATCH;
    if (!g->gram->column[e] && ep_gram_need(g->gram, batch, g->candidate + q, err)) return false;
    if (ep_passive_add(g->set, e, g->gram->column[e], g->gram->c[e])) {
      ep_passive_solve(g->set);
      if (ep_passive_gain(g->set) > before) return true;
    }
    g->closed[e] = 2;
  }
  return false;
}

static void mark(grower *g, bool forget) {
  const int n = g->gram->n;
  for (int e = 0; e < n; e++) g->closed[e] = !forget && g->closed[e] == 2 ? 2 : 0;
  for (int i = 0; i < g->set->count; i++) g->closed[g->set->index[i]] = 1;
}

static ep_status grow(grower *g, int size, ep_error *err) {
  ep_error local = {0};
  for (long round = 0; g->set->count < size && round < 20L * size; round++) {
    if (ep_selection_residual(g->gram, g->set) <= g->growth->residual) break;
    ep_parallel_ranges(g->gram->n, correlation_range, &(correlation_work){g->gram, g->set, g->w});
    make_shortlist(g);
    if (g->growth->shortlist > 1) rescore(g);
    if (g->count == 0) break;
    const bool added = add_best(g, &local);
    if (local.status != EP_OK) return ep_fail(err, local.status, "%s", local.text);
    mark(g, added);
  }
  return EP_OK;
}

ep_status ep_select_grow(ep_gram *gram, const ep_growth *growth, int size, ep_passive *set,
                         ep_error *err) {
  if (size > set->capacity)
    return ep_fail(err, EP_ERR_ARGUMENT, "cubature: %d elements wanted in a set of %d", size,
                   set->capacity);
  const size_t n = (size_t)gram->n + 1;
  grower g = {.gram = gram, .growth = growth, .set = set};
  g.w = calloc(n, sizeof *g.w);
  g.closed = calloc(n, 1);
  g.pool = calloc(n, sizeof *g.pool);
  ep_status status = EP_OK;
  if (!g.w || !g.closed || !g.pool)
    EP_TRY_GOTO(status, ep_fail(err, EP_ERR_MEMORY, "no memory for %d candidates", gram->n), done);
  for (int e = 0; e < gram->n; e++) g.pool[e] = e;
  EP_TRY_GOTO(status, ep_gram_need(gram, set->count, set->index, err), done);
  mark(&g, true);
  status = grow(&g, size, err);
done:
  free(g.w);
  free(g.closed);
  free(g.pool);
  return status;
}
