/// A hand to what has to be pushed. Where a body that no actuator moves is asked for elsewhere, the helper forces of the first
/// stages carry it there: they roll it along, since sliding costs more of them, and nothing brings a hand to it when they
/// fade. So one is brought there first: the geom of a driven tree that serves best and of these is nearest to the
/// body, to the side opposite to the way, at the height of the body's centre or as low as it can be over the ground.
#include "hand.h"

#include <math.h>

#include "math3.h"
#include "role.h"
#include "schedule.h"
#include "transcription.h"

/// m: a way from which a body has to be pushed; gap over the ground of what pushes.
static const double least_way = 0.02, clear = 0.005;

/// Weight of the terms, and the fraction of the time until the target from which on a hand pushes.
static const double weight = 300, begins = 0.3;

/// Fraction of the schedule's way where contacts are sharp, and stages from there.
static const double sharp = 0.87;
enum { STAGES = 6 };

/// What has to be moved.
typedef struct thing {
  int link;
  double way[3], time;
} thing;

/// Whether no actuator moves a link that can move.
static int is_left(const cav_model *m, int link) { return link > 0 && !m->link[link].driven; }

/// Along the ground, and far enough.
static int is_pushed(const double way[3]) {
  const double along = hypot(way[0], way[1]);
  return along >= least_way && along >= fabs(way[2]);
}

/// Adds what a term asks for of a link's place. The state is at the start.
static void add_term(const cav_problem *p, const cav_term *term, cav_state *state, thing *found) {
  const cav_sensor *s = &term->sensor;
  double at[CAV_SENSOR_DIM_MAX], target[CAV_SENSOR_DIM_MAX];
  const int place = term->quantity == CAV_QUANTITY_SENSOR && s->type == CAV_SENSOR_FRAMEPOS && !s->referred;
  if (!place || term->use == CAV_USE_RANGE || (term->use == CAV_USE_COST && !(term->weight > 0))) return;
  const double time = term->to < 0 ? p->duration : fmin(term->to, p->duration);
  // the last one is where it goes
  if (cav_object_link(p->model, s->object_type, s->object) != found->link || time < found->time) return;
  cav_sensor_read(p->model, state, s, at);
  cav_term_target(term, time, s->dim, target);
  for (int k = 0; k < 3; k++)
    if (term->component < 0 || term->component == k) found->way[k] = target[k] - at[k];
  found->time = time;
}

/// The first link that terms ask for elsewhere; link 0: none.
static void find_of_terms(const cav_problem *p, cav_state *state, thing *found) {
  for (int l = 1; l < p->model->nlink && !found->link; l++) {
    if (!is_left(p->model, l)) continue;
    thing one = {.link = l};
    for (int i = 0; i < p->nterm; i++) add_term(p, &p->term[i], state, &one);
    if (is_pushed(one.way)) *found = one;
  }
}

/// What the goal has elsewhere than the start, if no term asks for anything. The state is at the start, and comes to the goal.
static cav_status find_of_goal(const cav_problem *p, cav_state *state, thing *found) {
  const cav_model *m = p->model;
  if (p->cycle.on) return CAV_OK;
  for (int l = 1; l < m->nlink && !found->link; l++) {
    if (!is_left(m, l) || m->link[l].root != l) continue;
    thing one = {.link = l, .time = p->duration};
    cav_status status = cav_position(m, state, p->q_start);
    if (status) return status;
    scale3(one.way, -1, state->link[l].pos);
    if ((status = cav_position(m, state, p->q_goal))) return status;
    add3(one.way, one.way, state->link[l].pos);
    if (is_pushed(one.way)) *found = one;
  }
  return CAV_OK;
}

static void pose_of(const cav_model *m, const cav_state *state, int geom, cav_pose *pose) {
  cav_object_pose(m, state, CAV_OBJECT_GEOM, geom, pose);
}

