#include <stdio.h>

#include "app/commands.h"
#include "app/figures/figures.h"
#include "app/report.h"

ep_status ep_command_report(const ep_cli *cli, ep_error *err) {
  const char *root = cli->out ? cli->out : "out";
  ep_figures figures;
  EP_TRY(ep_figures_read(cli->input, root, &figures, err));
  ep_status status = ep_figures_write(root, &figures, err);
  if (status == EP_OK && cli->json)
    status = ep_report_print(json_pack("{s:i, s:i, s:i}", "figures", figures.count, "runs",
                                       figures.runs, "failed", figures.failed),
                             err);
  if (status == EP_OK && !cli->json)
    printf("%d figures, %d runs, %d failed: %s/index.html\n", figures.count, figures.runs,
           figures.failed, root);
  ep_figures_free(&figures);
  return status;
}
