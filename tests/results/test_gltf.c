// Claim: a .glb written is valid glTF 2.0 as far as its text says (chunks, alignment, ranges,
// bounds), and played back, base + sum_a weight_a target_a, it gives X + U q of every frame to
// single precision, with every weight in [0, 1]. Without memory, or with numbers that are none,
// there is no file.
#include "tests/results/harness.h"

#include <jansson.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"
#include "base/random.h"
#include "results/gltf.h"

enum { N = 9, R = 4, FRAMES = 5, TRIANGLES = 6 };

typedef struct setup {
  double x[N * 3], u[R * N * 3], q[FRAMES * R], time[FRAMES];
  int triangle[TRIANGLES * 3];
} setup;

// A cube cut open: vertex 4 is on no triangle, mode 3 stands still at 0.7.
static setup make_setup(void) {
  setup s;
  ep_random rng = ep_random_seed(7, 1);
  for (int i = 0; i < N * 3; i++) s.x[i] = ep_random_normal(&rng);
  for (int i = 0; i < R * N * 3; i++) s.u[i] = 0.3 * ep_random_normal(&rng);
  for (int f = 0; f < FRAMES; f++) {
    s.time[f] = f / 30.0;
    for (int a = 0; a < R; a++) s.q[f * R + a] = a == 3 ? 0.7 : 5 * ep_random_normal(&rng);
  }
  const int triangle[TRIANGLES * 3] = {0, 1, 2, 1, 2, 3, 3, 5, 6, 5, 6, 7, 6, 7, 8, 8, 0, 1};
  memcpy(s.triangle, triangle, sizeof triangle);
  return s;
}

static ep_gltf_animation animation_of(const setup *s) {
  ep_gltf_animation a = ep_default_gltf();
  a.n = N, a.r = R, a.frames = FRAMES, a.triangles = TRIANGLES;
  a.x = s->x, a.u = s->u, a.q = s->q, a.time = s->time, a.triangle = s->triangle;
  return a;
}

typedef struct glb {
  char *bytes;
  size_t size;
  json_t *root;
  const unsigned char *bin;
  size_t bin_size;
} glb;

static uint32_t u32(const char *p) {
  uint32_t value;
  memcpy(&value, p, 4);
  return value;
}

static glb read_glb(const char *path) {
  glb g = {0};
  ep_error err = {0};
  assert_int_equal(ep_file_read(path, &g.bytes, &g.size, &err), EP_OK);
  assert_memory_equal(g.bytes, "glTF", 4);
  assert_int_equal(u32(g.bytes + 4), 2);
  assert_int_equal(u32(g.bytes + 8), g.size);
  const uint32_t text = u32(g.bytes + 12);
  assert_int_equal(text % 4, 0);
  assert_memory_equal(g.bytes + 16, "JSON", 4);
  json_error_t error;
  g.root = json_loadb(g.bytes + 20, text, 0, &error);
  assert_non_null(g.root);
  const char *chunk = g.bytes + 20 + text;
  assert_memory_equal(chunk + 4, "BIN\0", 4);
  g.bin_size = u32(chunk);
  assert_int_equal(g.bin_size % 4, 0);
  assert_int_equal(28 + text + g.bin_size, g.size);
  g.bin = (const unsigned char *)chunk + 8;
  return g;
}

static void free_glb(glb *g) {
  json_decref(g->root);
  free(g->bytes);
}

static json_int_t number(json_t *object, const char *key) {
  json_t *value = json_object_get(object, key);
  assert_true(json_is_integer(value));
  return json_integer_value(value);
}

