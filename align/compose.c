#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

static ep_status check(const ep_map *first, const ep_map *second, ep_error *err) {
  if (first->m != second->m)
    return ep_fail(err, EP_ERR_ARGUMENT, "cannot compose maps of %d and %d functions", first->m,
                   second->m);
  for (int i = 0; i < first->n; i++)
    if (first->p[i] < 0 || first->p[i] >= second->n)
      return ep_fail(err, EP_ERR_ARGUMENT,
                     "cannot compose maps: vertex %d goes to %d, the second map has %d vertices", i,
                     first->p[i], second->n);
  return EP_OK;
}

// x_from = s1 R1 (s2 R2 (x - ct2) + cf2 - ct1) + cf1.
static void compose_frames(const ep_map *first, const ep_map *second, ep_map *out) {
  double shift[3], turned[3];
  ep_frame_multiply(first->rotation, second->rotation, out->rotation);
  out->scale = first->scale * second->scale;
  for (int c = 0; c < 3; c++) shift[c] = second->center_from[c] - first->center_to[c];
  ep_frame_apply(1, first->rotation, shift, turned);
  for (int c = 0; c < 3; c++) {
    out->center_to[c] = second->center_to[c];
    out->center_from[c] = first->center_from[c] + first->scale * turned[c];
  }
}

static bool worse(const ep_map_quality *a, const ep_map_quality *b) {
  return a->verdict != b->verdict ? a->verdict > b->verdict : a->cycle > b->cycle;
}

static ep_status compose_quality(const ep_map *first, const ep_map *second, ep_map *out,
                                 ep_error *err) {
  const ep_map_quality *from =
      worse(&second->quality, &first->quality) ? &second->quality : &first->quality;
  out->quality = *from;
  out->quality.region = NULL;
  out->quality.candidate = NULL;
  out->quality.landmark = NULL;
  out->quality.candidates = out->quality.rivals = out->quality.against = 0;
  out->quality.exchanged = out->quality.exchanged_with = -1;
  out->quality.settle_from = out->quality.settle_to = out->quality.settle_other = -1;
  out->quality.determinant = first->quality.determinant * second->quality.determinant;
  out->quality.frame_angle = ep_frame_angle(out->rotation);
  if (from->regions == 0) return EP_OK;
  const size_t bytes = (size_t)from->regions * sizeof *from->region;
  out->quality.region = malloc(bytes);
  if (!out->quality.region)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", from->regions);
  memcpy(out->quality.region, from->region, bytes);
  return EP_OK;
}

// Where the points of the first map go in `to`, and the tets there that hold them.
static ep_status compose_points(const ep_map *first, const ep_mesh *middle, const ep_map *second,
                                const ep_mesh *to, ep_map *out, ep_error *err) {
  double *there = malloc(3 * (size_t)second->n * sizeof *there);
  double *point = malloc(3 * (size_t)first->n * sizeof *point);
  ep_status status =
      there && point ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory to compose maps");
  if (status == EP_OK) {
    ep_map_pull(second, to, 3, to->x, there);
    ep_map_pull(first, middle, 3, there, point);
    status = ep_points_project(to, 3, to->x, first->n, point, out->p, out->tet, out->weight, err);
  }
  free(there);
  free(point);
  return status;
}

ep_status ep_map_compose(const ep_map *first, const ep_mesh *middle, const ep_map *second,
                         const ep_mesh *to, ep_map *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  EP_TRY(check(first, second, err));
  const int m = first->m;
  ep_map made = {.n = first->n, .m = m};
  made.p = malloc((size_t)made.n * sizeof *made.p);
  made.tet = malloc((size_t)made.n * sizeof *made.tet);
  made.weight = malloc(4 * (size_t)made.n * sizeof *made.weight);
  made.c = malloc((size_t)m * m * sizeof *made.c);
  made.a = malloc((size_t)m * m * sizeof *made.a);
  ep_status status = made.p && made.tet && made.weight && made.c && made.a
                         ? compose_quality(first, second, &made, err)
                         : ep_fail(err, EP_ERR_MEMORY, "no memory to compose maps");
  for (int i = 0; i < made.n && status == EP_OK; i++) made.p[i] = second->p[first->p[i]];
  if (status == EP_OK) status = compose_points(first, middle, second, to, &made, err);
  if (status != EP_OK) {
    ep_map_free(&made);
    return status;
  }
  ep_gemm(m, m, m, first->c, second->c, made.c); // Phi_2[p2][p1] = Phi_1[p1] C2 = Phi_0 C1 C2
  ep_gemm(m, m, m, second->a, first->a, made.a);
  compose_frames(first, second, &made);
  made.quality.frame_angle = ep_frame_angle(made.rotation);
  *out = made;
  return EP_OK;
}
