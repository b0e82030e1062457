/// A compiled model: immutable after loading, shared by threads. Layout of q and v, names and defaults are MJCF's.
/// Units: m, kg, s, rad, N. Quaternions are (w, x, y, z), unit. A pose (pos, quat) maps local to parent coordinates.
#ifndef CAVORT_MODEL_H
#define CAVORT_MODEL_H

#include <stddef.h>

#include "cavort/status.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum cav_joint_type { CAV_JOINT_FREE, CAV_JOINT_BALL, CAV_JOINT_SLIDE, CAV_JOINT_HINGE } cav_joint_type;

typedef enum cav_geom_type {
  CAV_GEOM_PLANE,     ///< z = 0, solid below; size unused
  CAV_GEOM_SPHERE,    ///< size[0] radius
  CAV_GEOM_CAPSULE,   ///< along z; size[0] radius, size[1] half length of the segment
  CAV_GEOM_ELLIPSOID, ///< size semi-axes
  CAV_GEOM_CYLINDER,  ///< along z; size[0] radius, size[1] half length
  CAV_GEOM_BOX,       ///< size half lengths
  CAV_GEOM_MESH,      ///< the convex hull of a mesh: model->mesh[asset]; size half lengths of its box
  CAV_GEOM_HFIELD,    ///< model->hfield[asset]; size as there
  CAV_GEOM_TYPES
} cav_geom_type;

/// What an actuator pulls at.
typedef enum cav_transmission {
  CAV_TRANSMISSION_JOINT,           ///< gear along the joint's own dofs
  CAV_TRANSMISSION_JOINT_IN_PARENT, ///< ball and free: turning gear in the axes of the parent (free: of the world)
  CAV_TRANSMISSION_TENDON,
  CAV_TRANSMISSION_SITE, ///< force and torque in the site's axes, or in those of a reference site
  CAV_TRANSMISSION_CRANK ///< slider-crank
} cav_transmission;

/// What the input of an actuator is: its control, or an activation that follows the control (a state MuJoCo integrates).
typedef enum cav_activation {
  CAV_ACTIVATION_NONE,
  CAV_ACTIVATION_INTEGRATOR,
  CAV_ACTIVATION_FILTER,
  CAV_ACTIVATION_MUSCLE
} cav_activation;
typedef enum cav_gain { CAV_GAIN_FIXED, CAV_GAIN_AFFINE, CAV_GAIN_MUSCLE } cav_gain;
typedef enum cav_bias { CAV_BIAS_NONE, CAV_BIAS_AFFINE, CAV_BIAS_MUSCLE } cav_bias;

