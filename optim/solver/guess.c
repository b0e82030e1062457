/// Guesses: the trajectory that a solve starts from.
///
/// From start to goal along the geodesic of the configuration space with a cubic of time; or by postures on the way,
/// linear in time between them; or the start held. On that a rotation and a bow of the first free joint, a ballistic arc of the
/// roots, and sines laid over single joints. Cycles go from their start to where that is a period on, at constant
/// speed. Wheels on the ground roll along. Asks nothing else of contacts or forces. A swing-up is simulated (pump.c).
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "clear.h"
#include "continuation.h"
#include "file.h"
#include "math3.h"
#include "problem_check.h"
#include "problem_file.h"
#include "pump.h"

/// How far a guess is moved off its symmetries, rad or m, by a fixed sequence; golden section.
static const double nudge = 1e-6, golden = 0.6180339887498949;

/// Gap within which a wheel stands on the ground, m.
static const double near_ground = 0.01;

/// Cubic that leaves 0 and reaches 1 at rest.
static double smoothstep(double s) {
  s = fmin(fmax(s, 0), 1);
  return s * s * (3 - 2 * s);
}

/// Turns the first free joint by a fraction of the guess's rotation.
static void rotation(const cav_problem *problem, double fraction, double *q) {
  const cav_model *m = problem->model;
  for (int j = 0; j < m->njoint; j++) {
    if (m->joint[j].type != CAV_JOINT_FREE) continue;
    double phi[3], *quat = q + m->joint[j].q + 3, angle = 0;
    for (int k = 0; k < 3; k++) phi[k] = fraction * problem->guess_rotation[k], angle += phi[k] * phi[k];
    angle = sqrt(angle);
    if (angle == 0) return;
    double s = sin(angle / 2) / angle, p[4] = {cos(angle / 2), s * phi[0], s * phi[1], s * phi[2]}, r[4];
    r[0] = quat[0] * p[0] - quat[1] * p[1] - quat[2] * p[2] - quat[3] * p[3];
    r[1] = quat[0] * p[1] + quat[1] * p[0] + quat[2] * p[3] - quat[3] * p[2];
    r[2] = quat[0] * p[2] - quat[1] * p[3] + quat[2] * p[0] + quat[3] * p[1];
    r[3] = quat[0] * p[3] + quat[1] * p[2] - quat[2] * p[1] + quat[3] * p[0];
    memcpy(quat, r, sizeof r);
    return;
  }
}

/// Moves the first free joint aside by a fraction of the guess's bow.
static void bow(const cav_problem *problem, double fraction, double *q) {
  const cav_model *m = problem->model;
  const int j = cav_first_free(m);
  for (int k = 0; k < 2 && j >= 0; k++) q[m->joint[j].q + k] += fraction * problem->guess_bow[k];
}

/// Lays the swings over q, within the joints' ranges: a knee swings one way only.
static void swing(const cav_problem *problem, double time, double *q) {
  double fade = problem->cycle.on ? 1 : smoothstep(5 * fmin(time, problem->duration - time) / problem->duration);
  for (int i = 0; i < problem->nswing; i++) {
    const cav_swing *s = &problem->swing[i];
    const cav_joint *joint = &problem->model->joint[s->joint];
    double *value = q + joint->q, keep = problem->limit_margin;
    *value += fade * s->amplitude * sin(2 * M_PI * s->frequency * time + s->phase);
    if (joint->limited) *value = fmin(fmax(*value, joint->range[0] + keep), joint->range[1] - keep);
  }
}

/// Posture i of those on the way: the start first, the end last.
static cav_guess_pose passed(const cav_problem *problem, const double *end, int i) {
  if (i == 0) return (cav_guess_pose){0, problem->q_start};
  if (i <= problem->nguess_pose) return problem->guess_pose[i - 1];
  return (cav_guess_pose){problem->duration, end};
}

/// What the guess is before turn, arc and swings; tangent is room for nv numbers.
static void follow(const cav_problem *problem, const double *end, double time, double *tangent, double *q) {
  const cav_model *m = problem->model;
  int i = 1;
  while (i <= problem->nguess_pose && problem->guess_pose[i - 1].time <= time) i++;
  cav_guess_pose a = passed(problem, end, i - 1), b = passed(problem, end, i);
  double s = b.time > a.time ? fmin((time - a.time) / (b.time - a.time), 1) : 0;
  // a cycle goes on at constant speed
  if (problem->nguess_pose == 0 && !problem->cycle.on) s = smoothstep(s);
  if (problem->guess == CAV_GUESS_HOLD && !problem->cycle.on) s = 0;
  cav_difference(m, a.q, b.q, 1, tangent);
  cav_integrate(m, a.q, tangent, s, q);
}

