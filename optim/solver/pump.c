/// Swinging up: forward simulations of models that actuators are too weak to carry along, under laws that pump energy.
///
/// Actuator i acts in the unit direction c of its transmission with the fraction of its limit, clipped to -1 .. 1,
///
///     gain * clip(sharp * (E_goal - E)/(V_goal - V_start)) * rate - stiffness * c'(q - q_goal) - damping * c'v
///
/// where rate is c'v, the power that the actuator has on all of the energy E (Spong 1995, acrobots), or what its
/// acceleration does to the energy of what it does not act on, -c'M v_passive/c'M c (Astrom and Furuta 2000, a pivot
/// that is moved). The last terms keep a cart on its rails and an elbow from turning over. Angles count in rad, lengths
/// over half the height that the model rises by in the mean, rates over the frequency of a pendulum of that length. A
/// push sets it off. None of this is known to lead to a goal: a fixed sequence of laws is simulated, the best of them
/// are refined, and that which comes nearest, in angles and rates alike, is the guess. Contacts are left out, and a
/// joint that leaves its range ends a simulation.
///
/// A model that is one hinge has shortest motions that are known (hinge.c): there a law is an extremal, found by the
/// direction of its adjoint at the start.
#include "pump.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hinge.h"
#include "math3.h"

enum { GAIN, SHARPNESS, STIFFNESS, DAMPING, PUSH, PARAMETERS };

/// Laws tried; those kept to be refined; refinements.
enum { LAWS = 800, BEST = 8, REFINEMENTS = 800 };

/// Parts of a step over which an extremal's torque is averaged; the last size of refinements of its direction, of the first.
enum { SWITCHES = 8 };
static const double last_direction = 1e-6;

/// Range of each parameter, geometric. Stiffness and damping are none in the first part of theirs. PUSH in 1/frequency.
static const double range[PARAMETERS][2] = {{1, 100}, {3, 90}, {0.05, 3}, {0.05, 1.5}, {0.3, 2.3}};
static const double none[PARAMETERS] = {[STIFFNESS] = 0.15, [DAMPING] = 0.15};

/// Refinements: their first and last size, as parts of the ranges.
static const double first_size = 0.2, last_size = 0.004;

/// Distance within which the optimiser brings a motion to its goal, for a dof; how much longer a motion, or how much stronger
/// actuators, are looked for.
static const double near_dof = 0.3, effort_ratio = 1.25;
enum { MOST_TIMES = 8, EFFORT_STEPS = 10, STATIC_POSTURES = 9 };

/// Gap from which a model stands free, m; part of the weight that counts as a force.
static const double free_gap = 0.01, tolerance = 1e-6;

typedef struct law {
  double x[PARAMETERS]; ///< 0 .. 1
  int reaction;         ///< which rate
  double sign;          ///< of the push
  double score;         ///< the less the better
  int knot;             ///< at which it is nearest, or near
} law;

typedef struct pump {
  const cav_problem *problem;
  const cav_model *model;
  cav_state *state;
  int steps;    ///< of a simulation
  int extremal; ///< 1: the model is the hinge, and laws are extremals by their first parameter
  cav_hinge hinge;
  int soonest;                    ///< 1: what counts is when it is near, 0: how near it comes
  double efforts;                 ///< multiple of those planned with
  double goal, rise;              ///< V_goal, V_goal - V_start, J
  double length, rate;            ///< m, 1/s
  double *direction, *size;       ///< [nu*nv] c; [nu] its unit
  double *force;                  ///< [nu*2] lowest and highest along c
  double *unit;                   ///< [nv] of angles and lengths
  double *q, *v, *next, *u, *off; ///< scratch
  double *passive, *momentum, *M;
} pump;

static void pump_close(pump *p) {
  cav_state_free(p->state);
  free(p->direction);
}

