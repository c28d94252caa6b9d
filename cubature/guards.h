// Which elements must be kept from turning over besides the cubature elements (reduced/guard.h):
// constraint generation. The reduced model is pushed harder and harder and let go, all elements of
// the mesh are looked at after every step, and the worst of every cluster that turned over becomes
// a guard; then the step is done again with it, until nothing turns over in it or this push has had
// its share of the guards and of the effort. Time: some 4 pushes x effort evaluations of the
// reduced energy at most (a step under way is finished), and fewer looks at the mesh than that;
// memory: some vectors of the mesh.
#ifndef EP_CUBATURE_GUARDS_H
#define EP_CUBATURE_GUARDS_H

#include "cubature/cubature.h"

typedef struct ep_guard_options {
  int most;      // guards at most
  int pushes;    // of every severity
  long effort;   // evaluations of the energy after which a push ends
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
  int cut;               // pushes that had their share of guards or effort and left more to do
  int tried, left, most; // held-out pushes, those that left tets inverted once let go, the most
                         // inverted at any time of them
  int failed;            // held-out pushes that ended in a step without convergence: not tested
} ep_guards;

// cubature: what the elastic energy is summed over. Deterministic. Errors: EP_ERR_MEMORY,
// EP_ERR_NUMERIC where K0 is not positive definite.
ep_status ep_guards_choose(const ep_fem *fem, const ep_basis *basis, const ep_cubature *cubature,
                           const ep_guard_options *options, ep_log *log, ep_guards *out,
                           ep_error *err);
void ep_guards_free(ep_guards *guards);

#endif
