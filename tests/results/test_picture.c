// Claims: a body's silhouette has the area geometry says; the nearer of two surfaces is seen; a
// corner of a box is shaded sharp, a ball smooth; labels leave ink; the PNG file decodes to the
// rendered pixels and is the same bytes every time.
#include "tests/results/harness.h"

#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "results/colors.h"
#include "results/picture.h"

enum { RINGS = 48, SECTORS = 96, BALL_NV = (RINGS + 1) * SECTORS, BALL_NT = 2 * RINGS * SECTORS };

typedef struct ball {
  double x[BALL_NV * 3];
  int triangle[BALL_NT * 3];
} ball;

static void make_ball(ball *b, double radius) {
  const double pi = acos(-1);
  for (int i = 0; i <= RINGS; i++)
    for (int j = 0; j < SECTORS; j++) {
      const double a = pi * i / RINGS, c = 2 * pi * j / SECTORS;
      double *x = b->x + 3 * (i * SECTORS + j);
      x[0] = radius * sin(a) * cos(c);
      x[1] = radius * cos(a);
      x[2] = radius * sin(a) * sin(c);
    }
  int *t = b->triangle;
  for (int i = 0; i < RINGS; i++)
    for (int j = 0; j < SECTORS; j++) {
      const int p = i * SECTORS + j, q = i * SECTORS + (j + 1) % SECTORS;
      const int corner[6] = {p, q, p + SECTORS, q, q + SECTORS, p + SECTORS};
      memcpy(t, corner, sizeof corner);
      t += 6;
    }
}

static const double cube_x[24] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0,
                                  0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1};
static const int cube_triangle[36] = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                      2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

// White background, no shadow, parallel: pixels of an object are those that are not white.
static ep_view plain_view(int size) {
  ep_view v = ep_default_view();
  v.width = v.height = size;
  v.perspective = 0;
  v.shadow = false;
  v.margin = 0.1;
  for (int k = 0; k < 3; k++) v.top[k] = v.bottom[k] = 1;
  v.from[0] = 0, v.from[1] = 0, v.from[2] = 1;
  return v;
}

static const unsigned char *pixel(const ep_image *image, int x, int y) {
  return image->rgb + 3 * (y * image->width + x);
}

static int not_white(const ep_image *image, int x0, int y0, int x1, int y1) {
  int count = 0;
  for (int y = y0; y < y1; y++)
    for (int x = x0; x < x1; x++) {
      const unsigned char *p = pixel(image, x, y);
      count += p[0] != 255 || p[1] != 255 || p[2] != 255;
    }
  return count;
}

static void test_silhouettes(void **state) {
  (void)state;
  static ball b;
  make_ball(&b, 2.5);
  ep_drawing d = ep_default_drawing(BALL_NV, b.x, BALL_NT, b.triangle);
  const ep_panel panel = {1, &d, NULL};
  ep_view view = plain_view(300);
  ep_image image;
  ep_error err = {0};
  assert_int_equal(ep_picture_render(&view, 1, &panel, &image, &err), EP_OK);
  // radius (0.5 - margin) 300 = 120 pixels; partly covered pixels along the rim count whole:
  // about half of the rim's 2 pi r pixels too many
  const double pi = acos(-1), area = pi * 120 * 120;
  const int seen = not_white(&image, 0, 0, 300, 300);
  assert_true(seen > area * 0.998 && seen < area + 1.2 * pi * 120);
  assert_true(not_white(&image, 0, 0, 300, 29) == 0 && not_white(&image, 150, 31, 151, 40) == 9);
  // smooth: neighbouring pixels in the middle differ by a few steps at most
  for (int x = 60; x < 240; x++)
    assert_true(abs(pixel(&image, x, 150)[1] - pixel(&image, x + 1, 150)[1]) <= 4);
  ep_image_free(&image);

  d = ep_default_drawing(8, cube_x, 12, cube_triangle);
  view.from[0] = view.from[1] = view.from[2] = 1; // along the diagonal: a regular hexagon
  assert_int_equal(ep_picture_render(&view, 1, &panel, &image, &err), EP_OK);
  // height of the hexagon 2 sqrt(2/3) fills 240 pixels; area 3 sqrt(3)/2 s^2, s = half the height
  const double side = 120, hexagon = 1.5 * sqrt(3) * side * side;
  const int cube_seen = not_white(&image, 0, 0, 300, 300);
  assert_true(cube_seen > hexagon * 0.995 && cube_seen < hexagon + 6 * side);
  // three faces, each of one shade, sharp edges between them
  const unsigned char *top = pixel(&image, 150, 90), *left = pixel(&image, 100, 190);
  const unsigned char *right = pixel(&image, 200, 190);
  assert_true(abs(top[1] - left[1]) > 15 && abs(left[1] - right[1]) > 15);
  ep_image_free(&image);
}

