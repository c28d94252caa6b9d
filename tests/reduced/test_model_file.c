// Model files: what is written is read back bit by bit, twice the same bytes; a file cut at any
// length, foreign, future, or damaged in its header or contents is refused with a message, and
// never read beyond its end (the sanitizer build watches).
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "base/files.h"
#include "reduced/bake/tensor_write.h"
#include "tests/reduced/bar.h"

typedef struct image {
  unsigned char *bytes; // 64-byte aligned
  size_t size;
} image;

static image load(const char *path) {
  ep_error err = {0};
  char *text;
  image out;
  assert_int_equal(ep_file_read(path, &text, &out.size, &err), EP_OK);
  out.bytes = aligned_alloc(64, (out.size + 63) / 64 * 64);
  assert_non_null(out.bytes);
  memcpy(out.bytes, text, out.size);
  free(text);
  return out;
}

static image written(int k) {
  ep_error err = {0};
  bar *b = bar_create(2, 1, 1, 5, 7, k ? 3 : 0, k, EP_STABLE_NEOHOOKEAN);
  if (k) bar_add_guards(b, 9, 0.3);
  const ep_metadata meta = {"scene", "a \"quoted\" name\n\\ \xc3\xa4"};
  assert_int_equal(ep_model_write("model.epm", &b->model, 1, &meta, &err), EP_OK);
  bar_free(b);
  return load("model.epm");
}

static void same_arrays(const ep_model *x, const ep_model *y) {
  const int n = x->size.n, nt = x->size.nt, r = x->size.r, m = x->size.m;
  const int k = x->size.k, s = x->size.s, blocks = x->size.blocks, greens = x->size.greens;
  const int cubic = x->size.cubic, cubic_float = x->size.cubic_float;
  const int rigid = x->size.rigid, cubature_float = x->size.cubature_float;
  const int contacts = x->size.contacts, nodes = x->size.nodes;
  const int regions = x->size.regions, guards = x->size.guards;
#define SAME(type, name, d1, d2, d3)                                                               \
  if ((d1) * (d2) * (d3) == 0)                                                                     \
    assert_null(x->name);                                                                          \
  else                                                                                             \
    assert_memory_equal(x->name, y->name, sizeof *x->name *(size_t)((d1) * (d2) * (d3)));
  EP_MODEL_ARRAYS(SAME)
#undef SAME
}

static void comes_back_bit_by_bit(void **state) {
  (void)state;
  ep_error err = {0};
  for (int k = 0; k <= 2; k += 2) {
    bar *b = bar_create(2, 1, 1, 5, 7, k ? 3 : 0, k, EP_STABLE_NEOHOOKEAN);
    if (k) bar_add_guards(b, 9, 0.3);
    ep_mapping map;
    ep_model m;
    char message[256];
    assert_int_equal(ep_model_write("a.epm", &b->model, 0, NULL, &err), EP_OK);
    assert_int_equal(ep_map_file("a.epm", &map, &err), EP_OK);
    assert_int_equal(ep_model_open(map.bytes, map.size, &m, message), EP_OK);
    assert_string_equal(message, "");
    assert_memory_equal(&m.size, &b->model.size, sizeof m.size);
    assert_int_equal(m.material, b->model.material);
    assert_true(m.rest_scale == b->model.rest_scale);
    same_arrays(&m, &b->model);
    ep_unmap(&map);
    bar_free(b);
  }
}

static void same_input_same_bytes(void **state) {
  (void)state;
  image a = written(2), b = written(2);
  assert_int_equal(a.size, b.size);
  assert_memory_equal(a.bytes, b.bytes, a.size);
  ep_tensorfile file;
  char text[64];
  assert_int_equal(ep_tensorfile_open(a.bytes, a.size, &file, NULL), EP_OK);
  assert_int_equal(ep_tensorfile_metadata(&file, "scene", text, sizeof text), EP_OK);
  assert_string_equal(text, "a \"quoted\" name\n\\ \xc3\xa4");
  assert_int_equal(ep_tensorfile_metadata(&file, "scene", text, 10), EP_ERR_FORMAT);
  assert_int_equal(ep_tensorfile_metadata(&file, "nothing", text, sizeof text), EP_ERR_FORMAT);
  free(a.bytes), free(b.bytes);
}

