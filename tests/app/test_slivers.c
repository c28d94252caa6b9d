// Claim: a mesh full of slivers (dihedral angles down to 0.05 degree) is baked and run as soundly
// as the same mesh without them; the bake warns and names the worst tets, the same as `check` does.
//
// The slivered bar is the plain one with a vertex put into every seventh tet, close over one face.
// Its finite element space contains that of the plain bar, so by the minimax principle no
// eigenvalue may be larger, and the few vertices more may lower them by little only.
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "box.h"
#include "mesh/io.h"
#include "mesh/quality.h"
#include "program.h"

enum { FUNCTIONS = 10 };

// Puts a vertex over the centroid of the first face of every seventh tet, at about 0.02 to 0.06
// degrees seen from the face's edges, and splits the tet in four.
static ep_mesh with_slivers(const ep_mesh *m) {
  const int extra = (m->nt + 6) / 7, nv = m->nv + extra, nt = m->nt + 3 * extra;
  double *x = malloc(3 * (size_t)nv * sizeof *x);
  int *tet = malloc(4 * (size_t)nt * sizeof *tet), tets = 0, vertices = m->nv;
  assert_true(x && tet);
  memcpy(x, m->x, 3 * (size_t)m->nv * sizeof *x);
  for (int e = 0; e < m->nt; e++) {
    const int *v = m->tet + 4 * e;
    memcpy(tet + 4 * tets, v, 4 * sizeof *tet);
    if (e % 7) {
      tets++;
      continue;
    }
    double *p = x + 3 * vertices;
    for (int k = 0; k < 3; k++) {
      const double face = (x[3 * v[0] + k] + x[3 * v[1] + k] + x[3 * v[2] + k]) / 3;
      p[k] = face + (e % 2 ? 3e-4 : 1e-3) * (x[3 * v[3] + k] - face);
    }
    for (int q = 0; q < 4; q++) {
      memcpy(tet + 4 * tets, v, 4 * sizeof *tet);
      tet[4 * tets++ + q] = vertices;
    }
    vertices++;
  }
  ep_mesh out;
  ep_error err = {0};
  assert_int_equal(ep_mesh_make(vertices, x, tets, tet, "slivers", &out, NULL, &err), EP_OK);
  free(x);
  free(tet);
  return out;
}

// y += 0.4 x^2 of the whole bar.
static void write_bent(const char *path, const ep_mesh *m) {
  ep_mesh bent;
  ep_error err = {0};
  assert_int_equal(ep_mesh_copy(m, &bent, &err), EP_OK);
  for (int v = 0; v < m->nv; v++) bent.x[3 * v + 1] += 0.4 * m->x[3 * v] * m->x[3 * v];
  assert_int_equal(ep_mesh_write_veg(path, &bent, &err), EP_OK);
  ep_mesh_free(&bent);
}

static void write_scene(const char *name) {
  char path[80], text[1200];
  snprintf(path, sizeof path, "%s.yaml", name);
  snprintf(text, sizeof text,
           "schema: 1\nobject: {mesh: %s.veg, material: {density: 1000, young: 2.0e5, poisson: "
           "0.4}}\nfixed: [{box: {low: [-1, -1, -1], high: [0.01, 1, 1]}}]\nfamilies:\n"
           "  - {name: own, poses: [%s-bent.veg]}\n"
           "  - {name: other, rest: other.veg, poses: [other-bent.veg], map: {frame: authored}}\n"
           "reduction: {modes: 15, linear_modes: 8, elements: 60, training_poses: 60}\n"
           "simulation: {steps: 40}\nloads: [{gravity: [0, -9.81, 0]}]\noutput: {formats: []}\n",
           name, name);
  write_text(path, text);
}

static int setup(void **state) {
  (void)state;
  ep_mesh plain, slivered, other;
  ep_error err = {0};
  write_box("plain.veg", 10, 3, 3, 1, 0, 0);
  write_box("other.veg", 12, 4, 4, 1, 0, 0);
  assert_int_equal(ep_mesh_read("plain.veg", &plain, NULL, NULL, &err), EP_OK);
  assert_int_equal(ep_mesh_read("other.veg", &other, NULL, NULL, &err), EP_OK);
  slivered = with_slivers(&plain);
  assert_int_equal(ep_mesh_write_veg("slivers.veg", &slivered, &err), EP_OK);
  write_bent("plain-bent.veg", &plain);
  write_bent("slivers-bent.veg", &slivered);
  write_bent("other-bent.veg", &other);
  write_scene("plain");
  write_scene("slivers");
  ep_mesh_free(&plain);
  ep_mesh_free(&slivered);
  ep_mesh_free(&other);
  return shell("rm -rf cache out");
}