/// Radius of a wheel, from its centre down to where it stands on the world, or something else, at the state; 0: it does not.
static double wheel_radius(const cav_state *state, int link) {
  for (int i = 0; i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const double down = state->com[3 * (size_t)link + 2] - c->pos[2];
    if (c->dist < near_ground && (c->link1 == link || c->link2 == link) && down > 0) return down;
  }
  return 0;
}

/// Rolls the wheels that stand on something at the start along with the guess, those whose goal is no other angle.
static cav_status roll(const cav_problem *problem, cav_trajectory *at) {
  const cav_model *m = problem->model;
  static const double up[3] = {0, 0, 1};
  int wheels = 0;
  for (int j = 0; j < m->njoint; j++) wheels += cav_problem_is_wheel(m, j);
  if (wheels == 0) return CAV_OK;
  cav_state *state = cav_state_new(m);
  double *before = calloc(3 * (size_t)m->nlink + (size_t)m->njoint + 1, sizeof *before);
  double *radius = before ? before + 3 * (size_t)m->nlink : NULL, forwards[3], way[3];
  cav_status status = state && before ? CAV_OK : CAV_NO_MEMORY;
  if (state) state->options.smoothing = near_ground;
  for (int t = 0; t < at->nknot && !status; t++) {
    double *q = at->q + (size_t)t * (size_t)at->nq;
    status = cav_position(m, state, q);
    for (int j = 0; j < m->njoint && !status; j++) {
      const cav_joint *joint = &m->joint[j];
      const double *centre = state->com + 3 * (size_t)joint->link;
      if (!cav_problem_is_wheel(m, j) || problem->q_goal[joint->q] != problem->q_start[joint->q]) continue;
      if (t == 0) radius[j] = wheel_radius(state, joint->link);
      cross3(forwards, state->axis + 6 * (size_t)joint->dof, up);
      sub3(way, centre, before + 3 * (size_t)joint->link);
      copy3(before + 3 * (size_t)joint->link, centre);
      if (t > 0) q[joint->q] = q[joint->q - at->nq] + (radius[j] > 0 ? dot3(way, forwards) / radius[j] : 0);
    }
  }
  cav_state_free(state);
  free(before);
  return status;
}

cav_status cav_guess_fill(const cav_problem *problem, const double *end, cav_trajectory *at) {
  const cav_model *m = problem->model;
  double *tangent = at->v + (size_t)(at->nknot - 1) * m->nv; // scratch until velocities are filled below
  double span = problem->guess_to - problem->guess_from;
  cav_status status = problem->guess == CAV_GUESS_PUMP ? cav_pump_fill(problem, at) : CAV_OK;
  if (status) return status;
  for (int t = 0; t < at->nknot; t++) {
    double time = t * problem->timestep, *q = at->q + (size_t)t * at->nq;
    double x = span > 0 ? (time - problem->guess_from) / span : -1;
    if (problem->guess != CAV_GUESS_PUMP) follow(problem, end, time, tangent, q);
    swing(problem, time, q);
    rotation(problem, smoothstep(x), q);
    if (x > 0 && x < 1) bow(problem, sin(M_PI * x), q);
    if (x > 0 && x < 1) cav_lift(m, 4 * problem->guess_height * x * (1 - x), q);
  }
  if (!problem->cycle.on && problem->guess != CAV_GUESS_PUMP) status = roll(problem, at);
  if (!status && problem->guess_ground && !problem->cycle.on) status = cav_ground(m, at);
  if (!status && problem->schedule.solids == CAV_SOLIDS_GROW && !problem->cycle.on) status = cav_clear(m, at);
  memcpy(at->v, problem->v_start, (size_t)m->nv * sizeof(double));
  cav_trajectory_velocities(m, at);
  return status;
}

cav_options cav_last_law(const cav_problem *problem) {
  cav_options law = problem->model->options;
  law.timestep = problem->timestep;
  law.order = problem->order;
  cav_stage_law(problem, 1, problem->timestep, &law);
  return law;
}