static void refuse(const unsigned char *bytes, size_t size, const char *hint) {
  ep_model m;
  char message[256] = "";
  ep_status status = ep_model_open(bytes, size, &m, message);
  if (status != EP_ERR_FORMAT || !message[0] || (hint && !strstr(message, hint)))
    fail_msg("status %d, message \"%s\", expected \"%s\"", status, message, hint ? hint : "any");
}

// Every length of the header, and a spread of the data; each copy ends where its block ends.
static void every_cut_is_refused(void **state) {
  (void)state;
  image a = written(2);
  for (size_t size = 0; size < a.size; size += size < 4096 || a.size - size < 200 ? 1 : 97) {
    unsigned char *copy = NULL;
    assert_int_equal(posix_memalign((void **)&copy, 64, size ? size : 1), 0);
    memcpy(copy, a.bytes, size);
    refuse(copy, size, NULL);
    free(copy);
  }
  unsigned char *longer = aligned_alloc(64, (a.size + 127) / 64 * 64);
  assert_non_null(longer);
  memset(longer, 0, (a.size + 127) / 64 * 64);
  memcpy(longer, a.bytes, a.size);
  refuse(longer, a.size + 1, "bytes after the last array");
  free(longer), free(a.bytes);
}

// Replace text of equal length in the header.
static void edit(image *a, const char *from, const char *to) {
  const size_t length = strlen(from);
  assert_int_equal(length, strlen(to));
  for (size_t i = 8; i + length < a->size; i++) {
    if (memcmp(a->bytes + i, from, length) != 0) continue;
    memcpy(a->bytes + i, to, length);
    return;
  }
  fail_msg("no %s in the file", from);
}

static void damaged_headers_are_refused(void **state) {
  (void)state;
  static const char *const edits[][3] = {
      {"eigenpose-model", "something-other", "not an Eigenpose model"},
      {"\"schema\":\"3\"", "\"schema\":\"2\"", "schema 2; this version reads schema 3: bake"},
      {"\"schema\":\"3\"", "\"schema\":\"4\"", "schema 4"},
      {"\"real\":\"f64\"", "\"real\":\"f32\"", "f64"},
      {"neohookean", "neohookeax", "unknown material"},
      {"\"format\"", "\"fromat\"", "lacks \"format\""},
      {"\"r\":\"5\"", "\"r\":\"6\"", "does not fit"},
      {"\"r\":\"5\"", "\"r\":\"x\"", "whole number"},
      {"\"rest_x\"", "\"rest_y\"", "\"rest_x\": missing"},
      {"[7,1,72]", "[7,2,36]", "does not fit"},
      {"[7,1,72]", "[7,1,73]", "does not fit"},
      {"\"I32\"", "\"F32\"", "wrong number type"},
      {"\"I32\"", "\"Q32\"", "unknown dtype"},
      {"\"shape\"", "\"dtype\"", NULL},
      {"\"data_offsets\":[0,", "\"data_offsets\":[8,", "hole"},
      {"\"data_offsets\":[0,", "\"data_offsets\":[-,", "pair of whole"},
      {"\"data_offsets\":[0,", "\"data_offsets\" [0,", "broken JSON"},
      {"{\"__metadata__\"", "[\"__metadata__\"", "not a JSON object"},
      {"\"__metadata__\":{", "\"__metadata__\":[", "not an object of strings"},
  };
  for (size_t i = 0; i < sizeof edits / sizeof *edits; i++) {
    image a = written(2);
    edit(&a, edits[i][0], edits[i][1]);
    refuse(a.bytes, a.size, edits[i][2]);
    free(a.bytes);
  }
}

