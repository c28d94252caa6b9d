#include "results/shadow.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { CELLS = 224, BLUR_ROUNDS = 3 };
static const double darkness = 0.42, slant[2] = {0.16, -0.10}; // shift per height, along the axes

static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// Axis 0 follows the camera's right, axis 1 points away from the viewer.
static void make_axes(const ep_view *view, const ep_camera *camera, ep_shadow *s) {
  const double length = sqrt(dot(view->up, view->up));
  for (int k = 0; k < 3; k++) s->up[k] = view->up[k] / length;
  // right is normal to up already: right = up x back
  for (int k = 0; k < 3; k++) s->axis[0][k] = camera->right[k];
  for (int k = 0; k < 3; k++) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    s->axis[1][k] = s->up[i] * camera->right[j] - s->up[j] * camera->right[i];
  }
}

// A point's shadow in ground coordinates.
static void cast(const ep_shadow *s, const double *p, double *g) {
  const double height = dot(p, s->up) - s->ground;
  for (int k = 0; k < 2; k++) g[k] = dot(p, s->axis[k]) + slant[k] * height;
}

static void fill(ep_shadow *s, double g[3][2]) {
  double c[3][2], low[2], high[2];
  for (int i = 0; i < 3; i++)
    for (int k = 0; k < 2; k++) c[i][k] = (g[i][k] - s->low[k]) / s->cell;
  for (int k = 0; k < 2; k++) {
    low[k] = fmax(0, floor(fmin(c[0][k], fmin(c[1][k], c[2][k]))));
    high[k] = fmin(s->size, ceil(fmax(c[0][k], fmax(c[1][k], c[2][k]))) + 1);
  }
  const double area =
      (c[1][0] - c[0][0]) * (c[2][1] - c[0][1]) - (c[1][1] - c[0][1]) * (c[2][0] - c[0][0]);
  if (area == 0) return;
  for (int y = (int)low[1]; y < (int)high[1]; y++)
    for (int x = (int)low[0]; x < (int)high[0]; x++) {
      bool in = true;
      for (int i = 0; i < 3 && in; i++) {
        const double *p = c[(i + 1) % 3], *q = c[(i + 2) % 3];
        in =
            ((p[0] - x - 0.5) * (q[1] - y - 0.5) - (p[1] - y - 0.5) * (q[0] - x - 0.5)) / area >= 0;
      }
      if (in) s->dark[(size_t)y * (size_t)s->size + (size_t)x] = 1;
    }
}

// Running mean of 2 radius + 1 cells along one line.
static void blur_line(float *line, float *scratch, int count, size_t stride, int radius) {
  double sum = 0;
  for (int i = 0; i < count; i++) scratch[i] = line[(size_t)i * stride];
  for (int i = -radius; i < count; i++) {
    if (i + radius < count) sum += (double)scratch[i + radius];
    if (i - radius - 1 >= 0) sum -= (double)scratch[i - radius - 1];
    if (i >= 0) line[(size_t)i * stride] = (float)fmax(0, sum / (2 * radius + 1));
  }
}

static void blur(ep_shadow *s, int radius) {
  float scratch[CELLS];
  for (int round = 0; round < BLUR_ROUNDS; round++)
    for (int i = 0; i < s->size; i++) {
      blur_line(s->dark + (size_t)i * (size_t)s->size, scratch, s->size, 1, radius);
    }
  for (int round = 0; round < BLUR_ROUNDS; round++)
    for (int i = 0; i < s->size; i++)
      blur_line(s->dark + i, scratch, s->size, (size_t)s->size, radius);
}

static void visit_triangles(ep_shadow *s, const ep_panel *panel, bool measure, double *high) {
  for (int i = 0; i < panel->drawings; i++) {
    const ep_drawing *d = &panel->drawing[i];
    for (int t = 0; t < d->nt && !d->floor; t++) {
      double g[3][2];
      for (int c = 0; c < 3; c++) cast(s, d->x + 3 * (size_t)d->triangle[3 * t + c], g[c]);
      for (int c = 0; c < 3 && measure; c++)
        for (int k = 0; k < 2; k++) {
          s->low[k] = fmin(s->low[k], g[c][k]);
          high[k] = fmax(high[k], g[c][k]);
        }
      if (!measure) fill(s, g);
    }
  }
}