/// What a sensor measures: MJCF's names, shapes and conventions. Velocities are those at v_next; accelerations and forces
/// are those of the step from v to v_next.
typedef enum cav_sensor_type {
  CAV_SENSOR_JOINTPOS,      ///< 1, rad or m
  CAV_SENSOR_JOINTVEL,      ///< 1
  CAV_SENSOR_FRAMEPOS,      ///< 3, m, in the reference frame (default: world), as the next six
  CAV_SENSOR_FRAMEQUAT,     ///< 4, unit quaternion
  CAV_SENSOR_FRAMEXAXIS,    ///< 3
  CAV_SENSOR_FRAMEYAXIS,    ///< 3
  CAV_SENSOR_FRAMEZAXIS,    ///< 3
  CAV_SENSOR_FRAMELINVEL,   ///< 3, m/s
  CAV_SENSOR_FRAMEANGVEL,   ///< 3, rad/s
  CAV_SENSOR_SUBTREECOM,    ///< 3, m, world
  CAV_SENSOR_SUBTREELINVEL, ///< 3, m/s, world
  CAV_SENSOR_SUBTREEANGMOM, ///< 3, kg m^2/s about the subtree's centre of mass, world
  CAV_SENSOR_TOUCH, ///< 1, N, sum of normal forces on the site's body within the site or pointing out through it
  CAV_SENSOR_ACCELEROMETER,  ///< 3, m/s^2, of the site, site axes, gravity included: 9.81 upwards at rest
  CAV_SENSOR_VELOCIMETER,    ///< 3, m/s, site axes
  CAV_SENSOR_GYRO,           ///< 3, rad/s, site axes
  CAV_SENSOR_FORCE,          ///< 3, N, that the parent of the site's body exerts on it, site axes
  CAV_SENSOR_TORQUE,         ///< 3, N m, likewise, about the site
  CAV_SENSOR_MAGNETOMETER,   ///< 3, the model's magnetic field in site axes
  CAV_SENSOR_RANGEFINDER,    ///< 1, m, along the site's z axis to the nearest geom of another body that is not fully
                             ///< transparent; -1: nothing there
  CAV_SENSOR_TENDONPOS,      ///< 1, m or rad
  CAV_SENSOR_TENDONVEL,      ///< 1
  CAV_SENSOR_ACTUATORPOS,    ///< 1, length of the transmission, gear included
  CAV_SENSOR_ACTUATORVEL,    ///< 1
  CAV_SENSOR_ACTUATORFRC,    ///< 1, N or N m before gear: least-norm forces of all actuators that give u
  CAV_SENSOR_BALLQUAT,       ///< 4, unit quaternion
  CAV_SENSOR_BALLANGVEL,     ///< 3, rad/s, body axes
  CAV_SENSOR_JOINTLIMITPOS,  ///< 1, distance to the nearer limit minus margin; 0 where no limit acts, as the next five
  CAV_SENSOR_JOINTLIMITVEL,  ///< 1, its rate
  CAV_SENSOR_JOINTLIMITFRC,  ///< 1, N or N m
  CAV_SENSOR_TENDONLIMITPOS, ///< 1
  CAV_SENSOR_TENDONLIMITVEL, ///< 1
  CAV_SENSOR_TENDONLIMITFRC, ///< 1, N
  CAV_SENSOR_FRAMELINACC,    ///< 3, m/s^2, world axes, gravity included: 9.81 upwards at rest
  CAV_SENSOR_FRAMEANGACC,    ///< 3, rad/s^2, world axes
  CAV_SENSOR_CLOCK,          ///< 1, s, state->time
  CAV_SENSOR_TYPES
} cav_sensor_type;

enum { CAV_SENSOR_DIM_MAX = 4 }; ///< most numbers of a reading

/// What a frame sensor or a term looks at.
typedef enum cav_object_type {
  CAV_OBJECT_BODY,  ///< frame at the body's centre of mass (MJCF "body")
  CAV_OBJECT_XBODY, ///< frame of the body as written in the file (MJCF "xbody")
  CAV_OBJECT_JOINT,
  CAV_OBJECT_GEOM,
  CAV_OBJECT_SITE,
  CAV_OBJECT_TENDON,
  CAV_OBJECT_ACTUATOR,
  CAV_OBJECT_KEY,
  CAV_OBJECT_SENSOR,
  CAV_OBJECT_EQUALITY,
  CAV_OBJECT_TYPES
} cav_object_type;

/// What a sensor may look at.
typedef enum cav_sensor_target {
  CAV_TARGET_NONE,  ///< nothing: a clock
  CAV_TARGET_FRAME, ///< body, xbody, geom or site
  CAV_TARGET_BODY,  ///< subtree of a body
  CAV_TARGET_SITE,
  CAV_TARGET_SCALAR_JOINT, ///< hinge or slide
  CAV_TARGET_BALL_JOINT,
  CAV_TARGET_LIMITED_JOINT,
  CAV_TARGET_TENDON,
  CAV_TARGET_LIMITED_TENDON,
  CAV_TARGET_ACTUATOR
} cav_sensor_target;

/// The last stage of an evaluation that a sensor needs.
typedef enum cav_sensor_stage {
  CAV_READS_POSITION,    ///< q
  CAV_READS_VELOCITY,    ///< q and v_next
  CAV_READS_ACCELERATION ///< q, v and v_next
} cav_sensor_stage;

/// What holds for all sensors of a type.
typedef struct cav_sensor_rule {
  const char *name; ///< MJCF's element
  int dim;          ///< length of a reading; 4: a unit quaternion
  cav_sensor_target target;
  cav_sensor_stage stage;
} cav_sensor_rule;

/// Softness of one constraint as MJCF writes it; dynamics/METHOD.md, 4.
typedef struct cav_softness {
  double solref[2]; ///< (time constant s, damping ratio), or both negative: (-stiffness, -damping)
  double solimp[5]; ///< impedance d0, d_width, width, midpoint, power
} cav_softness;

