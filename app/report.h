// What the commands say: plans and stages, as JSON and as text; reading and writing JSON.
#ifndef EP_APP_REPORT_H
#define EP_APP_REPORT_H

#include <jansson.h>

#include "app/plan/plan.h"

// All makers return NULL without memory; json_decref what they return.

// Numbers JSON cannot hold (NaN, infinity) become null.
json_t *ep_json_number(double value);
// A string; bytes that are no UTF-8, as names of files may have, become U+FFFD.
json_t *ep_json_text(const char *text);
json_t *ep_json_numbers(int count, const double *value);
// The number at a key, NaN where there is none (or null).
double ep_json_get_number(const json_t *object, const char *key);

// [{name, seconds, cached}] of the stages that run in a bake.
json_t *ep_report_stages(const ep_plan *plan);
// Take seconds and cached over from such a list, by name. False where it is no such list.
bool ep_report_take_stages(ep_plan *plan, const json_t *stages);

// The plan with reasons; `in_cache` (count) tells which results are there already.
json_t *ep_report_plan(const ep_scene *scene, const ep_shapes *shapes, const ep_plan *plan,
                       const bool *in_cache);
void ep_report_plan_text(const ep_scene *scene, const ep_shapes *shapes, const ep_plan *plan,
                         const bool *in_cache);

// Print a report on stdout and release it. Errors: EP_ERR_IO (stdout is full), EP_ERR_MEMORY where
// root is NULL.
ep_status ep_report_print(json_t *root, ep_error *err);
// The same into a file, whole or not at all; every number reads back to the same double.
ep_status ep_report_write(const char *path, json_t *root, ep_error *err);

#endif
