// Included once per instruction-set level and precision, with EP_CUBIC_KERNEL (the name of the
// function it defines) and REAL / LANES: double / 8 or float / 16 (64-byte vectors).
//
// Block form (docs/method.md "Floats and bits"). Rows are pairs a >= b in blocks of 4 x 4, columns
// the packed pairs c >= d up to b. Each vector S of coefficients serves three multiply-adds:
//   K_ab += S . zz,   T_a,cd += z_b S,   T_b,cd += z_a S
// and what T holds gives the other five positions of the second derivative:
//   (x, c) += T_x,cd z_d,   (x, d) += T_x,cd z_c,   (c, d) += z_x T_x,cd / 2
// with K = A + A^T at the end. A row block's own T is written by its diagonal block, which comes
// first, so that nothing is cleared. No fused multiply-adds: all levels give the same bits.
//
// What is stored and read again soon is stored and read in the same vectors (T: aligned; A: whole
// vectors, sums over lanes in a place of their own): a load that spans two stores still under way
// waits for both, which cost a fifth of the time at r = 30.
//
// Small models: K_ab = sum_cd Q_ab,cd z_c z_d with the square matrix Q over pairs.
#include <stdint.h>
#include <string.h>

#include "reduced/cubic_kernel.h"

typedef REAL vec __attribute__((vector_size(64), may_alias));
typedef REAL loose __attribute__((vector_size(64), aligned(sizeof(REAL)), may_alias));
typedef REAL vec8 __attribute__((vector_size(8 * sizeof(REAL))));
typedef REAL loose8
    __attribute__((vector_size(8 * sizeof(REAL)), aligned(sizeof(REAL)), may_alias));
typedef REAL vec4 __attribute__((vector_size(4 * sizeof(REAL))));
typedef REAL loose4
    __attribute__((vector_size(4 * sizeof(REAL)), aligned(sizeof(REAL)), may_alias));
#if LANES == 16
typedef int32_t integer;
#else
typedef int64_t integer;
#endif
typedef integer bits __attribute__((vector_size(64), aligned(sizeof(REAL)), may_alias));
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

// The first `count` lanes of v (count <= LANES), zero beyond, whatever stands there.
INLINE vec first_lanes(vec v, int count) {
  static const integer mask[2 * LANES] = {
#define EIGHT -1, -1, -1, -1, -1, -1, -1, -1
#if LANES == 16
    EIGHT,
#endif
    EIGHT
#undef EIGHT
  };
  return (vec)((bits)v & *(const bits *)(mask + LANES - count));
}

// ---- scratch memory --------------------------------------------------------------------------

typedef struct work {
  int n, blocks, stride;               // entries of z, blocks of 4, length of a row of `a`
  REAL *z, *zz;                        // entries, products of pairs
  REAL *pair;                          // sum_x z_x T_x,cd
  REAL *a;                             // (stride x stride)
  REAL *t[EP_CUBIC_MAX_MODES / 4 + 1]; // first row of each block
} work;

static void lay_out(int r, int width, void *scratch, work *w) {
  REAL *at = scratch;
  w->n = r + 1, w->blocks = (r + 4) / 4;
  w->stride = ep_cubic_stride(r, LANES);
  const int pairs = ep_cubic_pairs(r, LANES);
  w->z = at, at += (size_t)width * (size_t)(w->stride + LANES);
  w->zz = at, at += (size_t)width * (size_t)pairs;
  w->pair = at, at += (size_t)width * (size_t)pairs;
  w->a = at, at += (size_t)width * (size_t)(w->stride * w->stride);
  for (int x = 0; x < w->blocks; x++)
    w->t[x] = at, at += (size_t)width * 4 * (size_t)ep_cubic_row(x, LANES);
}

static void products(const work *w) {
  REAL *out = w->zz;
  for (int c = 0; c < w->n; c++)
    for (int d = 0; d <= c; d++) *out++ = w->z[c] * w->z[d];
  memset(out, 0, (size_t)(ep_cubic_pairs(w->n - 1, LANES) - ep_triangle(w->n)) * sizeof *out);
}

// Bytes of the stream asked for in advance; a tenth faster than the hardware alone at r = 50.
enum { AHEAD = 4096 };

// ---- main pass -------------------------------------------------------------------------------

typedef struct rows_of {
  REAL *ta, *tb;
  int na, nb; // lengths of their rows
  const REAL *za, *zb;
} rows_of;

