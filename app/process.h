// Finding and running the baker: the program that links PETSc stands beside the command, in
// libexec, so that the command itself starts in milliseconds.
#ifndef EP_APP_PROCESS_H
#define EP_APP_PROCESS_H

#include <jansson.h>

#include "app/cli.h"

// Replace this process by the baker, with the same arguments. Returns only on failure.
ep_status ep_baker_become(char **argv, ep_error *err);

// Run "bake SCENE --json" with the scene, overrides and cache of cli; its notices go on to stderr.
// *report receives what it printed (json_decref). A failure of the baker is passed on with its own
// text.
ep_status ep_baker_run(const ep_cli *cli, json_t **report, ep_error *err);

#endif
