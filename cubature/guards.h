// Which elements must be kept from turning over besides the cubature elements (reduced/guard.h):
// constraint generation. The reduced model is pushed hard and let go, all elements of the mesh are
// looked at after every step, and the worst of every cluster that turned over becomes a guard; the
// same push is then done again, until nothing turns over or the guards are used up.
#ifndef EP_CUBATURE_GUARDS_H
#define EP_CUBATURE_GUARDS_H

#include "cubature/cubature.h"

typedef struct ep_guard_options {
  int most;      // guards at most
  int pushes;    // of every severity
  long effort;   // evaluations of the energy after which no push is tried; a quarter more to test
  uint64_t seed; // pushes are drawn from it
} ep_guard_options;
ep_guard_options ep_default_guard_options(void);

typedef struct ep_guards {
  int count;
  int *tet;              // (count) ascending
  double *weight;        // (count) volume around the element
  double *limit;         // (count) share of its volume below which it resists
  int spared;            // tets an example turns over itself: they are never guards
  bool full;             // more were wanted than `most`
  bool tired;            // the effort was used up before all pushes were tried
  int tried, left, most; // held-out pushes, those that left tets inverted once let go, the most
                         // inverted at any time of them
} ep_guards;

// cubature: what the elastic energy is summed over. Deterministic. Errors: EP_ERR_MEMORY,
// EP_ERR_NUMERIC where K0 is not positive definite.
ep_status ep_guards_choose(const ep_fem *fem, const ep_basis *basis, const ep_cubature *cubature,
                           const ep_guard_options *options, ep_log *log, ep_guards *out,
                           ep_error *err);
void ep_guards_free(ep_guards *guards);

#endif
