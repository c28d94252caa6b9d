#include "app/plan/cache.h"

#include <ctype.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "app/scene/hash_text.h"

enum { META_MAX = 8 };

ep_status ep_cache_open(const char *given, ep_cache *out, ep_error *err) {
  const char *own = getenv("EIGENPOSE_CACHE"), *xdg = getenv("XDG_CACHE_HOME");
  const char *home = getenv("HOME");
  int length;
  if (given)
    length = snprintf(out->folder, sizeof out->folder, "%s", given);
  else if (own && *own)
    length = snprintf(out->folder, sizeof out->folder, "%s", own);
  else if (xdg && *xdg)
    length = snprintf(out->folder, sizeof out->folder, "%s/eigenpose", xdg);
  else if (home && *home)
    length = snprintf(out->folder, sizeof out->folder, "%s/.cache/eigenpose", home);
  else
    return ep_fail(err, EP_ERR_IO,
                   "no place for the cache: give --cache DIR or set "
                   "EIGENPOSE_CACHE or HOME");
  if (length >= (int)sizeof out->folder - 256)
    return ep_fail(err, EP_ERR_IO, "the cache folder's name is too long");
  return EP_OK;
}

void ep_cache_path(const ep_cache *cache, const char *stage, const ep_digest *key,
                   const char *extension, char *path) {
  char plain[100];
  snprintf(plain, sizeof plain, "%s", stage);
  for (char *p = plain; *p; p++)
    if (!isalnum((unsigned char)*p) && *p != '.' && *p != '_') *p = '-';
  snprintf(path, EP_PATH_MAX, "%.*s/%s-%s.%s", EP_PATH_MAX - 160, cache->folder, plain, key->hex,
           extension);
}

static size_t entries(const ep_tensor *tensor) {
  size_t count = 1;
  for (int i = 0; i < tensor->dims; i++) count *= (size_t)tensor->shape[i];
  return count;
}

static size_t bytes_of(const ep_tensor *tensor) {
  static const size_t width[EP_DTYPES] = {8, 4, 4, 8, 1};
  return entries(tensor) * width[tensor->dtype];
}

// The stored list of array names lets a reader digest them in the writer's order.
static ep_digest digest_arrays(int count, const ep_tensor *tensors) {
  ep_hash_text text = {0};
  for (int i = 0; i < count; i++)
    ep_hash_add_bytes(&text, tensors[i].name, tensors[i].data, bytes_of(&tensors[i]));
  return ep_hash_done(&text);
}

static bool digest_agrees(const ep_tensorfile *file) {
  char names[1024], digest[40];
  if (ep_tensorfile_metadata(file, "arrays", names, sizeof names) != EP_OK ||
      ep_tensorfile_metadata(file, "digest", digest, sizeof digest) != EP_OK)
    return false;
  ep_hash_text text = {0};
  char *rest = names;
  for (char *name; (name = strsep(&rest, " ")) != NULL;) {
    ep_tensor tensor;
    if (!*name) continue;
    if (ep_tensorfile_find(file, name, &tensor) != EP_OK) return false;
    ep_hash_add_bytes(&text, name, tensor.data, bytes_of(&tensor));
  }
  return strcmp(ep_hash_done(&text).hex, digest) == 0;
}

bool ep_cache_find(const ep_cache *cache, const char *stage, const ep_digest *key, ep_log *log,
                   ep_artifact *out) {
  char path[EP_PATH_MAX], message[256] = "";
  memset(out, 0, sizeof *out);
  ep_cache_path(cache, stage, key, "ept", path);
  if (!ep_path_exists(path)) return false;
  ep_error err = {0};
  bool good = ep_map_file(path, &out->mapping, &err) == EP_OK;
  if (!good) snprintf(message, sizeof message, "%.255s", err.text);
  if (good)
    good = ep_tensorfile_open(out->mapping.bytes, out->mapping.size, &out->file, message) == EP_OK;
  if (good && !digest_agrees(&out->file)) {
    snprintf(message, sizeof message, "its content has changed");
    good = false;
  }
  if (good) return true;
  ep_notice(log, "cache: %s is broken (%s); the stage is computed again", path, message);
  ep_artifact_close(out);
  return false;
}

void ep_artifact_close(ep_artifact *artifact) {
  if (artifact->mapping.bytes) ep_unmap(&artifact->mapping);
  memset(artifact, 0, sizeof *artifact);
}

const void *ep_artifact_array(const ep_artifact *artifact, const char *name, ep_dtype dtype,
                              size_t count) {
  ep_tensor tensor;
  if (ep_tensorfile_find(&artifact->file, name, &tensor) != EP_OK) return NULL;
  return tensor.dtype == dtype && entries(&tensor) == count ? tensor.data : NULL;
}

ep_status ep_cache_store(const ep_cache *cache, const char *stage, const ep_digest *key, int count,
                         const ep_tensor *tensors, int nmeta, const ep_metadata *meta,
                         ep_error *err) {
  char path[EP_PATH_MAX], names[1024] = "";
  ep_metadata all[META_MAX];
  if (nmeta > META_MAX - 2) return ep_fail(err, EP_ERR_ARGUMENT, "too much metadata");
  EP_TRY(ep_make_folders(cache->folder, err));
  ep_cache_path(cache, stage, key, "ept", path);
  for (int i = 0; i < count; i++) {
    const size_t used = strlen(names);
    snprintf(names + used, sizeof names - used, "%s%s", i ? " " : "", tensors[i].name);
  }
  const ep_digest digest = digest_arrays(count, tensors);
  for (int i = 0; i < nmeta; i++) all[i] = meta[i];
  all[nmeta] = (ep_metadata){"arrays", names};
  all[nmeta + 1] = (ep_metadata){"digest", digest.hex};
  return ep_tensorfile_write(path, count, tensors, nmeta + 2, all, err);
}

ep_tensor ep_tensor_of(const char *name, ep_dtype dtype, const void *data, int64_t d1, int64_t d2,
                       int64_t d3) {
  ep_tensor tensor = {.dtype = dtype, .data = data, .shape = {d1, d2, d3, 0}};
  snprintf(tensor.name, sizeof tensor.name, "%s", name);
  tensor.dims = d2 == 0 ? 1 : d3 == 0 ? 2 : 3;
  return tensor;
}
