// Elastic refinement of a map and its reverse, together. The product space finds which part goes
// where; how parts stretch is left to chance there, because every smooth displacement costs the
// same. Here the images y of from's vertices minimise
//   sum_i s_i |y_i - f(i)|^2 + sum_j s_j |y(g(j)) - x_j|^2 + t sum_e V_e |grad y - R_e|^2
//     + LANDMARK sum_m |y(a_m) - b_m|^2,
// f the map to points of `to`, g the reverse map, s shares of volume, x_j the vertices of `to`, R_e
// the rotation nearest to grad y (as rigid as possible, Sorkine & Alexa 2007), a_m and b_m the
// landmarks; the same for the reverse map; then each vertex goes to the point of the other body
// nearest to its y, skin to skin. The second sum makes the two maps inverse to each other and keeps
// them from leaving out tips (after "Reversible harmonic maps", Ezuz, Solomon & Ben-Chen 2019, and
// "Symmetric volume maps", Abulnaga et al. 2023, whose energies are of this kind).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "align/private.h"
#include "linalg/dense.h"

// Weight of a landmark; both bodies have volume 1.
static const double LANDMARK = 0.05;
// The last rounds stand still where others go on by momentum: the images end where the maps do.
enum { SETTLE = 3, SOLVE_STEPS = 200 };
// Relative residual of a solve: rounds repeat it with other data.
static const double SOLVED = 1e-5;

// One direction: images of from's vertices in `to`.
typedef struct half {
  const ep_side *from, *to;
  double r[9], stiffness;
  double *target, *mark;     // (to->n x 3), (marks x 3) of `to` in from's frame
  double *y, *last;          // (from->n x 3) now; as the last round solved for them
  ep_point_map *map;         // from -> to
  const ep_point_map *other; // to -> from
} half;

// Conjugate gradients' vectors, large enough for either direction.
typedef struct solver {
  double *rhs, *residual, *scaled, *direction, *image, *diagonal; // (n x 3)
  double *work;                                                   // (n x 3)
} solver;

static ep_status make_half(const ep_side *from, const ep_side *to, const double r[9],
                           ep_point_map *map, double stiffness, const ep_point_map *other, half *h,
                           ep_error *err) {
  *h = (half){.from = from, .to = to, .stiffness = stiffness, .map = map, .other = other};
  memcpy(h->r, r, sizeof h->r);
  h->target = malloc(3 * (size_t)to->n * sizeof *h->target);
  h->mark = malloc((3 * (size_t)to->marks + 1) * sizeof *h->mark);
  h->y = malloc(3 * (size_t)from->n * sizeof *h->y);
  h->last = malloc(3 * (size_t)from->n * sizeof *h->last);
  if (!h->target || !h->mark || !h->y || !h->last)
    return ep_fail(err, EP_ERR_MEMORY, "no memory to refine a map of %d vertices", from->n);
  ep_frame_apply(to->n, r, to->x, h->target);
  ep_frame_apply(to->marks, r, to->mark_x, h->mark);
  ep_point_map_pull(map, from->n, to->shape->mesh, 3, h->target, h->y);
  return EP_OK;
}

static void free_half(half *h) {
  free(h->target);
  free(h->mark);
  free(h->y);
  free(h->last);
}

static ep_status make_solver(int n, solver *s, ep_error *err) {
  double *memory = malloc(21 * (size_t)n * sizeof *memory);
  if (!memory) return ep_fail(err, EP_ERR_MEMORY, "no memory to refine a map");
  double **const part[7] = {&s->rhs,   &s->residual, &s->scaled, &s->direction,
                            &s->image, &s->diagonal, &s->work};
  for (int i = 0; i < 7; i++) *part[i] = memory + 3 * (size_t)n * i;
  return EP_OK;
}

static void free_solver(solver *s) {
  free(s->rhs);
}

// out (from->n x 3) = the energy's matrix times y; work (from->n x 3).
static void multiply(const half *h, const double *y, double *out, double *work) {
  const ep_side *from = h->from;
  const double stiff = h->stiffness / from->length;
  ep_csr_multiply(&from->stiffness, 3, y, work);
  for (int i = 0; i < from->n; i++)
    for (int c = 0; c < 3; c++)
      out[3 * (size_t)i + c] =
          stiff * work[3 * (size_t)i + c] + from->share[i] * y[3 * (size_t)i + c];
  for (int j = 0; j < h->to->n; j++) {
    const int *corner = from->shape->mesh->tet + 4 * (size_t)h->other->tet[j];
    const double *w = h->other->weight + 4 * (size_t)j;
    for (int c = 0; c < 3; c++) {
      double at = 0;
      for (int k = 0; k < 4; k++) at += w[k] * y[3 * (size_t)corner[k] + c];
      at *= h->to->share[j];
      for (int k = 0; k < 4; k++) out[3 * (size_t)corner[k] + c] += w[k] * at;
    }
  }
  for (int m = 0; m < from->marks; m++)
    for (int c = 0; c < 3; c++)
      out[3 * (size_t)from->mark_near[m] + c] += LANDMARK * y[3 * (size_t)from->mark_near[m] + c];
}

