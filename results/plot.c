#include "results/plot.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

static const float paper[3] = {1, 1, 1}, ink[3] = {0.16f, 0.18f, 0.22f};
static const float grid[3] = {0.87f, 0.89f, 0.91f};
static const float palette[8][3] = {
    {0.12f, 0.38f, 0.72f}, {0.85f, 0.37f, 0.10f}, {0.13f, 0.55f, 0.33f}, {0.56f, 0.27f, 0.62f},
    {0.78f, 0.16f, 0.24f}, {0.10f, 0.60f, 0.65f}, {0.62f, 0.48f, 0.08f}, {0.40f, 0.42f, 0.46f}};
enum { TEXT = 11 };

typedef struct axis {
  double first, step, pixel0, pixel1; // value first at pixel0, first + count step at pixel1
  int count;
} axis;

void ep_plot_ticks(double low, double high, int wanted, double *first, double *step, int *count) {
  if (!(high > low)) { // one value: room around it
    const double room = low != 0 ? 0.5 * fabs(low) : 1;
    low -= room;
    high += room;
  }
  const double rough = (high - low) / wanted, ten = pow(10, floor(log10(rough)));
  const double digit = rough / ten;
  *step = ten * (digit <= 1 ? 1 : digit <= 2 ? 2 : digit <= 5 ? 5 : 10);
  // A time of 60 steps of 0.0166666667 s is 1 s: no empty interval for what rounding leaves over.
  const double start = floor(low / *step + 1e-6), end = ceil(high / *step - 1e-6);
  *first = start * *step;
  *count = (int)(end - start);
}

static double pixel(const axis *a, double value) {
  return a->pixel0 + (a->pixel1 - a->pixel0) * (value - a->first) / (a->count * a->step);
}

static ep_status measure(const ep_plot *p, axis *x, axis *y, ep_error *err) {
  if (p->n < 2 || p->series < 1 || p->width < 160 || p->height < 120)
    return ep_fail(err, EP_ERR_ARGUMENT, "chart: %d points, %d lines, %d x %d pixels: too few",
                   p->n, p->series, p->width, p->height);
  for (int i = 0; i < p->n; i++)
    if (!isfinite(p->x[i]) || (i > 0 && !(p->x[i] > p->x[i - 1])))
      return ep_fail(err, EP_ERR_ARGUMENT, "chart: x must ascend; point %d is at %g", i, p->x[i]);
  double low = DBL_MAX, high = -DBL_MAX;
  for (size_t i = 0; i < (size_t)p->n * (size_t)p->series; i++)
    if (isfinite(p->y[i])) {
      low = fmin(low, p->y[i]);
      high = fmax(high, p->y[i]);
    }
  if (low > high) return ep_fail(err, EP_ERR_ARGUMENT, "chart: no finite value to draw");
  ep_plot_ticks(p->x[0], p->x[p->n - 1], p->width / 90, &x->first, &x->step, &x->count);
  ep_plot_ticks(low, high, p->height / 60, &y->first, &y->step, &y->count);
  return EP_OK;
}

static double legend_width(const ep_plot *p) {
  double widest = 0;
  for (int s = 0; s < p->series && p->name; s++)
    widest = fmax(widest, ep_text_width(TEXT, p->name[s]) + 44);
  return widest;
}

static void tick_text(const axis *a, int i, char *text, size_t size) {
  const double value = a->first + i * a->step;
  snprintf(text, size, "%.6g", fabs(value) < 1e-9 * a->step ? 0 : value);
}

static void place(const ep_plot *p, axis *x, axis *y) {
  double widest = 0;
  for (int i = 0; i <= y->count; i++) {
    char text[32];
    tick_text(y, i, text, sizeof text);
    widest = fmax(widest, ep_text_width(TEXT, text));
  }
  x->pixel0 = 20 + widest;
  x->pixel1 = p->width - 24 - legend_width(p);
  y->pixel0 = p->height - (p->x_label ? 52 : 32);
  y->pixel1 = (p->title ? 40 : 14) + (p->y_label ? 24 : 0);
}

