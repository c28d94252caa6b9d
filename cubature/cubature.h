// Cubature: few elements with weights that stand for all (An, Kim, James 2008; docs/method.md
// "Cubature training"): training poses, Gram system, greedy NNLS.
#ifndef EP_CUBATURE_CUBATURE_H
#define EP_CUBATURE_CUBATURE_H

#include <stdint.h>

#include "base/log.h"
#include "reduced/bake/basis.h"

typedef struct ep_cubature_options {
  int elements;     // s at most
  double tolerance; // stop at this training error (0: never)
  int poses;        // training poses; as many again / 2 held out
  double amplitude; // largest vertex displacement of random poses over the extent (0.2)
  uint64_t seed;
  int method;            // 0 greedy over all candidates, 1: 100 random candidates a round
  int curve_count;       // held-out error wanted at these sizes too
  const int *curve_size; // (curve_count) ascending
  // Local examples: share of each element in each region, and the region of each example. 0, NULL:
  // none. Half as many poses again are then trained and held out, of the material in the regions.
  int regions;
  const double *share;       // (regions x nt) in [0, 1]
  const int *example_region; // (examples)
} ep_cubature_options;
ep_cubature_options ep_default_cubature_options(void);

enum { EP_REGION_ELEMENTS, EP_REGION_TRAIN, EP_REGION_HELD_OUT, EP_REGION_NUMBERS };

typedef struct ep_cubature {
  int count;
  int *tet;                           // (count) ascending
  double *weight;                     // (count) absolute volumes, > 0
  double train_error, held_out_error; // relative force error, root mean square over poses
  double *curve;                      // (curve_count) held-out error at each size
  int regions;
  double *region; // (regions x EP_REGION_NUMBERS): elements with a share above 1/2, training error,
                  // held-out error of the forces of the region alone
} ep_cubature;

// Training poses: random in the subspace, along the example paths, relative to the examples.
// example_q (examples x r) from the basis. Errors: EP_ERR_ARGUMENT, EP_ERR_NUMERIC.
ep_status ep_cubature_train(const ep_fem *fem, const ep_basis *basis,
                            const ep_cubature_options *options, ep_log *log, ep_cubature *out,
                            ep_error *err);
void ep_cubature_free(ep_cubature *cubature);

// Non-negative least squares min |A x - b|, x >= 0 in Gram form: G = A^T A (n x n), c = A^T b.
// Lawson-Hanson with an updated Cholesky; KKT conditions checked at the end.
ep_status ep_nnls_gram(int n, const double *g, const double *c, double *x, ep_error *err);

#endif
