// How a free object starts.
#include "app/scene/scene_reader.h"

ep_status ep_read_start(const ep_scene_reader *r, const raw_scene *raw, ep_scene *out) {
  const raw_start *given = raw->start;
  ep_start *start = &out->start;
  if (!given) return EP_OK;
  if (out->nfixed)
    return ep_read_refuse(r, "start",
                          "something is fixed: a held object starts at rest where its mesh is; "
                          "take `start` or `fixed` out");
  start->placed = given->position != NULL;
  if (given->position)
    EP_TRY(ep_read_bounded(r, "start.position", given->position, EP_PLACE_MOST, start->position));
  if (given->velocity)
    EP_TRY(ep_read_bounded(r, "start.velocity", given->velocity, EP_PLACE_MOST, start->velocity));
  if (given->spin)
    EP_TRY(ep_read_bounded(r, "start.spin", given->spin, EP_PLACE_MOST, start->spin));
  return ep_read_turn(r, "start.rotation", given->rotation, &start->rotation);
}
