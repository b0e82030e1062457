/// A body under model-predictive control, simulated in the contacts of its model's file, and pushed.
#ifndef CAVORT_SIMULATION_H
#define CAVORT_SIMULATION_H

#include "cavort/mpc.h"

/// A force that the controller does not know of, at the centre of mass of a link.
typedef struct cav_push {
  int link;            ///< 0: none
  double impulse[3];   ///< N s, world
  double time, length; ///< s
} cav_push;

/// u [nv] += the generalised force of a push at the last cav_position of a state.
void cav_push_add(const cav_model *model, const cav_state *state, const cav_push *push, double *u);

/// What to simulate. Results depend on nothing else: time is that of the simulation.
typedef struct cav_simulation {
  const cav_problem *problem;
  const cav_trajectory *first; ///< the plan that a run begins with
  cav_mpc_options mpc;         ///< whose timestep is that of the simulation, too
  int period;                  ///< steps from plan to plan
  int steps;                   ///< in all
} cav_simulation;

/// One plan that was made.
typedef struct cav_plan_record {
  double time;               ///< s, of the state that it is made from
  double cost, unactuated;   ///< cost; largest unactuated force, fraction of weight
  double seconds, processor; ///< s that it took, by the clock and of the processors
} cav_plan_record;

/// A run, and what came of it. To be cleared.
typedef struct cav_run {
  cav_trajectory *motion; ///< at the states that plans were made from, forces that actuators gave there
  int nplan;
  cav_plan_record *plan; ///< [nplan]
  double cost;           ///< mean of its plans'
  double strayed;        ///< m, farthest that the centre of mass was from where it began, level
  double lowered;    ///< by how much a link ended below its place in the goal posture at most, over the posture's size
  double speed;      ///< m/s of the centre of mass at the end
  int stands;        ///< 1: lowered by at most CAV_RUN_LOWERED, no faster than CAV_RUN_SPEED
  char stopped[160]; ///< why it ended early, "" if it did not
} cav_run;

#define CAV_RUN_LOWERED 0.3
#define CAV_RUN_SPEED 0.3 ///< m/s

/// Simulates under a push, NULL: none. A simulation that cannot go on is a run that does not stand. CAV_NO_MEMORY, or why
/// there is no controller, with error.
cav_status cav_simulate(const cav_simulation *simulation, const cav_push *push, cav_run *run, cav_error *error);
void cav_run_clear(cav_run *run);

#endif
