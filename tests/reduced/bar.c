#include "tests/reduced/bar.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void *own(bar *b, size_t bytes) {
  void *block = aligned_alloc(64, (bytes + 63) / 64 * 64);
  if (!block || b->owned_count == 64) abort();
  memset(block, 0, (bytes + 63) / 64 * 64);
  return b->owned[b->owned_count++] = block;
}

double bar_uniform(bar *b) {
  b->seed = b->seed * 1664525u + 1013904223u;
  return (double)b->seed / 2147483648.0 - 1;
}

// ---- mesh --------------------------------------------------------------------------------------

static void make_mesh(bar *b, int nx, int ny, int nz, double **x_out, int32_t **tets_out) {
  static const int path[6][3] = {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}};
  const int count[3] = {nx, ny, nz}, step[3] = {1, nx + 1, (nx + 1) * (ny + 1)};
  double *x = own(b, sizeof *x * 3 * (size_t)b->model.size.n);
  int32_t *tets = own(b, sizeof *tets * 4 * (size_t)b->model.size.nt);
  for (int v = 0; v < b->model.size.n; v++) {
    const int at[3] = {v % step[1], v / step[1] % (ny + 1), v / step[2]};
    for (int c = 0; c < 3; c++) x[3 * v + c] = (c == 0 ? 4.0 : 1.0) * at[c] / count[c];
  }
  for (int cell = 0, t = 0; cell < nx * ny * nz; cell++) {
    const int corner = cell % nx + cell / nx % ny * step[1] + cell / (nx * ny) * step[2];
    for (int p = 0; p < 6; p++, t++) { // Kuhn's subdivision: one tet per order of the axes
      tets[4 * t] = corner;
      for (int c = 0; c < 3; c++) tets[4 * t + c + 1] = tets[4 * t + c] + step[path[p][c]];
      if (p == 1 || p == 2 || p == 5) { // odd orders: positive orientation
        int32_t swap = tets[4 * t + 2];
        tets[4 * t + 2] = tets[4 * t + 3], tets[4 * t + 3] = swap;
      }
    }
  }
  *x_out = x, *tets_out = tets;
}

static double invert(const double a[9], double out[9]) {
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < 3; j++) {
      int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
      out[3 * j + i] = a[3 * i1 + j1] * a[3 * i2 + j2] - a[3 * i1 + j2] * a[3 * i2 + j1];
    }
  }
  double det = a[0] * out[0] + a[1] * out[3] + a[2] * out[6];
  for (int i = 0; i < 9; i++) out[i] /= det;
  return det;
}

// Edge matrix of a tet (columns: edges from its first vertex).
static void edges(const bar *b, const double *x, int t, double e[9]) {
  const int32_t *v = b->model.tets + 4 * t;
  for (int c = 0; c < 3; c++)
    for (int i = 0; i < 3; i++) e[3 * i + c] = x[3 * v[c + 1] + i] - x[3 * v[0] + i];
}

// ---- modes -------------------------------------------------------------------------------------

// Gram-Schmidt, twice, in lumped mass; rows of `width` entries, `each` entries a vertex.
static void orthonormalise(double *row, int rows, int n, int each, const double *mass) {
  const size_t width = (size_t)n * (size_t)each;
  for (int a = 0; a < rows; a++) {
    double *ra = row + (size_t)a * width;
    for (int round = 0; round < 2; round++) {
      for (int c = 0; c <= a; c++) {
        const double *rc = row + (size_t)c * width;
        double sum = 0;
        for (size_t i = 0; i < width; i++) sum += mass[i / (size_t)each] * ra[i] * rc[i];
        for (size_t i = 0; i < width; i++) ra[i] = c < a ? ra[i] - sum * rc[i] : ra[i] / sqrt(sum);
      }
    }
  }
}

static double *make_modes(bar *b, const double *x, const double *mass) {
  const int n = b->model.size.n, r = b->model.size.r;
  double *u = own(b, sizeof *u * 3 * (size_t)n * (size_t)r);
  for (int a = 0; a < r; a++) {
    double wave[3], shift[3];
    for (int c = 0; c < 3; c++)
      wave[c] = (1 + a / 9) * bar_uniform(b), shift[c] = 3 * bar_uniform(b);
    for (int v = 0; v < n; v++) {
      const double *p = x + 3 * v;
      for (int c = 0; c < 3; c++)
        u[((size_t)a * (size_t)n + (size_t)v) * 3 + (size_t)c] =
            p[0] * sin(wave[0] * p[0] + 2 * wave[1] * p[1] + 2 * wave[2] * p[2] + shift[c]);
    }
  }
  orthonormalise(u, r, n, 3, mass);
  return u;
}

