/// Problems: defaults, and reading a problem file with its model.
///
/// The file is checked against grammar.c while it is read; what is left here is what only the whole can tell: that
/// names stand for something in the model, that windows lie in the horizon, that nothing contradicts. Postures are read
/// by pose.c, guesses by initial_guess.c, terms by term.c; write.c is the way back. The weights and the schedule come
/// from trials on a 27-dof humanoid (squat, jump, walk, get-up) and serve other bodies because all quantities are
/// scaled by weight, limits and lengths. Does not decides whether a motion is possible.
#include "cavort/problem.h"

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file.h"
#include "ipopt_options.h"
#include "objects.h"
#include "plannable.h"
#include "problem_file.h"
#include "role.h"
#include "scene.h"
#include "schedule.h"
#include "tendon_range.h"

static const double most_knots = 1e6;

// ends of the continuation
#define FIRST(name, first, ...) .name = first,
#define LAST(name, first, last, ...) .name = last,
static const cav_stage_options first_stage = {CAV_STAGE_OPTIONS(FIRST, FIRST)};
static const cav_stage_options last_stage = {CAV_STAGE_OPTIONS(LAST, LAST)};

cav_problem cav_problem_default(const cav_model *model) {
  cav_problem problem = {
      .name = "",
      .model = model,
      .duration = 1,
      .timestep = 0.025,
      .order = CAV_ORDER_MIDPOINT,
      .close_at_rest = 1,
      .guess = CAV_GUESS_INTERPOLATE,
      .guess_to = 1,
      .effort_limit = 0.8,
      .limit_margin = 1e-3,
      .residual = {.within = 0.05},
      .schedule = {.stages = 16, .sliding = CAV_SLIDING_COULOMB, .first = first_stage, .last = last_stage},
  };
  const double part = cav_schedule_part(model);
  problem.schedule.first.smoothing_self *= part;
  problem.schedule.last.smoothing_self *= part;
  return problem;
}

void *cav_problem_alloc(cav_problem_owner *owner, size_t size) {
  cav_problem_block *block = calloc(1, sizeof *block + size);
  if (!block) return NULL;
  block->next = owner->block;
  owner->block = block;
  return block->data;
}

char *cav_problem_text(cav_problem_owner *owner, const char *text) {
  char *copy = cav_problem_alloc(owner, strlen(text) + 1);
  return copy ? strcpy(copy, text) : NULL;
}

static void free_owner(cav_problem_owner *owner) {
  if (!owner) return;
  while (owner->block) {
    cav_problem_block *next = owner->block->next;
    free(owner->block);
    owner->block = next;
  }
  cav_model_free(owner->model);
  free(owner);
}

void cav_problem_free(cav_problem *problem) {
  if (problem) free_owner(problem->owner);
}

int cav_problem_has_goal(const cav_problem *problem) {
  return ((const cav_problem_owner *)(const void *)problem)->goal;
}

const cav_xml_node *cav_problem_child(const cav_xml_node *node, const char *name) {
  const cav_xml_node *child = node ? node->child : NULL;
  while (child && strcmp(child->rule->name, name)) child = child->next;
  return child;
}

cav_status cav_problem_no_memory(const cav_problem_reader *reader) {
  return cav_file_fail(reader->error, CAV_NO_MEMORY, 0, "%s: no memory for the problem", reader->path);
}

// another kind that has an object of that name; CAV_OBJECT_TYPES: none
static cav_object_type other_kind(const cav_model *model, cav_object_type type, const char *name) {
  const char *kind = cav_object_kind_of(type)->text;
  cav_object_type other = 0;
  while (other < CAV_OBJECT_TYPES &&
         (cav_object_kind_of(other)->text == kind || cav_object_find(model, other, name) < 0))
    other++;
  return other;
}

