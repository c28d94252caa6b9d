// Lists of vertices for meshes: the first byte gives the number of shapes (and with its highest bit
// unused vertices), the rest is read as a regions file and as a list of a selection.
#include <string.h>

#include "align/align.h"
#include "app/scene/select.h"
#include "tests/fuzz/target.h"

// A box of 8 vertices and 6 tets; with `gap` file numbers 2, 4, .., so that every other is unused.
static ep_mesh box(double *x, int *tet, int *file_vertex, bool gap) {
  static const int kuhn[24] = {0, 1, 3, 7, 0, 3, 2, 7, 0, 2, 6, 7,
                               0, 6, 4, 7, 0, 4, 5, 7, 0, 5, 1, 7};
  for (int i = 0; i < 8; i++) {
    for (int k = 0; k < 3; k++) x[3 * i + k] = (i >> k) & 1;
    file_vertex[i] = gap ? 2 * i + 1 : i;
  }
  memcpy(tet, kuhn, sizeof kuhn);
  return (ep_mesh){.nv = 8,
                   .nt = 6,
                   .x = x,
                   .tet = tet,
                   .file_vertex = file_vertex,
                   .file_vertices = gap ? 16 : 8,
                   .name = "box"};
}

static bool regions_hold(const char *text, int shapes, const ep_mesh *mesh) {
  const ep_mesh *meshes[4] = {mesh, mesh, mesh, mesh};
  ep_regions regions;
  ep_error err = {0};
  const ep_status status = ep_regions_parse("input", text, shapes, meshes, &regions, &err);
  if (status != EP_OK) {
    must(err.status == status && err.text[0], "an error has a text");
    must(!regions.start && !regions.vertex, "no regions after an error");
    return false;
  }
  must(regions.count >= 1 && regions.shapes == shapes, "counts");
  for (int i = 0; i < regions.count * shapes; i++) {
    must(regions.start[i] < regions.start[i + 1], "no region is empty");
    for (int j = regions.start[i]; j < regions.start[i + 1]; j++)
      must(regions.vertex[j] >= 0 && regions.vertex[j] < mesh->nv, "vertices in range");
  }
  ep_regions_free(&regions);
  return true;
}

static bool selection_holds(const char *text, const ep_mesh *mesh) {
  unsigned char chosen[8] = {0};
  int count = -1, marked = 0;
  ep_error err = {0};
  const ep_status status = ep_select_parse("input", text, mesh, chosen, &count, &err);
  for (int i = 0; i < 8; i++) marked += chosen[i];
  must(status == EP_OK ? marked == count : marked == 0, "marks are those counted");
  must(status == EP_OK || err.text[0], "an error has a text");
  return status == EP_OK;
}

bool fuzz_target(const uint8_t *data, size_t size) {
  double x[24];
  int tet[24], file_vertex[8];
  if (size == 0) return false;
  char *text = malloc(size);
  must(text != NULL, "memory");
  memcpy(text, data + 1, size - 1);
  text[size - 1] = '\0';
  const ep_mesh mesh = box(x, tet, file_vertex, data[0] & 0x40);
  const bool regions = regions_hold(text, 1 + data[0] % 4, &mesh);
  const bool selection = selection_holds(text, &mesh);
  free(text);
  return regions || selection;
}
