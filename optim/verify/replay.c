/// Forward simulation of a motion, three ways. Single steps: from every knot's own (q_t, v_t) with the whole u_t, one
/// step of the claimed law: how well the forward step undoes the inverse. Open loop at the step of the knots: from
/// (q_0, v_0), only what the actuators give of u_t. Errors grow as the body's own instability makes them; how long they
/// stay small is the figure. Closed loop at a finer step, by the paper's Euler step: forces u + K_q (q (-) q_ref) + K_v
/// (v - v_ref) brought to the actuators and clipped to their limits. Once under the claimed contact law at a tenth of
/// the step, with the time constant that keeps its stiffness there, and under the model as its file says (its own
/// solref contacts, exact law) at the steps that simulators take. Between knots the motion is read as
/// cav_trajectory_resample does; gains of knot t hold until knot t+1. Cycles run for several periods. METHOD.md, 6 and
/// 8.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "verification.h"

// iterations of a forward step: friction by Coulomb's law may take hundreds; how often a step that is not found is halved
enum { SUBSTEPS = 10, ITERATIONS = 1000, HALVINGS = 4 };

static const double same = 1e-6;             // rad or m: a replay that is the knots
static const double turned = 1;              // rad: a replay that has lost the motion, or at CAV_LOST_DISTANCE
static const double exact_tolerance = 1e-12; // relative residual asked of forward steps
static const double poor = 1e-6;             // fraction of weight that a forward step may leave unexplained
// s: steps that simulators take. A motion on the edge follows at one and falls at another
static const double own_step[] = {0.002, 0.001};

// largest tangent component from q0 to q1
static double apart(const cav_model *model, const double *q0, const double *q1, double *work) {
  double most = 0;
  cav_difference(model, q0, q1, 1, work);
  for (int d = 0; d < model->nv; d++) {
    if (!(fabs(work[d]) <= most)) most = fabs(work[d]);
  }
  return most;
}

// largest generalised force by which a step misses u, fraction of the weight
static double missed(const cav_verification *verification, cav_state *state, const double *q, const double *v,
                     const double *u, const double *next, double *found) {
  double most = 0;
  if (cav_inverse(verification->model, state, q, v, next, found) != CAV_OK) return INFINITY;
  for (int d = 0; d < verification->model->nv; d++) most = fmax(most, fabs(found[d] - u[d]));
  return most / (verification->weight * verification->arm);
}

// one forward step to next [2*nv], of which the second half is scratch, from a guess or NULL. A step that stopped above
// the tolerance is checked by the force that it leaves unexplained
static cav_status step(const cav_verification *verification, cav_state *state, double tolerance, const double *q,
                       const double *v, const double *u, const double *guess, double *next) {
  int nv = verification->model->nv;
  cav_status status =
      cav_forward_newton_from(verification->model, state, q, v, u, guess, ITERATIONS, tolerance, next, NULL);
  if (status == CAV_NOT_CONVERGED && missed(verification, state, q, v, u, next, next + nv) <= poor) return CAV_OK;
  return status;
}

cav_status cav_replay_steps(const cav_verification *verification, cav_replay *replay) {
  const cav_model *model = verification->model;
  int nv = model->nv;
  double *next = malloc(sizeof(double) * (size_t)(2 * nv + 1));
  if (!next) return CAV_NO_MEMORY;
  cav_status status = CAV_OK;
  replay->step_error = 0;
  replay->step_knot = 0;
  for (int t = 0; t < verification->rows && status == CAV_OK; t++) {
    const double *v = verification->v + t * nv;
    verification->state->options = cav_verification_law(verification, t);
    status = step(verification, verification->state, exact_tolerance, verification->q + t * model->nq, v,
                  verification->u + t * nv, NULL, next);
    // a step that stopped far from its solution shows as a large error, one that has none in numbers as one without end
    const int nowhere = status == CAV_NOT_FINITE;
    if (nowhere && isfinite(replay->step_error)) replay->step_error = INFINITY, replay->step_knot = t;
    if (status == CAV_NOT_CONVERGED || nowhere) status = CAV_OK;
    if (status != CAV_OK) break;
    for (int d = 0; d < nv && !nowhere; d++) {
      double error = fabs(next[d] - v[nv + d]) * verification->h;
      if (error <= replay->step_error) continue;
      replay->step_error = error;
      replay->step_knot = t;
    }
  }
  free(next);
  return status;
}

