#include "mesh/io.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "base/files.h"
#include "mesh/readers.h"

static ep_status run_reader(ep_mesh_format format, ep_raw_mesh *raw, ep_scan scan,
                            const char *folder, ep_error *err) {
  switch (format) {
  case EP_MESH_VEG:
    return ep_read_veg(raw, scan, folder, err);
  case EP_MESH_MSH:
    return ep_read_msh(raw, scan, err);
  case EP_MESH_VTK:
    return ep_read_vtk(raw, scan, err);
  case EP_MESH_MEDIT:
    return ep_read_medit(raw, scan, err);
  case EP_MESH_TETGEN:
    return ep_read_tetgen(raw, scan, folder, err);
  case EP_MESH_VTU:
    return ep_read_vtu(raw, scan, err);
  case EP_MESH_FORMATS:
    break;
  }
  return ep_fail(err, EP_ERR_ARGUMENT, "%s: no such mesh format: %d", raw->name, (int)format);
}

ep_status ep_mesh_parse(ep_mesh_format format, const char *name, const char *bytes, size_t size,
                        const char *folder, ep_mesh *out, ep_mesh_findings *findings,
                        ep_error *err) {
  memset(out, 0, sizeof *out);
  ep_scan scan = ep_scan_open(name, bytes, size, 0);
  if (ep_scan_peek(&scan).length == 0) return ep_fail(err, EP_ERR_FORMAT, "%s: empty file", name);
  ep_c_locale locale;
  EP_TRY(ep_c_locale_enter(&locale, err));
  ep_raw_mesh raw = {.name = name};
  ep_status status = run_reader(format, &raw, scan, folder, err);
  ep_c_locale_leave(&locale);
  if (status == EP_OK) return ep_raw_finish(&raw, out, findings, err);
  ep_raw_free(&raw);
  return status;
}

static ep_mesh_format format_of(const char *path) {
  static const struct {
    const char *extension;
    ep_mesh_format format;
  } known[] = {{"veg", EP_MESH_VEG},   {"msh", EP_MESH_MSH},    {"vtk", EP_MESH_VTK},
               {"vtu", EP_MESH_VTU},   {"mesh", EP_MESH_MEDIT}, {"node", EP_MESH_TETGEN},
               {"ele", EP_MESH_TETGEN}};
  const char *extension = ep_path_extension(path);
  for (size_t i = 0; i < sizeof known / sizeof *known; i++)
    if (strcasecmp(extension, known[i].extension) == 0) return known[i].format;
  return EP_MESH_FORMATS;
}

// TetGen: the .ele is read, whichever of the two was named.
static ep_status path_to_read(const char *path, char *out, ep_error *err) {
  if (snprintf(out, EP_PATH_MAX, "%s", path) >= EP_PATH_MAX)
    return ep_fail(err, EP_ERR_IO, "path too long: %s", path);
  const char *extension = ep_path_extension(path);
  if (strcasecmp(extension, "node") != 0) return EP_OK;
  return snprintf(out, EP_PATH_MAX, "%.*sele", (int)(extension - path), path) < EP_PATH_MAX
             ? EP_OK
             : ep_fail(err, EP_ERR_IO, "path too long: %s", path);
}

ep_status ep_mesh_read(const char *path, ep_mesh *out, ep_mesh_findings *findings, ep_log *log,
                       ep_error *err) {
  memset(out, 0, sizeof *out);
  const ep_mesh_format format = format_of(path);
  if (format == EP_MESH_FORMATS)
    return ep_fail(err, EP_ERR_FORMAT,
                   "%s: mesh files end in .veg, .msh, .vtk, .vtu, .mesh, .node or .ele", path);
  char file[EP_PATH_MAX], folder[EP_PATH_MAX];
  EP_TRY(path_to_read(path, file, err));
  EP_TRY(ep_path_folder(file, folder, err));
  char *bytes;
  size_t size;
  EP_TRY(ep_file_read(file, &bytes, &size, err));
  ep_mesh_findings found;
  const ep_status status = ep_mesh_parse(format, file, bytes, size, folder, out, &found, err);
  free(bytes);
  if (status != EP_OK) return status;
  ep_mesh_report(out, &found, log);
  if (findings) *findings = found;
  return EP_OK;
}
