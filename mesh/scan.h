// Text scanner shared by the mesh readers (private to mesh/): works on bytes in memory, never past
// their end, knows the line for messages, reads numbers strictly and in the C locale.
#ifndef EP_MESH_SCAN_H
#define EP_MESH_SCAN_H

#include <locale.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/error.h"

// A view of [at, end) inside a file which begins at start. Copies are cheap and independent, so a
// line or a place to report later is simply a copy.
typedef struct ep_scan {
  const char *name;  // file name for messages
  const char *start; // first byte of the file: lines and offsets are counted from here
  const char *at, *end;
  const char *mark; // where the last token began: the place errors name
  char comment;     // starts a comment up to the end of the line; 0 for none
  bool commas;      // commas separate as blanks do
} ep_scan;

typedef struct ep_token {
  const char *text; // not terminated
  int length;
} ep_token;

// Skips a UTF-8 byte order mark.
ep_scan ep_scan_open(const char *name, const char *bytes, size_t size, char comment);

// "name:line: ..." of the last token; with _byte "name: byte N: ..." of the reading position.
ep_status ep_scan_fail(const ep_scan *scan, ep_error *err, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
ep_status ep_scan_fail_byte(const ep_scan *scan, ep_error *err, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
// The same with another status than EP_ERR_FORMAT.
ep_status ep_scan_fail_as(const ep_scan *scan, ep_status status, ep_error *err, const char *format,
                          ...) __attribute__((format(printf, 4, 5)));

// The next token; false (and length 0) at the end. Tokens are separated by white space.
bool ep_scan_token(ep_scan *scan, ep_token *token);
// The token without moving on.
ep_token ep_scan_peek(const ep_scan *scan);
// Case does not matter.
bool ep_token_is(ep_token token, const char *word);
bool ep_token_same(ep_token a, ep_token b); // case matters
// The next line that is not blank or comment as a view of its own; false at the end.
bool ep_scan_line(ep_scan *scan, ep_scan *line);
// Move behind the end of the present line.
void ep_scan_skip_line(ep_scan *scan);
// Fails if anything is left.
ep_status ep_scan_expect_end(ep_scan *scan, ep_error *err);

// A whole number in [low, high]; `what` names it in messages.
ep_status ep_scan_long(ep_scan *scan, const char *what, long long low, long long high,
                       long long *out, ep_error *err);
ep_status ep_scan_int(ep_scan *scan, const char *what, int low, int high, int *out, ep_error *err);
// A finite number: no "nan", "inf", hexadecimal, or anything behind it.
ep_status ep_scan_double(ep_scan *scan, const char *what, double *out, ep_error *err);
// Data may hold "nan" and infinities: both give NaN.
ep_status ep_scan_any_double(ep_scan *scan, const char *what, double *out, ep_error *err);
ep_status ep_scan_doubles(ep_scan *scan, const char *what, int count, double *out, ep_error *err);
// Pass over count tokens that must be numbers.
ep_status ep_scan_skip_numbers(ep_scan *scan, long long count, const char *what, ep_error *err);

// Binary numbers: `swap` where the file's byte order is not the machine's. They fail where fewer
// bytes are left.
ep_status ep_scan_need(const ep_scan *scan, uint64_t bytes, const char *what, ep_error *err);
ep_status ep_scan_i32(ep_scan *scan, bool swap, const char *what, int32_t *out, ep_error *err);
ep_status ep_scan_i64(ep_scan *scan, bool swap, const char *what, int64_t *out, ep_error *err);
ep_status ep_scan_f64(ep_scan *scan, bool swap, const char *what, double *out, ep_error *err);
bool ep_machine_big_endian(void);

// Numbers are read and written with a point whatever the user's locale: this thread is put into
// the C locale in between.
typedef struct ep_c_locale {
  locale_t c, before;
} ep_c_locale;
ep_status ep_c_locale_enter(ep_c_locale *state, ep_error *err);
void ep_c_locale_leave(ep_c_locale *state);

#endif
