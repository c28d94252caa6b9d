// Which random cases a property test goes through, and how one that fails is done again alone:
//   EP_PROPERTY_SEED=N     the first seed, 0 to 2^64 - 1 (default 1)
//   EP_PROPERTY_COUNT=N    how many, one after the other (default: a few seconds' worth)
//   EP_PROPERTY_SECONDS=S  go on until then, whatever the count
// Anything else ends the test.
// A case is made of its seed alone: the same one on every machine.
#ifndef EP_TESTS_PROPERTIES_SEEDS_H
#define EP_TESTS_PROPERTIES_SEEDS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/random.h"

typedef struct seeds {
  uint64_t first, now; // now: the case at hand, after seeds_next
  int done, count;     // cases begun
  double seconds, until;
} seeds;
seeds seeds_begin(int usual_count);
bool seeds_next(seeds *s); // on to the next case; false at the end

enum { WHY = 600 };
// A property that does not hold: into why (WHY), false.
bool breaks(char *why, const char *format, ...) __attribute__((format(printf, 2, 3)));
// Ends the test: the seed, the way to do it again, why.
_Noreturn void seed_fails(const char *test, uint64_t seed, const char *why);

// ---- draws -------------------------------------------------------------------------------------
double between(ep_random *rng, double low, double high);
double between_powers(ep_random *rng, double low, double high); // uniform in the logarithm
bool chance(ep_random *rng, double probability);
int from_to(ep_random *rng, int low, int high);             // both may be drawn
void direction(ep_random *rng, double out[3]);              // a unit vector
void rotation(ep_random *rng, double angle, double out[9]); // about a random axis, row-major
void permutation(ep_random *rng, int count, int *out);

#endif
