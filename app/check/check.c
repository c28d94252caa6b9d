// The command `check`: reads what is named, says the findings, repairs where asked.
#include "app/check/check.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

#include "app/report.h"
#include "base/files.h"
#include "mesh/io.h"

static const char *severity_name(ep_severity severity) {
  static const char *const names[] = {"error", "warning", "note"};
  return names[severity];
}

static bool is_scene(const char *path) {
  const char *extension = ep_path_extension(path);
  return strcasecmp(extension, "yaml") == 0 || strcasecmp(extension, "yml") == 0 ||
         strcasecmp(extension, "json") == 0;
}

static int count_of(const ep_check *check, const char *file, ep_severity severity) {
  int count = 0;
  for (int i = 0; i < check->nfound; i++)
    count += check->found[i].severity == severity && strcmp(check->found[i].file, file) == 0;
  return count;
}

// ---- text --------------------------------------------------------------------------------------

static void print_text(const ep_check *check, bool quiet) {
  for (int i = 0; i < check->nfound; i++) {
    const ep_found *f = &check->found[i];
    if (quiet && f->severity == EP_FOUND_NOTE) continue;
    printf("%-7s  %s: %s: %s%s\n", severity_name(f->severity), f->file, f->code, f->text,
           f->repairable ? " [repairable]" : "");
  }
  if (!check->nmeshes || quiet) return;
  printf("%s%8s %9s %5s %11s %11s %9s %7s %6s %8s  %s\n", check->nfound ? "\n" : "", "vertices",
         "tets", "parts", "volume", "diagonal", "angles", "ratio", "errors", "warnings", "mesh");
  for (int i = 0; i < check->nmeshes; i++) {
    const ep_checked_mesh *m = &check->mesh[i];
    const int errors = count_of(check, m->file, EP_FOUND_ERROR);
    const int warnings = count_of(check, m->file, EP_FOUND_WARNING);
    if (m->read)
      printf("%8d %9d %5d %11.4g %11.4g %4.3g-%-4.4g %7.3f %6d %8d  %s\n", m->mesh.nv, m->mesh.nt,
             m->findings.components, ep_mesh_volume(&m->mesh), ep_mesh_diagonal(&m->mesh),
             m->quality.low, m->quality.high, m->quality.radius_ratio, errors, warnings, m->file);
    else
      printf("%8s %9s %5s %11s %11s %9s %7s %6d %8d  %s\n", "-", "-", "-", "-", "-", "-", "-",
             errors, warnings, m->file);
  }
}

// ---- JSON --------------------------------------------------------------------------------------

static json_t *mesh_json(const ep_checked_mesh *m) {
  if (!m->read) return json_pack("{s:o, s:b}", "file", ep_json_text(m->file), "read", 0);
  const ep_mesh_findings *f = &m->findings;
  const ep_mesh_quality *q = &m->quality;
  return json_pack(
      "{s:o, s:b, s:i, s:i, s:i, s:o, s:o, s:i, s:i, s:i, s:i, s:i,"
      " s:{s:o, s:o, s:o, s:o, s:i}, s:{s:i, s:i, s:i}}",
      "file", ep_json_text(m->file), "read", 1, "vertices", m->mesh.nv, "tets", m->mesh.nt, "parts",
      f->components, "volume", ep_json_number(ep_mesh_volume(&m->mesh)), "diagonal",
      ep_json_number(ep_mesh_diagonal(&m->mesh)), "inverted_tets", f->repaired_orientation,
      "degenerate_tets", f->degenerate_tets, "repeated_tets", f->repeated_tets, "unused_vertices",
      f->unused_vertices, "other_cells", f->dropped_cells, "quality", "smallest_angle",
      ep_json_number(q->low), "largest_angle", ep_json_number(q->high), "lowest_radius_ratio",
      ep_json_number(q->radius_ratio), "mean_radius_ratio", ep_json_number(q->mean_ratio),
      "slivers", q->slivers, "topology", "overlapping_faces", m->topology.overlapping_faces,
      "open_edges", m->topology.open_edges, "pinched_vertices", m->topology.pinched_vertices);
}

static ep_status print_json(const ep_check *check, const char *repaired, ep_error *err) {
  json_t *meshes = json_array(), *found = json_array();
  for (int i = 0; i < check->nmeshes; i++)
    json_array_append_new(meshes, mesh_json(&check->mesh[i]));
  for (int i = 0; i < check->nfound; i++) {
    const ep_found *f = &check->found[i];
    json_array_append_new(found, json_pack("{s:s, s:s, s:o, s:o, s:b}", "severity",
                                           severity_name(f->severity), "code", f->code, "file",
                                           ep_json_text(f->file), "message", ep_json_text(f->text),
                                           "repairable", f->repairable));
  }
  return ep_report_print(json_pack("{s:o, s:o, s:i, s:i, s:o}", "meshes", meshes, "findings", found,
                                   "errors", ep_check_count(check, EP_FOUND_ERROR), "warnings",
                                   ep_check_count(check, EP_FOUND_WARNING), "repaired",
                                   repaired ? ep_json_text(repaired) : json_null()),
                         err);
}

