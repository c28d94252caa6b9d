#include "results/picture.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "results/raster.h"
#include "results/shadow.h"

static const double pi = 3.14159265358979323846;
static const float ink[3] = {0.16f, 0.18f, 0.22f};

ep_drawing ep_default_drawing(int nv, const double *x, int nt, const int *triangle) {
  return (ep_drawing){.nv = nv,
                      .x = x,
                      .nt = nt,
                      .triangle = triangle,
                      .tint = {0.48f, 0.62f, 0.82f},
                      .crease = 40};
}

ep_view ep_default_view(void) {
  return (ep_view){.from = {0.55, 0.45, 1.0},
                   .up = {0, 1, 0},
                   .perspective = 22,
                   .shared = true,
                   .shadow = true,
                   .margin = 0.07,
                   .width = 480,
                   .height = 400,
                   .samples = 3,
                   .label_size = 13,
                   .top = {0.97f, 0.975f, 0.985f},
                   .bottom = {0.86f, 0.88f, 0.91f}};
}

// ---- checks ----------------------------------------------------------------------------------
static ep_status check_drawing(int panel, const ep_drawing *d, ep_error *err) {
  if (d->nv < 1 || d->nt < 1 || !d->x || !d->triangle)
    return ep_fail(err, EP_ERR_ARGUMENT, "picture: panel %d has nothing to show", panel);
  for (int i = 0; i < 3 * d->nt; i++)
    if (d->triangle[i] < 0 || d->triangle[i] >= d->nv)
      return ep_fail(err, EP_ERR_ARGUMENT, "picture: panel %d, triangle %d uses vertex %d of %d",
                     panel, i / 3, d->triangle[i], d->nv);
  for (int i = 0; i < 3 * d->nt; i++)
    for (int k = 0; k < 3; k++)
      if (!isfinite(d->x[3 * (size_t)d->triangle[i] + (size_t)k]))
        return ep_fail(err, EP_ERR_ARGUMENT, "picture: panel %d, vertex %d is nowhere (NaN)", panel,
                       d->triangle[i]);
  return EP_OK;
}

static ep_status check(const ep_view *v, int panels, const ep_panel *panel, ep_error *err) {
  if (panels < 1 || v->width < 8 || v->height < 8 || v->samples < 1 || v->samples > 8 ||
      v->columns < 0 || !(v->margin >= 0 && v->margin < 0.5) || !(v->label_size > 0) ||
      !(v->perspective >= 0 && v->perspective < 120))
    return ep_fail(err, EP_ERR_ARGUMENT,
                   "picture: %d panels of %d x %d pixels, %d samples, margin %g, field of view %g: "
                   "out of range",
                   panels, v->width, v->height, v->samples, v->margin, v->perspective);
  const double *f = v->from, *u = v->up;
  const double cross[3] = {f[1] * u[2] - f[2] * u[1], f[2] * u[0] - f[0] * u[2],
                           f[0] * u[1] - f[1] * u[0]};
  if (!(hypot(hypot(cross[0], cross[1]), cross[2]) > 0))
    return ep_fail(err, EP_ERR_ARGUMENT, "picture: view direction and up are parallel or zero");
  for (int p = 0; p < panels; p++) {
    if (panel[p].drawings < 1)
      return ep_fail(err, EP_ERR_ARGUMENT, "picture: panel %d has nothing to show", p);
    for (int i = 0; i < panel[p].drawings; i++) EP_TRY(check_drawing(p, &panel[p].drawing[i], err));
  }
  return EP_OK;
}

