#include "app/scene/hash_text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static void chain(ep_hash_text *text, const char *item) {
  char joined[sizeof text->so_far.hex + 1024];
  const int length = snprintf(joined, sizeof joined, "%s|%s", text->so_far.hex, item);
  text->so_far = ep_hash_bytes(joined, (size_t)length);
}

void ep_hash_add(ep_hash_text *text, const char *format, ...) {
  char item[960];
  va_list args;
  va_start(args, format);
  vsnprintf(item, sizeof item, format, args);
  va_end(args);
  chain(text, item);
}

void ep_hash_add_bytes(ep_hash_text *text, const char *name, const void *bytes, size_t size) {
  ep_hash_add(text, "%s %zu %s", name, size, ep_hash_bytes(bytes, size).hex);
}

ep_digest ep_hash_done(const ep_hash_text *text) {
  return text->so_far;
}
