// St. Venant-Kirchhoff energy of a reduced model, exact, as one quartic form (docs/method.md
// "Elastic energy"; Barbic and James 2005, with full symmetry).
//
// With z = (1, q), N = r + 1 entries, the energy is
//   W = sum over a >= b >= c >= d of w_abcd z_a z_b z_c z_d,
// multiplicities folded into w: the quartic, cubic and quadratic coefficients stand in one list,
// the linear and constant ones are zero. With K the second derivatives by z (N x N), Euler's
// relation for homogeneous degree 4 gives dW/dz = K z / 3 and W = z^T K z / 12: exact for all
// degrees of q at once, and every degree enters with one sign, so nothing cancels near rest.
//
// Multiply-adds of force + stiffness: 3 per coefficient and half of N^3, in lanes.
#ifndef EP_REDUCED_CUBIC_H
#define EP_REDUCED_CUBIC_H

#include <stddef.h>

#include "base/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ep_precision { EP_DOUBLE, EP_FLOAT } ep_precision;

enum { EP_CUBIC_MAX_MODES = 255 };

// ---- coefficients ----------------------------------------------------------------------------
// Numbers of coefficients: r (r+1)(r+2)(r+3) / 24 quartic ones (292,825 at r = 50); all of the
// list, (r+1)(r+2)(r+3)(r+4) / 24 (316,251 at r = 50).
size_t ep_cubic_quartic_count(int r);
size_t ep_cubic_count(int r);
// Place of w_abcd in the list, a >= b >= c >= d, 0 standing for the constant entry of z.
size_t ep_cubic_index(int a, int b, int c, int d);

// The list in the order the kernels read it, with padding (6 % at r = 50): what a model
// holds. Reals of the given precision, 64-byte aligned in use.
size_t ep_cubic_stream_size(int r, ep_precision precision);
// packed (ep_cubic_count) to stream. Errors: EP_ERR_ARGUMENT (r outside [1, EP_CUBIC_MAX_MODES]),
// EP_ERR_NUMERIC where a coefficient is not finite or overflows a float.
ep_status ep_cubic_pack(int r, const double *packed, double *stream);
ep_status ep_cubic_pack_float(int r, const double *packed, float *stream);

// ---- evaluation ------------------------------------------------------------------------------
typedef struct ep_cubic_task ep_cubic_task;

typedef struct ep_cubic {
  int r;
  ep_precision precision;
  const void *stream; // ep_cubic_stream_size reals, borrowed
  const char *isa;    // level chosen for this processor: "baseline", "avx2", "avx512"
  void (*kernel)(const ep_cubic_task *task);
} ep_cubic;

// Errors: EP_ERR_ARGUMENT (r, precision, stream NULL or not 64-byte aligned).
ep_status ep_cubic_open(int r, ep_precision precision, const void *stream, ep_cubic *out);

// Bytes of scratch memory, 64-byte aligned, for one state; for batches (any number of states).
size_t ep_cubic_scratch(int r, ep_precision precision);
size_t ep_cubic_batch_scratch(int r, ep_precision precision);

// Energy at q (r); f (r) = dW/dq and k (r x r, symmetric, both triangles) unless NULL. All
// instruction-set levels give the same bits.
double ep_cubic_evaluate(const ep_cubic *cubic, const double *q, double *f, double *k,
                         void *scratch);

// The same for many states of one model: each coefficient is read once for 8 states (double) or 16
// (float). q, f (states x r), energy (states), k (states x r x r); energy, f, k may be NULL. Sums
// run in another order than for one state: equal to round-off, and independent of `states`.
void ep_cubic_batch(const ep_cubic *cubic, int states, const double *q, double *energy, double *f,
                    double *k, void *scratch);

#ifdef __cplusplus
}
#endif
#endif
