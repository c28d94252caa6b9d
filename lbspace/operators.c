#include <stdlib.h>
#include <string.h>

#include "lbspace/lbspace.h"
#include "linalg/dense.h"

// Adds the 4 x 4 matrix of tet e.
static void add_tet(const ep_mesh *mesh, int e, const double local[16], ep_csr *a) {
  const int *v = mesh->tet + 4 * e;
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) a->value[ep_csr_find(a, v[i], v[j])] += local[4 * i + j];
}

static void stiffness_of(double volume, const double g[12], double local[16]) {
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) {
      const double *a = g + 3 * i, *b = g + 3 * j;
      local[4 * i + j] = volume * (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]);
    }
}

static void mass_of(double volume, double local[16]) {
  for (int i = 0; i < 4; i++)
    for (int j = 0; j < 4; j++) local[4 * i + j] = volume / 20 * (1 + (i == j));
}

static ep_status assemble(const ep_mesh *mesh, int mass, ep_csr *out, ep_error *err) {
  EP_TRY(ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 1, out, err));
  for (int e = 0; e < mesh->nt; e++) {
    double g[12], local[16];
    const double volume = ep_tet_gradients(mesh, e, g);
    if (!(volume > 0)) {
      ep_csr_free(out);
      return ep_fail(err, EP_ERR_MESH, "%s: tet %d has no volume (%g); repair the mesh", mesh->name,
                     e, volume);
    }
    if (mass)
      mass_of(volume, local);
    else
      stiffness_of(volume, g, local);
    add_tet(mesh, e, local, out);
  }
  return EP_OK;
}

ep_status ep_lb_stiffness(const ep_mesh *mesh, ep_csr *k, ep_error *err) {
  return assemble(mesh, 0, k, err);
}

ep_status ep_lb_mass(const ep_mesh *mesh, ep_csr *m, ep_error *err) {
  return assemble(mesh, 1, m, err);
}

void ep_lb_project(const ep_lb *lb, const ep_csr *mass, const double *u, double *d) {
  const size_t n = (size_t)lb->n;
  memset(d, 0, 3 * (size_t)lb->m * sizeof *d);
  for (int i = 0; i < lb->n; i++) {
    double mu[3] = {0, 0, 0};
    for (int p = mass->start[i]; p < mass->start[i + 1]; p++)
      for (int k = 0; k < 3; k++) mu[k] += mass->value[p] * u[3 * mass->column[p] + k];
    for (int j = 0; j < lb->m; j++)
      for (int k = 0; k < 3; k++) d[3 * j + k] += lb->phi[(size_t)j * n + (size_t)i] * mu[k];
  }
}

void ep_lb_reconstruct(const ep_lb *lb, const double *d, double *u) {
  ep_gemm_tn(lb->n, 3, lb->m, lb->phi, d, u);
}
