// Pairs of known truth made from data/: gmsh meshes a shape of data/generate at another resolution;
// where its points go is known from the stored rest mesh and its pose of the same connectivity.
#ifndef EP_TESTS_BENCH_DATA_PAIRS_H
#define EP_TESTS_BENCH_DATA_PAIRS_H

#include "tests/align/pairs.h"

typedef struct data_recipe {
  const char *name;
  const char *from;        // mesh of data/meshes, or NULL: made by gmsh of
  const char *geo;         // this description with
  double size;             // this resolution and
  const char *options;     // these gmsh options
  const char *rest, *pose; // same connectivity; NULL: the truth of a point is `place` of itself
  const char *to;          // the mesh mapped to
  placement place;         // NULL: its own position
} data_recipe;

extern const data_recipe DATA_RECIPES[];
extern const int DATA_RECIPE_COUNT;

// false, with a message: no gmsh to make it.
bool pair_of_data(const data_recipe *recipe, int functions, truth_pair *out);

#endif
