/// Why a motion that is certified does not do what was asked, where no limit and no proof says it: how much of the way to
/// the target it goes, against a motion that holds the start. One that goes none of it stays at the optimum next to its
/// guess; one that goes most of it trades the rest against other costs.
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/result.h"
#include "command.h"
#include "role.h"
#include "schedule.h"
#include "summary.h"

static const double idle = 1e-4; // part of its limit below which an actuator does nothing
static const double still = 0.2; // part of the way up to which a motion stays where it starts

/// The term that is missed by the most tolerances; -1: none.
static int worst_of(const cav_problem *p, const cav_term_report *report) {
  int worst = -1;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term_report *r = &report[i];
    if (!r->has_target || r->met || !(r->within > 0)) continue;
    if (worst < 0 || r->off / r->within > report[worst].off / report[worst].within) worst = i;
  }
  return worst;
}

/// A guess that goes there, as it would stand in the file: an arc where that is what strategies would try.
static void suggest(const cav_problem *p, char *text, size_t size) {
  cav_strategy strategy[CAV_STRATEGIES];
  int n = 0;
  const cav_status status = cav_strategy_list(p, strategy, &n);
  snprintf(text, size, "postures on the way to it (<waypoint> in <guess>) lead elsewhere");
  for (int i = 0; i < n && !status; i++)
    if (strategy[i].height > 0)
      snprintf(text, size, "<guess apex=\"%.3g\" from=\"%.3g\" to=\"%.3g\"/> leads elsewhere", strategy[i].height,
               strategy[i].from, strategy[i].to);
  cav_strategies_clear(strategy, n);
}

/// How far a motion is from the ends of what actuators and joints can do, where no multiplier speaks of a limit.
static void tell_room(const cav_problem *p, const cav_trajectory *motion, char *text, size_t size) {
  char words[CAV_WORDS];
  const cav_model *m = p->model;
  cav_error ignored = {0};
  cav_forces *forces = cav_forces_new(m, motion, &p->contact, p->close_at_rest, &ignored);
  double most = 0, near = INFINITY;
  int at = 0, of = -1, joint = -1;
  for (int i = 0; forces && i < forces->nknot * m->nu; i++) {
    double range[2], effort = forces->control[i];
    cav_actuator_effort_range(m, i % m->nu, range);
    double part = effort > 0 ? effort / range[1] : effort / range[0];
    if (isfinite(part) && part > most) most = part, of = i % m->nu, at = i / m->nu;
  }
  for (int i = 0; i < motion->nknot * m->njoint; i++) {
    const cav_joint *j = &m->joint[i % m->njoint];
    double q = motion->q[(i / m->njoint) * m->nq + j->q];
    int scalar = j->type == CAV_JOINT_HINGE || j->type == CAV_JOINT_SLIDE;
    if (!scalar || !j->limited || fmin(q - j->range[0], j->range[1] - q) >= near) continue;
    near = fmin(q - j->range[0], j->range[1] - q), joint = i % m->njoint;
  }
  cav_forces_free(forces);
  int n = snprintf(text, size, "no limit is at its end");
  if (most < idle && m->nu > 0)
    n +=
        snprintf(text + n, size - (size_t)n,
                 " and actuators do nothing: where all stands still nothing leads on, which <swing> in <guess> breaks");
  else if (of >= 0)
    n += snprintf(text + n, size - (size_t)n, ": actuators give at most %.2g %% of their limits ('%.100s' at %.3g s)",
                  100 * most, cav_actuator_words(m, of, words), at * motion->timestep);
  if (joint >= 0 && (size_t)n < size)
    snprintf(text + n, size - (size_t)n, ", the nearest end of a range is %.2g %s off ('%.40s')", fmax(near, 0),
             m->joint[joint].type == CAV_JOINT_HINGE ? "rad" : "m", m->joint[joint].name);
}

/// By how much the weight of a term was multiplied, as strategies.csv has it.
static double times_of(const char *changed, const char *name) {
  static const char goals[] = "weights of goals ";
  char one[64];
  snprintf(one, sizeof one, "weight of '%.40s' ", name);
  const char *at = strstr(changed, one), *all = strstr(changed, goals);
  return at ? strtod(at + strlen(one), NULL) : all ? strtod(all + sizeof goals - 1, NULL) : 1;
}