/// Memory and the state; zero where there is none.
static int pump_open(pump *p, const cav_problem *problem) {
  const cav_model *m = problem->model;
  size_t nv = (size_t)m->nv, nu = (size_t)m->nu, nq = (size_t)m->nq;
  *p = (pump){.problem = problem, .model = m, .efforts = 1, .state = cav_state_new(m)};
  p->steps = (int)lround(problem->duration / problem->timestep);
  p->direction = calloc(nu * nv + 3 * nu + nq + 7 * nv + nv * nv + 1, sizeof(double));
  if (!p->state || !p->direction) return 0;
  p->size = p->direction + nu * nv, p->force = p->size + nu, p->unit = p->force + 2 * nu;
  p->q = p->unit + nv, p->v = p->q + nq, p->next = p->v + nv, p->u = p->next + nv, p->off = p->u + nv;
  p->passive = p->off + nv, p->momentum = p->passive + nv, p->M = p->momentum + nv;
  p->state->options = m->options;
  p->state->options.timestep = problem->timestep;
  p->state->options.order = problem->order;
  p->state->options.contact = 0;
  return 1;
}

/// At the state's last position.
static double potential(const pump *p) {
  double sum = 0;
  for (int i = 1; i < p->model->nlink; i++)
    sum -= p->model->link[i].mass * dot3(p->model->gravity, p->state->com + 3 * (size_t)i);
  return sum;
}

/// Energies of start and goal, and units of lengths and rates.
static cav_status measure_rise(pump *p) {
  const cav_model *m = p->model;
  double weight = 0, g = norm3(m->gravity), *before = calloc(3 * (size_t)m->nlink + 1, sizeof *before);
  cav_status status = before ? cav_position(m, p->state, p->problem->q_start) : CAV_NO_MEMORY;
  if (!status) {
    memcpy(before, p->state->com, 3 * (size_t)m->nlink * sizeof *before);
    p->rise = -potential(p);
    status = cav_position(m, p->state, p->problem->q_goal);
  }
  if (!status) {
    p->goal = potential(p);
    p->rise += p->goal;
    for (int i = 1; i < m->nlink; i++) {
      double way[3];
      sub3(way, p->state->com + 3 * (size_t)i, before + 3 * (size_t)i);
      if (norm3(way) > tolerance) weight += g * m->link[i].mass;
    }
    p->length = p->rise > 0 && weight > 0 ? p->rise / (2 * weight) : 1;
    p->rate = sqrt(fmax(g, 1) / p->length);
  }
  free(before);
  return status;
}

/// Directions and forces of actuators. An actuator without limit gives what holds the model's weight at its length.
static void measure_actuators(pump *p) {
  const cav_model *m = p->model;
  for (int d = 0; d < m->nv; d++) {
    const cav_joint *joint = &m->joint[m->dof[d].joint];
    int line = joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && d < joint->dof + 3);
    p->unit[d] = line ? 1 / p->length : 1;
  }
  for (int i = 0; i < m->nu; i++) {
    double effort[2], *c = p->direction + (size_t)i * (size_t)m->nv, square = 0, scale = 0;
    cav_actuator_length(m, p->state, i, c);
    cav_actuator_effort_range(m, i, effort);
    for (int d = 0; d < m->nv; d++) square += c[d] * c[d];
    double norm = sqrt(square), force = norm * m->actuator[i].unit;
    for (int d = 0; d < m->nv && norm > 0; d++) c[d] /= norm, scale += c[d] * c[d] * p->unit[d] * p->unit[d];
    p->size[i] = sqrt(scale);
    for (int k = 0; k < 2; k++)
      p->force[2 * i + k] = isfinite(effort[k]) ? p->problem->effort_limit * effort[k] * force
                                                : (k ? 1 : -1) * m->mass * norm3(m->gravity) * p->length;
  }
}

static cav_status pump_measure(pump *p) {
  cav_options options = p->state->options;
  cav_status status = cav_hinge_of(p->model, p->state, &p->hinge, &p->extremal);
  p->state->options = options;
  if (!status) status = measure_rise(p);
  if (!status) measure_actuators(p);
  return status;
}

// ---------------------------------------------------------------- a simulation

