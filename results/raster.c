#include "results/raster.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

double ep_linear_from_srgb(double s) {
  return s <= 0.04045 ? s / 12.92 : pow((s + 0.055) / 1.055, 2.4);
}

double ep_srgb_from_linear(double l) {
  return l <= 0.0031308 ? 12.92 * fmax(0, l) : 1.055 * pow(fmin(1, l), 1 / 2.4) - 0.055;
}

ep_status ep_frame_make(int width, int height, ep_frame *out, ep_error *err) {
  const size_t count = (size_t)width * (size_t)height;
  *out = (ep_frame){width, height, calloc(count * 3, sizeof(float)), malloc(count * sizeof(float))};
  if (!out->color || !out->depth) {
    ep_frame_free(out);
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a picture of %d x %d samples", width, height);
  }
  for (size_t i = 0; i < count; i++) out->depth[i] = -FLT_MAX;
  return EP_OK;
}

void ep_frame_free(ep_frame *frame) {
  free(frame->color);
  free(frame->depth);
  memset(frame, 0, sizeof *frame);
}

static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

void ep_camera_project(const ep_camera *camera, const ep_frame *frame, const double *p, double *s) {
  double d[3];
  for (int k = 0; k < 3; k++) d[k] = p[k] - camera->centre[k];
  const double depth = dot(d, camera->back);
  const double near = camera->distance > 0 ? camera->distance / (camera->distance - depth) : 1;
  s[0] = frame->width / 2.0 + camera->offset[0] + camera->scale * near * dot(d, camera->right);
  s[1] = frame->height / 2.0 + camera->offset[1] - camera->scale * near * dot(d, camera->up);
  // monotonic in depth and linear on screen: 1/z for perspective
  s[2] = camera->distance > 0 ? near : depth;
}

// ---- normals ---------------------------------------------------------------------------------
static void face_normal(const ep_drawing *d, int t, double *n) {
  const int *c = d->triangle + 3 * (size_t)t;
  double e[2][3];
  for (int k = 0; k < 3; k++) {
    e[0][k] = d->x[3 * (size_t)c[1] + (size_t)k] - d->x[3 * (size_t)c[0] + (size_t)k];
    e[1][k] = d->x[3 * (size_t)c[2] + (size_t)k] - d->x[3 * (size_t)c[0] + (size_t)k];
  }
  for (int k = 0; k < 3; k++) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    n[k] = e[0][i] * e[1][j] - e[0][j] * e[1][i];
  }
}

static void normalize(double *n) {
  const double length = sqrt(dot(n, n));
  for (int k = 0; k < 3 && length > 0; k++) n[k] /= length;
}

// Faces round each vertex: those of vertex v are face[start[v] .. start[v + 1]).
static void list_faces(const ep_drawing *d, int *start, int *face) {
  for (int i = 0; i < 3 * d->nt; i++) start[d->triangle[i] + 1]++;
  for (int v = 0; v < d->nv; v++) start[v + 1] += start[v];
  for (int i = 3 * d->nt - 1; i >= 0; i--) face[--start[d->triangle[i] + 1]] = i / 3;
  // start[v + 1] is now where v's list begins
  memmove(start, start + 1, (size_t)d->nv * sizeof *start);
  start[d->nv] = 3 * d->nt;
}

ep_status ep_corner_normals(const ep_drawing *d, double *normal, ep_error *err) {
  double *flat = malloc((size_t)d->nt * 3 * sizeof *flat);
  int *start = calloc((size_t)d->nv + 1, sizeof *start);
  int *face = malloc((size_t)d->nt * 3 * sizeof *face);
  if (!flat || !start || !face) {
    free(flat);
    free(start);
    free(face);
    return ep_fail(err, EP_ERR_MEMORY, "no memory to draw %d triangles", d->nt);
  }
  for (int t = 0; t < d->nt; t++) face_normal(d, t, flat + 3 * (size_t)t);
  list_faces(d, start, face);
  const double limit = cos(d->crease * pi / 180);
  for (int i = 0; i < 3 * d->nt; i++) {
    const double *own = flat + 3 * (size_t)(i / 3);
    double *sum = normal + 3 * (size_t)i;
    for (int k = 0; k < 3; k++) sum[k] = own[k];
    const int v = d->triangle[i];
    for (int j = start[v]; j < start[v + 1]; j++) {
      const double *other = flat + 3 * (size_t)face[j];
      if (face[j] == i / 3 || dot(own, other) < limit * sqrt(dot(own, own) * dot(other, other)))
        continue;
      for (int k = 0; k < 3; k++) sum[k] += other[k];
    }
    normalize(sum);
  }
  free(flat);
  free(start);
  free(face);
  return EP_OK;
}

// ---- shading ---------------------------------------------------------------------------------
// A key light over the viewer's left shoulder, a weak fill from the right, light from the sky, and
// a little gloss. n in camera axes (right, up, back), unit, towards the viewer; albedo linear.
static void shade(const double *n, const float *albedo, float *out) {
  static const double key[3] = {-0.4243, 0.6364, 0.6442}, fill[3] = {0.8018, 0.1069, 0.5880};
  static const double half[3] = {-0.2340, 0.3510, 0.9067}; // between key and the viewer
  const double sky = 0.5 + 0.5 * n[1], lit = fmax(0, dot(n, key)), side = fmax(0, dot(n, fill));
  const double light = 0.14 + 0.16 * sky + 0.68 * lit + 0.14 * side;
  const double gloss = 0.10 * pow(fmax(0, dot(n, half)), 32);
  for (int k = 0; k < 3; k++) out[k] = (float)((double)albedo[k] * light + gloss);
}

