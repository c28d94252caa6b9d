// The quality of maps and poses for people and programs.
#ifndef EP_APP_QUALITY_JSON_H
#define EP_APP_QUALITY_JSON_H

#include <jansson.h>
#include <stdio.h>

#include "app/bake.h"

const char *ep_verdict_name(ep_verdict verdict); // "good", "doubtful", "bad"

// {verdict, reasons, residual_before, .., regions: [{region, residual_before, .., suspect}]};
// regions are numbered from 1 as a person counts the file's. NULL without memory.
json_t *ep_quality_json(const ep_map_quality *quality);
void ep_quality_text(FILE *out, const char *name, const ep_map_quality *quality);

// {inverted_tets, inverted_before, .., repair_shift}: a pose on the object's mesh.
json_t *ep_pose_json(const ep_pose_quality *quality);
void ep_pose_text(FILE *out, const char *name, const ep_pose_quality *quality);

#endif
