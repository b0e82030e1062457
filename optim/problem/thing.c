/// What no actuator moves and terms or the goal ask for elsewhere: which, how far and when, and its surface. hand.c and carry.c
/// bring hands to it.
#include "thing.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "extent.h"
#include "math3.h"
#include "quantity.h"
#include "role.h"

/// Weight of the terms that lead.
static const double weight = 300;

/// m: what is nearer touches; vertical part of a normal by which it bears.
static const double touching = 2e-3, upward = 0.7;

/// m from a surface: what is asked for so near is brought to it.
static const double brought = 0.2;

/// Whether no actuator moves a link that can move.
static int is_left(const cav_model *m, int link) { return link > 0 && !m->link[link].driven; }

/// Along the ground, and far enough; or up, where what is lifted counts.
static int is_moved(const cav_thing *t, int lifted) {
  const double along = hypot(t->way[0], t->way[1]);
  return (along >= CAV_THING_WAY && along >= fabs(t->way[2])) || (lifted && t->rise >= CAV_THING_WAY);
}

/// Adds what a term asks for of a link's place. The state is at the start.
static void add_term(const cav_problem *p, const cav_term *term, cav_state *state, cav_thing *found) {
  const cav_sensor *s = &term->sensor;
  const int z = term->component < 0 || term->component == 2;
  double at[CAV_SENSOR_DIM_MAX], target[CAV_SENSOR_DIM_MAX];
  if (cav_term_placed(p->model, term) != found->link || !cav_term_asks(term)) return;
  const double to = term->to < 0 ? p->duration : fmin(term->to, p->duration);
  cav_sensor_read(p->model, state, s, at);
  if (term->use == CAV_USE_RANGE && !cav_term_is_band(term)) {
    cav_term_target(term, to, s->dim, target);
    if (term->component == 2 && isfinite(term->lower)) found->rise = fmax(found->rise, target[2] + term->lower - at[2]);
    return;
  }
  // over a window that is where it is on the way, and the last one is where it goes
  for (int end = 0; end < 2; end++) {
    double far = 0;
    const double time = end ? to : fmin(fmax(term->from, 0), to);
    cav_term_target(term, time, s->dim, target);
    for (int k = 0; k < 3; k++)
      if (term->component < 0 || term->component == k) far = fmax(far, fabs(target[k] - at[k]));
    if (far >= CAV_THING_WAY) found->first = fmin(found->first, time);
    if (z) found->rise = fmax(found->rise, target[2] - at[2]);
  }
  if (to < found->time) return;
  for (int k = 0; k < 3; k++)
    if (term->component < 0 || term->component == k) found->way[k] = target[k] - at[k];
  found->time = to;
}

/// The joint by which what no actuator moves turns or slides in the world; -1: it does not, or by more than one.
static int hung_by(const cav_model *m, int link) {
  const cav_link *l = &m->link[link];
  if (l->root != link || l->njoint != 1) return -1;
  return m->joint[l->joint].type == CAV_JOINT_HINGE || m->joint[l->joint].type == CAV_JOINT_SLIDE ? l->joint : -1;
}

/// The centre of a link's mass.
static void centre_of(const cav_model *m, const cav_state *state, int link, double centre[3]) {
  transform(centre, state->link[link].pos, state->link[link].rotation, m->link[link].com);
}

/// The way of a hung link's centre from the start to a posture q. The state comes there.
static cav_status way_to(const cav_problem *p, const double *q, cav_state *state, cav_thing *found) {
  double start[3];
  cav_status status = cav_position(p->model, state, p->q_start);
  if (status) return status;
  centre_of(p->model, state, found->link, start);
  if ((status = cav_position(p->model, state, q))) return status;
  centre_of(p->model, state, found->link, found->way);
  sub3(found->way, found->way, start);
  found->angle = q[p->model->joint[found->joint].q];
  return CAV_OK;
}

