/// A body under model-predictive control. One step of the simulation is the model's own: its file's contacts, the
/// first-order step. What the controller takes to compute is not waited for: plans come into force when their delay is
/// over, whatever clock runs beside (optim/METHOD.md, 13); how long they took is noted.
#include "simulation.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/// Fraction of the forces that a step may leave unexplained, where it stopped above its tolerance.
static const double poor = 1e-6;

/// A run under way.
typedef struct plant {
  const cav_simulation *simulation;
  const cav_model *model;
  cav_mpc *mpc;
  cav_state *state, *bare; ///< the body; without contacts
  double *q, *v, *next, *u;
  double start[3]; ///< centre of mass
} plant;

static double now(clockid_t clock) {
  struct timespec t;
  clock_gettime(clock, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static cav_status no_memory(cav_error *error) {
  *error = (cav_error){CAV_NO_MEMORY, 0, "not enough memory for the simulation"};
  return CAV_NO_MEMORY;
}

static cav_status open_plant(plant *p, const cav_simulation *simulation, cav_error *error) {
  const cav_problem *problem = simulation->problem;
  const cav_model *m = problem->model;
  *p = (plant){.simulation = simulation, .model = m};
  if (!(p->mpc = cav_mpc_new(problem, &simulation->mpc, simulation->first, error))) return error->status;
  p->state = cav_state_new(m);
  p->bare = cav_state_new(m);
  p->q = calloc((size_t)(m->nq + 3 * m->nv), sizeof *p->q);
  if (!p->state || !p->bare || !p->q) return no_memory(error);
  p->v = p->q + m->nq, p->next = p->v + m->nv, p->u = p->next + m->nv;
  memcpy(p->q, problem->q_start, (size_t)m->nq * sizeof *p->q);
  memcpy(p->v, problem->v_start, (size_t)m->nv * sizeof *p->v);
  p->state->options.timestep = simulation->mpc.timestep;
  p->state->options.order = CAV_ORDER_EULER;
  p->bare->options.contact = p->bare->options.constraint = 0;
  cav_status status = cav_position(m, p->bare, p->q);
  if (status != CAV_OK) {
    snprintf(error->text, sizeof error->text, "start: %s", cav_status_name(status));
    return error->status = status;
  }
  cav_momentum(m, p->bare, p->v, p->start, NULL, NULL);
  return CAV_OK;
}

static void close_plant(plant *p) {
  cav_mpc_free(p->mpc);
  cav_state_free(p->state);
  cav_state_free(p->bare);
  free(p->q);
}

void cav_push_add(const cav_model *m, const cav_state *at, const cav_push *push, double *u) {
  double force[3], r[3];
  for (int k = 0; k < 3; k++) {
    force[k] = push->impulse[k] / push->length;
    r[k] = at->com[3 * push->link + k] - at->reference[3 * push->link + k];
  }
  const double moment[3] = {r[1] * force[2] - r[2] * force[1], r[2] * force[0] - r[0] * force[2],
                            r[0] * force[1] - r[1] * force[0]};
  for (int link = push->link; link > 0; link = m->link[link].parent)
    for (int d = m->link[link].dof; d < m->link[link].dof + m->link[link].ndof; d++)
      for (int k = 0; k < 3; k++) u[d] += at->axis[6 * d + k] * moment[k] + at->axis[6 * d + 3 + k] * force[k];
}

/// One step of the body. CAV_NOT_CONVERGED: there is no such step.
static cav_status step(plant *p) {
  const cav_model *m = p->model;
  cav_forward_report report = {0};
  memcpy(p->next, p->v, (size_t)m->nv * sizeof *p->next);
  cav_status status = cav_forward_newton(m, p->state, p->q, p->v, p->u, 200, 1e-9, p->next, &report);
  if (status == CAV_NOT_CONVERGED && report.residual <= poor) status = CAV_OK;
  if (status != CAV_OK) return status;
  memcpy(p->v, p->next, (size_t)m->nv * sizeof *p->v);
  cav_integrate(m, p->q, p->v, p->simulation->mpc.timestep, p->q);
  return CAV_OK;
}

/// Plans from where the body is, and notes it.
static cav_status plan(plant *p, double time, cav_run *run) {
  cav_progress at = {0};
  const double begin = now(CLOCK_MONOTONIC), work = now(CLOCK_PROCESS_CPUTIME_ID);
  const cav_status status = cav_mpc_plan(p->mpc, time, p->q, p->v, &at);
  run->plan[run->nplan] = (cav_plan_record){time, at.cost, at.unactuated, now(CLOCK_MONOTONIC) - begin,
                                            now(CLOCK_PROCESS_CPUTIME_ID) - work};
  const size_t t = (size_t)run->nplan++, nq = (size_t)p->model->nq, nv = (size_t)p->model->nv;
  memcpy(run->motion->q + t * nq, p->q, nq * sizeof(double));
  memcpy(run->motion->v + t * nv, p->v, nv * sizeof(double));
  return status;
}

/// Step number i with what comes before it.
static cav_status advance(plant *p, int i, const cav_push *push, cav_run *run) {
  const double time = i * p->simulation->mpc.timestep;
  const int plans = i % p->simulation->period == 0;
  cav_status status = plans ? plan(p, time, run) : CAV_OK;
  if (status == CAV_OK) status = cav_mpc_command(p->mpc, time, p->q, p->v, NULL, p->u);
  if (status == CAV_OK) status = cav_position(p->model, p->bare, p->q);
  if (status != CAV_OK) return status;
  double com[3];
  cav_momentum(p->model, p->bare, p->v, com, NULL, NULL);
  run->strayed = fmax(run->strayed, hypot(com[0] - p->start[0], com[1] - p->start[1]));
  if (plans)
    memcpy(run->motion->u + (size_t)(run->nplan - 1) * p->model->nv, p->u, (size_t)p->model->nv * sizeof *p->u);
  const double half = 0.5 * p->simulation->mpc.timestep;
  if (push && time > push->time - half && time < push->time + push->length - half)
    cav_push_add(p->model, p->bare, push, p->u);
  return step(p);
}

/// Height of link k's centre of mass, and the size of a posture: the largest distance of places of its links.
static double size_of(const cav_model *m, const cav_state *s) {
  double most = 0;
  for (int a = 1; a < m->nlink; a++)
    for (int b = 1; b < m->nlink; b++) {
      const double *x = s->com + 3 * a, *y = b == a ? s->link[b].pos : s->com + 3 * b;
      most = fmax(most, hypot(hypot(x[0] - y[0], x[1] - y[1]), x[2] - y[2]));
    }
  return most;
}

/// Where the body is at the end, against the goal posture.
static cav_status find_end(plant *p, cav_run *run) {
  const cav_model *m = p->model;
  double velocity[3];
  cav_status status = cav_position(m, p->bare, p->q);
  if (status != CAV_OK) return status;
  cav_momentum(m, p->bare, p->v, NULL, velocity, NULL);
  run->speed = sqrt(velocity[0] * velocity[0] + velocity[1] * velocity[1] + velocity[2] * velocity[2]);
  status = cav_position(m, p->state, p->simulation->problem->q_goal);
  const double size = size_of(m, p->state);
  for (int l = 1; l < m->nlink && size > 0; l++)
    run->lowered = fmax(run->lowered, (p->state->com[3 * l + 2] - p->bare->com[3 * l + 2]) / size);
  run->stands = !*run->stopped && run->lowered <= CAV_RUN_LOWERED && run->speed <= CAV_RUN_SPEED;
  return status;
}

void cav_run_clear(cav_run *run) {
  cav_trajectory_free(run->motion);
  free(run->plan);
  *run = (cav_run){0};
}

cav_status cav_simulate(const cav_simulation *simulation, const cav_push *push, cav_run *run, cav_error *error) {
  plant p;
  *run = (cav_run){0};
  const int plans = (simulation->steps - 1) / simulation->period + 1;
  cav_status status = open_plant(&p, simulation, error);
  if (status == CAV_OK) {
    run->motion = cav_trajectory_new(p.model, plans < 2 ? 2 : plans, simulation->period * simulation->mpc.timestep);
    run->plan = calloc((size_t)plans, sizeof *run->plan);
    if (!run->motion || !run->plan) status = no_memory(error);
  }
  for (int i = 0; i < simulation->steps && status == CAV_OK && !*run->stopped; i++) {
    status = advance(&p, i, push, run);
    if (status == CAV_NO_MEMORY) no_memory(error);
    if (status == CAV_OK || status == CAV_NO_MEMORY) continue;
    snprintf(run->stopped, sizeof run->stopped, "stopped at %.3f s: %s", i * simulation->mpc.timestep,
             cav_status_name(status));
    status = CAV_OK;
  }
  for (int i = 0; i < run->nplan; i++) run->cost += run->plan[i].cost / run->nplan;
  if (status == CAV_OK && find_end(&p, run) != CAV_OK) run->stands = 0;
  if (run->motion) run->motion->nknot = run->nplan > 2 ? run->nplan : 2;
  close_plant(&p);
  return status;
}
