// The command `eigenpose stress`: all cases of a scene, or one failure once more.
#include <stdlib.h>

#include "app/commands.h"
#include "app/report.h"
#include "app/stress/stress.h"
#include "linalg/petsc.h"

static ep_status output(const ep_cli *cli, const char *folder, const ep_stress_report *report,
                        ep_error *err) {
  EP_TRY(ep_stress_write(folder, report, err));
  if (cli->json) return ep_report_print(ep_stress_json(report), err);
  ep_stress_text(stdout, report);
  printf("report: %s/index.html\n", folder);
  return EP_OK;
}

// A broken case is the program's failure, not the scene's.
static ep_status verdict(const ep_stress_report *report, ep_error *err) {
  int broken = 0;
  for (int i = 0; i < report->count; i++) broken += report->result[i].outcome == EP_STRESS_BROKEN;
  if (broken == 0) return EP_OK;
  return ep_fail(err, EP_ERR_NUMERIC,
                 "%d of %d cases broke the simulation; failures/ has their states for "
                 "`eigenpose stress SCENE --replay FILE`",
                 broken, report->count);
}

static ep_status sweep(const ep_cli *cli, ep_session *session, ep_error *err) {
  ep_stress_case *cases;
  ep_stress_report report = {.name = session->scene.name};
  char fallback[EP_PATH_MAX];
  snprintf(fallback, sizeof fallback, "out/%s-stress", session->scene.name);
  const char *folder = cli->out ? cli->out : fallback;
  EP_TRY(ep_output_folder(folder, err));
  EP_TRY(ep_stress_list(session, cli->quick, &report.count, &cases, err));
  ep_stress_result *result = calloc((size_t)report.count, sizeof *result);
  ep_status status =
      result ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for %d cases", report.count);
  const double started = ep_seconds();
  ep_progress_begin(&session->log, "stress", report.count);
  for (int i = 0; i < report.count && status == EP_OK; i++) {
    ep_session quiet = *session; // the first case is the scene as it is: its warnings do for all
    quiet.log.mute = i > 0;
    status = ep_stress_run(&quiet, &cases[i], &result[i], err);
    ep_progress(&session->log, i + 1);
  }
  ep_progress_end(&session->log);
  report.result = result;
  report.seconds = ep_seconds() - started;
  if (status == EP_OK) status = output(cli, folder, &report, err);
  if (status == EP_OK) status = verdict(&report, err);
  for (int i = 0; i < report.count && result; i++) ep_stress_result_free(&result[i]);
  free(result);
  free(cases);
  return status;
}

ep_status ep_command_stress(const ep_cli *cli, ep_error *err) {
  ep_session session;
  EP_TRY(ep_session_open(cli, &session, err));
  ep_status status = ep_petsc_start(err);
  if (status == EP_OK) {
    status = cli->replay ? ep_stress_replay(&session, cli->replay, cli->json, err)
                         : sweep(cli, &session, err);
    ep_petsc_stop();
  }
  ep_session_close(&session);
  return status;
}