// the body, or the geom at its end, that has a role by that name; -1: there is none
static int find_role(const char *name, const cav_roles *roles, cav_object_type *type) {
  cav_role role = cav_role_named(name);
  if (role == CAV_ROLE_TYPES || roles->body[role] < 0) return -1;
  if (roles->geom[role] < 0) return roles->body[role];
  *type = CAV_OBJECT_GEOM;
  return roles->geom[role];
}

enum { HINT = 240 };

// what may have been meant: near, or else names that hold what was asked for; "": nothing
static const char *hint_of(const char *near, const char *first, const void *names, int n, size_t stride,
                           char hint[HINT]) {
  char alike[200] = "";
  if (!near && n) cav_xml_alike(first, names, n, stride, alike, sizeof alike);
  snprintf(hint, HINT, "%s%.200s%s",
           near     ? "; did you mean '"
           : *alike ? "; it has "
                    : "",
           near ? near : alike, near ? "'?" : "");
  return hint;
}

// nothing of that name: what is near, or what else is called so
static void refuse_name(const cav_problem_reader *reader, const cav_xml_node *node, const char *attribute,
                        cav_object_type type, const char *first, const cav_roles *roles) {
  const cav_model *m = reader->model;
  const char *kind = cav_object_kind_of(type)->text;
  cav_object_type other = other_kind(m, type, first);
  int n = 0;
  size_t stride = 0;
  const void *names = cav_object_names(m, type, &n, &stride);
  const char *near = n ? cav_xml_nearest(first, names, n, stride) : NULL;
  if (other != CAV_OBJECT_TYPES) {
    const char *given = cav_object_kind_of(other)->text;
    int accepted = cav_xml_accepts(node, given);
    const int geom = !accepted && other == CAV_OBJECT_GEOM ? cav_object_find(m, other, first) : -1,
              body = geom >= 0 ? m->geom[geom].body : 0;
    char hint[HINT] = "";
    if (accepted) snprintf(hint, sizeof hint, ": give it as attribute '%.40s'", given);
    if (geom >= 0 && body > 0 && m->body[body].name)
      snprintf(hint, sizeof hint, ", of body '%.100s'", m->body[body].name);
    if (geom >= 0 && body == 0)
      snprintf(hint, sizeof hint, " in the world itself: put it into a <body name=\"%.60s\"> of its own", first);
    const int fixed = type == CAV_OBJECT_JOINT && (other == CAV_OBJECT_BODY || other == CAV_OBJECT_XBODY)
                          ? cav_object_find(m, CAV_OBJECT_BODY, first)
                          : -1;
    if (!accepted && geom < 0) hint_of(near, first, names, n, stride, hint);
    if (fixed > 0 && m->body[fixed].link == 0)
      snprintf(hint, sizeof hint,
               ", which is fixed to the world: <freejoint name=\"%.60s\"/> in its <body> lets it move", first);
    const cav_joint *free = fixed > 0 && m->body[fixed].link ? &m->joint[m->link[m->body[fixed].link].joint] : NULL;
    if (free && free->type == CAV_JOINT_FREE && *free->name)
      snprintf(hint, sizeof hint, ": its free joint is called '%.60s'", free->name);
    else if (free && free->type == CAV_JOINT_FREE)
      snprintf(hint, sizeof hint, ": its free joint has no name, <freejoint name=\"%.60s\"/> gives one", first);
    cav_xml_fail(reader->error, node, attribute, "the model '%s' has no %s '%.100s', but %s %s of that name%s", m->name,
                 kind, first, strchr("aeiou", *given) ? "an" : "a", given, hint);
    return;
  }
  const char *role_name[CAV_ROLE_TYPES];
  char known[480] = "", parts[240], hint[HINT];
  if (roles) {
    for (int r = 0; r < CAV_ROLE_TYPES; r++) role_name[r] = cav_role_name((cav_role)r);
    if (!near && cav_role_named(first) == CAV_ROLE_TYPES)
      near = cav_xml_nearest(first, role_name, CAV_ROLE_TYPES, sizeof *role_name);
    cav_roles_list(roles, parts, sizeof parts);
    snprintf(known, sizeof known, "; roles found (%s): %s", cav_build_name(roles->build), *parts ? parts : roles->why);
  }
  cav_xml_fail(reader->error, node, attribute, "the model '%s' has no %s of that name, got '%.200s'%s%s", m->name, kind,
               cav_xml_text(node, attribute, ""), hint_of(near, first, names, n, stride, hint), known);
}