// Vectors v .. end of the columns of one block: rows i < rows, columns j0 <= j < 4 (j <= i on the
// diagonal, whose T is written, not added to).
INLINE const vec *segment(const vec *s, const int rows, const int j0, const int diagonal, int v,
                          int end, const REAL *zz, const rows_of *o, vec sum[4][4]) {
  vec zi[4], zj[4];
  for (int i = 0; i < rows; i++) zi[i] = all(o->za[i]);
  for (int j = j0; j < 4; j++) zj[j] = all(o->zb[j]);
  for (; v < end; v++) {
    const int off = v * LANES;
    const vec q = load(zz + off);
    vec a[4], b[4];
    for (int i = 0; i < rows; i++) a[i] = diagonal ? (vec){0} : load(o->ta + i * o->na + off);
    for (int j = j0; j < 4 && !diagonal; j++) b[j] = load(o->tb + j * o->nb + off);
    for (int i = 0; i < rows; i++) {
      for (int j = j0; j < 4; j++) {
        if (diagonal && j > i) continue;
        __builtin_prefetch((const char *)s + AHEAD);
        const vec c = *s++;
        sum[i][j] += c * q;
        a[i] += c * zj[j];
        if (diagonal)
          a[j] += c * zi[i];
        else
          b[j] += c * zi[i];
      }
    }
    for (int i = 0; i < rows; i++) store(o->ta + i * o->na + off, a[i]);
    for (int j = j0; j < 4 && !diagonal; j++) store(o->tb + j * o->nb + off, b[j]);
  }
  return s;
}

INLINE const vec *block(const vec *s, const work *w, const int rows, const int diagonal, int x,
                        int y) {
  const rows_of o = {w->t[x],      w->t[y],     ep_cubic_row(x, LANES), ep_cubic_row(y, LANES),
                     w->z + 4 * x, w->z + 4 * y};
  vec sum[4][4];
  for (int i = 0; i < 16; i++) sum[i / 4][i % 4] = (vec){0};
  const int full = ep_cubic_full(y, LANES), end = ep_cubic_vectors(y, LANES);
  s = segment(s, rows, 0, diagonal, 0, full, w->zz, &o, sum);
  if (rows > 2 || !diagonal) s = segment(s, rows, 2, diagonal, full, end, w->zz, &o, sum);
  for (int i = 0; i < rows; i++)
    *(loose4 *)(w->a + (size_t)(4 * x + i) * (size_t)w->stride + 4 * y) = sum4(sum[i]);
  return s;
}

