/// Certifies a motion from its knots alone, with code apart from the optimiser's: velocities, forces and contacts are
/// recomputed from q; what a certificate promises is measured, and the first promise that is broken is named with its
/// knot, body and size. optimisation.md, 6. Momentum: balance.c; hard terms: demand.c; forward simulation: replay.c.
/// It does not judge the cost, and it does not look between knots, except by the closed-loop replay.
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "audit.h"
#include "transcription.h"

static const double usual_gravity = 9.81; // m/s^2, unit of forces where the model has none
static const double loaded = 0.01;        // share of the weight from which on a contact is loaded

/// What was found at the knots.
typedef struct evidence {
  cav_finding unactuated, limit, term, penetration, defect, wrap;
  double slip, load;
} evidence;

// writes the reason of a failed call
static cav_status fail(cav_error *error, cav_status status, const char *format, ...)
    __attribute__((format(printf, 3, 4)));
static cav_status fail(cav_error *error, cav_status status, const char *format, ...) {
  if (!error) return status;
  va_list list;
  va_start(list, format);
  error->status = status;
  error->line = 0;
  vsnprintf(error->text, sizeof error->text, format, list);
  va_end(list);
  return status;
}

void cav_finding_note(cav_finding *finding, double value, int knot, const char *format, ...) {
  if (value <= finding->value || isnan(finding->value)) return;
  va_list list;
  va_start(list, format);
  finding->value = value;
  finding->knot = knot;
  vsnprintf(finding->where, sizeof finding->where, format, list);
  va_end(list);
}

const char *cav_audit_link_name(const cav_model *model, int link, char buffer[32]) {
  int body = model->link[link].body;
  if (link == 0) return "the world";
  if (*model->body[body].name) return model->body[body].name;
  snprintf(buffer, 32, "body %d", body);
  return buffer;
}

void cav_audit_actuator_range(const cav_model *model, int actuator, double range[2], double *scale) {
  cav_actuator_effort_range(model, actuator, range);
  double most = 0;
  for (int k = 0; k < 2; k++) {
    if (isfinite(range[k])) most = fmax(most, fabs(range[k]));
  }
  *scale = most > 0 ? most : 1;
}

static const char *joint_name(const cav_model *model, int joint, char buffer[32]) {
  if (*model->joint[joint].name) return model->joint[joint].name;
  snprintf(buffer, 32, "joint %d", joint);
  return buffer;
}

static const char *geom_name(const cav_model *model, int geom, char buffer[32]) {
  if (*model->geom[geom].name) return model->geom[geom].name;
  snprintf(buffer, 32, "geom %d", geom);
  return buffer;
}

// 1 if all n values are finite
static int all_finite(const double *x, size_t n) {
  for (size_t i = 0; i < n; i++) {
    if (!isfinite(x[i])) return 0;
  }
  return 1;
}

// the motion fits the problem, and all of it is numbers
static cav_status admit(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                        const double *gain_q, const double *gain_v, cav_error *error) {
  if (!problem || !problem->model || !trajectory || !contact) {
    return fail(error, CAV_BAD_INPUT, "verification needs a problem with a model, a trajectory and a contact law");
  }
  const cav_model *model = problem->model;
  if (trajectory->nq != model->nq || trajectory->nv != model->nv) {
    return fail(error, CAV_BAD_INPUT,
                "the trajectory has %d positions and %d velocities, the model %d and %d: "
                "verify it with the model it was solved for",
                trajectory->nq, trajectory->nv, model->nq, model->nv);
  }
  if (!problem->q_start || !problem->v_start) {
    return fail(error, CAV_BAD_INPUT, "the problem has no start: set q_start and v_start");
  }
  if (problem->duration_most == 0 && !(fabs(trajectory->timestep - problem->timestep) <= 1e-9 * problem->timestep)) {
    return fail(error, CAV_BAD_INPUT, "the trajectory's step is %.9g s, the problem's %.9g s", trajectory->timestep,
                problem->timestep);
  }
  if (!(problem->timestep > 0) || !(trajectory->timestep > 0))
    return fail(error, CAV_BAD_INPUT, "the steps of the problem and of the trajectory must be positive");
  long knots = lround(problem->duration / problem->timestep) + 1;
  if (trajectory->nknot < 2 || trajectory->nknot != knots) {
    return fail(error, CAV_BAD_INPUT, "the trajectory has %d knots, the problem asks for %ld", trajectory->nknot,
                knots);
  }
  size_t n = (size_t)trajectory->nknot, gains = (n - 1) * (size_t)model->nv * (size_t)model->nv;
  int finite = all_finite(trajectory->q, n * (size_t)model->nq) && all_finite(problem->q_start, (size_t)model->nq) &&
               all_finite(problem->v_start, (size_t)model->nv) && (!gain_q || all_finite(gain_q, gains)) &&
               (!gain_v || all_finite(gain_v, gains));
  return finite
             ? CAV_OK
             : fail(error, CAV_NOT_FINITE, "the trajectory, the start or the gains hold numbers that are not finite");
}

