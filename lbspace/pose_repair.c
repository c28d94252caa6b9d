// Repair of inverted and crushed tets. With J_e = det F_e, t the target and N the norm of LB-ARAP's
// global step (K, and springs lambda_j / softness on the m low coefficients, pose_solver.c):
//   min over u  1/2 |u - u0|_N^2 + w/2 sum over {e: J_e < t} V_e (t - J_e)^2,
// for w growing until no tet is below the floor. Gauss-Newton: with G the columns
// g_e = dJ_e/du (cofactors of F_e times the shape functions' gradients, 4 vertices each),
//   u = u0 + N^-1 G s,  (diag(1/(w V)) + G^T N^-1 G) s = t - J + G^T (u_k - u0),
// so N is factored once, with scalar unknowns, and each step costs a dense system of the size of
// the number of active tets. N^-1 is needed between vertices of active tets only: one solve for
// three new vertices, kept from step to step.
//
// Unlike Newton on an elastic energy of the whole object, which would relax the whole pose, this
// leaves what is whole where it is.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "lbspace/pose_solver.h"
#include "linalg/dense.h"

static const double WEIGHT_FIRST = 10, WEIGHT_LAST = 1e6, WEIGHT_GROWTH = 10;
static const double SETTLED = 1e-3; // relative decrease of the objective: go on to the next weight
static const double UNFOLDED = 0.4; // smallest singular value of F after unfolding
enum { HALVINGS = 12, ACTIVE_MOST = 4000, UNFOLDINGS = 4 };

ep_repair_options ep_default_repair_options(void) {
  return (ep_repair_options){.m = 10, .floor = 0.05, .target = 0.12, .iterations = 60};
}

typedef struct tet_counts {
  int crushed, inverted;
  double worst; // smallest deformed / rest volume
} tet_counts;

typedef struct repair {
  const ep_mesh *mesh;
  const ep_repair_options *o;
  ep_pose_solver solver;
  double *delta, *trial, *step; // (n x 3) u - u0; a proposal; the way there
  const double *u0;             // (n x 3)
  double *best;                 // (n x 3) the delta seen that left least to repair, and
  tet_counts left;              // what it left
  int iterations;               // Gauss-Newton steps so far
  double *coefficients;         // (m x 3)
  double w;
  // active tets
  int active, *tet;       // (active)
  double *gradient, *jac; // (active x 12) dJ/du, (active) J
  // inverse of N between involved vertices
  int nodes, room, *node, *place; // (nodes) vertex; (n) number of a vertex among them or -1
  int *pin;                       // (components) lowest vertex of each
  double *inverse;                // (room x room)
} repair;

static ep_status no_memory(const repair *r, ep_error *err) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory to repair a pose of %d vertices", r->mesh->nv);
}

