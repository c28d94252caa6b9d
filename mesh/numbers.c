#include "mesh/numbers.h"

#include <string.h>

size_t ep_number_size(ep_number type) {
  static const unsigned char size[EP_NUMBERS] = {1, 2, 4, 8, 1, 2, 4, 8, 4, 8};
  return size[type];
}

bool ep_number_whole(ep_number type) {
  return type < EP_FLOAT32;
}

// The bytes as an unsigned number of the same width.
static uint64_t bits_of(const void *at, size_t size, bool swap) {
  const unsigned char *byte = at;
  const uint16_t one = 1;
  unsigned char low_first;
  memcpy(&low_first, &one, 1);
  const bool little = (low_first == 1) != swap;
  uint64_t bits = 0;
  for (size_t i = 0; i < size; i++) bits = bits << 8 | byte[little ? size - 1 - i : i];
  return bits;
}

int64_t ep_number_integer(ep_number type, const void *at, bool swap) {
  const uint64_t bits = bits_of(at, ep_number_size(type), swap);
  switch (type) {
  case EP_INT8:
    return (int8_t)bits;
  case EP_INT16:
    return (int16_t)bits;
  case EP_INT32:
    return (int32_t)bits;
  case EP_INT64:
    return (int64_t)bits;
  default:
    return bits > INT64_MAX ? INT64_MAX : (int64_t)bits;
  }
}

double ep_number_real(ep_number type, const void *at, bool swap) {
  const uint64_t bits = bits_of(at, ep_number_size(type), swap);
  if (type == EP_FLOAT64) {
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
  }
  if (type == EP_FLOAT32) {
    const uint32_t low = (uint32_t)bits;
    float value;
    memcpy(&value, &low, sizeof value);
    return (double)value;
  }
  return type == EP_UINT64 ? (double)bits : (double)ep_number_integer(type, at, swap);
}
