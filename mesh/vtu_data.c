// Encodings of DataArray: text; or a header of lengths and the bytes behind it, as they are or in
// base64, as a whole or in blocks packed by zlib.
//   whole:   [bytes] data
//   blocks:  [blocks] [size of a block] [size of the last, 0: full] [packed sizes ..] packed data
#include "mesh/vtu_data.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <zlib.h>

// zlib's own bound on how much a byte can stand for.
enum { DEFLATE_RATIO = 1032 };

// Bytes one after the other, decoded where they are base64. Header and data may be encoded as one
// or apart: padding only ends a group of four characters.
typedef struct stream {
  ep_scan from;
  bool base64;
  unsigned char spare[3];
  int spares;
} stream;

static int digit_of(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  return c == '+' ? 62 : c == '/' ? 63 : -1;
}

// The next group of four characters into spare; false where there is none or it is damaged.
static bool next_group(stream *s) {
  uint32_t bits = 0;
  int digits = 0, padding = 0;
  while (digits + padding < 4 && s->from.at < s->from.end) {
    const char c = *s->from.at++;
    if (c == ' ' || (c >= '\t' && c <= '\r')) continue;
    const int digit = digit_of(c);
    if (c == '=' && digits >= 2)
      padding++;
    else if (digit < 0 || padding)
      return false;
    else
      bits = bits << 6 | (uint32_t)digit, digits++;
  }
  if (digits + padding < 4) return false;
  bits <<= 6 * padding;
  for (int i = 0; i < 3; i++) s->spare[i] = (unsigned char)(bits >> 8 * (2 - i));
  s->spares = 3 - padding;
  return true;
}

static uint64_t bytes_left(const stream *s) {
  const uint64_t left = (uint64_t)(s->from.end - s->from.at);
  return s->base64 ? left / 4 * 3 + (uint64_t)s->spares : left;
}

static ep_status take(stream *s, void *out, size_t count, ep_error *err) {
  unsigned char *to = out;
  if (!s->base64) {
    EP_TRY(ep_scan_need(&s->from, count, "an array", err));
    memcpy(to, s->from.at, count);
    s->from.at += count;
    return EP_OK;
  }
  for (size_t i = 0; i < count; i++) {
    if (s->spares == 0 && !next_group(s))
      return ep_scan_fail_byte(&s->from, err, "base64 data are damaged or end too early");
    to[i] = s->spare[0];
    memmove(s->spare, s->spare + 1, 2);
    s->spares--;
  }
  return EP_OK;
}

static ep_status take_length(stream *s, const ep_vtu_header *h, uint64_t *out, ep_error *err) {
  unsigned char bytes[8];
  const ep_number type = h->wide ? EP_UINT64 : EP_UINT32;
  EP_TRY(take(s, bytes, ep_number_size(type), err));
  *out = (uint64_t)ep_number_integer(type, bytes, h->big_endian != ep_machine_big_endian());
  return EP_OK;
}

static ep_status wrong_size(const stream *s, const char *what, uint64_t found, uint64_t wanted,
                            ep_error *err) {
  return ep_scan_fail_byte(&s->from, err, "%s: %llu bytes, but %llu are needed", what,
                           (unsigned long long)found, (unsigned long long)wanted);
}

// --- zlib

typedef struct blocks {
  uint64_t count, size, last; // last: size of the last one
  uint64_t *packed;           // (count)
} blocks;

