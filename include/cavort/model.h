/// A compiled model: immutable after loading, shared by threads. Layout of q and v, names and defaults are MJCF's.
/// Units: m, kg, s, rad, N. Quaternions are (w, x, y, z), unit. A pose (pos, quat) maps local to parent coordinates.
#ifndef CAVORT_MODEL_H
#define CAVORT_MODEL_H

#include <float.h>
#include <stddef.h>

#include "cavort/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/// How a joint lets its body move: six dofs, three, one along or one about its axis.
typedef enum cav_joint_type {
  CAV_JOINT_FREE,  ///< a position and a quaternion: six dofs
  CAV_JOINT_BALL,  ///< a quaternion: three dofs
  CAV_JOINT_SLIDE, ///< a distance along its axis
  CAV_JOINT_HINGE  ///< an angle about its axis
} cav_joint_type;

/// Shapes, in the order in which pairs are sorted.
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
  CAV_TRANSMISSION_TENDON,          ///< along a tendon
  CAV_TRANSMISSION_SITE,            ///< force and torque in the site's axes, or in those of a reference site
  CAV_TRANSMISSION_CRANK            ///< slider-crank
} cav_transmission;

/// What the input of an actuator is: its control, or an activation that follows the control (a state MuJoCo
/// integrates).
typedef enum cav_activation {
  CAV_ACTIVATION_NONE,       ///< none: the control acts at once
  CAV_ACTIVATION_INTEGRATOR, ///< rate of the activation: the control
  CAV_ACTIVATION_FILTER,     ///< first-order filter of the control
  CAV_ACTIVATION_MUSCLE      ///< a muscle's
} cav_activation;
/// How the gain of an actuator is computed.
typedef enum cav_gain {
  CAV_GAIN_FIXED,  ///< a constant
  CAV_GAIN_AFFINE, ///< affine in length and velocity
  CAV_GAIN_MUSCLE  ///< a muscle's, by length and velocity
} cav_gain;
/// How the bias of an actuator is computed.
typedef enum cav_bias {
  CAV_BIAS_NONE,   ///< none
  CAV_BIAS_AFFINE, ///< affine in length and velocity
  CAV_BIAS_MUSCLE  ///< a muscle's passive force
} cav_bias;

/// What sensors measure, X(type, MJCF's name, length of a reading, what it looks at, last stage it needs, text): MJCF's
/// names, shapes and conventions. Velocities are those at v_next; accelerations and forces are those of the step from v
/// to v_next. The enumeration, the table of rules, the names in model and problem files and the help follow from it.
// clang-format off
#define CAV_SENSORS(X)                                                                                                     \
  X(JOINTPOS, "jointpos", 1, SCALAR_JOINT, POSITION, "rad or m")                                                           \
  X(JOINTVEL, "jointvel", 1, SCALAR_JOINT, VELOCITY, "rad/s or m/s")                                                       \
  X(FRAMEPOS, "framepos", 3, FRAME, POSITION, "m, in the reference frame (default: the world), as all up to frameangvel")   \
  X(FRAMEQUAT, "framequat", 4, FRAME, POSITION, "unit quaternion")                                                         \
  X(FRAMEXAXIS, "framexaxis", 3, FRAME, POSITION, "unit vector")                                                           \
  X(FRAMEYAXIS, "frameyaxis", 3, FRAME, POSITION, "unit vector")                                                           \
  X(FRAMEZAXIS, "framezaxis", 3, FRAME, POSITION, "unit vector")                                                           \
  X(FRAMELINVEL, "framelinvel", 3, FRAME, VELOCITY, "m/s")                                                                 \
  X(FRAMEANGVEL, "frameangvel", 3, FRAME, VELOCITY, "rad/s")                                                               \
  X(SUBTREECOM, "subtreecom", 3, BODY, POSITION, "m, world")                                                               \
  X(SUBTREELINVEL, "subtreelinvel", 3, BODY, VELOCITY, "m/s, world")                                                       \
  X(SUBTREEANGMOM, "subtreeangmom", 3, BODY, VELOCITY, "kg m^2/s about the subtree's centre of mass, world")                \
  X(TOUCH, "touch", 1, SURFACE, ACCELERATION, "N, sum of normal forces on a body with what is fixed to it, or on a geom, by what is not of its tree; of a site, in models too, of all on its body within the site or pointing out through it") \
  X(ACCELEROMETER, "accelerometer", 3, SITE, ACCELERATION, "m/s^2, of the site, site axes, gravity included: 9.81 upwards at rest") \
  X(VELOCIMETER, "velocimeter", 3, SITE, VELOCITY, "m/s, site axes")                                                       \
  X(GYRO, "gyro", 3, SITE, VELOCITY, "rad/s, site axes")                                                                   \
  X(FORCE, "force", 3, SITE, ACCELERATION, "N, that the parent of the site's body exerts on it, site axes")                 \
  X(TORQUE, "torque", 3, SITE, ACCELERATION, "N m, likewise, about the site")                                              \
  X(MAGNETOMETER, "magnetometer", 3, SITE, POSITION, "the model's magnetic field in site axes")                            \
  X(RANGEFINDER, "rangefinder", 1, SITE, POSITION, "m, along the site's z axis to the nearest geom of another body that is not fully transparent; -1: nothing there") \
  X(TENDONPOS, "tendonpos", 1, TENDON, POSITION, "m or rad")                                                               \
  X(TENDONVEL, "tendonvel", 1, TENDON, VELOCITY, "m/s or rad/s")                                                           \
  X(ACTUATORPOS, "actuatorpos", 1, ACTUATOR, POSITION, "length of the transmission, gear included")                        \
  X(ACTUATORVEL, "actuatorvel", 1, ACTUATOR, VELOCITY, "its rate")                                                         \
  X(ACTUATORFRC, "actuatorfrc", 1, ACTUATOR, ACCELERATION, "N or N m before gear: least-norm forces of all actuators that give u") \
  X(JOINTACTUATORFRC, "jointactuatorfrc", 1, SCALAR_JOINT, ACCELERATION, "N m or N, what those forces do to the joint")      \
  X(BALLQUAT, "ballquat", 4, BALL_JOINT, POSITION, "unit quaternion")                                                      \
  X(BALLANGVEL, "ballangvel", 3, BALL_JOINT, VELOCITY, "rad/s, body axes")                                                 \
  X(JOINTLIMITPOS, "jointlimitpos", 1, LIMITED_JOINT, POSITION, "distance to the nearer limit minus margin; 0 where no limit acts, as the next five") \
  X(JOINTLIMITVEL, "jointlimitvel", 1, LIMITED_JOINT, VELOCITY, "its rate")                                                \
  X(JOINTLIMITFRC, "jointlimitfrc", 1, LIMITED_JOINT, ACCELERATION, "N or N m")                                            \
  X(TENDONLIMITPOS, "tendonlimitpos", 1, LIMITED_TENDON, POSITION, "distance to the nearer limit minus margin")            \
  X(TENDONLIMITVEL, "tendonlimitvel", 1, LIMITED_TENDON, VELOCITY, "its rate")                                             \
  X(TENDONLIMITFRC, "tendonlimitfrc", 1, LIMITED_TENDON, ACCELERATION, "N")                                                \
  X(FRAMELINACC, "framelinacc", 3, FRAME, ACCELERATION, "m/s^2, world axes, gravity included: 9.81 upwards at rest")        \
  X(FRAMEANGACC, "frameangacc", 3, FRAME, ACCELERATION, "rad/s^2, world axes")                                             \
  X(CLOCK, "clock", 1, NONE, POSITION, "s, state->time")