static double parameter(const law *l, int i) {
  double x = l->x[i];
  if (x < none[i]) return 0;
  return range[i][0] * pow(range[i][1] / range[i][0], (x - none[i]) / (1 - none[i]));
}

/// Rate that an actuator's direction sees: its own, or how what it does not act on reacts.
static double rate_along(const pump *p, const double *c, int reaction) {
  int nv = p->model->nv;
  double along = 0, inertia = 0;
  if (!reaction) {
    for (int d = 0; d < nv; d++) along += c[d] * p->v[d];
    return along;
  }
  for (int d = 0; d < nv; d++) {
    along -= c[d] * p->momentum[d];
    for (int k = 0; k < nv; k++) inertia += c[d] * p->M[d * nv + k] * c[k];
  }
  return inertia > 0 ? along / inertia : 0;
}

/// Forces of all actuators; lack: the energy that is missing, over the rise.
static void apply_law(pump *p, const law *l, const double *x, double lack, int pushes) {
  const cav_model *m = p->model;
  memset(p->u, 0, (size_t)m->nv * sizeof *p->u);
  for (int i = 0; i < m->nu; i++) {
    const double *c = p->direction + (size_t)i * (size_t)m->nv;
    double position = 0, unit = p->size[i] / p->rate;
    for (int d = 0; d < m->nv; d++) position += c[d] * p->off[d];
    double pumped = fmax(-1, fmin(1, x[SHARPNESS] * lack)) * rate_along(p, c, l->reaction);
    double f = x[GAIN] * pumped * unit - x[STIFFNESS] * position * p->size[i] -
               x[DAMPING] * rate_along(p, c, 0) * unit + (pushes ? l->sign : 0);
    f = fmax(-1, fmin(1, f));
    f *= p->efforts * fabs(p->force[2 * i + (f > 0)]);
    for (int d = 0; d < m->nv; d++) p->u[d] += f * c[d];
  }
}

/// Torque of an extremal over the step from where the hinge is, and its adjoint after it.
static void apply_extremal(pump *p, double adjoint[2]) {
  double x[4] = {p->q[0], p->v[0], adjoint[0], adjoint[1]}, efforts = p->efforts * p->problem->effort_limit;
  p->u[0] = 0;
  for (int i = 0; i < SWITCHES; i++) {
    p->u[0] += efforts * p->hinge.torque[x[3] > 0] / SWITCHES;
    cav_hinge_step(&p->hinge, efforts, p->problem->timestep / SWITCHES, x);
  }
  adjoint[0] = x[2], adjoint[1] = x[3];
}

static int within_ranges(const pump *p) {
  for (int j = 0; j < p->model->njoint; j++) {
    const cav_joint *joint = &p->model->joint[j];
    int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
    if (joint->limited && scalar && (p->q[joint->q] < joint->range[0] || p->q[joint->q] > joint->range[1])) return 0;
  }
  return 1;
}

/// Distance of where it is from the goal at rest, squared; the energy that is missing, over the rise; passive momenta.
static cav_status observe(pump *p, double *distance, double *lack) {
  const cav_model *m = p->model;
  int nv = m->nv;
  cav_status status = cav_position(m, p->state, p->q);
  double energy = status ? 0 : potential(p);
  if (!status) status = cav_inertia(m, p->state, p->q, p->M);
  if (status) return status;
  cav_difference(m, p->problem->q_goal, p->q, 1, p->off);
  cav_actuation(m, p->state, p->v, p->passive, NULL);
  *distance = 0;
  for (int d = 0; d < nv; d++) {
    double own = 0, all = 0, unit = p->unit[d], rate = p->v[d] * unit / p->rate;
    for (int k = 0; k < nv; k++) own += p->M[d * nv + k] * p->passive[k], all += p->M[d * nv + k] * p->v[k];
    p->momentum[d] = own;
    energy += 0.5 * p->v[d] * all;
    *distance += p->off[d] * p->off[d] * unit * unit + rate * rate;
  }
  *lack = p->rise != 0 ? (p->goal - energy) / fabs(p->rise) : 0;
  return CAV_OK;
}