static double *make_gravity(bar *b, const double *mass) {
  const size_t n3 = 3 * (size_t)b->model.size.n, r = (size_t)b->model.size.r;
  double *modes = own(b, sizeof *modes * 3 * r);
  for (size_t i = 0; i < n3 * r; i++) modes[i % 3 * r + i / n3] += mass[i % n3 / 3] * b->model.u[i];
  return modes;
}

static void make_gradients(bar *b) {
  const int n = b->model.size.n, r = b->model.size.r;
  b->g = own(b, sizeof *b->g * 9 * (size_t)b->model.size.nt * (size_t)r);
  for (int t = 0; t < b->model.size.nt; t++) {
    double e[9], inverse[9], d[9];
    edges(b, b->model.rest_x, t, e);
    invert(e, inverse);
    for (int a = 0; a < r; a++) {
      edges(b, b->model.u + (size_t)a * 3 * (size_t)n, t, d);
      for (int c = 0; c < 9; c++) {
        double sum = 0;
        for (int i = 0; i < 3; i++) sum += d[c / 3 * 3 + i] * inverse[3 * i + c % 3];
        b->g[(9 * (size_t)t + (size_t)c) * (size_t)r + (size_t)a] = sum;
      }
    }
  }
}

static double *make_k0(bar *b, double lambda, double mu) {
  const int r = b->model.size.r;
  const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double h[81], *k0 = own(b, sizeof *k0 * (size_t)(r * r));
  ep_material_tangent(b->model.material, lambda, mu, identity, h);
  for (int t = 0; t < b->model.size.nt; t++) {
    const double *g = b->g + 9 * (size_t)t * (size_t)r;
    for (int i = 0; i < 81; i++)
      for (int a = 0; a < r && h[i] != 0; a++)
        for (int c = 0; c < r; c++)
          k0[a * r + c] += b->volume[t] * g[i / 9 * r + a] * h[i] * g[i % 9 * r + c];
  }
  for (int a = 0; a < r; a++)
    for (int c = 0; c < a; c++) k0[a * r + c] = k0[c * r + a];
  return k0;
}

// ---- cubature, descriptors, examples -----------------------------------------------------------

static void make_cubature(bar *b, int all, double lambda, double mu) {
  const int s = b->model.size.s, nt = b->model.size.nt, r = b->model.size.r;
  int32_t *tet = own(b, sizeof *tet * (size_t)s);
  double *w = own(b, sizeof *w * (size_t)s), *lam = own(b, sizeof *lam * (size_t)s);
  double *shear = own(b, sizeof *shear * (size_t)s);
  double *g = own(b, sizeof *g * 9 * (size_t)s * (size_t)r), total = 0;
  double *packed = own(b, sizeof *packed * ep_packed_cubature_size(r, s));
  for (int t = 0; t < nt; t++) total += b->volume[t];
  for (int e = 0; e < s; e++) {
    tet[e] = (int32_t)((int64_t)e * nt / s);
    w[e] = all ? b->volume[tet[e]] : total / s;
    lam[e] = lambda * (1 + 0.1 * (e % 3)), shear[e] = mu; // not the same everywhere
    memcpy(g + 9 * (size_t)e * (size_t)r, b->g + 9 * (size_t)tet[e] * (size_t)r,
           9 * (size_t)r * sizeof *g);
  }
  ep_pack_cubature(r, s, g, packed);
  b->model.cubature_tet = tet, b->model.cubature_w = w, b->model.cubature_g = packed;
  b->model.cubature_lambda = lam, b->model.cubature_mu = shear;
}

static void make_descriptors(bar *b, const double *mass) {
  const int n = b->model.size.n, r = b->model.size.r, m = b->model.size.m;
  double *phi = own(b, sizeof *phi * (size_t)(m * n));
  double *c0 = own(b, sizeof *c0 * 3 * (size_t)m);
  double *map = own(b, sizeof *map * 3 * (size_t)(m * r));
  for (int f = 0; f < m; f++)
    for (int v = 0; v < n; v++) {
      const double *p = b->model.rest_x + 3 * v;
      phi[f * n + v] = cos(0.7 * f * p[0] / 2) + 0.3 * (f % 3) * p[1] + 0.2 * (f % 4) * p[2];
    }
  orthonormalise(phi, m, n, 1, mass);
  for (int f = 0; f < m; f++)
    for (int v = 0; v < n; v++)
      for (int c = 0; c < 3; c++) {
        double weight = mass[v] * phi[f * n + v];
        c0[3 * f + c] += weight * b->model.rest_x[3 * v + c];
        for (int a = 0; a < r; a++)
          map[(3 * f + c) * r + a] +=
              weight * b->model.u[((size_t)a * (size_t)n + (size_t)v) * 3 + (size_t)c];
      }
  b->model.c0 = c0, b->model.t = map;
}

