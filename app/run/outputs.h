// The files a run leaves: frames, animation, picture, tables, summary.
#ifndef EP_APP_RUN_OUTPUTS_H
#define EP_APP_RUN_OUTPUTS_H

#include <jansson.h>

#include "app/run/simulate.h"

// Make the folder, see that it takes files, and take away the summary of an earlier run: a folder
// with a summary holds a whole run. Refused where the scene reads a frame of an earlier run there,
// which would be written over.
ep_status ep_outputs_begin(const char *folder, const ep_scene *scene, ep_error *err);

// Write what scene->formats asks for into `folder` (begun), plus trajectory.csv. A record
// cut short by a failure is written as far as it goes.
//   frames/frame-0000.vtu .. and animation.pvd; animation.glb; strip.png, final.png
// What an earlier run left there in other formats is taken away.
ep_status ep_outputs_write(const char *folder, const ep_scene *scene, const ep_shapes *shapes,
                           const ep_model *model, const ep_record *record, ep_log *log,
                           ep_error *err);

// summary.json (the report as printed by --json) and summary.txt.
ep_status ep_outputs_summary(const char *folder, json_t *report, ep_error *err);

// The lines of summary.txt into an open stream.
void ep_summary_text(FILE *out, const json_t *report);

#endif
