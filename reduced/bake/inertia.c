#include "reduced/bake/inertia.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/dense.h"
#include "reduced/bake/vectors.h"

double ep_inertia_center(const ep_mesh *mesh, const ep_csr *mass, double center[3]) {
  double total = 0;
  center[0] = center[1] = center[2] = 0;
  for (int i = 0; i < mesh->nv; i++) {
    double row = 0;
    for (int at = mass->start[i]; at < mass->start[i + 1]; at++) row += mass->value[at];
    total += row;
    for (int a = 0; a < 3; a++) center[a] += row * mesh->x[3 * (size_t)i + (size_t)a];
  }
  for (int a = 0; a < 3; a++) center[a] /= total;
  return total;
}

// ---- rigid modes -----------------------------------------------------------------------------

static void fill_modes(const ep_mesh *mesh, const double center[3], double *modes) {
  const size_t n3 = 3 * (size_t)mesh->nv;
  memset(modes, 0, 6 * n3 * sizeof *modes);
  for (size_t v = 0; v < (size_t)mesh->nv; v++)
    for (size_t k = 0; k < 3; k++) {
      const size_t i = (k + 1) % 3, j = (k + 2) % 3;
      modes[k * n3 + 3 * v + k] = 1;
      modes[(3 + k) * n3 + 3 * v + j] = mesh->x[3 * v + i] - center[i]; // e_k x y
      modes[(3 + k) * n3 + 3 * v + i] = center[j] - mesh->x[3 * v + j];
    }
}

ep_status ep_rigid_modes(const ep_mesh *mesh, const ep_csr *mass, double *modes, double *mass_modes,
                         ep_error *err) {
  const size_t n3 = 3 * (size_t)mesh->nv;
  double center[3];
  ep_inertia_center(mesh, mass, center);
  fill_modes(mesh, center, modes);
  for (size_t k = 0; k < 6; k++) { // Gram-Schmidt, twice against round-off
    double *row = modes + k * n3, *image = mass_modes + k * n3;
    ep_csr_multiply(mass, 3, row, image);
    const double whole = ep_dot(n3, row, image);
    for (int pass = 0; pass < 2; pass++)
      for (size_t i = 0; i < k; i++)
        ep_axpy(n3, -ep_dot(n3, mass_modes + i * n3, row), modes + i * n3, row);
    ep_csr_multiply(mass, 3, row, image);
    const double square = ep_dot(n3, row, image);
    if (!(square > 1e-20 * whole))
      return ep_fail(err, EP_ERR_MESH, "%s: all vertices lie on a line; nothing can turn it",
                     mesh->name);
    for (size_t i = 0; i < n3; i++) row[i] /= sqrt(square), image[i] /= sqrt(square);
  }
  return EP_OK;
}

static void difference(const ep_mesh *mesh, int from, int to, double d[3]) {
  for (int a = 0; a < 3; a++)
    d[a] = mesh->x[3 * (size_t)to + (size_t)a] - mesh->x[3 * (size_t)from + (size_t)a];
}

static int largest_of(const double d[3]) {
  int best = 0;
  for (int a = 1; a < 3; a++)
    if (fabs(d[a]) > fabs(d[best])) best = a;
  return best;
}

// Vertex v held in all, w (far from v) across the main axis of d = w - v: only turning about d is
// left, which moves the vertex z farthest from that line along d x (z - v).
void ep_rigid_supports(const ep_mesh *mesh, unsigned char *held) {
  double d[3], e[3], moved[3], best[3] = {0}, far = -1;
  int second = 0, third = 0;
  for (int v = 0; v < mesh->nv; v++) {
    difference(mesh, 0, v, e);
    if (ep_dot(3, e, e) > far) far = ep_dot(3, e, e), second = v;
  }
  difference(mesh, 0, second, d);
  for (int v = 0; v < mesh->nv; v++) {
    difference(mesh, 0, v, e);
    for (int a = 0; a < 3; a++)
      moved[a] = d[(a + 1) % 3] * e[(a + 2) % 3] - d[(a + 2) % 3] * e[(a + 1) % 3];
    if (ep_dot(3, moved, moved) <= ep_dot(3, best, best)) continue;
    memcpy(best, moved, sizeof best);
    third = v;
  }
  for (int a = 0; a < 3; a++) {
    held[a] = 1;
    if (a != largest_of(d)) held[3 * (size_t)second + (size_t)a] = 1;
  }
  held[3 * (size_t)third + (size_t)largest_of(best)] = 1;
}

// ---- best fit --------------------------------------------------------------------------------