// J of tet e at displacement u0 + delta; where g (12): its derivative by the four vertices.
static double jacobian(const repair *r, int e, const double *delta, double *g) {
  const double *shape = r->solver.gradient + 12 * (size_t)e;
  const int *v = r->mesh->tet + 4 * (size_t)e;
  double f[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, c[9];
  for (int i = 0; i < 4; i++)
    for (int k = 0; k < 9; k++) {
      const size_t at = 3 * (size_t)v[i] + (size_t)(k / 3);
      f[k] += (r->u0[at] + delta[at]) * shape[3 * i + k % 3];
    }
  for (int a = 0; a < 3; a++)
    for (int b = 0; b < 3; b++) {
      const int a1 = (a + 1) % 3, a2 = (a + 2) % 3, b1 = (b + 1) % 3, b2 = (b + 2) % 3;
      c[3 * a + b] = f[3 * a1 + b1] * f[3 * a2 + b2] - f[3 * a1 + b2] * f[3 * a2 + b1];
    }
  for (int i = 0; g && i < 4; i++)
    for (int a = 0; a < 3; a++)
      g[3 * i + a] = c[3 * a] * shape[3 * i] + c[3 * a + 1] * shape[3 * i + 1] +
                     c[3 * a + 2] * shape[3 * i + 2];
  return f[0] * c[0] + f[1] * c[1] + f[2] * c[2];
}

// |delta|_N^2
static double norm_squared(repair *r, const double *delta) {
  const ep_pose_solver *s = &r->solver;
  double sum = 0;
  for (int e = 0; e < r->mesh->nt; e++) {
    const double *shape = s->gradient + 12 * (size_t)e;
    const int *v = r->mesh->tet + 4 * (size_t)e;
    for (int k = 0; k < 9; k++) {
      double d = 0;
      for (int i = 0; i < 4; i++)
        d += delta[3 * (size_t)v[i] + (size_t)(k / 3)] * shape[3 * i + k % 3];
      sum += s->volume[e] * d * d;
    }
  }
  return sum + ep_pose_spring_energy(s, delta, r->coefficients);
}

static double objective(repair *r, const double *delta) {
  double sum = 0.5 * norm_squared(r, delta);
  for (int e = 0; e < r->mesh->nt; e++) {
    const double miss = r->o->target - jacobian(r, e, delta, NULL);
    if (miss > 0) sum += 0.5 * r->w * r->solver.volume[e] * miss * miss;
  }
  return sum;
}

// ---- the active tets ---------------------------------------------------------------------------

static ep_status find_active(repair *r, ep_error *err) {
  int count = 0;
  for (int e = 0; e < r->mesh->nt; e++) count += jacobian(r, e, r->delta, NULL) < r->o->target;
  free(r->tet);
  free(r->gradient);
  r->tet = malloc((size_t)(count + 1) * sizeof *r->tet);
  r->gradient = malloc(13 * (size_t)(count + 1) * sizeof *r->gradient);
  r->active = 0;
  if (!r->tet || !r->gradient) return no_memory(r, err);
  r->jac = r->gradient + 12 * (size_t)count;
  for (int e = 0; e < r->mesh->nt; e++) {
    double g[12];
    const double j = jacobian(r, e, r->delta, g);
    if (!(j < r->o->target)) continue;
    memcpy(r->gradient + 12 * (size_t)r->active, g, sizeof g);
    r->jac[r->active] = j;
    r->tet[r->active++] = e;
  }
  return EP_OK;
}

static ep_status make_room(repair *r, int wanted, ep_error *err) {
  if (wanted <= r->room) return EP_OK;
  const size_t room = 2 * (size_t)wanted;
  double *inverse = malloc(room * room * sizeof *inverse);
  int *node = realloc(r->node, room * sizeof *node);
  if (node) r->node = node;
  if (!inverse || !node) {
    free(inverse);
    return no_memory(r, err);
  }
  for (size_t i = 0; i < (size_t)r->nodes; i++)
    memcpy(inverse + i * room, r->inverse + i * (size_t)r->room,
           (size_t)r->nodes * sizeof *inverse);
  free(r->inverse);
  r->inverse = inverse;
  r->room = (int)room;
  return EP_OK;
}

// Nothing held: N^-1 is determined up to a constant for each component and right-hand side, which
// drops out because the columns of G sum to zero. What is kept is made symmetric by taking the
// component's lowest vertex as origin.
static double origin(const repair *r, int i, int c, const double *x) {
  if (r->solver.held) return 0;
  return x[3 * (size_t)r->pin[r->solver.component[r->node[i]]] + (size_t)c];
}

// Columns of N^-1 for the nodes from `first` on, three at a time.
static ep_status solve_columns(repair *r, int first, ep_error *err) {
  const size_t n3 = 3 * (size_t)r->mesh->nv, room = (size_t)r->room;
  double *rhs = r->solver.rhs, *x = r->trial;
  for (int at = first; at < r->nodes; at += 3) {
    const int columns = r->nodes - at < 3 ? r->nodes - at : 3;
    memset(rhs, 0, n3 * sizeof *rhs);
    for (int c = 0; c < columns; c++) rhs[3 * (size_t)r->node[at + c] + (size_t)c] = 1;
    EP_TRY(ep_pose_solve(&r->solver, rhs, x, err));
    for (int c = 0; c < columns; c++)
      for (int i = 0; i < r->nodes; i++) {
        const double value = x[3 * (size_t)r->node[i] + (size_t)c] - origin(r, i, c, x);
        r->inverse[(size_t)i * room + (size_t)(at + c)] = value;
        r->inverse[(size_t)(at + c) * room + (size_t)i] = value;
      }
  }
  return EP_OK;
}

static ep_status find_nodes(repair *r, ep_error *err) {
  const int before = r->nodes;
  EP_TRY(make_room(r, before + 4 * r->active, err));
  for (int a = 0; a < r->active; a++)
    for (int i = 0; i < 4; i++) {
      const int v = r->mesh->tet[4 * (size_t)r->tet[a] + (size_t)i];
      if (r->place[v] >= 0) continue;
      r->place[v] = r->nodes;
      r->node[r->nodes++] = v;
    }
  return solve_columns(r, before, err);
}

// ---- one step ----------------------------------------------------------------------------------

// The dense system of the active tets; s: right-hand side in, multipliers out.
static ep_status solve_active(repair *r, double *s, ep_error *err) {
  const size_t count = (size_t)r->active, room = (size_t)r->room;
  double *a = malloc(count * count * sizeof *a);
  if (!a) return no_memory(r, err);
  for (size_t e = 0; e < count; e++)
    for (size_t f = 0; f <= e; f++) {
      const int *ve = r->mesh->tet + 4 * (size_t)r->tet[e],
                *vf = r->mesh->tet + 4 * (size_t)r->tet[f];
      double sum = e == f ? 1 / (r->w * r->solver.volume[r->tet[e]]) : 0;
      for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
          const double *ge = r->gradient + 12 * e + 3 * i, *gf = r->gradient + 12 * f + 3 * j;
          sum += r->inverse[(size_t)r->place[ve[i]] * room + (size_t)r->place[vf[j]]] *
                 (ge[0] * gf[0] + ge[1] * gf[1] + ge[2] * gf[2]);
        }
      a[e * count + f] = a[f * count + e] = sum;
    }
  const ep_status status = ep_solve_spd((int)count, a, 1, s, err);
  free(a);
  return status;
}

