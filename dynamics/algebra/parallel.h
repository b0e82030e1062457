/// A fixed team of threads that fractions a loop. The caller's thread is member 0.
#ifndef CAVORT_PARALLEL_H
#define CAVORT_PARALLEL_H

#include <stdatomic.h>

typedef struct cav_parallel cav_parallel;
typedef atomic_uchar cav_parallel_flag;

/// A team of at least one; NULL if threads or memory run out.
cav_parallel *cav_parallel_new(int threads);
void cav_parallel_free(cav_parallel *team);
int cav_parallel_size(const cav_parallel *team);

/// Calls body(context, item, member) for item = 0 .. n-1, each once, in no fixed order; returns when all are done.
void cav_parallel_for(cav_parallel *team, int n, void (*body)(void *context, int item, int member), void *context);

/// The same, and then(context, item) for each item after its body, in ascending order, by the caller's thread: what has an order
/// of its own goes on while bodies of later items do. ready [n] is the caller's.
void cav_parallel_then(cav_parallel *team, int n, void (*body)(void *context, int item, int member),
                       void (*then)(void *context, int item), void *context, cav_parallel_flag *ready);

#endif
