#include "app/scene/map_fields.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/point_data.h"

// One array on the two shapes of a map.
typedef struct pair {
  char key[96];
  const ep_mesh *mesh[2];
  const char *name[2];
  const double *value[2];
} pair;

void ep_map_fields_free(ep_regions *regions) {
  free(regions->start);
  free(regions->vertex);
  memset(regions, 0, sizeof *regions);
}

// ---- kinds of arrays ---------------------------------------------------------------------------

static bool all_whole(const ep_mesh *mesh, const double *value) {
  for (int v = 0; v < mesh->nv; v++)
    if (value[v] != floor(value[v])) return false;
  return true;
}

static ep_status check_painted(const pair *p, ep_error *err) {
  for (int s = 0; s < 2; s++) {
    double low, high;
    ep_scalar_range(p->mesh[s], p->value[s], &low, &high);
    if (low < 0 || high > 1)
      return ep_fail(err, EP_ERR_SCENE,
                     "%s: array '%s' of %s goes from %g to %g: neither labels (whole numbers) nor "
                     "painted weights (0 to 1)",
                     p->key, p->name[s], p->mesh[s]->name, low, high);
  }
  return EP_OK;
}

static int compare(const void *a, const void *b) {
  const double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

// The labels of one shape, ascending, without 0; *count > EP_LABELS_MAX where there are more.
static ep_status labels_of(const ep_mesh *mesh, const double *value, double *label, int *count,
                           ep_error *err) {
  double *sorted = malloc((size_t)mesh->nv * sizeof *sorted);
  if (!sorted) return ep_fail(err, EP_ERR_MEMORY, "no memory for the labels of %s", mesh->name);
  memcpy(sorted, value, (size_t)mesh->nv * sizeof *sorted);
  qsort(sorted, (size_t)mesh->nv, sizeof *sorted, compare);
  *count = 0;
  for (int v = 0; v < mesh->nv && *count <= EP_LABELS_MAX; v++) {
    if (sorted[v] == 0 || (*count && label[*count - 1] == sorted[v])) continue;
    if (*count < EP_LABELS_MAX) label[*count] = sorted[v];
    ++*count;
    if (*count > EP_LABELS_MAX) break;
  }
  free(sorted);
  return EP_OK;
}

static ep_status refuse_label(const pair *p, int has, double label, ep_error *err) {
  return ep_fail(err, EP_ERR_SCENE, "%s: label %g is on %s ('%s'), but not on %s ('%s')", p->key,
                 label, p->mesh[has]->name, p->name[has], p->mesh[!has]->name, p->name[!has]);
}

static ep_status common_labels(const pair *p, double *label, int *count, ep_error *err) {
  double other[EP_LABELS_MAX];
  int others;
  EP_TRY(labels_of(p->mesh[0], p->value[0], label, count, err));
  EP_TRY(labels_of(p->mesh[1], p->value[1], other, &others, err));
  if (*count > EP_LABELS_MAX || others > EP_LABELS_MAX)
    return ep_fail(
        err, EP_ERR_SCENE,
        "%s: array '%s' has more than %d different labels; it does not look like regions", p->key,
        p->name[*count > EP_LABELS_MAX ? 0 : 1], EP_LABELS_MAX);
  for (int i = 0; i < *count || i < others; i++) {
    if (i >= *count || (i < others && other[i] < label[i]))
      return refuse_label(p, 1, other[i], err);
    if (i >= others || label[i] < other[i]) return refuse_label(p, 0, label[i], err);
  }
  if (*count) return EP_OK;
  return ep_fail(err, EP_ERR_SCENE, "%s: array '%s' is 0 everywhere: no region", p->key,
                 p->name[0]);
}

// ---- regions -----------------------------------------------------------------------------------

// One more region: the vertices of each shape whose value is `label`, or above 0.5 where painted.
static ep_status add_region(const pair *p, bool painted, double label, ep_regions *out,
                            ep_error *err) {
  const size_t lists = 2 * (size_t)out->count, used = lists ? (size_t)out->start[lists] : 0;
  const size_t most = used + (size_t)p->mesh[0]->nv + (size_t)p->mesh[1]->nv;
  int *start = realloc(out->start, (lists + 3) * sizeof *start);
  if (start) out->start = start;
  int *vertex = realloc(out->vertex, most * sizeof *vertex);
  if (vertex) out->vertex = vertex;
  if (!start || !vertex) return ep_fail(err, EP_ERR_MEMORY, "no memory for regions");
  start[lists] = (int)used;
  for (int s = 0; s < 2; s++) {
    int n = start[lists + (size_t)s];
    for (int v = 0; v < p->mesh[s]->nv; v++)
      if (painted ? p->value[s][v] > 0.5 : p->value[s][v] == label) vertex[n++] = v;
    start[lists + (size_t)s + 1] = n;
    if (n == start[lists + (size_t)s])
      return ep_fail(err, EP_ERR_SCENE, "%s: array '%s' of %s is nowhere above 0.5: no region",
                     p->key, p->name[s], p->mesh[s]->name);
  }
  out->count++;
  return EP_OK;
}

static ep_status add_field(pair *p, ep_regions *out, ep_error *err) {
  double label[EP_LABELS_MAX];
  int count = 0;
  for (int s = 0; s < 2; s++)
    EP_TRY(ep_scalar_of(p->mesh[s], p->key, p->name[s], &p->value[s], err));
  const bool painted = !all_whole(p->mesh[0], p->value[0]) || !all_whole(p->mesh[1], p->value[1]);
  if (painted) {
    EP_TRY(check_painted(p, err));
    return add_region(p, true, 0, out, err);
  }
  EP_TRY(common_labels(p, label, &count, err));
  for (int i = 0; i < count; i++) EP_TRY(add_region(p, false, label[i], out, err));
  return EP_OK;
}

// The name of a field on a shape; *optional where the scene does not name it for poses.
static const char *name_on(const ep_shapes *shapes, int family, const ep_map_field *field,
                           int shape, bool *optional) {
  *optional = false;
  if (shape == 0) return field->object;
  if (shape == shapes->rest[family]) return field->rest;
  *optional = !field->poses;
  return field->poses ? field->poses : shapes->rest[family] ? field->rest : field->object;
}

ep_status ep_map_fields(const ep_scene *scene, const ep_shapes *shapes, int family, int from,
                        int to, ep_regions *out, ep_error *err) {
  const ep_family *f = &scene->family[family];
  const int shape[2] = {from, to};
  ep_status status = EP_OK;
  memset(out, 0, sizeof *out);
  out->shapes = 2;
  for (int i = 0; i < f->fields && status == EP_OK; i++) {
    pair p;
    bool optional = false;
    snprintf(p.key, sizeof p.key, "families.%d.map.fields.%d", family, i);
    for (int s = 0; s < 2; s++) {
      p.mesh[s] = &shapes->shape[shape[s]].mesh;
      p.name[s] = name_on(shapes, family, &f->field[i], shape[s], &optional);
    }
    if (optional && !ep_mesh_data(p.mesh[1], p.name[1])) continue;
    status = add_field(&p, out, err);
  }
  if (status == EP_OK) return EP_OK;
  ep_map_fields_free(out);
  return ep_fail_context(err, "%s", scene->path);
}