/// Simulates a law, into its score and knot; way [(steps + 1)*nq] gets the configurations, NULL: nothing. What the
/// dynamics cannot step ends it.
static cav_status simulate(pump *p, law *l, double *way) {
  const cav_model *m = p->model;
  double h = p->problem->timestep, x[PARAMETERS], distance, lack, least = INFINITY, near = near_dof * sqrt(m->nv);
  double adjoint[2] = {cos(2 * M_PI * l->x[0]), sin(2 * M_PI * l->x[0])};
  for (int i = 0; i < PARAMETERS; i++) x[i] = parameter(l, i);
  memcpy(p->q, p->problem->q_start, (size_t)m->nq * sizeof *p->q);
  memcpy(p->v, p->problem->v_start, (size_t)m->nv * sizeof *p->v);
  l->knot = 0;
  for (int t = 0; t <= p->steps && within_ranges(p); t++) {
    cav_status status = observe(p, &distance, &lack);
    if (status == CAV_NO_MEMORY) return status;
    if (status) break;
    if (way) memcpy(way + (size_t)t * (size_t)m->nq, p->q, (size_t)m->nq * sizeof *way);
    if (distance < least) least = distance, l->knot = t;
    if (p->soonest && sqrt(distance) < near) break;
    if (p->extremal)
      apply_extremal(p, adjoint);
    else
      apply_law(p, l, x, lack, t * h < x[PUSH] / p->rate);
    status = cav_forward(m, p->state, p->q, p->v, p->u, p->next);
    if (status == CAV_NO_MEMORY) return status;
    if (status) break;
    cav_integrate(m, p->q, p->next, h, p->q);
    memcpy(p->v, p->next, (size_t)m->nv * sizeof *p->v);
  }
  l->score = sqrt(least);
  // what is near counts by its time, before all that is not
  if (p->soonest && l->score < near) l->score = -1.0 / (l->knot + 1);
  return CAV_OK;
}

// ---------------------------------------------------------------- the search

/// Element i of a sequence that fills the unit cube evenly: multiples of powers of the root of x^6 = x + 1, in
/// five dimensions (Roberts 2018).
static double evenly(int i, int dimension) {
  static const double root = 1.1347241384015194;
  assert(PARAMETERS == 5);
  return fmod(0.5 + (i + 1) * pow(1 / root, dimension + 1), 1);
}

/// The same of extremals: directions evenly around, then nearer and nearer to the best.
static law proposed_extremal(int i, const law best[BEST]) {
  law l = {.x = {(double)i / LAWS}};
  if (i < LAWS) return l;
  int number = i - LAWS;
  l = best[number % BEST];
  l.x[0] += pow(last_direction, (double)number / REFINEMENTS) * (2 * evenly(number, 0) - 1) / LAWS;
  return l;
}

/// The law to try as number i, where the best are known.
static law proposal(int i, const law best[BEST]) {
  law l;
  if (i < LAWS) {
    l.sign = i % 2 ? 1 : -1;
    l.reaction = i / 2 % 2;
    for (int k = 0; k < PARAMETERS; k++) l.x[k] = evenly(i / 4, k);
    return l;
  }
  int number = i - LAWS;
  double size = first_size * pow(last_size / first_size, (double)number / REFINEMENTS);
  l = best[number % BEST];
  for (int k = 0; k < PARAMETERS; k++) l.x[k] = fmin(1, fmax(0, l.x[k] + size * (2 * evenly(number, k) - 1)));
  return l;
}

