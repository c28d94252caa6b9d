// A scanner for the one shape of JSON a safetensors header has:
//   {"__metadata__": {"key": "text", ...}, "name": {"dtype": "F64", "shape": [..],
//    "data_offsets": [begin, end]}, ...}
// in place and without memory of its own. As in safetensors itself the arrays must cover the data
// without holes, here also in the header's order (the writer fills gaps with arrays "pad.N").
#include "reduced/tensorfile.h"

#include <string.h>

#include "reduced/text.h"

// ---- scanner -----------------------------------------------------------------------------------

typedef struct scanner {
  const char *at, *end;
} scanner;

static void skip_space(scanner *s) {
  while (s->at < s->end && (*s->at == ' ' || *s->at == '\n' || *s->at == '\t' || *s->at == '\r'))
    s->at++;
}

static int accept(scanner *s, char c) {
  skip_space(s);
  if (s->at == s->end || *s->at != c) return 0;
  s->at++;
  return 1;
}

static int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

static long code_unit(const char *at, const char *end) {
  if (end - at < 4) return -1;
  long value = 0;
  for (int i = 0; i < 4; i++) {
    int digit = hex_digit(at[i]);
    if (digit < 0) return -1;
    value = 16 * value + digit;
  }
  return value;
}

// Append a code point as UTF-8. Returns 0 where there is no room for it and a NUL.
static int put_utf8(unsigned long code, char *text, size_t capacity, size_t *used) {
  int bytes = code < 0x80 ? 1 : code < 0x800 ? 2 : code < 0x10000 ? 3 : 4;
  if (*used + (size_t)bytes >= capacity) return 0;
  static const unsigned char lead[5] = {0, 0, 0xc0, 0xe0, 0xf0};
  for (int i = bytes - 1; i > 0; i--) {
    text[*used + (size_t)i] = (char)(0x80 | (code & 0x3f));
    code >>= 6;
  }
  text[*used] = (char)(lead[bytes] | code);
  *used += (size_t)bytes;
  return 1;
}

// The escape after a backslash; -1 where it is none. Surrogate pairs are joined.
static long unescape(scanner *s) {
  if (s->at == s->end) return -1;
  char c = *s->at++;
  static const char from[] = "\"\\/bfnrt", to[] = "\"\\/\b\f\n\r\t";
  for (int i = 0; from[i]; i++)
    if (c == from[i]) return to[i];
  if (c != 'u') return -1;
  long high = code_unit(s->at, s->end);
  if (high < 0) return -1;
  s->at += 4;
  if (high < 0xd800 || high > 0xdfff) return high;
  if (high > 0xdbff || s->end - s->at < 6 || s->at[0] != '\\' || s->at[1] != 'u') return -1;
  long low = code_unit(s->at + 2, s->end);
  if (low < 0xdc00 || low > 0xdfff) return -1;
  s->at += 6;
  return 0x10000 + ((high - 0xd800) << 10) + (low - 0xdc00);
}

// A string, unescaped into text (capacity, NUL included), or skipped when text is NULL.
static int scan_string(scanner *s, char *text, size_t capacity) {
  if (!accept(s, '"')) return 0;
  size_t used = 0;
  while (s->at < s->end && *s->at != '"') {
    unsigned char c = (unsigned char)*s->at++;
    if (c < 0x20) return 0;
    if (c == '\\') {
      long code = unescape(s);
      if (code < 0 ||
          (text && (code == 0 || !put_utf8((unsigned long)code, text, capacity, &used))))
        return 0;
    } else if (text) {
      if (used + 1 >= capacity) return 0;
      text[used++] = (char)c;
    }
  }
  if (text) text[used] = '\0';
  return accept(s, '"');
}

static int scan_whole(scanner *s, int64_t *value) {
  skip_space(s);
  const char *start = s->at;
  uint64_t sum = 0;
  while (s->at < s->end && *s->at >= '0' && *s->at <= '9') {
    if (sum > (uint64_t)INT64_MAX / 10 - 1) return 0;
    sum = 10 * sum + (uint64_t)(*s->at++ - '0');
  }
  *value = (int64_t)sum;
  return s->at > start && !(s->at - start > 1 && *start == '0');
}

