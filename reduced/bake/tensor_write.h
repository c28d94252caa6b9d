// Writing named arrays (the layout of reduced/tensorfile.h) and models.
#ifndef EP_BAKE_TENSOR_WRITE_H
#define EP_BAKE_TENSOR_WRITE_H

#include "base/error.h"
#include "reduced/eigenpose.h"
#include "reduced/tensorfile.h"

typedef struct ep_metadata {
  const char *key, *value; // strings, escaped by the writer
} ep_metadata;

// Atomic (written beside and renamed), same input -> same bytes.
ep_status ep_tensorfile_write(const char *path, int count, const ep_tensor *tensors, int nmeta,
                              const ep_metadata *meta, ep_error *err);

// A model as .epm; meta adds to what the writer records itself (schema, sizes, material, real
// type, units).
ep_status ep_model_write(const char *path, const ep_model *model, int nmeta,
                         const ep_metadata *meta, ep_error *err);

// A file mapped into memory read-only. Unmap with ep_unmap.
typedef struct ep_mapping {
  void *bytes;
  size_t size;
} ep_mapping;
ep_status ep_map_file(const char *path, ep_mapping *out, ep_error *err);
void ep_unmap(ep_mapping *mapping);

#endif
