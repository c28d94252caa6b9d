#include <stdlib.h>

#include "mesh/faces.h"

// Marks faces that belong to one tet only; returns their number.
static int mark_single(const ep_face *face, int count, bool *boundary) {
  int singles = 0;
  for (int i = 0, n; i < count; i += n) {
    n = ep_faces_alike(face, count, i);
    boundary[face[i].id] = n == 1;
    singles += n == 1;
  }
  return singles;
}

ep_status ep_mesh_surface(const ep_mesh *mesh, int *count, int **triangle, ep_error *err) {
  const int faces = 4 * mesh->nt;
  *count = 0;
  *triangle = NULL;
  ep_face *face = ep_mesh_faces(mesh);
  bool *boundary = calloc((size_t)faces, sizeof *boundary);
  int *out = NULL;
  if (face && boundary) {
    *count = mark_single(face, faces, boundary);
    out = malloc(3 * ((size_t)*count + 1) * sizeof *out);
  }
  if (out) {
    int *to = out;
    for (int i = 0; i < faces; i++)
      for (int k = 0; boundary[i] && k < 3; k++)
        *to++ = mesh->tet[i - i % 4 + ep_face_corner[i % 4][k]];
  }
  free(face);
  free(boundary);
  *triangle = out;
  if (out) return EP_OK;
  *count = 0;
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the surface of %s", mesh->name);
}
