/// Standing without names, by least squares over configurations (posture_search.c). Rows: the tilt of the soles of bipeds (a
/// sole is flat where it was flat in the model's own configuration), heights of all feet, the centre of mass over their
/// middle, the height of the trunk, and, with small weights, the way from the model's own configuration. Legs that are
/// straight there, whose length can only fall, are bent: the trunk comes down by a fixed fraction, and hinges start off
/// towards the middle of their ranges; soles of a quadruped stay where they are seen from the hips, those of a biped sideways
/// and side by side, or it would splay, lean or step. Joints stay in their ranges. Where links are inside each other so the
/// feet of a biped go farther apart.
#include "stand.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "extent.h"
#include "posture_search.h"

static const double straight = 0.93;   // leg's length over that of its parts
static const double biped_bent = 0.96; // of the height of straight legs
static const double quadruped_bent = 0.75;
static const double start_bend = 0.3;    // rad
static const double length_weight = 100; // 1/m
static const double joint_weight = 0.03, root_weight = 0.3, under_weight = 10;
static const double tilt_weight = 30;
static const double touching = 1e-3, clearance = 0.01; // m: links this deep in each other go apart, by so much more
static const double level = 1e-3;                      // m and rad: what a posture that stands may be off by
enum { FEET = 4, MOST = 80, OTHER_ROWS = 16 };         // OTHER_ROWS: beside one for each dof

typedef struct stander {
  const cav_model *model;
  cav_state *state;
  const cav_roles *roles;
  int nfoot, foot[FEET], first[FEET]; // bodies
  double point[FEET][3], up[FEET][3]; // of the sole, and the vertical, in the frame of the foot's body
  int root;                           // body at the top of the tree
  double rise;                        // of the trunk over the feet that is wanted
  int stretched;                      // legs are straight in the model's own configuration
  double under[FEET][2];              // from where a leg begins to its sole there, m
  double apart, width;                // feet of a biped, sideways: as wanted, 0 for wherever; as they are
  double *q0, *q, *step;
  cav_stand *stand; // what the posture looked at last is off by
} stander;

// world point of a point of a body
static void place(const cav_pose *at, const double *p, double *out) {
  const double *r = at->rotation;
  for (int i = 0; i < 3; i++) out[i] = at->pos[i] + r[3 * i] * p[0] + r[3 * i + 1] * p[1] + r[3 * i + 2] * p[2];
}

static void unplace(const cav_pose *at, const double *x, double *out) {
  const double *r = at->rotation, d[3] = {x[0] - at->pos[0], x[1] - at->pos[1], x[2] - at->pos[2]};
  for (int i = 0; i < 3; i++) out[i] = r[i] * d[0] + r[3 + i] * d[1] + r[6 + i] * d[2];
}

// middle of the sole of a foot: of its box along the world's axes, at its lowest
static void find_sole(stander *s, int k, int geom) {
  const cav_model *m = s->model;
  const cav_body *body = &m->body[s->foot[k]];
  cav_pose foot, at;
  cav_object_pose(m, s->state, CAV_OBJECT_XBODY, s->foot[k], &foot);
  double least[3] = {INFINITY, INFINITY, INFINITY}, most[3] = {-INFINITY, -INFINITY, -INFINITY}, sole[3];
  int from = geom < 0 ? body->geom : geom, to = geom < 0 ? body->geom + body->ngeom : geom + 1;
  for (int g = from; g < to; g++) {
    cav_object_pose(m, s->state, CAV_OBJECT_GEOM, g, &at);
    for (int i = 0; i < 3; i++) {
      const double n[3] = {i == 0, i == 1, i == 2}, back[3] = {-n[0], -n[1], -n[2]};
      least[i] = fmin(least[i], at.pos[i] - cav_geom_reach(m, g, &at, back));
      most[i] = fmax(most[i], at.pos[i] + cav_geom_reach(m, g, &at, n));
    }
  }
  cav_object_pose(m, s->state, CAV_OBJECT_BODY, s->foot[k], &at);
  for (int i = 0; i < 3; i++) sole[i] = from == to ? at.pos[i] : i < 2 ? (least[i] + most[i]) / 2 : least[i];
  unplace(&foot, sole, s->point[k]);
  memcpy(s->up[k], foot.rotation + 6, sizeof s->up[k]);
}

