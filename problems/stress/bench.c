/// Scenes pushed to one value of one parameter, and samples of their states. The model is loaded once, edited in place
/// and put back. Samples are the same whatever is swept, so what changes between two values is the parameter.
#include "bench.h"

#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "cavort/dynamics.h"
#include "edit.h"
#include "file.h"
#include "math3.h"
#include "random.h"

enum { BISECTIONS = 60 };
static const double nearness = 1e-4; // of L, how deep contacts are where nothing is said
static const double swing = 0.3;     // rad, of samples about the scene's posture
static const double deep = 1e-3;     // of L, how much deeper links may be in each other there
static const double upright = 0.99;  // cosine of a slide along the vertical

int cav_bench_turns(const cav_model *model, int i) {
  const cav_joint *joint = &model->joint[model->dof[i].joint];
  return joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_BALL ||
         (joint->type == CAV_JOINT_FREE && i >= joint->dof + 3);
}

// --- the scene ---

// distance from the origin of a root to the furthest point of what hangs from it, at the state's posture
static double size_of(const cav_model *model, const cav_state *state) {
  double most = 0;
  for (int i = 0; i < model->ngeom; i++) {
    const cav_geom *geom = &model->geom[i];
    if (geom->link == 0 || !isfinite(geom->bound)) continue;
    const double *root = state->link[model->link[geom->link].root].pos;
    cav_pose at;
    cav_object_pose(model, state, CAV_OBJECT_GEOM, i, &at);
    most = fmax(most, hypot(hypot(at.pos[0] - root[0], at.pos[1] - root[1]), at.pos[2] - root[2]) + geom->bound);
  }
  for (int i = 1; i < model->nlink; i++) {
    const double *root = state->link[model->link[i].root].pos, *at = state->com + 3 * i;
    most = fmax(most, hypot(hypot(at[0] - root[0], at[1] - root[1]), at[2] - root[2]));
  }
  return most > 0 ? most : 1;
}

static cav_status load(cav_bench *b, const cav_stress_scene *scene, cav_error *error) {
  if (scene->problem) {
    b->problem = cav_problem_load(scene->path, scene->model, error);
    if (!b->problem) return error->status;
    b->model = (cav_model *)b->problem->model;
    return CAV_OK;
  }
  cav_load_options options = cav_load_options_default();
  options.floating = scene->floating;
  b->model = cav_model_load_with(scene->path, &options, error);
  return b->model ? CAV_OK : error->status;
}

// the law that a problem ends with
static cav_options options_of(const cav_bench *b) {
  cav_options o = b->model->options;
  if (!b->problem) return o;
  const cav_stage_options *last = &b->problem->schedule.last;
  o.timestep = b->problem->timestep;
  o.order = b->problem->order;
  o.stabilisation = CAV_STABILISATION_DISCRETE;
  o.softness = last->softness;
  o.time_constant = last->time_constant;
  o.smoothing = last->smoothing;
  o.smoothing_self = last->smoothing_self;
  o.sliding = b->problem->schedule.sliding;
  o.next_gap = b->problem->schedule.next_gap;
  o.next_slip = b->problem->schedule.next_slip;
  return o;
}

// what a loaded scene needs
static cav_status set_up(cav_bench *b, cav_error *error) {
  const cav_model *m = b->model;
  const size_t nq = (size_t)m->nq, nv = (size_t)m->nv;
  b->kept = cav_model_keep(m);
  b->space = calloc(3 * nq + 10 * nv + 1, sizeof *b->space);
  if (!b->kept || !b->space) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for the scene");
  double *at = b->space;
  b->q = at, b->v = at += nq, b->v_next = at += nv, b->u = at += nv, b->unit = at += nv, b->scratch = at += nv;
  double *start = at + nq + 6 * nv;
  if (nq > 0) memcpy(start, b->problem ? b->problem->q_start : m->q0, nq * sizeof *start);
  b->start = start;
  b->options = options_of(b);
  if (nv == 0) return cav_file_fail(error, CAV_BAD_INPUT, 0, "nothing moves in this scene: there is nothing to sweep");
  return CAV_OK;
}

cav_status cav_bench_open(cav_bench *b, const cav_stress_scene *scene, cav_error *error) {
  *b = (cav_bench){0};
  cav_status status = load(b, scene, error);
  return status ? status : set_up(b, error);
}

cav_status cav_bench_take(cav_bench *b, cav_model *model, cav_error *error) {
  *b = (cav_bench){.model = model};
  return set_up(b, error);
}

