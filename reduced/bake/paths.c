#include "reduced/bake/paths.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "reduced/bake/basis.h"
#include "reduced/bake/fem_assembly.h"
#include "reduced/bake/inertia.h"
#include "reduced/bake/vectors.h"

static const double PROXIMAL = 1e-8;  // of the stiffness at rest: see paths.h
static const double TOLERANCE = 1e-4; // relative Newton decrement; the last step squares it
static const double ARMIJO = 1e-4;
// After an indefinite stiffness the exact one is tried again below this relative decrement.
static const double NEAR = 0.05;
enum { ITERATIONS = 30, HALVINGS = 30 };

// E = (A + A^T + A^T A) / 2 with A = F - I: no cancellation at small strains.
static void green_strain(const double a[9], double e[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      e[3 * i + j] = 0.5 * (a[3 * i + j] + a[3 * j + i] + a[i] * a[j] + a[3 + i] * a[3 + j] +
                            a[6 + i] * a[6 + j]);
}

void ep_green_strains(const ep_fem *fem, const double *u, double *strain) {
  for (int e = 0; e < fem->mesh->nt; e++) {
    double a[9];
    ep_fem_displacement_gradient(fem, e, u, a);
    green_strain(a, strain + 9 * (size_t)e);
  }
}

// F, Z = E - w E(P) and the second Piola-Kirchhoff stress S = lambda tr(Z) I + 2 mu Z of a tet.
static void element_state(const ep_strain_fit *fit, int e, const double *u, double f[9],
                          double z[9], double s[9]) {
  const ep_fem *fem = fit->fem;
  ep_fem_displacement_gradient(fem, e, u, f);
  green_strain(f, z);
  for (int i = 0; i < 9; i += 4) f[i] += 1;
  for (int i = 0; i < 9; i++) z[i] -= fit->w * fit->strain[9 * (size_t)e + (size_t)i];
  const double pressure = fem->lambda[e] * (z[0] + z[4] + z[8]);
  for (int i = 0; i < 9; i++) s[i] = 2 * fem->mu[e] * z[i] + (i % 4 == 0 ? pressure : 0);
}

double ep_strain_fit_energy(const ep_strain_fit *fit, const double *u, double *g) {
  const ep_fem *fem = fit->fem;
  double sum = 0;
  if (g) memset(g, 0, 3 * (size_t)fem->mesh->nv * sizeof *g);
  for (int e = 0; e < fem->mesh->nt; e++) {
    double f[9], z[9], s[9], p[9];
    element_state(fit, e, u, f, z, s);
    sum += 0.5 * fem->volume[e] * ep_dot(9, s, z); // S : Z = lambda tr^2 + 2 mu Z : Z
    if (!g) continue;
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++)
        p[3 * a + b] = f[3 * a] * s[b] + f[3 * a + 1] * s[3 + b] + f[3 * a + 2] * s[6 + b];
    ep_fem_scatter_stress(fem, e, fem->volume[e], p, g);
  }
  return sum;
}

// dP_ab/dF_cd = d_ac S_bd + lambda F_ab F_cd + mu ((F F^T)_ac d_bd + F_ad F_cb)
static void tangent(double lambda, double mu, const double f[9], const double s[9], double h[81]) {
  for (int a = 0; a < 3; a++)
    for (int c = 0; c < 3; c++) {
      const double ff = ep_dot(3, f + 3 * a, f + 3 * c);
      for (int b = 0; b < 3; b++)
        for (int d = 0; d < 3; d++)
          h[9 * (3 * a + b) + 3 * c + d] = (a == c ? s[3 * b + d] : 0) + (b == d ? mu * ff : 0) +
                                           lambda * f[3 * a + b] * f[3 * c + d] +
                                           mu * f[3 * a + d] * f[3 * c + b];
    }
}

void ep_strain_fit_stiffness(const ep_strain_fit *fit, const double *u, int project, ep_csr *k) {
  const ep_fem *fem = fit->fem;
  memset(k->value, 0, (size_t)k->start[k->n] * sizeof *k->value);
  for (int e = 0; e < fem->mesh->nt; e++) {
    double f[9], z[9], s[9], h[81];
    element_state(fit, e, u, f, z, s);
    // Gauss-Newton: without the stress term the tangent is F^T D F, positive semidefinite
    if (project) memset(s, 0, sizeof s);
    tangent(fem->lambda[e], fem->mu[e], f, s, h);
    ep_fem_scatter_tangent(fem, e, fem->volume[e], h, k);
  }
}

// ---- Newton -------------------------------------------------------------------------------------
typedef struct newton {
  const ep_strain_fit *fit;
  const ep_csr *k0;
  ep_csr *k;
  ep_factor *factor;
  size_t n3;
  double *start, *gradient, *step, *trial, *pull, *difference; // (3n) each
} newton;

