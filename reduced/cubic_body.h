// Included once per instruction-set level and precision, with EP_CUBIC_KERNEL (the name of the
// function it defines) and REAL / LANES: double / 8 or float / 16 (64-byte vectors).
//
// Block form (DESIGN section 7). Rows are pairs a >= b in blocks of 4 x 4, columns the packed pairs
// c >= d up to b. Each vector S of coefficients serves three multiply-adds:
//   K_ab += S . zz,   T_a,cd += z_b S,   T_b,cd += z_a S
// and what T holds gives the other five positions of the second derivative:
//   (x, c) += T_x,cd z_d,   (x, d) += T_x,cd z_c,   (c, d) += z_x T_x,cd / 2
// with K = A + A^T at the end. A row block's own T is written by its diagonal block, which comes
// first, so that nothing is cleared. No fused multiply-adds: all levels give the same bits.
//
// Small models: K_ab = sum_cd Q_ab,cd z_c z_d with the square matrix Q over pairs.
#include <string.h>

#include "reduced/cubic_kernel.h"

typedef REAL vec __attribute__((vector_size(64), may_alias));
typedef REAL loose __attribute__((vector_size(64), aligned(sizeof(REAL)), may_alias));
typedef REAL vec8 __attribute__((vector_size(8 * sizeof(REAL))));
typedef REAL vec4 __attribute__((vector_size(4 * sizeof(REAL))));
typedef REAL loose4
    __attribute__((vector_size(4 * sizeof(REAL)), aligned(sizeof(REAL)), may_alias));
#define INLINE static inline __attribute__((always_inline))

INLINE vec all(REAL x) {
  return x - (vec){0};
}
INLINE vec load(const REAL *p) {
  return *(const loose *)p;
}
INLINE void store(REAL *p, vec v) {
  *(loose *)p = v;
}

