// Claims: what was stored is found again under its key and no other; the same result makes the same
// bytes; a truncated or altered file is not used but said; the folder is chosen as documented; a
// failed write leaves nothing behind.
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "app/plan/cache.h"

static const double numbers[6] = {1, -2, 3.5, 0, 1e300, -0.25};
static const int whole[2] = {3, -4};

static ep_status store(const ep_cache *cache, const ep_digest *key, ep_error *err) {
  const ep_tensor tensors[] = {ep_tensor_of("a", EP_F64, numbers, 2, 3, 0),
                               ep_tensor_of("b", EP_I32, whole, 2, 0, 0)};
  return ep_cache_store(cache, "map:x/y", key, 2, tensors, 0, NULL, err);
}

static void what_is_stored_is_found(void **state) {
  (void)state;
  ep_cache cache;
  ep_error err = {0};
  ep_artifact found;
  const ep_digest key = ep_hash_bytes("k", 1), other = ep_hash_bytes("l", 1);
  assert_int_equal(ep_cache_open("cache", &cache, &err), EP_OK);
  if (store(&cache, &key, &err) != EP_OK) fail_msg("%s", err.text);
  assert_false(ep_cache_find(&cache, "map:x/y", &other, NULL, &found));
  assert_true(ep_cache_find(&cache, "map:x/y", &key, NULL, &found));
  const double *a = ep_artifact_array(&found, "a", EP_F64, 6);
  const int *b = ep_artifact_array(&found, "b", EP_I32, 2);
  assert_non_null(a);
  assert_non_null(b);
  assert_memory_equal(a, numbers, sizeof numbers);
  assert_memory_equal(b, whole, sizeof whole);
  assert_null(ep_artifact_array(&found, "a", EP_F64, 5));
  assert_null(ep_artifact_array(&found, "a", EP_I32, 6));
  assert_null(ep_artifact_array(&found, "c", EP_F64, 6));
  ep_artifact_close(&found);
}

static void the_same_result_makes_the_same_bytes(void **state) {
  (void)state;
  ep_cache cache;
  ep_error err = {0};
  char path[EP_PATH_MAX];
  ep_digest first, second;
  const ep_digest key = ep_hash_bytes("same", 4);
  assert_int_equal(ep_cache_open("cache", &cache, &err), EP_OK);
  ep_cache_path(&cache, "map:x/y", &key, "ept", path);
  assert_int_equal(store(&cache, &key, &err), EP_OK);
  assert_int_equal(ep_hash_file(path, &first, &err), EP_OK);
  unlink(path);
  assert_int_equal(store(&cache, &key, &err), EP_OK);
  assert_int_equal(ep_hash_file(path, &second, &err), EP_OK);
  assert_string_equal(first.hex, second.hex);
}

// Every prefix of the file, and the file with any one byte changed, is refused. (Bytes between
// arrays are padding: changing those does no harm and need not be seen.)
static void broken_files_are_not_used(void **state) {
  (void)state;
  ep_cache cache;
  ep_error err = {0};
  ep_artifact found;
  char path[EP_PATH_MAX], *bytes;
  size_t size;
  const ep_digest key = ep_hash_bytes("broken", 6);
  assert_int_equal(ep_cache_open("cache", &cache, &err), EP_OK);
  assert_int_equal(store(&cache, &key, &err), EP_OK);
  ep_cache_path(&cache, "map:x/y", &key, "ept", path);
  assert_int_equal(ep_file_read(path, &bytes, &size, &err), EP_OK);
  for (size_t cut = 0; cut < size; cut += cut < 64 ? 1 : 17) {
    assert_int_equal(ep_file_write(path, bytes, cut, &err), EP_OK);
    if (ep_cache_find(&cache, "map:x/y", &key, NULL, &found)) fail_msg("used with %zu bytes", cut);
  }
  int unseen = 0;
  for (size_t at = 0; at < size; at++) {
    bytes[at] ^= 0x5a;
    assert_int_equal(ep_file_write(path, bytes, size, &err), EP_OK);
    if (ep_cache_find(&cache, "map:x/y", &key, NULL, &found)) {
      const double *a = ep_artifact_array(&found, "a", EP_F64, 6);
      const int *b = ep_artifact_array(&found, "b", EP_I32, 2);
      if (a) assert_memory_equal(a, numbers, sizeof numbers);
      if (b) assert_memory_equal(b, whole, sizeof whole);
      ep_artifact_close(&found);
      unseen++;
    }
    bytes[at] ^= 0x5a;
  }
  assert_true(unseen < (int)size / 2);
  free(bytes);
}

static void the_folder_is_chosen_in_order(void **state) {
  (void)state;
  ep_cache cache;
  ep_error err = {0};
  setenv("HOME", "/h", 1);
  setenv("XDG_CACHE_HOME", "/x", 1);
  setenv("EIGENPOSE_CACHE", "/e", 1);
  assert_int_equal(ep_cache_open("/given", &cache, &err), EP_OK);
  assert_string_equal(cache.folder, "/given");
  assert_int_equal(ep_cache_open(NULL, &cache, &err), EP_OK);
  assert_string_equal(cache.folder, "/e");
  unsetenv("EIGENPOSE_CACHE");
  assert_int_equal(ep_cache_open(NULL, &cache, &err), EP_OK);
  assert_string_equal(cache.folder, "/x/eigenpose");
  unsetenv("XDG_CACHE_HOME");
  assert_int_equal(ep_cache_open(NULL, &cache, &err), EP_OK);
  assert_string_equal(cache.folder, "/h/.cache/eigenpose");
  unsetenv("HOME");
  assert_int_equal(ep_cache_open(NULL, &cache, &err), EP_ERR_IO);
}

// A full disk, imitated by a limit on file size: EP_ERR_IO, and no file under the result's name.
static void a_full_disk_leaves_nothing(void **state) {
  (void)state;
  ep_cache cache;
  ep_error err = {0};
  char path[EP_PATH_MAX];
  struct rlimit old, small;
  const ep_digest key = ep_hash_bytes("full", 4);
  assert_int_equal(ep_cache_open("cache", &cache, &err), EP_OK);
  signal(SIGXFSZ, SIG_IGN);
  getrlimit(RLIMIT_FSIZE, &old);
  small = old;
  small.rlim_cur = 100;
  setrlimit(RLIMIT_FSIZE, &small);
  const ep_status status = store(&cache, &key, &err);
  setrlimit(RLIMIT_FSIZE, &old);
  assert_int_equal(status, EP_ERR_IO);
  ep_cache_path(&cache, "map:x/y", &key, "ept", path);
  assert_false(ep_path_exists(path));
}

int main(void) {
  const struct CMUnitTest tests[] = {
      cmocka_unit_test(what_is_stored_is_found),
      cmocka_unit_test(the_same_result_makes_the_same_bytes),
      cmocka_unit_test(broken_files_are_not_used),
      cmocka_unit_test(a_full_disk_leaves_nothing),
      cmocka_unit_test(the_folder_is_chosen_in_order),
  };
  return cmocka_run_group_tests(tests, NULL, NULL);
}
