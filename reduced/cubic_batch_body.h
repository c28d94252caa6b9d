// Part of cubic_body.h: many states of one model. The same sums with one number of every state in
// each vector, and nothing to sum over lanes: every coefficient is read once and used for as many
// states as a vector has lanes.
//
// A tile of columns (c, d) goes through all blocks before the next one: its T then is complete,
// serves the last pass and is forgotten; T as a whole (1.5 MB at r = 50) is never stored. Four
// vectors of columns: with one, the blocks are too short (43 us a state instead of 33 at r = 50);
// with 16 there is nothing more to win.

typedef struct batch_work {
  int n, stride;  // entries of z; rows of T and A, a multiple of 4
  vec *z, *zz;    // entries, products of pairs
  vec *a;         // (stride x stride): a[b * stride + a], the larger index inside
  vec *t;         // (blocks of 4 x tile of columns x 4)
  int first, end; // vectors of columns under way
  const vec *s;   // stream
  int part[EP_CUBIC_MAX_MODES / 4 + 2]; // vectors a row of the blocks before y takes
} batch_work;

static void batch_lay_out(const ep_cubic_task *task, batch_work *w) {
  const size_t stride = (size_t)ep_round_up(task->r + 1, 4);
  w->first = 0, w->end = EP_CUBIC_TILE;
  w->n = task->r + 1, w->stride = (int)stride, w->s = task->stream;
  w->z = task->scratch;
  w->zz = w->z + stride;
  w->a = w->zz + ep_triangle((int)stride);
  w->t = w->a + stride * stride;
  w->part[0] = 0;
  for (int y = 0; y < w->stride / 4; y++)
    w->part[y + 1] = w->part[y] + 2 * (ep_cubic_full(y, LANES) + ep_cubic_vectors(y, LANES));
  for (int i = 0; i < w->stride; i++) {
    w->z[i] = (vec){0};
    if (i == 0) w->z[i] = all(1);
    for (int l = 0; i > 0 && i < w->n && l < task->states; l++)
      w->z[i][l] = (REAL)task->q[l * task->r + i - 1];
  }
  vec *out = w->zz;
  for (int c = 0; c < w->stride; c++)
    for (int d = 0; d <= c; d++) *out++ = w->z[c] * w->z[d];
}

// T of block x: its four rows together for each column of the tile.
INLINE vec *batch_t(const batch_work *w, int x) {
  return w->t + (size_t)x * 4 * EP_CUBIC_TILE * LANES;
}

// Vectors v .. end of the columns of one block, its pairs (i, j), j0 <= j < j0 + 2; s: coefficients
// of vector v, of pairs with j >= from.
INLINE void batch_pairs(const batch_work *w, const vec *s, const int rows, const int from,
                        const int j0, const int diagonal, int x, int y, int v, int end) {
  const size_t stride = (size_t)w->stride;
  const int each = diagonal ? ep_triangle(rows - from) : (4 - from) * rows;
  const vec *za = w->z + 4 * x, *zb = w->z + 4 * y;
  vec *ta = batch_t(w, x) + 4 * LANES * (v - w->first);
  vec *tb = batch_t(w, y) + 4 * LANES * (v - w->first),
      *a = w->a + (size_t)(4 * y) * stride + 4 * x;
  vec sum[4][2], zi[4], zj[2]; // z in registers: a store might change it for all a compiler knows
  for (int i = 0; i < rows; i++) zi[i] = za[i];
  for (int j = 0; j < 2; j++) zj[j] = zb[j0 + j];
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < 2; j++) sum[i][j] = a[(size_t)(j0 + j) * stride + (size_t)i];
  for (; v < end; v++, s += each) {
    const REAL *c = (const REAL *)s;
    const int count = ep_least(LANES, ep_triangle(4 * y + 4) - v * LANES);
    for (int l = 0; l < count; l++, c++, ta += 4, tb += 4) {
      if (from == j0) __builtin_prefetch((const char *)(s + 2 * l) + AHEAD);
      const vec q = w->zz[v * LANES + l];
      vec t[4], u[2];
      for (int i = 0; i < rows; i++) t[i] = ta[i];
      for (int j = 0; j < 2 && !diagonal; j++) u[j] = tb[j0 + j];
      for (int i = 0; i < rows; i++) {
        for (int j = j0; j < j0 + 2; j++) {
          if (diagonal && j > i) continue;
          const int pair = diagonal ? ep_triangle(i - from) + j - from : (4 - from) * i + j - from;
          const vec one = all(c[pair * LANES]);
          sum[i][j - j0] += one * q;
          t[i] += one * zj[j - j0];
          if (diagonal)
            t[j] += one * zi[i];
          else
            u[j - j0] += one * zi[i];
        }
      }
      for (int i = 0; i < rows; i++) ta[i] = t[i];
      for (int j = 0; j < 2 && !diagonal; j++) tb[j0 + j] = u[j];
    }
  }
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < 2; j++) a[(size_t)(j0 + j) * stride + (size_t)i] = sum[i][j];
}

// The columns under way of one block; s: the block's first vector.
INLINE void batch_block(const batch_work *w, const vec *s, const int rows, const int diagonal,
                        int x, int y) {
  const int full = ep_cubic_full(y, LANES), end = ep_least(w->end, ep_cubic_vectors(y, LANES));
  const int each = diagonal ? ep_triangle(rows) : 4 * rows;
  const int less = diagonal ? ep_triangle(rows - 2) : 2 * rows;
  if (w->first < full) {
    const vec *c = s + w->first * each;
    batch_pairs(w, c, rows, 0, 0, diagonal, x, y, w->first, ep_least(full, end));
    if (rows > 2 || !diagonal)
      batch_pairs(w, c, rows, 0, 2, diagonal, x, y, w->first, ep_least(full, end));
  }
  const int v = w->first < full ? full : w->first;
  if (v < end && (rows > 2 || !diagonal))
    batch_pairs(w, s + full * each + (v - full) * less, rows, 2, 2, diagonal, x, y, v, end);
}

