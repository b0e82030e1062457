/// The grammar of MJCF: which elements and attributes a model file may have, and of what type.
///
/// Names and counts are those that MuJoCo 3.14 takes, and those of 2.2.2 that it no longer does. What is only seen or
/// tunes a solver (visual, asset textures, camera, light, statistic, size, custom, extension) is accepted unread. What
/// has an effect but is not offered is in the table too: the readers name it with its line, all of it in one run.

#include "remove.h"
#include "spec.h"

#define TEXT(name) \
  { name, CAV_XML_TEXT, 0, 0, NULL, 0, NULL }
#define NAMED(name) \
  { name, CAV_XML_TEXT, 1, 0, NULL, 0, NULL }
#define NEEDED(name) \
  { name, CAV_XML_TEXT, 1, 0, NULL, 1, NULL }
#define INT(name) \
  { name, CAV_XML_INT, 1, 1, NULL, 0, NULL }
#define INTS(name, n) \
  { name, CAV_XML_INT, n, n, NULL, 0, NULL }
#define INTS_ANY(name) \
  { name, CAV_XML_INT, 0, 0, NULL, 0, NULL }
#define REAL(name) \
  { name, CAV_XML_REAL, 1, 1, NULL, 0, NULL }
#define REALS(name, least, most) \
  { name, CAV_XML_REAL, least, most, NULL, 0, NULL }
#define WORD(name, words) \
  { name, CAV_XML_WORD, 0, 0, words, 0, NULL }
#define BOOL(name) \
  { name, CAV_XML_BOOL, 0, 0, NULL, 0, NULL }
#define SKIP(name) \
  { name, CAV_XML_SKIP, 0, 0, NULL, 0, NULL }
#define END \
  { NULL, CAV_XML_SKIP, 0, 0, NULL, 0, NULL }

// words by the enumerations that mjcf.c casts them to
static const char *const truth[] = {
    [CAV_LIMITED_NO] = "false", [CAV_LIMITED_YES] = "true", [CAV_LIMITED_AUTO] = "auto", NULL};
static const char *const onoff[] = {"disable", "enable", NULL};
static const char *const angles[] = {"radian", "degree", NULL};
static const char *const coordinates[] = {"local", "global", NULL};
static const char *const collisions[] = {
    [CAV_COLLISION_ALL] = "all", [CAV_COLLISION_PAIRS] = "predefined", [CAV_COLLISION_GEOMS] = "dynamic", NULL};
static const char *const cones[] = {"elliptic", "pyramidal", NULL};
static const char *const integrators[] = {"Euler", "RK4", "implicit", "implicitfast", NULL};
static const char *const aligns[] = {"false", "true", "auto", NULL};
static const char *const mesh_inertias[] = {[CAV_MESH_LEGACY] = "legacy",
                                            [CAV_MESH_EXACT] = "exact",
                                            [CAV_MESH_CONVEX] = "convex",
                                            [CAV_MESH_SHELL] = "shell",
                                            NULL};
static const char *const joints[] = {[CAV_JOINT_FREE] = "free",
                                     [CAV_JOINT_BALL] = "ball",
                                     [CAV_JOINT_SLIDE] = "slide",
                                     [CAV_JOINT_HINGE] = "hinge",
                                     NULL};
static const char *const geoms[CAV_GEOM_TYPES + 1] = {
    [CAV_GEOM_PLANE] = "plane",         [CAV_GEOM_SPHERE] = "sphere",     [CAV_GEOM_CAPSULE] = "capsule",
    [CAV_GEOM_ELLIPSOID] = "ellipsoid", [CAV_GEOM_CYLINDER] = "cylinder", [CAV_GEOM_BOX] = "box",
    [CAV_GEOM_MESH] = "mesh",           [CAV_GEOM_HFIELD] = "hfield"};
static const char *const shapes[] = {"none", "ellipsoid", NULL};
static const char *const objects[] = {"body", "xbody", "geom", "site", "camera", NULL};
static const char *const dyntypes[] = {"none",        "integrator", "filter",  "muscle",
                                       "filterexact", "user",       "dcmotor", NULL};