static void audit_clear(cav_audit *audit) {
  cav_wrap_free(audit->wrap);
  cav_state_free(audit->state);
  cav_state_free(audit->bare);
  free(audit->v);
  free(audit->u);
  free(audit->control);
}

// velocities from the knots; one more closes the motion
static void knot_velocities(cav_audit *audit) {
  const cav_model *model = audit->model;
  int nq = model->nq, nv = model->nv;
  memcpy(audit->v, audit->problem->v_start, sizeof(double) * nv);
  for (int t = 1; t <= audit->last; t++) {
    cav_difference(model, audit->q + (t - 1) * nq, audit->q + t * nq, audit->h, audit->v + t * nv);
  }
  double *close = audit->v + (audit->last + 1) * nv;
  memset(close, 0, sizeof(double) * nv);
  if (audit->wrap) {
    cav_wrap_tangent(audit->wrap, -1, close - nv, audit->v);
    cav_wrap_tangent(audit->wrap, 1, audit->v + nv, close);
  } else if (!audit->problem->close_at_rest) {
    memcpy(close, close - nv, sizeof(double) * nv);
  }
}

static cav_status audit_start(cav_audit *audit, const cav_problem *problem, const cav_trajectory *trajectory,
                              const cav_options *contact, cav_error *error) {
  const cav_model *model = problem->model;
  size_t n = (size_t)trajectory->nknot, nv = (size_t)model->nv;
  *audit = (cav_audit){.problem = problem,
                       .model = model,
                       .law = *contact,
                       .last = trajectory->nknot - 1,
                       .h = trajectory->timestep,
                       .arm = CAV_MOMENT_ARM,
                       .q = trajectory->q};
  audit->periods = 1;
  if (problem->cycle.on) {
    audit->wrap = cav_wrap_new(problem, error);
    if (!audit->wrap) return error->status;
    audit->periods = problem->cycle.mirror == CAV_MIRROR_NONE ? 2 : 4;
  }
  audit->rows = audit->last + (problem->close_at_rest && !problem->cycle.on ? 1 : 0);
  audit->law.timestep = audit->h;
  // weight, or a like force where there is no gravity
  const double *g = model->gravity;
  double pull = contact->gravity ? sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]) : 0;
  audit->weight = (pull > 0 ? pull : usual_gravity) * (model->mass > 0 ? model->mass : 1);
  audit->state = cav_state_new(model);
  audit->bare = cav_state_new(model);
  audit->v = malloc(sizeof(double) * (n + 1) * (nv + 1));
  audit->u = calloc(n * (nv + 1), sizeof(double));
  audit->control = calloc(n * ((size_t)model->nu + 1), sizeof(double));
  if (!audit->state || !audit->bare || !audit->v || !audit->u || !audit->control) return CAV_NO_MEMORY;
  audit->state->options = audit->law;
  audit->bare->options.contact = audit->bare->options.constraint = 0;
  knot_velocities(audit);
  return CAV_OK;
}

// the motion begins where the problem says
static void note_start(const cav_audit *audit, cav_finding *finding) {
  const cav_model *model = audit->model;
  double *away = audit->u; // not yet filled
  char name[32];
  cav_difference(model, audit->problem->q_start, audit->q, 1, away);
  for (int d = 0; d < model->nv; d++) {
    cav_finding_note(finding, fabs(away[d]), 0, "start, %s, away from the problem's start",
                     joint_name(model, model->dof[d].joint, name));
  }
}

