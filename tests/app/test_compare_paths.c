// `eigenpose compare` over the paths of the examples, and what its files hold. Claims:
//  - each path is measured against the full space with the forces of that path: a full-space run
//  has
//    no error, and with strains in the span of the basis the exact polynomials give what all
//    elements give, on the Green-strain path too;
//  - weights and shape difference of the paths stand in results.json, frames.csv and on the page,
//    the same numbers in each;
//  - the first chart is results.csv: two logarithmic axes carry every pair of neighbouring points
//  to
//    a line of the picture;
//  - all elements and polynomials stay together over 1,000 undamped steps to round-off;
//  - a scene on the Green-strain path with poses of its own connectivity has no Laplace-Beltrami
//    space, map or descriptor: not planned, not in the cache, not in the model.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "base/files.h"
#include "box.h"
#include "program.h"
#include "reduced/eigenpose.h"
#include "tests/near.h"

static const char scene_text[] =
    "schema: 1\nname: beam\nobject: {mesh: beam.veg}\n"
    "fixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\n"
    "families: [{poses: [beam-bent.veg]}]\n"
    "reduction: {eigenfunctions: 5, modes: 10, linear_modes: 5, path_samples: 2, elements: 12,\n"
    "  training_poses: 20, amplitude: 0.1}\n"
    "simulation: {dt: 0.02, steps: 20, damping: {mass: 0.5, stiffness: 0.05}}\n"
    "examples: {alpha: 0.8}\n"
    "loads: [{push: {box: {low: [0.9, -1, -1], high: [2, 2, 2]}, force: [0, 6, 2], ramp: 0.1}}]\n"
    "compare: {modes: [4, 10], elements: [12], solvers: [newton], precisions: [double],\n"
    "  paths: [lb, green]}\n";

static int write_scene(void **state) {
  (void)state;
  write_box("beam.veg", 6, 2, 2, 1.2, 0, 2e4);
  write_box("beam-bent.veg", 6, 2, 2, 1.2, 0.2, 0);
  write_text("beam.yaml", scene_text);
  return 0;
}

static json_t *compare(const char *folder, const char *sets) {
  if (program("", "compare beam.yaml --json -q --cache paths-cache --out %s %s", folder, sets) != 0)
    fail_msg("%s", text_of("err.txt"));
  return report();
}

static const char *text_at(const json_t *object, const char *key) {
  const char *text = json_string_value(json_object_get(object, key));
  if (!text) fail_msg("a point lacks %s", key);
  return text;
}

static const json_t *point_of(const json_t *root, const char *method, const char *path, int r) {
  size_t i;
  json_t *p;
  json_array_foreach(json_object_get(root, "points"), i, p) {
    if (strcmp(text_at(p, "method"), method) == 0 && strcmp(text_at(p, "path"), path) == 0 &&
        (int)number(p, "r") == r)
      return p;
  }
  fail_msg("no point %s %s r = %d", method, path, r);
  return NULL;
}

// ---- paths -------------------------------------------------------------------------------------

static void check_points(const json_t *root) {
  static const char *const paths[] = {"lb", "green"};
  for (int i = 0; i < 2; i++) {
    const json_t *full = point_of(root, "full", paths[i], 10);
    assert_true(number(full, "position_error") == 0 && number(full, "weight_error") == 0);
    const json_t *all = point_of(root, "all", paths[i], 10);
    assert_true(number(all, "position_error") > 1e-6 && number(all, "position_error") < 0.1);
    assert_true(number(all, "weight_error") < 0.1);
  }
  const json_t *all = point_of(root, "all", "green", 10);
  const json_t *cubic = point_of(root, "cubic", "green", 10);
  ASSERT_NEAR(number(all, "position_error"), number(cubic, "position_error"), 1e-10);
  assert_true(number(cubic, "target_median_us") == 0);
  assert_true(number(point_of(root, "cubic", "lb", 10), "target_median_us") > 0);
}