/// A search among the objects of a model by a list of names, separated by |, which it cuts.
typedef struct search {
  const cav_model *model;
  cav_state *state;
  cav_object_type type; ///< of bodies by their roles it may become a geom
  const char *first;    ///< of the names
  int known;            ///< whether roles are filled
  cav_roles roles;
  cav_status status;
} search;

// the first object that there is, -1: none
static int find_listed(search *s, char *names) {
  int found = -1, may = s->type == CAV_OBJECT_BODY || s->type == CAV_OBJECT_XBODY;
  char *name = NULL;
  while (found < 0 && !s->status && (name = strsep(&names, "|"))) {
    name += strspn(name, " ");
    for (size_t n = strlen(name); n && name[n - 1] == ' '; n--) name[n - 1] = 0;
    if (!s->first) s->first = name;
    if (*name) found = cav_object_find(s->model, s->type, name);
    if (found >= 0 || !may) continue;
    if (!s->known++) s->status = cav_roles_find(s->model, s->state, &s->roles);
    if (!s->status) found = find_role(name, &s->roles, &s->type);
  }
  return found;
}

int cav_problem_find_frame(const cav_problem_reader *reader, const cav_xml_node *node, const char *attribute,
                           cav_object_type *type) {
  char *copy = strdup(cav_xml_text(node, attribute, ""));
  search s = {.model = reader->model, .state = reader->state, .type = *type, .status = copy ? CAV_OK : CAV_NO_MEMORY};
  int found = copy ? find_listed(&s, copy) : -1;
  if (s.status)
    cav_xml_fail_as(reader->error, s.status, node, attribute, "the roles of bodies cannot be found: %s",
                    cav_status_name(s.status));
  else if (found < 0)
    refuse_name(reader, node, attribute, *type, s.first, s.known ? &s.roles : NULL);
  *type = s.type;
  free(copy);
  return found;
}

int cav_object_named(const cav_model *model, cav_state *state, const char *names, cav_object_type *type,
                     cav_error *error) {
  char *copy = names && (unsigned)*type < CAV_OBJECT_TYPES ? strdup(names) : NULL;
  search s = {.model = model, .state = state, .type = *type, .status = copy ? CAV_OK : CAV_NO_MEMORY};
  int found = copy ? find_listed(&s, copy) : -1;
  if (s.status) {
    cav_file_fail(error, s.status, 0, "no object can be sought by name: %s", cav_status_name(s.status));
  } else if (found < 0) {
    int n = 0;
    size_t stride = 0;
    const void *known = cav_object_names(model, *type, &n, &stride);
    const char *near = n ? cav_xml_nearest(s.first, known, n, stride) : NULL;
    char hint[HINT];
    cav_file_fail(error, CAV_BAD_INPUT, 0, "the model '%.100s' has no %s of that name, got '%.100s'%s", model->name,
                  cav_object_kind_of(*type)->text, names, hint_of(near, s.first, known, n, stride, hint));
  }
  *type = s.type;
  free(copy);
  return found;
}

int cav_problem_find(const cav_problem_reader *reader, const cav_xml_node *node, const char *attribute,
                     cav_object_type type) {
  cav_object_type found = type;
  int object = cav_problem_find_frame(reader, node, attribute, &found);
  return object >= 0 && found != type ? reader->model->geom[object].body : object;
}

