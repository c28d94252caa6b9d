#include "app/run/pressures.h"

#include <stdlib.h>
#include <string.h>

#include "app/run/loads.h"
#include "app/scene/select.h"

static void cross(const double a[3], const double b[3], double out[3]) {
  for (int i = 0; i < 3; i++)
    out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

static void edges(const double *x, const int *v, double e[2][3]) {
  for (int k = 0; k < 2; k++)
    for (int i = 0; i < 3; i++)
      e[k][i] = x[3 * (size_t)v[k + 1] + (size_t)i] - x[3 * (size_t)v[0] + (size_t)i];
}

// One triangle's part of f0 and B, for p = 1.
static void add_triangle(const ep_model *model, const int *v, double *sums, double *f0, double *b) {
  const size_t r = (size_t)model->size.r, n3 = 3 * (size_t)model->size.n;
  double e[2][3], n[3];
  edges(model->rest_x, v, e);
  cross(e[0], e[1], n);
  for (size_t a = 0; a < r; a++) {
    const double *u = model->u + a * n3;
    for (size_t i = 0; i < 3; i++) {
      sums[3 * a + i] = 0;
      for (int k = 0; k < 3; k++) sums[3 * a + i] -= u[3 * (size_t)v[k] + i] / 6;
      f0[a] += sums[3 * a + i] * n[i];
    }
  }
  for (size_t c = 0; c < r; c++) {
    double d[2][3], first[3], second[3];
    edges(model->u + c * n3, v, d);
    cross(d[0], e[1], first);
    cross(e[0], d[1], second);
    for (size_t a = 0; a < r; a++)
      for (size_t i = 0; i < 3; i++) b[a * r + c] += sums[3 * a + i] * (first[i] + second[i]);
  }
}

static ep_status make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                      int triangles, const int *triangle, ep_pressures *out, ep_error *err) {
  const ep_mesh *mesh = &shapes->shape[0].mesh;
  const size_t r = (size_t)model->size.r;
  unsigned char *chosen = malloc((size_t)mesh->nv);
  double *sums = malloc(3 * r * sizeof *sums);
  ep_status status =
      chosen && sums ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for the pressure");
  for (int i = 0; i < scene->npressures && status == EP_OK; i++) {
    const ep_scene_pressure *p = &scene->pressure[i];
    int count;
    memset(chosen, !p->selected, (size_t)mesh->nv);
    if (p->selected) status = ep_select_vertices(&p->where, mesh, chosen, &count, err);
    for (int t = 0; t < triangles && status == EP_OK; t++) {
      const int *v = triangle + 3 * (size_t)t;
      if (chosen[v[0]] && chosen[v[1]] && chosen[v[2]])
        add_triangle(model, v, sums, out->f0 + (size_t)i * r, out->b + (size_t)i * r * r);
    }
    out->count++;
  }
  free(chosen);
  free(sums);
  return status;
}

ep_status ep_pressures_make(const ep_scene *scene, const ep_shapes *shapes, const ep_model *model,
                            ep_pressures *out, ep_error *err) {
  const size_t r = (size_t)model->size.r, count = (size_t)scene->npressures;
  int triangles, *triangle;
  *out = (ep_pressures){.r = model->size.r};
  if (!count) return EP_OK;
  for (size_t i = 0; i < count; i++)
    if (model->size.rigid && scene->pressure[i].selected)
      return ep_fail(err, EP_ERR_UNSUPPORTED,
                     "%s: pressure on a part of a free object is not known to this version; leave "
                     "box, plane and file out for its whole surface, or use push",
                     scene->path);
  EP_TRY(ep_mesh_surface(&shapes->shape[0].mesh, &triangles, &triangle, err));
  out->f0 = calloc(count * r, sizeof *out->f0);
  out->b = calloc(count * r * r, sizeof *out->b);
  const ep_status status = out->f0 && out->b
                               ? make(scene, shapes, model, triangles, triangle, out, err)
                               : ep_fail(err, EP_ERR_MEMORY, "no memory for the pressure");
  free(triangle);
  if (status != EP_OK) ep_pressures_free(out);
  return status;
}

void ep_pressures_free(ep_pressures *pressures) {
  free(pressures->f0);
  free(pressures->b);
  *pressures = (ep_pressures){.count = 0};
}

void ep_pressures_add(const ep_scene *scene, const ep_pressures *p, double t, const double *q,
                      double *force) {
  const size_t r = (size_t)p->r;
  for (int i = 0; i < p->count; i++) {
    const ep_scene_pressure *given = &scene->pressure[i];
    const ep_load profile = {.from = given->from, .until = given->until, .ramp = given->ramp};
    const double pascal = given->pascal * ep_load_profile(&profile, t);
    const double *f0 = p->f0 + (size_t)i * r, *b = p->b + (size_t)i * r * r;
    for (size_t a = 0; pascal != 0 && a < r; a++) {
      double sum = f0[a];
      for (size_t c = 0; c < r; c++) sum += b[a * r + c] * q[c];
      force[a] += pascal * sum;
    }
  }
}