INLINE const vec *block_row(const vec *s, const work *w, const int rows, int x) {
  const int row = ep_cubic_row(x, LANES), written = ep_cubic_full(x, LANES) * LANES;
  for (int i = 0; i < rows; i++) { // where the diagonal block writes nothing
    if (rows < 3) memset(w->t[x] + i * row + written, 0, (size_t)(row - written) * sizeof(REAL));
    store(w->a + (size_t)(4 * x + i) * (size_t)w->stride + 4 * x / LANES * LANES, (vec){0});
  }
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

// T_x,cd of four c from `first` on and of `rows` x, times z_d (sums over lanes in dot) and times
// z_c (into a), vectors of d from `from` on; in the last vector only d <= c.
INLINE void four_columns(const work *w, const REAL *t, size_t row, const int rows, int first,
                         int from, int to, const int last, REAL *a, vec dot[4][4]) {
  for (int d = from; d < to; d += LANES) {
    const vec zd = load(w->z + d);
    for (int i = 0; i < rows; i++) {
      REAL *out = a + (size_t)i * (size_t)w->stride + d;
      vec sum = load(out);
      for (int k = 0; k < 4; k++) {
        vec v = load(t + (size_t)i * row + ep_triangle(first + k) + d);
        if (last) v = first_lanes(v, ep_least(first + k + 1 - d, LANES));
        dot[i][k] += v * zd;
        sum += v * all(w->z[first + k]);
      }
      store(out, sum);
    }
  }
}

// (x, c) and (x, d) of `rows` rows from x on, all of one block.
INLINE void add_rows(const work *w, const int rows, int x) {
  const size_t stride = (size_t)w->stride, row = (size_t)ep_cubic_row(x / 4, LANES);
  const REAL *t = w->t[x / 4] + (size_t)(x % 4) * row;
  const int end = x / 4 * 4 + 4;
  REAL *a = w->a + (size_t)x * stride, dots[4][EP_CUBIC_MAX_MODES + 1 + LANES];
  for (int c = 0; c < end; c += 4) {
    vec dot[4][4];
    for (int i = 0; i < rows; i++)
      for (int k = 0; k < 4; k++) dot[i][k] = (vec){0};
    const int whole = (c + 1) / LANES * LANES;
    four_columns(w, t, row, rows, c, 0, whole, 0, a, dot);
    four_columns(w, t, row, rows, c, whole, whole + 1, 1, a, dot);
    for (int i = 0; i < rows; i++) *(loose4 *)(dots[i] + c) = sum4(dot[i]);
  }
  for (int i = 0; i < rows; i++, a += stride)
    for (int c = 0; c < end; c += LANES)
      store(a + c, load(a + c) + first_lanes(load(dots[i] + c), ep_least(end - c, LANES)));
}

static void add_quarter_pairs(const work *w) {
  const REAL *pair = w->pair;
  for (int c = 0; c < w->n; pair += ++c) {
    REAL *a = w->a + (size_t)c * (size_t)w->stride;
    for (int d = 0; d <= c; d += LANES)
      store(a + d,
            load(a + d) + all((REAL)0.5) * first_lanes(load(pair + d), ep_least(c + 1 - d, LANES)));
  }
}

INLINE void transpose8(vec8 m[8]) {
  vec8 t[8];
  for (int i = 0; i < 8; i += 2) {
    t[i] = __builtin_shufflevector(m[i], m[i + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    t[i + 1] = __builtin_shufflevector(m[i], m[i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
  for (int i = 0; i < 8; i += 4)
    for (int j = 0; j < 2; j++) {
      m[i + j] = __builtin_shufflevector(t[i + j], t[i + j + 2], 0, 1, 8, 9, 4, 5, 12, 13);
      m[i + j + 2] = __builtin_shufflevector(t[i + j], t[i + j + 2], 2, 3, 10, 11, 6, 7, 14, 15);
    }
  for (int i = 0; i < 4; i++) {
    t[i] = __builtin_shufflevector(m[i], m[i + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    t[i + 4] = __builtin_shufflevector(m[i], m[i + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
  for (int i = 0; i < 8; i++) m[i] = t[i];
}

// K = A + A^T in tiles of 8 x 8; A stands in the lower triangle.
static void add_transpose(const work *w) {
  const size_t stride = (size_t)w->stride;
  for (int i = 0; i < w->n; i += 8) {
    for (int j = 0; j <= i; j += 8) {
      REAL *low = w->a + (size_t)i * stride + j, *high = w->a + (size_t)j * stride + i;
      vec8 m[8];
      for (int k = 0; k < 8; k++) m[k] = *(loose8 *)(low + (size_t)k * stride);
      transpose8(m);
      for (int k = 0; k < 8; k++) {
        loose8 *to = (loose8 *)(high + (size_t)k * stride);
        *to = i == j ? (vec8)(*to + m[k]) : m[k];
      }
    }
  }
}

// From K (N x N) in a: k without the constant entry; f = K z / 3; returns W.
static double finish(const work *w, const double *q, double *f, double *k) {
  const int r = w->n - 1;
  const REAL *a = w->a;
  double first = (double)a[0], energy = 0;
  for (int j = 0; j < r; j++) f[j] = (double)a[j + 1], first += f[j] * q[j];
  for (int i = 0; i < r; i++) {
    a += w->stride;
    double *row = k + (size_t)i * (size_t)r;
    for (int j = 0; j < r; j++) {
      row[j] = (double)a[j + 1];
      f[j] += row[j] * q[i];
    }
  }
  for (int i = 0; i < r; i++) {
    f[i] *= 1.0 / 3;
    energy += f[i] * q[i];
  }
  return 0.25 * (energy + first / 3);
}

static void blocks_form(const work *w, const vec *s) {
  const int last = w->blocks - 1, rows = w->n - 4 * last;
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
  WITH_ROWS(add_pairs(w, 1, last, 1), add_pairs(w, 2, last, 1), add_pairs(w, 3, last, 1),
            add_pairs(w, 4, last, 1))
#undef WITH_ROWS
  for (int x = last - 1; x >= 0; x--) add_pairs(w, 4, x, 0);
  for (int x = 0; x < last; x++) add_rows(w, 4, 4 * x);
  for (int x = 4 * last; x < w->n; x++) add_rows(w, 1, x);
  add_quarter_pairs(w);
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
  memset(w->a, 0, (size_t)(w->stride * w->stride) * sizeof(REAL));
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
  products(&w);
  if (w.n < EP_CUBIC_BLOCKS_FROM)
    square_form(&w, t->stream);
  else
    blocks_form(&w, t->stream);
  add_transpose(&w);
  return finish(&w, t->q, t->f, t->k);
}

#include "reduced/cubic_batch_body.h"

void EP_CUBIC_KERNEL(const ep_cubic_task *t) {
  if (t->states)
    batch(t);
  else
    *t->energy = evaluate(t);
}