static void test_depth(void **state) {
  (void)state;
  const double x[18] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 1, 0, 1, 0, 1, 1};
  const int triangle[6] = {0, 1, 2, 3, 4, 5};
  float color[18] = {1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
  ep_drawing d = ep_default_drawing(6, x, 2, triangle);
  d.color = color;
  const ep_panel panel = {1, &d, NULL};
  ep_view view = plain_view(100);
  for (int perspective = 0; perspective <= 30; perspective += 30) {
    view.perspective = perspective;
    view.from[2] = 1; // the green one, at z = 1, is nearer
    ep_image image;
    assert_int_equal(ep_picture_render(&view, 1, &panel, &image, NULL), EP_OK);
    assert_true(pixel(&image, 30, 70)[1] > 2 * pixel(&image, 30, 70)[0]);
    ep_image_free(&image);
    view.from[2] = -1; // from behind the red one; mirrored left to right
    assert_int_equal(ep_picture_render(&view, 1, &panel, &image, NULL), EP_OK);
    assert_true(pixel(&image, 70, 70)[0] > 2 * pixel(&image, 70, 70)[1]);
    ep_image_free(&image);
  }
}

static void test_panels_and_labels(void **state) {
  (void)state;
  double large[24];
  for (int i = 0; i < 24; i++) large[i] = 2 * cube_x[i];
  const ep_drawing small = ep_default_drawing(8, cube_x, 12, cube_triangle);
  const ep_drawing big = ep_default_drawing(8, large, 12, cube_triangle);
  ep_panel panel[3] = {{1, &small, "one"}, {1, &big, NULL}, {1, &big, "three"}};
  ep_view view = plain_view(120);
  view.columns = 2;
  ep_image image;
  assert_int_equal(ep_picture_render(&view, 3, panel, &image, NULL), EP_OK);
  const int band = (image.height - 240) / 2;
  assert_int_equal(image.width, 240);
  assert_true(band > 20);
  assert_true(not_white(&image, 0, 120, 120, 120 + band) > 30);       // "one"
  assert_int_equal(not_white(&image, 120, 120, 240, 120 + band), 0);  // no label
  assert_true(not_white(&image, 0, 240 + band, 120, 240 + 2 * band) > // longer: more ink
              not_white(&image, 0, 120, 120, 120 + band));
  // shared scale: half the side, a quarter of the pixels (to the rim)
  const int first = not_white(&image, 0, 0, 120, 120), other = not_white(&image, 120, 0, 240, 120);
  assert_true(fabs(4.0 * first / other - 1) < 0.1);
  ep_image_free(&image);
  view.shared = false;
  assert_int_equal(ep_picture_render(&view, 3, panel, &image, NULL), EP_OK);
  assert_int_equal(not_white(&image, 0, 0, 120, 120), not_white(&image, 120, 0, 240, 120));
  ep_image_free(&image);
}

static void test_shadow(void **state) {
  (void)state;
  const ep_drawing cube = ep_default_drawing(8, cube_x, 12, cube_triangle);
  const ep_panel panel = {1, &cube, NULL};
  ep_view view = plain_view(160);
  view.from[1] = 0.7;
  view.margin = 0.25;
  ep_image without, with;
  assert_int_equal(ep_picture_render(&view, 1, &panel, &without, NULL), EP_OK);
  view.shadow = true;
  assert_int_equal(ep_picture_render(&view, 1, &panel, &with, NULL), EP_OK);
  const int more = not_white(&with, 0, 0, 160, 160) - not_white(&without, 0, 0, 160, 160);
  assert_true(more > 200); // seen beside the cube, and only ever darker
  for (int i = 0; i < 3 * 160 * 160; i++) assert_true(with.rgb[i] <= without.rgb[i]);
  ep_image_free(&without);
  ep_image_free(&with);
}

// A cube over a floor: the floor is darkened where the shadow falls, nothing else changes.
static void test_floor(void **state) {
  (void)state;
  double high[24], wide[24];
  for (int i = 0; i < 24; i++) {
    high[i] = cube_x[i] + (i % 3 == 1 ? 2 : 0);
    wide[i] = i % 3 == 1 ? 0.1 * cube_x[i] : 6 * cube_x[i];
  }
  ep_drawing both[2] = {ep_default_drawing(8, high, 12, cube_triangle),
                        ep_default_drawing(8, wide, 12, cube_triangle)};
  both[1].floor = true;
  const ep_panel panel = {2, both, NULL};
  ep_view view = plain_view(160);
  view.from[1] = 0.7;
  ep_image without, with;
  assert_int_equal(ep_picture_render(&view, 1, &panel, &without, NULL), EP_OK);
  view.shadow = true;
  assert_int_equal(ep_picture_render(&view, 1, &panel, &with, NULL), EP_OK);
  assert_int_equal(not_white(&with, 0, 0, 160, 160), not_white(&without, 0, 0, 160, 160));
  int darker = 0;
  for (int i = 0; i < 3 * 160 * 160; i++) {
    assert_true(with.rgb[i] <= without.rgb[i]);
    darker += with.rgb[i] < without.rgb[i];
  }
  assert_true(darker > 200);
  ep_image_free(&without);
  ep_image_free(&with);
}

