// Examples first, then mass-PCA of linear modes, modal derivatives and path samples.
#include "reduced/bake/basis.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "linalg/dense.h"
#include "reduced/bake/inertia.h"
#include "reduced/bake/vectors.h"

// Relative mass norm left of an example after the earlier ones are taken out, below which it adds
// no direction: what would be normalised is then mostly round-off.
static const double DEPENDENT = 1e-8;
// Largest displacement of a vertex in the first mode over the extent of the object: the amplitude
// poses are trained for.
static const double AMPLITUDE = 0.2;
// Gram eigenvalues below this times the largest are round-off of the Gram product.
static const double RANK = 1e-13;

typedef struct builder {
  const ep_fem *fem;
  ep_csr mass; // scalar, with density
  size_t n3;
  ep_basis *basis;
  double *mu;        // (r x 3n) M times each row of basis->u
  double *rigid;     // (12 x 3n) rigid modes and M times them, where nothing is held; else NULL
  int filled;        // rows done
  int count;         // candidates
  double *candidate; // (count x 3n)
} builder;

static double *row_of(double *rows, size_t n3, int i) {
  return rows + (size_t)i * n3;
}

static void mass_times(const builder *b, const double *x, double *y) {
  ep_csr_multiply(&b->mass, 3, x, y);
}

// Take the rows done out of v, twice: once loses orthogonality when little is left (Kahan).
// Rigid modes too: a free object moves as a whole by its frame alone.
static void deflate(const builder *b, double *v) {
  for (int pass = 0; pass < 2; pass++) {
    for (int k = 0; b->rigid && k < 6; k++)
      ep_axpy(b->n3, -ep_dot(b->n3, row_of(b->rigid, b->n3, 6 + k), v), row_of(b->rigid, b->n3, k),
              v);
    for (int a = 0; a < b->filled; a++) {
      const double part = ep_dot(b->n3, row_of(b->mu, b->n3, a), v);
      ep_axpy(b->n3, -part, row_of(b->basis->u, b->n3, a), v);
    }
  }
}

// |v|_M, with M v left in the next row of mu.
static double mass_norm(const builder *b, const double *v) {
  double *mv = row_of(b->mu, b->n3, b->filled);
  mass_times(b, v, mv);
  return sqrt(fmax(0, ep_dot(b->n3, v, mv)));
}

// The next row of u holds a deflated vector: normalise it and count it in.
static void accept(builder *b, double norm) {
  double *v = row_of(b->basis->u, b->n3, b->filled), *mv = row_of(b->mu, b->n3, b->filled);
  for (size_t i = 0; i < b->n3; i++) v[i] /= norm, mv[i] /= norm;
  b->filled++;
}

static ep_status check_poses(const builder *b, const char *what, int count, const double *poses,
                             ep_error *err) {
  for (int p = 0; p < count; p++)
    for (size_t i = 0; i < b->n3; i++) {
      const double value = poses[(size_t)p * b->n3 + i];
      if (!isfinite(value))
        return ep_fail(err, EP_ERR_ARGUMENT, "%s %d: displacement of vertex %zu is not finite",
                       what, p + 1, i / 3);
      if (b->fem->held[i] && value != 0)
        return ep_fail(err, EP_ERR_ARGUMENT, "%s %d: fixed vertex %zu is displaced by %g", what,
                       p + 1, i / 3, value);
    }
  return EP_OK;
}

static void add_examples(builder *b, int examples, const double *poses, ep_log *log) {
  for (int p = 0; p < examples; p++) {
    const double *pose = poses + (size_t)p * b->n3;
    double *v = row_of(b->basis->u, b->n3, b->filled);
    const double full = mass_norm(b, pose);
    memcpy(v, pose, b->n3 * sizeof *v);
    deflate(b, v);
    const double left = mass_norm(b, v);
    if (full == 0)
      ep_notice(log, "example %d is the rest shape itself and adds nothing to the basis", p + 1);
    else if (left <= DEPENDENT * full)
      ep_notice(log,
                "example %d is a combination of the examples before it (%.1e of it is left): it "
                "adds no direction to the basis",
                p + 1, left / full);
    else
      accept(b, left);
  }
}