static void fill_diagonal(const half *h, double *diagonal) {
  const ep_side *from = h->from;
  const double stiff = h->stiffness / from->length;
  for (int i = 0; i < from->n; i++)
    diagonal[3 * (size_t)i] =
        stiff * from->stiffness.value[ep_csr_find(&from->stiffness, i, i)] + from->share[i];
  for (int j = 0; j < h->to->n; j++)
    for (int k = 0; k < 4; k++) {
      const double w = h->other->weight[4 * (size_t)j + k];
      const int v = from->shape->mesh->tet[4 * (size_t)h->other->tet[j] + k];
      diagonal[3 * (size_t)v] += w * w * h->to->share[j];
    }
  for (int m = 0; m < from->marks; m++) diagonal[3 * (size_t)from->mark_near[m]] += LANDMARK;
  for (int i = 0; i < from->n; i++)
    diagonal[3 * (size_t)i + 1] = diagonal[3 * (size_t)i + 2] = diagonal[3 * (size_t)i];
}

// Gradient f of the images in tet e and the rotation r nearest to it; g (4 x 3) the shape
// functions' gradients [1 / model units]. Returns the tet's volume [model units].
static double gradient_of(const half *h, int e, double g[12], double f[9], double r[9]) {
  const ep_mesh *mesh = h->from->shape->mesh;
  const int *corner = mesh->tet + 4 * (size_t)e;
  const double volume = ep_tet_gradients(mesh, e, g);
  memset(f, 0, 9 * sizeof *f);
  for (int k = 0; k < 4; k++)
    for (int a = 0; a < 3; a++)
      for (int b = 0; b < 3; b++)
        f[3 * a + b] += h->from->length * h->y[3 * (size_t)corner[k] + a] * g[3 * k + b];
  ep_rotation_of(f, r);
  return volume;
}

// rhs += t sum_e V_e R_e grad phi.
static void add_rotations(const half *h, double *rhs) {
  const ep_mesh *mesh = h->from->shape->mesh;
  const double length = h->from->length;
  for (int e = 0; e < mesh->nt; e++) {
    double g[12], f[9], r[9];
    const int *corner = mesh->tet + 4 * (size_t)e;
    const double v = h->stiffness * gradient_of(h, e, g, f, r) / (length * length);
    for (int k = 0; k < 4; k++)
      for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++)
          rhs[3 * (size_t)corner[k] + a] += v * r[3 * a + b] * g[3 * k + b];
  }
}

static void fill_rhs(const half *h, double *rhs) {
  const ep_side *from = h->from;
  ep_point_map_pull(h->map, from->n, h->to->shape->mesh, 3, h->target, rhs);
  for (int i = 0; i < from->n; i++)
    for (int c = 0; c < 3; c++) rhs[3 * (size_t)i + c] *= from->share[i];
  for (int j = 0; j < h->to->n; j++)
    for (int k = 0; k < 4; k++) {
      const double w = h->other->weight[4 * (size_t)j + k] * h->to->share[j];
      const int v = from->shape->mesh->tet[4 * (size_t)h->other->tet[j] + k];
      for (int c = 0; c < 3; c++) rhs[3 * (size_t)v + c] += w * h->target[3 * (size_t)j + c];
    }
  // The vertex near a landmark belongs beside its partner, as far as it is beside the landmark.
  for (int m = 0; m < from->marks; m++) {
    const size_t v = 3 * (size_t)from->mark_near[m];
    for (int c = 0; c < 3; c++)
      rhs[v + c] += LANDMARK * (h->mark[3 * m + c] + from->x[v + c] - from->mark_x[3 * m + c]);
  }
  add_rotations(h, rhs);
}

