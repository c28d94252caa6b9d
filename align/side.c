#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"
#include "mesh/topology.h"

// Regions are blurred over this share of V^(1/3), so that their edges pull on what is near.
static const double REGION_BLUR = 0.1;

void ep_side_free(ep_side *side) {
  if (!side) return;
  free(side->x);
  free(side->phi);
  free(side->mphi);
  free(side->share);
  free(side->indicator);
  free(side->region);
  free(side->skin);
  free(side->mark);
  free(side->mark_x);
  free(side->mark_near);
  free(side->mark_gram);
  ep_csr_free(&side->stiffness);
  memset(side, 0, sizeof *side);
}

static ep_status no_memory(const ep_side *side, ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory to map %s (%d vertices)", side->shape->mesh->name,
                 side->n);
}

int ep_components(const ep_mesh *mesh) {
  int *parent = malloc(((size_t)mesh->nv + 1) * sizeof *parent);
  if (!parent) return -1;
  const int parts = ep_mesh_join_tets(mesh, parent);
  free(parent);
  return parts;
}

static void set_positions(ep_side *side) {
  const ep_mesh *mesh = side->shape->mesh;
  ep_mesh_centroid(mesh, mesh->x, side->centre);
  ep_mesh_vertex_volumes(mesh, side->share);
  double radius2 = 0;
  for (int i = 0; i < side->n; i++) {
    side->share[i] /= side->shape->lb->volume;
    double r2 = 0;
    for (int c = 0; c < 3; c++) {
      const double x = (mesh->x[3 * i + c] - side->centre[c]) / side->length;
      side->x[3 * i + c] = x;
      r2 += x * x;
    }
    radius2 += side->share[i] * r2;
  }
  side->radius = sqrt(radius2);
}

static void set_functions(ep_side *side) {
  const double volume = side->shape->lb->volume, scale = sqrt(volume);
  for (int f = 0; f < side->k; f++)
    for (int i = 0; i < side->n; i++)
      side->phi[(size_t)i * side->k + f] = scale * side->shape->lb->phi[(size_t)f * side->n + i];
  ep_csr_multiply(side->shape->mass, side->k, side->phi, side->mphi);
  for (size_t i = 0; i < (size_t)side->n * side->k; i++) side->mphi[i] /= volume;
}

static ep_status set_skin(ep_side *side, ep_error *err) {
  int count, *triangle;
  EP_TRY(ep_mesh_surface(side->shape->mesh, &count, &triangle, err));
  for (int i = 0; i < 3 * count; i++) side->skin[triangle[i]] = 1;
  free(triangle);
  return EP_OK;
}

ep_status ep_side_make(const ep_shape *shape, int k, ep_side *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  out->shape = shape;
  out->n = shape->mesh->nv;
  out->k = k;
  out->length = cbrt(shape->lb->volume);
  const size_t n = (size_t)out->n;
  out->x = malloc(3 * n * sizeof(double));
  out->phi = malloc(n * k * sizeof(double));
  out->mphi = malloc(n * k * sizeof(double));
  out->share = malloc(n * sizeof(double));
  ep_status status = EP_OK;
  out->skin = calloc(n, sizeof(double));
  if (!out->x || !out->phi || !out->mphi || !out->share || !out->skin)
    status = no_memory(out, err);
  else
    status = ep_lb_stiffness(shape->mesh, &out->stiffness, err);
  if (status == EP_OK) status = set_skin(out, err);
  if (status != EP_OK) {
    ep_side_free(out);
    return status;
  }
  set_positions(out);
  set_functions(out);
  return EP_OK;
}

// y = (M + t K) x for `width` interleaved columns; work as large as y.
static void blur_operator(const ep_side *side, double t, int width, const double *x, double *y,
                          double *work) {
  ep_csr_multiply(side->shape->mass, width, x, y);
  ep_csr_multiply(&side->stiffness, width, x, work);
  for (size_t i = 0; i < (size_t)side->n * width; i++) y[i] += t * work[i];
}

