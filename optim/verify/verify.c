/// Certifies a motion from its knots alone, with code apart from the optimiser's: velocities, forces and contacts are
/// recomputed from q; what a certificate requires is measured, and the first tolerance that is broken is named with its
/// knot, body and size. METHOD.md, 6. What is admitted: verification.c; momentum: momentum_balance.c; hard terms:
/// constraint_check.c; depths, between knots too: penetration.c; forward simulation: replay.c, closed_loop.c. It does not
/// decide on the cost.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "verification.h"

/// What was found at the knots.
typedef struct metrics {
  cav_metric unactuated, mirrored, limit, term, penetration, between, defect, periodicity, hover;
  double hover_self; // fraction of hover between links of one tree
  cav_slip slip;
  cav_rates rates;
  cav_residual_sum residual;
  double stop; ///< largest part of its stop that a joint takes; below 0: none has one
} metrics;

static const char *joint_name(const cav_model *model, int joint, char buffer[32]) {
  if (*model->joint[joint].name) return model->joint[joint].name;
  static const char *const type[] = {[CAV_JOINT_FREE] = "free joint",
                                     [CAV_JOINT_BALL] = "ball joint",
                                     [CAV_JOINT_SLIDE] = "slide",
                                     [CAV_JOINT_HINGE] = "hinge"};
  snprintf(buffer, 32, "%s %d", type[model->joint[joint].type], joint);
  return buffer;
}

// the motion begins where the problem says
static void note_start(const cav_verification *verification, cav_metric *metric) {
  const cav_model *model = verification->model;
  double *away = verification->u; // not yet filled
  char name[32];
  cav_difference(model, verification->problem->q_start, verification->q, 1, away);
  for (int d = 0; d < model->nv; d++) {
    cav_metric_note(metric, fabs(away[d]), 0, "start, %s, away from the problem's start",
                    joint_name(model, model->dof[d].joint, name));
  }
}

// the duration is one that the problem allows
static void note_duration(const cav_verification *verification, cav_metric *metric) {
  const cav_problem *p = verification->problem;
  double duration = verification->last * verification->h, least = p->duration, most = p->duration;
  if (p->duration_most > 0) least = p->duration_least, most = p->duration_most;
  double beyond = fmax(least - duration, duration - most) / p->duration;
  cav_metric_note(metric, beyond, verification->last, "duration, %.6g s of %.6g .. %.6g s", duration, least, most);
}

// the end of a cycle is its start moved: by coordinates, by the step that follows it, and by where the links are
static cav_status note_periodicity(const cav_verification *verification, cav_metric *metric) {
  const cav_model *model = verification->model;
  const cav_state *bare = verification->bare;
  int nq = model->nq, nv = model->nv;
  size_t nlink = (size_t)model->nlink, numbers = 2 * (size_t)nq + 2 * (size_t)nv + 3 * nlink;
  const double *last = verification->q + (size_t)verification->last * nq;
  double *q = malloc(sizeof(double) * numbers), *next = q + nq, *off = next + nq, *step = off + nv, *com = step + nv;
  cav_pose *pose = malloc(nlink * sizeof *pose);
  cav_status status = q && pose ? cav_position(model, verification->bare, verification->q) : CAV_NO_MEMORY;
  char name[32];
  if (status == CAV_OK) {
    cav_cycle_image_configuration(verification->image, verification->q, q);
    cav_difference(model, q, last, 1, off);
    for (int d = 0; d < nv; d++)
      cav_metric_note(metric, fabs(off[d]), verification->last, "%s", joint_name(model, model->dof[d].joint, name));
    cav_cycle_image_configuration(verification->image, verification->q + nq, next);
    cav_difference(model, q, next, 1, off);
    cav_cycle_image_tangent(verification->image, 1, verification->v + nv, step);
    for (int d = 0; d < nv; d++)
      cav_metric_note(metric, fabs(off[d] - verification->h * step[d]), 1, "step of %s",
                      joint_name(model, model->dof[d].joint, name));
    memcpy(com, bare->com, sizeof(double) * 3 * nlink);
    memcpy(pose, bare->link, sizeof *pose * nlink);
    status = cav_position(model, verification->bare, last);
  }
  for (int l = 1; l < model->nlink && status == CAV_OK; l++)
    cav_metric_note(metric, cav_cycle_image_error(verification->image, l, pose, com, bare), verification->last, "%s",
                    cav_verification_link_name(model, l, name));
  free(pose);
  free(q);
  return status;
}

