/// A hand to what has to be pushed, a door among them. Where a body that no actuator moves is asked for elsewhere, the helper
/// forces of the first stages carry it there: they roll it along, since sliding costs more of them, and nothing brings a hand to
/// it when they fade. So one is brought there first: the geom of a driven tree that serves best and of these is nearest to the
/// body, to the side opposite to the way, at the height of the body's centre or as low as it can be over the ground.
/// A touch sensor reads nothing until something touches, and has no derivative there: where a force is asked of one, what
/// serves best is brought to the surface first, where it is nearest within the sensor's site, or where other terms want it.
#include "hand.h"

#include <math.h>

#include "extent.h"
#include "math3.h"
#include "quantity.h"
#include "role.h"
#include "schedule.h"
#include "thing.h"

/// m: gap over the ground of what pushes.
static const double clear = 0.005;

/// Fractions of the time until the target from which on a hand pushes, and until when, where it is wanted elsewhere at the end.
static const double begins = 0.3, leaves_at = 0.7;

/// Fraction of the schedule's way where contacts are sharp, and stages from there.
static const double sharp = 0.87;
enum { STAGES = 6 };

enum { SENSED = 3 };

/// Whether a link carries no other.
static int is_last(const cav_model *m, int link) {
  for (int l = link + 1; l < m->nlink; l++)
    if (m->link[l].parent == link) return 0;
  return 1;
}

/// How well a geom serves to push: SENSED of what a sensor is to feel, 2 of a hand, 1 of the last link of a limb, 0 of others.
static int grade_of(const cav_model *m, const cav_roles *roles, int geom) {
  const int link = m->geom[geom].link, hand[] = {CAV_ROLE_RIGHT_HAND, CAV_ROLE_LEFT_HAND, CAV_ROLE_HAND};
  for (int k = 0; k < 3; k++)
    if (roles->body[hand[k]] > 0 && m->body[roles->body[hand[k]]].link == link) return 2;
  return is_last(m, link);
}

/// The geom of a driven tree that can touch the link, serves best and of these is nearest to a place; -1: there is none. One that
/// a sensor is to feel serves best.
static cav_status find_geom(const cav_model *m, cav_state *state, const double *q, int link, const double place[3],
                            const cav_sensor *feels, int *best) {
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
    cav_object_pose(m, state, CAV_OBJECT_GEOM, geom, &pose);
    sub3(arm, pose.pos, place);
    const int grade = feels && cav_touch_sees(m, feels, geom) ? SENSED : grade_of(m, &roles, geom);
    if (grade < best_grade || (grade == best_grade && norm3(arm) >= least)) continue;
    best_grade = grade, least = norm3(arm), *best = geom;
  }
  return status;
}

/// Where a geom pushes a thing from, at the start, in the frame of the thing's body.
static void find_place(const cav_model *m, const cav_state *state, const cav_thing *t, int geom, double away,
                       double place[3]) {
  static const double down[3] = {0, 0, -1};
  double back[3], ahead[3], centre[3], lowest, far[3];
  cav_pose hand, body;
  scale3(back, -1, t->way);
  back[2] = 0;
  normalise3(back);
  scale3(ahead, -1, back);
  const double out = cav_thing_surface(m, state, t->link, back, centre, &lowest);
  cav_object_pose(m, state, CAV_OBJECT_GEOM, geom, &hand);
  axpy3(far, centre, out + away * cav_geom_reach(m, geom, &hand, ahead), back);
  far[2] = fmax(far[2], lowest + cav_geom_reach(m, geom, &hand, down) + clear);
  cav_object_pose(m, state, CAV_OBJECT_XBODY, m->link[t->link].body, &body);
  sub3(far, far, body.pos);
  rotate_back(place, body.rotation, far);
}

