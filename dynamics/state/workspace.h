/// What a state keeps to itself: the list of work its model needs, compiled once by cav_state_new, and scratch.
/// Private to dynamics/.
#ifndef CAVORT_WORKSPACE_H
#define CAVORT_WORKSPACE_H

#include "stage.h"

/// World placement of the geoms that are in pairs: what collide.c keeps between its own calls.
struct cav_geom_cache;
enum { CAV_SWEEP_FROM = 1000 }; ///< pairs from which on a sweep prunes them (bench_sweep)
struct cav_geom_cache *cav_geom_cache_new(const cav_model *model, int sweep_from);
void cav_geom_cache_free(struct cav_geom_cache *cache);
size_t cav_geom_cache_bytes(const struct cav_geom_cache *cache);

/// Links at one configuration; arrays as in cav_state.
typedef struct cav_posture {
  double *q; ///< [nq], its quaternions are made unit
  cav_pose *link;
  double *com, *inertia, *reference, *axis;
  int referred; ///< 1: reference is given and stays
} cav_posture;

/// Poses, centres of mass, world inertias and motion subspaces at a posture. kinematics.c.
void cav_posture_place(const cav_model *model, struct cav_workspace *w, const cav_posture *at);

/// Mass, first moment and inertia of every subtree about its reference, all [nlink*10], from com, inertia and reference of a
/// posture. inertia.c.
void cav_composites_at(const cav_model *model, const cav_posture *at, double *all);

/// What the memory of a state serves. profile.c tells of it.
typedef enum cav_part {
  CAV_PART_HEAD,      ///< the two structs themselves
  CAV_PART_POSES,     ///< positions of links
  CAV_PART_MOTION,    ///< velocities, forces, joints' own forces
  CAV_PART_TENDONS,   ///< lengths and moment arms
  CAV_PART_EQUALITY,  ///< equality constraints
  CAV_PART_ROWS,      ///< limits and friction losses
  CAV_PART_CONTACTS,  ///< contacts, and geoms that may touch
  CAV_PART_ACTUATION, ///< transmissions
  CAV_PART_INERTIA,   ///< inertia matrix and its factors: forward steps only
  CAV_PART_SOLVERS,   ///< solvers and derivatives that have been called
  CAV_PARTS
} cav_part;

/// Bytes of each part of a state as it is now. state.c.
void cav_state_bytes(const cav_state *state, size_t bytes[CAV_PARTS]);

/// Times of the stages of one evaluation of the inverse, s: each run alone often enough to be measured, shortest of several.
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

enum { CAV_IMPULSE_DIM = 6 }; ///< most impulses of one object

/// An impulse remembered between Gauss-Seidel solves, and of which object. gpgs.c.
typedef struct cav_memory {
  int type;   ///< -1 for a contact, else the cav_row_type
  int object; ///< pair, or the object of the row
  int detail; ///< feature, or the side of the row
  double f[CAV_IMPULSE_DIM];
} cav_memory;

typedef struct cav_workspace {
  size_t bytes[CAV_PARTS], noted; ///< of the block, by part

  // the last evaluation
  cav_stage valid;        ///< what cav_inverse_from may reuse
  cav_options options;    ///< under which it was made
  double *q, *v, *v_next; ///< [nq], [nv], [nv]; quaternions of q unit
  double *acceleration;   ///< [nlink*6] spatial, base acceleration -gravity
  double *velocity_now;   ///< [nlink*6] scratch: at v, where that is not where the bias is taken

  // rooms
  int contact_room, row_room;
  struct cav_geom_cache *geom;

  double discrete_damping, discrete_stiffness; ///< h B and h K of every row, by the options of the last position

  // dofs, compact
  double *armature, *damping; ///< [nv]
  int *group;                 ///< [nv] 1 where a joint's dofs start (a free joint's rotation starts a second group)
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
  int gear_varies;            ///< some moments depend on q
  int gram_diagonal;
  double *gram_inverse; ///< [nu] of a diagonal T'T
  double *gram;         ///< [nu*nu] its pseudo-inverse otherwise, with scratch behind; NULL if diagonal and constant
  double *control;      ///< [2*nu]

  // coupled rows (coupled.c): I + R A^+ times what undoes the factor 1 + epsilon of each row [rows*rows], v* [rows] in the
  // order of cav_jacobian; NULL without
  double *coupling, *target;
  size_t coupling_room;
  int first_row, first_equality; // where in target rows and equality constraints begin

  // readings of cav_readout_differentiate, grown on demand
  double *readout;
  size_t readout_room;

  // momenta half a step before and after: made by the first evaluation of the order that takes them
  struct cav_half_steps *half_steps;

  // analytic derivatives: made by the first call, and whether they are of the last evaluation
  struct cav_derivative_store *derivatives;
  int derived;

  // forward step: memory of its matrices, grown by impulse.c, and the impulses of its last Gauss-Seidel solve, by gpgs.c
  void *solver;
  size_t solver_bytes;
  cav_memory *memory;
  int nmemory, memory_room;
} cav_workspace;

/// Dofs that an actuator moves, dof NULL: only their number. Its length and moments along them, at the state's position.
/// transmission.c.
int cav_transmission_dofs(const cav_model *model, int actuator, int *dof);
double cav_transmission_length(const cav_state *state, int actuator, double *moment);

/// What a medium acts on, if there is one. fluid.c.
cav_status cav_fluid_compile(const cav_model *model, cav_workspace *w);
size_t cav_fluid_bytes(const cav_workspace *w);

/// Fills the transmission of a workspace. actuation.c.
cav_status cav_actuation_compile(const cav_model *model, cav_state *state);

/// Memory of the state's solvers with room for that many bytes, what it held is lost; NULL if memory runs out. impulse.c.
void *cav_solver_room(cav_workspace *w, size_t bytes);

#endif