static const char *const gaintypes[] = {"fixed", "affine", "muscle", "user", "dcmotor", NULL};
static const char *const biastypes[] = {"none", "affine", "muscle", "user", "dcmotor", NULL};

// --- attributes shared by defaults and objects ---

#define ORIENTATION \
  REALS("quat", 4, 4), REALS("axisangle", 4, 4), REALS("xyaxes", 6, 6), REALS("zaxis", 3, 3), REALS("euler", 3, 3)

#define EFFORT WORD("actuatorfrclimited", truth), REALS("actuatorfrcrange", 2, 2)

#define JOINT                                                                                                \
  WORD("type", joints), SKIP("group"), REALS("pos", 3, 3), REALS("axis", 3, 3), REALS("springdamper", 2, 2), \
      WORD("limited", truth), REALS("twistrange", 2, 2), REAL("swingrange"), REALS("solreflimit", 1, 2),     \
      REALS("solimplimit", 1, 5), REALS("solreffriction", 1, 2), REALS("solimpfriction", 1, 5),              \
      REALS("stiffness", 1, 3), REALS("range", 2, 2), REAL("margin"), REAL("ref"), REAL("springref"),        \
      REAL("armature"), REALS("damping", 1, 3), REAL("frictionloss"), SKIP("user"), EFFORT, BOOL("actuatorgravcomp")

#define GEOM                                                                                                       \
  WORD("type", geoms), REALS("pos", 3, 3), ORIENTATION, INT("contype"), INT("conaffinity"), INT("condim"),         \
      INT("group"), INT("priority"), REALS("size", 1, 3), TEXT("material"), REALS("friction", 1, 3), REAL("mass"), \
      REAL("density"), BOOL("shellinertia"), REAL("solmix"), REALS("solref", 1, 2), REALS("solimp", 1, 5),         \
      REAL("margin"), SKIP("gap"), REALS("fromto", 6, 6), NAMED("hfield"), NAMED("mesh"), REAL("fitscale"),        \
      REALS("rgba", 4, 4), WORD("fluidshape", shapes), REALS("fluidcoef", 1, 5), SKIP("user"), REAL("adhesion"),   \
      REALS("surfacevel", 1, 6)

#define SITE                                                                                                  \
  WORD("type", geoms), SKIP("group"), REALS("pos", 3, 3), ORIENTATION, SKIP("material"), REALS("size", 1, 3), \
      REALS("fromto", 6, 6), SKIP("rgba"), SKIP("user"), SKIP("mesh")

#define PAIR                                                                                                         \
  INT("condim"), REALS("friction", 1, 5), REALS("solref", 1, 2), REALS("solimp", 1, 5), SKIP("gap"), REAL("margin"), \
      REALS("solreffriction", 1, 2), REAL("adhesion")

#define EQUALITY BOOL("active"), REALS("solref", 1, 2), REALS("solimp", 1, 5)

#define TENDON                                                                                                         \
  SKIP("group"), WORD("limited", truth), REALS("range", 2, 2), REALS("solreflimit", 1, 2), REALS("solimplimit", 1, 5), \
      REALS("solreffriction", 1, 2), REALS("solimpfriction", 1, 5), REAL("frictionloss"), REALS("springlength", 1, 2), \
      SKIP("width"), SKIP("material"), REAL("margin"), REALS("stiffness", 1, 3), REALS("damping", 1, 3), SKIP("rgba"), \
      SKIP("user"), EFFORT, REAL("armature")

#define ACTUATOR                                                                                                      \
  WORD("ctrllimited", truth), WORD("forcelimited", truth), REALS("ctrlrange", 2, 2), REALS("forcerange", 2, 2),       \
      REALS("gear", 1, 6), REAL("cranklength"), SKIP("user"), INT("group"), REAL("armature"), REALS("damping", 1, 3), \
      REAL("delay"), SKIP("nsample"), SKIP("interp")

