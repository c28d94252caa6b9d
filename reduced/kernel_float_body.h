// Part of kernel_body.h: the sums of a task with g_float. G is read in floats and the stiffness is
// summed in floats, 16 lanes. F, the laws, energy and force stay in doubles, so that the force is
// the exact gradient of the energy (of a model whose G is rounded once) and nothing else is lost:
// Newton converges as far as with doubles, its Hessian is right to 1e-6.
//
// Rows of G: 16 ceil(r / 16) floats, (s x 9 x row).

typedef float narrow __attribute__((vector_size(64), may_alias));
typedef float narrow8 __attribute__((vector_size(32), may_alias));

enum { NARROW = 16 };

LANE_INLINE int narrow_row(const ep_kernel_task *t) {
  return (t->blocks + 1) / 2 * NARROW;
}

LANE_INLINE const float *narrow_g(const ep_kernel_task *t, int element) {
  return t->g_float + (size_t)element * 9 * (size_t)narrow_row(t);
}

LANE_INLINE lane widen(const float *x) {
  return __builtin_convertvector(*(const narrow8 *)x, lane);
}

// row[c]: sum over blocks of 8 modes of G_c q.
static void narrow_rows(const ep_kernel_task *t, int element, lane row[9]) {
  const lane *q = (const lane *)t->q;
  const float *g = narrow_g(t, element);
  const int length = narrow_row(t);
  for (int c = 0; c < 9; c++)
    for (int b = 0; b < t->blocks; b++) row[c] += widen(g + c * length + EP_LANES * b) * q[b];
}

static void narrow_force(const ep_kernel_task *t, int first, const lane stress[9]) {
  const int count = t->s - first < EP_LANES ? t->s - first : EP_LANES, length = narrow_row(t);
  lane *f = (lane *)t->f;
  for (int b = 0; b < t->blocks; b++) {
    lane chain[3] = {f[b], lane_all(0), lane_all(0)};
    for (int e = 0; e < count; e++) {
      const float *g = narrow_g(t, first + e) + EP_LANES * b;
      const double *p = (const double *)stress + e;
      for (int c = 0; c < 9; c++) chain[c % 3] += widen(g + c * length) * lane_all(p[EP_LANES * c]);
    }
    f[b] = (chain[0] + chain[1]) + chain[2];
  }
}

// B = H G of one group, laid out as G.
static void narrow_product(const ep_kernel_task *t, int count, const narrow *g, const lane *tangent,
                           narrow *out) {
  const int vectors = narrow_row(t) / NARROW;
  for (int e = 0; e < count; e++, g += 9 * vectors, out += 9 * vectors) {
    float h[81];
    for (int c = 0; c < 81; c++) h[c] = (float)((const double *)tangent)[EP_LANES * c + e];
    for (int v = 0; v < vectors; v++) {
      narrow x[9];
      for (int c = 0; c < 9; c++) x[c] = g[c * vectors + v];
      for (int i = 0; i < 9; i++) {
        narrow sum = x[0] * h[9 * i];
        for (int j = 1; j < 9; j++) sum += x[j] * h[9 * i + j];
        out[i * vectors + v] = sum;
      }
    }
  }
}

// Rows row .. row + TILE_ROWS - 1 of K, `columns` vectors from `column` on, one group.
LANE_INLINE void narrow_tile(int vectors, const narrow *g, const narrow *b, int count, int row,
                             int column, const int columns, narrow *k) {
  narrow sum[TILE_ROWS][TILE_COLUMNS];
  k += (size_t)row * (size_t)vectors + column;
  for (int i = 0; i < TILE_ROWS; i++)
    for (int j = 0; j < columns; j++) sum[i][j] = k[i * vectors + j];
  for (int c = 0; c < 9 * count; c++) {
    const float *left = (const float *)(g + (size_t)c * (size_t)vectors) + row;
    narrow x[TILE_COLUMNS];
    for (int j = 0; j < columns; j++) x[j] = b[(size_t)c * (size_t)vectors + (size_t)(column + j)];
    for (int i = 0; i < TILE_ROWS; i++)
      for (int j = 0; j < columns; j++) sum[i][j] += x[j] * left[i];
  }
  for (int i = 0; i < TILE_ROWS; i++)
    for (int j = 0; j < columns; j++) k[i * vectors + j] = sum[i][j];
}

// K += G^T H G on the upper triangle, of the elements of one group.
static void narrow_stiffness(const ep_kernel_task *t, int first, const lane *tangent, narrow *k) {
  const int count = t->s - first < EP_LANES ? t->s - first : EP_LANES;
  const int vectors = narrow_row(t) / NARROW;
  const narrow *g = (const narrow *)narrow_g(t, first);
  narrow *product = k + (size_t)narrow_row(t) * (size_t)vectors;
  narrow_product(t, count, g, tangent, product);
  for (int row = 0; row < EP_LANES * t->blocks; row += TILE_ROWS) {
    int column = row / NARROW;
    for (; column + TILE_COLUMNS <= vectors; column += TILE_COLUMNS)
      narrow_tile(vectors, g, product, count, row, column, TILE_COLUMNS, k);
    if (TILE_COLUMNS > 1 && column < vectors)
      narrow_tile(vectors, g, product, count, row, column, 1, k);
  }
}

static void narrow_finish(const ep_kernel_task *t, const float *k) {
  const int width = EP_LANES * t->blocks, length = narrow_row(t);
  for (int i = 0; i < width; i++)
    for (int j = i; j < width; j++)
      t->k[i * width + j] = t->k[j * width + i] = (double)k[i * length + j];
}
