/// Both hands to a free body that is asked for elsewhere, or to a door or a drawer. Where what has hands stands on a free base,
/// one hand alone turns or tips what is heavy, and a guess in which the base stays where it is pushes as far as arms reach. So
/// both are led: to the side that it is pushed from, as low as it does not tip, or where it is to be lifted to its two sides,
/// over what is in its way; the base goes along, as far as solids let it. Terms of a cost lead, and are no part of the problem.
#include "carry.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "clear.h"
#include "extent.h"
#include "math3.h"
#include "quantity.h"
#include "role.h"
#include "thing.h"
#include "transcription.h"

/// Of the time until the body is asked for last: from when on hands are there, at the latest of that until it is first asked
/// for elsewhere, and until when, where they are wanted elsewhere at the end.
static const double begins = 0.3, before_first = 0.6, leaves = 0.7;

/// Of the height at which a body would tip over its edge; of its half width, and of the reach of an arm, how far hands are.
static const double steady = 0.9, within_width = 0.7, reached = 0.9;

/// Cosine of a way that leads back to the base.
static const double nearer = 0.5;

/// Speed at which the base comes to it, m/s, the way from which it has to, m, and how deep it may come into solids, m.
static const double pace = 0.8, least_step = 0.05, shallow = 1e-3;

/// m: as deep what is carried may come into solids on its way, by how much it is raised at a time, and at most; part of the time
/// for which it is.
static const double sunk = 0.01, higher = 0.02, highest = 0.6, raised = 0.3;

/// How much lower than hands that hang places are that the root stoops for, m.
static const double stooped = 0.1;

/// Part of the weight of what leads hands that keeps the root at its height.
static const double lightly = 0.3;

/// What is known of the hands while places are found.
typedef struct hands {
  const cav_model *m;
  cav_state *state; ///< at the start
  const cav_problem *problem;
  cav_thing thing;
  int geom[2];      ///< of the right and the left hand
  double at[2][3];  ///< m, where they are
  int first[2];     ///< links that the arms begin with
  double reach;     ///< m, of an arm
  double toward[2]; ///< unit, along the ground, from the root to the body
  double friction;  ///< of the body on the ground
  const double *root;
} hands;

/// The geom of a hand that can touch the link; -1: none.
static int geom_of(const cav_model *m, const cav_roles *roles, cav_role role, int link) {
  const int body = roles->body[role], meant = roles->geom[role];
  int best = -1;
  for (int i = 0; i < m->npair && body > 0; i++) {
    const int one = m->pair[i].geom1, two = m->pair[i].geom2;
    const int geom = m->geom[one].link == link ? two : m->geom[two].link == link ? one : -1;
    if (geom < 0 || (m->geom[geom].body != body && geom != meant)) continue;
    if (best < 0 || geom == meant) best = geom;
  }
  return best;
}

/// The joint of a link that is free in the world; -1: it is not.
static int free_joint(const cav_model *m, int link) {
  const cav_link *root = &m->link[m->link[link].root];
  return root->njoint == 1 && m->joint[root->joint].type == CAV_JOINT_FREE ? root->joint : -1;
}

/// Sliding friction of the body against the world.
static double ground_friction(const cav_model *m, int link) {
  double least = INFINITY;
  for (int i = 0; i < m->npair; i++) {
    const cav_pair *pair = &m->pair[i];
    const int one = m->geom[pair->geom1].link, two = m->geom[pair->geom2].link;
    if ((one == link && two == 0) || (two == link && one == 0)) least = fmin(least, pair->friction[0]);
  }
  return isfinite(least) ? least : 1;
}

static int is_still(const cav_problem *p, int joint) {
  const double *v = p->v_start + p->model->joint[joint].dof;
  for (int k = 0; k < (p->model->joint[joint].type == CAV_JOINT_FREE ? 6 : 1); k++)
    if (v[k] != 0) return 0;
  return 1;
}