// whether a leg is straight: from its first body to its sole as long as all its parts
static int is_straight(const stander *s, int k) {
  const cav_model *m = s->model;
  cav_pose at;
  double from[3], to[3], parts = 0, whole = 0;
  cav_object_pose(m, s->state, CAV_OBJECT_XBODY, s->foot[k], &at);
  place(&at, s->point[k], from);
  double sole[3] = {from[0], from[1], from[2]};
  for (int i = s->foot[k];; i = m->body[i].parent) {
    cav_object_pose(m, s->state, CAV_OBJECT_XBODY, i, &at);
    for (int c = 0; c < 3; c++) to[c] = at.pos[c];
    parts += sqrt((to[0] - from[0]) * (to[0] - from[0]) + (to[2] - from[2]) * (to[2] - from[2]));
    memcpy(from, to, sizeof from);
    if (i == s->first[k] || m->body[i].parent <= 0) break;
  }
  whole = sqrt((to[0] - sole[0]) * (to[0] - sole[0]) + (to[2] - sole[2]) * (to[2] - sole[2]));
  return whole > straight * parts;
}

// starts a leg's hinges about the sideways axis off to where there is room
static void bend(stander *s, int k) {
  const cav_model *m = s->model;
  int count = 0, quadruped = s->nfoot == 4;
  int chain[MOST], n = 0;
  for (int i = s->foot[k]; n < MOST; i = m->body[i].parent) {
    chain[n++] = i;
    if (i == s->first[k] || m->body[i].parent <= 0) break;
  }
  while (n-- > 0) {
    const cav_link *link = &m->link[m->body[chain[n]].link];
    if (link->body != chain[n]) continue;
    for (int j = link->joint; j < link->joint + link->njoint; j++) {
      const cav_joint *joint = &m->joint[j];
      const double *axis = s->state->axis + 6 * joint->dof;
      double side = axis[0] * s->roles->left[0] + axis[1] * s->roles->left[1];
      if (joint->type != CAV_JOINT_HINGE || fabs(side) < 0.8) continue;
      double *q = &s->q[joint->q], room = (joint->range[0] + joint->range[1]) / 2 - *q;
      // without a side to go to: hip and knee of a crouch
      static const double crouch[3] = {-1, 2, -1};
      if (!joint->limited || fabs(room) < 0.2)
        *q += count < 3 ? (quadruped ? -1 : 1) * copysign(start_bend, side) * crouch[count] : 0;
      else
        *q += copysign(fmin(start_bend, fabs(room)), room);
      count++;
    }
  }
}

// weight of the way of dof d from the model's own configuration
static double holding(const cav_model *m, int d) {
  const cav_joint *joint = &m->joint[m->dof[d].joint];
  if (m->link[joint->link].parent != 0) return joint_weight;
  if (joint->type == CAV_JOINT_FREE) return d - joint->dof == 2 ? 1e-4 : d - joint->dof < 2 ? 0.01 : root_weight;
  return joint->type == CAV_JOINT_SLIDE ? 1e-3 : root_weight;
}

// horizontally from where a leg begins to its sole
static void reach_of(const stander *s, int k, const double sole[3], double reach[2]) {
  cav_pose at;
  cav_object_pose(s->model, s->state, CAV_OBJECT_XBODY, s->first[k], &at);
  for (int i = 0; i < 2; i++) reach[i] = sole[i] - at.pos[i];
}