/// A body as the file names it. Body 0 is the world.
typedef struct cav_body {
  const char *name; ///< never NULL; "" if the file gives none
  int parent;       ///< body; 0 for children of the world; -1 for the world
  int link;         ///< link it is part of
  int geom, ngeom;  ///< its geoms: first, count
  double pos[3];    ///< frame in its link's frame
  double quat[4];
  double mass;              ///< kg
  double com[3];            ///< centre of mass in the body frame
  double iquat[4];          ///< principal axes in the body frame
  double inertia[3];        ///< principal moments about the centre of mass, kg m^2
  double inverse_weight[2]; ///< mean diagonal of J M^-1 J' at its com at q0: translation 1/kg, rotation 1/(kg m^2)
  double buoyancy;          ///< fraction of its weight that is taken off (gravcomp of MJCF), 1: floats
} cav_body;

/// Bodies that move as one: the unit of the dynamics. Link 0 is the world and all that is fixed to it.
/// Links are in topological order: parent < child. A link's frame is the frame of its one body with joints.
typedef struct cav_link {
  int body;          ///< body whose joints move it
  int parent;        ///< link; -1 for the world
  int root;          ///< link at the top of its tree (child of the world); 0 for the world
  int joint, njoint; ///< joints in the order in which they act
  int dof, ndof;
  double pos[3]; ///< frame in the parent link's frame at zero joint displacement
  double quat[4];
  double mass;       ///< kg, of all its bodies
  double com[3];     ///< centre of mass in the link frame
  double inertia[6]; ///< about the centre of mass, link axes: xx yy zz xy xz yz, kg m^2
} cav_link;

typedef struct cav_joint {
  const char *name;
  cav_joint_type type;
  int body, link;
  int q, dof;      ///< first index into q and into v
  double pos[3];   ///< anchor in the link frame
  double axis[3];  ///< unit, link frame (hinge, slide, twist of a ball)
  double ref;      ///< q of a hinge or slide in the posture of the file
  int limited;     ///< 1 if range holds
  double range[2]; ///< rad or m; ball: range[1] is the largest rotation angle
  /// Ball: the cylinder of Todorov 2014 in the rotation vector of its quaternion, rad: twist is its component along axis,
  /// within a range, swing the length of the rest, at most a radius. Each holds where its flag is 1.
  int twist_limited, swing_limited;
  double twist[2], swing;
  double margin; ///< limit acts from this distance on
  cav_softness limit;
  double stiffness; ///< N m/rad or N/m
  double springref; ///< hinge and slide: q at rest of the spring
} cav_joint;

/// One degree of freedom, index into v.
typedef struct cav_dof {
  int link, joint;
  int parent;            ///< previous dof towards the root, -1 if none
  double damping;        ///< N m s/rad or N s/m
  double armature;       ///< kg m^2 or kg
  double frictionloss;   ///< N m or N, 0: none
  cav_softness friction; ///< of the friction loss
  double inverse_weight; ///< diagonal of M^-1 at q0, averaged over a ball's 3 and over 3+3 of a free joint
} cav_dof;

/// Convex hull of a mesh, about its centre of mass and principal axes: the frame of its geoms.
typedef struct cav_mesh {
  const char *name;
  int nvertex, nface;
  const double *vertex; ///< [nvertex*3] m
  const double *plane;  ///< [nface*4] of each polygon: outward unit normal n and offset d, n x <= d inside
  const int *face;      ///< [nface+1] first entry of each polygon in corner
  const int *corner;    ///< [face[nface]] vertices, counterclockwise from outside
  const int *neighbour_start, *neighbour; ///< [nvertex+1], vertices across an edge from each
} cav_mesh;

/// Heights over a grid in the x-y plane, solid down to -base; x grows along columns, y along rows, both about 0.
typedef struct cav_hfield {
  const char *name;
  int nrow, ncol;
  double size[2];       ///< half lengths along x and y, m
  double top, base;     ///< m: largest height that elevation 1 stands for; depth below 0
  const double *height; ///< [nrow*ncol] m
} cav_hfield;

typedef struct cav_geom {
  const char *name;
  cav_geom_type type;
  int body, link;
  double pos[3]; ///< in the link frame
  double quat[4];
  double rotation[9]; ///< of quat, row-major
  double size[3];
  int asset;    ///< of a mesh or height field: index of its kind
  double bound; ///< radius of the bounding sphere about pos; infinite for a plane
  int contype, conaffinity;
  int condim, priority;
  double friction[3]; ///< sliding, torsional (m), rolling (m)
  double margin, gap; ///< m
  double solmix;
  cav_softness softness;
  int fluid;           ///< 1: in a medium this geom is an ellipsoid, and its body no box
  double fluidcoef[5]; ///< drag blunt, slender, angular; lift of Kutta, of Magnus
  float rgba[4];
  int group;
} cav_geom;