// what no actuator gives of u, and what actuators are asked for beyond their limits; work [nv]
static void note_forces(const cav_verification *verification, int t, const double *v, const double *u, double *control,
                        double *work, const char *suffix, metrics *found) {
  const cav_model *model = verification->model;
  char name[32], link[32];
  cav_actuation(model, verification->state, u, work, control);
  for (int d = 0; d < model->nv; d++) {
    const cav_joint *joint = model->joint + model->dof[d].joint;
    if (verification->deviation[d] > 0) continue;
    int line = cav_verification_is_line(model, d);
    double fraction = fabs(work[d]) / (verification->weight * (line ? 1 : verification->arm));
    cav_metric_note(&found->unactuated, fraction, t, "%.60s of %.60s, dof %d: %.4g %s%s",
                    joint_name(model, model->dof[d].joint, name), cav_verification_link_name(model, joint->link, link),
                    d, work[d], line ? "N" : "N m", suffix);
  }
  for (int a = 0; a < model->nu; a++)
    cav_verification_effort(verification, t, a, control[a], v, work, suffix, &found->limit);
}

// ranges of joints at q; of those that no actuator works on, what their stops take is no violation
static void note_joints(const cav_verification *verification, int t, const double *q, const char *suffix,
                        metrics *found) {
  const cav_model *model = verification->model;
  char name[32];
  for (int j = 0; j < model->njoint; j++) {
    const cav_joint *joint = model->joint + j;
    if (!joint->limited || joint->type == CAV_JOINT_FREE) continue;
    const double *x = q + joint->q;
    double beyond = fmax(joint->range[0] - *x, *x - joint->range[1]);
    if (joint->type == CAV_JOINT_BALL) {
      beyond = 2 * atan2(sqrt(x[1] * x[1] + x[2] * x[2] + x[3] * x[3]), fabs(x[0])) - joint->range[1];
    }
    const double stop = cav_joint_stop(joint);
    if (stop > 0) found->stop = fmax(found->stop, fmax(beyond, 0) / stop);
    cav_metric_note(&found->limit, beyond - stop, t,
                    stop > 0 ? "stop of %.60s, in rad or m%s" : "range of %.60s, in rad or m%s",
                    joint_name(model, j, name), suffix);
  }
}

// joint and tendon ranges; the state is at q
static void note_ranges(const cav_verification *verification, int t, const double *q, const char *suffix,
                        metrics *found) {
  const cav_model *model = verification->model;
  char name[32];
  note_joints(verification, t, q, suffix, found);
  // twist and swing of ball joints are rows where they are violated
  for (int i = 0; i < verification->state->nrow; i++) {
    const cav_row *row = verification->state->row + i;
    if (row->type != CAV_ROW_LIMIT_JOINT || row->side < 2) continue;
    cav_metric_note(&found->limit, -row->dist - cav_joint_stop(&model->joint[row->object]), t, "%s of %.60s, in rad%s",
                    row->side < 4 ? "twist" : "swing", joint_name(model, row->object, name), suffix);
  }
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *tendon = model->tendon + i;
    if (!tendon->limited) continue;
    double length = verification->state->tendon_length[i];
    double beyond = fmax(tendon->range[0] - length, length - tendon->range[1]);
    cav_metric_note(&found->limit, beyond, t, "range of tendon %.60s (%d)%s", tendon->name, i, suffix);
  }
}

