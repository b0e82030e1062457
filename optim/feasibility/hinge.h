/// Shortest motions of a model that is one hinge. Private to optim/.
#ifndef CAVORT_HINGE_H
#define CAVORT_HINGE_H

#include "cavort/dynamics.h"
#include "cavort/problem.h"

/// inertia q'' = torque - damping q' - gravity[0] cos q - gravity[1] sin q
typedef struct cav_hinge {
  double inertia, damping, gravity[2];
  double torque[2]; ///< least and largest of all actuators at full effort
} cav_hinge;

/// The hinge of a model that is nothing else and that nothing but gravity, damping and actuators with limits acts on, at
/// any angle; *known is 0 for any other model. scratch: of the model, any options.
cav_status cav_hinge_of(const cav_model *model, cav_state *scratch, cav_hinge *hinge, int *known);

/// An extremal a time later: x[4] is q, q' and their adjoints, torque times efforts.
void cav_hinge_step(const cav_hinge *hinge, double efforts, double time, double x[4]);

/// Least time from q, q' to a box of them with so many times the torques; infinite: more than most. Too
/// little by a hundredth of the time of a swing at most.
double cav_hinge_time(const cav_hinge *hinge, double efforts, const double start[2], const double low[2],
                      const double high[2], double most);

/// Least multiple of the torques, up to a hundred, with which a time is enough; infinite: none.
double cav_hinge_efforts(const cav_hinge *hinge, const double start[2], const double low[2], const double high[2],
                         double time);

/// Multiple of the torques that the discretisation can stand for, at a step: the work of a swing is right to O(h) under
/// order euler, to O(h^2) under the others.
double cav_hinge_margin(const cav_hinge *hinge, cav_order order, double timestep);

#endif
