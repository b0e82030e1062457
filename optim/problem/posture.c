/// Kneeling, sitting and lying without names of joints. Roles (role.c) tell limbs, of which the joint farthest from both ends
/// is knee or elbow. A posture says how the trunk is turned, which way the parts of limbs point, seen from it, what is on the
/// ground and what the centre of mass is over. It is found by least squares over configurations (posture_search.c): those
/// ways, heights of what is on the ground, nothing below it, soles as flat as in the model's own configuration, and with a
/// small weight the way from there. Where links are inside each other limbs spread. Quadrupeds lie down from where they
/// stand.
#include "posture.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "extent.h"
#include "math3.h"
#include "posture_search.h"
#include "stand.h"

static const double trunk_weight = 3, pelvis_weight = 0.5, way_weight = 1, length_weight = 100, pull_weight = 10,
                    tilt_weight = 30;
static const double joint_weight = 0.03, root_weight = 1e-3;
static const double touching = 1e-3;   // m: links this deep in each other spread
static const double spread = 0.1;      // so much farther outwards each time
static const double level = 5e-3;      // m: what is on the ground may be off it, and the centre of mass off its place
static const double behind_knee = 0.2; // of the shank: where a knee bears
enum { LIMBS = 4, TRIES = 6 };

/// What is on the ground: legs without feet, ends of limbs, the trunk. Of quadrupeds the first limbs are the front legs.
enum {
  RIGHT_LEG = 1,
  LEFT_LEG = 2,
  RIGHT_FOOT = 4,
  LEFT_FOOT = 8,
  RIGHT_HAND = 16,
  LEFT_HAND = 32,
  TORSO = 64,
  PELVIS = 128,
  PARTS = 9, // these and the rest
  TRUNK = TORSO | PELVIS,
  LEGS = RIGHT_LEG | LEFT_LEG,
  FEET = RIGHT_FOOT | LEFT_FOOT,
  HANDS = RIGHT_HAND | LEFT_HAND
};

/// A posture. Ways are seen from the trunk: forwards, outwards, towards the head; of the upper part of a limb, then of the
/// lower one. Zeros: of the left limb as of the right one, of the right arm hanging down.
typedef struct shape {
  const char *name, *meaning;
  double pitch, roll; // of the trunk, degrees: forwards, then onto the right side
  double limb[LIMBS][2][3];
  unsigned on, near;   // what is on the ground; what is as near as it can be
  unsigned flat, over; // feet whose soles are flat; what the centre of mass is over, 0: anything
} shape;

static const double hanging[2][3] = {{0, 0.3, -1}, {0.2, 0.2, -1}};

static const shape biped[] = {{.name = "squat",
                               .meaning = "low on both feet, arms forwards",
                               .pitch = 35,
                               .limb = {{{0.7, 0.2, -0.6}, {-0.75, 0, -0.65}}, {{0}}, {{1, 0.2, -0.3}, {1, 0.2, -0.3}}},
                               .on = FEET,
                               .flat = FEET,
                               .over = FEET},
                              {.name = "kneel",
                               .meaning = "on both knees, the trunk upright",
                               .limb = {{{0, 0.1, -1}, {-1, 0, 0}}},
                               .on = LEGS,
                               .near = FEET,
                               .over = LEGS},
                              {.name = "half-kneel",
                               .meaning = "on the right knee and the left foot",
                               .limb = {{{0, 0.1, -1}, {-1, 0, 0}}, {{1, 0.1, 0}, {0, 0, -1}}},
                               .on = RIGHT_LEG | LEFT_FOOT,
                               .near = RIGHT_FOOT,
                               .flat = LEFT_FOOT,
                               .over = RIGHT_LEG | LEFT_FOOT},
                              {.name = "sit",
                               .meaning = "as on a seat: thighs level, shanks upright, feet flat",
                               .limb = {{{1, 0.1, 0}, {0, 0, -1}}},
                               .on = FEET,
                               .flat = FEET},
                              {.name = "sit-floor",
                               .meaning = "on the floor, legs straight ahead",
                               .pitch = -15,
                               .limb = {{{1, 0.15, 0}, {1, 0.1, 0}}},
                               .on = PELVIS,
                               .near = FEET},
                              {.name = "all-fours",
                               .meaning = "on hands and knees",
                               .pitch = 90,
                               .limb = {{{1, 0.1, 0}, {0, 0, -1}}, {{0}}, {{1, 0.1, 0}, {1, 0, 0}}},
                               .on = LEGS | HANDS,
                               .near = FEET,
                               .over = LEGS | HANDS},
                              {.name = "lie-back",
                               .meaning = "on the back, face up",
                               .pitch = -90,
                               .limb = {{{0, 0.15, -1}, {0, 0.1, -1}}},
                               .near = TRUNK | FEET | HANDS},
                              {.name = "hook-lying",
                               .meaning = "on the back, knees bent, soles on the ground",
                               .pitch = -90,
                               .limb = {{{0.7, 0.15, -0.6}, {-0.9, 0, -0.3}}, {{0}}, {{0, 0.8, -1}, {0, 0.8, -1}}},
                               .on = FEET,
                               .near = TRUNK | HANDS,
                               .flat = FEET},
                              {.name = "lie-front",
                               .meaning = "on the belly, face down",
                               .pitch = 90,
                               .limb = {{{0, 0.15, -1}, {0, 0.1, -1}}},
                               .near = TRUNK | FEET | HANDS},
                              {.name = "lie-side",
                               .meaning = "on the right side, the right arm and the left thigh forwards",
                               .pitch = -90,
                               .roll = 90,
                               .limb = {{{0, 0, -1}, {0, 0, -1}},
                                        {{1, 0, -0.6}, {-0.3, 0, -1}},
                                        {{1, 0.2, 0}, {1, 0.2, 0}},
                                        {{0.1, 0.3, -1}, {0.3, 0.2, -1}}},
                               .near = TRUNK | FEET | RIGHT_HAND}};

