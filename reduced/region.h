// Local examples (Zhao et al. 2018, sec. 5; docs/method.md "Local examples"): sets of examples,
// each with the part of the object it acts on, with descriptors, weights and a target of its own. A
// model without regions has one set, of all its examples, and none of the region arrays. Private to
// the run time.
#ifndef EP_REDUCED_REGION_H
#define EP_REDUCED_REGION_H

#include "reduced/eigenpose.h"

// The set of example i (0 .. k - 1).
static inline int ep_region_of(const ep_model *m, int i) {
  return m->example_region ? m->example_region[i] : 0;
}
// Its functions are first .. first of the next - 1 of the m.
static inline int ep_region_first(const ep_model *m, int region) {
  return m->region_first ? m->region_first[region] : region == 0 ? 0 : m->size.m;
}
static inline int ep_region_length(const ep_model *m, int region) { // numbers of its descriptor
  return 3 * (ep_region_first(m, region + 1) - ep_region_first(m, region));
}

// The descriptor of one region at q (r), into its place in c (3m).
void ep_region_descriptor(const ep_model *model, int region, const double *q, double *c);

#endif