static void gradient_at(const bar *b, int e, const double *q, double f[9]) {
  const int r = b->model.size.r;
  const double *g = b->g + 9 * (size_t)b->model.cubature_tet[e] * (size_t)r;
  for (int c = 0; c < 9; c++) {
    f[c] = c % 4 == 0;
    for (int a = 0; a < r; a++) f[c] += g[c * r + a] * q[a];
  }
}

static void make_examples(bar *b) {
  const int r = b->model.size.r, k = b->model.size.k, s = b->model.size.s, m = b->model.size.m;
  double *q = own(b, sizeof *q * (size_t)(k * r) + 64);
  double *c = own(b, sizeof *c * 3 * (size_t)(k * m) + 64);
  double *inverse = own(b, sizeof *inverse * 9 * (size_t)(k * s) + 64);
  double *w = own(b, sizeof *w * (size_t)(k * s) + 64), f[9];
  for (int i = 0; i < k; i++) {
    bar_random_q(b, 0.5, q + i * r);
    ep_descriptor(&b->model, q + i * r, c + 3 * i * m);
    for (int e = 0; e < s; e++) {
      gradient_at(b, e, q + i * r, f);
      w[i * s + e] = b->model.cubature_w[e] * fabs(invert(f, inverse + 9 * (i * s + e)));
    }
  }
  b->model.example_q = q, b->model.example_c = c;
  b->model.example_finv = inverse, b->model.example_w = w;
}

// Stress lambda tr(E) I + 2 mu E of the Green strain at element e.
static void strain_at(const bar *b, int e, const double *q, double strain[9], double stress[9]) {
  const double lambda = b->model.cubature_lambda[e], mu = b->model.cubature_mu[e];
  double f[9];
  gradient_at(b, e, q, f);
  for (int c = 0; c < 9; c++)
    strain[c] = 0.5 * (f[c / 3] * f[c % 3] + f[3 + c / 3] * f[3 + c % 3] +
                       f[6 + c / 3] * f[6 + c % 3] - (c % 4 == 0));
  for (int c = 0; c < 9; c++)
    stress[c] =
        2 * mu * strain[c] + (c % 4 == 0 ? lambda * (strain[0] + strain[4] + strain[8]) : 0);
}

// Q = <E_i, E_j>, linear_i = <E_i, sym G>, B_i = <E_i, sym G^T G> by plain sums over elements.
static void plain_green(const bar *b, double *gram, double *linear, double *matrix) {
  const int r = b->model.size.r, k = b->model.size.k;
  for (int e = 0; e < b->model.size.s; e++) {
    const double *g = b->g + 9 * (size_t)b->model.cubature_tet[e] * (size_t)r;
    const double half = 0.5 * b->model.cubature_w[e];
    for (int i = 0; i < k; i++) {
      double strain[9], stress[9], other[9], unused[9];
      strain_at(b, e, b->model.example_q + i * r, strain, stress);
      for (int j = 0; j < k; j++) {
        strain_at(b, e, b->model.example_q + j * r, other, unused);
        for (int c = 0; c < 9; c++) gram[i * k + j] += half * stress[c] * other[c];
      }
      for (int a = 0; a < r; a++) {
        for (int c = 0; c < 9; c++) linear[i * r + a] += half * stress[c] * g[c * r + a];
        for (int o = 0; o < r; o++)
          for (int c = 0; c < 9; c++)
            for (int d = 0; d < 3; d++) // (G_a^T G_o)_c = sum_d G_a,(d, row c) G_o,(d, column c)
              matrix[(i * r + a) * r + o] +=
                  half * stress[c] * g[(3 * d + c / 3) * r + a] * g[(3 * d + c % 3) * r + o];
      }
    }
  }
}

