#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lbspace/pose_solver.h"
#include "linalg/dense.h"

ep_pose_options ep_default_pose_options(void) {
  return (ep_pose_options){.m = 10, .iterations = 100, .tolerance = 1e-5, .held = NULL};
}

static ep_status check_options(const ep_mesh *mesh, const ep_lb *lb, const double *d,
                               const ep_pose_options *o, ep_error *err) {
  if (lb->n != mesh->nv)
    return ep_fail(err, EP_ERR_ARGUMENT, "pose: eigenfunctions of %d vertices, mesh of %d", lb->n,
                   mesh->nv);
  if (o->m < 1 || o->m > lb->m || 2 * o->m > mesh->nv)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "pose: %d coefficients asked; there are %d eigenfunctions of %d vertices", o->m,
                   lb->m, mesh->nv);
  if (o->iterations < 1 || !(o->tolerance >= 0))
    return ep_fail(err, EP_ERR_ARGUMENT, "pose: %d iterations, tolerance %g", o->iterations,
                   o->tolerance);
  for (int i = 0; i < 3 * o->m; i++)
    if (!isfinite(d[i]))
      return ep_fail(err, EP_ERR_ARGUMENT, "pose: coefficient %d is not finite", i / 3);
  return EP_OK;
}

static int any_held(const ep_mesh *mesh, const unsigned char *held) {
  for (int i = 0; held && i < mesh->nv; i++)
    if (held[i]) return 1;
  return 0;
}

static ep_status alternate(ep_pose_solver *s, const double *d, const ep_pose_options *o, double *u,
                           int *iterations, ep_error *err) {
  const double enough = o->tolerance * ep_mesh_extent(s->mesh);
  for (*iterations = 0; *iterations < o->iterations;) {
    double moved;
    EP_TRY(ep_pose_iterate(s, d, u, &moved, err));
    ++*iterations;
    if (moved <= enough) break;
  }
  return EP_OK;
}

// The pose without held vertices, started from Phi d.
static ep_status free_pose(const ep_mesh *mesh, const ep_lb *lb, const double *d,
                           const ep_pose_options *o, double *u, int *iterations, ep_error *err) {
  ep_pose_solver s;
  ep_status status = ep_pose_solver_make(mesh, lb, o->m, NULL, &s, err);
  if (status == EP_OK) {
    memset(u, 0, 3 * (size_t)mesh->nv * sizeof *u);
    ep_pose_set_coefficients(&s, d, u);
    status = alternate(&s, d, o, u, iterations, err);
  }
  ep_pose_solver_free(&s);
  return status;
}

// Move the pose rigidly so that its held vertices come to rest as well as they can: what the
// example's frame was is of no matter to an object that is fixed somewhere. One vertex, or a line
// of them, determines no rotation; then the pose is only shifted.
static ep_status seat_on_held(const ep_mesh *mesh, const unsigned char *held, double *u,
                              ep_error *err) {
  const int n = mesh->nv;
  double *y = calloc(4 * (size_t)n, sizeof *y), *weight = y + 3 * n;
  if (!y) return ep_fail(err, EP_ERR_MEMORY, "no memory for a pose of %d vertices", n);
  for (int i = 0; i < 3 * n; i++) y[i] = mesh->x[i] + u[i];
  for (int i = 0; i < n; i++) weight[i] = held[i] ? 1 : 0;
  double r[9], from[3], to[3];
  ep_error undetermined = {0};
  const ep_status status = ep_kabsch(n, y, mesh->x, weight, r, from, to, &undetermined);
  if (status != EP_OK && status != EP_ERR_NUMERIC) {
    free(y);
    return ep_fail(err, status, "%s", undetermined.text);
  }
  for (int i = 0; i < n; i++)
    for (int k = 0; k < 3; k++) {
      double turned = to[k];
      for (int l = 0; l < 3; l++) turned += r[3 * k + l] * (y[3 * i + l] - from[l]);
      u[3 * i + k] = turned - mesh->x[3 * i + k];
    }
  free(y);
  return EP_OK;
}

