/// Momentum defect: how well a motion obeys the balance of linear and angular momentum that no discretisation can bend.
/// For each tree of bodies, with c its centre of mass at the knots, P its linear momentum and L its angular momentum
/// about the point c_t, both taken half way between knots (configuration q_t (+) h v_{t+1}/2, velocity v_{t+1}):
///   F = (P_{t+1/2} - P_{t-1/2})/h - m g - sum f
///   N = (L_{t+1/2} - L_{t-1/2})/h - sum ((p - c_t) x f + torque)
/// over contacts and equality constraints (connect, weld, distance) with what is not of the tree, and what the model
/// compensates of gravity. What is lost at one knot is lost
/// for good: the momenta after a knot are those before the next. Of order h^2 for a motion sampled from the continuous
/// one; zero to rounding for one that obeys the step of order momentum.
/// A tree that joints hold to the world gets forces from there which no one measures: only what its root link can do
/// freely is balanced. F and N/0.3 m are projected on the span of the motions of the root link's dofs that no actuator
/// and no tendon acts on, seen at c; what those joints themselves exert (damping, springs, armature, limits, friction
/// loss, their equality constraints), what a medium does, and a residual force that is penalised, is accounted for. A
/// free root gives all six components, a planar one (two slides and a hinge) three, a cart driven along its rail none:
/// its defect is 0 by definition.
/// Written for verification alone: momenta come from link poses and the motion subspaces, not from the inverse. That of
/// a medium is the difference of two inverses, with it and without.
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "verification.h"

struct cav_balance {
  int ntree;
  int *root;        // [ntree] root link
  int *tree;        // [nlink] tree of a link, -1 for the world
  double *com;      // [(T+1)*ntree*3] at the knots
  double *momentum; // [(T+2)*ntree*9] half way, from before knot 0 on: centre of mass, P, angular momentum about it
  int *held;        // [nv] 1: driven by an actuator or a tendon, left out
  double *sum;      // [ntree] squares
  int *count;       // [ntree]
  double *worst;    // [ntree] largest component
  int *worst_knot;  // [ntree]
  const double
      *residual;  // [nv] of the knot at hand: what actuators leave of its forces, accounted for where it is penalised
  double *mass;   // [ntree]
  double *twist;  // [nlink*6] scratch
  double *wrench; // [ntree*6] scratch: linear, angular about c
  // in a medium: the model without it, states of both that nothing touches, and what it does along each dof at the knot
  cav_model still;
  cav_state *wet, *dry;
  double *medium; // [3*nv] force, then scratch; NULL: there is no medium
};

static double vector_dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

static void cross(const double *a, const double *b, double *out) {
  out[0] = a[1] * b[2] - a[2] * b[1];
  out[1] = a[2] * b[0] - a[0] * b[2];
  out[2] = a[0] * b[1] - a[1] * b[0];
}

// velocity of the point p of a body with spatial velocity twist (angular, linear) taken at reference
static void point_velocity(const double *twist, const double *reference, const double *p, double *out) {
  const double arm[3] = {p[0] - reference[0], p[1] - reference[1], p[2] - reference[2]};
  cross(twist, arm, out);
  for (int k = 0; k < 3; k++) out[k] += twist[3 + k];
}

// centres of mass of all trees at the bare state's position
static void tree_com(const cav_balance *balance, const cav_verification *verification, double *com) {
  const cav_model *model = verification->model;
  memset(com, 0, sizeof(double) * 3 * balance->ntree);
  for (int l = 1; l < model->nlink; l++) {
    double *c = com + 3 * balance->tree[l];
    for (int k = 0; k < 3; k++) c[k] += model->link[l].mass * verification->bare->com[3 * l + k];
  }
  for (int i = 0; i < balance->ntree; i++) {
    for (int k = 0; k < 3; k++) com[3 * i + k] /= balance->mass[i] > 0 ? balance->mass[i] : 1;
  }
}

// spatial velocities of links at the bare state's position
static void link_twists(const cav_verification *verification, const double *v, double *twist) {
  const cav_model *model = verification->model;
  memset(twist, 0, sizeof(double) * 6);
  for (int l = 1; l < model->nlink; l++) {
    const cav_link *link = model->link + l;
    // links of one tree share their reference point
    memcpy(twist + 6 * l, twist + 6 * link->parent, sizeof(double) * 6);
    for (int d = link->dof; d < link->dof + link->ndof; d++) {
      for (int k = 0; k < 6; k++) twist[6 * l + k] += verification->bare->axis[6 * d + k] * v[d];
    }
  }
}

