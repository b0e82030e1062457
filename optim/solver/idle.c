/// What a plan leaves out: trees that no actuator moves and no term asks for, out of reach of the others. Given their
/// start, the dynamics alone says what they do, so no knot of theirs is unknown: they are simulated beside the plan,
/// which is that of the scene without them, weight included. How far others get is not known before the plan is: trees
/// count as out of reach where the guess keeps the size of a tree away from them, and the whole motion tells in the
/// end. If anything has met them it is planned as a whole. Sound without that guess being right; that only saves the
/// second plan. Cycles leave out nothing: what does not move would not move on with them.
#include "idle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "continuation.h"
#include "driven.h"
#include "lqr.h"
#include "problem_file.h"
#include "transcription.h"

// ---------------------------------------------------------------- what is asked for

/// Marks of trees, by their root links.
typedef struct marks {
  const cav_problem *problem;
  char *kept; ///< [nlink] 1 at root links: planned
} marks;

static void keep_link(const marks *a, int link) {
  const cav_model *m = a->problem->model;
  if (link > 0) a->kept[m->link[link].root] = 1;
}

static void keep_all(const marks *a) { memset(a->kept, 1, (size_t)a->problem->model->nlink); }

static void keep_dof(const marks *a, int dof) { keep_link(a, a->problem->model->dof[dof].link); }

static void keep_tendon(const marks *a, int tendon) {
  const cav_model *m = a->problem->model;
  for (int k = 0; k < m->tendon[tendon].ndof; k++) keep_dof(a, m->tendon_dof[m->tendon[tendon].dof + k]);
}

static void keep_object(const marks *a, cav_object_type type, int object) {
  const cav_model *m = a->problem->model;
  int link = type == CAV_OBJECT_GEOM   ? m->geom[object].link
             : type == CAV_OBJECT_SITE ? m->site[object].link
                                       : m->body[object].link;
  keep_link(a, link);
}

static void keep_sensed(const marks *a, const cav_sensor *sensor) {
  const cav_model *m = a->problem->model;
  switch (cav_sensor_rule_of(sensor->type)->target) {
    case CAV_TARGET_NONE:
      break;
    case CAV_TARGET_FRAME:
      keep_object(a, sensor->object_type, sensor->object);
      if (sensor->referred) keep_object(a, sensor->reference_type, sensor->reference);
      break;
    case CAV_TARGET_BODY:
      if (m->body[sensor->object].link == 0) keep_all(a);
      keep_object(a, CAV_OBJECT_BODY, sensor->object);
      break;
    case CAV_TARGET_SURFACE:
      // anything may press on what is of the world
      if (cav_object_link(m, sensor->object_type, sensor->object) == 0) keep_all(a);
      keep_object(a, sensor->object_type, sensor->object);
      break;
    case CAV_TARGET_SITE:
      // a rangefinder sees whatever is there
      if (sensor->type == CAV_SENSOR_RANGEFINDER) keep_all(a);
      keep_object(a, CAV_OBJECT_SITE, sensor->object);
      break;
    case CAV_TARGET_SCALAR_JOINT:
    case CAV_TARGET_BALL_JOINT:
    case CAV_TARGET_LIMITED_JOINT:
      keep_link(a, m->joint[sensor->object].link);
      break;
    case CAV_TARGET_TENDON:
    case CAV_TARGET_LIMITED_TENDON:
      keep_tendon(a, sensor->object);
      break;
    case CAV_TARGET_ACTUATOR:
      break;
  }
}

static int coordinates_of(const cav_joint *joint) {
  return joint->type == CAV_JOINT_FREE ? 7 : joint->type == CAV_JOINT_BALL ? 4 : 1;
}