// clang-format on

/// Types of sensors: CAV_SENSORS.
typedef enum cav_sensor_type {
#define CAV_SENSOR_MEMBER(type, ...) CAV_SENSOR_##type,
  CAV_SENSORS(CAV_SENSOR_MEMBER)
#undef CAV_SENSOR_MEMBER
      CAV_SENSOR_TYPES
} cav_sensor_type;

enum { CAV_SENSOR_DIM_MAX = 4 }; ///< most numbers of a reading

/// What a frame sensor or a term looks at, X(type, array of the model, attribute that names one in problem files, what
/// to call it). BODY is the frame at a body's centre of mass (MJCF "body"), XBODY that of the body as written in the
/// file (MJCF "xbody").
#define CAV_OBJECTS(X)                          \
  X(BODY, body, "body", "body")                 \
  X(XBODY, body, "xbody", "body")               \
  X(JOINT, joint, "joint", "joint")             \
  X(GEOM, geom, "geom", "geom")                 \
  X(SITE, site, "site", "site")                 \
  X(TENDON, tendon, "tendon", "tendon")         \
  X(ACTUATOR, actuator, "actuator", "actuator") \
  X(KEY, key, "key", "keyframe")                \
  X(SENSOR, sensor, "sensor", "sensor")         \
  X(EQUALITY, equality, "equality", "equality constraint")

/// Kinds of objects: CAV_OBJECTS.
typedef enum cav_object_type {
#define CAV_OBJECT_MEMBER(type, ...) CAV_OBJECT_##type,
  CAV_OBJECTS(CAV_OBJECT_MEMBER)
#undef CAV_OBJECT_MEMBER
      CAV_OBJECT_TYPES
} cav_object_type;

/// What a sensor may look at.
typedef enum cav_sensor_target {
  CAV_TARGET_NONE,           ///< nothing: a clock
  CAV_TARGET_FRAME,          ///< body, xbody, geom or site
  CAV_TARGET_BODY,           ///< subtree of a body
  CAV_TARGET_SITE,           ///< a site
  CAV_TARGET_SURFACE,        ///< a site, whose zone counts; in problems a body with what is fixed to it, or a geom
  CAV_TARGET_SCALAR_JOINT,   ///< hinge or slide
  CAV_TARGET_BALL_JOINT,     ///< a ball joint
  CAV_TARGET_LIMITED_JOINT,  ///< a joint with a range
  CAV_TARGET_TENDON,         ///< a tendon
  CAV_TARGET_LIMITED_TENDON, ///< a tendon with a range
  CAV_TARGET_ACTUATOR        ///< an actuator
} cav_sensor_target;

/// The last stage of an evaluation that a sensor needs.
typedef enum cav_sensor_stage {
  CAV_READS_POSITION,    ///< q
  CAV_READS_VELOCITY,    ///< q and v_next
  CAV_READS_ACCELERATION ///< q, v and v_next
} cav_sensor_stage;

/// What holds for all sensors of a type.
typedef struct cav_sensor_rule {
  const char *name;         ///< MJCF's element
  int dim;                  ///< length of a reading; 4: a unit quaternion
  cav_sensor_target target; ///< what it looks at
  cav_sensor_stage stage;   ///< last stage of an evaluation that it reads
  const char *text;         ///< unit and meaning
} cav_sensor_rule;

/// Softness of one constraint as MJCF writes it; dynamics/METHOD.md, 4.
typedef struct cav_softness {
  double solref[2]; ///< (time constant s, damping ratio), or both negative: (-stiffness, -damping)
  double solimp[5]; ///< impedance d0, d_width, width, midpoint, power
} cav_softness;

