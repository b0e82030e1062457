/// Model-predictive control on a solver that keeps its memory (optimiser.c). A plan is the last one, read from where the
/// body will be when it comes into force, and a few Gauss-Newton steps under one law with rows held by fixed penalties:
/// multipliers that are updated once a plan lag behind a body that is pushed (optim/METHOD.md, 13). Two plans are kept,
/// since one is made while the other is followed.
#include "cavort/mpc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/// A time that is reached but for rounding, s.
static const double rounding = 1e-9;

/// Most that damping of springs may take of a dof's velocity within a step of the simulation, half of it. Where all of it was
/// taken, from one dof alone, torques of joints of long arms went from limit to limit every millisecond.
static const double held = 0.25;

struct cav_mpc {
  const cav_problem *problem;
  const cav_model *model;
  cav_mpc_options options;
  cav_optimiser *optimiser;
  double begin;                ///< s, time of the optimiser's first knot
  cav_trajectory *plan[2];     ///< the newest one and the one before it
  double start[2];             ///< s, time of their first knots
  cav_state *state, *bare;     ///< of looking ahead; without contacts
  double *q, *v, *next;        ///< [nq], [nv], [nv] ahead; q holds the room of all
  double *q_plan, *u;          ///< [nq], [nv]
  double *difference, *moment; ///< [nv], [nv]
  double *effort, *input;      ///< [nu], [nu]
  double *inertia, *factor;    ///< [nv*nv] M, and its triangular factor
  double *give;                ///< [nv] diagonal of M^-1
};

cav_mpc_options cav_mpc_options_default(void) {
  return (cav_mpc_options){.threads = 1, .iterations = 2, .timestep = 0.001, .stiffness = 40};
}

static cav_status refuse(cav_error *error, cav_status status, const char *text) {
  if (error) {
    *error = (cav_error){.status = status};
    strncpy(error->text, text, sizeof error->text - 1);
  }
  return status;
}

static cav_status check(const cav_problem *problem, const cav_mpc_options *o, cav_error *error) {
  const double ahead = o->knots ? (o->knots - 1) * problem->timestep : problem->duration;
  if (problem->cycle.on || problem->duration_most > 0)
    return refuse(error, CAV_NOT_SUPPORTED, "mpc: plans ahead of a moving body: no cycle and no free duration");
  if (o->threads < 1 || o->iterations < 1)
    return refuse(error, CAV_BAD_INPUT, "mpc: expected at least one thread and one iteration a plan");
  if (o->knots != 0 && (o->knots < 2 || ahead > problem->duration * (1 + rounding)))
    return refuse(error, CAV_BAD_INPUT, "mpc: expected knots of a plan from 2 to those of the problem, or 0: all");
  if (!(o->delay >= 0 && isfinite(o->delay)) || !(o->timestep > 0 && isfinite(o->timestep)) ||
      !(o->stiffness >= 0 && isfinite(o->stiffness)))
    return refuse(error, CAV_BAD_INPUT, "mpc: expected a delay and a stiffness from 0 on and a timestep above 0");
  if (!(o->delay + problem->timestep < ahead))
    return refuse(error, CAV_BAD_INPUT, "mpc: the delay is as long as plans look ahead; expected a longer duration");
  return CAV_OK;
}