/// How far the surface of a geom is from its centre along the unit direction n; of a capsule's ends what its cylinder has.
static double exit_of(const cav_geom *geom, const cav_pose *pose, const double n[3]) {
  double d[3], least = INFINITY;
  const double *s = geom->size;
  rotate_back(d, pose->rotation, n);
  const double across = hypot(d[0], d[1]);
  switch (geom->type) {
    case CAV_GEOM_SPHERE:
      return s[0];
    case CAV_GEOM_ELLIPSOID:
      return 1 / sqrt(pow(d[0] / s[0], 2) + pow(d[1] / s[1], 2) + pow(d[2] / s[2], 2));
    case CAV_GEOM_CAPSULE:
    case CAV_GEOM_CYLINDER:
      if (across > 0) least = s[0] / across;
      return fabs(d[2]) > 0 ? fmin(least, (s[1] + (geom->type == CAV_GEOM_CAPSULE ? s[0] : 0)) / fabs(d[2])) : least;
    case CAV_GEOM_BOX:
    case CAV_GEOM_MESH: // its box
      for (int k = 0; k < 3; k++)
        if (d[k] != 0) least = fmin(least, s[k] / fabs(d[k]));
      return least;
    default:
      return 0;
  }
}

/// The centre of a link's mass, how far its surface is from there along n, and how low it comes.
static double surface_of(const cav_model *m, const cav_state *state, int link, const double n[3], double centre[3],
                         double *lowest) {
  static const double down[3] = {0, 0, 1};
  double out = 0;
  transform(centre, state->link[link].pos, state->link[link].rotation, m->link[link].com);
  *lowest = INFINITY;
  for (int g = 0; g < m->ngeom; g++) {
    if (m->geom[g].link != link || !(m->geom[g].contype || m->geom[g].conaffinity)) continue;
    cav_pose pose;
    double arm[3];
    pose_of(m, state, g, &pose);
    sub3(arm, pose.pos, centre);
    out = fmax(out, dot3(arm, n) + exit_of(&m->geom[g], &pose, n));
    *lowest = fmin(*lowest, pose.pos[2] - cav_geom_reach(&m->geom[g], &pose, down));
  }
  return out;
}

/// Whether a link carries no other.
static int is_last(const cav_model *m, int link) {
  for (int l = link + 1; l < m->nlink; l++)
    if (m->link[l].parent == link) return 0;
  return 1;
}

/// How well a geom serves to push: 2 of a hand, 1 of the last link of a limb, 0 of others.
static int grade_of(const cav_model *m, const cav_roles *roles, int geom) {
  const int link = m->geom[geom].link, hand[] = {CAV_ROLE_RIGHT_HAND, CAV_ROLE_LEFT_HAND, CAV_ROLE_HAND};
  for (int k = 0; k < 3; k++)
    if (roles->body[hand[k]] > 0 && m->body[roles->body[hand[k]]].link == link) return 2;
  return is_last(m, link);
}

/// The geom of a driven tree that can touch the link, serves best and of these is nearest to a place; -1: there is none.
static cav_status find_geom(const cav_model *m, cav_state *state, const double *q, int link, const double place[3],
                            int *best) {
  cav_roles roles;
  int best_grade = -1;
  double least = INFINITY;
  *best = -1;
  cav_status status = cav_roles_find(m, state, &roles);
  if (!status) status = cav_position(m, state, q);
  for (int i = 0; i < m->npair && !status; i++) {
    const int one = m->pair[i].geom1, two = m->pair[i].geom2;
    const int geom = m->geom[one].link == link ? two : m->geom[two].link == link ? one : -1;
    if (geom < 0 || !m->link[m->geom[geom].link].driven) continue;
    cav_pose pose;
    double arm[3];
    pose_of(m, state, geom, &pose);
    sub3(arm, pose.pos, place);
    const int grade = grade_of(m, &roles, geom);
    if (grade < best_grade || (grade == best_grade && norm3(arm) >= least)) continue;
    best_grade = grade, least = norm3(arm), *best = geom;
  }
  return status;
}

