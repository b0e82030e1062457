/// Sampling: the cross-entropy method (Rubinstein 1999) over forward simulations. Actuators follow targets by a critically
/// damped law, clipped to the efforts that are planned with; targets are piecewise linear, and their values are drawn from
/// normal distributions, whose means and widths then follow the best draws. A draw is simulated by the dynamics, law and
/// step of the last stage, so the motion that is found has no force from nowhere but where it has to stop at the end, and
/// it is scored by what the solver minimises. Many searches begin, each from a seed of its own, and those that are ahead
/// go on. METHOD.md, 7.
#include "sampling.h"

#include <math.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "parallel.h"
#include "transcription.h"

/// Actuators and dofs at most.
enum { MOST_ACTUATORS = 8, MOST_DOFS = 9 };

/// Draws of a round at most and at least, and for how many dofs; one in how many is followed, at least so many.
enum {
  MOST_DRAWS = 48,
  LEAST_DRAWS = 16,
  DRAWS_OF_ONE = 160,
  ONE_IN = 8,
  LEAST_BEST = 4,
  MOST_BEST = MOST_DRAWS / ONE_IN
};

/// Searches that begin, and rounds of each; then one in how many goes on, for how many times as many rounds, until one is left.
enum { SEARCHES = 32, ROUNDS = 4, GOES_ON = 4, LONGER = 2 };

/// Nodes of a target at most, and seconds between them at least; frequency of the law that follows it, 1/s, and at most so much
/// a step; its width at first, of its range; ranges of what has none, m and rad.
enum { MOST_NODES = 16 };
static const double spacing = 0.1, frequency = 15, per_step = 0.4, first_width = 0.6, ranges[2] = {1, 3};

/// What widths keep from round to round, and never fall below, of the first ones; how much a node's noise is that of the one
/// before.
static const double inertia = 0.2, least_width = 0.03, follows = 0.5;

/// Forward steps: Newton's iterations at most, and their tolerance.
enum { ITERATIONS = 60 };
static const double step_tolerance = 1e-8;

/// A search: what its draws are drawn from, and the best of the last round in their order, before them the best of all.
typedef struct search {
  uint64_t state;        ///< of its numbers
  double *mean, *spread; ///< [n] over the targets' widths
  double *best;          ///< [MOST_BEST*n]
  double score[MOST_BEST];
} search;

/// What a thread simulates with.
typedef struct member {
  cav_transcription *tr;
  cav_state *state;
  cav_trajectory *at;
  double *u, *moment; ///< [nv]
} member;

typedef struct sampler {
  const cav_problem *problem;
  const cav_model *model;
  const cav_solve_options *options;
  cav_parallel *team;
  member *member; ///< [size of the team]
  search search[SEARCHES];
  int nodes, n;     ///< of a target; of all
  int draws, nbest; ///< a round; that are followed
  double begin;     ///< s
  atomic_int ended;
  double *stiffness, *damping; ///< [nu] over the length of the transmission
  double *centre, *width;      ///< [nu] length at the start; of the targets at first
  double *force;               ///< [nu*2] lowest and highest
  double *draw;                ///< [draws*n]
  double *score;               ///< [draws]
  cav_status *status;          ///< [draws]
} sampler;

int cav_sample_serves(const cav_problem *problem) {
  const cav_model *m = problem->model;
  return m->nu > 0 && m->nu <= MOST_ACTUATORS && m->nv <= MOST_DOFS && !problem->cycle.on && !problem->free_start &&
         problem->duration_most == 0;
}

// ---------------------------------------------------------------- memory

static void close_all(sampler *s) {
  for (int i = 0; s->member && s->team && i < cav_parallel_size(s->team); i++) {
    cav_transcription_free(s->member[i].tr);
    cav_state_free(s->member[i].state);
    cav_trajectory_free(s->member[i].at);
  }
  cav_parallel_free(s->team);
  free(s->member), free(s->stiffness), free(s->status);
}

static cav_status open_member(const sampler *s, member *who, cav_error *error) {
  const cav_problem *problem = s->problem;
  who->tr = cav_transcription_new(problem, 1, error);
  if (!who->tr) return error->status;
  who->state = cav_state_new(s->model);
  who->at = cav_trajectory_new(s->model, (int)lround(problem->duration / problem->timestep) + 1, problem->timestep);
  if (!who->state || !who->at) return CAV_NO_MEMORY;
  who->tr->options.timestep = problem->timestep;
  cav_stage_set(problem, 1, who->tr);
  // what has to stop at the end may be brought to rest later
  who->tr->penalty.unactuated = problem->schedule.first.penalty;
  who->state->options = cav_last_law(problem);
  return CAV_OK;
}

