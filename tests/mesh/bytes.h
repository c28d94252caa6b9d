// Files put together in memory, byte by byte.
#ifndef EP_TESTS_MESH_BYTES_H
#define EP_TESTS_MESH_BYTES_H

#include <stdarg.h>

#include "mesh/io.h"
#include "tests/mesh/shapes.h"

typedef struct bytes {
  char data[16384];
  size_t size;
  bool big_endian;
} bytes;

static inline void put_raw(bytes *b, const void *data, size_t size) {
  assert_true(b->size + size <= sizeof b->data);
  memcpy(b->data + b->size, data, size);
  b->size += size;
}

__attribute__((format(printf, 2, 3))) static inline void put(bytes *b, const char *format, ...) {
  char text[1024];
  va_list args;
  va_start(args, format);
  const int length = vsnprintf(text, sizeof text, format, args);
  va_end(args);
  put_raw(b, text, (size_t)length);
}

// The low `size` bytes of a number in the file's byte order.
static inline void put_bits(bytes *b, uint64_t bits, int size) {
  for (int i = 0; i < size; i++) {
    const char byte = (char)(bits >> 8 * (b->big_endian ? size - 1 - i : i));
    put_raw(b, &byte, 1);
  }
}

static inline void put_i32(bytes *b, int32_t value) {
  put_bits(b, (uint32_t)value, 4);
}
static inline void put_i64(bytes *b, int64_t value) {
  put_bits(b, (uint64_t)value, 8);
}

static inline void put_f64(bytes *b, double value) {
  uint64_t bits;
  memcpy(&bits, &value, sizeof bits);
  put_bits(b, bits, 8);
}

static inline void put_f32(bytes *b, float value) {
  uint32_t bits;
  memcpy(&bits, &value, sizeof bits);
  put_bits(b, bits, 4);
}

static inline ep_status parse(ep_mesh_format format, const bytes *b, ep_mesh *m,
                              ep_mesh_findings *f, ep_error *err) {
  // An exact copy on the heap, so that a sanitizer sees a read past the end.
  char *copy = malloc(b->size ? b->size : 1);
  assert_non_null(copy);
  memcpy(copy, b->data, b->size);
  const ep_status status = ep_mesh_parse(format, "memory", copy, b->size, NULL, m, f, err);
  free(copy);
  return status;
}

static inline ep_mesh parse_ok(ep_mesh_format format, const bytes *b, ep_mesh_findings *f) {
  ep_mesh m;
  ep_error err = {0};
  assert_ok(parse(format, b, &m, f, &err), &err);
  return m;
}

// The mesh must be the cube of shapes.h, to the last bit.
static inline void assert_cube(const ep_mesh *m) {
  assert_int_equal(m->nv, 8);
  assert_int_equal(m->nt, 6);
  assert_memory_equal(m->x, cube_x, sizeof cube_x);
  assert_memory_equal(m->tet, cube_tet, sizeof cube_tet);
}

#endif