// what is required of knot t of a cycle one period on too, where the model or the ground may not be the same; work
// [nq+4*nv+nu]
static cav_status examine_image(const cav_verification *verification, int t, double *work, metrics *found) {
  static const char *const suffix = ", one period on";
  const cav_model *model = verification->model;
  size_t nv = (size_t)model->nv;
  double *q = work, *v = q + model->nq, *next = v + nv, *u = next + nv, *scratch = u + nv, *control = scratch + nv;
  const double *knot_v = verification->v + (size_t)t * nv;
  cav_cycle_image_configuration(verification->image, verification->q + (size_t)t * model->nq, q);
  cav_cycle_image_tangent(verification->image, 1, knot_v, v);
  cav_cycle_image_tangent(verification->image, 1, knot_v + nv, next);
  cav_status status = cav_inverse(model, verification->state, q, v, next, u);
  if (status != CAV_OK) return status;
  note_ranges(verification, t, q, suffix, found);
  cav_verification_penetration(verification, t, suffix, &found->penetration);
  if (t >= verification->rows) return CAV_OK;
  metrics apart = {.unactuated = found->mirrored, .limit = found->mirrored};
  const int uneven = cav_cycle_image_is_uneven(verification->image);
  note_forces(verification, t, v, u, control, scratch, suffix, uneven ? &apart : found);
  if (uneven) found->mirrored = apart.unactuated.value > apart.limit.value ? apart.unactuated : apart.limit;
  return CAV_OK;
}

// inverse dynamics at knot t, and what is measured there but terms; the state is left at the knot
static cav_status examine_knot(cav_verification *verification, int t, cav_balance *balance, double *work,
                               metrics *found) {
  const cav_model *model = verification->model;
  size_t nv = (size_t)model->nv, knot = (size_t)t;
  const double *q = verification->q + knot * model->nq, *v = verification->v + knot * nv;
  if (verification->image) {
    cav_status status = examine_image(verification, t, work, found);
    if (status != CAV_OK) return status;
  }
  verification->state->options = cav_verification_law(verification, t);
  cav_status status = cav_inverse(model, verification->state, q, v, v + nv, work);
  if (status != CAV_OK) return status;
  note_ranges(verification, t, q, "", found);
  cav_verification_penetration(verification, t, "", &found->penetration);
  if (t >= verification->rows) cav_rates_add(verification, t, work + nv, &found->rates);
  if (t >= verification->rows) return CAV_OK;
  memcpy(verification->u + knot * nv, work, sizeof(double) * nv);
  status = cav_slip_add(verification, t, work + nv, &found->slip);
  if (status != CAV_OK) return status;
  note_forces(verification, t, v, work, verification->control + knot * model->nu, work + nv, "", found);
  cav_residual_add(verification, t, work + nv, &found->residual);
  cav_balance_add(balance, verification, t, work + nv);
  cav_rates_add(verification, t, work + nv, &found->rates);
  return CAV_OK;
}

// knot by knot, and all that is measured there
static cav_status examine(cav_verification *verification, cav_balance *balance, metrics *found, cav_term_report *report,
                          cav_error *error) {
  const cav_model *model = verification->model;
  int room = 0;
  double *terms = NULL, *work = malloc(sizeof(double) * (size_t)(model->nq + 4 * model->nv + model->nu + 1));
  cav_hover *hover = cav_hover_new();
  cav_status status = work && hover ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK && verification->image) {
    status = note_periodicity(verification, &found->periodicity);
  } else if (status == CAV_OK && !verification->problem->free_start) {
    note_start(verification, &found->term);
  }
  note_duration(verification, &found->term);
  for (int t = 0; t <= verification->last && status == CAV_OK; t++) {
    status = examine_knot(verification, t, balance, work, found);
    if (status != CAV_OK) {
      cav_verification_fail(error, status, "inverse dynamics at knot %d: %s", t, cav_status_name(status));
      break;
    }
    status = cav_hover_add(hover, verification, t);
    if (status != CAV_OK) break;
    // contacts may have come
    if (cav_constraint_check_room(verification) > room) {
      free(terms);
      room = cav_constraint_check_room(verification);
      terms = malloc(sizeof(double) * (size_t)room);
      if (!terms) status = CAV_NO_MEMORY;
      if (!terms) break;
    }
    cav_constraint_check(verification, t, terms, &found->term);
    cav_targets_note(verification, t, terms, report);
    if ((status = verification->failure->status) != CAV_OK && error) *error = *verification->failure;
  }
  cav_balance_result(balance, verification, &found->defect);
  if (hover) cav_hover_result(hover, verification, &found->hover, &found->hover_self);
  cav_hover_free(hover);
  free(work);
  free(terms);
  return status;
}