/// What a term of a joint alone, its sensor or its posture, asks of it at a time; 0: it is of something else.
static int asks_of_joint(const cav_problem *p, const cav_term *term, int joint, double time, double *target) {
  const cav_joint *j = &p->model->joint[joint];
  if (term->quantity == CAV_QUANTITY_SENSOR && term->sensor.type == CAV_SENSOR_JOINTPOS &&
      term->sensor.object == joint) {
    cav_term_target(term, time, 1, target);
    return 1;
  }
  if (term->quantity != CAV_QUANTITY_CONFIGURATION || term->dofs != CAV_DOFS_ONE || term->joint != joint) return 0;
  *target = (term->target && !term->nwaypoint ? term->target : p->q_goal)[j->q];
  return !term->nwaypoint;
}

/// Where terms ask for a joint last, the start's where none does.
static double joint_asked(const cav_problem *p, int joint, cav_thing *found) {
  const double start = p->q_start[p->model->joint[joint].q];
  double last = start, target;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    const double to = term->to < 0 ? p->duration : fmin(term->to, p->duration);
    if (!asks_of_joint(p, term, joint, to, &target) || !cav_term_asks(term) || to < found->time) continue;
    const int bounds = term->use == CAV_USE_RANGE && !cav_term_is_band(term);
    last = bounds ? fmin(fmax(start, target + term->lower), target + term->upper) : target;
    found->time = to, found->first = fmin(found->first, fmin(fmax(term->from, 0), to));
  }
  return last;
}

/// Of a link that is hung in the world what terms ask for its joint.
static cav_status add_joint(const cav_problem *p, cav_state *state, cav_thing *found) {
  const size_t bytes = (size_t)p->model->nq * sizeof(double);
  double *q = malloc(bytes);
  if (!q) return CAV_NO_MEMORY;
  memcpy(q, p->q_start, bytes);
  q[p->model->joint[found->joint].q] = joint_asked(p, found->joint, found);
  cav_status status = way_to(p, q, state, found);
  free(q);
  return status ? status : cav_position(p->model, state, p->q_start);
}

/// The first link that terms ask for elsewhere; link 0: none. The state is at the start.
static cav_status find_of_terms(const cav_problem *p, int lifted, cav_state *state, cav_thing *found) {
  cav_status status = CAV_OK;
  for (int l = 1; l < p->model->nlink && !found->link && !status; l++) {
    if (!is_left(p->model, l)) continue;
    cav_thing one = {.link = l, .joint = hung_by(p->model, l), .first = p->duration};
    if (one.joint >= 0) status = add_joint(p, state, &one);
    // asked for by a place, it is as any other thing
    if (one.joint >= 0 && !status && !is_moved(&one, 0))
      one = (cav_thing){.link = l, .joint = -1, .first = p->duration};
    for (int i = 0; i < p->nterm && one.joint < 0 && !status; i++) add_term(p, &p->term[i], state, &one);
    if (!status && is_moved(&one, lifted && one.joint < 0)) *found = one;
  }
  return status;
}

/// What the goal has elsewhere than the start, if no term asks for anything. The state is at the start, and comes to the goal.
static cav_status find_of_goal(const cav_problem *p, int lifted, cav_state *state, cav_thing *found) {
  const cav_model *m = p->model;
  if (p->cycle.on) return CAV_OK;
  for (int l = 1; l < m->nlink && !found->link; l++) {
    if (!is_left(m, l) || m->link[l].root != l) continue;
    cav_thing one = {.link = l, .joint = hung_by(m, l), .first = p->duration, .time = p->duration};
    const int hung = one.joint >= 0;
    cav_status status = hung ? way_to(p, p->q_goal, state, &one) : cav_position(m, state, p->q_start);
    if (!status && !hung) {
      scale3(one.way, -1, state->link[l].pos);
      status = cav_position(m, state, p->q_goal);
      add3(one.way, one.way, state->link[l].pos);
      one.rise = one.way[2];
    }
    if (status) return status;
    if (is_moved(&one, lifted && !hung)) *found = one;
  }
  return CAV_OK;
}