cav_status cav_simulate_passive(const cav_model *model, const cav_options *law, cav_trajectory *at) {
  double *u = calloc((size_t)model->nv + 1, sizeof *u);
  cav_state *state = cav_state_new(model);
  cav_status status = u && state ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) state->options = *law, state->options.stops = 0;
  at->timestep = law->timestep;
  for (int t = 0; status == CAV_OK && t + 1 < at->nknot; t++) {
    double *q = at->q + (size_t)t * (size_t)at->nq, *v = at->v + (size_t)t * (size_t)at->nv;
    status = cav_forward(model, state, q, v, u, v + at->nv);
    if (status == CAV_OK) cav_integrate(model, q, v + at->nv, law->timestep, q + at->nq);
  }
  if (status == CAV_OK) cav_trajectory_velocities(model, at);
  cav_state_free(state);
  free(u);
  return status;
}

cav_status cav_guess_given(const cav_problem *problem, cav_trajectory **at) {
  *at = NULL;
  if (!cav_problem_is_given(problem) || problem->cycle.on || problem->schedule.kinematics) return CAV_OK;
  const cav_options law = cav_last_law(problem);
  const int nknot = (int)lround(problem->duration / problem->timestep) + 1;
  cav_trajectory *way = cav_trajectory_new(problem->model, nknot, problem->timestep);
  if (!way) return CAV_NO_MEMORY;
  memcpy(way->q, problem->q_start, (size_t)way->nq * sizeof *way->q);
  memcpy(way->v, problem->v_start, (size_t)way->nv * sizeof *way->v);
  cav_status status = cav_simulate_passive(problem->model, &law, way);
  if (status == CAV_OK)
    *at = way;
  else
    cav_trajectory_free(way);
  // what the forward step does not find is left to the solver
  return status == CAV_NO_MEMORY ? status : CAV_OK;
}

cav_trajectory *cav_problem_guess(const cav_problem *problem, cav_error *error) {
  if (cav_problem_check(problem, 0, error)) return NULL;
  int nknot = (int)lround(problem->duration / problem->timestep) + 1, cycle = problem->cycle.on;
  cav_periodicity *periodicity = cycle ? cav_periodicity_new(problem, error) : NULL;
  if (cycle && !periodicity) return NULL;
  cav_trajectory *at = cav_trajectory_new(problem->model, nknot, problem->timestep);
  double *end = malloc((size_t)problem->model->nq * sizeof *end);
  cav_status status = at && end ? CAV_OK : CAV_NO_MEMORY;
  if (!status && cycle) cav_periodicity_configuration(periodicity, 1, problem->q_start, end);
  if (!status) status = cav_guess_fill(problem, cycle ? end : problem->q_goal, at);
  if (status) {
    cav_file_fail(error, status, 0,
                  status == CAV_NO_MEMORY ? "no memory for the guess" : "the guess cannot be simulated");
    cav_trajectory_free(at);
    at = NULL;
  }
  free(end);
  cav_periodicity_free(periodicity);
  return at;
}

cav_status cav_guess_take(cav_solve_run *run) {
  int n = cav_transcription_unknowns(run->tr);
  double *x = malloc((size_t)n * sizeof *x);
  if (!x) return CAV_NO_MEMORY;
  // a cycle goes to where its start is a period on
  const double *end = run->problem->q_goal;
  if (run->tr->periodicity) {
    cav_periodicity_configuration(run->tr->periodicity, 1, run->problem->q_start, run->spare->q);
    end = run->spare->q;
  }
  run->at->timestep = run->problem->timestep;
  cav_status status = cav_guess_fill(run->problem, end, run->at);
  for (int i = 0; i < n; i++) x[i] = nudge * (2 * fmod((i + 1) * golden, 1) - 1);
  cav_transcription_move(run->tr, run->at, x, run->spare);
  cav_run_exchange(&run->at, &run->spare);
  free(x);
  return status;
}

int cav_guess_is_decorated(const cav_problem *problem) {
  int decorated = problem->guess_bow[0] != 0 || problem->guess_bow[1] != 0 || problem->guess_height != 0 ||
                  problem->nguess_pose || problem->nswing;
  for (int k = 0; k < 3; k++) decorated |= problem->guess_rotation[k] != 0;
  return decorated;
}
