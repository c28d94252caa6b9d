#include "reduced/bake/green_strains.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/dense.h"
#include "reduced/bake/fem_assembly.h"

// Eigenvalues of the strains' correlations below this share of the largest are dependence.
static const double DEPENDENT = 1e-8;
// An example whose strain energy is below this share of the largest has none: round-off of a rigid
// motion is 1e-30.
static const double STRAINLESS = 1e-20;

void ep_green_strain6(const ep_fem *fem, int e, const double *u, double strain[6]) {
  static const int place[6][2] = {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}};
  double a[9];
  ep_fem_displacement_gradient(fem, e, u, a);
  for (int c = 0; c < 6; c++) {
    const int i = place[c][0], j = place[c][1];
    strain[c] = 0.5 * (a[3 * i + j] + a[3 * j + i] + a[i] * a[j] + a[3 + i] * a[3 + j] +
                       a[6 + i] * a[6 + j]);
  }
}

// Strains chi_j E_j (k x 6) of one tet, their stresses, and what they add to the Gram matrix.
static void add_element(ep_green_space *s, int e, double weight, const double *poses,
                        const double *share, double *strain) {
  const ep_fem *fem = s->fem;
  const size_t nt = (size_t)fem->mesh->nt, n3 = 3 * (size_t)fem->mesh->nv, k = (size_t)s->k;
  for (size_t j = 0; j < k; j++) {
    double *ej = strain + 6 * j, *stress = s->stress + 6 * (j * nt + (size_t)e);
    ep_green_strain6(fem, e, poses + j * n3, ej);
    const double chi = share ? share[j * nt + (size_t)e] : 1;
    for (int c = 0; c < 6; c++) ej[c] *= chi;
    const double pressure = fem->lambda[e] * (ej[0] + ej[1] + ej[2]);
    for (int c = 0; c < 6; c++)
      stress[c] = 0.5 * weight * (2 * fem->mu[e] * ej[c] + (c < 3 ? pressure : 0));
    for (size_t i = 0; i <= j; i++) s->gram[j * k + i] += ep_inner6(stress, strain + 6 * i);
  }
}

static ep_status check_strains(const ep_green_space *s, ep_error *err) {
  const int k = s->k;
  double largest = 0;
  for (int j = 0; j < k; j++) largest = fmax(largest, s->gram[(k + 1) * j]);
  for (int j = 0; j < k; j++)
    if (!(s->gram[(k + 1) * j] > STRAINLESS * largest))
      return ep_fail(err, EP_ERR_ARGUMENT,
                     "example %d has no strain where it acts (strain energy %g J): it is the rest "
                     "shape or a rigid motion of it, or its region does not deform; leave it out "
                     "of the Green-strain path or change its region",
                     j + 1, s->gram[(k + 1) * j]);
  return EP_OK;
}

// V from the eigenpairs of the correlations; how far each example is apart from the others.
static void keep_independent(ep_green_space *s, const double *lambda, const double *vectors) {
  const int k = s->k;
  int first = 0; // eigenvalues ascend
  while (lambda[first] <= DEPENDENT * lambda[k - 1]) first++;
  s->count = k - first;
  for (int j = 0; j < k; j++) {
    double inverse = 0;
    for (int i = 0; i < k; i++) {
      const double v = vectors[i * k + j];
      inverse += v * v / (fmax(lambda[i], 0) + DEPENDENT);
      if (i >= first)
        s->weights[j * s->count + i - first] = v / sqrt(lambda[i] * s->gram[(k + 1) * j]);
    }
    s->apart[j] = fmax(0, 1 / inverse - DEPENDENT);
  }
}

static void report(const ep_green_space *s, ep_log *log) {
  if (s->count == s->k) return;
  for (int j = 0; j < s->k; j++)
    if (s->apart[j] < 10 * DEPENDENT)
      ep_warn(log,
              "Green-strain path: example %d is (nearly) a combination of the others (less than "
              "%.0e of its strain energy is its own); weights are shared among such examples",
              j + 1, 10 * DEPENDENT);
  ep_notice(log, "Green-strain path: %d of %d examples' strains are independent", s->count, s->k);
}

static ep_status find_rank(ep_green_space *s, ep_log *log, ep_error *err) {
  const int k = s->k;
  double *work = malloc((2 * (size_t)(k * k) + (size_t)k) * sizeof *work);
  if (!work) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d examples' strains", k);
  double *vectors = work + k * k, *lambda = vectors + k * k;
  for (int j = 0; j < k; j++)
    for (int i = 0; i < k; i++)
      work[j * k + i] = s->gram[j * k + i] / sqrt(s->gram[(k + 1) * j] * s->gram[(k + 1) * i]);
  const ep_status status = ep_eigen_symmetric(k, work, lambda, vectors, err);
  if (status == EP_OK) {
    keep_independent(s, lambda, vectors);
    report(s, log);
  }
  free(work);
  return status;
}

ep_status ep_green_space_create(const ep_fem *fem, const double *weight, int k, const double *poses,
                                const double *share, ep_log *log, ep_green_space *out,
                                ep_error *err) {
  const size_t nt = (size_t)fem->mesh->nt, count = (size_t)k;
  *out = (ep_green_space){.fem = fem, .k = k};
  if (k < 1) return ep_fail(err, EP_ERR_ARGUMENT, "the Green-strain path needs examples");
  double *strain = malloc(6 * count * sizeof *strain);
  out->stress = malloc(6 * count * nt * sizeof *out->stress);
  out->gram = calloc(count * count, sizeof *out->gram);
  out->weights = calloc(count * count, sizeof *out->weights);
  out->apart = calloc(count, sizeof *out->apart);
  ep_status status = EP_OK;
  if (!strain || !out->stress || !out->gram || !out->weights || !out->apart)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for %d examples' strains", k);
  for (int e = 0; e < fem->mesh->nt && status == EP_OK; e++)
    add_element(out, e, weight[e], poses, share, strain);
  free(strain);
  for (size_t j = 0; j < count && status == EP_OK; j++)
    for (size_t i = 0; i < j; i++) out->gram[i * count + j] = out->gram[j * count + i];
  if (status == EP_OK) status = check_strains(out, err);
  if (status == EP_OK) status = find_rank(out, log, err);
  if (status != EP_OK) ep_green_space_free(out);
  return status;
}

void ep_green_space_free(ep_green_space *space) {
  free(space->stress);
  free(space->gram);
  free(space->weights);
  free(space->apart);
  *space = (ep_green_space){0};
}