// [n, n, ...] with at most `most` numbers; their count, or -1.
static int scan_list(scanner *s, int most, int64_t *value) {
  int count = 0;
  if (!accept(s, '[')) return -1;
  if (accept(s, ']')) return 0;
  do {
    if (count == most || !scan_whole(s, &value[count])) return -1;
    count++;
  } while (accept(s, ','));
  return accept(s, ']') ? count : -1;
}

// ---- entries -----------------------------------------------------------------------------------

typedef struct entry {
  ep_tensor tensor;
  int64_t begin, end; // within the data part
} entry;

static const struct {
  char name[4]; // an array, not a pointer: constant data without relocations
  int size;
} dtypes[EP_DTYPES] = {{"F64", 8}, {"F32", 4}, {"I32", 4}, {"I64", 8}, {"U8", 1}};

static int scan_dtype(scanner *s, ep_dtype *dtype) {
  char text[8];
  if (!scan_string(s, text, sizeof text)) return 0;
  for (int i = 0; i < EP_DTYPES; i++) {
    if (strcmp(text, dtypes[i].name) == 0) {
      *dtype = (ep_dtype)i;
      return 1;
    }
  }
  return 0;
}

// {"dtype": .., "shape": .., "data_offsets": ..} in any order, each once.
static const char *scan_entry(scanner *s, entry *e) {
  int seen = 0;
  int64_t offsets[2];
  if (!accept(s, '{')) return "an array's entry is not an object";
  do {
    char key[16];
    if (!scan_string(s, key, sizeof key) || !accept(s, ':')) return "broken JSON in an entry";
    int bit;
    if (strcmp(key, "dtype") == 0) {
      bit = 1;
      if (!scan_dtype(s, &e->tensor.dtype)) return "unknown dtype";
    } else if (strcmp(key, "shape") == 0) {
      bit = 2;
      e->tensor.dims = scan_list(s, 4, e->tensor.shape);
      if (e->tensor.dims < 0) return "shape is not a list of at most 4 whole numbers";
    } else if (strcmp(key, "data_offsets") == 0) {
      bit = 4;
      if (scan_list(s, 2, offsets) != 2) return "data_offsets is not a pair of whole numbers";
    } else {
      return "unknown key in an entry";
    }
    if (seen & bit) return "a key appears twice in an entry";
    seen |= bit;
  } while (accept(s, ','));
  if (!accept(s, '}') || seen != 7) return "an entry is incomplete";
  e->begin = offsets[0], e->end = offsets[1];
  return NULL;
}

// Bytes of a shape; -1 on overflow.
static int64_t shape_bytes(const ep_tensor *t) {
  int64_t bytes = dtypes[t->dtype].size;
  for (int i = 0; i < t->dims; i++)
    if (__builtin_mul_overflow(bytes, t->shape[i], &bytes)) return -1;
  return bytes;
}

// Skip {"key": "text", ...}; where key is given, copy its value instead. 1 found or skipped, 0 no
// such key, -1 broken.
static int scan_metadata(scanner *s, const char *key, char *text, size_t capacity) {
  int found = 0;
  if (!accept(s, '{')) return -1;
  if (accept(s, '}')) return !key;
  do {
    char name[64];
    scanner start = *s;
    int fits = scan_string(s, name, sizeof name);
    if (!fits) { // a longer key than any of ours
      *s = start;
      if (!scan_string(s, NULL, 0)) return -1;
    }
    if (!accept(s, ':')) return -1;
    int wanted = key && fits && strcmp(name, key) == 0;
    start = *s;
    if (!scan_string(s, wanted ? text : NULL, capacity)) return -1;
    found |= wanted;
  } while (accept(s, ','));
  if (!accept(s, '}')) return -1;
  return key ? found : 1;
}

// Next array of the header. 1: *e filled, 0: the header ends here, -1: broken (*why).
static int next_entry(scanner *s, int *first, entry *e, const char **why) {
  for (;;) {
    if (accept(s, '}')) return 0;
    if (!*first && !accept(s, ',')) {
      *why = "broken JSON: expected , or } after an entry";
      return -1;
    }
    *first = 0;
    memset(e, 0, sizeof *e);
    if (!scan_string(s, e->tensor.name, sizeof e->tensor.name) || !accept(s, ':')) {
      *why = "broken JSON: expected an array's name (at most 63 bytes)";
      return -1;
    }
    if (strcmp(e->tensor.name, "__metadata__") != 0) {
      *why = scan_entry(s, e);
      return *why ? -1 : 1;
    }
    if (scan_metadata(s, NULL, NULL, 0) < 0) {
      *why = "__metadata__ is not an object of strings";
      return -1;
    }
  }
}

