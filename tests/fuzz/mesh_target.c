// Mesh files: the first byte chooses the format, the rest is the file.
#include <math.h>

#include "mesh/io.h"
#include "tests/fuzz/target.h"

static void check_mesh(const ep_mesh *m, const ep_mesh_findings *f) {
  must(m->nv > 0 && m->nt > 0, "not empty");
  must(f->components >= 1 && f->components <= m->nt, "components");
  for (int i = 0; i < 4 * m->nt; i++) must(m->tet[i] >= 0 && m->tet[i] < m->nv, "indices");
  for (int i = 0; i < m->nv; i++) {
    const int place = m->file_vertex[i];
    must(place >= 0 && place < m->file_vertices, "file_vertex in range");
    must(i == 0 || place > m->file_vertex[i - 1], "file_vertex ascends");
    must(ep_mesh_from_file_vertex(m, place) == i, "file_vertex found");
  }
  for (int e = 0; m->tet_material && e < m->nt; e++)
    must(m->tet_material[e] >= 0 && m->tet_material[e] < m->nmaterials, "materials");
  for (int i = 0; i < m->ndata; i++) {
    const ep_point_data *data = &m->data[i];
    must(data->name && (data->components == 1) == (data->value != NULL), "scalars have values");
    double sum = 0;
    for (int k = 0; data->value && k < m->nv; k++) sum += data->value[k]; // a sanitizer looks
    must(sum == sum || isnan(sum), "values");
  }
  must(ep_mesh_volume(m) >= 0, "volume");
}

bool fuzz_target(const uint8_t *data, size_t size) {
  if (size == 0) return false;
  ep_mesh m;
  ep_mesh_findings f;
  ep_error err = {0};
  const ep_mesh_format format = (ep_mesh_format)(data[0] % EP_MESH_FORMATS);
  const ep_status status =
      ep_mesh_parse(format, "input", (const char *)data + 1, size - 1, NULL, &m, &f, &err);
  if (status != EP_OK) {
    must(err.status == status && err.text[0], "an error has a text");
    must(!m.x && !m.tet, "no mesh after an error");
    return false;
  }
  check_mesh(&m, &f);
  int count, *triangle;
  if (ep_mesh_surface(&m, &count, &triangle, &err) == EP_OK) free(triangle);
  ep_mesh_free(&m);
  return true;
}
