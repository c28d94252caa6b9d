#include "mesh/faces.h"

#include <stdlib.h>
#include <string.h>

const int ep_face_corner[4][3] = {{1, 2, 3}, {0, 3, 2}, {0, 1, 3}, {0, 2, 1}};

static ep_face make_face(const int *tet, int id) {
  ep_face f = {.id = id, .even = true};
  for (int i = 0; i < 3; i++) {
    const int v = tet[ep_face_corner[id % 4][i]];
    int j = i;
    for (; j > 0 && f.v[j - 1] > v; j--) {
      f.v[j] = f.v[j - 1];
      f.even = !f.even;
    }
    f.v[j] = v;
  }
  return f;
}

static int compare_faces(const void *a, const void *b) {
  const ep_face *s = a, *t = b;
  for (int i = 0; i < 3; i++)
    if (s->v[i] != t->v[i]) return s->v[i] < t->v[i] ? -1 : 1;
  return (s->id > t->id) - (s->id < t->id);
}

ep_face *ep_mesh_faces(const ep_mesh *mesh) {
  const int count = 4 * mesh->nt;
  ep_face *face = malloc((size_t)count * sizeof *face);
  if (!face) return NULL;
  for (int i = 0; i < count; i++) face[i] = make_face(mesh->tet + i - i % 4, i);
  qsort(face, (size_t)count, sizeof *face, compare_faces);
  return face;
}

int ep_faces_alike(const ep_face *face, int count, int i) {
  int n = 1;
  while (i + n < count && memcmp(face[i].v, face[i + n].v, sizeof face->v) == 0) n++;
  return n;
}
