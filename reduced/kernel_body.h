// Included once per instruction-set level with EP_KERNEL defined as the function's name.
//
// Per 8 elements: F = I + G q (sums over lanes of modes, transposed into lanes of elements), the
// laws over lanes of elements for each term, summed into one stress and one tangent per element
// (P F_i^-T and the 9 x 9 tangents: the cost in r does not grow with the number of terms), then
// f += G^T P and K += G^T (H G) over lanes of modes. Multiply-adds at r = 30, s = 60: H G 155 K,
// G^T (H G) 346 K on the upper blocks, F and f 17 K each.
#include <string.h>

#include "reduced/kernel.h"
#include "reduced/lane_jacobi.h"
#include "reduced/lane_material.h"

// Register tile of K += G^T B: rows x vectors of 8 columns.
#if defined(__AVX512F__)
enum { TILE_ROWS = 8, TILE_COLUMNS = 2 };
#elif defined(__AVX2__)
enum { TILE_ROWS = 4, TILE_COLUMNS = 1 };
#else
enum { TILE_ROWS = 2, TILE_COLUMNS = 1 };
#endif

#include "reduced/kernel_float_body.h"

// Gather one number of 8 elements; beyond s the value `beyond`.
LANE_INLINE lane gather(const double *x, int stride, int first, int s, double beyond) {
  lane out;
  for (int i = 0; i < EP_LANES; i++) out[i] = first + i < s ? x[(first + i) * stride] : beyond;
  return out;
}

// The sums over lanes of modes of one element's F.
LANE_INLINE void gradient_rows(const ep_kernel_task *t, int e, lane sum[9][EP_LANES], int at) {
  const lane *g = (const lane *)t->g + (size_t)e * (size_t)t->blocks * 9, *q = (const lane *)t->q;
  for (int p = 0; p < PARTS; p++) {
    part row[9];
    for (int c = 0; c < 9; c++) row[c] = part_all(0);
    for (int b = 0; b < t->blocks; b++)
      for (int c = 0; c < 9; c++) row[c] += part_of(g + 9 * b + c, p) * part_of(q + b, p);
    for (int c = 0; c < 9; c++) ((part *)&sum[c][at])[p] = row[c];
  }
}

// F of elements first .. first + 7 (lanes of elements).
static void deformation_gradients(const ep_kernel_task *t, int first, lane f[9]) {
  lane sum[9][EP_LANES];
  for (int e = 0; e < EP_LANES; e++) {
    if (first + e < t->s && !t->g_float) {
      gradient_rows(t, first + e, sum, e);
      continue;
    }
    lane row[9];
    for (int c = 0; c < 9; c++) row[c] = lane_all(0);
    if (first + e < t->s) narrow_rows(t, first + e, row);
    for (int c = 0; c < 9; c++) sum[c][e] = row[c];
  }
  for (int c = 0; c < 9; c++) f[c] = lane_sum8(sum[c]) + lane_all(c % 4 == 0);
}