static const shape quadruped = {
    .name = "lie", .meaning = "of a quadruped: on the belly, legs folded", .on = FEET | HANDS | TORSO};

enum { BIPED_SHAPES = sizeof biped / sizeof *biped };

const char *const cav_posture_names[] = {"squat",    "kneel",      "half-kneel", "sit",      "sit-floor", "all-fours",
                                         "lie-back", "hook-lying", "lie-front",  "lie-side", "lie",       NULL};

/// A search for one.
typedef struct poser {
  const cav_model *model;
  cav_state *state;
  const cav_roles *roles;
  const shape *shape;
  int quadruped;
  int first[LIMBS], middle[LIMBS], end[LIMBS]; // bodies of limbs; -1: there is none
  int torso, pelvis, root;                     // root: at the top of the tree
  int *part;                                   // [nbody] part_of; -1: of another tree
  double axis[3][3];                           // of the trunk as wanted, in the world: forwards, left, up
  double own[2][2][3];                         // left and up of the upright torso and pelvis in their own frames
  double up[2][3]; // the vertical in the frames of the feet, in the model's own configuration
  double spread;   // beside the ways outwards
  int grounded;    // whether the ground counts
  double *q0, *q, *step;
  double off, aside,
      depth; // of the posture looked at last: of what is on the ground, of the centre of mass, of links, m
} poser;

static const shape *find_shape(const char *name) {
  for (int i = 0; i < BIPED_SHAPES; i++)
    if (!strcmp(biped[i].name, name)) return &biped[i];
  return strcmp(quadruped.name, name) ? NULL : &quadruped;
}

const char *cav_posture_meaning(const char *name) {
  const shape *s = find_shape(name);
  return s ? s->meaning : NULL;
}

// way of the trunk in the world: pitched forwards about its left, then rolled about its long axis
static void turn_trunk(poser *p) {
  const double *left = p->roles->left;
  double l[3] = {left[0], left[1], 0}, f[3] = {left[1], -left[0], 0};
  double pitch = p->shape->pitch * M_PI / 180, roll = p->shape->roll * M_PI / 180, side[3];
  double up[3] = {sin(pitch) * f[0], sin(pitch) * f[1], cos(pitch)};
  cross3(side, up, l);
  for (int i = 0; i < 3; i++) p->axis[1][i] = cos(roll) * l[i] - sin(roll) * side[i];
  memcpy(p->axis[2], up, sizeof up);
  cross3(p->axis[0], p->axis[1], p->axis[2]);
}

static void origin(const poser *p, int body, double x[3]) {
  cav_pose at;
  cav_object_pose(p->model, p->state, CAV_OBJECT_XBODY, body, &at);
  memcpy(x, at.pos, 3 * sizeof *x);
}

