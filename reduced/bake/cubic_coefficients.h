// Coefficients of the reduced StVK energy (reduced/cubic.h), exact, over all elements
// (docs/method.md "Elastic energy"; Barbic and James 2005 sec. 4.1, by one symmetric rank-k
// update).
#ifndef EP_BAKE_CUBIC_COEFFICIENTS_H
#define EP_BAKE_CUBIC_COEFFICIENTS_H

#include "base/log.h"
#include "reduced/bake/fem.h"
#include "reduced/cubic.h"

// Elements a chunk: the strain map of 6 x 256 rows is all that is ever held of it.
enum { EP_CUBIC_CHUNK = 256 };

typedef struct ep_cubic_report {
  size_t bytes;                          // largest memory in use beside the result
  double strain_seconds, update_seconds; // building the strain map; rank-k updates
  double update_flops;
} ep_cubic_report;

// u (r x 3 nv) modes as in ep_basis; packed (ep_cubic_count(r)) out, owned by the caller.
//
// Green strain with engineering shear is e = Y [q; qq] per element, the energy
// 1/2 sum_e V e^T D e = 1/2 [q; qq]^T (sum_e Y^T C C^T Y) [q; qq] with V D = C C^T (Cholesky): rows
// C^T Y of a chunk of elements, one dsyrk a chunk, then full symmetrisation. The columns are the
// pairs a >= b of (1, q) without (0, 0): p = r (r + 3) / 2 = 1325 at r = 50.
//   memory: 8 (6 * 256 p + p^2 + 9 r) bytes, 30 MB at r = 50, whatever the mesh
//   work: 6 p^2 multiply-adds and adds an element (3.8e12 for 364 K elements at r = 50)
// report may be NULL; log shows progress. Errors: EP_ERR_UNSUPPORTED where the material is not
// StVK (with or without the volume penalty, which is no part of the polynomial), EP_ERR_ARGUMENT
// (r), EP_ERR_MEMORY, EP_ERR_NUMERIC (not finite).
ep_status ep_cubic_coefficients(const ep_fem *fem, int r, const double *u, ep_log *log,
                                double *packed, ep_cubic_report *report, ep_error *err);

#endif