// The last row of frames.csv against results.json.
static void check_frames(const json_t *root, const char *csv) {
  const json_t *paths = json_object_get(root, "paths");
  assert_int_equal(json_array_size(paths), 2);
  const size_t frames = (size_t)number(root, "frames");
  const char *row = csv;
  for (const char *at = csv; (at = strchr(at, '\n')) && at[1]; at++) row = at + 1;
  double value[64];
  int count = 0;
  for (char *end; count < 64; count++, row = end + 1) {
    value[count] = strtod(row, &end);
    if (*end != ',') break;
  }
  ASSERT_NEAR(value[0], 20 * 0.02, 1e-9); // time
  double expected[3];                     // weights of lb, green; green apart from lb
  for (size_t i = 0; i < 2; i++) {
    const json_t *run = json_array_get(paths, i);
    const json_t *at = json_array_get(json_object_get(run, "weights_at"), frames - 1);
    assert_int_equal(json_array_size(at), 1);
    expected[i] = json_number_value(json_array_get(at, 0));
    assert_true(expected[i] > 1e-3 && expected[i] < 1); // on the way to its example
  }
  const json_t *first = json_object_get(json_array_get(paths, 0), "apart_at");
  const json_t *apart = json_object_get(json_array_get(paths, 1), "apart_at");
  assert_true(json_number_value(json_array_get(first, frames - 1)) == 0);
  expected[2] = 100 * json_number_value(json_array_get(apart, frames - 1));
  assert_true(expected[2] > 0.01);
  for (int i = 0; i < 3; i++)
    ASSERT_NEAR(value[count - 2 + i], expected[i], 1e-7 * (1 + fabs(expected[i])));
}

static void both_paths_are_measured(void **state) {
  (void)state;
  if (shell("rm -rf paths-cache paths-page") != 0) fail_msg("cannot clean up");
  json_t *root = compare("paths-page", "");
  check_points(root);
  char *csv = text_of("paths-page/frames.csv"), *page = text_of("paths-page/index.html");
  check_frames(root, csv);
  assert_non_null(strstr(csv, "\"weight: green, example 1\""));
  assert_non_null(strstr(page, "Weights of the examples over time"));
  assert_non_null(strstr(page, "green from lb"));
  assert_non_null(strstr(page, "The shapes of path green are at most"));
  // another share of the examples is another result; the interpolation path has none
  json_t *other = compare("paths-page", "--set examples.alpha=0.4");
  assert_true(number(point_of(root, "all", "green", 10), "weight_error") !=
              number(point_of(other, "all", "green", 10), "weight_error"));
  free(csv);
  free(page);
  json_decref(root);
  json_decref(other);
}

// ---- chart -------------------------------------------------------------------------------------

enum { LINES = 4000, ROWS = 64 };
typedef struct segment {
  double x[2], y[2];
} segment;

// The thin lines of the series: neither grid nor frame nor the samples of the legend.
static int series_lines(const char *svg, segment *out) {
  int count = 0;
  for (const char *at = svg; (at = strstr(at, "<line ")) && count < LINES; at++) {
    segment s;
    char color[16];
    double width;
    if (sscanf(at,
               "<line x1=\"%lf\" y1=\"%lf\" x2=\"%lf\" y2=\"%lf\" stroke=\"%15[^\"]\" "
               "stroke-width=\"%lf\"",
               &s.x[0], &s.y[0], &s.x[1], &s.y[1], color, &width) != 6)
      fail_msg("a line of the chart cannot be read: %.80s", at);
    const int legend = s.y[0] == s.y[1] && fabs(s.x[1] - s.x[0] - 22) < 0.02;
    if (width == 1 && strcmp(color, "#dde2e7") != 0 && !legend) out[count++] = s;
  }
  return count;
}

typedef struct row {
  char key[200]; // all but r
  double x, y;
} row;