// what the model has and the claimed law leaves out, NULL if nothing
static const char *left_out(const cav_verification *verification) {
  const cav_options *own = &verification->model->options, *law = &verification->law;
  if (own->gravity && !law->gravity) return "gravity";
  if (own->constraint && !law->constraint) return "constraints";
  if (own->contact && !law->contact) return "contacts";
  if (own->passive && !law->passive) return "springs and dampers";
  if (law->self_stiffness != 1) return "full contacts between links of one tree (self_stiffness below 1)";
  return NULL;
}

double cav_verdict_replay(const cav_verdict *verdict) {
  return fmin(CAV_TOLERANCE_REPLAY, verdict->duration) * (1 - 1e-9);
}

int cav_verdict_feasible(const cav_verdict *verdict) {
  return verdict->unactuated_force_max <= CAV_TOLERANCE_UNACTUATED &&
         verdict->limit_violation_max <= CAV_TOLERANCE_LIMIT &&
         verdict->constraint_violation_max <= CAV_TOLERANCE_CONSTRAINT;
}

int cav_verdict_optimal(const cav_verdict *verdict) {
  return cav_verdict_feasible(verdict) && verdict->optimality <= CAV_TOLERANCE_OPTIMAL;
}

// writes the reason unless there is one, when a metric breaks its limit
static void require(cav_verdict *verdict, const cav_metric *metric, double limit, const char *what, const char *help) {
  if (metric->value <= limit || *verdict->reason) return;
  char knot[32] = "";
  if (metric->knot >= 0) snprintf(knot, sizeof knot, " at knot %d", metric->knot);
  snprintf(verdict->reason, sizeof verdict->reason, "%s %.3g (at most %g)%s: %s. %s", what, metric->value, limit, knot,
           metric->where, help);
}

/// Unactuated force, fraction of the weight, from which on a motion is not nearly one.
static const double astray = 0.5;

// the conditions in order
static void decide(const cav_verification *verification, const metrics *found, const cav_replay *replay,
                   cav_verdict *verdict) {
  const char *missing = left_out(verification);
  if (missing) {
    snprintf(verdict->reason, sizeof verdict->reason, "the claimed contact law leaves out the model's %s", missing);
  }
  require(verdict, &found->unactuated, CAV_TOLERANCE_UNACTUATED, "unactuated force, fraction of weight,",
          found->unactuated.value > astray
              ? "The solve went astray, and what its forces are means little: <waypoint>s on the way, or parts of it "
                "one by "
                "one, usually help."
              : "More iterations, a longer motion or a start nearer to balance usually help.");
  require(verdict, &found->mirrored, CAV_TOLERANCE_MIRRORED,
          "unactuated force in the mirrored half stride, fraction of weight, or of a limit beyond it,",
          "The model is not enough its own mirror image: a whole stride, without mirror, needs no such image.");
  if (!isnan(verdict->residual_within))
    require(verdict, &found->residual.worst, verdict->residual_within, "residual force on a root, fraction of weight,",
            "A lower 'force' or 'torque' of <residual> makes it more expensive; 'within' says how much is allowed.");
  require(verdict, &found->limit, CAV_TOLERANCE_LIMIT, "limit exceeded by",
          "A longer motion, or less to do in it, usually helps.");
  require(verdict, &found->term, CAV_TOLERANCE_CONSTRAINT, "constraint missed by",
          "Constraints may contradict each other or the limits.");
  require(verdict, &found->periodicity, CAV_TOLERANCE_PERIODICITY, "end of the cycle away from its start, m or rad,",
          "It was cut or resampled after it was solved: solve it again from there.");
  require(verdict, &found->penetration, CAV_TOLERANCE_PENETRATION, "penetration, m,",
          "A lower softness or smoothing at the end of the schedule usually helps.");
  require(verdict, &found->between, CAV_TOLERANCE_PENETRATION, "penetration between knots, m,",
          "A smaller time step, or a way around, usually helps.");
  require(verdict, &found->defect, CAV_TOLERANCE_MOMENTUM, "momentum defect, fraction of weight rms,",
          "The order momentum keeps it exactly; a smaller time step usually helps too.");
  cav_metric slip = found->slip.most;
  slip.value = verdict->slip_mean_m_s;
  require(verdict, &slip, CAV_TOLERANCE_SLIP, "slip, m/s,",
          "A lower softness or smoothing at the end of the schedule, or a higher weight of slip, usually helps; "
          "what is meant to slide is said by <slip body=\"NAME\" weight=\"0\" within=\"SPEED\"/>.");
  require(
      verdict, &found->hover, CAV_TOLERANCE_HOVER, "contact force across gaps that stay open, fraction of all,",
      found->hover_self > 0.5
          ? "Links of one tree lean on each other: a lower smoothing_self at the end of the schedule, or <self_force "
            "weight='1000'/>, usually helps."
          : "Coulomb's law and the exact gap (sliding=\"coulomb\" next_gap=\"exact\" in <schedule>), or a lower "
            "smoothing "
            "at its end usually helps.");
  const cav_metric step = {replay->step_error, replay->step_knot, "forward step from the knot against the next knot"};
  require(verdict, &step, CAV_TOLERANCE_STEP, "replay error, rad or m,",
          verification->law.sliding == CAV_SLIDING_COULOMB
              ? "A step of Coulomb's law may have another solution than the planned one; the convex law has one only "
                "(sliding='convex' in <schedule>)."
              : "Forward and inverse dynamics disagree: please report it.");
  double least = cav_verdict_replay(verdict);
  if (replay->open_seconds < least && !*verdict->reason) {
    snprintf(verdict->reason, sizeof verdict->reason,
             "open loop at the same step leaves the knots by 1e-6 after %.3g s (at least %.3g s). "
             "A smaller tolerance of the solver usually helps.",
             replay->open_seconds, least);
  }
  if (*replay->closed.lost && !*verdict->reason && !verdict->has_gains && *verdict->missed) {
    snprintf(verdict->reason, sizeof verdict->reason, "left without gains beside a target: %s", verdict->missed);
  }
  if (*replay->closed.lost && !*verdict->reason) {
    snprintf(verdict->reason, sizeof verdict->reason,
             "closed loop at a tenth of the step ends after %.3g of %.3g s: %s. "
             "Stiffer gains, more slack in the effort limits or a slower motion usually help.",
             replay->closed.seconds, verdict->periods * verdict->duration, replay->closed.lost);
  }
  if (*replay->own.lost && !*verdict->reason) {
    snprintf(verdict->reason, sizeof verdict->reason,
             "closed loop under the contacts of the model's file ends after %.3g of %.3g s: %s. "
             "Stiffer gains, a lower softness or a slower motion usually help.",
             replay->own.seconds, verdict->periods * verdict->duration, replay->own.lost);
  }
  verdict->certified = !*verdict->reason;
}