// ---- repair ------------------------------------------------------------------------------------

static ep_status write_mesh(const char *path, const ep_mesh *mesh, ep_error *err) {
  const char *extension = ep_path_extension(path);
  if (strcasecmp(extension, "veg") == 0) return ep_mesh_write_veg(path, mesh, err);
  ep_field *field = calloc((size_t)mesh->ndata + 1, sizeof *field);
  if (!field) return ep_fail(err, EP_ERR_MEMORY, "no memory to write %s", path);
  int count = 0;
  for (int i = 0; i < mesh->ndata; i++)
    if (mesh->data[i].value)
      field[count++] = (ep_field){mesh->data[i].name, 1, mesh->data[i].value};
  const ep_status status = ep_mesh_write_vtu(path, mesh, NULL, count, field, 0, NULL, err);
  free(field);
  return status;
}

// Repairs the one mesh of the check, writes it, and puts its own findings in the place of the old
// ones, so that what is said is true of what was written.
static ep_status repair(const ep_cli *cli, ep_check *check, ep_error *err) {
  const ep_checked_mesh *old = &check->mesh[0];
  if (!old->read) return EP_OK; // the finding says why
  ep_mesh_repairs r = {.largest_only = cli->largest};
  ep_mesh mesh;
  ep_mesh_findings findings;
  ep_check after = {0};
  EP_TRY(ep_mesh_repair(&old->mesh, &r, &mesh, &findings, err));
  ep_status status = write_mesh(cli->repair, &mesh, err);
  if (status == EP_OK && !cli->quiet)
    fprintf(
        stderr,
        "eigenpose: %s: %d tets turned round, %d without volume, %d repeated and %d of other parts "
        "left out; %d vertices joined, %d unused left out\n",
        cli->repair, old->findings.repaired_orientation, r.degenerate_tets,
        old->findings.repeated_tets + r.repeated_tets, r.left_out_tets, r.merged_vertices,
        old->findings.unused_vertices);
  if (status == EP_OK)
    status = ep_check_mesh_take(&after, cli->repair, &mesh, &findings, NULL, err);
  ep_mesh_free(&mesh);
  ep_check_free(check);
  *check = after;
  return status;
}

// ---- the command -------------------------------------------------------------------------------

static ep_status check_usage(const ep_cli *cli, ep_error *err) {
  if (!cli->repair && cli->largest)
    return ep_fail(err, EP_ERR_ARGUMENT, "--largest belongs to --repair OUT");
  if (!cli->repair) return EP_OK;
  if (cli->ninputs != 1 || is_scene(cli->inputs[0]))
    return ep_fail(err, EP_ERR_ARGUMENT, "--repair takes one mesh, not %s",
                   cli->ninputs != 1 ? "several files" : "a scene");
  EP_TRY(ep_output_spares(cli->repair, cli->inputs[0], err));
  const char *extension = ep_path_extension(cli->repair);
  if (strcasecmp(extension, "veg") == 0 || strcasecmp(extension, "vtu") == 0) return EP_OK;
  return ep_fail(err, EP_ERR_ARGUMENT, "--repair %s: the repaired mesh is written as .veg or .vtu",
                 cli->repair);
}

static ep_status check_file(const ep_cli *cli, const char *path, ep_check *check, ep_error *err) {
  if (!is_scene(path)) return ep_check_mesh_file(check, path, NULL, err);
  ep_scene scene;
  ep_error bad = {0};
  ep_status status = ep_scene_read(path, cli->nsets, cli->set, &scene, &bad);
  if (status == EP_ERR_IO || status == EP_ERR_MEMORY) return ep_fail(err, status, "%s", bad.text);
  if (status != EP_OK)
    return ep_check_add(check, EP_FOUND_ERROR, "scene", path, false, err, "%s", bad.text);
  status = ep_check_scene(check, &scene, err);
  ep_scene_free(&scene);
  return status;
}

ep_status ep_command_check(const ep_cli *cli, bool *found_errors, ep_error *err) {
  ep_check check = {0};
  EP_TRY(check_usage(cli, err));
  ep_status status = EP_OK;
  for (int i = 0; i < cli->ninputs && status == EP_OK; i++)
    status = check_file(cli, cli->inputs[i], &check, err);
  if (status == EP_OK && cli->repair) status = repair(cli, &check, err);
  if (status == EP_OK && cli->json) status = print_json(&check, cli->repair, err);
  if (status == EP_OK && !cli->json) print_text(&check, cli->quiet);
  *found_errors = ep_check_count(&check, EP_FOUND_ERROR) > 0;
  ep_check_free(&check);
  return status;
}
