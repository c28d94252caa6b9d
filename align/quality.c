#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// A region is suspect where another fits clearly better, and its own partner hardly.
static const double SUSPECT_JACCARD = 0.5, SUSPECT_WEIGHT = 0.1;
// Neighbouring eigenvalues closer than this (relative) may swap or mix between shapes.
static const double NEAR_MULTIPLE = 0.03;
// A vertex counts as hit within so many mean vertex distances of the coarser sampling.
static const double HIT_DISTANCE = 1.5;

ep_status ep_region_overlap(const ep_side *from, const ep_side *to, const int *p, double *out,
                            ep_error *err) {
  const int count = from->regions;
  double *own = calloc(2 * (size_t)count, sizeof *own), *pulled = own + count;
  if (!own) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", count);
  memset(out, 0, (size_t)count * count * sizeof *out);
  for (int i = 0; i < from->n; i++) {
    const double *a = from->indicator + (size_t)i * count;
    const double *b = to->indicator + (size_t)p[i] * count;
    for (int g = 0; g < count; g++) {
      own[g] += from->share[i] * a[g];
      pulled[g] += from->share[i] * b[g];
      for (int h = 0; h < count; h++) out[g * count + h] += from->share[i] * a[g] * b[h];
    }
  }
  for (int g = 0; g < count; g++)
    for (int h = 0; h < count; h++) out[g * count + h] /= own[g] + pulled[h] - out[g * count + h];
  free(own);
  return EP_OK;
}

static int best_of(int regions, const double *row, const unsigned char *among) {
  int best = -1;
  for (int h = 0; h < regions; h++)
    if ((!among || among[h]) && (best < 0 || row[h] > row[best])) best = h;
  return best;
}

void ep_region_suspects(int regions, const double *overlap, const unsigned char *use,
                        unsigned char *suspect, int *best) {
  for (int g = 0; g < regions; g++) {
    const double *row = overlap + (size_t)g * regions;
    best[g] = best_of(regions, row, NULL);
    if (row[best[g]] <= row[g] + EP_REGION_CLEARLY) best[g] = g;
    suspect[g] = (use && !use[g]) || (best[g] != g && row[g] < SUSPECT_JACCARD);
  }
  // Regions overlap: a misplaced one may fit the partner of another region best. Swapped partners
  // are found among the misplaced ones.
  for (int g = 0; g < regions; g++) {
    const double *row = overlap + (size_t)g * regions;
    const int swapped = suspect[g] ? best_of(regions, row, suspect) : g;
    if (row[swapped] > SUSPECT_JACCARD) best[g] = swapped;
  }
}

// Sign of det A, A orthogonal (m x m), by elimination with pivoting on a copy.
static double determinant_sign(int m, const double *a, double *work) {
  memcpy(work, a, (size_t)m * m * sizeof *work);
  double sign = 1;
  for (int c = 0; c < m; c++) {
    int pivot = c;
    for (int r = c + 1; r < m; r++)
      if (fabs(work[r * m + c]) > fabs(work[pivot * m + c])) pivot = r;
    if (pivot != c) {
      sign = -sign;
      for (int i = 0; i < m; i++) {
        const double t = work[c * m + i];
        work[c * m + i] = work[pivot * m + i];
        work[pivot * m + i] = t;
      }
    }
    if (work[c * m + c] < 0) sign = -sign;
    for (int r = c + 1; r < m; r++) {
      const double f = work[c * m + c] != 0 ? work[r * m + c] / work[c * m + c] : 0;
      for (int i = c; i < m; i++) work[r * m + i] -= f * work[c * m + i];
    }
  }
  return sign;
}

