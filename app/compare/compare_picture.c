// What the reference run looks like.
#include <stdlib.h>
#include <string.h>

#include "app/compare/compare.h"
#include "base/files.h"
#include "results/picture.h"

enum { MOMENTS = 6, LABEL = 32 };

ep_status ep_compare_picture(const char *path, const char *title, const ep_mesh *mesh,
                             const ep_frames *frames, ep_error *err) {
  const size_t n3 = frames->n3;
  char label[MOMENTS][LABEL];
  ep_drawing drawing[MOMENTS];
  ep_panel panel[MOMENTS];
  int triangles, *triangle = NULL;
  double *x = malloc(MOMENTS * n3 * sizeof *x);
  if (!x) return ep_fail(err, EP_ERR_MEMORY, "no memory for the picture of the reference");
  ep_status status = ep_mesh_surface(mesh, &triangles, &triangle, err);
  for (int i = 0; i < MOMENTS && status == EP_OK; i++) {
    const int frame = i * frames->count / (MOMENTS - 1) - 1; // -1: at rest
    double *at = x + (size_t)i * n3;
    memcpy(at, mesh->x, n3 * sizeof *at);
    for (size_t j = 0; j < n3 && frame >= 0; j++) at[j] += frames->x[(size_t)frame * n3 + j];
    snprintf(label[i], LABEL, "t = %.2f s", (frame + 1) * frames->interval);
    drawing[i] = ep_default_drawing(mesh->nv, at, triangles, triangle);
    panel[i] = (ep_panel){.drawings = 1, .drawing = &drawing[i], .label = label[i]};
  }
  if (status == EP_OK) {
    ep_view view = ep_default_view();
    view.shared = true;
    view.columns = MOMENTS / 2;
    view.title = title;
    status = ep_picture_write(path, &view, MOMENTS, panel, err);
  }
  free(triangle);
  free(x);
  return status;
}