/// Whether a link is wanted elsewhere than at the thing at the end: by its place, or that of what hangs on the world as it does,
/// or by its joints.
static int is_wanted_back(const cav_problem *p, int link) {
  const cav_model *m = p->model;
  const cav_link *root = &m->link[m->link[link].root];
  const int hangs = root->njoint == 0 || m->joint[root->joint].type != CAV_JOINT_FREE;
  int wanted = 0;
  for (int i = 0; i < p->nterm && !wanted; i++) {
    const cav_term *term = &p->term[i];
    const int last = (term->to < 0 || term->to >= p->duration) && term->from > 0 && cav_term_asks(term);
    const int of = cav_term_placed(m, term);
    const int placed = of == link || (of > 0 && hangs && m->link[of].root == m->link[link].root);
    const int joints =
        term->quantity == CAV_QUANTITY_CONFIGURATION && (term->dofs == CAV_DOFS_ALL || term->dofs == CAV_DOFS_JOINTS);
    wanted = last && (placed || joints);
  }
  return wanted;
}

static void lay(const cav_problem *p, const cav_state *state, const cav_thing *t, int geom, double away,
                cav_hand *hand) {
  const cav_model *m = p->model;
  const int body = m->link[t->link].body;
  cav_pose pose;
  find_place(m, state, t, geom, away, hand->place);
  hand->hung = t->joint >= 0;
  hand->found = isfinite(hand->place[2]) ? CAV_HAND_TERMS : 0; // not where it touches by listed pairs alone
  cav_object_pose(m, state, CAV_OBJECT_XBODY, body, &pose);
  column3(hand->upright, pose.rotation, 2);
  hand->term[0] = cav_leading_term(CAV_SENSOR_FRAMEPOS, CAV_OBJECT_GEOM, geom, hand->place);
  hand->term[0].sensor.referred = 1, hand->term[0].sensor.reference_type = CAV_OBJECT_XBODY;
  hand->term[0].sensor.reference = body;
  hand->term[0].from = begins * t->time;
  const int leaves = t->time >= p->duration && is_wanted_back(p, m->geom[geom].link);
  hand->term[0].to = leaves ? fmax(leaves_at * t->time, hand->term[0].from + p->timestep) : t->time;
  // a hinge or a slide keeps it from tumbling
  const int still = hand->hung ? 1 : 2;
  const cav_object_type kind = hand->hung ? CAV_OBJECT_BODY : CAV_OBJECT_XBODY;
  if (hand->found) hand->found = still + 1 + leaves;
  hand->term[1] = cav_leading_term(CAV_SENSOR_FRAMEZAXIS, CAV_OBJECT_XBODY, body, hand->upright);
  hand->term[1].to = t->time;
  cav_object_pose(m, state, kind, body, &pose);
  copy3(hand->still, pose.pos);
  hand->term[still] = cav_leading_term(CAV_SENSOR_FRAMEPOS, kind, body, hand->still);
  hand->term[still].to = hand->term[0].from;
  add3(hand->there, hand->still, t->way);
  hand->term[still + 1] = cav_leading_term(CAV_SENSOR_FRAMEPOS, kind, body, hand->there);
  hand->term[still + 1].from = hand->term[0].to, hand->term[still + 1].to = t->time;
}

/// What has to be touched: what a touch sensor looks at that is to feel a force, and when.
typedef struct touched {
  const cav_sensor *sensor;
  double from, to;
} touched;

static int find_touched(const cav_problem *p, touched *found) {
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    if (term->quantity != CAV_QUANTITY_SENSOR || term->sensor.type != CAV_SENSOR_TOUCH) continue;
    double target, to = term->to < 0 ? p->duration : fmin(term->to, p->duration);
    cav_term_target(term, to, 1, &target);
    if (term->use == CAV_USE_RANGE) target += term->lower;
    if (!(target > 0) || !cav_term_asks(term)) continue;
    *found = (touched){&term->sensor, fmax(term->from, 0), to};
    return 1;
  }
  return 0;
}

/// Where a term on its place wants the link of a geom while it touches, over a place at; 0: none does.
static int place_asked(const cav_problem *p, const touched *t, int link, double at[3]) {
  int found = 0;
  for (int i = 0; i < p->nterm; i++) {
    const cav_term *term = &p->term[i];
    const double to = term->to < 0 ? p->duration : term->to;
    double target[CAV_SENSOR_DIM_MAX];
    if ((term->use == CAV_USE_RANGE && !cav_term_is_band(term)) || cav_term_placed(p->model, term) != link) continue;
    if (term->from > t->to || to < t->from) continue;
    cav_term_target(term, fmin(to, t->to), 3, target);
    for (int k = 0; k < 3; k++)
      if (term->component < 0 || term->component == k) at[k] = target[k];
    found = 1;
  }
  return found;
}