// the duration is one that the problem allows
static void note_duration(const cav_audit *audit, cav_finding *finding) {
  const cav_problem *p = audit->problem;
  double duration = audit->last * audit->h, least = p->duration, most = p->duration;
  if (p->duration_most > 0) least = p->duration_least, most = p->duration_most;
  double beyond = fmax(least - duration, duration - most) / p->duration;
  cav_finding_note(finding, beyond, audit->last, "duration, %.6g s of %.6g .. %.6g s", duration, least, most);
}

// the end of a cycle is its start moved: by coordinates, by where the links are, and by the step that leads to the start
static cav_status note_wrap(const cav_audit *audit, cav_finding *finding) {
  const cav_model *model = audit->model;
  int nq = model->nq, nv = model->nv;
  const double *last = audit->q + audit->last * nq;
  double *q = malloc(sizeof(double) * (size_t)(nq + nv + 3 * model->nlink)), *off = q + nq, *com = off + nv;
  char name[32];
  if (!q) return CAV_NO_MEMORY;
  cav_wrap_configuration(audit->wrap, 1, audit->q, q);
  cav_difference(model, q, last, 1, off);
  for (int d = 0; d < nv; d++)
    cav_finding_note(finding, fabs(off[d]), audit->last, "%s", joint_name(model, model->dof[d].joint, name));
  cav_wrap_configuration(audit->wrap, -1, last - nq, q);
  cav_difference(model, q, audit->q, 1, off);
  for (int d = 0; d < nv; d++)
    cav_finding_note(finding, fabs(off[d] - audit->h * audit->v[d]), 0, "step of %s",
                     joint_name(model, model->dof[d].joint, name));
  cav_status status = cav_position(model, audit->bare, audit->q);
  memcpy(com, audit->bare->com, sizeof(double) * 3 * model->nlink);
  if (status == CAV_OK) status = cav_position(model, audit->bare, last);
  for (int l = 1; l < model->nlink && status == CAV_OK; l++) {
    const double *there = audit->bare->com + 3 * cav_wrap_link(audit->wrap, l);
    double moved[3], apart = 0;
    cav_wrap_point(audit->wrap, com + 3 * l, moved);
    for (int k = 0; k < 3; k++) apart += (moved[k] - there[k]) * (moved[k] - there[k]);
    cav_finding_note(finding, sqrt(apart), audit->last, "%s", cav_audit_link_name(model, l, name));
  }
  free(q);
  return status;
}

// control of a servo beyond its limits: what the nearest one within them does not give, over gain and limits
static void note_servo(const cav_audit *audit, int t, int a, double effort, double *moment, evidence *found) {
  const cav_model *model = audit->model;
  const cav_actuator *actuator = model->actuator + a;
  double length = cav_actuator_length(model, audit->state, a, moment), velocity = 0, input;
  for (int d = 0; d < model->nv; d++) velocity += moment[d] * audit->v[t * model->nv + d];
  cav_actuator_input(model, a, length, velocity, effort, &input);
  double missing = fabs(effort - cav_actuator_force(model, a, length, velocity, input));
  double scale = fmax(fabs(actuator->ctrlrange[0]), fabs(actuator->ctrlrange[1])) * fabs(actuator->gain_parameter[0]);
  cav_finding_note(&found->limit, missing / scale, t, "servo %.60s (%d), control at %.4g of %.4g .. %.4g",
                   actuator->name, a, input, actuator->ctrlrange[0], actuator->ctrlrange[1]);
}

// what no actuator gives, and what actuators are asked for beyond their limits
static void note_forces(const cav_audit *audit, int t, double *residual, evidence *found) {
  const cav_model *model = audit->model;
  double *control = audit->control + t * model->nu;
  char name[32], link[32];
  cav_actuation(model, audit->state, audit->u + t * model->nv, residual, control);
  for (int d = 0; d < model->nv; d++) {
    const cav_joint *joint = model->joint + model->dof[d].joint;
    int line = joint->type == CAV_JOINT_SLIDE || (joint->type == CAV_JOINT_FREE && d - joint->dof < 3);
    double share = fabs(residual[d]) / (audit->weight * (line ? 1 : audit->arm));
    cav_finding_note(&found->unactuated, share, t, "%.60s of %.60s, dof %d: %.4g %s",
                     joint_name(model, model->dof[d].joint, name), cav_audit_link_name(model, joint->link, link), d,
                     residual[d], line ? "N" : "N m");
  }
  for (int a = 0; a < model->nu; a++) {
    double range[2], scale;
    cav_audit_actuator_range(model, a, range, &scale);
    double beyond = fmax(range[0] - control[a], control[a] - range[1]) / scale;
    cav_finding_note(&found->limit, beyond, t, "actuator %.60s (%d) at %.4g of %.4g .. %.4g", model->actuator[a].name,
                     a, control[a], range[0], range[1]);
    if (cav_servo_bounds(model, a)) note_servo(audit, t, a, control[a], residual, found);
  }
}