// The Gauss-Newton point into r->trial.
static ep_status propose(repair *r, ep_error *err) {
  double *s = malloc((size_t)r->active * sizeof *s), *rhs = r->solver.rhs;
  if (!s) return no_memory(r, err);
  for (int a = 0; a < r->active; a++) {
    s[a] = r->o->target - r->jac[a];
    for (int i = 0; i < 12; i++) {
      const size_t v = (size_t)r->mesh->tet[4 * (size_t)r->tet[a] + (size_t)(i / 3)];
      s[a] += r->gradient[12 * (size_t)a + (size_t)i] * r->delta[3 * v + (size_t)(i % 3)];
    }
  }
  const ep_status status = solve_active(r, s, err);
  if (status == EP_OK) {
    memset(rhs, 0, 3 * (size_t)r->mesh->nv * sizeof *rhs);
    for (int a = 0; a < r->active; a++)
      for (int i = 0; i < 12; i++) {
        const size_t v = (size_t)r->mesh->tet[4 * (size_t)r->tet[a] + (size_t)(i / 3)];
        rhs[3 * v + (size_t)(i % 3)] += r->gradient[12 * (size_t)a + (size_t)i] * s[a];
      }
  }
  free(s);
  return status == EP_OK ? ep_pose_solve(&r->solver, rhs, r->trial, err) : status;
}

// From r->delta towards the proposal as far as the objective falls. *decrease relative.
static ep_status advance(repair *r, double *decrease, ep_error *err) {
  const size_t n3 = 3 * (size_t)r->mesh->nv;
  const double before = objective(r, r->delta);
  double after = before, length = 1;
  EP_TRY(propose(r, err));
  for (size_t i = 0; i < n3; i++) r->step[i] = r->trial[i] - r->delta[i];
  for (int i = 0; i < HALVINGS; i++, length *= 0.5) {
    for (size_t k = 0; k < n3; k++) r->trial[k] = r->delta[k] + length * r->step[k];
    after = objective(r, r->trial);
    if (after < before) break;
  }
  *decrease = after < before ? 1 - after / before : 0;
  if (after < before) memcpy(r->delta, r->trial, n3 * sizeof *r->delta);
  return EP_OK;
}

