#include "reduced/bake/green_full.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/dense.h"
#include "reduced/bake/fem_assembly.h"
#include "reduced/bake/vectors.h"
#include "reduced/green_weights.h"

static const double TOLERANCE = 1e-8, ARMIJO = 1e-4;
enum { ITERATIONS = 200, HALVINGS = 40 };

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the full-space Green-strain potential");
}

static ep_status small_arrays(ep_green_full *full, ep_error *err) {
  const size_t p = (size_t)full->space.count, k = (size_t)full->space.k;
  full->block = calloc(4 * p + 2 * k + 3 * p * p, sizeof *full->block);
  if (!full->block) return no_memory(err);
  full->y0 = full->block;
  full->y = full->y0 + p;
  full->last = full->y + p;
  full->ones = full->last + p;
  full->w = full->ones + p;
  full->trial_w = full->w + k;
  full->factor = full->trial_w + k;
  full->system = full->factor + p * p;
  full->small = full->system + p * p;
  return EP_OK;
}

ep_status ep_green_full_create(const ep_fem *fem, const double *weight, int k, const double *poses,
                               const double *share, ep_log *log, ep_green_full *out,
                               ep_error *err) {
  *out = (ep_green_full){0};
  EP_TRY(ep_green_space_create(fem, weight, k, poses, share, log, &out->space, err));
  const size_t numbers = 6 * (size_t)fem->mesh->nt, count = (size_t)out->space.count;
  out->stress = calloc(count * numbers, sizeof *out->stress);
  const ep_status status = out->stress ? small_arrays(out, err) : no_memory(err);
  if (status != EP_OK) {
    ep_green_full_free(out);
    return status;
  }
  for (size_t i = 0; i < count; i++)
    for (size_t j = 0; j < (size_t)k; j++)
      ep_axpy(numbers, out->space.weights[j * count + i], out->space.stress + j * numbers,
              out->stress + i * numbers);
  return EP_OK;
}

void ep_green_full_free(ep_green_full *full) {
  ep_green_space_free(&full->space);
  free(full->stress);
  free(full->block);
  *full = (ep_green_full){0};
}

// The constraints count in units of the examples' mean strain energy, as in the reduced model.
static ep_green_problem problem_of(const ep_green_full *full) {
  const ep_green_space *s = &full->space;
  double unit = 0;
  for (int j = 0; j < s->k; j++) unit += s->gram[(s->k + 1) * j] / s->k;
  return (ep_green_problem){.p = s->count,
                            .k = s->k,
                            .v = s->weights,
                            .sigma = unit * full->weak.sum_to_one,
                            .nu = unit * full->weak.non_negative};
}

static const double *stress_at(const ep_green_full *full, int i, int e) {
  return full->stress + 6 * ((size_t)i * (size_t)full->space.fem->mesh->nt + (size_t)e);
}

static void expand(const double s[6], double m[9]) {
  static const int from[9] = {0, 3, 4, 3, 1, 5, 4, 5, 2};
  for (int c = 0; c < 9; c++) m[c] = s[from[c]];
}

// P = F S added with weight to the forces of tet e.
static void add_force(const ep_fem *fem, int e, const double f[9], const double s[6], double scale,
                      double *force) {
  double m[9], p[9];
  expand(s, m);
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++)
      p[3 * a + b] = f[3 * a] * m[b] + f[3 * a + 1] * m[3 + b] + f[3 * a + 2] * m[6 + b];
  ep_fem_scatter_stress(fem, e, scale, p, force);
}

// sum_i c_i S_i of tet e
static void combine(const ep_green_full *full, int e, const double *c, double scale, double s[6]) {
  memset(s, 0, 6 * sizeof *s);
  for (int i = 0; i < full->space.count; i++) ep_axpy(6, scale * c[i], stress_at(full, i, e), s);
}

// y0_i = <O_i, E(u)>
static void products(const ep_green_full *full, const double *u, double *y0) {
  const ep_fem *fem = full->space.fem;
  memset(y0, 0, (size_t)full->space.count * sizeof *y0);
  for (int e = 0; e < fem->mesh->nt; e++) {
    double strain[6];
    ep_green_strain6(fem, e, u, strain);
    for (int i = 0; i < full->space.count; i++) y0[i] += ep_inner6(stress_at(full, i, e), strain);
  }
}

double ep_green_full_energy(ep_green_full *full, const double *u, double *y, double *f, double *w) {
  const ep_fem *fem = full->space.fem;
  const ep_green_problem problem = problem_of(full);
  ep_green_solution solution = {.y = full->y,
                                .w = full->w,
                                .c = full->factor,
                                .last = full->last,
                                .a = full->ones,
                                .trial_w = full->trial_w};
  products(full, u, full->y0);
  const double energy = ep_green_weights(&problem, full->y0, &solution);
  memcpy(y, full->y, (size_t)problem.p * sizeof *y);
  if (w) memcpy(w, full->w, (size_t)problem.k * sizeof *w);
  if (f) memset(f, 0, 3 * (size_t)fem->mesh->nv * sizeof *f);
  for (int e = 0; f && e < fem->mesh->nt; e++) {
    double at[9], s[6];
    ep_fem_deformation(fem, e, u, at);
    combine(full, e, y, -2, s);
    add_force(fem, e, at, s, 1, f);
  }
  return energy;
}