// ---- camera ----------------------------------------------------------------------------------
static double dot(const double *a, const double *b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross_unit(const double *a, const double *b, double *c) {
  for (int k = 0; k < 3; k++)
    c[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
  const double length = sqrt(dot(c, c));
  for (int k = 0; k < 3; k++) c[k] /= length;
}

static ep_camera aim(const ep_view *view) {
  ep_camera c = {.scale = 1};
  const double length = sqrt(dot(view->from, view->from));
  for (int k = 0; k < 3; k++) c.back[k] = view->from[k] / length;
  cross_unit(view->up, c.back, c.right);
  cross_unit(c.back, c.right, c.up);
  return c;
}

// Run over the used vertices of panels first..last.
typedef void (*visit)(void *user, const double *p);
static void each_vertex(int first, int last, const ep_panel *panel, visit f, void *user) {
  for (int p = first; p <= last; p++)
    for (int i = 0; i < panel[p].drawings; i++) {
      const ep_drawing *d = &panel[p].drawing[i];
      for (int j = 0; j < 3 * d->nt; j++) f(user, d->x + 3 * (size_t)d->triangle[j]);
    }
}

typedef struct extent {
  const ep_camera *camera;
  const ep_frame *frame;
  double low[3], high[3];
} extent;

static void widen(extent *e, const double *s) {
  for (int k = 0; k < 3; k++) {
    e->low[k] = fmin(e->low[k], s[k]);
    e->high[k] = fmax(e->high[k], s[k]);
  }
}

static void visit_point(void *user, const double *p) {
  widen(user, p);
}

static void visit_screen(void *user, const double *p) {
  extent *e = user;
  double s[3];
  ep_camera_project(e->camera, e->frame, p, s);
  widen(e, s);
}

static const extent nothing = {.low = {DBL_MAX, DBL_MAX, DBL_MAX},
                               .high = {-DBL_MAX, -DBL_MAX, -DBL_MAX}};

// Fit the camera to panels first..last on a frame of samples.
static void fit(const ep_view *view, int first, int last, const ep_panel *panel,
                const ep_frame *frame, ep_camera *camera) {
  extent box = nothing;
  each_vertex(first, last, panel, visit_point, &box);
  double radius = 0;
  for (int k = 0; k < 3; k++) {
    camera->centre[k] = (box.low[k] + box.high[k]) / 2;
    radius += (box.high[k] - box.low[k]) * (box.high[k] - box.low[k]) / 4;
  }
  radius = sqrt(radius);
  camera->distance =
      view->perspective > 0 && radius > 0 ? radius / sin(view->perspective * pi / 360) : 0;
  camera->scale = 1;
  camera->offset[0] = camera->offset[1] = 0;
  extent screen = nothing;
  screen.camera = camera;
  screen.frame = frame;
  each_vertex(first, last, panel, visit_screen, &screen);
  const double w = screen.high[0] - screen.low[0], h = screen.high[1] - screen.low[1];
  const double free_side = 2 * view->margin * fmin(frame->width, frame->height);
  double scale = DBL_MAX;
  if (w > 0) scale = (frame->width - free_side) / w;
  if (h > 0) scale = fmin(scale, (frame->height - free_side) / h);
  if (scale == DBL_MAX) scale = 1; // a single point
  camera->offset[0] = -scale * ((screen.low[0] + screen.high[0]) / 2 - frame->width / 2.0);
  camera->offset[1] = -scale * ((screen.low[1] + screen.high[1]) / 2 - frame->height / 2.0);
  camera->scale = scale;
}

// ---- layout ----------------------------------------------------------------------------------
typedef struct layout {
  int columns, rows;
  int title, label; // heights of the band of title and note, and of each label band
} layout;

// A line of `text` that fits into `room` pixels, broken at a blank: its length. *next: what
// follows.
static size_t line_of(const char *text, double size, double room, const char **next) {
  char line[240];
  size_t best = 0;
  for (size_t i = 1; i < sizeof line && text[i - 1]; i++) {
    if (text[i] && text[i] != ' ') continue;
    memcpy(line, text, i);
    line[i] = 0;
    if (best && ep_text_width(size, line) > room) break;
    best = i;
  }
  if (!best) best = strnlen(text, sizeof line - 1); // one word longer than a line
  *next = text + best;
  while (**next == ' ') ++*next;
  return best;
}

static double note_size(const ep_view *view) {
  return 0.8 * view->label_size;
}

static int lines_of_note(const ep_view *view, double room) {
  int lines = 0;
  for (const char *at = view->note; at && *at; lines++) line_of(at, note_size(view), room, &at);
  return lines;
}

static layout lay_out(const ep_view *view, int panels, const ep_panel *panel) {
  layout l = {.columns = view->columns > 0 && view->columns < panels ? view->columns : panels};
  l.rows = (panels + l.columns - 1) / l.columns;
  l.title = view->title ? (int)ceil(3.2 * view->label_size) : 0;
  l.title += (int)ceil(1.8 * note_size(view) * lines_of_note(view, l.columns * view->width - 32.0));
  for (int p = 0; p < panels; p++)
    if (panel[p].label) l.label = (int)ceil(2.4 * view->label_size);
  return l;
}

static void paint_background(ep_image *image, const ep_view *view) {
  for (int y = 0; y < image->height; y++) {
    const float t = image->height > 1 ? (float)y / (float)(image->height - 1) : 0;
    unsigned char rgb[3];
    for (int k = 0; k < 3; k++)
      rgb[k] = (unsigned char)lroundf(
          255 * fminf(1, fmaxf(0, view->top[k] + t * (view->bottom[k] - view->top[k]))));
    unsigned char *row = image->rgb + 3 * (size_t)y * (size_t)image->width;
    for (int x = 0; x < image->width; x++) memcpy(row + 3 * (size_t)x, rgb, 3);
  }
}

// Average the samples of each pixel in linear light, over the background and its shadow.
static void resolve(const ep_frame *frame, int samples, const ep_shadow *shadow,
                    const ep_camera *camera, ep_image *image, int left, int top) {
  double linear[256];
  for (int v = 0; v < 256; v++) linear[v] = ep_linear_from_srgb(v / 255.0);
  for (int y = 0; y < frame->height / samples; y++)
    for (int x = 0; x < frame->width / samples; x++) {
      double sum[3] = {0, 0, 0};
      int covered = 0;
      for (int j = 0; j < samples * samples; j++) {
        const size_t row = (size_t)(y * samples + j / samples) * (size_t)frame->width;
        const size_t at = row + (size_t)(x * samples + j % samples);
        if (frame->depth[at] == -FLT_MAX) continue;
        covered++;
        for (int k = 0; k < 3; k++) sum[k] += fmin(1, (double)frame->color[3 * at + (size_t)k]);
      }
      const double total = samples * samples,
                   dark = covered == samples * samples
                              ? 0
                              : ep_shadow_at(shadow, camera, frame, (x + 0.5) * samples,
                                             (y + 0.5) * samples);
      if (!covered && dark == 0) continue;
      unsigned char *p =
          image->rgb + 3 * ((size_t)(top + y) * (size_t)image->width + (size_t)(left + x));
      for (int k = 0; k < 3; k++) {
        const double behind = linear[p[k]] * (1 - dark);
        const double light = (sum[k] + (total - covered) * behind) / total;
        p[k] = (unsigned char)lround(255 * ep_srgb_from_linear(light));
      }
    }
}

static double height_of(const ep_view *view, const double *p) {
  return dot(view->up, p) / sqrt(dot(view->up, view->up));
}

// A floor and the shadow of everything else on its upper side.
static ep_status draw_floor(const ep_view *view, const ep_panel *panel, const ep_drawing *d,
                            ep_frame *frame, const ep_camera *camera, ep_error *err) {
  ep_shadow shadow;
  double top = -DBL_MAX;
  EP_TRY(ep_frame_draw(frame, camera, d, 1.1 * view->samples, err));
  if (!view->shadow) return EP_OK;
  for (int j = 0; j < 3 * d->nt; j++)
    top = fmax(top, height_of(view, d->x + 3 * (size_t)d->triangle[j]));
  EP_TRY(ep_shadow_make(view, camera, panel, top, &shadow, err));
  ep_shadow_fall(&shadow, camera, frame);
  ep_shadow_free(&shadow);
  return EP_OK;
}

static ep_status draw_panel(const ep_view *view, const ep_panel *panel, ep_frame *frame,
                            const ep_camera *camera, double ground, ep_image *image, int left,
                            int top, ep_error *err) {
  int floors = 0;
  memset(frame->color, 0, (size_t)frame->width * (size_t)frame->height * 3 * sizeof(float));
  for (size_t i = 0; i < (size_t)frame->width * (size_t)frame->height; i++)
    frame->depth[i] = -FLT_MAX;
  for (int i = 0; i < panel->drawings; i++) {
    if (!panel->drawing[i].floor) continue;
    EP_TRY(draw_floor(view, panel, &panel->drawing[i], frame, camera, err));
    floors++;
  }
  for (int i = 0; i < panel->drawings; i++)
    if (!panel->drawing[i].floor)
      EP_TRY(ep_frame_draw(frame, camera, &panel->drawing[i], 1.1 * view->samples, err));
  ep_shadow shadow = {0};
  if (view->shadow && !floors) EP_TRY(ep_shadow_make(view, camera, panel, ground, &shadow, err));
  resolve(frame, view->samples, &shadow, camera, image, left, top);
  ep_shadow_free(&shadow);
  return EP_OK;
}

static double lowest(const ep_view *view, int first, int last, const ep_panel *panel) {
  double low = DBL_MAX;
  for (int p = first; p <= last; p++)
    for (int i = 0; i < panel[p].drawings; i++) {
      const ep_drawing *d = &panel[p].drawing[i];
      for (int j = 0; j < 3 * d->nt; j++)
        low = fmin(low, height_of(view, d->x + 3 * (size_t)d->triangle[j]));
    }
  return low;
}

static ep_status draw_label(ep_image *image, double middle, double baseline, double room,
                            const char *text, double size, ep_error *err) {
  const double width = ep_text_width(size, text);
  const double fitted = width > room ? size * room / width : size; // shrink rather than cut
  return ep_image_text(image, middle - ep_text_width(fitted, text) / 2, baseline, fitted, ink, text,
                       err);
}

static ep_status draw_note(const ep_view *view, ep_image *image, ep_error *err) {
  const double size = note_size(view), room = image->width - 32.0;
  double baseline = (view->title ? 3.2 : 1.2) * view->label_size + 0.8 * size;
  for (const char *at = view->note, *next; at && *at; at = next, baseline += 1.8 * size) {
    char line[240];
    const size_t length = line_of(at, size, room, &next);
    memcpy(line, at, length);
    line[length] = 0;
    EP_TRY(draw_label(image, image->width / 2.0, baseline, room, line, size, err));
  }
  return EP_OK;
}

static ep_status draw_panels(const ep_view *view, const layout *l, int panels,
                             const ep_panel *panel, ep_frame *frame, ep_image *image,
                             ep_error *err) {
  ep_camera camera = aim(view);
  double ground = 0;
  for (int p = 0; p < panels; p++) {
    if (!view->shared || p == 0) {
      const int first = view->shared ? 0 : p, last = view->shared ? panels - 1 : p;
      fit(view, first, last, panel, frame, &camera);
      ground = lowest(view, first, last, panel);
    }
    const int left = p % l->columns * view->width;
    const int top = l->title + p / l->columns * (view->height + l->label);
    EP_TRY(draw_panel(view, &panel[p], frame, &camera, ground, image, left, top, err));
    if (panel[p].label)
      EP_TRY(draw_label(image, left + view->width / 2.0,
                        top + view->height + 1.3 * view->label_size, view->width - 8.0,
                        panel[p].label, view->label_size, err));
  }
  return EP_OK;
}

ep_status ep_picture_render(const ep_view *view, int panels, const ep_panel *panel, ep_image *out,
                            ep_error *err) {
  memset(out, 0, sizeof *out);
  EP_TRY(check(view, panels, panel, err));
  const layout l = lay_out(view, panels, panel);
  EP_TRY(ep_image_make(l.columns * view->width, l.title + l.rows * (view->height + l.label),
                       view->top, out, err));
  paint_background(out, view);
  ep_frame frame;
  ep_status status =
      ep_frame_make(view->width * view->samples, view->height * view->samples, &frame, err);
  if (status == EP_OK) {
    status = draw_panels(view, &l, panels, panel, &frame, out, err);
    ep_frame_free(&frame);
  }
  if (status == EP_OK && view->title)
    status = draw_label(out, out->width / 2.0, 2.2 * view->label_size, out->width - 16.0,
                        view->title, 1.3 * view->label_size, err);
  if (status == EP_OK) status = draw_note(view, out, err);
  if (status != EP_OK) ep_image_free(out);
  return status;
}

ep_status ep_picture_write(const char *path, const ep_view *view, int panels, const ep_panel *panel,
                           ep_error *err) {
  ep_image image;
  EP_TRY(ep_picture_render(view, panels, panel, &image, err));
  const ep_status status = ep_image_write_png(path, &image, err);
  ep_image_free(&image);
  return status;
}
