// The map of a family: the input stands behind `map:` of a scene that is otherwise sound, so that
// the fuzzer spends its time on landmarks.
#include <string.h>

#include "tests/fuzz/scene_target.h"

static const char before[] = "schema: 1\n"
                             "object:\n"
                             "  mesh: ../meshes/bar.msh\n"
                             "  material: {density: 1000, young: 3.0e5, poisson: 0.4}\n"
                             "families:\n"
                             "  - rest: ../meshes/cylinder.veg\n"
                             "    poses: [../meshes/cylinder-s.veg, ../meshes/cylinder-twist.veg]\n"
                             "    map:\n";

bool fuzz_target(const uint8_t *data, size_t size) {
  const size_t length = sizeof before - 1;
  char *text = malloc(length + size);
  must(text != NULL, "memory");
  memcpy(text, before, length);
  if (size) memcpy(text + length, data, size);
  const bool good = scene_holds(text, length + size);
  free(text);
  return good;
}
