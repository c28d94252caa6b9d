// Charts. Claims: a point's place in the SVG is affine in the logarithm on a logarithmic axis;
// names are escaped; points a logarithmic axis cannot hold are left out, and nothing at all is an
// error; the same chart gives the same bytes, as SVG and as PNG; ticks are round and
// enclose the data.
#include "harness.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "results/chart.h"

static ep_chart chart_of(const ep_chart_series *series, bool log_x) {
  return (ep_chart){.title = "a <title>",
                    .x_label = "x",
                    .y_label = "y",
                    .log_x = log_x,
                    .log_y = true,
                    .width = 600,
                    .height = 400,
                    .series = 1,
                    .list = series};
}

// noinline: gcc 12 takes what is returned for a pointer to the variable that held it.
__attribute__((noinline)) static char *svg_of(const ep_chart *chart) {
  ep_error err = {0};
  char *text;
  size_t size;
  if (ep_chart_write_svg("chart.svg", chart, &err) != EP_OK) fail_msg("%s", err.text);
  if (ep_file_read("chart.svg", &text, &size, &err) != EP_OK) fail_msg("%s", err.text);
  return text;
}

// The place of a label's text: 8 right of its point, 5 above.
static void place_of(const char *svg, const char *label, double *x, double *y) {
  char text[32];
  snprintf(text, sizeof text, ">%s</text>", label);
  assert_non_null(strstr(svg, text));
  size_t start = (size_t)(strstr(svg, text) - svg);
  while (strncmp(svg + start, "<text", 5) != 0) start--;
  assert_int_equal(sscanf(svg + start, "<text x=\"%lf\" y=\"%lf\"", x, y), 2);
}

// x = 1, 10, 100 stand at equal distances on a logarithmic axis; 1, 10, 19 on a linear one. The
// file has two digits after the point.
static void places_follow_the_axes(void **state) {
  (void)state;
  for (int log_x = 0; log_x < 2; log_x++) {
    const double x[3] = {1, 10, log_x ? 100 : 19}, y[3] = {1e-3, 1e-2, 1e-1};
    const char *label[3] = {"one", "two", "three"};
    const ep_chart_series series = {
        .name = "s", .n = 3, .x = x, .y = y, .label = label, .line = true, .marks = true};
    const ep_chart chart = chart_of(&series, log_x);
    char *svg = svg_of(&chart);
    double px[3], py[3];
    for (int i = 0; i < 3; i++) place_of(svg, label[i], &px[i], &py[i]);
    assert_true(px[0] < px[1] && py[0] > py[1]); // up is larger
    assert_true(fabs((px[2] - px[1]) - (px[1] - px[0])) < 0.03);
    assert_true(fabs((py[2] - py[1]) - (py[1] - py[0])) < 0.03);
    assert_non_null(strstr(svg, "a &lt;title&gt;"));
    assert_null(strstr(svg, "<title>"));
    free(svg);
  }
}

static void what_cannot_be_drawn_is_left_out(void **state) {
  (void)state;
  const double x[3] = {1, 2, 3}, y[3] = {0, 1, NAN}, none[3] = {0, -1, NAN};
  const char *label[3] = {"zero", "good", "nan"};
  ep_chart_series series = {.name = "s", .n = 3, .x = x, .y = y, .label = label, .marks = true};
  const ep_chart chart = chart_of(&series, false);
  char *svg = svg_of(&chart);
  assert_non_null(strstr(svg, ">good<"));
  assert_null(strstr(svg, ">zero<"));
  assert_null(strstr(svg, ">nan<"));
  free(svg);
  series.y = none;
  ep_error err = {0};
  assert_int_equal(ep_chart_write_svg("none.svg", &chart, &err), EP_ERR_ARGUMENT);
  assert_false(ep_path_exists("none.svg"));
  ep_error again = {0};
  assert_int_equal(ep_chart_write_png("none.png", &chart, &again), EP_ERR_ARGUMENT);
}

static void same_chart_same_bytes(void **state) {
  (void)state;
  const double x[4] = {1, 5, 30, 200}, y[4] = {3, 1, 0.2, 0.7};
  const ep_chart_series series = {.name = "s", .n = 4, .x = x, .y = y, .line = true, .marks = true};
  const ep_chart chart = chart_of(&series, true);
  char *a = svg_of(&chart), *b = svg_of(&chart);
  assert_string_equal(a, b);
  ep_digest first, second;
  ep_error err = {0};
  assert_int_equal(ep_chart_write_png("chart.png", &chart, &err), EP_OK);
  assert_int_equal(ep_hash_file("chart.png", &first, &err), EP_OK);
  assert_int_equal(ep_chart_write_png("chart.png", &chart, &err), EP_OK);
  assert_int_equal(ep_hash_file("chart.png", &second, &err), EP_OK);
  assert_string_equal(first.hex, second.hex);
  free(a);
  free(b);
}

static void ticks_are_round_and_enclose(void **state) {
  (void)state;
  const double range[5][2] = {{0, 1}, {-0.37, 12.2}, {1e-7, 3e-7}, {5, 5}, {-2e5, -1e5}};
  for (int i = 0; i < 5; i++) {
    double first, step;
    int count;
    ep_chart_ticks(range[i][0], range[i][1], 6, &first, &step, &count);
    assert_true(first <= range[i][0] * (1 + 1e-12) || first <= range[i][0]);
    assert_true(first + count * step >= range[i][1] - 1e-9 * step);
    assert_true(count >= 2 && count <= 14);
    const double digit = step / pow(10, floor(log10(step) + 1e-9));
    assert_true(fabs(digit - 1) < 1e-9 || fabs(digit - 2) < 1e-9 || fabs(digit - 5) < 1e-9);
  }
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(places_follow_the_axes),
      cmocka_unit_test(what_cannot_be_drawn_is_left_out),
      cmocka_unit_test(same_chart_same_bytes),
      cmocka_unit_test(ticks_are_round_and_enclose),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
