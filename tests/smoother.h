/// A point mass that follows noisy positions, as a problem and as the linear smoother that it is: least squares over
/// its start and forces solved densely, and with a prior on the start the recursion of Rauch, Tung and Striebel, with
/// their covariances.
#ifndef CAVORT_TESTS_SMOOTHER_H
#define CAVORT_TESTS_SMOOTHER_H

#include "cavort/cavort.h"
#include "scene.h"
#include "storage.h"

enum { STEPS = 40, STATES = 2 };
static const double mass = 1.7, step = 0.025, of_force = 0.3, of_place = 400;

static const char cart[] =
    "<mujoco model='cart'><option gravity='0 0 0'/><worldbody><body name='cart'>"
    "<joint name='x' type='slide' axis='1 0 0'/><geom type='sphere' size='.1' mass='1.7'/></body>"
    "</worldbody><actuator><motor joint='x'/></actuator></mujoco>";

/// What was seen, weights of a prior on the start (0: none) and what it says.
typedef struct record {
  double seen[STEPS + 1], time[STEPS + 1], prior[STATES], weight[STATES];
} record;

static inline record make_record(int with_prior) {
  record r = {.prior = {0.1, -0.4}};
  for (int t = 0; t <= STEPS; t++) {
    r.time[t] = t * step;
    r.seen[t] = 0.7 + 0.9 * r.time[t] + 0.2 * sin(5 * r.time[t]) + 0.05 * scene_uniform();
  }
  if (with_prior) r.weight[0] = 30, r.weight[1] = 3;
  return r;
}

// ---------------------------------------------------------------- the smoother, written twice

/// Least squares over (q_0, v_0, u_0 .. u_{T-1}) by the normal equations: states [(STEPS+1)*2], their covariances
/// [(STEPS+1)*4] and the deviations of the forces [STEPS]; NULL: not wanted.
static inline void smooth_densely(const record *r, double *state, double *cov, double *force) {
  enum { N = STATES + STEPS };
  static double A[N][2 * N + 1], row[STEPS + 1][STATES][N];
  memset(A, 0, sizeof A);
  memset(row, 0, sizeof row);
  row[0][0][0] = row[0][1][1] = 1;
  for (int t = 0; t < STEPS; t++) {
    for (int j = 0; j < N; j++) row[t + 1][1][j] = row[t][1][j];
    row[t + 1][1][STATES + t] += step / mass;
    for (int j = 0; j < N; j++) row[t + 1][0][j] = row[t][0][j] + step * row[t + 1][1][j];
    A[STATES + t][STATES + t] += step * of_force;
  }
  for (int t = 0; t <= STEPS; t++)
    for (int i = 0; i < N; i++) {
      for (int j = 0; j < N; j++) A[i][j] += step * of_place * row[t][0][i] * row[t][0][j];
      A[i][N] += step * of_place * row[t][0][i] * r->seen[t];
    }
  for (int k = 0; k < STATES; k++) A[k][k] += r->weight[k], A[k][N] += r->weight[k] * r->prior[k];
  // elimination, the inverse beside it; the matrix is positive definite
  for (int i = 0; i < N; i++) A[i][N + 1 + i] = 1;
  for (int c = 0; c < N; c++)
    for (int i = 0; i < N; i++) {
      double f = i != c ? A[i][c] / A[c][c] : 0;
      for (int j = c; j <= 2 * N && f != 0; j++) A[i][j] -= f * A[c][j];
    }
  for (int t = 0; t <= STEPS && cov; t++)
    for (int k = 0; k < 4; k++) {
      cov[4 * t + k] = 0;
      for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) cov[4 * t + k] += row[t][k / 2][i] * A[i][N + 1 + j] / A[i][i] * row[t][k % 2][j];
    }
  for (int t = 0; t < STEPS && force; t++)
    force[t] = sqrt(A[STATES + t][N + 1 + STATES + t] / A[STATES + t][STATES + t]);
  for (int t = 0; t <= STEPS; t++)
    for (int k = 0; k < STATES; k++) {
      state[t * STATES + k] = 0;
      for (int j = 0; j < N; j++) state[t * STATES + k] += row[t][k][j] * A[j][N] / A[j][j];
    }
}

typedef struct gauss {
  double x[2], P[2][2];
} gauss;

static inline void see(gauss *g, double seen) {
  double S = g->P[0][0] + 1 / (step * of_place), K[2] = {g->P[0][0] / S, g->P[1][0] / S}, off = seen - g->x[0];
  double row[2] = {g->P[0][0], g->P[0][1]};
  for (int i = 0; i < 2; i++) {
    g->x[i] += K[i] * off;
    for (int j = 0; j < 2; j++) g->P[i][j] -= K[i] * row[j];
  }
}