// periods of a cycle in a row, each the image of the one before
static cav_trajectory *unroll(const cav_verification *verification, const cav_trajectory *period) {
  int last = verification->last, nq = period->nq, nv = period->nv;
  cav_trajectory *all = cav_trajectory_new(verification->model, verification->periods * last + 1, period->timestep);
  if (!all) return NULL;
  memcpy(all->v, period->v, sizeof(double) * (size_t)nv);
  for (size_t t = 0; t < (size_t)all->nknot; t++) {
    double *q = all->q + t * nq, *u = all->u + t * nv;
    if (t < (size_t)last) {
      memcpy(q, period->q + t * nq, sizeof(double) * (size_t)nq);
      memcpy(u, period->u + t * nv, sizeof(double) * (size_t)nv);
    } else {
      cav_cycle_image_configuration(verification->image, q - (size_t)last * nq, q);
      cav_cycle_image_tangent(verification->image, 1, u - (size_t)last * nv, u);
    }
  }
  cav_trajectory_velocities(verification->model, all);
  return all;
}

// all periods of the motion; the last knot holds the force before it where none closes the motion
static cav_trajectory *whole(const cav_verification *verification) {
  const cav_model *model = verification->model;
  double *u = verification->u + (size_t)verification->last * (size_t)model->nv;
  if (verification->rows == verification->last) memcpy(u, u - model->nv, sizeof(double) * model->nv);
  cav_trajectory motion = {
      .nq = model->nq, .nv = model->nv, .nknot = verification->last + 1, .timestep = verification->h};
  motion.q = (double *)verification->q, motion.v = verification->v, motion.u = verification->u;
  return verification->image ? unroll(verification, &motion) : cav_trajectory_copy(&motion);
}

cav_status cav_replay_open(const cav_verification *verification, cav_replay *replay) {
  const cav_model *model = verification->model;
  int nv = model->nv, nq = model->nq, together = 1;
  double *q = malloc(sizeof(double) * (size_t)(nq + 5 * nv + 1));
  cav_trajectory *motion = whole(verification);
  if (!q || !motion) {
    free(q);
    cav_trajectory_free(motion);
    return CAV_NO_MEMORY;
  }
  double *v = q + nq, *u = v + nv, *next = u + nv, *work = next + 2 * nv;
  memcpy(q, verification->q, sizeof(double) * nq);
  memcpy(v, verification->v, sizeof(double) * nv);
  replay->open_error = replay->open_seconds = 0;
  verification->state->options = cav_verification_law(verification, 0);
  cav_status status = CAV_OK;
  for (int t = 0; t + 1 < motion->nknot; t++) {
    // only what actuators give, and what is penalised of the rest
    const double *all = motion->u + t * nv;
    cav_actuation(model, verification->state, all, work, NULL);
    for (int d = 0; d < nv; d++) u[d] = verification->deviation[d] > 0 ? all[d] : all[d] - work[d];
    status = step(verification, verification->state, exact_tolerance, q, v, u, NULL, next);
    if (status != CAV_OK) break;
    cav_integrate(model, q, next, verification->h, q);
    memcpy(v, next, sizeof(double) * nv);
    double error = apart(model, motion->q + (t + 1) * nq, q, work);
    if (!(error <= replay->open_error)) replay->open_error = error;
    together = together && error <= same;
    if (together) replay->open_seconds = (t + 1) * verification->h;
  }
  free(q);
  cav_trajectory_free(motion);
  // a simulation that ends in numbers that are not finite or in a step without solution ends the figure, not the
  // verification
  return status == CAV_NO_MEMORY ? status : CAV_OK;
}

// generalised force of efforts within the limits at (q, v), where bare stands; moment [nv] is scratch
static void run_loop(const cav_verification *verification, const double *v, const double *effort, double *moment,
                     double *u) {
  const cav_model *model = verification->model;
  memset(u, 0, sizeof(double) * model->nv);
  for (int a = 0; a < model->nu; a++) {
    double length = cav_actuator_length(model, verification->bare, a, moment), velocity = 0, input;
    for (int d = 0; d < model->nv; d++) velocity += moment[d] * v[d];
    cav_actuator_input(model, a, length, velocity, model->actuator[a].unit * effort[a], &input);
    double force = cav_actuator_force(model, a, length, velocity, input);
    for (int d = 0; d < model->nv; d++) u[d] += force * moment[d];
  }
}

