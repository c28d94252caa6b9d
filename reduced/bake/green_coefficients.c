#include "reduced/bake/green_coefficients.h"

#include <stdlib.h>
#include <string.h>

#include "linalg/dense.h"
#include "reduced/bake/vectors.h"

typedef struct workspace {
  ep_csr g;      // scalar geometric stiffness
  double *force; // (3n)
  double *image; // (r x 3n) G U
  double *b;     // (r x r) of one example
} workspace;

static void workspace_free(workspace *w) {
  ep_csr_free(&w->g);
  free(w->force);
  free(w->image);
  free(w->b);
}

static ep_status no_memory(ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the Green-strain coefficients");
}

static ep_status workspace_make(const ep_fem *fem, int r, workspace *w, ep_error *err) {
  const ep_mesh *mesh = fem->mesh;
  const size_t n3 = 3 * (size_t)mesh->nv, modes = (size_t)r;
  EP_TRY(ep_csr_from_tets(mesh->nv, mesh->nt, mesh->tet, 1, &w->g, err));
  w->force = malloc(n3 * sizeof *w->force);
  w->image = malloc(modes * n3 * sizeof *w->image);
  w->b = malloc(modes * modes * sizeof *w->b);
  return w->force && w->image && w->b ? EP_OK : no_memory(err);
}

// s (6) times g (3)
static void stress_on(const double s[6], const double g[3], double out[3]) {
  out[0] = s[0] * g[0] + s[3] * g[1] + s[4] * g[2];
  out[1] = s[3] * g[0] + s[1] * g[1] + s[5] * g[2];
  out[2] = s[4] * g[0] + s[5] * g[1] + s[2] * g[2];
}

// G and the forces S g_v of a stress field (nt x 6, weights included).
static void assemble(const ep_fem *fem, const double *stress, workspace *w) {
  const ep_mesh *mesh = fem->mesh;
  memset(w->g.value, 0, (size_t)w->g.start[w->g.n] * sizeof *w->g.value);
  memset(w->force, 0, 3 * (size_t)mesh->nv * sizeof *w->force);
  for (int e = 0; e < mesh->nt; e++) {
    const int *tet = mesh->tet + 4 * (size_t)e, *slot = fem->slot + 16 * (size_t)e;
    const double *g = fem->gradient + 12 * (size_t)e;
    for (int v = 0; v < 4; v++) {
      double t[3];
      stress_on(stress + 6 * (size_t)e, g + 3 * v, t);
      for (int a = 0; a < 3; a++) w->force[3 * (size_t)tet[v] + (size_t)a] += t[a];
      for (int u = 0; u < 4; u++)
        w->g.value[w->g.start[tet[v]] + slot[4 * v + u]] += ep_dot(3, t, g + 3 * u);
    }
  }
}

// Coefficients of example j's own strain, added with V_ji to those of every strain i.
static void add_example(const ep_green_space *space, const ep_basis *basis, int j, workspace *w,
                        ep_green_coefficients *out) {
  const size_t nt = (size_t)space->fem->mesh->nt, n3 = 3 * (size_t)basis->n;
  const size_t r = (size_t)basis->r, count = (size_t)space->count;
  assemble(space->fem, space->stress + 6 * nt * (size_t)j, w);
  for (size_t a = 0; a < r; a++) ep_csr_multiply(&w->g, 3, basis->u + a * n3, w->image + a * n3);
  ep_gemm_nt(basis->r, basis->r, (int)n3, basis->u, w->image, w->b);
  for (size_t i = 0; i < count; i++) {
    const double v = space->weights[(size_t)j * count + i];
    for (size_t a = 0; a < r; a++) {
      out->linear[i * r + a] += v * ep_dot(n3, w->force, basis->u + a * n3);
      for (size_t b = 0; b < r; b++) // both halves: symmetric to the last bit
        out->b[(i * r + a) * r + b] += 0.5 * v * (w->b[a * r + b] + w->b[b * r + a]);
    }
  }
}

static ep_status allocate(const ep_green_space *space, const ep_basis *basis,
                          ep_green_coefficients *out, ep_error *err) {
  const size_t r = (size_t)basis->r, k = (size_t)space->k, count = (size_t)space->count;
  *out = (ep_green_coefficients){.r = basis->r, .k = space->k, .count = space->count};
  out->b = calloc(count * r * r, sizeof *out->b);
  out->linear = calloc(count * r, sizeof *out->linear);
  out->weights = malloc(k * count * sizeof *out->weights);
  out->energy = malloc(k * sizeof *out->energy);
  if (!out->b || !out->linear || !out->weights || !out->energy) return no_memory(err);
  memcpy(out->weights, space->weights, k * count * sizeof *out->weights);
  for (size_t j = 0; j < k; j++) out->energy[j] = space->gram[(k + 1) * j];
  return EP_OK;
}

// Poses (examples x 3n) as the basis holds them: U q_i.
static void poses_of(const ep_basis *basis, double *poses) {
  const size_t n3 = 3 * (size_t)basis->n, r = (size_t)basis->r;
  memset(poses, 0, (size_t)basis->examples * n3 * sizeof *poses);
  for (size_t i = 0; i < (size_t)basis->examples; i++)
    for (size_t a = 0; a < r; a++)
      ep_axpy(n3, basis->example_q[i * r + a], basis->u + a * n3, poses + i * n3);
}

ep_status ep_green_coefficients_compute(const ep_fem *fem, const ep_basis *basis,
                                        const double *poses, const double *weight,
                                        const double *share, ep_log *log,
                                        ep_green_coefficients *out, ep_error *err) {
  ep_green_space space = {0};
  workspace w = {0};
  *out = (ep_green_coefficients){0};
  double *own = NULL;
  if (!poses) {
    own = malloc(((size_t)basis->examples * 3 * (size_t)basis->n + 1) * sizeof *own);
    if (!own) return no_memory(err);
    poses_of(basis, own);
  }
  ep_status status = ep_green_space_create(fem, weight, basis->examples, poses ? poses : own, share,
                                           log, &space, err);
  free(own);
  if (status == EP_OK) status = allocate(&space, basis, out, err);
  if (status == EP_OK) status = workspace_make(fem, basis->r, &w, err);
  if (status == EP_OK) ep_progress_begin(log, "Green-strain coefficients", space.k);
  for (int j = 0; j < space.k && status == EP_OK; j++) {
    add_example(&space, basis, j, &w, out);
    ep_progress(log, j + 1);
  }
  ep_progress_end(log);
  workspace_free(&w);
  ep_green_space_free(&space);
  if (status != EP_OK) ep_green_coefficients_free(out);
  return status;
}

void ep_green_coefficients_free(ep_green_coefficients *coefficients) {
  free(coefficients->b);
  free(coefficients->linear);
  free(coefficients->weights);
  free(coefficients->energy);
  *coefficients = (ep_green_coefficients){0};
}
