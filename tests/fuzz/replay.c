// Replays the corpus of one fuzz target (the folder EP_CORPUS) and EP_MUTATIONS bounded, repeatable
// mutations of each of its files: bytes changed, taken out, doubled, cut off, and numbers replaced
// by nasty ones. Runs with any compiler.
#include <dirent.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <string.h>
// clang-format off
#include <cmocka.h>
// clang-format on

#include "base/files.h"
#include "base/random.h"
#include "tests/fuzz/target.h"

enum { MOST_SEEDS = 128, MOST_BYTES = 1 << 15 };

typedef struct seed {
  char name[256];
  char *bytes;
  size_t size;
} seed;

typedef struct corpus {
  seed seed[MOST_SEEDS];
  int count;
} corpus;

static int by_name(const void *a, const void *b) {
  return strcmp(((const seed *)a)->name, ((const seed *)b)->name);
}

static void load(corpus *c) {
  static const char folder[] = EP_CORPUS;
  DIR *dir = opendir(folder);
  assert_non_null(dir);
  for (struct dirent *entry; (entry = readdir(dir)) && c->count < MOST_SEEDS;) {
    if (entry->d_name[0] == '.') continue;
    seed *s = c->seed + c->count++;
    char path[1024];
    snprintf(s->name, sizeof s->name, "%s", entry->d_name);
    snprintf(path, sizeof path, "%s/%s", folder, s->name);
    ep_error err = {0};
    if (ep_file_read(path, &s->bytes, &s->size, &err) != EP_OK) fail_msg("%s", err.text);
  }
  closedir(dir);
  qsort(c->seed, (size_t)c->count, sizeof *c->seed, by_name); // readdir has no fixed order
}

// Seeds named good-* must be accepted; the others (found by fuzzing) only kept
static void seeds_do_what_their_names_say(void **state) {
  const corpus *c = *state;
  assert_true(c->count >= 3);
  for (int i = 0; i < c->count; i++) {
    const seed *s = c->seed + i;
    const bool accepted = fuzz_target((const uint8_t *)s->bytes, s->size);
    if (strncmp(s->name, "good-", 5) == 0 && !accepted) fail_msg("%s is not read", s->name);
  }
}

static size_t splice(uint8_t *data, size_t size, size_t at, size_t out, const void *in,
                     size_t length) {
  if (out > size - at) out = size - at;
  if (size - out + length > MOST_BYTES) return size;
  memmove(data + at + length, data + at + out, size - at - out);
  memcpy(data + at, in, length);
  return size - out + length;
}

static size_t mutate(ep_random *rng, uint8_t *data, size_t size) {
  static const char *const nasty[] = {"-1",  "0",   "2147483647", "4294967296",
                                      "nan", "1e9", "\n",         "134217728"};
  const size_t at = (size_t)ep_random_below(rng, (int)size);
  uint8_t copy[64];
  const size_t length = (size_t)ep_random_below(rng, 64), left = size - at;
  switch (ep_random_below(rng, 6)) {
  case 0:
    data[at] = (uint8_t)ep_random_u32(rng);
    return size;
  case 1:
    data[at] ^= (uint8_t)(1u << ep_random_below(rng, 8));
    return size;
  case 2:
    return splice(data, size, at, length, "", 0);
  case 3:
    return at + 1;
  case 4: {
    const size_t take = length < left ? length : left;
    memcpy(copy, data + at, take);
    return splice(data, size, at, 0, copy, take);
  }
  default: {
    const char *text = nasty[ep_random_below(rng, 8)];
    return splice(data, size, at, (size_t)ep_random_below(rng, 4), text, strlen(text));
  }
  }
}

static void mutations_never_break_a_reader(void **state) {
  const corpus *c = *state;
  static uint8_t data[MOST_BYTES + 64];
  int accepted = 0, refused = 0;
  for (int i = 0; i < c->count; i++) {
    ep_random rng = ep_random_seed(1, (uint64_t)i);
    for (int n = 0; n < EP_MUTATIONS; n++) {
      size_t size = c->seed[i].size < MOST_BYTES ? c->seed[i].size : MOST_BYTES;
      memcpy(data, c->seed[i].bytes, size);
      for (int k = ep_random_below(&rng, 3); k >= 0 && size > 0; k--)
        size = mutate(&rng, data, size);
      uint8_t *exact = malloc(size ? size : 1); // so that a sanitizer sees a read past the end
      assert_non_null(exact);
      memcpy(exact, data, size);
      if (fuzz_target(exact, size))
        accepted++;
      else
        refused++;
      free(exact);
    }
  }
  assert_true(accepted > 0 && refused > accepted / 50); // the mutations reach both outcomes
}

int main(void) {
  static corpus c;
  load(&c);
  const struct CMUnitTest tests[] = {
      cmocka_unit_test_prestate(seeds_do_what_their_names_say, &c),
      cmocka_unit_test_prestate(mutations_never_break_a_reader, &c),
  };
  const int failed = cmocka_run_group_tests(tests, NULL, NULL);
  for (int i = 0; i < c.count; i++) free(c.seed[i].bytes);
  return failed;
}
