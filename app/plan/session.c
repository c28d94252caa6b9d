#include "app/plan/session.h"

ep_status ep_session_open(const ep_cli *cli, ep_session *out, ep_error *err) {
  *out = (ep_session){.log = ep_log_default(cli->quiet)};
  ep_status status = ep_cache_open(cli->cache, &out->cache, err);
  if (status == EP_OK) status = ep_scene_read(cli->input, cli->nsets, cli->set, &out->scene, err);
  if (status == EP_OK)
    status = ep_shapes_read(&out->scene, cli->served ? NULL : &out->log, &out->shapes, err);
  if (status == EP_OK) status = ep_plan_make(&out->scene, &out->shapes, &out->plan, err);
  if (status != EP_OK) ep_session_close(out);
  return status;
}

void ep_session_close(ep_session *session) {
  ep_progress_end(&session->log); // of a stage that failed: the message has a line of its own
  ep_plan_free(&session->plan);
  ep_shapes_free(&session->shapes);
  ep_scene_free(&session->scene);
}

void ep_session_model_path(const ep_session *session, char *path) {
  const ep_stage *stage = ep_plan_find(&session->plan, EP_STAGE_MODEL);
  ep_cache_path(&session->cache, stage->name, &stage->key, "epm", path);
}