// g_v . S g_w times the identity on every vertex block of tet e.
static void add_geometric(const ep_fem *fem, int e, const double s[6], ep_csr *k) {
  double m[9], h[81] = {0};
  expand(s, m);
  for (int a = 0; a < 3; a++) // dP_ab/dF_cd = delta_ac S_bd
    for (int b = 0; b < 3; b++)
      for (int d = 0; d < 3; d++) h[9 * (3 * a + b) + 3 * a + d] = m[3 * b + d];
  ep_fem_scatter_tangent(fem, e, 1, h, k);
}

// C at y, the identity without constraints.
static void constraint_system(ep_green_full *full, const double *y) {
  const ep_green_problem problem = problem_of(full);
  const size_t p = (size_t)problem.p;
  for (int j = 0; j < problem.k; j++) full->w[j] = ep_dot(p, problem.v + (size_t)j * p, y);
  ep_green_system(&problem, full->w, full->system, full->ones);
}

void ep_green_full_stiffness(ep_green_full *full, double alpha, const double *u, const double *y,
                             ep_csr *k, double *columns) {
  const ep_fem *fem = full->space.fem;
  const size_t n3 = 3 * (size_t)fem->mesh->nv, count = (size_t)full->space.count;
  memset(columns, 0, count * n3 * sizeof *columns);
  constraint_system(full, y);
  for (int e = 0; e < fem->mesh->nt; e++) {
    double at[9], s[6];
    ep_fem_deformation(fem, e, u, at);
    combine(full, e, y, -2 * alpha, s);
    add_geometric(fem, e, s, k);
    for (size_t i = 0; i < count; i++)
      add_force(fem, e, at, stress_at(full, (int)i, e), 1, columns + i * n3);
  }
  for (size_t i = 0; i < count; i++)
    for (size_t a = 0; a < n3; a++)
      if (fem->held[a]) columns[i * n3 + a] = 0;
}

// solution (count) := matrix^-1 right; the matrix is kept.
static ep_status solve_small(const ep_green_full *full, const double *matrix, double *right,
                             ep_error *err) {
  const size_t p = (size_t)full->space.count;
  double *copy = malloc(p * p * sizeof *copy);
  if (!copy) return no_memory(err);
  memcpy(copy, matrix, p * p * sizeof *copy);
  const ep_status status = ep_solve_spd((int)p, copy, 1, right, err);
  free(copy);
  return status;
}

ep_status ep_green_full_woodbury(ep_green_full *full, double alpha, ep_factor *factor,
                                 const double *columns, double *work, ep_error *err) {
  const size_t n3 = 3 * (size_t)full->space.fem->mesh->nv, p = (size_t)full->space.count;
  for (size_t i = 0; i < p; i++) // Z_i = K^-1 J_i
    EP_TRY(ep_factor_solve(factor, 1, columns + i * n3, work + i * n3, err));
  for (size_t i = 0; i < p; i++)
    for (size_t j = 0; j < p; j++)
      full->small[i * p + j] =
          0.5 * (full->system[i * p + j] / alpha - ep_dot(n3, columns + i * n3, work + j * n3) -
                 ep_dot(n3, columns + j * n3, work + i * n3));
  memset(full->last, 0, p * sizeof *full->last); // positive definite?
  return solve_small(full, full->small, full->last, err);
}

ep_status ep_green_full_solve(const ep_green_full *full, ep_factor *factor, const double *columns,
                              const double *work, const double *b, double *x, ep_error *err) {
  const size_t n3 = 3 * (size_t)full->space.fem->mesh->nv, p = (size_t)full->space.count;
  double *right = full->last;
  EP_TRY(ep_factor_solve(factor, 1, b, x, err));
  for (size_t i = 0; i < p; i++) right[i] = ep_dot(n3, columns + i * n3, x);
  EP_TRY(solve_small(full, full->small, right, err));
  for (size_t i = 0; i < p; i++) ep_axpy(n3, right[i], work + i * n3, x);
  return EP_OK;
}

ep_status ep_green_full_subtract(const ep_green_full *full, double alpha, const double *columns,
                                 const double *x, double *image, ep_error *err) {
  const size_t n3 = 3 * (size_t)full->space.fem->mesh->nv, p = (size_t)full->space.count;
  double *right = full->last;
  for (size_t i = 0; i < p; i++) right[i] = ep_dot(n3, columns + i * n3, x);
  EP_TRY(solve_small(full, full->system, right, err));
  for (size_t i = 0; i < p; i++) ep_axpy(n3, -2 * alpha * right[i], columns + i * n3, image);
  return EP_OK;
}

// ---- equilibrium -------------------------------------------------------------------------------

typedef struct newton {
  ep_green_full *full;
  double alpha;
  const double *load;
  size_t n3;
  ep_csr k;
  ep_factor *factor;
  double *y, *g, *step, *trial, *scratch, *columns, *work;
} newton;