// ranges of joints at q, a configuration of knot t or its image
static void note_joints(const cav_audit *audit, int t, const double *q, cav_finding *finding) {
  const cav_model *model = audit->model;
  char name[32];
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = model->joint + j;
    if (!joint->limited || joint->type == CAV_JOINT_FREE) continue;
    const double *x = q + joint->q;
    double beyond = fmax(joint->range[0] - *x, *x - joint->range[1]);
    if (joint->type == CAV_JOINT_BALL) {
      beyond = 2 * atan2(sqrt(x[1] * x[1] + x[2] * x[2] + x[3] * x[3]), fabs(x[0])) - joint->range[1];
    }
    cav_finding_note(finding, beyond, t, "range of %.60s, in rad or m", joint_name(model, j, name));
  }
}

// joint and tendon ranges; image [nq] is scratch
static void note_ranges(const cav_audit *audit, int t, double *image, cav_finding *finding) {
  const cav_model *model = audit->model;
  const double *q = audit->q + t * model->nq;
  char name[32];
  note_joints(audit, t, q, finding);
  if (audit->wrap) {
    cav_wrap_configuration(audit->wrap, 1, q, image);
    note_joints(audit, t, image, finding);
  }
  // twist and swing of ball joints are rows where they are violated
  for (int i = 0; i < audit->state->nrow; i++) {
    const cav_row *row = audit->state->row + i;
    if (row->type != CAV_ROW_LIMIT_JOINT || row->side < 2) continue;
    cav_finding_note(finding, -row->dist, t, "%s of %.60s, in rad", row->side < 4 ? "twist" : "swing",
                     joint_name(model, row->object, name));
  }
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *tendon = model->tendon + i;
    if (!tendon->limited) continue;
    double length = audit->state->tendon_length[i];
    double beyond = fmax(tendon->range[0] - length, length - tendon->range[1]);
    cav_finding_note(finding, beyond, t, "range of tendon %.60s (%d)", tendon->name, i);
  }
}

// how deep, how fast under load
static void note_contacts(const cav_audit *audit, int t, evidence *found) {
  const cav_model *model = audit->model;
  char name1[32], name2[32];
  for (int i = 0; i < audit->state->ncontact; i++) {
    const cav_contact *contact = audit->state->contact + i;
    const cav_pair *pair = model->pair + contact->pair;
    cav_finding_note(&found->penetration, -contact->dist, t, "%.60s in %.60s", geom_name(model, pair->geom2, name2),
                     geom_name(model, pair->geom1, name1));
    if (t >= audit->rows || contact->dim < 3) continue;
    double load = contact->impulse[0];
    if (!(load > loaded * audit->weight * audit->h)) continue;
    found->load += load;
    found->slip += load * hypot(contact->velocity_next[1], contact->velocity_next[2]);
  }
}

// inverse dynamics knot by knot, and all that is measured there
static cav_status examine(cav_audit *audit, cav_balance *balance, evidence *found, cav_error *error) {
  const cav_model *model = audit->model;
  int nv = model->nv, room = 0;
  double *work = NULL, *residual = malloc(sizeof(double) * (size_t)(2 * nv + model->nq + 1));
  cav_status status = residual ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK && audit->wrap) {
    status = note_wrap(audit, &found->wrap);
  } else if (status == CAV_OK) {
    note_start(audit, &found->term);
  }
  note_duration(audit, &found->term);
  for (int t = 0; t <= audit->last && status == CAV_OK; t++) {
    const double *v = audit->v + t * nv;
    double *u = residual + nv;
    status = cav_inverse(model, audit->state, audit->q + t * model->nq, v, v + nv, u);
    if (status != CAV_OK) {
      fail(error, status, "inverse dynamics at knot %d: %s", t, cav_status_name(status));
      break;
    }
    // contacts may have come
    if (cav_demand_room(audit) > room) {
      free(work);
      room = cav_demand_room(audit);
      work = malloc(sizeof(double) * (size_t)room);
      if (!work) status = CAV_NO_MEMORY;
      if (!work) break;
    }
    note_ranges(audit, t, residual + 2 * nv, &found->limit);
    note_contacts(audit, t, found);
    if (t < audit->rows) {
      memcpy(audit->u + t * nv, u, sizeof(double) * nv);
      note_forces(audit, t, residual, found);
      cav_balance_add(balance, audit, t);
    }
    cav_demand_note(audit, t, work, &found->term);
  }
  cav_balance_result(balance, audit, &found->defect);
  free(residual);
  free(work);
  return status;
}

