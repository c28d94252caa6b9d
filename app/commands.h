// Commands that leave pictures and pages to look at.
#ifndef EP_APP_COMMANDS_H
#define EP_APP_COMMANDS_H

#include "app/bake/bake.h"
#include "app/plan/session.h"

// eigen MESH [--out F.vtu]: eigenvalues on stdout; the eigenfunctions into F.vtu, and F.png with
// the first of them inside the volume.
ep_status ep_command_eigen(const ep_cli *cli, ep_error *err);

// align SCENE [--out DIR]: the record of every map, and of every example's pose on the object's
// mesh; pictures and .vtu files of both in DIR. A bad map is said, and no error.
ep_status ep_command_align(const ep_cli *cli, ep_session *session, ep_bake *bake, ep_error *err);

// report FIGURES [--out DIR]: DIR/index.html of the runs in DIR.
ep_status ep_command_report(const ep_cli *cli, ep_error *err);

#endif