// Energy with the proximal term; where g: its gradient, zero at held unknowns.
static double total(newton *s, const double *u, double *g) {
  double energy = ep_strain_fit_energy(s->fit, u, g);
  for (size_t i = 0; i < s->n3; i++) s->difference[i] = u[i] - s->start[i];
  ep_csr_multiply(s->k0, 1, s->difference, s->pull);
  energy += 0.5 * PROXIMAL * ep_dot(s->n3, s->difference, s->pull);
  if (!g) return energy;
  ep_axpy(s->n3, PROXIMAL, s->pull, g);
  for (size_t i = 0; i < s->n3; i++)
    if (s->fit->fem->held[i]) g[i] = 0;
  return energy;
}

static ep_status factorise(newton *s, const double *u, int project, ep_error *err) {
  ep_strain_fit_stiffness(s->fit, u, project, s->k);
  ep_axpy((size_t)s->k->start[s->k->n], PROXIMAL, s->k0->value, s->k->value);
  return ep_factor_update(s->factor, s->k, err);
}

// Newton direction into step: the exact stiffness where it is positive definite, else Gauss-Newton,
// which is close to it because the strains of a path are nearly compatible (small residual).
static ep_status direction(newton *s, const double *u, ep_strain_fit_report *report,
                           ep_error *err) {
  ep_error indefinite = {0}; // expected at times: not the caller's concern
  ep_status status = EP_ERR_NUMERIC;
  if (report->projections == 0 || report->residual < NEAR) status = factorise(s, u, 0, &indefinite);
  if (status == EP_ERR_NUMERIC) {
    report->projections++;
    status = factorise(s, u, 1, err);
  } else if (status != EP_OK) {
    return ep_fail(err, status, "%s", indefinite.text);
  }
  if (status != EP_OK) return status;
  EP_TRY(ep_factor_solve(s->factor, 1, s->gradient, s->step, err));
  for (size_t i = 0; i < s->n3; i++) s->step[i] = -s->step[i];
  return EP_OK;
}

// Backtracking with the Armijo condition, loosened by the round-off of the energy. Moves u and
// returns 1, or returns 0 where no step length helps.
static int line_search(newton *s, double energy, double slope, double *u) {
  double length = 1;
  for (int i = 0; i < HALVINGS; i++, length *= 0.5) {
    memcpy(s->trial, u, s->n3 * sizeof *u);
    ep_axpy(s->n3, length, s->step, s->trial);
    if (total(s, s->trial, NULL) <= energy + ARMIJO * length * slope + 1e-14 * fabs(energy)) {
      memcpy(u, s->trial, s->n3 * sizeof *u);
      return 1;
    }
  }
  return 0;
}

// |w E(P)|_D: the potential at rest is half its square.
static double strain_scale(newton *s) {
  memset(s->trial, 0, s->n3 * sizeof *s->trial);
  return sqrt(2 * ep_strain_fit_energy(s->fit, s->trial, NULL));
}

static ep_status iterate(newton *s, double *u, ep_strain_fit_report *report, ep_error *err) {
  const double scale = strain_scale(s);
  double energy = total(s, u, s->gradient);
  while (scale > 0 && report->iterations < ITERATIONS) {
    EP_TRY(direction(s, u, report, err));
    const double slope = ep_dot(s->n3, s->gradient, s->step);
    report->iterations++;
    report->residual = sqrt(fmax(0, -slope)) / scale;
    const int moved = line_search(s, energy, slope, u);
    energy = total(s, u, s->gradient);
    if (!moved || report->residual < TOLERANCE) break;
  }
  report->energy = ep_strain_fit_energy(s->fit, u, NULL);
  return EP_OK;
}

ep_status ep_strain_fit_minimise(const ep_strain_fit *fit, ep_factor *factor, const ep_csr *k0,
                                 ep_csr *k, double *u, ep_strain_fit_report *report,
                                 ep_error *err) {
  const size_t n3 = 3 * (size_t)fit->fem->mesh->nv;
  double *block = malloc(6 * n3 * sizeof *block);
  if (!block) return ep_fail(err, EP_ERR_MEMORY, "no memory for an example's path");
  newton s = {.fit = fit, .k0 = k0, .k = k, .factor = factor, .n3 = n3, .start = block};
  s.gradient = block + n3;
  s.step = block + 2 * n3;
  s.trial = block + 3 * n3;
  s.pull = block + 4 * n3;
  s.difference = block + 5 * n3;
  memcpy(s.start, u, n3 * sizeof *u);
  *report = (ep_strain_fit_report){0};
  ep_status status = iterate(&s, u, report, err);
  free(block);
  return status;
}

// ---- samples ------------------------------------------------------------------------------------
typedef struct workspace {
  ep_csr k0, k;
  ep_factor *factor;
  double *strain, *u, *guess;
} workspace;

static void workspace_free(workspace *w) {
  ep_csr_free(&w->k0);
  ep_csr_free(&w->k);
  ep_factor_free(w->factor);
  free(w->strain);
  free(w->u);
  free(w->guess);
}