static void column_dots(int n, int width, const double *a, const double *b, double *dot) {
  for (int c = 0; c < width; c++) dot[c] = 0;
  for (int i = 0; i < n; i++)
    for (int c = 0; c < width; c++) dot[c] += a[(size_t)i * width + c] * b[(size_t)i * width + c];
}

// Conjugate gradients with Jacobi on all columns at once, each with its own steps; x: start,
// result. buffer: 5 n width + 4 width doubles. The operator is definite and well conditioned
// (mass).
static void blur_solve(const ep_side *side, double t, int width, const double *b, double *x,
                       double *buffer) {
  enum { ITERATIONS = 300 };
  const int n = side->n;
  const size_t all = (size_t)n * width;
  double *r = buffer, *z = r + all, *p = z + all, *ap = p + all, *work = ap + all;
  double *rho = work + all, *rho_new = rho + width, *pap = rho_new + width, *stop = pap + width;
  const ep_csr *mass = side->shape->mass, *k = &side->stiffness;
  blur_operator(side, t, width, x, r, work);
  for (size_t i = 0; i < all; i++) r[i] = b[i] - r[i];
  column_dots(n, width, b, b, stop);
  for (size_t i = 0; i < all; i++) p[i] = 0;
  for (int c = 0; c < width; c++) rho[c] = 0;
  for (int it = 0; it < ITERATIONS; it++) {
    column_dots(n, width, r, r, pap);
    bool done = true;
    for (int c = 0; c < width; c++) done = done && pap[c] <= 1e-20 * stop[c];
    if (done) return;
    for (int i = 0; i < n; i++) {
      const int d = ep_csr_find(mass, i, i);
      const double inverse = 1 / (mass->value[d] + t * k->value[ep_csr_find(k, i, i)]);
      for (int c = 0; c < width; c++) z[(size_t)i * width + c] = inverse * r[(size_t)i * width + c];
    }
    column_dots(n, width, r, z, rho_new);
    for (int i = 0; i < n; i++)
      for (int c = 0; c < width; c++) {
        const size_t at = (size_t)i * width + c;
        p[at] = z[at] + (rho[c] > 0 ? rho_new[c] / rho[c] : 0) * p[at];
      }
    blur_operator(side, t, width, p, ap, work);
    column_dots(n, width, p, ap, pap);
    for (int i = 0; i < n; i++)
      for (int c = 0; c < width; c++) {
        const size_t at = (size_t)i * width + c;
        const double alpha = pap[c] > 0 ? rho_new[c] / pap[c] : 0;
        x[at] += alpha * p[at];
        r[at] -= alpha * ap[at];
      }
    memcpy(rho, rho_new, (size_t)width * sizeof(double));
  }
}

ep_status ep_side_blur(const ep_side *side, double width, int columns, double *f, ep_error *err) {
  const size_t all = (size_t)side->n * columns;
  const double t = width * width * side->length * side->length;
  double *buffer = malloc((6 * all + 4 * (size_t)columns) * sizeof *buffer);
  if (!buffer) return no_memory(side, err);
  double *b = buffer + 5 * all + 4 * (size_t)columns;
  ep_csr_multiply(side->shape->mass, columns, f, b);
  blur_solve(side, t, columns, b, f, buffer);
  free(buffer);
  return EP_OK;
}

ep_status ep_side_regions(ep_side *side, const ep_regions *regions, int column, ep_error *err) {
  const int count = regions->count;
  const size_t all = (size_t)side->n * count;
  side->indicator = calloc(all, sizeof(double));
  side->region = calloc(all, sizeof(double));
  if (!side->indicator || !side->region) return no_memory(side, err);
  for (int g = 0; g < count; g++) {
    const int at = g * regions->shapes + column;
    for (int i = regions->start[at]; i < regions->start[at + 1]; i++)
      side->indicator[(size_t)regions->vertex[i] * count + g] = 1;
  }
  side->regions = count;
  memcpy(side->region, side->indicator, all * sizeof(double));
  return ep_side_blur(side, REGION_BLUR, count, side->region, err);
}
