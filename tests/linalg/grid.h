// A box cut into tets for tests: counts (nx, ny, nz) cells of 6 tets each (Kuhn's cut, conforming).
#ifndef EP_TESTS_LINALG_GRID_H
#define EP_TESTS_LINALG_GRID_H

typedef struct grid {
  int nv, nt;
  double *x; // (nv x 3)
  int *tet;  // (nt x 4), positive volume
} grid;

grid grid_make(int nx, int ny, int nz, double lx, double ly, double lz);
void grid_free(grid *g);

#endif