static void the_mesh_is_as_bad_as_said(void **state) {
  (void)state;
  assert_int_equal(program("", "check slivers.veg --json"), 0);
  json_t *root = report();
  const json_t *mesh = json_array_get(json_object_get(root, "meshes"), 0);
  const json_t *quality = json_object_get(mesh, "quality");
  assert_true(number(quality, "smallest_angle") < 0.1);
  assert_true(number(quality, "slivers") >= 70);
  json_decref(root);
}

static void eigenvalues_hold(void **state) {
  (void)state;
  double value[2][FUNCTIONS];
  for (int k = 0; k < 2; k++) {
    assert_int_equal(
        program("", "eigen %s.veg --count %d --json", k ? "slivers" : "plain", FUNCTIONS), 0);
    json_t *root = report();
    for (size_t i = 0; i < FUNCTIONS; i++)
      value[k][i] = json_number_value(json_array_get(json_object_get(root, "eigenvalues"), i));
    json_decref(root);
  }
  for (int i = 0; i < FUNCTIONS; i++) {
    // 1e-9: residuals of the eigensolver; 1e-3: a vertex in every seventh tet is no real
    // refinement.
    assert_true(value[1][i] <= value[0][i] * (1 + 1e-9));
    assert_true(value[1][i] >= value[0][i] * (1 - 1e-3));
  }
}

// The warning of the bake names the tets that `check` calls the worst.
static void the_bake_warns_and_names_them(void **state) {
  (void)state;
  assert_int_equal(program("", "check slivers.veg --json"), 0);
  json_t *root = report();
  const char *message = NULL;
  size_t i;
  const json_t *f;
  json_array_foreach(json_object_get(root, "findings"), i, f) {
    if (strcmp(json_string_value(json_object_get(f, "code")), "slivers") == 0)
      message = json_string_value(json_object_get(f, "message"));
  }
  assert_non_null(message);
  const char *worst = strstr(message, "worst: tet ");
  assert_non_null(worst);
  char named[200];
  snprintf(named, sizeof named, "%.*s", (int)(strstr(worst, "; the first") - worst), worst);
  assert_int_equal(program("", "bake slivers.yaml --json --cache cache"), 0);
  char *said = text_of("err.txt");
  if (!strstr(said, named)) fail_msg("'%s' is not in: %s", named, said);
  free(said);
  json_decref(root);
}

// No pose keeps an inverted or crushed tet, not even of the flat ones; the one that comes from
// another mesh meets its low coefficients as it does on a good mesh (some percent: the repair and
// the fixed vertices).
static void poses_are_sound(void **state) {
  (void)state;
  assert_int_equal(program("", "bake slivers.yaml --json --cache cache"), 0);
  json_t *root = report();
  const json_t *examples = json_object_get(root, "examples");
  assert_int_equal(json_array_size(examples), 2);
  for (size_t i = 0; i < 2; i++) {
    const json_t *e = json_array_get(examples, i);
    assert_true(number(e, "inverted_tets") == 0 && number(e, "crushed_tets") == 0);
    assert_true(number(e, "coefficient_error") < 0.03);
    assert_true(number(e, "repair_moved_most") < 0.01);
  }
  json_decref(root);
}

static void cubature_and_steps_are_sound(void **state) {
  (void)state;
  double held_out[2], fraction[2];
  for (int k = 0; k < 2; k++) {
    assert_int_equal(
        program("", "run %s.yaml --json --cache cache --out out", k ? "slivers" : "plain"), 0);
    json_t *root = report();
    held_out[k] = number(json_object_get(root, "cubature_error"), "held_out");
    fraction[k] = number(root, "example_fraction");
    assert_true(number(root, "steps_done") == 40 && number(root, "halved_steps") == 0);
    assert_true(number(root, "inverted_tets") == 0);
    json_decref(root);
  }
  // The same motion to a few percent: both are reduced models of one bar, with elements of their
  // own (60: with 40 what the cubature leaves is itself 4 to 7 % here, with 120 it is 1 %).
  assert_true(fabs(fraction[0]) > 0.3);
  assert_true(fabs(fraction[1] - fraction[0]) < 0.05 * fabs(fraction[0]));
  assert_true(held_out[1] < 0.06 && held_out[1] < 2 * held_out[0] + 0.01);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(the_mesh_is_as_bad_as_said),    cmocka_unit_test(eigenvalues_hold),
      cmocka_unit_test(the_bake_warns_and_names_them), cmocka_unit_test(poses_are_sound),
      cmocka_unit_test(cubature_and_steps_are_sound),
  };
  return cmocka_run_group_tests(tests, setup, NULL);
}