// times its weight from which on a trial in vain tells that weight is not what is missing
static const double plenty = 5;
static const double nearer = 0.95; // part of what is missed that a trial leaves where it helped
static const double counts = 0.02; // part of the cost from which on another target is told to be in the way

/// Another target that costs most, in words that go on from a weight's; "" where none counts.
static void tell_opponent(const cav_problem *p, const cav_term_report *report, int missed, char *text, size_t size) {
  int most = -1;
  for (int i = 0; i < p->nterm; i++)
    if (i != missed && report[i].has_target && report[i].fraction > (most < 0 ? counts : report[most].fraction))
      most = i;
  *text = 0;
  if (most < 0) return;
  const char *name = p->term[most].name;
  snprintf(text, size, "; beside it '%.60s' is asked for and has %.2g %% of the cost, which may pull the other way",
           *name ? name : report[most].what, 100 * report[most].fraction);
}

/// What became of the heaviest weight of a term that was tried, where that is by so many times more than that of the motion
/// that was kept, or is its own: in words, "" where no such was.
static void tell_heavier(const char *folder, const char *name, double more, double off, char *text, size_t size) {
  cav_tried t = cav_tried_open(folder);
  double most = 1, kept = 1, left = NAN;
  char how[160] = "";
  *text = 0;
  while (cav_tried_next(&t)) {
    const double times = times_of(t.changed, name);
    if (t.kept) kept = times;
    if (!(times > most) || strncmp(t.outcome, "not ", 4) || !strcmp(t.outcome, "not tried")) continue;
    // what began elsewhere tells nothing of more weight here
    if (strstr(t.changed, "kinematics=")) continue;
    most = times;
    const char *end = strstr(t.reason, ": wanted"), *stop = strstr(t.reason, ". ");
    if (!end || (stop && stop < end)) end = stop;
    snprintf(how, sizeof how, "%.*s", end ? (int)(end - t.reason) : (int)strlen(t.reason), t.reason);
    left = NAN;
    const char *by = strstr(t.reason, "' by ");
    if (by) sscanf(by, "' by %lf", &left);
  }
  cav_tried_close(&t);
  // one that brought it nearer tells nothing against more
  const int helped = left < nearer * off;
  if (*how && most > kept && (most >= 0.99 * more * kept || (most >= plenty * kept && !helped)))
    snprintf(text, size, "%g times the stated weight was tried (strategies.csv) and did not do: %s", most, how);
}

/// What the strategy missed that brings a hand to what has to be pushed, in words; "" where it was not tried.
static void tell_pushed(const char *folder, char *text, size_t size) {
  cav_tried t = cav_tried_open(folder);
  *text = 0;
  while (cav_tried_next(&t)) {
    if (strcmp(t.name, "push") != 0 || strncmp(t.outcome, "not ", 4) != 0 || !strcmp(t.outcome, "not tried")) continue;
    const char *stop = strstr(t.reason, ". ");
    snprintf(text, size, "%.*s", stop ? (int)(stop - t.reason) : (int)strlen(t.reason), t.reason);
  }
  cav_tried_close(&t);
}

/// Link whose place or joint a term is of, of several the one that is off the most, a joint's name; 0: of the world or of none
/// of them.
static int link_of(const cav_problem *p, const cav_term *term, const char *what) {
  const cav_model *m = p->model;
  if (term->quantity == CAV_QUANTITY_CONFIGURATION) {
    const int joint = term->dofs == CAV_DOFS_ONE ? term->joint : cav_object_find(m, CAV_OBJECT_JOINT, what);
    return joint >= 0 ? m->dof[m->joint[joint].dof].link : 0;
  }
  if (term->quantity != CAV_QUANTITY_SENSOR) return 0;
  if (term->sensor.object_type == CAV_OBJECT_JOINT) return m->dof[m->joint[term->sensor.object].dof].link;
  int link = cav_object_link(m, term->sensor.object_type, term->sensor.object);
  return link > 0 ? link : 0;
}