static cav_status open_all(sampler *s, const cav_problem *problem, const cav_solve_options *options, cav_error *error) {
  const cav_model *m = problem->model;
  const int nodes = (int)ceil(problem->duration / spacing) + 1, draws = DRAWS_OF_ONE / m->nv;
  *s = (sampler){.problem = problem, .model = m, .options = options, .begin = cav_clock()};
  s->nodes = nodes < MOST_NODES ? nodes : MOST_NODES;
  s->draws = draws > MOST_DRAWS ? MOST_DRAWS : draws < LEAST_DRAWS ? LEAST_DRAWS : draws;
  s->nbest = s->draws / ONE_IN > LEAST_BEST ? s->draws / ONE_IN : LEAST_BEST;
  s->n = s->nodes * m->nu;
  s->team = cav_parallel_new(options->threads);
  if (!s->team) return CAV_NO_MEMORY;
  const size_t nu = (size_t)m->nu, n = (size_t)s->n, nv = (size_t)m->nv, size = (size_t)cav_parallel_size(s->team);
  const size_t of_search = (2 + MOST_BEST) * n;
  s->member = calloc(size, sizeof *s->member);
  s->status = calloc((size_t)s->draws, sizeof *s->status);
  s->stiffness =
      calloc(6 * nu + SEARCHES * of_search + (size_t)s->draws * (n + 1) + 2 * size * nv, sizeof *s->stiffness);
  if (!s->member || !s->status || !s->stiffness) return CAV_NO_MEMORY;
  s->damping = s->stiffness + nu, s->centre = s->damping + nu, s->width = s->centre + nu, s->force = s->width + nu;
  double *next = s->force + 2 * nu;
  for (int k = 0; k < SEARCHES; k++, next += of_search) {
    search *of = &s->search[k];
    *of = (search){.mean = next, .spread = next + n, .best = next + 2 * n};
    for (size_t j = 0; j < n; j++) of->spread[j] = 1;
    for (int b = 0; b < MOST_BEST; b++) of->score[b] = INFINITY;
  }
  s->draw = next, s->score = s->draw + (size_t)s->draws * n;
  next = s->score + s->draws;
  cav_status status = CAV_OK;
  for (size_t i = 0; i < size && !status; i++, next += 2 * nv) {
    s->member[i].u = next, s->member[i].moment = next + nv;
    status = open_member(s, &s->member[i], error);
  }
  return status;
}

/// Forces and laws of the actuators, at the start.
static cav_status measure(sampler *s) {
  const cav_model *m = s->model;
  const member *who = &s->member[0];
  const int nv = m->nv;
  const double rate = fmin(frequency, per_step / s->problem->timestep);
  double *M = malloc((size_t)nv * (size_t)nv * sizeof *M);
  cav_status status = M ? cav_inertia(m, who->state, s->problem->q_start, M) : CAV_NO_MEMORY;
  if (!status) status = cav_position(m, who->state, s->problem->q_start);
  for (int i = 0; i < m->nu && !status; i++) {
    double effort[2], square = 0, along = 0, span = 0;
    s->centre[i] = cav_actuator_length(m, who->state, i, who->moment);
    cav_actuator_effort_range(m, i, effort);
    for (int d = 0; d < nv; d++) {
      const double moment = who->moment[d];
      const cav_joint *joint = &m->joint[m->dof[d].joint];
      const double range = joint->limited ? joint->range[1] - joint->range[0] : ranges[joint->type != CAV_JOINT_SLIDE];
      square += moment * moment;
      for (int k = 0; k < nv; k++) along += moment * M[d * nv + k] * who->moment[k];
      if (moment != 0) span += fabs(moment) * range;
    }
    // a unit of force accelerates the length by square^2 over along
    const double mass = square > 0 ? along / (square * square) : 0;
    s->stiffness[i] = mass * rate * rate, s->damping[i] = 2 * mass * rate;
    double most = 0;
    for (int k = 0; k < 2; k++) {
      s->force[2 * i + k] = isfinite(effort[k]) ? s->problem->effort_limit * effort[k] * m->actuator[i].unit
                                                : (k ? 1 : -1) * s->stiffness[i] * span;
      most = fmax(most, fabs(s->force[2 * i + k]));
    }
    // as far as the actuator's strength reaches, at least
    s->width[i] = fmax(first_width * span, s->stiffness[i] > 0 ? most / s->stiffness[i] : 0);
  }
  free(M);
  return status;
}

// ---------------------------------------------------------------- draws

/// Uniform in -1 .. 1 (splitmix64).
static double uniform(search *of) {
  uint64_t z = of->state += 0x9e3779b97f4a7c15u;
  z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
  z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
  return (double)((z ^ (z >> 31)) >> 11) * 0x1p-52 - 1;
}