// numbers into the verdict
static void fill(const cav_verification *verification, const metrics *found, const cav_replay *replay,
                 cav_verdict *verdict) {
  verdict->unactuated_force_max = found->unactuated.value;
  verdict->unactuated_force_knot = found->unactuated.knot;
  verdict->momentum_defect_rms = found->defect.value;
  cav_residual_tell(verification, &found->residual, verdict);
  verdict->limit_violation_max = found->limit.value;
  verdict->stop_fraction_max = found->stop < 0 ? NAN : found->stop;
  verdict->constraint_violation_max = found->term.value;
  verdict->penetration_max_m = found->penetration.value;
  verdict->penetration_between_m = found->between.value;
  verdict->slip_mean_m_s = found->slip.load > 0 ? found->slip.slides / found->slip.load : 0;
  verdict->slip_step_mean_m_s = found->slip.load > 0 ? found->slip.carried / found->slip.load : 0;
  verdict->slip_self = found->slip.slides > 0 ? found->slip.own / found->slip.slides : 0;
  verdict->hover_fraction = found->hover.value;
  verdict->hover_self = found->hover_self;
  verdict->power_max_w = found->rates.power;
  verdict->joint_speed_max_rad_s = found->rates.speed;
  verdict->slide_speed_max_m_s = found->rates.slide_speed < 0 ? NAN : found->rates.slide_speed;
  verdict->joint_speed_over_limit = found->rates.over_limit < 0 ? NAN : found->rates.over_limit;
  verdict->replay_step_max_error = replay->step_error;
  verdict->replay_same_step_max_error = replay->open_error;
  verdict->replay_same_step_seconds = replay->open_seconds;
  verdict->closed_loop_seconds = replay->closed.seconds;
  verdict->closed_loop_end_error_m = replay->closed.error;
  verdict->feedback_effort_max = fmax(replay->closed.asked, replay->own.asked);
  verdict->model_contacts_seconds = replay->own.seconds;
  verdict->model_contacts_end_error_m = replay->own.error;
  verdict->periodicity_error = found->periodicity.value;
  verdict->mirrored_force_max = NAN;
  if (verification->image && cav_cycle_image_is_uneven(verification->image))
    verdict->mirrored_force_max = found->mirrored.value;
  verdict->periods = verification->periods;
  verdict->duration = verification->last * verification->h;
}

