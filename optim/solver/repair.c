/// Strategies out of what another one missed: the first condition that its motion misses has usual cures, those that the
/// certificate names. One is laid over it at a time. What they change is not what was asked but how it is planned; it is
/// told with the result (cav_strategy.changed).
#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/solve.h"
#include "detour.h"
#include "schedule.h"
#include "upright.h"

/// What can be changed.
typedef enum cure {
  NONE,
  FORCE,     ///< contact forces cost something: loads are spread, and nothing stands on an edge
  GOALS,     ///< heavier weights of goals
  ANEW,      ///< the same, from where targets are met by inverse kinematics
  BIT,       ///< a bit heavier ones, as much as what is missed needs
  SLIP,      ///< a heavier weight of slip
  OFF,       ///< so much that what need not touch anything does not
  SELF,      ///< what leans on its own links pays
  SLIDING,   ///< the convex law of contacts that slide: it has one solution
  ORDER,     ///< the order of momentum
  GAP,       ///< contacts see the gap where a step ends
  STEP,      ///< half the step
  SOFTNESS,  ///< harder contacts at the end
  SMOOTHING, ///< contact forces that fade over a shorter way
  CLOSER,    ///< those between links of one tree
  SOFTER,    ///< softer ones, that bend over a longer way
  LOOSE,     ///< a lighter weight of slip
  EFFORT,    ///< half of the usual reserve of the actuators is given; less than that was asked for, and stays
  SLACK      ///< more of it is kept, for feedback
} cure;

enum { CURES = 3 };
static const double force_weight = 1, off_weight = 1e4, self_weight = 1000, heavier = 10, harder = 4, lighter = 0.04,
                    softer = 6, longer = 2, closer = 2, soft = 0.03, slack = 0.75;

/// Whether all that moves hangs on the world by actuated joints, as arms do, and no term asks for a touch: it leans
/// on things only because that saves effort.
static int only_hangs(const cav_problem *p) {
  const cav_model *m = p->model;
  for (int l = 1; l < m->nlink; l++) {
    if (m->link[l].root != l) continue;
    for (int j = m->link[l].joint; j < m->link[l].joint + m->link[l].njoint; j++)
      if (!cav_detour_moves(m, j)) return 0;
  }
  for (int i = 0; i < p->nterm; i++)
    if (p->term[i].quantity == CAV_QUANTITY_SENSOR && p->term[i].sensor.type == CAV_SENSOR_TOUCH) return 0;
  return 1;
}

/// Whether the problem itself has a term of the quantity.
static int is_stated(const cav_problem *p, cav_quantity quantity) {
  for (int i = 0; i < p->nterm; i++)
    if (p->term[i].quantity == quantity) return 1;
  return 0;
}