static ep_status judge_basis(const ep_side *from, ep_map *map, ep_error *err) {
  const int m = map->m;
  double *work = malloc((size_t)m * m * sizeof *work);
  if (!work) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d functions", m);
  ep_map_quality *q = &map->quality;
  ep_gemm_tn(m, m, m, map->a, map->a, work);
  q->orthogonality = 0;
  for (int i = 0; i < m; i++)
    for (int j = 0; j < m; j++)
      q->orthogonality = fmax(q->orthogonality, fabs(work[i * m + j] - (i == j)));
  q->determinant = determinant_sign(m, map->a, work);
  free(work);
  const ep_lb *lb = from->shape->lb;
  int counted = 0;
  for (int i = 0; i < m; i++) {
    const double *l = lb->lambda;
    const bool below = i > 0 && l[i] - l[i - 1] < NEAR_MULTIPLE * l[i];
    const bool above = i + 1 < lb->m && l[i + 1] - l[i] < NEAR_MULTIPLE * l[i + 1];
    counted += below || above;
  }
  q->near_multiple = counted;
  return EP_OK;
}

// Share of the volume of `to` within a vertex distance of the map's image.
static ep_status judge_points(const ep_side *from, const ep_side *to, ep_map *map, ep_error *err) {
  const size_t nf = (size_t)from->n, nt = (size_t)to->n;
  double *image = malloc(3 * nf * sizeof *image), *kx = malloc(3 * nf * sizeof *kx);
  int *nearest = malloc(nt * sizeof *nearest);
  ep_tree *tree = NULL;
  ep_status status = EP_OK;
  if (!image || !kx || !nearest) status = ep_fail(err, EP_ERR_MEMORY, "no memory to judge a map");
  for (size_t i = 0; i < nf && status == EP_OK; i++)
    memcpy(image + 3 * i, to->x + 3 * (size_t)map->p[i], 3 * sizeof(double));
  if (status == EP_OK) status = ep_tree_make(from->n, 3, image, &tree, err);
  if (status == EP_OK) {
    for (size_t i = 0; i < nt; i++) nearest[i] = -1;
    ep_tree_nearest(tree, to->n, to->x, nearest);
    const double spacing = HIT_DISTANCE / cbrt((double)(nf < nt ? nf : nt));
    map->quality.coverage = 0;
    for (size_t i = 0; i < nt; i++) {
      double d2 = 0;
      for (int c = 0; c < 3; c++)
        d2 += pow(to->x[3 * i + c] - image[3 * (size_t)nearest[i] + c], 2);
      if (d2 <= spacing * spacing) map->quality.coverage += to->share[i];
    }
    double there = 0, own = 0;
    ep_csr_multiply(&from->stiffness, 3, image, kx);
    for (size_t i = 0; i < 3 * nf; i++) there += image[i] * kx[i];
    ep_csr_multiply(&from->stiffness, 3, from->x, kx);
    for (size_t i = 0; i < 3 * nf; i++) own += from->x[i] * kx[i];
    map->quality.dirichlet = there / own;
  }
  ep_tree_free(tree);
  free(image);
  free(kx);
  free(nearest);
  return status;
}

// Six times the volume of a tet with these corners, signed.
static double signed_volume(const double *x, const int *v) {
  double d[9];
  for (int k = 0; k < 9; k++)
    d[k] = x[3 * (size_t)v[1 + k / 3] + k % 3] - x[3 * (size_t)v[0] + k % 3];
  return ep_determinant3(d);
}

ep_status ep_map_handedness(const ep_side *from, const ep_side *to, const double r[9],
                            const ep_point_map *map, double *handed, ep_error *err) {
  const ep_mesh *mesh = from->shape->mesh;
  double *image = malloc(3 * (size_t)from->n * sizeof *image);
  double *star = calloc((size_t)from->n, sizeof *star);
  ep_status status =
      image && star ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory to judge a map");
  if (status == EP_OK) {
    const double side = ep_determinant3(r) < 0 ? -1 : 1;
    ep_point_map_pull(map, from->n, to->shape->mesh, 3, to->x, image);
    for (int e = 0; e < mesh->nt; e++) {
      const int *v = mesh->tet + 4 * (size_t)e;
      const double turned = signed_volume(from->x, v) < 0 ? -side : side;
      for (int c = 0; c < 4; c++) star[v[c]] += turned * signed_volume(image, v);
    }
    *handed = 0;
    for (int i = 0; i < from->n; i++)
      if (star[i] > 0) *handed += from->share[i];
  }
  free(image);
  free(star);
  return status;
}

