// Scene files, with overrides.
#include "tests/fuzz/scene_target.h"

bool fuzz_target(const uint8_t *data, size_t size) {
  return scene_holds((const char *)data, size);
}