static ep_status read_blocks(stream *s, const ep_vtu_header *h, uint64_t wanted, const char *what,
                             blocks *b, ep_error *err) {
  EP_TRY(take_length(s, h, &b->count, err));
  EP_TRY(take_length(s, h, &b->size, err));
  EP_TRY(take_length(s, h, &b->last, err));
  if (b->last == 0) b->last = b->size;
  if (b->count > bytes_left(s) / (h->wide ? 8 : 4))
    return ep_scan_fail_byte(&s->from, err, "%s: %llu packed blocks do not fit into the file", what,
                             (unsigned long long)b->count);
  uint64_t total;
  if (b->last > b->size || __builtin_mul_overflow(b->size, b->count, &total))
    return ep_scan_fail_byte(&s->from, err, "%s: the sizes of its packed blocks are damaged", what);
  if (b->count) total -= b->size - b->last;
  if (total != wanted) return wrong_size(s, what, total, wanted, err);
  if (wanted / DEFLATE_RATIO > bytes_left(s))
    return ep_scan_fail_byte(&s->from, err, "%s: the file ends too early", what);
  b->packed = malloc((size_t)(b->count + 1) * sizeof *b->packed);
  if (!b->packed) return ep_fail(err, EP_ERR_MEMORY, "no memory for %s", what);
  for (uint64_t i = 0; i < b->count; i++) EP_TRY(take_length(s, h, &b->packed[i], err));
  return EP_OK;
}

static ep_status unpack_block(stream *s, uint64_t packed, unsigned char *to, uint64_t size,
                              const char *what, ep_error *err) {
  if (packed > bytes_left(s)) return wrong_size(s, what, bytes_left(s), packed, err);
  unsigned char *bytes = malloc((size_t)packed + 1);
  if (!bytes) return ep_fail(err, EP_ERR_MEMORY, "no memory for %s", what);
  ep_status status = take(s, bytes, (size_t)packed, err);
  uLongf length = (uLongf)size;
  if (status == EP_OK &&
      (uncompress(to, &length, bytes, (uLong)packed) != Z_OK || length != (uLongf)size))
    status = ep_scan_fail_byte(&s->from, err, "%s: packed data are damaged", what);
  free(bytes);
  return status;
}

static ep_status unpack(stream *s, const ep_vtu_header *h, uint64_t wanted, const char *what,
                        unsigned char **out, ep_error *err) {
  blocks b = {0};
  ep_status status = read_blocks(s, h, wanted, what, &b, err);
  if (status == EP_OK && !(*out = malloc((size_t)wanted + 1)))
    status = ep_fail(err, EP_ERR_MEMORY, "no memory for %s", what);
  for (uint64_t i = 0; i < b.count && status == EP_OK; i++)
    status = unpack_block(s, b.packed[i], *out + i * b.size, i + 1 < b.count ? b.size : b.last,
                          what, err);
  free(b.packed);
  return status;
}

// --- arrays

static ep_status take_whole(stream *s, const ep_vtu_header *h, uint64_t wanted, const char *what,
                            unsigned char **out, ep_error *err) {
  uint64_t length;
  EP_TRY(take_length(s, h, &length, err));
  if (length != wanted) return wrong_size(s, what, length, wanted, err);
  if (length > bytes_left(s)) return wrong_size(s, what, bytes_left(s), wanted, err);
  *out = malloc((size_t)wanted + 1);
  if (!*out) return ep_fail(err, EP_ERR_MEMORY, "no memory for %s", what);
  return take(s, *out, (size_t)wanted, err);
}

static ep_status array_bytes(const ep_vtu_header *h, const ep_vtu_array *a, uint64_t count,
                             const char *what, unsigned char **out, ep_error *err) {
  uint64_t wanted;
  stream s = {.from = a->place, .base64 = a->encoding == EP_VTU_BASE64};
  *out = NULL;
  if (__builtin_mul_overflow(count, (uint64_t)ep_number_size(a->type), &wanted))
    return ep_scan_fail(&a->place, err, "%s: impossible size", what);
  if (a->appended && a->offset > (uint64_t)(s.from.end - s.from.at))
    return ep_scan_fail(&a->place, err, "%s: offset %llu lies behind the end of the file", what,
                        (unsigned long long)a->offset);
  if (a->appended) s.from.at += a->offset;
  const ep_status status =
      h->zlib ? unpack(&s, h, wanted, what, out, err) : take_whole(&s, h, wanted, what, out, err);
  if (status == EP_OK) return EP_OK;
  free(*out);
  *out = NULL;
  return status;
}

