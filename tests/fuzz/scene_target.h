// Shared by the targets that read scenes: parses a scene whose files exist, checks what came out
// and resolves its landmarks on a small mesh.
#ifndef EP_TESTS_FUZZ_SCENE_TARGET_H
#define EP_TESTS_FUZZ_SCENE_TARGET_H

#include "tests/fuzz/target.h"

// text need not end in NUL. Comment lines "#set key=value" at its start are given as --set.
bool scene_holds(const char *text, size_t size);

#endif