// From the seated free pose to one that rests at the held vertices; seated (m x 3) receives the
// coefficients of the former. What is aimed at are the coefficients of the seated pose *without*
// its held vertices: how far those were from rest is nothing the rest of the object should make up
// for (it would be torn: a bar held over half its length got inverted tets).
static ep_status held_pose(const ep_mesh *mesh, const ep_lb *lb, const ep_pose_options *o,
                           double *u, double *seated, ep_pose_report *report, ep_error *err) {
  ep_pose_solver s;
  int iterations = 0;
  double *target = malloc(3 * (size_t)o->m * sizeof *target);
  if (!target) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d coefficients", o->m);
  ep_status status = ep_pose_solver_make(mesh, lb, o->m, o->held, &s, err);
  if (status == EP_OK) {
    ep_pose_coefficients(&s, u, seated);
    for (int i = 0; i < mesh->nv; i++)
      if (o->held[i]) u[3 * i] = u[3 * i + 1] = u[3 * i + 2] = 0;
    ep_pose_coefficients(&s, u, target);
    status = alternate(&s, target, o, u, &iterations, err);
    report->iterations += iterations;
  }
  ep_pose_solver_free(&s);
  free(target);
  return status;
}

static ep_status coefficient_error(const ep_mesh *mesh, const ep_lb *lb, int m, const double *u,
                                   const double *target, double *error, ep_error *err) {
  ep_csr mass = {0};
  const ep_lb low = {.n = lb->n, .m = m, .lambda = lb->lambda, .phi = lb->phi};
  double *d = malloc(3 * (size_t)m * sizeof *d), miss = 0, size = 0;
  if (!d) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d coefficients", m);
  const ep_status status = ep_lb_mass(mesh, &mass, err);
  if (status == EP_OK) {
    ep_lb_project(&low, &mass, u, d);
    for (int i = 0; i < 3 * m; i++) {
      miss += (d[i] - target[i]) * (d[i] - target[i]);
      size += target[i] * target[i];
    }
    *error = size > 0 ? sqrt(miss / size) : sqrt(miss);
  }
  ep_csr_free(&mass);
  free(d);
  return status;
}

static ep_status find_pose(const ep_mesh *mesh, const ep_lb *lb, const double *d,
                           const ep_pose_options *o, double *target, double *u,
                           ep_pose_report *report, ep_error *err) {
  memcpy(target, d, 3 * (size_t)o->m * sizeof *target);
  EP_TRY(free_pose(mesh, lb, d, o, u, &report->iterations, err));
  if (any_held(mesh, o->held)) {
    EP_TRY(seat_on_held(mesh, o->held, u, err));
    EP_TRY(held_pose(mesh, lb, o, u, target, report, err));
  }
  EP_TRY(coefficient_error(mesh, lb, o->m, u, target, &report->coefficient_error, err));
  double *x = malloc(3 * (size_t)mesh->nv * sizeof *x);
  if (!x) return ep_fail(err, EP_ERR_MEMORY, "no memory for a pose of %d vertices", mesh->nv);
  for (int i = 0; i < 3 * mesh->nv; i++) x[i] = mesh->x[i] + u[i];
  report->inverted_tets = ep_mesh_inverted(mesh, x, &report->worst_volume_ratio);
  free(x);
  return EP_OK;
}

ep_status ep_lb_pose(const ep_mesh *mesh, const ep_lb *lb, const double *d,
                     const ep_pose_options *options, double *u, ep_pose_report *report,
                     ep_error *err) {
  EP_TRY(check_options(mesh, lb, d, options, err));
  ep_pose_report unused;
  if (!report) report = &unused;
  memset(report, 0, sizeof *report);
  double *target = malloc(3 * (size_t)options->m * sizeof *target);
  if (!target) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d coefficients", options->m);
  const ep_status status = find_pose(mesh, lb, d, options, target, u, report, err);
  free(target);
  return status;
}