/// Whether something driven bears a link at the start: a ball on a beam, a cup on a tray. No hand is brought to the side of that.
static cav_status find_bearer(const cav_problem *p, int link, int *borne) {
  const cav_model *m = p->model;
  cav_state *state = cav_state_new(m);
  cav_status status = state ? CAV_OK : CAV_NO_MEMORY;
  *borne = 0;
  // contacts are listed that are so far apart
  if (state) state->options.smoothing = touching;
  if (!status) status = cav_position(m, state, p->q_start);
  for (int i = 0; !status && i < state->ncontact; i++) {
    const cav_contact *c = &state->contact[i];
    const int other = c->link1 == link ? c->link2 : c->link2 == link ? c->link1 : 0;
    const double up = c->link2 == link ? c->frame[2] : -c->frame[2];
    if (other > 0 && m->link[other].driven && c->dist <= touching && up >= upward) *borne = 1;
  }
  cav_state_free(state);
  return status;
}

/// When a term first brings something driven to where a link is at the start, as a foot to a ball that is to be kicked.
static cav_status find_met(const cav_problem *p, cav_state *state, cav_thing *thing) {
  const cav_model *m = p->model;
  cav_status status = cav_position(m, state, p->q_start);
  for (int i = 0; i < p->nterm && !status; i++) {
    const cav_term *term = &p->term[i];
    const int link = cav_term_placed(m, term);
    if (link <= 0 || !m->link[link].driven || term->component >= 0 || term->use == CAV_USE_RANGE) continue;
    if (!cav_term_asks(term)) continue;
    if (!(term->from > 0 && term->from < thing->time) || (thing->met > 0 && term->from >= thing->met)) continue;
    double target[CAV_SENSOR_DIM_MAX], centre[3], n[3], lowest;
    cav_term_target(term, term->from, 3, target);
    centre_of(m, state, thing->link, centre);
    sub3(n, target, centre);
    const double far = norm3(n);
    normalise3(n);
    if (far <= cav_thing_surface(m, state, thing->link, n, centre, &lowest) + brought) thing->met = term->from;
  }
  return status;
}

cav_status cav_thing_find(const cav_problem *problem, int lifted, cav_state *state, cav_thing *thing) {
  *thing = (cav_thing){.link = 0, .joint = -1};
  int borne = 0;
  cav_status status = cav_position(problem->model, state, problem->q_start);
  if (!status) status = find_of_terms(problem, lifted, state, thing);
  if (!status && !thing->link) status = find_of_goal(problem, lifted, state, thing);
  if (!status && thing->link) status = find_bearer(problem, thing->link, &borne);
  if (borne) thing->link = 0;
  if (!status && thing->link) status = find_met(problem, state, thing);
  return status;
}

double cav_thing_surface(const cav_model *m, const cav_state *state, int link, const double n[3], double centre[3],
                         double *lowest) {
  double out = 0;
  centre_of(m, state, link, centre);
  *lowest = INFINITY;
  for (int g = 0; g < m->ngeom; g++) {
    if (m->geom[g].link != link || !(m->geom[g].contype || m->geom[g].conaffinity)) continue;
    cav_pose pose;
    double arm[3];
    cav_object_pose(m, state, CAV_OBJECT_GEOM, g, &pose);
    sub3(arm, pose.pos, centre);
    out = fmax(out, dot3(arm, n) + cav_geom_exit(m, g, &pose, n));
    *lowest = fmin(*lowest, cav_geom_bottom(m, g, &pose));
  }
  return out;
}

cav_term cav_leading_term(cav_sensor_type type, cav_object_type object_type, int object, const double *target) {
  cav_term term = {.name = "hand", .quantity = CAV_QUANTITY_SENSOR, .use = CAV_USE_COST, .target = target};
  term.sensor = (cav_sensor){.name = "", .type = type, .dim = 3, .object_type = object_type, .object = object};
  term.component = -1, term.scale = 1, term.weight = weight, term.within = INFINITY;
  return term;
}
