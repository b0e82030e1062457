/// The inverse and the forward step: what they share with each other and with derivatives. Private to dynamics/.
#ifndef CAVORT_STEP_H
#define CAVORT_STEP_H

#include "actuator.h"
#include "constraint.h"

/// R by the true diagonal of A where the options ask, and what cav_coupled_targets needs. After all else of the
/// position stage. Fails with CAV_NO_MEMORY, and with CAV_BAD_INPUT if the inertia is not positive definite. coupled.c.
cav_status cav_coupled_prepare(const cav_model *model, cav_state *state);

/// v* of all rows together from their velocities in the state, into its workspace. coupled.c.
void cav_coupled_targets(cav_state *state);

/// Velocity of a contact in its frame, out [dim], from spatial velocities of links [nlink*6]. inverse.c.
void cav_contact_velocity(const cav_state *state, const cav_contact *contact, const double *velocity, double *out);

/// Impulse of a contact by its law at its velocities; coupled: v* of its rows, NULL: each has its own; hessian [dim*dim]: of the
/// law, or NULL. inverse.c.
void cav_contact_impulse(const cav_state *state, cav_contact *contact, const double *coupled, double *hessian);

/// Wrenches of all contacts of four states into the forces of the lanes, after cav_lanes_newton_euler there; contacts
/// are sought among the pairs that are near, and no state gets them. Plain scenes (inverse.c). lanes_contacts.c.
void cav_lanes_contacts(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES]);

/// Before that: what was worked out under other options is forgotten, and lanes->rows says whether cav_lanes_rows does springs,
/// friction losses and limits. That adds them to u of the lanes, after cav_lanes_limits and cav_lanes_project. lanes_rows.c.
void cav_lanes_prepare(const cav_model *model, cav_lanes *lanes, const cav_state *state);
void cav_lanes_rows(const cav_model *model, cav_lanes *lanes, const cav_state *state);

/// Whether the state holds a whole evaluation of the inverse under its present options. inverse.c.
int cav_state_evaluated(const cav_state *state);

/// u [nv] of the step without constraints, at the state's positions: u = RNE + D a - p. Fills velocities. Under an
/// order that the state has evaluated before. inverse.c.
void cav_smooth_inverse(const cav_model *model, cav_state *state, const double *v, const double *v_next, double *u);

/// cav_inverse at four points under the same options, with the bits of each alone, in the time of less than four: smooth
/// parts, the broad phase and in plain scenes contacts go for all at once. The states are scratch: none of their
/// evaluations may be reused. inverse.c.
void cav_inverse_four(const cav_model *model, cav_lanes *lanes, cav_state *const state[CAV_LANES],
                      const double *const q[CAV_LANES], const double *const v[CAV_LANES],
                      const double *const v_next[CAV_LANES], double *const u[CAV_LANES], cav_status status[CAV_LANES]);

/// What cav_forward passes to cav_forward_newton: its tolerance, and the most iterations under the state's options. forward.c.
#define CAV_FORWARD_TOLERANCE 1e-13
int cav_forward_limit(const cav_state *state);

/// Bytes of each part of a state as it is now. state.c.
void cav_state_bytes(const cav_state *state, size_t bytes[CAV_MEMORY_USES]);

/// Times of the stages of one evaluation of the inverse, s: each run alone often enough to be measured, shortest of
/// several.
typedef struct cav_profile {
  double poses, rows, contacts, equalities,
      laws;        ///< from q: links and tendons; limits; search of contacts; errors; R, B, K
  double motion;   ///< from v and v_next: Newton-Euler, joints' and tendons' forces
  double impulses; ///< from both: of contacts, equality constraints and rows
  double whole;
} cav_profile;

/// Measures at (q, v, v_next); fails as cav_inverse does. The state is left evaluated there. profile.c.
cav_status cav_profile_inverse(const cav_model *model, cav_state *state, const double *q, const double *v,
                               const double *v_next, cav_profile *profile);

/// Memory of the state's solvers with room for that many bytes, what it held is lost; NULL if memory runs out.
/// impulse.c.
void *cav_solver_room(cav_workspace *w, size_t bytes);

#endif
