#include "mesh/scan.h"

#include <errno.h>
#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>

enum { NUMBER_LENGTH = 256, SHOWN_LENGTH = 40 };

ep_scan ep_scan_open(const char *name, const char *bytes, size_t size, char comment) {
  const char *at = bytes;
  if (size >= 3 && memcmp(bytes, "\xEF\xBB\xBF", 3) == 0) at += 3;
  return (ep_scan){
      .name = name, .start = bytes, .at = at, .end = bytes + size, .mark = at, .comment = comment};
}

// Of the mark; at the end of the file the last line that holds something.
static int line_of(const ep_scan *scan) {
  const char *mark = scan->mark;
  if (mark == scan->end)
    while (mark > scan->start && strchr(" \t\r\n", mark[-1]) && mark[-1]) mark--;
  int line = 1;
  for (const char *p = scan->start; p < mark; p++) line += *p == '\n';
  return line;
}

static ep_status fail_text(const ep_scan *scan, ep_status status, ep_error *err, bool byte,
                           const char *format, va_list args) {
  char text[768];
  vsnprintf(text, sizeof text, format, args);
  if (byte)
    return ep_fail(err, status, "%s: byte %td: %s", scan->name, scan->at - scan->start, text);
  return ep_fail(err, status, "%s:%d: %s", scan->name, line_of(scan), text);
}

ep_status ep_scan_fail(const ep_scan *scan, ep_error *err, const char *format, ...) {
  va_list args;
  va_start(args, format);
  const ep_status status = fail_text(scan, EP_ERR_FORMAT, err, false, format, args);
  va_end(args);
  return status;
}

ep_status ep_scan_fail_byte(const ep_scan *scan, ep_error *err, const char *format, ...) {
  va_list args;
  va_start(args, format);
  const ep_status status = fail_text(scan, EP_ERR_FORMAT, err, true, format, args);
  va_end(args);
  return status;
}

ep_status ep_scan_fail_as(const ep_scan *scan, ep_status status, ep_error *err, const char *format,
                          ...) {
  va_list args;
  va_start(args, format);
  fail_text(scan, status, err, false, format, args);
  va_end(args);
  return status;
}

static bool is_blank(const ep_scan *scan, char c) {
  return c == ' ' || (c >= '\t' && c <= '\r') || (scan->commas && c == ',');
}

static void skip_to_newline(ep_scan *scan) {
  while (scan->at < scan->end && *scan->at != '\n') scan->at++;
}

static void skip_blank(ep_scan *scan) {
  while (scan->at < scan->end) {
    if (scan->comment && *scan->at == scan->comment)
      skip_to_newline(scan);
    else if (is_blank(scan, *scan->at))
      scan->at++;
    else
      break;
  }
}

bool ep_scan_token(ep_scan *scan, ep_token *token) {
  skip_blank(scan);
  scan->mark = scan->at;
  const char *p = scan->at;
  while (p < scan->end && !is_blank(scan, *p) && !(scan->comment && *p == scan->comment) &&
         p - scan->at < INT_MAX)
    p++;
  *token = (ep_token){scan->at, (int)(p - scan->at)};
  scan->at = p;
  return token->length > 0;
}

ep_token ep_scan_peek(const ep_scan *scan) {
  ep_scan copy = *scan;
  ep_token token;
  ep_scan_token(&copy, &token);
  return token;
}

bool ep_token_is(ep_token token, const char *word) {
  return (size_t)token.length == strlen(word) &&
         strncasecmp(token.text, word, (size_t)token.length) == 0;
}

bool ep_token_same(ep_token a, ep_token b) {
  return a.length == b.length && memcmp(a.text, b.text, (size_t)a.length) == 0;
}

bool ep_scan_line(ep_scan *scan, ep_scan *line) {
  skip_blank(scan);
  scan->mark = scan->at;
  *line = *scan;
  skip_to_newline(scan);
  line->end = scan->at;
  return line->at < line->end;
}

void ep_scan_skip_line(ep_scan *scan) {
  skip_to_newline(scan);
  if (scan->at < scan->end) scan->at++;
}

static int shown(ep_token token) {
  return token.length < SHOWN_LENGTH ? token.length : SHOWN_LENGTH;
}

ep_status ep_scan_expect_end(ep_scan *scan, ep_error *err) {
  ep_token token;
  if (!ep_scan_token(scan, &token)) return EP_OK;
  return ep_scan_fail(scan, err, "'%.*s' is too much here", shown(token), token.text);
}

// The token as text of its own for the C library; fails where there is none.
static ep_status number_text(ep_scan *scan, const char *what, char text[NUMBER_LENGTH],
                             ep_error *err) {
  ep_token token;
  if (!ep_scan_token(scan, &token)) return ep_scan_fail(scan, err, "%s is missing", what);
  if (token.length >= NUMBER_LENGTH)
    return ep_scan_fail(scan, err, "%s: '%.*s...' is no number", what, SHOWN_LENGTH, token.text);
  memcpy(text, token.text, (size_t)token.length);
  text[token.length] = '\0';
  return EP_OK;
}

