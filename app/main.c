// The command `eigenpose`. It links neither PETSc nor SLEPc: what needs them is done by the baker,
// a program of its own in libexec.
#include "app/check/check.h"
#include "app/commands.h"
#include "app/process.h"
#include "app/run/run.h"

static ep_status perform(const ep_cli *cli, char **argv, bool *found, ep_error *err) {
  switch (cli->command) {
  case EP_COMMAND_CHECK:
    return ep_command_check(cli, found, err);
  case EP_COMMAND_PLAN:
    return ep_command_plan(cli, err);
  case EP_COMMAND_REPORT:
    return ep_command_report(cli, err);
  case EP_COMMAND_RUN:
    return ep_command_run(cli, err);
  default:
    return ep_baker_become(argv, err);
  }
}

int main(int argc, char **argv) {
  ep_cli cli;
  ep_error err = {0};
  ep_cli_guard_streams();
  ep_cli_parse(argc, argv, &cli);
  bool found = false; // check: errors in what was checked
  if (perform(&cli, argv, &found, &err) != EP_OK || ep_cli_flush(&err) != EP_OK)
    return ep_cli_fail(&cli, &err);
  return found ? EP_EXIT_FOUND : 0;
}
