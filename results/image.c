#include "results/image.h"

#include <math.h>
#include <png.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "results/font.h"

enum { LARGEST = 32768, CUTS = 3, POINTS = 512 };

ep_status ep_image_make(int width, int height, const float color[3], ep_image *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  if (width < 1 || height < 1 || width > LARGEST || height > LARGEST)
    return ep_fail(err, EP_ERR_ARGUMENT, "a picture of %d x %d pixels: each side must be 1 to %d",
                   width, height, LARGEST);
  const size_t pixels = (size_t)width * (size_t)height;
  out->rgb = malloc(3 * pixels);
  if (!out->rgb)
    return ep_fail(err, EP_ERR_MEMORY, "no memory for a picture of %d x %d pixels", width, height);
  out->width = width;
  out->height = height;
  for (size_t i = 0; i < 3 * pixels; i++)
    out->rgb[i] = (unsigned char)lround(255.0 * fmin(1, fmax(0, (double)color[i % 3])));
  return EP_OK;
}

void ep_image_free(ep_image *image) {
  free(image->rgb);
  memset(image, 0, sizeof *image);
}

// ---- PNG -------------------------------------------------------------------------------------
typedef struct save_context {
  jmp_buf back; // libpng reports failure by a callback that must not return
  char text[200];
} save_context;

static void save_failed(png_structp png, png_const_charp text) {
  save_context *context = png_get_error_ptr(png);
  snprintf(context->text, sizeof context->text, "%s", text);
  longjmp(context->back, 1);
}

static void save_ignored(png_structp png, png_const_charp text) {
  (void)png;
  (void)text;
}