// Orthonormal strains by a Cholesky factor Q = L L^T: V = L^-T.
void bar_make_green(bar *b) {
  const int r = b->model.size.r, k = b->model.size.k, width = 8 * b->model.size.blocks;
  const size_t tiles = ep_packed_green_size(r);
  if (k == 0) return;
  double *gram = own(b, sizeof *gram * (size_t)(k * k) + 64),
         *v = own(b, sizeof *v * (size_t)(k * k) + 64);
  double *linear = own(b, sizeof *linear * (size_t)(k * r) + 64);
  double *matrix = own(b, sizeof *matrix * (size_t)(k * r * r) + 64),
         *sum = own(b, sizeof *sum * (size_t)(r * r) + 64);
  double *packed = own(b, sizeof *packed * (size_t)k * tiles),
         *padded = own(b, sizeof *padded * (size_t)(k * width));
  double *energy = own(b, sizeof *energy * (size_t)k + 64), *scale = own(b, 64);
  plain_green(b, gram, linear, matrix);
  for (int i = 0; i < k; i++) { // Gram-Schmidt in the inner product Q, on coefficients
    energy[i] = gram[i * k + i];
    scale[0] += energy[i] / k;
    double *c = sum; // column i of V
    for (int j = 0; j < k; j++) c[j] = j == i;
    for (int pass = 0; pass < 2; pass++)
      for (int o = 0; o < i; o++) {
        double along = 0;
        for (int j = 0; j < k; j++)
          for (int l = 0; l < k; l++) along += v[j * k + o] * gram[j * k + l] * c[l];
        for (int j = 0; j < k; j++) c[j] -= along * v[j * k + o];
      }
    double square = 0;
    for (int j = 0; j < k; j++)
      for (int l = 0; l < k; l++) square += c[j] * gram[j * k + l] * c[l];
    for (int j = 0; j < k; j++) v[j * k + i] = c[j] / sqrt(square);
  }
  for (int i = 0; i < k; i++) {
    memset(sum, 0, (size_t)(r * r) * sizeof *sum);
    for (int j = 0; j < k; j++) {
      for (int a = 0; a < r * r; a++) sum[a] += v[j * k + i] * matrix[j * r * r + a];
      for (int a = 0; a < r; a++) padded[i * width + a] += v[j * k + i] * linear[j * r + a];
    }
    ep_pack_green(r, sum, packed + (size_t)i * tiles);
  }
  b->model.green_b = packed, b->model.green_linear = padded, b->model.green_weights = v;
  b->model.green_energy = energy, b->model.green_scale = scale;
}

// ---- public ------------------------------------------------------------------------------------

bar *bar_create(int nx, int ny, int nz, int r, int s, int m, int k, ep_material material) {
  bar *b = calloc(1, sizeof *b);
  if (!b) abort();
  const int n = (nx + 1) * (ny + 1) * (nz + 1), nt = 6 * nx * ny * nz;
  const double lambda = 1.2e5, mu = 0.9e5, density = 1000;
  double *x;
  int32_t *tets;
  b->seed = 7;
  b->model.size = (ep_model_sizes){.n = n,
                                   .nt = nt,
                                   .r = r,
                                   .m = m,
                                   .k = k,
                                   .s = s ? s : nt,
                                   .blocks = (r + 7) / 8,
                                   .greens = k};
  b->model.material = material, b->model.rest_scale = sqrt(18);
  make_mesh(b, nx, ny, nz, &x, &tets);
  b->model.rest_x = x, b->model.tets = tets;
  b->volume = own(b, sizeof *b->volume * (size_t)nt);
  double *mass = own(b, sizeof *mass * (size_t)n);
  for (int t = 0; t < nt; t++) {
    double e[9], inverse[9];
    edges(b, x, t, e);
    b->volume[t] = invert(e, inverse) / 6;
    for (int i = 0; i < 4; i++) mass[tets[4 * t + i]] += density * b->volume[t] / 4;
  }
  b->model.u = make_modes(b, x, mass);
  b->model.gravity_modes = make_gravity(b, mass);
  make_gradients(b);
  b->model.k0 = make_k0(b, lambda, mu);
  make_cubature(b, s == 0, lambda, mu);
  make_descriptors(b, mass);
  make_examples(b);
  bar_make_green(b);
  return b;
}

void bar_add_guards(bar *b, int count, double limit) {
  const size_t r = (size_t)b->model.size.r, width = 8 * (size_t)b->model.size.blocks;
  const size_t guards = (size_t)count;
  int32_t *tet = own(b, guards * sizeof *tet);
  double *w = own(b, guards * sizeof *w), *stiffness = own(b, guards * sizeof *w);
  double *limits = own(b, guards * sizeof *w), *packed = own(b, guards * 9 * width * sizeof *w);
  double *growth = own(b, (guards + 7) / 8 * width * sizeof *w);
  for (size_t i = 0; i < guards; i++) {
    const size_t t = i * (size_t)b->model.size.nt / guards;
    const double *g = b->g + 9 * t * r;
    tet[i] = (int32_t)t;
    w[i] = b->volume[t] * (double)(1 + i % 4);
    stiffness[i] = 1e6 * (1 + 0.2 * (double)(i % 3));
    limits[i] = limit * (1 - 0.02 * (double)(i % 6));
    ep_pack_cubature((int)r, 1, g, packed + i * 9 * width);
    for (size_t a = 0; a < r; a++) {
      double square = 0;
      for (size_t c = 0; c < 9; c++) square += g[c * r + a] * g[c * r + a];
      growth[i / 8 * width + a] = fmax(growth[i / 8 * width + a], sqrt(square));
    }
  }
  b->model.size.guards = count;
  b->model.guard_tet = tet, b->model.guard_w = w, b->model.guard_stiffness = stiffness;
  b->model.guard_limit = limits, b->model.guard_g = packed, b->model.guard_growth = growth;
}

