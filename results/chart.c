#include "results/chart.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/escape.h"
#include "base/files.h"
#include "results/image.h"

// sRGB; 0 ink, 1 grid, from 2 on the series: told apart also without colour, by their marks.
static const unsigned char palette[10][3] = {
    {41, 46, 56},   {221, 226, 231}, {31, 97, 184},  {217, 94, 26},  {33, 140, 84},
    {143, 69, 158}, {199, 41, 61},   {26, 153, 166}, {158, 122, 20}, {102, 107, 117}};
enum { INK, GRID, FIRST_SERIES, COLORS = 8 };
enum { TEXT = 12, SMALL = 10, TITLE = 15, SCALE = 2 };

// ---- where it is drawn: SVG or an image --------------------------------------------------------

typedef struct canvas {
  FILE *svg;       // or
  ep_image *image; // of SCALE times the size
  ep_error *err;
  ep_status status;
} canvas;

static void color_of(int index, float rgb[3]) {
  for (int c = 0; c < 3; c++) rgb[c] = palette[index][c] / 255.0f;
}

static void put_line(canvas *c, double x0, double y0, double x1, double y1, double width,
                     int color) {
  if (c->svg) {
    const unsigned char *p = palette[color];
    fprintf(c->svg,
            "<line x1=\"%.2f\" y1=\"%.2f\" x2=\"%.2f\" y2=\"%.2f\" stroke=\"#%02x%02x%02x\" "
            "stroke-width=\"%.2g\" stroke-linecap=\"round\"/>\n",
            x0, y0, x1, y1, p[0], p[1], p[2], width);
    return;
  }
  float rgb[3];
  color_of(color, rgb);
  ep_image_line(c->image, SCALE * x0, SCALE * y0, SCALE * x1, SCALE * y1, SCALE * width, rgb);
}

// align: 0 left, 1 middle, 2 right
static void put_text(canvas *c, double x, double y, double size, int align, int color,
                     const char *text) {
  static const char *const anchor[3] = {"start", "middle", "end"};
  if (c->svg) {
    const unsigned char *p = palette[color];
    fprintf(c->svg,
            "<text x=\"%.2f\" y=\"%.2f\" font-size=\"%g\" text-anchor=\"%s\" "
            "fill=\"#%02x%02x%02x\">",
            x, y, size, anchor[align], p[0], p[1], p[2]);
    ep_write_escaped(c->svg, text);
    fputs("</text>\n", c->svg);
    return;
  }
  if (c->status != EP_OK) return;
  float rgb[3];
  color_of(color, rgb);
  const double capital = SCALE * 0.72 * size; // height of capitals of a font this large
  const double left = SCALE * x - 0.5 * align * ep_text_width(capital, text);
  c->status = ep_image_text(c->image, left, SCALE * y, capital, rgb, text, c->err);
}

// Marks of eight shapes, drawn as short lines.
static void put_mark(canvas *c, double x, double y, int shape, int color) {
  static const signed char strokes[COLORS][9] = {
      // pairs of points on a 3 x 3 grid 0..8 (4: middle), -1 ends
      {0, 2, 2, 8, 8, 6, 6, 0, -1},
      {1, 5, 5, 7, 7, 3, 3, 1, -1},
      {0, 8, 2, 6, -1},
      {1, 7, 3, 5, -1},
      {1, 8, 8, 6, 6, 1, -1},
      {0, 2, 2, 7, 7, 0, -1},
      {0, 6, 6, 5, 5, 0, -1},
      {0, 8, 2, 6, 1, 7, -1}};
  const double size = 4;
  for (int i = 0; i < 8 && strokes[shape][i] >= 0; i += 2) {
    const int a = strokes[shape][i], b = strokes[shape][i + 1];
    put_line(c, x + size * (a % 3 - 1), y + size * (a / 3 - 1), x + size * (b % 3 - 1),
             y + size * (b / 3 - 1), 2.2, color);
  }
}

// ---- axes --------------------------------------------------------------------------------------

