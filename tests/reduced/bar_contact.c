#include "tests/reduced/bar_contact.h"

#include <stdlib.h>
#include <string.h>

void bar_add_contact(bar *b, double young, ep_contact_tree *tree) {
  ep_mesh mesh;
  ep_error err = {0};
  ep_model *m = &b->model;
  if (ep_mesh_make(m->size.n, m->rest_x, m->size.nt, m->tets, "bar", &mesh, NULL, &err) != EP_OK ||
      ep_contact_tree_build(&mesh, m->size.r, m->u, tree, &err) != EP_OK ||
      b->owned_count == (int)(sizeof b->owned / sizeof *b->owned))
    abort();
  double *scale = b->owned[b->owned_count++] = aligned_alloc(64, 64);
  if (!scale) abort();
  *scale = young / ep_mesh_diagonal(&mesh);
  m->size.contacts = tree->contacts;
  m->size.nodes = tree->nodes;
  m->contact_vertex = tree->vertex;
  m->contact_x = tree->x;
  m->contact_area = tree->area;
  m->contact_u = tree->u;
  m->tree_range = tree->range;
  m->tree_center = tree->center;
  m->tree_u = tree->node_u;
  m->tree_radius = tree->radius;
  m->tree_growth = tree->growth;
  m->contact_scale = scale;
  ep_mesh_free(&mesh);
}
