// The quality of maps and poses for people and programs.
#ifndef EP_APP_MAPS_QUALITY_JSON_H
#define EP_APP_MAPS_QUALITY_JSON_H

#include <jansson.h>
#include <stdio.h>

#include "app/bake/bake.h"

const char *ep_verdict_name(ep_verdict verdict); // "good", "doubtful", "bad"

// The whole record: {verdict, reasons, .., regions: [..], coupling: {..}, frames: [..], settle}.
// Regions are numbered from 1 as a person counts the file's; vertices as in lists of vertices:
// their place in the mesh file, from 1. NULL without memory.
json_t *ep_quality_json(const ep_map_quality *quality, const ep_mesh *from, const ep_mesh *to);
void ep_quality_text(FILE *out, const char *name, const ep_map_quality *quality,
                     const ep_mesh *from, const ep_mesh *to);

// What stands under the picture of a map that shows `dots` places on both shapes: the landmarks
// given where there are any, else the one that would settle the frame, if there is one.
void ep_map_note(const ep_map_quality *quality, int dots, char *note, size_t size);

// {inverted_tets, inverted_before_repair, .., iterations}: a pose on the object's mesh.
json_t *ep_pose_json(const ep_pose_quality *quality);
// Regions of local examples: elements and errors of the cubature in each.
json_t *ep_regions_json(const ep_bake *bake);
void ep_regions_text(FILE *out, const ep_bake *bake);
// [{name, ..}] of all examples; empty before ep_bake_poses.
json_t *ep_poses_json(const ep_bake *bake);
void ep_pose_text(FILE *out, const char *name, const ep_pose_quality *quality);

#endif