static double distance(const double *a, const double *b) {
  double d[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
  return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

// the body of a limb between its first and its last whose frame is farthest from both; the last of a limb of two
static int part_limb(const poser *p, int first, int end) {
  double a[3], b[3], x[3], most = -1;
  int best = end;
  origin(p, first, a), origin(p, end, b);
  for (int i = p->model->body[end].parent; i > 0 && i != first; i = p->model->body[i].parent) {
    origin(p, i, x);
    double far = fmin(distance(x, a), distance(x, b));
    if (far > most) most = far, best = i;
  }
  return best;
}

// which part a body is of, by its bit's place
static int part_of(const poser *p, int body) {
  enum { FIRST_FOOT = 2, FIRST_TRUNK = 6, REST = PARTS - 1 };
  for (int i = body; i > 0; i = p->model->body[i].parent) {
    if (i == p->torso) return FIRST_TRUNK;
    if (i == p->pelvis) return FIRST_TRUNK + 1;
    for (int k = 0; k < LIMBS; k++) {
      if (i == p->end[k]) return FIRST_FOOT + k;
      if (i == p->first[k]) return k < 2 && !p->quadruped ? k : REST;
    }
  }
  return REST;
}

// heights of the lowest points of parts; INFINITY: one has no shape
static void find_heights(const poser *p, double height[PARTS]) {
  const cav_model *m = p->model;
  for (int i = 0; i < PARTS; i++) height[i] = INFINITY;
  for (int g = 0; g < m->ngeom; g++) {
    const cav_geom *geom = &m->geom[g];
    int part = p->part[geom->body];
    if (part < 0 || (!geom->contype && !geom->conaffinity)) continue;
    cav_pose at;
    cav_object_pose(m, p->state, CAV_OBJECT_GEOM, g, &at);
    height[part] = fmin(height[part], cav_geom_bottom(m, g, &at));
  }
}

// the middle of what the centre of mass is to be over; 0: it may be anywhere
static int find_middle(const poser *p, double middle[2]) {
  int n = 0;
  middle[0] = middle[1] = 0;
  for (int k = 0; k < LIMBS; k++) {
    double a[3], b[3];
    if (p->end[k] < 0) continue;
    cav_pose at;
    if (p->shape->over & (unsigned)(RIGHT_FOOT << k)) {
      cav_object_pose(p->model, p->state, CAV_OBJECT_BODY, p->end[k], &at);
      for (int i = 0; i < 2; i++) middle[i] += at.pos[i];
      n++;
    }
    if (k < 2 && p->shape->over & (unsigned)(RIGHT_LEG << k)) {
      origin(p, p->middle[k], a), origin(p, p->end[k], b);
      for (int i = 0; i < 2; i++) middle[i] += a[i] + behind_knee * (b[i] - a[i]);
      n++;
    }
  }
  for (int i = 0; i < 2; i++) middle[i] /= n ? n : 1;
  return n;
}

static int is_unsaid(const double way[3]) { return way[0] == 0 && way[1] == 0 && way[2] == 0; }

// way of a part of a limb less the one that is wanted; row [3]
static void way_rows(const poser *p, int limb, int lower, double *row) {
  const double *stated = p->shape->limb[limb][lower];
  double a[3], b[3], way[3], sum = 0, side = limb % 2 ? 1 : -1, length;
  origin(p, lower ? p->middle[limb] : p->first[limb], a);
  origin(p, lower ? p->end[limb] : p->middle[limb], b);
  const double *left_as_right = limb % 2 ? p->shape->limb[limb - 1][lower] : stated;
  if (is_unsaid(stated)) stated = left_as_right;
  if (is_unsaid(stated)) stated = hanging[lower];
  const double seen[3] = {stated[0], side * (stated[1] + p->spread), stated[2]};
  for (int i = 0; i < 3; i++) {
    way[i] = seen[0] * p->axis[0][i] + seen[1] * p->axis[1][i] + seen[2] * p->axis[2][i];
    sum += way[i] * way[i];
  }
  length = distance(a, b);
  for (int i = 0; i < 3 && length > 0; i++) row[i] = way_weight * ((b[i] - a[i]) / length - way[i] / sqrt(sum));
}

// heights of parts, and how far the centre of mass is from its place
static void ground_rows(poser *p, double *row) {
  double height[PARTS], middle[2], com[3];
  int n = 0;
  find_heights(p, height);
  p->off = p->aside = 0;
  for (int i = 0; i < PARTS; i++, n++) {
    unsigned bit = i < PARTS - 1 ? 1U << i : 0;
    if (height[i] == INFINITY) continue;
    int on = (p->shape->on & bit) != 0, near = (p->shape->near & bit) != 0;
    row[n] = on || height[i] < 0 ? length_weight * height[i] : near ? pull_weight * height[i] : 0;
    if (on) p->off = fmax(p->off, fabs(height[i]));
  }
  if (find_middle(p, middle)) {
    const cav_sensor sensor = {
        .name = "", .type = CAV_SENSOR_SUBTREECOM, .object_type = CAV_OBJECT_BODY, .object = p->root, .dim = 3};
    cav_sensor_read(p->model, p->state, &sensor, com);
    for (int i = 0; i < 2; i++) row[n + i] = length_weight * (com[i] - middle[i]);
    p->aside = hypot(com[0] - middle[0], com[1] - middle[1]);
  }
}

// how deep links are inside each other at the posture looked at last, all pairs
static double find_depth(const poser *p) { return cav_posture_depth(p->model, p->state, CAV_DEPTH_ALL); }

enum { OTHER_ROWS = 12 + 6 * LIMBS + 4 + PARTS + 3 }; // beside one for each dof

// rows at q: trunk, ways of limbs, soles, ground, way from where it began
static cav_status rows(void *user, const double *q, double *row) {
  poser *p = user;
  const cav_model *m = p->model;
  cav_status status = cav_position(m, p->state, q);
  if (status) return status;
  memset(row, 0, (size_t)(OTHER_ROWS + m->nv) * sizeof *row);
  cav_pose at;
  double x[3];
  int n = 0;
  for (int part = 0; part < 2; part++) {
    cav_object_pose(m, p->state, CAV_OBJECT_XBODY, part ? p->pelvis : p->torso, &at);
    for (int k = 0; k < 2; k++, n += 3) {
      rotate(x, at.rotation, p->own[part][k]);
      for (int i = 0; i < 3; i++) row[n + i] = (part ? pelvis_weight : trunk_weight) * (x[i] - p->axis[k + 1][i]);
    }
  }
  for (int k = 0; k < LIMBS; k++, n += 6) {
    if (p->quadruped || p->end[k] < 0) continue;
    way_rows(p, k, 0, row + n), way_rows(p, k, 1, row + n + 3);
  }
  for (int k = 0; k < 2; k++, n += 2) {
    if (!(p->shape->flat & (unsigned)(RIGHT_FOOT << k))) continue;
    cav_object_pose(m, p->state, CAV_OBJECT_XBODY, p->end[k], &at);
    rotate(x, at.rotation, p->up[k]);
    for (int i = 0; i < 2; i++) row[n + i] = tilt_weight * x[i];
  }
  if (p->grounded) ground_rows(p, row + n);
  n += PARTS + 2;
  p->depth = p->state->options.contact ? find_depth(p) : 0;
  row[n++] = length_weight * p->depth;
  assert(n == OTHER_ROWS);
  cav_difference(m, p->q0, q, 1, p->step);
  for (int d = 0; d < m->nv; d++) {
    int root = m->link[m->joint[m->dof[d].joint].link].parent == 0;
    row[n++] = (root ? root_weight : joint_weight) * p->step[d];
  }
  return CAV_OK;
}

// limbs out of the roles, and what is upright, at the model's own configuration
static cav_status prepare(poser *p) {
  static const cav_role limbs[2][LIMBS] = {
      {CAV_ROLE_RIGHT_FOOT, CAV_ROLE_LEFT_FOOT, CAV_ROLE_RIGHT_HAND, CAV_ROLE_LEFT_HAND},
      {CAV_ROLE_FRONT_RIGHT_FOOT, CAV_ROLE_FRONT_LEFT_FOOT, CAV_ROLE_BACK_RIGHT_FOOT, CAV_ROLE_BACK_LEFT_FOOT}};
  const cav_model *m = p->model;
  cav_status status = cav_position(m, p->state, p->q0);
  if (status) return status;
  p->torso = p->roles->body[CAV_ROLE_TORSO], p->pelvis = p->roles->body[CAV_ROLE_PELVIS];
  for (p->root = p->torso; m->body[p->root].parent > 0;) p->root = m->body[p->root].parent;
  for (int k = 0; k < LIMBS; k++) {
    cav_role role = limbs[p->quadruped][k];
    p->first[k] = p->roles->limb[role], p->end[k] = p->roles->body[role];
    p->middle[k] = p->end[k] < 0 ? -1 : part_limb(p, p->first[k], p->end[k]);
  }
  for (int i = 0; i < m->nbody; i++) {
    int top = i;
    while (m->body[top].parent > 0) top = m->body[top].parent;
    p->part[i] = top == p->root ? part_of(p, i) : -1;
  }
  cav_pose at;
  const double upright[2][3] = {{p->roles->left[0], p->roles->left[1], 0}, {0, 0, 1}};
  for (int part = 0; part < 2; part++) {
    cav_object_pose(m, p->state, CAV_OBJECT_XBODY, part ? p->pelvis : p->torso, &at);
    for (int k = 0; k < 2; k++) rotate_back(p->own[part][k], at.rotation, upright[k]);
  }
  for (int k = 0; k < 2 && !p->quadruped; k++) {
    cav_object_pose(m, p->state, CAV_OBJECT_XBODY, p->end[k], &at);
    memcpy(p->up[k], at.rotation + 6, sizeof p->up[k]);
  }
  return CAV_OK;
}

// the root turned as the trunk is: from far away the way there is none
static void turn_root(const poser *p, double *q) {
  const cav_model *m = p->model;
  const cav_link *link = &m->link[m->body[p->root].link];
  double turned[4] = {1, 0, 0, 0}, half, rotation[4] = {0}, *w = q + m->joint[link->joint].q + 3, kept[4];
  const double *left = p->roles->left;
  half = p->shape->pitch * M_PI / 360;
  double pitch[4] = {cos(half), sin(half) * left[0], sin(half) * left[1], 0};
  half = -p->shape->roll * M_PI / 360;
  rotation[0] = cos(half);
  for (int i = 0; i < 3; i++) rotation[1 + i] = sin(half) * p->axis[2][i];
  quat_mul(turned, rotation, pitch);
  memcpy(kept, w, sizeof kept);
  quat_mul(w, turned, kept);
}

static cav_status search(poser *p) {
  cav_posture_search search = {
      .model = p->model, .nrow = OTHER_ROWS + p->model->nv, .q = p->q, .rows = rows, .user = p};
  // the ways first: from upright the ground has no way to fold a leg. Contacts take most of the time
  p->state->options.contact = 0;
  cav_status status = cav_posture_find(&search);
  p->grounded = 1;
  for (int i = 0; i < TRIES && !status; i++, p->spread += spread) {
    p->state->options.contact = 0;
    status = cav_posture_find(&search);
    p->state->options.contact = 1;
    if (!status) status = cav_position(p->model, p->state, p->q);
    if (status || find_depth(p) <= touching) return status;
  }
  return status ? status : cav_posture_find(&search);
}

static cav_status pose(poser *p, char *why) {
  const cav_model *m = p->model;
  cav_stand stand;
  cav_status status = prepare(p);
  memcpy(p->q, p->q0, (size_t)m->nq * sizeof *p->q);
  if (!status && p->quadruped) {
    status = cav_stand_find(m, p->state, p->q0, &stand);
    if (status == CAV_BAD_INPUT) snprintf(why, 200, "%s", stand.why);
    memcpy(p->q, p->q0, (size_t)m->nq * sizeof *p->q);
  }
  if (status) return status;
  turn_trunk(p);
  turn_root(p, p->q);
  int contact = p->state->options.contact;
  status = search(p);
  p->state->options.contact = contact;
  if (status || fmax(fmax(p->off, p->aside), p->depth) <= level) return status;
  snprintf(
      why, 200,
      "none was found (%s): what is on the ground is %.2g m off it, the centre of mass %.2g m from its place, links "
      "are %.2g m inside each other",
      p->shape->meaning, p->off, p->aside, p->depth);
  return CAV_BAD_INPUT;
}

cav_status cav_posture_named(const cav_model *m, cav_state *state, const char *name, double *q, char *why) {
  cav_roles roles;
  *why = 0;
  cav_status status = cav_roles_find(m, state, &roles);
  if (status) return status;
  poser p = {.model = m, .state = state, .roles = &roles, .shape = find_shape(name)};
  assert(p.shape);
  p.quadruped = p.shape == &quadruped;
  if (roles.build != (p.quadruped ? CAV_BUILD_QUADRUPED : CAV_BUILD_BIPED) || roles.base != CAV_BASE_FREE) {
    snprintf(why, 200, "it is for %s with a free root (%s%s%.120s)", p.quadruped ? "quadrupeds" : "bipeds",
             cav_build_name(roles.build), *roles.why ? ": " : "", roles.why);
    return CAV_BAD_INPUT;
  }
  p.q0 = calloc((size_t)(2 * m->nq + m->nv), sizeof *p.q0);
  p.part = calloc((size_t)m->nbody, sizeof *p.part);
  status = p.q0 && p.part ? CAV_OK : CAV_NO_MEMORY;
  if (!status) {
    p.q = p.q0 + m->nq, p.step = p.q + m->nq;
    memcpy(p.q0, m->q0, (size_t)m->nq * sizeof *p.q0);
    status = pose(&p, why);
  }
  if (!status) memcpy(q, p.q, (size_t)m->nq * sizeof *q);
  free(p.q0), free(p.part);
  return status;
}