static const double tail = 1e-3; // N/kg of the scene: less is the tail of a smoothed law

/// Of what no actuator moves and nothing that one moves touches: its body, for people; NULL: something does, or may.
static const char *untouched(const cav_problem *p, const cav_trajectory *motion, const cav_term *term,
                             const char *what) {
  const cav_model *m = p->model;
  const int link = link_of(p, term, what), root = m->link[link].root;
  cav_error ignored = {0};
  if (link <= 0 || m->link[link].driven || m->nu == 0) return NULL;
  cav_forces *forces = cav_forces_new(m, motion, &p->contact, p->close_at_rest, &ignored);
  int touched = !forces;
  for (int i = 0; forces && i < forces->nforce; i++) {
    const double *force = forces->force[i].force;
    if (force[0] * force[0] + force[1] * force[1] + force[2] * force[2] < pow(tail * m->mass, 2)) continue;
    const int one = m->geom[forces->force[i].geom1].link, two = m->geom[forces->force[i].geom2].link;
    touched |= (m->link[one].root == root && m->link[two].driven) || (m->link[two].root == root && m->link[one].driven);
  }
  cav_forces_free(forces);
  for (int b = 1; b < m->nbody && !touched; b++)
    if (m->body[b].link == link) return m->body[b].name && *m->body[b].name ? m->body[b].name : "the body";
  return NULL;
}

/// The first term that asks for something as a link sees it; -1: none.
static int seen_from(const cav_problem *p, int link) {
  for (int i = 0; i < p->nterm; i++) {
    const cav_sensor *s = &p->term[i].sensor;
    if (p->term[i].quantity == CAV_QUANTITY_SENSOR && s->type == CAV_SENSOR_FRAMEPOS && s->referred &&
        cav_object_link(p->model, s->reference_type, s->reference) == link)
      return i;
  }
  return -1;
}

/// A body that may take hold of things: a hand, or a foot, or the last link of a chain.
static const char *hand_of(const cav_model *m) {
  static const cav_role role[] = {CAV_ROLE_RIGHT_HAND, CAV_ROLE_LEFT_HAND, CAV_ROLE_HAND, CAV_ROLE_RIGHT_FOOT};
  cav_state *state = cav_state_new(m);
  cav_roles roles;
  const char *name = "";
  for (int l = 1; l < m->nlink; l++)
    if (m->link[l].driven && *m->body[m->link[l].body].name) name = m->body[m->link[l].body].name;
  if (state && !cav_roles_find(m, state, &roles))
    for (int i = 3; i >= 0; i--)
      if (roles.body[role[i]] > 0) name = m->body[roles.body[role[i]]].name;
  cav_state_free(state);
  return name;
}

/// What a step may still save, of the cost, from which on a motion is at no optimum.
static const double far_off = 0.01;

/// Whether a number is on the other side of what is wanted than the start has it.
static int goes_beyond(const cav_term_report *got, const cav_term_report *start) {
  return !strcmp(got->what, start->what) && (got->got - got->wanted) * (start->got - start->wanted) < 0;
}

/// What is told of the term that is missed most.
typedef struct miss {
  const cav_problem *p;
  const cav_term *term;
  const cav_term_report *got, *all; ///< of the term, and of all
  const cav_explanation *e;
  const char *name, *unit, *gap; ///< gap: what stands before the unit
  double way, done;              ///< what the start is off by, and how much of that the motion goes
  char weight[480], tried[300], ended[100];
} miss;

/// How the texts begin: "'door' is 1.2 rad from where the start has it".
static int tell_way(const miss *s, char *text, size_t size) {
  return snprintf(text, size, "'%.60s' is %.3g%s%s from where the start has it", s->name, s->way, s->gap, s->unit);
}

/// What the strongest of the constraints that hold a motion back is, after some words; "" without one.
static const char *holds(const miss *s, const char *words, char text[300]) {
  *text = 0;
  if (s->e->nconflict) snprintf(text, 300, "; %s: %.160s", words, s->e->conflict[0].what);
  return text;
}

