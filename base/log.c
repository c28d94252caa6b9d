#include "base/log.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/ioctl.h>
#include <time.h>
#include <unistd.h>

enum { BAR_WIDTH = 24, BAR_LEAST = 4 };
static const double redraw_seconds = 0.1, line_seconds = 5.0;

double ep_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

ep_log ep_log_default(bool quiet) {
  return (ep_log){.quiet = quiet, .terminal = isatty(STDERR_FILENO) == 1};
}

static void clear_bar(const ep_log *log) {
  if (log->terminal && log->stage[0]) fputs("\r\033[K", stderr);
}

static void print_line(ep_log *log, const char *prefix, const char *format, va_list args) {
  clear_bar(log);
  fputs(prefix, stderr);
  vfprintf(stderr, format, args);
  fputc('\n', stderr);
}

void ep_notice(ep_log *log, const char *format, ...) {
  if (!log || log->quiet) return;
  va_list args;
  va_start(args, format);
  print_line(log, "", format, args);
  va_end(args);
}

void ep_warn(ep_log *log, const char *format, ...) {
  if (!log || log->mute) return;
  log->warnings++;
  va_list args;
  va_start(args, format);
  print_line(log, "warning: ", format, args);
  va_end(args);
}

// Elapsed and remaining time, and the rate where a total is known.
static void describe(const ep_log *log, double now, char *text, size_t size) {
  const double elapsed = now - log->started;
  if (log->total <= 0 || log->done <= 0) {
    snprintf(text, size, "%.1f s", elapsed);
    return;
  }
  const double rate = (double)log->done / (elapsed > 1e-9 ? elapsed : 1e-9);
  snprintf(text, size, "%3ld%%  %ld/%ld  %.3g/s  %.0f s left", 100 * log->done / log->total,
           log->done, log->total, rate, (double)(log->total - log->done) / rate);
}

static int terminal_width(void) {
  struct winsize size;
  return ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

// One line: what runs over its end stays where it is when the line is drawn again. The bar
// gives way first.
static void draw(const ep_log *log, const char *text) {
  const int room = terminal_width() - 1; // terminals go on to the next line behind the last column
  const int free = room - (int)strlen(text) - 26; // name, brackets and blanks
  const int width = free < BAR_WIDTH ? free : BAR_WIDTH;
  const long filled = log->total > 0 ? width * log->done / log->total : 0;
  char bar[BAR_WIDTH + 4] = "", line[256];
  if (width >= BAR_LEAST) {
    for (int i = 0; i < width; i++) bar[i + 1] = i < filled ? '#' : '.';
    bar[0] = '[';
    memcpy(bar + 1 + width, "] ", 3);
  }
  snprintf(line, sizeof line, "%-22s %s%s", log->stage, bar, text);
  fprintf(stderr, "\r\033[K%.*s", room > 0 ? room : 1, line);
  fflush(stderr);
}

static void show(ep_log *log, double now) {
  char text[128];
  describe(log, now, text, sizeof text);
  if (!log->terminal) {
    fprintf(stderr, "%s: %s\n", log->stage, text);
    return;
  }
  draw(log, text);
}

void ep_progress_begin(ep_log *log, const char *stage, long total) {
  if (!log || log->quiet) return;
  ep_progress_end(log);
  snprintf(log->stage, sizeof log->stage, "%s", stage);
  log->done = 0;
  log->total = total;
  log->started = log->shown = ep_seconds();
  if (log->terminal) show(log, log->started);
}

void ep_progress(ep_log *log, long done) {
  if (!log || log->quiet || !log->stage[0]) return;
  log->done = done;
  const double now = ep_seconds();
  if (now - log->shown < (log->terminal ? redraw_seconds : line_seconds)) return;
  log->shown = now;
  show(log, now);
}

void ep_progress_end(ep_log *log) {
  if (!log || log->quiet || !log->stage[0]) return;
  clear_bar(log);
  fprintf(stderr, "%-22s %.2f s\n", log->stage, ep_seconds() - log->started);
  log->stage[0] = '\0';
}
