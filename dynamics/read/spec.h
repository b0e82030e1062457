/// A model as its file describes it, between reading (mjcf.c) and compiling (mass.c, filter.c, compile.c). Private.
/// Lists are in the model's final order: bodies depth first, the objects of a body together, the rest as written.
/// Angles are radians, poses are relative to the body (of a body: to its parent), defaults are applied. References are
/// names until cav_compile resolves them. Texts belong to the tree of nodes, which outlives the spec.
#ifndef CAVORT_SPEC_H
#define CAVORT_SPEC_H

#include "cavort/model.h"
#include "hull.h"
#include "mesh.h"
#include "xml.h"

/// Whether a limit holds, as the file says.
typedef enum cav_limited { CAV_LIMITED_NO, CAV_LIMITED_YES, CAV_LIMITED_AUTO } cav_limited;

/// Mass, centre of mass and principal axes and moments in the body's (or geom's) frame.
typedef struct cav_spec_inertia {
  double mass, com[3], quat[4], moment[3];
} cav_spec_inertia;

typedef struct cav_spec_body {
  const char *name;
  const cav_xml_node *node;
  int parent;
  double pos[3], quat[4];
  int joint, njoint, geom, ngeom;
  double gravcomp;
  int geoms;        ///< elements so far, those left out too
  int has_inertial; ///< the file gives inertia explicitly
  double full[6];   ///< fullinertia where has_full: xx yy zz xy xz yz
  int has_full;
  cav_spec_inertia inertia; ///< explicit, or computed by mass.c
} cav_spec_body;

typedef struct cav_spec_joint {
  const char *name;
  const cav_xml_node *node;
  int body;
  cav_joint_type type;
  double pos[3], axis[3], ref, springref, range[2], margin, speed;
  cav_limited limited;
  double twist[2], swing; ///< ball: the cylinder, where has_twist and has_swing
  int has_twist, has_swing;
  cav_softness limit, friction;
  double stiffness, damping, armature, frictionloss, springdamper[2];
  cav_limited effort; ///< whether effort_range holds, of the sum of what actuators do to the joint
  double effort_range[2];
  int gravcomp; ///< compensation of weight is part of what actuators do
} cav_spec_joint;

typedef struct cav_spec_geom {
  const char *name;
  const cav_xml_node *node;
  int number; ///< in its body, from 1
  int body, type;
  double pos[3], quat[4], size[3], fromto[6];
  int has_fromto;
  int contype, conaffinity, condim, priority, group;
  double friction[3], margin, solmix, mass, density;
  int has_mass, shell;
  double fitscale;
  cav_softness softness;
  double rgba[4];
  const char *material, *mesh, *hfield;
  int fluid; ///< an ellipsoid to the medium
  double fluidcoef[5];
  int asset;                ///< mesh or height field in its list
  int weighs;               ///< its mass counts in its body's
  double bound;             ///< of a mesh or height field: radius of the bounding sphere
  cav_spec_inertia inertia; ///< of the shape, by mass.c; com is pos
} cav_spec_geom;

/// A mesh as asked for; from index on filled by asset.c where a geom uses it.
typedef struct cav_spec_mesh {
  const char *name;
  const cav_xml_node *node;
  const char *path; ///< NULL: vertex and face
  const cav_xml_value *vertex, *face;
  double scale[3], refpos[3], refquat[4];
  cav_mesh_inertia inertia;
  int hull_vertices; ///< at most; below 4: all
  int builtin, loaded;
  int index;                              ///< in the model; -1: no geom uses it
  double volume, moment[3];               ///< moments of inertia of density 1
  double pos[3], quat[4], half[3], bound; ///< centre of mass and principal axes; its box and sphere about these
  double low[3], high[3];                 ///< its box, not about the centre
  cav_hull hull;
  cav_triangles surface; ///< as the file gives it, about its own frame, for a viewer; empty where that is not asked for
} cav_spec_mesh;

typedef struct cav_spec_hfield {
  const char *name;
  const cav_xml_node *node;
  const char *path; ///< NULL: elevation, or level
  const cav_xml_value *elevation;
  int nrow, ncol, index;
  double size[4]; ///< half lengths along x and y, height, depth of the base
  double *height; ///< [nrow*ncol] m; of malloc
} cav_spec_hfield;

typedef struct cav_spec_site {
  const char *name;
  const cav_xml_node *node;
  int body;
  double pos[3], quat[4], fromto[6], size[3];
  int has_fromto, type;
} cav_spec_site;