static void *array_of(image *a, const char *name) {
  ep_tensorfile file;
  ep_tensor t;
  assert_int_equal(ep_tensorfile_open(a->bytes, a->size, &file, NULL), EP_OK);
  assert_int_equal(ep_tensorfile_find(&file, name, &t), EP_OK);
  assert_int_equal((uintptr_t)t.data % 64, 0);
  return a->bytes + ((const unsigned char *)t.data - a->bytes);
}

static void damaged_contents_are_refused(void **state) {
  (void)state;
  image a = written(2);
  double *u = array_of(&a, "u"), *w = array_of(&a, "cubature_w"), keep = u[4];
  double *limit = array_of(&a, "guard_limit");
  int32_t *tets = array_of(&a, "tets");
  u[4] = NAN;
  refuse(a.bytes, a.size, "\"u\": not finite at element 4");
  u[4] = keep, keep = w[2], w[2] = -1;
  refuse(a.bytes, a.size, "\"cubature_w\": holds a negative");
  w[2] = keep, keep = limit[3];
  static const double shares[] = {0, -0.1, 1.5};
  for (int i = 0; i < 3; i++) {
    limit[3] = shares[i];
    refuse(a.bytes, a.size, "\"guard_limit\": holds a number that is not above 0 and at most 1");
  }
  limit[3] = keep, tets[5] = 1000;
  refuse(a.bytes, a.size, "\"tets\": holds an index out of range");
  free(a.bytes);
}

// Random damage anywhere in the header: refused or harmless, never a crash (sanitizers watch).
static void random_damage_does_no_harm(void **state) {
  (void)state;
  image a = written(1);
  uint32_t seed = 5;
  int refused = 0;
  for (int trial = 0; trial < 3000; trial++) {
    seed = seed * 1664525u + 1013904223u;
    unsigned char *at = a.bytes + (seed >> 8) % 2000, keep = *at;
    *at = (unsigned char)(seed >> 4);
    ep_model m;
    char message[256];
    refused += ep_model_open(a.bytes, a.size, &m, message) != EP_OK;
    *at = keep;
  }
  assert_true(refused > 1500);
  free(a.bytes);
}

static void unaligned_memory_is_an_argument_error(void **state) {
  (void)state;
  ep_model m;
  char message[256];
  image a = written(0);
  assert_int_equal(ep_model_open(a.bytes + 8, a.size - 8, &m, message), EP_ERR_ARGUMENT);
  assert_non_null(strstr(message, "aligned"));
  free(a.bytes);
}

static void writer_refuses_nonsense(void **state) {
  (void)state;
  ep_error err = {0};
  bar *b = bar_create(2, 1, 1, 5, 7, 0, 0, EP_STVK);
  b->model.size.blocks = 3;
  assert_int_equal(ep_model_write("x.epm", &b->model, 0, NULL, &err), EP_ERR_ARGUMENT);
  b->model.size.blocks = 1, err = (ep_error){0};
  const ep_metadata taken = {"schema", "7"};
  assert_int_equal(ep_model_write("x.epm", &b->model, 1, &taken, &err), EP_ERR_ARGUMENT);
  err = (ep_error){0};
  assert_int_equal(ep_model_write("no/such/folder/x.epm", &b->model, 0, NULL, &err), EP_ERR_IO);
  assert_false(ep_path_exists("x.epm"));
  ep_mapping map;
  err = (ep_error){0};
  assert_int_equal(ep_map_file("absent.epm", &map, &err), EP_ERR_IO);
  bar_free(b);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(comes_back_bit_by_bit),
      cmocka_unit_test(same_input_same_bytes),
      cmocka_unit_test(every_cut_is_refused),
      cmocka_unit_test(damaged_headers_are_refused),
      cmocka_unit_test(damaged_contents_are_refused),
      cmocka_unit_test(random_damage_does_no_harm),
      cmocka_unit_test(unaligned_memory_is_an_argument_error),
      cmocka_unit_test(writer_refuses_nonsense),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
