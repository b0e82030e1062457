#include "pool.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "file.h"

// starts a task; its process, -1 if there is none
static pid_t start(const cav_pool *pool, int task) {
  fflush(NULL);
  pid_t child = fork();
  if (child) return child;
  // until the task has its own, signals end it
  signal(SIGINT, SIG_DFL), signal(SIGTERM, SIG_DFL);
  // what nohup has asked for stays
  if (signal(SIGHUP, SIG_DFL) == SIG_IGN) signal(SIGHUP, SIG_IGN);
  int status = pool->work(pool->context, task);
  fflush(NULL);
  _exit(status);
}

static int ends(const cav_pool *pool) { return pool->interrupted && *pool->interrupted; }

cav_status cav_pool_run(const cav_pool *pool, cav_error *error) {
  pid_t *child = calloc((size_t)pool->n + 1, sizeof *child);
  if (!child) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for %d tasks", pool->n);
  int next = 0, running = 0, asked = 0;
  cav_status status = CAV_OK;
  while (running > 0 || (next < pool->n && !status && !ends(pool))) {
    for (; next < pool->n && running < pool->processes && !status && !ends(pool); next++) {
      if (!pool->wanted(pool->context, next)) continue;
      child[next] = start(pool, next);
      if (child[next] < 0) status = cav_file_fail(error, CAV_NO_MEMORY, 0, "no process for another task");
      running += child[next] > 0;
    }
    int end = ends(pool);
    for (int i = 0; i < next && end && !asked; i++)
      if (child[i] > 0) kill(child[i], SIGTERM);
    asked = end;
    if (running == 0) continue;
    int how;
    // an interrupt just before a call that waits would be seen too late
    pid_t ended = waitpid(-1, &how, pool->interrupted ? WNOHANG : 0);
    if (ended < 0 && errno != EINTR) break;
    if (ended == 0) nanosleep(&(struct timespec){0, 20000000}, NULL);
    for (int i = 0; i < next && ended > 0; i++) {
      if (child[i] != ended) continue;
      child[i] = 0;
      running--;
      pool->ended(pool->context, i, how);
    }
  }
  free(child);
  return status;
}
