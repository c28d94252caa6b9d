// `eigenpose run` and `eigenpose plan`: what needs no PETSc.
#ifndef EP_APP_RUN_RUN_H
#define EP_APP_RUN_RUN_H

#include "app/cli.h"

ep_status ep_command_plan(const ep_cli *cli, ep_error *err);
ep_status ep_command_run(const ep_cli *cli, ep_error *err);

#endif
