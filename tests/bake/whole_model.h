// A model with every tet of its mesh as an element, so that nothing is left to quadrature, and a
// state of it. Also a complete basis: what then differs from the full space is round-off.
#ifndef EP_TESTS_BAKE_WHOLE_MODEL_H
#define EP_TESTS_BAKE_WHOLE_MODEL_H

#include "bar.h"

#include "reduced/bake/model_build.h"

typedef struct whole_model {
  ep_model_memory memory;
  void *block;
  ep_state *state;
} whole_model;

// parts: all but the elements, which are those of parts.fem.
static inline void make_whole_model(ep_model_parts parts, whole_model *out) {
  const int nt = parts.fem->mesh->nt;
  int *all = malloc((size_t)nt * sizeof *all);
  assert_non_null(all);
  for (int e = 0; e < nt; e++) all[e] = e;
  parts.s = nt, parts.tet = all, parts.weight = parts.fem->volume;
  ASSERT_OK(ep_model_build(&parts, &out->memory, err));
  free(all);
  const size_t bytes = (ep_state_bytes(&out->memory.model) + 63) / 64 * 64;
  out->block = aligned_alloc(64, bytes);
  assert_int_equal(ep_state_init(&out->memory.model, out->block, bytes, &out->state), EP_OK);
}

static inline void free_whole_model(whole_model *m) {
  ep_model_memory_free(&m->memory);
  free(m->block);
}

// x . A y
static inline double product_of(const ep_csr *a, const double *x, const double *y) {
  double *ay = vector_of((size_t)a->n), sum = 0;
  ep_csr_multiply(a, 1, y, ay);
  for (int i = 0; i < a->n; i++) sum += x[i] * ay[i];
  free(ay);
  return sum;
}

// All free unknowns of a bar as a basis: Gram-Schmidt (twice) of their unit vectors in the mass
// (3n x 3n), K0 by the stiffness. Free with ep_basis_free.
static inline void make_complete_basis(const bar *b, const ep_csr *mass, const ep_csr *k0,
                                       ep_basis *out) {
  const size_t n3 = b->n3;
  *out = (ep_basis){.n = b->mesh.nv, .u = vector_of(n3 * n3)};
  for (size_t i = 0; i < n3; i++) {
    double *row = out->u + (size_t)out->r * n3;
    if (b->fem.held[i]) continue;
    row[i] = 1;
    for (int a = 0; a < 2 * out->r; a++) {
      const double *other = out->u + (size_t)(a % out->r) * n3,
                   along = product_of(mass, row, other);
      for (size_t j = 0; j < n3; j++) row[j] -= along * other[j];
    }
    const double norm = sqrt(product_of(mass, row, row));
    for (size_t j = 0; j < n3; j++) row[j] /= norm;
    out->r++;
  }
  const size_t r = (size_t)out->r;
  out->stiffness = vector_of(r * r);
  for (size_t a = 0; a < r; a++)
    for (size_t d = 0; d <= a; d++)
      out->stiffness[a * r + d] = out->stiffness[d * r + a] =
          product_of(k0, out->u + a * n3, out->u + d * n3);
}

// Entry i (of 3n) of U q.
static inline double nodal_of(const ep_basis *basis, const double *q, size_t i) {
  double x = 0;
  for (int a = 0; a < basis->r; a++) x += basis->u[(size_t)a * 3 * (size_t)basis->n + i] * q[a];
  return x;
}

#endif
