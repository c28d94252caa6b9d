// The numbers of one DataArray of a .vtu file, whatever their encoding (private to mesh/).
#ifndef EP_MESH_VTU_DATA_H
#define EP_MESH_VTU_DATA_H

#include "mesh/numbers.h"
#include "mesh/scan.h"

typedef enum ep_vtu_encoding { EP_VTU_ASCII, EP_VTU_BASE64, EP_VTU_RAW } ep_vtu_encoding;

// What the file says for all arrays.
typedef struct ep_vtu_header {
  bool big_endian, wide, zlib; // wide: lengths are UInt64 instead of UInt32
} ep_vtu_header;

typedef struct ep_vtu_array {
  ep_token name;
  ep_number type;
  int components;
  bool present, appended;
  uint64_t offset; // of appended data
  ep_scan place;   // the tag, for messages; its text where not appended
  ep_vtu_encoding encoding;
} ep_vtu_array;

// count numbers into new memory. Sizes are checked against the bytes there are before anything is
// allocated (zlib cannot pack more than 1032 : 1).
//   NaN and infinities are allowed in _doubles; ints must lie in [low, high].
// Errors: EP_ERR_FORMAT with line or byte: wrong number of numbers, damaged data; EP_ERR_MEMORY.
ep_status ep_vtu_doubles(const ep_vtu_header *header, const ep_vtu_array *array, uint64_t count,
                         const char *what, double **out, ep_error *err);
ep_status ep_vtu_ints(const ep_vtu_header *header, const ep_vtu_array *array, uint64_t count,
                      int low, int high, const char *what, int **out, ep_error *err);

#endif
