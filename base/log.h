// Notices and progress of long offline work, always on stderr: a bar with stage, rate and
// remaining time on a terminal, plain lines elsewhere. Results never go through here.
#ifndef EP_BASE_LOG_H
#define EP_BASE_LOG_H

#include <stdbool.h>

typedef struct ep_log {
  bool quiet;    // no notices, no progress; warnings and errors still appear
  bool mute;     // no warnings either
  bool terminal; // stderr is a terminal: progress is redrawn in place
  int warnings;  // how many were given, for the summary
  // progress of the stage under way (private)
  char stage[64];
  long done, total;
  double started, shown;
} ep_log;

// A log for this process: terminal is found out, nothing is quiet.
ep_log ep_log_default(bool quiet);

// All of these accept log == NULL and then do nothing.
void ep_notice(ep_log *log, const char *format, ...) __attribute__((format(printf, 2, 3)));
void ep_warn(ep_log *log, const char *format, ...) __attribute__((format(printf, 2, 3)));

// total: number of equal pieces of work, 0 where unknown. Stages do not nest: beginning one ends
// the one before.
void ep_progress_begin(ep_log *log, const char *stage, long total);
void ep_progress(ep_log *log, long done);
void ep_progress_end(ep_log *log);

// Seconds of a monotonic clock.
double ep_seconds(void);

#endif
