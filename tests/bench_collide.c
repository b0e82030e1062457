/// Time of cav_contacts_find on the humanoid against mj_collision, same states, in turns: a posture in the air, where
/// the broad phase is nearly all, and random postures near the ground; exact law, and the smoothed law's longer reach.
#include <time.h>

#include "check.h"
#include "math3.h"
#include "step.h"

#ifdef CAVORT_HAVE_MUJOCO
#include <mujoco/mujoco.h>

enum { STATES = 200, REPEATS = 31 };

// xorshift: the same numbers on every machine
static unsigned long long seed = 88172645463325252ULL;
static double uniform(double low, double high) {
  seed ^= seed << 13;
  seed ^= seed >> 7;
  seed ^= seed << 17;
  return low + (high - low) * (double)(seed >> 11) / 9007199254740992.0;
}

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec * 1e6 + (double)t.tv_nsec * 1e-3;
}

static int by_value(const void *a, const void *b) {
  double x = *(const double *)a, y = *(const double *)b;
  return (x > y) - (x < y);
}

/// Times of one kind of call, microseconds.
typedef struct times {
  double at[REPEATS];
} times;

static double quantile(times *t, double fraction) {
  qsort(t->at, REPEATS, sizeof *t->at, by_value);
  return t->at[(int)(fraction * (REPEATS - 1))];
}

/// Both engines at the same states.
typedef struct rig {
  const cav_model *model;
  cav_state *state;
  const mjModel *m;
  mjData *d[STATES]; // kinematics done
  cav_pose *pose[STATES];
} rig;

static void posture(const rig *r, mjData *d, int airborne) {
  memcpy(d->qpos, r->m->qpos0, sizeof(double) * (size_t)r->m->nq);
  if (airborne) {
    d->qpos[2] = 10;
    return;
  }
  d->qpos[2] = uniform(0, 1);
  for (int i = 3; i < 7; i++) d->qpos[i] = uniform(-1, 1);
  quat_normalise(d->qpos + 3);
  for (int j = 1; j < r->m->njnt; j++) {
    d->qpos[r->m->jnt_qposadr[j]] = uniform(r->m->jnt_range[2 * j], r->m->jnt_range[2 * j + 1]);
  }
}

static void compare(rig *r, const char *name, double smoothing) {
  times ours, theirs;
  double contacts = 0, their_contacts = 0;
  size_t poses = sizeof(cav_pose) * (size_t)r->model->nlink;
  r->state->options.smoothing = r->state->options.smoothing_self = smoothing;
  for (int repeat = 0; repeat < REPEATS; repeat++) {
    double start = now(), copy;
    for (int k = 0; k < STATES; k++) memcpy(r->state->link, r->pose[k], poses);
    copy = now() - start;
    start = now();
    for (int k = 0; k < STATES; k++) {
      memcpy(r->state->link, r->pose[k], poses);
      cav_contacts_find(r->model, r->state);
      contacts += r->state->ncontact;
    }
    ours.at[repeat] = (now() - start - copy) / STATES;
    start = now();
    for (int k = 0; k < STATES; k++) {
      mj_collision(r->m, r->d[k]);
      their_contacts += r->d[k]->ncon;
    }
    theirs.at[repeat] = (now() - start) / STATES;
  }
  double a = quantile(&ours, 0.5), b = quantile(&theirs, 0.5);
  printf("%-34s %5.1f contacts: %6.2f us (%.2f to %.2f); mj_collision %5.1f contacts: %6.2f us; ratio %.2f\n", name,
         contacts / STATES / REPEATS, a, quantile(&ours, 0.1), quantile(&ours, 0.9), their_contacts / STATES / REPEATS,
         b, a / b);
}

int main(void) {
  char path[4200], text[300] = "";
  const char *folder = check_shared_models();
  if (!folder) {
    printf("shared models absent\n");
    return CHECK_SKIPPED;
  }
  snprintf(path, sizeof path, "%s/mujoco/humanoid.xml", folder);
  cav_error error;
  cav_model *model = cav_model_load(path, &error);
  mjModel *m = mj_loadXML(path, NULL, text, sizeof text);
  rig r = {.model = model, .m = m, .state = model ? cav_state_new(model) : NULL};
  if (!r.state || !m) {
    fprintf(stderr, "%s: %s %s\n", path, model ? "" : error.text, text);
    return EXIT_FAILURE;
  }
  printf("%s: %d pairs\n", path, model->npair);
  for (int airborne = 1; airborne >= 0; airborne--) {
    for (int k = 0; k < STATES; k++) {
      r.d[k] = mj_makeData(m);
      r.pose[k] = malloc(sizeof(cav_pose) * (size_t)model->nlink);
      if (!r.d[k] || !r.pose[k]) return EXIT_FAILURE;
      posture(&r, r.d[k], airborne);
      mj_kinematics(m, r.d[k]);
      mj_comPos(m, r.d[k]);
      cav_position(model, r.state, r.d[k]->qpos);
      memcpy(r.pose[k], r.state->link, sizeof(cav_pose) * (size_t)model->nlink);
    }
    compare(&r, airborne ? "in the air" : "near the ground", 0);
    compare(&r, airborne ? "in the air, reach 0.12 m" : "near the ground, reach 0.12 m", 0.01);
    for (int k = 0; k < STATES; k++) {
      mj_deleteData(r.d[k]);
      free(r.pose[k]);
    }
  }
  mj_deleteModel(m);
  cav_state_free(r.state);
  cav_model_free(model);
  return EXIT_SUCCESS;
}
#else
int main(void) {
  printf("built without MuJoCo\n");
  return CHECK_SKIPPED;
}
#endif