/// Of a body that nothing touches which an actuator moves: how to bring a hand to it.
static void tell_untouched(const miss *s, const char *body, const char *folder, char *text, size_t size) {
  const cav_problem *p = s->p;
  const int brought = seen_from(p, link_of(p, s->term, s->got->what));
  const cav_term *hand = brought >= 0 ? &p->term[brought] : NULL;
  char pushed[200];
  tell_pushed(folder, pushed, sizeof pushed);
  int n = tell_way(s, text, size);
  n += snprintf(text + n, size - (size_t)n, ", and nothing that an actuator moves touches '%.40s'", body);
  if (hand)
    snprintf(
        text + n, size - (size_t)n,
        ". '%.60s' asks for something there, at a weight of %.3g, and is off by %.2g m. Next: its target at the "
        "face to push on, less what the body that pushes is thick, from when on it can be there; or postures in "
        "<guess> that have it there%s.",
        *hand->name ? hand->name : s->all[brought].what, hand->weight, s->all[brought].off,
        p->schedule.kinematics ? "" : "; or <schedule kinematics=\"true\"/>, which begins from where targets are met");
  else if (*pushed)
    snprintf(
        text + n, size - (size_t)n,
        ". The strategy push brought a hand to it and missed: %.160s. Next: more time, %sless friction or a lighter "
        "body to see whether it is too heavy, or postures in <guess> that push it.",
        pushed, p->close_at_rest ? "close=\"open\" in <horizon> where it may move at the end, " : "");
  else
    snprintf(
        text + n, size - (size_t)n,
        ": from afar no change of the motion brings it nearer, whatever its weight. Next: bring a hand to it, by "
        "<sensor type=\"framepos\" body=\"%.40s\" reftype=\"xbody\" refname=\"%.40s\" target=\"0 0 0\" from=\"%.2g\" "
        "weight=\"300\" within=\"any\"/>, its target at the side to push from, in the axes of that body, or by "
        "postures in <guess> that have it there.",
        hand_of(p->model), body, p->duration / 3);
}

/// Of a motion that stays about where it starts: what leads elsewhere.
static void tell_still(const miss *s, const cav_trajectory *motion, char *text, size_t size) {
  const cav_term_report *got = s->got;
  const char *unit = s->unit, *gap = s->gap, *tried = s->tried, *more = *tried ? "; " : ", or ";
  char hint[160], room[300];
  suggest(s->p, hint, sizeof hint);
  int n = tell_way(s, text, size);
  if (s->e->nconflict) {
    snprintf(text + n, size - (size_t)n,
             ", and the motion goes %.2g%s%s of that by %.3g s; what holds it back: %.160s. It ended %s: %s%s%s.",
             fmax(s->done, 0), gap, unit, got->time, s->e->conflict[0].what, s->ended, hint, more,
             *tried ? tried : "a higher weight does");
    return;
  }
  tell_room(s->p, motion, room, sizeof room);
  snprintf(text + n, size - (size_t)n,
           ", %.3g%s%s a second, and the motion goes %.2g%s%s of that by %.3g s, though %s. The search ended %s, with "
           "%.3g %% of the cost in this term; nothing proves that it cannot be had, nor that it can. Next: half of the "
           "way, or more time, to see what can be; %s%s%s.",
           s->way / fmax(got->time, s->p->timestep), gap, unit, fmax(s->done, 0), gap, unit, got->time, room, s->ended,
           100 * got->fraction, hint, more, *tried ? tried : "a higher weight does");
}

