// A small clamped bar as a model, made without the bake: 6 tets a cell, smooth random modes which
// vanish at x = 0, mass-orthonormalised; every array of a model is filled. For tests and
// benchmarks.
#ifndef EP_TESTS_REDUCED_BAR_H
#define EP_TESTS_REDUCED_BAR_H

#include <stddef.h>
#include <stdint.h>

#include "reduced/eigenpose.h"

typedef struct bar {
  ep_model model;
  double *g;       // (nt x 9 x r) dF/dq of all elements, unpacked
  double *volume;  // (nt)
  void *owned[64]; // for bar_free
  int owned_count;
  uint32_t seed;
} bar;

// s elements evenly spread over the mesh with equal weights, or all of them (s = 0) with their
// volumes. m: descriptor functions. k examples: random poses, strains up to 0.5. Never fails
// (aborts without memory).
bar *bar_create(int nx, int ny, int nz, int r, int s, int m, int k, ep_material material);
void bar_free(bar *b);

double bar_uniform(bar *b);                             // [-1, 1), repeatable
void bar_random_q(bar *b, double amplitude, double *q); // max_j |G_j q|_F = amplitude

// A state in memory of its own (free the block), for convenience.
ep_state *bar_state(const bar *b, void **block);

// The coefficients of the Green-strain path anew, after the examples or their number were changed.
void bar_make_green(bar *b);

// Guards (reduced/guard.h): `count` elements evenly spread over the mesh, of different weights,
// stiffness and limits (`limit` and up to a tenth less).
void bar_add_guards(bar *b, int count, double limit);

// Elements of the whole mesh with J <= 0 at q.
int bar_inverted(const bar *b, const double *q);

// The plain sum over elements with the scalar laws: energy of the cubature with F_j B_j; f, k as in
// ep_elastic_energy. inverse (s x 9) or NULL, weight (s).
double bar_reference(const bar *b, const double *inverse, const double *weight, const double *q,
                     double *f, double *k, int project);

#endif
