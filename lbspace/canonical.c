// An eigenfunction is known up to its sign only, and several of one eigenvalue up to a rotation
// among themselves; which of them a solver returns depends on round-off. Here they are chosen by
// the geometry: each group of near-equal eigenvalues is shown a fixed series of probe functions of
// the position about the centroid (x, y, z, then their products, then plane waves), and its first
// function becomes the group's share of the first probe that it can represent at all, the second
// that of the next one in what is left, and so on. Signs follow: <phi, probe>_M > 0. The order of
// vertices and tets does not enter.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lbspace/private.h"
#include "linalg/dense.h"

// Eigenvalues closer than this (relatively) count as equal. Rotating within such a group leaves
// residuals of this size, which is why it is not larger.
static const double near_multiple = 1e-6;
// A probe decides where at least this share of its norm (without its mean) lies in what is left
// of the group: far above the error of the eigenfunctions, which is about 1e-8.
static const double probe_share = 1e-2;

enum { MONOMIALS = 19, WAVES = 48, PROBES = MONOMIALS + WAVES };

int ep_lb_group_end(int count, const double *lambda, int first) {
  int end = first + 1;
  while (end < count && lambda[end] - lambda[end - 1] <= near_multiple * fabs(lambda[end])) end++;
  return end;
}

// Exponents of x, y, z of the monomials of degree 1 to 3.
static void exponents(int which, int power[3]) {
  for (int degree = 1, at = 0; degree <= 3; degree++)
    for (int a = degree; a >= 0; a--)
      for (int b = degree - a; b >= 0; b--, at++)
        if (at == which) {
          power[0] = a;
          power[1] = b;
          power[2] = degree - a - b;
          return;
        }
}

// Probe number `which` at p, a position about the centroid over the cube root of the volume.
static double probe_at(int which, const double p[3]) {
  if (which < MONOMIALS) {
    int power[3] = {0, 0, 0};
    exponents(which, power);
    double value = 1;
    for (int k = 0; k < 3; k++)
      for (int i = 0; i < power[k]; i++) value *= p[k];
    return value;
  }
  // Directions and lengths by irrational steps, so that no symmetry is met; waves grow shorter.
  const double w = which - MONOMIALS;
  const double turn = 2.39996322972865332 * w, z = fmod(0.618033988749894848 * (w + 1), 1.0);
  const double r = sqrt(1 - z * z), length = 2 + 0.35 * w;
  return sin(length * (r * cos(turn) * p[0] + r * sin(turn) * p[1] + z * p[2]) + 0.7 + w);
}

// share (count x PROBES): <phi_i, probe> / |probe - mean|.
static ep_status probe_shares(const ep_mesh *mesh, const ep_csr *mass, int count, const double *phi,
                              double *share, ep_error *err) {
  const size_t n = (size_t)mesh->nv;
  double *probe = malloc(2 * n * sizeof *probe), *weighted = probe + n, centroid[3];
  if (!probe) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d vertices", mesh->nv);
  const double volume = ep_mesh_volume(mesh), scale = 1 / cbrt(volume);
  ep_mesh_centroid(mesh, mesh->x, centroid);
  for (int q = 0; q < PROBES; q++) {
    for (size_t i = 0; i < n; i++) {
      double p[3];
      for (int k = 0; k < 3; k++) p[k] = scale * (mesh->x[3 * i + (size_t)k] - centroid[k]);
      probe[i] = probe_at(q, p);
    }
    ep_csr_multiply(mass, 1, probe, weighted);
    double square = 0, mean = 0;
    for (size_t i = 0; i < n; i++) {
      square += probe[i] * weighted[i];
      mean += weighted[i];
    }
    const double norm = sqrt(fmax(square - mean * mean / volume, 0));
    for (int j = 0; j < count; j++) {
      double sum = 0;
      for (size_t i = 0; i < n; i++) sum += phi[(size_t)j * n + i] * weighted[i];
      share[j * PROBES + q] = norm > 0 ? sum / norm : 0;
    }
  }
  free(probe);
  return EP_OK;
}

// v (size) minus its parts along the first `rows` rows of q; returns the norm of what is left.
static double remove_rows(int size, int rows, const double *q, double *v) {
  for (int pass = 0; pass < 2; pass++)
    for (int r = 0; r < rows; r++) {
      double c = 0;
      for (int i = 0; i < size; i++) c += q[r * size + i] * v[i];
      for (int i = 0; i < size; i++) v[i] -= c * q[r * size + i];
    }
  double square = 0;
  for (int i = 0; i < size; i++) square += v[i] * v[i];
  return sqrt(square);
}

// Next row of q: what the first deciding probe leaves; failing all probes (a function that none of
// them sees) the coordinate axis that has most left, which is at least deterministic.
static void choose_row(int size, int row, const double *share, double *q) {
  double *v = q + row * size, norm = 0;
  for (int p = 0; p < PROBES; p++) {
    for (int i = 0; i < size; i++) v[i] = share[i * PROBES + p];
    norm = remove_rows(size, row, q, v);
    if (norm > probe_share) break;
  }
  for (int axis = 0; axis < size && !(norm > probe_share); axis++) {
    for (int i = 0; i < size; i++) v[i] = i == axis;
    norm = remove_rows(size, row, q, v);
    // Some axis keeps at least sqrt((size - row) / size) of its length.
    if (norm * norm * size < 0.99 * (size - row)) norm = 0;
  }
  for (int i = 0; i < size; i++) v[i] /= norm;
}

static ep_status rotate_group(int n, int size, const double *share, double *phi, ep_error *err) {
  const size_t entries = (size_t)size * (size_t)n;
  double *q = malloc(((size_t)size * (size_t)size + entries) * sizeof *q);
  if (!q) return ep_fail(err, EP_ERR_MEMORY, "no memory for a group of %d eigenfunctions", size);
  double *turned = q + size * size;
  for (int row = 0; row < size; row++) choose_row(size, row, share, q);
  ep_gemm(size, n, size, q, phi, turned);
  memcpy(phi, turned, entries * sizeof *phi);
  free(q);
  return EP_OK;
}

ep_status ep_lb_make_canonical(const ep_mesh *mesh, const ep_csr *mass, int count,
                               const double *lambda, double *phi, ep_error *err) {
  double *share = malloc((size_t)count * PROBES * sizeof *share);
  if (!share) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d eigenfunctions", count);
  ep_status status = probe_shares(mesh, mass, count, phi, share, err);
  for (int first = 0; first < count && status == EP_OK;) {
    const int end = ep_lb_group_end(count, lambda, first);
    status = rotate_group(mesh->nv, end - first, share + (size_t)first * PROBES,
                          phi + (size_t)first * (size_t)mesh->nv, err);
    first = end;
  }
  free(share);
  return status;
}
