// Writers. Numbers go out with a point whatever the locale, and the same mesh gives the same bytes.
#include <inttypes.h>
#include <stdint.h>
#include <string.h>

#include "base/escape.h"
#include "base/files.h"
#include "mesh/io.h"
#include "mesh/scan.h"

enum { VTK_TETRA = 10, BUFFER = 4096 };

// Runs `body` on a file of that name in the C locale; commits or removes it.
typedef ep_status write_body(FILE *file, const void *what, ep_error *err);

static ep_status write_file(const char *path, write_body *body, const void *what, ep_error *err) {
  ep_c_locale locale;
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  ep_status status = ep_c_locale_enter(&locale, err);
  if (status == EP_OK) {
    status = body(out.file, what, err);
    ep_c_locale_leave(&locale);
  }
  if (status == EP_OK) return ep_output_commit(&out, err);
  ep_output_discard(&out);
  return status;
}

// --- .veg

static void write_set(FILE *file, const ep_mesh *mesh, int material) {
  fprintf(file, "\n*SET S%d\n", material + 1);
  for (int e = 0, n = 0; e < mesh->nt; e++)
    if (mesh->tet_material[e] == material)
      fprintf(file, "%d%s", e + 1, ++n % 12 == 0 ? ",\n" : ", ");
  fprintf(file, "\n");
}

static void write_materials(FILE *file, const ep_mesh *mesh) {
  for (int i = 0; i < mesh->nmaterials; i++) {
    const ep_elastic *m = mesh->material + i;
    fprintf(file, "\n*MATERIAL M%d\nENU, %.17g, %.17g, %.17g\n", i + 1, m->density, m->young,
            m->poisson);
  }
  for (int i = 0; i < mesh->nmaterials && mesh->nmaterials > 1; i++) write_set(file, mesh, i);
  for (int i = 0; i < mesh->nmaterials; i++)
    if (mesh->nmaterials == 1)
      fprintf(file, "\n*REGION\nallElements, M1\n");
    else
      fprintf(file, "\n*REGION\nS%d, M%d\n", i + 1, i + 1);
}

static ep_status write_veg(FILE *file, const void *what, ep_error *err) {
  (void)err;
  const ep_mesh *mesh = what;
  fprintf(file, "*VERTICES\n%d 3 0 0\n", mesh->nv);
  for (int i = 0; i < mesh->nv; i++) {
    const double *x = mesh->x + 3 * i;
    fprintf(file, "%d %.17g %.17g %.17g\n", i + 1, x[0], x[1], x[2]);
  }
  fprintf(file, "\n*ELEMENTS\nTET\n%d 4 0\n", mesh->nt);
  for (int e = 0; e < mesh->nt; e++) {
    const int *v = mesh->tet + 4 * e;
    fprintf(file, "%d %d %d %d %d\n", e + 1, v[0] + 1, v[1] + 1, v[2] + 1, v[3] + 1);
  }
  write_materials(file, mesh);
  return EP_OK;
}

ep_status ep_mesh_write_veg(const char *path, const ep_mesh *mesh, ep_error *err) {
  return write_file(path, write_veg, mesh, err);
}

// --- .vtu: XML header, then the arrays as raw bytes, each after its length as UInt64. Offsets
// count from the byte behind the underscore.

typedef struct vtu {
  const ep_mesh *mesh;
  const double *x;
  int npoint, ncell;
  const ep_field *point, *cell;
} vtu;

static void declare(FILE *file, const char *type, const char *name, int components, uint64_t bytes,
                    uint64_t *offset) {
  fprintf(file, "        <DataArray type=\"%s\" Name=\"", type);
  ep_write_escaped(file, name);
  fprintf(file, "\" NumberOfComponents=\"%d\" format=\"appended\" offset=\"%" PRIu64 "\"/>\n",
          components, *offset);
  *offset += sizeof(uint64_t) + bytes;
}

static uint64_t field_bytes(const ep_field *field, int rows) {
  return (uint64_t)rows * (uint64_t)field->components * sizeof(double);
}

static void declare_fields(FILE *file, const char *tag, int count, const ep_field *field, int rows,
                           uint64_t *offset) {
  fprintf(file, "      <%s>\n", tag);
  for (int i = 0; i < count; i++)
    declare(file, "Float64", field[i].name, field[i].components, field_bytes(field + i, rows),
            offset);
  fprintf(file, "      </%s>\n", tag);
}