/// Whether a verification simulates the motion as well.
enum { KNOTS_ALONE, SIMULATED };

static cav_status simulate(cav_verification *verification, const cav_followed *followed, const double *gain_q,
                           const double *gain_v, cav_replay *replay) {
  cav_status status = cav_replay_steps(verification, replay);
  if (status == CAV_OK) status = cav_replay_open(verification, replay);
  return status == CAV_OK ? cav_closed_loops_certify(verification, followed, gain_q, gain_v, replay) : status;
}

static cav_status verify(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                         const double *gain_q, const double *gain_v, const cav_followed *followed, int simulated,
                         cav_verdict *verdict, cav_error *error) {
  if (!verdict) return cav_verification_fail(error, CAV_BAD_INPUT, "verification needs a place for its verdict");
  verdict->certified = verdict->achieved = 0;
  snprintf(verdict->reason, sizeof verdict->reason, "not verified");
  cav_verification verification;
  metrics found = {.rates = {.over_limit = -1, .slide_speed = -1}, .stop = -1};
  cav_replay replay = {0};
  cav_balance *balance = NULL;
  cav_status status = cav_verification_begin(&verification, problem, trajectory, contact, gain_q, gain_v, error);
  if (status == CAV_OK) status = cav_verification_actuators(problem->model, error);
  if (status == CAV_OK) balance = cav_balance_new(&verification);
  if (status == CAV_OK && !balance) status = CAV_NO_MEMORY;
  cav_term_report *report = status == CAV_OK ? calloc((size_t)problem->nterm + 1, sizeof *report) : NULL;
  if (status == CAV_OK && !report) status = CAV_NO_MEMORY;
  if (status == CAV_OK) status = examine(&verification, balance, &found, report, error);
  if (status == CAV_OK) status = cav_verification_between(&verification, &found.between);
  if (status == CAV_OK && simulated) status = simulate(&verification, followed, gain_q, gain_v, &replay);
  if (status == CAV_OK) {
    if (simulated) *verdict->reason = 0;
    fill(&verification, &found, &replay, verdict);
    verdict->has_gains = gain_q != NULL;
    cav_targets_verdict(&verification, report, found.residual.cost, verdict);
    if (simulated) decide(&verification, &found, &replay, verdict);
    status = cav_verification_ending(&verification, verdict);
  }
  verdict->push_survived_n_s = NAN;
  if (status == CAV_OK && verdict->certified)
    status = cav_closed_loops_push(&verification, gain_q, gain_v, &verdict->push_survived_n_s);
  free(report);
  cav_balance_free(balance);
  cav_verification_end(&verification);
  if (status != CAV_OK && error && !*error->text)
    cav_verification_fail(error, status, "verification: %s", cav_status_name(status));
  return status;
}

cav_status cav_verify_knots(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                            cav_verdict *verdict, cav_error *error) {
  return verify(problem, trajectory, contact, NULL, NULL, NULL, KNOTS_ALONE, verdict, error);
}

cav_status cav_verify(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                      const double *gain_q, const double *gain_v, cav_verdict *verdict, cav_error *error) {
  return verify(problem, trajectory, contact, gain_q, gain_v, NULL, SIMULATED, verdict, error);
}

cav_status cav_verify_solution(const cav_problem *problem, const cav_solution *solution, cav_verdict *verdict,
                               cav_error *error) {
  if (!solution) return cav_verification_fail(error, CAV_BAD_INPUT, "there is no solution to verify");
  return verify(problem, solution->trajectory, &solution->contact, solution->gain_q, solution->gain_v,
                solution->followed, SIMULATED, verdict, error);
}