static double dot(size_t n, const double *a, const double *b) {
  double sum = 0;
  for (size_t i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

// Conjugate gradients with Jacobi from h->y on.
static void solve(half *h, const solver *s) {
  const size_t n = 3 * (size_t)h->from->n;
  double *r = s->residual, *z = s->scaled, *p = s->direction, *q = s->image;
  fill_rhs(h, s->rhs);
  fill_diagonal(h, s->diagonal);
  multiply(h, h->y, q, s->work);
  for (size_t i = 0; i < n; i++) r[i] = s->rhs[i] - q[i];
  for (size_t i = 0; i < n; i++) p[i] = z[i] = r[i] / s->diagonal[i];
  const double stop = SOLVED * SOLVED * dot(n, s->rhs, s->rhs);
  double rho = dot(n, r, z);
  for (int step = 0; step < SOLVE_STEPS && dot(n, r, r) > stop; step++) {
    multiply(h, p, q, s->work);
    const double alpha = rho / dot(n, p, q), old = rho;
    for (size_t i = 0; i < n; i++) {
      h->y[i] += alpha * p[i];
      r[i] -= alpha * q[i];
      z[i] = r[i] / s->diagonal[i];
    }
    rho = dot(n, r, z);
    for (size_t i = 0; i < n; i++) p[i] = z[i] + rho / old * p[i];
  }
}

// Move the images on by `momentum` of their way since the last round.
static void move_on(half *h, double momentum) {
  for (size_t i = 0; i < 3 * (size_t)h->from->n; i++) {
    const double y = h->y[i];
    if (momentum > 0) h->y[i] += momentum * (y - h->last[i]);
    h->last[i] = y;
  }
}

static ep_status refine(half *there, half *back, const ep_match_rule *rule, const solver *s,
                        ep_error *err) {
  for (int round = 0; round < rule->rounds; round++) {
    const double momentum = round > 0 && round < rule->rounds - SETTLE ? rule->momentum : 0;
    solve(there, s);
    solve(back, s);
    move_on(there, momentum);
    move_on(back, momentum);
    EP_TRY(ep_match_positions(there->from, there->to, there->r, rule, there->y, there->map, err));
    EP_TRY(ep_match_positions(back->from, back->to, back->r, rule, back->y, back->map, err));
  }
  return EP_OK;
}

// sum_e V_e |grad y - R_e|^2 / V: how far the images are from rigid, part by part.
static double distortion_of(const half *h) {
  const ep_side *from = h->from;
  double sum = 0;
  for (int e = 0; e < from->shape->mesh->nt; e++) {
    double g[12], f[9], r[9], d2 = 0;
    const double volume = gradient_of(h, e, g, f, r);
    for (int i = 0; i < 9; i++) d2 += (f[i] - r[i]) * (f[i] - r[i]);
    sum += volume * d2;
  }
  return sum / from->shape->lb->volume;
}

// The first two sums of the energy. work (the larger side x 3).
static double misfit_of(const half *h, double *work) {
  const ep_side *from = h->from, *to = h->to;
  double sum = 0;
  ep_point_map_pull(h->map, from->n, to->shape->mesh, 3, h->target, work);
  for (int i = 0; i < 3 * from->n; i++) sum += from->share[i / 3] * pow(work[i] - h->y[i], 2);
  ep_point_map_pull(h->other, to->n, from->shape->mesh, 3, h->y, work);
  for (int i = 0; i < 3 * to->n; i++) sum += to->share[i / 3] * pow(work[i] - h->target[i], 2);
  return sum;
}

static void judge(const half *there, const half *back, const ep_match_rule *rule, double *work,
                  ep_elastic_quality *q) {
  const double a = distortion_of(there), b = distortion_of(back);
  q->distortion = sqrt(0.5 * (a + b));
  q->energy = misfit_of(there, work) + misfit_of(back, work) + rule->stiffness * (a + b);
}

ep_status ep_elastic_refine(const ep_side *from, const ep_side *to, const double r[9],
                            const ep_match_rule *rule, ep_point_map *there, ep_point_map *back,
                            ep_elastic_quality *quality, ep_error *err) {
  half h = {0}, b = {0};
  solver s = {0};
  double transposed[9];
  ep_frame_transpose(r, transposed);
  ep_status status = make_solver(from->n > to->n ? from->n : to->n, &s, err);
  if (status == EP_OK) status = make_half(from, to, r, there, rule->stiffness, back, &h, err);
  if (status == EP_OK)
    status = make_half(to, from, transposed, back, rule->stiffness, there, &b, err);
  if (status == EP_OK) status = refine(&h, &b, rule, &s, err);
  if (status == EP_OK) judge(&h, &b, rule, s.work, quality);
  free_half(&h);
  free_half(&b);
  free_solver(&s);
  return status;
}
