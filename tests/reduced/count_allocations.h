// Counts what a test program takes from the heap, through the linker's --wrap (CMakeLists.txt).
#ifndef EP_TESTS_REDUCED_COUNT_ALLOCATIONS_H
#define EP_TESTS_REDUCED_COUNT_ALLOCATIONS_H

#include <stddef.h>

static volatile int allocations; // compilers think malloc changes nothing

void *__real_malloc(size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_malloc(size_t size) {
  allocations++;
  return __real_malloc(size);
}

void *__real_calloc(size_t n, size_t size);
void *__wrap_calloc(size_t n, size_t size);
void *__wrap_calloc(size_t n, size_t size) {
  allocations++;
  return __real_calloc(n, size);
}

void *__real_realloc(void *p, size_t size);
void *__wrap_realloc(void *p, size_t size);
void *__wrap_realloc(void *p, size_t size) {
  allocations++;
  return __real_realloc(p, size);
}

#endif
