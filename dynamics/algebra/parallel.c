/// Team of POSIX threads that draw items of a loop from one counter. Which member takes an item does not matter to the
/// result as long as the body writes to places of its item only.
#include "parallel.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>

struct cav_parallel {
  int size, started;
  pthread_t *thread;
  struct member {
    struct cav_parallel *team;
    int index;
  } * member;
  pthread_mutex_t mutex;
  pthread_cond_t work, done;
  atomic_int round, busy; ///< loops begun; members that are still at the present one
  int stop;
  int n;
  atomic_int next;
  void (*body)(void *, int, int);
  void *context;
};

/// Looks at what another member is about to change before a member goes to sleep, some 100 microseconds in all: between two loops
/// there is often less than it takes to be woken.
enum { LOOKS = 4000 };

static inline void pause(void) {
#if defined(__x86_64__)
  __builtin_ia32_pause();
#endif
}

static int changes(const atomic_int *value, int from) {
  for (int i = 0; i < LOOKS; i++) {
    if (atomic_load_explicit(value, memory_order_acquire) != from) return 1;
    pause();
  }
  return 0;
}

static void draw(cav_parallel *team, int member) {
  for (int item = atomic_fetch_add(&team->next, 1); item < team->n; item = atomic_fetch_add(&team->next, 1))
    team->body(team->context, item, member);
}

static void *serve(void *argument) {
  const struct member *self = argument;
  cav_parallel *team = self->team;
  int seen = 0;
  pthread_mutex_lock(&team->mutex);
  for (;;) {
    while (team->round == seen && !team->stop) pthread_cond_wait(&team->work, &team->mutex);
    if (team->stop) break;
    seen = team->round;
    pthread_mutex_unlock(&team->mutex);
    draw(team, self->index);
    if (atomic_fetch_sub(&team->busy, 1) == 1) {
      // the caller may have gone to sleep
      pthread_mutex_lock(&team->mutex);
      pthread_cond_signal(&team->done);
      pthread_mutex_unlock(&team->mutex);
    }
    changes(&team->round, seen);
    pthread_mutex_lock(&team->mutex);
  }
  pthread_mutex_unlock(&team->mutex);
  return NULL;
}

cav_parallel *cav_parallel_new(int threads) {
  cav_parallel *team = calloc(1, sizeof *team);
  if (!team) return NULL;
  team->size = threads < 1 ? 1 : threads;
  pthread_mutex_init(&team->mutex, NULL);
  pthread_cond_init(&team->work, NULL);
  pthread_cond_init(&team->done, NULL);
  team->thread = calloc((size_t)team->size, sizeof *team->thread);
  team->member = calloc((size_t)team->size, sizeof *team->member);
  int ok = team->thread && team->member;
  for (int i = 1; ok && i < team->size; i++) {
    team->member[i] = (struct member){team, i};
    ok = pthread_create(&team->thread[i], NULL, serve, &team->member[i]) == 0;
    team->started += ok;
  }
  if (ok) return team;
  cav_parallel_free(team);
  return NULL;
}

void cav_parallel_free(cav_parallel *team) {
  if (!team) return;
  pthread_mutex_lock(&team->mutex);
  team->stop = 1;
  pthread_cond_broadcast(&team->work);
  pthread_mutex_unlock(&team->mutex);
  for (int i = 1; i <= team->started; i++) pthread_join(team->thread[i], NULL);
  pthread_cond_destroy(&team->work);
  pthread_cond_destroy(&team->done);
  pthread_mutex_destroy(&team->mutex);
  free(team->thread);
  free(team->member);
  free(team);
}

int cav_parallel_size(const cav_parallel *team) { return team->size; }

void cav_parallel_for(cav_parallel *team, int n, void (*body)(void *context, int item, int member), void *context) {
  pthread_mutex_lock(&team->mutex);
  team->n = n;
  team->body = body;
  team->context = context;
  atomic_store(&team->next, 0);
  team->busy = team->size - 1;
  team->round++;
  pthread_cond_broadcast(&team->work);
  pthread_mutex_unlock(&team->mutex);

  draw(team, 0);

  for (int i = 0; i < LOOKS && atomic_load(&team->busy) > 0; i++) pause();
  if (atomic_load(&team->busy) == 0) return;
  pthread_mutex_lock(&team->mutex);
  while (team->busy > 0) pthread_cond_wait(&team->done, &team->mutex);
  pthread_mutex_unlock(&team->mutex);
}

/// A loop whose items are followed in their order.
typedef struct order {
  void (*body)(void *, int, int);
  void (*then)(void *, int);
  void *context;
  cav_parallel_flag *ready;
  int n, next; ///< items; the first that was not followed
} order;

/// Follows what is ready.
static void catch_up(order *o) {
  for (; o->next < o->n && atomic_load(&o->ready[o->next]); o->next++) o->then(o->context, o->next);
}

static void follow(void *context, int item, int member) {
  order *o = context;
  o->body(o->context, item, member);
  atomic_store(&o->ready[item], 1);
  // by one member alone, in whose cache stays what one item leaves for the next
  if (member == 0) catch_up(o);
}

void cav_parallel_then(cav_parallel *team, int n, void (*body)(void *context, int item, int member),
                       void (*then)(void *context, int item), void *context, cav_parallel_flag *ready) {
  order o = {.body = body, .then = then, .context = context, .ready = ready, .n = n};
  for (int i = 0; i < n; i++) atomic_store(&ready[i], 0);
  cav_parallel_for(team, n, follow, &o);
  // what others had at hand when no item was left
  catch_up(&o);
}
