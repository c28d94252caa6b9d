#include "app/plan/model_file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"

static double number_of(const ep_tensorfile *file, const char *key) {
  char text[64];
  return ep_tensorfile_metadata(file, key, text, sizeof text) == EP_OK ? strtod(text, NULL) : NAN;
}

ep_status ep_model_file_open(const char *path, ep_model_file *out, ep_error *err) {
  char message[256] = "";
  memset(out, 0, sizeof *out);
  EP_TRY(ep_map_file(path, &out->mapping, err));
  const ep_status status =
      ep_model_open(out->mapping.bytes, out->mapping.size, &out->model, message);
  ep_tensorfile file;
  if (status != EP_OK ||
      ep_tensorfile_open(out->mapping.bytes, out->mapping.size, &file, message) != EP_OK) {
    ep_model_file_close(out);
    return ep_fail(err, EP_ERR_FORMAT, "%s: %s; bake the scene again", path, message);
  }
  out->train_error = number_of(&file, "cubature_train_error");
  out->held_out_error = number_of(&file, "cubature_held_out_error");
  return EP_OK;
}

void ep_model_file_close(ep_model_file *file) {
  if (file->mapping.bytes) ep_unmap(&file->mapping);
  memset(file, 0, sizeof *file);
}

bool ep_model_usable(const char *path, ep_log *log) {
  if (!ep_path_exists(path)) return false;
  ep_model_file file;
  ep_error err = {0};
  if (ep_model_file_open(path, &file, &err) != EP_OK) {
    ep_notice(log, "cache: %s", err.text);
    return false;
  }
  ep_model_file_close(&file);
  return true;
}