static bool save_rows(FILE *file, const ep_image *image, save_context *context) {
  png_structp png =
      png_create_write_struct(PNG_LIBPNG_VER_STRING, context, save_failed, save_ignored);
  png_infop info = png ? png_create_info_struct(png) : NULL;
  if (!info) {
    png_destroy_write_struct(&png, NULL);
    snprintf(context->text, sizeof context->text, "libpng could not start");
    return false;
  }
  if (setjmp(context->back)) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_init_io(png, file);
  png_set_IHDR(png, info, (png_uint_32)image->width, (png_uint_32)image->height, 8,
               PNG_COLOR_TYPE_RGB, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_set_sRGB(png, info, PNG_sRGB_INTENT_PERCEPTUAL);
  png_set_compression_level(png, 6); // 9: 8 per cent smaller, for three times the time
  png_write_info(png, info);
  for (int y = 0; y < image->height; y++)
    png_write_row(png, image->rgb + 3 * (size_t)y * (size_t)image->width);
  png_write_end(png, NULL);
  png_destroy_write_struct(&png, &info);
  return true;
}

ep_status ep_image_write_png(const char *path, const ep_image *image, ep_error *err) {
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  save_context context = {.text = ""};
  if (!save_rows(out.file, image, &context)) {
    ep_output_discard(&out);
    return ep_fail(err, EP_ERR_IO, "cannot write %s: %s", path, context.text);
  }
  return ep_output_commit(&out, err);
}

// ---- lines and text --------------------------------------------------------------------------
// Distance of p to the segment a-b.
static double segment_distance(double px, double py, const double *a, const double *b) {
  const double dx = b[0] - a[0], dy = b[1] - a[1], l2 = dx * dx + dy * dy;
  double t = l2 > 0 ? ((px - a[0]) * dx + (py - a[1]) * dy) / l2 : 0;
  t = fmin(1, fmax(0, t));
  return hypot(px - a[0] - t * dx, py - a[1] - t * dy);
}

// Coverage of pixels by strokes, in a window of the image.
typedef struct mask {
  int x0, y0, width, height;
  float *cover;
} mask;

static ep_status mask_make(const ep_image *image, double x0, double y0, double x1, double y1,
                           mask *out, ep_error *err) {
  const double low_x = fmax(0, floor(x0)), high_x = fmin(image->width, ceil(x1));
  const double low_y = fmax(0, floor(y0)), high_y = fmin(image->height, ceil(y1));
  *out = (mask){(int)low_x, (int)low_y, (int)(high_x - low_x), (int)(high_y - low_y), NULL};
  if (!(high_x > low_x && high_y > low_y)) return EP_OK; // all outside
  out->cover = calloc((size_t)out->width * (size_t)out->height, sizeof *out->cover);
  return out->cover ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for a label");
}

static void mask_segment(mask *m, const double *a, const double *b, double width) {
  const double reach = width / 2 + 1;
  const int x0 = (int)fmax(m->x0, floor(fmin(a[0], b[0]) - reach));
  const int x1 = (int)fmin(m->x0 + m->width, ceil(fmax(a[0], b[0]) + reach));
  const int y0 = (int)fmax(m->y0, floor(fmin(a[1], b[1]) - reach));
  const int y1 = (int)fmin(m->y0 + m->height, ceil(fmax(a[1], b[1]) + reach));
  for (int y = y0; y < y1; y++)
    for (int x = x0; x < x1; x++) {
      const double d = segment_distance(x + 0.5, y + 0.5, a, b);
      const float c = (float)fmin(1, fmax(0, 0.5 + width / 2 - d));
      float *cover = m->cover + (size_t)(y - m->y0) * (size_t)m->width + (size_t)(x - m->x0);
      if (c > *cover) *cover = c;
    }
}

static void mask_paint(const mask *m, ep_image *image, const float color[3]) {
  for (int y = 0; y < m->height; y++)
    for (int x = 0; x < m->width; x++) {
      const float c = m->cover[(size_t)y * (size_t)m->width + (size_t)x];
      const size_t row = (size_t)(m->y0 + y) * (size_t)image->width;
      unsigned char *p = image->rgb + 3 * (row + (size_t)(m->x0 + x));
      for (int k = 0; k < 3; k++)
        p[k] = (unsigned char)lroundf((float)p[k] + c * (255.0f * color[k] - (float)p[k]));
    }
}

void ep_image_line(ep_image *image, double x0, double y0, double x1, double y1, double width,
                   const float color[3]) {
  const double a[2] = {x0, y0}, b[2] = {x1, y1}, reach = width / 2 + 1;
  const int left = (int)fmax(0, floor(fmin(x0, x1) - reach));
  const int right = (int)fmin(image->width, ceil(fmax(x0, x1) + reach));
  const int top = (int)fmax(0, floor(fmin(y0, y1) - reach));
  const int bottom = (int)fmin(image->height, ceil(fmax(y0, y1) + reach));
  for (int y = top; y < bottom; y++)
    for (int x = left; x < right; x++) {
      const double d = segment_distance(x + 0.5, y + 0.5, a, b);
      const double c = fmin(1, fmax(0, 0.5 + width / 2 - d));
      unsigned char *p = image->rgb + 3 * ((size_t)y * (size_t)image->width + (size_t)x);
      for (int k = 0; k < 3; k++)
        p[k] = (unsigned char)lround(p[k] + c * (255.0 * (double)color[k] - p[k]));
    }
}

// Points of a stroke in grid units; returns its end in the glyph's text.
static const char *read_stroke(const char *s, double (*point)[2], int *count, bool *smooth) {
  *smooth = *s == '~';
  if (*smooth) s++;
  *count = 0;
  for (; *s >= '0' && *s <= '9' && *count < POINTS; s += 2, (*count)++) {
    point[*count][0] = s[0] - '0';
    point[*count][1] = s[1] - '0';
  }
  return s;
}

// One round of corner cutting (Chaikin 1974), end points kept; tends to the quadratic B-spline.
static int cut_corners(double (*point)[2], int count) {
  double cut[POINTS][2];
  int n = 0;
  for (int k = 0; k < 2; k++) cut[0][k] = point[0][k];
  for (int i = 0; i + 1 < count && n + 3 < POINTS; i++) {
    const double first = i == 0 ? 0.5 : 0.25, last = i == count - 2 ? 0.5 : 0.75;
    for (int k = 0; k < 2; k++) {
      cut[n + 1][k] = point[i][k] + first * (point[i + 1][k] - point[i][k]);
      cut[n + 2][k] = point[i][k] + last * (point[i + 1][k] - point[i][k]);
    }
    n += 2;
  }
  for (int k = 0; k < 2; k++) cut[n + 1][k] = point[count - 1][k];
  n += 2;
  memcpy(point, cut, (size_t)n * sizeof cut[0]);
  return n;
}

static void draw_glyph(mask *m, char c, double x, double y, double unit, double width) {
  double point[POINTS][2];
  for (const char *s = ep_font_glyph(c); *s;) {
    int count;
    bool smooth;
    if (*s == ' ') s++;
    s = read_stroke(s, point, &count, &smooth);
    for (int round = 0; smooth && round < CUTS; round++) count = cut_corners(point, count);
    for (int i = 0; i < count; i++) {
      point[i][0] = x + unit * point[i][0];
      point[i][1] = y - unit * (point[i][1] - EP_FONT_BASELINE);
    }
    for (int i = 0; i + 1 < count; i++) mask_segment(m, point[i], point[i + 1], width);
  }
}

double ep_text_width(double size, const char *text) {
  double width = 0;
  for (const char *c = text; *c; c++) width += ep_font_advance(*c) + (c[1] ? ep_font_gap : 0);
  return width * size / EP_FONT_CAPITAL;
}

ep_status ep_image_text(ep_image *image, double x, double y, double size, const float color[3],
                        const char *text, ep_error *err) {
  const double unit = size / EP_FONT_CAPITAL, width = fmax(1.0, 0.13 * size);
  mask m;
  EP_TRY(mask_make(image, x - width, y - 1.3 * size - width, x + ep_text_width(size, text) + width,
                   y + 0.5 * size + width, &m, err));
  if (!m.cover) return EP_OK;
  for (const char *c = text; *c; c++) {
    draw_glyph(&m, *c, x, y, unit, width);
    x += unit * (ep_font_advance(*c) + ep_font_gap);
  }
  mask_paint(&m, image, color);
  free(m.cover);
  return EP_OK;
}