// x [nv], a tangent, moved by a number of periods; scratch [nv]
static void move(const cav_verification *verification, int periods, double *x, double *scratch) {
  for (int k = 0; k < abs(periods); k++) {
    cav_cycle_image_tangent(verification->image, periods > 0 ? 1 : -1, x, scratch);
    memcpy(x, scratch, sizeof(double) * verification->model->nv);
  }
}

// u := forces of the motion and feedback of knot t at v, and where bare stands, through the actuators; residual ones as
// planned. dq and dv may be changed
static void command(const cav_verification *verification, int t, const double *planned, const double *gain_q,
                    const double *gain_v, const double *v, double *dq, double *dv, double *effort, double *work,
                    double *u) {
  int nv = verification->model->nv, periods = t / verification->last;
  size_t at = (size_t)(t % verification->last) * (size_t)nv * (size_t)nv;
  const double *Kq = gain_q ? gain_q + at : NULL, *Kv = gain_v ? gain_v + at : NULL;
  // gains are those of the first period, where forces and strayings are moved to
  move(verification, -periods, dq, work);
  move(verification, -periods, dv, work);
  for (int i = 0; i < nv; i++) {
    u[i] = 0;
    for (int j = 0; Kq && j < nv; j++) u[i] += Kq[i * nv + j] * dq[j];
    for (int j = 0; Kv && j < nv; j++) u[i] += Kv[i * nv + j] * dv[j];
  }
  move(verification, periods, u, work);
  for (int i = 0; i < nv; i++) u[i] += planned[i];
  cav_actuation(verification->model, verification->bare, u, NULL, effort);
  run_loop(verification, v, effort, work, u);
  // residual forces act as planned, with their penalty
  for (int i = 0; i < nv; i++)
    if (verification->deviation[i] > 0) u[i] += planned[i];
}

// angle between two unit quaternions
static double angle(const double *a, const double *b) {
  double w = fabs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
  return 2 * acos(fmin(w, 1));
}

// whether a link is a ball that no actuator moves: which way round it lies means nothing
static int is_ball(const cav_model *model, int link) {
  int round = !model->link[link].driven;
  for (int l = link + 1; l < model->nlink; l++) round &= model->link[l].parent != link;
  for (int g = 0; g < model->ngeom; g++) {
    const cav_geom *geom = &model->geom[g];
    if (geom->link != link || (!geom->contype && !geom->conaffinity)) continue;
    double off = 0;
    for (int k = 0; k < 3; k++) off = fmax(off, fabs(geom->pos[k] - model->link[link].com[k]));
    round &= geom->type == CAV_GEOM_SPHERE && off < 1e-6;
  }
  return round;
}

// distances between two configurations: of links' centres of mass, and turn of root links but balls; -> bodies of the largest
typedef struct gap {
  double distance, rotation;
  int link, root;
} gap;

// leaves bare at q1
static cav_status compare(const cav_verification *verification, const double *q0, const double *q1, double *place,
                          gap *found) {
  const cav_model *model = verification->model;
  cav_status status = cav_position(model, verification->bare, q0);
  if (status != CAV_OK) return status;
  for (int l = 0; l < model->nlink; l++) {
    memcpy(place + 7 * l, verification->bare->com + 3 * l, sizeof(double) * 3);
    memcpy(place + 7 * l + 3, verification->bare->link[l].quat, sizeof(double) * 4);
  }
  status = cav_position(model, verification->bare, q1);
  *found = (gap){0};
  for (int l = 1; l < model->nlink && status == CAV_OK; l++) {
    const double *a = place + 7 * l, *b = verification->bare->com + 3 * l;
    double distance =
        sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]));
    if (distance > found->distance) found->distance = distance, found->link = l;
    if (model->link[l].root != l || is_ball(model, l)) continue;
    double rotation = angle(a + 3, verification->bare->link[l].quat);
    if (rotation > found->rotation) found->rotation = rotation, found->root = l;
  }
  return status;
}