// dofs of the smallest tree
static int smallest_tree(const cav_model *m) {
  int least = m->nv;
  for (int i = 1, n = 0; i < m->nlink; i++) {
    n = m->link[i].parent == 0 ? m->link[i].ndof : n + m->link[i].ndof;
    if ((i + 1 == m->nlink || m->link[i + 1].parent == 0) && n < least) least = n;
  }
  return least;
}

static cav_status read_horizon(const cav_problem_reader *reader) {
  cav_problem *p = reader->problem;
  const cav_xml_node *node = cav_problem_child(reader->root, "horizon");
  cav_status status = cav_problem_real(reader, node, "duration", DBL_MIN, DBL_MAX, &p->duration);
  if (!status) status = cav_problem_real(reader, node, "timestep", DBL_MIN, DBL_MAX, &p->timestep);
  if (status) return status;
  double steps = p->duration / p->timestep;
  if (!(steps >= 2 - CAV_WHOLE_STEP && steps < most_knots)) {
    // of the two numbers the one that the file states; of both the step, which is that of numerics
    const int step = cav_xml_get(node, "timestep") != NULL;
    return cav_xml_fail(reader->error, node, step ? "timestep" : "duration",
                        "expected 2 to %g steps of %g s in a duration of %g s, got %g%s", most_knots, p->timestep,
                        p->duration, steps, steps < 2 ? "; shorten the step or give more time" : "");
  }
  if (fabs(steps - round(steps)) > CAV_WHOLE_STEP) {
    return cav_xml_fail(reader->error, node, "duration",
                        "expected a whole number of steps of %g s, got %g; %g s would be one", p->timestep, steps,
                        round(steps) * p->timestep);
  }
  // trees that nothing moves or asks for are left out of plans: of one alone, the smallest
  cav_error needs;
  if (cav_knots_plannable(round(steps) + 1, smallest_tree(reader->model), &needs) != CAV_OK)
    return cav_xml_fail(reader->error, node, "duration", "%s", needs.text);
  double range[2];
  status = cav_problem_real(reader, node, "weight", 0, CAV_WEIGHT_MOST, &p->duration_weight);
  if (status) return status;
  if (cav_xml_reals(node, "range", range, 2)) {
    if (!(range[0] > 0 && range[0] <= p->duration && p->duration <= range[1]))
      return cav_xml_fail(reader->error, node, "range",
                          "expected a shortest and a longest duration about %g s, got %g %g", p->duration, range[0],
                          range[1]);
    p->duration_least = range[0];
    p->duration_most = range[1];
  } else if (cav_xml_get(node, "weight")) {
    return cav_xml_fail(reader->error, node, "weight", "multipliers a free duration: give its range too");
  }
  status = cav_problem_real(reader, node, "window", DBL_MIN, DBL_MAX, &p->window);
  p->overlap = p->window / 3;
  if (!status) status = cav_problem_real(reader, node, "overlap", DBL_MIN, DBL_MAX, &p->overlap);
  if (status) return status;
  if (p->window > 0 && (p->duration_most > 0 || p->overlap > p->window - 2 * p->timestep))
    return cav_xml_fail(reader->error, node, p->duration_most > 0 ? "window" : "overlap",
                        p->duration_most > 0 ? "contradicts 'range': windows are of a duration that is given"
                                             : "expected less than the window of %g s by two steps, got %g",
                        p->window, p->overlap);
  p->order = (cav_order)cav_xml_word(node, "order", p->order);
  p->close_at_rest = cav_xml_word(node, "close", p->close_at_rest);
  return CAV_OK;
}

