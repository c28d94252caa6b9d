// The command line, the same for the command and for the baker.
#ifndef EP_APP_CLI_H
#define EP_APP_CLI_H

#include <stdbool.h>

#include "base/error.h"

enum { EP_SETS_MAX = 64, EP_INPUTS_MAX = 256 };

typedef enum ep_command {
  EP_COMMAND_EIGEN,
  EP_COMMAND_ALIGN,
  EP_COMMAND_PLAN,
  EP_COMMAND_BAKE,
  EP_COMMAND_RUN,
  EP_COMMAND_COMPARE,
  EP_COMMAND_STRESS,
  EP_COMMAND_REPORT,
  EP_COMMAND_CHECK,
  EP_COMMANDS
} ep_command;

typedef struct ep_cli {
  ep_command command;
  const char *input; // mesh or scene; of several the first
  int ninputs;       // check takes several
  const char *inputs[EP_INPUTS_MAX];
  const char *repair; // check: where the repaired mesh goes
  bool largest;       // check: of it keep the largest part only
  const char *out, *cache;
  const char *kernels; // run: instruction set of the kernels; NULL: the widest
  int count; // eigen: eigenpairs wanted
  bool json, quiet;
  bool quick;         // stress: only the ends of every axis
  const char *replay; // stress: a failure's file
  bool served;        // run by the command, which reports in its place what both would say
  int nsets;
  const char *set[EP_SETS_MAX];
} ep_cli;

// First of all: where stdin, stdout or stderr is closed, the next file opened would take its number
// and get what is printed. Such a stream fails instead.
void ep_cli_guard_streams(void);
// Last of all: whether what was printed has arrived. EP_ERR_IO.
ep_status ep_cli_flush(ep_error *err);

// Parse; --help, --version and mistakes end the process (argp), mistakes with status
// EP_ERR_ARGUMENT.
void ep_cli_parse(int argc, char **argv, ep_cli *out);

// Say a failure: on stderr, and with --json as {"error": ...} on stdout. Returns the exit code:
// the number of the status (README "Exit codes").
int ep_cli_fail(const ep_cli *cli, const ep_error *err);

#endif