static tet_counts count_tets(const repair *r) {
  tet_counts counts = {.worst = INFINITY};
  for (int e = 0; e < r->mesh->nt; e++) {
    const double j = jacobian(r, e, r->delta, NULL);
    counts.inverted += !(j > 0);
    counts.crushed += !(j >= r->o->floor);
    counts.worst = fmin(counts.worst, j);
  }
  return counts;
}

static bool whole(const repair *r) {
  for (int e = 0; e < r->mesh->nt; e++)
    if (!(jacobian(r, e, r->delta, NULL) >= r->o->floor)) return false;
  return true;
}

// Neither a step nor an unfolding is sure to leave fewer crushed tets than there were.
static void keep_best(repair *r) {
  const tet_counts now = count_tets(r), best = r->left;
  if (now.crushed > best.crushed) return;
  if (now.crushed == best.crushed) {
    if (now.inverted > best.inverted) return;
    if (now.inverted == best.inverted && now.worst <= best.worst) return;
  }
  r->left = now;
  memcpy(r->best, r->delta, 3 * (size_t)r->mesh->nv * sizeof *r->best);
}

static ep_status descend(repair *r, ep_error *err) {
  for (; r->iterations < r->o->iterations && !whole(r); r->iterations++) {
    double decrease;
    EP_TRY(find_active(r, err));
    if (r->active > ACTIVE_MOST) return EP_OK; // no pose any more: the report says so
    EP_TRY(find_nodes(r, err));
    EP_TRY(advance(r, &decrease, err));
    keep_best(r);
    if (decrease >= SETTLED) continue;
    if (r->w >= WEIGHT_LAST) return EP_OK;
    r->w *= WEIGHT_GROWTH;
  }
  return EP_OK;
}

// ---- unfolding ---------------------------------------------------------------------------------