// lengths of tendons within their ranges
static cav_status check_tendons(const cav_problem_reader *reader, const cav_xml_node *node, const double *q,
                                double slack) {
  const cav_model *m = reader->model;
  cav_state *state = cav_state_new(m);
  cav_status status = state ? cav_position(m, state, q) : CAV_NO_MEMORY;
  if (status != CAV_OK) cav_xml_fail_as(reader->error, status, node, NULL, "lengths of tendons cannot be computed");
  for (int i = 0; i < m->ntendon && status == CAV_OK; i++) {
    const cav_tendon *tendon = &m->tendon[i];
    double length = state->tendon_length[i];
    if (fabs(cav_tendon_outside(tendon, length)) <= slack) continue;
    char label[CAV_TENDON_LABEL];
    cav_tendon_label(m, i, label);
    status = cav_xml_fail(reader->error, node, NULL, "%s has length %g, outside its range %g .. %g; %s", label, length,
                          tendon->range[0], tendon->range[1],
                          cav_xml_word(node, "ranges", 0) ? "no posture near this one has it inside: state another one"
                                                          : "ranges='clip' brings it in, where a posture nearby does");
  }
  cav_state_free(state);
  return status;
}

static int within_range(const cav_joint *joint, double value) {
  return value >= joint->range[0] && value <= joint->range[1];
}

// what a value outside a joint's range may have been meant as: of a little beyond nothing
static const char *meant(const cav_joint *joint, double value, int degrees) {
  const int hinge = joint->type == CAV_JOINT_HINGE;
  const double beyond = fmax(joint->range[0] - value, value - joint->range[1]), turned = value * M_PI / 180;
  if (joint->type == CAV_JOINT_BALL || beyond <= (hinge ? 0.1 : 0.01)) return "";
  if (hinge && !degrees && within_range(joint, turned)) return "; in degrees it would be in it: <joint name= degrees=>";
  if (within_range(joint, -value))
    return "; with the other sign it would be in it: cavort inspect MODEL says which way a joint is positive";
  if (hinge && !degrees && within_range(joint, -turned))
    return "; in degrees and with the other sign it would be in it: <joint name= degrees=>";
  return "";
}

static cav_status refuse_range(const cav_problem_reader *reader, const cav_xml_node *node, int j, double value,
                               double least) {
  const cav_joint *joint = &reader->model->joint[j];
  const int based = cav_xml_get(node, "key") || cav_xml_get(node, "qpos") || cav_xml_get(node, "file");
  const int own = !based && value == reader->model->q0[joint->q], hinge = joint->type == CAV_JOINT_HINGE;
  // of the model's own posture nobody said in what
  const int slide = joint->type == CAV_JOINT_SLIDE,
            degrees = (own && hinge) || (!slide && cav_problem_in_degrees(reader, node, j));
  const double unit = degrees ? 180 / M_PI : 1;
  if (own)
    return cav_xml_fail(reader->error, node, NULL,
                        "joint '%s' is at %g, outside its range %.5g .. %.5g %s, in the model's own configuration, "
                        "with which a posture "
                        "without 'key' begins; key=\"stand\", or a keyframe of the model, begins with another, <joint "
                        "name=\"%s\"%s/> inside "
                        "sets it, ranges=\"clip\" brings it in",
                        joint->name, unit * value, unit * least, unit * joint->range[1],
                        slide     ? "m"
                        : degrees ? "degrees"
                                  : "rad",
                        joint->name,
                        slide   ? " pos="
                        : hinge ? " degrees="
                                : "");
  return cav_xml_fail(reader->error, node, NULL,
                      "joint '%s' is at %g, outside its range %.5g .. %.5g %s; ranges='clip' would bring it in%s",
                      joint->name, unit * value, unit * least, unit * joint->range[1],
                      slide     ? "m"
                      : degrees ? "degrees"
                                : "rad",
                      meant(joint, value, degrees));
}