void cav_bench_close(cav_bench *b) {
  cav_state_free(b->state);
  if (b->kept && b->model) cav_model_return(b->model, b->kept);
  if (b->problem)
    cav_problem_free(b->problem);
  else
    cav_model_free(b->model);
  free(b->kept);
  free(b->space);
  *b = (cav_bench){0};
}

// --- parameters ---

static int constrained(const cav_model *m) {
  int n = m->npair + m->nequality;
  for (int i = 0; i < m->njoint; i++) {
    const cav_joint *joint = &m->joint[i];
    n += joint->limited || joint->twist_limited || joint->swing_limited;
  }
  for (int i = 0; i < m->nv; i++) n += m->dof[i].frictionloss > 0;
  for (int i = 0; i < m->ntendon; i++) n += m->tendon[i].limited || m->tendon[i].frictionloss > 0;
  return n > 0;
}

static int has_quaternions(const cav_model *m) {
  for (int i = 0; i < m->njoint; i++)
    if (m->joint[i].type == CAV_JOINT_FREE || m->joint[i].type == CAV_JOINT_BALL) return 1;
  return 0;
}

static int has_joints_in_trees(const cav_model *m) {
  for (int i = 0; i < m->njoint; i++)
    if (m->joint[i].type != CAV_JOINT_FREE) return 1;
  return 0;
}

static int rubs(const cav_model *m) {
  for (int i = 0; i < m->npair; i++)
    if (m->pair[i].dim > 1) return 1;
  return 0;
}

// by how much a joint of a root link has to move to lift its tree by 1: a free joint along z, a slide along the vertical that
// no joint before it turns and no limit holds; 0: it lifts nothing
static double lift_of(const cav_model *m, const cav_joint *joint) {
  const cav_link *link = &m->link[joint->link];
  double axis[3];
  if (link->parent != 0) return 0;
  if (joint->type == CAV_JOINT_FREE) return 1;
  if (joint->type != CAV_JOINT_SLIDE || joint->limited) return 0;
  for (const cav_joint *before = m->joint + link->joint; before < joint; before++)
    if (before->type != CAV_JOINT_SLIDE) return 0;
  quat_rotate(axis, link->quat, joint->axis);
  return fabs(axis[2]) > upright ? 1 / axis[2] : 0;
}

// whether the tree of a geom can be moved along the vertical
static int rises(const cav_model *m, int geom) {
  const cav_link *root = &m->link[m->link[m->geom[geom].link].root];
  for (int i = root->joint; i < root->joint + root->njoint; i++)
    if (lift_of(m, &m->joint[i]) != 0) return 1;
  return 0;
}

// why no contact with the world can be made as deep as asked; NULL: it can
static const char *not_lowered(const cav_model *m) {
  int ground = 0;
  for (int i = 0; i < m->npair; i++) {
    const int first = m->geom[m->pair[i].geom1].link == 0, second = m->geom[m->pair[i].geom2].link == 0;
    if (!first && !second) continue;
    ground = 1;
    if (rises(m, first ? m->pair[i].geom2 : m->pair[i].geom1)) return NULL;
  }
  return ground ? "what can touch the world neither floats nor slides along the vertical without a limit: how deep it "
                  "is depends "
                  "on the posture"
                : "the scene has nothing that stands in the world and can be touched, no floor say";
}

const char *cav_bench_absent(const cav_bench *b, cav_stress_sweep sweep) {
  const cav_model *m = b->model;
  switch (sweep) {
    case CAV_STRESS_MASS_RATIO:
      return m->nlink > 2 ? NULL : "one thing alone moves";
    case CAV_STRESS_STIFFNESS:
      return has_joints_in_trees(m) || cav_model_stiffest(m, 0, NULL) > 0 ? NULL : "no joint for a spring";
    case CAV_STRESS_DAMPING:
      return has_joints_in_trees(m) || cav_model_most_damped(m, NULL) > 0 ? NULL : "no joint for a damper";
    case CAV_STRESS_SOLREF:
    case CAV_STRESS_SOFTNESS:
    case CAV_STRESS_TIME_CONSTANT:
    case CAV_STRESS_SMOOTHING:
      return constrained(m) ? NULL : "no contacts, limits, friction losses or equality constraints";
    case CAV_STRESS_FRICTION:
    case CAV_STRESS_IMPRATIO:
      return rubs(m) ? NULL : "no contacts with friction";
    case CAV_STRESS_PENETRATION:
      return not_lowered(m);
    case CAV_STRESS_QUATERNIONS:
      return has_quaternions(m) ? NULL : "no free or ball joint";
    default:
      return NULL;
  }
}

