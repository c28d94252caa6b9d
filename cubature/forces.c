#include "cubature/forces.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/parallel.h"
#include "linalg/dense.h"
#include "reduced/reference.h"

typedef struct create_work {
  ep_elements *elements;
  const ep_basis *basis;
} create_work;

void ep_element_rows(const ep_fem *fem, const ep_basis *basis, int e, double *g) {
  const size_t r = (size_t)basis->r, width = 3 * (size_t)fem->mesh->nv;
  const int *tet = fem->mesh->tet + 4 * (size_t)e;
  const double *gradient = fem->gradient + 12 * (size_t)e;
  for (size_t a = 0; a < r; a++)
    for (int entry = 0; entry < 9; entry++) {
      double sum = 0;
      for (int v = 0; v < 4; v++)
        sum += basis->u[a * width + 3 * (size_t)tet[v] + (size_t)(entry / 3)] *
               gradient[3 * v + entry % 3];
      g[(size_t)entry * r + a] = sum;
    }
}

static void create_range(void *context, int piece, int from, int to) {
  (void)piece;
  const create_work *w = context;
  for (int e = from; e < to; e++)
    ep_element_rows(w->elements->fem, w->basis, e,
                    w->elements->g + (size_t)e * 9 * (size_t)w->elements->r);
}

ep_status ep_elements_create(const ep_fem *fem, const ep_basis *basis, ep_elements *out,
                             ep_error *err) {
  *out = (ep_elements){.fem = fem, .nt = fem->mesh->nt, .r = basis->r};
  out->g = malloc(((size_t)out->nt * 9 * (size_t)out->r + 1) * sizeof *out->g);
  if (!out->g)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the gradients of %d elements", out->nt);
  ep_parallel_ranges(out->nt, create_range, &(create_work){out, basis});
  return EP_OK;
}

void ep_elements_free(ep_elements *elements) {
  free(elements->g);
  *elements = (ep_elements){0};
}

// c = a b; c = a b^T.
static void multiply(const double a[9], const double b[9], double c[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

static void multiply_nt(const double a[9], const double b[9], double c[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      c[3 * i + j] =
          a[3 * i] * b[3 * j] + a[3 * i + 1] * b[3 * j + 1] + a[3 * i + 2] * b[3 * j + 2];
}

double ep_element_gradient(const ep_elements *elements, int e, const double *q, double f[9]) {
  const int r = elements->r;
  const double *g = elements->g + (size_t)e * 9 * (size_t)r;
  for (int entry = 0; entry < 9; entry++) {
    // Four partial sums in a fixed order, so that compilers may use lanes without being told to
    // reorder.
    const double *row = g + (size_t)entry * (size_t)r;
    double sum[4] = {0};
    int a = 0;
    for (; a + 4 <= r; a += 4)
      for (int k = 0; k < 4; k++) sum[k] += row[a + k] * q[a + k];
    for (; a < r; a++) sum[0] += row[a] * q[a];
    f[entry] = (entry % 4 == 0 ? 1.0 : 0.0) + ((sum[0] + sum[1]) + (sum[2] + sum[3]));
  }
  return ep_determinant3(f);
}

void ep_element_pull_back(const ep_elements *elements, int e, const double stress[9], double *out) {
  const int r = elements->r;
  const double *g = elements->g + (size_t)e * 9 * (size_t)r;
  memset(out, 0, (size_t)r * sizeof *out);
  for (int entry = 0; entry < 9; entry++) {
    const double *row = g + (size_t)entry * (size_t)r, p = stress[entry];
    for (int a = 0; a < r; a++) out[a] += row[a] * p;
  }
}

double ep_element_volume_ratio(const ep_elements *elements, int e, const ep_pose *pose) {
  double f[9];
  const double det = ep_element_gradient(elements, e, pose->q, f);
  if (!pose->reference) return det;
  double inverted[9];
  const double base_det = ep_element_gradient(elements, e, pose->reference, f);
  return ep_reference_element(f, inverted) > 0 ? det / base_det : 1;
}

static double whole_force(const ep_elements *elements, int e, const ep_pose *pose, double *out) {
  const ep_fem *fem = elements->fem;
  double f[9], stress[9];
  double det = ep_element_gradient(elements, e, pose->q, f);
  if (!pose->reference) {
    ep_material_stress(fem->model, fem->lambda[e], fem->mu[e], f, stress);
    ep_element_pull_back(elements, e, stress, out);
    return det;
  }
  double base[9], inverted[9], relative[9], pulled[9];
  const double base_det = ep_element_gradient(elements, e, pose->reference, base);
  const double weight = ep_reference_element(base, inverted);
  if (!(weight > 0)) {
    memset(out, 0, (size_t)elements->r * sizeof *out);
    return 1;
  }
  multiply(f, inverted, relative);
  ep_material_stress(fem->model, fem->lambda[e], fem->mu[e], relative, stress);
  multiply_nt(stress, inverted, pulled);
  for (int i = 0; i < 9; i++) pulled[i] *= weight;
  ep_element_pull_back(elements, e, pulled, out);
  return det / base_det;
}

double ep_element_force(const ep_elements *elements, int e, const ep_pose *pose, double *out) {
  const double share = pose->share ? pose->share[e] : 1;
  if (share == 0) {
    memset(out, 0, (size_t)elements->r * sizeof *out);
    return 1;
  }
  const double det = whole_force(elements, e, pose, out);
  for (int a = 0; share != 1 && a < elements->r; a++) out[a] *= share;
  return det;
}