/// Explicit pair: its own parameters, nothing is taken from the two geoms.
typedef struct cav_spec_pair {
  const cav_xml_node *node;
  const char *geom1, *geom2;
  int condim;
  double friction[5], margin;
  cav_softness softness;
} cav_spec_pair;

typedef struct cav_spec_exclude {
  const cav_xml_node *node;
  const char *body1, *body2;
} cav_spec_exclude;

typedef struct cav_spec_part {
  const cav_xml_node *node;
  const char *joint;
  double coef;
} cav_spec_part;

/// Element of a path; a geom is CAV_PATH_SPHERE until cav_spec_tendon_paths has found its shape.
typedef struct cav_spec_tendon_path {
  const cav_xml_node *node;
  cav_tendon_path_type type;
  const char *name, *sidesite; ///< sidesite: NULL for none
  double divisor;
  int object, side; ///< by cav_spec_tendon_paths
} cav_spec_tendon_path;

typedef struct cav_spec_tendon {
  const char *name;
  const cav_xml_node *node;
  int spatial, part, npart, path, npath;
  cav_limited limited;
  double range[2], margin, stiffness, damping, armature, frictionloss, springlength[2];
  int has_springlength;
  cav_softness limit, friction;
  cav_limited effort; ///< whether effort_range holds, of the sum of what actuators do to it
  double effort_range[2];
} cav_spec_tendon;

typedef struct cav_spec_equality {
  const char *name;
  const cav_xml_node *node;
  cav_equality_type type;
  const char *object[2]; ///< NULL: none, or the world
  int sites;             ///< the objects are sites
  int active;
  double anchor[3], relpose[7], torquescale, polycoef[5], distance;
  cav_softness softness;
} cav_spec_equality;

enum { CAV_SPEC_ACTUATOR_PARAMETERS = CAV_ACTUATOR_PARAMETERS };

typedef struct cav_spec_actuator {
  const char *name;
  const cav_xml_node *node;
  cav_transmission transmission;
  const char *target_kind, *target, *reference_kind, *reference; ///< attributes and what they name; NULL: no reference
  cav_limited ctrllimited, forcelimited, actlimited;
  double ctrlrange[2], forcerange[2], actrange[2], lengthrange[2], gear[6], cranklength, armature, damping[3];
  double inherit; ///< > 0: the range of its control is that of its joint or tendon times this, about the middle
  int integrates; ///< that of its activation instead
  int group;
  int activation, gain, bias; ///< words of the file, in the order of the enumerations; one more is "user"
  double dynprm[CAV_SPEC_ACTUATOR_PARAMETERS], gainprm[CAV_SPEC_ACTUATOR_PARAMETERS],
      biasprm[CAV_SPEC_ACTUATOR_PARAMETERS];
} cav_spec_actuator;

typedef struct cav_spec_sensor {
  const char *name;
  const cav_xml_node *node;
  cav_sensor_type type;
  cav_object_type object_type, reference_type;
  const char *object, *reference; ///< names; NULL: none
  double cutoff;
} cav_spec_sensor;

typedef struct cav_spec_key {
  const char *name;
  const cav_xml_node *node;
  double time;
  int nq, nv; ///< values given; 0: none
  const double *q, *v;
} cav_spec_key;

typedef struct cav_spec_compiler {
  int degree, autolimits, balance, from_geoms; ///< from_geoms, autolimits: 0 no, 1 yes, 2 not said
  int group_range[2];
  double bound_mass, bound_inertia, total_mass;
  int fit_box, align_free;
  int repair; ///< moments of inertia that no solid has are mended or let pass, with a warning
  char euler[4];
  int exact_mesh;          ///< volume of meshes by signed sums
  int fuse;                ///< bodies that move as one take the reference weights of the whole
  int strip;               ///< of a mesh's path only the name counts
  const char *mesh_folder; ///< never NULL
} cav_spec_compiler;

/// A file that another one attaches: what its nodes, whose part counts from 1, are read by.
typedef struct cav_spec_part_of_file {
  const char *path, *prefix;
  cav_spec_compiler compiler;
  int class; ///< its outermost class of defaults, by defaults.c
} cav_spec_part_of_file;

typedef enum cav_collision { CAV_COLLISION_ALL, CAV_COLLISION_PAIRS, CAV_COLLISION_GEOMS } cav_collision;

