// What the fuzzer and the replay of its corpus both do with one input: each NAME_target.c defines
// it for one reader. Whatever comes, a reader gives a result that holds together or an error with a
// text.
#ifndef EP_TESTS_FUZZ_TARGET_H
#define EP_TESTS_FUZZ_TARGET_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

// Returns whether the input was accepted; aborts where a promise is broken.
bool fuzz_target(const uint8_t *data, size_t size);

static inline void must(bool good, const char *what) {
  if (good) return;
  fprintf(stderr, "a reader broke its promise: %s\n", what);
  abort();
}

#endif
