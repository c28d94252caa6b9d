#include "app/scene/scene_reader.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

#include "base/files.h"

// The last --set that gives the value at a dotted key, something in it, or what it stands in;
// *length of its own key. NULL where none does.
static const char *set_of(const ep_scene_reader *r, const char *key, int *length) {
  for (int i = r->nsets; i-- > 0;) {
    const char *set = r->sets[i];
    const size_t own = strcspn(set, "="), asked = strlen(key), common = own < asked ? own : asked;
    const char after = own < asked ? key[own] : set[asked];
    if (strncmp(set, key, common) != 0 || (own != asked && after != '.')) continue;
    *length = (int)own;
    return set;
  }
  return NULL;
}

void ep_read_place(const ep_scene_reader *r, const char *key, char *out, size_t size) {
  int line, column, own;
  const char *set = set_of(r, key, &own);
  if (set && (size_t)own == strlen(key))
    snprintf(out, size, ": --set %.60s", key);
  else if (set)
    snprintf(out, size, ": --set %.*s: %.60s", own < 60 ? own : 60, set, key);
  else if (ep_yaml_locate(&r->loaded->yaml, key, &line, &column) || !r->nsets)
    snprintf(out, size, ":%d:%d: %.60s", line, column, key);
  else
    snprintf(out, size, " with --set: %.60s", key);
}

bool ep_read_given(const ep_scene_reader *r, const char *key) {
  int line, column, own;
  return (set_of(r, key, &own) && (size_t)own == strlen(key)) ||
         ep_yaml_locate(&r->loaded->yaml, key, &line, &column);
}

ep_status ep_read_refuse(const ep_scene_reader *r, const char *key, const char *format, ...) {
  char text[512];
  va_list args;
  va_start(args, format);
  vsnprintf(text, sizeof text, format, args);
  va_end(args);
  char place[136];
  ep_read_place(r, key, place, sizeof place);
  const bool in_file = r->nsets && !strstr(place, "--set"); // another key's value may not fit it
  return ep_fail(r->err, EP_ERR_SCENE, "%s%s: %s%s", r->name, place, text,
                 in_file ? " (with --set)" : "");
}

ep_status ep_read_number(const ep_scene_reader *r, const char *key, const double *given,
                         double fallback, double low, double high, double *out) {
  *out = given ? *given : fallback;
  if (!isfinite(*out) || *out < low || *out > high)
    return ep_read_refuse(r, key, "%g is out of range; use %g to %g", *out, low, high);
  return EP_OK;
}

ep_status ep_read_whole(const ep_scene_reader *r, const char *key, const double *given,
                        int fallback, int low, int high, int *out) {
  double value;
  EP_TRY(ep_read_number(r, key, given, fallback, low, high, &value));
  if (value != floor(value)) return ep_read_refuse(r, key, "%g is not a whole number", value);
  *out = (int)value;
  return EP_OK;
}

ep_status ep_read_vector(const ep_scene_reader *r, const char *key, const double *given,
                         double *out) {
  for (int i = 0; i < 3; i++) {
    if (!isfinite(given[i]) || fabs(given[i]) > 1e30)
      return ep_read_refuse(r, key, "component %d is %g; use finite numbers", i, given[i]);
    out[i] = given[i];
  }
  return EP_OK;
}

ep_status ep_read_bounded(const ep_scene_reader *r, const char *key, const double *given,
                          double most, double *out) {
  EP_TRY(ep_read_vector(r, key, given, out));
  for (int i = 0; i < 3; i++)
    if (fabs(out[i]) > most)
      return ep_read_refuse(r, key, "component %d, %g, is out of range; use %g to %g", i, out[i],
                            -most, most);
  return EP_OK;
}

ep_status ep_read_direction(const ep_scene_reader *r, const char *key, const char *what,
                            const double *given, double *out) {
  EP_TRY(ep_read_vector(r, key, given, out));
  const double largest = fmax(fabs(out[0]), fmax(fabs(out[1]), fabs(out[2])));
  if (largest == 0) return ep_read_refuse(r, key, "%s is zero", what);
  const int exponent = ilogb(largest);
  for (int i = 0; i < 3; i++) out[i] = ldexp(out[i], -exponent);
  return EP_OK;
}

ep_status ep_read_text(const ep_scene_reader *r, const char *text, char **out) {
  *out = strdup(text);
  return *out ? EP_OK : ep_fail(r->err, EP_ERR_MEMORY, "no memory for the scene");
}