typedef struct cav_site {
  const char *name;
  int body, link;
  double pos[3]; ///< in the link frame
  double quat[4];
  cav_geom_type type; ///< shape of the zone of a touch sensor: sphere, capsule, ellipsoid, cylinder or box
  double size[3];
} cav_site;

/// Two geoms that may touch; everything mixed at compile time. Only pairs that can touch are listed.
typedef struct cav_pair {
  int geom1, geom2;   ///< geom1's type <= geom2's type
  int dim;            ///< 1, 3, 4 or 6 rows
  int external;       ///< 1 if one of the two stands in the world, or they hang from the world by different roots
  double friction[5]; ///< two tangential, torsional (m), two rolling (m)
  double margin, gap; ///< m
  cav_softness softness;
  double weight[2]; ///< reference diagonal of A: translation, rotation (sum of both bodies' inverse_weight)
} cav_pair;

/// One joint of a fixed tendon.
typedef struct cav_tendon_part {
  int joint;
  double coef;
} cav_tendon_part;

/// What the path of a spatial tendon meets next.
typedef enum cav_tendon_path_type {
  CAV_TENDON_PATH_SITE,
  CAV_TENDON_PATH_SPHERE,
  CAV_TENDON_PATH_CYLINDER,
  CAV_TENDON_PATH_PULLEY
} cav_tendon_path_type;
typedef struct cav_tendon_path_point {
  cav_tendon_path_type type;
  int object;     ///< site to pass through, or geom to wrap around
  int side;       ///< geoms: site on the side to pass, or inside to come through; -1: the shorter way
  double divisor; ///< pulleys: of the length of the branch that starts here
} cav_tendon_path_point;

/// Tendon. Fixed: length = sum coef q_joint. Spatial: length of the string along its path.
typedef struct cav_tendon {
  const char *name;
  int part, npart; ///< fixed: range in model->tendon_part
  int path, npath; ///< spatial: range in model->tendon_path; npath is 0 for a fixed one
  int dof, ndof;   ///< range in model->tendon_dof: what can change its length
  int limited;
  double range[2];
  double margin;
  cav_softness limit;
  double stiffness, damping, springlength;
  double frictionloss;
  cav_softness friction;
  double inverse_weight; ///< J M^-1 J' at q0
} cav_tendon;

typedef enum cav_equality_type {
  CAV_EQUALITY_CONNECT, ///< two points of two bodies are one
  CAV_EQUALITY_WELD,    ///< two frames of two bodies are one
  CAV_EQUALITY_JOINT,   ///< q1 - r1 = polynomial of q2 - r2
  CAV_EQUALITY_TENDON,  ///< the same of two lengths
  CAV_EQUALITY_DISTANCE ///< two geoms are that far apart
} cav_equality_type;

/// Constraint that holds always, softly: error x -> 0. Todorov 2014, eqs. (5)-(7).
typedef struct cav_equality {
  const char *name;
  cav_equality_type type;
  int dim;             ///< rows: connect 3, weld 6, others 1
  int object[2];       ///< bodies, joints, tendons or geoms; the second joint or tendon may be -1: none
  int link[2];         ///< of bodies and geoms
  double pos[2][3];    ///< connect, weld: the points that are one, each in its link's frame, m
  double quat[2][4];   ///< weld: the frames that are one, each in its link's frame
  double torquescale;  ///< weld: length per sine of half the angle between the frames, m
  double reference[2]; ///< joint, tendon: r, the values at q0
  double coef[5];      ///< joint, tendon: of the polynomial, constant first
  double distance;     ///< m
  cav_softness softness;
  double weight; ///< reference diagonal of A, the same for all rows
} cav_equality;

enum { CAV_ACTUATOR_PARAMETERS = 10 };