// rows at q, zeros where there are fewer; what the posture is off by in s->stand
static cav_status rows(void *user, const double *q, double *row) {
  stander *s = user;
  cav_stand *stand = s->stand;
  const cav_model *m = s->model;
  cav_status status = cav_position(m, s->state, q);
  if (status) return status;
  double middle[3] = {0}, com[3], x[FEET][3];
  cav_pose at;
  int n = 0;
  *stand = (cav_stand){0};
  for (int k = 0; k < s->nfoot; k++) {
    cav_object_pose(m, s->state, CAV_OBJECT_XBODY, s->foot[k], &at);
    place(&at, s->point[k], x[k]);
    for (int i = 0; i < 3; i++) middle[i] += x[k][i] / s->nfoot;
    for (int i = 0; i < 2 && s->nfoot == 2; i++) {
      const double *r = at.rotation + 3 * i;
      row[n] = r[0] * s->up[k][0] + r[1] * s->up[k][1] + r[2] * s->up[k][2];
      stand->tilt = fmax(stand->tilt, fabs(row[n]));
      row[n++] *= tilt_weight;
    }
  }
  for (int k = 0; k < s->nfoot; k++) {
    row[n++] = length_weight * x[k][2];
    stand->uneven = fmax(stand->uneven, fabs(x[k][2]));
  }
  const cav_sensor sensor = {
      .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = s->root, .dim = 3};
  cav_sensor_read(m, s->state, &sensor, com);
  for (int i = 0; i < 2; i++) row[n++] = length_weight * (com[i] - middle[i]);
  stand->aside = hypot(com[0] - middle[0], com[1] - middle[1]);
  cav_object_pose(m, s->state, CAV_OBJECT_XBODY, s->root, &at);
  row[n++] = length_weight * (at.pos[2] - middle[2] - s->rise);
  s->width = 0;
  for (int i = 0; i < 2; i++) s->width += s->roles->left[i] * (x[1][i] - x[0][i]);
  // straight legs are lowered by their knees, not by leaning, splaying or a step: a biped's hips may go back where its knees go
  // forwards, both as far
  const double *left = s->roles->left;
  double step = 0;
  for (int k = 0; k < s->nfoot && s->stretched; k++) {
    double way[2];
    reach_of(s, k, x[k], way);
    for (int i = 0; i < 2; i++) way[i] -= s->under[k][i];
    for (int i = 0; i < 2 && s->nfoot == 4; i++) row[n++] = under_weight * way[i];
    if (s->nfoot == 2 && s->apart <= 0) row[n++] = under_weight * (left[0] * way[0] + left[1] * way[1]);
    step += (k ? 1 : -1) * (left[1] * way[0] - left[0] * way[1]);
  }
  if (s->nfoot == 2 && s->stretched) row[n++] = under_weight * step;
  if (s->apart > 0) row[n++] = length_weight * (s->width - s->apart);
  cav_difference(m, s->q0, q, 1, s->step);
  for (int d = 0; d < m->nv; d++) row[n++] = holding(m, d) * s->step[d];
  assert(n <= OTHER_ROWS + m->nv);
  memset(row + n, 0, (size_t)(OTHER_ROWS + m->nv - n) * sizeof *row);
  return CAV_OK;
}

// the contacts at s->q
static cav_status find_contacts(const stander *s) {
  int contact = s->state->options.contact;
  s->state->options.contact = 1;
  cav_status status = cav_position(s->model, s->state, s->q);
  s->state->options.contact = contact;
  return status;
}

// a posture; farther and farther apart while links are inside each other. Feet that cannot go farther stay
static cav_status search_clear(stander *s) {
  enum { TRIES = 6 };
  cav_posture_search search = {
      .model = s->model, .nrow = OTHER_ROWS + s->model->nv, .q = s->q, .rows = rows, .user = s};
  cav_status status = cav_posture_find(&search);
  for (int i = 0; i < TRIES && !status && s->nfoot == 2; i++) {
    if ((status = find_contacts(s))) break;
    double depth = cav_posture_depth(s->model, s->state, CAV_DEPTH_DEEPEST);
    if (depth <= touching) break;
    s->apart = s->width + depth + clearance;
    status = cav_posture_find(&search);
  }
  return status;
}