static void declare_all(FILE *file, const vtu *w) {
  const uint64_t nv = (uint64_t)w->mesh->nv, nt = (uint64_t)w->mesh->nt;
  uint64_t offset = 0;
  fprintf(file,
          "<?xml version=\"1.0\"?>\n"
          "<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"%s\" "
          "header_type=\"UInt64\">\n"
          "  <UnstructuredGrid>\n"
          "    <Piece NumberOfPoints=\"%d\" NumberOfCells=\"%d\">\n",
          ep_machine_big_endian() ? "BigEndian" : "LittleEndian", w->mesh->nv, w->mesh->nt);
  declare_fields(file, "PointData", w->npoint, w->point, w->mesh->nv, &offset);
  declare_fields(file, "CellData", w->ncell, w->cell, w->mesh->nt, &offset);
  fprintf(file, "      <Points>\n");
  declare(file, "Float64", "Points", 3, 3 * nv * sizeof(double), &offset);
  fprintf(file, "      </Points>\n      <Cells>\n");
  declare(file, "Int32", "connectivity", 1, 4 * nt * sizeof(int32_t), &offset);
  declare(file, "Int32", "offsets", 1, nt * sizeof(int32_t), &offset);
  declare(file, "UInt8", "types", 1, nt, &offset);
  fprintf(file, "      </Cells>\n    </Piece>\n  </UnstructuredGrid>\n"
                "  <AppendedData encoding=\"raw\">\n_");
}

static void append(FILE *file, const void *data, uint64_t bytes) {
  fwrite(&bytes, sizeof bytes, 1, file);
  fwrite(data, 1, (size_t)bytes, file);
}

static void append_offsets(FILE *file, int nt) {
  const uint64_t bytes = (uint64_t)nt * sizeof(int32_t);
  int32_t buffer[BUFFER];
  fwrite(&bytes, sizeof bytes, 1, file);
  for (int e = 0, n = 0; e < nt; e++) {
    buffer[n++] = 4 * (e + 1);
    if (n < BUFFER && e + 1 < nt) continue;
    fwrite(buffer, sizeof *buffer, (size_t)n, file);
    n = 0;
  }
}

static void append_types(FILE *file, int nt) {
  const uint64_t bytes = (uint64_t)nt;
  fwrite(&bytes, sizeof bytes, 1, file);
  for (int e = 0; e < nt; e++) fputc(VTK_TETRA, file);
}

static ep_status write_vtu(FILE *file, const void *what, ep_error *err) {
  (void)err;
  const vtu *w = what;
  const ep_mesh *mesh = w->mesh;
  _Static_assert(sizeof(int) == sizeof(int32_t), "connectivity is written as Int32");
  declare_all(file, w);
  for (int i = 0; i < w->npoint; i++)
    append(file, w->point[i].data, field_bytes(w->point + i, mesh->nv));
  for (int i = 0; i < w->ncell; i++)
    append(file, w->cell[i].data, field_bytes(w->cell + i, mesh->nt));
  append(file, w->x ? w->x : mesh->x, 3 * (uint64_t)mesh->nv * sizeof(double));
  append(file, mesh->tet, 4 * (uint64_t)mesh->nt * sizeof(int32_t));
  append_offsets(file, mesh->nt);
  append_types(file, mesh->nt);
  fprintf(file, "\n  </AppendedData>\n</VTKFile>\n");
  return EP_OK;
}

static ep_status check_fields(const char *path, int count, const ep_field *field, ep_error *err) {
  for (int i = 0; i < count; i++)
    if (!field[i].name || !field[i].data || (field[i].components != 1 && field[i].components != 3))
      return ep_fail(err, EP_ERR_ARGUMENT,
                     "%s: field %s needs a name, data and 1 or 3 components, not %d", path,
                     field[i].name ? field[i].name : "(unnamed)", field[i].components);
  return EP_OK;
}

ep_status ep_mesh_write_vtu(const char *path, const ep_mesh *mesh, const double *x, int npoint,
                            const ep_field *point, int ncell, const ep_field *cell, ep_error *err) {
  const vtu what = {mesh, x, npoint, ncell, point, cell};
  EP_TRY(check_fields(path, npoint, point, err));
  EP_TRY(check_fields(path, ncell, cell, err));
  return write_file(path, write_vtu, &what, err);
}

// --- .pvd

typedef struct pvd {
  int count;
  const double *time;
  const char *const *files;
} pvd;

static ep_status write_pvd(FILE *file, const void *what, ep_error *err) {
  (void)err;
  const pvd *w = what;
  fprintf(file, "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\" "
                "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n  <Collection>\n");
  for (int i = 0; i < w->count; i++) {
    fprintf(file, "    <DataSet timestep=\"%.12g\" group=\"\" part=\"0\" file=\"", w->time[i]);
    ep_write_escaped(file, w->files[i]);
    fprintf(file, "\"/>\n");
  }
  fprintf(file, "  </Collection>\n</VTKFile>\n");
  return EP_OK;
}

ep_status ep_mesh_write_pvd(const char *path, int count, const double *time,
                            const char *const *files, ep_error *err) {
  const pvd what = {count, time, files};
  return write_file(path, write_pvd, &what, err);
}