// shortest time constant of contacts, limits and equality constraints, s; 0: none in that form
static double shortest_solref(const cav_model *m) {
  double least = INFINITY;
  for (int i = 0; i < m->npair; i++)
    if (m->pair[i].softness.solref[0] > 0) least = fmin(least, m->pair[i].softness.solref[0]);
  for (int i = 0; i < m->nequality; i++)
    if (m->equality[i].softness.solref[0] > 0) least = fmin(least, m->equality[i].softness.solref[0]);
  for (int i = 0; i < m->njoint; i++)
    if (m->joint[i].limited && m->joint[i].limit.solref[0] > 0) least = fmin(least, m->joint[i].limit.solref[0]);
  return isfinite(least) ? least : 0;
}

double cav_bench_own(const cav_bench *b, cav_stress_sweep sweep) {
  const double h = b->options.timestep;
  double solref;
  switch (sweep) {
    case CAV_STRESS_TIMESTEP:
      return h;
    case CAV_STRESS_STIFFNESS:
      return cav_model_stiffest(b->model, 0, NULL) * h * h;
    case CAV_STRESS_DAMPING:
      return cav_model_most_damped(b->model, NULL) * h;
    case CAV_STRESS_SOLREF:
      solref = shortest_solref(b->model) / h;
      return solref > 0 && b->options.refsafe ? fmax(solref, 2) : solref;
    case CAV_STRESS_SOFTNESS:
      return b->options.softness;
    case CAV_STRESS_TIME_CONSTANT:
      return b->options.time_constant / h;
    case CAV_STRESS_SMOOTHING:
      return b->options.smoothing / b->size;
    case CAV_STRESS_FRICTION:
      for (int i = 0; i < b->model->npair; i++)
        if (b->model->pair[i].dim > 1) return b->model->pair[i].friction[0];
      return 0;
    case CAV_STRESS_IMPRATIO:
      return b->options.impratio;
    case CAV_STRESS_PENETRATION:
      return nearness;
    case CAV_STRESS_MASS_RATIO:
    case CAV_STRESS_SIZE:
    case CAV_STRESS_SPEED:
    case CAV_STRESS_FORCE:
    case CAV_STRESS_COORDINATES:
    case CAV_STRESS_QUATERNIONS:
    case CAV_STRESS_SWEEPS:
      break;
  }
  return 1;
}

int cav_bench_other_law(const cav_bench *b, cav_stress_sweep sweep) {
  const int discrete = b->options.stabilisation == CAV_STABILISATION_DISCRETE;
  if (sweep == CAV_STRESS_SOLREF) return discrete;
  return (sweep == CAV_STRESS_SOFTNESS || sweep == CAV_STRESS_TIME_CONSTANT) && !discrete;
}

// every other link down each tree, trees by turns
static cav_status push_masses(cav_bench *b, double factor) {
  const cav_model *m = b->model;
  double *scale = calloc((size_t)m->nlink + 1, sizeof *scale);
  int *depth = calloc((size_t)m->nlink + 1, sizeof *depth);
  cav_status status = scale && depth ? CAV_OK : CAV_NO_MEMORY;
  for (int i = 1, trees = 0; i < m->nlink && !status; i++) {
    depth[i] = m->link[i].parent == 0 ? trees++ : depth[m->link[i].parent] + 1;
    scale[i] = depth[i] % 2 ? factor : 1;
  }
  if (!status) status = cav_model_perturb(b->model, scale, 0);
  free(scale);
  free(depth);
  return status;
}

static cav_status push_model(cav_bench *b, cav_stress_sweep sweep, double value) {
  cav_options *o = &b->pushed;
  const double h = o->timestep;
  switch (sweep) {
    case CAV_STRESS_MASS_RATIO:
      return push_masses(b, value);
    case CAV_STRESS_TIMESTEP:
      o->timestep = value;
      break;
    case CAV_STRESS_STIFFNESS:
      o->passive = 1;
      cav_model_set_stiffest(b->model, value / (h * h));
      break;
    case CAV_STRESS_DAMPING:
      o->passive = 1;
      cav_model_set_most_damped(b->model, value / h);
      break;
    case CAV_STRESS_SOLREF:
      o->stabilisation = CAV_STABILISATION_SOLREF;
      o->refsafe = 0;
      if (value > 0) cav_model_set_solref(b->model, value * h);
      break;
    case CAV_STRESS_SOFTNESS:
      o->stabilisation = CAV_STABILISATION_DISCRETE;
      o->softness = value;
      break;
    case CAV_STRESS_TIME_CONSTANT:
      o->stabilisation = CAV_STABILISATION_DISCRETE;
      o->time_constant = value * h;
      break;
    case CAV_STRESS_SMOOTHING:
      o->smoothing = o->smoothing_self = value * b->size;
      break;
    case CAV_STRESS_FRICTION:
      return value > 0 ? cav_model_perturb(b->model, NULL, value) : CAV_OK;
    case CAV_STRESS_IMPRATIO:
      o->impratio = value;
      break;
    case CAV_STRESS_SIZE:
      return cav_model_scale(b->model, value);
    case CAV_STRESS_SPEED:
      b->speed = value;
      b->slow = value < 1;
      break;
    case CAV_STRESS_FORCE:
      b->force = value;
      break;
    case CAV_STRESS_PENETRATION:
      b->depth = value * b->size;
      break;
    case CAV_STRESS_COORDINATES:
      b->moved[0] = value * b->size;
      b->moved[1] = -0.7 * value * b->size;
      cav_model_move(b->model, b->moved);
      break;
    case CAV_STRESS_QUATERNIONS:
      b->quaternion = value;
      break;
    case CAV_STRESS_SWEEPS:
      break;
  }
  return CAV_OK;
}

