#include "reduced/bake/model_build.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "reduced/bake/inertia.h"
#include "reduced/guard.h"
#include "reduced/reference.h"

// The arrays while they are written; the model itself holds pointers to const.
typedef struct arrays {
#define X(type, name, d1, d2, d3) ep_model_##type *name;
  EP_MODEL_ARRAYS(X)
#undef X
} arrays;

typedef struct builder {
  const ep_model_parts *parts;
  ep_model_sizes size;
  arrays a;
} builder;

static ep_status check_regions(const ep_model_parts *p, ep_error *err) {
  for (int g = 0; g < p->regions; g++) {
    int examples = 0;
    for (int i = 0; i < p->basis->examples; i++) examples += p->example_region[i] == g;
    if (p->region[g].m < 1 || p->region[g].m > p->lb->m)
      return ep_fail(err, EP_ERR_ARGUMENT,
                     "region %d wants %d eigenfunctions, the Laplace-Beltrami space has %d", g,
                     p->region[g].m, p->lb->m);
    if (!examples) return ep_fail(err, EP_ERR_ARGUMENT, "region %d has no example", g);
  }
  return EP_OK;
}

static ep_status check_parts(const ep_model_parts *p, ep_error *err) {
  if (p->basis->n != p->fem->mesh->nv)
    return ep_fail(err, EP_ERR_ARGUMENT, "the basis is of another mesh (%d vertices, not %d)",
                   p->basis->n, p->fem->mesh->nv);
  const bool penalty = p->fem->model == EP_STVK_VOLUME;
  if (p->s < 1 && (!p->cubic || p->m > 0 || penalty))
    return ep_fail(err, EP_ERR_ARGUMENT, "a model needs cubature elements%s",
                   !p->cubic ? ""
                   : penalty ? " for the volume penalty"
                             : " for its examples");
  if (p->m < 0 || (p->m > 0 && (!p->lb || !p->lb_mass)))
    return ep_fail(err, EP_ERR_ARGUMENT, "descriptors need the Laplace-Beltrami space");
  if (p->m > 0 && (p->lb->m < p->m || p->lb->n != p->basis->n || p->lb_mass->n != p->basis->n))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "%d eigenfunctions wanted, the Laplace-Beltrami space has %d on %d vertices",
                   p->m, p->lb->m, p->lb->n);
  EP_TRY(check_regions(p, err));
  if (p->green && (p->green->r != p->basis->r || p->green->k != p->basis->examples))
    return ep_fail(err, EP_ERR_ARGUMENT, "the Green-strain coefficients are of another basis");
  if (p->basis->examples > 0 && p->m == 0 && !p->green)
    return ep_fail(err, EP_ERR_ARGUMENT, "%d examples, but no eigenfunctions to describe them",
                   p->basis->examples);
  for (int j = 0; j < p->s; j++) {
    if (p->tet[j] < 0 || p->tet[j] >= p->fem->mesh->nt)
      return ep_fail(err, EP_ERR_ARGUMENT, "cubature element %d is tet %d, but there are %d", j,
                     p->tet[j], p->fem->mesh->nt);
    if (!(p->weight[j] >= 0) || !isfinite(p->weight[j]))
      return ep_fail(err, EP_ERR_ARGUMENT, "cubature element %d has the weight %g", j,
                     p->weight[j]);
  }
  for (int i = 0; i < p->guards; i++) {
    if (p->guard_tet[i] < 0 || p->guard_tet[i] >= p->fem->mesh->nt || !(p->guard_w[i] >= 0) ||
        !(p->guard_limit[i] > 0) || p->guard_limit[i] > 1 || !isfinite(p->guard_w[i]))
      return ep_fail(err, EP_ERR_ARGUMENT, "guard %d is tet %d with weight %g and limit %g", i,
                     p->guard_tet[i], p->guard_w[i], p->guard_limit[i]);
  }
  return EP_OK;
}

