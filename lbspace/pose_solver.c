// LB-ARAP. Minimise sum_e V_e |F_e(u) - R_e|^2 over displacements u and rotations R_e under
// A u = d, A = Phi^T M (the m low coefficients), by turns:
//   local:  R_e = the rotation nearest to F_e;
//   global: K u0 = b, b_i = sum_e V_e (R_e - I) g_i, then u = u0 + K^-1 A^T mu with A u = d.
// Nothing held: K^-1 A^T = Phi Lambda^-1 (the phi are both K- and M-orthogonal), so the second
// half is to overwrite the coefficients: u = u0 + Phi (d - A u0). K's constants are fixed by a zero
// mean of each component.
// Vertices held: u vanishes there, K becomes K_ff, W = K_ff^-1 A_f^T is computed once by m solves,
// and (A W + e diag(1/lambda)) mu = d - A u0. The small softness e makes the coefficients springs
// instead of constraints: a demand that the held vertices rule out (functions that hardly move
// anything free) is given up where it would tear the shape. Each half still minimises one fixed
// energy, sum V |F - R|^2 + sum_j lambda_j/e |A u - d|_j^2, so the alternation converges.
#include "lbspace/pose_solver.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/dense.h"

// e above, relative: without held vertices the error that is left would be e/(1+e) of what ARAP
// alone wants otherwise.
static const double softness = 0.01;

static ep_status no_memory(const ep_mesh *mesh, ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for a pose of %d vertices", mesh->nv);
}

static ep_status allocate(ep_pose_solver *s, ep_error *err) {
  const size_t n = (size_t)s->mesh->nv, nt = (size_t)s->mesh->nt, m = (size_t)s->m;
  s->gradient = malloc(12 * nt * sizeof *s->gradient);
  s->volume = malloc(nt * sizeof *s->volume);
  s->vertex_volume = malloc(n * sizeof *s->vertex_volume);
  s->component = malloc(n * sizeof *s->component);
  s->mphi = malloc((m + 1) * n * sizeof *s->mphi);
  s->rhs = malloc(3 * n * sizeof *s->rhs);
  s->next = malloc(3 * n * sizeof *s->next);
  const int all =
      s->gradient && s->volume && s->vertex_volume && s->component && s->mphi && s->rhs && s->next;
  return all ? EP_OK : no_memory(s->mesh, err);
}

// What the factor holds: the held vertices, or the lowest vertex of each component.
static ep_status vertices_to_fix(const ep_pose_solver *s, const unsigned char *held,
                                 unsigned char *fixed, ep_error *err) {
  const ep_mesh *mesh = s->mesh;
  int seen = 0;
  for (int i = 0; i < mesh->nv; i++) {
    fixed[i] = held ? held[i] != 0 : s->component[i] == seen;
    if (!held && fixed[i]) seen++;
  }
  for (int c = 0; held && c < s->components; c++) {
    int any = 0;
    for (int i = 0; i < mesh->nv && !any; i++) any = fixed[i] && s->component[i] == c;
    if (!any)
      return ep_fail(err, EP_ERR_UNSUPPORTED,
                     "%s: component %d of %d has no held vertex; hold some there, or none at all",
                     mesh->name, c, s->components);
  }
  return EP_OK;
}

static ep_status factorise(ep_pose_solver *s, const unsigned char *held, ep_error *err) {
  ep_csr k = {0};
  unsigned char *fixed = malloc((size_t)s->mesh->nv);
  if (!fixed) return no_memory(s->mesh, err);
  ep_status status = vertices_to_fix(s, held, fixed, err);
  if (status == EP_OK) status = ep_lb_stiffness(s->mesh, &k, err);
  if (status == EP_OK) status = ep_factor_create(&k, fixed, 1, &s->factor, err);
  ep_csr_free(&k);
  free(fixed);
  return status;
}

