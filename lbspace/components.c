#include <stdlib.h>

#include "lbspace/private.h"

// Root of i, halving the path on the way.
static int root_of(int *parent, int i) {
  while (parent[i] != i) i = parent[i] = parent[parent[i]];
  return i;
}

ep_status ep_lb_components(const ep_mesh *mesh, int *count, int *component, ep_error *err) {
  int *parent = malloc((size_t)mesh->nv * sizeof *parent);
  if (!parent) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d vertices", mesh->nv);
  for (int i = 0; i < mesh->nv; i++) parent[i] = i;
  for (int e = 0; e < mesh->nt; e++)
    for (int c = 1; c < 4; c++) {
      const int a = root_of(parent, mesh->tet[4 * e]), b = root_of(parent, mesh->tet[4 * e + c]);
      // The lower vertex becomes the root, so that it is met first below.
      if (a < b)
        parent[b] = a;
      else
        parent[a] = b;
    }
  *count = 0;
  for (int i = 0; i < mesh->nv; i++) {
    const int root = root_of(parent, i);
    component[i] = root == i ? (*count)++ : component[root];
  }
  free(parent);
  return EP_OK;
}
