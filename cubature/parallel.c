#include "cubature/parallel.h"

#include <pthread.h>
#include <stdatomic.h>
#include <unistd.h>

enum { MAX_THREADS = 16 };

typedef struct job {
  int count;
  atomic_int next; // piece to be taken
  ep_range_work *work;
  void *context;
} job;

static void *run(void *argument) {
  job *j = argument;
  for (;;) {
    const long piece = atomic_fetch_add(&j->next, 1);
    if (piece >= EP_PIECES) return NULL;
    const int from = (int)(piece * j->count / EP_PIECES);
    const int to = (int)((piece + 1) * j->count / EP_PIECES);
    if (to > from) j->work(j->context, (int)piece, from, to);
  }
}

void ep_parallel_ranges(int count, ep_range_work *work, void *context) {
  job j = {.count = count, .work = work, .context = context};
  const long cores = sysconf(_SC_NPROCESSORS_ONLN);
  const int wanted = cores > MAX_THREADS ? MAX_THREADS : (int)cores;
  pthread_t thread[MAX_THREADS];
  int started = 0;
  while (started < wanted - 1 && pthread_create(&thread[started], NULL, run, &j) == 0) started++;
  run(&j);
  for (int i = 0; i < started; i++) pthread_join(thread[i], NULL);
}