/// What a motion misses first, in the order of a certificate (METHOD.md, 6), most of momentum, slip and hover, and its
/// cures. Forces near a record are what is looked for: none of them costs anything. A residual beyond its bound is
/// what the model cannot do. What people do on the edges of their feet is nearer where these may slide, and on softer
/// ground.
static const cure *cures_of(const cav_problem *p, const cav_verdict *v) {
  static const cure forces[] = {EFFORT, STEP, NONE}, deep[] = {SOFTNESS, STEP, NONE}, between[] = {STEP, NONE},
                    turned[] = {ORDER, STEP, NONE}, slip[] = {SMOOTHING, SLIP, SOFTNESS},
                    rub[] = {SELF, SMOOTHING, SLIP}, limbs[] = {CLOSER, SELF, STEP}, hover[] = {GAP, SMOOTHING, STEP},
                    fold[] = {SLIDING, STEP, NONE}, lost[] = {FORCE, STEP, SLACK}, with_force[] = {SLACK, FORCE, STEP},
                    target[] = {EFFORT, ANEW, GOALS}, close[] = {BIT, EFFORT, GOALS}, fades[] = {SMOOTHING, GAP, STEP},
                    near[] = {STEP, SLACK, NONE}, again[] = {STEP, SLIDING, NONE}, off_slip[] = {OFF, SMOOTHING, SLIP},
                    off_hover[] = {OFF, GAP, SMOOTHING}, ground[] = {STEP, LOOSE, SOFTER}, none[] = {NONE},
                    finer[] = {STEP, SMOOTHING, NONE}, lower[] = {SMOOTHING, STEP, GAP};
  // what follows from its start is off by its steps, and hovers at rest by several of its smoothings (METHOD.md, 7)
  const int given = cav_problem_is_given(p);
  const cure *aims = v->achieved                                                ? none
                     : given                                                    ? finer
                     : v->missed_most > 0 && v->missed_most < CAV_MISSED_LITTLE ? close
                                                                                : target;
  if (v->certified) return aims;
  if (!cav_verdict_feasible(v)) return cav_problem_has_record(p) ? ground : forces;
  if (v->penetration_max_m > CAV_TOLERANCE_PENETRATION) return deep;
  if (v->penetration_between_m > CAV_TOLERANCE_PENETRATION) return between;
  // of these what is missed by most of its tolerance: what is missed by little is often met once that is mended
  double momentum = v->momentum_defect_rms / CAV_TOLERANCE_MOMENTUM, slide = v->slip_mean_m_s / CAV_TOLERANCE_SLIP,
         air = v->hover_fraction / CAV_TOLERANCE_HOVER;
  if (momentum > 1 && momentum >= fmax(slide, air)) return turned;
  // what is smoothed slides by a part of the smoothing in every step
  if (slide > 1 && slide >= air) return v->slip_self > 0.5 ? rub : only_hangs(p) ? off_slip : slip;
  // a stated smoothing beyond the usual one is what holds things off the ground
  int blurred = p->schedule.last.smoothing > cav_problem_default(p->model).schedule.last.smoothing;
  if (air > 1 && v->hover_self > 0.5) return limbs;
  if (air > 1 && !blurred && only_hangs(p)) return off_hover;
  if (air > 1) return given ? lower : blurred ? fades : hover;
  if (v->replay_step_max_error > CAV_TOLERANCE_STEP) return cav_problem_has_record(p) ? again : fold;
  if (v->residual_fraction_max > v->residual_within) return none;
  // left beside its targets, before gains were chosen
  if (!v->achieved && !v->has_gains) return aims;
  // where forces cost something feedback has too little left, rather than standing on edges
  return cav_problem_has_record(p) ? near : is_stated(p, CAV_QUANTITY_FORCE) ? with_force : lost;
}

// ---------------------------------------------------------------- changes

/// Gives a strategy terms of its own, those that it has with room for one more.
static cav_status own_terms(const cav_problem *p, cav_strategy *s) {
  int n = s->term ? s->nterm : p->nterm;
  cav_term *all = calloc((size_t)n + 1, sizeof *all);
  if (!all) return CAV_NO_MEMORY;
  if (n > 0) memcpy(all, s->term ? s->term : p->term, (size_t)n * sizeof *all);
  free(s->term);
  s->term = all;
  s->nterm = n;
  return CAV_OK;
}

static cav_status add_term(const cav_problem *p, cav_strategy *s, const cav_term *term) {
  cav_status status = own_terms(p, s);
  if (!status) s->term[s->nterm++] = *term;
  return status;
}

/// Costs that have to be met: at one time, held over a window, or within a tolerance.
static int is_goal(const cav_problem *p, const cav_term *term) {
  int contacts = cav_quantity_rule_of(term->quantity)->of == CAV_OF_CONTACTS;
  return !contacts && term->use == CAV_USE_COST && isfinite(cav_term_tolerance(p, term, 1));
}

/// Twice as many times its weight as a target that is missed by little is off over its tolerance: what a cost leaves of it
/// goes with one over its weight at most.
static double enough(const cav_verdict *v) { return ceil(10 * CAV_MISSED_LITTLE * v->missed_most) / 10; }

/// Weights those that are missed, or all where none is known to be, that many times.
static cav_status weigh_goals(const cav_problem *p, const cav_verdict *v, double times, cav_strategy *s) {
  cav_status status = own_terms(p, s);
  for (int i = 0; i < s->nterm && !status; i++) {
    int missed = v->missed_terms == 0 || (i < 64 && (v->missed_terms >> i & 1));
    if (missed && is_goal(p, &s->term[i])) s->term[i].weight *= times;
  }
  return status;
}

/// Whether a repair has added a term of the quantity already: more of it is another cure's work.
static int is_added(const cav_problem *p, const cav_strategy *s, cav_quantity quantity) {
  for (int i = p->nterm; i < s->nterm && s->term; i++)
    if (s->term[i].quantity == quantity) return 1;
  return 0;
}