// within ranges of joints and tendons, or the solver meets a knot that it may not move
static cav_status check_ranges(const cav_problem_reader *reader, const cav_xml_node *node, const double *q) {
  static const double slack = 1e-6;
  const cav_model *m = reader->model;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    if (!joint->limited || joint->type == CAV_JOINT_FREE) continue;
    double value = q[joint->q], least = joint->range[0];
    if (joint->type == CAV_JOINT_BALL) {
      const double *w = q + joint->q;
      value = 2 * atan2(sqrt(w[1] * w[1] + w[2] * w[2] + w[3] * w[3]), fabs(w[0]));
      least = 0;
    }
    if (value < least - slack || value > joint->range[1] + slack) return refuse_range(reader, node, j, value, least);
  }
  return m->ntendon > 0 ? check_tendons(reader, node, q, slack) : CAV_OK;
}

static cav_status read_ends(const cav_problem_reader *reader) {
  cav_problem *p = reader->problem;
  const cav_model *m = reader->model;
  p->q_start = cav_problem_alloc(reader->owner, (size_t)(2 * m->nq + m->nv + 1) * sizeof(double));
  if (!p->q_start) return cav_problem_no_memory(reader);
  p->q_goal = p->q_start + m->nq;
  p->v_start = p->q_goal + m->nq;
  const cav_xml_node *start = cav_problem_child(reader->root, "start"), *goal = cav_problem_child(reader->root, "goal");
  cav_status status = cav_problem_pose(reader, start, p->q_start);
  p->free_start = cav_xml_bool(start, "free", 0);
  reader->owner->goal = goal != NULL;
  // one that is free is brought into ranges by the solver
  if (!status && !p->free_start) status = check_ranges(reader, start, p->q_start);
  if (status) return status;
  const cav_xml_value *qvel = cav_xml_get(start, "qvel");
  if (qvel && qvel->count != m->nv) {
    return cav_xml_fail(reader->error, start, "qvel", "expected %d numbers for the model '%s', got %d", m->nv, m->name,
                        qvel->count);
  }
  if (qvel) cav_xml_reals(start, "qvel", p->v_start, m->nv);
  if (cav_xml_word(start, "velocity", 0)) {
    if (qvel)
      return cav_xml_fail(reader->error, start, "velocity", "contradicts attribute 'qvel'; give one of the two");
    status = cav_problem_pose_velocity(reader, start, p->v_start);
    if (status) return status;
  }
  if ((status = cav_problem_pose_moves(reader, start, p->q_start, p->v_start))) return status;
  if (!goal) {
    memcpy(p->q_goal, p->q_start, (size_t)m->nq * sizeof(double));
    return CAV_OK;
  }
  status = cav_problem_pose(reader, goal, p->q_goal);
  return status ? status : check_ranges(reader, goal, p->q_goal);
}

static cav_status read_limits(const cav_problem_reader *reader) {
  const cav_xml_node *node = cav_problem_child(reader->root, "limits");
  if (!node) return CAV_OK;
  cav_status status = cav_problem_real(reader, node, "effort", DBL_MIN, 1, &reader->problem->effort_limit);
  const double effort = cav_xml_real(node, "effort", 0), least_percent = 5;
  if (status && effort >= least_percent && effort <= 100)
    return cav_xml_fail(reader->error, node, "effort",
                        "expected a fraction of the limits of actuators, above 0, at most 1, got %g; %g %% are %g",
                        effort, effort, effort / 100);
  return status ? status : cav_problem_real(reader, node, "margin", 0, DBL_MAX, &reader->problem->limit_margin);
}

static cav_status read_residual(const cav_problem_reader *reader) {
  const cav_xml_node *node = cav_problem_child(reader->root, "residual");
  cav_residual *r = &reader->problem->residual;
  if (!node) return CAV_OK;
  if (!cav_xml_get(node, "force") && !cav_xml_get(node, "torque"))
    return cav_xml_fail(reader->error, node, NULL, "expected 'force' in N, 'torque' in N m, or both");
  cav_status status = cav_problem_real(reader, node, "force", DBL_MIN, DBL_MAX, &r->force);
  if (!status) status = cav_problem_real(reader, node, "torque", DBL_MIN, DBL_MAX, &r->torque);
  return status ? status : cav_problem_real(reader, node, "within", 0, DBL_MAX, &r->within);
}

