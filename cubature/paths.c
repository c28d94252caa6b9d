// Gauss-Newton in the subspace for the stations of the example paths.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/cholesky.h"
#include "cubature/poses.h"

enum { MAX_STEPS = 30, MAX_HALVINGS = 12 };

// Weight of 1/2 q^T K0 q beside the strain difference: keeps the matrix regular where strain does
// not see a mode at first order, without moving the minimum visibly.
static const double regularisation = 1e-6, converged = 1e-8;

typedef struct path_problem {
  const ep_elements *elements;
  const ep_basis *basis;
  const double *target; // (nt x 6) Green strain xx yy zz yz xz xy of the example
  double w;
  double *h, *gradient, *rows; // (r x r), (r), (6 x r)
} path_problem;

static const int voigt[6][2] = {{0, 0}, {1, 1}, {2, 2}, {1, 2}, {0, 2}, {0, 1}};

static void green_strain(const double f[9], double e[6]) {
  for (int k = 0; k < 6; k++) {
    const int i = voigt[k][0], j = voigt[k][1];
    e[k] = 0.5 * (f[i] * f[j] + f[3 + i] * f[3 + j] + f[6 + i] * f[6 + j] - (i == j ? 1.0 : 0.0));
  }
}

static double strain_norm(double lambda, double mu, const double e[6]) {
  const double trace = e[0] + e[1] + e[2];
  return 0.5 * lambda * trace * trace + mu * (e[0] * e[0] + e[1] * e[1] + e[2] * e[2] +
                                              2 * (e[3] * e[3] + e[4] * e[4] + e[5] * e[5]));
}

static void strain_difference(const path_problem *p, int e, const double *q, double f[9],
                              double out[6]) {
  ep_element_gradient(p->elements, e, q, f);
  green_strain(f, out);
  for (int k = 0; k < 6; k++) out[k] -= p->w * p->target[6 * (size_t)e + (size_t)k];
}

static double quadratic(int r, const double *k0, const double *q) {
  double sum = 0;
  for (int a = 0; a < r; a++)
    for (int b = 0; b < r; b++) sum += q[a] * k0[(size_t)a * (size_t)r + (size_t)b] * q[b];
  return sum;
}

static double objective(const path_problem *p, const double *q) {
  const ep_fem *fem = p->elements->fem;
  double sum = 0.5 * regularisation * quadratic(p->basis->r, p->basis->stiffness, q), f[9], e[6];
  for (int t = 0; t < p->elements->nt; t++) {
    strain_difference(p, t, q, f, e);
    sum += fem->volume[t] * strain_norm(fem->lambda[t], fem->mu[t], e);
  }
  return sum;
}

// rows[k][a] = dE_k / dq_a = sym(F^T G_a).
static void strain_rows(const path_problem *p, int e, const double f[9], double *rows) {
  const size_t r = (size_t)p->elements->r;
  const double *g = p->elements->g + (size_t)e * 9 * r;
  for (int k = 0; k < 6; k++) {
    const int i = voigt[k][0], j = voigt[k][1];
    for (size_t a = 0; a < r; a++) {
      double sum = 0;
      for (int m = 0; m < 3; m++)
        sum += f[3 * m + i] * g[(size_t)(3 * m + j) * r + a] +
               f[3 * m + j] * g[(size_t)(3 * m + i) * r + a];
      rows[(size_t)k * r + a] = 0.5 * sum;
    }
  }
}

// Add weight * row row^T (lower triangle) and weight * value * row.
static void add_row(path_problem *p, double weight, double value, const double *row) {
  const size_t r = (size_t)p->elements->r;
  for (size_t a = 0; a < r; a++) {
    const double scaled = weight * row[a];
    p->gradient[a] += scaled * value;
    for (size_t b = 0; b <= a; b++) p->h[a * r + b] += scaled * row[b];
  }
}

