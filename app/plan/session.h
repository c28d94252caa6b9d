// What every command on a scene opens first: scene, meshes, plan, cache.
#ifndef EP_APP_PLAN_SESSION_H
#define EP_APP_PLAN_SESSION_H

#include "app/cli.h"
#include "app/plan/plan.h"

typedef struct ep_session {
  ep_scene scene;
  ep_shapes shapes;
  ep_plan plan;
  ep_cache cache;
  ep_log log;
} ep_session;

ep_status ep_session_open(const ep_cli *cli, ep_session *out, ep_error *err);
void ep_session_close(ep_session *session);

// The model file of the scene in the cache, into path (EP_PATH_MAX), whether it exists or not.
void ep_session_model_path(const ep_session *session, char *path);

#endif