// method,precision,material,path,r,s,dt,solver,failed, then the numbers of compare.h in order
static int rows_of(const char *csv, row *out) {
  int count = 0;
  for (const char *at = strchr(csv, '\n') + 1; *at && count < ROWS; at = strchr(at, '\n') + 1) {
    char method[32], precision[16], material[32], path[16];
    int r, s;
    double x, y;
    const int read = sscanf(at,
                            "%31[^,],%15[^,],%31[^,],%15[^,],%d,%d,%*[^,],%*[^0-9]0,%*[^,],%*[^,],"
                            "%*[^,],%lf,%*[^,],%*[^,],%lf",
                            method, precision, material, path, &r, &s, &x, &y);
    if (read != 8) fail_msg("a row cannot be read: %.120s", at);
    if (strcmp(method, "cubic") == 0) s = 0; // grows with r along one line
    snprintf(out[count].key, sizeof out->key, "%s %s %s %s %d", method, precision, material, path,
             s);
    out[count].x = log10(x);
    out[count++].y = y > 0 ? log10(100 * y) : NAN;
  }
  return count;
}

// pixel = offset + scale * value from the extremes of both.
static void fit_axis(int n, const double *value, int m, const double *pixels, int flip,
                     double *offset, double *scale) {
  double low = INFINITY, high = -INFINITY, first = INFINITY, last = -INFINITY;
  for (int i = 0; i < n; i++) low = fmin(low, value[i]), high = fmax(high, value[i]);
  for (int i = 0; i < m; i++) first = fmin(first, pixels[i]), last = fmax(last, pixels[i]);
  *scale = (flip ? first - last : last - first) / (high - low);
  *offset = (flip ? last : first) - *scale * low;
}

static void the_table_is_the_chart(void **state) {
  (void)state;
  json_decref(compare("paths-page", ""));
  char *svg = text_of("paths-page/chart.svg"), *csv = text_of("paths-page/results.csv");
  static segment line[LINES];
  static row rows[ROWS];
  const int lines = series_lines(svg, line), count = rows_of(csv, rows);
  segment wanted[ROWS];
  double x[2 * ROWS], y[2 * ROWS], px[2 * LINES], py[2 * LINES];
  int pairs = 0;
  for (int i = 0; i < count; i++)
    for (int j = i + 1; j < count; j++) {
      if (strcmp(rows[i].key, rows[j].key) != 0 || isnan(rows[i].y) || isnan(rows[j].y)) continue;
      wanted[pairs] = (segment){{rows[i].x, rows[j].x}, {rows[i].y, rows[j].y}};
      for (int k = 0; k < 2; k++) {
        x[2 * pairs + k] = wanted[pairs].x[k];
        y[2 * pairs + k] = wanted[pairs].y[k];
      }
      pairs++;
    }
  assert_int_equal(pairs, 2 * 3); // paths; cubature, cubic, all: two r each
  assert_int_equal(lines, pairs);
  for (int i = 0; i < lines; i++)
    for (int k = 0; k < 2; k++) px[2 * i + k] = line[i].x[k], py[2 * i + k] = line[i].y[k];
  double ox, sx, oy, sy;
  fit_axis(2 * pairs, x, 2 * lines, px, 0, &ox, &sx);
  fit_axis(2 * pairs, y, 2 * lines, py, 1, &oy, &sy);
  for (int i = 0; i < pairs; i++) { // pixels are written with two decimals
    double nearest = INFINITY;
    for (int j = 0; j < lines; j++) {
      double worst = 0;
      for (int k = 0; k < 2; k++)
        worst = fmax(worst, fmax(fabs(ox + sx * wanted[i].x[k] - line[j].x[k]),
                                 fabs(oy + sy * wanted[i].y[k] - line[j].y[k])));
      nearest = fmin(nearest, worst);
    }
    if (nearest > 0.03) fail_msg("pair %d of the table is %g pixels from its line", i, nearest);
  }
  free(svg);
  free(csv);
}

// ---- 1,000 steps -------------------------------------------------------------------------------