/// The best law of a fixed sequence.
static cav_status search(pump *p, law *found) {
  law best[BEST];
  for (int k = 0; k < BEST; k++) best[k] = (law){.score = INFINITY};
  for (int i = 0; i < LAWS + REFINEMENTS; i++) {
    law l = p->extremal ? proposed_extremal(i, best) : proposal(i, best);
    cav_status status = simulate(p, &l, NULL);
    if (status) return status;
    // a law takes the place of the worst one, a refinement that of what it refines
    int place = i < LAWS ? 0 : (i - LAWS) % BEST;
    for (int k = 0; k < BEST && i < LAWS; k++)
      if (best[k].score > best[place].score) place = k;
    if (l.score < best[place].score) best[place] = l;
    // nothing that is near later than this counts
    if (p->soonest && l.score < 0 && l.knot < p->steps) p->steps = l.knot;
  }
  *found = best[0];
  for (int k = 1; k < BEST; k++)
    if (best[k].score < found->score) *found = best[k];
  return CAV_OK;
}

cav_status cav_pump_fill(const cav_problem *problem, cav_trajectory *at) {
  pump p;
  law best;
  size_t nq = (size_t)problem->model->nq;
  cav_status status = pump_open(&p, problem) ? CAV_OK : CAV_NO_MEMORY;
  assert(at->nknot == p.steps + 1);
  double *way = malloc((size_t)at->nknot * nq * sizeof *way);
  if (!way) status = CAV_NO_MEMORY;
  if (!status) status = pump_measure(&p);
  if (!status) status = search(&p, &best);
  if (!status) status = simulate(&p, &best, way);
  if (!status) {
    int wait = p.steps - best.knot;
    for (int t = 0; t < at->nknot; t++) {
      const double *q = t < wait ? problem->q_start : way + (size_t)(t - wait) * nq;
      memcpy(at->q + (size_t)t * nq, q, nq * sizeof *q);
    }
  }
  free(way);
  pump_close(&p);
  return status;
}

// ---------------------------------------------------------------- when

/// Whether anything touches at a posture, where the model lets it.
static cav_status find_touch(pump *p, const double *q, int *touches) {
  cav_options simulated = p->state->options;
  p->state->options.contact = p->model->options.contact;
  p->state->options.smoothing = p->state->options.smoothing_self = free_gap;
  cav_status status = cav_position(p->model, p->state, q);
  for (int i = 0; i < p->state->ncontact && !status; i++) *touches |= p->state->contact[i].dist < free_gap;
  p->state->options = simulated;
  return status;
}

/// Whether actuators within the planned limits hold a posture against gravity.
static cav_status find_held(pump *p, const double *q, int *held) {
  const cav_model *m = p->model;
  double *effort = calloc((size_t)m->nu + 1, sizeof *effort), weight = m->mass * norm3(m->gravity);
  memset(p->v, 0, (size_t)m->nv * sizeof *p->v);
  cav_status status = effort ? cav_inverse(m, p->state, q, p->v, p->v, p->u) : CAV_NO_MEMORY;
  *held = 1;
  if (!status) cav_actuation(m, p->state, p->u, p->passive, effort);
  for (int d = 0; d < m->nv && !status; d++)
    *held &= fabs(p->passive[d] * p->unit[d]) <= tolerance * weight * p->length;
  for (int i = 0; i < m->nu && !status; i++) {
    double limit[2];
    cav_actuator_effort_range(m, i, limit);
    for (int k = 0; k < 2; k++) limit[k] *= p->problem->effort_limit;
    *held &= effort[i] >= limit[0] - tolerance && effort[i] <= limit[1] + tolerance;
  }
  free(effort);
  return status;
}

/// Whether start and goal stand by themselves and what lies between them does not.
static cav_status find_need(pump *p, int *needed) {
  const cav_problem *problem = p->problem;
  int held = 1, between = 1, touches = 0;
  *needed = 0;
  cav_status status = find_touch(p, problem->q_start, &touches);
  if (!status) status = find_touch(p, problem->q_goal, &touches);
  if (status || touches) return status;
  double *q = malloc((size_t)p->model->nq * sizeof *q);
  if (!q) return CAV_NO_MEMORY;
  for (int i = 0; i < STATIC_POSTURES && !status; i++) {
    cav_difference(p->model, problem->q_start, problem->q_goal, 1, p->off);
    cav_integrate(p->model, problem->q_start, p->off, (double)i / (STATIC_POSTURES - 1), q);
    status = find_held(p, q, &held);
    if (i > 0 && i < STATIC_POSTURES - 1) between &= held;
    if ((i == 0 || i == STATIC_POSTURES - 1) && !held) break;
  }
  *needed = held && !between;
  free(q);
  return status;
}