// feet out of the roles, soles and the height wanted at the model's own configuration
static cav_status prepare(stander *s) {
  static const cav_role feet[2][FEET] = {
      {CAV_ROLE_RIGHT_FOOT, CAV_ROLE_LEFT_FOOT},
      {CAV_ROLE_FRONT_RIGHT_FOOT, CAV_ROLE_FRONT_LEFT_FOOT, CAV_ROLE_BACK_RIGHT_FOOT, CAV_ROLE_BACK_LEFT_FOOT}};
  const cav_model *m = s->model;
  cav_status status = cav_position(m, s->state, s->q0);
  if (status) return status;
  int stretched = 1;
  double ground = 0;
  s->nfoot = s->roles->build == CAV_BUILD_QUADRUPED ? 4 : 2;
  for (int k = 0; k < s->nfoot; k++) {
    cav_role role = feet[s->nfoot == 4][k];
    s->foot[k] = s->roles->body[role], s->first[k] = s->roles->limb[role];
    find_sole(s, k, s->roles->geom[role]);
    stretched &= is_straight(s, k);
    cav_pose at;
    double x[3];
    cav_object_pose(m, s->state, CAV_OBJECT_XBODY, s->foot[k], &at);
    place(&at, s->point[k], x);
    ground += x[2] / s->nfoot;
    reach_of(s, k, x, s->under[k]);
  }
  s->root = s->foot[0];
  while (m->body[s->root].parent > 0) s->root = m->body[s->root].parent;
  cav_pose at;
  cav_object_pose(m, s->state, CAV_OBJECT_XBODY, s->root, &at);
  s->rise = at.pos[2] - ground;
  // legs end where limbs begin: what is lowered is a fraction of them, not of the trunk above
  cav_object_pose(m, s->state, CAV_OBJECT_XBODY, s->first[0], &at);
  double leg = at.pos[2] - ground;
  memcpy(s->q, s->q0, (size_t)m->nq * sizeof *s->q);
  if (stretched) {
    s->rise -= leg * (1 - (s->nfoot == 4 ? quadruped_bent : biped_bent));
    for (int k = 0; k < s->nfoot; k++) bend(s, k);
  }
  s->stretched = stretched;
  cav_posture_clip(m, s->q);
  return CAV_OK;
}

static cav_status stand_on_feet(const cav_model *m, cav_state *state, const cav_roles *roles, double *q,
                                cav_stand *stand) {
  stander s = {.model = m, .state = state, .roles = roles, .stand = stand};
  s.q0 = calloc((size_t)(2 * m->nq + m->nv), sizeof *s.q0);
  if (!s.q0) return CAV_NO_MEMORY;
  s.q = s.q0 + m->nq, s.step = s.q + m->nq;
  memcpy(s.q0, m->q0, (size_t)m->nq * sizeof *s.q0);
  // links alone: contacts take most of the time, and say nothing here
  int contact = state->options.contact;
  state->options.contact = 0;
  cav_status status = prepare(&s);
  if (!status) status = search_clear(&s);
  state->options.contact = contact;
  if (!status && (stand->tilt > level || stand->uneven > level || stand->aside > level)) {
    snprintf(
        stand->why, sizeof stand->why,
        "no posture was found with level feet below the centre of mass: soles tilt by %.2g rad, feet are %.2g m from "
        "level, the centre of mass %.2g m from their middle",
        stand->tilt, stand->uneven, stand->aside);
    status = CAV_BAD_INPUT;
  }
  if (!status) memcpy(q, s.q, (size_t)m->nq * sizeof *q);
  free(s.q0);
  return status;
}

cav_status cav_stand_find(const cav_model *m, cav_state *state, double *q, cav_stand *stand) {
  static const char *const keys[] = {"stand", "home"};
  *stand = (cav_stand){0};
  for (int i = 0; i < 2; i++) {
    int key = cav_object_find(m, CAV_OBJECT_KEY, keys[i]);
    if (key < 0) continue;
    stand->key = m->key[key].name;
    memcpy(q, m->key[key].q, (size_t)m->nq * sizeof *q);
    return CAV_OK;
  }
  cav_roles roles;
  cav_status status = cav_roles_find(m, state, &roles);
  if (status) return status;
  int feet = roles.build == CAV_BUILD_BIPED || roles.build == CAV_BUILD_QUADRUPED;
  if (feet && roles.base == CAV_BASE_FIXED) {
    snprintf(stand->why, sizeof stand->why,
             "its base is fixed to the world; floating='true' on <problem> frees that of a URDF");
    return CAV_BAD_INPUT;
  }
  if (feet) return stand_on_feet(m, state, &roles, q, stand);
  snprintf(stand->why, sizeof stand->why, "no feet were found to stand on (%s%s%s)", cav_build_name(roles.build),
           *roles.why ? ": " : "", roles.why);
  return CAV_BAD_INPUT;
}
