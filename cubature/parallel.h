// Independent pieces of work over the cores. Each piece writes only what is its own, so the result
// does not depend on how many threads there are.
#ifndef EP_CUBATURE_PARALLEL_H
#define EP_CUBATURE_PARALLEL_H

enum { EP_PIECES = 64 };

// work(context, piece, from, to) for EP_PIECES ranges covering [0, count), empty ones left out;
// piece (0 .. EP_PIECES - 1) lets a piece have scratch of its own. Runs in the calling thread what
// cannot be given to another one.
typedef void ep_range_work(void *context, int piece, int from, int to);
void ep_parallel_ranges(int count, ep_range_work *work, void *context);

#endif
