#include "base/escape.h"

#include <stdlib.h>
#include <string.h>

void ep_write_escaped(FILE *out, const char *text) {
  static const char special[] = "&<>\"'";
  static const char *const entity[] = {"&amp;", "&lt;", "&gt;", "&quot;", "&apos;"};
  for (; *text; text++) {
    const char *found = strchr(special, *text);
    if (found)
      fputs(entity[found - special], out);
    else
      fputc(*text, out);
  }
}

// Bytes of the character at text, 0 where it is none.
static size_t character(const unsigned char *text) {
  static const unsigned lowest[5] = {0, 0, 0x80, 0x800, 0x10000};
  const unsigned first = text[0];
  if (first < 0x80) return 1;
  const size_t size = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : 2;
  if (first < 0xc2 || first > 0xf4) return 0;
  unsigned code = first & (0x7fu >> size);
  for (size_t i = 1; i < size; i++) {
    if ((text[i] & 0xc0) != 0x80) return 0; // the end of the text too
    code = code << 6 | (text[i] & 0x3fu);
  }
  const bool surrogate = code >= 0xd800 && code <= 0xdfff;
  return code < lowest[size] || code > 0x10ffff || surrogate ? 0 : size;
}

bool ep_text_is_utf8(const char *text) {
  const unsigned char *p = (const unsigned char *)text;
  while (*p) {
    const size_t size = character(p);
    if (!size) return false;
    p += size;
  }
  return true;
}

char *ep_text_to_utf8(const char *text) {
  char *out = malloc(3 * strlen(text) + 1), *to = out; // U+FFFD has three bytes
  const unsigned char *p = (const unsigned char *)text;
  while (out && *p) {
    const size_t size = character(p);
    memcpy(to, size ? (const char *)p : "\xef\xbf\xbd", size ? size : 3);
    to += size ? size : 3;
    p += size ? size : 1;
  }
  if (out) *to = '\0';
  return out;
}