// Newmark without damping keeps the beam swinging. Round-off of sums in another order, 1e-15 a
// step, times 1,000 steps of an oscillation: linear growth, 1e-12, and ten times that.
static void a_thousand_steps_agree(void **state) {
  (void)state;
  json_t *root = compare(
      "paths-page", "--set simulation.steps=1000 --set simulation.integrator=newmark "
                    "--set 'simulation.damping={mass: 0, stiffness: 0}' "
                    "--set object.material.model=stvk --set 'compare={modes: [10], methods: [all, "
                    "cubic], reference: all, paths: [green], precisions: [double, float]}'");
  size_t i;
  json_t *p;
  int seen[2] = {0};
  json_array_foreach(json_object_get(root, "points"), i, p) {
    if (strcmp(text_at(p, "method"), "cubic") != 0) continue;
    const int floats = strcmp(text_at(p, "precision"), "float") == 0;
    const double error = number(p, "position_error");
    if (!(error < (floats ? 1e-2 : 1e-11))) fail_msg("%s: %g", text_at(p, "precision"), error);
    if (floats) assert_true(error > 1e-9); // not one run compared with itself
    seen[floats] = 1;
  }
  assert_true(seen[0] && seen[1]);
  json_decref(root);
}

// ---- left out ----------------------------------------------------------------------------------

static void the_green_path_leaves_out_the_rest(void **state) {
  (void)state;
  static const char scene[] = EP_SOURCE_DIR "/data/scenes/bar-green-same.yaml";
  if (program("", "plan %s --json -q", scene) != 0) fail_msg("%s", text_of("err.txt"));
  json_t *root = report();
  size_t i;
  json_t *stage;
  int left_out = 0;
  json_array_foreach(json_object_get(root, "stages"), i, stage) {
    const char *name = text_at(stage, "name");
    const bool absent = strncmp(name, "eigen", 5) == 0 || strncmp(name, "map", 3) == 0 ||
                        strcmp(name, "interpolation") == 0;
    const bool present = strcmp(name, "green") == 0 || strcmp(name, "paths") == 0;
    const bool runs = json_is_true(json_object_get(stage, "runs"));
    if ((absent && runs) || (present && !runs)) fail_msg("stage %s", name);
    assert_true(strlen(text_at(stage, "reason")) > 10);
    left_out += absent;
  }
  assert_int_equal(left_out, 4); // the spaces of object and pose, their map, the interpolation
  json_decref(root);
  if (shell("rm -rf green-cache") != 0) fail_msg("cannot clean up");
  if (program("",
              "bake %s -q --cache green-cache --set reduction.modes=8 --set "
              "reduction.elements=10 --set reduction.training_poses=20",
              scene) != 0)
    fail_msg("%s", text_of("err.txt"));
  assert_int_equal(shell("ls green-cache | grep -E '^(eigen|map|cubic-)'"), 1); // none
  assert_int_equal(shell("ls green-cache | grep -c '^green-'"), 0);
  assert_int_equal(shell("cp green-cache/model-*.epm green.epm"), 0);
  char *bytes;
  size_t size;
  ep_error err = {0};
  if (ep_file_read("green.epm", &bytes, &size, &err) != EP_OK) fail_msg("%s", err.text);
  void *aligned = aligned_alloc(64, (size + 63) / 64 * 64);
  memcpy(aligned, bytes, size);
  ep_model model;
  char message[256];
  if (ep_model_open(aligned, size, &model, message) != EP_OK) fail_msg("%s", message);
  assert_int_equal(model.size.m, 0);
  assert_int_equal(model.size.greens, 1);
  free(aligned);
  free(bytes);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(both_paths_are_measured),
      cmocka_unit_test(the_table_is_the_chart),
      cmocka_unit_test(a_thousand_steps_agree),
      cmocka_unit_test(the_green_path_leaves_out_the_rest),
  };
  return cmocka_run_group_tests(tests, write_scene, NULL);
}
