#include "reduced/bake/curvature.h"

#include <stdlib.h>
#include <string.h>

#include "reduced/bake/fem_assembly.h"

// (H(I + h e) - H(I - h e)) / 2h for the unit direction `entry` of F.
static void central_difference(ep_material model, double lambda, double mu, int entry, double h,
                               double out[81]) {
  double f[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, minus[81];
  f[entry] += h;
  ep_material_tangent(model, lambda, mu, f, out);
  f[entry] -= 2 * h;
  ep_material_tangent(model, lambda, mu, f, minus);
  for (int i = 0; i < 81; i++) out[i] = (out[i] - minus[i]) / (2 * h);
}

// c[81 * entry + 9 * ab + cd]; the tensor is symmetric in its three indices.
static void extrapolate(ep_material model, double lambda, double mu, double c[729]) {
  enum { LEVELS = 4 };
  for (int entry = 0; entry < 9; entry++) {
    double table[LEVELS][81], h = 1.0 / 32;
    for (int level = 0; level < LEVELS; level++, h /= 2)
      central_difference(model, lambda, mu, entry, h, table[level]);
    // the error series of a central difference has even powers only: factors 4, 16, 64
    for (int order = 1, factor = 4; order < LEVELS; order++, factor *= 4)
      for (int level = 0; level + order < LEVELS; level++)
        for (int i = 0; i < 81; i++)
          table[level][i] = (factor * table[level + 1][i] - table[level][i]) / (factor - 1);
    memcpy(c + 81 * entry, table[0], sizeof table[0]);
  }
}

void ep_rest_curvature(ep_material model, ep_curvature *out) {
  // (1, 1) and (1, 2): no law has to accept a vanishing constant
  double both[729], twice[729];
  extrapolate(model, 1, 1, both);
  extrapolate(model, 1, 2, twice);
  for (int i = 0; i < 729; i++) {
    out->by_mu[i] = twice[i] - both[i];
    out->by_lambda[i] = both[i] - out->by_mu[i];
  }
}

// m[ab][cd] = sum_ef C[ef][ab][cd] d[ef]
static void contract(const double c[729], const double d[9], double m[81]) {
  memset(m, 0, 81 * sizeof *m);
  for (int ef = 0; ef < 9; ef++)
    for (int i = 0; i < 81; i++) m[i] += d[ef] * c[81 * ef + i];
}

static void contract_pairs(const ep_fem *fem, int e, int count, const double c[729],
                           const double *gradient, double *f) {
  const int *tet = fem->mesh->tet + 4 * (size_t)e;
  const double *g = fem->gradient + 12 * (size_t)e;
  const size_t pairs = (size_t)count * ((size_t)count + 1) / 2;
  for (int j = 0; j < count; j++) {
    double m[81];
    contract(c, gradient + 9 * (size_t)j, m);
    for (int i = j; i < count; i++) {
      const size_t pair = (size_t)i * ((size_t)i + 1) / 2 + (size_t)j;
      const double *d = gradient + 9 * (size_t)i;
      double p[9];
      for (int ab = 0; ab < 9; ab++) {
        p[ab] = 0;
        for (int cd = 0; cd < 9; cd++) p[ab] += m[9 * ab + cd] * d[cd];
      }
      for (int v = 0; v < 4; v++)
        for (int a = 0; a < 3; a++)
          f[(3 * (size_t)tet[v] + (size_t)a) * pairs + pair] +=
              fem->volume[e] *
              (p[3 * a] * g[3 * v] + p[3 * a + 1] * g[3 * v + 1] + p[3 * a + 2] * g[3 * v + 2]);
    }
  }
}

ep_status ep_fem_rest_curvature_forces(const ep_fem *fem, int count, const double *u, double *f,
                                       ep_error *err) {
  const size_t n3 = 3 * (size_t)fem->mesh->nv;
  const size_t pairs = (size_t)count * ((size_t)count + 1) / 2;
  double *gradient = malloc(9 * (size_t)count * sizeof *gradient + 1);
  if (!gradient) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d modes", count);
  ep_curvature law;
  ep_rest_curvature(fem->model, &law);
  memset(f, 0, n3 * pairs * sizeof *f);
  for (int e = 0; e < fem->mesh->nt; e++) {
    double c[729];
    for (int i = 0; i < 729; i++)
      c[i] = fem->lambda[e] * law.by_lambda[i] + fem->mu[e] * law.by_mu[i];
    for (int i = 0; i < count; i++)
      ep_fem_displacement_gradient(fem, e, u + n3 * (size_t)i, gradient + 9 * (size_t)i);
    contract_pairs(fem, e, count, c, gradient, f);
  }
  free(gradient);
  return EP_OK;
}