// where the pushed scene starts: the scene's posture, scaled and moved
static void place_start(const cav_bench *b, double *q) {
  const cav_model *m = b->model;
  memcpy(q, b->start, (size_t)m->nq * sizeof *q);
  for (int i = 0; i < m->njoint; i++) {
    const cav_joint *joint = &m->joint[i];
    if (joint->type == CAV_JOINT_SLIDE) q[joint->q] *= b->factor;
    for (int k = 0; k < 3 && joint->type == CAV_JOINT_FREE; k++)
      q[joint->q + k] = q[joint->q + k] * b->factor + b->moved[k];
  }
}

cav_status cav_bench_push(cav_bench *b, cav_stress_sweep sweep, double value, cav_error *error) {
  cav_model *m = b->model;
  cav_state_free(b->state);
  cav_model_return(m, b->kept);
  b->pushed = b->options;
  b->slow = 0;
  b->speed = b->force = b->quaternion = b->factor = 1;
  memset(b->moved, 0, sizeof b->moved);
  b->gravity = hypot(hypot(m->gravity[0], m->gravity[1]), m->gravity[2]);
  if (!(b->gravity > 0)) b->gravity = 9.81;
  // L of the scene as it is
  b->state = cav_state_new(m);
  if (!b->state) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for a state");
  cav_status status = cav_position(m, b->state, b->start);
  if (status) return cav_file_fail(error, status, 0, "the scene's own posture cannot be evaluated");
  b->size = size_of(m, b->state);
  b->depth = nearness * b->size;
  cav_state_free(b->state);
  b->state = NULL;
  if (sweep == CAV_STRESS_SWEEPS) {
    status = CAV_OK;
  } else {
    status = push_model(b, sweep, value);
    if (status == CAV_NO_MEMORY) return cav_file_fail(error, status, 0, "no memory");
    if (status)
      return cav_file_fail(error, status, 0, "there is no such model: its inertia matrix is singular or not finite");
    status = cav_options_check(&b->pushed, error);
    if (status) return status;
  }
  if (sweep == CAV_STRESS_SIZE) b->factor = value, b->size *= value, b->depth *= value;
  b->state = cav_state_new(m);
  if (!b->state) return cav_file_fail(error, CAV_NO_MEMORY, 0, "no memory for a state");
  b->state->options = b->pushed;
  for (int i = 0; i < m->nv; i++) b->unit[i] = cav_bench_turns(m, i) ? 1 / b->size : 1;
  return CAV_OK;
}

// --- samples ---

// a joint near where it is, within its limits
static void swing_joint(const cav_joint *joint, double by, double *q) {
  double x = *q + by;
  if (joint->limited) x = fmin(fmax(x, fmin(*q, joint->range[0])), fmax(*q, joint->range[1]));
  *q = x;
}

static void swing_all(cav_bench *b, uint64_t seed, double by) {
  const cav_model *m = b->model;
  double *w = b->scratch, *old = b->scratch + m->nv;
  for (int i = 0; i < m->nv; i++) w[i] = by * cav_random_uniform(&seed);
  for (int i = 0; i < m->njoint; i++) {
    const cav_joint *joint = &m->joint[i];
    if (joint->type == CAV_JOINT_HINGE) swing_joint(joint, w[joint->dof], &b->q[joint->q]);
    if (joint->type == CAV_JOINT_SLIDE) swing_joint(joint, w[joint->dof] * 0.1 * b->size, &b->q[joint->q]);
    // links fall where they are: what floats rotates only
    if (joint->type == CAV_JOINT_SLIDE || joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_FREE)
      for (int k = 0; k < (joint->type == CAV_JOINT_FREE ? 3 : 1); k++) w[joint->dof + k] = 0;
  }
  memcpy(old, b->q, (size_t)m->nq * sizeof *old);
  cav_integrate(m, old, w, 1, b->q);
}

