// Maps and poses to look at and to judge.
#include <math.h>
#include <stdio.h>

#include "app/commands.h"
#include "app/maps/align_view.h"
#include "app/maps/quality_json.h"
#include "app/report.h"

// The maps first, so that those are there to look at even where a pose cannot be made; then the
// poses, which tell how many tets each map leaves inverted.
static ep_status make_maps(const ep_cli *cli, ep_bake *bake, int *maps, ep_error *err) {
  *maps = 0;
  for (int i = 0; i < bake->plan->count; i++) {
    ep_stage *stage = &bake->plan->stage[i];
    const ep_map *map;
    if (stage->kind != EP_STAGE_MAP || !stage->runs) continue;
    EP_TRY(ep_bake_map(bake, stage, &map, err));
    if (cli->out) EP_TRY(ep_align_view_map(cli->out, bake, stage, map, err));
    ++*maps;
  }
  return EP_OK;
}

// A map from the object answers for all poses of its family.
static void note_inverted(ep_bake *bake) {
  for (int i = 0; i < bake->plan->count; i++) {
    const ep_stage *stage = &bake->plan->stage[i];
    double before = 0, left = 0;
    int poses = 0;
    if (stage->kind != EP_STAGE_MAP || !stage->runs || stage->from != 0) continue;
    for (int k = 0; k < bake->shapes->examples; k++) {
      const ep_pose_source *example = &bake->shapes->example[k];
      if (example->rest != stage->to && example->shape != stage->to) continue;
      poses++;
      before = fmax(before, bake->quality[k].inverted_before);
      left = fmax(left, bake->quality[k].inverted_tets);
    }
    if (poses) ep_map_note_inverted(&bake->map[i], (int)before, (int)left);
  }
}

static json_t *map_json(const ep_bake *bake, const ep_stage *stage, const ep_map *map) {
  const ep_shape_file *from = &bake->shapes->shape[stage->from];
  const ep_shape_file *to = &bake->shapes->shape[stage->to];
  json_t *record = ep_quality_json(&map->quality, &from->mesh, &to->mesh);
  if (!record) return NULL;
  json_object_set_new(record, "name", ep_json_text(stage->name));
  json_object_set_new(record, "from", ep_json_text(from->name));
  json_object_set_new(record, "to", ep_json_text(to->name));
  json_object_set_new(record, "m", json_integer(map->m));
  json_object_set_new(record, "cached", json_boolean(stage->cached));
  json_object_set_new(record, "accepted", json_boolean(bake->scene->family[stage->family].accept));
  return record;
}

static json_t *maps_json(const ep_bake *bake) {
  json_t *list = json_array();
  for (int i = 0; list && i < bake->plan->count; i++)
    if (bake->map[i].p)
      json_array_append_new(list, map_json(bake, &bake->plan->stage[i], &bake->map[i]));
  return list;
}

static void print_text(const ep_bake *bake, int maps) {
  for (int i = 0; i < bake->plan->count; i++)
    if (bake->map[i].p) {
      const ep_stage *stage = &bake->plan->stage[i];
      ep_quality_text(stdout, stage->name, &bake->map[i].quality,
                      &bake->shapes->shape[stage->from].mesh, &bake->shapes->shape[stage->to].mesh);
    }
  for (int i = 0; bake->quality && i < bake->shapes->examples; i++)
    ep_pose_text(stdout, bake->shapes->shape[bake->shapes->example[i].shape].name,
                 &bake->quality[i]);
  if (!maps) printf("%s: no maps are needed (see eigenpose plan)\n", bake->scene->name);
}

ep_status ep_command_align(const ep_cli *cli, ep_session *session, ep_bake *bake, ep_error *err) {
  int maps;
  bake->look = true;
  if (cli->out) EP_TRY(ep_output_folder(cli->out, err));
  EP_TRY(make_maps(cli, bake, &maps, err));
  EP_TRY(ep_bake_poses(bake, err));
  if (bake->quality) note_inverted(bake);
  for (int i = 0; cli->out && bake->poses && i < bake->shapes->examples; i++)
    EP_TRY(ep_align_view_pose(cli->out, bake, i, err));
  if (cli->json)
    return ep_report_print(json_pack("{s:s, s:o, s:o}", "scene", session->scene.name, "maps",
                                     maps_json(bake), "poses", ep_poses_json(bake)),
                           err);
  print_text(bake, maps);
  return EP_OK;
}