#define ACTRANGE WORD("actlimited", truth), REALS("actrange", 2, 2)

#define GENERAL                                                                                                  \
  ACTRANGE, WORD("dyntype", dyntypes), WORD("gaintype", gaintypes), WORD("biastype", biastypes),                 \
      REALS("dynprm", 1, 10), REALS("gainprm", 1, 10), REALS("biasprm", 1, 10), INT("actdim"), SKIP("actearly"), \
      SKIP("velrange"), SKIP("ffrange")

#define SERVO REAL("kp"), REAL("kv"), REAL("dampratio"), REAL("inheritrange")

#define CYLINDER REAL("timeconst"), REAL("area"), REAL("diameter"), REALS("bias", 3, 3)

#define MUSCLE                                                                                                   \
  REALS("timeconst", 2, 2), REAL("tausmooth"), REALS("range", 2, 2), REAL("force"), REAL("scale"), REAL("lmin"), \
      REAL("lmax"), REAL("vmax"), REAL("fpmax"), REAL("fvmax")

#define TRANSMISSION                                                                                                 \
  TEXT("name"), NAMED("class"), REALS("lengthrange", 2, 2), NAMED("joint"), NAMED("jointinparent"), NAMED("tendon"), \
      NAMED("slidersite"), NAMED("cranksite"), NAMED("site"), NAMED("refsite"), NAMED("body")

// --- elements without children, or with children of no interest ---

static const cav_xml_attribute include_attributes[] = {NEEDED("file"), END};
static const cav_xml_element include = {"include", 0, 0, include_attributes, NULL, CAV_XML_INCLUDE, NULL};