// Bytes of an accessor, after checking all the format demands of it.
static const float *accessor(const glb *g, json_int_t index, size_t *count, int components) {
  json_t *a = json_array_get(json_object_get(g->root, "accessors"), (size_t)index);
  json_t *view =
      json_array_get(json_object_get(g->root, "bufferViews"), (size_t)number(a, "bufferView"));
  *count = (size_t)number(a, "count");
  const size_t offset = (size_t)number(view, "byteOffset");
  assert_int_equal(offset % 4, 0);
  assert_int_equal((size_t)number(view, "byteLength"), 4 * *count * (size_t)components);
  assert_true(offset + 4 * *count * (size_t)components <= g->bin_size);
  assert_string_equal(json_string_value(json_object_get(a, "type")),
                      components == 3 ? "VEC3" : "SCALAR");
  const float *data = (const float *)(const void *)(g->bin + offset);
  for (int k = 0; k < components && json_object_get(a, "min"); k++) {
    float low = INFINITY, high = -INFINITY;
    for (size_t i = 0; i < *count; i++) {
      float value;
      memcpy(&value, data + i * (size_t)components + (size_t)k, 4);
      low = fminf(low, value);
      high = fmaxf(high, value);
    }
    json_t *min = json_object_get(a, "min"), *max = json_object_get(a, "max");
    assert_true((float)json_real_value(json_array_get(min, (size_t)k)) == low);
    assert_true((float)json_real_value(json_array_get(max, (size_t)k)) == high);
  }
  return data;
}

static json_t *primitive_of(const glb *g) {
  json_t *mesh = json_array_get(json_object_get(g->root, "meshes"), 0);
  return json_array_get(json_object_get(mesh, "primitives"), 0);
}

static float value_at(const float *data, size_t i) {
  float value;
  memcpy(&value, data + i, 4); // the chunk itself need not be aligned in memory
  return value;
}

static void test_plays_back(void **state) {
  (void)state;
  const setup s = make_setup();
  const ep_gltf_animation a = animation_of(&s);
  ep_error err = {0};
  assert_int_equal(ep_gltf_write("a.glb", &a, &err), EP_OK);
  glb g = read_glb("a.glb");
  json_t *primitive = primitive_of(&g), *targets = json_object_get(primitive, "targets");
  json_t *attributes = json_object_get(primitive, "attributes");
  json_t *animation = json_array_get(json_object_get(g.root, "animations"), 0);
  json_t *sampler = json_array_get(json_object_get(animation, "samplers"), 0);
  size_t nv, count;
  const float *base = accessor(&g, number(attributes, "POSITION"), &nv, 3);
  assert_int_equal(nv, N - 1);
  assert_int_equal(json_array_size(targets), R);
  const float *time = accessor(&g, number(sampler, "input"), &count, 1);
  assert_int_equal(count, FRAMES);
  const float *weight = accessor(&g, number(sampler, "output"), &count, 1);
  assert_int_equal(count, FRAMES * R);
  for (int f = 0; f < FRAMES; f++) {
    assert_true(value_at(time, (size_t)f) == (float)s.time[f]);
    for (size_t i = 0; i < 3 * nv; i++) {
      const size_t at = i + (i / 3 >= 4 ? 3 : 0); // vertex 4 is left out
      double want = s.x[at], got = (double)value_at(base, i), size = fabs(got);
      for (size_t m = 0; m < R; m++) {
        json_t *target = json_array_get(targets, m);
        const float *u = accessor(&g, number(target, "POSITION"), &count, 3);
        assert_int_equal(count, nv);
        const float w = value_at(weight, (size_t)f * R + m);
        assert_true(w >= 0 && w <= 1);
        want += s.u[m * N * 3 + at] * s.q[(size_t)f * R + m];
        got += (double)w * (double)value_at(u, i);
        size += fabs((double)value_at(u, i));
      }
      assert_true(fabs(got - want) <= 3e-7 * size); // a few units of 2^-24 of the terms added up
    }
  }
  free_glb(&g);
}

static void test_normals(void **state) {
  (void)state;
  const setup s = make_setup();
  const ep_gltf_animation a = animation_of(&s);
  assert_int_equal(ep_gltf_write("n.glb", &a, NULL), EP_OK);
  glb g = read_glb("n.glb");
  json_t *attributes = json_object_get(primitive_of(&g), "attributes");
  size_t nv;
  const float *normal = accessor(&g, number(attributes, "NORMAL"), &nv, 3);
  for (size_t v = 0; v < nv; v++) {
    double length = 0;
    for (size_t k = 0; k < 3; k++) length += pow((double)value_at(normal, 3 * v + k), 2);
    assert_true(fabs(length - 1) < 1e-5); // the validator's own tolerance is 5e-4
  }
  size_t count;
  const float *index = accessor(&g, number(primitive_of(&g), "indices"), &count, 1);
  assert_int_equal(count, TRIANGLES * 3);
  for (size_t i = 0; i < count; i++) {
    uint32_t value;
    memcpy(&value, index + i, 4);
    assert_int_equal(value, s.triangle[i] - (s.triangle[i] > 4));
  }
  free_glb(&g);
}

