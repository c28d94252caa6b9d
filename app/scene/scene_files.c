// The files a scene reads.
#include "app/scene/scene.h"

typedef struct visit {
  ep_file_visit *call;
  void *user;
  ep_error *err;
} visit;

static ep_status see(const visit *v, const char *path) {
  return path ? v->call(v->user, path, v->err) : EP_OK;
}

static ep_status see_selection(const visit *v, const ep_selection *s) {
  return s->kind == EP_SELECT_FILE ? see(v, s->path) : EP_OK;
}

static ep_status see_family(const visit *v, const ep_family *family) {
  EP_TRY(see(v, family->rest));
  EP_TRY(see(v, family->regions));
  for (int i = 0; i < family->poses; i++) EP_TRY(see(v, family->pose[i]));
  return EP_OK;
}

ep_status ep_scene_each_file(const ep_scene *scene, ep_file_visit *call, void *user,
                             ep_error *err) {
  const visit v = {call, user, err};
  EP_TRY(see(&v, scene->path));
  EP_TRY(see(&v, scene->mesh));
  for (int i = 0; i < scene->nfamilies; i++) EP_TRY(see_family(&v, &scene->family[i]));
  for (int i = 0; i < scene->nfixed; i++) EP_TRY(see_selection(&v, &scene->fixed[i]));
  for (int i = 0; i < scene->nregions; i++) EP_TRY(see_selection(&v, &scene->region[i].where));
  for (int i = 0; i < scene->nloads; i++) EP_TRY(see_selection(&v, &scene->load[i].where));
  for (int i = 0; i < scene->ndrags; i++) EP_TRY(see_selection(&v, &scene->drag[i].where));
  for (int i = 0; i < scene->npressures; i++) EP_TRY(see_selection(&v, &scene->pressure[i].where));
  return EP_OK;
}