typedef struct cav_spec_option {
  double timestep, gravity[3], density, viscosity, wind[3], magnetic[3], impratio;
  cav_collision collision;
  int constraint, equality, frictionloss, limit, contact, spring, damper, weight, clamp, filter_parent, refsafe,
      override; ///< flags
  double o_margin, o_friction[5];
  cav_softness o_softness;  ///< of every contact where override is set
  unsigned disabled_groups; ///< of actuators, one bit each
} cav_spec_option;

/// Something that is left aside or not offered, said once however often it occurs.
typedef struct cav_spec_note {
  const cav_xml_node *node; ///< of the first
  const char *attribute, *text;
  int count, lacking; ///< lacking: the file cannot be read without it
} cav_spec_note;

/// A growing list of one kind.
#define CAV_SPEC_LIST(type) \
  struct {                  \
    type *at;               \
    int n, room;            \
  }

typedef struct cav_spec {
  const char *name;
  const cav_xml *xml;
  cav_error *error;
  cav_status status; ///< of the first failure; everything stops at it
  cav_load_options load;
  const cav_xml_node *scene; ///< what is added to the world, NULL: nothing
  int own_bodies;            ///< bodies before those of the scene, the world included
  cav_spec_compiler compiler;
  cav_spec_option option;
  CAV_SPEC_LIST(cav_spec_body) body;
  CAV_SPEC_LIST(cav_spec_joint) joint;
  CAV_SPEC_LIST(cav_spec_geom) geom;
  CAV_SPEC_LIST(cav_spec_mesh) mesh;
  CAV_SPEC_LIST(cav_spec_hfield) hfield;
  CAV_SPEC_LIST(cav_spec_site) site;
  CAV_SPEC_LIST(cav_spec_pair) pair;
  CAV_SPEC_LIST(cav_spec_exclude) exclude;
  CAV_SPEC_LIST(cav_spec_tendon) tendon;
  CAV_SPEC_LIST(cav_spec_part) part;
  CAV_SPEC_LIST(cav_spec_tendon_path) path;
  CAV_SPEC_LIST(cav_spec_equality) equality;
  CAV_SPEC_LIST(cav_spec_actuator) actuator;
  CAV_SPEC_LIST(cav_spec_sensor) sensor;
  CAV_SPEC_LIST(cav_spec_key) key;
  CAV_SPEC_LIST(char *) warning;
  CAV_SPEC_LIST(cav_spec_note) note;
  CAV_SPEC_LIST(char *) kept;      ///< texts made while reading
  CAV_SPEC_LIST(cav_xml *) others; ///< files that are attached
  CAV_SPEC_LIST(cav_spec_part_of_file) parts;
} cav_spec;

enum {
  CAV_SPEC_OBJECTS = 65536, ///< most objects of one kind
  CAV_SPEC_GRID = 4096,     ///< most points along a side of a height field
  CAV_SPEC_DOFS = 5000,     ///< most degrees of freedom
  CAV_SPEC_PAIRS = 2000000  ///< most pairs that may touch
};

/// Compiler settings that an element is read by.
static inline const cav_spec_compiler *cav_compiler_of(const cav_spec *spec, const cav_xml_node *node) {
  return node->part ? &spec->parts.at[node->part - 1].compiler : &spec->compiler;
}

/// spec.c: lists and complaints.

/// Room for one more at the end of a list, zeroed; NULL after a failure, which it notes. spec is the owner.
#define CAV_SPEC_PUSH(spec, list)                                                             \
  (cav_spec_grow((spec), (void **)&(list)->at, &(list)->n, &(list)->room, sizeof *(list)->at) \
       ? &(list)->at[(list)->n - 1]                                                           \
       : NULL)
int cav_spec_grow(cav_spec *spec, void **at, int *n, int *room, size_t size);

/// Room for a text that lives as long as the spec; NULL after a failure.
char *cav_spec_keep_text(cav_spec *spec, size_t size);

/// Notes the first failure, with file, line and element; later ones are ignored.
void cav_spec_fail(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *format, ...)
    __attribute__((format(printf, 4, 5)));
void cav_spec_no_memory(cav_spec *spec);

