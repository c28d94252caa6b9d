#include "reduced/bake/fem.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "reduced/bake/fem_assembly.h"

// A tet counts as flat when its volume is this far below the cube of its longest edge: shape
// gradients then lose all but a few digits.
static const double FLAT = 1e-12;

static ep_status check_elastic(const ep_elastic *m, int index, const char *mesh, ep_error *err) {
  if (!(m->density > 0) || !isfinite(m->density))
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: material %d: density %g kg/m^3 is not positive", mesh,
                   index, m->density);
  if (!(m->young > 0) || !isfinite(m->young))
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: material %d: Young's modulus %g Pa is not positive",
                   mesh, index, m->young);
  if (!(m->poisson >= 0 && m->poisson < 0.5))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "%s: material %d: Poisson's ratio %g is outside [0, 0.5); use 0.49 for "
                   "a nearly incompressible body",
                   mesh, index, m->poisson);
  return EP_OK;
}

static ep_status allocate(ep_fem *fem, ep_error *err) {
  size_t nt = (size_t)fem->mesh->nt, nv = (size_t)fem->mesh->nv;
  fem->gradient = malloc(12 * nt * sizeof *fem->gradient);
  fem->volume = malloc(nt * sizeof *fem->volume);
  fem->lambda = malloc(nt * sizeof *fem->lambda);
  fem->mu = malloc(nt * sizeof *fem->mu);
  fem->density = malloc(nt * sizeof *fem->density);
  fem->held = calloc(3 * nv, 1);
  fem->slot = malloc(16 * nt * sizeof *fem->slot);
  if (!fem->gradient || !fem->volume || !fem->lambda || !fem->mu || !fem->density || !fem->held ||
      !fem->slot)
    return ep_fail(err, EP_ERR_MEMORY, "%s: no memory for %d finite elements", fem->mesh->name,
                   fem->mesh->nt);
  return EP_OK;
}

static double longest_edge(const ep_mesh *mesh, int e) {
  const int *tet = mesh->tet + 4 * (size_t)e;
  double longest = 0;
  for (int i = 0; i < 4; i++)
    for (int j = i + 1; j < 4; j++) {
      const double *x = mesh->x + 3 * (size_t)tet[i], *y = mesh->x + 3 * (size_t)tet[j];
      double square = 0;
      for (int a = 0; a < 3; a++) square += (x[a] - y[a]) * (x[a] - y[a]);
      longest = fmax(longest, square);
    }
  return sqrt(longest);
}

static ep_status set_geometry(ep_fem *fem, ep_error *err) {
  for (int e = 0; e < fem->mesh->nt; e++) {
    double h = longest_edge(fem->mesh, e);
    fem->volume[e] = ep_tet_gradients(fem->mesh, e, fem->gradient + 12 * (size_t)e);
    if (!(fem->volume[e] > FLAT * h * h * h))
      return ep_fail(err, EP_ERR_MESH,
                     "%s: tet %d (counted from 0) is degenerate: volume %g at longest edge %g; "
                     "remove it or mesh the object again",
                     fem->mesh->name, e, fem->volume[e], h);
  }
  return EP_OK;
}

static ep_status set_materials(ep_fem *fem, int nmaterials, const ep_elastic *material,
                               ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  if (nmaterials < 1)
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: no material: give density, young and poisson",
                   mesh->name);
  if (nmaterials > 1 && !mesh->tet_material)
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: %d materials, but the mesh does not say where",
                   mesh->name, nmaterials);
  for (int i = 0; i < nmaterials; i++) EP_TRY(check_elastic(&material[i], i, mesh->name, err));
  for (int e = 0; e < mesh->nt; e++) {
    int index = nmaterials > 1 ? mesh->tet_material[e] : 0;
    if (index < 0 || index >= nmaterials)
      return ep_fail(err, EP_ERR_ARGUMENT, "%s: tet %d has material %d of %d", mesh->name, e, index,
                     nmaterials);
    const ep_elastic *m = &material[index];
    fem->lambda[e] = m->young * m->poisson / ((1 + m->poisson) * (1 - 2 * m->poisson));
    fem->mu[e] = m->young / (2 * (1 + m->poisson));
    fem->density[e] = m->density;
  }
  return EP_OK;
}

static ep_status set_fixed(ep_fem *fem, int nfixed, const int *fixed, ep_error *err) {
  for (int i = 0; i < nfixed; i++) {
    int v = fixed[i];
    if (v < 0 || v >= fem->mesh->nv)
      return ep_fail(err, EP_ERR_ARGUMENT, "%s: fixed vertex %d does not exist (0 to %d)",
                     fem->mesh->name, v, fem->mesh->nv - 1);
    if (!fem->held[3 * (size_t)v]) fem->nheld++;
    memset(fem->held + 3 * (size_t)v, 1, 3);
  }
  return EP_OK;
}