// depth of the deepest contact that moving what floats or slides upright leaves as it is; -INFINITY: none
static double deepest_inside(const cav_bench *b) {
  double most = -INFINITY;
  if (cav_position(b->model, b->state, b->q)) return most;
  for (int i = 0; i < b->state->ncontact; i++) {
    const cav_contact *c = &b->state->contact[i];
    if (c->link1 != 0 && c->link2 != 0) most = fmax(most, -c->dist);
  }
  return most;
}

// a posture near the scene's, near enough that links are hardly deeper in each other than there
static void take_posture(cav_bench *b, int k) {
  place_start(b, b->q);
  if (k == 0) return;
  const double most = fmax(deepest_inside(b), 0) + deep * b->size;
  for (int i = 0; i < 8; i++) {
    place_start(b, b->q);
    swing_all(b, 0x9E3779B97F4A7C15u * (uint64_t)(k + 1), ldexp(swing, -i));
    if (deepest_inside(b) <= most) return;
  }
  place_start(b, b->q);
}

static void raise(const cav_bench *b, double by) {
  for (int i = 0; i < b->model->njoint; i++) {
    const cav_joint *joint = &b->model->joint[i];
    b->q[joint->q + (joint->type == CAV_JOINT_FREE ? 2 : 0)] += by * lift_of(b->model, joint);
  }
}

// depth of the deepest contact with the world, -INFINITY: none. Its status in *status
static double deepest(const cav_bench *b, cav_status *status) {
  double most = -INFINITY;
  *status = cav_position(b->model, b->state, b->q);
  for (int i = 0; i < b->state->ncontact && !*status; i++) {
    const cav_contact *c = &b->state->contact[i];
    if (c->link1 == 0 || c->link2 == 0) most = fmax(most, -c->dist);
  }
  return most;
}

// moves what floats or slides so along z until the deepest contact with the world is as deep as asked, if it can be
static cav_status lower(cav_bench *b) {
  if (not_lowered(b->model)) return CAV_OK;
  cav_status status;
  double low = 0, high = 0, step = 0.05 * b->size, now = deepest(b, &status);
  const int down = now < b->depth;
  double at = 0;
  for (int i = 0; i < 200 && !status && (now < b->depth) == down; i++) {
    if (i > 60) step *= 1.1;
    raise(b, down ? -step : step);
    at += down ? -step : step;
    now = deepest(b, &status);
  }
  if (status) return status;
  // nothing below, or nothing but what is deeper above: as it was
  if ((now < b->depth) == down) {
    raise(b, -at);
    return CAV_OK;
  }
  low = down ? at : at - step;
  high = down ? at + step : at;
  for (int i = 0; i < BISECTIONS && !status; i++) {
    const double middle = 0.5 * (low + high);
    raise(b, middle - at);
    at = middle;
    if (deepest(b, &status) < b->depth)
      high = middle;
    else
      low = middle;
  }
  return status;
}

static void stretch_quaternions(cav_bench *b) {
  for (int i = 0; i < b->model->njoint; i++) {
    const cav_joint *joint = &b->model->joint[i];
    if (joint->type != CAV_JOINT_FREE && joint->type != CAV_JOINT_BALL) continue;
    double *q = b->q + joint->q + (joint->type == CAV_JOINT_FREE ? 3 : 0);
    for (int k = 0; k < 4; k++) q[k] *= b->quaternion;
  }
}

cav_status cav_bench_sample(cav_bench *b, int k) {
  const cav_model *m = b->model;
  uint64_t seed = 0xD1B54A32D192ED03u * (uint64_t)(k + 1);
  const double h = b->pushed.timestep;
  take_posture(b, k);
  cav_status status = lower(b);
  if (status) return status;
  stretch_quaternions(b);
  for (int i = 0; i < m->nv; i++) {
    const double a = b->gravity * cav_random_uniform(&seed);
    b->v[i] = b->speed * cav_random_uniform(&seed) * b->unit[i];
    // slow motions change as slowly, so that all numbers are as small
    b->v_next[i] = b->v[i] + (b->slow ? 0.1 * b->speed * cav_random_uniform(&seed) : h * b->force * a) * b->unit[i];
    // a weight on what one dof moves
    b->u[i] = b->force * b->gravity * b->unit[i] * cav_random_uniform(&seed) / m->dof[i].inverse_weight;
    if (!isfinite(b->u[i])) b->u[i] = 0;
  }
  return CAV_OK;
}