static void newton_free(newton *s) {
  ep_csr_free(&s->k);
  ep_factor_free(s->factor);
  free(s->y);
}

static ep_status newton_make(newton *s, ep_error *err) {
  const ep_fem *fem = s->full->space.fem;
  const size_t p = (size_t)s->full->space.count;
  EP_TRY(ep_fem_rest_stiffness(fem, &s->k, err));
  EP_TRY(ep_factor_create(&s->k, fem->held, 1, &s->factor, err));
  s->y = malloc((p + s->n3 * (5 + 2 * p)) * sizeof *s->y);
  if (!s->y) return no_memory(err);
  s->g = s->y + p;
  s->step = s->g + s->n3;
  s->trial = s->step + s->n3;
  s->scratch = s->trial + s->n3;
  s->columns = s->scratch + s->n3;
  s->work = s->columns + p * s->n3;
  return EP_OK;
}

static double total(newton *s, const double *u, double *g) {
  const ep_fem *fem = s->full->space.fem;
  double energy = ep_fem_energy(fem, u) +
                  s->alpha * ep_green_full_energy(s->full, u, s->y, g ? s->scratch : NULL, NULL) -
                  ep_dot(s->n3, s->load, u);
  if (!g) return energy;
  ep_fem_force(fem, u, g);
  for (size_t i = 0; i < s->n3; i++)
    g[i] = fem->held[i] ? 0 : g[i] + s->alpha * s->scratch[i] - s->load[i];
  return energy;
}

// The exact stiffness; where it is not positive definite the projected elastic one alone, which is
// never softer.
static ep_status direction(newton *s, const double *u, ep_green_full_report *report,
                           ep_error *err) {
  const ep_fem *fem = s->full->space.fem;
  ep_error indefinite = {0};
  ep_fem_stiffness(fem, u, 0, &s->k);
  ep_green_full_stiffness(s->full, s->alpha, u, s->y, &s->k, s->columns);
  ep_status status = ep_factor_update(s->factor, &s->k, &indefinite);
  if (status == EP_OK && s->alpha == 0)
    status = ep_factor_solve(s->factor, 1, s->g, s->step, &indefinite);
  if (status == EP_OK && s->alpha > 0)
    status = ep_green_full_woodbury(s->full, s->alpha, s->factor, s->columns, s->work, &indefinite);
  if (status == EP_OK && s->alpha > 0)
    status =
        ep_green_full_solve(s->full, s->factor, s->columns, s->work, s->g, s->step, &indefinite);
  if (status == EP_ERR_NUMERIC) {
    report->projections++;
    ep_fem_stiffness(fem, u, 1, &s->k);
    EP_TRY(ep_factor_update(s->factor, &s->k, err));
    EP_TRY(ep_factor_solve(s->factor, 1, s->g, s->step, err));
  } else if (status != EP_OK) {
    return ep_fail(err, status, "%s", indefinite.text);
  }
  for (size_t i = 0; i < s->n3; i++) s->step[i] = -s->step[i];
  return EP_OK;
}

// Armijo, loosened by the round-off of the energies; 0 where no step helps.
static int line_search(newton *s, double energy, double slope, double *u) {
  double length = 1;
  const double noise = 1e-13 * (fabs(energy) + ep_fem_energy(s->full->space.fem, u));
  for (int i = 0; i < HALVINGS; i++, length *= 0.5) {
    memcpy(s->trial, u, s->n3 * sizeof *u);
    ep_axpy(s->n3, length, s->step, s->trial);
    if (total(s, s->trial, NULL) > energy + ARMIJO * length * slope + noise) continue;
    memcpy(u, s->trial, s->n3 * sizeof *u);
    return 1;
  }
  return 0;
}

static ep_status iterate(newton *s, double *u, ep_green_full_report *report, ep_error *err) {
  const double scale = sqrt(ep_dot(s->n3, s->load, s->load));
  for (;;) {
    report->energy = total(s, u, s->g);
    report->residual = sqrt(ep_dot(s->n3, s->g, s->g)) / (scale > 0 ? scale : 1);
    if (report->residual <= TOLERANCE) return EP_OK;
    if (report->iterations++ == ITERATIONS) break;
    EP_TRY(direction(s, u, report, err));
    if (!line_search(s, report->energy, ep_dot(s->n3, s->g, s->step), u)) break;
  }
  return ep_fail(err, EP_ERR_NUMERIC,
                 "equilibrium with examples: residual %.1e after %d iterations; apply the load in "
                 "parts",
                 report->residual, report->iterations);
}

ep_status ep_green_full_equilibrium(ep_green_full *full, double alpha, const double *load,
                                    double *u, ep_green_full_report *report, ep_error *err) {
  newton s = {
      .full = full, .alpha = alpha, .load = load, .n3 = 3 * (size_t)full->space.fem->mesh->nv};
  *report = (ep_green_full_report){0};
  ep_status status = newton_make(&s, err);
  if (status == EP_OK) status = iterate(&s, u, report, err);
  newton_free(&s);
  return status;
}