// ---- public ------------------------------------------------------------------------------------

static ep_status refuse_entry(char *message, const entry *e, const char *why) {
  ep_text_set(message, "array \"");
  ep_text_add(message, e->tensor.name);
  ep_text_add(message, "\": ");
  ep_text_add(message, why);
  return EP_ERR_FORMAT;
}

static ep_status check_entries(const ep_tensorfile *file, char *message) {
  scanner s = {file->header, file->header + file->header_size};
  int64_t data = (int64_t)(file->size - 8 - file->header_size), covered = 0;
  const char *why = NULL;
  int first = 1, more;
  entry e;
  if (!accept(&s, '{')) return ep_text_refuse(message, "the header is not a JSON object");
  while ((more = next_entry(&s, &first, &e, &why)) > 0) {
    if (e.begin != covered || e.end < e.begin)
      return refuse_entry(message, &e, "its data overlaps, leaves a hole or stands out of order");
    if (e.end > data) return refuse_entry(message, &e, "its data ends beyond the file: truncated?");
    if (shape_bytes(&e.tensor) != e.end - e.begin)
      return refuse_entry(message, &e, "its shape does not fit its bytes");
    if ((uintptr_t)(file->bytes + 8 + file->header_size + e.begin) %
        (unsigned)dtypes[e.tensor.dtype].size)
      return refuse_entry(message, &e, "its data is not aligned");
    covered = e.end;
  }
  if (more < 0) return refuse_entry(message, &e, why);
  skip_space(&s);
  if (s.at != s.end) return ep_text_refuse(message, "text after the header's JSON object");
  if (covered != data) return ep_text_refuse(message, "bytes after the last array");
  return EP_OK;
}

ep_status ep_tensorfile_open(const void *bytes, size_t size, ep_tensorfile *out, char *message) {
  uint64_t header = 0;
  const unsigned char *raw = bytes;
  memset(out, 0, sizeof *out);
  ep_text_set(message, "");
  if ((uintptr_t)bytes % 8) {
    ep_text_set(message, "the file's memory is not aligned to 8 bytes");
    return EP_ERR_ARGUMENT;
  }
  if (size < 10)
    return ep_text_refuse(message, "too short for a tensor file: truncated or foreign");
  for (int i = 0; i < 8; i++) header |= (uint64_t)raw[i] << (8 * i);
  if (header < 2 || header > size - 8)
    return ep_text_refuse(message, "the header's length exceeds the file: truncated or foreign");
  *out = (ep_tensorfile){raw, size, (const char *)raw + 8, (size_t)header};
  return check_entries(out, message);
}

ep_status ep_tensorfile_find(const ep_tensorfile *file, const char *name, ep_tensor *out) {
  scanner s = {file->header, file->header + file->header_size};
  const char *why;
  int first = 1;
  entry e;
  if (!accept(&s, '{')) return EP_ERR_FORMAT;
  while (next_entry(&s, &first, &e, &why) > 0) {
    if (strcmp(e.tensor.name, name) != 0) continue;
    e.tensor.data = file->bytes + 8 + file->header_size + e.begin;
    *out = e.tensor;
    return EP_OK;
  }
  return EP_ERR_FORMAT;
}

ep_status ep_tensorfile_metadata(const ep_tensorfile *file, const char *key, char *text,
                                 size_t capacity) {
  scanner s = {file->header, file->header + file->header_size};
  if (!accept(&s, '{')) return EP_ERR_FORMAT;
  do {
    char name[64];
    entry e;
    if (!scan_string(&s, name, sizeof name) || !accept(&s, ':')) return EP_ERR_FORMAT;
    if (strcmp(name, "__metadata__") == 0)
      return scan_metadata(&s, key, text, capacity) == 1 ? EP_OK : EP_ERR_FORMAT;
    if (scan_entry(&s, &e)) return EP_ERR_FORMAT;
  } while (accept(&s, ','));
  return EP_ERR_FORMAT;
}
