// Cubature sums over lanes: energy, force and stiffness of several deformation energies at once.
// One source (kernel_body.h) is compiled per instruction-set level; all levels give the same bits:
// fixed summation order, no fused multiply-add, 8 lanes whatever the registers. Private.
#ifndef EP_REDUCED_KERNEL_H
#define EP_REDUCED_KERNEL_H

#include "reduced/isa.h"
#include "reduced/material.h"

enum { EP_LANES = 8 };

// A law of the kernels beside those of ep_material: the penalty of EP_STVK_VOLUME alone.
#define EP_VOLUME_PENALTY EP_MATERIALS
// And the wall of the guards (reduced/guard.h); lambda holds its stiffness, mu the limit.
#define EP_GUARD_WALL (EP_MATERIALS + 1)
#define EP_GUARD_SOFT (EP_MATERIALS + 2) // the parabola of an object that is turned over

// One energy: scale * sum_j weight_j psi(F_j(q) inverse_j).
typedef struct ep_kernel_term {
  double scale;
  const double *inverse; // (s x 9) row-major, or NULL: identity
  const double *weight;  // (s) volumes >= 0
  double energy;         // out
} ep_kernel_term;

typedef struct ep_kernel_task {
  int r, s, blocks; // blocks = ceil(r / 8)
  ep_material material;
  const double *g;           // (s x blocks x 72) as packed
  const double *lambda, *mu; // (s)
  int terms;
  ep_kernel_term *term;
  const double *q; // (8 blocks) padded with zeros, 64-byte aligned
  double *f;       // (8 blocks) out, or NULL
  double *k;       // (8 blocks x 8 blocks) out, symmetric, or NULL
  int project;     // element tangents projected to positive semidefinite
  double *scratch; // ep_kernel_scratch doubles, 64-byte aligned
  // In place of g: floats as packed by ep_pack_cubature_float (kernel_float_body.h); or NULL.
  const float *g_float;
} ep_kernel_task;

typedef void (*ep_kernel)(ep_kernel_task *task);

// Doubles of scratch memory for one evaluation, with G in doubles or floats.
int ep_kernel_scratch(int blocks, int floats);

void ep_kernel_baseline(ep_kernel_task *task); // x86-64 (SSE2) or whatever the target is
#if defined(__x86_64__)
void ep_kernel_avx2(ep_kernel_task *task);
void ep_kernel_avx512(ep_kernel_task *task);
#endif

// The kernel of an instruction set this processor runs.
ep_kernel ep_kernel_of(ep_isa isa);

#endif
