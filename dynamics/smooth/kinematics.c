/// Poses of links, their centres of mass and world inertias, motion subspaces of dofs, tendon lengths: all that depends
/// on q alone except contacts and limits. One pass down the tree. Joints of a link act in the order of the file, each
/// about an axis and anchor in the link frame as the joints before it have left it (MJCF's convention).
///
/// Spatial vectors are taken in world axes at the position of the tree's root link, one point for the whole tree: going
/// from link to link they are only added, never transformed.
#include "four_states.h"
#include "half_step.h"
#include "math3.h"
#include "tree.h"
#include "vectors.h"

// half angles of all hinges of q, by joint order of the work list
static void half_turns(cav_workspace *w, const double *q) {
  double largest = 0;
  for (int i = 0; i < w->nhinge; i++) {
    w->half[i] = 0.5 * (q[w->hinge[i]] - w->hinge_ref[i]);
    largest = fmax(largest, fabs(w->half[i]));
  }
  if (largest < SINES_MOST) {
    sines(w->half, w->sine, w->cosine, w->nhinge);
    return;
  }
  for (int i = 0; i < w->nhinge; i++) {
    w->sine[i] = sin(w->half[i]);
    w->cosine[i] = cos(w->half[i]);
  }
}

// unit quaternions, whatever came in
static void make_unit(const cav_workspace *w, double *q) {
  for (int i = 0; i < w->nquaternion; i++) quat_normalise(q + w->quaternion[i]);
}

CAV_VECTOR_BODY void place_links_body(const cav_model *model, const cav_workspace *w, const tree_poses *to) {
  for (int i = 1; i < model->nlink; i++) place_link(model, w, to, i);
}
CAV_BY_VECTORS(place_links, (const cav_model *model, const cav_workspace *w, const tree_poses *to), (model, w, to))

void cav_posture_place(const cav_model *model, cav_workspace *w, const cav_posture *at) {
  make_unit(w, at->q);
  half_turns(w, at->q);
  const tree_poses to = {at->q,       w->sine,       w->cosine, at->link,    at->com,
                         at->inertia, at->reference, at->axis,  at->referred};
  place_links(model, w, &to);
}

void cav_kinematics(const cav_model *model, cav_state *state, const double *q) {
  double *unit = state->work->q;
  if (unit != q && model->nq > 0) { memcpy(unit, q, (size_t)model->nq * sizeof *q); }
  const cav_posture at = {unit, state->link, state->com, state->inertia, state->reference, state->axis, 0};
  cav_posture_place(model, state->work, &at);
  cav_kinematics_close(model, state);
}

void cav_kinematics_open(cav_state *state) { make_unit(state->work, state->work->q); }

void cav_kinematics_close(const cav_model *model, cav_state *state) {
  if (state->work->half_steps) { state->work->half_steps->fresh = 0; }
  if (model->ntendon > 0) { cav_tendon_lengths(model, state); }
}

int cav_last_dof(const cav_model *model, int link) {
  while (link > 0 && model->link[link].ndof == 0) link = model->link[link].parent;
  return link > 0 ? model->link[link].dof + model->link[link].ndof - 1 : -1;
}