/// Whether terms ask for the goal's posture of some dofs, or of all, at the end.
static int is_asked_at_end(const cav_problem *p, cav_dof_set dofs) {
  int asked = 0;
  for (int i = 0; i < p->nterm && !asked; i++) {
    const cav_term *term = &p->term[i];
    const int last = term->to < 0 || term->to >= p->duration;
    asked = term->quantity == CAV_QUANTITY_CONFIGURATION && last && term->from > 0 && cav_term_asks(term) &&
            (term->dofs == CAV_DOFS_ALL || term->dofs == dofs);
  }
  return asked;
}

/// Whether terms say where the root is at the end, or the goal has it elsewhere.
static int is_root_bound(const cav_problem *p, int root) {
  const double *a = p->q_start + p->model->joint[root].q, *b = p->q_goal + p->model->joint[root].q;
  return hypot(b[0] - a[0], b[1] - a[1]) >= CAV_THING_WAY || is_asked_at_end(p, CAV_DOFS_ROOT_LINEAR);
}

/// Length of an arm when it is stretched, m: from the body that it begins with, by those in between, to where the hand is.
static double arm_length(const hands *h, int hand, int first, const double at[3]) {
  double end[3], length = 0;
  copy3(end, at);
  for (int i = hand; i > 0; i = h->m->body[i].parent) {
    cav_pose pose;
    double part[3];
    cav_object_pose(h->m, h->state, CAV_OBJECT_XBODY, i, &pose);
    sub3(part, end, pose.pos);
    length += norm3(part);
    copy3(end, pose.pos);
    if (i == first) break;
  }
  return length;
}

/// Finds hands, arms and the way to the body; 0: there are none, or they cannot touch it.
static int find_hands(hands *h, const cav_roles *roles, int root) {
  const cav_model *m = h->m;
  const double *start = h->problem->q_start + m->joint[root].q;
  double body[3];
  for (int k = 0; k < 2; k++) {
    const cav_role role = k ? CAV_ROLE_LEFT_HAND : CAV_ROLE_RIGHT_HAND;
    cav_pose pose;
    h->geom[k] = geom_of(m, roles, role, h->thing.link);
    if (h->geom[k] < 0 || roles->limb[role] < 0) return 0;
    cav_object_pose(m, h->state, CAV_OBJECT_GEOM, h->geom[k], &pose);
    copy3(h->at[k], pose.pos);
    h->first[k] = m->body[roles->limb[role]].link;
    h->reach = fmax(h->reach, arm_length(h, m->geom[h->geom[k]].body, roles->limb[role], h->at[k]));
  }
  transform(body, h->state->link[h->thing.link].pos, h->state->link[h->thing.link].rotation,
            m->link[h->thing.link].com);
  const double x = body[0] - start[0], y = body[1] - start[1], far = hypot(x, y);
  h->root = start;
  h->toward[0] = far > 0 ? x / far : 1, h->toward[1] = far > 0 ? y / far : 0;
  h->friction = ground_friction(m, h->thing.link);
  return 1;
}

/// The horizontal axis of the body that is nearest to a horizontal direction, along it.
static void nearest_axis(const cav_pose *body, const double along[2], double axis[3]) {
  double most = 0;
  set3(axis, along[0], along[1], 0);
  for (int k = 0; k < 3; k++) {
    double one[3];
    column3(one, body->rotation, k);
    const double c = one[0] * along[0] + one[1] * along[1];
    if (fabs(c) <= most || fabs(one[2]) > 0.3) continue;
    most = fabs(c);
    set3(axis, copysign(1, c) * one[0], copysign(1, c) * one[1], 0);
  }
  normalise3(axis);
}