/// Whether a cost over postures wants the joint elsewhere than where it starts.
static int wants_posture(const cav_problem *p, const cav_term *term, const cav_joint *joint) {
  int postures = !term->target ? 1 : term->nwaypoint ? term->nwaypoint : 1;
  for (int i = 0; i < postures; i++) {
    const double *target = term->target ? term->target + (size_t)i * (size_t)p->model->nq : p->q_goal;
    for (int k = joint->q; k < joint->q + coordinates_of(joint); k++)
      if (target[k] != p->q_start[k]) return 1;
  }
  return 0;
}

/// Whether a cost over rates wants other than rest.
static int wants_rate(const cav_problem *p, const cav_term *term, int dof) {
  int rates = term->nwaypoint ? term->nwaypoint : 1;
  for (int i = 0; term->target && i < rates; i++)
    if (term->target[(size_t)i * (size_t)p->model->nv + (size_t)dof] != 0) return 1;
  return 0;
}

static void keep_recorded(const marks *a, const cav_channel *channel) {
  if (channel->kind == CAV_CHANNEL_SENSOR)
    keep_sensed(a, &channel->sensor);
  else if (channel->kind == CAV_CHANNEL_MARKER)
    keep_object(a, CAV_OBJECT_XBODY, channel->object);
  else
    keep_link(a, a->problem->model->joint[channel->object].link);
}

static void keep_asked(const marks *a, const cav_term *term) {
  const cav_model *m = a->problem->model;
  cav_values_of of = cav_quantity_rule_of(term->quantity)->of;
  if (of == CAV_OF_SENSOR) keep_sensed(a, &term->sensor);
  for (int i = 0; of == CAV_OF_TRACK && i < term->track->nchannel; i++) keep_recorded(a, &term->track->channel[i]);
  if (of == CAV_OF_USER) keep_all(a); // what it looks at it alone knows, by the numbers of this model
  if (of == CAV_OF_CONTACTS && term->body > 0) keep_object(a, CAV_OBJECT_BODY, term->body);
  for (int d = 0; (of == CAV_OF_POSTURE || of == CAV_OF_RATE) && d < m->nv; d++) {
    if (!cav_problem_selects(m, term, d)) continue;
    int asked = term->use != CAV_USE_COST || term->dofs == CAV_DOFS_ONE;
    if (of == CAV_OF_POSTURE) asked |= wants_posture(a->problem, term, &m->joint[m->dof[d].joint]);
    if (of == CAV_OF_RATE) asked |= wants_rate(a->problem, term, d);
    if (asked) keep_dof(a, d);
  }
}

// ---------------------------------------------------------------- what comes near

typedef struct box {
  double low[3], high[3];
} box;

/// Box about the geoms of each tree that are in a pair, over the knots of a motion, and the largest at one knot.
typedef struct extent {
  box *box;     ///< [nlink] by root links
  double *size; ///< [nlink]
} extent;

static double box_size(const box *b) {
  double sum = 0;
  for (int k = 0; k < 3; k++) sum += (b->high[k] - b->low[k]) * (b->high[k] - b->low[k]);
  return sqrt(sum);
}

static double box_gap(const box *a, const box *b) {
  double sum = 0;
  for (int k = 0; k < 3; k++) {
    double gap = fmax(fmax(a->low[k] - b->high[k], b->low[k] - a->high[k]), 0);
    sum += gap * gap;
  }
  return sqrt(sum);
}