// Vectors of the diagonal block.
static int batch_diagonal(int rows, int x) {
  const int full = ep_cubic_full(x, LANES);
  return full * ep_triangle(rows) +
         (rows > 2 ? (ep_cubic_vectors(x, LANES) - full) * ep_triangle(rows - 2) : 0);
}

INLINE void batch_block_row(const batch_work *w, const vec *s, const int rows, int x, int y0) {
  batch_block(w, s, rows, 1, x, x);
  s += batch_diagonal(rows, x);
  for (int y = y0; y < x; y++) batch_block(w, s + rows * w->part[y], rows, 0, x, y);
}

// What T of `count` columns, all with one c, gives the other positions.
INLINE void batch_add(const batch_work *w, int column, int c, int d, const int count) {
  const size_t stride = (size_t)w->stride;
  vec *ac = w->a + (size_t)c * stride, *ad = w->a + (size_t)d * stride;
  const vec zc = w->z[c];
  vec pair[4], zd[4];
  for (int l = 0; l < count; l++) pair[l] = (vec){0}, zd[l] = w->z[d + l];
  for (int x = c; x < w->n; x++) {
    const vec zx = w->z[x], *t = batch_t(w, x / 4) + 4 * column + x % 4;
    vec sum = {0};
    for (int l = 0; l < count; l++) {
      const vec v = t[4 * l];
      sum += v * zd[l];
      ad[(size_t)l * stride + (size_t)x] += v * zc;
      pair[l] += v * zx;
    }
    ac[x] += sum;
  }
  for (int l = 0; l < count; l++) ad[(size_t)l * stride + (size_t)c] += all((REAL)0.5) * pair[l];
}

// The last pass of the tile's columns; c, d: the first of them, moved on.
static void batch_last_pass(const batch_work *w, int *c, int *d) {
  for (int l = 0; l < EP_CUBIC_TILE * LANES && *c < w->n;) {
    const int left = ep_least(EP_CUBIC_TILE * LANES - l, *c + 1 - *d), count = left < 4 ? 1 : 4;
    if (count == 4)
      batch_add(w, l, *c, *d, 4);
    else
      batch_add(w, l, *c, *d, 1);
    l += count, *d += count;
    if (*d > *c) ++*c, *d = 0;
  }
}

static void batch_blocks_form(batch_work *w) {
  const int last = w->stride / 4 - 1, rows = w->n - 4 * last;
  const size_t stride = (size_t)w->stride;
  memset(w->a, 0, stride * stride * sizeof(vec));
  for (int y0 = 0, c = 0, d = 0; c < w->n; w->first = w->end, w->end += EP_CUBIC_TILE) {
    const vec *s = w->s;
    while (ep_cubic_vectors(y0, LANES) <= w->first) y0++;
    memset(w->t, 0, EP_CUBIC_TILE * LANES * stride * sizeof(vec));
    for (int x = 0; x < last; s += batch_diagonal(4, x) + 4 * w->part[x], x++)
      if (x >= y0) batch_block_row(w, s, 4, x, y0);
    switch (rows) {
    case 1:
      batch_block_row(w, s, 1, last, y0);
      break;
    case 2:
      batch_block_row(w, s, 2, last, y0);
      break;
    case 3:
      batch_block_row(w, s, 3, last, y0);
      break;
    default:
      batch_block_row(w, s, 4, last, y0);
    }
    batch_last_pass(w, &c, &d);
  }
}

static void batch_square_form(const batch_work *w) {
  const int pairs = ep_triangle(w->n), columns = (pairs + LANES - 1) / LANES;
  const vec *s = w->s;
  int a = 0, b = 0;
  for (int row = 0; row < pairs; row += 4, s += 4 * columns) {
    vec sum[4] = {{0}, {0}, {0}, {0}};
    for (int cd = 0; cd < pairs; cd++) {
      const REAL *c = (const REAL *)(s + 4 * (cd / LANES)) + cd % LANES;
      for (int i = 0; i < 4; i++) sum[i] += all(c[i * LANES]) * w->zz[cd];
    }
    for (int i = 0; i < 4 && row + i < pairs; i++) {
      w->a[b * w->stride + a] = sum[i] * all(a == b ? (REAL)0.5 : 1);
      if (++b > a) a++, b = 0;
    }
  }
}

// Entry (i, j) of K of every state; f (3 times the force) and the energy along the way.
static void batch_finish(const batch_work *w, int states, double *energy, double *f, double *k) {
  const int n = w->n, r = n - 1, stride = w->stride;
  vec whole = {0};
  for (int i = 0; i < n; i++) {
    vec sum = {0};
    for (int j = 0; j < n; j++) {
      vec v = w->a[ep_least(i, j) * stride + (i < j ? j : i)];
      if (i == j) v += v;
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
  batch_work w;
  batch_lay_out(t, &w);
  if (w.n < EP_CUBIC_BLOCKS_FROM)
    batch_square_form(&w);
  else
    batch_blocks_form(&w);
  batch_finish(&w, t->states, t->energy, t->f, t->k);
}