/// A body as the file names it. Body 0 is the world.
typedef struct cav_body {
  const char *name;         ///< never NULL; "" if the file gives none
  int parent;               ///< body; 0 for children of the world; -1 for the world
  int link;                 ///< link it is part of
  int geom, ngeom;          ///< its geoms: first, count
  double pos[3];            ///< frame in its link's frame
  double quat[4];           ///< unit quaternion w x y z of its frame in the frame of its link
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
  int dof, ndof;     ///< dofs: first, count
  int driven;        ///< 1: an actuator moves its tree, or one that equality constraints or tendons join to it
  double pos[3];     ///< frame in the parent link's frame at zero joint displacement
  double quat[4];    ///< unit quaternion w x y z at q0, in the frame of its parent
  double mass;       ///< kg, of all its bodies
  double com[3];     ///< centre of mass in the link frame
  double inertia[6]; ///< about the centre of mass, link axes: xx yy zz xy xz yz, kg m^2
} cav_link;

/// A joint; its coordinates follow each other in q and v.
typedef struct cav_joint {
  const char *name;    ///< as in the file
  cav_joint_type type; ///< kind of joint
  int body, link;      ///< body and link that it moves
  int q, dof;          ///< first index into q and into v
  double pos[3];       ///< anchor in the link frame
  double axis[3];      ///< unit, link frame (hinge, slide, twist of a ball)
  double ref;          ///< q of a hinge or slide in the posture of the file
  int limited;         ///< 1 if range holds
  double range[2];     ///< rad or m; ball: range[1] is the largest rotation angle
  /// Ball: the cylinder of Todorov 2014 in the rotation vector of its quaternion, rad: twist is its component along
  /// axis, within a range, swing the length of the rest, at most a radius. Each holds where its flag is 1.
  int twist_limited, swing_limited; ///< ball: whether the angle is limited
  double twist[2], swing;           ///< rad, ball: range of the twist, largest swing
  double margin;                    ///< limit acts from this distance on
  cav_softness limit;               ///< softness of the limit
  double stiffness;                 ///< N m/rad or N/m
  double springref;                 ///< hinge and slide: q at rest of the spring
  /// Limit on what all actuators together do to a hinge or slide, N m or N (actuatorfrcrange of MJCF); the force ranges
  /// of those actuators are within it.
  int effort_limited;
  double effort_range[2]; ///< N or N m: what actuators on it may give together
  int driven;             ///< 1: an actuator works on it, itself or by a transmission that it moves
  int lifts;              ///< its actuators give the gravity compensation of what it carries (actuatorgravcomp of MJCF)
  double speed; ///< hinge and slide: limit in the file, rad/s or m/s, told in certificates, obeyed by nothing; 0: none
} cav_joint;

/// One degree of freedom, index into v.
typedef struct cav_dof {
  int link, joint;       ///< that it belongs to
  int parent;            ///< previous dof towards the root, -1 if none
  double damping;        ///< N m s/rad or N s/m
  double armature;       ///< kg m^2 or kg
  double frictionloss;   ///< N m or N, 0: none
  cav_softness friction; ///< of the friction loss
  double inverse_weight; ///< diagonal of M^-1 at q0, averaged over a ball's 3 and over 3+3 of a free joint
} cav_dof;

/// Convex hull of a mesh, about its centre of mass and principal axes: the frame of its geoms.
typedef struct cav_mesh {
  const char *name;     ///< as in the file
  int nvertex, nface;   ///< vertices and polygons
  const double *vertex; ///< [nvertex*3] m
  const double *plane;  ///< [nface*4] of each polygon: outward unit normal n and offset d, n x <= d inside
  const int *face;      ///< [nface+1] first entry of each polygon in corner
  const int *corner;    ///< [face[nface]] vertices, counterclockwise from outside
  const int *neighbour_start, *neighbour; ///< [nvertex+1], vertices across an edge from each
  const int *meeting_start, *meeting;     ///< [nvertex+1], faces that meet at each
  const int *summit;                      ///< vertex furthest along the middle of each cell of directions (direction.h)
  int npoint, ntriangle; ///< the file's own surface, of a model that is loaded for a viewer; 0: not kept
  const double *point;   ///< [npoint*3] m
  const int *triangle;   ///< [ntriangle*3] points, counterclockwise from outside
} cav_mesh;

/// Heights over a grid in the x-y plane, solid down to -base; x grows along columns, y along rows, both about 0.
typedef struct cav_hfield {
  const char *name;     ///< as in the file
  int nrow, ncol;       ///< grid
  double size[2];       ///< half lengths along x and y, m
  double top, base;     ///< m: largest height that elevation 1 stands for; depth below 0
  const double *height; ///< [nrow*ncol] m
} cav_hfield;

/// A shape that collides, or weighs, or is only seen.
typedef struct cav_geom {
  const char *name;         ///< as in the file; "" if it has no name
  cav_geom_type type;       ///< kind of shape
  int body, link;           ///< that it is fixed to
  int number;               ///< in its body, from 1, in the order of the file and with those that are left out
  double pos[3];            ///< in the link frame
  double quat[4];           ///< unit quaternion w x y z in the frame of its link
  double rotation[9];       ///< of quat, row-major
  double size[3];           ///< m, by type as in MJCF
  int asset;                ///< of a mesh or height field: index of its kind
  double bound;             ///< radius of the bounding sphere about pos; infinite for a plane
  int contype, conaffinity; ///< bits: a pair is tested if either one's contype meets the other's conaffinity
  int condim, priority;     ///< dimensions of its contacts; the pair takes the parameters of the higher priority
  double friction[3];       ///< sliding, torsional (m), rolling (m)
  double margin;            ///< m, adds to that of the other geom
  double solmix;            ///< weight of its softness in a pair
  cav_softness softness;    ///< of its contacts
  int fluid;                ///< 1: in a medium this geom is an ellipsoid, and its body no box
  double fluidcoef[5];      ///< drag blunt, slender, angular; lift of Kutta, of Magnus
  float rgba[4];            ///< colour, for pages
  int group;                ///< as in the file
} cav_geom;

