// Choosing elements: greedy growth (An, Kim, James 2008, with all candidates and in Gram form),
// pruning by the optimal brain surgeon (Hassibi and Stork 1993), and exchange of both.
#ifndef EP_CUBATURE_SELECT_H
#define EP_CUBATURE_SELECT_H

#include "base/random.h"
#include "cubature/gram.h"
#include "cubature/nnls.h"

typedef struct ep_growth {
  int pool;          // candidates looked at in a round, drawn at random; 0: all
  int shortlist;     // of these, how many of the best by residual correlation are compared by what
                     // they would really gain (orthogonal least squares); 1: correlation decides
  double residual;   // stop at this squared residual over |b|^2
  ep_random *random; // for pool > 0
} ep_growth;

// Squared residual over |b|^2 at the set's solution, >= 0.
double ep_selection_residual(const ep_gram *gram, const ep_passive *set);

// Add elements one at a time, with all weights refitted under x >= 0 (elements whose weight falls
// to 0 leave again), until `size` are in, or the residual is reached, or nothing helps any more.
ep_status ep_select_grow(ep_gram *gram, const ep_growth *growth, int size, ep_passive *set,
                         ep_error *err);

// Remove the elements that are missed least until `size` are left, and refit.
ep_status ep_select_prune(ep_gram *gram, int size, ep_passive *set, ep_error *err);

// Swap elements while that lowers the residual: grow by a share of the size, prune back, keep the
// better of the two; a smaller share after a failure. `rounds` at most.
ep_status ep_select_exchange(ep_gram *gram, const ep_growth *growth, int rounds, ep_passive *set,
                             ep_error *err);

#endif