int bar_inverted(const bar *b, const double *q) {
  const int r = b->model.size.r;
  int count = 0;
  for (int t = 0; t < b->model.size.nt; t++) {
    const double *g = b->g + 9 * (size_t)t * (size_t)r;
    double f[9], inverse[9];
    for (int c = 0; c < 9; c++) {
      f[c] = c % 4 == 0;
      for (int a = 0; a < r; a++) f[c] += g[c * r + a] * q[a];
    }
    count += !(invert(f, inverse) > 0);
  }
  return count;
}

void bar_free(bar *b) {
  for (int i = 0; i < b->owned_count; i++) free(b->owned[i]);
  free(b);
}

void bar_random_q(bar *b, double amplitude, double *q) {
  const int r = b->model.size.r;
  double largest = 0, f[9];
  for (int a = 0; a < r; a++) q[a] = bar_uniform(b) / (1 + a);
  for (int e = 0; e < b->model.size.s; e++) {
    double square = 0;
    gradient_at(b, e, q, f);
    for (int c = 0; c < 9; c++) square += pow(f[c] - (c % 4 == 0), 2);
    largest = fmax(largest, sqrt(square));
  }
  for (int a = 0; a < r; a++) q[a] *= amplitude / largest;
}

ep_state *bar_state(const bar *b, void **block) {
  const size_t bytes = ep_state_bytes(&b->model);
  ep_state *state = NULL;
  *block = aligned_alloc(64, bytes);
  if (!*block || ep_state_init(&b->model, *block, bytes, &state) != EP_OK) abort();
  return state;
}

double bar_reference(const bar *b, const double *inverse, const double *weight, const double *q,
                     double *f, double *k, int project) {
  const int r = b->model.size.r;
  const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  double energy = 0;
  if (f) memset(f, 0, (size_t)r * sizeof *f);
  if (k) memset(k, 0, (size_t)(r * r) * sizeof *k);
  for (int e = 0; e < b->model.size.s; e++) {
    const double lambda = b->model.cubature_lambda[e], mu = b->model.cubature_mu[e];
    const double *g = b->g + 9 * (size_t)b->model.cubature_tet[e] * (size_t)r;
    const double *bi = inverse ? inverse + 9 * e : identity;
    double at[9], x[9], p[9], h[81], pulled[9], tangent[81];
    gradient_at(b, e, q, at);
    for (int c = 0; c < 9; c++) {
      x[c] = 0;
      for (int i = 0; i < 3; i++) x[c] += at[c / 3 * 3 + i] * bi[3 * i + c % 3];
    }
    energy += weight[e] * ep_material_energy(b->model.material, lambda, mu, x);
    ep_material_stress(b->model.material, lambda, mu, x, p);
    ep_material_tangent(b->model.material, lambda, mu, x, h);
    for (int c = 0; c < 9; c++) { // dx_ij/dF_il = B_lj
      pulled[c] = 0;
      for (int j = 0; j < 3; j++) pulled[c] += p[c / 3 * 3 + j] * bi[c % 3 * 3 + j];
      for (int d = 0; d < 9; d++) {
        double sum = 0;
        for (int j = 0; j < 9; j++)
          sum += bi[c % 3 * 3 + j / 3] * h[9 * (c / 3 * 3 + j / 3) + d / 3 * 3 + j % 3] *
                 bi[d % 3 * 3 + j % 3];
        tangent[9 * c + d] = sum;
      }
    }
    if (project) ep_material_project(tangent);
    for (int c = 0; c < 9; c++) {
      for (int a = 0; f && a < r; a++) f[a] += weight[e] * g[c * r + a] * pulled[c];
      for (int d = 0; k && d < 9; d++)
        for (int a = 0; a < r; a++)
          for (int o = 0; o < r; o++)
            k[a * r + o] += weight[e] * g[c * r + a] * tangent[9 * c + d] * g[d * r + o];
    }
  }
  return energy;
}