// Lane i: the sum over v[i], in one order.
INLINE vec4 sum4(const vec v[4]) {
  vec8 w[4], t[2];
  for (int i = 0; i < 4; i++) {
#if LANES == 16
    w[i] = __builtin_shufflevector(v[i], v[i], 0, 1, 2, 3, 4, 5, 6, 7) +
           __builtin_shufflevector(v[i], v[i], 8, 9, 10, 11, 12, 13, 14, 15);
#else
    w[i] = v[i];
#endif
  }
  for (int i = 0; i < 2; i++)
    t[i] = __builtin_shufflevector(w[2 * i], w[2 * i + 1], 0, 8, 2, 10, 4, 12, 6, 14) +
           __builtin_shufflevector(w[2 * i], w[2 * i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  const vec8 u = __builtin_shufflevector(t[0], t[1], 0, 1, 8, 9, 4, 5, 12, 13) +
                 __builtin_shufflevector(t[0], t[1], 2, 3, 10, 11, 6, 7, 14, 15);
  return __builtin_shufflevector(u, u, 0, 1, 2, 3) + __builtin_shufflevector(u, u, 4, 5, 6, 7);
}

// ---- scratch memory --------------------------------------------------------------------------

typedef struct work {
  int n, blocks, stride;               // entries of z, blocks of 4, length of a row of `a`
  REAL *z, *zz;                        // entries, products of pairs
  REAL *pair;                          // sum_x z_x T_x,cd
  REAL *a;                             // (4 blocks x stride)
  REAL *t[EP_CUBIC_MAX_MODES / 4 + 1]; // first row of each block
} work;

static void lay_out(int r, int width, void *scratch, work *w) {
  REAL *at = scratch;
  w->n = r + 1, w->blocks = (r + 4) / 4;
  w->stride = ep_round_up(4 * w->blocks, LANES);
  const int pairs = ep_round_up(ep_triangle(4 * w->blocks), LANES) + 2 * LANES;
  w->z = at, at += (size_t)width * (size_t)(w->stride + LANES);
  w->zz = at, at += (size_t)width * (size_t)pairs;
  w->pair = at, at += (size_t)width * (size_t)pairs;
  w->a = at, at += (size_t)width * (size_t)(4 * w->blocks * w->stride);
  for (int x = 0; x < w->blocks; x++)
    w->t[x] = at, at += (size_t)width * 4 * (size_t)ep_cubic_row(x, LANES);
}

static void products(const work *w, int count) {
  REAL *out = w->zz;
  for (int c = 0; c < w->n; c++)
    for (int d = 0; d <= c; d++) *out++ = w->z[c] * w->z[d];
  memset(out, 0, (size_t)(count - ep_triangle(w->n)) * sizeof *out);
}

// Bytes of the stream asked for in advance; a tenth faster than the hardware alone at r = 50.
enum { AHEAD = 4096 };

// ---- main pass -------------------------------------------------------------------------------

// The columns off .. off + LANES vectors of one block: rows i < rows, columns j0 <= j < 4 (j <= i
// on the diagonal, whose T is written, not added to).
INLINE const vec *segment(const vec *s, const int rows, const int j0, const int diagonal, int off,
                          int vectors, const REAL *zz, REAL *ta, int na, REAL *tb, int nb,
                          const REAL *za, const REAL *zb, vec sum[4][4]) {
  for (int v = 0; v < vectors; v++, off += LANES) {
    const vec q = load(zz + off);
    vec a[4], b[4];
    for (int i = 0; i < rows; i++) a[i] = diagonal ? (vec){0} : load(ta + i * na + off);
    for (int j = j0; j < 4 && !diagonal; j++) b[j] = load(tb + j * nb + off);
    for (int i = 0; i < rows; i++) {
      for (int j = j0; j < 4; j++) {
        if (diagonal && j > i) continue;
        __builtin_prefetch((const char *)s + AHEAD);
        const vec c = *s++;
        sum[i][j] += c * q;
        a[i] += c * all(zb[j]);
        if (diagonal)
          a[j] += c * all(za[i]);
        else
          b[j] += c * all(za[i]);
      }
    }
    for (int i = 0; i < rows; i++) store(ta + i * na + off, a[i]);
    for (int j = j0; j < 4 && !diagonal; j++) store(tb + j * nb + off, b[j]);
  }
  return s;
}

INLINE const vec *block(const vec *s, const work *w, const int rows, const int diagonal, int x,
                        int y) {
  const int na = ep_cubic_row(x, LANES), nb = ep_cubic_row(y, LANES);
  REAL *ta = w->t[x], *tb = w->t[y];
  const REAL *za = w->z + 4 * x, *zb = w->z + 4 * y;
  vec sum[4][4];
  for (int i = 0; i < 16; i++) sum[i / 4][i % 4] = (vec){0};
  const int first = ep_triangle(4 * y + 1);
  s = segment(s, rows, 0, diagonal, 0, (first + LANES - 1) / LANES, w->zz, ta, na, tb, nb, za, zb,
              sum);
#define MORE(j)                                                                                    \
  if (rows > (j) || !diagonal)                                                                     \
    s = segment(s, rows, j, diagonal, ep_triangle(4 * y + (j)), (4 * y + (j) + LANES) / LANES,     \
                w->zz, ta, na, tb, nb, za, zb, sum);
  MORE(1)
  MORE(2)
  MORE(3)
#undef MORE
  for (int i = 0; i < rows; i++)
    *(loose4 *)(w->a + (size_t)(4 * x + i) * (size_t)w->stride + 4 * y) = sum4(sum[i]);
  return s;
}

INLINE const vec *block_row(const vec *s, const work *w, const int rows, int x) {
  // What vectors reach into but no coefficient belongs to: beyond the triangle, and the last
  // columns of a part of a block.
  const int row = ep_cubic_row(x, LANES);
  const int begin = rows < 4 ? ep_triangle(4 * x + 1) : row - 2 * LANES;
  for (int i = 0; i < rows; i++)
    memset(w->t[x] + i * row + begin, 0, (size_t)(row - begin) * sizeof(REAL));
  s = block(s, w, rows, 1, x, x);
  for (int y = 0; y < x; y++) s = block(s, w, rows, 0, x, y);
  return s;
}

// ---- last pass -------------------------------------------------------------------------------

// pair (+)= sum over the rows of block x of z_x T_x.
INLINE void add_pairs(const work *w, const int rows, int x, int begin) {
  const int row = ep_cubic_row(x, LANES), count = ep_triangle(ep_least(4 * x + 4, w->n));
  for (int v = 0; v < count; v += LANES) {
    const REAL *t = w->t[x] + v;
    vec sum = load(t) * all(w->z[4 * x]);
    for (int i = 1; i < rows; i++) sum += load(t + i * row) * all(w->z[4 * x + i]);
    store(w->pair + v, begin ? sum : (vec)(load(w->pair + v) + sum));
  }
}

// (x, c) and (x, d) of the rows x of one block.
INLINE void add_rows(const work *w, const int rows, int x, const REAL *ones) {
  const int row = ep_cubic_row(x, LANES), end = ep_least(4 * x + 4, w->n);
  const REAL *t = w->t[x];
  REAL *a = w->a + (size_t)(4 * x) * (size_t)w->stride;
  for (int c = 0; c < end; c++, t += c) {
    const vec zc = all(w->z[c]);
    vec dot[4] = {{0}, {0}, {0}, {0}};
    for (int d = 0; d <= c; d += LANES) {
      vec zd = load(w->z + d), zm = zc;
      if (d + LANES > c + 1) { // beyond this row stands the next one
        const vec only = load(ones + LANES - (c + 1 - d));
        zd *= only, zm *= only;
      }
      for (int i = 0; i < rows; i++) {
        const vec v = load(t + i * row + d);
        REAL *to = a + (size_t)i * (size_t)w->stride + d;
        dot[i] += v * zd;
        store(to, load(to) + v * zm);
      }
    }
    const vec4 sum = sum4(dot);
    for (int i = 0; i < rows; i++) a[(size_t)i * (size_t)w->stride + (size_t)c] += sum[i];
  }
}

INLINE void last_block(const work *w, const int rows, int x, const REAL *ones) {
  add_pairs(w, rows, x, x == w->blocks - 1);
  add_rows(w, rows, x, ones);
}

// k = A + A^T; returns W, f = K z / 3.
static double finish(const work *w, const double *q, double *f, double *k) {
  const int r = w->n - 1;
  const size_t stride = (size_t)w->stride;
  const REAL *a = w->a;
  double first = (double)(a[0] + a[0]), energy = 0;
  for (int i = 1; i <= r; i++) {
    const double edge = (double)(a[(size_t)i * stride] + a[i]);
    first += edge * q[i - 1];
    f[i - 1] = edge;
    for (int j = 1; j <= i; j++) {
      const double v =
          (double)(a[(size_t)i * stride + (size_t)j] + a[(size_t)j * stride + (size_t)i]);
      k[(i - 1) * r + j - 1] = v;
      k[(j - 1) * r + i - 1] = v;
    }
  }
  for (int i = 0; i < r; i++)
    for (int j = 0; j < r; j++) f[j] += k[i * r + j] * q[i];
  for (int i = 0; i < r; i++) {
    f[i] *= 1.0 / 3;
    energy += f[i] * q[i];
  }
  return 0.25 * (energy + first / 3);
}

static void blocks_form(const work *w, const vec *s) {
  static const REAL ones[2 * LANES] = {
#if LANES == 16
    1,
    1,
    1,
    1,
    1,
    1,
    1,
    1,
#endif
    1,
    1,
    1,
    1,
    1,
    1,
    1,
    1
  };
  const int last = w->blocks - 1, rows = w->n - 4 * last;
  memset(w->a, 0, (size_t)(4 * w->blocks * w->stride) * sizeof(REAL));
  for (int x = 0; x < last; x++) s = block_row(s, w, 4, x);
#define WITH_ROWS(call_1, call_2, call_3, call_4)                                                  \
  switch (rows) {                                                                                  \
  case 1:                                                                                          \
    call_1;                                                                                        \
    break;                                                                                         \
  case 2:                                                                                          \
    call_2;                                                                                        \
    break;                                                                                         \
  case 3:                                                                                          \
    call_3;                                                                                        \
    break;                                                                                         \
  default:                                                                                         \
    call_4;                                                                                        \
  }
  WITH_ROWS(block_row(s, w, 1, last), block_row(s, w, 2, last), block_row(s, w, 3, last),
            block_row(s, w, 4, last))
  WITH_ROWS(last_block(w, 1, last, ones), last_block(w, 2, last, ones),
            last_block(w, 3, last, ones), last_block(w, 4, last, ones))
#undef WITH_ROWS
  for (int x = last - 1; x >= 0; x--) last_block(w, 4, x, ones);
  const REAL *pair = w->pair;
  for (int c = 0; c < w->n; c++)
    for (int d = 0; d <= c; d++) w->a[c * w->stride + d] += (REAL)0.5 * *pair++;
}

// ---- small models ----------------------------------------------------------------------------

static void square_form(const work *w, const vec *s) {
  const int pairs = ep_triangle(w->n), columns = (pairs + LANES - 1) / LANES;
  for (int row = 0; row < pairs; row += 4) {
    vec sum[4] = {{0}, {0}, {0}, {0}};
    for (int v = 0; v < columns; v++, s += 4)
      for (int i = 0; i < 4; i++) sum[i] += s[i] * load(w->zz + v * LANES);
    *(loose4 *)(w->pair + row) = sum4(sum);
  }
  const REAL *pair = w->pair;
  memset(w->a, 0, (size_t)(w->n * w->stride) * sizeof(REAL));
  for (int c = 0; c < w->n; c++, pair++) {
    for (int d = 0; d < c; d++) w->a[c * w->stride + d] = *pair++;
    w->a[c * w->stride + c] = (REAL)0.5 * *pair;
  }
}

static double evaluate(const ep_cubic_task *t) {
  const int r = t->r;
  work w;
  lay_out(r, 1, t->scratch, &w);
  w.z[0] = 1;
  for (int i = 0; i < r; i++) w.z[i + 1] = (REAL)t->q[i];
  memset(w.z + w.n, 0, (size_t)(w.stride + LANES - w.n) * sizeof(REAL));
  products(&w, ep_round_up(ep_triangle(4 * w.blocks), LANES) + LANES);
  if (w.n < EP_CUBIC_BLOCKS_FROM)
    square_form(&w, t->stream);
  else
    blocks_form(&w, t->stream);
  return finish(&w, t->q, t->f, t->k);
}

// ---- batches: lanes of states ----------------------------------------------------------------
// The same passes with one number of every state in each vector, and nothing to sum over lanes.

enum { TILE = 64 };

typedef struct batch_work {
  int n, blocks;
  vec *z, *zz, *pair, *a; // a (n4 x n4), n4 = 4 blocks
  work w;                 // t
} batch_work;

// T of block x: for each column its four rows together.
INLINE vec *batch_columns(const batch_work *w, int x) {
  return (vec *)w->w.t[x];
}

INLINE const vec *batch_segment(const vec *s, const batch_work *w, const int rows, const int j0,
                                const int diagonal, int off, int end, int x, int y, vec sum[4][4]) {
  const vec *za = w->z + 4 * x, *zb = w->z + 4 * y;
  vec *ta = batch_columns(w, x), *tb = batch_columns(w, y);
  const int each = diagonal ? ep_triangle(rows - j0) : (4 - j0) * rows;
  for (; off < end; off += LANES, s += each) {
    const int lanes = ep_least(LANES, end - off);
    for (int l = 0; l < lanes; l++) {
      const REAL *c = (const REAL *)s + l;
      const vec q = w->zz[off + l];
      vec a[4], b[4];
      for (int i = 0; i < rows; i++) a[i] = diagonal ? (vec){0} : ta[4 * (off + l) + i];
      for (int j = j0; j < 4 && !diagonal; j++) b[j] = tb[4 * (off + l) + j];
      for (int i = 0; i < rows; i++) {
        for (int j = j0; j < 4; j++) {
          if (diagonal && j > i) continue;
          const vec w4 = all(*c);
          c += LANES;
          sum[i][j] += w4 * q;
          a[i] += w4 * zb[j];
          if (diagonal)
            a[j] += w4 * za[i];
          else
            b[j] += w4 * za[i];
        }
      }
      for (int i = 0; i < rows; i++) ta[4 * (off + l) + i] = a[i];
      for (int j = j0; j < 4 && !diagonal; j++) tb[4 * (off + l) + j] = b[j];
    }
  }
  return s;
}

INLINE vec *batch_sums(const batch_work *w, int x, int y, int i) {
  return w->a + (size_t)(4 * x + i) * 4 * (size_t)w->blocks + (size_t)(4 * y);
}

// Columns begin .. begin + TILE of the first segment (begin < 0: the three others, whole) of one
// block; s: its first coefficient.
INLINE void batch_block(const vec *s, const batch_work *w, const int rows, const int diagonal,
                        int x, int y, int begin) {
  vec sum[4][4];
  const int first = ep_triangle(4 * y + 1);
  if (begin >= first) return;
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < 4; j++) sum[i][j] = batch_sums(w, x, y, i)[j];
  const int each = diagonal ? ep_triangle(rows) : 4 * rows;
  if (begin >= 0) {
    batch_segment(s + begin / LANES * each, w, rows, 0, diagonal, begin,
                  ep_least(begin + TILE, first), x, y, sum);
  } else {
    s += (first + LANES - 1) / LANES * each;
#define MORE(j)                                                                                    \
  if (rows > (j) || !diagonal)                                                                     \
    s = batch_segment(s, w, rows, j, diagonal, ep_triangle(4 * y + (j)),                           \
                      ep_triangle(4 * y + (j) + 1), x, y, sum);
    MORE(1) MORE(2) MORE(3)
#undef MORE
  }
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < 4; j++) batch_sums(w, x, y, i)[j] = sum[i][j];
}