/// Where the hands hold the body, in the world: at its two sides as seen from the root.
static void find_sides(const hands *h, const cav_pose *body, double away, double place[2][3]) {
  const double left[2] = {-h->toward[1], h->toward[0]};
  for (int k = 0; k < 2; k++) {
    const double along[2] = {k ? left[0] : -left[0], k ? left[1] : -left[1]};
    double n[3], back[3], centre[3], lowest;
    cav_pose hand;
    nearest_axis(body, along, n);
    scale3(back, -1, n);
    cav_object_pose(h->m, h->state, CAV_OBJECT_GEOM, h->geom[k], &hand);
    const double out = cav_thing_surface(h->m, h->state, h->thing.link, n, centre, &lowest);
    axpy3(place[k], centre, out + away * cav_geom_reach(h->m, h->geom[k], &hand, back), n);
  }
}

/// The geom of the thing that comes farthest out along n: a handle, where it has one; -1: it touches by listed pairs alone.
static int outermost(const hands *h, const double n[3]) {
  int best = -1;
  double most = -INFINITY;
  for (int g = 0; g < h->m->ngeom; g++) {
    if (h->m->geom[g].link != h->thing.link || !(h->m->geom[g].contype || h->m->geom[g].conaffinity)) continue;
    cav_pose pose;
    cav_object_pose(h->m, h->state, CAV_OBJECT_GEOM, g, &pose);
    const double out = dot3(pose.pos, n) + cav_geom_exit(h->m, g, &pose, n);
    if (out > most + shallow) most = out, best = g;
  }
  return best;
}

/// Where they push it from, in the world: opposite to the way, side by side, where it does not tip.
static void find_back(const hands *h, double away, double place[2][3]) {
  static const double up[3] = {0, 0, 1}, down[3] = {0, 0, -1};
  double n[3] = {-h->thing.way[0], -h->thing.way[1], 0}, ahead[3], across[3], centre[3], lowest, none;
  normalise3(n);
  scale3(ahead, -1, n);
  set3(across, -n[1], n[0], 0); // to the right of who goes that way
  const double depth = cav_thing_surface(h->m, h->state, h->thing.link, n, centre, &lowest);
  const double edge = cav_thing_surface(h->m, h->state, h->thing.link, ahead, centre, &none);
  const int g = outermost(h, n);
  cav_pose back;
  if (g < 0) {
    for (int k = 0; k < 2; k++) set3(place[k], NAN, NAN, NAN);
    return;
  }
  cav_object_pose(h->m, h->state, CAV_OBJECT_GEOM, g, &back);
  const double width = cav_geom_exit(h->m, g, &back, across), bottom = cav_geom_bottom(h->m, g, &back),
               top = back.pos[2] + cav_geom_exit(h->m, g, &back, up);
  double side[3], off[3];
  sub3(side, h->at[1], h->at[0]);
  sub3(off, back.pos, centre);
  const double apart = fmin(within_width * width, 0.5 * hypot(side[0], side[1])), aside = dot3(off, across);
  for (int k = 0; k < 2; k++) {
    cav_pose hand;
    cav_object_pose(h->m, h->state, CAV_OBJECT_GEOM, h->geom[k], &hand);
    axpy3(place[k], centre, depth + away * cav_geom_reach(h->m, h->geom[k], &hand, ahead), n);
    axpy3(place[k], place[k], aside + (k ? -apart : apart), across);
    const double over = cav_geom_reach(h->m, h->geom[k], &hand, up),
                 under = cav_geom_reach(h->m, h->geom[k], &hand, down);
    const double tips = lowest + steady * edge / h->friction;
    const double high = h->thing.joint < 0 ? fmin(h->at[k][2], tips) : h->at[k][2];
    // hands thicker than a rail take its middle
    const int thin = top - over < bottom + under;
    place[k][2] = thin ? back.pos[2] : fmax(fmin(high, top - over), bottom + under);
  }
}

static void find_times(const cav_problem *p, const hands *h, double come, cav_carry *c) {
  const double end = h->thing.time;
  c->from = fmin(fmax(begins * end, come / pace), before_first * fmin(end, fmax(h->thing.first, begins * end)));
  const int held = c->lifts && h->thing.way[2] >= CAV_THING_WAY;
  c->to = !held && is_asked_at_end(p, CAV_DOFS_JOINTS) ? fmax(leaves * end, c->from + p->timestep) : end;
}

