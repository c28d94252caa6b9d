// The baker: commands that need PETSc and SLEPc. Run by `eigenpose`, or by hand with the same
// arguments.
#include <stdio.h>
#include <stdlib.h>

#include "app/blas_core.h"
#include "app/commands.h"
#include "app/compare/compare.h"
#include "app/maps/quality_json.h"
#include "app/report.h"
#include "app/stress/stress.h"

// ---- bake ------------------------------------------------------------------------------------

// For an engine: the model under a name of its own.
static ep_status copy_model(const char *from, const char *to, ep_error *err) {
  char *bytes;
  size_t size;
  EP_TRY(ep_file_read(from, &bytes, &size, err));
  const ep_status status = ep_file_write(to, bytes, size, err);
  free(bytes);
  return status;
}

static ep_status spares(void *user, const char *path, ep_error *err) {
  return ep_output_spares(user, path, err);
}

static ep_status command_bake(const ep_cli *cli, ep_session *session, ep_bake *bake,
                              ep_error *err) {
  char path[EP_PATH_MAX];
  if (cli->out) {
    EP_TRY(ep_output_place(cli->out, err));
    EP_TRY(ep_scene_each_file(&session->scene, spares, (void *)cli->out, err));
  }
  EP_TRY(ep_bake_model(bake, path, err));
  if (cli->out) EP_TRY(copy_model(path, cli->out, err));
  EP_TRY(ep_bake_poses(bake, err)); // for the report: a model in the cache does not ask for them
  if (session->shapes.sets) EP_TRY(ep_bake_cubature(bake, err)); // the same
  if (cli->json) {
    json_t *report =
        json_pack("{s:s, s:o, s:i, s:o, s:o}", "scene", session->scene.name, "model",
                  ep_json_text(cli->out ? cli->out : path), "warnings", session->log.warnings,
                  "stages", ep_report_stages(&session->plan), "examples", ep_poses_json(bake));
    if (report && session->shapes.sets)
      json_object_set_new(report, "regions", ep_regions_json(bake));
    return ep_report_print(report, err);
  }
  for (int i = 0; i < session->plan.count; i++) {
    const ep_stage *stage = &session->plan.stage[i];
    if (stage->runs && ep_stage_is_baked(stage->kind))
      printf("%-30s %8.3f s%s\n", stage->name, stage->seconds, stage->cached ? "  (cached)" : "");
  }
  ep_regions_text(stdout, bake);
  printf("model: %s\n", cli->out ? cli->out : path);
  return EP_OK;
}

static ep_status on_scene(const ep_cli *cli, ep_error *err) {
  ep_session session;
  ep_bake bake;
  EP_TRY(ep_session_open(cli, &session, err));
  ep_status status = ep_bake_open(&session.scene, &session.shapes, &session.plan, &session.cache,
                                  &session.log, &bake, err);
  if (status == EP_OK) {
    status = cli->command == EP_COMMAND_ALIGN ? ep_command_align(cli, &session, &bake, err)
                                              : command_bake(cli, &session, &bake, err);
    ep_bake_close(&bake);
  }
  ep_session_close(&session);
  return status;
}

int main(int argc, char **argv) {
  ep_cli cli;
  ep_error err = {0};
  ep_cli_guard_streams();
  ep_blas_core_check(argv);
  ep_cli_parse(argc, argv, &cli);
  ep_status status;
  switch (cli.command) {
  case EP_COMMAND_EIGEN:
    status = ep_command_eigen(&cli, &err);
    break;
  case EP_COMMAND_COMPARE:
    status = ep_command_compare(&cli, &err);
    break;
  case EP_COMMAND_STRESS:
    status = ep_command_stress(&cli, &err);
    break;
  case EP_COMMAND_ALIGN:
  case EP_COMMAND_BAKE:
    status = on_scene(&cli, &err);
    break;
  default:
    status = ep_fail(&err, EP_ERR_ARGUMENT, "the baker bakes; use eigenpose for this command");
  }
  if (status == EP_OK) status = ep_cli_flush(&err);
  return status == EP_OK ? 0 : ep_cli_fail(&cli, &err);
}