static int block_vectors(int rows, int diagonal, int y) {
  int count = 0;
  for (int j = 0; j < 4 && (rows > j || !diagonal); j++) {
    const int length = j ? 4 * y + j + 1 : ep_triangle(4 * y + 1);
    count += (length + LANES - 1) / LANES * (diagonal ? ep_triangle(rows - j) : (4 - j) * rows);
  }
  return count;
}

INLINE const vec *batch_block_row(const vec *s, const batch_work *w, const int rows, int x,
                                  int begin) {
  batch_block(s, w, rows, 1, x, x, begin);
  s += block_vectors(rows, 1, x);
  for (int y = 0; y < x; y++) {
    batch_block(s, w, rows, 0, x, y, begin);
    s += block_vectors(rows, 0, y);
  }
  return s;
}

static void batch_last_pass(const batch_work *w) {
  const size_t stride = 4 * (size_t)w->blocks;
  memset(w->pair, 0, (size_t)ep_triangle(w->n) * sizeof(vec));
  for (int x = 0; x < w->n; x++) {
    const vec *t = batch_columns(w, x / 4) + x % 4, zx = w->z[x];
    vec *a = w->a + (size_t)x * stride, *pair = w->pair;
    for (int c = 0; c <= x; c++) {
      const vec zc = w->z[c];
      vec dot = {0};
      for (int d = 0; d <= c; d++, t += 4, pair++) {
        dot += *t * w->z[d];
        a[d] += *t * zc;
        *pair += *t * zx;
      }
      a[c] += dot;
    }
  }
  const vec *pair = w->pair;
  for (int c = 0; c < w->n; c++)
    for (int d = 0; d <= c; d++) w->a[(size_t)c * stride + (size_t)d] += all((REAL)0.5) * *pair++;
}

