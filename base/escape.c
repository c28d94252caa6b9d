#include "base/escape.h"

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
