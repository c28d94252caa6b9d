#include <stdlib.h>
#include <string.h>

#include "mesh/mesh.h"

typedef struct sorted_face {
  int v[3];
  int id; // 4 tet + face
} sorted_face;

// Outward faces of a tet with positive volume.
static const int face_vertex[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

static int compare_faces(const void *a, const void *b) {
  const sorted_face *s = a, *t = b;
  for (int i = 0; i < 3; i++)
    if (s->v[i] != t->v[i]) return s->v[i] < t->v[i] ? -1 : 1;
  return (s->id > t->id) - (s->id < t->id);
}

static sorted_face make_face(const int *tet, int id) {
  sorted_face f = {.id = id};
  for (int i = 0; i < 3; i++) {
    const int v = tet[face_vertex[id % 4][i]];
    int j = i;
    for (; j > 0 && f.v[j - 1] > v; j--) f.v[j] = f.v[j - 1];
    f.v[j] = v;
  }
  return f;
}

// Marks faces that belong to one tet only; returns their number.
static int mark_single(sorted_face *face, int count, bool *boundary) {
  int singles = 0;
  qsort(face, (size_t)count, sizeof *face, compare_faces);
  for (int i = 0, j; i < count; i = j) {
    for (j = i + 1; j < count && memcmp(face[i].v, face[j].v, sizeof face[i].v) == 0;) j++;
    boundary[face[i].id] = j == i + 1;
    singles += j == i + 1;
  }
  return singles;
}

ep_status ep_mesh_surface(const ep_mesh *mesh, int *count, int **triangle, ep_error *err) {
  const int faces = 4 * mesh->nt;
  *count = 0;
  *triangle = NULL;
  sorted_face *face = malloc((size_t)faces * sizeof *face);
  bool *boundary = calloc((size_t)faces, sizeof *boundary);
  int *out = NULL;
  if (face && boundary) {
    for (int i = 0; i < faces; i++) face[i] = make_face(mesh->tet + i - i % 4, i);
    *count = mark_single(face, faces, boundary);
    out = malloc(3 * ((size_t)*count + 1) * sizeof *out);
  }
  if (out) {
    int *to = out;
    for (int i = 0; i < faces; i++)
      for (int k = 0; boundary[i] && k < 3; k++)
        *to++ = mesh->tet[i - i % 4 + face_vertex[i % 4][k]];
  }
  free(face);
  free(boundary);
  *triangle = out;
  if (out) return EP_OK;
  *count = 0;
  return ep_fail(err, EP_ERR_MEMORY, "no memory for the surface of %s", mesh->name);
}
