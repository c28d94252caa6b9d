// Families of poses in the bench of maps: through the rest shape, and each pose on its own.
#ifndef EP_TESTS_BENCH_MAP_FAMILIES_H
#define EP_TESTS_BENCH_MAP_FAMILIES_H

#include "tests/align/pairs.h"

// Functions of a map; of the spaces it is made in.
enum { BENCH_M = 20, BENCH_FUNCTIONS = 40, BENCH_MARK_COUNT = 6 };

extern const char *const BENCH_VERDICTS[3];
// Six landmarks of each body, in its parameters.
extern const double BENCH_MARKS[BODIES][BENCH_MARK_COUNT][3];

// A map as a scene without other wishes has it, with so many landmarks.
void bench_match(const truth_pair *pair, int landmarks, const ep_landmark *mark, ep_map *map);

// Prints a table of three families of three poses, without and with landmarks.
void run_families(void);

#endif
