// Small meshes with known volumes, for the tests of this folder.
#ifndef EP_TESTS_MESH_SHAPES_H
#define EP_TESTS_MESH_SHAPES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
// clang-format off
#include <cmocka.h>
// clang-format on
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "mesh/mesh.h"

// The unit cube in six tets along its diagonal 0-7 (Kuhn); vertex i at the bits of i.
static const double cube_x[24] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0,
                                  0, 0, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1};
static const int cube_tet[24] = {0, 1, 3, 7, 0, 3, 2, 7, 0, 2, 6, 7,
                                 0, 6, 4, 7, 0, 4, 5, 7, 0, 5, 1, 7};

static inline void assert_ok(ep_status status, const ep_error *err) {
  if (status != EP_OK) fail_msg("%s", err->text);
}

static inline void assert_says(const ep_error *err, const char *text) {
  if (!strstr(err->text, text)) fail_msg("'%s' does not say '%s'", err->text, text);
}

static inline ep_mesh make_cube(ep_mesh_findings *findings) {
  ep_mesh mesh;
  ep_error err = {0};
  assert_ok(ep_mesh_make(8, cube_x, 6, cube_tet, "cube", &mesh, findings, &err), &err);
  return mesh;
}

#endif
