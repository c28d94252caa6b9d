// Tables for spreadsheets and scripts: CSV.
#ifndef EP_RESULTS_CSV_H
#define EP_RESULTS_CSV_H

#include <stdbool.h>
#include <stddef.h>

#include "base/error.h"

// A group of columns with the same name: "t" alone, or "q0", "q1", ... where components > 1.
typedef struct ep_csv_group {
  const char *name;   // no comma, quote or line break
  int components;     // 0 leaves the group out
  const double *data; // (rows x components), row-major
  bool numbered;      // number even a single component (a trajectory with r = 1 still says q0)
} ep_csv_group;

// Comma separated, one header line, '.' as decimal point whatever the locale, every number with the
// fewest digits that read back to the same double (NaN as "nan", infinities as "inf", "-inf").
// Errors: EP_ERR_ARGUMENT (name), EP_ERR_IO.
ep_status ep_csv_write(const char *path, int rows, int groups, const ep_csv_group *group,
                       ep_error *err);

#endif