/// Adds a warning, with file, line and element.
void cav_spec_warn(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/// Notes what is left aside, or cannot be (lacking), by a text that lives as long as the spec: equal texts become one
/// warning with a count, and all that is lacking one failure, when cav_spec_settle_notes is called.
void cav_spec_leave(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *text);
void cav_spec_lack(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *text);
void cav_spec_settle_notes(cav_spec *spec);

/// Warns of text between tags, where there is any.
void cav_spec_warn_of_prose(cav_spec *spec);

/// Notes that there is no object of that kind and name, and which is near.
void cav_spec_unknown(cav_spec *spec, const cav_xml_node *node, const char *attribute, const char *kind,
                      const char *name, const void *first, int n, size_t stride);

/// Checks that fail with the element's line: a number >= 0; solref (where: limit, friction or nothing);
/// condim.
void cav_check_not_negative(cav_spec *spec, const cav_xml_node *node, const char *attribute, double value);
void cav_check_softness(cav_spec *spec, const cav_xml_node *node, const char *where, const cav_softness *softness);
void cav_check_condim(cav_spec *spec, const cav_xml_node *node, int condim);

/// Index of a named object among n, at a stride of bytes whose first member is the name; -1 if there is none. spec.c.
int cav_name_find(const void *first, int n, size_t stride, const char *name);

/// 1 if a geom's mass counts in that of its body. spec.c.
int cav_geom_weighs(const cav_spec *spec, const cav_spec_geom *geom);

/// Lets go of the lists.
void cav_spec_clear(cav_spec *spec);

/// Root of the grammar of MJCF, and the same element where a URDF file has one: options only. schema.c.
extern const cav_xml_element cav_mjcf_root, cav_mjcf_extension, cav_replicate_element;
extern const cav_xml_element *const cav_frame_element;

/// Fills spec from a checked tree. mjcf.c.
void cav_mjcf_read(cav_spec *spec, cav_xml *xml);

/// Adds the scene's objects that stand in the world, with what the world has of its own; then its bodies, after all
/// others. mjcf.c.
void cav_scene_objects(cav_spec *spec);
void cav_scene_bodies(cav_spec *spec);

/// What MJCF sets before a file says anything, and what a file's compiler and option elements say. mjcf.c.
void cav_mjcf_first_options(cav_spec *spec);
void cav_mjcf_read_options(cav_spec *spec, const cav_xml_node *node);
void cav_mjcf_default_joint(cav_spec_joint *joint);
void cav_mjcf_default_geom(cav_spec_geom *geom);

/// Mesh and hfield elements of MJCF into the lists of a spec; a mesh by path and scale, once: its index. asset.c.
void cav_read_mesh(cav_spec *spec, const cav_xml_node *node, const double scale[3], cav_mesh_inertia inertia,
                   int hull_vertices);
void cav_read_hfield(cav_spec *spec, const cav_xml_node *node);
int cav_add_mesh(cav_spec *spec, const cav_xml_node *node, const char *path, const double scale[3]);

/// Loads the meshes and height fields that geoms use, and moves those geoms to their frames. asset.c.
void cav_spec_assets(cav_spec *spec);

/// Copies them to base (16-byte aligned) and sets them in the model; base NULL: only counts. Returns the bytes.
/// asset.c.
size_t cav_put_assets(const cav_spec *spec, void *base, cav_model *model);
void cav_clear_assets(cav_spec *spec);

/// Root of the grammar of URDF; fills spec from a checked tree of it. urdf.c.
extern const cav_xml_element cav_urdf_root;
void cav_urdf_read(cav_spec *spec, const cav_xml *xml);

/// The SRDF file beside a URDF file, where there is one, once all bodies and joints are read. srdf.c.
void cav_srdf_read(cav_spec *spec);

/// Orientation of an element, by whichever attribute gives it; quat stays where none does. orientation.c.
void cav_read_orientation(cav_spec *spec, const cav_xml_node *node, double quat[4]);

/// Pose midway between two points [6], z along their line; returns half their distance. orientation.c.
double cav_pose_of_fromto(const double *fromto, double pos[3], double quat[4]);

/// Values of an actuator element, of a class or of its own, over those it starts from. actuator.c.
void cav_actuator_read_values(const cav_xml_node *node, cav_spec_actuator *actuator);

/// The whole element: values, name, transmission. Then everything but name and the three limits. actuator.c.
void cav_actuator_read(cav_spec *spec, const cav_xml_node *node, cav_spec_actuator *actuator);
void cav_actuator_compile(cav_spec *spec, const cav_spec_actuator *s, cav_actuator *actuator);

/// What actuators take from the joints and tendons they act on, once all are read: ranges of control, limits of effort,
/// armature and damping. actuator.c.
void cav_actuators_settle(cav_spec *spec);

#endif
