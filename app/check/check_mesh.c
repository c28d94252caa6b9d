// A mesh by itself: what reading found, slivers, faces, surface, parts, size.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/check/check.h"
#include "mesh/io.h"
#include "mesh/raw.h"

void ep_check_free(ep_check *check) {
  for (int i = 0; i < check->nmeshes; i++) ep_mesh_free(&check->mesh[i].mesh);
  free(check->mesh);
  free(check->found);
  memset(check, 0, sizeof *check);
}

int ep_check_count(const ep_check *check, ep_severity severity) {
  int count = 0;
  for (int i = 0; i < check->nfound; i++) count += check->found[i].severity == severity;
  return count;
}

ep_status ep_check_add(ep_check *check, ep_severity severity, const char *code, const char *file,
                       bool repairable, ep_error *err, const char *format, ...) {
  void *list = check->found;
  const ep_status status =
      ep_grow(&list, &check->room_found, check->nfound + 1, sizeof *check->found, file, err);
  check->found = list;
  if (status != EP_OK) return status;
  ep_found *f = &check->found[check->nfound++];
  *f = (ep_found){.severity = severity, .code = code, .repairable = repairable};
  snprintf(f->file, sizeof f->file, "%s", file);
  va_list args;
  va_start(args, format);
  vsnprintf(f->text, sizeof f->text, format, args);
  va_end(args);
  return EP_OK;
}

// ---- findings ----------------------------------------------------------------------------------

#define ADD(severity, code, repairable, ...)                                                       \
  EP_TRY(ep_check_add(check, severity, code, m->file, repairable, err, __VA_ARGS__))

static void center_of(const ep_mesh *mesh, int e, double c[3]) {
  for (int k = 0; k < 3; k++) {
    c[k] = 0;
    for (int i = 0; i < 4; i++)
      c[k] += 0.25 * mesh->x[3 * (size_t)mesh->tet[4 * (size_t)e + (size_t)i] + (size_t)k];
  }
}

static ep_status add_reading(ep_check *check, const ep_checked_mesh *m, ep_error *err) {
  const ep_mesh_findings *f = &m->findings;
  if (f->degenerate_tets)
    ADD(EP_FOUND_ERROR, "degenerate-tets", true,
        "%d tets have no volume (first: tet %d); --repair leaves them out, better is to mesh anew",
        f->degenerate_tets, f->first_degenerate + 1);
  if (f->repaired_orientation)
    ADD(EP_FOUND_WARNING, "inverted-tets", true,
        "%d tets are inverted (first: tet %d); they are turned round on reading", //
        f->repaired_orientation, f->first_inverted + 1);
  if (f->repeated_tets)
    ADD(EP_FOUND_WARNING, "repeated-tets", true,
        "%d tets occur more than once (first: tet %d); each is counted once", f->repeated_tets,
        f->first_repeated + 1);
  if (f->unused_vertices)
    ADD(EP_FOUND_NOTE, "unused-vertices", true,
        "%d vertices belong to no tet (first: vertex %d); they are left out", f->unused_vertices,
        f->first_unused + 1);
  if (f->dropped_cells)
    ADD(EP_FOUND_NOTE, "other-cells", true,
        "%d cells are not tets (triangles of the surface, mostly); they are left out",
        f->dropped_cells);
  if (f->unread_arrays)
    ADD(EP_FOUND_NOTE, "unread-array", false,
        "array '%s' on the vertices is no numbers and was not read", f->first_unread_array);
  return EP_OK;
}

static ep_status add_duplicates(ep_check *check, const ep_checked_mesh *m, ep_error *err) {
  const ep_mesh *mesh = &m->mesh;
  int *first = malloc((size_t)mesh->nv * sizeof *first), count = 0;
  if (!first) return ep_fail(err, EP_ERR_MEMORY, "no memory to check %s", m->file);
  ep_status status = ep_mesh_same_places(mesh, first, &count, err);
  for (int v = 0; v < mesh->nv && status == EP_OK && count; v++) {
    if (first[v] == v) continue;
    status = ep_check_add(check, EP_FOUND_WARNING, "duplicate-vertices", m->file, true, err,
                          "%d vertices stand where another does (first: vertex %d, where %d is); "
                          "tets that only touch "
                          "there are not joined; --repair joins them",
                          count, mesh->file_vertex[v] + 1, mesh->file_vertex[first[v]] + 1);
    break;
  }
  free(first);
  return status;
}

static ep_status add_parts(ep_check *check, const ep_checked_mesh *m, ep_error *err) {
  const ep_mesh *mesh = &m->mesh;
  if (m->findings.components == 1) return EP_OK;
  int *part = malloc(2 * (size_t)mesh->nt * sizeof *part), parts = 0;
  if (!part) return ep_fail(err, EP_ERR_MEMORY, "no memory to check %s", m->file);
  const int *size = part + mesh->nt;
  ep_status status = ep_mesh_parts(mesh, part, part + mesh->nt, &parts, err);
  int other = 0;
  while (status == EP_OK && other < mesh->nt - 1 && part[other] != 1) other++;
  double c[3];
  center_of(mesh, other, c);
  if (status == EP_OK)
    status = ep_check_add(
        check, EP_FOUND_ERROR, "islands", m->file, false, err,
        "%d separate parts: the largest has %d of %d tets, the next %d (near %.4g %.4g %.4g); join "
        "them, or keep the largest with --repair OUT --largest",
        parts, size[0], mesh->nt, size[1], c[0], c[1], c[2]);
  free(part);
  return status;
}