/// The nearest place of a box's zone, of a ball's for other shapes.
static void clamp_to_site(const cav_model *m, const cav_state *state, int index, double at[3]) {
  const cav_site *site = &m->site[index];
  cav_pose pose;
  double d[3], local[3];
  cav_object_pose(m, state, CAV_OBJECT_SITE, index, &pose);
  sub3(d, at, pose.pos);
  rotate_back(local, pose.rotation, d);
  if (site->type == CAV_GEOM_BOX) {
    for (int k = 0; k < 3; k++) local[k] = fmin(fmax(local[k], -site->size[k]), site->size[k]);
  } else if (norm3(local) > site->size[0])
    scale3(local, site->size[0] / norm3(local), local);
  transform(at, pose.pos, pose.rotation, local);
}

/// The place on the surface of a geom nearest to x, of round ones and meshes towards their middle, and the normal out of it.
static void surface_near(const cav_model *m, int g, const cav_pose *pose, const double x[3], double at[3],
                         double normal[3]) {
  const cav_geom *geom = &m->geom[g];
  double d[3], local[3];
  column3(normal, pose->rotation, 2);
  sub3(d, x, pose->pos);
  if (geom->type == CAV_GEOM_PLANE || geom->type == CAV_GEOM_HFIELD) {
    axpy3(at, x, -dot3(d, normal), normal);
    return;
  }
  if (geom->type != CAV_GEOM_BOX) {
    if (norm3(d) > 0) scale3(normal, 1 / norm3(d), d);
    axpy3(at, pose->pos, cav_geom_exit(m, g, pose, normal), normal);
    return;
  }
  int face = 0;
  double most = -INFINITY;
  rotate_back(local, pose->rotation, d);
  for (int k = 0; k < 3; k++) {
    const double out = fabs(local[k]) - geom->size[k];
    if (out > most) most = out, face = k;
    local[k] = fmin(fmax(local[k], -geom->size[k]), geom->size[k]);
  }
  column3(normal, pose->rotation, face);
  local[face] = copysign(geom->size[face], dot3(d, normal));
  if (dot3(d, normal) < 0) scale3(normal, -1, normal);
  transform(at, pose->pos, pose->rotation, local);
}

/// How a geom that an actuator moves may come to one that none moves.
typedef struct meeting {
  int mover, ground, grade;
  double far; ///< m, at the start
  double at[3], normal[3];
} meeting;

/// Of the pair of a mover and what it may touch; the state is at the start.
static void weigh_meeting(const cav_problem *p, const cav_state *state, const cav_roles *roles, const touched *t,
                          int mover, int ground, meeting *best) {
  const cav_model *m = p->model;
  const int on_ground = cav_touch_sees(m, t->sensor, ground);
  cav_pose hand, pose;
  double x[3], d[3];
  // a sensor that moves is to press on a solid sooner than on the ground
  const int solid = m->geom[ground].type != CAV_GEOM_PLANE && m->geom[ground].type != CAV_GEOM_HFIELD;
  meeting one = {.mover = mover, .ground = ground, .grade = on_ground ? grade_of(m, roles, mover) : solid};
  cav_object_pose(m, state, CAV_OBJECT_GEOM, mover, &hand);
  cav_object_pose(m, state, CAV_OBJECT_GEOM, ground, &pose);
  copy3(x, hand.pos);
  if (place_asked(p, t, m->geom[mover].link, x)) one.grade = 3;
  if (on_ground && t->sensor->object_type == CAV_OBJECT_SITE) clamp_to_site(m, state, t->sensor->object, x);
  surface_near(m, ground, &pose, x, one.at, one.normal);
  sub3(d, hand.pos, one.at);
  one.far = norm3(d);
  if (one.grade > best->grade || (one.grade == best->grade && one.far < best->far)) *best = one;
}