static const double F[2][2] = {{1, 0.025}, {0, 1}};

static inline gauss go(const gauss *g) {
  gauss next = {0};
  double G[2] = {step * step / mass, step / mass}, FP[2][2] = {0};
  for (int i = 0; i < 2; i++)
    for (int k = 0; k < 2; k++) {
      next.x[i] += F[i][k] * g->x[k];
      for (int j = 0; j < 2; j++) FP[i][j] += F[i][k] * g->P[k][j];
    }
  for (int i = 0; i < 2; i++)
    for (int j = 0; j < 2; j++) {
      for (int k = 0; k < 2; k++) next.P[i][j] += FP[i][k] * F[j][k];
      next.P[i][j] += G[i] * G[j] / (step * of_force);
    }
  return next;
}

/// Kalman's filter forwards, Rauch's, Tung's and Striebel's recursion back; needs a prior. cov NULL: not wanted.
static inline void smooth_by_recursion(const record *r, double *state, double *cov) {
  gauss after[STEPS + 1], before[STEPS + 1], is;
  double late[2][2] = {{0}};
  before[0] = (gauss){.x = {r->prior[0], r->prior[1]}, .P = {{1 / r->weight[0], 0}, {0, 1 / r->weight[1]}}};
  for (int t = 0; t <= STEPS; t++) {
    if (t > 0) before[t] = go(&after[t - 1]);
    after[t] = before[t];
    see(&after[t], r->seen[t]);
  }
  is = after[STEPS];
  for (int t = STEPS; t >= 0; t--) {
    if (t < STEPS) {
      double(*P)[2] = before[t + 1].P;
      double det = P[0][0] * P[1][1] - P[0][1] * P[1][0], off[2], PF[2][2] = {0};
      double inverse[2][2] = {{P[1][1] / det, -P[0][1] / det}, {-P[1][0] / det, P[0][0] / det}};
      for (int i = 0; i < 2; i++) off[i] = is.x[i] - before[t + 1].x[i];
      is = after[t];
      for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
          for (int k = 0; k < 2; k++) PF[i][j] += after[t].P[i][k] * F[j][k];
      for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
          for (int k = 0; k < 2; k++) is.x[i] += PF[i][j] * inverse[j][k] * off[k];
      // P := P_after + G (P_next - P_before) G' with G = P F' / P_before
      double G[2][2] = {0}, change[2][2], GC[2][2] = {0};
      for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++) {
          for (int k = 0; k < 2; k++) G[i][j] += PF[i][k] * inverse[k][j];
          change[i][j] = late[i][j] - P[i][j];
        }
      for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
          for (int k = 0; k < 2; k++) GC[i][j] += G[i][k] * change[k][j];
      for (int i = 0; i < 2; i++)
        for (int j = 0; j < 2; j++)
          for (int k = 0; k < 2; k++) is.P[i][j] += GC[i][k] * G[j][k];
    }
    memcpy(late, is.P, sizeof late);
    if (cov) memcpy(cov + 4 * (size_t)t, is.P, sizeof is.P);
    memcpy(state + (size_t)t * STATES, is.x, sizeof is.x);
  }
}

// ---------------------------------------------------------------- the same as a problem

static inline int bench_make(bench *b, const char *text, double duration) {
  *b = (bench){.model = scene_load(text)};
  if (!CHECK(b->model != NULL)) return 0;
  b->problem = cav_problem_default(b->model);
  memcpy(b->q_start, b->model->q0, (size_t)b->model->nq * sizeof(double));
  b->problem.duration = duration;
  b->problem.timestep = step;
  b->problem.close_at_rest = 0;
  b->problem.free_start = 1;
  b->problem.q_start = b->problem.q_goal = b->q_start, b->problem.v_start = b->v_start;
  b->problem.term = b->term;
  return 1;
}

static inline int bench_smoother(bench *b, const record *r) {
  if (!bench_make(b, cart, STEPS * step)) return 0;
  add(b, cav_term_cost(CAV_QUANTITY_EFFORT, of_force));
  cav_term *term = add(b, cav_term_cost(CAV_QUANTITY_CONFIGURATION, of_place));
  term->target = r->seen, term->nwaypoint = STEPS + 1, term->waypoint_time = r->time;
  for (int k = 0; k < STATES && r->weight[k] > 0; k++) {
    term = add(b, cav_term_cost(k ? CAV_QUANTITY_VELOCITY : CAV_QUANTITY_CONFIGURATION, r->weight[k]));
    term->target = &r->prior[k], term->to = 0;
  }
  return 1;
}

#endif
