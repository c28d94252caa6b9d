#include "results/gallery.h"

#include <math.h>
#include <stdlib.h>

static ep_status no_memory(ep_error *err, int panels) {
  return ep_fail(err, EP_ERR_MEMORY, "no memory for a picture of %d panels", panels);
}

// A dot is an octahedron.
enum { CORNERS = 6, FACES = 8 };

// Panels and the surfaces they own: each a mesh, and its dots.
typedef struct sheet {
  int count, **triangle;
  ep_drawing *drawing; // (2 count)
  ep_panel *panel;
  struct dots {
    double *x;
    int *triangle;
    float *color;
  } * dots;
} sheet;

static void free_sheet(sheet *s) {
  for (int i = 0; i < s->count && s->triangle; i++) free(s->triangle[i]);
  for (int i = 0; i < s->count && s->dots; i++) {
    free(s->dots[i].x);
    free(s->dots[i].triangle);
    free(s->dots[i].color);
  }
  free(s->dots);
  free(s->triangle);
  free(s->drawing);
  free(s->panel);
}

static ep_status make_sheet(int count, sheet *s, ep_error *err) {
  const size_t n = count > 0 ? (size_t)count : 1;
  *s = (sheet){count, calloc(n, sizeof *s->triangle), calloc(2 * n, sizeof *s->drawing),
               calloc(n, sizeof *s->panel), calloc(n, sizeof *s->dots)};
  if (s->triangle && s->drawing && s->panel && s->dots) return EP_OK;
  free_sheet(s);
  return no_memory(err, count);
}

// Bright, and well apart for neighbours in number: hues by the golden section.
static void dot_color(int number, float rgb[3]) {
  const double hue = 6 * fmod(0.08 + 0.618034 * number, 1);
  for (int c = 0; c < 3; c++) {
    const double away = fabs(fmod(hue + 6 - 2 * c, 6) - 3); // 3 at the colour's own hue
    rgb[c] = (float)fmin(1, fmax(0.05, 3 - away < 1 ? 1 : 2 - (3 - away)));
  }
}

static double size_of(int n, const double *x) {
  double low[3], high[3], sum = 0;
  for (int c = 0; c < 3; c++) low[c] = high[c] = x[c];
  for (int i = 0; i < 3 * n; i++) {
    low[i % 3] = fmin(low[i % 3], x[i]);
    high[i % 3] = fmax(high[i % 3], x[i]);
  }
  for (int c = 0; c < 3; c++) sum += (high[c] - low[c]) * (high[c] - low[c]);
  return sqrt(sum);
}

static ep_status make_dots(const ep_gallery_item *item, const double *x, struct dots *d,
                           ep_drawing *out, ep_error *err) {
  static const double SHARE = 0.016; // radius over the mesh's diagonal
  static const int face[FACES][3] = {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4},
                                     {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}};
  const size_t count = (size_t)item->dots;
  const double radius = SHARE * size_of(item->mesh->nv, x);
  d->x = malloc(count * CORNERS * 3 * sizeof *d->x);
  d->triangle = malloc(count * FACES * 3 * sizeof *d->triangle);
  d->color = malloc(count * CORNERS * 3 * sizeof *d->color);
  if (!d->x || !d->triangle || !d->color) return no_memory(err, item->dots);
  for (int i = 0; i < item->dots; i++) {
    for (int k = 0; k < CORNERS; k++) { // +x -x +y -y +z -z
      double *at = d->x + 3 * (CORNERS * (size_t)i + (size_t)k);
      for (int c = 0; c < 3; c++) at[c] = item->dot[3 * i + c];
      at[k / 2] += k % 2 ? -radius : radius;
      dot_color(i, d->color + 3 * (CORNERS * (size_t)i + (size_t)k));
    }
    for (int f = 0; f < FACES; f++)
      for (int c = 0; c < 3; c++) d->triangle[3 * (FACES * i + f) + c] = CORNERS * i + face[f][c];
  }
  *out = ep_default_drawing(CORNERS * item->dots, d->x, FACES * item->dots, d->triangle);
  out->color = d->color;
  out->edges = 0.7f;
  return EP_OK;
}

ep_status ep_gallery_poses(const char *path, const ep_view *view, int items,
                           const ep_gallery_item *item, float edges, ep_error *err) {
  sheet s;
  EP_TRY(make_sheet(items, &s, err));
  ep_status status = EP_OK;
  for (int i = 0; i < items && status == EP_OK; i++) {
    int count;
    status = ep_mesh_surface(item[i].mesh, &count, &s.triangle[i], err);
    if (status != EP_OK) break;
    const double *x = item[i].x ? item[i].x : item[i].mesh->x;
    ep_drawing *d = &s.drawing[2 * i];
    *d = ep_default_drawing(item[i].mesh->nv, x, count, s.triangle[i]);
    d->color = item[i].color;
    d->edges = edges;
    s.panel[i] = (ep_panel){item[i].dots > 0 ? 2 : 1, d, item[i].label};
    if (item[i].dots > 0) status = make_dots(&item[i], x, &s.dots[i], d + 1, err);
  }
  if (status == EP_OK) status = ep_picture_write(path, view, items, s.panel, err);
  free_sheet(&s);
  return status;
}