// centres of mass of all trees, linear and angular momenta about them at the bare state's position; out [ntree*9]
static void tree_momentum(const cav_balance *balance, const cav_verification *verification, const double *v,
                          double *out) {
  const cav_model *model = verification->model;
  const cav_state *bare = verification->bare;
  double arm[3], moment[3];
  link_twists(verification, v, balance->twist);
  memset(out, 0, sizeof(double) * 9 * balance->ntree);
  for (int i = 0; i < balance->ntree; i++) {
    // centre of mass of the tree
    double mass = balance->mass[i] > 0 ? balance->mass[i] : 1, *com = out + 9 * i, *linear = com + 3, *spin = com + 6;
    for (int l = 1; l < model->nlink; l++) {
      if (balance->tree[l] != i) continue;
      for (int k = 0; k < 3; k++) com[k] += model->link[l].mass * bare->com[3 * l + k] / mass;
    }
    // spin of each link and momentum of its centre; the tree's mean velocity drops out of the sum
    for (int l = 1; l < model->nlink; l++) {
      if (balance->tree[l] != i) continue;
      const double *I = bare->inertia + 6 * l, *w = balance->twist + 6 * l;
      double vc[3];
      point_velocity(w, bare->reference + 3 * l, bare->com + 3 * l, vc);
      for (int k = 0; k < 3; k++) {
        arm[k] = bare->com[3 * l + k] - com[k];
        linear[k] += model->link[l].mass * vc[k];
      }
      cross(arm, vc, moment);
      spin[0] += I[0] * w[0] + I[3] * w[1] + I[4] * w[2] + model->link[l].mass * moment[0];
      spin[1] += I[3] * w[0] + I[1] * w[1] + I[5] * w[2] + model->link[l].mass * moment[1];
      spin[2] += I[4] * w[0] + I[5] * w[1] + I[2] * w[2] + model->link[l].mass * moment[2];
    }
  }
}

// trees, and the dofs that something acts on
static void survey(cav_balance *balance, const cav_verification *verification, double *unit, double *residual) {
  const cav_model *model = verification->model;
  balance->tree[0] = -1;
  for (int l = 1; l < model->nlink; l++) {
    const cav_link *link = model->link + l;
    if (link->root == l) balance->root[balance->ntree++] = l;
    for (int i = 0; i < balance->ntree; i++) {
      if (balance->root[i] == link->root) balance->tree[l] = i;
    }
    balance->mass[balance->tree[l]] += link->mass;
  }
  for (int d = 0; d < model->nv; d++) {
    memset(unit, 0, sizeof(double) * model->nv);
    unit[d] = 1;
    cav_actuation(model, verification->bare, unit, residual, NULL);
    balance->held[d] = residual[d] < 1 - 1e-9;
  }
  for (int i = 0; i < model->ntendon_dof; i++) balance->held[model->tendon_dof[i]] = 1;
}

// centres of mass at the knots, momenta half way
static cav_status record(cav_balance *balance, const cav_verification *verification, double *q) {
  const cav_model *model = verification->model;
  int nv = model->nv, ntree = balance->ntree;
  cav_status status = CAV_OK;
  for (int k = -1; k <= verification->last && status == CAV_OK; k++) {
    // knot k
    if (k < 0) cav_integrate(model, verification->q, verification->v, -verification->h, q);
    if (k >= 0) memcpy(q, verification->q + k * model->nq, sizeof(double) * model->nq);
    status = cav_position(model, verification->bare, q);
    if (status != CAV_OK) break;
    if (k >= 0) tree_com(balance, verification, balance->com + 3 * k * ntree);
    // half a step on
    cav_integrate(model, q, verification->v + (k + 1) * nv, verification->h / 2, q);
    status = cav_position(model, verification->bare, q);
    if (status == CAV_OK)
      tree_momentum(balance, verification, verification->v + (k + 1) * nv, balance->momentum + 9 * (k + 1) * ntree);
  }
  return status;
}

// the states that the force of a medium is the difference of
static cav_status survey_medium(cav_balance *balance, const cav_verification *verification) {
  const cav_model *model = verification->model;
  if (!verification->law.passive || (model->density == 0 && model->viscosity == 0)) return CAV_OK;
  balance->still = *model;
  balance->still.density = balance->still.viscosity = 0;
  balance->wet = cav_state_new(model);
  balance->dry = cav_state_new(&balance->still);
  balance->medium = calloc(3 * (size_t)model->nv + 1, sizeof *balance->medium);
  if (!balance->wet || !balance->dry || !balance->medium) return CAV_NO_MEMORY;
  balance->wet->options = verification->law;
  balance->wet->options.contact = balance->wet->options.constraint = 0;
  balance->dry->options = balance->wet->options;
  return CAV_OK;
}