// notes the distance now; 0 once the motion is lost
static int following(const cav_verification *verification, const gap *now, double time, struct cav_follow *follow) {
  char name[32];
  follow->error = now->distance;
  int near = now->distance <= CAV_LOST_DISTANCE && now->rotation <= turned;
  if (near) {
    follow->seconds = time;
    return 1;
  }
  int by_rotation = now->distance <= CAV_LOST_DISTANCE;
  snprintf(follow->lost, sizeof follow->lost, "%.60s is %.2g %s away at %.3f s",
           cav_verification_link_name(verification->model, by_rotation ? now->root : now->link, name),
           by_rotation ? now->rotation : now->distance, by_rotation ? "rad" : "m", time);
  return 0;
}

// notes that there is no step to go on by; 0
static int stopped(cav_status status, double time, struct cav_follow *follow) {
  snprintf(follow->lost, sizeof follow->lost, "simulation stopped at %.3f s: %s", time, cav_status_name(status));
  return 0;
}

// the model as its file says, at a finer step
static cav_options own_options(const cav_verification *verification, double h) {
  cav_options options = verification->model->options;
  options.timestep = h;
  options.order = CAV_ORDER_EULER;
  options.stabilisation = CAV_STABILISATION_SOLREF;
  options.smoothing = options.smoothing_self = 0;
  options.refsafe = 1;
  return options;
}

// the claimed law at a finer step; what smoothing lets slip in a step, delta/h, stays
static cav_options claimed_options(const cav_verification *verification, const cav_options *law, double h) {
  cav_options claimed = *law;
  claimed.timestep = verification->h;
  claimed = cav_options_at_step(&claimed, h);
  claimed.smoothing *= h / verification->h;
  claimed.smoothing_self *= h / verification->h;
  claimed.order = CAV_ORDER_EULER;
  claimed.stops = 0;
  return claimed;
}

// notes the largest effort asked for, over its limit; of actuators that have one
static void note_asked(const cav_model *model, const double *effort, struct cav_follow *follow) {
  for (int a = 0; a < model->nu; a++) {
    const cav_actuator *actuator = model->actuator + a;
    if (!actuator->ctrllimited && !actuator->forcelimited && !actuator->actlimited) continue;
    follow->asked = fmax(follow->asked, fabs(effort[a]) / cav_verification_effort_scale(model, a));
  }
}

// the motion read at a finer step: the nearest to h that divides it, and no longer than its own
static cav_trajectory *finer(const cav_verification *verification, double h) {
  cav_trajectory *motion = whole(verification), *fine = NULL;
  double duration = motion ? verification->h * (motion->nknot - 1) : 0;
  double steps = motion ? fmax(round(duration / h), motion->nknot - 1) : 1;
  if (motion) fine = cav_trajectory_resample(verification->model, motion, duration / steps);
  cav_trajectory_free(motion);
  return fine;
}

// a simulation under way
typedef struct simulation {
  cav_trajectory *motion; ///< at the finer step
  const double *gain_q, *gain_v;
  const cav_disturbance *push; ///< within the next step, or NULL
  const cav_options *law;      ///< claimed, or NULL: the model's own
  cav_state *state;
  double *q, *v; ///< q owns the room of all
  double *a;     ///< mean acceleration of the last step, from which the next is guessed; 0 before the first
  double *dq, *dv, *u, *next, *control, *place;
} simulation;

// what a simulation obeys at a step
static cav_options options_at(const cav_verification *verification, const cav_options *law, double h) {
  return law ? claimed_options(verification, law, h) : own_options(verification, h);
}

// a step of h under the forces s->u. One that is not found is taken as two of h/2: with Coulomb's friction it need not exist
static cav_status go(const cav_verification *verification, simulation *s, double h, int halvings) {
  const cav_model *model = verification->model;
  s->state->options = options_at(verification, s->law, h);
  for (int d = 0; d < model->nv; d++) s->next[d] = s->v[d] + h * s->a[d];
  cav_status status = step(verification, s->state, 1e-9, s->q, s->v, s->u, s->next, s->next);
  if (status == CAV_NOT_CONVERGED && halvings > 0) {
    status = go(verification, s, h / 2, halvings - 1);
    return status == CAV_OK ? go(verification, s, h / 2, halvings - 1) : status;
  }
  if (status != CAV_OK) return status;
  cav_integrate(model, s->q, s->next, h, s->q);
  for (int d = 0; d < model->nv; d++) s->a[d] = (s->next[d] - s->v[d]) / h;
  memcpy(s->v, s->next, sizeof(double) * model->nv);
  return CAV_OK;
}

