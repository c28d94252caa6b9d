#include "tests/linalg/grid.h"

#include <assert.h>
#include <stdlib.h>

// The six ways from corner 000 to corner 111 along the axes; odd permutations have two corners
// swapped so that every tet has positive volume.
static void cut_cell(const int corner[8], int *tet) {
  static const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1},
                                   {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};
  for (int p = 0; p < 6; p++) {
    const int a = 1 << orders[p][0], b = a | 1 << orders[p][1];
    int *t = tet + 4 * p;
    t[0] = corner[0];
    t[1] = corner[p < 3 ? a : b];
    t[2] = corner[p < 3 ? b : a];
    t[3] = corner[7];
  }
}

grid grid_make(int nx, int ny, int nz, double lx, double ly, double lz) {
  grid g = {.nv = (nx + 1) * (ny + 1) * (nz + 1), .nt = 6 * nx * ny * nz};
  g.x = malloc(3 * (size_t)g.nv * sizeof *g.x);
  g.tet = malloc(4 * (size_t)g.nt * sizeof *g.tet);
  assert(g.x && g.tet);
  double *x = g.x;
  for (int k = 0; k <= nz; k++)
    for (int j = 0; j <= ny; j++)
      for (int i = 0; i <= nx; i++, x += 3) {
        x[0] = lx * i / nx;
        x[1] = ly * j / ny;
        x[2] = lz * k / nz;
      }
  int *tet = g.tet;
  for (int k = 0; k < nz; k++)
    for (int j = 0; j < ny; j++)
      for (int i = 0; i < nx; i++, tet += 24) {
        int corner[8];
        for (int c = 0; c < 8; c++)
          corner[c] = (i + (c & 1)) + (nx + 1) * ((j + (c >> 1 & 1)) + (ny + 1) * (k + (c >> 2)));
        cut_cell(corner, tet);
      }
  return g;
}

void grid_free(grid *g) {
  free(g->x);
  free(g->tet);
}