// what the medium does along each dof at knot t
static void find_medium(cav_balance *balance, const cav_verification *verification, int t) {
  const cav_model *model = verification->model;
  const int nv = model->nv;
  const double *q = verification->q + t * model->nq, *v = verification->v + t * nv;
  if (!balance->medium) return;
  double *force = balance->medium, *wet = force + nv, *dry = wet + nv;
  const int known = cav_inverse(model, balance->wet, q, v, v + nv, wet) == CAV_OK &&
                    cav_inverse(&balance->still, balance->dry, q, v, v + nv, dry) == CAV_OK;
  for (int d = 0; d < nv; d++) force[d] = known ? dry[d] - wet[d] : NAN;
}

cav_balance *cav_balance_new(const cav_verification *verification) {
  const cav_model *model = verification->model;
  size_t nl = (size_t)model->nlink, nv = (size_t)model->nv + 1, knots = (size_t)verification->last + 2;
  cav_balance *b = calloc(1, sizeof *b);
  double *unit = calloc(2 * nv + (size_t)model->nq, sizeof *unit);
  if (!b || !unit) {
    free(b);
    free(unit);
    return NULL;
  }
  b->root = calloc(nl, sizeof *b->root);
  b->tree = calloc(nl, sizeof *b->tree);
  b->com = calloc(knots * nl * 3, sizeof *b->com);
  b->momentum = calloc(knots * nl * 9, sizeof *b->momentum);
  b->held = calloc(nv, sizeof *b->held);
  b->sum = calloc(nl, sizeof *b->sum);
  b->count = calloc(nl, sizeof *b->count);
  b->worst = calloc(nl, sizeof *b->worst);
  b->worst_knot = calloc(nl, sizeof *b->worst_knot);
  b->mass = calloc(nl, sizeof *b->mass);
  b->twist = calloc(nl * 6, sizeof *b->twist);
  b->wrench = calloc(nl * 6, sizeof *b->wrench);
  int complete = b->root && b->tree && b->com && b->momentum && b->held && b->sum && b->count && b->worst &&
                 b->worst_knot && b->mass && b->twist && b->wrench;
  if (complete) survey(b, verification, unit, unit + nv);
  if (!complete || survey_medium(b, verification) != CAV_OK || record(b, verification, unit + 2 * nv) != CAV_OK) {
    cav_balance_free(b);
    b = NULL;
  }
  free(unit);
  return b;
}

void cav_balance_free(cav_balance *balance) {
  if (!balance) return;
  free(balance->root);
  free(balance->tree);
  free(balance->com);
  free(balance->momentum);
  free(balance->held);
  free(balance->sum);
  free(balance->count);
  free(balance->worst);
  free(balance->worst_knot);
  free(balance->mass);
  free(balance->twist);
  free(balance->wrench);
  free(balance->medium);
  cav_state_free(balance->wet);
  cav_state_free(balance->dry);
  free(balance);
}

// takes a force and a torque at p, both on one link of tree i, out of the tree's balance
static void apply(cav_balance *balance, int i, const double *com, const double *p, const double *force,
                  const double *torque, double sign) {
  double *w = balance->wrench + 6 * i, moment[3];
  const double arm[3] = {p[0] - com[0], p[1] - com[1], p[2] - com[2]};
  cross(arm, force, moment);
  for (int k = 0; k < 3; k++) {
    w[k] -= sign * force[k];
    w[3 + k] -= sign * (moment[k] + torque[k]);
  }
}

// angular momentum of a tree about a point; momentum [9] as tree_momentum writes it
static void moment_about(const double *momentum, const double *point, double *out) {
  const double arm[3] = {momentum[0] - point[0], momentum[1] - point[1], momentum[2] - point[2]};
  cross(arm, momentum + 3, out);
  for (int k = 0; k < 3; k++) out[k] += momentum[6 + k];
}

