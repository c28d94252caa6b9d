// The regions of a scene: parts of the object where examples act.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/scene_reader.h"

static ep_status read_region(const ep_scene_reader *r, const char *key, const char *name,
                             const raw_region *raw, ep_scene_region *out) {
  char part[96];
  EP_TRY(ep_read_text(r, name, &out->name));
  const raw_selection where = {raw->box,   raw->plane, raw->file,
                               raw->field, raw->above, raw->equals};
  EP_TRY(ep_read_selection(r, key, &where, &out->where));
  snprintf(part, sizeof part, "%.63s.soft", key);
  EP_TRY(ep_read_number(r, part, raw->soft, 0, 0, 1e12, &out->soft));
  snprintf(part, sizeof part, "%.63s.strength", key);
  EP_TRY(ep_read_number(r, part, raw->strength, 1, 0, 1e4, &out->strength));
  snprintf(part, sizeof part, "%.63s.eigenfunctions", key);
  if (!raw->eigenfunctions) return EP_OK; // reduction.eigenfunctions, known later
  return ep_read_whole(r, part, raw->eigenfunctions, 0, 1, 200, &out->eigenfunctions);
}

static int find_name(const ep_scene *scene, const char *name) {
  for (int i = 0; i < scene->nregions; i++)
    if (strcmp(scene->region[i].name, name) == 0) return i;
  return -1;
}

ep_status ep_read_regions(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out) {
  const size_t most = (size_t)raw->regions_count + raw->families_count;
  if (!most) return EP_OK;
  out->region = calloc(most, sizeof *out->region);
  if (!out->region) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->regions_count; i++) {
    char key[64];
    snprintf(key, sizeof key, "regions.%u", i);
    const char *name = raw->regions[i].name;
    if (!name) return ep_read_refuse(r, key, "give it a name, by which families refer to it");
    if (strlen(name) > 24 || strpbrk(name, "/ \t\n"))
      return ep_read_refuse(r, key, "name: at most 24 characters, without '/' and blanks");
    if (find_name(out, name) >= 0)
      return ep_read_refuse(r, key, "another region is called '%s' too", name);
    out->nregions++;
    EP_TRY(read_region(r, key, name, &raw->regions[i], &out->region[i]));
  }
  return EP_OK;
}

static bool same_place(const ep_selection *a, const ep_selection *b) {
  if (a->kind != b->kind) return false;
  if (a->path)
    return strcmp(a->path, b->path) == 0 && a->value == b->value && a->equals == b->equals;
  for (int i = 0; i < 3; i++)
    if (a->a[i] != b->a[i] || a->b[i] != b->b[i]) return false;
  return true;
}

static bool same_region(const ep_scene_region *a, const ep_scene_region *b) {
  return same_place(&a->where, &b->where) && a->soft == b->soft && a->strength == b->strength &&
         a->eigenfunctions == b->eigenfunctions;
}

// One given in a family is called after that family; the same text in two families is one region.
ep_status ep_read_family_region(const ep_scene_reader *r, const char *key, const char *family,
                                const raw_region *raw, ep_scene *scene, int *number) {
  const bool place = raw->box || raw->plane || raw->file || raw->field;
  if (raw->name && (place || raw->soft || raw->eigenfunctions || raw->strength))
    return ep_read_refuse(r, key,
                          "give the name of one of `regions`, or a place of its own, not both");
  if (raw->name) {
    *number = find_name(scene, raw->name);
    return *number >= 0 ? EP_OK
                        : ep_read_refuse(r, key, "there is no '%s' among `regions`", raw->name);
  }
  ep_scene_region *next = &scene->region[scene->nregions++];
  EP_TRY(read_region(r, key, family, raw, next));
  for (*number = 0; *number < scene->nregions - 1; ++*number)
    if (same_region(&scene->region[*number], next)) {
      free(next->name);
      free(next->where.path);
      memset(next, 0, sizeof *next);
      scene->nregions--;
      break;
    }
  return EP_OK;
}