/// Adds a term on what they move.
static cav_term *push_term(cav_carry *c, cav_sensor_type type, cav_object_type kind, int body, const double *target) {
  cav_term *term = &c->term[c->found++];
  *term = cav_leading_term(type, kind, body, target);
  return term;
}

static void lay(const hands *h, const cav_pose *body, double place[2][3], cav_carry *c) {
  const cav_model *m = h->m;
  const int index = m->link[h->thing.link].body, hung = h->thing.joint >= 0;
  const cav_object_type kind = hung ? CAV_OBJECT_BODY : CAV_OBJECT_XBODY;
  cav_pose pose;
  c->found = 0;
  for (int k = 0; k < 2; k++) {
    double d[3];
    sub3(d, place[k], body->pos);
    rotate_back(c->place[k], body->rotation, d);
    cav_term *term = push_term(c, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_GEOM, h->geom[k], c->place[k]);
    term->sensor.referred = 1, term->sensor.reference_type = CAV_OBJECT_XBODY;
    term->sensor.reference = index;
    term->from = c->from, term->to = c->to;
  }
  cav_object_pose(m, h->state, kind, index, &pose);
  column3(c->upright, body->rotation, 2);
  copy3(c->still, pose.pos);
  add3(c->there, pose.pos, h->thing.way);
  if (!hung) push_term(c, CAV_SENSOR_FRAMEZAXIS, kind, index, c->upright)->to = h->thing.time;
  push_term(c, CAV_SENSOR_FRAMEPOS, kind, index, c->still)->to = c->from;
  // hands that go up would take the root along, where nothing weighs yet; it stoops for what is lower than hands that hang
  c->height[2] = h->root[2];
  const int stoops = fmin(place[0][2], place[1][2]) < fmin(h->at[0][2], h->at[1][2]) - stooped;
  if (c->over > 0 && !stoops) {
    cav_term *level = push_term(c, CAV_SENSOR_FRAMEPOS, CAV_OBJECT_XBODY, m->joint[c->root].body, c->height);
    level->component = 2, level->weight *= lightly, level->to = h->thing.time;
  }
  if (c->to < h->thing.time) {
    cav_term *there = push_term(c, CAV_SENSOR_FRAMEPOS, kind, index, c->there);
    there->from = c->to, there->to = h->thing.time;
  }
  for (int k = 0; k < 2; k++)
    if (!isfinite(norm3(c->place[k]))) c->found = 0;
}

/// Whether the body is asked for nearer to the root: hands on its far side would lead the root through it.
static int is_pulled(const hands *h) {
  const double *way = h->thing.way, along = way[0] * h->toward[0] + way[1] * h->toward[1];
  return along < -nearer * hypot(way[0], way[1]);
}

/// How far the root has to go for a place to be in reach, m: the way there, which it goes.
static void step_to(const hands *h, double at[2], const double place[3], double way[2]) {
  const double d[2] = {place[0] - at[0], place[1] - at[1]}, far = hypot(d[0], d[1]), step = far - reached * h->reach;
  const double goes = step > least_step ? step : 0;
  for (int k = 0; k < 2; k++) way[k] = far > 0 ? goes * d[k] / far : 0, at[k] += way[k];
}

/// Whether a link is of an arm.
static int is_arm(const hands *h, int link) {
  for (int i = link; i > 0; i = h->m->link[i].parent)
    if (i == h->first[0] || i == h->first[1]) return 1;
  return 0;
}