/// A place on a body.
typedef struct cav_site {
  const char *name;   ///< as in the file
  int body, link;     ///< that it is fixed to
  double pos[3];      ///< in the link frame
  double quat[4];     ///< unit quaternion w x y z in the frame of its link
  cav_geom_type type; ///< shape of the zone of a touch sensor: sphere, capsule, ellipsoid, cylinder or box
  double size[3];     ///< m, by type as in MJCF
} cav_site;

/// Two geoms that may touch; everything mixed at compile time. Only pairs that can touch are listed.
typedef struct cav_pair {
  int geom1, geom2; ///< geom1's type <= geom2's type
  int dim;          ///< 1, 3, 4 or 6 rows
  int listed;       ///< 1: the file lists this pair, whatever masks say
  /// 1 but between links of one tree, of trees that equality constraints of joints, points or frames make one mechanism, and
  /// between a link and what a body of the world is made of from which its tree hangs, but planes and height fields.
  int external;
  double friction[5];    ///< two tangential, torsional (m), two rolling (m)
  double margin;         ///< m, distance below which the contact pushes
  cav_softness softness; ///< of its contacts
  double weight[2];      ///< reference diagonal of A: translation, rotation (sum of both bodies' inverse_weight)
} cav_pair;

/// One joint of a fixed tendon.
typedef struct cav_tendon_part {
  int joint;   ///< that it moves with
  double coef; ///< length of the tendon per rad or m of the joint
} cav_tendon_part;

/// What the path of a spatial tendon meets next.
typedef enum cav_tendon_path_type {
  CAV_TENDON_PATH_SITE,     ///< passes a site
  CAV_TENDON_PATH_SPHERE,   ///< around or through a sphere
  CAV_TENDON_PATH_CYLINDER, ///< around or through a cylinder
  CAV_TENDON_PATH_PULLEY    ///< a pulley divides it
} cav_tendon_path_type;
/// A point of the path of a spatial tendon.
typedef struct cav_tendon_path_point {
  cav_tendon_path_type type; ///< what the path meets there
  int object;                ///< site to pass through, or geom to wrap around
  int side;                  ///< geoms: site on the side to pass, or inside to come through; -1: the shorter way
  double divisor;            ///< pulleys: of the length of the branch that starts here
} cav_tendon_path_point;

/// Tendon. Fixed: length = sum coef q_joint. Spatial: length of the string along its path.
typedef struct cav_tendon {
  const char *name;          ///< as in the file
  int part, npart;           ///< fixed: range in model->tendon_part
  int path, npath;           ///< spatial: range in model->tendon_path; npath is 0 for a fixed one
  int dof, ndof;             ///< range in model->tendon_dof: what can change its length
  int limited;               ///< whether its length is limited
  double range[2];           ///< m or rad: of its length
  double margin;             ///< m or rad: distance from the range at which the limit becomes active
  cav_softness limit;        ///< softness of the limit
  double stiffness, damping; ///< N/m and N s/m, of a fixed one per unit of its length
  double springlength[2];    ///< the spring is slack between these lengths, m or rad
  double frictionloss;       ///< N: dry friction
  cav_softness friction;     ///< softness of the dry friction
  double inverse_weight;     ///< J M^-1 J' at q0
} cav_tendon;

/// Kinds of equality constraints.
typedef enum cav_equality_type {
  CAV_EQUALITY_CONNECT, ///< two points of two bodies are one
  CAV_EQUALITY_WELD,    ///< two frames of two bodies are one
  CAV_EQUALITY_JOINT,   ///< q1 - r1 = polynomial of q2 - r2
  CAV_EQUALITY_TENDON,  ///< the same of two lengths
  CAV_EQUALITY_DISTANCE ///< two geoms are that far apart
} cav_equality_type;

/// Constraint that holds always, softly: error x -> 0. Todorov 2014, eqs. (5)-(7).
typedef struct cav_equality {
  const char *name;       ///< as in the file; "" if it has no name
  cav_equality_type type; ///< kind of constraint
  int dim;                ///< rows: connect 3, weld 6, others 1
  int object[2];          ///< bodies, joints, tendons or geoms; the second joint or tendon may be -1: none
  int placed;             ///< connect, weld: both points and frames are the file's own (sites), not those of q0
  int link[2];            ///< of bodies and geoms
  double pos[2][3];       ///< connect, weld: the points that are one, each in its link's frame, m
  double quat[2][4];      ///< weld: the frames that are one, each in its link's frame
  double torquescale;     ///< weld: length per sine of half the angle between the frames, m
  double reference[2];    ///< joint, tendon: r, the values at q0
  double coef[5];         ///< joint, tendon: of the polynomial, constant first
  double distance;        ///< m
  cav_softness softness;  ///< of the constraint
  double weight[2];       ///< reference diagonals of A: of all rows, but of a weld's rotation
} cav_equality;

enum { CAV_ACTUATOR_PARAMETERS = 10 }; ///< most parameters of a law