/// Room for all vectors, states and plans; CAV_NO_MEMORY if there is none.
static cav_status make_room(cav_mpc *mpc, const cav_trajectory *first) {
  const cav_model *m = mpc->model;
  const size_t nq = (size_t)m->nq, nv = (size_t)m->nv, nu = (size_t)m->nu;
  double **const part[] = {&mpc->q,      &mpc->q_plan, &mpc->v,     &mpc->next,    &mpc->u,      &mpc->difference,
                           &mpc->moment, &mpc->effort, &mpc->input, &mpc->inertia, &mpc->factor, &mpc->give};
  const size_t size[] = {nq, nq, nv, nv, nv, nv, nv, nu, nu, nv * nv, nv * nv, nv};
  double *room = calloc(2 * nq + 6 * nv + 2 * nu + 2 * nv * nv, sizeof *room);
  for (int i = 0; room && i < 12; i++) *part[i] = room, room += size[i];
  mpc->state = cav_state_new(m);
  mpc->bare = cav_state_new(m);
  mpc->plan[0] = cav_trajectory_copy(first);
  mpc->plan[1] = cav_trajectory_copy(first);
  if (!mpc->q || !mpc->state || !mpc->bare || !mpc->plan[0] || !mpc->plan[1]) return CAV_NO_MEMORY;
  // contacts as the model's file has them
  cav_options *law = &mpc->state->options;
  law->order = CAV_ORDER_EULER;
  law->stabilisation = CAV_STABILISATION_SOLREF;
  law->smoothing = law->smoothing_self = 0;
  law->refsafe = 1;
  mpc->bare->options.contact = mpc->bare->options.constraint = 0;
  return CAV_OK;
}

/// The first knots of a problem's guess; NULL with the reason in error.
static cav_trajectory *begin_of_guess(const cav_problem *problem, int knots, cav_error *error) {
  cav_trajectory *guess = cav_problem_guess(problem, error);
  if (guess && knots < guess->nknot) guess->nknot = knots;
  return guess;
}

/// An optimiser at a plan for the problem's start: the given one, or one that is solved for. What did not converge is a
/// plan all the same.
static cav_optimiser *open_optimiser(const cav_mpc *mpc, const cav_trajectory *start, cav_error *error) {
  cav_solve_options options = cav_solve_options_default();
  cav_solution *solution = NULL;
  cav_problem plan = *mpc->problem;
  const int knots = mpc->options.knots;
  if (knots) plan.duration = (knots - 1) * plan.timestep, plan.nguess_pose = 0;
  options.threads = mpc->options.threads;
  options.gains = options.diagnose = 0;
  options.fixed_multipliers = options.moving_targets = 1;
  if (!start) {
    cav_trajectory *guess = begin_of_guess(mpc->problem, (int)lround(plan.duration / plan.timestep) + 1, error);
    if (guess) cav_solve(&plan, &options, guess, &solution, error);
    cav_trajectory_free(guess);
    if (!solution) return NULL;
  }
  cav_optimiser *optimiser = cav_optimiser_new(&plan, &options, start ? start : solution->trajectory, error);
  cav_solution_free(solution);
  return optimiser;
}

/// Opens all that a controller has. Its forces are there after an iteration.
static cav_status open_all(cav_mpc *mpc, const cav_trajectory *start, cav_error *error) {
  mpc->optimiser = open_optimiser(mpc, start, error);
  if (!mpc->optimiser) return error->status;
  cav_status status = cav_optimiser_iterate(mpc->optimiser, mpc->options.iterations, NULL);
  if (status != CAV_OK) return refuse(error, status, "mpc: the first plan cannot be evaluated");
  status = make_room(mpc, cav_optimiser_trajectory(mpc->optimiser));
  return status == CAV_OK ? CAV_OK : refuse(error, status, "mpc: not enough memory");
}

cav_mpc *cav_mpc_new(const cav_problem *problem, const cav_mpc_options *options, const cav_trajectory *start,
                     cav_error *error) {
  cav_error ignored;
  if (!error) error = &ignored;
  const cav_mpc_options o = options ? *options : cav_mpc_options_default();
  if (check(problem, &o, error)) return NULL;
  cav_mpc *mpc = calloc(1, sizeof *mpc);
  if (!mpc) {
    refuse(error, CAV_NO_MEMORY, "mpc: not enough memory");
    return NULL;
  }
  *mpc = (cav_mpc){.problem = problem, .model = problem->model, .options = o};
  if (open_all(mpc, start, error) == CAV_OK) return mpc;
  cav_mpc_free(mpc);
  return NULL;
}

void cav_mpc_free(cav_mpc *mpc) {
  if (!mpc) return;
  cav_optimiser_free(mpc->optimiser);
  cav_trajectory_free(mpc->plan[0]);
  cav_trajectory_free(mpc->plan[1]);
  cav_state_free(mpc->state);
  cav_state_free(mpc->bare);
  free(mpc->q);
  free(mpc);
}