/// How deep the thing, or else what has the hands but for its arms, is in solids of the world, m, where its free joint is aside
/// of the start by a way.
static cav_status depth_aside(const hands *h, const cav_carry *c, int thing, const double way[3], double *q,
                              double *depth) {
  const cav_model *m = h->m;
  const cav_joint *joint = &m->joint[thing ? c->thing : c->root];
  memcpy(q, h->problem->q_start, (size_t)m->nq * sizeof *q);
  add3(q + joint->q, q + joint->q, way);
  const cav_status status = cav_position(m, h->state, q);
  *depth = 0;
  for (int i = 0; i < h->state->ncontact && !status; i++) {
    const cav_contact *contact = &h->state->contact[i];
    const int link = contact->link1 ? contact->link1 : contact->link2;
    if (m->link[link].root != m->link[joint->link].root || !cav_is_with_solid(m, contact) || is_arm(h, link)) continue;
    *depth = fmax(*depth, -contact->dist);
  }
  return status;
}

/// Shortens a way of the root on from another one until it leads no deeper into a solid than the start is: a table's edge, say.
static cav_status stop_at_solids(const hands *h, const cav_carry *c, const double from[2], double way[2]) {
  enum { PARTS = 8 };
  double *q = calloc((size_t)h->m->nq, sizeof *q), depth = 0, before = 0, aside[3] = {0};
  cav_status status = q ? depth_aside(h, c, 0, aside, q, &before) : CAV_NO_MEMORY;
  int part = PARTS;
  for (; part > 0 && !status; part--) {
    for (int k = 0; k < 2; k++) aside[k] = from[k] + way[k] * part / PARTS;
    status = depth_aside(h, c, 0, aside, q, &depth);
    if (depth <= before + shallow) break;
  }
  for (int k = 0; k < 2; k++) way[k] *= (double)part / PARTS;
  if (!status) status = cav_position(h->m, h->state, h->problem->q_start);
  free(q);
  return status;
}

static cav_status find_carry(hands *h, double away, cav_carry *c) {
  const cav_model *m = h->m;
  double place[2][3], middle[3];
  cav_pose body;
  cav_object_pose(m, h->state, CAV_OBJECT_XBODY, m->link[h->thing.link].body, &body);
  if (c->lifts)
    find_sides(h, &body, away, place);
  else
    find_back(h, away, place);
  add3(middle, place[0], place[1]);
  scale3(middle, 0.5, middle);
  static const double still[2] = {0, 0};
  double at[2] = {h->root[0], h->root[1]};
  step_to(h, at, middle, c->come);
  cav_status status = stop_at_solids(h, c, still, c->come);
  for (int k = 0; k < 2; k++) at[k] = h->root[k] + c->come[k];
  add3(middle, middle, h->thing.way);
  step_to(h, at, middle, c->go);
  if (!status) status = stop_at_solids(h, c, c->come, c->go);
  const double *goal = h->problem->q_goal + m->joint[c->root].q;
  for (int k = 0; k < 2 && is_root_bound(h->problem, c->root); k++) c->go[k] = goal[k] - h->root[k] - c->come[k];
  find_times(h->problem, h, hypot(c->come[0], c->come[1]), c);
  lay(h, &body, place, c);
  return status;
}

/// How deep what is carried comes into solids on its way, m: straight, or up to a height over the start, along and down.
static cav_status depth_on_way(const hands *h, const cav_carry *c, const double *over, double *q, double *most) {
  enum { PARTS = 12 };
  const double *to = h->thing.way;
  const double bend[4][3] = {
      {0, 0, 0}, {0, 0, over ? *over : 0}, {to[0], to[1], over ? *over : 0}, {to[0], to[1], to[2]}};
  cav_status status = CAV_OK;
  *most = 0;
  for (int i = 0; i <= 3 * PARTS && !status; i++) {
    const int part = i / PARTS < 3 ? i / PARTS : 2;
    const double along = (double)(i - part * PARTS) / PARTS;
    double way[3], depth = 0;
    for (int k = 0; k < 3; k++)
      way[k] = over ? bend[part][k] + along * (bend[part + 1][k] - bend[part][k]) : to[k] * i / (3 * PARTS);
    status = depth_aside(h, c, 1, way, q, &depth);
    *most = fmax(*most, depth);
  }
  return status;
}

