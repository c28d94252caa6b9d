// Linear modes and modal derivatives (Barbic and James 2005, sections 4.1 and 4.2).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/petsc.h"
#include "reduced/bake/basis.h"
#include "reduced/bake/curvature.h"
#include "reduced/bake/inertia.h"
#include "reduced/bake/vectors.h"

// Twice the area of the largest triangle (a, b, v) of fixed vertices, a the first, b farthest
// from a: zero where all fixed vertices lie on a line.
static double fixed_spread(const ep_fem *fem) {
  const double *x = fem->mesh->x, *a = NULL, *b = NULL;
  double far = 0, area = 0;
  for (int pass = 0; pass < 2; pass++)
    for (int v = 0; v < fem->mesh->nv; v++) {
      const double *y = x + 3 * (size_t)v;
      if (!fem->held[3 * (size_t)v]) continue;
      if (!a) a = b = y;
      double d[3] = {y[0] - a[0], y[1] - a[1], y[2] - a[2]};
      double l[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
      double c[3] = {d[1] * l[2] - d[2] * l[1], d[2] * l[0] - d[0] * l[2],
                     d[0] * l[1] - d[1] * l[0]};
      double square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
      if (pass == 0 && square > far) far = square, b = y;
      if (pass == 1) area = fmax(area, sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]));
    }
  return area;
}

static ep_status check_request(const ep_fem *fem, int linear, ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  const double diagonal = ep_mesh_diagonal(mesh);
  if (!ep_fem_is_free(fem) && (fem->nheld < 3 || fixed_spread(fem) < 1e-9 * diagonal * diagonal))
    return ep_fail(err, EP_ERR_UNSUPPORTED,
                   "%s: %d vertices are fixed; an object must be held by at least three that are "
                   "not on a line, or not at all (hinges are not supported)",
                   mesh->name, fem->nheld);
  const int movable = 3 * (mesh->nv - fem->nheld) - (ep_fem_is_free(fem) ? 6 : 0);
  if (linear < 1 || linear >= movable)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "%s: %d linear modes wanted; between 1 and %d are possible", mesh->name, linear,
                   movable - 1);
  return EP_OK;
}

// Largest diagonal entry of K over that of M: an upper bound in size of the spectrum.
static double spectrum_scale(const ep_csr *k, const ep_csr *mass) {
  double largest = 0;
  for (int i = 0; i < k->n; i++)
    largest = fmax(largest, k->value[ep_csr_find(k, i, i)] / mass->value[ep_csr_find(mass, i, i)]);
  return largest;
}

// Nothing held: the modes above six rigid ones of eigenvalue 0. The shift must be small against the
// first elastic one but keep K - shift M definite; the rigid ones are checked to be rigid.
static ep_status free_modes(const ep_fem *fem, const ep_csr *k, const ep_csr *mass, ep_log *log,
                            ep_modes *out, ep_error *err) {
  const size_t n3 = 3 * (size_t)out->n, count = (size_t)out->linear + 6;
  double *lambda = malloc(count * sizeof *lambda), *x = malloc(count * n3 * sizeof *x);
  ep_status status = lambda && x ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for modes");
  if (status == EP_OK)
    status = ep_eigenpairs(k, mass, NULL, -1e-7 * spectrum_scale(k, mass), (int)count, lambda, x,
                           log, err);
  if (status == EP_OK && !(fabs(lambda[5]) < 1e-6 * lambda[6]))
    status = ep_fail(err, EP_ERR_NUMERIC,
                     "%s: the sixth eigenvalue, %g, is not small against the seventh, %g: the "
                     "object is not one solid piece, or parts of it are far too soft",
                     fem->mesh->name, lambda[5], lambda[6]);
  if (status == EP_OK) {
    memcpy(out->omega2, lambda + 6, (size_t)out->linear * sizeof *lambda);
    memcpy(out->mode, x + 6 * n3, (size_t)out->linear * n3 * sizeof *x);
  }
  free(lambda);
  free(x);
  return status;
}

static ep_status linear_modes(const ep_fem *fem, const ep_csr *k, ep_log *log, ep_modes *out,
                              ep_error *err) {
  ep_csr mass = {0};
  EP_TRY(ep_fem_mass(fem, &mass, err));
  // shift 0: with the object held K is positive definite, and the lowest modes are nearest
  ep_status status = ep_fem_is_free(fem) ? free_modes(fem, k, &mass, log, out, err)
                                         : ep_eigenpairs(k, &mass, fem->held, 0, out->linear,
                                                         out->omega2, out->mode, log, err);
  ep_csr_free(&mass);
  const size_t n3 = 3 * (size_t)out->n;
  for (int i = 0; status == EP_OK && i < out->linear; i++)
    ep_canonical_sign(n3, out->mode + (size_t)i * n3);
  return status;
}

