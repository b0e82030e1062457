/// Four states at once: numbers of four states of one model side by side, so that the passes over the tree and the broad
/// phase take all four in one go, with the operations and the order of a single state (tree.h). Private to dynamics/.
#ifndef CAVORT_FOUR_STATES_H
#define CAVORT_FOUR_STATES_H

#include "smooth.h"
#include "vectors.h"

enum { CAV_LANES = 4, CAV_LANE_BITS = 16 };

/// cav_pose of four states.
typedef struct cav_lane_pose {
  cav_four pos[3], rotation[9], quat[4];
} cav_lane_pose;

/// What the law of a row is made of under the options of a batch (lanes_law.h of step/).
typedef struct cav_row_law {
  int known, curved;                              ///< 1: R and h K depend on the violation
  double weight, regulariser, stiffness, damping; ///< inverse weight; R and h K where they do not; h B
  double ends[2], width, midpoint, power,
      factor; ///< of the impedance where they do; h K is factor times that over stiffness
} cav_row_law;

/// What the contacts of a pair have in common.
typedef struct cav_pair_law {
  const cav_pair *pair; ///< NULL: not known yet
  int link[2];
  cav_row_law row;
  double friction[5], ratio[6]; ///< R of a friction row is ratio squared times that of the first
} cav_pair_law;

/// Arrays as in cav_state and its workspace, each number four times.
typedef struct cav_lanes {
  cav_four *q, *half, *sine, *cosine; ///< [nq], [nhinge]
  cav_lane_pose *link;
  cav_four *com, *inertia, *reference, *axis;
  cav_four *v, *v_next, *bias, *a; ///< [nv] before and after the step, where the bias is taken, acceleration
  cav_four *velocity, *velocity_next, *acceleration, *force, *u;
  cav_four *centre;       ///< [3*ngeom] of geoms in pairs, by their slots in the broad phase
  int nnear, *near;       ///< [npair] pairs that are near in some state: 16 times the pair, and a bit for each state
  double activation[2];   ///< what was added to margins within trees and with the world
  cav_pair_law *law;      ///< [npair]
  cav_row_law *row_law;   ///< [nv+2*ntendon+njoint] of friction losses and limits (lanes_rows.c)
  cav_options options;    ///< of all of those
  int rows;               ///< 1: springs, friction losses and limits go by four
  int nbounded, *bounded; ///< [njoint] limits that are near in some state, the same way
} cav_lanes;

/// How much of the poses goes back to the states: nothing, what contacts of primitive geoms need, or all.
typedef enum cav_extent { CAV_EXTENT_NONE, CAV_EXTENT_CONTACTS, CAV_EXTENT_ALL } cav_extent;

/// Whether the processor gains by them: by two numbers at once a state alone is faster. What is below is for those that do.
static inline int cav_lanes_pay(void) { return cav_dense_lanes() >= CAV_LANES; }

/// NULL if memory runs out.
cav_lanes *cav_lanes_new(const cav_model *model);
void cav_lanes_free(cav_lanes *lanes);

/// Numbers of four arrays [n] side by side, and back.
void cav_lanes_gather(cav_four *to, const double *const from[CAV_LANES], int n);
void cav_lanes_scatter(double *const to[CAV_LANES], const cav_four *from, int n);

/// A bit for each of the four arrays whose numbers are all finite.
int cav_lanes_finite(const cav_four *x, int n);

/// cav_kinematics of four states at the q in their workspaces.
void cav_lanes_kinematics(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES],
                          cav_extent extent);

/// What cav_kinematics does of a single state before and after its poses. kinematics.c.
void cav_kinematics_open(cav_state *state);
void cav_kinematics_close(const cav_model *model, cav_state *state);

/// cav_newton_euler of four states after that, at v and v_next of the lanes; the states get the results if pushed.
void cav_lanes_newton_euler(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES], int pushed);

/// cav_link_velocities of four states at v of the lanes, left in them in the place of the accelerations. Returns them.
const cav_four *cav_lanes_velocities(const cav_model *model, cav_lanes *lanes);

/// cav_force_project of the forces of the states if pushed, else of those of the lanes, then cav_add_resistance; into u [nv]
/// of each, or NULL: left in the lanes.
void cav_lanes_project(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES], int pushed,
                       double *const u[CAV_LANES]);

#endif