// u += what a force on the centre of mass of a root link does
static void add_force(const cav_model *model, const cav_state *state, int link, const double force[3], double *u) {
  const double *reference = state->reference + 3 * link, *com = state->com + 3 * link;
  double r[3] = {com[0] - reference[0], com[1] - reference[1], com[2] - reference[2]};
  double moment[3] = {r[1] * force[2] - r[2] * force[1], r[2] * force[0] - r[0] * force[2],
                      r[0] * force[1] - r[1] * force[0]};
  for (int d = model->link[link].dof; d < model->link[link].dof + model->link[link].ndof; d++)
    for (int k = 0; k < 3; k++) u[d] += state->axis[6 * d + k] * moment[k] + state->axis[6 * d + 3 + k] * force[k];
}

// one step from i to i+1 of the finer motion, begun and ended with bare at s->q; 0 in *on once the motion is lost
static cav_status advance(const cav_verification *verification, simulation *s, int i, struct cav_follow *follow,
                          int *on) {
  const cav_model *model = verification->model;
  const double *q_ref = s->motion->q + i * model->nq, *v_ref = s->motion->v + i * model->nv;
  double time = (i + 1) * s->motion->timestep;
  cav_difference(model, q_ref, s->q, 1, s->dq);
  for (int d = 0; d < model->nv; d++) s->dv[d] = s->v[d] - v_ref[d];
  int knot = (int)((i + 1e-6) * s->motion->timestep / verification->h);
  command(verification, knot, s->motion->u + i * model->nv, s->gain_q, s->gain_v, s->v, s->dq, s->dv, s->control,
          s->next, s->u);
  note_asked(model, s->control, follow);
  if (s->push) {
    double force[3];
    for (int k = 0; k < 3; k++) force[k] = s->push->impulse[k] / s->motion->timestep;
    add_force(model, verification->bare, s->push->link, force, s->u);
  }
  cav_status status = go(verification, s, s->motion->timestep, HALVINGS);
  if (status == CAV_NO_MEMORY) return status;
  if (status != CAV_OK) {
    *on = stopped(status, time, follow);
    return CAV_OK;
  }
  gap now;
  status = compare(verification, q_ref + model->nq, s->q, s->place, &now);
  if (status == CAV_NO_MEMORY) return status;
  if (status == CAV_OK)
    *on = following(verification, &now, time, follow);
  else
    *on = stopped(status, time, follow);
  return CAV_OK;
}

// number k of an even sequence over (-1, 1), of which each start has its own
static double spread(int start, int k) {
  return 2 * fmod(0.5 + start * 0.7548776662466927 + k * 0.6180339887498949, 1) - 1;
}

// moves a start off: joints, and velocities of all
static void move_start(const cav_model *model, int start, double *q, double *v) {
  for (int d = 0; d < model->nv; d++) v[d] += CAV_START_VELOCITY * spread(start, d);
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = model->joint + j;
    if (joint->type == CAV_JOINT_SLIDE || joint->type == CAV_JOINT_HINGE)
      q[joint->q] += CAV_START_POSITION * spread(start, model->nv + j);
  }
}

// the first step: that of the push where it is known how q, v, a [n] stand there, else 0
static int go_on(const cav_disturbance *push, int at, size_t n, double *q) {
  if (!push || !push->before || !push->before->known) return 0;
  memcpy(q, push->before->x, n * sizeof *q);
  return at;
}

// keeps how they stand there
static void keep(const cav_disturbance *disturbance, size_t n, const double *q) {
  if (!disturbance->before || disturbance->before->known) return;
  memcpy(disturbance->before->x, q, n * sizeof *q);
  disturbance->before->known = 1;
}

// a simulation at the motion's start, or a little off; to be put away in any case
static cav_status set_out(const cav_verification *verification, const cav_options *law, double h, int start,
                          simulation *s) {
  const cav_model *model = verification->model;
  size_t nq = (size_t)model->nq, nv = (size_t)model->nv;
  *s = (simulation){.motion = finer(verification, h), .law = law, .state = cav_state_new(model)};
  s->q = malloc(sizeof(double) * (nq + 7 * nv + (size_t)model->nu + 7 * (size_t)model->nlink));
  if (!s->q || !s->state || !s->motion) return CAV_NO_MEMORY;
  s->v = s->q + nq, s->a = s->v + nv;
  s->dq = s->a + nv, s->dv = s->dq + nv, s->u = s->dv + nv, s->next = s->u + nv, s->control = s->next + 2 * nv;
  s->place = s->control + model->nu;
  memcpy(s->q, verification->q, sizeof(double) * nq);
  memcpy(s->v, verification->v, sizeof(double) * nv);
  memset(s->a, 0, sizeof(double) * nv);
  if (start) move_start(model, start, s->q, s->v);
  return CAV_OK;
}