/// Where a geom pushes a thing from, at the start, in the frame of the thing's body.
static void find_place(const cav_model *m, const cav_state *state, const thing *t, int geom, double away,
                       double place[3]) {
  static const double up[3] = {0, 0, 1};
  double back[3], centre[3], lowest, far[3];
  cav_pose hand, body;
  scale3(back, -1, t->way);
  back[2] = 0;
  normalise3(back);
  const double out = surface_of(m, state, t->link, back, centre, &lowest);
  pose_of(m, state, geom, &hand);
  axpy3(far, centre, out + away * cav_geom_reach(&m->geom[geom], &hand, back), back);
  far[2] = fmax(far[2], lowest + cav_geom_reach(&m->geom[geom], &hand, up) + clear);
  cav_object_pose(m, state, CAV_OBJECT_XBODY, m->link[t->link].body, &body);
  sub3(far, far, body.pos);
  rotate_back(place, body.rotation, far);
}

/// A cost on what a frame sensor of an object reads, from a time on.
static cav_term term_of(cav_sensor_type type, cav_object_type object_type, int object, const double *target) {
  cav_term term = {.name = "hand", .quantity = CAV_QUANTITY_SENSOR, .use = CAV_USE_COST, .target = target};
  term.sensor = (cav_sensor){.name = "", .type = type, .dim = 3, .object_type = object_type, .object = object};
  term.component = -1, term.scale = 1, term.weight = weight, term.within = INFINITY;
  return term;
}

static void lay(const cav_model *m, const cav_state *state, const thing *t, int geom, double away, cav_hand *hand) {
  const int body = m->link[t->link].body;
  cav_pose pose;
  find_place(m, state, t, geom, away, hand->place);
  hand->found = isfinite(hand->place[2]); // not where it touches by listed pairs alone
  cav_object_pose(m, state, CAV_OBJECT_XBODY, body, &pose);
  column3(hand->upright, pose.rotation, 2);
  hand->term[0] = term_of(CAV_SENSOR_FRAMEPOS, CAV_OBJECT_GEOM, geom, hand->place);
  hand->term[0].sensor.referred = 1, hand->term[0].sensor.reference_type = CAV_OBJECT_XBODY;
  hand->term[0].sensor.reference = body;
  hand->term[0].from = begins * t->time;
  hand->term[1] = term_of(CAV_SENSOR_FRAMEZAXIS, CAV_OBJECT_XBODY, body, hand->upright);
  copy3(hand->still, pose.pos);
  hand->term[2] = term_of(CAV_SENSOR_FRAMEPOS, CAV_OBJECT_XBODY, body, hand->still);
  for (int i = 0; i < CAV_HAND_TERMS; i++) hand->term[i].to = i == 2 ? hand->term[0].from : t->time;
}

cav_status cav_hand_find(const cav_problem *problem, double away, cav_hand *hand) {
  const cav_model *m = problem->model;
  thing t = {.link = 0};
  *hand = (cav_hand){.found = 0};
  cav_state *state = cav_state_new(m);
  cav_status status = state ? cav_position(m, state, problem->q_start) : CAV_NO_MEMORY;
  if (!status) find_of_terms(problem, state, &t);
  if (!status && !t.link) status = find_of_goal(problem, state, &t);
  int geom = -1;
  if (!status && t.link) status = cav_position(m, state, problem->q_start);
  if (!status && t.link) status = find_geom(m, state, problem->q_start, t.link, state->link[t.link].pos, &geom);
  if (!status && geom >= 0) lay(m, state, &t, geom, away, hand);
  cav_state_free(state);
  return status;
}

cav_schedule cav_hand_schedule(const cav_schedule *schedule) {
  cav_schedule rest = *schedule;
  rest.first = cav_schedule_at(schedule, sharp);
  rest.stages = STAGES;
  rest.kinematics = 1;
  return rest;
}