// The numbers of a text are at least one character and a blank each.
static ep_status text_room(const ep_scan *s, uint64_t count, size_t size, const char *what,
                           void **out, ep_error *err) {
  if (count > (uint64_t)(s->end - s->at) / 2 + 1)
    return ep_scan_fail(s, err, "%s: %llu numbers are needed, fewer are here", what,
                        (unsigned long long)count);
  *out = malloc((size_t)(count + 1) * size);
  return *out ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for %s", what);
}

static ep_status text_doubles(const ep_vtu_array *a, uint64_t count, const char *what, double **out,
                              ep_error *err) {
  ep_scan s = a->place;
  void *room = NULL;
  EP_TRY(text_room(&s, count, sizeof **out, what, &room, err));
  *out = room;
  for (uint64_t i = 0; i < count; i++) EP_TRY(ep_scan_any_double(&s, what, &(*out)[i], err));
  return ep_scan_expect_end(&s, err);
}

static ep_status text_ints(const ep_vtu_array *a, uint64_t count, int low, int high,
                           const char *what, int **out, ep_error *err) {
  ep_scan s = a->place;
  void *room = NULL;
  EP_TRY(text_room(&s, count, sizeof **out, what, &room, err));
  *out = room;
  for (uint64_t i = 0; i < count; i++) EP_TRY(ep_scan_int(&s, what, low, high, &(*out)[i], err));
  return ep_scan_expect_end(&s, err);
}

static ep_status binary_doubles(const ep_vtu_header *h, const ep_vtu_array *a, uint64_t count,
                                const char *what, double **out, ep_error *err) {
  unsigned char *bytes;
  const size_t size = ep_number_size(a->type);
  EP_TRY(array_bytes(h, a, count, what, &bytes, err));
  *out = malloc((size_t)(count + 1) * sizeof **out);
  for (uint64_t i = 0; *out && i < count; i++) {
    const double value =
        ep_number_real(a->type, bytes + i * size, h->big_endian != ep_machine_big_endian());
    (*out)[i] = isfinite(value) ? value : NAN;
  }
  free(bytes);
  return *out ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for %s", what);
}

static ep_status binary_ints(const ep_vtu_header *h, const ep_vtu_array *a, uint64_t count, int low,
                             int high, const char *what, int **out, ep_error *err) {
  unsigned char *bytes;
  const size_t size = ep_number_size(a->type);
  EP_TRY(array_bytes(h, a, count, what, &bytes, err));
  *out = malloc((size_t)(count + 1) * sizeof **out);
  ep_status status = *out ? EP_OK : ep_fail(err, EP_ERR_MEMORY, "no memory for %s", what);
  for (uint64_t i = 0; status == EP_OK && i < count; i++) {
    const int64_t value =
        ep_number_integer(a->type, bytes + i * size, h->big_endian != ep_machine_big_endian());
    (*out)[i] = (int)value;
    if (value < low || value > high)
      status = ep_scan_fail(&a->place, err, "%s is %lld, but must lie in %d to %d", what,
                            (long long)value, low, high);
  }
  free(bytes);
  return status;
}

ep_status ep_vtu_doubles(const ep_vtu_header *h, const ep_vtu_array *a, uint64_t count,
                         const char *what, double **out, ep_error *err) {
  *out = NULL;
  const ep_status status = a->encoding == EP_VTU_ASCII
                               ? text_doubles(a, count, what, out, err)
                               : binary_doubles(h, a, count, what, out, err);
  if (status == EP_OK) return EP_OK;
  free(*out);
  *out = NULL;
  return status;
}

ep_status ep_vtu_ints(const ep_vtu_header *h, const ep_vtu_array *a, uint64_t count, int low,
                      int high, const char *what, int **out, ep_error *err) {
  *out = NULL;
  if (!ep_number_whole(a->type))
    return ep_scan_fail(&a->place, err, "%s must be of a whole-number type", what);
  const ep_status status = a->encoding == EP_VTU_ASCII
                               ? text_ints(a, count, low, high, what, out, err)
                               : binary_ints(h, a, count, low, high, what, out, err);
  if (status == EP_OK) return EP_OK;
  free(*out);
  *out = NULL;
  return status;
}