static ep_status workspace_make(const ep_fem *fem, const double *pose, workspace *w,
                                ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  w->strain = malloc(9 * (size_t)mesh->nt * sizeof *w->strain);
  w->u = calloc(3 * (size_t)mesh->nv, sizeof *w->u);
  w->guess = malloc(3 * (size_t)mesh->nv * sizeof *w->guess);
  if (!w->strain || !w->u || !w->guess)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for an example's path");
  EP_TRY(ep_fem_rest_stiffness(fem, &w->k0, err));
  EP_TRY(ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 3, &w->k, err));
  EP_TRY(ep_factor_create(&w->k0, fem->held, 1, &w->factor, err));
  ep_green_strains(fem, pose, w->strain);
  return EP_OK;
}

// Start of sample i (from 1) of `samples`: the polynomial in w through rest, the samples before
// and the pose itself, which is the last; or the sample before (w->u), whichever fits better. The
// path is smooth in w, so the prediction is close, where the exact stiffness is positive definite.
static void predict(const ep_strain_fit *fit, int i, int samples, const double *out,
                    const double *pose, workspace *w) {
  const size_t n3 = 3 * (size_t)fit->fem->mesh->nv;
  memset(w->guess, 0, n3 * sizeof *w->guess);
  for (int j = 1; j <= i; j++) { // known: 1 .. i - 1 and `samples`; rest is zero
    const int at = j < i ? j : samples;
    double c = (double)i / at;
    for (int l = 1; l <= i; l++)
      if (l != j) c *= (double)(i - (l < i ? l : samples)) / (at - (l < i ? l : samples));
    ep_axpy(n3, c, j < i ? out + (size_t)(j - 1) * n3 : pose, w->guess);
  }
  if (ep_strain_fit_energy(fit, w->guess, NULL) < ep_strain_fit_energy(fit, w->u, NULL))
    memcpy(w->u, w->guess, n3 * sizeof *w->u);
}

static ep_status one_sample(const ep_fem *fem, workspace *w, int i, int samples, const double *pose,
                            const double *out, ep_log *log, ep_error *err) {
  const double strength = (double)i / samples;
  ep_strain_fit fit = {.fem = fem, .strain = w->strain, .w = strength};
  predict(&fit, i, samples, out, pose, w);
  ep_strain_fit_report report;
  EP_TRY(ep_strain_fit_minimise(&fit, w->factor, &w->k0, &w->k, w->u, &report, err));
  if (report.residual >= TOLERANCE)
    ep_warn(log,
            "path of an example at %.2f: Newton stopped after %d iterations with residual %.1e; "
            "the sample reached so far goes into the basis",
            strength, report.iterations, report.residual);
  return EP_OK;
}

static ep_status held_samples(const ep_fem *fem, const double *pose, int samples, ep_log *log,
                              double *out, ep_error *err) {
  const size_t n3 = 3 * (size_t)fem->mesh->nv;
  workspace w = {0};
  ep_status status = EP_OK;
  if (samples < 1) return ep_fail(err, EP_ERR_ARGUMENT, "%d path samples wanted", samples);
  // A single sample is the pose: nothing to solve.
  if (samples > 1) EP_TRY_GOTO(status, workspace_make(fem, pose, &w, err), done);
  ep_progress_begin(log, "example path", samples);
  for (int i = 1; i < samples; i++) { // from rest on, each from the one before
    EP_TRY_GOTO(status, one_sample(fem, &w, i, samples, pose, out, log, err), done);
    memcpy(out + (size_t)(i - 1) * n3, w.u, n3 * sizeof *out);
    ep_progress(log, i);
  }
  memcpy(out + (size_t)(samples - 1) * n3, pose, n3 * sizeof *out);
  ep_progress_end(log);
done:
  workspace_free(&w);
  return status;
}

// Nothing held: strains do not see rigid motions; supports take them out, and each sample is fitted
// to rest again.
static ep_status free_samples(const ep_fem *fem, const double *pose, int samples, ep_log *log,
                              double *out, ep_error *err) {
  const size_t n3 = 3 * (size_t)fem->mesh->nv;
  ep_csr mass = {0};
  ep_fem supported = *fem;
  supported.held = calloc(n3, 1);
  if (!supported.held) return ep_fail(err, EP_ERR_MEMORY, "no memory for an example's path");
  ep_rigid_supports(fem->mesh, supported.held);
  ep_status status = held_samples(&supported, pose, samples, log, out, err);
  free(supported.held);
  if (status == EP_OK) status = ep_fem_scalar_mass(fem, &mass, err);
  for (int i = 0; i < samples && status == EP_OK; i++)
    status = ep_rigid_fit(fem->mesh, &mass, out + (size_t)i * n3, err);
  ep_csr_free(&mass);
  return status;
}

ep_status ep_path_samples(const ep_fem *fem, const double *pose, int samples, ep_log *log,
                          double *out, ep_error *err) {
  return ep_fem_is_free(fem) ? free_samples(fem, pose, samples, log, out, err)
                             : held_samples(fem, pose, samples, log, out, err);
}