// what the model has and the claimed law leaves out, NULL if nothing
static const char *left_out(const cav_audit *audit) {
  const cav_options *own = &audit->model->options, *law = &audit->law;
  if (own->gravity && !law->gravity) return "gravity";
  if (own->constraint && !law->constraint) return "constraints";
  if (own->contact && !law->contact) return "contacts";
  if (own->passive && !law->passive) return "springs and dampers";
  if (law->self_share != 1) return "full contacts between links of one tree (self_share below 1)";
  return NULL;
}

double cav_verdict_replay(const cav_verdict *verdict) {
  return fmin(CAV_PROMISE_REPLAY, verdict->duration) * (1 - 1e-9);
}

// writes the reason unless there is one, when a finding breaks its limit
static void require(cav_verdict *verdict, const cav_finding *finding, double limit, const char *what,
                    const char *help) {
  if (finding->value <= limit || *verdict->reason) return;
  char knot[32] = "";
  if (finding->knot >= 0) snprintf(knot, sizeof knot, " at knot %d", finding->knot);
  snprintf(verdict->reason, sizeof verdict->reason, "%s %.3g (at most %g)%s: %s. %s", what, finding->value, limit, knot,
           finding->where, help);
}

// the promises in order
static void judge(const cav_audit *audit, const evidence *found, const cav_replay *replay, cav_verdict *verdict) {
  const char *missing = left_out(audit);
  if (missing) {
    snprintf(verdict->reason, sizeof verdict->reason, "the claimed contact law leaves out the model's %s", missing);
  }
  require(verdict, &found->unactuated, CAV_PROMISE_UNACTUATED, "unactuated force, share of weight,",
          "More iterations, a longer motion or a start nearer to balance usually help.");
  require(verdict, &found->limit, CAV_PROMISE_LIMIT, "limit exceeded by",
          "A longer motion or a lower effort_limit usually helps.");
  require(verdict, &found->term, CAV_PROMISE_CONSTRAINT, "constraint missed by",
          "Constraints may contradict each other or the limits.");
  require(verdict, &found->wrap, CAV_PROMISE_WRAP, "end of the cycle away from its start, m or rad,",
          "It was cut or resampled after it was solved: solve it again from there.");
  require(verdict, &found->penetration, CAV_PROMISE_PENETRATION, "penetration, m,",
          "A lower softness or smoothing at the end of the schedule usually helps.");
  require(verdict, &found->defect, CAV_PROMISE_MOMENTUM, "momentum defect, share of weight rms,",
          "The order momentum keeps it exactly; a smaller time step usually helps too.");
  const cav_finding slip = {verdict->slip_mean_m_s, -1, "mean over loaded contacts"};
  require(verdict, &slip, CAV_PROMISE_SLIP, "slip, m/s,",
          "A lower softness or smoothing at the end of the schedule, or a higher weight of slip, usually helps.");
  const cav_finding step = {replay->step_error, replay->step_knot, "forward step from the knot against the next knot"};
  require(verdict, &step, CAV_PROMISE_STEP, "replay error, rad or m,",
          "Forward and inverse dynamics disagree: please report it.");
  double least = cav_verdict_replay(verdict);
  if (replay->open_seconds < least && !*verdict->reason) {
    snprintf(verdict->reason, sizeof verdict->reason,
             "open loop at the same step leaves the knots by 1e-6 after %.3g s (at least %.3g s). "
             "A smaller tolerance of the solver usually helps.",
             replay->open_seconds, least);
  }
  if (*replay->closed.lost && !*verdict->reason) {
    snprintf(verdict->reason, sizeof verdict->reason,
             "closed loop at a tenth of the step ends after %.3g of %.3g s: %s. "
             "Stiffer gains, more slack in the effort limits or a slower motion usually help.",
             replay->closed.seconds, verdict->periods * verdict->duration, replay->closed.lost);
  }
  verdict->certified = !*verdict->reason;
}