// Tiles of columns: T of all rows for one tile stays in the second-level cache, that of a row block
// in the first.
static void batch_blocks_form(const batch_work *w, const vec *stream) {
  const int last = w->blocks - 1, rows = w->n - 4 * last, columns = ep_triangle(4 * last + 1);
  memset(w->a, 0, 16 * (size_t)w->blocks * (size_t)w->blocks * sizeof(vec));
  for (int tile = 0; tile < columns + TILE; tile += TILE) {
    const int begin = tile < columns ? tile : -1; // the other segments at the end
    const vec *s = stream;
    for (int x = 0; x < last; x++) s = batch_block_row(s, w, 4, x, begin);
    switch (rows) {
    case 1:
      batch_block_row(s, w, 1, last, begin);
      break;
    case 2:
      batch_block_row(s, w, 2, last, begin);
      break;
    case 3:
      batch_block_row(s, w, 3, last, begin);
      break;
    default:
      batch_block_row(s, w, 4, last, begin);
    }
  }
  batch_last_pass(w);
}

static void batch_square_form(const batch_work *w, const vec *s) {
  const int pairs = ep_triangle(w->n), columns = (pairs + LANES - 1) / LANES;
  for (int row = 0; row < pairs; row += 4, s += 4 * columns) {
    vec sum[4] = {{0}, {0}, {0}, {0}};
    for (int cd = 0; cd < pairs; cd++) {
      const REAL *c = (const REAL *)(s + 4 * (cd / LANES)) + cd % LANES;
      for (int i = 0; i < 4; i++) sum[i] += all(c[i * LANES]) * w->zz[cd];
    }
    for (int i = 0; i < 4 && row + i < pairs; i++) w->pair[row + i] = sum[i];
  }
  const size_t stride = 4 * (size_t)w->blocks;
  const vec *pair = w->pair;
  memset(w->a, 0, 16 * (size_t)w->blocks * (size_t)w->blocks * sizeof(vec));
  for (int c = 0; c < w->n; c++, pair++) {
    for (int d = 0; d < c; d++) w->a[(size_t)c * stride + (size_t)d] = *pair++;
    w->a[(size_t)c * stride + (size_t)c] = all((REAL)0.5) * *pair;
  }
}