/// Actuator: force = gain(length, velocity) input + bias(length, velocity), clamped; its fraction of u is force times the
/// moments of its transmission. What is planned with is its effort: u = sum unit effort moment. A motor (fixed gain, no
/// bias) has its gain as unit, so effort is the control; for every other one the unit is 1 and effort is the force, of
/// which bias is a part, as the servo's pull towards its target: a law of control, not a passive force of the model.
typedef struct cav_actuator {
  const char *name;
  cav_transmission transmission;
  int target;     ///< joint, tendon, site, or site of the crank
  int reference;  ///< site of reference, or of the slider; -1 for none
  int constant;   ///< 1 if the moments do not depend on q
  double gear[6]; ///< gear[0] for scalar joints, tendons and cranks; ball (3); free joint and site (6): force, torque
  double cranklength; ///< m
  cav_activation activation;
  cav_gain gain;
  cav_bias bias;
  double activation_parameter[3];
  double gain_parameter
      [CAV_ACTUATOR_PARAMETERS]; ///< fixed: [0]; affine: constant, per length, per velocity; muscle: MJCF's
  double bias_parameter[CAV_ACTUATOR_PARAMETERS];
  double unit; ///< force of one unit of effort
  int ctrllimited, forcelimited, actlimited;
  double ctrlrange[2];
  double forcerange[2];  ///< in units of effort
  double actrange[2];    ///< of an integrated activation
  double lengthrange[2]; ///< muscles: shortest and longest transmission
  double acceleration;   ///< |M^-1 moments| at q0, what a unit force causes
} cav_actuator;

typedef struct cav_sensor {
  const char *name;
  cav_sensor_type type;
  cav_object_type object_type;
  int object;                     ///< index of that kind
  int dim;                        ///< length of its reading
  int adr;                        ///< first index in the vector of all readings
  int referred;                   ///< frame sensors: 1 if readings are in the frame of the following object
  cav_object_type reference_type; ///< a kind with a frame
  int reference;
  double cutoff; ///< values beyond are cut to it, both ways; 0: not cut. Never cuts axes and quaternions
} cav_sensor;

typedef struct cav_key {
  const char *name;
  double time;
  const double *q; ///< [nq]
  const double *v; ///< [nv]
} cav_key;

/// Which velocity the bias force c and the passive force p are evaluated at, or what takes their place; dynamics/METHOD.md, 2.
typedef enum cav_order {
  CAV_ORDER_EULER,    ///< at v; joint damping at v_next (implicit). The paper's step
  CAV_ORDER_MIDPOINT, ///< at (v + v_next)/2, damping too; second order where it matters
  /// as midpoint, but the rows of a root link balance the momentum of its tree half a step before and after: exact in flight
  CAV_ORDER_MOMENTUM
} cav_order;

/// How v* is made from a constraint's position error; dynamics/METHOD.md, 4.
typedef enum cav_stabilisation {
  CAV_STABILISATION_SOLREF, ///< eq. (28) from each constraint's solref and solimp, as MuJoCo does
  CAV_STABILISATION_DISCRETE ///< critically damped discrete step with double pole exp(-h/time_constant), one softness for all
} cav_stabilisation;

/// Diagonal of A that scales the regulariser R (27).
typedef enum cav_regulariser {
  CAV_REGULARISER_REFERENCE, ///< constants of the configuration q0: smooth in q, cheap, MuJoCo's
  CAV_REGULARISER_EXACT      ///< of J M_hat^-1 J' at q, the paper's: factors the inertia in every evaluation
} cav_regulariser;

/// How constraints are evaluated. A state starts with the model's; change state->options between calls at will.
typedef struct cav_options {
  double timestep; ///< h, s: starts as the model's; every evaluation uses this one
  cav_order order;
  cav_stabilisation stabilisation;
  cav_regulariser regulariser;
  int coupled;          ///< 1: B and K dense, so that all rows together are critically damped; costs a factorisation
  double softness;      ///< epsilon of CAV_STABILISATION_DISCRETE, > 0
  double time_constant; ///< kappa of CAV_STABILISATION_DISCRETE, s; 0: deadbeat
  double
      smoothing; ///< delta, m: distance at which the smoothed law is active; 0: the exact law (dynamics/METHOD.md, 3)
  double smoothing_self; ///< delta between two links of one tree, m, used where smoothing > 0
  double
      self_stiffness; ///< fraction of their stiffness that contacts between two links of one tree get, (0, 1]; 1: the law
  double impratio;    ///< R_normal / R_friction, > 0
  int refsafe;        ///< 1: keep solref time constants >= 2 h
  int contact;        ///< 0: no contacts
  int constraint;     ///< 0: no equality constraints, limits, friction loss or contacts
  int gravity;        ///< 0: none
  int passive;        ///< 0: no springs and dampers
} cav_options;