// Every candidate enters with the size with which it is expected to occur, so that the PCA weighs
// displacement against displacement. Modes: amplitude p_i = p_1 lambda_1 / lambda_i, derivatives:
// p_i p_j Psi_ij, which is the scaling of Barbic and James 2005 (lambda_1 / lambda_i and
// lambda_1^2 / (lambda_i lambda_j)) but for the factor p_1: their form leaves it out, which makes
// the balance between modes and derivatives depend on the unit of length.
static void scale_modes(const builder *b, const ep_modes *modes, double *out) {
  const double peak = ep_longest((size_t)modes->n, modes->mode);
  const double p1 = AMPLITUDE * ep_mesh_extent(b->fem->mesh) / peak;
  const int l = modes->linear;
  for (int i = 0; i < l; i++) {
    const double pi = p1 * modes->omega2[0] / modes->omega2[i];
    const double *psi = modes->mode + (size_t)i * b->n3;
    double *row = row_of(out, b->n3, i);
    for (size_t t = 0; t < b->n3; t++) row[t] = pi * psi[t];
    for (int j = 0; j <= i; j++) {
      const double pj = p1 * modes->omega2[0] / modes->omega2[j];
      const int d = l + i * (i + 1) / 2 + j;
      const double *derivative = modes->mode + (size_t)d * b->n3;
      row = row_of(out, b->n3, d);
      for (size_t t = 0; t < b->n3; t++) row[t] = pi * pj * derivative[t];
    }
  }
}

// Path samples keep their own size: what is left of one beside the examples is the error the basis
// would make there.
static ep_status gather_candidates(builder *b, const ep_modes *modes, int npaths,
                                   const double *paths, ep_error *err) {
  const int nmodes = modes->linear + modes->derivatives;
  b->count = nmodes + npaths;
  b->candidate = malloc((size_t)b->count * b->n3 * sizeof *b->candidate);
  if (!b->candidate)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d basis candidates", b->count);
  scale_modes(b, modes, b->candidate);
  if (npaths > 0)
    memcpy(row_of(b->candidate, b->n3, nmodes), paths, (size_t)npaths * b->n3 * sizeof *paths);
  for (int i = 0; i < b->count; i++) deflate(b, row_of(b->candidate, b->n3, i));
  return EP_OK;
}

// Principal directions: eigenvalues of the Gram matrix C M C^T (count, ascending) and its
// eigenvectors (rows of v).
static ep_status gram_eigen(const builder *b, double *lambda, double *v, ep_error *err) {
  const size_t count = (size_t)b->count;
  double *gram = malloc(count * count * sizeof *gram);
  double *mc = malloc(count * b->n3 * sizeof *mc);
  ep_status status = EP_OK;
  if (!gram || !mc) {
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for the PCA of %d candidates", b->count);
    goto done;
  }
  for (int i = 0; i < b->count; i++)
    mass_times(b, row_of(b->candidate, b->n3, i), row_of(mc, b->n3, i));
  ep_gemm_nt(b->count, b->count, (int)b->n3, b->candidate, mc, gram);
  status = ep_eigen_symmetric(b->count, gram, lambda, v, err);
done:
  free(gram);
  free(mc);
  return status;
}

static ep_status require_rank(const builder *b, const double *lambda, ep_error *err) {
  const int wanted = b->basis->r - b->filled;
  int rank = 0;
  while (rank < b->count && lambda[b->count - 1 - rank] > RANK * lambda[b->count - 1]) rank++;
  if (wanted > rank)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "%d basis vectors wanted, but examples, modes and paths span %d; ask for at "
                   "most that or for more linear modes",
                   b->basis->r, b->filled + rank);
  return EP_OK;
}

static ep_status add_principal(builder *b, ep_error *err) {
  const int wanted = b->basis->r - b->filled, count = b->count;
  double *lambda = malloc((size_t)count * sizeof *lambda);
  double *v = malloc((size_t)count * (size_t)count * sizeof *v);
  ep_status status;
  if (!lambda || !v) {
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for the PCA of %d candidates", count);
    goto done;
  }
  EP_TRY_GOTO(status, gram_eigen(b, lambda, v, err), done);
  EP_TRY_GOTO(status, require_rank(b, lambda, err), done);
  for (int i = 0; i < wanted; i++) {
    double *row = row_of(b->basis->u, b->n3, b->filled);
    ep_gemm(1, (int)b->n3, count, v + (size_t)(count - 1 - i) * (size_t)count, b->candidate, row);
    ep_canonical_sign(b->n3, row);
    // normalised before deflation too: the rounding of small directions must not be amplified
    const double size = mass_norm(b, row);
    for (size_t t = 0; t < b->n3; t++) row[t] /= size;
    deflate(b, row);
    accept(b, mass_norm(b, row));
  }
done:
  free(lambda);
  free(v);
  return status;
}