/// A cost on forces of contacts with the world and other trees (FORCE), or between links of one tree (SELF_FORCE).
static cav_status weigh_forces(const cav_problem *p, cav_quantity quantity, double weight, cav_strategy *s) {
  if (is_added(p, s, quantity)) return CAV_OK;
  cav_term term = {.name = cav_quantity_rule_of(quantity)->name, .quantity = quantity, .use = CAV_USE_COST};
  term.component = -1, term.to = -1, term.weight = weight, term.scale = 1;
  return add_term(p, s, &term);
}

/// Beside the weight that is there.
static cav_status weigh_slip(const cav_problem *p, cav_strategy *s) {
  if (is_added(p, s, CAV_QUANTITY_SLIP)) return CAV_OK;
  for (int i = 0; i < p->nterm; i++) {
    cav_term more = p->term[i];
    if (more.quantity != CAV_QUANTITY_SLIP || !(more.weight > 0)) continue;
    more.weight *= heavier - 1;
    return add_term(p, s, &more);
  }
  return CAV_OK;
}

static cav_status loosen_slip(const cav_problem *p, cav_strategy *s) {
  cav_status status = own_terms(p, s);
  for (int i = 0; i < s->nterm && !status; i++)
    if (s->term[i].quantity == CAV_QUANTITY_SLIP) s->term[i].weight *= lighter;
  return status;
}

/// Whether a cure changes what the motion does, not what contacts obey.
static int is_of_motion(cure c) {
  return c == FORCE || c == OFF || c == SELF || c == GOALS || c == ANEW || c == BIT || c == SLIP || c == LOOSE ||
         c == EFFORT || c == SLACK;
}

static cav_status change(const cav_problem *p, const cav_verdict *v, cure c, cav_strategy *s) {
  // what follows from its start has the cures of the contact law left
  if (cav_problem_is_given(p) && is_of_motion(c)) return CAV_OK;
  double effort = s->effort_limit > 0 ? s->effort_limit : p->effort_limit;
  switch (c) {
    case FORCE:
      return weigh_forces(p, CAV_QUANTITY_FORCE, force_weight, s);
    case OFF:
      return weigh_forces(p, CAV_QUANTITY_FORCE, off_weight, s);
    case SELF:
      return weigh_forces(p, CAV_QUANTITY_SELF_FORCE, self_weight, s);
    case GOALS:
      return weigh_goals(p, v, heavier, s);
    case ANEW: // all of them, so that none gives way to the others
      if (s->schedule.kinematics) break;
      s->schedule.kinematics = 1;
      return weigh_goals(p, &(cav_verdict){.missed_terms = 0}, heavier, s);
    case BIT:
      return weigh_goals(p, v, enough(v), s);
    case SLIP:
      return weigh_slip(p, s);
    case SLIDING:
      s->schedule.sliding = CAV_SLIDING_CONVEX;
      break;
    case ORDER:
      s->order = CAV_ORDER_MOMENTUM;
      break;
    case GAP:
      s->schedule.next_gap = CAV_NEXT_GAP_EXACT;
      break;
    case STEP:
      if (s->timestep <= 0) s->timestep = p->timestep / 2;
      break;
    case SOFTNESS:
      s->schedule.last.softness /= harder;
      break;
    case SMOOTHING:
      s->schedule.last.smoothing /= harder;
      break;
    case CLOSER:
      s->schedule.last.smoothing_self /= closer;
      break;
    case LOOSE:
      return loosen_slip(p, s);
    case SOFTER:
      if (s->schedule.last.softness >= soft) break;
      s->schedule.last.softness *= softer;
      s->schedule.last.smoothing *= longer;
      break;
    case EFFORT: // what is missed within the limits with half of the reserve has another cause
      if (s->effort_limit > p->effort_limit && v->limit_violation_max <= CAV_TOLERANCE_LIMIT) break;
      if (effort >= cav_problem_default(p->model).effort_limit && effort < 0.99) s->effort_limit = (1 + effort) / 2;
      break;
    case SLACK:
      s->effort_limit = slack * effort;
      break;
    case NONE:
      break;
  }
  return CAV_OK;
}

