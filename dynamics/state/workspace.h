/// What a state keeps to itself: the list of work its model needs, compiled once by cav_state_new, and scratch.
/// Private to dynamics/.
#ifndef CAVORT_WORKSPACE_H
#define CAVORT_WORKSPACE_H

#include "cavort/dynamics.h"

/// What the memory of a state serves. profile.c tells of it.
typedef enum cav_memory_use {
  CAV_MEMORY_HEAD,      ///< the two structs themselves
  CAV_MEMORY_POSES,     ///< positions of links
  CAV_MEMORY_MOTION,    ///< velocities, forces, joints' own forces
  CAV_MEMORY_TENDONS,   ///< lengths and moment arms
  CAV_MEMORY_EQUALITY,  ///< equality constraints
  CAV_MEMORY_ROWS,      ///< limits and friction losses
  CAV_MEMORY_CONTACTS,  ///< contacts, and geoms that may touch
  CAV_MEMORY_ACTUATION, ///< transmissions
  CAV_MEMORY_INERTIA,   ///< inertia matrix and its factors: forward steps only
  CAV_MEMORY_SOLVERS,   ///< solvers and derivatives that have been called
  CAV_MEMORY_USES
} cav_memory_use;

enum { CAV_IMPULSE_DIM = 6 }; ///< most impulses of one object

/// An impulse remembered between Gauss-Seidel solves, and of which object. gpgs.c.
typedef struct cav_memory {
  int type;   ///< -1 for a contact, else the cav_row_type
  int object; ///< pair, or the object of the row
  int detail; ///< feature, or the side of the row
  double f[CAV_IMPULSE_DIM];
} cav_memory;

struct cav_geom_cache;
struct cav_half_steps;
struct cav_next_knot;
struct cav_derivative_store;

/// Of a matrix of three rows.
enum { CAV_LAW_NUMBERS = 9 };

typedef struct cav_workspace {
  size_t bytes[CAV_MEMORY_USES], noted; ///< of the block, by part

  // the last evaluation
  cav_stage valid;        ///< what cav_inverse_from may reuse
  cav_options options;    ///< under which it was made
  double *q, *v, *v_next; ///< [nq], [nv], [nv]; quaternions of q unit
  double *acceleration;   ///< [nlink*6] spatial, base acceleration -gravity
  double *velocity_now;   ///< [nlink*6] scratch: at v, where that is not where the bias is taken

  double *bias; ///< [nlink*6] spatial accelerations that v alone makes; none without connects and welds

  // contacts of the last position are those that can bear something at these velocities, or near them
  int narrowed;
  double *narrow_v; ///< [2*nv] v, v_next

  // rooms
  int contact_room, row_room;
  struct cav_geom_cache *geom;

  // -df/dv_next of contacts of up to three rows, found with their impulses [CAV_LAW_NUMBERS] each; the first number below 0:
  // not known. Less room than contacts: none is known
  double *law;
  int law_room;

  double discrete_damping, discrete_stiffness; ///< h B and h K of every row, by the options of the last position

  // dofs, compact
  double *armature, *damping; ///< [nv]
  int *group;                 ///< [nv] 1 where a joint's dofs start (a free joint's rotation starts a second group)
  int *turns;                 ///< [nv] 1 of a rotation, 0 of a translation
  int *parent;                ///< [nv] previous dof towards the root, -1
  int damped;                 ///< some dof has damping

  // kinematics: what makes a joint or link cheap
  int nquaternion, *quaternion;  ///< indices into q of quaternions
  int nhinge, *hinge, *hinge_of; ///< indices into q of hinges; which of them a joint is [njoint]
  double *hinge_ref;             ///< [nhinge] displacement zero
  double *half, *sine, *cosine;  ///< [nhinge] half angles
  int *aligned;                  ///< [njoint] hinge axis along x, y or z of the link frame: 0, 1, 2; else -1
  int *centred;                  ///< [njoint] anchor at the link's origin
  int *straight;                 ///< [nlink] frame at rest parallel to the parent's

  // joints, tendons, dofs that need a stage: indices and counts
  int nfloat; ///< boxes and ellipsoids in a medium, NULL if none
  struct cav_float *floats;
  int nbuoy, *buoy;     ///< bodies with gravity compensation
  int nstring, *string; ///< spatial tendons
  int nspring, nlimit, nfriction, ntendon_spring, ntendon_limit, ntendon_friction;
  int *spring, *limit, *friction, *tendon_spring, *tendon_limit, *tendon_friction;

  // tree-sparse inertia: row i holds dof i, its parent, the parent's parent, ...
  int *row;          ///< [nv+1] first entry of each row
  double *M;         ///< [row[nv]] composite inertia plus D
  double *L;         ///< [row[nv]] its factors: M = L' D L, D in the first entry of each row
  double *composite; ///< [nlink*10] mass, first moment, inertia at reference of each subtree
  double *scratch;   ///< [4*nv]

  // transmission: moments of each actuator along its dofs and what inverts T'T (actuation.c)
  int *gear_start, *gear_dof; ///< [nu+1], [entries]
  double *gear;               ///< [entries]
  int gear_room;              ///< entries that were counted
  int gear_varies;            ///< some moments depend on q
  int gram_diagonal;
  double *gram_inverse; ///< [nu] of a diagonal T'T
  double *gram;         ///< [nu*nu] its pseudo-inverse otherwise, with scratch behind; NULL if diagonal and constant
  double *control;      ///< [2*nu]

  // coupled rows (coupled.c): I + R A^+ times what undoes the factor 1 + epsilon of each row [rows*rows], v* [rows] in
  // the order of cav_jacobian; NULL without
  double *coupling, *target;
  size_t coupling_room;
  int first_row, first_equality; // where in target rows and equality constraints begin

  // readings of cav_readout_differentiate, grown as needed
  double *readout;
  size_t readout_room;

  // momenta half a step before and after: made by the first evaluation of the order that takes them
  struct cav_half_steps *half_steps;

  // where links and contacts are after the step: made by the first evaluation that looks there
  struct cav_next_knot *next;

  // analytic derivatives: made by the first call, and whether they are of the last evaluation
  struct cav_derivative_store *derivatives;
  int derived;

  // forward step: memory of its matrices, grown by impulse.c, and the impulses of its last Gauss-Seidel solve, by
  // gpgs.c
  void *solver;
  size_t solver_bytes;
  cav_memory *memory;
  int nmemory, memory_room;
  struct cav_hessian *hessian; // made by the first Newton step
} cav_workspace;

/// Room for one more contact or row at the end of the state's arrays; NULL if memory runs out. storage.c.
cav_contact *cav_contact_push(cav_state *state);
cav_row *cav_row_push(cav_state *state);

enum { CAV_FIRST_ROOM = 16 }; ///< contacts or rows that a new state has room for

#endif