static ep_status weigh_functions(ep_pose_solver *s, ep_error *err) {
  ep_csr mass;
  EP_TRY(ep_lb_mass(s->mesh, &mass, err));
  for (int j = 0; j < s->m; j++) {
    const size_t row = (size_t)j * (size_t)s->mesh->nv;
    ep_csr_multiply(&mass, 1, s->phi + row, s->mphi + row);
  }
  ep_csr_free(&mass);
  return EP_OK;
}

// Rows K_ff^-1 A_j^T, and the inverse of A W + softness.
static ep_status prepare_responses(ep_pose_solver *s, const double *lambda, ep_error *err) {
  const size_t n = (size_t)s->mesh->nv, m = (size_t)s->m;
  if (m == 0) return EP_OK;
  s->response = malloc(m * n * sizeof *s->response);
  s->compliance = calloc(m * m, sizeof *s->compliance);
  double *gram = malloc(m * m * sizeof *gram);
  ep_status status = s->response && s->compliance && gram ? EP_OK : no_memory(s->mesh, err);
  for (size_t j = 0; j < m && status == EP_OK; j++)
    status = ep_factor_solve(s->factor, 1, s->mphi + j * n, s->response + j * n, err);
  if (status == EP_OK) {
    ep_gemm_nt(s->m, s->m, s->mesh->nv, s->mphi, s->response, gram);
    for (size_t j = 0; j < m; j++) {
      gram[j * m + j] += softness / lambda[j];
      s->compliance[j * m + j] = 1;
    }
    status = ep_solve_spd(s->m, gram, s->m, s->compliance, err);
  }
  free(gram);
  return status;
}

ep_status ep_pose_solver_make(const ep_mesh *mesh, const ep_lb *lb, int m,
                              const unsigned char *held, ep_pose_solver *s, ep_error *err) {
  *s = (ep_pose_solver){
      .mesh = mesh, .m = m, .held = held != NULL, .phi = lb->phi, .lambda = lb->lambda};
  EP_TRY(allocate(s, err));
  for (int e = 0; e < mesh->nt; e++)
    s->volume[e] = ep_tet_gradients(mesh, e, s->gradient + 12 * (size_t)e);
  ep_mesh_vertex_volumes(mesh, s->vertex_volume);
  EP_TRY(ep_lb_components(mesh, &s->components, s->component, err));
  EP_TRY(weigh_functions(s, err));
  EP_TRY(factorise(s, held, err));
  return held ? prepare_responses(s, lb->lambda, err) : EP_OK;
}

void ep_pose_solver_free(ep_pose_solver *s) {
  free(s->gradient);
  free(s->volume);
  free(s->vertex_volume);
  free(s->component);
  free(s->mphi);
  free(s->rhs);
  free(s->next);
  free(s->response);
  free(s->compliance);
  ep_factor_free(s->factor);
  memset(s, 0, sizeof *s);
}

void ep_pose_coefficients(const ep_pose_solver *s, const double *u, double *d) {
  if (s->m == 0) return;
  ep_gemm(s->m, 3, s->mesh->nv, s->mphi, u, d);
}

// u += sum_j row_j mu_j, mu (m x 3).
static void add_rows(const ep_pose_solver *s, const double *rows, const double *mu, double *u) {
  const int n = s->mesh->nv;
  for (int j = 0; j < s->m; j++) {
    const double *row = rows + (size_t)j * (size_t)n;
    for (int i = 0; i < n; i++)
      for (int k = 0; k < 3; k++) u[3 * i + k] += row[i] * mu[3 * j + k];
  }
}

void ep_pose_set_coefficients(ep_pose_solver *s, const double *d, double *u) {
  double *miss = s->rhs, *mu = miss + 3 * s->m; // rhs is free here; m < n / 2 is checked by callers
  if (s->m == 0) return;
  ep_pose_coefficients(s, u, miss);
  for (int i = 0; i < 3 * s->m; i++) miss[i] = (d ? d[i] : 0) - miss[i];
  if (!s->held) {
    add_rows(s, s->phi, miss, u);
    return;
  }
  ep_gemm(s->m, 3, s->m, s->compliance, miss, mu);
  add_rows(s, s->response, mu, u);
}

