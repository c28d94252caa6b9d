// Numbers of the types and byte orders VTK files hold (private to mesh/).
#ifndef EP_MESH_NUMBERS_H
#define EP_MESH_NUMBERS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum ep_number {
  EP_INT8,
  EP_INT16,
  EP_INT32,
  EP_INT64,
  EP_UINT8,
  EP_UINT16,
  EP_UINT32,
  EP_UINT64,
  EP_FLOAT32,
  EP_FLOAT64,
  EP_NUMBERS
} ep_number;

size_t ep_number_size(ep_number type);
bool ep_number_whole(ep_number type); // an integer type
// The number at `at` (any alignment); swap where its byte order is not the machine's.
double ep_number_real(ep_number type, const void *at, bool swap);
// Of an integer type; UInt64 beyond INT64_MAX gives INT64_MAX.
int64_t ep_number_integer(ep_number type, const void *at, bool swap);

#endif