/// The plan in force at a time.
static int plan_at(const cav_mpc *mpc, double time) { return time >= mpc->start[0] - rounding ? 0 : 1; }

/// Velocity of dof d of a plan at x knots: steps have the velocities of their middles; at the end it rests.
static double velocity_at(const cav_trajectory *plan, double x, int d) {
  const int t = (int)(x + 0.5);
  const double part = x + 0.5 - t;
  const double *v = plan->v + (size_t)t * plan->nv + d;
  return (t < plan->nknot ? (1 - part) * v[0] : 0) + (t + 1 < plan->nknot ? part * v[plan->nv] : 0);
}

/// The diagonal of M^-1: squares of the columns of L^-1, M = L L'.
static void find_give(cav_mpc *mpc) {
  const int n = mpc->model->nv;
  double *L = mpc->factor;
  for (int i = 0; i < n; i++)
    for (int j = 0; j <= i; j++) {
      double sum = mpc->inertia[i * n + j];
      for (int k = 0; k < j; k++) sum -= L[i * n + k] * L[j * n + k];
      L[i * n + j] = i == j ? sqrt(sum) : sum / L[j * n + j];
    }
  for (int d = 0; d < n; d++) {
    double *x = mpc->moment;
    mpc->give[d] = 0;
    for (int i = d; i < n; i++) {
      double sum = i == d;
      for (int k = d; k < i; k++) sum -= L[i * n + k] * x[k];
      x[i] = sum / L[i * n + i];
      mpc->give[d] += x[i] * x[i];
    }
  }
}

/// What springs count as the inertia of dof d: its diagonal entry of M, of all that the joint carries, but at most what damping
/// 2 w times that can hold: where other joints give way it moves 1/(M^-1)_dd alone, of whose velocity a step h of the simulation
/// then takes 2 w h M_dd (M^-1)_dd, and at 2 turns it around for ever.
static double inertia_of(const cav_mpc *mpc, int d) {
  const double rate = mpc->options.stiffness * mpc->options.timestep;
  const double own = mpc->inertia[d * mpc->model->nv + d];
  return rate > 0 ? fmin(own, held / (rate * mpc->give[d])) : own;
}

/// u := the plan's forces at a time less critically damped springs back to it. Forces are those of the step.
static void follow(cav_mpc *mpc, double time, const double *q, const double *v) {
  const cav_model *m = mpc->model;
  const int i = plan_at(mpc, time), nq = m->nq, nv = m->nv;
  const cav_trajectory *plan = mpc->plan[i];
  const double x = fmin(fmax(time - mpc->start[i] + rounding, 0) / plan->timestep, plan->nknot - 1);
  const double rate = mpc->options.stiffness;
  const int t = (int)x, ends = t == plan->nknot - 1;
  memcpy(mpc->q_plan, plan->q + (size_t)t * nq, (size_t)nq * sizeof(double));
  if (!ends) cav_integrate(m, mpc->q_plan, plan->v + (size_t)(t + 1) * nv, (x - t) * plan->timestep, mpc->q_plan);
  cav_difference(m, mpc->q_plan, q, 1, mpc->difference);
  for (int d = 0; d < nv; d++) {
    const double inertia = inertia_of(mpc, d), straying = v[d] - velocity_at(plan, x, d);
    mpc->u[d] = plan->u[(size_t)t * nv + d] - inertia * rate * (rate * mpc->difference[d] + 2 * straying);
  }
}

/// u := what actuators give with their inputs at the state's position and v.
static void act(cav_mpc *mpc, const double *v, const double *input, double *u) {
  const cav_model *m = mpc->model;
  memset(u, 0, (size_t)m->nv * sizeof(double));
  for (int a = 0; a < m->nu; a++) {
    double length = cav_actuator_length(m, mpc->bare, a, mpc->moment), velocity = 0;
    for (int d = 0; d < m->nv; d++) velocity += mpc->moment[d] * v[d];
    const double force = cav_actuator_force(m, a, length, velocity, input[a]);
    for (int d = 0; d < m->nv; d++) u[d] += force * mpc->moment[d];
  }
}