/// Nearly normal, of unit variance, by sums alone: the same on every machine.
static double normal(search *of) {
  enum { SUMMED = 6 };
  double sum = 0;
  for (int k = 0; k < SUMMED; k++) sum += uniform(of);
  return sum * sqrt(3.0 / SUMMED);
}

static void draw_one(const sampler *s, search *from, double *draw) {
  for (int i = 0, j = 0; i < s->model->nu; i++) {
    double noise = normal(from);
    for (int k = 0; k < s->nodes; k++, j++) {
      if (k > 0) noise = follows * noise + sqrt(1 - follows * follows) * normal(from);
      draw[j] = from->mean[j] + from->spread[j] * noise;
    }
  }
}

/// Puts a draw among the best, in their order; the earlier of equals first.
static void keep(const sampler *s, search *of, const double *draw, double score) {
  const size_t n = (size_t)s->n;
  int place = s->nbest;
  while (place > 0 && score < of->score[place - 1]) place--;
  if (place == s->nbest) return;
  const size_t after = (size_t)(s->nbest - 1 - place);
  double *to = of->best + (size_t)place * n;
  memmove(to + n, to, after * n * sizeof *to);
  memmove(of->score + place + 1, of->score + place, after * sizeof *of->score);
  memcpy(to, draw, n * sizeof *to);
  of->score[place] = score;
}

static void follow_best(const sampler *s, search *of) {
  const size_t n = (size_t)s->n;
  for (size_t j = 0; j < n; j++) {
    double mean = 0, square = 0;
    for (int k = 0; k < s->nbest; k++) mean += of->best[(size_t)k * n + j] / s->nbest;
    for (int k = 0; k < s->nbest; k++) {
      const double off = of->best[(size_t)k * n + j] - mean;
      square += off * off / s->nbest;
    }
    of->mean[j] = mean;
    of->spread[j] = inertia * of->spread[j] + (1 - inertia) * fmax(sqrt(square), least_width);
  }
}

// ---------------------------------------------------------------- a simulation

/// Target of an actuator at a fraction of the time, over its width.
static double target_at(const sampler *s, const double *draw, int i, double x) {
  const double place = x * (s->nodes - 1), *of = draw + (size_t)i * (size_t)s->nodes;
  const int node = place < s->nodes - 2 ? (int)place : s->nodes - 2;
  return of[node] + (place - node) * (of[node + 1] - of[node]);
}

/// Generalised forces of all actuators at knot t.
static void actuate(const sampler *s, const member *who, const double *draw, int t) {
  const cav_model *m = s->model;
  const double *v = who->at->v + (size_t)t * (size_t)m->nv;
  memset(who->u, 0, (size_t)m->nv * sizeof *who->u);
  for (int i = 0; i < m->nu; i++) {
    const double length = cav_actuator_length(m, who->state, i, who->moment) - s->centre[i];
    const double target = s->width[i] * target_at(s, draw, i, (double)t / (who->at->nknot - 1));
    double rate = 0;
    for (int d = 0; d < m->nv; d++) rate += who->moment[d] * v[d];
    double f = s->stiffness[i] * (target - length) - s->damping[i] * rate;
    f = fmin(fmax(f, s->force[2 * i]), s->force[2 * i + 1]);
    for (int d = 0; d < m->nv; d++) who->u[d] += f * who->moment[d];
  }
}

/// Simulates a draw into the member's trajectory and scores it; infinite where the dynamics cannot step it to its end.
static cav_status simulate(const sampler *s, const member *who, const double *draw, double *score) {
  const cav_model *m = s->model;
  cav_trajectory *at = who->at;
  const size_t nq = (size_t)m->nq, nv = (size_t)m->nv;
  *score = INFINITY;
  memcpy(at->q, s->problem->q_start, nq * sizeof *at->q);
  memcpy(at->v, s->problem->v_start, nv * sizeof *at->v);
  for (int t = 0; t + 1 < at->nknot; t++) {
    const double *q = at->q + (size_t)t * nq, *v = at->v + (size_t)t * nv;
    double *next = at->v + (size_t)(t + 1) * nv;
    cav_status status = cav_position(m, who->state, q);
    if (!status) {
      actuate(s, who, draw, t);
      status = cav_forward_newton_from(m, who->state, q, v, who->u, NULL, ITERATIONS, step_tolerance, next, NULL);
    }
    if (status == CAV_NO_MEMORY) return status;
    if (status && status != CAV_NOT_CONVERGED) return CAV_OK;
    cav_integrate(m, q, next, at->timestep, at->q + (size_t)(t + 1) * nq);
  }
  cav_trajectory_velocities(m, at);
  cav_status status = cav_transcription_values(who->tr, at);
  if (status == CAV_NO_MEMORY || status == CAV_BAD_INPUT) return status;
  const double merit = status ? INFINITY : cav_transcription_merit(who->tr);
  if (isfinite(merit)) *score = merit;
  return CAV_OK;
}