static void put_away(simulation *s) {
  cav_trajectory_free(s->motion);
  cav_state_free(s->state);
  free(s->q);
}

// a simulation to its end; disturbance NULL: none
static cav_status closed(const cav_verification *verification, const cav_options *law, double h, const double *gain_q,
                         const double *gain_v, const cav_disturbance *disturbance, struct cav_follow *follow) {
  const cav_disturbance *push = disturbance && disturbance->link ? disturbance : NULL;
  const size_t n = cav_before_numbers(verification);
  simulation s;
  cav_status status = set_out(verification, law, h, disturbance ? disturbance->start : 0, &s);
  *follow = (struct cav_follow){0};
  if (status == CAV_OK) {
    s.gain_q = gain_q, s.gain_v = gain_v;
    const int hit = disturbance ? (int)(disturbance->fraction * (s.motion->nknot - 1)) : 0;
    int on = 1, i = go_on(push, hit, n, s.q);
    status = cav_position(verification->model, verification->bare, s.q);
    for (; i + 1 < s.motion->nknot && on && status == CAV_OK; i++) {
      s.push = push && i == hit ? push : NULL;
      if (disturbance && i == hit) keep(disturbance, n, s.q);
      status = advance(verification, &s, i, follow, &on);
    }
  }
  put_away(&s);
  return status;
}

struct cav_lane {
  simulation s;
};

static cav_lane *lane(const cav_verification *verification, const cav_options *law, double h, int start) {
  cav_lane *l = malloc(sizeof *l);
  if (l && set_out(verification, law, h, start, &l->s) == CAV_OK) return l;
  cav_lane_free(l);
  return NULL;
}

cav_lane *cav_lane_claimed(const cav_verification *verification) {
  return lane(verification, &verification->law, verification->h / SUBSTEPS, 0);
}

cav_lane *cav_lane_own(const cav_verification *verification, int finer, int start) {
  return lane(verification, NULL, own_step[finer], start);
}

void cav_lane_free(cav_lane *l) {
  if (l) put_away(&l->s);
  free(l);
}

double *cav_lane_state(cav_lane *l) { return l->s.q; }

cav_status cav_lane_run(const cav_verification *verification, cav_lane *l, const double *gain_q, const double *gain_v,
                        int from, int to, double *strayed) {
  const cav_model *model = verification->model;
  simulation *s = &l->s;
  const double steps = verification->h / s->motion->timestep;
  const int end = (int)fmin(round(to * steps), s->motion->nknot - 1);
  struct cav_follow follow = {0};
  int on = 1, i = (int)lround(from * steps);
  s->gain_q = gain_q, s->gain_v = gain_v, s->push = NULL;
  cav_status status = cav_position(model, verification->bare, s->q);
  for (; i < end && on && status == CAV_OK; i++) status = advance(verification, s, i, &follow, &on);
  *strayed = 1 + (end - i) * s->motion->timestep;
  gap now;
  if (on && status == CAV_OK) {
    status = compare(verification, s->motion->q + end * model->nq, s->q, s->place, &now);
    if (status == CAV_OK) *strayed = fmin(fmax(now.distance / CAV_LOST_DISTANCE, now.rotation / turned), 1);
  }
  // what has left all numbers is lost
  return status == CAV_NO_MEMORY ? status : CAV_OK;
}

cav_status cav_replay_closed(const cav_verification *verification, const cav_options *law, const double *gain_q,
                             const double *gain_v, struct cav_follow *follow) {
  return closed(verification, law, verification->h / SUBSTEPS, gain_q, gain_v, NULL, follow);
}

cav_status cav_replay_own(const cav_verification *verification, int finer, const double *gain_q, const double *gain_v,
                          const cav_disturbance *disturbance, struct cav_follow *follow) {
  return closed(verification, NULL, own_step[finer], gain_q, gain_v, disturbance, follow);
}
