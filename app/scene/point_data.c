#include "app/scene/point_data.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// "a, b (3 components)"; cut off with dots where it gets too long.
static void list_arrays(const ep_mesh *mesh, char *text, size_t size) {
  size_t used = 0;
  text[0] = '\0';
  for (int i = 0; i < mesh->ndata; i++) {
    const ep_point_data *data = &mesh->data[i];
    char components[40] = "";
    if (used + 80 > size) {
      snprintf(text + used, size - used, ", ..");
      return;
    }
    if (data->components != 1)
      snprintf(components, sizeof components, " (%d components)", data->components);
    used += (size_t)snprintf(text + used, size - used, "%s%.32s%s", used ? ", " : "", data->name,
                             components);
  }
}

ep_status ep_scalar_of(const ep_mesh *mesh, const char *key, const char *name, const double **value,
                       ep_error *err) {
  const ep_point_data *data = ep_mesh_data(mesh, name);
  char list[400];
  list_arrays(mesh, list, sizeof list);
  if (!data && mesh->ndata)
    return ep_fail(err, EP_ERR_SCENE, "%s: %s has no array '%s' on its vertices; it has: %s", key,
                   mesh->name, name, list);
  if (!data)
    return ep_fail(err, EP_ERR_SCENE,
                   "%s: %s has no arrays on its vertices, so no '%s'; save it as .vtk or .vtu with "
                   "point data",
                   key, mesh->name, name);
  if (!data->value)
    return ep_fail(err, EP_ERR_SCENE, "%s: array '%s' of %s has %d components; a scalar is needed",
                   key, name, mesh->name, data->components);
  for (int v = 0; v < mesh->nv; v++)
    if (!isfinite(data->value[v]))
      return ep_fail(err, EP_ERR_SCENE,
                     "%s: array '%s' of %s is not a finite number at vertex %d (from 1)", key, name,
                     mesh->name, mesh->file_vertex[v] + 1);
  *value = data->value;
  return EP_OK;
}

void ep_scalar_range(const ep_mesh *mesh, const double *value, double *low, double *high) {
  *low = *high = value[0];
  for (int v = 1; v < mesh->nv; v++) {
    *low = fmin(*low, value[v]);
    *high = fmax(*high, value[v]);
  }
}