#define LEAF(id, name, ...)                                              \
  static const cav_xml_attribute id##_attributes[] = {__VA_ARGS__, END}; \
  static const cav_xml_element id = {name, 0, 0, id##_attributes, NULL, 0, NULL}

#define UNREAD(id, name) static const cav_xml_element id = {name, 0, 0, NULL, NULL, CAV_XML_ANYTHING, NULL}

UNREAD(size, "size");
UNREAD(visual, "visual");
UNREAD(statistic, "statistic");
UNREAD(custom, "custom");
UNREAD(lengthrange, "lengthrange");
UNREAD(texture, "texture");
UNREAD(skin, "skin");
UNREAD(camera, "camera");
UNREAD(light, "light");
UNREAD(composite, "composite");
UNREAD(flexcomp, "flexcomp");
UNREAD(plugin, "plugin");
UNREAD(flex, "flex");
UNREAD(layer, "layer");
UNREAD(extension, "extension");

static const cav_xml_attribute compiler_attributes[] = {BOOL("autolimits"),
                                                        REAL("boundmass"),
                                                        REAL("boundinertia"),
                                                        REAL("settotalmass"),
                                                        BOOL("balanceinertia"),
                                                        BOOL("strippath"),
                                                        WORD("coordinate", coordinates),
                                                        WORD("angle", angles),
                                                        BOOL("fitaabb"),
                                                        NAMED("eulerseq"),
                                                        TEXT("meshdir"),
                                                        SKIP("texturedir"),
                                                        TEXT("assetdir"),
                                                        BOOL("discardvisual"),
                                                        SKIP("convexhull"),
                                                        SKIP("usethread"),
                                                        BOOL("fusestatic"),
                                                        WORD("inertiafromgeom", truth),
                                                        INTS("inertiagrouprange", 2),
                                                        BOOL("exactmeshinertia"),
                                                        SKIP("saveinertial"),
                                                        BOOL("alignfree"),
                                                        SKIP("conflict"),
                                                        END};
static const cav_xml_element *const compiler_children[] = {&lengthrange, &include, NULL};
static const cav_xml_element compiler = {"compiler", 0, 0, compiler_attributes, compiler_children, 0, NULL};

LEAF(flag, "flag", WORD("constraint", onoff), WORD("equality", onoff), WORD("frictionloss", onoff),
     WORD("limit", onoff), WORD("contact", onoff), WORD("passive", onoff), WORD("gravity", onoff),
     WORD("clampctrl", onoff), SKIP("warmstart"), WORD("filterparent", onoff), WORD("actuation", onoff),
     WORD("refsafe", onoff), SKIP("sensor"), WORD("override", onoff), SKIP("energy"), SKIP("fwdinv"),
     SKIP("sensornoise"), SKIP("multiccd"), WORD("spring", onoff), WORD("damper", onoff), SKIP("midphase"),
     SKIP("nativeccd"), SKIP("island"), WORD("eulerdamp", onoff), SKIP("autoreset"), SKIP("invdiscrete"), SKIP("sleep"),
     SKIP("diagexact"), WORD("ipc", onoff));
static const cav_xml_attribute option_attributes[] = {REAL("timestep"),
                                                      SKIP("apirate"),
                                                      REAL("impratio"),
                                                      SKIP("tolerance"),
                                                      SKIP("noslip_tolerance"),
                                                      SKIP("mpr_tolerance"),
                                                      REALS("gravity", 3, 3),
                                                      REALS("wind", 3, 3),
                                                      REALS("magnetic", 3, 3),
                                                      REAL("density"),
                                                      REAL("viscosity"),
                                                      REAL("o_margin"),
                                                      REALS("o_solref", 1, 2),
                                                      REALS("o_solimp", 1, 5),
                                                      REALS("o_friction", 1, 5),
                                                      WORD("integrator", integrators),
                                                      WORD("collision", collisions),
                                                      WORD("cone", cones),
                                                      SKIP("jacobian"),
                                                      SKIP("solver"),
                                                      SKIP("iterations"),
                                                      INT("noslip_iterations"),
                                                      SKIP("mpr_iterations"),
                                                      SKIP("ls_iterations"),
                                                      SKIP("ls_tolerance"),
                                                      SKIP("ccd_iterations"),
                                                      SKIP("ccd_tolerance"),
                                                      SKIP("sdf_iterations"),
                                                      SKIP("sdf_initpoints"),
                                                      SKIP("sleep_tolerance"),
                                                      INTS_ANY("actuatorgroupdisable"),
                                                      END};
static const cav_xml_element *const option_children[] = {&flag, &include, NULL};
static const cav_xml_element option = {"option", 0, 0, option_attributes, option_children, 0, NULL};

// --- defaults ---

#define MATERIAL                                                                                                 \
  SKIP("texture"), SKIP("texrepeat"), SKIP("texuniform"), SKIP("emission"), SKIP("specular"), SKIP("shininess"), \
      SKIP("reflectance"), SKIP("metallic"), SKIP("roughness"), REALS("rgba", 4, 4)
static const cav_xml_element *const material_children[] = {&layer, &include, NULL};
LEAF(default_mesh, "mesh", REALS("scale", 3, 3), INT("maxhullvert"), WORD("inertia", mesh_inertias));
static const cav_xml_attribute default_material_attributes[] = {MATERIAL, END};
static const cav_xml_element default_material = {"material",        0, 0,   default_material_attributes,
                                                 material_children, 0, NULL};
LEAF(default_joint, "joint", JOINT);
LEAF(default_geom, "geom", GEOM);
LEAF(default_site, "site", SITE);
LEAF(default_pair, "pair", PAIR);
LEAF(default_equality, "equality", EQUALITY);
LEAF(default_tendon, "tendon", TENDON);
LEAF(default_general, "general", ACTUATOR, GENERAL);
LEAF(default_motor, "motor", ACTUATOR);
LEAF(default_position, "position", ACTUATOR, SERVO, REAL("timeconst"));
LEAF(default_velocity, "velocity", ACTUATOR, REAL("kv"));
LEAF(default_intvelocity, "intvelocity", ACTUATOR, ACTRANGE, SERVO);
LEAF(default_damper, "damper", ACTUATOR, REAL("kv"));
LEAF(default_cylinder, "cylinder", ACTUATOR, CYLINDER);
LEAF(default_muscle, "muscle", ACTUATOR, MUSCLE);
UNREAD(adhesion, "adhesion");
UNREAD(dcmotor, "dcmotor");
UNREAD(pid, "pid");
UNREAD(orientation, "orientation");

static const cav_xml_attribute default_attributes[] = {NAMED("class"), END};
static const cav_xml_element defaults;
static const cav_xml_element *const default_children[] = {&default_mesh,
                                                          &default_material,
                                                          &default_joint,
                                                          &default_geom,
                                                          &default_site,
                                                          &default_pair,
                                                          &default_equality,
                                                          &default_tendon,
                                                          &default_general,
                                                          &default_motor,
                                                          &default_position,
                                                          &default_velocity,
                                                          &default_damper,
                                                          &default_cylinder,
                                                          &default_muscle,
                                                          &adhesion,
                                                          &dcmotor,
                                                          &pid,
                                                          &orientation,
                                                          &default_intvelocity,
                                                          &camera,
                                                          &light,
                                                          &defaults,
                                                          &include,
                                                          NULL};
static const cav_xml_element defaults = {"default", 0, 0, default_attributes, default_children, 0, NULL};

// --- assets ---

static const cav_xml_attribute material_attributes[] = {NEEDED("name"), NAMED("class"), MATERIAL, END};
static const cav_xml_element material = {"material", 0, 0, material_attributes, material_children, 0, NULL};
static const cav_xml_attribute mesh_attributes[] = {TEXT("name"),
                                                    NAMED("class"),
                                                    NAMED("file"),
                                                    SKIP("content_type"),
                                                    SKIP("material"),
                                                    REALS("scale", 3, 3),
                                                    REALS("refpos", 3, 3),
                                                    REALS("refquat", 4, 4),
                                                    REALS("vertex", 0, 0),
                                                    REALS("face", 0, 0),
                                                    SKIP("normal"),
                                                    SKIP("texcoord"),
                                                    SKIP("smoothnormal"),
                                                    INT("maxhullvert"),
                                                    WORD("inertia", mesh_inertias),
                                                    TEXT("builtin"),
                                                    SKIP("params"),
                                                    SKIP("octree_maxdepth"),
                                                    END};
static const cav_xml_element *const mesh_children[] = {&plugin, &include, NULL};
static const cav_xml_element mesh = {"mesh", 0, 0, mesh_attributes, mesh_children, 0, NULL};
LEAF(hfield, "hfield", TEXT("name"), NAMED("file"), SKIP("content_type"), INT("nrow"), INT("ncol"),
     REALS("elevation", 0, 0), {"size", CAV_XML_REAL, 4, 4, NULL, 1, NULL});
LEAF(model_asset, "model", TEXT("name"), NEEDED("file"), SKIP("content_type"));
static const cav_xml_element *const asset_children[] = {&texture,  &hfield,      &mesh,    &skin,
                                                        &material, &model_asset, &include, NULL};
static const cav_xml_element asset = {"asset", 0, 0, NULL, asset_children, 0, NULL};

// --- bodies ---

static const cav_xml_attribute inertial_attributes[] = {{"pos", CAV_XML_REAL, 3, 3, NULL, 1, NULL},
                                                        ORIENTATION,
                                                        {"mass", CAV_XML_REAL, 1, 1, NULL, 1, NULL},
                                                        REALS("diaginertia", 3, 3),
                                                        REALS("fullinertia", 6, 6),
                                                        END};
static const cav_xml_element inertial = {"inertial", 0, 1, inertial_attributes, NULL, 0, NULL};
LEAF(joint, "joint", TEXT("name"), NAMED("class"), JOINT);
LEAF(freejoint, "freejoint", TEXT("name"), SKIP("group"), WORD("align", aligns));
static const cav_xml_attribute geom_attributes[] = {TEXT("name"), NAMED("class"), GEOM, END};
static const cav_xml_element *const geom_children[] = {&plugin, &include, NULL};
static const cav_xml_element geom = {"geom", 0, 0, geom_attributes, geom_children, 0, NULL};
LEAF(attach, "attach", NEEDED("model"), NAMED("body"), TEXT("prefix"), NAMED("frame"));
LEAF(site, "site", TEXT("name"), NAMED("class"), SITE);
static const cav_xml_attribute frame_attributes[] = {TEXT("name"), NAMED("childclass"), REALS("pos", 3, 3), ORIENTATION,
                                                     END};
static const cav_xml_attribute body_attributes[] = {TEXT("name"), NAMED("childclass"), REALS("pos", 3, 3),
                                                    ORIENTATION,  BOOL("mocap"),       REAL("gravcomp"),
                                                    SKIP("user"), SKIP("sleep"),       END};
static const cav_xml_element body, frame;
#define WORLD_CHILDREN                                                                                           \
  &geom, &site, &camera, &light, &composite, &flexcomp, &plugin, &frame, &cav_replicate_element, &attach, &body, \
      &include
static const cav_xml_element *const body_children[] = {&inertial, &joint, &freejoint, WORLD_CHILDREN, NULL};
static const cav_xml_element *const frame_children[] = {&inertial, &joint, &freejoint, WORLD_CHILDREN, NULL};
static const cav_xml_attribute replicate_attributes[] = {{"count", CAV_XML_INT, 1, 1, NULL, 1, NULL},
                                                         REALS("offset", 3, 3),
                                                         REALS("euler", 3, 3),
                                                         TEXT("sep"),
                                                         NAMED("childclass"),
                                                         END};
const cav_xml_element cav_replicate_element = {"replicate", 0, 0, replicate_attributes, frame_children, 0, NULL};
static const cav_xml_element *const world_children[] = {WORLD_CHILDREN, NULL};
static const cav_xml_element frame = {"frame", 0, 0, frame_attributes, frame_children, 0, NULL};
const cav_xml_element *const cav_frame_element = &frame;
static const cav_xml_element body = {"body", 0, 0, body_attributes, body_children, 0, NULL};
static const cav_xml_attribute world_attributes[] = {TEXT("name"),     NAMED("childclass"), SKIP("pos"), SKIP("quat"),
                                                     SKIP("gravcomp"), SKIP("user"),        END};
static const cav_xml_element worldbody = {"worldbody", 0, 0, world_attributes, world_children, 0, NULL};
static const cav_xml_element *const scene_children[] = {WORLD_CHILDREN, &cav_remove_element, NULL};
const cav_xml_element cav_scene_element = {
    "scene",
    0,
    1,
    NULL,
    scene_children,
    0,
    "bodies and geoms that are added to the world of the model, as MJCF's worldbody has them, angles in degrees"};

// --- contact, equality, tendon ---

LEAF(pair, "pair", TEXT("name"), NAMED("class"), NEEDED("geom1"), NEEDED("geom2"), PAIR);
LEAF(exclude, "exclude", TEXT("name"), NEEDED("body1"), NEEDED("body2"));
static const cav_xml_element *const contact_children[] = {&pair, &exclude, &include, NULL};
static const cav_xml_element contact = {"contact", 0, 0, NULL, contact_children, 0, NULL};

LEAF(connect, "connect", TEXT("name"), NAMED("class"), EQUALITY, NAMED("body1"), NAMED("body2"), NAMED("site1"),
     NAMED("site2"), REALS("anchor", 3, 3));
LEAF(weld, "weld", TEXT("name"), NAMED("class"), EQUALITY, NAMED("body1"), NAMED("body2"), NAMED("site1"),
     NAMED("site2"), REALS("relpose", 7, 7), REALS("anchor", 3, 3), REAL("torquescale"));
UNREAD(flex_equality, "flex");
UNREAD(flexvert_equality, "flexvert");
UNREAD(flexstrain_equality, "flexstrain");
LEAF(equality_joint, "joint", TEXT("name"), NAMED("class"), EQUALITY, NEEDED("joint1"), NAMED("joint2"),
     REALS("polycoef", 1, 5));
LEAF(equality_tendon, "tendon", TEXT("name"), NAMED("class"), EQUALITY, NEEDED("tendon1"), NAMED("tendon2"),
     REALS("polycoef", 1, 5));
LEAF(equality_distance, "distance", TEXT("name"), NAMED("class"), EQUALITY, NEEDED("geom1"), NEEDED("geom2"),
     REAL("distance"));
static const cav_xml_element *const equality_children[] = {&connect,           &weld,
                                                           &equality_joint,    &equality_tendon,
                                                           &equality_distance, &flex_equality,
                                                           &flexvert_equality, &flexstrain_equality,
                                                           &include,           NULL};
static const cav_xml_element *const deformable_children[] = {&flex, &skin, &include, NULL};
static const cav_xml_element deformable = {"deformable", 0, 0, NULL, deformable_children, 0, NULL};
static const cav_xml_element equality = {"equality", 0, 0, NULL, equality_children, 0, NULL};

static const cav_xml_attribute part_attributes[] = {NEEDED("joint"), {"coef", CAV_XML_REAL, 1, 1, NULL, 1, NULL}, END};
static const cav_xml_element part = {"joint", 1, 0, part_attributes, NULL, 0, NULL};
static const cav_xml_attribute tendon_attributes[] = {TEXT("name"), NAMED("class"), TENDON, END};
static const cav_xml_element *const fixed_children[] = {&part, &include, NULL};
static const cav_xml_element fixed = {"fixed", 0, 0, tendon_attributes, fixed_children, 0, NULL};
LEAF(via_site, "site", NEEDED("site"));
LEAF(via_geom, "geom", NEEDED("geom"), NAMED("sidesite"));
LEAF(pulley, "pulley", {"divisor", CAV_XML_REAL, 1, 1, NULL, 1, NULL});
static const cav_xml_element *const spatial_children[] = {&via_site, &via_geom, &pulley, &include, NULL};
static const cav_xml_element spatial = {"spatial", 0, 0, tendon_attributes, spatial_children, 0, NULL};
static const cav_xml_element *const tendon_children[] = {&fixed, &spatial, &include, NULL};
static const cav_xml_element tendon = {"tendon", 0, 0, NULL, tendon_children, 0, NULL};

// --- actuators ---

LEAF(general, "general", TRANSMISSION, ACTUATOR, GENERAL);
LEAF(motor, "motor", TRANSMISSION, ACTUATOR);
LEAF(position, "position", TRANSMISSION, ACTUATOR, SERVO, REAL("timeconst"));
LEAF(velocity, "velocity", TRANSMISSION, ACTUATOR, REAL("kv"));
LEAF(intvelocity, "intvelocity", TRANSMISSION, ACTUATOR, ACTRANGE, SERVO);
LEAF(damper, "damper", TRANSMISSION, ACTUATOR, REAL("kv"));
LEAF(cylinder, "cylinder", TRANSMISSION, ACTUATOR, CYLINDER);
LEAF(muscle, "muscle", TRANSMISSION, ACTUATOR, MUSCLE);
static const cav_xml_element *const actuator_children[] = {&general, &motor,    &position,    &velocity, &intvelocity,
                                                           &damper,  &cylinder, &muscle,      &plugin,   &adhesion,
                                                           &dcmotor, &pid,      &orientation, &include,  NULL};
static const cav_xml_element actuator = {"actuator", 0, 0, NULL, actuator_children, 0, NULL};

// --- sensors ---

#define READING \
  REAL("cutoff"), SKIP("noise"), SKIP("user"), SKIP("delay"), SKIP("nsample"), SKIP("interp"), SKIP("interval")
static const cav_xml_attribute of_joint[] = {TEXT("name"), NEEDED("joint"), READING, END};
static const cav_xml_attribute of_body[] = {TEXT("name"), NEEDED("body"), READING, END};
static const cav_xml_attribute of_site[] = {TEXT("name"), NAMED("site"), SKIP("camera"), SKIP("data"), READING, END};
static const cav_xml_attribute of_tendon[] = {TEXT("name"), NEEDED("tendon"), READING, END};
static const cav_xml_attribute of_actuator[] = {TEXT("name"), NEEDED("actuator"), READING, END};
static const cav_xml_attribute of_nothing[] = {TEXT("name"), READING, END};
static const cav_xml_attribute place_attributes[] = {
    TEXT("name"), {"objtype", CAV_XML_WORD, 0, 0, objects, 1, NULL}, NEEDED("objname"), READING, END};
static const cav_xml_attribute referred_attributes[] = {TEXT("name"),
                                                        {"objtype", CAV_XML_WORD, 0, 0, objects, 1, NULL},
                                                        NEEDED("objname"),
                                                        WORD("reftype", objects),
                                                        NAMED("refname"),
                                                        READING,
                                                        END};
#define UNREAD_SENSORS(X) \
  X(user)                 \
  X(plugin)               \
  X(camprojection)        \
  X(insidesite) X(distance) X(normal) X(fromto) X(contact) X(tactile) X(tendonactuatorfrc) X(e_potential) X(e_kinetic)
#define UNREAD_SENSOR(name) UNREAD(sensor_##name, #name);
UNREAD_SENSORS(UNREAD_SENSOR)

// attributes by what a sensor looks at; frames, by what it reads
#define OF_NONE(reads) of_nothing
#define OF_BODY(reads) of_body
#define OF_SITE(reads) of_site
#define OF_SURFACE(reads) of_site
#define OF_SCALAR_JOINT(reads) of_joint
#define OF_BALL_JOINT(reads) of_joint
#define OF_LIMITED_JOINT(reads) of_joint
#define OF_TENDON(reads) of_tendon
#define OF_LIMITED_TENDON(reads) of_tendon
#define OF_ACTUATOR(reads) of_actuator
#define OF_FRAME(reads) OF_FRAME_##reads
#define OF_FRAME_POSITION referred_attributes
#define OF_FRAME_VELOCITY referred_attributes
#define OF_FRAME_ACCELERATION place_attributes
#define SENSOR_ELEMENT(type, name, dim, target, reads, text) \
  [CAV_SENSOR_##type] = {name, 0, 0, OF_##target(reads), NULL, 0, NULL},
#define UNREAD_CHILD(name) &sensor_##name,
#define SENSOR_CHILD(type, ...) &sensor_elements[CAV_SENSOR_##type],
static const cav_xml_element sensor_elements[CAV_SENSOR_TYPES] = {CAV_SENSORS(SENSOR_ELEMENT)};
// clang-format off
static const cav_xml_element *const sensor_children[] = {CAV_SENSORS(SENSOR_CHILD) UNREAD_SENSORS(UNREAD_CHILD) &include, NULL};
// clang-format on
static const cav_xml_element sensor = {"sensor", 0, 0, NULL, sensor_children, 0, NULL};

// --- keyframes ---

LEAF(key, "key", TEXT("name"), REAL("time"), REALS("qpos", 0, 0), REALS("qvel", 0, 0), SKIP("act"), SKIP("mpos"),
     SKIP("mquat"), SKIP("ctrl"));
static const cav_xml_element *const keyframe_children[] = {&key, &include, NULL};
static const cav_xml_element keyframe = {"keyframe", 0, 0, NULL, keyframe_children, 0, NULL};

// --- the file ---

static const cav_xml_attribute mujoco_attributes[] = {TEXT("model"), END};
static const cav_xml_element *const mujoco_children[] = {
    &compiler, &option, &size,     &visual, &statistic, &defaults, &custom,     &asset,     &worldbody, &contact,
    &equality, &tendon, &actuator, &sensor, &keyframe,  &include,  &deformable, &extension, NULL};
const cav_xml_element cav_mjcf_root = {"mujoco", 0, 0, mujoco_attributes, mujoco_children, CAV_XML_PROSE, NULL};
static const cav_xml_element *const extension_children[] = {&compiler, &option, &size, NULL};
const cav_xml_element cav_mjcf_extension = {"mujoco", 0, 0, mujoco_attributes, extension_children, 0, NULL};