// b_i = sum_e V_e (R_e - I) g_i with R_e the rotation nearest to F_e = I + sum_i u_i g_i^T.
static void local_step(const ep_pose_solver *s, const double *u, double *b) {
  const ep_mesh *mesh = s->mesh;
  memset(b, 0, 3 * (size_t)mesh->nv * sizeof *b);
  for (int e = 0; e < mesh->nt; e++) {
    const double *g = s->gradient + 12 * (size_t)e;
    const int *v = mesh->tet + 4 * e;
    double f[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, r[9];
    for (int i = 0; i < 4; i++)
      for (int k = 0; k < 9; k++) f[k] += u[3 * v[i] + k / 3] * g[3 * i + k % 3];
    ep_rotation_of(f, r);
    r[0] -= 1;
    r[4] -= 1;
    r[8] -= 1;
    for (int i = 0; i < 4; i++)
      for (int k = 0; k < 3; k++)
        b[3 * v[i] + k] += s->volume[e] * (r[3 * k] * g[3 * i] + r[3 * k + 1] * g[3 * i + 1] +
                                           r[3 * k + 2] * g[3 * i + 2]);
  }
}

// Take the volume-weighted mean of each component out of u.
static ep_status remove_means(const ep_pose_solver *s, double *u, ep_error *err) {
  double *sum = calloc(4 * (size_t)s->components, sizeof *sum);
  if (!sum) return no_memory(s->mesh, err);
  for (int i = 0; i < s->mesh->nv; i++) {
    double *c = sum + 4 * s->component[i];
    for (int k = 0; k < 3; k++) c[k] += s->vertex_volume[i] * u[3 * i + k];
    c[3] += s->vertex_volume[i];
  }
  for (int i = 0; i < s->mesh->nv; i++) {
    const double *c = sum + 4 * s->component[i];
    for (int k = 0; k < 3; k++) u[3 * i + k] -= c[k] / c[3];
  }
  free(sum);
  return EP_OK;
}

ep_status ep_pose_iterate(ep_pose_solver *s, const double *d, double *u, double *moved,
                          ep_error *err) {
  const int n = s->mesh->nv;
  local_step(s, u, s->rhs);
  EP_TRY(ep_factor_solve(s->factor, 3, s->rhs, s->next, err));
  if (!s->held) EP_TRY(remove_means(s, s->next, err));
  ep_pose_set_coefficients(s, d, s->next);
  double largest = 0;
  for (int i = 0; i < n; i++) {
    double square = 0;
    for (int k = 0; k < 3; k++) {
      const double step = s->next[3 * i + k] - u[3 * i + k];
      square += step * step;
    }
    if (!(square <= largest)) largest = square; // a NaN stays
  }
  memcpy(u, s->next, 3 * (size_t)n * sizeof *u);
  *moved = sqrt(largest);
  if (!isfinite(largest))
    return ep_fail(err, EP_ERR_NUMERIC, "pose of %s: positions are no longer finite",
                   s->mesh->name);
  return EP_OK;
}

ep_status ep_pose_solve(ep_pose_solver *s, const double *b, double *x, ep_error *err) {
  EP_TRY(ep_factor_solve(s->factor, 3, b, x, err));
  if (!s->held) EP_TRY(remove_means(s, x, err));
  ep_pose_set_coefficients(s, NULL, x);
  return EP_OK;
}

double ep_pose_spring_energy(const ep_pose_solver *s, const double *u, double *d) {
  double sum = 0;
  if (!s->held) return 0;
  ep_pose_coefficients(s, u, d);
  for (int i = 0; i < 3 * s->m; i++) sum += s->lambda[i / 3] / softness * d[i] * d[i];
  return sum;
}
