/// A fixed team of threads that fractions a loop. The caller's thread is member 0.
#ifndef CAVORT_PARALLEL_H
#define CAVORT_PARALLEL_H

typedef struct cav_parallel cav_parallel;

/// A team of at least one; NULL if threads or memory run out.
cav_parallel *cav_parallel_new(int threads);
void cav_parallel_free(cav_parallel *team);
int cav_parallel_size(const cav_parallel *team);

/// Calls body(context, item, member) for item = 0 .. n-1, each once, in no fixed order; returns when all are done.
void cav_parallel_for(cav_parallel *team, int n, void (*body)(void *context, int item, int member), void *context);

#endif
