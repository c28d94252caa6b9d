#include "app/scene/landmarks.h"

#include <stdio.h>
#include <string.h>

// The place on a shape and its key; NULL where the landmark does not name one.
static const ep_mark *mark_on(const ep_shapes *shapes, int family, const ep_scene_landmark *l,
                              int shape, char *key, size_t size) {
  const ep_mark *found = NULL;
  if (shape == 0) {
    snprintf(key, size, "object");
    found = &l->object;
  } else if (shape == shapes->rest[family]) {
    snprintf(key, size, "rest");
    found = &l->rest;
  }
  for (int i = 0; i < shapes->examples && !found; i++) {
    const ep_pose_source *example = &shapes->example[i];
    if (example->family != family || example->shape != shape || example->index >= l->poses)
      continue;
    snprintf(key, size, "poses.%d", example->index);
    found = &l->pose[example->index];
  }
  return found && found->given ? found : NULL;
}

static ep_status resolve(const ep_scene *scene, const char *key, const ep_mesh *mesh,
                         const ep_mark *mark, int *vertex, double at[3], ep_error *err) {
  *vertex = -1;
  memcpy(at, mark->at, sizeof mark->at);
  if (!mark->vertex) return EP_OK;
  if (mark->vertex <= mesh->file_vertices)
    *vertex = ep_mesh_from_file_vertex(mesh, mark->vertex - 1);
  if (*vertex >= 0) return EP_OK;
  return ep_fail(err, EP_ERR_SCENE, "%s: %s: %s has no tet at vertex %d; its vertices are 1 to %d",
                 scene->path, key, mesh->name, mark->vertex, mesh->file_vertices);
}

ep_status ep_landmarks_of_map(const ep_scene *scene, const ep_shapes *shapes, int family, int from,
                              int to, ep_landmark *out, int *count, ep_error *err) {
  const ep_family *f = &scene->family[family];
  *count = 0;
  for (int i = 0; i < f->landmarks && *count < EP_LANDMARKS_MAX; i++) {
    char part[2][32], key[112];
    const ep_mark *here = mark_on(shapes, family, &f->landmark[i], from, part[0], sizeof part[0]);
    const ep_mark *there = mark_on(shapes, family, &f->landmark[i], to, part[1], sizeof part[1]);
    if (!here || !there) continue;
    ep_landmark *l = &out[(*count)++];
    snprintf(key, sizeof key, "families.%d.map.landmarks.%d.%s", family, i, part[0]);
    EP_TRY(resolve(scene, key, &shapes->shape[from].mesh, here, &l->from_vertex, l->from, err));
    snprintf(key, sizeof key, "families.%d.map.landmarks.%d.%s", family, i, part[1]);
    EP_TRY(resolve(scene, key, &shapes->shape[to].mesh, there, &l->to_vertex, l->to, err));
  }
  return EP_OK;
}
