#include "box.h"

#include <stdio.h>

#include <stdlib.h>

// Kuhn's subdivision: six tets for the six orders in which the axes can be walked.
static const int orders[6][3] = {{0, 1, 2}, {1, 2, 0}, {2, 0, 1}, {0, 2, 1}, {2, 1, 0}, {1, 0, 2}};

static int vertex(const int *n, const int *at) {
  return 1 + at[0] + (n[0] + 1) * (at[1] + (n[1] + 1) * at[2]);
}

static int write_cell(FILE *f, const int *n, const int *cell, int number) {
  for (int t = 0; t < 6; t++) {
    int at[3] = {cell[0], cell[1], cell[2]};
    fprintf(f, "%d %d", ++number, vertex(n, at));
    for (int s = 0; s < 3; s++) {
      at[orders[t][s]]++;
      fprintf(f, " %d", vertex(n, at));
    }
    fputc('\n', f);
  }
  return number;
}

void write_box(const char *path, int nx, int ny, int nz, double lx, double bend, double young) {
  const int n[3] = {nx, ny, nz};
  const double h = lx / nx;
  FILE *f = fopen(path, "w");
  if (!f) abort();
  fprintf(f, "*VERTICES\n%d 3 0 0\n", (nx + 1) * (ny + 1) * (nz + 1));
  int at[3], number = 0;
  for (at[2] = 0; at[2] <= nz; at[2]++)
    for (at[1] = 0; at[1] <= ny; at[1]++)
      for (at[0] = 0; at[0] <= nx; at[0]++) {
        const double x = h * at[0];
        fprintf(f, "%d %.17g %.17g %.17g\n", vertex(n, at), x, h * at[1] + bend * x * x, h * at[2]);
      }
  fprintf(f, "*ELEMENTS\nTET\n%d 4 0\n", 6 * nx * ny * nz);
  for (at[2] = 0; at[2] < nz; at[2]++)
    for (at[1] = 0; at[1] < ny; at[1]++)
      for (at[0] = 0; at[0] < nx; at[0]++) number = write_cell(f, n, at, number);
  if (young > 0)
    fprintf(f, "*MATERIAL BODY\nENU, 1000, %.17g, 0.4\n*REGION\nallElements, BODY\n", young);
  fclose(f);
}

void write_text(const char *path, const char *text) {
  FILE *f = fopen(path, "w");
  if (!f) abort();
  fputs(text, f);
  fclose(f);
}
