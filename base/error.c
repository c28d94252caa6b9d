#include "base/error.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

ep_status ep_fail(ep_error *err, ep_status status, const char *format, ...) {
  if (!err) return status;
  if (err->status != EP_OK) return err->status;
  err->status = status;
  va_list args;
  va_start(args, format);
  vsnprintf(err->text, sizeof err->text, format, args);
  va_end(args);
  return status;
}

ep_status ep_fail_context(ep_error *err, const char *format, ...) {
  if (!err) return EP_ERR_ARGUMENT;
  char where[sizeof err->text];
  va_list args;
  va_start(args, format);
  vsnprintf(where, sizeof where, format, args);
  va_end(args);
  // "where: text", cut at the end where both together are too long.
  const size_t room = sizeof err->text - 1, length = strlen(where);
  const size_t prefix = length < room - 2 ? length : room - 2;
  const size_t old = strlen(err->text), kept = old < room - prefix - 2 ? old : room - prefix - 2;
  memmove(err->text + prefix + 2, err->text, kept);
  memcpy(err->text, where, prefix);
  memcpy(err->text + prefix, ": ", 2);
  err->text[prefix + 2 + kept] = '\0';
  return err->status;
}

const char *ep_status_name(ep_status status) {
  static const char *const names[EP_STATUS_COUNT] = {
      "ok",    "argument", "io",      "format", "mesh",
      "scene", "match",    "numeric", "memory", "unsupported",
  };
  return (unsigned)status < EP_STATUS_COUNT ? names[status] : "unknown";
}
