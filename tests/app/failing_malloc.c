// Preloaded into the program: the n-th allocation made by the program's own code fails, once.
// Allocations of shared libraries (PETSc, OpenBLAS, libc) are left alone: whether those survive is
// theirs. Environment: EP_FAIL_PROGRAM, the last part of the program's path; EP_FAIL_AT, n from 0
// (absent: none fails); EP_FAIL_COUNT, a file that receives how many there were.
#define _GNU_SOURCE // dl_iterate_phdr, RTLD_NEXT
#include <dlfcn.h>
#include <errno.h>
#include <link.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static atomic_long made;
static long fail_at = -1;
static uintptr_t code_begin, code_end; // of the program itself

static int first_object(struct dl_phdr_info *info, size_t size, void *user) {
  (void)size;
  (void)user;
  for (int i = 0; i < info->dlpi_phnum; i++) {
    const ElfW(Phdr) *part = &info->dlpi_phdr[i];
    if (part->p_type != PT_LOAD || !(part->p_flags & PF_X)) continue;
    code_begin = info->dlpi_addr + part->p_vaddr;
    code_end = code_begin + part->p_memsz;
  }
  return 1; // the program is the first object
}

__attribute__((constructor)) static void begin(void) {
  const char *program = getenv("EP_FAIL_PROGRAM"), *at = getenv("EP_FAIL_AT");
  char self[4096];
  const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
  if (!program || length < 0) return;
  self[length] = '\0';
  const char *slash = strrchr(self, '/');
  if (strcmp(slash ? slash + 1 : self, program) != 0) return;
  if (at) fail_at = strtol(at, NULL, 10);
  dl_iterate_phdr(first_object, NULL);
}

__attribute__((destructor)) static void end(void) {
  const char *path = getenv("EP_FAIL_COUNT");
  FILE *f = path && code_begin ? fopen(path, "w") : NULL;
  if (!f) return;
  fprintf(f, "%ld\n", atomic_load(&made));
  fclose(f);
}

static int fails(void *caller) {
  const uintptr_t from = (uintptr_t)caller;
  if (from < code_begin || from >= code_end) return 0;
  return atomic_fetch_add(&made, 1) == fail_at;
}

// The next object's functions, and a small store for what dlsym itself allocates before they are
// known.
static char early[8192];
static size_t early_used;

static void *next(const char *name) {
  return dlsym(RTLD_NEXT, name);
}

static void *take_early(size_t size) {
  const size_t at = (early_used + 15) / 16 * 16;
  if (size > sizeof early - at) abort();
  early_used = at + size;
  return early + at;
}

static int is_early(const void *p) {
  return (const char *)p >= early && (const char *)p < early + sizeof early;
}

#define NO_MEMORY                                                                                  \
  do {                                                                                             \
    if (fails(__builtin_return_address(0))) {                                                      \
      errno = ENOMEM;                                                                              \
      return NULL;                                                                                 \
    }                                                                                              \
  } while (0)

void *malloc(size_t size) {
  static void *(*real)(size_t);
  NO_MEMORY;
  if (!real) real = (void *(*)(size_t))next("malloc");
  return real(size);
}

void *calloc(size_t count, size_t size) {
  static void *(*real)(size_t, size_t);
  static int looking;
  NO_MEMORY;
  if (!real) {
    if (looking) return take_early(count * size);
    looking = 1;
    real = (void *(*)(size_t, size_t))next("calloc");
  }
  return real(count, size);
}

void *realloc(void *old, size_t size) {
  static void *(*real)(void *, size_t);
  NO_MEMORY;
  if (!real) real = (void *(*)(void *, size_t))next("realloc");
  return real(old, size);
}

void *aligned_alloc(size_t alignment, size_t size) {
  static void *(*real)(size_t, size_t);
  NO_MEMORY;
  if (!real) real = (void *(*)(size_t, size_t))next("aligned_alloc");
  return real(alignment, size);
}

void free(void *p) {
  static void (*real)(void *);
  if (is_early(p)) return;
  if (!real) real = (void (*)(void *))next("free");
  real(p);
}
