// Files of the offline part. Whole outputs are written beside their place and renamed, so that a
// reader never meets half a file and a failure loses nothing.
#ifndef EP_BASE_FILES_H
#define EP_BASE_FILES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include "base/error.h"

enum { EP_PATH_MAX = 4096 };

// Read a whole file; *text gets a terminating NUL after size bytes. Free with free().
ep_status ep_file_read(const char *path, char **text, size_t *size, ep_error *err);

// A file being written: "<path>.<pid>.tmp" until ep_output_commit renames it onto path.
typedef struct ep_output {
  FILE *file;
  char path[EP_PATH_MAX], temporary[EP_PATH_MAX + 32];
} ep_output;

ep_status ep_output_open(ep_output *out, const char *path, ep_error *err);
// Flushes, checks every write that came before (a full disk shows here), syncs and renames.
ep_status ep_output_commit(ep_output *out, ep_error *err);
// Removes what was written; path keeps its old content. Harmless after a commit.
void ep_output_discard(ep_output *out);

// Write size bytes as the whole file, atomically.
ep_status ep_file_write(const char *path, const void *bytes, size_t size, ep_error *err);

// mkdir -p.
ep_status ep_make_folders(const char *path, ep_error *err);
// The same for a folder of results, which must take files: known before long work, not behind it.
ep_status ep_output_folder(const char *path, ep_error *err);
// For one file of results: its folder must be there and take files, and the path be no folder and
// no device; made is nothing.
ep_status ep_output_place(const char *path, ep_error *err);
// Refused where both paths lead to one file: a result never replaces what it was made from.
ep_status ep_output_spares(const char *path, const char *input, ep_error *err);
// Remove a file if it is there.
ep_status ep_file_remove(const char *path, ep_error *err);

// Join base folder and path (kept as it is when absolute) into out (EP_PATH_MAX).
ep_status ep_path_join(const char *folder, const char *path, char *out, ep_error *err);
// The folder of a path ("." where it has none), into out (EP_PATH_MAX).
ep_status ep_path_folder(const char *path, char *out, ep_error *err);
// The last component, without its extension, into out (EP_PATH_MAX).
ep_status ep_path_stem(const char *path, char *out, ep_error *err);
// The extension without its dot, "" where there is none.
const char *ep_path_extension(const char *path);
bool ep_path_exists(const char *path);
bool ep_path_same(const char *a, const char *b); // two names of one file or folder

// 128-bit content hash (XXH3) as 32 hexadecimal digits and a NUL: names of cached results.
typedef struct ep_digest {
  char hex[33];
} ep_digest;
ep_digest ep_hash_bytes(const void *bytes, size_t size);
ep_status ep_hash_file(const char *path, ep_digest *digest, ep_error *err);

#endif
