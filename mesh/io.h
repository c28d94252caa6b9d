// Mesh files: readers for .veg, .msh (2.2, 4.1; ASCII, binary), .vtk (legacy 4.2, 5.1; ASCII,
// binary), .vtu (text, base64, raw; zlib), .mesh (Medit), .node/.ele (TetGen); writers .veg, .vtu,
// .pvd. Scalars on the vertices of .vtk and .vtu are kept in the mesh.
#ifndef EP_MESH_IO_H
#define EP_MESH_IO_H

#include <stddef.h>

#include "mesh/mesh.h"

// Read by the file's extension. Both index bases and both orientations are accepted.
//   findings and log may be NULL; findings are said on log.
// Errors: EP_ERR_IO, EP_ERR_FORMAT with file and line (or byte offset), EP_ERR_MESH.
ep_status ep_mesh_read(const char *path, ep_mesh *out, ep_mesh_findings *findings, ep_log *log,
                       ep_error *err);

// The readers proper work on bytes in memory (fuzzed). `folder` is where *INCLUDE and the .node of
// an .ele (the bytes, named `name`) are looked up; NULL: nothing but the bytes is looked at, and
// TetGen's are the .node followed by the .ele.
typedef enum ep_mesh_format {
  EP_MESH_VEG,
  EP_MESH_MSH,
  EP_MESH_VTK,
  EP_MESH_MEDIT,
  EP_MESH_TETGEN,
  EP_MESH_VTU,
  EP_MESH_FORMATS
} ep_mesh_format;
ep_status ep_mesh_parse(ep_mesh_format format, const char *name, const char *bytes, size_t size,
                        const char *folder, ep_mesh *out, ep_mesh_findings *findings,
                        ep_error *err);

ep_status ep_mesh_write_veg(const char *path, const ep_mesh *mesh, ep_error *err);

// A named array on vertices or tets for .vtu files.
typedef struct ep_field {
  const char *name;
  int components;     // 1 or 3
  const double *data; // (nv x components) or (nt x components)
} ep_field;
// Positions x (nv x 3) or NULL for rest. Binary (appended raw or base64), deterministic bytes.
ep_status ep_mesh_write_vtu(const char *path, const ep_mesh *mesh, const double *x, int npoint,
                            const ep_field *point, int ncell, const ep_field *cell, ep_error *err);
// A ParaView collection: count time steps and file names (relative to the .pvd).
ep_status ep_mesh_write_pvd(const char *path, int count, const double *time,
                            const char *const *files, ep_error *err);

#endif
