#define _POSIX_C_SOURCE 200809L
#include "reduced/bake/tensor_write.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/files.h"

enum { ALIGNMENT = 64, MAX_MODEL_META = 32 };

// ---- header text -------------------------------------------------------------------------------

typedef struct buffer {
  char *text;
  size_t used, capacity;
  int failed; // out of memory, once and for all
} buffer;

static void put(buffer *b, const char *text, size_t length) {
  if (b->failed) return;
  if (b->used + length > b->capacity) {
    size_t capacity = 2 * (b->used + length) + 1024;
    char *grown = realloc(b->text, capacity);
    if (!grown) {
      b->failed = 1;
      return;
    }
    b->text = grown, b->capacity = capacity;
  }
  memcpy(b->text + b->used, text, length);
  b->used += length;
}

static void put_text(buffer *b, const char *text) {
  put(b, text, strlen(text));
}

static void put_number(buffer *b, int64_t number) {
  char digits[32];
  snprintf(digits, sizeof digits, "%" PRId64, number);
  put_text(b, digits);
}

static void put_string(buffer *b, const char *text) {
  put_text(b, "\"");
  for (; *text; text++) {
    unsigned char c = (unsigned char)*text;
    char escape[8];
    if (c == '"' || c == '\\')
      snprintf(escape, sizeof escape, "\\%c", c);
    else if (c < 0x20)
      snprintf(escape, sizeof escape, "\\u%04x", c);
    else
      snprintf(escape, sizeof escape, "%c", c);
    put_text(b, escape);
  }
  put_text(b, "\"");
}

static const struct {
  const char *name;
  int size;
} dtypes[EP_DTYPES] = {{"F64", 8}, {"F32", 4}, {"I32", 4}, {"I64", 8}, {"U8", 1}};

static int64_t tensor_bytes(const ep_tensor *t) {
  int64_t bytes = dtypes[t->dtype].size;
  for (int i = 0; i < t->dims; i++) bytes *= t->shape[i];
  return bytes;
}

static int64_t padding(int64_t bytes) {
  return (ALIGNMENT - bytes % ALIGNMENT) % ALIGNMENT;
}

static void put_entry(buffer *b, const char *name, ep_dtype dtype, int dims, const int64_t *shape,
                      int64_t begin, int64_t end) {
  put_text(b, ",");
  put_string(b, name);
  put_text(b, ":{\"dtype\":\"");
  put_text(b, dtypes[dtype].name);
  put_text(b, "\",\"shape\":[");
  for (int i = 0; i < dims; i++) {
    if (i) put_text(b, ",");
    put_number(b, shape[i]);
  }
  put_text(b, "],\"data_offsets\":[");
  put_number(b, begin);
  put_text(b, ",");
  put_number(b, end);
  put_text(b, "]}");
}

// The header, padded with spaces so that the data starts at a multiple of 64 bytes. Gaps between
// arrays become arrays "pad.N": safetensors readers refuse holes.
static void put_header(buffer *b, int count, const ep_tensor *tensors, int nmeta,
                       const ep_metadata *meta) {
  int64_t at = 0;
  put_text(b, "{\"__metadata__\":{");
  for (int i = 0; i < nmeta; i++) {
    if (i) put_text(b, ",");
    put_string(b, meta[i].key);
    put_text(b, ":");
    put_string(b, meta[i].value);
  }
  put_text(b, "}");
  for (int i = 0; i < count; i++) {
    int64_t end = at + tensor_bytes(&tensors[i]), gap = padding(end);
    put_entry(b, tensors[i].name, tensors[i].dtype, tensors[i].dims, tensors[i].shape, at, end);
    if (gap && i + 1 < count) {
      char name[32];
      snprintf(name, sizeof name, "pad.%d", i);
      put_entry(b, name, EP_U8, 1, &gap, end, end + gap);
    }
    at = end + gap;
  }
  put_text(b, "}");
  while (!b->failed && (b->used + 8) % ALIGNMENT) put_text(b, " ");
}

// ---- files -------------------------------------------------------------------------------------

static ep_status check_tensors(int count, const ep_tensor *tensors, ep_error *err) {
  for (int i = 0; i < count; i++) {
    const ep_tensor *t = &tensors[i];
    int64_t bytes = 8;
    if (!memchr(t->name, '\0', sizeof t->name) || !t->name[0])
      return ep_fail(err, EP_ERR_ARGUMENT, "array %d has no name of 1 to 63 bytes", i);
    int good = t->dims >= 0 && t->dims <= 4 && (int)t->dtype >= 0 && (int)t->dtype < EP_DTYPES;
    for (int d = 0; good && d < t->dims; d++)
      good = t->shape[d] >= 0 && !__builtin_mul_overflow(bytes, t->shape[d], &bytes);
    if (!good)
      return ep_fail(err, EP_ERR_ARGUMENT, "array \"%s\" has an impossible shape", t->name);
    for (int j = 0; j < i; j++)
      if (strcmp(tensors[j].name, t->name) == 0)
        return ep_fail(err, EP_ERR_ARGUMENT, "two arrays are named \"%s\"", t->name);
  }
  return EP_OK;
}