static void simulate_item(void *context, int item, int who) {
  sampler *s = context;
  const cav_solve_options *o = s->options;
  // the caller's thread alone asks for the end
  if (who == 0 &&
      ((o->stop && o->stop(o->stop_context)) || (o->max_seconds > 0 && cav_clock() - s->begin > o->max_seconds)))
    s->ended = 1;
  s->score[item] = INFINITY;
  s->status[item] = CAV_OK;
  if (s->ended) return;
  s->status[item] = simulate(s, &s->member[who], s->draw + (size_t)item * (size_t)s->n, &s->score[item]);
}

// ---------------------------------------------------------------- the search

/// Rounds of a search. A round that is ended counts for nothing.
static cav_status go_on(sampler *s, search *of, int rounds) {
  for (int round = 0; round < rounds; round++) {
    for (int i = 0; i < s->draws; i++) draw_one(s, of, s->draw + (size_t)i * (size_t)s->n);
    cav_parallel_for(s->team, s->draws, simulate_item, s);
    if (s->ended) return CAV_OK;
    // the best of before stays among them, but not those after it, whose places new ones take
    for (int k = 1; k < s->nbest; k++) of->score[k] = INFINITY;
    for (int i = 0; i < s->draws; i++) {
      if (s->status[i]) return s->status[i];
      keep(s, of, s->draw + (size_t)i * (size_t)s->n, s->score[i]);
    }
    if (isfinite(of->score[s->nbest - 1])) follow_best(s, of);
  }
  return CAV_OK;
}

/// Tells the observer where the search is.
static void tell(sampler *s, int done, int of, double score) {
  const cav_solve_options *o = s->options;
  cav_progress line = {.phase = "sampling", .stage = done, .stages = of, .cost = score};
  line.seconds = cav_clock() - s->begin;
  if (o->observer && o->observer(o->observer_context, &line)) s->ended = 1;
}

/// The searches in the order of what they have found; stable, so that it is that of any machine.
static void sort(search *of, int n) {
  for (int i = 1; i < n; i++)
    for (int k = i; k > 0 && of[k].score[0] < of[k - 1].score[0]; k--) {
      const search swapped = of[k];
      of[k] = of[k - 1], of[k - 1] = swapped;
    }
}

/// All searches; the best is the first one then.
static cav_status race(sampler *s) {
  int all = 0, done = 0;
  for (int n = SEARCHES; n > 0; n /= GOES_ON) all += n;
  for (int n = SEARCHES, rounds = ROUNDS; n > 0 && !s->ended; n /= GOES_ON, rounds *= LONGER) {
    for (int i = 0; i < n && !s->ended; i++) {
      cav_status status = go_on(s, &s->search[i], rounds);
      if (status) return status;
      tell(s, ++done, all, s->search[i].score[0]);
    }
    sort(s->search, n);
  }
  return CAV_OK;
}

cav_status cav_sample_fill(const cav_problem *problem, const cav_solve_options *options, int number, cav_trajectory *at,
                           double *score, cav_error *error) {
  sampler s;
  cav_error refused = {0};
  cav_status status = open_all(&s, problem, options, &refused);
  for (int k = 0; k < SEARCHES; k++) s.search[k].state = ((uint64_t)number << 32) + ((uint64_t)k << 16);
  if (!status) status = measure(&s);
  if (!status) status = race(&s);
  for (int i = 0; status == CAV_BAD_INPUT && s.team && i < cav_parallel_size(s.team); i++) {
    const cav_transcription *tr = s.member[i].tr;
    if (tr && tr->failure.status == CAV_BAD_INPUT) refused = tr->failure;
  }
  if (error && refused.status) *error = refused;
  *score = INFINITY;
  if (!status && isfinite(s.search[0].score[0])) status = simulate(&s, &s.member[0], s.search[0].best, score);
  if (!status && !isfinite(*score)) status = s.ended ? CAV_INTERRUPTED : CAV_NOT_CONVERGED;
  if (!status) {
    const cav_trajectory *from = s.member[0].at;
    assert(at->nknot == from->nknot && at->nq == from->nq && at->nv == from->nv);
    memcpy(at->q, from->q, (size_t)at->nknot * (size_t)at->nq * sizeof *at->q);
    memcpy(at->v, from->v, (size_t)at->nknot * (size_t)at->nv * sizeof *at->v);
  }
  close_all(&s);
  return status;
}