static ep_status add_topology(ep_check *check, const ep_checked_mesh *m, ep_error *err) {
  const ep_mesh_topology *t = &m->topology;
  const int *number = m->mesh.file_vertex;
  if (t->overlapping_faces)
    ADD(EP_FOUND_ERROR, "overlapping-tets", false,
        "%d faces have two tets on the same side (first: tets %d and %d): the tets lie in each "
        "other; mesh anew, or take one of each pair out",
        t->overlapping_faces, t->overlap_first + 1, t->overlap_second + 1);
  if (t->open_edges)
    ADD(EP_FOUND_WARNING, "surface-edges", false,
        "the surface is no manifold at %d edges (first: vertices %d and %d): tets meet by the "
        "edge only: a hinge, or parts of the surface grown together",
        t->open_edges, number[t->open_edge[0]] + 1, number[t->open_edge[1]] + 1);
  if (t->pinched_vertices)
    ADD(EP_FOUND_WARNING, "surface-vertices", false,
        "the surface touches itself in %d vertices (first: vertex %d): tets meet by the "
        "vertex only: a joint, or parts of the surface grown together",
        t->pinched_vertices, number[t->first_pinched] + 1);
  return EP_OK;
}

static ep_status add_shape(ep_check *check, const ep_checked_mesh *m, ep_error *err) {
  char worst[300];
  double c[3];
  const ep_mesh_quality *q = &m->quality;
  const double diagonal = ep_mesh_diagonal(&m->mesh);
  if (q->slivers) {
    ep_mesh_worst_text(q, worst, sizeof worst);
    center_of(&m->mesh, q->worst[0], c);
    ADD(EP_FOUND_WARNING, "slivers", false,
        "%d tets have dihedral angles within %g degree of 0 or 180; worst: %s; the first near %.4g "
        "%.4g %.4g; let the mesher optimise its quality",
        q->slivers, EP_SLIVER_DEGREES, worst, c[0], c[1], c[2]);
  }
  if (diagonal > 50 || diagonal < 2e-3)
    ADD(EP_FOUND_NOTE, "scale", false,
        "%.4g from corner to corner: meters, if the scene is in SI units; %s", diagonal,
        diagonal > 50 ? "millimeters or centimeters are likelier: scale the mesh by 0.001 or 0.01"
                      : "is it in kilometers or without units?");
  return EP_OK;
}

// ---- one mesh ----------------------------------------------------------------------------------

static ep_status new_mesh(ep_check *check, const char *file, ep_checked_mesh **out, ep_error *err) {
  void *list = check->mesh;
  const ep_status status =
      ep_grow(&list, &check->room_meshes, check->nmeshes + 1, sizeof *check->mesh, file, err);
  check->mesh = list;
  if (status != EP_OK) return status;
  *out = &check->mesh[check->nmeshes++];
  memset(*out, 0, sizeof **out);
  snprintf((*out)->file, sizeof(*out)->file, "%s", file);
  return EP_OK;
}

ep_status ep_check_mesh_take(ep_check *check, const char *file, ep_mesh *mesh,
                             const ep_mesh_findings *findings, int *number, ep_error *err) {
  ep_checked_mesh *m;
  EP_TRY(new_mesh(check, file, &m, err));
  if (number) *number = check->nmeshes - 1;
  m->mesh = *mesh;
  memset(mesh, 0, sizeof *mesh);
  m->findings = *findings;
  m->read = true;
  ep_mesh_measure(&m->mesh, &m->quality);
  EP_TRY(ep_mesh_examine(&m->mesh, &m->topology, err));
  EP_TRY(add_reading(check, m, err));
  EP_TRY(add_duplicates(check, m, err));
  EP_TRY(add_parts(check, m, err));
  EP_TRY(add_topology(check, m, err));
  return add_shape(check, m, err);
}

ep_status ep_check_mesh_file(ep_check *check, const char *path, int *number, ep_error *err) {
  ep_mesh mesh;
  ep_mesh_findings findings;
  ep_error bad = {0};
  ep_checked_mesh *m;
  const ep_status status = ep_mesh_read(path, &mesh, &findings, NULL, &bad);
  if (status == EP_ERR_IO || status == EP_ERR_MEMORY) return ep_fail(err, status, "%s", bad.text);
  if (status == EP_OK) {
    const ep_status taken = ep_check_mesh_take(check, path, &mesh, &findings, number, err);
    ep_mesh_free(&mesh); // empty, where it was taken
    return taken;
  }
  EP_TRY(new_mesh(check, path, &m, err));
  if (number) *number = check->nmeshes - 1;
  // The text begins with "file:line: " or "file: ".
  const size_t length = strlen(path);
  const bool begins = strncmp(bad.text, path, length) == 0 && bad.text[length] == ':';
  const char *text = begins ? bad.text + length + 1 : bad.text;
  const char *line = begins && *text != ' ' ? "line " : "";
  while (*text == ' ') text++;
  ADD(EP_FOUND_ERROR, status == EP_ERR_MESH ? "no-mesh" : "unreadable", false, "%s%s", line, text);
  return EP_OK;
}