/// Of a motion that goes part of the way, too far, or away from where it starts: what it is traded against.
static void tell_traded(const miss *s, int beyond, char *text, size_t size) {
  const cav_term_report *got = s->got;
  char held[300];
  if (s->way <= got->within) {
    snprintf(text, size,
             "the start has '%.60s' to %.3g%s%s, and the motion leaves it by %.3g%s%s at %.3g s%s. It is traded "
             "against other costs: %s.",
             s->name, s->way, s->gap, s->unit, got->off, s->gap, s->unit, got->time, holds(s, "what holds it", held),
             s->weight);
    return;
  }
  const int n = tell_way(s, text, size);
  if (beyond)
    snprintf(text + n, size - (size_t)n,
             ", and the motion goes %.3g%s%s too far by %.3g s%s. It is traded against other costs: %s.", got->off,
             s->gap, s->unit, got->time, holds(s, "what holds it there", held), s->weight);
  else
    snprintf(text + n, size - (size_t)n,
             ", and the motion goes %.0f %% of that by %.3g s%s. The rest is traded against other costs: %s.",
             100 * s->done / s->way, got->time, holds(s, "what holds it back", held), s->weight);
}

static void tell(const cav_problem *p, const cav_trajectory *motion, const cav_term_report *got,
                 const cav_term_report *held, int i, const cav_explanation *e, double saving, const char *folder,
                 char *text, size_t size) {
  miss s = {.p = p, .term = &p->term[i], .got = &got[i], .all = got, .e = e, .unit = got[i].unit};
  const int named = *s.term->name && strcmp(s.term->name, cav_quantity_rule_of(s.term->quantity)->name);
  const double more = 2 * got[i].off / got[i].within;
  s.name = named ? s.term->name : got[i].what;
  s.gap = *s.unit ? " " : "";
  s.way = held[i].off, s.done = s.way - got[i].off;
  snprintf(s.ended, sizeof s.ended, "at the optimum next to its guess");
  if (saving > far_off)
    snprintf(s.ended, sizeof s.ended, "short of an optimum, where a step may still save %.2g %% of the cost",
             100 * saving);
  const int stays = s.done < still * s.way && s.way > got[i].within;
  tell_heavier(folder, s.term->name, stays ? 1 : more, got[i].off, s.tried, sizeof s.tried);
  snprintf(s.weight, sizeof s.weight, "a weight %.2g times as large brings it nearer", more);
  if (*s.tried) snprintf(s.weight, sizeof s.weight, "%s", s.tried);
  const size_t said = strlen(s.weight);
  tell_opponent(p, got, i, s.weight + said, sizeof s.weight - said);
  const char *body = stays ? untouched(p, motion, s.term, got[i].what) : NULL;
  const int beyond = goes_beyond(&got[i], &held[i]);
  if (body)
    tell_untouched(&s, body, folder, text, size);
  else if (cav_problem_is_given(p))
    snprintf(text, size,
             "'%.60s' is off by %.3g%s%s at %.3g s, and no actuator moves this model: the motion follows from its "
             "start, and no weight changes it. Next: another start (where, or how fast), duration, mass or friction.",
             s.name, got[i].off, s.gap, s.unit, got[i].time);
  else if (stays && !beyond)
    tell_still(&s, motion, text, size);
  else
    tell_traded(&s, beyond, text, size);
}

int cav_command_missed(const cav_result *result, const cav_explanation *e, double saving, const char *folder,
                       char text[CAV_MISSED_TEXT]) {
  const cav_problem *p = result->problem;
  const cav_trajectory *motion = result->trajectory;
  cav_error error = {0};
  cav_term_report *got = calloc(2 * (size_t)p->nterm + 2, sizeof *got), *held = got ? got + p->nterm + 1 : NULL;
  cav_trajectory *start = cav_trajectory_copy(motion);
  int worst = -1;
  *text = 0;
  for (int t = 1; start && t < start->nknot; t++)
    memcpy(start->q + (size_t)t * (size_t)start->nq, start->q, (size_t)start->nq * sizeof *start->q);
  if (start) memset(start->v, 0, (size_t)start->nknot * (size_t)start->nv * sizeof *start->v);
  if (got && start && !p->cycle.on && !cav_terms_report(p, motion, &p->contact, got, NULL, &error) &&
      !cav_terms_report(p, start, &p->contact, held, NULL, &error))
    worst = worst_of(p, got);
  if (worst >= 0) tell(p, motion, got, held, worst, e, saving, folder, text, CAV_MISSED_TEXT);
  cav_trajectory_free(start);
  free(got);
  return *text != 0;
}