// Coefficients of the regions' indicators in the first k functions, scale-free: f (regions x k).
static ep_status region_functions(const ep_side *side, int k, double *f, ep_error *err) {
  const int count = side->regions, n = side->n;
  const ep_lb *lb = side->shape->lb;
  double *b = malloc((size_t)n * count * sizeof *b), *t = malloc((size_t)k * count * sizeof *t);
  if (!b || !t) {
    free(b);
    free(t);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", count);
  }
  ep_csr_multiply(side->shape->mass, count, side->indicator, b);
  ep_gemm(k, count, n, lb->phi, b, t);
  for (int g = 0; g < count; g++)
    for (int j = 0; j < k; j++) f[g * k + j] = t[j * count + g] / sqrt(lb->volume);
  free(b);
  free(t);
  return EP_OK;
}

// Relative residual of each region's function under A (k x m); returns their root mean square.
static double region_residuals(const ep_couple_problem *p, const double *a, double *each) {
  double sum = 0;
  for (int g = 0; g < p->q; g++) {
    double r2 = 0, f2 = 0;
    for (int j = 0; j < p->m; j++) {
      double v = 0;
      for (int i = 0; i < p->k; i++) v += p->f_to[g * p->k + i] * a[i * p->m + j];
      r2 += pow(v - p->f_from[g * p->m + j], 2);
      f2 += pow(p->f_from[g * p->m + j], 2);
    }
    each[g] = f2 > 0 ? sqrt(r2 / f2) : 0;
    sum += each[g] * each[g];
  }
  return sqrt(sum / p->q);
}

// Rows of equal size, so that small regions count as much as large ones.
static void normalise_rows(int q, int m, int k, double *f_from, double *f_to) {
  for (int g = 0; g < q; g++) {
    double f2 = 0;
    for (int j = 0; j < m; j++) f2 += f_from[g * m + j] * f_from[g * m + j];
    const double scale = f2 > 0 ? 1 / sqrt(f2) : 0;
    for (int j = 0; j < m; j++) f_from[g * m + j] *= scale;
    for (int j = 0; j < k; j++) f_to[g * k + j] *= scale;
  }
}

typedef struct coupling_work {
  double *f_from, *f_to, *lambda_from, *lambda_to, *a, *other, *weight, *other_weight, *each;
} coupling_work;

// Couple from Procrustes and from the map's own basis, keep the lower objective.
static ep_status couple_both(const ep_coupling *def, const ep_couple_problem *p, const ep_map *map,
                             const coupling_work *w, ep_error *err) {
  double lower = 0, other = 0;
  memset(w->a, 0, (size_t)def->k * def->m * sizeof(double));
  EP_TRY(ep_couple(def, p->q, p->lambda_from, p->lambda_to, p->f_from, p->f_to, w->a, w->weight,
                   &lower, err));
  memset(w->other, 0, (size_t)def->k * def->m * sizeof(double));
  memcpy(w->other, map->a, (size_t)def->m * def->m * sizeof(double));
  EP_TRY(ep_couple(def, p->q, p->lambda_from, p->lambda_to, p->f_from, p->f_to, w->other,
                   w->other_weight, &other, err));
  if (other < lower) {
    memcpy(w->a, w->other, (size_t)def->k * def->m * sizeof(double));
    memcpy(w->weight, w->other_weight, (size_t)p->q * sizeof(double));
  }
  return EP_OK;
}

