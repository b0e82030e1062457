/// Result folders: solved motions as files, which the tool reads and writes too (problems/README.md lists them). Every file is
/// replaced atomically and alone. And what contacts and actuators do along a motion.
#ifndef CAVORT_PUBLIC_RESULT_H
#define CAVORT_PUBLIC_RESULT_H

#include "cavort/solve.h"

#ifdef __cplusplus
extern "C" {
#endif

/// One loaded contact. The force acts on geom2, and reversed on geom1.
typedef struct cav_contact_force {
  int knot;         ///< at which it presses
  int geom1, geom2; ///< geoms that touch
  double pos[3];    ///< m, world
  double force[3];  ///< N, world
  double normal[3]; ///< from geom1 to geom2, world
  double friction;  ///< coefficient of sliding; 0: the contact has none
  double gap;       ///< m, negative: penetration
} cav_contact_force;

/// What a motion does at its knots.
typedef struct cav_forces {
  int nknot, nforce, nu;    ///< knots, contact forces, actuators
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
CAV_API cav_forces *cav_forces_new(const cav_model *model, const cav_trajectory *trajectory, const cav_options *contact,
                                   int at_rest, cav_error *error);
CAV_API void cav_forces_free(cav_forces *forces);

/// A result folder as read: enough to certify and to show the motion again.
typedef struct cav_result {
  cav_problem *problem;       ///< with the contact law of the motion
  cav_trajectory *trajectory; ///< the motion
  double *gain_q, *gain_v;    ///< [(nknot-1)*nv*nv]; NULL: there is no gains.csv
  int nrow;                   ///< rows of rows.csv
  cav_binding *row;           ///< [nrow] constraint rows of rows.csv, with their multipliers
  double solve_seconds;       ///< as the solver left it in verdict.json; NaN: not recorded
  int iterations;             ///< likewise; 0: not recorded
} cav_result;

/// Writes problem.xml, trajectory.csv, gains.csv (where there are gains), log.csv, stages.csv and rows.csv into a folder,
/// which is made. The path of the model's file is written as seen from there. CAV_BAD_INPUT: what cannot be written; a
/// problem with a quantity of one's own or a model without a file, of which nothing is written; CAV_NO_MEMORY.
CAV_API cav_status cav_result_write(const char *folder, const cav_problem *problem, const cav_solution *solution,
                                    cav_error *error);

/// Writes verdict.json and, with the report of its terms [problem->nterm] (NULL: none), terms.csv. provenance: a JSON value,
/// put into the verdict by that name; NULL: none. Errors as above.
CAV_API cav_status cav_result_write_verdict(const char *folder, const cav_problem *problem, const cav_verdict *verdict,
                                            const cav_term_report *report, const char *provenance, cav_error *error);

/// Writes forces.csv and controls.csv of a motion under the law contact: what touches and presses at each knot, and what
/// actuators give. Errors as above, and what the dynamics says.
CAV_API cav_status cav_result_write_forces(const char *folder, const cav_problem *problem,
                                           const cav_trajectory *trajectory, const cav_options *contact,
                                           cav_error *error);

/// Writes stderr.csv: time, then standard errors of the tangent at q (q_JOINT, with _0, _1, ... where a joint has several dofs),
/// of velocities (qvel_), generalised forces (u_) and actuators (force_NAME); empty where there are no forces. Errors as above.
CAV_API cav_status cav_result_write_errors(const char *folder, const cav_model *model, const cav_trajectory *trajectory,
                                           const cav_standard_errors *errors, cav_error *error);

/// Reads a folder; model_path replaces the model that problem.xml names, NULL: as it says. NULL on failure with the
/// reason in error: CAV_BAD_INPUT with file and line, CAV_NO_MEMORY. Freed with cav_result_free.
CAV_API cav_result *cav_result_read(const char *folder, const char *model_path, cav_error *error);

/// Frees a result with its problem and model; NULL is fine.
CAV_API void cav_result_free(cav_result *result);

#ifdef __cplusplus
}
#endif
#endif
