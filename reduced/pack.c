#include <math.h>
#include <string.h>

#include "reduced/eigenpose.h"

static const double largest_float = 3.4e38, smallest_float = 1.2e-38;

size_t ep_packed_cubature_size(int r, int s) {
  return (size_t)s * (size_t)((r + 7) / 8) * 72;
}

void ep_pack_cubature(int r, int s, const double *g, double *out) {
  size_t blocks = (size_t)(r + 7) / 8, modes = (size_t)r;
  memset(out, 0, ep_packed_cubature_size(r, s) * sizeof *out);
  for (size_t e = 0; e < (size_t)s; e++)
    for (size_t entry = 0; entry < 9; entry++)
      for (size_t a = 0; a < modes; a++)
        out[((e * blocks + a / 8) * 9 + entry) * 8 + a % 8] = g[(9 * e + entry) * modes + a];
}

size_t ep_packed_cubature_float_size(int r, int s) {
  return (size_t)s * 9 * (size_t)((r + 15) / 16 * 16);
}

ep_status ep_pack_cubature_float(int r, int s, const double *g, float *out) {
  const size_t modes = (size_t)r, row = (size_t)((r + 15) / 16 * 16);
  memset(out, 0, ep_packed_cubature_float_size(r, s) * sizeof *out);
  for (size_t i = 0; i < 9 * (size_t)s; i++)
    for (size_t a = 0; a < modes; a++) {
      const double x = g[i * modes + a];
      if (!(fabs(x) <= largest_float)) return EP_ERR_NUMERIC;
      // what a float has no normal form for is nothing beside the others, and slow
      out[i * row + a] = fabs(x) < smallest_float ? 0 : (float)x;
    }
  return EP_OK;
}

size_t ep_packed_green_size(int r) {
  const size_t blocks = (size_t)(r + 7) / 8;
  return blocks * (blocks + 1) / 2 * 64;
}

void ep_pack_green(int r, const double *b, double *out) {
  const size_t modes = (size_t)r;
  memset(out, 0, ep_packed_green_size(r) * sizeof *out);
  for (size_t p = 0; p < modes; p++)
    for (size_t q = 0; q <= p; q++) {
      const size_t tile = p / 8 * (p / 8 + 1) / 2 + q / 8;
      out[64 * tile + 8 * (p % 8) + q % 8] = (p == q ? 0.5 : 1) * b[p * modes + q];
    }
}