/// Whether the energy of a model is that of its masses alone, and its actuators have limits that hold for all postures.
static int is_covered(const cav_problem *problem) {
  const cav_model *m = problem->model;
  double effort[2];
  for (int j = 0; j < m->njoint; j++)
    if (m->joint[j].stiffness != 0) return 0;
  for (int i = 0; i < m->ntendon; i++)
    if (m->tendon[i].stiffness != 0) return 0;
  for (int i = 0; i < m->nu; i++) {
    cav_actuator_effort_range(m, i, effort);
    if (isinf(effort[0]) || isinf(effort[1]) || !m->actuator[i].constant) return 0;
  }
  return m->nu > 0 && m->nequality == 0 && !problem->cycle.on && problem->duration_most == 0;
}

/// A pump that is measured, and whether it is needed; to be closed where this succeeds.
static cav_status examine(const cav_problem *problem, pump *p, int *needed) {
  double weight = problem->model->mass * norm3(problem->model->gravity);
  *needed = 0;
  cav_status status = pump_open(p, problem) ? pump_measure(p) : CAV_NO_MEMORY;
  if (!status && p->rise > tolerance * weight * p->length) status = find_need(p, needed);
  if (status) pump_close(p);
  return status;
}

cav_status cav_pump_needed(const cav_problem *problem, int *needed) {
  pump p;
  *needed = 0;
  if (!is_covered(problem)) return CAV_OK;
  cav_status status = examine(problem, &p, needed);
  if (!status) pump_close(&p);
  return status;
}

/// The same of one hinge, exactly: to the goal within the usual tolerance, at a rate that would take it away in a radian
/// of a small swing.
static void tell_extremal(const pump *p, cav_pumping *pumping) {
  const cav_problem *problem = p->problem;
  double goal = problem->q_goal[0], off = CAV_WITHIN_ANGLE;
  double rate = off * sqrt(hypot(p->hinge.gravity[0], p->hinge.gravity[1]) / p->hinge.inertia);
  const double start[2] = {problem->q_start[0], problem->v_start[0]};
  const double low[2] = {goal - off, -rate}, high[2] = {goal + off, rate};
  double planned = problem->effort_limit, time = problem->duration;
  cav_hinge weak = p->hinge;
  weak.torque[0] *= planned, weak.torque[1] *= planned;
  pumping->exact = 1;
  pumping->seconds = cav_hinge_time(&weak, 1, start, low, high, MOST_TIMES * time);
  pumping->efforts = pumping->seconds <= time ? 1 : cav_hinge_efforts(&weak, start, low, high, time);
}

cav_status cav_problem_pumping(const cav_problem *problem, cav_pumping *pumping) {
  pump p;
  law best;
  *pumping = (cav_pumping){.seconds = INFINITY, .efforts = INFINITY};
  cav_status status = is_covered(problem) ? examine(problem, &p, &pumping->needed) : CAV_OK;
  if (status || !is_covered(problem)) return status;
  if (p.extremal && pumping->needed) {
    tell_extremal(&p, pumping);
    pump_close(&p);
    return CAV_OK;
  }
  int steps = p.steps;
  p.soonest = 1;
  if (pumping->needed) {
    p.steps = MOST_TIMES * steps;
    status = search(&p, &best);
    if (best.score < 0) pumping->seconds = best.knot * problem->timestep;
  }
  for (int i = 0; pumping->needed && !status && i <= EFFORT_STEPS && isinf(pumping->efforts); i++) {
    p.steps = steps, p.efforts = pow(effort_ratio, i);
    status = search(&p, &best);
    if (best.score < 0) pumping->efforts = p.efforts;
  }
  pump_close(&p);
  return status;
}
