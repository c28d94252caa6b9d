// Coefficients of the StVK energy of a bar from the definition, the slow way: oracle of the bake.
#ifndef EP_TESTS_REDUCED_QUARTIC_H
#define EP_TESTS_REDUCED_QUARTIC_H

#include "tests/reduced/bar.h"

// psi = lambda/2 tr(E)^2 + mu E:E summed over the cubature elements of the bar with their weights,
// as the list of reduced/cubic.h (ep_cubic_count(r)). Free it; aborts without memory.
double *quartic_coefficients(const bar *b);

#endif
