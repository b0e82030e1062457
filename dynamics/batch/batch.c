/// Many points of the dynamics in one call: a loop over rows, shared out to threads by blocks. Every thread has states
/// of its own, and what a state did before does not change the bits of what it does next, so neither does who takes a
/// block. Inverses go four rows at a time, with the bits of one.
#include <stdint.h>
#include <stdlib.h>

#include "cavort/dynamics.h"
#include "parallel.h"
#include "step.h"

enum { BLOCK = 32 }; // rows: some 30 us of inverses, so drawing a block costs nothing

typedef struct batch batch;
typedef cav_status (*point)(const batch *b, cav_state *state, size_t row);

struct batch {
  const cav_model *model;
  point evaluate;
  cav_derivative method;
  int n;
  size_t nq, nv;
  const double *q, *v, *given; ///< v_next, or u of a forward step
  double *found;               ///< u, or v_next of a forward step
  double *d_dq, *d_dv, *d_dv_next;
  cav_state **state;  ///< [threads*per_thread]
  int per_thread;     ///< four where rows are taken by four
  cav_lanes **lanes;  ///< [threads], NULL where rows are taken singly
  cav_status *status; ///< [n], NULL: not asked for
  int *failed;        ///< [threads] the first row of each thread that failed, n: none
  cav_status *why;    ///< [threads] its status
};

static cav_status inverse(const batch *b, cav_state *state, size_t row) {
  return cav_inverse(b->model, state, b->q + row * b->nq, b->v + row * b->nv, b->given + row * b->nv,
                     b->found + row * b->nv);
}

static cav_status forward(const batch *b, cav_state *state, size_t row) {
  return cav_forward(b->model, state, b->q + row * b->nq, b->v + row * b->nv, b->given + row * b->nv,
                     b->found + row * b->nv);
}

static double *matrix(double *matrices, const batch *b, size_t row) {
  return matrices ? matrices + row * b->nv * b->nv : NULL;
}

static cav_status jacobian(const batch *b, cav_state *state, size_t row) {
  return cav_inverse_jacobian_by(b->model, state, b->method, b->q + row * b->nq, b->v + row * b->nv,
                                 b->given + row * b->nv, matrix(b->d_dq, b, row), matrix(b->d_dv, b, row),
                                 matrix(b->d_dv_next, b, row));
}

static void note(batch *b, int member, int row, cav_status status) {
  if (b->status) b->status[row] = status;
  if (status && row < b->failed[member]) b->failed[member] = row, b->why[member] = status;
}

// four inverses from a row on
static void take_four(batch *b, int member, int first) {
  const double *q[CAV_LANES], *v[CAV_LANES], *next[CAV_LANES];
  double *u[CAV_LANES];
  cav_status status[CAV_LANES];
  for (int l = 0; l < CAV_LANES; l++) {
    const size_t row = (size_t)(first + l);
    q[l] = b->q + row * b->nq, v[l] = b->v + row * b->nv, next[l] = b->given + row * b->nv;
    u[l] = b->found + row * b->nv;
  }
  cav_inverse_four(b->model, b->lanes[member], b->state + member * b->per_thread, q, v, next, u, status);
  for (int l = 0; l < CAV_LANES; l++) note(b, member, first + l, status[l]);
}

static void take_block(void *context, int block, int member) {
  batch *b = context;
  int end = b->n - block * BLOCK < BLOCK ? b->n : (block + 1) * BLOCK, i = block * BLOCK;
  for (; b->lanes[member] && i + CAV_LANES <= end; i += CAV_LANES) take_four(b, member, i);
  for (; i < end; i++) note(b, member, i, b->evaluate(b, b->state[member * b->per_thread], (size_t)i));
}

// all rows by a team whose members have their states
static cav_status run_team(batch *b, cav_parallel *team, const cav_options *options) {
  int threads = cav_parallel_size(team);
  for (int i = 0; i < threads * b->per_thread; i++) {
    b->state[i] = cav_state_new(b->model);
    if (!b->state[i]) return CAV_NO_MEMORY;
    if (options) b->state[i]->options = *options;
  }
  for (int i = 0; i < threads; i++) {
    b->failed[i] = b->n;
    if (b->per_thread < CAV_LANES) continue;
    b->lanes[i] = cav_lanes_new(b->model);
    if (!b->lanes[i]) return CAV_NO_MEMORY;
  }
  cav_parallel_for(team, (b->n + BLOCK - 1) / BLOCK, take_block, b);
  int first = 0;
  for (int i = 1; i < threads; i++) {
    if (b->failed[i] < b->failed[first]) first = i;
  }
  return b->failed[first] < b->n ? b->why[first] : CAV_OK;
}

static cav_status run(batch *b, const cav_options *options, int threads) {
  if (b->n < 0 || threads < 1 || b->n > INT32_MAX - BLOCK) return CAV_BAD_INPUT;
  b->nq = (size_t)b->model->nq;
  b->nv = (size_t)b->model->nv;
  int blocks = (b->n + BLOCK - 1) / BLOCK;
  if (threads > blocks) threads = blocks ? blocks : 1;
  cav_parallel *team = cav_parallel_new(threads);
  b->per_thread = b->evaluate == inverse && b->n >= CAV_LANES && cav_lanes_pay() ? CAV_LANES : 1;
  size_t states = (size_t)threads * (size_t)b->per_thread;
  b->state = calloc(states, sizeof *b->state);
  b->lanes = calloc((size_t)threads, sizeof *b->lanes);
  b->failed = calloc((size_t)threads, sizeof *b->failed);
  b->why = calloc((size_t)threads, sizeof *b->why);
  int whole = team && b->state && b->lanes && b->failed && b->why;
  cav_status status = whole ? run_team(b, team, options) : CAV_NO_MEMORY;
  for (size_t i = 0; b->state && i < states; i++) cav_state_free(b->state[i]);
  for (int i = 0; b->lanes && i < threads; i++) cav_lanes_free(b->lanes[i]);
  cav_parallel_free(team);
  free(b->state);
  free(b->lanes);
  free(b->failed);
  free(b->why);
  return status;
}

cav_status cav_inverse_batch(const cav_model *model, const cav_options *options, int threads, int n, const double *q,
                             const double *v, const double *v_next, double *u, cav_status *status) {
  batch b = {
      .model = model, .evaluate = inverse, .n = n, .q = q, .v = v, .given = v_next, .found = u, .status = status};
  return run(&b, options, threads);
}

cav_status cav_forward_batch(const cav_model *model, const cav_options *options, int threads, int n, const double *q,
                             const double *v, const double *u, double *v_next, cav_status *status) {
  batch b = {
      .model = model, .evaluate = forward, .n = n, .q = q, .v = v, .given = u, .found = v_next, .status = status};
  return run(&b, options, threads);
}

cav_status cav_inverse_jacobian_batch(const cav_model *model, const cav_options *options, cav_derivative method,
                                      int threads, int n, const double *q, const double *v, const double *v_next,
                                      double *du_dq, double *du_dv, double *du_dv_next, cav_status *status) {
  batch b = {.model = model,
             .evaluate = jacobian,
             .method = method,
             .n = n,
             .q = q,
             .v = v,
             .given = v_next,
             .d_dq = du_dq,
             .d_dv = du_dv,
             .d_dv_next = du_dv_next,
             .status = status};
  return run(&b, options, threads);
}
