#include "cubature/poses.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cubature/cholesky.h"
#include "cubature/parallel.h"

// A pose is too far when more than this share of the elements keeps less than this of its volume:
// such forces are those of the volume penalty in a few crushed elements, which say nothing about
// the poses a simulation visits.
static const double crushed_ratio = 0.1, crushed_share = 0.01;
static const double shrink = 0.75; // of the displacement (or perturbation) on each new attempt
enum { MAX_SHRINKS = 40 };
// Displacements below this share of the amplitude are left out: round-off in F would dominate.
static const double smallest = 1e-3;
// Perturbation of poses on a path, as a share of the amplitude of random poses.
static const double path_noise = 0.25;

typedef struct pose_maker {
  const ep_elements *elements;
  const ep_basis *basis;
  const double *paths;
  const ep_cubature_options *options;
  double reach; // largest displacement of random poses [length]
  ep_cholesky k0;
  double *direction, *base, *u, *ratio; // (r), (r), (3 nv), (nt)
  ep_random rng;
} pose_maker;

static double largest_displacement(const pose_maker *m, const double *q) {
  const size_t nv = (size_t)m->elements->fem->mesh->nv, r = (size_t)m->elements->r;
  memset(m->u, 0, 3 * nv * sizeof *m->u);
  for (size_t a = 0; a < r; a++)
    for (size_t i = 0; i < 3 * nv; i++) m->u[i] += q[a] * m->basis->u[a * 3 * nv + i];
  double largest = 0;
  for (size_t v = 0; v < nv; v++) {
    const double *x = m->u + 3 * v;
    largest = fmax(largest, x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
  }
  return sqrt(largest);
}

// A normal deviate of covariance K0^-1 (all modes of equal mean energy, amplitudes ~ 1 / omega),
// scaled to a largest vertex displacement uniform in (0, share of the reach).
static ep_status random_direction(pose_maker *m, double share, ep_error *err) {
  const int r = m->elements->r;
  double *d = m->direction;
  for (int a = 0; a < r; a++) d[a] = ep_random_normal(&m->rng);
  for (int i = r - 1; i >= 0; i--) { // L^T d = xi
    const double *l = m->k0.l;
    d[i] /= l[(size_t)i * (size_t)r + (size_t)i];
    for (int j = 0; j < i; j++) d[j] -= l[(size_t)i * (size_t)r + (size_t)j] * d[i];
  }
  const double largest = largest_displacement(m, d);
  const double wanted = fmax(smallest, ep_random_uniform(&m->rng)) * share * m->reach;
  if (!(largest > 0) || !isfinite(largest))
    return ep_fail(err, EP_ERR_NUMERIC,
                   "cubature: a random pose moves no vertex; is the basis zero?");
  for (int a = 0; a < r; a++) d[a] *= wanted / largest;
  return EP_OK;
}

// A point of the path of example i, w in [0, 1], linear between its stations.
static void path_point(const pose_maker *m, size_t example, double w, double *q) {
  const size_t r = (size_t)m->elements->r;
  const double *station = m->paths + example * EP_PATH_STATIONS * r;
  const double at = w * EP_PATH_STATIONS;
  size_t s = (size_t)at;
  if (s >= EP_PATH_STATIONS) s = EP_PATH_STATIONS - 1;
  const double t = at - (double)s;
  for (size_t a = 0; a < r; a++) {
    const double from = s > 0 ? station[(s - 1) * r + a] : 0;
    q[a] = (1 - t) * from + t * station[s * r + a];
  }
}

typedef struct ratio_work {
  const ep_elements *elements;
  const ep_pose *pose;
  double *ratio; // (nt)
} ratio_work;

static void ratio_range(void *context, int piece, int from, int to) {
  (void)piece;
  const ratio_work *w = context;
  for (int e = from; e < to; e++) w->ratio[e] = ep_element_volume_ratio(w->elements, e, w->pose);
}

static bool usable(const pose_maker *m, const ep_pose *pose) {
  const int nt = m->elements->nt;
  ep_parallel_ranges(nt, ratio_range, &(ratio_work){m->elements, pose, m->ratio});
  int crushed = 0;
  for (int e = 0; e < nt; e++) {
    if (!isfinite(m->ratio[e])) return false;
    crushed += m->ratio[e] < crushed_ratio;
  }
  return crushed <= crushed_share * nt;
}

// Base and perturbation of the pose, and the example it belongs to.
static ep_status draw(pose_maker *m, ep_pose_kind kind, double *reference, size_t *which,
                      ep_error *err) {
  const size_t r = (size_t)m->elements->r;
  memset(m->base, 0, r * sizeof *m->base);
  if (kind == EP_POSE_RANDOM) return random_direction(m, 1, err);
  const int examples = m->basis->examples;
  const size_t example = *which = (size_t)ep_random_below(&m->rng, examples);
  if (kind == EP_POSE_PATH) {
    path_point(m, example, ep_random_uniform(&m->rng), m->base);
    return random_direction(m, path_noise, err);
  }
  // Relative: half of them around the example itself, half on the way of any example, as the object
  // is seen from that example while it is pulled there.
  memcpy(reference, m->basis->example_q + example * r, r * sizeof *reference);
  if (ep_random_uniform(&m->rng) < 0.5) {
    memcpy(m->base, reference, r * sizeof *m->base);
    return random_direction(m, 1, err);
  }
  path_point(m, (size_t)ep_random_below(&m->rng, examples), ep_random_uniform(&m->rng), m->base);
  return random_direction(m, path_noise, err);
}

// Shrink the perturbation until the pose is usable; where the base itself is not (an example with
// crushed elements), shrink that as well.
static ep_status make_pose(pose_maker *m, ep_pose_kind kind, double *q, double *reference,
                           size_t *example, int *shrunk, ep_error *err) {
  const int r = m->elements->r;
  EP_TRY(draw(m, kind, reference, example, err));
  const ep_pose pose = {q, kind == EP_POSE_RELATIVE ? reference : NULL, NULL};
  double size = 1, base = 1;
  for (int attempt = 0; attempt < MAX_SHRINKS; attempt++, size *= shrink) {
    if (attempt > MAX_SHRINKS / 2) base *= shrink;
    for (int a = 0; a < r; a++) q[a] = base * m->base[a] + size * m->direction[a];
    if (!usable(m, &pose)) continue;
    *shrunk += attempt > 0;
    return EP_OK;
  }
  static const char *const names[EP_POSE_KINDS] = {"at random", "along an example's path",
                                                   "relative to an example"};
  return ep_fail(
      err, EP_ERR_NUMERIC,
      "cubature: no training pose %s without crushed elements; look at the example poses "
      "(inverted tets?) or lower reduction.amplitude",
      names[kind]);
}

static ep_pose_kind kind_of(const ep_basis *basis, int i, int count) {
  static const ep_pose_kind pattern[8] = {EP_POSE_RANDOM,   EP_POSE_RELATIVE, EP_POSE_RANDOM,
                                          EP_POSE_PATH,     EP_POSE_RANDOM,   EP_POSE_RELATIVE,
                                          EP_POSE_RELATIVE, EP_POSE_RANDOM};
  if (i >= count) return EP_POSE_PATH; // of the material in a region
  return basis->examples > 0 ? pattern[i % 8] : EP_POSE_RANDOM;
}

static ep_status allocate(int count, int r, ep_pose_set *out, ep_error *err) {
  const size_t numbers = (size_t)count * (size_t)r + 1;
  *out = (ep_pose_set){.count = count, .r = r};
  out->q = calloc(numbers, sizeof *out->q);
  out->reference = calloc(numbers, sizeof *out->reference);
  out->kind = calloc((size_t)count + 1, sizeof *out->kind);
  out->region = calloc((size_t)count + 1, sizeof *out->region);
  if (out->q && out->reference && out->kind && out->region) return EP_OK;
  ep_poses_free(out);
  return ep_fail(err, EP_ERR_MEMORY, "no memory for %d training poses", count);
}

static ep_status prepare(pose_maker *m, ep_error *err) {
  const size_t r = (size_t)m->elements->r, nv = (size_t)m->elements->fem->mesh->nv;
  m->direction = calloc(2 * r + 3 * nv + (size_t)m->elements->nt, sizeof *m->direction);
  if (!m->direction) return ep_fail(err, EP_ERR_MEMORY, "no memory for training poses");
  m->base = m->direction + r;
  m->u = m->base + r;
  m->ratio = m->u + 3 * nv;
  EP_TRY(ep_cholesky_create(m->elements->r, &m->k0, err));
  for (size_t a = 0; a < r; a++) {
    const double *row = m->basis->stiffness + a * r;
    if (!ep_cholesky_append(&m->k0, row, row[a]))
      return ep_fail(err, EP_ERR_NUMERIC,
                     "cubature: the stiffness of mode %d of the basis is not positive (%g); is "
                     "enough of the object fixed?",
                     (int)a, row[a]);
  }
  return EP_OK;
}

ep_status ep_poses_make(const ep_elements *elements, const ep_basis *basis, const double *paths,
                        const ep_cubature_options *options, int count, uint64_t stream,
                        ep_pose_set *out, ep_error *err) {
  const size_t r = (size_t)elements->r;
  const int all = options->regions ? count + (count + 1) / 2 : count;
  pose_maker m = {.elements = elements, .basis = basis, .paths = paths, .options = options};
  m.reach = options->amplitude * ep_mesh_extent(elements->fem->mesh);
  m.rng = ep_random_seed(options->seed, stream);
  ep_status status = EP_OK;
  *out = (ep_pose_set){0};
  EP_TRY_GOTO(status, prepare(&m, err), done);
  EP_TRY_GOTO(status, allocate(all, elements->r, out, err), done);
  out->share = options->share;
  out->nt = elements->nt;
  for (int i = 0; i < all; i++) {
    const size_t at = (size_t)i * r;
    size_t example = 0;
    out->kind[i] = kind_of(basis, i, count);
    EP_TRY_GOTO(
        status,
        make_pose(&m, out->kind[i], out->q + at, out->reference + at, &example, &out->shrunk, err),
        done);
    const bool local = options->regions && (i >= count || out->kind[i] == EP_POSE_RELATIVE);
    out->region[i] = local ? options->example_region[example] : -1;
  }
done:
  ep_cholesky_free(&m.k0);
  free(m.direction);
  if (status != EP_OK) ep_poses_free(out);
  return status;
}

void ep_poses_free(ep_pose_set *poses) {
  free(poses->q);
  free(poses->reference);
  free(poses->kind);
  free(poses->region);
  *poses = (ep_pose_set){0};
}

ep_pose ep_pose_at(const ep_pose_set *poses, int i) {
  const size_t at = (size_t)i * (size_t)poses->r;
  return (ep_pose){
      poses->q + at, poses->kind[i] == EP_POSE_RELATIVE ? poses->reference + at : NULL,
      poses->region[i] < 0 ? NULL : poses->share + (size_t)poses->region[i] * (size_t)poses->nt};
}