ep_status ep_scan_long(ep_scan *scan, const char *what, long long low, long long high,
                       long long *out, ep_error *err) {
  char text[NUMBER_LENGTH];
  EP_TRY(number_text(scan, what, text, err));
  const char *digits = text + (text[0] == '-' || text[0] == '+');
  if (!*digits || digits[strspn(digits, "0123456789")])
    return ep_scan_fail(scan, err, "%s: '%.*s' is not a whole number", what, SHOWN_LENGTH, text);
  errno = 0;
  const long long value = strtoll(text, NULL, 10);
  if (errno == ERANGE || value < low || value > high)
    return ep_scan_fail(scan, err, "%s is %.*s, but must lie in %lld to %lld", what, SHOWN_LENGTH,
                        text, low, high);
  *out = value;
  return EP_OK;
}

ep_status ep_scan_int(ep_scan *scan, const char *what, int low, int high, int *out, ep_error *err) {
  long long value;
  EP_TRY(ep_scan_long(scan, what, low, high, &value, err));
  *out = (int)value;
  return EP_OK;
}

ep_status ep_scan_double(ep_scan *scan, const char *what, double *out, ep_error *err) {
  char text[NUMBER_LENGTH], *rest = text;
  EP_TRY(number_text(scan, what, text, err));
  double value = 0;
  if (!text[strspn(text, "0123456789+-.eE")]) value = strtod(text, &rest);
  if (rest == text || *rest || !isfinite(value))
    return ep_scan_fail(scan, err, "%s: '%.*s' is not a finite number", what, SHOWN_LENGTH, text);
  *out = value;
  return EP_OK;
}

ep_status ep_scan_any_double(ep_scan *scan, const char *what, double *out, ep_error *err) {
  static const char *const words[] = {"nan", "inf", "infinity"};
  const ep_token token = ep_scan_peek(scan);
  const int sign = token.length && (token.text[0] == '-' || token.text[0] == '+');
  const ep_token plain = {token.text + sign, token.length - sign};
  for (size_t i = 0; i < sizeof words / sizeof *words; i++)
    if (ep_token_is(plain, words[i])) {
      *out = NAN;
      ep_token passed;
      ep_scan_token(scan, &passed);
      return EP_OK;
    }
  return ep_scan_double(scan, what, out, err);
}

ep_status ep_scan_doubles(ep_scan *scan, const char *what, int count, double *out, ep_error *err) {
  for (int i = 0; i < count; i++) EP_TRY(ep_scan_double(scan, what, out + i, err));
  return EP_OK;
}

ep_status ep_scan_skip_numbers(ep_scan *scan, long long count, const char *what, ep_error *err) {
  for (long long i = 0; i < count; i++) {
    ep_token token;
    if (!ep_scan_token(scan, &token)) return ep_scan_fail(scan, err, "%s is missing", what);
    if (token.length >= NUMBER_LENGTH || !memchr("0123456789+-.nNiI", token.text[0], 17))
      return ep_scan_fail(scan, err, "%s: '%.*s' is no number", what, shown(token), token.text);
  }
  return EP_OK;
}

bool ep_machine_big_endian(void) {
  const uint16_t one = 1;
  unsigned char first;
  memcpy(&first, &one, 1);
  return first == 0;
}

ep_status ep_scan_need(const ep_scan *scan, uint64_t bytes, const char *what, ep_error *err) {
  const uint64_t left = (uint64_t)(scan->end - scan->at);
  if (bytes <= left) return EP_OK;
  return ep_scan_fail_byte(scan, err, "the file ends too early: %s needs %llu bytes, %llu are left",
                           what, (unsigned long long)bytes, (unsigned long long)left);
}

static ep_status take(ep_scan *scan, bool swap, const char *what, size_t size, void *out,
                      ep_error *err) {
  EP_TRY(ep_scan_need(scan, size, what, err));
  unsigned char *to = out;
  for (size_t i = 0; i < size; i++) to[i] = (unsigned char)scan->at[swap ? size - 1 - i : i];
  scan->mark = scan->at;
  scan->at += size;
  return EP_OK;
}

ep_status ep_scan_i32(ep_scan *scan, bool swap, const char *what, int32_t *out, ep_error *err) {
  return take(scan, swap, what, sizeof *out, out, err);
}

ep_status ep_scan_i64(ep_scan *scan, bool swap, const char *what, int64_t *out, ep_error *err) {
  return take(scan, swap, what, sizeof *out, out, err);
}

ep_status ep_scan_f64(ep_scan *scan, bool swap, const char *what, double *out, ep_error *err) {
  return take(scan, swap, what, sizeof *out, out, err);
}

ep_status ep_c_locale_enter(ep_c_locale *state, ep_error *err) {
  state->before = (locale_t)0;
  state->c = newlocale(LC_ALL_MASK, "C", (locale_t)0);
  if (state->c == (locale_t)0) return ep_fail(err, EP_ERR_MEMORY, "no memory for the C locale");
  state->before = uselocale(state->c);
  return EP_OK;
}

void ep_c_locale_leave(ep_c_locale *state) {
  uselocale(state->before);
  freelocale(state->c);
}