static cav_status read_schedule(const cav_problem_reader *reader) {
  const cav_xml_node *node = cav_problem_child(reader->root, "schedule");
  if (!node) return CAV_OK;
  cav_schedule *schedule = &reader->problem->schedule;
  schedule->stages = cav_xml_int(node, "stages", schedule->stages);
  if (schedule->stages < 1 || schedule->stages > 1000) {
    return cav_xml_fail(reader->error, node, "stages", "expected 1 to 1000, got %d", schedule->stages);
  }
  schedule->sliding = (cav_sliding)cav_xml_word(node, "sliding", schedule->sliding);
  schedule->solids = (cav_solids)cav_xml_word(node, "solids", schedule->solids);
  schedule->kinematics = cav_xml_bool(node, "kinematics", schedule->kinematics);
  schedule->light_avoided = cav_xml_bool(node, "light_avoided", schedule->light_avoided);
  schedule->calm = cav_xml_bool(node, "calm", schedule->calm);
  schedule->next_gap = (cav_next_gap)cav_xml_word(node, "next_gap", schedule->next_gap);
  schedule->next_slip = (cav_next_slip)cav_xml_word(node, "next_slip", schedule->next_slip);
  int n;
  const cav_field *field = cav_stage_fields(&n);
  cav_status status = cav_problem_real(reader, node, "optimality", 0, 1, &schedule->optimality);
  if (!status) status = cav_problem_read_fields(reader, cav_problem_child(node, "first"), field, n, &schedule->first);
  return status ? status : cav_problem_read_fields(reader, cav_problem_child(node, "last"), field, n, &schedule->last);
}

// Ipopt's options, checked where they stand
static cav_status read_ipopt(const cav_problem_reader *reader) {
  const cav_xml_node *node = cav_problem_child(reader->root, "ipopt");
  int n;
  const cav_ipopt_rule *rule = cav_ipopt_rules(&n);
  if (!node) return CAV_OK;
  cav_ipopt_option *option = cav_problem_alloc(reader->owner, (size_t)n * sizeof *option);
  if (!option) return cav_problem_no_memory(reader);
  reader->problem->ipopt = option;
  for (int i = 0; i < n; i++) {
    const char *text = cav_xml_text(node, rule[i].name, NULL);
    if (!text) continue;
    cav_error inner = {0};
    char *copy = cav_problem_text(reader->owner, text);
    if (!copy) return cav_problem_no_memory(reader);
    *option = (cav_ipopt_option){rule[i].name, copy};
    if (cav_ipopt_option_check(option++, &inner))
      return cav_xml_fail(reader->error, node, rule[i].name, "%s", inner.text);
    reader->problem->nipopt++;
  }
  return CAV_OK;
}

// the law that a result folder records
static cav_status read_contact(const cav_problem_reader *reader) {
  const cav_xml_node *node = cav_problem_child(reader->root, "contact");
  cav_options *o = &reader->problem->contact;
  *o = reader->model->options;
  if (!node) return CAV_OK;
  int n;
  const cav_field *field = cav_option_fields(&n);
  cav_status status = cav_problem_read_fields(reader, node, field, n, o);
  if (status) return status;
  // a free duration has found its own
  const cav_problem *p = reader->problem;
  if (p->duration_most == 0 && fabs(o->timestep - p->timestep) > CAV_WHOLE_STEP * o->timestep) {
    return cav_xml_fail(reader->error, node, "timestep", "expected %g as in <horizon>, got %g",
                        reader->problem->timestep, o->timestep);
  }
  reader->problem->solved = 1;
  return CAV_OK;
}