static void test_still_and_repeatable(void **state) {
  (void)state;
  const setup s = make_setup();
  ep_gltf_animation a = animation_of(&s);
  ep_digest one, two;
  assert_int_equal(ep_gltf_write("r1.glb", &a, NULL), EP_OK);
  assert_int_equal(ep_gltf_write("r2.glb", &a, NULL), EP_OK);
  assert_int_equal(ep_hash_file("r1.glb", &one, NULL), EP_OK);
  assert_int_equal(ep_hash_file("r2.glb", &two, NULL), EP_OK);
  assert_string_equal(one.hex, two.hex);
  a.r = 0, a.frames = 0; // a still: no targets, no animation
  assert_int_equal(ep_gltf_write("still.glb", &a, NULL), EP_OK);
  glb g = read_glb("still.glb");
  assert_null(json_object_get(g.root, "animations"));
  assert_null(json_object_get(primitive_of(&g), "targets"));
  free_glb(&g);
}

static void test_refuses(void **state) {
  (void)state;
  setup s = make_setup();
  ep_gltf_animation a = animation_of(&s);
  ep_error err = {0};
  s.time[2] = s.time[1];
  assert_int_equal(ep_gltf_write("bad.glb", &a, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "frame 2"));
  s = make_setup();
  s.q[2 * R + 1] = NAN;
  err = (ep_error){0};
  assert_int_equal(ep_gltf_write("bad.glb", &a, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "q1 of frame 2"));
  s = make_setup();
  s.u[5] = NAN;
  err = (ep_error){0};
  assert_int_equal(ep_gltf_write("bad.glb", &a, &err), EP_ERR_ARGUMENT);
  assert_non_null(strstr(err.text, "not a number"));
  s = make_setup();
  s.triangle[4] = N;
  assert_int_equal(ep_gltf_write("bad.glb", &a, NULL), EP_ERR_ARGUMENT);
  assert_false(ep_path_exists("bad.glb"));
}

static long until_failure = -1; // allocations of JSON still to succeed; negative: all do

static void *scarce(size_t size) {
  if (until_failure == 0) return NULL;
  if (until_failure > 0) until_failure--;
  return malloc(size);
}

// From the k-th allocation of the JSON on there is no memory: an error and no file, for every k up
// to the one that suffices, and then the file is whole.
static void test_no_memory_no_file(void **state) {
  (void)state;
  setup s = make_setup();
  ep_gltf_animation a = animation_of(&s);
  double pose[FRAMES * 12] = {0};
  for (int f = 0; f < FRAMES; f++)
    for (int i = 0; i < 3; i++) pose[12 * f + 3 + 4 * i] = 1;
  const ep_gltf_solid solid = {
      .n = N, .x = s.x, .triangles = TRIANGLES, .triangle = s.triangle, .pose = pose};
  a.pose = pose, a.solids = 1, a.solid = &solid;
  ep_digest whole, scant;
  assert_int_equal(ep_gltf_write("whole.glb", &a, NULL), EP_OK);
  assert_int_equal(ep_hash_file("whole.glb", &whole, NULL), EP_OK);
  remove("scant.glb"); // of an earlier run
  json_set_alloc_funcs(scarce, free);
  int k = 0;
  for (;; k++) {
    until_failure = k;
    ep_error err = {0};
    const ep_status status = ep_gltf_write("scant.glb", &a, &err);
    until_failure = -1;
    if (status == EP_OK) break;
    assert_true(err.text[0]);
    assert_false(ep_path_exists("scant.glb"));
  }
  json_set_alloc_funcs(malloc, free);
  assert_true(k > 100);
  assert_int_equal(ep_hash_file("scant.glb", &scant, NULL), EP_OK);
  assert_string_equal(whole.hex, scant.hex);
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(test_plays_back), cmocka_unit_test(test_normals),
      cmocka_unit_test(test_still_and_repeatable), cmocka_unit_test(test_refuses),
      cmocka_unit_test(test_no_memory_no_file)};
  return cmocka_run_group_tests(tests, NULL, NULL);
}