static void assemble(path_problem *p, const double *q) {
  const ep_fem *fem = p->elements->fem;
  const size_t r = (size_t)p->elements->r;
  memcpy(p->h, p->basis->stiffness, r * r * sizeof(double));
  for (size_t i = 0; i < r * r; i++) p->h[i] *= regularisation;
  for (size_t a = 0; a < r; a++) {
    p->gradient[a] = 0;
    for (size_t b = 0; b < r; b++) p->gradient[a] += p->h[a * r + b] * q[b];
  }
  for (int t = 0; t < p->elements->nt; t++) {
    double f[9], e[6];
    strain_difference(p, t, q, f, e);
    strain_rows(p, t, f, p->rows);
    const double volume = fem->volume[t], shear = 2 * fem->mu[t] * volume;
    for (size_t k = 0; k < 6; k++) add_row(p, k < 3 ? shear : 2 * shear, e[k], p->rows + k * r);
    for (size_t a = 0; a < r; a++) p->rows[a] += p->rows[r + a] + p->rows[2 * r + a];
    add_row(p, fem->lambda[t] * volume, e[0] + e[1] + e[2], p->rows);
  }
}

static bool factorise(const path_problem *p, ep_cholesky *factor) {
  const int r = p->elements->r;
  factor->n = 0;
  for (int a = 0; a < r; a++) {
    const double *row = p->h + (size_t)a * (size_t)r;
    if (!ep_cholesky_append(factor, row, row[a])) return false;
  }
  return true;
}

// From the station before as start. The objective falls in every step; done when a step no longer
// changes it.
static ep_status solve_station(path_problem *p, ep_cholesky *factor, double *step, double *trial,
                               double *q, ep_error *err) {
  const int r = p->elements->r;
  double value = objective(p, q);
  for (int iteration = 0; iteration < MAX_STEPS; iteration++) {
    assemble(p, q);
    if (!factorise(p, factor))
      return ep_fail(err, EP_ERR_NUMERIC, "cubature: example path at w = %g: singular system",
                     p->w);
    ep_cholesky_solve(factor, p->gradient, step);
    double length = 1, next = value;
    for (int halving = 0; halving < MAX_HALVINGS; halving++, length *= 0.5) {
      for (int a = 0; a < r; a++) trial[a] = q[a] - length * step[a];
      next = objective(p, trial);
      if (next < value) break;
    }
    if (!(next < value)) return EP_OK;
    memcpy(q, trial, (size_t)r * sizeof *q);
    if (value - next <= converged * value) return EP_OK;
    value = next;
  }
  return EP_OK; // any point on the way serves as a training pose
}

static ep_status one_path(path_problem *p, const double *pose, ep_cholesky *factor, double *work,
                          double *strain, double *out, ep_error *err) {
  const size_t r = (size_t)p->elements->r;
  for (int e = 0; e < p->elements->nt; e++) {
    double f[9];
    ep_element_gradient(p->elements, e, pose, f);
    green_strain(f, strain + 6 * (size_t)e);
  }
  for (size_t s = 0; s + 1 < EP_PATH_STATIONS; s++) {
    double *q = out + s * r;
    p->w = (double)(s + 1) / EP_PATH_STATIONS;
    const double start = s > 0 ? (double)(s + 1) / (double)s : p->w;
    for (size_t a = 0; a < r; a++) q[a] = start * (s > 0 ? q[a - r] : pose[a]);
    EP_TRY(solve_station(p, factor, work, work + r, q, err));
  }
  memcpy(out + (EP_PATH_STATIONS - 1) * r, pose, r * sizeof *out);
  return EP_OK;
}

ep_status ep_example_paths(const ep_elements *elements, const ep_basis *basis, double *out,
                           ep_error *err) {
  const size_t r = (size_t)elements->r, nt = (size_t)elements->nt;
  ep_cholesky factor = {0};
  ep_status status = EP_OK;
  double *memory = malloc((6 * nt + r * r + 9 * r) * sizeof *memory);
  if (!memory) return ep_fail(err, EP_ERR_MEMORY, "no memory for the example paths");
  EP_TRY_GOTO(status, ep_cholesky_create(elements->r, &factor, err), done);
  path_problem p = {.elements = elements, .basis = basis, .target = memory};
  p.h = memory + 6 * nt;
  p.gradient = p.h + r * r;
  p.rows = p.gradient + r;
  double *work = p.rows + 6 * r;
  for (size_t i = 0; i < (size_t)basis->examples; i++)
    EP_TRY_GOTO(status,
                one_path(&p, basis->example_q + i * r, &factor, work, memory,
                         out + i * EP_PATH_STATIONS * r, err),
                done);
done:
  ep_cholesky_free(&factor);
  free(memory);
  return status;
}