ep_status ep_rigid_fit(const ep_mesh *mesh, const ep_csr *mass, double *u, ep_error *err) {
  const size_t n = (size_t)mesh->nv;
  double *image = malloc(3 * n * sizeof *image), center[3], moved[3] = {0}, a[9] = {0}, r[9];
  if (!image) return ep_fail(err, EP_ERR_MEMORY, "no memory for a rigid fit");
  const double total = ep_inertia_center(mesh, mass, center);
  for (size_t i = 0; i < 3 * n; i++) u[i] += mesh->x[i]; // positions from here on
  ep_csr_multiply(mass, 3, u, image);
  for (size_t i = 0; i < 3 * n; i++) moved[i % 3] += image[i] / total;
  for (size_t v = 0; v < n; v++) // sum m (X - c) y^T; the centroid of y drops out
    for (size_t i = 0; i < 3; i++)
      for (size_t j = 0; j < 3; j++)
        a[3 * i + j] += (mesh->x[3 * v + i] - center[i]) * image[3 * v + j];
  free(image);
  ep_rotation_of(a, r);
  for (size_t v = 0; v < n; v++) {
    double y[3];
    for (size_t i = 0; i < 3; i++) y[i] = u[3 * v + i] - moved[i];
    for (size_t i = 0; i < 3; i++)
      u[3 * v + i] = center[i] + ep_dot(3, r + 3 * i, y) - mesh->x[3 * v + i];
  }
  return EP_OK;
}

// ---- inertia sums ----------------------------------------------------------------------------

static const int first[6] = {0, 1, 2, 1, 2, 0}, second[6] = {0, 1, 2, 2, 0, 1};

// One axis of each row of modes: out (r x n).
static void take_axis(int r, size_t n, int axis, const double *rows, double *out) {
  for (size_t a = 0; a < (size_t)r; a++)
    for (size_t v = 0; v < n; v++) out[a * n + v] = rows[3 * (a * n + v) + (size_t)axis];
}

typedef struct sums {
  int r;
  size_t n;
  const double *u;
  double *mu;           // (r x 3n) rows M u
  double *left, *right; // (r x n)
  double *gram;         // (r x r)
} sums;

// gram_ab = sum m U_a,i U_b,j for axes i, j
static void pair_of_axes(sums *s, int i, int j) {
  take_axis(s->r, s->n, i, s->u, s->left);
  take_axis(s->r, s->n, j, s->mu, s->right);
  ep_gemm_nt(s->r, s->r, (int)s->n, s->left, s->right, s->gram);
}

static void second_order(sums *s, double *s2, double *h) {
  const size_t r = (size_t)s->r, pairs = r * (r + 1) / 2;
  for (size_t k = 0; k < 6; k++) {
    pair_of_axes(s, first[k], second[k]);
    for (size_t a = 0, at = 0; a < r; a++)
      for (size_t b = 0; b <= a; b++, at++) {
        const double ab = s->gram[a * r + b], ba = s->gram[b * r + a];
        s2[k * pairs + at] = 0.5 * (ab + ba);
        // (U_a x U_b) along the third axis: (y, z) gives x, and so on
        if (k >= 3) h[(k - 3) * pairs + at] = a == b ? 0 : ab - ba;
      }
  }
}

static void first_order(const ep_mesh *mesh, const double center[3], const sums *s, double *s1) {
  const size_t r = (size_t)s->r;
  for (size_t a = 0; a < r; a++)
    for (size_t k = 0; k < 6; k++) {
      const size_t i = (size_t)first[k], j = (size_t)second[k];
      double sum = 0;
      for (size_t v = 0; v < s->n; v++) {
        const double *x = mesh->x + 3 * v, *mu = s->mu + 3 * (a * s->n + v);
        sum += (x[i] - center[i]) * mu[j] + (x[j] - center[j]) * mu[i];
      }
      s1[k * r + a] = sum;
    }
}

static void zeroth_order(const ep_mesh *mesh, const ep_csr *mass, const double center[3],
                         double *s0) {
  for (int k = 0; k < 6; k++) s0[k] = 0;
  for (int v = 0; v < mesh->nv; v++)
    for (int at = mass->start[v]; at < mass->start[v + 1]; at++) {
      const double *x = mesh->x + 3 * (size_t)v, *y = mesh->x + 3 * (size_t)mass->column[at];
      for (int k = 0; k < 6; k++)
        s0[k] +=
            mass->value[at] * (x[first[k]] - center[first[k]]) * (y[second[k]] - center[second[k]]);
    }
}

ep_status ep_inertia_sums(const ep_mesh *mesh, const ep_csr *mass, int r, const double *u,
                          double *total, double *origin, double *s0, double *s1, double *s2,
                          double *h, ep_error *err) {
  const size_t n = (size_t)mesh->nv, rows = (size_t)r;
  double *block = malloc((5 * rows * n + rows * rows) * sizeof *block);
  if (!block) return ep_fail(err, EP_ERR_MEMORY, "no memory for the inertia of %d modes", r);
  sums s = {.r = r, .n = n, .u = u, .mu = block, .left = block + 3 * rows * n};
  s.right = s.left + rows * n;
  s.gram = s.right + rows * n;
  for (size_t a = 0; a < rows; a++) ep_csr_multiply(mass, 3, u + 3 * a * n, s.mu + 3 * a * n);
  *total = ep_inertia_center(mesh, mass, origin);
  zeroth_order(mesh, mass, origin, s0);
  first_order(mesh, origin, &s, s1);
  second_order(&s, s2, h);
  free(block);
  return EP_OK;
}