cav_status cav_mpc_command(cav_mpc *mpc, double time, const double *q, const double *v, double *input, double *u) {
  const cav_model *m = mpc->model;
  cav_status status = cav_inertia(m, mpc->bare, q, mpc->inertia);
  if (status == CAV_OK) status = cav_position(m, mpc->bare, q);
  if (status != CAV_OK) return status;
  find_give(mpc);
  follow(mpc, time, q, v);
  cav_actuation(m, mpc->bare, mpc->u, NULL, mpc->effort);
  cav_actuation_inputs(m, mpc->bare, v, mpc->effort, mpc->input);
  if (input) memcpy(input, mpc->input, (size_t)m->nu * sizeof(double));
  if (u) act(mpc, v, mpc->input, u);
  return CAV_OK;
}

/// q, v := where the body will be when the delay is over.
static cav_status look_ahead(cav_mpc *mpc, double time, const double *q, const double *v) {
  const cav_model *m = mpc->model;
  const double delay = mpc->options.delay;
  const int steps = (int)ceil(delay / mpc->options.timestep - rounding);
  memcpy(mpc->q, q, (size_t)m->nq * sizeof(double));
  memcpy(mpc->v, v, (size_t)m->nv * sizeof(double));
  for (int i = 0; i < steps; i++) {
    const double h = delay / steps;
    mpc->state->options.timestep = h;
    cav_status status = cav_mpc_command(mpc, time + i * h, mpc->q, mpc->v, NULL, mpc->u);
    if (status == CAV_OK) status = cav_forward(m, mpc->state, mpc->q, mpc->v, mpc->u, mpc->next);
    // a step that ended above its tolerance is as good a guess
    if (status != CAV_OK && status != CAV_NOT_CONVERGED) return status;
    memcpy(mpc->v, mpc->next, (size_t)m->nv * sizeof(double));
    cav_integrate(m, mpc->q, mpc->v, h, mpc->q);
  }
  return CAV_OK;
}

/// The optimiser's motion as the newest plan; the one before it stays in force until the time.
static void take_plan(cav_mpc *mpc, double time) {
  const cav_trajectory *at = cav_optimiser_trajectory(mpc->optimiser);
  const size_t n = (size_t)at->nknot, nq = (size_t)at->nq, nv = (size_t)at->nv;
  cav_trajectory *oldest = mpc->plan[1];
  mpc->plan[1] = mpc->plan[0];
  mpc->start[1] = mpc->start[0];
  mpc->plan[0] = oldest;
  mpc->start[0] = time;
  memcpy(oldest->q, at->q, n * nq * sizeof(double));
  memcpy(oldest->v, at->v, n * nv * sizeof(double));
  memcpy(oldest->u, at->u, n * nv * sizeof(double));
}

cav_status cav_mpc_plan(cav_mpc *mpc, double time, const double *q, const double *v, cav_progress *last) {
  const double begin = time + mpc->options.delay;
  if (!(time >= mpc->start[0] - rounding)) return CAV_BAD_INPUT;
  cav_status status = look_ahead(mpc, time, q, v);
  const double knots = fmax(begin - mpc->begin, 0) / mpc->plan[0]->timestep, whole = round(knots);
  if (status == CAV_OK)
    status = cav_optimiser_shift(mpc->optimiser, fabs(knots - whole) < 1e-6 ? whole : knots, mpc->q, mpc->v);
  if (status != CAV_OK) return status;
  mpc->begin = begin;
  status = cav_optimiser_iterate(mpc->optimiser, mpc->options.iterations, last);
  if (status == CAV_OK) take_plan(mpc, begin);
  return status;
}

const cav_trajectory *cav_mpc_trajectory(const cav_mpc *mpc, double *start) {
  if (start) *start = mpc->start[0];
  return mpc->plan[0];
}
