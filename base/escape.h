// Text inside XML and HTML.
#ifndef EP_BASE_ESCAPE_H
#define EP_BASE_ESCAPE_H

#include <stdio.h>

// text with &, <, >, " and ' as entities: fit for content and for attributes.
void ep_write_escaped(FILE *out, const char *text);

#endif