/// Actuator: force = gain(length, velocity) input + bias(length, velocity), clamped; its fraction of u is force times
/// the moments of its transmission. What is planned with is its effort: u = sum unit effort moment. A motor (fixed
/// gain, no bias) has its gain as unit, so effort is the control; for every other one the unit is 1 and effort is the
/// force, of which bias is a part, as the servo's pull towards its target: a law of control, not a passive force of the
/// model.
typedef struct cav_actuator {
  const char *name;              ///< as in the file
  cav_transmission transmission; ///< what it acts on
  int target;                    ///< joint, tendon, site, or site of the crank
  int reference;                 ///< site of reference, or of the slider; -1 for none
  int constant;                  ///< 1 if the moments do not depend on q
  double gear[6]; ///< gear[0] for scalar joints, tendons and cranks; ball (3); free joint and site (6): force, torque
  double cranklength;             ///< m
  cav_activation activation;      ///< law of its activation
  cav_gain gain;                  ///< law of its gain
  cav_bias bias;                  ///< law of its bias
  double activation_parameter[3]; ///< of the law of the activation
  double gain_parameter
      [CAV_ACTUATOR_PARAMETERS]; ///< fixed: [0]; affine: constant, per length, per velocity; muscle: MJCF's
  double bias_parameter[CAV_ACTUATOR_PARAMETERS]; ///< of the law of the bias
  double unit;                                    ///< force of one unit of effort
  int ctrllimited, forcelimited, actlimited;      ///< whether control, force and activation are limited
  double ctrlrange[2];                            ///< range of the control
  double forcerange[2];                           ///< in units of effort
  double actrange[2];                             ///< of an integrated activation
  double lengthrange[2];                          ///< muscles: shortest and longest transmission
  double acceleration;                            ///< |M^-1 moments| at q0, what a unit force causes
} cav_actuator;

/// A sensor of the model, or one that a problem declares.
typedef struct cav_sensor {
  const char *name;               ///< as in the file; "" of a declared one
  cav_sensor_type type;           ///< what it reads
  cav_object_type object_type;    ///< kind of the object that it looks at
  int object;                     ///< index of that kind
  int dim;                        ///< length of its reading
  int adr;                        ///< first index in the vector of all readings
  int referred;                   ///< frame sensors: 1 if readings are in the frame of the following object
  cav_object_type reference_type; ///< a kind with a frame
  int reference;                  ///< number of the object of reference_type in whose frame it reads
  double cutoff; ///< values beyond are cut to it, both ways; 0: not cut. Never cuts axes and quaternions
} cav_sensor;

/// A keyframe.
typedef struct cav_key {
  const char *name; ///< as in the file
  double time;      ///< s, as in the file
  const double *q;  ///< [nq]
  const double *v;  ///< [nv]
} cav_key;

/// A member of a struct of options, as the table of that struct declares it: what may stand there.
typedef enum cav_field_type {
  CAV_FIELD_REAL,  ///< a double
  CAV_FIELD_WHOLE, ///< an int
  CAV_FIELD_FLAG,  ///< an int, 0 or 1
  CAV_FIELD_WORD   ///< an enumeration
} cav_field_type;

/// A member of a struct with a table: its type, place, range and meaning.
typedef struct cav_field {
  const char *name;         ///< of the member, and of its attribute in problem files
  cav_field_type type;      ///< its type
  size_t offset;            ///< of a double; of an int or an enumeration
  double least, most;       ///< of numbers and words; least DBL_MIN: above 0
  const char *const *words; ///< of a word, by enumerator; NULL at the end
  const char *unit, *text;  ///< of its value, "" if it has none; what it means
} cav_field;

/// Which velocity the bias force c and the passive force p are evaluated at, or what takes their place;
/// dynamics/METHOD.md, 2. X(enumerator, word, text), as all lists of words.
// clang-format off
#define CAV_ORDERS(X)                                                                                              \
  X(CAV_ORDER_EULER, "euler", "at v; joint damping at v_next (implicit). The paper's step")                        \
  X(CAV_ORDER_MIDPOINT, "midpoint", "at (v + v_next)/2, damping too; second order where it matters")               \
  X(CAV_ORDER_MOMENTUM, "momentum", "as midpoint, but the rows of a root link balance the momentum of its tree half a step before and after: exact in flight")

/// Where springs of joints and tendons act, stiffness above 0: their stretch x there by its rate at q;
/// dynamics/METHOD.md, 12.
#define CAV_SPRINGS(X)                                                                                             \
  X(CAV_SPRING_EXPLICIT, "explicit", "at q: a step of sqrt(2) (euler) over their frequency and more explodes")    \
  X(CAV_SPRING_IMPLICIT, "implicit", "at x + h x'(v_next) under euler, which damps them; at x + h (x'(v_next) - x'(v))/4 under the other orders, which keeps their energy. Stable at any stiffness")

/// How v* is made from a constraint's position error; dynamics/METHOD.md, 4.
#define CAV_STABILISATIONS(X)                                                                                      \
  X(CAV_STABILISATION_SOLREF, "solref", "eq. (28) from each constraint's solref and solimp, as MuJoCo does")       \
  X(CAV_STABILISATION_DISCRETE, "discrete", "critically damped discrete step with double pole exp(-h/time_constant), one softness for all")

/// Diagonal of A that scales the regulariser R (27).
#define CAV_REGULARISERS(X)                                                                                        \
  X(CAV_REGULARISER_REFERENCE, "reference", "constants of the configuration q0: smooth in q, cheap, MuJoCo's")     \
  X(CAV_REGULARISER_EXACT, "exact", "of J M_hat^-1 J' at q, the paper's: factors the inertia in every evaluation")

/// What a contact obeys that slides; dynamics/METHOD.md, 9.
#define CAV_SLIDINGS(X)                                                                                            \
  X(CAV_SLIDING_CONVEX, "convex", "the paper's law: held off by h mu times the slip")                              \
  X(CAV_SLIDING_COULOMB, "coulomb", "Coulomb's: gap and force complementary at any slip")

/// The gap after the step that the normal row of a contact sees; dynamics/METHOD.md, 10.
#define CAV_NEXT_GAPS(X)                                                                                           \
  X(CAV_NEXT_GAP_LINEAR, "linear", "the paper's: gap + h n.v_next, off by h^2 where links turn")                   \
  X(CAV_NEXT_GAP_EXACT, "exact", "that of the same point at q (+) h v_next: one more placement of links and contacts")

