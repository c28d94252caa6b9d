#include "base/files.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

static ep_status io_error(ep_error *err, const char *what, const char *path) {
  return ep_fail(err, EP_ERR_IO, "%s %s: %s", what, path, strerror(errno));
}

static ep_status read_stream(FILE *file, const char *path, char **text, size_t *size,
                             ep_error *err) {
  size_t capacity = 1 << 16, used = 0;
  char *data = malloc(capacity);
  while (data) {
    used += fread(data + used, 1, capacity - used - 1, file);
    if (used < capacity - 1) break;
    char *larger = realloc(data, capacity *= 2);
    if (!larger) free(data);
    data = larger;
  }
  if (!data) return ep_fail(err, EP_ERR_MEMORY, "no memory to read %s", path);
  if (ferror(file)) {
    free(data);
    return io_error(err, "cannot read", path);
  }
  data[used] = '\0';
  *text = data;
  *size = used;
  return EP_OK;
}

ep_status ep_file_read(const char *path, char **text, size_t *size, ep_error *err) {
  *text = NULL;
  *size = 0;
  struct stat info;
  const bool there = stat(path, &info) == 0;
  if (there && S_ISDIR(info.st_mode))
    return ep_fail(err, EP_ERR_IO, "%s is a folder; name a file in it", path);
  if (there && (S_ISCHR(info.st_mode) || S_ISBLK(info.st_mode))) // may never end
    return ep_fail(err, EP_ERR_IO, "%s is a device; name a file", path);
  FILE *file = fopen(path, "rb");
  if (!file) return io_error(err, "cannot open", path);
  const ep_status status = read_stream(file, path, text, size, err);
  fclose(file);
  return status;
}

// A rename would put a file in the place of a folder or of /dev/null.
static ep_status require_file(const char *path, ep_error *err) {
  struct stat info;
  if (stat(path, &info) != 0 || S_ISREG(info.st_mode)) return EP_OK;
  if (S_ISDIR(info.st_mode))
    return ep_fail(err, EP_ERR_IO,
                   "cannot write the file %s: a folder of that name is there; take it away or name "
                   "another file",
                   path);
  return ep_fail(err, EP_ERR_IO, "cannot write %s: it is a device, no file; name a file", path);
}

ep_status ep_output_open(ep_output *out, const char *path, ep_error *err) {
  memset(out, 0, sizeof *out);
  if (strlen(path) >= sizeof out->path) return ep_fail(err, EP_ERR_IO, "path too long: %s", path);
  EP_TRY(require_file(path, err));
  strcpy(out->path, path);
  snprintf(out->temporary, sizeof out->temporary, "%s.%ld.tmp", path, (long)getpid());
  out->file = fopen(out->temporary, "wb");
  return out->file ? EP_OK : io_error(err, "cannot write", path);
}

ep_status ep_output_commit(ep_output *out, ep_error *err) {
  const bool bad = fflush(out->file) != 0 || ferror(out->file) || fsync(fileno(out->file)) != 0;
  const int cause = errno;
  const bool closed = fclose(out->file) == 0;
  out->file = NULL;
  if (bad || !closed) {
    if (bad) errno = cause;
    const ep_status status = io_error(err, "cannot write all of", out->path);
    unlink(out->temporary);
    return status;
  }
  if (rename(out->temporary, out->path) != 0) {
    const ep_status status = io_error(err, "cannot rename onto", out->path);
    unlink(out->temporary);
    return status;
  }
  return EP_OK;
}

void ep_output_discard(ep_output *out) {
  if (!out->file) return;
  fclose(out->file);
  out->file = NULL;
  unlink(out->temporary);
}

ep_status ep_file_write(const char *path, const void *bytes, size_t size, ep_error *err) {
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  fwrite(bytes, 1, size, out.file);
  return ep_output_commit(&out, err);
}

ep_status ep_make_folders(const char *path, ep_error *err) {
  char partial[EP_PATH_MAX];
  if (!*path) return ep_fail(err, EP_ERR_IO, "the name of a folder is empty");
  if (strlen(path) >= sizeof partial) return ep_fail(err, EP_ERR_IO, "path too long: %s", path);
  strcpy(partial, path);
  for (char *p = partial + 1;; p++) {
    if (*p != '/' && *p != '\0') continue;
    const char kept = *p;
    *p = '\0';
    struct stat info;
    if (mkdir(partial, 0777) != 0 && (errno != EEXIST || stat(partial, &info) != 0))
      return io_error(err, "cannot make folder", partial);
    if (stat(partial, &info) == 0 && !S_ISDIR(info.st_mode))
      return ep_fail(err, EP_ERR_IO, "%s is a file, but a folder is needed there", partial);
    *p = kept;
    if (!kept) return EP_OK;
  }
}

