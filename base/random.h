// Repeatable random numbers: a seed in the scene gives the same bytes on every machine.
#ifndef EP_BASE_RANDOM_H
#define EP_BASE_RANDOM_H

#include <stdint.h>

// PCG32 (O'Neill 2014, XSH-RR 64/32).
typedef struct ep_random {
  uint64_t state, increment;
} ep_random;

// Streams with the same seed and different names of use (a small number) are independent.
ep_random ep_random_seed(uint64_t seed, uint64_t stream);
uint32_t ep_random_u32(ep_random *rng);
int ep_random_below(ep_random *rng, int bound); // uniform in [0, bound), unbiased
double ep_random_uniform(ep_random *rng);       // [0, 1)
double ep_random_normal(ep_random *rng);        // mean 0, variance 1 (Box-Muller, one of the pair)

#endif
