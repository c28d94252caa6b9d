// Errors of the offline part: a status travels upward, the text says what was wrong, where, and
// what to do. One ep_error belongs to one call chain; the first failure is kept.
#ifndef EP_BASE_ERROR_H
#define EP_BASE_ERROR_H

#include "base/status.h"

typedef struct ep_error {
  ep_status status;
  char text[1024];
} ep_error;

// Record a failure and return its status, so that `return ep_fail(err, EP_ERR_IO, "...")` works.
// err may be NULL (the text is dropped). If err already holds a failure, that one is kept, and its
// status returned: the innermost cause knows most.
ep_status ep_fail(ep_error *err, ep_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

// Prefix the recorded text with where it happened ("scene bar.yaml: ..."). Returns err->status.
ep_status ep_fail_context(ep_error *err, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

// One word for a status ("format", "numeric"), for --json output.
const char *ep_status_name(ep_status status);

// Run `call`; on failure return its status from the enclosing function.
#define EP_TRY(call)                                                                               \
  do {                                                                                             \
    ep_status ep_try_status_ = (call);                                                             \
    if (ep_try_status_ != EP_OK) return ep_try_status_;                                            \
  } while (0)

// The same, but `goto label` so that the function can release what it owns; `status` is set.
#define EP_TRY_GOTO(status, call, label)                                                           \
  do {                                                                                             \
    (status) = (call);                                                                             \
    if ((status) != EP_OK) goto label;                                                             \
  } while (0)

#endif