ep_status ep_output_folder(const char *path, ep_error *err) {
  EP_TRY(ep_make_folders(path, err));
  return access(path, W_OK | X_OK) == 0 ? EP_OK : io_error(err, "cannot write into folder", path);
}

ep_status ep_output_place(const char *path, ep_error *err) {
  char folder[EP_PATH_MAX];
  struct stat info;
  EP_TRY(ep_path_folder(path, folder, err));
  if (stat(path, &info) == 0 && S_ISDIR(info.st_mode))
    return ep_fail(err, EP_ERR_IO, "%s is a folder; name a file in it", path);
  EP_TRY(require_file(path, err));
  if (stat(folder, &info) != 0) return io_error(err, "cannot write into folder", folder);
  if (!S_ISDIR(info.st_mode))
    return ep_fail(err, EP_ERR_IO, "cannot write %s: %s is no folder", path, folder);
  return access(folder, W_OK | X_OK) == 0 ? EP_OK
                                          : io_error(err, "cannot write into folder", folder);
}

bool ep_path_same(const char *a, const char *b) {
  struct stat one, two;
  return stat(a, &one) == 0 && stat(b, &two) == 0 && one.st_dev == two.st_dev &&
         one.st_ino == two.st_ino;
}

ep_status ep_output_spares(const char *path, const char *input, ep_error *err) {
  if (!ep_path_same(path, input)) return EP_OK;
  return ep_fail(err, EP_ERR_IO, "%s is what is read here and would be written over; name another",
                 path);
}

ep_status ep_file_remove(const char *path, ep_error *err) {
  return unlink(path) == 0 || errno == ENOENT ? EP_OK : io_error(err, "cannot remove", path);
}

ep_status ep_path_join(const char *folder, const char *path, char *out, ep_error *err) {
  const int length = path[0] == '/' ? snprintf(out, EP_PATH_MAX, "%s", path)
                                    : snprintf(out, EP_PATH_MAX, "%s/%s", folder, path);
  if (length >= EP_PATH_MAX) return ep_fail(err, EP_ERR_IO, "path too long: %s/%s", folder, path);
  return EP_OK;
}

ep_status ep_path_folder(const char *path, char *out, ep_error *err) {
  const char *slash = strrchr(path, '/');
  const size_t length = slash ? (slash == path ? 1 : (size_t)(slash - path)) : 1;
  if (length >= EP_PATH_MAX) return ep_fail(err, EP_ERR_IO, "path too long: %s", path);
  memcpy(out, slash ? path : ".", length);
  out[length] = '\0';
  return EP_OK;
}

ep_status ep_path_stem(const char *path, char *out, ep_error *err) {
  const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
  const char *dot = strrchr(name, '.');
  const size_t length = dot && dot != name ? (size_t)(dot - name) : strlen(name);
  if (length >= EP_PATH_MAX) return ep_fail(err, EP_ERR_IO, "path too long: %s", path);
  memcpy(out, name, length);
  out[length] = '\0';
  return EP_OK;
}

const char *ep_path_extension(const char *path) {
  const char *slash = strrchr(path, '/'), *name = slash ? slash + 1 : path;
  const char *dot = strrchr(name, '.');
  return dot && dot != name ? dot + 1 : "";
}

bool ep_path_exists(const char *path) {
  return access(path, F_OK) == 0;
}

ep_digest ep_hash_bytes(const void *bytes, size_t size) {
  const XXH128_hash_t hash = XXH3_128bits(bytes, size);
  ep_digest digest;
  snprintf(digest.hex, sizeof digest.hex, "%016llx%016llx", (unsigned long long)hash.high64,
           (unsigned long long)hash.low64);
  return digest;
}

ep_status ep_hash_file(const char *path, ep_digest *digest, ep_error *err) {
  char *bytes;
  size_t size;
  EP_TRY(ep_file_read(path, &bytes, &size, err));
  *digest = ep_hash_bytes(bytes, size);
  free(bytes);
  return EP_OK;
}
