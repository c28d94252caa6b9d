// The examples of a scene: families, their maps and landmarks.
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/scene_reader.h"

// A place of a landmark on one shape: a vertex, a point, or nothing.
static ep_status mark(const ep_scene_reader *r, const char *key, const double *vertex,
                      const double *point, ep_mark *out) {
  if (vertex && point) return ep_read_refuse(r, key, "give a vertex or a point, not both");
  out->given = vertex || point;
  if (point) return ep_read_vector(r, key, point, out->at);
  return vertex ? ep_read_whole(r, key, vertex, 0, 1, 2147483647, &out->vertex) : EP_OK;
}

static ep_status read_landmark(const ep_scene_reader *r, const char *key, const raw_landmark *raw,
                               const ep_family *family, ep_scene_landmark *out) {
  char part[112];
  EP_TRY(mark(r, key, raw->object, raw->object_at, &out->object));
  EP_TRY(mark(r, key, raw->rest, raw->rest_at, &out->rest));
  if (out->rest.given && !family->rest)
    return ep_read_refuse(r, key, "the family has no rest shape of its own; give object and poses");
  if (raw->poses_count && raw->poses_at_count)
    return ep_read_refuse(r, key, "give poses (vertices) or poses_at (points), not both");
  const unsigned poses = raw->poses_count + raw->poses_at_count;
  if (out->object.given + out->rest.given + (poses > 0) < 2)
    return ep_read_refuse(r, key,
                          "name the place on two shapes: object, rest, poses (vertices), or "
                          "object_at, rest_at, poses_at (points)");
  if (poses && (int)poses != family->poses)
    return ep_read_refuse(r, key,
                          "%s lists %u places, but the family has %d poses; give one for each",
                          raw->poses_count ? "poses" : "poses_at", poses, family->poses);
  out->pose = calloc(poses + 1, sizeof *out->pose);
  if (!out->pose) return ep_read_no_memory(r);
  out->poses = (int)poses;
  for (unsigned i = 0; i < poses; i++) {
    snprintf(part, sizeof part, "%.90s.poses%s.%u", key, raw->poses_count ? "" : "_at", i);
    EP_TRY(mark(r, part, raw->poses_count ? &raw->poses[i] : NULL,
                raw->poses_count ? NULL : raw->poses_at[i], &out->pose[i]));
  }
  return EP_OK;
}

static ep_status read_field(const ep_scene_reader *r, const char *key, const raw_map_field *raw,
                            ep_map_field *out) {
  const char *object = raw->object ? raw->object : raw->name;
  const char *rest = raw->rest ? raw->rest : object;
  if (!object)
    return ep_read_refuse(r, key, "give a name for all shapes, or object (and rest, poses)");
  EP_TRY(ep_read_text(r, object, &out->object));
  EP_TRY(ep_read_text(r, rest, &out->rest));
  return raw->poses ? ep_read_text(r, raw->poses, &out->poses) : EP_OK;
}

static ep_status read_fields(const ep_scene_reader *r, unsigned index, const raw_map *raw,
                             ep_family *out) {
  char key[64];
  snprintf(key, sizeof key, "families.%u.map.fields", index);
  if (raw->fields_count && raw->regions)
    return ep_read_refuse(r, key, "give regions or fields, not both");
  out->field = calloc(raw->fields_count + 1, sizeof *out->field);
  if (!out->field) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->fields_count; i++) {
    snprintf(key, sizeof key, "families.%u.map.fields.%u", index, i);
    out->fields++;
    EP_TRY(read_field(r, key, &raw->fields[i], &out->field[i]));
  }
  return EP_OK;
}

static ep_status read_map(const ep_scene_reader *r, unsigned index, const raw_map *raw,
                          ep_family *out) {
  char key[64];
  out->accept = raw->accept && *raw->accept;
  out->reflections = raw->reflections && *raw->reflections;
  if (raw->frame) out->frame = (ep_map_frame)*raw->frame;
  snprintf(key, sizeof key, "families.%u.map.eigenfunctions", index);
  if (raw->eigenfunctions)
    EP_TRY(ep_read_whole(r, key, raw->eigenfunctions, 0, 1, 200, &out->eigenfunctions));
  out->landmark = calloc(raw->landmarks_count + 1, sizeof *out->landmark);
  if (!out->landmark) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->landmarks_count; i++) {
    snprintf(key, sizeof key, "families.%u.map.landmarks.%u", index, i);
    out->landmarks++;
    EP_TRY(read_landmark(r, key, &raw->landmarks[i], out, &out->landmark[i]));
  }
  EP_TRY(read_fields(r, index, raw, out));
  snprintf(key, sizeof key, "families.%u.map.regions", index);
  return raw->regions ? ep_read_file(r, key, raw->regions, &out->regions) : EP_OK;
}

static ep_status read_family(const ep_scene_reader *r, unsigned index, const raw_family *raw,
                             ep_scene *scene, ep_family *out) {
  char key[64], fallback[32];
  out->region = -1;
  snprintf(fallback, sizeof fallback, "family%u", index);
  EP_TRY(ep_read_text(r, raw->name ? raw->name : fallback, &out->name));
  snprintf(key, sizeof key, "families.%u.name", index);
  if (strlen(out->name) > 24 || strpbrk(out->name, "/ \t\n"))
    return ep_read_refuse(r, key, "use at most 24 characters, without '/' and blanks");
  snprintf(key, sizeof key, "families.%u.rest", index);
  if (raw->rest) EP_TRY(ep_read_file(r, key, raw->rest, &out->rest));
  out->pose = calloc(raw->poses_count, sizeof *out->pose);
  if (!out->pose) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->poses_count; i++) {
    snprintf(key, sizeof key, "families.%u.poses.%u", index, i);
    out->poses++;
    EP_TRY(ep_read_file(r, key, raw->poses[i], &out->pose[i]));
  }
  if (raw->region) {
    snprintf(key, sizeof key, "families.%u.region", index);
    EP_TRY(ep_read_family_region(r, key, out->name, raw->region, scene, &out->region));
  }
  return raw->map ? read_map(r, index, raw->map, out) : EP_OK;
}

ep_status ep_read_families(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out) {
  if (!raw->families_count) return EP_OK;
  out->family = calloc(raw->families_count, sizeof *out->family);
  if (!out->family) return ep_read_no_memory(r);
  for (unsigned i = 0; i < raw->families_count; i++) {
    out->nfamilies++;
    EP_TRY(read_family(r, i, &raw->families[i], out, &out->family[i]));
    for (unsigned j = 0; j < i; j++)
      if (strcmp(out->family[i].name, out->family[j].name) == 0) {
        char key[64];
        snprintf(key, sizeof key, "families.%u.name", i);
        return ep_read_refuse(r, key, "another family is called '%s' too", out->family[i].name);
      }
  }
  return EP_OK;
}
