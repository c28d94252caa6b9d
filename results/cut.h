// A tet mesh cut open by a plane: what is left of the surface, and the cut faces of the tets
// inside.
#ifndef EP_RESULTS_CUT_H
#define EP_RESULTS_CUT_H

#include "mesh/mesh.h"

// Every vertex of the cut lies on an edge of the mesh (or on a vertex: both ends the same), so any
// field on the mesh's vertices can be carried over by ep_cut_field.
typedef struct ep_cut {
  int nv, nt;
  double *x;     // (nv x 3)
  int *end;      // (nv x 2) vertices of the mesh
  double *share; // (nv) value = (1 - share) value(end 0) + share value(end 1)
  int *triangle; // (nt x 3) outward; the first `outer` ones are of the surface
  int outer;
  unsigned char *hidden; // (nt) edges that are none of the mesh: ep_drawing.hidden_edges
} ep_cut;

// Keep the side the normal points away from: (p - point) . normal <= 0. x (nv x 3) or NULL: rest.
// Errors: EP_ERR_ARGUMENT (normal zero; nothing is left), EP_ERR_MEMORY.
ep_status ep_cut_mesh(const ep_mesh *mesh, const double *x, const double point[3],
                      const double normal[3], ep_cut *out, ep_error *err);
void ep_cut_free(ep_cut *cut);
// field (nv of the mesh x components) -> out (cut->nv x components).
void ep_cut_field(const ep_cut *cut, int components, const double *field, double *out);

#endif