/// The slip of a contact that its tangential rows see; dynamics/METHOD.md, 13.
#define CAV_NEXT_SLIPS(X)                                                                                        \
  X(CAV_NEXT_SLIP_LINEAR, "linear", "the paper's: J v_next at q, off by h/2 of the point's acceleration where links turn") \
  X(CAV_NEXT_SLIP_EXACT, "exact", "the way of the point to q (+) h v_next over h: one more placement of links")

/// How constraints are evaluated: REAL(stage, name, least, most, required, unit, text), WORD(stage, name, type, words,
/// text) and FLAG(stage, name, text), which is 0 or 1. stage: the first stage of an evaluation that depends on it,
/// which is not reused after a change. required: of a recorded law (<contact> of a problem file). The struct, the
/// comparison, the checks, and reading, writing, grammar and help of <contact> follow from this list.
#define CAV_OPTIONS(REAL, WORD, FLAG)                                                                              \
  REAL(POSITION, timestep, DBL_MIN, DBL_MAX, 1, "s", "h: starts as the model's; every evaluation uses this one")   \
  WORD(VELOCITY, order, cav_order, CAV_ORDERS, "velocity of the bias and passive forces")                          \
  WORD(POSITION, spring, cav_spring, CAV_SPRINGS, "where springs of joints and tendons act")                       \
  WORD(POSITION, stabilisation, cav_stabilisation, CAV_STABILISATIONS, "how v* follows from the position error")   \
  WORD(POSITION, regulariser, cav_regulariser, CAV_REGULARISERS, "diagonal of A that scales R")                    \
  WORD(VELOCITY, sliding, cav_sliding, CAV_SLIDINGS, "law of contacts that slide")                                 \
  WORD(VELOCITY, next_gap, cav_next_gap, CAV_NEXT_GAPS, "gap after the step that contacts see")                    \
  WORD(VELOCITY, next_slip, cav_next_slip, CAV_NEXT_SLIPS, "slip over the step that contacts see")                 \
  REAL(POSITION, softness, DBL_MIN, DBL_MAX, 1, "", "epsilon of the discrete stabilisation")                       \
  REAL(POSITION, time_constant, 0, DBL_MAX, 1, "s", "kappa of the discrete stabilisation; 0: deadbeat")            \
  REAL(POSITION, smoothing, 0, DBL_MAX, 1, "m", "delta: distance at which the smoothed law is active; 0: the exact law (dynamics/METHOD.md, 3)") \
  REAL(POSITION, smoothing_self, 0, DBL_MAX, 1, "m", "delta between two links of one tree, used where smoothing > 0") \
  REAL(POSITION, self_stiffness, DBL_MIN, 1, 0, "", "fraction of their stiffness that contacts between two links of one tree get; 1: the law") \
  REAL(POSITION, saturation, 0, DBL_MAX, 0, "m", "depth beyond which the smoothed law's contacts with the world grow no stiffer, and fade out where round geoms are in solids; 0: never") \
  REAL(POSITION, impratio, DBL_MIN, DBL_MAX, 1, "", "R_normal / R_friction")                                       \
  FLAG(POSITION, stops, "1: the step after which nothing moves: friction acts by the velocity before it too, since what friction holds creeps by that (dynamics/METHOD.md, 4)") \
  FLAG(POSITION, coupled, "1: B and K dense, so that all rows together are critically damped; costs a factorisation") \
  FLAG(POSITION, refsafe, "1: keep solref time constants >= 2 h")                                                  \
  FLAG(POSITION, contact, "0: no contacts")                                                                        \
  FLAG(POSITION, constraint, "0: no equality constraints, limits, friction loss or contacts")                      \
  FLAG(VELOCITY, gravity, "0: none")                                                                               \
  FLAG(VELOCITY, passive, "0: no springs and dampers")
// clang-format on

#define CAV_WORD_MEMBER(enumerator, word, text) enumerator,
/// Order of the step: CAV_ORDERS.
typedef enum cav_order { CAV_ORDERS(CAV_WORD_MEMBER) } cav_order;
/// Where springs act: CAV_SPRINGS.
typedef enum cav_spring { CAV_SPRINGS(CAV_WORD_MEMBER) } cav_spring;
/// How position errors are undone: CAV_STABILISATIONS.
typedef enum cav_stabilisation { CAV_STABILISATIONS(CAV_WORD_MEMBER) } cav_stabilisation;
/// Scale of the regulariser: CAV_REGULARISERS.
typedef enum cav_regulariser { CAV_REGULARISERS(CAV_WORD_MEMBER) } cav_regulariser;
/// Law of contacts that slide: CAV_SLIDINGS.
typedef enum cav_sliding { CAV_SLIDINGS(CAV_WORD_MEMBER) } cav_sliding;
/// Gap after the step: CAV_NEXT_GAPS.
typedef enum cav_next_gap { CAV_NEXT_GAPS(CAV_WORD_MEMBER) } cav_next_gap;
/// Slip over the step: CAV_NEXT_SLIPS.
typedef enum cav_next_slip { CAV_NEXT_SLIPS(CAV_WORD_MEMBER) } cav_next_slip;
#undef CAV_WORD_MEMBER

/// A state starts with the model's; change state->options between calls at will.
typedef struct cav_options {
#define CAV_REAL_MEMBER(stage, name, ...) double name;
#define CAV_WORD_MEMBER(stage, name, type, ...) type name;
#define CAV_FLAG_MEMBER(stage, name, text) int name;
  CAV_OPTIONS(CAV_REAL_MEMBER, CAV_WORD_MEMBER, CAV_FLAG_MEMBER)
#undef CAV_REAL_MEMBER
#undef CAV_WORD_MEMBER
#undef CAV_FLAG_MEMBER
} cav_options;

/// The table of cav_options; its length in *n.
CAV_API const cav_field *cav_option_fields(int *n);