// takes out what the model compensates of gravity, at the bodies' centres of mass
static void apply_buoyancy(cav_balance *balance, const cav_verification *verification, const double *com) {
  const cav_model *model = verification->model;
  static const double none[3] = {0};
  if (!verification->law.gravity || !verification->law.passive) return;
  for (int b = 1; b < model->nbody; b++) {
    const cav_body *body = model->body + b;
    int tree = balance->tree[body->link];
    if (body->buoyancy == 0 || tree < 0) continue;
    cav_pose pose;
    double force[3];
    cav_object_pose(model, verification->state, CAV_OBJECT_BODY, b, &pose);
    for (int k = 0; k < 3; k++) force[k] = -body->buoyancy * body->mass * model->gravity[k];
    apply(balance, tree, com + 3 * tree, pose.pos, force, none, 1);
  }
}

// takes out what an equality constraint between links does to the trees that it joins; those between joints act along
// dofs (joint_force), those between tendons on dofs that are held
static void apply_equality(cav_balance *balance, const cav_verification *verification, const cav_equality_rows *rows,
                           const double *com) {
  const cav_equality *equality = verification->model->equality + rows->equality;
  const int joins = equality->type == CAV_EQUALITY_CONNECT || equality->type == CAV_EQUALITY_WELD ||
                    equality->type == CAV_EQUALITY_DISTANCE;
  if (!joins || balance->tree[equality->link[0]] == balance->tree[equality->link[1]]) return;
  double force[3], torque[3] = {0};
  for (int k = 0; k < 3; k++) {
    force[k] = (rows->dim == 1 ? rows->normal[k] * rows->impulse[0] : rows->impulse[k]) / verification->h;
    for (int i = 0; i < 3 && rows->dim == 6; i++)
      torque[k] += rows->rotation[3 * i + k] * rows->impulse[3 + i] / verification->h;
  }
  for (int side = 0; side < 2; side++) {
    const int tree = balance->tree[equality->link[side]];
    if (tree >= 0) apply(balance, tree, com + 3 * tree, rows->point[side], force, torque, side ? -1 : 1);
  }
}

// balance of every tree at knot t: linear, angular about the centre of mass, N and N m
static void wrenches(cav_balance *balance, const cav_verification *verification, int t) {
  const cav_model *model = verification->model;
  double h = verification->h;
  const double *now = balance->com + 3 * t * balance->ntree;
  for (int i = 0; i < balance->ntree; i++) {
    const double *before = balance->momentum + 9 * (t * balance->ntree + i), *after = before + 9 * balance->ntree;
    double *w = balance->wrench + 6 * i, change[3];
    moment_about(after, now + 3 * i, change);
    memcpy(w + 3, change, sizeof change);
    moment_about(before, now + 3 * i, change);
    for (int k = 0; k < 3; k++) {
      w[k] =
          (after[3 + k] - before[3 + k]) / h - (verification->law.gravity ? balance->mass[i] * model->gravity[k] : 0);
      w[3 + k] = (w[3 + k] - change[k]) / h;
    }
  }
  apply_buoyancy(balance, verification, now);
  for (int j = 0; j < verification->state->ncontact; j++) {
    const cav_contact *contact = verification->state->contact + j;
    int tree1 = balance->tree[contact->link1], tree2 = balance->tree[contact->link2];
    if (tree1 == tree2) continue;
    double force[3] = {0}, torque[3] = {0};
    for (int k = 0; k < contact->dim; k++) {
      double *to = k < 3 ? force : torque;
      for (int x = 0; x < 3; x++) to[x] += contact->frame[3 * (k % 3) + x] * contact->impulse[k] / h;
    }
    if (tree2 >= 0) apply(balance, tree2, now + 3 * tree2, contact->pos, force, torque, 1);
    if (tree1 >= 0) apply(balance, tree1, now + 3 * tree1, contact->pos, force, torque, -1);
  }
  for (int i = 0; i < verification->state->nequality; i++)
    apply_equality(balance, verification, verification->state->equality + i, now);
}