static void test_png(void **state) {
  (void)state;
  const ep_drawing cube = ep_default_drawing(8, cube_x, 12, cube_triangle);
  const ep_panel panel = {1, &cube, "cube"};
  const ep_view view = ep_default_view();
  ep_image image;
  ep_error err = {0};
  assert_int_equal(ep_picture_render(&view, 1, &panel, &image, &err), EP_OK);
  assert_int_equal(ep_picture_write("a.png", &view, 1, &panel, &err), EP_OK);
  assert_int_equal(ep_picture_write("b.png", &view, 1, &panel, &err), EP_OK);
  ep_digest one, two;
  assert_int_equal(ep_hash_file("a.png", &one, &err), EP_OK);
  assert_int_equal(ep_hash_file("b.png", &two, &err), EP_OK);
  assert_string_equal(one.hex, two.hex);
  png_image png = {.version = PNG_IMAGE_VERSION};
  assert_true(png_image_begin_read_from_file(&png, "a.png"));
  png.format = PNG_FORMAT_RGB;
  assert_int_equal(png.width, image.width);
  assert_int_equal(png.height, image.height);
  unsigned char *rgb = malloc(PNG_IMAGE_SIZE(png));
  assert_non_null(rgb);
  assert_true(png_image_finish_read(&png, NULL, rgb, 0, NULL));
  assert_memory_equal(rgb, image.rgb, PNG_IMAGE_SIZE(png));
  free(rgb);
  ep_image_free(&image);
}

static void test_every_glyph(void **state) {
  (void)state;
  const float white[3] = {1, 1, 1}, black[3] = {0, 0, 0};
  ep_digest seen[96];
  int count = 0;
  for (char c = '!'; c <= '~'; c++, count++) {
    ep_image image;
    const char text[2] = {c, 0};
    assert_int_equal(ep_image_make(48, 60, white, &image, NULL), EP_OK);
    assert_int_equal(ep_image_text(&image, 6, 44, 30, black, text, NULL), EP_OK);
    assert_true(not_white(&image, 0, 0, 48, 60) > 10);
    seen[count] = ep_hash_bytes(image.rgb, 3 * 48 * 60);
    for (int i = 0; i < count; i++) assert_string_not_equal(seen[i].hex, seen[count].hex);
    ep_image_free(&image);
  }
  ep_image image; // far outside: nothing happens
  assert_int_equal(ep_image_make(8, 8, white, &image, NULL), EP_OK);
  assert_int_equal(ep_image_text(&image, -1e6, 1e6, 30, black, "gone", NULL), EP_OK);
  ep_image_line(&image, -1e5, -50, 1e5, -50, 3, black);
  assert_int_equal(not_white(&image, 0, 0, 8, 8), 0);
  ep_image_free(&image);
}

static void test_colors(void **state) {
  (void)state;
  float low[3], middle[3], high[3], before = 0;
  for (int i = 0; i <= 20; i++) { // lightness ascends: the scale survives in grey
    ep_color(EP_COLORS_SEQUENTIAL, i / 20.0, middle);
    const float light = 0.2126f * middle[0] + 0.7152f * middle[1] + 0.0722f * middle[2];
    assert_true(light > before);
    before = light;
  }
  ep_color(EP_COLORS_DIVERGING, 0, low);
  ep_color(EP_COLORS_DIVERGING, 0.5, middle);
  ep_color(EP_COLORS_DIVERGING, 1, high);
  assert_true(low[2] > low[0] && high[0] > high[2] && middle[0] > 0.9f && middle[2] > 0.9f);
  const double value[3] = {-1, 0, 4};
  float rgb[9];
  ep_color_signed(3, value, rgb);
  assert_memory_equal(rgb + 3, middle, sizeof middle); // zero is the neutral colour
  assert_memory_equal(rgb + 6, high, sizeof high);
}

static void test_refuses(void **state) {
  (void)state;
  double x[24];
  memcpy(x, cube_x, sizeof x);
  ep_drawing cube = ep_default_drawing(8, x, 12, cube_triangle);
  const ep_panel panel[2] = {{1, &cube, NULL}, {0, NULL, NULL}};
  ep_view view = ep_default_view();
  ep_image image;
  ep_error err = {0};
  assert_int_equal(ep_picture_render(&view, 2, panel, &image, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "panel 1"));
  x[5] = NAN;
  err = (ep_error){0};
  assert_int_equal(ep_picture_render(&view, 1, panel, &image, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "vertex 1"));
  x[5] = 0;
  memcpy(view.up, view.from, sizeof view.up);
  assert_int_equal(ep_picture_render(&view, 1, panel, &image, NULL), EP_ERR_ARGUMENT);
  assert_null(image.rgb);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_silhouettes),
                                     cmocka_unit_test(test_depth),
                                     cmocka_unit_test(test_panels_and_labels),
                                     cmocka_unit_test(test_shadow),
                                     cmocka_unit_test(test_floor),
                                     cmocka_unit_test(test_png),
                                     cmocka_unit_test(test_every_glyph),
                                     cmocka_unit_test(test_colors),
                                     cmocka_unit_test(test_refuses)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
