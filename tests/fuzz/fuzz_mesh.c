// libFuzzer target: the first byte chooses the format, the rest is the file. Whatever comes, a
// reader must return a mesh that holds together or an error with a text.
#include "tests/fuzz/mesh_target.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  mesh_target(data, size);
  return 0;
}
