/// The order `momentum`: what trees of links weigh and how they move half a step before and after a knot. Private to
/// dynamics/.
#ifndef CAVORT_HALFWAY_H
#define CAVORT_HALFWAY_H

#include "smooth.h"

/// Links half way: at q (-) h v/2 with v, or at q (+) h v_next/2 with v_next. Spatial vectors about the references of
/// the state, which are points fixed in space for both.
typedef struct cav_half_step {
  double sign; ///< -1 before, 1 after the knot
  double *q;   ///< [nq]
  cav_pose *link;
  double *com, *inertia, *axis; ///< as in cav_state
  double *velocity, *momentum;  ///< [nlink*6] of each link

  // for derivatives, half_step.c: inertia and momentum of subtrees; by each dof of q and of the velocity, the twist of
  // what it moves and what inertia multiplies
  double *composite, *whole; ///< [nlink*10], [nlink*6]
  double *by_q, *by_v;       ///< [nv*12]
  double *twist_q, *twist_v; ///< [nv*6] cav_displaced_twists
} cav_half_step;

typedef struct cav_half_steps {
  cav_half_step before, after;
  size_t bytes;
  size_t evaluated; ///< numbers from before.com on that an evaluation leaves to derivatives, v and missing with them

  // what before is good for: the state's position, this step and this velocity
  int fresh;
  double timestep, *v; ///< [nv]

  // of root links: what the change of momentum of their trees has over the sum of inertial forces. For derivatives:
  // sums of inertial forces over subtrees, of root links what stands for them
  double *missing, *inner; ///< [nlink*6]
} cav_half_steps;

/// Memory of the half steps of a state, at its first use. CAV_NO_MEMORY.
cav_status cav_half_steps_new(const cav_model *model, cav_state *state);

/// After cav_newton_euler: adds to the wrench of each root link what is missing to the change of momentum of its tree,
/// from half a step before to half a step after the position, v and v_next of the workspace. Where only v_next is new,
/// what is before is kept.
void cav_half_steps_forces(const cav_model *model, cav_state *state);

/// Whether a dof is one of a root link: its row is that of momentum.
static inline int cav_moves_root(const cav_model *model, int dof) {
  int link = model->dof[dof].link;
  return model->link[link].root == link;
}

/// What the derivatives of the rows of root links are made of, at the state's last evaluation.
void cav_half_steps_derivatives(const cav_model *model, cav_state *state);

/// Then column j of those rows in du/dq, du/dv and du/dv_next [nv*nv], added. Forces on the subtree of j that are
/// carried along, whatever they are, are in it.
void cav_half_steps_column(const cav_model *model, const cav_state *state, int j, double *dq, double *dv, double *dn);

#endif
