/// Many points of the dynamics in one call: a loop over rows, shared out to threads by blocks. Every thread has a state
/// of its own, and what a state did before does not change the bits of what it does next, so neither does who takes a
/// block.
#include <stdint.h>
#include <stdlib.h>

#include "cavort/dynamics.h"
#include "parallel.h"

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
  cav_state **state;  ///< [threads]
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

static void take_block(void *context, int block, int member) {
  batch *b = context;
  int end = b->n - block * BLOCK < BLOCK ? b->n : (block + 1) * BLOCK;
  for (int i = block * BLOCK; i < end; i++) {
    cav_status status = b->evaluate(b, b->state[member], (size_t)i);
    if (b->status) b->status[i] = status;
    if (status && i < b->failed[member]) b->failed[member] = i, b->why[member] = status;
  }
}

// all rows by a team whose members have their states
static cav_status run_team(batch *b, cav_parallel *team, const cav_options *options) {
  int threads = cav_parallel_size(team);
  for (int i = 0; i < threads; i++) {
    b->state[i] = cav_state_new(b->model);
    if (!b->state[i]) return CAV_NO_MEMORY;
    if (options) b->state[i]->options = *options;
    b->failed[i] = b->n;
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
  b->state = calloc((size_t)threads, sizeof *b->state);
  b->failed = calloc((size_t)threads, sizeof *b->failed);
  b->why = calloc((size_t)threads, sizeof *b->why);
  int whole = team && b->state && b->failed && b->why;
  cav_status status = whole ? run_team(b, team, options) : CAV_NO_MEMORY;
  for (int i = 0; b->state && i < threads; i++) cav_state_free(b->state[i]);
  cav_parallel_free(team);
  free(b->state);
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