// numbers into the verdict
static void fill(const cav_audit *audit, const evidence *found, const cav_replay *replay, cav_verdict *verdict) {
  verdict->unactuated_force_max = found->unactuated.value;
  verdict->unactuated_force_knot = found->unactuated.knot;
  verdict->momentum_defect_rms = found->defect.value;
  verdict->limit_violation_max = found->limit.value;
  verdict->constraint_violation_max = found->term.value;
  verdict->penetration_max_m = found->penetration.value;
  verdict->slip_mean_m_s = found->load > 0 ? found->slip / found->load : 0;
  verdict->replay_step_max_error = replay->step_error;
  verdict->replay_same_step_max_error = replay->open_error;
  verdict->replay_same_step_seconds = replay->open_seconds;
  verdict->closed_loop_seconds = replay->closed.seconds;
  verdict->closed_loop_end_error_m = replay->closed.error;
  verdict->own_contacts_seconds = replay->own.seconds;
  verdict->own_contacts_end_error_m = replay->own.error;
  verdict->wrap_error = found->wrap.value;
  verdict->periods = audit->periods;
  verdict->duration = audit->last * audit->h;
}

cav_status cav_verify(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                      const double *gain_q, const double *gain_v, cav_verdict *verdict, cav_error *error) {
  if (!verdict) return fail(error, CAV_BAD_INPUT, "verification needs a place for its verdict");
  verdict->certified = 0;
  snprintf(verdict->reason, sizeof verdict->reason, "not verified");
  cav_status status = admit(problem, trajectory, contact, gain_q, gain_v, error);
  if (status != CAV_OK) return status;
  cav_audit audit;
  evidence found = {0};
  cav_replay replay = {0};
  cav_balance *balance = NULL;
  if (error) *error = (cav_error){0};
  status = cav_drives_plannable(problem->model, error);
  if (status != CAV_OK) return status;
  cav_error refusal = {0};
  status = audit_start(&audit, problem, trajectory, contact, &refusal);
  if (refusal.status != CAV_OK && error) *error = refusal;
  if (status == CAV_OK) balance = cav_balance_new(&audit);
  if (status == CAV_OK && !balance) status = CAV_NO_MEMORY;
  if (status == CAV_OK) status = examine(&audit, balance, &found, error);
  if (status == CAV_OK) status = cav_replay_steps(&audit, &replay);
  if (status == CAV_OK) status = cav_replay_open(&audit, &replay);
  if (status == CAV_OK) status = cav_replay_closed(&audit, contact, gain_q, gain_v, &replay.closed);
  if (status == CAV_OK) status = cav_replay_closed(&audit, NULL, gain_q, gain_v, &replay.own);
  if (status == CAV_OK) {
    *verdict->reason = 0;
    fill(&audit, &found, &replay, verdict);
    judge(&audit, &found, &replay, verdict);
  }
  cav_balance_free(balance);
  audit_clear(&audit);
  if (status != CAV_OK && error && !*error->text) fail(error, status, "verification: %s", cav_status_name(status));
  return status;
}

cav_status cav_track(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                     const double *gain_q, const double *gain_v, struct cav_follow *claimed, struct cav_follow *own,
                     cav_error *error) {
  cav_audit audit;
  cav_status status = admit(problem, trajectory, contact, gain_q, gain_v, error);
  if (status != CAV_OK) return status;
  cav_error refusal = {0};
  status = audit_start(&audit, problem, trajectory, contact, &refusal);
  if (refusal.status != CAV_OK && error) *error = refusal;
  int nv = audit.model->nv;
  for (int t = 0; t < audit.rows && status == CAV_OK; t++) {
    const double *v = audit.v + t * nv;
    status = cav_inverse(audit.model, audit.state, audit.q + t * audit.model->nq, v, v + nv, audit.u + t * nv);
  }
  if (status == CAV_OK) status = cav_replay_closed(&audit, contact, gain_q, gain_v, claimed);
  if (status == CAV_OK) status = cav_replay_closed(&audit, NULL, gain_q, gain_v, own);
  audit_clear(&audit);
  return status;
}