ep_status ep_read_file(const ep_scene_reader *r, const char *key, const char *path, char **out) {
  char joined[EP_PATH_MAX];
  EP_TRY(ep_path_join(r->folder, path, joined, r->err));
  if (!ep_path_exists(joined)) return ep_read_refuse(r, key, "there is no file %s", joined);
  return ep_read_text(r, joined, out);
}

// An array of the object's vertices; whether the mesh has it shows when the mesh is read.
static ep_status field_selection(const ep_scene_reader *r, const char *key,
                                 const raw_selection *raw, ep_selection *out) {
  char part[96];
  out->kind = EP_SELECT_FIELD;
  out->equals = raw->equals != NULL;
  snprintf(part, sizeof part, "%.63s.%s", key, out->equals ? "equals" : "above");
  if (raw->above && raw->equals) return ep_read_refuse(r, key, "give one of above, equals");
  EP_TRY(ep_read_number(r, part, out->equals ? raw->equals : raw->above, 0.5, -1e300, 1e300,
                        &out->value));
  return ep_read_text(r, raw->field, &out->path);
}

// Whether anything lies there shows when the mesh is read: the place is kept for that message.
static void set_place(const ep_scene_reader *r, const char *key, ep_selection *out) {
  const size_t length = strlen(r->name), most = 90;
  char place[136];
  ep_read_place(r, key, place, sizeof place);
  snprintf(out->key, sizeof out->key, "%s%.90s%.135s", length > most ? "..." : "",
           r->name + (length > most ? length - most : 0), place);
}

ep_status ep_read_selection(const ep_scene_reader *r, const char *key, const raw_selection *raw,
                            ep_selection *out) {
  const raw_box *box = raw->box;
  const raw_plane *plane = raw->plane;
  set_place(r, key, out);
  if (!!box + !!plane + !!raw->file + !!raw->field != 1)
    return ep_read_refuse(r, key, "give one of box, plane, file, field");
  if (raw->field) return field_selection(r, key, raw, out);
  if (raw->above || raw->equals) return ep_read_refuse(r, key, "above and equals need a field");
  if (raw->file) {
    out->kind = EP_SELECT_FILE;
    return ep_read_file(r, key, raw->file, &out->path);
  }
  out->kind = box ? EP_SELECT_BOX : EP_SELECT_PLANE;
  EP_TRY(ep_read_vector(r, key, box ? box->low : plane->point, out->a));
  if (plane) return ep_read_direction(r, key, "plane: the normal", plane->normal, out->b);
  EP_TRY(ep_read_vector(r, key, box->high, out->b));
  for (int i = 0; i < 3; i++)
    if (out->a[i] > out->b[i])
      return ep_read_refuse(r, key, "box: low %g lies above high %g on axis %d", out->a[i],
                            out->b[i], i);
  return EP_OK;
}

ep_status ep_read_no_memory(const ep_scene_reader *r) {
  return ep_fail(r->err, EP_ERR_MEMORY, "no memory for the scene");
}

// NLopt's that go by gradients and need no second optimizer (LD_AUGLAG does).
static const char *const algorithms[] = {
    "LD_LBFGS",
    "LD_SLSQP",
    "LD_MMA",
    "LD_CCSAQ",
    "LD_VAR1",
    "LD_VAR2",
    "LD_TNEWTON",
    "LD_TNEWTON_RESTART",
    "LD_TNEWTON_PRECOND",
    "LD_TNEWTON_PRECOND_RESTART",
};

ep_status ep_read_algorithm(const ep_scene_reader *r, const char *key, const char *name,
                            char out[48]) {
  for (size_t i = 0; i < sizeof algorithms / sizeof *algorithms; i++) {
    if (strcmp(name, algorithms[i]) != 0) continue;
    snprintf(out, 48, "%s", name);
    return EP_OK;
  }
  return ep_read_refuse(r, key,
                        "'%.60s' is no local algorithm with gradients; there are LD_LBFGS, "
                        "LD_SLSQP, LD_MMA, LD_CCSAQ, LD_VAR1, LD_VAR2, LD_TNEWTON, "
                        "LD_TNEWTON_RESTART, LD_TNEWTON_PRECOND, LD_TNEWTON_PRECOND_RESTART",
                        name);
}
