// The faces of all tets, sorted so that shared ones stand side by side (private to mesh/).
#ifndef EP_MESH_FACES_H
#define EP_MESH_FACES_H

#include "mesh/mesh.h"

// Outward corners of the four faces of a tet with positive volume.
extern const int ep_face_corner[4][3];

typedef struct ep_face {
  int v[3];  // ascending
  int id;    // 4 tet + face
  bool even; // the tet sees them as an even permutation, outward
} ep_face;

// The 4 nt faces by vertices, then by tet; malloc'd, NULL without memory.
ep_face *ep_mesh_faces(const ep_mesh *mesh);
// How many faces from face[i] on have its vertices.
int ep_faces_alike(const ep_face *face, int count, int i);

#endif