// F of tet e with its singular values no less than UNFOLDED, right way round. That goes by the
// factors themselves: where two singular values vanish J is round-off, of either sign, and so is
// the handedness of the factors.
static ep_status unfolded(const repair *r, int e, double *out, ep_error *err) {
  const double *shape = r->solver.gradient + 12 * (size_t)e;
  const int *v = r->mesh->tet + 4 * (size_t)e;
  double f[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, left[9], s[3], right[9];
  for (int i = 0; i < 4; i++)
    for (int k = 0; k < 9; k++) {
      const size_t at = 3 * (size_t)v[i] + (size_t)(k / 3);
      f[k] += (r->u0[at] + r->delta[at]) * shape[3 * i + k % 3];
    }
  EP_TRY(ep_svd(3, 3, f, left, s, right, err));
  if (ep_determinant3(left) * ep_determinant3(right) < 0) // the shortest axis points the wrong way
    for (int k = 0; k < 3; k++) left[3 * k + 2] = -left[3 * k + 2];
  for (int i = 0; i < 9; i++) {
    out[i] = 0;
    for (int k = 0; k < 3; k++)
      out[i] += left[3 * (i / 3) + k] * fmax(s[k], UNFOLDED) * right[3 * k + i % 3];
  }
  return EP_OK;
}

// Adds where tet e wants its vertices (delta) to sum (n x 3) and counts them.
static ep_status want(const repair *r, int e, double *sum, int *count, ep_error *err) {
  const int *v = r->mesh->tet + 4 * (size_t)e;
  double f[9], rest[3] = {0, 0, 0}, now[3] = {0, 0, 0};
  EP_TRY(unfolded(r, e, f, err));
  for (int i = 0; i < 4; i++)
    for (int k = 0; k < 3; k++) {
      const size_t at = 3 * (size_t)v[i] + (size_t)k;
      rest[k] += r->mesh->x[at] / 4;
      now[k] += (r->mesh->x[at] + r->u0[at] + r->delta[at]) / 4;
    }
  for (int i = 0; i < 4; i++) {
    count[v[i]]++;
    for (int k = 0; k < 3; k++) {
      const size_t at = 3 * (size_t)v[i] + (size_t)k;
      double x = now[k];
      for (int c = 0; c < 3; c++)
        x += f[3 * k + c] * (r->mesh->x[3 * (size_t)v[i] + (size_t)c] - rest[c]);
      sum[at] += x - r->mesh->x[at] - r->u0[at];
    }
  }
  return EP_OK;
}

// A tet pressed onto a line has no derivative of its volume to go by. So the tets left below the
// floor are opened by themselves, each vertex to the mean of what its tets want; the descent then
// goes on from there at the last weight.
static ep_status unfold(repair *r, ep_error *err) {
  const size_t n = (size_t)r->mesh->nv;
  double *sum = calloc(3 * n, sizeof *sum);
  int *count = calloc(n, sizeof *count);
  ep_status status = sum && count ? EP_OK : no_memory(r, err);
  for (int e = 0; e < r->mesh->nt && status == EP_OK; e++)
    if (!(jacobian(r, e, r->delta, NULL) >= r->o->floor)) status = want(r, e, sum, count, err);
  for (size_t i = 0; i < 3 * n && status == EP_OK; i++)
    if (count[i / 3] && !(r->o->held && r->o->held[i / 3])) r->delta[i] = sum[i] / count[i / 3];
  free(sum);
  free(count);
  return status;
}

static ep_status iterate(repair *r, ep_error *err) {
  r->w = WEIGHT_FIRST;
  r->left = count_tets(r);
  EP_TRY(descend(r, err));
  for (int i = 0;
       i < UNFOLDINGS && r->iterations < r->o->iterations && !whole(r) && r->active <= ACTIVE_MOST;
       i++) {
    EP_TRY(unfold(r, err));
    keep_best(r);
    EP_TRY(descend(r, err));
  }
  memcpy(r->delta, r->best, 3 * (size_t)r->mesh->nv * sizeof *r->delta);
  return EP_OK;
}

// ---- the report --------------------------------------------------------------------------------

static void measure_move(repair *r, ep_repair_report *report) {
  const ep_pose_solver *s = &r->solver;
  const double diagonal = ep_mesh_diagonal(r->mesh);
  double sum = 0, volume = 0, most = 0, pose = 0;
  for (int v = 0; v < r->mesh->nv; v++) {
    const double *d = r->delta + 3 * (size_t)v, square = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    sum += s->vertex_volume[v] * square;
    const double *u = r->u0 + 3 * (size_t)v;
    pose += s->vertex_volume[v] * (u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    volume += s->vertex_volume[v];
    most = fmax(most, square);
  }
  report->moved = sqrt(sum / volume) / diagonal;
  report->moved_most = sqrt(most) / diagonal;
  report->moved_share = sqrt(sum / pose); // a pose with inverted tets is not at rest: pose > 0
  double shift = 0, size = 0;
  ep_pose_coefficients(s, r->delta, r->coefficients);
  for (int i = 0; i < 3 * s->m; i++) shift += r->coefficients[i] * r->coefficients[i];
  ep_pose_coefficients(s, r->u0, r->coefficients);
  for (int i = 0; i < 3 * s->m; i++) size += r->coefficients[i] * r->coefficients[i];
  report->coefficient_shift = shift > 0 ? sqrt(shift / size) : 0;
}

// ---- set-up ------------------------------------------------------------------------------------

static ep_status check(const ep_mesh *mesh, const ep_lb *lb, const ep_repair_options *o,
                       const double *u, ep_error *err) {
  const int most = lb ? lb->m : 0;
  if (lb && lb->n != mesh->nv)
    return ep_fail(err, EP_ERR_ARGUMENT, "repair: eigenfunctions of %d vertices, mesh of %d", lb->n,
                   mesh->nv);
  if (o->m < 0 || o->m > most || 2 * o->m > mesh->nv)
    return ep_fail(err, EP_ERR_ARGUMENT, "repair: %d coefficients to keep of %d eigenfunctions",
                   o->m, most);
  if (!(o->floor >= 0) || !(o->target > o->floor) || !(o->target < 1) || o->iterations < 0)
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "repair: floor %g, target %g, %d iterations; expected 0 <= floor < target < 1",
                   o->floor, o->target, o->iterations);
  for (int i = 0; i < 3 * mesh->nv; i++)
    if (!isfinite(u[i]))
      return ep_fail(err, EP_ERR_ARGUMENT, "repair: vertex %d is not at a finite place", i / 3);
  return EP_OK;
}

static ep_status allocate(repair *r, const ep_lb *lb, ep_error *err) {
  static const ep_lb nothing = {0};
  const size_t n = (size_t)r->mesh->nv;
  r->delta = calloc(12 * n, sizeof *r->delta);
  r->place = malloc(n * sizeof *r->place);
  r->coefficients = malloc(3 * (size_t)(r->o->m + 1) * sizeof *r->coefficients);
  EP_TRY(ep_pose_solver_make(r->mesh, lb ? lb : &nothing, r->o->m, r->o->held, &r->solver, err));
  r->pin = malloc((size_t)r->solver.components * sizeof *r->pin);
  if (!r->delta || !r->place || !r->coefficients || !r->pin) return no_memory(r, err);
  r->trial = r->delta + 3 * n;
  r->step = r->delta + 6 * n;
  r->best = r->delta + 9 * n;
  for (size_t v = n; v-- > 0;) {
    r->place[v] = -1;
    r->pin[r->solver.component[v]] = (int)v;
  }
  return EP_OK;
}

static void release(repair *r) {
  ep_pose_solver_free(&r->solver);
  free(r->delta);
  free(r->place);
  free(r->coefficients);
  free(r->pin);
  free(r->tet);
  free(r->gradient);
  free(r->node);
  free(r->inverse);
}

// Counts the pose's tets before anything is set up: most poses need no repair.
static bool needs_repair(const ep_mesh *mesh, const ep_repair_options *o, const double *u,
                         ep_repair_report *report, double *volume) {
  double *rest = volume, *now = volume + mesh->nt, *x = volume + 2 * (size_t)mesh->nt;
  for (int i = 0; i < 3 * mesh->nv; i++) x[i] = mesh->x[i] + u[i];
  ep_tet_volumes(mesh, mesh->x, rest);
  ep_tet_volumes(mesh, x, now);
  report->worst_before = INFINITY;
  for (int e = 0; e < mesh->nt; e++) {
    const double ratio = now[e] / rest[e];
    report->inverted_before += !(ratio > 0);
    report->crushed_before += !(ratio >= o->floor);
    report->worst_before = fmin(report->worst_before, ratio);
  }
  report->inverted_after = report->inverted_before;
  report->crushed_after = report->crushed_before;
  report->worst_after = report->worst_before;
  return report->crushed_before > 0;
}

static ep_status run(const ep_mesh *mesh, const ep_lb *lb, const ep_repair_options *o, double *u,
                     ep_repair_report *report, ep_error *err) {
  repair r = {.mesh = mesh, .o = o, .u0 = u};
  ep_status status = allocate(&r, lb, err);
  if (status == EP_OK) status = iterate(&r, err);
  if (status == EP_OK) {
    report->iterations = r.iterations;
    report->inverted_after = r.left.inverted;
    report->crushed_after = r.left.crushed;
    report->worst_after = r.left.worst;
    measure_move(&r, report);
    for (int i = 0; i < 3 * mesh->nv; i++)
      if (!o->held || !o->held[i / 3]) u[i] += r.delta[i];
  }
  release(&r);
  return status;
}

ep_status ep_lb_repair(const ep_mesh *mesh, const ep_lb *lb, const ep_repair_options *options,
                       double *u, ep_repair_report *report, ep_error *err) {
  ep_repair_report unused;
  if (!report) report = &unused;
  *report = (ep_repair_report){0};
  EP_TRY(check(mesh, lb, options, u, err));
  double *volume = malloc((2 * (size_t)mesh->nt + 3 * (size_t)mesh->nv) * sizeof *volume);
  if (!volume)
    return ep_fail(err, EP_ERR_MEMORY, "no memory to look at a pose of %d vertices", mesh->nv);
  const bool needed = needs_repair(mesh, options, u, report, volume);
  free(volume);
  return needed && options->iterations ? run(mesh, lb, options, u, report, err) : EP_OK;
}
