#include "tests/lbspace/shapes.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "base/files.h"
#include "base/random.h"
#include "mesh/io.h"
#include "tests/linalg/grid.h"

ep_mesh shape_box(int nx, int ny, int nz, double lx, double ly, double lz) {
  grid g = grid_make(nx, ny, nz, lx, ly, lz);
  ep_mesh mesh;
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(g.nv, g.x, g.nt, g.tet, "box", &mesh, NULL, &err), EP_OK);
  grid_free(&g);
  return mesh;
}

static void shuffle(int n, int *p, uint64_t seed) {
  ep_random rng = ep_random_seed(seed, 0);
  for (int i = 0; i < n; i++) p[i] = i;
  for (int i = n - 1; i > 0; i--) {
    const int j = ep_random_below(&rng, i + 1), kept = p[i];
    p[i] = p[j];
    p[j] = kept;
  }
}

ep_mesh shape_permuted(const ep_mesh *mesh, int *to) {
  int *order = malloc((size_t)mesh->nt * sizeof *order);
  int *tet = malloc(4 * (size_t)mesh->nt * sizeof *tet);
  double *x = malloc(3 * (size_t)mesh->nv * sizeof *x);
  shuffle(mesh->nv, to, 11);
  shuffle(mesh->nt, order, 12);
  for (int i = 0; i < 3 * mesh->nv; i++) x[3 * to[i / 3] + i % 3] = mesh->x[i];
  for (int i = 0; i < 4 * mesh->nt; i++) tet[4 * order[i / 4] + i % 4] = to[mesh->tet[i]];
  ep_mesh out;
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(mesh->nv, x, mesh->nt, tet, "permuted", &out, NULL, &err), EP_OK);
  free(order);
  free(tet);
  free(x);
  return out;
}

int shape_from_data(const char *file, ep_mesh *out) {
  char path[EP_PATH_MAX];
  snprintf(path, sizeof path, "%s/../shared/data/%s", EP_SOURCE_DIR, file);
  if (!ep_path_exists(path)) {
    print_message("skipped: the shared data folder has no %s\n", file);
    return 0;
  }
  ep_error err = {0};
  if (ep_mesh_read(path, out, NULL, NULL, &err) != EP_OK) fail_msg("%s", err.text);
  return 1;
}
