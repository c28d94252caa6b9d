// A running text of what a result depends on, hashed to its name in the cache.
#ifndef EP_APP_SCENE_HASH_TEXT_H
#define EP_APP_SCENE_HASH_TEXT_H

#include "base/files.h"

// Starts as {0}. The chain is hash(previous hash, next item), so it never grows.
typedef struct ep_hash_text {
  ep_digest so_far;
} ep_hash_text;

void ep_hash_add(ep_hash_text *text, const char *format, ...) __attribute__((format(printf, 2, 3)));
void ep_hash_add_bytes(ep_hash_text *text, const char *name, const void *bytes, size_t size);
ep_digest ep_hash_done(const ep_hash_text *text);

#endif
