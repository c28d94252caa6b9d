// HTML pages that need nothing else: their head, the look they share, tables.
#ifndef EP_RESULTS_PAGE_H
#define EP_RESULTS_PAGE_H

#include <stdio.h>

// Up to and with the heading <h1>. style: rules of this page alone, after those all share.
void ep_page_begin(FILE *out, const char *title, const char *style);
void ep_page_end(FILE *out);

// A table that scrolls by itself, up to the first row of its body; heads that are NULL are left
// out.
void ep_page_table(FILE *out, int count, const char *const *head);
void ep_page_table_end(FILE *out);
// <td>, empty where the value is not finite. format takes one double.
void ep_page_cell(FILE *out, const char *format, double value);

#endif