// What is needed of a triangle while it is scanned.
typedef struct scan {
  double s[3][3];      // corners on screen: x, y, depth
  double normal[3][3]; // corner normals in camera axes
  float color[3][3];   // linear
  double inverse_area; // of the screen triangle, signed
  double near[3];      // perspective weight of each corner
  double height[3];    // of each corner over its opposite edge [samples]
  float edges;
  unsigned hidden;
  double line;
} scan;

// Barycentric coordinates of a sample; false outside.
static bool inside(const scan *t, double x, double y, double *b) {
  for (int c = 0; c < 3; c++) {
    const double *p = t->s[(c + 1) % 3], *q = t->s[(c + 2) % 3];
    b[c] = ((p[0] - x) * (q[1] - y) - (p[1] - y) * (q[0] - x)) * t->inverse_area;
    if (b[c] < 0) return false;
  }
  return true;
}

static void shade_sample(const scan *t, const double *b, float *out) {
  double n[3] = {0, 0, 0}, w[3], sum = 0;
  float albedo[3] = {0, 0, 0};
  for (int c = 0; c < 3; c++) sum += w[c] = b[c] * t->near[c];
  for (int c = 0; c < 3; c++)
    for (int k = 0; k < 3; k++) {
      n[k] += w[c] / sum * t->normal[c][k];
      albedo[k] += (float)(w[c] / sum) * t->color[c][k];
    }
  normalize(n);
  shade(n, albedo, out);
  double nearest = t->line;
  for (int c = 0; c < 3; c++)
    if (!(t->hidden >> c & 1)) nearest = fmin(nearest, b[c] * t->height[c]);
  const double dark = t->line > 0 ? fmin(1, fmax(0, t->line / 2 + 0.5 - nearest)) : 0;
  for (int k = 0; k < 3; k++) out[k] *= (float)(1 - (double)t->edges * dark);
}

static void scan_triangle(ep_frame *frame, const scan *t) {
  double low[2], high[2];
  for (int k = 0; k < 2; k++) {
    low[k] = fmin(t->s[0][k], fmin(t->s[1][k], t->s[2][k]));
    high[k] = fmax(t->s[0][k], fmax(t->s[1][k], t->s[2][k]));
  }
  const int x0 = (int)fmax(0, floor(low[0])), x1 = (int)fmin(frame->width, ceil(high[0]) + 1);
  const int y0 = (int)fmax(0, floor(low[1])), y1 = (int)fmin(frame->height, ceil(high[1]) + 1);
  for (int y = y0; y < y1; y++)
    for (int x = x0; x < x1; x++) {
      double b[3];
      if (!inside(t, x + 0.5, y + 0.5, b)) continue;
      const size_t at = (size_t)y * (size_t)frame->width + (size_t)x;
      const float depth = (float)(b[0] * t->s[0][2] + b[1] * t->s[1][2] + b[2] * t->s[2][2]);
      if (depth <= frame->depth[at]) continue;
      frame->depth[at] = depth;
      shade_sample(t, b, frame->color + 3 * at);
    }
}

static bool set_up(scan *t, const ep_frame *frame, const ep_camera *camera, const ep_drawing *d,
                   int index, const double *normal) {
  for (int c = 0; c < 3; c++) {
    const size_t v = (size_t)d->triangle[3 * (size_t)index + (size_t)c];
    ep_camera_project(camera, frame, d->x + 3 * v, t->s[c]);
    t->near[c] = camera->distance > 0 ? t->s[c][2] : 1;
    const double *n = normal + 3 * (3 * (size_t)index + (size_t)c);
    t->normal[c][0] = dot(n, camera->right);
    t->normal[c][1] = dot(n, camera->up);
    t->normal[c][2] = dot(n, camera->back);
    for (int k = 0; k < 3; k++) {
      const float s = d->color ? d->color[3 * v + (size_t)k] : d->tint[k];
      t->color[c][k] = (float)ep_linear_from_srgb(fmin(1, fmax(0, (double)s)));
    }
  }
  const double area = (t->s[1][0] - t->s[0][0]) * (t->s[2][1] - t->s[0][1]) -
                      (t->s[1][1] - t->s[0][1]) * (t->s[2][0] - t->s[0][0]);
  if (area == 0) return false; // seen edge-on
  t->inverse_area = 1 / area;
  for (int c = 0; c < 3 && area > 0; c++) // a back face (y points down): light its inner side
    for (int k = 0; k < 3; k++) t->normal[c][k] = -t->normal[c][k];
  for (int c = 0; c < 3; c++) {
    const double *p = t->s[(c + 1) % 3], *q = t->s[(c + 2) % 3];
    t->height[c] = fabs(area) / fmax(1e-12, hypot(q[0] - p[0], q[1] - p[1]));
  }
  return true;
}

ep_status ep_frame_draw(ep_frame *frame, const ep_camera *camera, const ep_drawing *drawing,
                        double line, ep_error *err) {
  double *normal = malloc((size_t)drawing->nt * 9 * sizeof *normal);
  if (!normal) return ep_fail(err, EP_ERR_MEMORY, "no memory to draw %d triangles", drawing->nt);
  ep_status status = ep_corner_normals(drawing, normal, err);
  for (int t = 0; t < drawing->nt && status == EP_OK; t++) {
    scan s = {.edges = drawing->edges,
              .hidden = drawing->hidden_edges ? drawing->hidden_edges[t] : 0,
              .line = drawing->edges > 0 ? line : 0};
    if (set_up(&s, frame, camera, drawing, t, normal)) scan_triangle(frame, &s);
  }
  free(normal);
  return status;
}
