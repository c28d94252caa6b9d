#include "base/random.h"

#include <math.h>

ep_random ep_random_seed(uint64_t seed, uint64_t stream) {
  ep_random rng = {0, (stream << 1) | 1u};
  ep_random_u32(&rng);
  rng.state += seed;
  ep_random_u32(&rng);
  return rng;
}

uint32_t ep_random_u32(ep_random *rng) {
  const uint64_t old = rng->state;
  rng->state = old * 6364136223846793005ULL + rng->increment;
  const uint32_t shifted = (uint32_t)(((old >> 18) ^ old) >> 27);
  const uint32_t rotate = (uint32_t)(old >> 59);
  return (shifted >> rotate) | (shifted << ((32u - rotate) & 31u));
}

int ep_random_below(ep_random *rng, int bound) {
  const uint32_t b = (uint32_t)bound, threshold = (0u - b) % b;
  for (;;) {
    const uint32_t value = ep_random_u32(rng);
    if (value >= threshold) return (int)(value % b);
  }
}

double ep_random_uniform(ep_random *rng) {
  const uint64_t high = ep_random_u32(rng) >> 5, low = ep_random_u32(rng) >> 6;
  return (double)((high << 26) | low) * 0x1p-53;
}

double ep_random_normal(ep_random *rng) {
  const double u = 1.0 - ep_random_uniform(rng), v = ep_random_uniform(rng);
  return sqrt(-2.0 * log(u)) * cos(6.283185307179586 * v);
}
