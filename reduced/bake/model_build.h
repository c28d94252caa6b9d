// From the results of a bake to the arrays of a model, in memory.
#ifndef EP_BAKE_MODEL_BUILD_H
#define EP_BAKE_MODEL_BUILD_H

#include "base/error.h"
#include "lbspace/lbspace.h"
#include "reduced/bake/basis.h"
#include "reduced/bake/contact_tree.h"
#include "reduced/bake/green_coefficients.h"
#include "reduced/bake/model_regions.h"
#include "reduced/eigenpose.h"

typedef struct ep_model_parts {
  const ep_fem *fem;
  const ep_basis *basis;
  // Local examples: sets of examples with their regions, and the set of each example (examples).
  // 0 and NULL: all examples act everywhere.
  int regions;
  const ep_region_part *region;
  const int *example_region;
  int m;                 // LB eigenfunctions of the descriptor; 0 without examples; with
                         // regions any number > 0, theirs are used
  const ep_lb *lb;       // lb->m >= m; NULL where m == 0
  const ep_csr *lb_mass; // (n) plain volume mass; NULL where m == 0
  int s;                 // cubature elements
  const int *tet;        // (s) element numbers
  const double *weight;  // (s) absolute volumes, >= 0
  const ep_green_coefficients *green; // of the Green-strain path, NULL: not used
  const double *cubic;                // (ep_cubic_count(r)) exact StVK coefficients, NULL: not used
  ep_precision precision;             // of the model's evaluator: polynomials, else cubature
  int guards;                         // reduced/guard.h; 0: none
  const int *guard_tet;               // (guards) element numbers
  const double *guard_w;              // (guards) weights, >= 0 [volume]
  const double *guard_limit;          // (guards) shares of the volume, above 0, at most 1
  const ep_contact_tree *contact;     // surface of the basis' mesh and modes, NULL: no obstacles
} ep_model_parts;

// A model with memory of its own; nothing of the parts is kept.
typedef struct ep_model_memory {
  ep_model model;
  void *owned[EP_MODEL_ARRAY_COUNT]; // (count) one block per array that is there
  int count;
} ep_model_memory;

// Fills every array of reduced/model_arrays.h. Descriptors (docs/method.md "Descriptors"): T = L^T
// M3 U with the plain volume mass M, L = Phi kron I3, c0 = L^T M3 X, so that c(q) = c0 + T q. An
// object with fixed vertices gets the constant function 1/sqrt(V) as function 0 (size.m = m + 1):
// without it a mean displacement would not be seen. With regions: T = L^T M_R U of each, one after
// another (Zhao et al. 2018, sec. 5), with the constant function where the region is held
// (ep_region_carried). Example i: q_i of the basis, c0 + T q_i, and at each cubature element F_i^-1
// and w |det F_i| (reduced/reference.h: nothing where the example flattens it). Errors:
// EP_ERR_ARGUMENT (sizes, element numbers, weights), EP_ERR_NUMERIC (numbers that do not fit the
// precision), EP_ERR_MEMORY.
ep_status ep_model_build(const ep_model_parts *parts, ep_model_memory *out, ep_error *err);
void ep_model_memory_free(ep_model_memory *memory);

#endif