static const box nowhere = {{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};

static void box_take(box *b, const box *other) {
  for (int k = 0; k < 3; k++) b->low[k] = fmin(b->low[k], other->low[k]), b->high[k] = fmax(b->high[k], other->high[k]);
}

/// Boxes of a part's trees over the knots of a trajectory, by the root links of the whole. here [nlink] is scratch.
static cav_status find_space(const cav_model *whole, const cav_part *part, const cav_trajectory *at, box *here,
                             extent *space) {
  const cav_model *m = part->model;
  cav_state *state = cav_state_new(m);
  cav_status status = state ? CAV_OK : CAV_NO_MEMORY;
  for (int t = 0; status == CAV_OK && t < at->nknot; t++) {
    status = cav_position(m, state, at->q + (size_t)t * (size_t)at->nq);
    for (int l = 0; l < whole->nlink; l++) here[l] = nowhere;
    for (int g = 0; status == CAV_OK && g < whole->ngeom; g++) {
      const cav_geom *geom = &whole->geom[g];
      if (geom->link == 0 || part->link[geom->link] < 0) continue;
      const cav_pose *pose = &state->link[part->link[geom->link]];
      box ball;
      for (int k = 0; k < 3; k++) {
        const double *R = pose->rotation + 3 * k;
        double centre = pose->pos[k] + R[0] * geom->pos[0] + R[1] * geom->pos[1] + R[2] * geom->pos[2];
        ball.low[k] = centre - geom->bound, ball.high[k] = centre + geom->bound;
      }
      box_take(&here[whole->link[geom->link].root], &ball);
    }
    for (int l = 1; status == CAV_OK && l < whole->nlink; l++) {
      if (here[l].low[0] > here[l].high[0]) continue;
      box_take(&space->box[l], &here[l]);
      space->size[l] = fmax(space->size[l], box_size(&here[l]));
    }
  }
  cav_state_free(state);
  return status;
}

/// Keeps the trees that a pair joins to one that is kept, where the boxes are nearer than that one's size. Returns
/// whether there were any.
static int keep_near(const marks *a, const extent *space) {
  const cav_model *m = a->problem->model;
  int changed = 0;
  for (int i = 0; i < m->npair; i++) {
    int one = m->link[m->geom[m->pair[i].geom1].link].root, other = m->link[m->geom[m->pair[i].geom2].link].root;
    if (one == 0 || other == 0 || a->kept[one] == a->kept[other]) continue;
    int kept = a->kept[one] ? one : other, alone = kept == one ? other : one;
    if (box_gap(&space->box[one], &space->box[other]) >= space->size[kept]) continue;
    a->kept[alone] = 1;
    changed = 1;
  }
  return changed;
}

// ---------------------------------------------------------------- the two parts

static void *take(char **at, size_t n, size_t size) {
  void *p = *at;
  *at += (n * size + 15) & ~(size_t)15;
  return p;
}

/// Vectors of target of a term: waypoints, or one.
static size_t targets_of(const cav_term *term) { return term->nwaypoint ? (size_t)term->nwaypoint : 1; }

/// A record over the part's indices; columns stay where they are.
static const cav_track *reduce_track(const cav_track *whole, const cav_part *part, char **at) {
  cav_track *track = take(at, 1, sizeof *track);
  cav_channel *channel = take(at, (size_t)whole->nchannel, sizeof *channel);
  *track = *whole;
  track->channel = channel;
  for (int i = 0; i < whole->nchannel; i++) {
    channel[i] = whole->channel[i];
    if (channel[i].kind == CAV_CHANNEL_SENSOR)
      cav_part_sensor(part, &channel[i].sensor);
    else
      channel[i].object = (channel[i].kind == CAV_CHANNEL_MARKER ? part->body : part->joint)[channel[i].object];
  }
  return track;
}

/// The whole problem over the part's indices.
static cav_status reduce_problem(const cav_problem *whole, const cav_part *part, cav_problem *problem, void **owner) {
  const cav_model *m = whole->model;
  size_t nq = (size_t)m->nq, nv = (size_t)m->nv, bytes = (2 * nq + nv) * sizeof(double) + 64;
  bytes += (size_t)whole->nguess_pose * (sizeof(cav_guess_pose) + nq * sizeof(double) + 16) + 16;
  bytes += (size_t)whole->nswing * sizeof(cav_swing) + (size_t)whole->nterm * sizeof(cav_term) + 32;
  for (int i = 0; i < whole->nterm; i++) bytes += targets_of(&whole->term[i]) * nq * sizeof(double) + 16;
  for (int i = 0; i < whole->nterm; i++)
    if (whole->term[i].track)
      bytes += sizeof(cav_track) + (size_t)whole->term[i].track->nchannel * sizeof(cav_channel) + 32;
  char *at = *owner = calloc(1, bytes);
  if (!at) return CAV_NO_MEMORY;
  *problem = *whole;
  problem->model = part->model;
  problem->owner = NULL;
  problem->q_start = take(&at, nq, sizeof(double));
  problem->q_goal = take(&at, nq, sizeof(double));
  problem->v_start = take(&at, nv, sizeof(double));
  cav_part_gather(m->nq, part->q, whole->q_start, problem->q_start);
  cav_part_gather(m->nq, part->q, whole->q_goal, problem->q_goal);
  cav_part_gather(m->nv, part->dof, whole->v_start, problem->v_start);
  cav_guess_pose *pose = take(&at, (size_t)whole->nguess_pose, sizeof *pose);
  for (int i = 0; i < whole->nguess_pose; i++) {
    double *q = take(&at, nq, sizeof(double));
    cav_part_gather(m->nq, part->q, whole->guess_pose[i].q, q);
    pose[i] = (cav_guess_pose){whole->guess_pose[i].time, q};
  }
  problem->guess_pose = pose;
  problem->guess_left = NULL;
  problem->swing = take(&at, (size_t)whole->nswing, sizeof *problem->swing);
  for (int i = 0; i < whole->nswing; i++) {
    problem->swing[i] = whole->swing[i];
    problem->swing[i].joint = part->joint[whole->swing[i].joint];
  }
  problem->term = take(&at, (size_t)whole->nterm, sizeof *problem->term);
  for (int i = 0; i < whole->nterm; i++) {
    cav_term *term = &problem->term[i];
    *term = whole->term[i];
    cav_values_of of = cav_quantity_rule_of(term->quantity)->of;
    if (of == CAV_OF_SENSOR) cav_part_sensor(part, &term->sensor);
    if (of == CAV_OF_TRACK) term->track = reduce_track(term->track, part, &at);
    if (of == CAV_OF_CONTACTS && term->body > 0) term->body = part->body[term->body];
    if (term->dofs == CAV_DOFS_ONE) term->joint = part->joint[term->joint];
    if (!term->target || (of != CAV_OF_POSTURE && of != CAV_OF_RATE)) continue;
    int posture = of == CAV_OF_POSTURE, n = posture ? m->nq : m->nv, kept = posture ? part->model->nq : part->model->nv;
    double *target = take(&at, targets_of(term) * (size_t)n, sizeof(double));
    for (size_t k = 0; k < targets_of(term); k++)
      cav_part_gather(n, posture ? part->q : part->dof, whole->term[i].target + k * (size_t)n,
                      target + k * (size_t)kept);
    term->target = target;
  }
  return CAV_OK;
}

/// Both parts by the marks; 0 trees left out where all are marked. here [nlink] is scratch.
static cav_status split(const marks *a, char *here, cav_idle *idle) {
  const cav_model *m = a->problem->model;
  cav_part_clear(&idle->plan), cav_part_clear(&idle->idle);
  idle->ntree = idle->ndof = 0;
  int planned = 0;
  for (int l = 1; l < m->nlink; l++) {
    int root = m->link[l].root, left = !a->kept[root];
    here[l] = !a->kept[l];
    idle->ntree += left && root == l;
    idle->ndof += left ? m->link[l].ndof : 0;
    planned |= !left;
  }
  if (!planned) idle->ntree = idle->ndof = 0;
  if (idle->ntree == 0) return CAV_OK;
  cav_status status = cav_part_take(m, a->kept, &idle->plan);
  return status == CAV_OK ? cav_part_take(m, here, &idle->idle) : status;
}

/// The idle trees from their start by the law. CAV_NOT_CONVERGED, CAV_NOT_FINITE: what the forward step says.
static cav_status move_alone(const cav_idle *idle, const cav_options *law, cav_trajectory *at) {
  cav_part_gather(idle->whole->model->nq, idle->idle.q, idle->whole->q_start, at->q);
  cav_part_gather(idle->whole->model->nv, idle->idle.dof, idle->whole->v_start, at->v);
  return cav_simulate_passive(idle->idle.model, law, at);
}

/// Whether the idle trees end at rest, where the motion closes so: within the speed that a ten millionth of their
/// weight gives in a step.
static int ends_well(const cav_idle *idle, const cav_options *law) {
  const cav_trajectory *at = idle->alone;
  const double *v = at->v + (size_t)(at->nknot - 1) * (size_t)at->nv;
  double fastest = 0;
  for (int d = 0; d < at->nv; d++) fastest = fmax(fastest, fabs(v[d]));
  return !idle->whole->close_at_rest || fastest <= 1e-6 * law->timestep;
}

/// Whether the problem can be split; with both parts, and the idle one by itself. What comes near is kept until nothing
/// does.
static cav_status split_apart(marks *a, char *here, box *room, extent *space, cav_idle *idle) {
  const cav_model *m = a->problem->model;
  int nknot = (int)lround(a->problem->duration / a->problem->timestep) + 1;
  cav_options law = cav_last_law(a->problem);
  for (;;) {
    while (cav_roots_join(a->problem->model, a->kept)) continue;
    cav_trajectory_free(idle->alone);
    free(idle->owner);
    idle->alone = NULL, idle->owner = NULL;
    cav_status status = split(a, here, idle);
    if (status != CAV_OK || idle->ntree == 0) return status;
    status = reduce_problem(a->problem, &idle->plan, &idle->problem, &idle->owner);
    cav_trajectory *guess = cav_trajectory_new(idle->plan.model, nknot, a->problem->timestep);
    idle->alone = cav_trajectory_new(idle->idle.model, nknot, a->problem->timestep);
    if (!guess || !idle->alone) status = CAV_NO_MEMORY;
    if (status == CAV_OK) status = move_alone(idle, &law, idle->alone);
    if (status == CAV_OK && !ends_well(idle, &law)) status = CAV_NOT_CONVERGED;
    for (int l = 0; l < m->nlink; l++) space->box[l] = nowhere, space->size[l] = 0;
    if (status == CAV_OK) { status = cav_guess_fill(&idle->problem, idle->problem.q_goal, guess); }
    if (status == CAV_OK) { status = find_space(m, &idle->plan, guess, room, space); }
    if (status == CAV_OK) status = find_space(m, &idle->idle, idle->alone, room, space);
    cav_trajectory_free(guess);
    // what cannot be moved by itself, or not as asked, is planned with the rest
    if (status != CAV_OK && status != CAV_NO_MEMORY) {
      keep_all(a);
      continue;
    }
    if (status != CAV_OK || !keep_near(a, space)) return status;
  }
}

cav_status cav_idle_find(const cav_problem *p, cav_idle *idle) {
  const cav_model *m = p->model;
  size_t n = (size_t)m->nlink;
  int trees = 0;
  *idle = (cav_idle){.whole = p};
  for (int l = 1; l < m->nlink; l++) trees += m->link[l].root == l;
  if (trees < 2 || p->cycle.on || p->free_start) return CAV_OK;
  char *mark = calloc(2, n);
  box *room = malloc(2 * n * sizeof *room);
  double *size = malloc(n * sizeof *size);
  marks a = {p, mark};
  extent space = {room ? room + n : NULL, size};
  cav_status status = mark && room && size ? CAV_OK : CAV_NO_MEMORY;
  if (status == CAV_OK) {
    cav_roots_actuated(m, a.kept);
    for (int i = 0; i < p->nterm; i++) keep_asked(&a, &p->term[i]);
    for (int i = 0; i < p->nswing; i++) keep_link(&a, m->joint[p->swing[i].joint].link);
    status = split_apart(&a, mark + n, room, &space, idle);
  }
  free(mark), free(room), free(size);
  if (status != CAV_OK || idle->ntree == 0) cav_idle_clear(idle);
  idle->whole = p;
  return status;
}

void cav_idle_clear(cav_idle *idle) {
  cav_part_clear(&idle->plan), cav_part_clear(&idle->idle);
  cav_trajectory_free(idle->alone);
  free(idle->owner);
  *idle = (cav_idle){0};
}

// ---------------------------------------------------------------- to and fro

cav_trajectory *cav_idle_reduce(const cav_idle *idle, const cav_trajectory *whole) {
  cav_trajectory *part = cav_trajectory_new(idle->plan.model, whole->nknot, whole->timestep);
  for (size_t t = 0; part && t < (size_t)whole->nknot; t++) {
    cav_part_gather(whole->nq, idle->plan.q, whole->q + t * (size_t)whole->nq, part->q + t * (size_t)part->nq);
    cav_part_gather(whole->nv, idle->plan.dof, whole->v + t * (size_t)whole->nv, part->v + t * (size_t)part->nv);
    cav_part_gather(whole->nv, idle->plan.dof, whole->u + t * (size_t)whole->nv, part->u + t * (size_t)part->nv);
  }
  return part;
}

/// A part's motion into the whole one.
static void lay(const cav_part *part, const cav_trajectory *from, cav_trajectory *to) {
  for (size_t t = 0; t < (size_t)to->nknot; t++) {
    cav_part_scatter(to->nq, part->q, from->q + t * (size_t)from->nq, to->q + t * (size_t)to->nq);
    cav_part_scatter(to->nv, part->dof, from->v + t * (size_t)from->nv, to->v + t * (size_t)to->nv);
    cav_part_scatter(to->nv, part->dof, from->u + t * (size_t)from->nv, to->u + t * (size_t)to->nv);
  }
}

/// Whether a contact of a state pushes between a tree that is planned and one that is idle.
static int meets(const cav_idle *idle, const cav_state *state) {
  for (int k = 0; k < state->ncontact; k++) {
    const cav_contact *c = &state->contact[k];
    if (c->link1 == 0 || c->link2 == 0) continue;
    if ((idle->plan.link[c->link1] < 0) != (idle->plan.link[c->link2] < 0) && c->impulse[0] > 0) return 1;
  }
  return 0;
}

/// Whether no knot of the whole motion has such a contact, or an idle tree that needs a force; u of these is filled in.
static cav_status check_alone(const cav_idle *idle, const cav_options *law, double tolerance, cav_trajectory *at,
                              int *alone) {
  const cav_problem *p = idle->whole;
  const cav_model *m = p->model;
  size_t nq = (size_t)at->nq, nv = (size_t)at->nv;
  double *rest = calloc(2 * nv, sizeof *rest), pull = 0;
  cav_state *state = cav_state_new(m);
  cav_status status = rest && state ? CAV_OK : CAV_NO_MEMORY;
  for (int k = 0; k < 3; k++) pull += m->gravity[k] * m->gravity[k];
  double unit = m->mass * (pull > 0 ? sqrt(pull) : 1), *u = rest ? rest + nv : NULL;
  *alone = 1;
  if (status == CAV_OK) state->options = *law;
  for (size_t t = 0; status == CAV_OK && t < (size_t)at->nknot; t++) {
    int last = t + 1 == (size_t)at->nknot;
    const double *v = at->v + t * nv, *next = !last ? v + nv : p->close_at_rest ? rest : v;
    state->options.stops = law->stops && last && p->close_at_rest;
    status = cav_inverse(m, state, at->q + t * nq, v, next, u);
    if (status != CAV_OK) break;
    *alone &= !meets(idle, state);
    for (size_t d = 0; d < nv; d++) {
      if (idle->idle.dof[d] < 0) continue;
      at->u[t * nv + d] = u[d];
      if ((!last || p->close_at_rest) && !(fabs(u[d]) <= tolerance * unit * CAV_MOMENT_ARM)) *alone = 0;
    }
  }
  cav_state_free(state);
  free(rest);
  return status;
}

/// Index in the whole of a part's.
static int index_of(int n, const int *map, int part) {
  for (int i = 0; i < n; i++)
    if (map[i] == part) return i;
  return part;
}

static void renumber_row(const cav_idle *idle, cav_binding *row) {
  const cav_model *m = idle->whole->model;
  const cav_part *part = &idle->plan;
  switch (row->kind) {
    case CAV_BINDING_UNACTUATED:
      row->object = index_of(m->nv, part->dof, row->object);
      break;
    case CAV_BINDING_EFFORT:
      row->object = index_of(m->nactuator, part->actuator, row->object);
      break;
    case CAV_BINDING_JOINT:
      row->object = index_of(m->njoint, part->joint, row->object);
      break;
    case CAV_BINDING_TENDON:
      row->object = index_of(m->ntendon, part->tendon, row->object);
      break;
    case CAV_BINDING_TERM: {
      int hard = -1;
      for (int i = 0; i < idle->whole->nterm; i++) {
        const cav_term *term = &idle->whole->term[i];
        hard += term->use != CAV_USE_COST;
        if (hard != row->object || term->use == CAV_USE_COST || cav_term_is_reading(term)) continue;
        row->component = index_of(m->nv, part->dof, row->component);
      }
      break;
    }
    case CAV_BINDING_PENETRATION:
    case CAV_BINDING_KINDS:
      break;
  }
}

/// Gains [n*nv*nv] of the whole, zero for the idle trees; NULL if memory runs out.
static double *spread_gains(const cav_idle *idle, size_t n, const double *gain) {
  size_t nv = (size_t)idle->whole->model->nv, kept = (size_t)idle->plan.model->nv;
  const int *dof = idle->plan.dof;
  double *out = calloc(n * nv * nv + 1, sizeof *out);
  for (size_t t = 0; out && t < n; t++)
    for (size_t i = 0; i < nv; i++)
      for (size_t j = 0; dof[i] >= 0 && j < nv; j++)
        if (dof[j] >= 0) out[(t * nv + i) * nv + j] = gain[(t * kept + (size_t)dof[i]) * kept + (size_t)dof[j]];
  return out;
}

cav_status cav_idle_expand(const cav_idle *idle, double tolerance, cav_solution *solution, int *alone) {
  const cav_trajectory *plan = solution->trajectory;
  size_t steps = (size_t)plan->nknot - 1;
  cav_trajectory *at = cav_trajectory_new(idle->whole->model, plan->nknot, plan->timestep);
  cav_trajectory *rest = cav_trajectory_new(idle->idle.model, plan->nknot, plan->timestep);
  double *gain_q = solution->gain_q ? spread_gains(idle, steps, solution->gain_q) : NULL;
  double *gain_v = solution->gain_v ? spread_gains(idle, steps, solution->gain_v) : NULL;
  int whole = at && rest && (gain_q || !solution->gain_q) && (gain_v || !solution->gain_v);
  cav_status status = whole ? move_alone(idle, &solution->contact, rest) : CAV_NO_MEMORY;
  *alone = status == CAV_OK;
  if (status == CAV_OK) {
    lay(&idle->plan, plan, at);
    lay(&idle->idle, rest, at);
    status = check_alone(idle, &solution->contact, tolerance, at, alone);
  }
  cav_trajectory_free(rest);
  if (status != CAV_OK) {
    cav_trajectory_free(at), free(gain_q), free(gain_v);
    *alone = 0;
    return status == CAV_NO_MEMORY ? status : CAV_OK;
  }
  cav_trajectory_free(solution->trajectory);
  cav_gains_free(solution);
  solution->trajectory = at;
  solution->gain_q = gain_q, solution->gain_v = gain_v;
  for (int i = 0; i < solution->nrow; i++) renumber_row(idle, &solution->row[i]);
  return CAV_OK;
}