/// A compiled model. Built by cav_model_load; nothing but cav_model_perturb changes it, before any state of it exists.
typedef struct cav_model {
  const char *name;
  int nq, nv, nu;  ///< sizes of q, v and of the control vector (one per actuator)
  double timestep; ///< s
  double gravity[3];
  double density, viscosity, wind[3]; ///< of the medium: kg/m^3, kg/(m s), m/s; both 0: none
  double magnetic[3];                 ///< field that magnetometers read, world
  cav_options options;                ///< defaults for new states

  int nbody, nlink, njoint, ngeom, nsite, npair, ntendon, ntendon_part, ntendon_path, ntendon_dof, nequality, nactuator,
      nsensor, nkey, nwarning;
  int nmesh, nhfield;
  int fused;       ///< 1: bodies without joints take the reference weights of the link they are part of
  int nsensordata; ///< length of the vector of all readings
  const cav_body *body;
  const cav_link *link;
  const cav_joint *joint;
  const cav_dof *dof; ///< [nv]
  const cav_geom *geom;
  const cav_mesh *mesh;
  const cav_hfield *hfield;
  const cav_site *site;
  const cav_pair *pair;
  const cav_tendon *tendon;
  const cav_tendon_part *tendon_part;
  const cav_tendon_path_point *tendon_path;
  const int *tendon_dof; ///< [ntendon_dof] indices into v, by tendon
  const cav_equality *equality;
  const cav_actuator *actuator; ///< [nu]
  const cav_sensor *sensor;
  const cav_key *key;
  const double *q0;           ///< [nq] configuration of the file, where reference quantities are taken
  const char *const *warning; ///< what the file asks for and this version leaves aside, with file and line
  double mass;                ///< kg, of all that moves
  size_t bytes;               ///< memory of the model
} cav_model;

/// What to read of a file beyond what its dynamics need.
typedef struct cav_load_options {
  int visual; ///< 1: geometry that can neither touch nor weigh too, for a viewer
  int floating; ///< 1: the root link of a URDF floats (joint "root"); 0: it stands in the world unless the file says otherwise
} cav_load_options;

CAV_API cav_load_options cav_load_options_default(void);

/// cav_model_load with options.
CAV_API cav_model *cav_model_load_with(const char *path, const cav_load_options *options, cav_error *error);

/// Loads an MJCF or URDF file, told apart by the root element, with its includes and assets. NULL on failure with the reason in error (may be NULL).
/// What is understood but not used becomes a model->warning. The result is freed with cav_model_free.
CAV_API cav_model *cav_model_load(const char *path, cav_error *error);

/// Frees a model; NULL is fine. No state of it may be used afterwards.
CAV_API void cav_model_free(cav_model *model);

/// Changes a model before any state of it exists: mass and inertia of link i times mass_scale[i] ([nlink], > 0; NULL: as they are),
/// sliding friction of every contact (0: as it is); what the model derives from them follows. CAV_BAD_INPUT: a scale that is not
/// positive, a negative friction, nothing changed; CAV_NO_MEMORY: do not use the model.
CAV_API cav_status cav_model_perturb(cav_model *model, const double *mass_scale, double friction);

/// Index of the object of that kind and name, -1 if there is none. CAV_OBJECT_BODY and _XBODY both look up bodies.
CAV_API int cav_object_find(const cav_model *model, cav_object_type type, const char *name);

/// Name, length and needs of a type of sensor; type < CAV_SENSOR_TYPES.
CAV_API const cav_sensor_rule *cav_sensor_rule_of(cav_sensor_type type);

/// q [nq] := the configuration of the file (model->q0).
CAV_API void cav_configuration_reset(const cav_model *model, double *q);

/// Scales every quaternion in q [nq] to unit length; a zero quaternion becomes the identity.
CAV_API void cav_configuration_normalise(const cav_model *model, double *q);

/// Moves q along v for a time h on the manifold: q_next = q (+) h v. q, q_next [nq], v [nv]; q_next may be q.
/// Quaternions advance by the exponential in body axes. dynamics/METHOD.md, 1.
CAV_API void cav_integrate(const cav_model *model, const double *q, const double *v, double h, double *q_next);

/// Velocity that takes q0 to q1 in time h: v = (q1 (-) q0)/h. q0, q1 [nq], v [nv]; inverse of cav_integrate.
CAV_API void cav_difference(const cav_model *model, const double *q0, const double *q1, double h, double *v);

#ifdef __cplusplus
}
#endif
#endif