/// What differs from the problem, as it would stand in its file.
static void describe(const cav_problem *p, cav_strategy *s) {
  char *out = s->changed;
  size_t room = sizeof s->changed;
  *out = 0;
  int goals = 0, heavy = 0, alike = 1;
  double all = 0;
  for (int i = 0; i < p->nterm && s->term; i++) {
    if (!is_goal(p, &p->term[i]) || !(p->term[i].weight > 0)) continue;
    const double times = s->term[i].weight / p->term[i].weight;
    goals++, heavy += s->term[i].weight != p->term[i].weight;
    alike &= goals == 1 || fabs(times - all) <= 1e-12 * all;
    all = times;
  }
  for (int i = 0; i < p->nterm && heavy; i++) {
    size_t n = strlen(out);
    double times = p->term[i].weight > 0 ? s->term[i].weight / p->term[i].weight : 1;
    if (!is_goal(p, &p->term[i]) || times == 1) continue;
    if (heavy == goals && alike) {
      snprintf(out, room, ", weights of goals %g times", times);
      break;
    }
    snprintf(out + n, room - n, ", weight of '%.40s' %g times", p->term[i].name ? p->term[i].name : "", times);
  }
  for (int i = 0; i < p->nterm && s->term; i++) {
    size_t n = strlen(out);
    if (!is_goal(p, &p->term[i]) && s->term[i].weight != p->term[i].weight)
      snprintf(out + n, room - n, ", <%s weight=\"%g\"/>", cav_quantity_rule_of(p->term[i].quantity)->name,
               s->term[i].weight);
  }
  for (int i = p->nterm; i < s->nterm; i++) {
    size_t n = strlen(out);
    if (s->term[i].quantity == CAV_QUANTITY_SENSOR)
      cav_upright_describe(p, &s->term[i], out + n, room - n);
    else
      snprintf(out + n, room - n, ", <%s weight=\"%g\"/>%s", cav_quantity_rule_of(s->term[i].quantity)->name,
               s->term[i].weight, is_stated(p, s->term[i].quantity) ? " beside the one that is there" : "");
  }
  const struct {
    int differs;
    const char *format;
    double value;
  } number[] = {{s->effort_limit > 0, ", <limits effort=\"%.3g\"/>", s->effort_limit},
                {s->timestep > 0, ", timestep=\"%.4g\"", s->timestep},
                {s->schedule.last.softness != p->schedule.last.softness, ", <last softness=\"%.3g\"/>",
                 s->schedule.last.softness},
                {s->schedule.last.smoothing != p->schedule.last.smoothing, ", <last smoothing=\"%.3g\"/>",
                 s->schedule.last.smoothing},
                {s->schedule.last.smoothing_self != p->schedule.last.smoothing_self,
                 ", <last smoothing_self=\"%.3g\"/>", s->schedule.last.smoothing_self}};
  for (size_t i = 0; i < sizeof number / sizeof *number; i++) {
    size_t n = strlen(out);
    if (number[i].differs) snprintf(out + n, room - n, number[i].format, number[i].value);
  }
  size_t n = strlen(out);
  snprintf(out + n, room - n, "%s%s%s%s%s", s->order != p->order ? ", order=\"momentum\"" : "",
           s->schedule.sliding != p->schedule.sliding ? ", sliding=\"convex\"" : "",
           s->schedule.next_gap != p->schedule.next_gap ? ", next_gap=\"exact\"" : "",
           s->schedule.solids != p->schedule.solids ? ", solids=\"grow\"" : "",
           s->schedule.kinematics != p->schedule.kinematics ? ", kinematics=\"true\"" : "");
  if (*out) memmove(out, out + 2, strlen(out + 2) + 1);
}

cav_status cav_strategy_repair(const cav_problem *problem, const cav_strategy *from, const cav_verdict *verdict, int k,
                               cav_strategy *repaired, int *found) {
  const cure *cures = cures_of(problem, verdict);
  int n = 0;
  *found = 0;
  while (n < CURES && cures[n] != NONE) n++;
  if (k >= n) return CAV_OK;
  *repaired = *from;
  repaired->use = CAV_STRATEGY_REPAIR;
  repaired->term = NULL;
  repaired->nterm = 0;
  cav_status status = CAV_OK;
  if (from->term) {
    cav_problem with = *problem;
    with.term = from->term, with.nterm = from->nterm;
    status = own_terms(&with, repaired);
  }
  if (!status) status = change(problem, verdict, cures[k], repaired);
  if (status) {
    cav_strategy_clear(repaired);
    return status;
  }
  describe(problem, repaired);
  *found = 1;
  return CAV_OK;
}

void cav_strategy_clear(cav_strategy *strategy) {
  free(strategy->term);
  strategy->term = NULL;
  strategy->nterm = 0;
}

void cav_strategies_clear(cav_strategy *strategy, int n) {
  for (int i = 0; i < n; i++) cav_strategy_clear(&strategy[i]);
}
