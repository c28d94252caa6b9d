// Named arrays in one file: the safetensors layout (u64 little-endian header length, JSON header,
// raw arrays, each 64-byte aligned here). Used by the model file and by the bake's cache.
// Reading is run-time code: in place, no allocation. Writing is offline (bake/tensor_write.h).
#ifndef EP_REDUCED_TENSORFILE_H
#define EP_REDUCED_TENSORFILE_H

#include <stddef.h>
#include <stdint.h>

#include "base/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum ep_dtype { EP_F64, EP_F32, EP_I32, EP_I64, EP_U8, EP_DTYPES } ep_dtype;

typedef struct ep_tensor {
  char name[64];
  ep_dtype dtype;
  int dims;
  int64_t shape[4];
  const void *data;
} ep_tensor;

typedef struct ep_tensorfile {
  const unsigned char *bytes;
  size_t size;
  const char *header; // JSON text
  size_t header_size;
} ep_tensorfile;

// Check the envelope and every entry (offsets inside the file, ordered, size = shape x dtype).
// message (NULL or >= 256 chars) says what is wrong and where.
ep_status ep_tensorfile_open(const void *bytes, size_t size, ep_tensorfile *out, char *message);
// EP_ERR_FORMAT where there is no such array.
ep_status ep_tensorfile_find(const ep_tensorfile *file, const char *name, ep_tensor *out);
// A string of "__metadata__", unescaped into text (capacity). EP_ERR_FORMAT where absent or longer.
ep_status ep_tensorfile_metadata(const ep_tensorfile *file, const char *key, char *text,
                                 size_t capacity);

#ifdef __cplusplus
}
#endif
#endif
