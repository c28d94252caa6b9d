#include "app/blas_core.h"

#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

extern char *openblas_get_corename(void);

// Kernels OpenBLAS chooses for x86 processors without AVX2, or that it does not know.
static int outdated(const char *name) {
  static const char *const old[] = {"Prescott",    "Katmai", "Coppermine", "Northwood", "Banias",
                                    "Core2",       "Penryn", "Dunnington", "Atom",      "Nehalem",
                                    "Sandybridge", "Athlon", "Opteron",    "Barcelona", "Bobcat"};
  for (size_t i = 0; i < sizeof old / sizeof *old; i++)
    if (strcasecmp(name, old[i]) == 0) return 1;
  return strncasecmp(name, "Opteron", 7) == 0;
}

const char *ep_blas_core_better(const char *in_use, int avx2, int avx512) {
  if (!in_use || !outdated(in_use)) return NULL;
  return avx512 ? "SkylakeX" : avx2 ? "Haswell" : NULL;
}

void ep_blas_core_check(char **argv) {
#if defined(__x86_64__)
  // Set by a person, or by this function before.
  if (getenv("OPENBLAS_CORETYPE")) return;
  const int avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma");
  const int avx512 = __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
                     __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl") &&
                     __builtin_cpu_supports("avx512cd");
  const char *better = ep_blas_core_better(openblas_get_corename(), avx2, avx512);
  if (!better || setenv("OPENBLAS_CORETYPE", better, 1) != 0) return;
  execv("/proc/self/exe", argv); // on failure: go on with slow kernels
#else
  (void)argv;
#endif
}