// what a root dof's own joint exerts along it at knot t: damping, spring, armature, limit, friction loss, and its
// equality constraint with another joint
static double joint_force(const cav_verification *verification, int dof, int t) {
  const cav_model *model = verification->model;
  const cav_joint *joint = model->joint + model->dof[dof].joint;
  int nv = model->nv;
  double v = verification->v[t * nv + dof], next = verification->v[(t + 1) * nv + dof];
  double rate = verification->law.order == CAV_ORDER_EULER ? next : (v + next) / 2;
  int scalar = joint->type == CAV_JOINT_HINGE || joint->type == CAV_JOINT_SLIDE;
  double force = -model->dof[dof].armature * (next - v) / verification->h;
  if (verification->law.passive) {
    force -= model->dof[dof].damping * rate;
    if (scalar) force -= joint->stiffness * (verification->q[t * model->nq + joint->q] - joint->springref);
  }
  for (int i = 0; i < verification->state->nrow; i++) {
    const cav_row *row = verification->state->row + i;
    if (row->type == CAV_ROW_FRICTION_DOF && row->object == dof) force += row->impulse / verification->h;
    if (row->type == CAV_ROW_LIMIT_JOINT && model->joint + row->object == joint) {
      force += row->axis[scalar ? 0 : dof - joint->dof] * row->impulse / verification->h;
    }
  }
  for (int i = 0; i < verification->state->nequality; i++) {
    const cav_equality_rows *rows = verification->state->equality + i;
    const cav_equality *equality = model->equality + rows->equality;
    for (int side = 0; side < 2 && equality->type == CAV_EQUALITY_JOINT; side++) {
      if (equality->object[side] < 0 || model->joint + equality->object[side] != joint) continue;
      force += (side ? -rows->derivative : 1) * rows->impulse[0] / verification->h;
    }
  }
  return force;
}

// 1 if the dof's joint can exert what joint_force does not know: the spring of a ball or free joint
static int opaque(const cav_model *model, int dof) {
  const cav_joint *joint = model->joint + model->dof[dof].joint;
  return (joint->type == CAV_JOINT_BALL || joint->type == CAV_JOINT_FREE) && joint->stiffness > 0;
}

// components of tree i's balance along what its root can freely do, fraction of weight; returns their number
static int project(const cav_balance *balance, const cav_verification *verification, int i, int t, double *out) {
  const cav_model *model = verification->model;
  const cav_state *state = verification->state;
  const cav_link *root = model->link + balance->root[i];
  const double *c = balance->com + 3 * (t * balance->ntree + i);
  double basis[6][6], force[6], fraction[6];
  int n = 0;
  const double *w = balance->wrench + 6 * i;
  for (int k = 0; k < 3; k++) fraction[k] = w[k], fraction[3 + k] = w[3 + k] / verification->arm;
  for (int d = root->dof; d < root->dof + root->ndof && n < 6; d++) {
    if (balance->held[d] || opaque(model, d)) continue;
    // motion of this dof seen at c, angles in arms
    const double *axis = state->axis + 6 * d;
    double *e = basis[n],
           own = joint_force(verification, d, t) + (verification->deviation[d] > 0 ? balance->residual[d] : 0);
    if (balance->medium) own += balance->medium[d];
    point_velocity(axis, state->reference + 3 * balance->root[i], c, e);
    for (int k = 0; k < 3; k++) e[3 + k] = axis[k] * verification->arm;
    double size = 0;
    for (int k = 0; k < 6; k++) size += e[k] * e[k];
    // Gram-Schmidt, carrying the joint's own force along
    for (int j = 0; j < n; j++) {
      double along = vector_dot(e, basis[j]) + vector_dot(e + 3, basis[j] + 3);
      for (int k = 0; k < 6; k++) e[k] -= along * basis[j][k];
      own -= along * force[j];
    }
    double norm = sqrt(vector_dot(e, e) + vector_dot(e + 3, e + 3));
    if (norm <= 1e-9 * sqrt(size)) continue;
    for (int k = 0; k < 6; k++) e[k] /= norm;
    force[n] = own / norm;
    out[n] = (vector_dot(e, fraction) + vector_dot(e + 3, fraction + 3) - force[n]) / verification->weight;
    n++;
  }
  return n;
}

void cav_balance_add(cav_balance *balance, const cav_verification *verification, int t, const double *residual) {
  double part[6];
  balance->residual = residual;
  wrenches(balance, verification, t);
  find_medium(balance, verification, t);
  for (int i = 0; i < balance->ntree; i++) {
    int n = project(balance, verification, i, t, part);
    balance->count[i] += n;
    for (int k = 0; k < n; k++) {
      balance->sum[i] += part[k] * part[k];
      if (fabs(part[k]) <= balance->worst[i]) continue;
      balance->worst[i] = fabs(part[k]);
      balance->worst_knot[i] = t;
    }
  }
}

void cav_balance_result(const cav_balance *balance, const cav_verification *verification, cav_metric *metric) {
  char name[32];
  for (int i = 0; i < balance->ntree; i++) {
    if (!balance->count[i]) continue;
    double rms = sqrt(balance->sum[i] / balance->count[i]);
    cav_metric_note(metric, rms, balance->worst_knot[i], "tree of %s, worst component %.3g",
                    cav_verification_link_name(verification->model, balance->root[i], name), balance->worst[i]);
  }
}