/// The best of them, mover -1 where there is none.
static cav_status find_meeting(const cav_problem *p, cav_state *state, const touched *t, meeting *best) {
  const cav_model *m = p->model;
  cav_roles roles;
  *best = (meeting){.mover = -1, .grade = -1};
  cav_status status = cav_roles_find(m, state, &roles);
  if (!status) status = cav_position(m, state, p->q_start);
  for (int i = 0; i < m->npair && !status; i++) {
    const int pair[] = {m->pair[i].geom1, m->pair[i].geom2};
    for (int k = 0; k < 2; k++) {
      const int mover = pair[k], ground = pair[1 - k];
      if (!cav_touch_sees(m, t->sensor, mover) && !cav_touch_sees(m, t->sensor, ground)) continue;
      if (!m->link[m->geom[mover].link].driven || m->link[m->geom[ground].link].driven) continue;
      weigh_meeting(p, state, &roles, t, mover, ground, best);
    }
  }
  return status;
}

/// How far a geom's middle is from the surface it lies on with its broadest side, m: a shin that kneels lies flat,
/// whichever way it points before; of a mesh as far as it reaches as it is.
static double lying(const cav_model *m, int g, const cav_pose *pose, const double back[3]) {
  const cav_geom *geom = &m->geom[g];
  switch (geom->type) {
    case CAV_GEOM_CAPSULE:
      return geom->size[0];
    case CAV_GEOM_CYLINDER:
      return fmin(geom->size[0], geom->size[1]);
    case CAV_GEOM_BOX:
    case CAV_GEOM_ELLIPSOID:
      return fmin(geom->size[0], fmin(geom->size[1], geom->size[2]));
    default:
      return cav_geom_reach(m, g, pose, back);
  }
}

/// One term: the mover at the surface while the sensor is to feel something; with any side, if that is all one to the
/// sensor.
static void lay_meeting(const cav_model *m, const cav_state *state, const touched *t, const meeting *one, double away,
                        cav_hand *hand) {
  const int link = m->geom[one->ground].link, body = m->link[link].body;
  cav_pose mover, pose;
  double back[3];
  scale3(back, -1, one->normal);
  cav_object_pose(m, state, CAV_OBJECT_GEOM, one->mover, &mover);
  const int lies = t->sensor->object_type != CAV_OBJECT_SITE && cav_touch_sees(m, t->sensor, one->mover);
  const double reach = lies ? lying(m, one->mover, &mover, back) : cav_geom_reach(m, one->mover, &mover, back);
  axpy3(hand->place, one->at, away * reach, one->normal);
  hand->term[0] = cav_leading_term(CAV_SENSOR_FRAMEPOS, CAV_OBJECT_GEOM, one->mover, hand->place);
  hand->term[0].from = t->from, hand->term[0].to = t->to;
  hand->found = isfinite(dot3(hand->place, hand->place)), hand->touches = 1;
  if (link == 0) return;
  double d[3];
  cav_object_pose(m, state, CAV_OBJECT_XBODY, body, &pose);
  sub3(d, hand->place, pose.pos);
  rotate_back(hand->place, pose.rotation, d);
  hand->term[0].sensor.referred = 1, hand->term[0].sensor.reference_type = CAV_OBJECT_XBODY;
  hand->term[0].sensor.reference = body;
}

cav_status cav_hand_find(const cav_problem *problem, double away, cav_hand *hand) {
  const cav_model *m = problem->model;
  cav_thing t = {.link = 0};
  *hand = (cav_hand){.found = 0};
  cav_state *state = cav_state_new(m);
  cav_status status = state ? cav_thing_find(problem, 0, state, &t) : CAV_NO_MEMORY;
  int geom = -1;
  touched touch = {.sensor = NULL};
  const int feels = find_touched(problem, &touch);
  if (!status && t.link) status = cav_position(m, state, problem->q_start);
  if (!status && t.link)
    status = find_geom(m, state, problem->q_start, t.link, state->link[t.link].pos, feels ? touch.sensor : NULL, &geom);
  if (!status && geom >= 0) lay(problem, state, &t, geom, away, hand);
  meeting one = {.mover = -1};
  if (!status && !hand->found && feels) status = find_meeting(problem, state, &touch, &one);
  if (!status && one.mover >= 0) lay_meeting(m, state, &touch, &one, away, hand);
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
