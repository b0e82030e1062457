/// Contact forces of a motion, knot by knot.
#ifndef CAVORT_FORCES_H
#define CAVORT_FORCES_H

#include "cavort/trajectory.h"

/// One loaded contact. The force acts on geom2, and reversed on geom1.
typedef struct cav_contact_force {
  int knot;
  int geom1, geom2;
  double pos[3];    ///< m, world
  double force[3];  ///< N, world
  double normal[3]; ///< from geom1 to geom2, world
  double friction;  ///< coefficient of sliding; 0: the contact has none
  double gap;       ///< m, negative: penetration
} cav_contact_force;

/// What a motion does at its knots.
typedef struct cav_forces {
  int nknot, nforce, nu;
  int *count;               ///< [nknot] loaded contacts at each knot
  cav_contact_force *force; ///< [nforce] in the order of the knots
  double *u;                ///< [nknot*nv]; rows without a force are NaN
  double *control;          ///< [nknot*nu] least-norm efforts; NaN likewise
  double *input;            ///< [nknot*nu] controls, or activations, that give them; NaN likewise
  double *unactuated;       ///< [nknot] largest force that no actuator can give, N or N m; NaN likewise
  double *com;              ///< [nknot*3] centre of mass of all that moves, m
  double *depth;            ///< [nknot] deepest penetration of a contact, m
} cav_forces;

/// Forces by the law contact; at_rest: the velocity after the last knot is zero, otherwise the last knot has none. A
/// contact counts as loaded from a millionth of the weight on. NULL on failure, with the reason in error.
cav_forces *cav_forces_new(const cav_model *model, const cav_trajectory *trajectory, const cav_options *contact,
                           int at_rest, cav_error *error);
void cav_forces_free(cav_forces *forces);

/// Writes forces.csv: knot, time, geoms by name (or #number), position, force on the second geom, gap. Replaces
/// atomically.
cav_status cav_forces_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                            const cav_forces *forces, cav_error *error);

/// Writes controls.csv: time, then of every actuator its control (ctrl_NAME; of one that has an activation that, act_NAME)
/// and its force before the gear (force_NAME), at the knots that have forces. Replaces atomically.
cav_status cav_controls_write(const char *path, const cav_model *model, const cav_trajectory *trajectory,
                              const cav_forces *forces, cav_error *error);

#endif
