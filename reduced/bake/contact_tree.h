// What contact needs of a mesh and its modes: surface vertices with their area and rows of U, and a
// tree of balls that bound them whatever q is (reduced/contact.h).
#ifndef EP_BAKE_CONTACT_TREE_H
#define EP_BAKE_CONTACT_TREE_H

#include "base/error.h"
#include "mesh/mesh.h"

typedef struct ep_contact_tree {
  int contacts, nodes, r;
  int *vertex;    // (contacts) in the tree's order
  double *x;      // (contacts x 3) at rest
  double *area;   // (contacts) a third of the triangles around
  double *u;      // (contacts x 3 x r)
  int *range;     // (nodes x 3) first vertex, end, next node when this one is passed over: a node's
                  // children follow it; it is a leaf where next is the node after it
  double *center; // (nodes x 3) at rest
  double *node_u; // (nodes x 3 x r) the centre moves by node_u q
  double *radius; // (nodes) at rest
  double *growth; // (nodes x r) radius(q) = radius + sum_k growth_k |q_k|
} ep_contact_tree;

// u (r x 3n) modes as rows. Vertices no mode moves (held ones) are left out. The tree halves its
// vertices by the longest axis of their box down to EP_CONTACT_LEAF, in an order that depends on
// nothing but the mesh. radius = max |X_i - X_c|, growth_k = max |U_ik - U_ck| over the vertices i
// (James and Pai 2004, eq. 6 to 9). Errors: EP_ERR_MEMORY; EP_ERR_ARGUMENT where no surface vertex
// moves.
enum { EP_CONTACT_LEAF = 8 };
ep_status ep_contact_tree_build(const ep_mesh *mesh, int r, const double *u, ep_contact_tree *out,
                                ep_error *err);
void ep_contact_tree_free(ep_contact_tree *tree);

// Surface area lumped to vertices, into area (nv); 0 inside. Errors: EP_ERR_MEMORY.
ep_status ep_surface_areas(const ep_mesh *mesh, double *area, ep_error *err);

#endif
