/// A gait: the limbs that carry the body swinging against each other (METHOD.md, 7: without it a walk becomes a hop). Left and
/// right are those of mirror.c; the limbs are those that touch the world in the goal posture; of their hinges across the
/// direction of travel the first swings, forwards as a sine, and the second bends while the limb comes forwards.
#include "gait.h"

#include <assert.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "periodicity.h"

/// Gap below which a limb carries, m; travel from which there is a gait, m; cosine from which a hinge lies across the
/// travel.
static const double touching = 0.02, least_travel = 0.3, across = 0.7;

/// Turn on the spot from which there is a gait, rad, and how much of its rotation is about the vertical, the cosine of half of
/// the rest; distance of limbs that stand one behind the other, m.
static const double least_turn = 0.7, upright = 0.9, apart = 0.1;

/// The gait: how far the first and the second hinge go, rad, and its frequency where the hip is a metre up, Hz.
static const double swing_angle = 0.25, bend_angle = 0.4, pace = 1.2;

/// What the gait is made of.
typedef struct walker {
  const cav_problem *problem;
  double *posture;  ///< [nq] of the goal, of a turn that of the start, turned to the heading of the model's own
  cav_state *state; ///< there
  cav_image *image; ///< [njoint]
  char *carries;    ///< [nlink] the link or one that it carries touches the world
  int side;         ///< axis that the mirror reflects: 0 x, 1 y
} walker;

/// How far the first body that can goes from start to goal along the horizontal axes, m.
static void find_travel(const cav_problem *p, double travel[2]) {
  const cav_model *m = p->model;
  travel[0] = p->cycle.on ? p->cycle.translation[0] : 0;
  travel[1] = p->cycle.on ? p->cycle.translation[1] : 0;
  if (p->cycle.on) return;
  for (int j = 0; j < m->njoint; j++) {
    const cav_joint *joint = &m->joint[j];
    int free = joint->type == CAV_JOINT_FREE;
    if (m->link[joint->link].parent != 0 || (!free && joint->type != CAV_JOINT_SLIDE)) continue;
    for (int k = 0; k < 2; k++) {
      if (free) travel[k] += p->q_goal[joint->q + k] - p->q_start[joint->q + k];
      if (!free) travel[k] += (p->q_goal[joint->q] - p->q_start[joint->q]) * joint->axis[k];
    }
    if (free) return;
  }
}

/// Marks the links that carry the body in the posture.
static cav_status find_support(walker *w) {
  const cav_model *m = w->problem->model;
  w->state->options = m->options;
  w->state->options.smoothing = w->state->options.smoothing_self = touching;
  cav_status status = cav_position(m, w->state, w->posture);
  for (int i = 0; i < w->state->ncontact && status == CAV_OK; i++) {
    const cav_contact *c = &w->state->contact[i];
    if ((c->link1 > 0 && c->link2 > 0) || c->dist > touching) continue;
    for (int link = c->link1 > 0 ? c->link1 : c->link2; link > 0; link = m->link[link].parent) w->carries[link] = 1;
  }
  return status;
}

/// Fraction of a hinge's axis across the travel, in the posture; 0 for other joints and those that stand for
/// themselves.
static double crosses(const walker *w, int j) {
  const cav_joint *joint = &w->problem->model->joint[j];
  if (joint->type != CAV_JOINT_HINGE || w->image[j].joint == j || !w->carries[joint->link]) return 0;
  return w->state->axis[6 * joint->dof + w->side];
}

/// Whether a link hangs on a joint's.
static int hangs_on(const cav_model *m, int link, int joint) {
  while (link > 0 && link != m->joint[joint].link) link = m->link[link].parent;
  return link > 0;
}

/// The next hinge across the travel on the way from a link outwards; -1: none.
static int next_hinge(const walker *w, int after) {
  const cav_model *m = w->problem->model;
  for (int j = after + 1; j < m->njoint; j++)
    if (fabs(crosses(w, j)) >= across && hangs_on(m, m->joint[j].link, after)) return j;
  return -1;
}

/// Whether a hinge across the travel is the first one on the way from the root to where a limb touches the world, and that of
/// the two limbs which are images of each other that comes first.
static int is_hip(const walker *w, int j) {
  const cav_model *m = w->problem->model;
  if (fabs(crosses(w, j)) < across || w->image[j].joint < j) return 0;
  for (int k = 0; k < j; k++)
    if (fabs(crosses(w, k)) >= across && hangs_on(m, m->joint[j].link, k)) return 0;
  return 1;
}

/// A swing of a joint and the opposite one of its image, half a period later.
static void lay(const walker *w, int j, double amplitude, double frequency, double phase, cav_strategy *strategy) {
  assert(strategy->nswing + 2 <= CAV_STRATEGY_SWINGS);
  strategy->swing[strategy->nswing++] = (cav_swing){j, amplitude, frequency, phase};
  strategy->swing[strategy->nswing++] =
      (cav_swing){w->image[j].joint, w->image[j].sign * amplitude, frequency, phase + M_PI};
}

static const double *place_of(const walker *w, int j) { return w->state->link[w->problem->model->joint[j].link].pos; }

/// Where a joint is from its image across the travel, m.
static double aside(const walker *w, int j) {
  return place_of(w, j)[w->side] - place_of(w, w->image[j].joint)[w->side];
}

