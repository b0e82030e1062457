/// Tasks, each in a process of its own, at most so many at a time: one that crashes takes nothing with it.
#ifndef CAVORT_POOL_H
#define CAVORT_POOL_H

#include <signal.h>

#include "cavort/status.h"

typedef struct cav_pool {
  int n, processes;
  volatile sig_atomic_t *interrupted;     ///< nonzero: nothing more is begun, what runs is asked to end; NULL: never
  int (*wanted)(void *context, int task); ///< 0: it is done already
  int (*work)(void *context, int task);   ///< in the process of the task; its exit status
  void (*ended)(void *context, int task, int status); ///< in this one, status as of waitpid
  void *context;
} cav_pool;

/// Runs all tasks that are wanted, in their order. CAV_NO_MEMORY: no process for another one; those that run have ended.
cav_status cav_pool_run(const cav_pool *pool, cav_error *error);

#endif