/// CAV_BAD_INPUT, with the member at fault and what it may be in error (may be NULL), if an option is outside the
/// table. Evaluations refuse such options with the same status.
CAV_API cav_status cav_options_check(const cav_options *options, cav_error *error);

/// The same of any struct by its table of n fields; what: how the text calls it.
CAV_API cav_status cav_fields_check(const cav_field *field, int n, const void *values, const char *what,
                                    cav_error *error);

/// Arrays of a model, X(type, name, number): the members and their place in the model's memory follow from this list.
#define CAV_MODEL_ARRAYS(X)                                       \
  X(cav_body, body, nbody)                                        \
  X(cav_link, link, nlink)                                        \
  X(cav_joint, joint, njoint)                                     \
  X(cav_dof, dof, nv)                                             \
  X(cav_geom, geom, ngeom)                                        \
  X(cav_site, site, nsite)                                        \
  X(cav_pair, pair, npair)                                        \
  X(cav_tendon, tendon, ntendon)                                  \
  X(cav_tendon_part, tendon_part, ntendon_part)                   \
  X(cav_tendon_path_point, tendon_path, ntendon_path)             \
  X(int, tendon_dof, ntendon_dof) /* indices into v, by tendon */ \
  X(cav_equality, equality, nequality)                            \
  X(cav_actuator, actuator, nactuator)                            \
  X(cav_sensor, sensor, nsensor)                                  \
  X(cav_key, key, nkey)                                           \
  X(double, q0, nq) /* configuration of the file, where reference quantities are taken */

/// A compiled model. Built by cav_model_load; nothing but cav_model_perturb changes it, before any state of it exists.
typedef struct cav_model {
  const char *name;                   ///< as in the file
  int nq, nv, nu;                     ///< sizes of q, v and of the control vector (one per actuator)
  double timestep;                    ///< s, of the file: where options.timestep starts, which evaluations use
  double gravity[3];                  ///< m/s^2
  double density, viscosity, wind[3]; ///< of the medium: kg/m^3, kg/(m s), m/s; both 0: none
  double magnetic[3];                 ///< field that magnetometers read, world
  cav_options options;                ///< defaults for new states

  int nbody, nlink, njoint, ngeom, nsite, npair;        ///< sizes of the arrays below
  int ntendon, ntendon_part, ntendon_path, ntendon_dof; ///< sizes of the arrays below
  int nequality, nactuator, nsensor, nkey, nwarning;    ///< sizes of the arrays below
  int nmesh, nhfield;                                   ///< sizes of the arrays below
  int fused;       ///< 1: bodies without joints take the reference weights of the link they are part of
  int nsensordata; ///< length of the vector of all readings
#define CAV_ARRAY_MEMBER(type, name, count) const type *name;
  CAV_MODEL_ARRAYS(CAV_ARRAY_MEMBER)
#undef CAV_ARRAY_MEMBER
  const cav_mesh *mesh;       ///< [nmesh]
  const cav_hfield *hfield;   ///< [nhfield]
  const char *const *warning; ///< what the file asks for and this version leaves aside, with file and line
  double mass;                ///< kg, of all that moves
  size_t bytes;               ///< memory of the model
} cav_model;

/// What to read of a file beyond what its dynamics need.
typedef struct cav_load_options {
  int visual; ///< 1: geometry that can neither touch nor weigh too, and the surfaces of meshes, for a viewer
  int floating; ///< 1: the root link of a URDF floats (joint "root"); 0: it stands in the world unless the file says otherwise
  int overlaps; ///< 1: pairs of geoms of one robot that overlap at rest are left out, and told in a warning
} cav_load_options;

/// What cav_model_load takes.
CAV_API cav_load_options cav_load_options_default(void);

/// cav_model_load with options.
CAV_API cav_model *cav_model_load_with(const char *path, const cav_load_options *options, cav_error *error);

/// Loads an MJCF or URDF file, told apart by the root element, with its includes and assets. NULL on failure with the
/// reason in error (may be NULL). What is understood but not used becomes a model->warning. The result is freed with
/// cav_model_free.
CAV_API cav_model *cav_model_load(const char *path, cav_error *error);

/// The same of a text, MJCF or URDF, in the place of a file: meshes and other files that it names are sought from folder
/// (NULL: the current one), complaints are of "FOLDER/text" with its lines. options NULL: the default ones.
CAV_API cav_model *cav_model_parse(const char *text, const char *folder, const cav_load_options *options,
                                   cav_error *error);

/// A model in the making: MJCF's elements, made in code. What a draft may hold is what a file may hold; cavort checks it
/// when it is compiled, and the model has the bits of the same MJCF in a file. One thread.
typedef struct cav_draft cav_draft;

/// Elements that every draft has: <mujoco>, which holds the sections (actuator, tendon, sensor, keyframe, option, ...), and
/// <worldbody>, which holds bodies.
enum {
  CAV_DRAFT_ROOT, ///< <mujoco>
  CAV_DRAFT_WORLD ///< <worldbody>
};

/// An empty model of that name (NULL: "model"), angles in radians; NULL if memory runs out.
CAV_API cav_draft *cav_draft_new(const char *name);
CAV_API void cav_draft_free(cav_draft *draft);

/// Puts an element into another (body, joint, freejoint, geom, site, motor, ... as in MJCF) after those that it has.
/// Returns its number, with which it is given attributes and elements of its own. -1 after any failure, which
/// cav_draft_compile tells, so results need no check.
CAV_API int cav_draft_add(cav_draft *draft, int parent, const char *element);

/// Gives an element an attribute, in the place of one of that name: a text (names, words, "true"), or n numbers, written with
/// 17 digits. Units as in MJCF: m, kg, rad, N.
CAV_API void cav_draft_text(cav_draft *draft, int element, const char *attribute, const char *value);
CAV_API void cav_draft_numbers(cav_draft *draft, int element, const char *attribute, const double *value, int n);

