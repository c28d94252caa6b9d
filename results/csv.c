#include "results/csv.h"

#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/files.h"

static ep_status check_groups(int groups, const ep_csv_group *group, ep_error *err) {
  for (int g = 0; g < groups; g++) {
    if (!group[g].name[0] || strpbrk(group[g].name, ",\"\r\n"))
      return ep_fail(err, EP_ERR_ARGUMENT, "column name \"%s\" cannot stand in a CSV file",
                     group[g].name);
    if (group[g].components < 0 || (group[g].components > 0 && !group[g].data))
      return ep_fail(err, EP_ERR_ARGUMENT, "column group \"%s\" has no data", group[g].name);
  }
  return EP_OK;
}

static void put_number(FILE *file, double value) {
  char text[40];
  for (int digits = 15; digits <= 17; digits++) {
    snprintf(text, sizeof text, "%.*g", digits, value);
    if (isnan(value) || strtod(text, NULL) == value) break;
  }
  if (isnan(value)) strcpy(text, "nan");
  const char point = localeconv()->decimal_point[0];
  for (char *c = text; *c; c++)
    if (*c == point) *c = '.';
  fputs(text, file);
}

static void put_header(FILE *file, int groups, const ep_csv_group *group) {
  bool first = true;
  for (int g = 0; g < groups; g++)
    for (int i = 0; i < group[g].components; i++, first = false) {
      fprintf(file, "%s%s", first ? "" : ",", group[g].name);
      if (group[g].components > 1 || group[g].numbered) fprintf(file, "%d", i);
    }
  fputc('\n', file);
}

ep_status ep_csv_write(const char *path, int rows, int groups, const ep_csv_group *group,
                       ep_error *err) {
  EP_TRY(check_groups(groups, group, err));
  ep_output out;
  EP_TRY(ep_output_open(&out, path, err));
  put_header(out.file, groups, group);
  for (int row = 0; row < rows; row++) {
    bool first = true;
    for (int g = 0; g < groups; g++)
      for (int i = 0; i < group[g].components; i++, first = false) {
        if (!first) fputc(',', out.file);
        put_number(out.file, group[g].data[(size_t)row * (size_t)group[g].components + (size_t)i]);
      }
    fputc('\n', out.file);
  }
  return ep_output_commit(&out, err);
}