// Entry (i, j) of K of every state; f (3 times the force) and the energy along the way.
static void batch_finish(const batch_work *w, int states, double *energy, double *f, double *k) {
  const int n = w->n, r = n - 1;
  const size_t stride = 4 * (size_t)w->blocks;
  vec whole = {0};
  for (int i = 0; i < n; i++) {
    vec sum = {0};
    for (int j = 0; j < n; j++) {
      const vec v = w->a[(size_t)i * stride + (size_t)j] + w->a[(size_t)j * stride + (size_t)i];
      sum += v * w->z[j];
      if (!k || i == 0 || j == 0) continue;
      double *to = k + (size_t)(i - 1) * (size_t)r + (j - 1);
      for (int l = 0; l < states; l++) to[(size_t)l * (size_t)(r * r)] = (double)v[l];
    }
    whole += sum * w->z[i];
    for (int l = 0; f && i > 0 && l < states; l++) f[l * r + i - 1] = (double)sum[l] / 3;
  }
  for (int l = 0; energy && l < states; l++) energy[l] = (double)whole[l] / 12;
}

static void batch(const ep_cubic_task *t) {
  const int r = t->r;
  batch_work w;
  lay_out(r, LANES, t->scratch, &w.w);
  w.n = w.w.n, w.blocks = w.w.blocks;
  w.z = (vec *)w.w.z, w.zz = (vec *)w.w.zz, w.pair = (vec *)w.w.pair, w.a = (vec *)w.w.a;
  w.z[0] = all(1);
  for (int i = 1; i < 4 * w.blocks; i++) {
    w.z[i] = (vec){0};
    for (int l = 0; i < w.n && l < t->states; l++) w.z[i][l] = (REAL)t->q[l * r + i - 1];
  }
  vec *out = w.zz;
  for (int c = 0; c < 4 * w.blocks; c++)
    for (int d = 0; d <= c; d++) *out++ = w.z[c] * w.z[d];
  if (w.n < EP_CUBIC_BLOCKS_FROM)
    batch_square_form(&w, t->stream);
  else
    batch_blocks_form(&w, t->stream);
  batch_finish(&w, t->states, t->energy, t->f, t->k);
}

void EP_CUBIC_KERNEL(const ep_cubic_task *t) {
  if (t->states)
    batch(t);
  else
    *t->energy = evaluate(t);
}