// K0 = U^T K(0) U, symmetric to the bit.
static ep_status reduce_stiffness(builder *b, ep_error *err) {
  const int r = b->basis->r;
  ep_csr k = {0};
  EP_TRY(ep_fem_rest_stiffness(b->fem, &k, err));
  double *ku = malloc((size_t)r * b->n3 * sizeof *ku);
  if (!ku) {
    ep_csr_free(&k);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for the reduced stiffness");
  }
  for (int a = 0; a < r; a++)
    ep_csr_multiply(&k, 1, row_of(b->basis->u, b->n3, a), row_of(ku, b->n3, a));
  double *k0 = b->basis->stiffness;
  ep_gemm_nt(r, r, (int)b->n3, b->basis->u, ku, k0);
  for (int i = 0; i < r; i++)
    for (int j = 0; j < i; j++)
      k0[i * r + j] = k0[j * r + i] = 0.5 * (k0[i * r + j] + k0[j * r + i]);
  free(ku);
  ep_csr_free(&k);
  return EP_OK;
}

// q = U^T M P, and what is left of P. mu is used up.
static void project_examples(builder *b, const double *poses) {
  ep_basis *basis = b->basis;
  const int r = basis->r;
  double *left = b->candidate; // at least one row, no longer needed
  for (int p = 0; p < basis->examples; p++) {
    const double *pose = poses + (size_t)p * b->n3;
    double *q = basis->example_q + (size_t)p * (size_t)r;
    memcpy(left, pose, b->n3 * sizeof *left);
    for (int pass = 0; pass < 2; pass++) { // the second pass projects the rounding of the first
      for (int a = 0; a < r; a++) {
        const double part = ep_dot(b->n3, row_of(b->mu, b->n3, a), left);
        q[a] = pass == 0 ? part : q[a] + part;
        ep_axpy(b->n3, -part, row_of(basis->u, b->n3, a), left);
      }
    }
    b->filled = r; // norms go to the spare row of mu
    const double full = mass_norm(b, pose), rest = mass_norm(b, left);
    basis->example_residual[p] = full > 0 ? rest / full : 0;
  }
}

static ep_status allocate(builder *b, ep_error *err) {
  ep_basis *basis = b->basis;
  const size_t r = (size_t)basis->r, k = (size_t)basis->examples;
  basis->u = malloc(r * b->n3 * sizeof *basis->u);
  basis->stiffness = malloc(r * r * sizeof *basis->stiffness);
  basis->example_q = calloc(k * r + 1, sizeof *basis->example_q);
  basis->example_residual = calloc(k + 1, sizeof *basis->example_residual);
  b->mu = malloc((r + 1) * b->n3 * sizeof *b->mu);
  if (!basis->u || !basis->stiffness || !basis->example_q || !basis->example_residual || !b->mu)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for %d basis vectors", basis->r);
  EP_TRY(ep_fem_scalar_mass(b->fem, &b->mass, err));
  if (!ep_fem_is_free(b->fem)) return EP_OK;
  b->rigid = malloc(12 * b->n3 * sizeof *b->rigid);
  if (!b->rigid) return ep_fail(err, EP_ERR_MEMORY, "no memory for the rigid modes");
  return ep_rigid_modes(b->fem->mesh, &b->mass, b->rigid, b->rigid + 6 * b->n3, err);
}

static ep_status build(builder *b, const ep_modes *modes, const double *poses, int npaths,
                       const double *paths, ep_log *log, ep_error *err) {
  EP_TRY(allocate(b, err));
  EP_TRY(check_poses(b, "example", b->basis->examples, poses, err));
  EP_TRY(check_poses(b, "path sample", npaths, paths, err));
  add_examples(b, b->basis->examples, poses, log);
  EP_TRY(gather_candidates(b, modes, npaths, paths, err));
  if (b->filled < b->basis->r) EP_TRY(add_principal(b, err));
  EP_TRY(reduce_stiffness(b, err));
  project_examples(b, poses);
  return EP_OK;
}

ep_status ep_basis_build(const ep_fem *fem, const ep_modes *modes, int examples,
                         const double *poses, int npaths, const double *paths, int r, ep_log *log,
                         ep_basis *out, ep_error *err) {
  *out = (ep_basis){.n = fem->mesh->nv, .r = r, .examples = examples};
  builder b = {.fem = fem, .n3 = 3 * (size_t)fem->mesh->nv, .basis = out};
  if (modes->n != fem->mesh->nv)
    return ep_fail(err, EP_ERR_ARGUMENT, "modes are of another mesh (%d vertices, not %d)",
                   modes->n, fem->mesh->nv);
  if (examples < 0 || npaths < 0 || r < 1 || r < examples)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "%d basis vectors cannot hold %d examples: raise `modes` to more than that", r,
                   examples);
  ep_status status = build(&b, modes, poses, npaths, paths, log, err);
  ep_csr_free(&b.mass);
  free(b.mu);
  free(b.rigid);
  free(b.candidate);
  if (status != EP_OK) ep_basis_free(out);
  return status;
}

void ep_basis_free(ep_basis *basis) {
  free(basis->u);
  free(basis->stiffness);
  free(basis->example_q);
  free(basis->example_residual);
  *basis = (ep_basis){0};
}