cav_status cav_terms_report(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                            cav_term_report *report, double *cost, cav_error *error) {
  cav_verification verification;
  metrics found = {.rates = {.over_limit = -1, .slide_speed = -1}, .stop = -1};
  cav_verdict verdict = {0};
  cav_status status = cav_verification_begin(&verification, problem, trajectory, contact, NULL, NULL, error);
  cav_balance *balance = status == CAV_OK ? cav_balance_new(&verification) : NULL;
  if (status == CAV_OK && !balance) status = CAV_NO_MEMORY;
  if (status == CAV_OK) memset(report, 0, (size_t)problem->nterm * sizeof *report);
  if (status == CAV_OK) status = examine(&verification, balance, &found, report, error);
  if (status == CAV_OK) cav_targets_verdict(&verification, report, found.residual.cost, &verdict);
  if (cost) *cost = verdict.cost;
  cav_balance_free(balance);
  cav_verification_end(&verification);
  return status;
}

// inverse dynamics and efforts at knot t, with room for the values of terms in *work, which has *room numbers
static cav_status stand_at(cav_verification *verification, int t, double **work, int *room) {
  const cav_model *model = verification->model;
  size_t nv = (size_t)model->nv, knot = (size_t)t;
  const double *v = verification->v + knot * nv;
  double *u = verification->u + knot * nv;
  verification->state->options = cav_verification_law(verification, t);
  cav_status status = cav_inverse(model, verification->state, verification->q + knot * (size_t)model->nq, v, v + nv, u);
  if (status != CAV_OK) return status;
  cav_actuation(model, verification->state, u, NULL, verification->control + knot * (size_t)model->nu);
  if (cav_constraint_check_room(verification) <= *room) return CAV_OK;
  free(*work);
  *room = cav_constraint_check_room(verification);
  *work = malloc(sizeof(double) * (size_t)*room);
  return *work ? CAV_OK : CAV_NO_MEMORY;
}

cav_status cav_term_values(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                           int term, int most, cav_term_value *value, int *n, cav_error *error) {
  cav_verification verification;
  double *work = NULL;
  int room = 0;
  *n = 0;
  cav_status status = cav_verification_begin(&verification, problem, trajectory, contact, NULL, NULL, error);
  if (status == CAV_OK && (term < 0 || term >= problem->nterm))
    status = cav_verification_fail(error, CAV_BAD_INPUT, "the problem has %d terms, none of number %d", problem->nterm,
                                   term);
  for (int t = 0; status == CAV_OK && t <= verification.last; t++) {
    status = stand_at(&verification, t, &work, &room);
    if (status != CAV_OK) cav_verification_fail(error, status, "knot %d: %s", t, cav_status_name(status));
    if (status == CAV_OK) cav_targets_list(&verification, &problem->term[term], t, work, most, value, n);
    if (status == CAV_OK && (status = verification.failure->status) != CAV_OK && error) *error = *verification.failure;
  }
  free(work);
  cav_verification_end(&verification);
  return status;
}

cav_status cav_track_residuals(const cav_problem *problem, const cav_trajectory *trajectory, const cav_options *contact,
                               int term, cav_channel_residual *residual, cav_error *error) {
  cav_verification verification;
  double *work = NULL;
  int room = 0;
  cav_status status = cav_verification_begin(&verification, problem, trajectory, contact, NULL, NULL, error);
  if (status == CAV_OK && (term < 0 || term >= problem->nterm || !problem->term[term].track))
    status = cav_verification_fail(error, CAV_BAD_INPUT, "the problem has %d terms, no record of number %d",
                                   problem->nterm, term);
  const cav_track *track = status == CAV_OK ? problem->term[term].track : NULL;
  if (track) cav_records_begin(problem->model, track, residual);
  for (int t = 0; status == CAV_OK && t <= verification.last; t++) {
    status = stand_at(&verification, t, &work, &room);
    if (status == CAV_OK)
      cav_records_note(&verification, &problem->term[term], t, residual);
    else
      cav_verification_fail(error, status, "knot %d: %s", t, cav_status_name(status));
  }
  for (int i = 0; track && i < track->nchannel; i++) {
    cav_channel_residual *r = &residual[i];
    r->rms = r->seen ? sqrt(r->rms / r->seen) : NAN;
    if (!r->seen) r->worst = NAN;
  }
  free(work);
  cav_verification_end(&verification);
  return status;
}