/// How high over the start what is carried goes along clear of solids, m; 0: it is so on its straight way, or nowhere as high as
/// is tried.
static cav_status find_over(const hands *h, cav_carry *c) {
  double *q = calloc((size_t)h->m->nq, sizeof *q), depth = 0, before = 0, over = fmax(h->thing.way[2], 0);
  static const double still[3] = {0, 0, 0};
  const double most = over + highest;
  cav_status status = q ? depth_aside(h, c, 1, still, q, &before) : CAV_NO_MEMORY;
  if (!status) status = depth_on_way(h, c, NULL, q, &depth);
  const int blocked = depth > before + sunk;
  for (; blocked && !status && over < most; over += higher) {
    status = depth_on_way(h, c, &over, q, &depth);
    if (depth <= before + sunk) break;
  }
  c->over = blocked && depth <= before + sunk ? fmax(over, higher) : 0;
  if (!status) status = cav_position(h->m, h->state, h->problem->q_start);
  free(q);
  return status;
}

cav_status cav_carry_find(const cav_problem *problem, double away, cav_carry *carry) {
  const cav_model *m = problem->model;
  *carry = (cav_carry){.found = 0};
  if (problem->cycle.on) return CAV_OK;
  hands h = {.m = m, .problem = problem};
  cav_roles roles;
  cav_state *state = cav_state_new(m);
  cav_status status = state ? cav_thing_find(problem, 1, state, &h.thing) : CAV_NO_MEMORY;
  if (!status) status = cav_roles_find(m, state, &roles);
  if (!status) status = cav_position(m, state, problem->q_start);
  if (!status && h.thing.link && roles.body[CAV_ROLE_RIGHT_HAND] > 0 && roles.body[CAV_ROLE_LEFT_HAND] > 0) {
    h.state = state;
    carry->lifts = h.thing.rise >= CAV_THING_WAY;
    carry->thing = h.thing.joint >= 0 ? h.thing.joint : free_joint(m, h.thing.link);
    carry->hung = h.thing.joint >= 0, carry->angle = h.thing.angle;
    carry->root = free_joint(m, m->body[roles.body[CAV_ROLE_RIGHT_HAND]].link);
    const int alone = m->link[h.thing.link].root == h.thing.link;
    const int usable = carry->thing >= 0 && carry->root >= 0 && alone && is_still(problem, carry->thing);
    const int able = usable && find_hands(&h, &roles, carry->root);
    if (able && !carry->hung) status = find_over(&h, carry);
    carry->lifts |= carry->over > 0;
    if (able && !status && (carry->lifts || !is_pulled(&h))) status = find_carry(&h, away, carry);
  }
  cav_state_free(state);
  return status;
}

int cav_carry_poses(const cav_problem *problem, const cav_carry *carry, double *q,
                    cav_guess_pose pose[CAV_CARRY_POSES]) {
  const cav_model *m = problem->model;
  const int root = m->joint[carry->root].q, thing = m->joint[carry->thing].q;
  const double aside = raised * (carry->to - carry->from);
  int n = 0;
  for (int i = 0; i < CAV_CARRY_POSES; i++) {
    // up, along and down where a solid is in the way
    const int there = i >= CAV_CARRY_POSES / 2, up = i == 1 || i == 2;
    if (up && !(carry->over > 0)) continue;
    double *at = q + (size_t)n * (size_t)m->nq;
    memcpy(at, problem->q_start, (size_t)m->nq * sizeof *at);
    for (int k = 0; k < 2; k++) at[root + k] += carry->come[k] + (there ? carry->go[k] : 0);
    if (there && carry->hung) at[thing] = carry->angle;
    if (there && !carry->hung) copy3(at + thing, carry->there);
    if (up) at[thing + 2] = problem->q_start[thing + 2] + carry->over;
    pose[n++] = (cav_guess_pose){there ? carry->to - up * aside : carry->from + up * aside, at};
  }
  return n;
}