static ep_status judge_coupling(const ep_side *from, const ep_side *to, const coupling_work *w,
                                int k, ep_map *map, ep_error *err) {
  const int m = map->m, q = from->regions;
  const double *l_from = from->shape->lb->lambda, *l_to = to->shape->lb->lambda;
  for (int i = 0; i < m; i++) w->lambda_from[i] = l_from[i] * from->length * from->length;
  for (int i = 0; i < k; i++) w->lambda_to[i] = l_to[i] * to->length * to->length;
  EP_TRY(region_functions(from, m, w->f_from, err));
  EP_TRY(region_functions(to, k, w->f_to, err));
  normalise_rows(q, m, k, w->f_from, w->f_to);
  ep_couple_problem p = {.k = k,
                         .m = m,
                         .q = q,
                         .lambda_from = w->lambda_from,
                         .lambda_to = w->lambda_to,
                         .f_from = w->f_from,
                         .f_to = w->f_to};
  ep_region_quality *r = map->quality.region;
  memset(w->a, 0, (size_t)k * m * sizeof(double));
  for (int i = 0; i < m; i++) w->a[i * m + i] = 1;
  map->quality.residual_before = region_residuals(&p, w->a, w->each);
  for (int g = 0; g < q; g++) r[g].residual_before = w->each[g];
  ep_coupling def = ep_default_coupling(m);
  def.k = k;
  map->quality.coupled_functions = ep_couple_determined(q, m, w->f_from);
  if (map->quality.coupled_functions < 0)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", q);
  EP_TRY(ep_couple_choose(&def, k, q, w->lambda_from, w->lambda_to, w->f_from, w->f_to,
                          &map->quality.held_out, err));
  if (def.k < k) {
    for (int g = 0; g < q; g++)
      memmove(w->f_to + (size_t)g * def.k, w->f_to + (size_t)g * k, (size_t)def.k * sizeof(double));
    p.k = def.k;
  }
  map->quality.coupling_k = def.k;
  map->quality.coupling_mu = def.mu_data;
  EP_TRY(couple_both(&def, &p, map, w, err));
  map->quality.residual_after = region_residuals(&p, w->a, w->each);
  for (int g = 0; g < q; g++) {
    r[g].residual_after = w->each[g];
    if (w->weight[g] < SUSPECT_WEIGHT && r[g].jaccard < SUSPECT_JACCARD) r[g].suspect = true;
  }
  return EP_OK;
}

static ep_status couple_regions(const ep_side *from, const ep_side *to, ep_map *map,
                                ep_error *err) {
  const int q = from->regions, m = map->m, twice = 2 * m;
  const int k = twice < to->shape->lb->m ? twice : to->shape->lb->m;
  const size_t basis = (size_t)k * m,
               total = (size_t)q * (m + k) + m + k + 2 * basis + 3 * (size_t)q;
  double *memory = malloc(total * sizeof *memory);
  if (!memory) return ep_fail(err, EP_ERR_MEMORY, "no memory to couple %d functions", k);
  coupling_work w = {.f_from = memory};
  w.f_to = w.f_from + (size_t)q * m;
  w.lambda_from = w.f_to + (size_t)q * k;
  w.lambda_to = w.lambda_from + m;
  w.a = w.lambda_to + k;
  w.other = w.a + basis;
  w.weight = w.other + basis;
  w.other_weight = w.weight + q;
  w.each = w.other_weight + q;
  const ep_status status = judge_coupling(from, to, &w, k, map, err);
  free(memory);
  return status;
}

static ep_status judge_regions(const ep_side *from, const ep_side *to, const unsigned char *use,
                               ep_map *map, ep_error *err) {
  const int count = from->regions;
  map->quality.regions = count;
  map->quality.region = calloc((size_t)count, sizeof *map->quality.region);
  double *overlap = malloc((size_t)count * count * sizeof *overlap);
  unsigned char *suspect = malloc((size_t)count);
  int *best = malloc((size_t)count * sizeof *best);
  ep_status status = EP_OK;
  if (!map->quality.region || !overlap || !suspect || !best)
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for %d regions", count);
  if (status == EP_OK) status = ep_region_overlap(from, to, map->p, overlap, err);
  if (status == EP_OK) {
    ep_region_suspects(count, overlap, use, suspect, best);
    for (int g = 0; g < count; g++) {
      ep_region_quality *r = &map->quality.region[g];
      r->jaccard = overlap[g * count + g];
      r->best_match = best[g];
      r->suspect = suspect[g];
    }
    status = couple_regions(from, to, map, err);
  }
  free(overlap);
  free(suspect);
  free(best);
  return status;
}

ep_status ep_map_judge(const ep_side *from, const ep_side *to, const unsigned char *use,
                       bool same_family, ep_map *map, ep_error *err) {
  EP_TRY(judge_basis(from, map, err));
  EP_TRY(judge_points(from, to, map, err));
  if (use) EP_TRY(judge_regions(from, to, use, map, err));
  ep_map_verdict(from->shape->mesh, to->shape->mesh, same_family, map);
  return EP_OK;
}