// rows (pairs x 3n) = - columns (3n x pairs)
static void negated_rows(size_t n3, size_t pairs, const double *columns, double *rows) {
  for (size_t i = 0; i < n3; i++)
    for (size_t p = 0; p < pairs; p++) rows[p * n3 + i] = -columns[i * pairs + p];
}

// Take the rigid part out of columns f (3n x pairs), as loads (M R R^T f) or as displacements
// (R R^T M f).
static void take_rigid_out(size_t n3, size_t pairs, const double *rigid, bool loads, double *f) {
  const double *test = loads ? rigid : rigid + 6 * n3, *span = loads ? rigid + 6 * n3 : rigid;
  for (size_t p = 0; p < pairs; p++)
    for (size_t k = 0; k < 6; k++) {
      double part = 0;
      for (size_t i = 0; i < n3; i++) part += test[k * n3 + i] * f[i * pairs + p];
      for (size_t i = 0; i < n3; i++) f[i * pairs + p] -= part * span[k * n3 + i];
    }
}

// K Psi = f where nothing is held: loads that turn the object as a whole are taken off, supports
// then carry nothing, and the solution is told from others by being mass-orthogonal to the rigid
// modes.
static ep_status solve_free(const ep_fem *fem, const ep_csr *k, int pairs, double *f,
                            ep_error *err) {
  const size_t n3 = 3 * (size_t)fem->mesh->nv;
  ep_csr mass = {0};
  ep_factor *factor = NULL;
  unsigned char *held = calloc(n3, 1);
  double *rigid = malloc(12 * n3 * sizeof *rigid);
  ep_status status = held && rigid ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for modes");
  if (status == EP_OK) status = ep_fem_scalar_mass(fem, &mass, err);
  if (status == EP_OK) status = ep_rigid_modes(fem->mesh, &mass, rigid, rigid + 6 * n3, err);
  if (status == EP_OK) {
    ep_rigid_supports(fem->mesh, held);
    take_rigid_out(n3, (size_t)pairs, rigid, true, f);
    status = ep_factor_create(k, held, 1, &factor, err);
  }
  if (status == EP_OK) status = ep_factor_solve(factor, pairs, f, f, err);
  if (status == EP_OK) take_rigid_out(n3, (size_t)pairs, rigid, false, f);
  ep_factor_free(factor);
  ep_csr_free(&mass);
  free(held);
  free(rigid);
  return status;
}

static ep_status solve_held(const ep_fem *fem, const ep_csr *k, int pairs, double *f,
                            ep_error *err) {
  ep_factor *factor = NULL;
  EP_TRY(ep_factor_create(k, fem->held, 1, &factor, err));
  const ep_status status = ep_factor_solve(factor, pairs, f, f, err);
  ep_factor_free(factor);
  return status;
}

// K Psi_ij = -(H : psi_j) psi_i for all pairs, one factorisation.
static ep_status derivatives(const ep_fem *fem, const ep_csr *k, ep_modes *out, ep_error *err) {
  const size_t n3 = 3 * (size_t)out->n, pairs = (size_t)out->derivatives;
  double *f = malloc(n3 * pairs * sizeof *f);
  if (!f)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d modal derivatives", out->derivatives);
  ep_status status = ep_fem_rest_curvature_forces(fem, out->linear, out->mode, f, err);
  if (status == EP_OK)
    status = ep_fem_is_free(fem) ? solve_free(fem, k, out->derivatives, f, err)
                                 : solve_held(fem, k, out->derivatives, f, err);
  if (status == EP_OK) negated_rows(n3, pairs, f, out->mode + (size_t)out->linear * n3);
  free(f);
  return status;
}

ep_status ep_modes_compute(const ep_fem *fem, int linear, ep_log *log, ep_modes *out,
                           ep_error *err) {
  const size_t n3 = 3 * (size_t)fem->mesh->nv;
  ep_csr k = {0};
  ep_status status;
  *out = (ep_modes){.n = fem->mesh->nv, .linear = linear};
  EP_TRY(check_request(fem, linear, err));
  out->derivatives = linear * (linear + 1) / 2;
  out->omega2 = malloc((size_t)linear * sizeof *out->omega2);
  out->mode = malloc((size_t)(linear + out->derivatives) * n3 * sizeof *out->mode);
  if (!out->omega2 || !out->mode) {
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for %d modes", linear);
    goto fail;
  }
  EP_TRY_GOTO(status, ep_fem_rest_stiffness(fem, &k, err), fail);
  EP_TRY_GOTO(status, linear_modes(fem, &k, log, out, err), fail);
  EP_TRY_GOTO(status, derivatives(fem, &k, out, err), fail);
  ep_csr_free(&k);
  return EP_OK;
fail:
  ep_csr_free(&k);
  ep_modes_free(out);
  return status;
}

void ep_modes_free(ep_modes *modes) {
  free(modes->omega2);
  free(modes->mode);
  *modes = (ep_modes){0};
}
