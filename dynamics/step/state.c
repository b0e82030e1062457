/// The state of one thread: one block carved once, plus contacts and rows in two arrays that grow. Here the model is
/// also compiled into the list of work it needs: which joints have springs or limits, which dofs friction, how the rows
/// of the sparse inertia lie. A model without any of them gets empty lists. Nothing is evaluated.
#include <assert.h>
#include <stdint.h>
#include <stdlib.h>

#include "derivative_store.h"
#include "half_step.h"
#include "hessian.h"
#include "math3.h"
#include "step.h"

enum { ALIGNMENT = 64 };

// next piece of a block, or only its size while base is NULL
static void *carve(char *base, size_t *used, size_t count, size_t size) {
  void *piece = base ? base + *used : NULL;
  assert(size < (SIZE_MAX / 2 - *used) / (count + 1));
  *used += (count * size + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT;
  return piece;
}

// number of entries of the tree-sparse inertia: each dof with its ancestors
static size_t inertia_entries(const cav_model *model) {
  size_t n = 0;
  for (int i = 0; i < model->nv; i++) {
    for (int j = i; j >= 0; j = model->dof[j].parent) { n++; }
  }
  return n;
}

// bodies whose weight is taken off, wholly or in part; out may be NULL
static size_t count_buoys(const cav_model *model, int *out) {
  size_t n = 0;
  for (int i = 1; i < model->nbody; i++) {
    if (model->body[i].buoyancy == 0 || model->body[i].link == 0) { continue; }
    if (out) { out[n] = i; }
    n++;
  }
  return n;
}

// how many joints, dofs and actuators need a list of their own
typedef struct census {
  size_t springs, limits, frictions, gears, turning;
} census;

static int is_limited(const cav_joint *joint) {
  return joint->type != CAV_JOINT_FREE && (joint->limited || joint->twist_limited || joint->swing_limited);
}

static census count(const cav_model *model) {
  census c = {0};
  for (int i = 0; i < model->njoint; i++) {
    c.springs += model->joint[i].stiffness != 0;
    c.limits += is_limited(&model->joint[i]);
  }
  for (int i = 0; i < model->nv; i++) { c.frictions += model->dof[i].frictionloss > 0; }
  for (int i = 0; i < model->nequality; i++) { c.turning += cav_equality_turns(&model->equality[i]); }
  for (int k = 0; k < model->nactuator; k++) { c.gears += (size_t)cav_transmission_dofs(model, k, NULL); }
  return c;
}

// notes what was laid out since the last note as belonging to a part
static void note(cav_workspace *w, cav_memory_use part, size_t used) {
  w->bytes[part] += used - w->noted;
  w->noted = used;
}

// lays out the state and its workspace over base, part by part; with base NULL only counts. Returns the bytes
static size_t layout(const cav_model *model, char *base, cav_state *s, cav_workspace *w) {
  size_t used = 0;
  size_t n = model->nlink, nv = model->nv, nq = model->nq, nt = model->ntendon, nj = model->njoint;
  size_t d = sizeof(double), i = sizeof(int), nu = model->nactuator, entries = inertia_entries(model);
  const census c = count(model);

  s->link = carve(base, &used, n, sizeof(cav_pose));
  s->com = carve(base, &used, 3 * n, d);
  s->inertia = carve(base, &used, 6 * n, d);
  s->reference = carve(base, &used, 3 * n, d);
  s->axis = carve(base, &used, 6 * nv, d);
  w->q = carve(base, &used, nq, d);
  w->quaternion = carve(base, &used, nj, i);
  w->hinge = carve(base, &used, nj, i);
  w->hinge_of = carve(base, &used, nj, i);
  w->hinge_ref = carve(base, &used, nj, d);
  w->half = carve(base, &used, nj, d);
  w->sine = carve(base, &used, nj, d);
  w->cosine = carve(base, &used, nj, d);
  w->aligned = carve(base, &used, nj, i);
  w->centred = carve(base, &used, nj, i);
  w->straight = carve(base, &used, n, i);
  note(w, CAV_MEMORY_POSES, used);

  s->velocity = carve(base, &used, 6 * n, d);
  s->velocity_next = carve(base, &used, 6 * n, d);
  s->force = carve(base, &used, 6 * n, d);
  s->u = carve(base, &used, nv, d);
  w->v = carve(base, &used, nv, d);
  w->v_next = carve(base, &used, nv, d);
  w->acceleration = carve(base, &used, 6 * n, d);
  w->velocity_now = carve(base, &used, 6 * n, d);
  w->narrow_v = carve(base, &used, 2 * nv, d);
  w->scratch = carve(base, &used, 4 * nv, d);
  w->group = carve(base, &used, nv, i);
  w->turns = carve(base, &used, nv, i);
  w->armature = carve(base, &used, nv, d);
  w->damping = carve(base, &used, nv, d);
  w->spring = carve(base, &used, c.springs, i);
  w->buoy = carve(base, &used, count_buoys(model, NULL), i);
  note(w, CAV_MEMORY_MOTION, used);

  s->tendon_length = carve(base, &used, nt, d);
  s->tendon_arm = carve(base, &used, model->ntendon_dof, d);
  w->string = carve(base, &used, nt, i);
  w->tendon_spring = carve(base, &used, nt, i);
  w->tendon_limit = carve(base, &used, nt, i);
  w->tendon_friction = carve(base, &used, nt, i);
  note(w, CAV_MEMORY_TENDONS, used);

  s->equality = carve(base, &used, (size_t)model->nequality, sizeof(cav_equality_rows));
  w->bias = c.turning > 0 ? carve(base, &used, 6 * n, d) : NULL;
  note(w, CAV_MEMORY_EQUALITY, used);

  w->limit = carve(base, &used, c.limits, i);
  w->friction = carve(base, &used, c.frictions, i);
  note(w, CAV_MEMORY_ROWS, used);

  w->gear_start = carve(base, &used, nu > 0 ? nu + 1 : 0, i);
  w->gear_dof = carve(base, &used, c.gears, i);
  w->gear = carve(base, &used, c.gears, d);
  w->gear_room = (int)c.gears;
  w->gram_inverse = carve(base, &used, nu, d);
  w->control = carve(base, &used, 2 * nu, d);
  note(w, CAV_MEMORY_ACTUATION, used);

  w->parent = carve(base, &used, nv, i);
  w->row = carve(base, &used, nv + 1, i);
  w->M = carve(base, &used, entries, d);
  w->L = carve(base, &used, entries, d);
  w->composite = carve(base, &used, 10 * n, d);
  note(w, CAV_MEMORY_INERTIA, used);
  return used;
}

// dofs: compact copies and the rows of the sparse inertia
static void compile_dofs(const cav_model *model, cav_workspace *w) {
  int entries = 0;
  for (int i = 0; i < model->nv; i++) {
    const cav_dof *dof = &model->dof[i];
    const cav_joint *joint = &model->joint[dof->joint];
    int k = i - joint->dof;
    w->armature[i] = dof->armature;
    w->damping[i] = dof->damping;
    w->group[i] = k == 0 || (joint->type == CAV_JOINT_FREE && k == 3);
    w->turns[i] = joint->type != CAV_JOINT_SLIDE && (joint->type != CAV_JOINT_FREE || k >= 3);
    w->parent[i] = dof->parent;
    w->row[i] = entries;
    for (int j = i; j >= 0; j = model->dof[j].parent) { entries++; }
    if (dof->damping != 0) { w->damped = 1; }
    if (dof->frictionloss > 0) { w->friction[w->nfriction++] = i; }
  }
  w->row[model->nv] = entries;
}

// index of the one coordinate axis a unit vector lies along, -1 if none
static int along(const double a[3]) {
  for (int k = 0; k < 3; k++) {
    if (a[(k + 1) % 3] == 0 && a[(k + 2) % 3] == 0) return k;
  }
  return -1;
}

// special cases that kinematics takes advantage of
static void compile_frames(const cav_model *model, cav_workspace *w) {
  for (int i = 0; i < model->njoint; i++) {
    const cav_joint *joint = &model->joint[i];
    w->aligned[i] = joint->type == CAV_JOINT_HINGE ? along(joint->axis) : -1;
    w->centred[i] = joint->pos[0] == 0 && joint->pos[1] == 0 && joint->pos[2] == 0;
    if (joint->type == CAV_JOINT_HINGE) {
      w->hinge_of[i] = w->nhinge;
      w->hinge_ref[w->nhinge] = joint->ref;
      w->hinge[w->nhinge++] = joint->q;
    }
    if (joint->type == CAV_JOINT_FREE || joint->type == CAV_JOINT_BALL) {
      w->quaternion[w->nquaternion++] = joint->type == CAV_JOINT_FREE ? joint->q + 3 : joint->q;
    }
  }
  for (int i = 0; i < model->nlink; i++) {
    const double *quat = model->link[i].quat;
    w->straight[i] = quat[0] == 1 && quat[1] == 0 && quat[2] == 0 && quat[3] == 0;
  }
}

// joints and tendons that exert a force or set a limit
static void compile_lists(const cav_model *model, cav_workspace *w) {
  for (int i = 0; i < model->njoint; i++) {
    if (model->joint[i].stiffness != 0) { w->spring[w->nspring++] = i; }
    if (is_limited(&model->joint[i])) { w->limit[w->nlimit++] = i; }
  }
  w->nbuoy = (int)count_buoys(model, w->buoy);
  for (int i = 0; i < model->ntendon; i++) {
    const cav_tendon *tendon = &model->tendon[i];
    if (tendon->stiffness != 0 || tendon->damping != 0) { w->tendon_spring[w->ntendon_spring++] = i; }
    if (tendon->limited) { w->tendon_limit[w->ntendon_limit++] = i; }
    if (tendon->frictionloss > 0) { w->tendon_friction[w->ntendon_friction++] = i; }
  }
}

// every list is as long as was counted for it
static void check_lists(const cav_model *model, const cav_workspace *w) {
  const census c = count(model);
  assert((size_t)w->nspring == c.springs && (size_t)w->nlimit == c.limits && (size_t)w->nfriction == c.frictions);
  assert((size_t)w->row[model->nv] == inertia_entries(model));
  assert(w->nhinge <= model->njoint && w->nquaternion <= model->njoint);
  assert(w->ntendon_spring <= model->ntendon && w->ntendon_limit <= model->ntendon);
  assert(w->ntendon_friction <= model->ntendon);
  (void)model, (void)w, (void)c;
}

// an array for the first few items, if it is needed at all
static void *make_room(int needed, int *room, size_t size) {
  void *items = needed ? malloc(CAV_FIRST_ROOM * size) : NULL;
  *room = items ? CAV_FIRST_ROOM : 0;
  return items;
}

cav_state *cav_state_new(const cav_model *model) {
  // sizes first, then one block: state, workspace, arrays
  cav_state probe = {0};
  cav_workspace probe_work = {0};
  size_t head = 0;
  carve(NULL, &head, 1, sizeof(cav_state));
  carve(NULL, &head, 1, sizeof(cav_workspace));
  size_t bytes = head + layout(model, NULL, &probe, &probe_work);
  char *block = aligned_alloc(ALIGNMENT, bytes);
  if (!block) { return NULL; }
  memset(block, 0, bytes);
  size_t used = 0;
  cav_state *state = carve(block, &used, 1, sizeof(cav_state));
  cav_workspace *work = carve(block, &used, 1, sizeof(cav_workspace));
  size_t laid = layout(model, block + head, state, work);
  assert(used == head && head + laid == bytes);
  (void)laid;
  work->bytes[CAV_MEMORY_HEAD] = head;

  // what this model needs
  state->model = model;
  state->options = model->options;
  state->work = work;
  compile_dofs(model, work);
  compile_frames(model, work);
  compile_lists(model, work);
  check_lists(model, work);
  cav_tendon_compile(model, state);
  quat_normalise(state->link[0].quat);
  quat_matrix(state->link[0].rotation, state->link[0].quat);

  // room for contacts and rows, where there can be any; both grow later
  int touches = model->npair > 0, bounded = work->nlimit + work->nfriction > 0;
  bounded = bounded || work->ntendon_limit + work->ntendon_friction > 0;
  state->contact = make_room(touches, &work->contact_room, sizeof *state->contact);
  state->row = make_room(bounded, &work->row_room, sizeof *state->row);
  work->geom = touches ? cav_geom_cache_new(model, CAV_SWEEP_FROM) : NULL;
  int whole = (!touches || (state->contact && work->geom)) && (!bounded || state->row);
  if (!whole || cav_fluid_compile(model, work) != CAV_OK || cav_actuation_compile(model, state) != CAV_OK) {
    cav_state_free(state);
    return NULL;
  }
  return state;
}

void cav_state_free(cav_state *state) {
  if (!state) { return; }
  cav_geom_cache_free(state->work->geom);
  free(state->work->gram);
  free(state->work->floats);
  free(state->work->readout);
  free(state->work->half_steps);
  cav_next_knot_free(state->work->next);
  cav_derivative_store_free(state->work->derivatives);
  free(state->work->coupling);
  cav_hessian_free(state->work->hessian);
  free(state->work->solver);
  free(state->work->memory);
  free(state->work->law);
  free(state->contact);
  free(state->row);
  free(state);
}

void cav_state_bytes(const cav_state *state, size_t bytes[CAV_MEMORY_USES]) {
  const cav_workspace *w = state->work;
  memcpy(bytes, w->bytes, sizeof w->bytes);
  bytes[CAV_MEMORY_ROWS] += (size_t)w->row_room * sizeof *state->row;
  bytes[CAV_MEMORY_MOTION] += cav_fluid_bytes(w) + (w->half_steps ? w->half_steps->bytes : 0);
  bytes[CAV_MEMORY_CONTACTS] += cav_next_knot_bytes(w->next);
  bytes[CAV_MEMORY_CONTACTS] += (size_t)w->law_room * CAV_LAW_NUMBERS * sizeof *w->law;
  bytes[CAV_MEMORY_CONTACTS] += (size_t)w->contact_room * sizeof *state->contact + cav_geom_cache_bytes(w->geom);
  size_t nu = (size_t)state->model->nactuator;
  bytes[CAV_MEMORY_ACTUATION] += w->gram ? 3 * nu * nu * sizeof(double) : 0;
  bytes[CAV_MEMORY_SOLVERS] += w->solver_bytes + w->readout_room * sizeof(double);
  bytes[CAV_MEMORY_SOLVERS] += (size_t)w->memory_room * sizeof *w->memory + w->coupling_room * sizeof *w->coupling;
  bytes[CAV_MEMORY_SOLVERS] += cav_derivative_store_bytes(w->derivatives);
  bytes[CAV_MEMORY_SOLVERS] += cav_hessian_bytes(w->hessian);
}
