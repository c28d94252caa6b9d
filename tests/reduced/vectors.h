// Small helpers of the run-time tests. To be included after cmocka.h.
#ifndef EP_TESTS_REDUCED_VECTORS_H
#define EP_TESTS_REDUCED_VECTORS_H

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "tests/norms.h"

// Memory aligned to 64 bytes, full of what is no number: whoever reads what nobody wrote shows it.
static inline void *block_of(size_t bytes) {
  void *block = aligned_alloc(64, (bytes + 63) / 64 * 64);
  assert_non_null(block);
  memset(block, 0xff, bytes);
  return block;
}

#endif