LANE_INLINE void multiply(const lane a[9], const lane b[9], lane c[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      c[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}

// p += w p' B^T: the stress with respect to F of psi(F B).
LANE_INLINE void pull_stress(lane w, const lane p[9], const lane b[9], lane sum[9]) {
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      sum[3 * i + j] +=
          w * (p[3 * i] * b[3 * j] + p[3 * i + 1] * b[3 * j + 1] + p[3 * i + 2] * b[3 * j + 2]);
}

// Each 3 x 3 block (rows of F i, k) of the tangent: sum_ik += w B h_ik B^T; symmetric as a whole.
static void pull_tangent(lane w, const lane h[81], const lane b[9], lane sum[81]) {
  for (int i = 0; i < 3; i++) {
    for (int k = i; k < 3; k++) {
      lane x[9], y[9];
      for (int j = 0; j < 9; j++) x[j] = h[9 * (3 * i + j / 3) + 3 * k + j % 3];
      multiply(b, x, y);
      for (int c = 0; c < 9; c++) x[c] = lane_all(0);
      pull_stress(w, y, b, x);
      for (int j = 0; j < 3; j++) {
        for (int l = 0; l < 3; l++) {
          sum[9 * (3 * i + j) + 3 * k + l] += x[3 * j + l];
          if (k > i) sum[9 * (3 * k + l) + 3 * i + j] += x[3 * j + l];
        }
      }
    }
  }
}

// Add one term at F of 8 elements to stress (9) and tangent (81, or NULL); returns its energies.
static void add_term(const ep_kernel_task *t, const ep_kernel_term *term, int first,
                     const lane f[9], lane *energy, lane stress[9], lane *tangent) {
  const lane weight = gather(term->weight, 1, first, t->s, 0);
  if (!lane_any(weight != lane_all(0))) return; // outside the region of a local example
  const lane lambda = gather(t->lambda, 1, first, t->s, 0), mu = gather(t->mu, 1, first, t->s, 0);
  const lane w = weight * lane_all(term->scale);
  const int want_stress = t->f || t->k;
  lane b[9], x[9], p[9], h[81];
  const lane *at = f;
  if (term->inverse) {
    for (int c = 0; c < 9; c++) b[c] = gather(term->inverse + c, 9, first, t->s, c % 4 == 0);
    multiply(f, b, x);
    at = x;
  }
  *energy += weight *
             lane_material(t->material, lambda, mu, at, want_stress ? p : NULL, tangent ? h : NULL);
  if (!want_stress) return;
  if (term->inverse) {
    pull_stress(w, p, b, stress);
    if (tangent) pull_tangent(w, h, b, tangent);
    return;
  }
  for (int c = 0; c < 9; c++) stress[c] += w * p[c];
  for (int c = 0; tangent && c < 81; c++) tangent[c] += w * h[c];
}

// Elements of one group whose stress and tangent are to be summed. `all` is known where it is
// compiled: the loops of the material are those over consecutive elements.
typedef struct acting {
  int all, count, element[EP_LANES]; // from `first` on
} acting;

// f += G^T P for the elements of one group, three chains of additions.
LANE_INLINE void add_force(const ep_kernel_task *t, int first, const acting *on,
                           const lane stress[9]) {
  lane *f = (lane *)t->f;
  for (int i = 0; i < t->blocks * PARTS; i++) {
    const int b = i / PARTS, p = i % PARTS;
    part *out = (part *)(f + b) + p, chain[3] = {*out, part_all(0), part_all(0)};
    for (int j = 0; j < on->count; j++) {
      const int e = on->all ? j : on->element[j];
      const lane *g =
          (const lane *)t->g + ((size_t)(first + e) * (size_t)t->blocks + (size_t)b) * 9;
      const double *x = (const double *)stress + e;
      for (int c = 0; c < 9; c++) chain[c % 3] += part_of(g + c, p) * part_all(x[EP_LANES * c]);
    }
    *out = (chain[0] + chain[1]) + chain[2];
  }
}

// B = H G (acting element, block, 9 rows) for one group.
LANE_INLINE void tangent_times_modes(const ep_kernel_task *t, int first, const acting *on,
                                     const lane *tangent, lane *out) {
  for (int at = 0; at < on->count; at++) {
    const int e = on->all ? at : on->element[at];
    const double *h = (const double *)tangent + e;
    const lane *g = (const lane *)t->g + (size_t)(first + e) * (size_t)t->blocks * 9;
    lane *row = out + (size_t)at * (size_t)t->blocks * 9;
    for (int b = 0; b < t->blocks * PARTS; b++) {
      const part *x = (const part *)(g + 9 * (b / PARTS)) + b % PARTS;
      part *y = (part *)(row + 9 * (b / PARTS)) + b % PARTS;
      for (int i = 0; i < 9; i++) {
        part sum = x[0] * part_all(h[EP_LANES * 9 * i]);
        for (int j = 1; j < 9; j++) sum += x[PARTS * j] * part_all(h[EP_LANES * (9 * i + j)]);
        y[PARTS * i] = sum;
      }
    }
  }
}

// A tile of K: rows row .. row + TILE_ROWS - 1 (of block row / 8), `columns` vectors from block
// `column` on, over the acting elements of one group.
LANE_INLINE void add_tile(const ep_kernel_task *t, const lane *g, const lane *b, const acting *on,
                          int row, int column, const int columns) {
  const size_t stride = (size_t)t->blocks * 9, width = (size_t)(t->blocks * PARTS);
  const int wide = columns * PARTS;
  part sum[TILE_ROWS][TILE_COLUMNS * PARTS];
  part *k = (part *)t->k + (size_t)row * width + (size_t)(column * PARTS);
  for (int i = 0; i < TILE_ROWS; i++)
    for (int j = 0; j < wide; j++) sum[i][j] = k[(size_t)i * width + (size_t)j];
  for (int at = 0; at < on->count; at++) {
    const size_t e = (size_t)(on->all ? at : on->element[at]);
    const double *left = (const double *)(g + e * stride + 9 * (row / 8)) + row % 8;
    const lane *right = b + (size_t)at * stride + 9 * (size_t)column;
    for (int c = 0; c < 9; c++) {
      part x[TILE_COLUMNS * PARTS];
      for (int j = 0; j < wide; j++) x[j] = part_of(right + 9 * (j / PARTS) + c, j % PARTS);
      for (int i = 0; i < TILE_ROWS; i++) {
        const part y = part_all(left[8 * c + i]);
        for (int j = 0; j < wide; j++) sum[i][j] += y * x[j];
      }
    }
  }
  for (int i = 0; i < TILE_ROWS; i++)
    for (int j = 0; j < wide; j++) k[(size_t)i * width + (size_t)j] = sum[i][j];
}

// K += G^T B on the blocks of the upper triangle.
LANE_INLINE void add_stiffness(const ep_kernel_task *t, int first, const acting *on,
                               const lane *b) {
  const lane *g = (const lane *)t->g + (size_t)first * (size_t)t->blocks * 9;
  for (int row = 0; row < 8 * t->blocks; row += TILE_ROWS) {
    int column = row / 8;
    for (; column + TILE_COLUMNS <= t->blocks; column += TILE_COLUMNS)
      add_tile(t, g, b, on, row, column, TILE_COLUMNS);
    if (TILE_COLUMNS > 1 && column < t->blocks) add_tile(t, g, b, on, row, column, 1);
  }
}

LANE_INLINE void add_group(const ep_kernel_task *t, int first, const acting *on,
                           const lane stress[9], lane *tangent) {
  lane *product = (lane *)t->scratch + 81;
  if (t->f) add_force(t, first, on, stress);
  if (!t->k) return;
  if (t->project) lane_project(tangent);
  tangent_times_modes(t, first, on, tangent, product);
  add_stiffness(t, first, on, product);
}

static void mirror(int n, double *k) {
  for (int i = 0; i < n; i++)
    for (int j = 0; j < i; j++) k[n * i + j] = k[n * j + i];
}

static void add_all(const ep_kernel_task *t, int first, const lane stress[9], lane *tangent) {
  const acting all = {1, t->s - first < EP_LANES ? t->s - first : EP_LANES, {0}};
  add_group(t, first, &all, stress, tangent);
}

// Of guards (one term) those below their limit: the others would add exact zeros.
static void add_some(const ep_kernel_task *t, int first, lane energy, const lane stress[9],
                     lane *tangent) {
  acting some = {0, 0, {0}};
  for (int e = 0; e < EP_LANES && first + e < t->s; e++)
    if (energy[e] != 0) some.element[some.count++] = e;
  add_group(t, first, &some, stress, tangent);
}

void EP_KERNEL(ep_kernel_task *t) {
  const size_t width = 8 * (size_t)t->blocks;
  lane *tangent = t->k ? (lane *)t->scratch : NULL, *product = (lane *)t->scratch + 81;
  narrow *k = (narrow *)product; // in floats, followed by the products
  if (t->k && t->g_float)
    memset(k, 0, (size_t)narrow_row(t) * (size_t)narrow_row(t) * sizeof(float));
  if (t->f) memset(t->f, 0, width * sizeof *t->f);
  if (t->k) memset(t->k, 0, width * width * sizeof *t->k);
  for (int i = 0; i < t->terms; i++) t->term[i].energy = 0;
  for (int first = 0; first < t->s; first += EP_LANES) {
    lane f[9], stress[9];
    deformation_gradients(t, first, f);
    // One check while nothing collapses (lanes beyond s are at rest).
    if (t->material == EP_VOLUME_PENALTY && !lane_any(lane_crushed(f))) continue;
    for (int c = 0; c < 9; c++) stress[c] = lane_all(0);
    for (int c = 0; tangent && c < 81; c++) tangent[c] = lane_all(0);
    lane energy = lane_all(0);
    for (int i = 0; i < t->terms; i++) {
      energy = lane_all(0);
      add_term(t, &t->term[i], first, f, &energy, stress, tangent);
      t->term[i].energy += lane_sum(energy);
    }
    if (t->g_float) {
      if (t->f) narrow_force(t, first, stress);
      if (!t->k) continue;
      if (t->project) lane_project(tangent);
      narrow_stiffness(t, first, tangent, k);
    } else if (t->material == EP_GUARD_WALL || t->material == EP_GUARD_SOFT) {
      add_some(t, first, energy, stress, tangent);
    } else {
      add_all(t, first, stress, tangent);
    }
  }
  for (int i = 0; i < t->terms; i++) t->term[i].energy *= t->term[i].scale;
  if (t->k && t->g_float) narrow_finish(t, (const float *)k);
  if (t->k && !t->g_float) mirror((int)width, t->k);
}