static ep_status draw_axes(ep_image *image, const axis *x, const axis *y, ep_error *err) {
  char text[32];
  for (int i = 0; i <= x->count; i++) {
    const double at = pixel(x, x->first + i * x->step);
    ep_image_line(image, at, y->pixel0, at, y->pixel1, 1, grid);
    tick_text(x, i, text, sizeof text);
    EP_TRY(ep_image_text(image, at - ep_text_width(TEXT, text) / 2, y->pixel0 + 20, TEXT, ink, text,
                         err));
  }
  for (int i = 0; i <= y->count; i++) {
    const double at = pixel(y, y->first + i * y->step);
    ep_image_line(image, x->pixel0, at, x->pixel1, at, 1, grid);
    tick_text(y, i, text, sizeof text);
    EP_TRY(ep_image_text(image, x->pixel0 - 8 - ep_text_width(TEXT, text), at + TEXT / 2.0, TEXT,
                         ink, text, err));
  }
  ep_image_line(image, x->pixel0, y->pixel0, x->pixel1, y->pixel0, 1.4, ink);
  ep_image_line(image, x->pixel0, y->pixel0, x->pixel0, y->pixel1, 1.4, ink);
  return EP_OK;
}

static void draw_lines(ep_image *image, const ep_plot *p, const axis *x, const axis *y) {
  for (int s = 0; s < p->series; s++)
    for (int i = 0; i + 1 < p->n; i++) {
      const double a = p->y[(size_t)i * (size_t)p->series + (size_t)s];
      const double b = p->y[(size_t)(i + 1) * (size_t)p->series + (size_t)s];
      if (!isfinite(a) || !isfinite(b)) continue;
      ep_image_line(image, pixel(x, p->x[i]), pixel(y, a), pixel(x, p->x[i + 1]), pixel(y, b), 2,
                    palette[s % 8]);
    }
}

static ep_status draw_texts(ep_image *image, const ep_plot *p, const axis *x, const axis *y,
                            ep_error *err) {
  if (p->title)
    EP_TRY(ep_image_text(image, (p->width - ep_text_width(14, p->title)) / 2, 26, 14, ink, p->title,
                         err));
  if (p->y_label) EP_TRY(ep_image_text(image, 12, y->pixel1 - 14, TEXT, ink, p->y_label, err));
  if (p->x_label)
    EP_TRY(ep_image_text(image, (x->pixel0 + x->pixel1 - ep_text_width(TEXT, p->x_label)) / 2,
                         p->height - 12, TEXT, ink, p->x_label, err));
  for (int s = 0; s < p->series && p->name; s++) {
    const double left = x->pixel1 + 14, top = y->pixel1 + 10 + 20.0 * s;
    ep_image_line(image, left, top, left + 20, top, 2.4, palette[s % 8]);
    EP_TRY(ep_image_text(image, left + 28, top + TEXT / 2.0, TEXT, ink, p->name[s], err));
  }
  return EP_OK;
}

ep_status ep_plot_render(const ep_plot *plot, ep_image *out, ep_error *err) {
  memset(out, 0, sizeof *out);
  axis x, y;
  EP_TRY(measure(plot, &x, &y, err));
  place(plot, &x, &y);
  if (!(x.pixel1 > x.pixel0 + 40 && y.pixel0 > y.pixel1 + 40))
    return ep_fail(err, EP_ERR_ARGUMENT, "chart: %d x %d pixels leave no room beside the labels",
                   plot->width, plot->height);
  EP_TRY(ep_image_make(plot->width, plot->height, paper, out, err));
  ep_status status = draw_axes(out, &x, &y, err);
  if (status == EP_OK) draw_lines(out, plot, &x, &y);
  if (status == EP_OK) status = draw_texts(out, plot, &x, &y, err);
  if (status != EP_OK) ep_image_free(out);
  return status;
}

ep_status ep_plot_write(const char *path, const ep_plot *plot, ep_error *err) {
  ep_image image;
  EP_TRY(ep_plot_render(plot, &image, err));
  const ep_status status = ep_image_write_png(path, &image, err);
  ep_image_free(&image);
  return status;
}