static void write_body(FILE *file, const buffer *header, int count, const ep_tensor *tensors) {
  static const char zeros[ALIGNMENT];
  unsigned char length[8];
  for (int i = 0; i < 8; i++) length[i] = (unsigned char)((uint64_t)header->used >> (8 * i));
  fwrite(length, 1, sizeof length, file);
  fwrite(header->text, 1, header->used, file);
  for (int i = 0; i < count; i++) { // errors are sticky: ep_output_commit reports them
    int64_t bytes = tensor_bytes(&tensors[i]);
    if (bytes) fwrite(tensors[i].data, 1, (size_t)bytes, file);
    if (i + 1 < count) fwrite(zeros, 1, (size_t)padding(bytes), file);
  }
}

ep_status ep_tensorfile_write(const char *path, int count, const ep_tensor *tensors, int nmeta,
                              const ep_metadata *meta, ep_error *err) {
  EP_TRY(check_tensors(count, tensors, err));
  buffer header = {0};
  put_header(&header, count, tensors, nmeta, meta);
  if (header.failed) {
    free(header.text);
    return ep_fail(err, EP_ERR_MEMORY, "%s: out of memory for its header", path);
  }
  ep_output out;
  ep_status status = ep_output_open(&out, path, err);
  if (status == EP_OK) {
    write_body(out.file, &header, count, tensors);
    status = ep_output_commit(&out, err);
  }
  free(header.text);
  return status;
}

// ---- models ------------------------------------------------------------------------------------

static int model_tensors(const ep_model *model, ep_tensor *out) {
  const ep_model_sizes *z = &model->size;
  int count = 0;
#define DTYPE_double EP_F64
#define DTYPE_int32  EP_I32
#define DTYPE_float  EP_F32
#define SIZES(name)  const int64_t name = z->name;
#define ARRAY(type, array, d1, d2, d3)                                                             \
  if ((int64_t)(d1) * (d2) * (d3) > 0)                                                             \
    out[count++] =                                                                                 \
        (ep_tensor){#array, DTYPE_##type, 3, {(d1), (d2), (d3)}, (const void *)model->array};
  EP_MODEL_SIZES(SIZES)
  EP_MODEL_ARRAYS(ARRAY)
#undef ARRAY
#undef SIZES
  out[count++] = (ep_tensor){"rest_scale", EP_F64, 1, {1}, &model->rest_scale};
  return count;
}

static ep_status check_model(const char *path, const ep_model *model, ep_error *err) {
  const ep_model_sizes *z = &model->size;
  if (z->blocks != (z->r + 7) / 8)
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: blocks is %d, not %d = ceil(r / 8)", path, z->blocks,
                   (z->r + 7) / 8);
  if (!ep_material_name(model->material))
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: unknown material %d", path, (int)model->material);
  return EP_OK;
}

enum {
#define ONE(name) SIZE_##name,
  EP_MODEL_SIZES(ONE)
#undef ONE
      SIZE_COUNT
};

ep_status ep_model_write(const char *path, const ep_model *model, int nmeta,
                         const ep_metadata *meta, ep_error *err) {
  char size_text[SIZE_COUNT][16];
  ep_metadata all[MAX_MODEL_META];
  ep_tensor tensors[EP_MODEL_ARRAY_COUNT + 1];
  int used = 0, at = 0;
  EP_TRY(check_model(path, model, err));
  all[used++] = (ep_metadata){"format", "eigenpose-model"};
  all[used++] = (ep_metadata){"schema", "3"};
  all[used++] = (ep_metadata){"real", "f64"};
  all[used++] = (ep_metadata){"units", "SI"};
  all[used++] = (ep_metadata){"material", ep_material_name(model->material)};
#define ONE(name)                                                                                  \
  snprintf(size_text[at], sizeof size_text[at], "%d", model->size.name);                           \
  all[used++] = (ep_metadata){#name, size_text[at++]};
  EP_MODEL_SIZES(ONE)
#undef ONE
  if (nmeta > MAX_MODEL_META - used)
    return ep_fail(err, EP_ERR_ARGUMENT, "%s: %d metadata entries, at most %d fit", path, nmeta,
                   MAX_MODEL_META - used);
  for (int i = 0; i < nmeta; i++) {
    for (int j = 0; j < used; j++)
      if (strcmp(all[j].key, meta[i].key) == 0)
        return ep_fail(err, EP_ERR_ARGUMENT, "%s: metadata key \"%s\" is taken", path, meta[i].key);
    all[used++] = meta[i];
  }
  return ep_tensorfile_write(path, model_tensors(model, tensors), tensors, used, all, err);
}

// ---- mapping -----------------------------------------------------------------------------------

ep_status ep_map_file(const char *path, ep_mapping *out, ep_error *err) {
  *out = (ep_mapping){0};
  int file = open(path, O_RDONLY | O_CLOEXEC);
  if (file < 0) return ep_fail(err, EP_ERR_IO, "%s: cannot open: %s", path, strerror(errno));
  struct stat info;
  if (fstat(file, &info) != 0 || !S_ISREG(info.st_mode) || info.st_size <= 0) {
    close(file);
    return ep_fail(err, EP_ERR_IO, "%s: not a file with contents", path);
  }
  void *bytes = mmap(NULL, (size_t)info.st_size, PROT_READ, MAP_PRIVATE, file, 0);
  int cause = errno;
  close(file);
  if (bytes == MAP_FAILED)
    return ep_fail(err, EP_ERR_IO, "%s: cannot map into memory: %s", path, strerror(cause));
  *out = (ep_mapping){bytes, (size_t)info.st_size};
  return EP_OK;
}

void ep_unmap(ep_mapping *mapping) {
  if (mapping->bytes) munmap(mapping->bytes, mapping->size);
  *mapping = (ep_mapping){0};
}
