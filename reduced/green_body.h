// Included once per instruction-set level with EP_GREEN defined as the name of its function.
//
// Bytes decide: 32 strains at r = 50 are 32 x 28 tiles x 512 bytes = 459 KB, half of the square
// matrices, and stay in L2. Both functions read them once; two multiply-adds a number.
#include <string.h>

#include "reduced/green.h"
#include "reduced/lanes.h"

// out += (L + L^T) z for the tile at rows a, lanes b.
LANE_INLINE void add_tile(const lane *tile, const double *z, int a, int b, lane *row_sum,
                          lane *out) {
  const lane zb = *(const lane *)(const void *)(z + 8 * b);
  lane across = lane_all(0);
  for (int i = 0; i < 8; i++) {
    row_sum[i] += tile[i] * zb;
    across += tile[i] * lane_all(z[8 * a + i]);
  }
  out[b] += across;
}

static void green_products(const ep_green_task *t) {
  const int blocks = t->blocks;
  const size_t width = 8 * (size_t)blocks, tiles = (size_t)blocks * ((size_t)blocks + 1) / 2;
  for (int i = 0; i < t->count; i++) {
    const lane *tile = (const lane *)(const void *)(t->b + 64 * tiles * (size_t)i);
    const double *linear = t->linear + width * (size_t)i;
    double *jacobian = t->jacobian + width * (size_t)i;
    lane *out = (lane *)(void *)jacobian, sum = lane_all(0);
    memset(jacobian, 0, width * sizeof *jacobian);
    for (int a = 0; a < blocks; a++) {
      lane row_sum[8] = {{0}};
      for (int b = 0; b <= a; b++, tile += 8) add_tile(tile, t->z, a, b, row_sum, out);
      out[a] += lane_sum8(row_sum);
    }
    for (int a = 0; a < blocks; a++) { // y = z . (jacobian + linear) / 2
      const lane l = ((const lane *)(const void *)linear)[a];
      out[a] += l;
      sum += ((const lane *)(const void *)t->z)[a] * (out[a] + l);
    }
    t->y[i] = 0.5 * lane_sum(sum);
  }
}

// h += the tile at rows a, lanes b: `half` holds L of a symmetric L + L^T, `whole` the entries.
LANE_INLINE void scatter_tile(int r, int a, int b, const lane *half, const lane *whole, double *h) {
  const int rows = r - 8 * a < 8 ? r - 8 * a : 8, columns = r - 8 * b < 8 ? r - 8 * b : 8;
  for (int i = 0; i < rows; i++)
    for (int j = 0; j < columns; j++) {
      const size_t p = (size_t)(8 * a + i), q = (size_t)(8 * b + j);
      if (a == b) {
        h[p * (size_t)r + q] += (half[i][j] + half[j][i]) + whole[i][j];
      } else {
        const double x = half[i][j] + whole[i][j];
        h[p * (size_t)r + q] += x;
        h[q * (size_t)r + p] += x;
      }
    }
}

static void green_curvature(const ep_green_task *t, int r, const double *scale, const double *low,
                            double *h) {
  const int blocks = t->blocks;
  const size_t width = 8 * (size_t)blocks, tiles = (size_t)blocks * ((size_t)blocks + 1) / 2;
  size_t at = 0;
  for (int a = 0; a < blocks; a++)
    for (int b = 0; b <= a; b++, at++) {
      lane half[8] = {{0}}, whole[8] = {{0}};
      for (int i = 0; i < t->count; i++) {
        const lane *tile = (const lane *)(const void *)(t->b + 64 * (tiles * (size_t)i + at));
        const double *row = low + width * (size_t)i;
        const lane s = lane_all(scale[i]), right = *(const lane *)(const void *)(row + 8 * b);
        for (int c = 0; c < 8; c++) {
          half[c] += s * tile[c];
          whole[c] -= lane_all(row[8 * a + c]) * right;
        }
      }
      scatter_tile(r, a, b, half, whole, h);
    }
}

ep_green_kernel EP_GREEN(void) {
  return (ep_green_kernel){green_products, green_curvature};
}
