#include "results/page.h"

#include <math.h>

#include "base/escape.h"

static const char shared[] =
    "body{font:15px/1.5 system-ui,sans-serif;color:#1d2430;background:#fff;max-width:1360px;"
    "margin:2rem auto;padding:0 1rem}h1{font-size:1.5rem;margin:0 0 .2rem}h2{font-size:1.1rem;"
    "margin:2rem 0 .5rem}p{margin:.4rem 0;max-width:60rem}.scroll{overflow-x:auto}"
    "table{border-collapse:collapse;font-size:13px;font-variant-numeric:tabular-nums}"
    "th,td{padding:.22rem .34rem;border-bottom:1px solid #dde2e7;text-align:right;"
    "white-space:nowrap}th:first-child{text-align:left;font-weight:500}"
    "thead th{border-bottom:2px solid #8a93a0;font-weight:600}"
    ".failed{color:#a11}.good{color:#1e7d4d}.note{color:#566070}";

void ep_page_begin(FILE *out, const char *title, const char *style) {
  fputs("<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width, initial-scale=1\"><title>",
        out);
  ep_write_escaped(out, title);
  fprintf(out, "</title><style>%s%s</style></head><body>\n<h1>", shared, style);
  ep_write_escaped(out, title);
  fputs("</h1>\n", out);
}

void ep_page_end(FILE *out) {
  fputs("</body></html>\n", out);
}

void ep_page_table(FILE *out, int count, const char *const *head) {
  fputs("<div class=\"scroll\"><table><thead><tr>", out);
  for (int i = 0; i < count; i++)
    if (head[i]) fprintf(out, "<th>%s</th>", head[i]);
  fputs("</tr></thead><tbody>\n", out);
}

void ep_page_table_end(FILE *out) {
  fputs("</tbody></table></div>\n", out);
}

void ep_page_cell(FILE *out, const char *format, double value) {
  fputs("<td>", out);
  if (isfinite(value)) fprintf(out, format, value);
  fputs("</td>", out);
}
