// Claims: ticks are round and enclose the data; a line is drawn where its values say, a NaN leaves
// a gap; what cannot be drawn is refused. The ready-made pictures have one panel per item.
#include "tests/results/harness.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "results/gallery.h"
#include "results/plot.h"

static void test_ticks(void **state) {
  (void)state;
  const double range[5][2] = {{0, 1}, {-0.37, 12.2}, {1e-7, 3e-7}, {5, 5}, {-2e5, -1e5}};
  for (int i = 0; i < 5; i++) {
    double first, step;
    int count;
    ep_plot_ticks(range[i][0], range[i][1], 6, &first, &step, &count);
    assert_true(first <= range[i][0] * (1 + 1e-12) || first <= range[i][0]);
    assert_true(first + count * step >= range[i][1] - 1e-9 * step);
    assert_true(count >= 2 && count <= 14);
    const double digit = step / pow(10, floor(log10(step) + 1e-9));
    assert_true(fabs(digit - 1) < 1e-9 || fabs(digit - 2) < 1e-9 || fabs(digit - 5) < 1e-9);
  }
}

// Pixels that are clearly orange (the second line's colour), in columns x0..x1.
static int orange(const ep_image *image, int x0, int x1) {
  int count = 0;
  for (int y = 0; y < image->height; y++)
    for (int x = x0; x < x1; x++) {
      const unsigned char *p = image->rgb + 3 * (y * image->width + x);
      count += p[0] > 200 && p[1] < 140 && p[2] < 90;
    }
  return count;
}

static void test_lines(void **state) {
  (void)state;
  enum { N = 41 };
  double x[N], y[2 * N];
  for (int i = 0; i < N; i++) {
    x[i] = i / 40.0;
    y[2 * i] = 0;
    y[2 * i + 1] = i > 15 && i < 25 ? NAN : 1;
  }
  const char *const name[2] = {"rest", "bent"};
  ep_plot plot = {"weights", "t [s]", "w", 500, 300, N, 2, x, y, name};
  ep_image image;
  ep_error err = {0};
  assert_int_equal(ep_plot_render(&plot, &image, &err), EP_OK);
  assert_int_equal(image.width, 500);
  assert_true(orange(&image, 60, 170) > 150);
  assert_int_equal(orange(&image, 225, 245), 0); // the gap
  assert_true(orange(&image, 420, 500) > 20);    // legend
  ep_image_free(&image);
  assert_int_equal(ep_plot_write("plot.png", &plot, &err), EP_OK);
  assert_true(ep_path_exists("plot.png"));
  x[3] = x[2];
  assert_int_equal(ep_plot_render(&plot, &image, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "point 3"));
  plot.n = 1;
  assert_int_equal(ep_plot_render(&plot, &image, NULL), EP_ERR_ARGUMENT);
}

static void png_size(const char *path, int size[2]) {
  char *bytes;
  size_t length;
  assert_int_equal(ep_file_read(path, &bytes, &length, NULL), EP_OK);
  assert_memory_equal(bytes, "\x89PNG\r\n\x1a\n", 8);
  for (int i = 0; i < 2; i++) {
    size[i] = 0;
    for (int k = 0; k < 4; k++) size[i] = size[i] * 256 + (unsigned char)bytes[16 + 4 * i + k];
  }
  free(bytes);
}

static void test_galleries(void **state) {
  (void)state;
  const double x[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 1, 1};
  const int tet[8] = {0, 1, 2, 3, 1, 2, 3, 4};
  ep_mesh mesh;
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(5, x, 2, tet, "pair", &mesh, NULL, &err), EP_OK);
  ep_view view = ep_default_view();
  view.width = 100, view.height = 80;
  const ep_gallery_item item[3] = {
      {.mesh = &mesh}, {.mesh = &mesh, .x = x, .dots = 1, .dot = x}, {.mesh = &mesh}};
  int size[2];
  assert_int_equal(ep_gallery_poses("poses.png", &view, 3, item, 0.4f, &err), EP_OK);
  png_size("poses.png", size);
  // a dot is seen: without it the picture is another one
  const ep_gallery_item plain[3] = {{.mesh = &mesh}, {.mesh = &mesh, .x = x}, {.mesh = &mesh}};
  assert_int_equal(ep_gallery_poses("plain.png", &view, 3, plain, 0.4f, &err), EP_OK);
  assert_int_not_equal(system("cmp -s poses.png plain.png"), 0);
  // a note takes lines of its own, above the panels
  view.note = "a note that is longer than one line of so small a picture, so that it is broken";
  assert_int_equal(ep_gallery_poses("noted.png", &view, 3, plain, 0.4f, &err), EP_OK);
  view.note = NULL;
  int noted[2];
  png_size("noted.png", noted);
  assert_true(noted[0] == 300 && noted[1] > 80 + 2 * 10);
  assert_true(size[0] == 300 && size[1] == 80);
  const double phi[10] = {-1, 0, 0, 0, 1, 1, -1, 0, 0, 0}, value[2] = {1.5, 2.5};
  assert_int_equal(ep_gallery_functions("phi.png", &view, &mesh, 2, phi, value, &err), EP_OK);
  png_size("phi.png", size);
  assert_true(size[0] == 200 && size[1] > 80);
  const double point[3] = {0.3, 0.3, 0.3}, normal[3] = {1, 0, 0};
  assert_int_equal(
      ep_gallery_cut("cut.png", &view, &mesh, NULL, point, normal, phi, "inside", &err), EP_OK);
  png_size("cut.png", size);
  assert_true(size[0] == 100);
  assert_int_equal(ep_gallery_poses("none.png", &view, 0, NULL, 0, &err), EP_ERR_ARGUMENT);
  assert_false(ep_path_exists("none.png"));
  ep_mesh_free(&mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_ticks), cmocka_unit_test(test_lines),
                                     cmocka_unit_test(test_galleries)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
