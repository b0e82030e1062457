/// What benchmarks share: a clock, an order, and random states of a model that MuJoCo has loaded.
#ifndef CAVORT_TESTS_BENCH_H
#define CAVORT_TESTS_BENCH_H

#include <time.h>

#include "scene.h"

static inline double bench_seconds(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/// For qsort of doubles.
static inline int bench_ascending(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>

/// A state in d: postures from relaxed to cramped, height from clear of the floor to pressed on it.
static inline void bench_draw(const mjModel *m, mjData *d) {
  double spread = 0.3 + 0.3 * scene_uniform(), lift = 0.3 * scene_uniform();
  mj_resetData(m, d);
  for (int i = 0; i < m->njnt; i++) {
    double *q = d->qpos + m->jnt_qposadr[i];
    const double *range = m->jnt_range + 2 * i;
    if (m->jnt_type[i] == mjJNT_FREE) {
      for (int k = 3; k < 7; k++) q[k] = scene_normal();
      mju_normalize4(q + 3);
    } else if (m->jnt_limited[i]) {
      *q = 0.5 * (range[0] + range[1]) + spread * (range[1] - range[0]) * scene_uniform();
    }
  }
  mj_kinematics(m, d);
  double lowest = INFINITY;
  for (int i = 0; i < m->ngeom; i++) {
    if (m->geom_bodyid[i] > 0) lowest = fmin(lowest, d->geom_xpos[3 * i + 2] - m->geom_size[3 * i]);
  }
  if (m->jnt_type[0] == mjJNT_FREE) d->qpos[2] += lift - lowest;
  for (int i = 0; i < m->nv; i++) {
    d->qvel[i] = scene_normal();
    d->qacc[i] = 20 * scene_normal();
  }
}
#endif

#endif