void ep_chart_ticks(double low, double high, int wanted, double *first, double *step, int *count) {
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

typedef struct axis {
  bool log;
  double low, high, pixel0, pixel1; // in log10 where log
  double first, step;
  int count; // linear: ticks
} axis;

static double coordinate(const axis *a, double value) {
  return a->log ? (value > 0 ? log10(value) : NAN) : value;
}

static double pixel(const axis *a, double value) {
  return a->pixel0 + (a->pixel1 - a->pixel0) * (coordinate(a, value) - a->low) / (a->high - a->low);
}

static bool drawable(const axis *x, const axis *y, const ep_chart_series *s, int i) {
  return isfinite(coordinate(x, s->x[i])) && isfinite(coordinate(y, s->y[i]));
}

static bool measure(const ep_chart *chart, axis *x, axis *y) {
  double low[2] = {DBL_MAX, DBL_MAX}, high[2] = {-DBL_MAX, -DBL_MAX};
  for (int s = 0; s < chart->series; s++)
    for (int i = 0; i < chart->list[s].n; i++) {
      const ep_chart_series *series = &chart->list[s];
      if (!drawable(x, y, series, i)) continue;
      const double at[2] = {coordinate(x, series->x[i]), coordinate(y, series->y[i])};
      for (int c = 0; c < 2; c++) low[c] = fmin(low[c], at[c]), high[c] = fmax(high[c], at[c]);
    }
  if (low[0] > high[0]) return false;
  axis *both[2] = {x, y};
  for (int c = 0; c < 2; c++) {
    axis *a = both[c];
    if (a->log) { // a little room, so that marks do not sit on the frame
      const double room = fmax(0.06 * (high[c] - low[c]), 0.12);
      a->low = low[c] - room;
      a->high = high[c] + room;
    } else {
      ep_chart_ticks(low[c], high[c], 6, &a->first, &a->step, &a->count);
      a->low = a->first;
      a->high = a->first + a->count * a->step;
    }
  }
  return true;
}

static void tick(canvas *c, const axis *a, const axis *other, double value, bool upright,
                 bool label) {
  const double at = pixel(a, value);
  char text[32];
  if (upright)
    put_line(c, at, other->pixel0, at, other->pixel1, 1, GRID);
  else
    put_line(c, other->pixel0, at, other->pixel1, at, 1, GRID);
  if (!label) return;
  snprintf(text, sizeof text, "%.6g", fabs(value) < 1e-12 ? 0 : value);
  if (upright)
    put_text(c, at, other->pixel0 + 18, TEXT, 1, INK, text);
  else
    put_text(c, other->pixel0 - 8, at + 4, TEXT, 2, INK, text);
}

// Powers of ten with their 2 and 5 where few decades are seen.
static void draw_ticks(canvas *c, const axis *a, const axis *other, bool upright) {
  if (!a->log) {
    for (int i = 0; i <= a->count; i++) tick(c, a, other, a->first + i * a->step, upright, true);
    return;
  }
  const double decades = a->high - a->low;
  const int every = decades > 9 ? 2 : 1;
  for (int d = (int)floor(a->low); d <= (int)ceil(a->high); d++)
    for (int digit = 1; digit < 10; digit++) {
      const double value = digit * pow(10, d), at = log10(value);
      const bool fine = digit == 2 || digit == 5;
      if (at < a->low || at > a->high || (digit > 1 && decades > 3.5)) continue;
      if (digit == 1 && d % every) continue;
      tick(c, a, other, value, upright, digit == 1 || (fine && decades < 2.5) || decades < 0.9);
    }
}

// ---- chart -------------------------------------------------------------------------------------

enum { LEFT = 74, RIGHT = 20, TOP = 66, BOTTOM = 50, LEGEND = 20 };

static double widest_name(const ep_chart *chart) {
  double widest = 0;
  for (int s = 0; s < chart->series; s++)
    widest = fmax(widest, ep_text_width(0.72 * TEXT, chart->list[s].name));
  return 48 + 1.1 * widest;
}

// Eight marks within a colour, so that 64 series are told apart.
static int mark_of(const ep_chart_series *s) {
  return (s->color + s->color / COLORS) % COLORS;
}

// Lines without marks are broken where their colour comes a second time.
static bool gap(const ep_chart_series *s, int i) {
  return !s->marks && s->color / COLORS % 2 && i % 4 == 3;
}

static void draw_series(canvas *c, const ep_chart_series *s, const axis *x, const axis *y) {
  const int color = FIRST_SERIES + s->color % COLORS;
  for (int i = 0; i + 1 < s->n && s->line; i++)
    if (!gap(s, i) && drawable(x, y, s, i) && drawable(x, y, s, i + 1))
      put_line(c, pixel(x, s->x[i]), pixel(y, s->y[i]), pixel(x, s->x[i + 1]),
               pixel(y, s->y[i + 1]), s->marks ? 1 : 2, color);
  for (int i = 0; i < s->n; i++) {
    if (!drawable(x, y, s, i)) continue;
    const double px = pixel(x, s->x[i]), py = pixel(y, s->y[i]);
    if (s->marks) put_mark(c, px, py, mark_of(s), color);
  }
}

// ---- labels ------------------------------------------------------------------------------------

typedef struct box {
  double x0, y0, x1, y1;
  const char *text;
} box;
typedef struct placed {
  box *list;
  int count;
} placed;

static bool overlap(const box *a, const box *b) {
  return a->x0 < b->x1 && b->x0 < a->x1 && a->y0 < b->y1 && b->y0 < a->y1;
}

// Above right of the mark, then below right, above left, below left.
static box label_box(double px, double py, int place, const char *text) {
  const double width = ep_text_width(0.72 * SMALL, text) * 1.1, height = SMALL;
  const double x0 = place < 2 ? px + 8 : px - 8 - width;
  const double y1 = place % 2 ? py + 5 + 0.72 * SMALL : py - 4;
  return (box){x0, y1 - height, x0 + width, y1, text};
}

// A place for a label where nothing is written or marked yet. Where a series has the same label
// close by, that one serves both; where all places are taken the label is left out.
static bool place_label(placed *p, double px, double py, const char *text, box *out) {
  for (int i = 0; i < p->count; i++) {
    const box *b = &p->list[i];
    if (b->text && strcmp(b->text, text) == 0 && fabs(0.5 * (b->x0 + b->x1) - px) < 26 &&
        fabs(0.5 * (b->y0 + b->y1) - py) < 20)
      return false;
  }
  for (int place = 0; place < 4; place++) {
    bool is_free = true;
    *out = label_box(px, py, place, text);
    for (int i = 0; i < p->count && is_free; i++) is_free = !overlap(out, &p->list[i]);
    if (is_free) {
      p->list[p->count++] = *out;
      return true;
    }
  }
  return false;
}

static void label_series(canvas *c, const ep_chart_series *s, const axis *x, const axis *y,
                         placed *p) {
  for (int i = 0; i < s->n && s->label; i++) {
    box at;
    if (!s->label[i] || !drawable(x, y, s, i)) continue;
    if (place_label(p, pixel(x, s->x[i]), pixel(y, s->y[i]), s->label[i], &at))
      put_text(c, at.x0, at.y1, SMALL, 0, FIRST_SERIES + s->color % COLORS, s->label[i]);
  }
}

// Labels last: they keep clear of all marks and of each other.
static ep_status draw_labels(canvas *c, const ep_chart *chart, const axis *x, const axis *y) {
  size_t most = 0;
  for (int s = 0; s < chart->series; s++) most += 2 * (size_t)chart->list[s].n;
  placed p = {.list = malloc((most + 1) * sizeof *p.list)};
  if (!p.list) return ep_fail(c->err, EP_ERR_MEMORY, "no memory for the labels of a chart");
  for (int s = 0; s < chart->series; s++)
    for (int i = 0; i < chart->list[s].n && chart->list[s].marks; i++) {
      const double px = pixel(x, chart->list[s].x[i]), py = pixel(y, chart->list[s].y[i]);
      if (drawable(x, y, &chart->list[s], i))
        p.list[p.count++] = (box){px - 4, py - 4, px + 4, py + 4, NULL};
    }
  for (int s = 0; s < chart->series; s++) label_series(c, &chart->list[s], x, y, &p);
  free(p.list);
  return EP_OK;
}

static void draw_legend(canvas *c, const ep_chart *chart, double left) {
  for (int s = 0; s < chart->series; s++) {
    const ep_chart_series *series = &chart->list[s];
    const double y = TOP + 10 + LEGEND * s;
    const int color = FIRST_SERIES + series->color % COLORS;
    if (series->line && gap(series, 3)) {
      put_line(c, left, y, left + 9, y, 2, color);
      put_line(c, left + 13, y, left + 22, y, 2, color);
    } else if (series->line) {
      put_line(c, left, y, left + 22, y, series->marks ? 1 : 2, color);
    }
    if (series->marks) put_mark(c, left + 11, y, mark_of(series), color);
    put_text(c, left + 30, y + 4, TEXT, 0, INK, series->name);
  }
}

static ep_status draw(canvas *c, const ep_chart *chart) {
  axis x = {.log = chart->log_x}, y = {.log = chart->log_y};
  if (!measure(chart, &x, &y))
    return ep_fail(c->err, EP_ERR_ARGUMENT, "chart: there is no point to draw");
  const double legend = widest_name(chart);
  x.pixel0 = LEFT;
  x.pixel1 = chart->width - RIGHT - legend;
  y.pixel0 = chart->height - BOTTOM;
  y.pixel1 = TOP;
  if (x.pixel1 < x.pixel0 + 100 || y.pixel0 < y.pixel1 + 60)
    return ep_fail(c->err, EP_ERR_ARGUMENT, "chart: %d x %d pixels leave no room", chart->width,
                   chart->height);
  draw_ticks(c, &x, &y, true);
  draw_ticks(c, &y, &x, false);
  put_line(c, x.pixel0, y.pixel0, x.pixel1, y.pixel0, 1.4, INK);
  put_line(c, x.pixel0, y.pixel0, x.pixel0, y.pixel1, 1.4, INK);
  for (int s = 0; s < chart->series; s++) draw_series(c, &chart->list[s], &x, &y);
  EP_TRY(draw_labels(c, chart, &x, &y));
  put_text(c, LEFT, 24, TITLE, 0, INK, chart->title);
  put_text(c, 14, TOP - 14, TEXT, 0, INK, chart->y_label);
  put_text(c, (x.pixel0 + x.pixel1) / 2, chart->height - 10, TEXT, 1, INK, chart->x_label);
  draw_legend(c, chart, x.pixel1 + 18);
  return c->status;
}

ep_status ep_chart_svg(const ep_chart *chart, FILE *out, ep_error *err) {
  canvas c = {.svg = out, .err = err};
  fprintf(out,
          "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 %d %d\" width=\"%d\" "
          "height=\"%d\" font-family=\"sans-serif\">\n<rect width=\"100%%\" height=\"100%%\" "
          "fill=\"#ffffff\"/>\n",
          chart->width, chart->height, chart->width, chart->height);
  EP_TRY(draw(&c, chart));
  fputs("</svg>\n", out);
  return EP_OK;
}

ep_status ep_chart_write_svg(const char *path, const ep_chart *chart, ep_error *err) {
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  fputs("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n", out.file);
  const ep_status status = ep_chart_svg(chart, out.file, err);
  if (status == EP_OK) return ep_output_commit(&out, err);
  ep_output_discard(&out);
  return status;
}

ep_status ep_chart_write_png(const char *path, const ep_chart *chart, ep_error *err) {
  static const float paper[3] = {1, 1, 1};
  ep_image image;
  EP_TRY(ep_image_make(SCALE * chart->width, SCALE * chart->height, paper, &image, err));
  canvas c = {.image = &image, .err = err};
  ep_status status = draw(&c, chart);
  if (status == EP_OK) status = ep_image_write_png(path, &image, err);
  ep_image_free(&image);
  return status;
}