ep_status ep_shadow_make(const ep_view *view, const ep_camera *camera, const ep_panel *panel,
                         double ground, ep_shadow *out, ep_error *err) {
  *out = (ep_shadow){.ground = ground, .low = {DBL_MAX, DBL_MAX}};
  make_axes(view, camera, out);
  double high[2] = {-DBL_MAX, -DBL_MAX};
  visit_triangles(out, panel, true, high);
  const double wide = fmax(high[0] - out->low[0], high[1] - out->low[1]);
  if (!(wide > 0)) return EP_OK; // a point casts none
  out->dark = calloc((size_t)CELLS * CELLS, sizeof *out->dark);
  if (!out->dark) return ep_fail(err, EP_ERR_MEMORY, "no memory for a shadow");
  out->size = CELLS;
  const int free_cells = CELLS / 7; // on each side, so that the blur fades out inside the grid
  out->cell = wide / (CELLS - 2 * free_cells);
  for (int k = 0; k < 2; k++) out->low[k] = (out->low[k] + high[k]) / 2 - out->cell * CELLS / 2;
  visit_triangles(out, panel, false, high);
  blur(out, free_cells / 5);
  return EP_OK;
}

void ep_shadow_free(ep_shadow *shadow) {
  free(shadow->dark);
  memset(shadow, 0, sizeof *shadow);
}

// Shadows reach beyond the frame: they fade out before its edges instead of being cut off.
static double fade(const ep_frame *frame, double x, double y) {
  static const double band = 0.16; // share of the shorter side
  const double side = fmin(frame->width, frame->height) * band;
  const double inside = fmin(fmin(x, frame->width - x), fmin(y, frame->height - y));
  const double t = fmin(fmax(inside / side, 0), 1);
  return t * t * (3 - 2 * t);
}

// Where the ground is seen at a sample, p (3); false: nowhere.
static bool seen_at(const ep_shadow *s, const ep_camera *camera, const ep_frame *frame, double x,
                    double y, double p[3]) {
  const double a = (x - frame->width / 2.0 - camera->offset[0]) / camera->scale;
  const double b = -(y - frame->height / 2.0 - camera->offset[1]) / camera->scale;
  double origin[3], ray[3];
  for (int k = 0; k < 3; k++) {
    const double across = a * camera->right[k] + b * camera->up[k];
    const double eye = camera->distance * camera->back[k];
    origin[k] = camera->centre[k] + (camera->distance > 0 ? eye : across);
    ray[k] = camera->distance > 0 ? across - eye : -camera->back[k];
  }
  const double slope = dot(ray, s->up);
  if (!(slope < -1e-6 * sqrt(dot(ray, ray)))) return false; // never meets the ground from above
  const double t = (s->ground - dot(origin, s->up)) / slope;
  for (int k = 0; k < 3; k++) p[k] = origin[k] + t * ray[k];
  return t > 0 || camera->distance == 0;
}

// How dark the ground is at a point of it.
static double dark_at(const ep_shadow *s, const double p[3]) {
  double g[2];
  for (int k = 0; k < 2; k++) g[k] = (dot(p, s->axis[k]) - s->low[k]) / s->cell - 0.5;
  if (!(g[0] >= 0 && g[1] >= 0 && g[0] < s->size - 1 && g[1] < s->size - 1)) return 0;
  const int i = (int)g[0], j = (int)g[1];
  const double fx = g[0] - i, fy = g[1] - j;
  const float *d = s->dark + (size_t)j * (size_t)s->size + i;
  const double low = (double)d[0] * (1 - fx) + (double)d[1] * fx;
  const double high = (double)d[s->size] * (1 - fx) + (double)d[s->size + 1] * fx;
  return darkness * (low * (1 - fy) + high * fy);
}

double ep_shadow_at(const ep_shadow *s, const ep_camera *camera, const ep_frame *frame, double x,
                    double y) {
  double p[3];
  if (s->size == 0 || !seen_at(s, camera, frame, x, y, p)) return 0;
  return fade(frame, x, y) * dark_at(s, p);
}

void ep_shadow_fall(const ep_shadow *s, const ep_camera *camera, ep_frame *frame) {
  // a cell's width, in units of depth; sides of a floor are further off but at its edges
  const double near = camera->distance > 0 ? s->cell / camera->distance : s->cell;
  for (int y = 0; y < frame->height && s->size; y++)
    for (int x = 0; x < frame->width; x++) {
      const size_t at = (size_t)y * (size_t)frame->width + (size_t)x;
      double p[3], screen[3];
      if (frame->depth[at] == -FLT_MAX || !seen_at(s, camera, frame, x + 0.5, y + 0.5, p)) continue;
      ep_camera_project(camera, frame, p, screen);
      if (!(fabs(screen[2] - (double)frame->depth[at]) < near)) continue;
      const float light = (float)(1 - dark_at(s, p));
      for (size_t k = 0; k < 3; k++) frame->color[3 * at + k] *= light;
    }
}
