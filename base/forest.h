// Which things hang together, pair by pair: disjoint sets (Tarjan 1975), in caller's memory.
#ifndef EP_BASE_FOREST_H
#define EP_BASE_FOREST_H

#include <stdbool.h>

// parent (count): every thing a group of its own.
void ep_forest_start(int *parent, int count);
// The lowest thing of i's group: the same for all of a group, whatever the order of joining. Halves
// the way there, so that no later search walks it again.
int ep_forest_root(int *parent, int i);
// Join the groups of a and b. False where they were one already.
bool ep_forest_join(int *parent, int a, int b);

#endif
