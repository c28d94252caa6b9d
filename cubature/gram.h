// The training system |A x - b| in Gram form, with columns of G = A^T A computed when a candidate
// is looked at: choosing s of n elements needs about 2 s columns of G, not n. Counted in bytes a
// batch of GRAM_BATCH columns reads A once; the full G would cost n / 8 times as much.
#ifndef EP_CUBATURE_GRAM_H
#define EP_CUBATURE_GRAM_H

#include "base/error.h"

enum { EP_GRAM_BATCH = 8 };

typedef struct ep_gram {
  int n, rows;     // candidates (elements), equations
  double *a;       // (n x stride) row e is the column of element e; of unit length once prepared
  int stride;      // rows rounded up to full lanes, the rest is zero
  double *norm;    // (n) its length before, 0 for an element that cannot be chosen
  double *b;       // (stride) target
  double *c;       // (n) A^T b
  double squared;  // b^T b
  double **column; // (n) columns of G (n), NULL where not needed yet
  double *packed;  // (stride x EP_GRAM_BATCH) work
} ep_gram;

// Everything zero. Fill a and b, then prepare.
ep_status ep_gram_create(int n, int rows, ep_gram *out, ep_error *err);
void ep_gram_free(ep_gram *gram);

// Scale the columns to unit length and compute c.
// Errors: EP_ERR_NUMERIC for numbers that are not finite (message: element).
ep_status ep_gram_prepare(ep_gram *gram, ep_error *err);

// Make sure that the columns of G of these candidates are there.
ep_status ep_gram_need(ep_gram *gram, int count, const int *candidate, ep_error *err);

#endif
