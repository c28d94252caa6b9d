#include <stdlib.h>

#include "base/forest.h"
#include "lbspace/private.h"
#include "mesh/topology.h"

ep_status ep_lb_components(const ep_mesh *mesh, int *count, int *component, ep_error *err) {
  int *parent = malloc((size_t)mesh->nv * sizeof *parent);
  if (!parent) return ep_fail(err, EP_ERR_MEMORY, "no memory for %d vertices", mesh->nv);
  ep_mesh_join_tets(mesh, parent);
  *count = 0;
  for (int i = 0; i < mesh->nv; i++) {
    const int root = ep_forest_root(parent, i); // the lowest vertex: met before the others
    component[i] = root == i ? (*count)++ : component[root];
  }
  free(parent);
  return EP_OK;
}