// The places of the element blocks in the mesh's pattern, once: assembly then never searches.
static ep_status set_slots(ep_fem *fem, ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  ep_csr pattern = {0};
  EP_TRY(ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 1, &pattern, err));
  for (int e = 0; e < mesh->nt; e++)
    for (int i = 0; i < 4; i++)
      for (int j = 0; j < 4; j++) {
        int v = mesh->tet[4 * (size_t)e + i], w = mesh->tet[4 * (size_t)e + j];
        fem->slot[16 * (size_t)e + 4 * i + j] = ep_csr_find(&pattern, v, w) - pattern.start[v];
      }
  ep_csr_free(&pattern);
  return EP_OK;
}

ep_status ep_fem_create(const ep_mesh *mesh, ep_material model, int nmaterials,
                        const ep_elastic *material, int nfixed, const int *fixed, ep_fem *out,
                        ep_error *err) {
  ep_status status;
  *out = (ep_fem){.mesh = mesh, .model = model};
  EP_TRY_GOTO(status, allocate(out, err), fail);
  EP_TRY_GOTO(status, set_geometry(out, err), fail);
  EP_TRY_GOTO(status, set_materials(out, nmaterials, material, err), fail);
  EP_TRY_GOTO(status, set_fixed(out, nfixed, fixed, err), fail);
  EP_TRY_GOTO(status, set_slots(out, err), fail);
  return EP_OK;
fail:
  ep_fem_free(out);
  return status;
}

void ep_fem_free(ep_fem *fem) {
  free(fem->gradient);
  free(fem->volume);
  free(fem->lambda);
  free(fem->mu);
  free(fem->density);
  free(fem->held);
  free(fem->slot);
  *fem = (ep_fem){0};
}

double ep_fem_contact_unit(const ep_fem *fem) {
  double volume = 0, sum = 0;
  for (int e = 0; e < fem->mesh->nt; e++) {
    const double lambda = fem->lambda[e], mu = fem->mu[e];
    volume += fem->volume[e];
    sum += fem->volume[e] * mu * (3 * lambda + 2 * mu) / (lambda + mu);
  }
  return sum / volume / ep_mesh_extent(fem->mesh);
}

double ep_fem_energy(const ep_fem *fem, const double *u) {
  double sum = 0;
  for (int e = 0; e < fem->mesh->nt; e++) {
    double f[9];
    ep_fem_deformation(fem, e, u, f);
    sum += fem->volume[e] * ep_material_energy(fem->model, fem->lambda[e], fem->mu[e], f);
  }
  return sum;
}

void ep_fem_force(const ep_fem *fem, const double *u, double *force) {
  memset(force, 0, 3 * (size_t)fem->mesh->nv * sizeof *force);
  for (int e = 0; e < fem->mesh->nt; e++) {
    double f[9], p[9];
    ep_fem_deformation(fem, e, u, f);
    ep_material_stress(fem->model, fem->lambda[e], fem->mu[e], f, p);
    ep_fem_scatter_stress(fem, e, fem->volume[e], p, force);
  }
}

void ep_fem_stiffness(const ep_fem *fem, const double *u, int project, ep_csr *k) {
  memset(k->value, 0, (size_t)k->start[k->n] * sizeof *k->value);
  for (int e = 0; e < fem->mesh->nt; e++) {
    double f[9], h[81];
    ep_fem_deformation(fem, e, u, f);
    ep_material_tangent(fem->model, fem->lambda[e], fem->mu[e], f, h);
    if (project) ep_material_project(h);
    ep_fem_scatter_tangent(fem, e, fem->volume[e], h, k);
  }
}

ep_status ep_fem_rest_stiffness(const ep_fem *fem, ep_csr *k, ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  double *rest = calloc(3 * (size_t)mesh->nv, sizeof *rest);
  if (!rest) return ep_fail(err, EP_ERR_MEMORY, "%s: no memory for a displacement", mesh->name);
  ep_status status = ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 3, k, err);
  if (status == EP_OK) ep_fem_stiffness(fem, rest, 0, k);
  free(rest);
  return status;
}

// rho V / 20 (1 + delta_ij) for linear tets, added to `axes` diagonals of each vertex block.
static void scatter_mass(const ep_fem *fem, int axes, ep_csr *m) {
  for (int e = 0; e < fem->mesh->nt; e++) {
    const int *tet = fem->mesh->tet + 4 * (size_t)e;
    const int *slot = fem->slot + 16 * (size_t)e;
    double part = fem->density[e] * fem->volume[e] / 20;
    for (int i = 0; i < 4; i++)
      for (int j = 0; j < 4; j++)
        for (int a = 0; a < axes; a++)
          m->value[m->start[axes * tet[i] + a] + axes * slot[4 * i + j] + a] +=
              i == j ? 2 * part : part;
  }
}

ep_status ep_fem_mass(const ep_fem *fem, ep_csr *m, ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  EP_TRY(ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 3, m, err));
  scatter_mass(fem, 3, m);
  return EP_OK;
}

ep_status ep_fem_scalar_mass(const ep_fem *fem, ep_csr *m, ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  EP_TRY(ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 1, m, err));
  scatter_mass(fem, 1, m);
  return EP_OK;
}