// the model that the file names, or another in its place
static cav_status load_model(cav_problem_reader *reader, const char *model_path) {
  const char *named = cav_xml_text(reader->root, "model", NULL);
  if (!named && !model_path) {
    return cav_xml_fail(
        reader->error, reader->root, "model",
        "is missing; this problem serves any model with the names that it uses: give one by --model FILE, or "
        "write its path here, from this file's folder");
  }
  char *path = model_path ? strdup(model_path) : cav_file_beside(reader->path, named);
  if (!path) return cav_problem_no_memory(reader);
  cav_error inner = {0};
  const cav_xml_node *scene = cav_problem_child(reader->root, "scene");
  cav_load_options options = cav_load_options_default();
  options.floating = cav_xml_bool(reader->root, "floating", 0);
  options.overlaps = 1;
  reader->owner->model = cav_model_load_scene(path, &options, scene, &inner);
  reader->problem->model_path = cav_problem_text(reader->owner, path);
  free(path);
  if (!reader->owner->model) {
    // a fault of the scene is in this file and says so
    size_t length = strlen(reader->path);
    int own = !strncmp(inner.text, reader->path, length) && inner.text[length] == ':';
    if (model_path || own) return cav_file_fail(reader->error, inner.status, inner.line, "%s", inner.text);
    return cav_xml_fail_as(reader->error, inner.status, reader->root, "model", "%s", inner.text);
  }
  reader->model = reader->owner->model;
  reader->state = cav_state_new(reader->model);
  return reader->state && reader->problem->model_path ? CAV_OK : cav_problem_no_memory(reader);
}

// the one there was knows the model before its numbers were set
static cav_status renew_state(cav_problem_reader *reader) {
  cav_state_free(reader->state);
  reader->state = cav_state_new(reader->model);
  return reader->state ? CAV_OK : cav_problem_no_memory(reader);
}

// all parts, in the order in which they need each other
static cav_status read_problem(cav_problem_reader *reader, const char *model_path) {
  cav_status status = load_model(reader, model_path);
  if (status) return status;
  const char *path = reader->problem->model_path;
  *reader->problem = cav_problem_default(reader->model);
  const cav_xml_node *scene = cav_problem_child(reader->root, "scene");
  if (scene && !(reader->problem->scene = cav_problem_scene(reader->owner, scene)))
    return cav_problem_no_memory(reader);
  reader->problem->owner = reader->owner;
  reader->problem->model_path = path;
  reader->problem->floating = cav_xml_bool(reader->root, "floating", 0);
  reader->problem->name = cav_problem_text(reader->owner, cav_xml_text(reader->root, "name", ""));
  if (!reader->problem->name) return cav_problem_no_memory(reader);
  status = cav_problem_parameters(reader);
  if (!status && reader->problem->nparameter) status = renew_state(reader);
  if (!status) status = read_horizon(reader);
  if (!status) status = read_ends(reader);
  if (!status) status = cav_problem_cycle(reader);
  if (!status) status = cav_problem_initial_guess(reader);
  if (!status) status = read_limits(reader);
  if (!status) status = read_residual(reader);
  if (!status) status = read_schedule(reader);
  if (!status) status = read_ipopt(reader);
  if (!status) status = read_contact(reader);
  if (!status) status = cav_problem_terms(reader);
  return status;
}

cav_problem *cav_problem_load(const char *path, const char *model_path, cav_error *error) {
  static const cav_xml_element *const roots[] = {&cav_problem_element, NULL};
  cav_xml *xml = cav_xml_read(path, roots, cav_problem_former, error);
  if (!xml) return NULL;
  cav_problem_owner *owner = calloc(1, sizeof *owner);
  cav_status status;
  if (owner) {
    cav_problem_reader reader = {
        .owner = owner, .problem = &owner->problem, .root = cav_xml_root(xml), .path = path, .error = error};
    status = read_problem(&reader, model_path);
    cav_state_free(reader.state);
  } else {
    status = cav_file_fail(error, CAV_NO_MEMORY, 0, "%s: no memory for the problem", path);
  }
  cav_xml_free(xml);
  if (!status) return &owner->problem;
  free_owner(owner);
  return NULL;
}
