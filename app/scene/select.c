#include "app/scene/select.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/point_data.h"
#include "base/files.h"

// The marks of an array on the vertices.
static ep_status by_field(const ep_selection *s, const ep_mesh *mesh, unsigned char *chosen,
                          int *count, ep_error *err) {
  const double *value;
  EP_TRY(ep_scalar_of(mesh, s->key, s->path, &value, err));
  for (int v = 0; v < mesh->nv; v++) {
    if (s->equals ? value[v] != s->value : !(value[v] > s->value)) continue;
    chosen[v] = 1;
    (*count)++;
  }
  if (*count) return EP_OK;
  double low, high;
  ep_scalar_range(mesh, value, &low, &high);
  return ep_fail(err, EP_ERR_SCENE, "%s: no vertex of %s has '%s' %s %g; its values are %g to %g",
                 s->key, mesh->name, s->path, s->equals ? "equal to" : "above", s->value, low,
                 high);
}

static bool inside(const ep_selection *s, const double *x) {
  if (s->kind == EP_SELECT_BOX) {
    for (int i = 0; i < 3; i++)
      if (x[i] < s->a[i] || x[i] > s->b[i]) return false;
    return true;
  }
  double side = 0;
  for (int i = 0; i < 3; i++) side += (x[i] - s->a[i]) * s->b[i];
  return side <= 0;
}

double ep_select_distance(const ep_selection *s, const double *x) {
  if (inside(s, x)) return 0;
  double square = 0, side = 0, normal = 0;
  for (int i = 0; i < 3; i++) {
    const double out = fmax(0, fmax(s->a[i] - x[i], x[i] - s->b[i]));
    square += out * out;
    side += (x[i] - s->a[i]) * s->b[i];
    normal += s->b[i] * s->b[i];
  }
  return s->kind == EP_SELECT_BOX ? sqrt(square) : side / sqrt(normal);
}

// One number of a list at *text; moves on past it.
static ep_status take_number(const char *name, int line, char **text, const ep_mesh *mesh,
                             unsigned char *chosen, int *count, ep_error *err) {
  char *end;
  const long number = strtol(*text, &end, 10);
  const size_t word = strcspn(*text, ", \t\r\n;#");
  const int shown = word < 24 ? (int)word : 24;
  if (end == *text || (*end && !strchr(", \t\r\n;#", *end)))
    return ep_fail(err, EP_ERR_FORMAT, "%s:%d: '%.*s' is no vertex number", name, line, shown,
                   *text);
  if (number < 1 || number > mesh->file_vertices)
    return ep_fail(err, EP_ERR_FORMAT, "%s:%d: vertex %ld does not exist; %s has 1 to %d", name,
                   line, number, mesh->name, mesh->file_vertices);
  *text = end;
  const int vertex = ep_mesh_from_file_vertex(mesh, (int)number - 1);
  if (vertex < 0) return EP_OK; // in the file, but no tet uses it
  *count += !chosen[vertex];
  chosen[vertex] = 1;
  return EP_OK;
}

ep_status ep_select_parse(const char *name, const char *text, const ep_mesh *mesh,
                          unsigned char *chosen, int *count, ep_error *err) {
  unsigned char *own = calloc((size_t)mesh->nv + 1, 1);
  if (!own) return ep_fail(err, EP_ERR_MEMORY, "no memory for the vertices of %s", name);
  ep_status status = EP_OK;
  int line = 1;
  char *p = (char *)text;
  *count = 0;
  while (*p && status == EP_OK) {
    if (*p == '#') {
      p += strcspn(p, "\n");
    } else if (strchr(", \t\r\n;", *p)) {
      line += *p++ == '\n';
    } else {
      status = take_number(name, line, &p, mesh, own, count, err);
    }
  }
  if (status == EP_OK)
    for (int v = 0; v < mesh->nv; v++) chosen[v] |= own[v];
  free(own);
  return status;
}

ep_status ep_select_vertices(const ep_selection *selection, const ep_mesh *mesh,
                             unsigned char *chosen, int *count, ep_error *err) {
  *count = 0;
  if (selection->kind == EP_SELECT_FIELD) return by_field(selection, mesh, chosen, count, err);
  if (selection->kind == EP_SELECT_FILE) {
    char *text;
    size_t size;
    EP_TRY(ep_file_read(selection->path, &text, &size, err));
    const ep_status status = ep_select_parse(selection->path, text, mesh, chosen, count, err);
    free(text);
    if (status != EP_OK) return status;
  } else {
    for (int v = 0; v < mesh->nv; v++) {
      if (!inside(selection, mesh->x + 3 * (size_t)v)) continue;
      chosen[v] = 1;
      (*count)++;
    }
  }
  if (*count) return EP_OK;
  double low[3], high[3];
  ep_mesh_bounds(mesh, low, high);
  return ep_fail(err, EP_ERR_SCENE,
                 "%s: no vertex of %s lies there; the mesh fills %g..%g, %g..%g, %g..%g",
                 selection->key, mesh->name, low[0], high[0], low[1], high[1], low[2], high[2]);
}

ep_status ep_select_fixed(const ep_scene *scene, const ep_mesh *mesh, int *count, int **vertex,
                          ep_error *err) {
  *count = 0;
  *vertex = NULL;
  if (!scene->nfixed) return EP_OK;
  unsigned char *chosen = calloc((size_t)mesh->nv, 1);
  int *list = malloc((size_t)mesh->nv * sizeof *list), held = 0, n = 0;
  ep_status status = chosen && list ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for fixed");
  for (int i = 0; i < scene->nfixed && status == EP_OK; i++)
    status = ep_select_vertices(&scene->fixed[i], mesh, chosen, &held, err);
  for (int v = 0; v < mesh->nv && status == EP_OK; v++)
    if (chosen[v]) list[n++] = v;
  if (status == EP_OK && n == mesh->nv)
    status = ep_fail(err, EP_ERR_SCENE, "fixed: every vertex of %s is held; nothing could move",
                     mesh->name);
  free(chosen);
  if (status != EP_OK) {
    free(list);
    return status;
  }
  *count = n;
  *vertex = list;
  return EP_OK;
}
