// Baked results by content: files <stage>-<key>.ept in one folder, named arrays as in
// reduced/tensorfile.h with a digest of their bytes. What is broken is baked again.
#ifndef EP_APP_PLAN_CACHE_H
#define EP_APP_PLAN_CACHE_H

#include <stdbool.h>

#include "base/files.h"
#include "base/log.h"
#include "reduced/bake/tensor_write.h"

typedef struct ep_cache {
  char folder[EP_PATH_MAX];
} ep_cache;

// `given` (from --cache), else $EIGENPOSE_CACHE, else $XDG_CACHE_HOME/eigenpose, else
// ~/.cache/eigenpose. The folder is made by the first store. Errors: EP_ERR_IO without any of them.
ep_status ep_cache_open(const char *given, ep_cache *out, ep_error *err);

// Path of a result; characters of the stage's name that do not fit a file name become '-'.
void ep_cache_path(const ep_cache *cache, const char *stage, const ep_digest *key,
                   const char *extension, char *path);

// A result mapped into memory.
typedef struct ep_artifact {
  ep_mapping mapping;
  ep_tensorfile file;
} ep_artifact;

// Look a result up. false where it is absent or, with a notice, broken (truncated, bytes changed).
bool ep_cache_find(const ep_cache *cache, const char *stage, const ep_digest *key, ep_log *log,
                   ep_artifact *out);
void ep_artifact_close(ep_artifact *artifact);

// An array that must have this type and this many entries: NULL where it has not.
const void *ep_artifact_array(const ep_artifact *artifact, const char *name, ep_dtype dtype,
                              size_t count);

// Store arrays atomically.
ep_status ep_cache_store(const ep_cache *cache, const char *stage, const ep_digest *key, int count,
                         const ep_tensor *tensors, int nmeta, const ep_metadata *meta,
                         ep_error *err);

// A tensor description for ep_cache_store; shape entries of 0 end it early.
ep_tensor ep_tensor_of(const char *name, ep_dtype dtype, const void *data, int64_t d1, int64_t d2,
                       int64_t d3);

#endif