/// The swings of the hinges found; none where the model has none. Limbs that are images of each other swing in turn, and of a
/// pair behind another one those that are across: a trot. A travel of 0 is a turn on the spot or a way aside: limbs bend in turn.
static void find_gait(const walker *w, double travel, cav_strategy *strategy) {
  const cav_model *m = w->problem->model;
  int first = -1, pair = 0;
  for (int hip = 0; hip < m->njoint && strategy->nswing + 4 <= CAV_STRATEGY_SWINGS; hip++) {
    if (!is_hip(w, hip)) continue;
    if (first < 0) first = hip;
    const int along = !w->side, beside = aside(w, hip) * aside(w, first) > 0;
    // pairs one behind the other alternate
    if (hip != first && fabs(place_of(w, hip)[along] - place_of(w, first)[along]) > apart) pair++;
    const double turn = (pair % 2 != 0) == beside && hip != first ? M_PI : 0;
    const double frequency = pace / sqrt(fmax(place_of(w, hip)[2], 0.05));
    // a limb hangs down: turning about +y takes it to -x, about +x to +y
    const double forwards = (w->side == 1 ? -1 : 1) * copysign(1, travel) * copysign(1, crosses(w, hip));
    if (travel != 0) lay(w, hip, forwards * swing_angle, frequency, turn, strategy);
    const int knee = next_hinge(w, hip);
    if (knee < 0) continue;
    const cav_joint *joint = &m->joint[knee];
    const double at = w->posture[joint->q];
    const int up_first = joint->limited && joint->range[1] - at > at - joint->range[0];
    const double bends = joint->limited ? (up_first ? 1 : -1) : -forwards;
    lay(w, knee, bends * bend_angle, frequency, turn + M_PI / 2, strategy);
  }
}

/// Quaternion of the first free joint in a configuration; NULL: none is free.
static double *heading_of(const cav_model *m, double *q) {
  for (int j = 0; j < m->njoint; j++)
    if (m->joint[j].type == CAV_JOINT_FREE) return q + m->joint[j].q + 3;
  return NULL;
}

/// How far the first free body is turned about the vertical from one configuration to another, rad; 0 where it mostly rolls or
/// tips, or none is free.
static double turned(const cav_model *m, const double *from, const double *to) {
  const double *a = heading_of(m, (double *)from), *b = heading_of(m, (double *)to);
  if (!a) return 0;
  // of b times the conjugate of a
  const double w = b[0] * a[0] + b[1] * a[1] + b[2] * a[2] + b[3] * a[3];
  const double z = -b[0] * a[3] - b[1] * a[2] + b[2] * a[1] + b[3] * a[0];
  return hypot(w, z) < upright ? 0 : remainder(2 * atan2(z, w), 2 * M_PI);
}

/// The posture, turned so that it faces where the model's own configuration does, and the travel with it: whose axes tell what is
/// across, and what the mirror is about.
static void face(const walker *w, const double *posture, double travel[2]) {
  const cav_model *m = w->problem->model;
  double *own = w->posture, *heading = heading_of(m, own);
  cav_configuration_reset(m, own);
  const double angle = -turned(m, own, posture), c = cos(angle), s = sin(angle), x = travel[0];
  memcpy(own, posture, (size_t)m->nq * sizeof *own);
  travel[0] = c * x - s * travel[1], travel[1] = s * x + c * travel[1];
  if (!heading) return;
  const double half[2] = {cos(angle / 2), sin(angle / 2)}, q[4] = {heading[0], heading[1], heading[2], heading[3]};
  heading[0] = half[0] * q[0] - half[1] * q[3], heading[1] = half[0] * q[1] - half[1] * q[2];
  heading[2] = half[0] * q[2] + half[1] * q[1], heading[3] = half[0] * q[3] + half[1] * q[0];
}

/// The gait of a model that is its own mirror image along an axis; none of others. link [nlink]: work.
static cav_status swing_in_turn(walker *w, int side, double travel, int *link, cav_strategy *strategy) {
  cav_error unlike;
  double asymmetry;
  w->side = side;
  cav_status status = cav_mirror_find(w->problem, side, w->image, link, &asymmetry, &unlike);
  if (status != CAV_OK) return status == CAV_NO_MEMORY ? status : CAV_OK;
  status = find_support(w);
  if (status == CAV_OK) find_gait(w, travel, strategy);
  return status;
}

cav_status cav_gait_find(const cav_problem *problem, cav_strategy *strategy, int *turns) {
  const cav_model *m = problem->model;
  double travel[2];
  find_travel(problem, travel);
  *turns = fmax(fabs(travel[0]), fabs(travel[1])) < least_travel;
  if (*turns && (problem->cycle.on || fabs(turned(m, problem->q_start, problem->q_goal)) < least_turn)) return CAV_OK;
  walker w = {.problem = problem, .state = cav_state_new(m), .posture = malloc((size_t)m->nq * sizeof(double))};
  w.image = calloc((size_t)m->njoint + 1, sizeof *w.image);
  w.carries = calloc((size_t)m->nlink + 1, 1);
  int *link = calloc((size_t)m->nlink + 1, sizeof *link);
  cav_status status = w.state && w.posture && w.image && w.carries && link ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) face(&w, *turns ? problem->q_start : problem->q_goal, travel);
  const int along = !*turns && fabs(travel[1]) > fabs(travel[0]);
  if (status == CAV_OK) status = swing_in_turn(&w, !along, *turns ? 0 : travel[along], link, strategy);
  // aside, where front and back are not alike: limbs bend in turn
  if (status == CAV_OK && along && !strategy->nswing) status = swing_in_turn(&w, 1, 0, link, strategy);
  cav_state_free(w.state);
  free(w.posture), free(w.image), free(w.carries), free(link);
  return status;
}
