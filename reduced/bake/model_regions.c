#include "reduced/bake/model_regions.h"

#include <stdlib.h>
#include <string.h>

double ep_region_share(const ep_mesh *mesh, const ep_region_part *region, int e) {
  if (!region->weight) return 1;
  const int *tet = mesh->tet + 4 * (size_t)e;
  const double *w = region->weight;
  return 0.25 * (w[tet[0]] + w[tet[1]] + w[tet[2]] + w[tet[3]]);
}

bool ep_region_carried(const ep_fem *fem, const ep_region_part *region) {
  int held = 0;
  if (!region->weight) return false;
  for (int v = 0; v < fem->mesh->nv; v++) held += region->weight[v] > 0.5 && fem->held[3 * v];
  return held < 3;
}

void ep_region_mass(const ep_mesh *mesh, const ep_region_part *region, const double *phi,
                    double *out) {
  memset(out, 0, (size_t)mesh->nv * sizeof *out);
  for (int e = 0; e < mesh->nt; e++) {
    const double share = ep_region_share(mesh, region, e);
    if (share == 0) continue;
    const int *tet = mesh->tet + 4 * (size_t)e;
    double gradient[12], sum = 0;
    const double mass = share * ep_tet_gradients(mesh, e, gradient) / 20;
    for (int i = 0; i < 4; i++) sum += phi[tet[i]];
    for (int i = 0; i < 4; i++) out[tet[i]] += mass * (sum + phi[tet[i]]);
  }
}

// Both parts of the motion for a field x (nv x 3) into column `at` of rows with `stride` columns.
static void motion_of(int nv, const double *b, const double *rest_x, const double *centre,
                      const double *x, double *out, size_t stride) {
  for (int i = 0; i < 12; i++) out[(size_t)i * stride] = 0;
  for (int v = 0; v < nv; v++) {
    if (b[v] == 0) continue;
    for (int i = 0; i < 3; i++) {
      const double bx = b[v] * x[3 * v + i];
      out[(size_t)(9 + i) * stride] += bx;
      for (int j = 0; j < 3; j++)
        out[(size_t)(3 * i + j) * stride] += bx * (rest_x[3 * v + j] - centre[j]);
    }
  }
}

ep_status ep_region_motion(const ep_basis *basis, const ep_mesh *mesh, const ep_region_part *region,
                           double *map, double *rest, ep_error *err) {
  const size_t nv = (size_t)mesh->nv, r = (size_t)basis->r;
  double *b = calloc(2 * nv, sizeof *b), *ones = b + nv, total = 0, centre[3] = {0, 0, 0};
  if (!b) return ep_fail(err, EP_ERR_MEMORY, "no memory for the motion of a region");
  for (size_t v = 0; v < nv; v++) ones[v] = 1;
  ep_region_mass(mesh, region, ones, b);
  for (size_t v = 0; v < nv; v++) total += b[v];
  for (size_t v = 0; v < nv; v++) {
    b[v] /= total;
    for (size_t i = 0; i < 3; i++) centre[i] += b[v] * mesh->x[3 * v + i];
  }
  motion_of(mesh->nv, b, mesh->x, centre, mesh->x, rest, 1);
  for (size_t a = 0; a < r; a++)
    motion_of(mesh->nv, b, mesh->x, centre, basis->u + a * 3 * nv, map + a, r);
  free(b);
  return EP_OK;
}
