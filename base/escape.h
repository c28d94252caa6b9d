// Text inside XML, HTML and JSON.
#ifndef EP_BASE_ESCAPE_H
#define EP_BASE_ESCAPE_H

#include <stdbool.h>
#include <stdio.h>

// text with &, <, >, " and ' as entities: fit for content and for attributes.
void ep_write_escaped(FILE *out, const char *text);

// Whether every byte belongs to a character of UTF-8 (RFC 3629: shortest form, no surrogates).
// Names of files may be any bytes; JSON may not.
bool ep_text_is_utf8(const char *text);

// text with each byte that belongs to no character replaced by U+FFFD; malloc'd, NULL without
// memory.
char *ep_text_to_utf8(const char *text);

#endif
