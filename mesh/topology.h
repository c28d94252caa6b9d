// How tets hang together: faces, the surface, parts.
#ifndef EP_MESH_TOPOLOGY_H
#define EP_MESH_TOPOLOGY_H

#include "mesh/mesh.h"

typedef struct ep_mesh_topology {
  // Faces on which two tets lie on the same side, or which three tets or more share: tets overlap.
  int overlapping_faces, overlap_first, overlap_second; // the first pair of tets, -1 where none
  // Edges of the surface that do not belong to two triangles, and further vertices in which it
  // touches itself: tets that hang together by an edge or a vertex only.
  int open_edges, open_edge[2]; // vertices of the first, -1 where none
  int pinched_vertices, first_pinched;
} ep_mesh_topology;
// Errors: EP_ERR_MEMORY.
ep_status ep_mesh_examine(const ep_mesh *mesh, ep_mesh_topology *out, ep_error *err);

// Joins the vertices of every tet in the forest parent (nv, base/forest.h). Returns the number of
// parts: a part hangs together by shared vertices.
int ep_mesh_join_tets(const ep_mesh *mesh, int *parent);

// The part each tet belongs to (nt), by number of tets: 0 is the largest. size (at most *parts
// entries of it, caller's array of nt) receives the tets of each. Tets hang together by vertices.
ep_status ep_mesh_parts(const ep_mesh *mesh, int *part, int *size, int *parts, ep_error *err);

#endif