/// The draft as MJCF, which a file may hold, until it is written or compiled again or freed; NULL after a failure.
CAV_API const char *cav_draft_mjcf(cav_draft *draft);

/// The model, as cav_model_parse of that text, in which lines of complaints are. The draft stays, and may grow further.
CAV_API cav_model *cav_draft_compile(cav_draft *draft, const char *folder, const cav_load_options *options,
                                     cav_error *error);

/// The model as the text of an MJCF file: bodies, joints, geoms, sites, masses and keyframes as the model has them now,
/// all else as the MJCF file says that it was loaded from, path. Of memory from malloc; NULL on failure with the reason in
/// error (may be NULL): CAV_NOT_SUPPORTED (not MJCF, meshes, height fields, copied bodies), CAV_BAD_INPUT, CAV_NO_MEMORY.
CAV_API char *cav_model_mjcf(const cav_model *model, const char *path, cav_error *error);

/// Frees a model; NULL is fine. No state of it may be used afterwards.
CAV_API void cav_model_free(cav_model *model);

/// Changes a model before any state of it exists: mass and inertia of link i times mass_scale[i] ([nlink], > 0; NULL:
/// as they are), sliding friction of every contact (0: as it is); what the model derives from them follows.
/// CAV_BAD_INPUT: a scale that is not positive, a negative friction, nothing changed; CAV_NO_MEMORY: do not use the
/// model.
CAV_API cav_status cav_model_perturb(cav_model *model, const double *mass_scale, double friction);

/// Single numbers of a model that may be unknown (cavort/estimate.h), X(kind, word, of, components, unit, text): of three
/// components each coordinate is a parameter, of any sign.
// clang-format off
#define CAV_PARAMETERS(X)                                                                                          \
  X(MASS, "mass", BODY, 1, "kg", "mass of a body; its moments of inertia go with it, its shape stays")             \
  X(COM, "com", BODY, 3, "m", "a coordinate of a body's centre of mass in its own frame: component 0, 1 or 2")     \
  X(INERTIA, "inertia", BODY, 1, "kg m^2", "largest principal moment of inertia of a body; the others go with it") \
  X(FRICTION, "friction", GEOM, 1, "", "coefficient of sliding friction in all contacts of a geom")                \
  X(STIFFNESS, "stiffness", JOINT, 1, "N m/rad or N/m", "stiffness of a joint's spring")                           \
  X(DAMPING, "damping", JOINT, 1, "N m s/rad or N s/m", "damping of a joint, in all its dofs")                      \
  X(ARMATURE, "armature", JOINT, 1, "kg m^2 or kg", "inertia that a joint adds to what it moves, in all its dofs") \
  X(PLACE, "place", SITE, 3, "m", "a coordinate of a site in its body's frame, of a marker or an IMU: component 0, 1 or 2")
// clang-format on

/// Kinds of parameters: CAV_PARAMETERS.
typedef enum cav_parameter_kind {
#define CAV_PARAMETER_MEMBER(kind, ...) CAV_PARAMETER_##kind,
  CAV_PARAMETERS(CAV_PARAMETER_MEMBER)
#undef CAV_PARAMETER_MEMBER
      CAV_PARAMETER_KINDS
} cav_parameter_kind;

/// What holds for all parameters of a kind.
typedef struct cav_parameter_rule {
  const char *name;   ///< its type in problem files
  cav_object_type of; ///< what it is a number of: BODY, GEOM, JOINT or SITE
  int components;     ///< 1, or 3: x, y and z
  const char *unit;   ///< of its value; "" has none
  const char *text;   ///< what it is
} cav_parameter_rule;

/// kind < CAV_PARAMETER_KINDS.
CAV_API const cav_parameter_rule *cav_parameter_rule_of(cav_parameter_kind kind);

/// A number that is not known. What the model has is where the search begins.
typedef struct cav_parameter {
  const char *name;        ///< for tables; NULL or "": what cav_parameter_label makes of kind and object
  cav_parameter_kind kind; ///< what it is
  int object;              ///< body, geom, joint or site that it is of
  int component;           ///< of COM and PLACE: 0 x, 1 y, 2 z
  double prior[2];         ///< mean and standard deviation of what is known beforehand; deviation 0: nothing
  double range[2];         ///< within which it is sought, infinite where open; both 0: open
} cav_parameter;

enum { CAV_PARAMETER_LABEL = 160 }; ///< room for a label

/// Name of a parameter, or where it has none "mass of BODY", written into label.
CAV_API const char *cav_parameter_label(const cav_model *model, const cav_parameter *parameter,
                                        char label[CAV_PARAMETER_LABEL]);

/// A parameter as the model has it, and another value in its place before any state of the model exists; what the model
/// derives from it follows. CAV_BAD_INPUT: there is no such object, or no such value (a mass that is not positive, a
/// negative friction, stiffness or damping), nothing changed; CAV_NO_MEMORY: do not use the model.
CAV_API double cav_model_parameter(const cav_model *model, const cav_parameter *parameter);
CAV_API cav_status cav_model_set_parameter(cav_model *model, const cav_parameter *parameter, double value);

/// n of them, value [n], in the order of their kinds, since some follow others (moments of inertia the mass).
CAV_API cav_status cav_model_set_parameters(cav_model *model, int n, const cav_parameter *parameter,
                                            const double *value);

enum { CAV_GEOM_LABEL = 96 }; ///< room for a label

/// Name of a geom, or where it has none "geom 2 of BODY", by its number in its body, written into label.
CAV_API const char *cav_geom_label(const cav_model *model, int geom, char label[CAV_GEOM_LABEL]);

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
