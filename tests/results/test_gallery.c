// Claim: the ready-made pictures have one panel per item, and show what they are given.
#include "tests/results/harness.h"

#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "results/gallery.h"

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
  assert_int_equal(ep_gallery_poses("none.png", &view, 0, NULL, 0, &err), EP_ERR_ARGUMENT);
  assert_false(ep_path_exists("none.png"));
  ep_mesh_free(&mesh);
}

int main(void) {
  const struct CMUnitTest tests[] = {cmocka_unit_test(test_galleries)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
