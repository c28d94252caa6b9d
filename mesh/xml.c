#include "mesh/xml.h"

#include <limits.h>
#include <string.h>

static bool starts(const ep_scan *s, const char *text) {
  const size_t length = strlen(text);
  return (size_t)(s->end - s->at) >= length && memcmp(s->at, text, length) == 0;
}

// Move behind the next `text`; to the end where there is none.
static bool skip_behind(ep_scan *s, const char *text) {
  while (s->at < s->end && !starts(s, text)) s->at++;
  if (s->at == s->end) return false;
  s->at += strlen(text);
  return true;
}

static bool name_ends(char c) {
  return c == ' ' || (c >= '\t' && c <= '\r') || c == '/' || c == '>' || c == '=';
}

static ep_token take_name(ep_scan *s) {
  const char *from = s->at;
  while (s->at < s->end && !name_ends(*s->at) && s->at - from < INT_MAX) s->at++;
  return (ep_token){from, (int)(s->at - from)};
}

static void skip_spaces(ep_scan *s) {
  while (s->at < s->end && (*s->at == ' ' || (*s->at >= '\t' && *s->at <= '\r'))) s->at++;
}

// From behind the name to behind '>', which does not count inside quotes.
static ep_status take_attributes(ep_scan *s, ep_xml_tag *tag, ep_error *err) {
  tag->attributes = *s;
  char quote = 0;
  while (s->at < s->end && (quote || *s->at != '>')) {
    const char c = *s->at++;
    if (quote)
      quote = c == quote ? 0 : quote;
    else if (c == '"' || c == '\'')
      quote = c;
  }
  if (s->at == s->end) return ep_scan_fail(s, err, "the file ends inside a tag");
  tag->attributes.end = s->at;
  tag->empty = s->at > tag->attributes.at && s->at[-1] == '/';
  s->at++;
  return EP_OK;
}

ep_status ep_xml_next(ep_scan *s, ep_xml_tag *tag, bool *found, ep_error *err) {
  *found = false;
  for (;;) {
    while (s->at < s->end && *s->at != '<') s->at++;
    s->mark = s->at;
    if (s->at == s->end) return EP_OK;
    const bool comment = starts(s, "<!--"), passed = starts(s, "<?") || starts(s, "<!");
    if (!comment && !passed) break;
    if (!skip_behind(s, comment ? "-->" : ">"))
      return ep_scan_fail(s, err, "the file ends inside a comment or declaration");
  }
  s->at++;
  memset(tag, 0, sizeof *tag);
  tag->closing = s->at < s->end && *s->at == '/';
  if (tag->closing) s->at++;
  tag->name = take_name(s);
  if (!tag->name.length) return ep_scan_fail(s, err, "a tag without a name");
  *found = true;
  return take_attributes(s, tag, err);
}

bool ep_xml_attribute(const ep_xml_tag *tag, const char *name, ep_token *value) {
  ep_scan s = tag->attributes;
  while (s.at < s.end) {
    skip_spaces(&s);
    const ep_token key = take_name(&s);
    skip_spaces(&s);
    if (s.at < s.end && *s.at == '=') s.at++;
    skip_spaces(&s);
    if (s.at == s.end) return false;
    const char quote = *s.at;
    if (quote != '"' && quote != '\'') {
      s.at++; // not "key = value": look on behind it
      continue;
    }
    const char *from = ++s.at;
    while (s.at < s.end && *s.at != quote) s.at++;
    if (s.at - from > INT_MAX) return false;
    *value = (ep_token){from, (int)(s.at - from)};
    if (s.at < s.end) s.at++;
    if ((size_t)key.length == strlen(name) && memcmp(key.text, name, (size_t)key.length) == 0)
      return true;
  }
  return false;
}

void ep_xml_decode(ep_token value, char *out, size_t capacity) {
  static const struct {
    const char *text;
    char c;
  } entity[] = {{"&lt;", '<'}, {"&gt;", '>'}, {"&amp;", '&'}, {"&quot;", '"'}, {"&apos;", '\''}};
  size_t used = 0;
  for (int i = 0; i < value.length && used + 1 < capacity;) {
    char c = value.text[i];
    int length = 1;
    for (size_t k = 0; k < sizeof entity / sizeof *entity && c == '&'; k++) {
      const int size = (int)strlen(entity[k].text);
      if (size > value.length - i || memcmp(value.text + i, entity[k].text, (size_t)size) != 0)
        continue;
      c = entity[k].c;
      length = size;
      break;
    }
    out[used++] = c;
    i += length;
  }
  out[used] = '\0';
}
