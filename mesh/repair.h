// Repairs that change no shape: what cannot be simulated is left out, what stands twice is joined.
#ifndef EP_MESH_REPAIR_H
#define EP_MESH_REPAIR_H

#include "mesh/mesh.h"

// Vertices nearer than this times the diagonal of the bounding box stand in one place: files with 9
// digits may hold one point in two ways.
#define EP_SAME_PLACE 1e-9

// For each vertex the lowest vertex in the same place, into first (nv); *count of those that have
// an earlier one. Chains are followed: places within the tolerance of each other are one.
ep_status ep_mesh_same_places(const ep_mesh *mesh, int *first, int *count, ep_error *err);

typedef struct ep_mesh_repairs {
  bool largest_only;                 // in: keep the largest part only
  int merged_vertices;               // out: joined with an earlier one in the same place
  int degenerate_tets;               // left out
  int repeated_tets;                 // left out after joining
  int left_out_parts, left_out_tets; // of other parts
} ep_mesh_repairs;
// A repaired copy, materials and point data kept (of joined vertices those of the first). Turned
// tets, unused vertices and repeated tets were seen to on reading.
// Errors: EP_ERR_MESH where no tet is left; EP_ERR_MEMORY.
ep_status ep_mesh_repair(const ep_mesh *mesh, ep_mesh_repairs *repairs, ep_mesh *out,
                         ep_mesh_findings *findings, ep_error *err);

#endif