// cubature_g has a layout of its own (padded lanes), so its size is that of the packing function.
static ep_status allocate(builder *b, ep_model_memory *out, ep_error *err) {
  const ep_model_sizes *z = &b->size;
  int n = z->n, nt = z->nt, r = z->r, m = z->m, k = z->k, s = z->s, blocks = z->blocks;
  int greens = z->greens, cubic = z->cubic, cubic_float = z->cubic_float, rigid = z->rigid;
  int regions = z->regions, cubature_float = z->cubature_float;
  (void)n, (void)nt, (void)r, (void)m, (void)k, (void)s, (void)blocks, (void)greens, (void)cubic,
      (void)cubic_float, (void)rigid, (void)regions, (void)cubature_float;
  const int contacts = z->contacts, nodes = z->nodes, guards = z->guards;
#define X(type, name, d1, d2, d3)                                                                  \
  if ((size_t)(d1) * (size_t)(d2) * (size_t)(d3) > 0) {                                            \
    size_t bytes = (size_t)(d1) * (size_t)(d2) * (size_t)(d3) * sizeof *b->a.name;                 \
    b->a.name = aligned_alloc(64, (bytes + 63) / 64 * 64);                                         \
    if (!b->a.name) return ep_fail(err, EP_ERR_MEMORY, "no memory for the model's " #name);        \
    memset(b->a.name, 0, bytes);                                                                   \
    out->owned[out->count++] = b->a.name;                                                          \
  }
  EP_MODEL_ARRAYS(X)
#undef X
  return EP_OK;
}

static void copy_mesh_and_modes(builder *b) {
  const ep_mesh *mesh = b->parts->fem->mesh;
  const ep_basis *basis = b->parts->basis;
  const size_t r = (size_t)basis->r, n3 = 3 * (size_t)mesh->nv;
  memcpy(b->a.rest_x, mesh->x, n3 * sizeof(double));
  for (size_t i = 0; i < 4 * (size_t)mesh->nt; i++) b->a.tets[i] = mesh->tet[i];
  memcpy(b->a.u, basis->u, r * n3 * sizeof(double));
  memcpy(b->a.k0, basis->stiffness, r * r * sizeof(double));
  if (basis->examples > 0)
    memcpy(b->a.example_q, basis->example_q, (size_t)basis->examples * r * sizeof(double));
}

static ep_region_part everywhere(const ep_model_parts *p) {
  return (ep_region_part){.weight = NULL, .m = p->m};
}

// Whether the constant function belongs to the region's descriptor: its mean displacement means
// something only where the region is held.
static int constants(const ep_model_parts *p, const ep_region_part *region) {
  return p->fem->nheld > 0 && !ep_region_carried(p->fem, region);
}

// M phi of function f of a region: the constant one first where it is held.
static void weighted_function(const builder *b, const ep_region_part *region, int f, double *work,
                              double *out) {
  const ep_lb *lb = b->parts->lb;
  const int constant = constants(b->parts, region);
  for (int i = 0; i < lb->n; i++)
    work[i] = f < constant ? 1 / sqrt(lb->volume)
                           : lb->phi[(size_t)(f - constant) * (size_t)lb->n + (size_t)i];
  if (region->weight)
    ep_region_mass(b->parts->fem->mesh, region, work, out);
  else
    ep_csr_multiply(b->parts->lb_mass, 1, work, out);
}

// row of c (3) = (M phi)^T x
static void describe(int n, const double *mphi, const double *x, double c[3]) {
  c[0] = c[1] = c[2] = 0;
  for (int i = 0; i < n; i++)
    for (int a = 0; a < 3; a++) c[a] += mphi[i] * x[3 * (size_t)i + (size_t)a];
}

// Function f of a region becomes function `at` of the model. work (2 n).
static void describe_function(builder *b, const ep_region_part *region, int f, int at,
                              double *work) {
  const int n = b->size.n, r = b->size.r;
  double *mphi = work + n, c[3];
  weighted_function(b, region, f, work, mphi);
  describe(n, mphi, b->a.rest_x, b->a.c0 + 3 * at);
  for (int j = 0; j < r; j++) {
    describe(n, mphi, b->a.u + (size_t)j * 3 * (size_t)n, c);
    for (int a = 0; a < 3; a++) b->a.t[(size_t)(3 * at + a) * (size_t)r + (size_t)j] = c[a];
  }
  for (int i = 0; b->a.region_mean && i < n; i++) b->a.region_mean[at] += mphi[i];
}

static ep_status build_descriptors(builder *b, ep_error *err) {
  const ep_model_parts *p = b->parts;
  const ep_region_part whole = everywhere(p);
  double *work = malloc(2 * (size_t)b->size.n * sizeof *work);
  if (!work) return ep_fail(err, EP_ERR_MEMORY, "no memory for the model's descriptors");
  int at = 0;
  for (int g = 0; g < (p->regions ? p->regions : 1); g++) {
    const ep_region_part *region = p->regions ? &p->region[g] : &whole;
    const int functions = region->m + constants(p, region);
    for (int f = 0; f < functions; f++) describe_function(b, region, f, at++, work);
    if (p->regions) b->a.region_first[g + 1] = at;
  }
  free(work);
  return EP_OK;
}

// Where regions act, and how the motion of one that is carried is told.
static ep_status build_regions(builder *b, ep_error *err) {
  const ep_model_parts *p = b->parts;
  const size_t r = (size_t)b->size.r, s = (size_t)b->size.s;
  for (int i = 0; b->size.regions && i < b->size.k; i++)
    b->a.example_region[i] = p->example_region[i];
  for (size_t g = 0; g < (size_t)b->size.regions; g++) {
    for (size_t j = 0; j < s; j++) {
      const double share = ep_region_share(p->fem->mesh, &p->region[g], p->tet[j]);
      b->a.region_inside[g * s + j] = share * p->weight[j];
      b->a.region_outside[g * s + j] = (1 - share) * p->weight[j];
    }
    if (!ep_region_carried(p->fem, &p->region[g])) continue;
    b->a.region_carried[g] = 1;
    EP_TRY(ep_region_motion(p->basis, p->fem->mesh, &p->region[g], b->a.region_motion + g * 12 * r,
                            b->a.region_motion_rest + g * 12, err));
  }
  return EP_OK;
}

// g (9 x r) of one element: dF_ab / dq_j = sum_v U_j(v)_a g_v,b
static void element_gradient(const builder *b, int e, double *g) {
  const ep_fem *fem = b->parts->fem;
  const int *tet = fem->mesh->tet + 4 * (size_t)e;
  const double *shape = fem->gradient + 12 * (size_t)e;
  const size_t r = (size_t)b->size.r, n3 = 3 * (size_t)b->size.n;
  for (size_t j = 0; j < r; j++)
    for (int a = 0; a < 3; a++)
      for (int c = 0; c < 3; c++) {
        double sum = 0;
        for (int v = 0; v < 4; v++)
          sum += b->a.u[j * n3 + 3 * (size_t)tet[v] + (size_t)a] * shape[3 * v + c];
        g[(size_t)(3 * a + c) * r + j] = sum;
      }
}

static void example_at_element(builder *b, int example, int j, const double *g) {
  const int r = b->size.r, s = b->size.s;
  const double *q = b->a.example_q + (size_t)example * (size_t)r;
  const size_t at = (size_t)example * (size_t)s + (size_t)j;
  double f[9];
  for (int i = 0; i < 9; i++) {
    f[i] = i % 4 == 0;
    for (int a = 0; a < r; a++) f[i] += g[(size_t)i * (size_t)r + (size_t)a] * q[a];
  }
  b->a.example_w[at] = b->parts->weight[j] * ep_reference_element(f, b->a.example_finv + 9 * at);
  if (b->size.regions)
    b->a.example_w[at] *=
        ep_region_share(b->parts->fem->mesh, &b->parts->region[b->parts->example_region[example]],
                        b->parts->tet[j]);
}

static ep_status fill_cubature(builder *b, double *g, ep_error *err) {
  const ep_model_parts *p = b->parts;
  for (int j = 0; j < p->s; j++) {
    double *gj = g + (size_t)j * 9 * (size_t)b->size.r;
    element_gradient(b, p->tet[j], gj);
    b->a.cubature_tet[j] = p->tet[j];
    b->a.cubature_w[j] = p->weight[j];
    b->a.cubature_lambda[j] = p->fem->lambda[p->tet[j]];
    b->a.cubature_mu[j] = p->fem->mu[p->tet[j]];
    for (int i = 0; b->size.m > 0 && i < b->size.k; i++) example_at_element(b, i, j, gj);
  }
  ep_pack_cubature(b->size.r, b->size.s, g, b->a.cubature_g);
  if (b->size.cubature_float &&
      ep_pack_cubature_float(b->size.r, b->size.s, g, b->a.cubature_g_float) != EP_OK)
    return ep_fail(
        err, EP_ERR_NUMERIC,
        "the deformation gradients of the modes do not fit floats: use double precision, "
        "or units nearer to the object's size");
  return EP_OK;
}

static ep_status build_cubature(builder *b, ep_error *err) {
  if (b->size.s == 0) return EP_OK;
  double *g = malloc((size_t)b->size.s * 9 * (size_t)b->size.r * sizeof *g);
  if (!g) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d cubature elements", b->size.s);
  const ep_status status = fill_cubature(b, g, err);
  free(g);
  return status;
}

static ep_status build_guards(builder *b, ep_error *err) {
  const ep_model_parts *p = b->parts;
  const size_t r = (size_t)b->size.r, width = 8 * (size_t)b->size.blocks;
  if (!p->guards) return EP_OK;
  double *g = malloc((size_t)p->guards * 9 * r * sizeof *g);
  if (!g) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d guards", p->guards);
  for (size_t i = 0; i < (size_t)p->guards; i++) {
    const int tet = p->guard_tet[i];
    double *gi = g + i * 9 * r;
    element_gradient(b, tet, gi);
    b->a.guard_tet[i] = tet;
    b->a.guard_w[i] = p->guard_w[i];
    b->a.guard_limit[i] = p->guard_limit[i];
    b->a.guard_stiffness[i] = ep_guard_stiffness(p->fem->lambda[tet], p->fem->mu[tet]);
    ep_guard_add_growth(b->size.r, gi, b->a.guard_growth + i / 8 * width);
  }
  ep_pack_cubature(b->size.r, p->guards, g, b->a.guard_g);
  free(g);
  return EP_OK;
}

static void fill_green(builder *b) {
  const ep_green_coefficients *green = b->parts->green;
  const int r = b->size.r, k = b->size.k, count = b->size.greens;
  const size_t width = 8 * (size_t)b->size.blocks;
  for (int i = 0; i < count; i++) {
    ep_pack_green(r, green->b + (size_t)i * (size_t)(r * r),
                  b->a.green_b + (size_t)i * ep_packed_green_size(r));
    memcpy(b->a.green_linear + (size_t)i * width, green->linear + (size_t)i * (size_t)r,
           (size_t)r * sizeof(double));
  }
  if (count == 0) return;
  memcpy(b->a.green_weights, green->weights, (size_t)(k * count) * sizeof(double));
  memcpy(b->a.green_energy, green->energy, (size_t)k * sizeof(double));
  for (int i = 0; i < k; i++) b->a.green_scale[0] += green->energy[i] / k;
}

// The stream, and what a state measures strains and forces by.
static ep_status fill_cubic(builder *b, ep_error *err) {
  const ep_model_parts *p = b->parts;
  const int r = b->size.r;
  const ep_status status = p->precision == EP_DOUBLE
                               ? ep_cubic_pack(r, p->cubic, b->a.cubic_stream)
                               : ep_cubic_pack_float(r, p->cubic, b->a.cubic_stream_float);
  if (status != EP_OK)
    return ep_fail(err, status,
                   "the cubic coefficients of %d modes do not fit %s: use double precision, or "
                   "other units",
                   r, p->precision == EP_DOUBLE ? "doubles" : "floats");
  double *g = malloc(9 * (size_t)r * sizeof *g);
  if (!g) return ep_fail(err, EP_ERR_MEMORY, "no memory for the scales of the model");
  for (int e = 0; e < b->size.nt; e++) {
    double square = 0;
    element_gradient(b, e, g);
    for (int i = 0; i < 9 * r; i++) square += g[i] * g[i];
    const double norm = sqrt(square);
    const double stiffness = p->fem->volume[e] * (p->fem->lambda[e] + 2 * p->fem->mu[e]);
    b->a.cubic_scales[0] = fmax(b->a.cubic_scales[0], norm);
    b->a.cubic_scales[1] += stiffness;
    b->a.cubic_scales[2] += stiffness * norm;
  }
  free(g);
  return EP_OK;
}

static void fill_contact(builder *b) {
  const ep_contact_tree *t = b->parts->contact;
  if (!t) return;
  const size_t n = (size_t)t->contacts, nodes = (size_t)t->nodes, r = (size_t)t->r;
  for (size_t i = 0; i < n; i++) b->a.contact_vertex[i] = t->vertex[i];
  for (size_t i = 0; i < 3 * nodes; i++) b->a.tree_range[i] = t->range[i];
  memcpy(b->a.contact_x, t->x, 3 * n * sizeof(double));
  memcpy(b->a.contact_area, t->area, n * sizeof(double));
  memcpy(b->a.contact_u, t->u, 3 * n * r * sizeof(double));
  memcpy(b->a.tree_center, t->center, 3 * nodes * sizeof(double));
  memcpy(b->a.tree_u, t->node_u, 3 * nodes * r * sizeof(double));
  memcpy(b->a.tree_radius, t->radius, nodes * sizeof(double));
  memcpy(b->a.tree_growth, t->growth, nodes * r * sizeof(double));
  b->a.contact_scale[0] = ep_fem_contact_unit(b->parts->fem);
}

static ep_status fill_inertia(builder *b, ep_error *err) {
  const ep_fem *fem = b->parts->fem;
  ep_csr mass = {0};
  EP_TRY(ep_fem_scalar_mass(fem, &mass, err));
  const ep_status status =
      ep_inertia_sums(fem->mesh, &mass, b->size.r, b->a.u, b->a.rigid_mass, b->a.rigid_origin,
                      b->a.rigid_s0, b->a.rigid_s1, b->a.rigid_s2, b->a.rigid_h, err);
  ep_csr_free(&mass);
  return status;
}

// sum_v m_v U_a(v), m_v the rows' sums of the mass.
static ep_status fill_gravity(builder *b, ep_error *err) {
  const size_t n = (size_t)b->size.n, r = (size_t)b->size.r;
  ep_csr mass = {0};
  EP_TRY(ep_fem_scalar_mass(b->parts->fem, &mass, err));
  double *work = malloc(2 * n * sizeof *work);
  if (!work) {
    ep_csr_free(&mass);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for gravity");
  }
  double *weight = work + n;
  for (size_t v = 0; v < n; v++) work[v] = 1;
  ep_csr_multiply(&mass, 1, work, weight);
  for (size_t i = 0; i < 3 * n * r; i++)
    b->a.gravity_modes[i % 3 * r + i / (3 * n)] += weight[i % (3 * n) / 3] * b->a.u[i];
  free(work);
  ep_csr_free(&mass);
  return EP_OK;
}

static int cubic_size(const ep_model_parts *p, ep_precision precision) {
  return p->cubic && p->precision == precision ? (int)ep_cubic_stream_size(p->basis->r, precision)
                                               : 0;
}

static ep_model_sizes sizes_of(const ep_model_parts *p) {
  const ep_region_part whole = everywhere(p);
  int m = p->m > 0 ? p->m + constants(p, &whole) : 0;
  if (p->regions) m = 0;
  for (int g = 0; g < p->regions; g++) m += p->region[g].m + constants(p, &p->region[g]);
  return (ep_model_sizes){.n = p->fem->mesh->nv,
                          .nt = p->fem->mesh->nt,
                          .r = p->basis->r,
                          .m = m,
                          .k = p->basis->examples,
                          .regions = p->regions,
                          .s = p->s,
                          .blocks = (p->basis->r + 7) / 8,
                          .greens = p->green ? p->green->count : 0,
                          .cubic = cubic_size(p, EP_DOUBLE),
                          .cubic_float = cubic_size(p, EP_FLOAT),
                          .cubature_float = !p->cubic && p->precision == EP_FLOAT ? p->s : 0,
                          .guards = p->guards,
                          .contacts = p->contact ? p->contact->contacts : 0,
                          .nodes = p->contact ? p->contact->nodes : 0,
                          .rigid = ep_fem_is_free(p->fem)};
}

ep_status ep_model_build(const ep_model_parts *parts, ep_model_memory *out, ep_error *err) {
  *out = (ep_model_memory){.count = 0};
  EP_TRY(check_parts(parts, err));
  builder b = {.parts = parts, .size = sizes_of(parts)};
  ep_status status;
  EP_TRY_GOTO(status, allocate(&b, out, err), fail);
  copy_mesh_and_modes(&b);
  if (b.size.m > 0) EP_TRY_GOTO(status, build_descriptors(&b, err), fail);
  EP_TRY_GOTO(status, build_regions(&b, err), fail);
  EP_TRY_GOTO(status, build_cubature(&b, err), fail);
  EP_TRY_GOTO(status, build_guards(&b, err), fail);
  fill_green(&b);
  fill_contact(&b);
  EP_TRY_GOTO(status, b.size.rigid ? fill_inertia(&b, err) : fill_gravity(&b, err), fail);
  if (parts->cubic) EP_TRY_GOTO(status, fill_cubic(&b, err), fail);
  out->model.size = b.size;
  out->model.material = parts->fem->model;
  out->model.rest_scale = ep_mesh_extent(parts->fem->mesh);
#define X(type, name, d1, d2, d3) out->model.name = b.a.name;
  EP_MODEL_ARRAYS(X)
#undef X
  // With the model's own function: that of a region may not be linear in q.
  for (int i = 0; b.size.m > 0 && i < b.size.k; i++)
    ep_descriptor(&out->model, b.a.example_q + i * b.size.r, b.a.example_c + i * 3 * b.size.m);
  const int floats = parts->precision == EP_FLOAT;
  if (parts->cubic)
    out->model.evaluator = floats ? EP_EVALUATE_CUBIC_FLOAT : EP_EVALUATE_CUBIC;
  else
    out->model.evaluator = floats ? EP_EVALUATE_CUBATURE_FLOAT : EP_EVALUATE_CUBATURE;
  return EP_OK;
fail:
  ep_model_memory_free(out);
  return status;
}

void ep_model_memory_free(ep_model_memory *memory) {
  for (int i = 0; i < memory->count; i++) free(memory->owned[i]);
  *memory = (ep_model_memory){.count = 0};
}
