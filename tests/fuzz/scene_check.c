#include "tests/fuzz/scene_target.h"

#include <math.h>
#include <string.h>

#include "app/scene/landmarks.h"
#include "app/scene/scene.h"

// Scenes of the project name their meshes relative to this folder.
static const char folder[] = EP_SOURCE_DIR "/data/scenes";

static void check_selection(const ep_selection *s) {
  must(s->key[0] != '\0', "a selection knows its key");
  must((s->kind == EP_SELECT_FILE || s->kind == EP_SELECT_FIELD) == (s->path != NULL),
       "a file has a path, a field a name");
  must(isfinite(s->value), "finite values");
  for (int k = 0; k < 3; k++) must(isfinite(s->a[k]) && isfinite(s->b[k]), "finite selections");
}

static void check_scene(const ep_scene *s) {
  must(s->name && s->mesh && s->path, "name, mesh and path");
  must(s->modes >= 1 && s->modes <= 200 && ep_scene_examples(s) <= s->modes, "modes");
  must(isfinite(s->dt) && s->dt > 0 && s->steps >= 1, "time");
  must(s->strength >= 0 && s->relief >= 0 && s->relief <= 1, "examples");
  for (int i = 0; i < s->nfixed; i++) check_selection(&s->fixed[i]);
  for (int i = 0; i < s->nloads; i++) {
    for (int k = 0; k < 3; k++) must(isfinite(s->load[i].vector[k]), "finite loads");
    if (!s->load[i].gravity) check_selection(&s->load[i].where);
  }
  for (int i = 0; i < s->nfamilies; i++) {
    must(s->family[i].poses >= 1 && s->family[i].eigenfunctions >= 1, "families");
    must(s->family[i].region >= -1 && s->family[i].region < s->nregions, "regions of families");
  }
  for (int i = 0; i < s->nregions; i++) check_selection(&s->region[i].where);
  must(s->sweep.nmodes >= 1 && s->sweep.ndt >= 1 && s->sweep.nsolvers >= 1, "sweeps");
}

static void check_marks(const ep_landmark *l, int count, int nv) {
  must(count >= 0 && count <= EP_LANDMARKS_MAX, "number of landmarks");
  for (int i = 0; i < count; i++) {
    must(l[i].from_vertex >= -1 && l[i].from_vertex < nv, "from in range");
    must(l[i].to_vertex >= -1 && l[i].to_vertex < nv, "to in range");
    for (int k = 0; k < 3; k++) must(isfinite(l[i].from[k]) && isfinite(l[i].to[k]), "points");
  }
}

// The landmarks of one family on a mesh of 8 vertices that stands for all its shapes.
static void resolve(const ep_scene *scene, int family, ep_mesh mesh) {
  const int poses = scene->family[family].poses, own_rest = scene->family[family].rest != NULL;
  ep_shape_file shape[66];
  ep_pose_source example[64];
  int rest[64] = {0};
  ep_landmark out[EP_LANDMARKS_MAX];
  if (poses > 64) return;
  for (int i = 0; i < 2 + poses; i++) shape[i] = (ep_shape_file){.mesh = mesh};
  rest[family] = own_rest;
  for (int i = 0; i < poses; i++)
    example[i] =
        (ep_pose_source){.family = family, .index = i, .shape = i + 1 + own_rest, .rest = own_rest};
  const ep_shapes shapes = {.count = 1 + own_rest + poses,
                            .shape = shape,
                            .rest = rest,
                            .examples = poses,
                            .example = example};
  for (int to = 1; to < shapes.count; to++) {
    ep_error err = {0};
    int count = 0;
    const int from = to == 1 ? 0 : own_rest;
    const ep_status status =
        ep_landmarks_of_map(scene, &shapes, family, from, to, out, &count, &err);
    if (status == EP_OK) check_marks(out, count, mesh.nv);
    must(status == EP_OK || err.text[0], "an error has a text");
  }
}

static void resolve_all(const ep_scene *scene) {
  double x[24];
  int tet[4] = {0, 1, 2, 4}, file_vertex[8];
  for (int i = 0; i < 8; i++) {
    for (int k = 0; k < 3; k++) x[3 * i + k] = (i >> k) & 1;
    file_vertex[i] = 2 * i; // every other vertex of the file is unused
  }
  const ep_mesh mesh = {.nv = 8,
                        .nt = 1,
                        .x = x,
                        .tet = tet,
                        .file_vertex = file_vertex,
                        .file_vertices = 16,
                        .name = "box"};
  for (int i = 0; i < scene->nfamilies && i < 64; i++) resolve(scene, i, mesh);
}

// "#set key=value" lines at the start, each ended in place.
static int take_sets(char *text, const char *sets[4]) {
  int count = 0;
  while (count < 4 && strncmp(text, "#set ", 5) == 0) {
    char *end = strchr(text, '\n');
    if (!end) break;
    *end = '\0';
    sets[count++] = text + 5;
    text = end + 1;
  }
  return count;
}

bool scene_holds(const char *text, size_t size) {
  char *copy = malloc(size + 1), *exact = malloc(size ? size : 1);
  const char *sets[4];
  must(copy && exact, "memory");
  memcpy(copy, text, size);
  copy[size] = '\0';
  memcpy(exact, text, size);
  ep_scene scene;
  ep_error err = {0};
  const int nsets = take_sets(copy, sets);
  const ep_status status =
      ep_scene_parse("input.yaml", folder, exact, size, nsets, sets, &scene, &err);
  must(status == EP_OK || (err.status == status && err.text[0]), "an error has a text");
  if (status == EP_OK) {
    check_scene(&scene);
    resolve_all(&scene);
    ep_scene_free(&scene);
  }
  free(copy);
  free(exact);
  return status == EP_OK;
}
